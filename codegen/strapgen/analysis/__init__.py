"""Analysis: what an algorithm loses, as power series in the step length."""
