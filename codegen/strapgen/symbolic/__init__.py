"""Mathematics on exact expressions: kernels, rotations, series, polynomials. No optimisation."""
