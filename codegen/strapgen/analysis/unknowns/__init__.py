"""Methods with unknown coefficients: order conditions and their solution."""
