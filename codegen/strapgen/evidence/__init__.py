"""Verification of generated code by external tools: proofs, runs on processors, fuzzing."""
