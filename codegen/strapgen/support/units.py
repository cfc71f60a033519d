"""Units of the field that are no SI units: what users write a quantity in."""

#: A g in m/s^2: standard gravity, by definition.
STANDARD_GRAVITY = 9.80665
