"""Butcher tableaux of explicit Runge-Kutta methods, read from files, and their verified order conditions.

`TABLEAUX` are those of the folder `butcher_tableaux`; a user's file is read by `read`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen.catalogue import toml_files
from strapgen.catalogue.methods import coefficient_files, coefficients, order_conditions
from strapgen.catalogue.methods.coefficient_files import CoefficientFiles, entries
from strapgen.catalogue.methods.coefficients import short_text
from strapgen.catalogue.methods.tableau import Tableau
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.suggestions import counted, needed
from strapgen.registry import Merged, Registry, Titles

if TYPE_CHECKING:
    from strapgen.catalogue.methods.coefficients import Number

#: Keys of a file, and those of them that are optional.
KEYS = ("name", "source", "order", "nodes", "matrix", "weights", "embedded_weights", "tolerance")
OPTIONAL = ("embedded_weights", "tolerance")

#: Highest order and most stages. The number of trees grows nearly threefold from order to order.
MOST_ORDER = 10
MOST_STAGES = 20

#: Largest tolerance of a user's file; rounding to double precision stays below it, a wrong coefficient does not.
MOST_TOLERANCE = Fraction(1, 10**12)

#: Most bytes of a file; twenty stages of long expressions take far less.
MOST_BYTES = 200_000


def _titles(files: Mapping[str, Path]) -> dict[str, str]:
    """Return the names in the literature, by name, sorted by order, with those of the thesis first within an order."""
    data = {name: tomllib.loads(path.read_text("utf-8")) for name, path in files.items()}

    def place(name: str) -> tuple[int, bool, int, str]:
        return data[name]["order"], not name.startswith("rk"), len(data[name]["nodes"]), name

    return {name: data[name]["name"] for name in sorted(data, key=place)}


def _shipped(path: Path, name: str) -> Tableau:
    """Read a tableau of strapgen, whose file the tests verify."""
    return _tableau(tomllib.loads(path.read_text("utf-8")), name)


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
    """Read a tableau from a file and check that it is explicit, its rows sum to its nodes, and it has the stated order.

    Parameters
    ----------
    path : path
        A TOML file with the keys of `KEYS`; every number is a whole number or a string, see `coefficients.number`.

    Returns
    -------
    Tableau
        Named after its key `name`, in lower case with hyphens.

    Raises
    ------
    InputError
        If the file cannot be read, a key or number is wrong, or a condition does not hold; the message names it.
    """
    data = toml_files.content(path, "a tableau", MOST_BYTES)
    try:
        if "unknowns" in data:
            raise InputError(
                "its coefficients hold unknowns; strapgen tableau solves for them, and --set sets them"
            )
        return from_data(data, checks.text("the name of the file", str(path)))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def from_data(data: Mapping[str, Any], file: str = "") -> Tableau:
    """Return the tableau of a file's content, checked; errors are those of `read`."""
    _check_keys(data)
    name = coefficient_files.slug(data["name"])
    if name in _BUILT_IN:
        raise InputError(f"name {data['name']!r} is that of the method {name}; another one is needed")
    tableau = replace(_tableau(data, name), file=file)
    verify(tableau)
    # A file may state less than the actual order.
    return replace(tableau, order=order_conditions.order(tableau, MOST_ORDER, known=tableau.order))


def _check_keys(data: Mapping[str, Any]) -> None:
    coefficient_files.check_keys(data, KEYS, OPTIONAL)
    order = data["order"]
    if not isinstance(order, int) or isinstance(order, bool) or not 1 <= order <= MOST_ORDER:
        raise InputError(
            f"order is {repr(order)[:40]}; a whole number from 1 to {MOST_ORDER} is needed, "
            "beyond it there are too many conditions to check"
        )


def _tableau(data: Mapping[str, Any], name: str) -> Tableau:
    """Return a tableau from the content of a file with all keys, after a check of its numbers and its shape."""
    nodes = _numbers("nodes", entries("nodes", data["nodes"]))
    stages = len(nodes)
    check_shape(data, stages)
    embedded = data.get("embedded_weights")
    tableau = Tableau(
        name,
        data["name"],
        data["source"],
        data["order"],
        nodes,
        tuple(_numbers(f"matrix row {number}", row) for number, row in enumerate(data["matrix"], 1)),
        _numbers("weights", data["weights"]),
        None if embedded is None else _numbers("embedded_weights", embedded),
        _tolerance(data.get("tolerance", 0)),
    )
    if not tableau.rational:
        _check_roots(tableau)
    return tableau


def check_shape(data: Mapping[str, Any], stages: int, most: int = MOST_STAGES) -> None:
    """Check that matrix and weights of a file go with its number of stages, `most` at most."""
    if not 1 <= stages <= most:
        raise InputError(f"nodes has {stages} entries; from 1 to {most} are allowed")
    rows = entries("matrix", data["matrix"])
    if len(rows) != stages:
        raise InputError(f"matrix has {counted(len(rows), 'row')}; as many as nodes are needed: {stages}")
    for number, row in enumerate(rows, 1):
        length = len(entries(f"matrix row {number}", row))
        if length != number - 1:
            why = "not explicit, " if length >= number else ""
            raise InputError(
                f"matrix row {number} has {counted(length, 'entry', 'entries')}: "
                f"{why}{needed(number - 1)}, left of the diagonal"
            )
    for what in ("weights", "embedded_weights"):
        weights = entries(what, data.get(what, [None] * stages))
        if len(weights) != stages:
            raise InputError(
                f"{what} has {counted(len(weights), 'entry', 'entries')}; as many as nodes are needed: {stages}"
            )


def _numbers(what: str, values: list[Any]) -> tuple[Number, ...]:
    return tuple(coefficients.number(f"{what}, entry {k}", value) for k, value in enumerate(values, 1))


def _tolerance(value: Any) -> Fraction:
    tolerance = coefficients.number("tolerance", value)
    if not isinstance(tolerance, Fraction) or not 0 <= tolerance <= MOST_TOLERANCE:
        raise InputError(
            f"tolerance is {value}; from 0 to {float(MOST_TOLERANCE):g} is needed: "
            "it explains the rounding of published coefficients, no more"
        )
    return tolerance


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
