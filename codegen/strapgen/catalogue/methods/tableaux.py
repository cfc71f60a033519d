"""Butcher tableaux of explicit Runge-Kutta methods, read from files, and their verified order conditions.

`TABLEAUX` are those of the folder `butcher_tableaux`; a user's file is read by `read`.

>>> from strapgen import tableaux
>>> tableaux.verify(tableaux.TABLEAUX["rk4"])
"""

from __future__ import annotations

import shlex
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from strapgen.catalogue import coefficients
from strapgen.catalogue.coefficients import Number, short_text
from strapgen.catalogue.methods import coefficient_files, order_conditions
from strapgen.catalogue.methods.coefficient_files import CoefficientFiles, Source, Title
from strapgen.catalogue.methods.method_spec import RequestedSamples, StepSamples, through_samples
from strapgen.catalogue.toml_models import Key, UserFile
from strapgen.ir import checks
from strapgen.ir.checks import counted, needed
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import notebook_latex, short_repr
from strapgen.registry import Merged, Registry, Titles

if TYPE_CHECKING:
    from strapgen.catalogue.coefficients import Number


#: Highest order and most stages. The number of trees grows nearly threefold from order to order.
MOST_ORDER = 10
MOST_STAGES = 20

Numbers = tuple[Number, ...]


@dataclass(frozen=True)
class TableauFile:
    """An explicit Runge-Kutta method in exact numbers; strapgen verifies its order.

    Examples
    --------
    >>> quarter, third, no = Fraction(1, 4), Fraction(1, 3), Fraction(0)
    >>> rows = ((), (2 * third,))
    >>> TableauFile("Two thirds", "a textbook", 2, (no, 2 * third), rows, (quarter, 3 * quarter)).order
    2
    """

    name: Title
    source: Source
    order: Annotated[int, Key("Order of the method, or a lower one", "1", least=1, most=MOST_ORDER)]
    nodes: Annotated[Numbers, Key("c_i, parts of the step", least=1, most=MOST_STAGES)]
    matrix: Annotated[tuple[Numbers, ...], Key("a_ij left of the diagonal; the first row is empty")]
    weights: Annotated[Numbers, Key("b_i")]
    embedded_weights: Annotated[Numbers | None, Key("Weights of a second method on the same stages")] = None
    tolerance: Annotated[
        Fraction,
        Key(
            "Largest residual of a condition that the rounding of published numbers explains",
            "1",
            least=0,
            most=1e-12,
        ),
    ] = Fraction(0)

    def __post_init__(self) -> None:
        check_shape(self.nodes, self.matrix, weights=self.weights, embedded_weights=self.embedded_weights)

    def tableau(self, name: str) -> Tableau:
        """Return the tableau under a name, its conditions not checked."""
        return Tableau(
            *(name, self.name, self.source, self.order, self.nodes, self.matrix, self.weights),
            *(self.embedded_weights, self.tolerance),
        )


TABLEAU = UserFile("a tableau", TableauFile, 200_000)


def _titles(files: Mapping[str, Path]) -> dict[str, str]:
    """Return the names in the literature, by name, sorted by order, with those of the thesis first within an order."""
    data = {name: tomllib.loads(path.read_text("utf-8")) for name, path in files.items()}

    def place(name: str) -> tuple[int, bool, int, str]:
        return data[name]["order"], not name.startswith("rk"), len(data[name]["nodes"]), name

    return {name: data[name]["name"] for name in sorted(data, key=place)}


def _shipped(path: Path, name: str) -> Tableau:
    """Read a tableau of strapgen, whose file the tests verify."""
    return TABLEAU.read(path).tableau(name)


def _installed(path: Path, name: str) -> Tableau:
    """Read the tableau of an installed package, which has the name of its file."""
    return replace(read(path), name=name, file="")


_FILES = Registry("tableaux", Path)
_BUILT_IN_TITLES = _titles(_FILES.own)
_BUILT_IN = CoefficientFiles({name: _FILES.own[name] for name in _BUILT_IN_TITLES}, _shipped)
_INSTALLED = CoefficientFiles(_FILES, _installed, without=_FILES.own)

#: The tableaux of strapgen and of installed packages, by name.
TABLEAUX: Merged[Tableau] = Merged(_BUILT_IN, _INSTALLED)

#: Their names in the literature.
TITLES: Merged[str] = Merged(_BUILT_IN_TITLES, Titles(_INSTALLED))


def read(path: str | Path) -> Tableau:
    r"""Read a tableau from a file and check that it is explicit, its rows sum to its nodes, and the order is right.

    Parameters
    ----------
    path : path
        A TOML file with the keys of `TableauFile`.

    Returns
    -------
    Tableau
        Named after its key `name`, in lower case with hyphens.

    Raises
    ------
    InputError
        If the file cannot be read, a key or number is wrong, or a condition does not hold; the message names it.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> file = Path(mkdtemp()) / "two-thirds.toml"
    >>> text = 'name = "Two thirds"\nsource = "a textbook"\norder = 2\nnodes = [0, "2/3"]\n'
    >>> _ = file.write_text(text + 'matrix = [[], ["2/3"]]\nweights = ["1/4", "3/4"]\n')
    >>> read(file).order
    2
    """
    if "unknowns" in TABLEAU.content(path):
        raise InputError(
            f"{path}: its coefficients hold unknowns; strapgen tableau solves for them, and --set sets them"
        )
    return TABLEAU.convert(path, lambda file: verified(file, checks.text("the name of the file", str(path))))


