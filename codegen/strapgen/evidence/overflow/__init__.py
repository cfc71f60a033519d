"""Proofs that the C in fixed point cannot overflow: abstract interpretation by Frama-C, and formulas for a solver."""
