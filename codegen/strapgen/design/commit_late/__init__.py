"""The target that prints C which commits an attitude late and answers it now."""
