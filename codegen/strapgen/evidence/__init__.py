"""Evidence by independent tools for what the generated code promises: proofs, runs on processors, fuzzing."""
