"""Analysis of the errors of an algorithm, as power series in the step length."""
