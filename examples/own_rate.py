"""A motion of your own by its rate alone: a swing that grows faster and slower while the body spins.

`strapgen simulate`, `compare`, `converge`, `series` and the studies take this file as --motion.
"""

import sympy as sp


def rate_expression(t):
    """Return the body rate in rad/s as expressions of the time t in s."""
    swing = sp.Rational(1, 5) * sp.sin(3 * t + sp.cos(t))
    return [swing, sp.pi / 18 / (1 + t**2 / 100), sp.Rational(3, 10) * sp.cos(2 * t)]
