"""Design of coefficients for a band or a spectrum of motion: filters of windows, and coning coefficients."""
