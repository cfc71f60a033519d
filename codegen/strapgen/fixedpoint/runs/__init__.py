"""How the errors of one call add up over the steps of a run."""
