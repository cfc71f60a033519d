"""Code generators that are given the same attitude step.

A module a generator. Each has ``version()``, and ``write(case, folder)``, which leaves ``step.inc`` in a folder: C
(or, where ``LANGUAGE`` is "c++", C++) that defines ``step(state, samples, next)`` on arrays of double; `next` may be
`state`.
"""

from __future__ import annotations

from typing import NamedTuple


class Case(NamedTuple):
    """What is to be generated.

    Parameters
    ----------
    algorithm : str
        "euler" or "dcm".
    samples : str
        "increments": two angle increments; "rates": rates at three nodes, times the step length.
    form : str
        How the formulas are given: "staged", slopes of the state as in a textbook, or "transition", the
        step applied to the identity and one product.
    """

    algorithm: str
    samples: str
    form: str = "staged"

    def __str__(self) -> str:
        return f"{self.algorithm}-{self.samples}-{self.form}"


#: Modules of this package by the name of the generator, and the forms in which each is given the step.
GENERATORS = {
    "strapgen": ("ours", ("transition",)),
    "by hand": ("by_hand", ("staged",)),
    "SymPy cse + ccode": ("sympy_ccode", ("staged", "transition")),
    "SymForce": ("symforce_cpp", ("staged", "transition")),
    "CasADi": ("casadi_c", ("staged", "transition")),
    "wrenfold": ("wrenfold_cpp", ("staged", "transition")),
}
