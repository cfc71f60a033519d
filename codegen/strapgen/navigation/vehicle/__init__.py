"""Vehicles that move over the earth: their courses, and what gyros and accelerometers measure on them."""
