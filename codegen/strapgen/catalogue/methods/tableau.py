"""`Tableau` is the value type of a Butcher tableau: exact coefficients with a name, a source and an order."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any, ClassVar

from strapgen.catalogue.methods.method_spec import Asked, StepSamples, through_samples
from strapgen.ir.notebook_display import notebook_latex, short_repr

if TYPE_CHECKING:
    from strapgen.catalogue.coefficients import Number


@dataclass(frozen=True)
class Tableau:
    """An explicit Runge-Kutta method in exact numbers.

    Parameters
    ----------
    name, title, source : str
        Name on the command line, name in the literature, citation.
    order : int
        Classical order of the method.
    nodes : tuple of Fraction or sympy.Expr
        c_i, as fractions of the step. Only an irrational number is an expression.
    matrix : tuple of tuple of Fraction or sympy.Expr
        a_ij below the diagonal, the first row empty.
    weights : tuple of Fraction or sympy.Expr
        b_i.
    embedded_weights : tuple of Fraction or sympy.Expr, optional
        Weights of a second method on the same stages.
    tolerance : Fraction
        Largest residual of a condition that the rounding of published coefficients explains; 0 if they are exact.
    file : str
        Path of the file; empty for a tableau of the catalogue.

    Examples
    --------
    >>> from strapgen.catalogue.methods.tableaux import TABLEAUX
    >>> TABLEAUX["rk2"].weights
    (Fraction(1, 2), Fraction(1, 2))
    """

    name: str
    title: str
    source: str
    order: int
    nodes: tuple[Number, ...]
    matrix: tuple[tuple[Number, ...], ...]
    weights: tuple[Number, ...]
    embedded_weights: tuple[Number, ...] | None = None
    tolerance: Fraction = Fraction(0)
    file: str = field(default="", compare=False, repr=False)

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        return f"{self.name}: {self.title}, order {self.order}, {len(self.nodes)} stages"

    @property
    def option(self) -> str:
        """The option that chooses it on the command line."""
        return f"--tableau {shlex.quote(self.file)}" if self.file else f"--method {self.name}"

    kind: ClassVar = "tableau"
    own_samples: ClassVar = None

    @property
    def recipe(self) -> tuple[str, str, tuple[Any, ...]]:
        """Module, function and arguments that make a `Method` of it."""
        return f"{__package__}.runge_kutta", "verified", (self,)

    def select(self, asked: Asked) -> tuple[Tableau, StepSamples]:
        """Return the method for the samples that are asked for, and the samples."""
        return self, through_samples(self.name, asked)

    @property
    def rational(self) -> bool:
        """Whether every coefficient is a fraction."""
        rows = (self.nodes, self.weights, self.embedded_weights or (), *self.matrix)
        return all(isinstance(value, Fraction) for row in rows for value in row)
