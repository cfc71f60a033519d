"""Design of coefficients for a band or a spectrum of motion; it begins with the filters of windows."""
