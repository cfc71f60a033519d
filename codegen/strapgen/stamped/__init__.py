"""Samples with instants of their own, taken to an even grid."""
