"""Butcher tableaux with unknown coefficients: their order conditions, and the families of methods that satisfy them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar

import sympy as sp

from strapgen.analysis.unknowns import elimination
from strapgen.analysis.unknowns.elimination import Equation, Family, PolynomialSolution
from strapgen.catalogue.methods import coefficient_files, tableaux
from strapgen.catalogue.methods.coefficient_files import Source, Title
from strapgen.catalogue.methods.order_conditions import Stages, symmetry, trees, weight_text, word_text, words
from strapgen.catalogue.methods.tableaux import Tableau
from strapgen.catalogue.toml_models import Key, UserFile, parse, refused
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import notebook_latex, short_repr
from strapgen.kernel import reading
from strapgen.kernel.power_series import field

#: Highest order for which conditions with unknowns are solved, and most stages.
MOST_ORDER, MOST_STAGES = 6, 8
#: The equations for which a method has an order: any, and x' = A(t) x.
EQUATIONS = ("general", "attitude")


@dataclass(frozen=True)
class UnknownTableau:
    """An explicit Runge-Kutta method whose coefficients hold unknowns.

    Parameters
    ----------
    name, title, source : str
        Name on the command line, name in the literature, citation.
    order : int
        The order that it is to have.
    unknowns : tuple of str
        Where there is a choice, the last ones are expressed by the first ones.
    nodes : tuple of Expr
    matrix : tuple of tuple of Expr
        Below the diagonal, the first row empty.
    weights : tuple of Expr

    Examples
    --------
    >>> from strapgen import unknowns
    >>> tableau = unknowns.read_tableau("examples/heun3.toml")
    >>> tableau.order, tableau.unknowns[:3]
    (3, ('c2', 'c3', 'a31'))
    """

    name: str
    title: str
    source: str
    order: int
    unknowns: tuple[str, ...]
    nodes: tuple[sp.Expr, ...]
    matrix: tuple[tuple[sp.Expr, ...], ...]
    weights: tuple[sp.Expr, ...]

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        stages = f"{len(self.nodes)} stages, order {self.order}"
        return f"{self.name}: {self.title}\n{stages}; unknowns {', '.join(self.unknowns)}"

    @cached_property
    def stages(self) -> Stages:
        """The coefficients as polynomials in the unknowns, or as quotients of such."""
        rows = [self.nodes, self.weights, *self.matrix]
        domain = field([value for row in rows for value in row], self.unknowns)
        return Stages(
            [[domain.from_sympy(value) for value in row] for row in rows],
            lambda value: domain.from_sympy(sp.Rational(value.numerator, value.denominator)),
            domain.to_sympy,
        )

    def conditions(self, equations: str = "general", order: int | None = None) -> list[Equation]:
        """Return the conditions of an order and of all below it, row sums first.

        Parameters
        ----------
        equations : str, optional
            "general" for any differential equation, "attitude" for x' = A(t) x.
        order : int, optional
            By default that of the tableau.

        Returns
        -------
        list of Equation
            Those that hold whatever the unknowns are are left out.
        """
        checks.choice("equations", equations, EQUATIONS)
        stages, stated = self.stages, []
        for number, defect in enumerate(stages.row_residuals(), 1):
            stated.append((f"row {number}: sum a_{number}j = c_{number}", 1, defect))
        for p in range(1, (order or self.order) + 1):
            if equations == "general":
                stated += [(weight_text(tree), p, stages.tree_residual(tree)) for tree in trees(p)]
            else:
                stated += [(word_text(word), p, stages.word_residual(word)) for word in words(p)]
        return [Equation(label, p, stages.number(defect)) for label, p, defect in stated if defect]

    def solve(self, equations: str = "general") -> PolynomialSolution:
        """Return the families of methods that have the order.

        Raises
        ------
        InputError
            If the conditions are beyond the limits of `elimination`.
        """
        symbols = [sp.Symbol(name, real=True) for name in self.unknowns]
        return elimination.solve(self.conditions(equations), symbols)

    def leading(self, family: Family) -> list[Equation]:
        """Return the error coefficients (Phi - 1/gamma)/sigma of the next order for a family, without zeros."""
        terms = []
        for tree in trees(self.order + 1):
            value = self.stages.number(self.stages.tree_residual(tree)) / symmetry(tree)
            left = elimination.simple(value.xreplace(family.values))
            if left != 0:
                terms.append(Equation(weight_text(tree), self.order + 1, left))
        return terms

    def member(self, family: Family, parameters: Mapping[str, Any]) -> Tableau:
        """Return the method of a family with these parameters; errors are those of `substitute`."""
        return self.substitute(elimination.member(family, f"tableau {self.title}", parameters))

    def substitute(self, values: Mapping[str, Any]) -> Tableau:
        """Return the tableau with values for all unknowns, its order verified.

        Parameters
        ----------
        values : mapping of str to number, Expr or str

        Raises
        ------
        InputError
            If an unknown has no value, a coefficient is too large or divides by zero, or a condition does not hold.
        """
        chosen = reading.values_of_unknowns(f"tableau {self.title}", self.unknowns, values)
        if left := reading.remaining_unknowns(self.unknowns, chosen):
            raise InputError(f"tableau {self.title}: {', '.join(left)} has no value")

        def known(row: Sequence[sp.Expr]) -> list[str]:
            numbers = [sp.radsimp(sp.expand(value.xreplace(chosen))) for value in row]
            if any(number.has(sp.zoo, sp.nan) for number in numbers):
                raise InputError(f"tableau {self.title} divides by zero with these values")
            return [str(number) for number in numbers]

        data = {
            "name": self.title,
            "source": self.source,
            "order": self.order,
            "nodes": known(self.nodes),
            "matrix": [known(row) for row in self.matrix],
            "weights": known(self.weights),
        }
        return tableaux.verified(parse(tableaux.TableauFile, data))


class Coefficient(str):
    """A coefficient as a text with numbers, unknowns, + - * /, whole powers, parentheses and sqrt."""

    __slots__ = ()
    WORDS = 'a whole number, or a text such as "1 - a/2",'
    SCHEMA: ClassVar = {"type": ["integer", "string"]}

    @classmethod
    def from_toml(cls, where: str, value: Any) -> Coefficient:
        """Return the text of an entry."""
        if isinstance(value, bool) or not isinstance(value, int | str):
            raise refused(where, value, cls.WORDS)
        return cls(value)


Row = tuple[Coefficient, ...]
#: Names that an unknown cannot have.
_TAKEN = {*reading.FUNCTIONS, *reading.CONSTANTS, *"IESNOQ", "and", "or", "not", "lambda"}


@dataclass(frozen=True)
class UnknownTableauFile:
    """An explicit Runge-Kutta method whose coefficients hold unknowns; strapgen solves for them."""

    name: Title
    source: Source
    order: Annotated[int, Key("Required order of the method", "1", least=1, most=MOST_ORDER)]
    unknowns: Annotated[
        tuple[str, ...], Key("Names; where there is a choice, the first ones express the last", least=1)
    ]
    nodes: Annotated[Row, Key("c_i, parts of the step", least=1, most=MOST_STAGES)]
    matrix: Annotated[tuple[Row, ...], Key("a_ij left of the diagonal; the first row is empty")]
    weights: Annotated[Row, Key("b_i")]

    def __post_init__(self) -> None:
        tableaux.check_shape(self.nodes, self.matrix, weights=self.weights)
        for name in self.unknowns:
            if not name.isascii() or not name.isidentifier():
                raise InputError(
                    f"unknowns holds {repr(name)[:40]}; names of letters, digits and underscores are needed"
                )
            if name in _TAKEN:
                raise InputError(f"unknowns holds {name}, which means something else; another name is needed")
            if self.unknowns.count(name) > 1:
                raise InputError(f"unknowns holds {name} twice")

    def tableau(self) -> UnknownTableau:
        """Return the tableau in expressions."""
        symbols = {name: sp.Symbol(name, real=True) for name in self.unknowns}

        def numbers(what: str, row: Row) -> tuple[sp.Expr, ...]:
            return tuple(
                reading.expression(f"{what}[{k}]", str(value), symbols, {"sqrt": sp.sqrt})
                for k, value in enumerate(row, 1)
            )

        nodes, weights = numbers("nodes", self.nodes), numbers("weights", self.weights)
        matrix = tuple(numbers(f"matrix[{k}]", row) for k, row in enumerate(self.matrix, 1))
        if nodes[0] != 0:
            raise InputError(f"nodes[1] is {nodes[0]}; the first stage of an explicit method is at 0")
        used = {s.name for row in (nodes, weights, *matrix) for value in row for s in value.free_symbols}
        if idle := [name for name in self.unknowns if name not in used]:
            raise InputError(f"unknowns: no coefficient holds {', '.join(idle)}")
        name = coefficient_files.slug(self.name)
        return UnknownTableau(name, self.name, self.source, self.order, self.unknowns, nodes, matrix, weights)


UNKNOWN_TABLEAU = UserFile("a tableau", UnknownTableauFile, tableaux.TABLEAU.most_bytes)


def has_unknowns(path: str | Path) -> bool:
    """Return whether the file of a tableau declares unknowns."""
    return "unknowns" in UNKNOWN_TABLEAU.content(path)


def read(path: str | Path) -> UnknownTableau:
    """Read a tableau with unknowns from a file.

    Parameters
    ----------
    path : path
        A TOML file with the keys of `UnknownTableauFile`.

    Returns
    -------
    UnknownTableau

    Raises
    ------
    InputError
        If the file cannot be read, or a key or a coefficient is wrong; the message names it.

    Examples
    --------
    >>> from strapgen import unknowns
    >>> unknowns.read_tableau("examples/heun3.toml").unknowns[:3]
    ('c2', 'c3', 'a31')
    """
    return UNKNOWN_TABLEAU.convert(path, UnknownTableauFile.tableau)


def from_data(data: Mapping[str, Any]) -> UnknownTableau:
    """Return the tableau with unknowns of a file's content; errors are those of `read`.

    >>> unknown = from_data({
    ...     "name": "two stages", "source": "this example", "order": 2, "unknowns": ["c", "b"],
    ...     "nodes": ["0", "c"], "matrix": [[], ["c"]], "weights": ["1 - b", "b"],
    ... })
    >>> [family.values for family in unknown.solve().families]
    [{b: 1/(2*c)}]
    >>> unknown.substitute({"c": "2/3", "b": "3/4"}).weights
    (Fraction(1, 4), Fraction(3, 4))
    """
    file: UnknownTableauFile = parse(UnknownTableauFile, data)
    return file.tableau()
