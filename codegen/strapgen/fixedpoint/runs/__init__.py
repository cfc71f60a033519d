"""Accumulation of the errors of single calls over the steps of a run."""
