"""Butcher tableaux of explicit Runge-Kutta methods."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction


def _row(text: str) -> tuple[Fraction, ...]:
    return tuple(Fraction(word) for word in text.split())


@dataclass(frozen=True)
class Tableau:
    """An explicit Runge-Kutta method in exact rationals.

    Parameters
    ----------
    name, title, source : str
        Name on the command line, name in the literature, citation.
    order : int
        Classical order of the method.
    nodes : tuple of Fraction
        c_i, in steps.
    matrix : tuple of tuple of Fraction
        a_ij below the diagonal, the first row empty.
    weights : tuple of Fraction
        b_i.

    Examples
    --------
    >>> TABLEAUX["rk2"].weights
    (Fraction(1, 2), Fraction(1, 2))
    """

    name: str
    title: str
    source: str
    order: int
    nodes: tuple[Fraction, ...]
    matrix: tuple[tuple[Fraction, ...], ...]
    weights: tuple[Fraction, ...]


TABLEAUX = {
    tableau.name: tableau
    for tableau in (
        Tableau("rk1", "Euler's method", "thesis, chapter 3 B", 1, _row("0"), ((),), _row("1")),
        Tableau(
            "rk2", "Heun's method", "thesis, chapter 3 B", 2, _row("0 1"), ((), _row("1")), _row("1/2 1/2")
        ),
        Tableau(
            "rk3",
            "Kutta's third-order method",
            "W. Kutta, Z. Math. Phys. 46 (1901) 435-453",
            3,
            _row("0 1/2 1"),
            ((), _row("1/2"), _row("-1 2")),
            _row("1/6 2/3 1/6"),
        ),
        Tableau(
            "rk4",
            "classical fourth-order Runge-Kutta method",
            "thesis, chapter 3 B",
            4,
            _row("0 1/2 1/2 1"),
            ((), _row("1/2"), _row("0 1/2"), _row("0 0 1")),
            _row("1/6 1/3 1/3 1/6"),
        ),
    )
}