def verified(stated: TableauFile, file: str = "") -> Tableau:
    """Return the tableau of a file, its conditions checked; errors are those of `read`.

    Examples
    --------
    >>> quarter, third, no = Fraction(1, 4), Fraction(1, 3), Fraction(0)
    >>> rows = ((), (2 * third,))
    >>> verified(TableauFile("Two thirds", "a textbook", 2, (no, 2 * third), rows, (quarter, 3 * quarter))).name
    'two-thirds'
    """
    name = coefficient_files.slug(stated.name)
    if name in _BUILT_IN:
        raise InputError(f"name {stated.name!r} is that of the method {name}; another one is needed")
    tableau = replace(stated.tableau(name), file=file)
    if not tableau.rational:
        _check_roots(tableau)
    verify(tableau)
    # A file may state less than the actual order.
    return replace(tableau, order=order_conditions.order(tableau, MOST_ORDER, known=tableau.order))


def check_shape(
    nodes: Sequence[Any], matrix: Sequence[Sequence[Any]], **weights: Sequence[Any] | None
) -> None:
    """Check that a matrix and weights go with the number of nodes.

    Examples
    --------
    >>> check_shape([0, 1], [[], [1]], weights=[1])
    Traceback (most recent call last):
        ...
    strapgen.InputError: weights has 1 entry; as many as nodes are needed: 2
    """
    stages = len(nodes)
    if len(matrix) != stages:
        raise InputError(f"matrix has {counted(len(matrix), 'row')}; as many as nodes are needed: {stages}")
    for number, row in enumerate(matrix, 1):
        if len(row) != number - 1:
            why = "not explicit, " if len(row) >= number else ""
            raise InputError(
                f"matrix[{number}] has {counted(len(row), 'entry', 'entries')}: "
                f"{why}{needed(number - 1)}, left of the diagonal"
            )
    for what, some in weights.items():
        if some is not None and len(some) != stages:
            raise InputError(
                f"{what} has {counted(len(some), 'entry', 'entries')}; as many as nodes are needed: {stages}"
            )


def _check_roots(tableau: Tableau) -> None:
    if tableau.tolerance:
        raise InputError("tolerance is for rounded fractions; a tableau with square roots is exact")
    rows = (tableau.nodes, tableau.weights, tableau.embedded_weights or (), *tableau.matrix)
    irrational = [value for row in rows for value in row if not isinstance(value, Fraction)]
    if coefficients.degree_bound(irrational) > coefficients.MOST_DEGREE:
        raise InputError("its numbers hold too many different square roots; at most three are allowed")


def verify(tableau: Tableau) -> None:
    """Check row sums and order conditions exactly.

    Raises
    ------
    InputError
        If one does not hold; the message names the first.

    Examples
    --------
    >>> from dataclasses import replace
    >>> verify(TABLEAUX["rk4"])
    >>> verify(replace(TABLEAUX["rk4"], order=5))
    Traceback (most recent call last):
        ...
    strapgen.InputError: order 5: sum b_i c_i^4 = 5/24, 1/5 is needed (off by 1/120)
    """
    for number, defect in enumerate(order_conditions.row_residuals(tableau), 1):
        if defect != 0 and not (tableau.tolerance and abs(defect) <= tableau.tolerance):
            node = tableau.nodes[number - 1]
            raise InputError(
                f"matrix row {number} sums to {short_text(node + defect)}; its node is {short_text(node)}"
            )
    for order in range(1, tableau.order + 1):
        failure = order_conditions.first_failure(tableau, order)
        if failure:
            tree, defect = failure
            needed = Fraction(1, order_conditions.density(tree))
            raise InputError(
                f"order {order}: {order_conditions.weight_text(tree)} = {short_text(needed + defect)}, "
                f"{needed} is needed (off by {short_text(defect)})"
            )
    if tableau.embedded_weights is not None and order_conditions.embedded_order(tableau) < 1:
        total = sum(tableau.embedded_weights)
        raise InputError(f"embedded_weights sum to {short_text(total)}; 1 is needed, that they have an order")


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

    kind: ClassVar[str] = "tableau"
    own_samples: ClassVar[int | None] = None

    @property
    def recipe(self) -> tuple[str, str, tuple[Any, ...]]:
        """Module, function and arguments that make a `Method` of it."""
        return f"{__package__}.runge_kutta", "verified", (self,)

    def select(self, asked: RequestedSamples) -> tuple[Tableau, StepSamples]:
        """Return the method and its samples for the requested ones."""
        return self, through_samples(self.name, asked)

    @property
    def rational(self) -> bool:
        """Whether every coefficient is a fraction."""
        rows = (self.nodes, self.weights, self.embedded_weights or (), *self.matrix)
        return all(isinstance(value, Fraction) for row in rows for value in row)
