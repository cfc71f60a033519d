"""Replaces functions of a length whose range is declared by certified series in the square of the length.

The cosine and sin(x)/x are even: where x is a multiple of the root of s, both are series in s. They alternate, so that
what is cut off is less than its first term where the terms fall. With the largest s proved from the ranges of the
inputs, a polynomial of known remainder takes the place of the root and the function, and has no branch.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import reduce
from itertools import count

from strapgen.fixedpoint.floating.errors import NUMBERS, Expressions, NoBoundError, NumberFormat
from strapgen.fixedpoint.intervals import Interval, root
from strapgen.fixedpoint.series import sine_series
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import ROTATION_INPUTS, Settings
from strapgen.ir.formats import above
from strapgen.ir.program import Assignment, Constant, Node, Operation, Program, Reference, names_in, walk
from strapgen.ir.signals import Signal

#: Largest magnitude of an argument for which a series is taken; beyond, it needs more terms than it saves.
_LARGEST_ARGUMENT = 2
#: Part of the unit roundoff of the numbers that a remainder may be.
SHARE = Fraction(1, 4)
#: The first degree of the sine's or the cosine's series that each function takes, and its text.
_FUNCTIONS = {"cos": (0, "cos(x)"), "sinc": (1, "sin(x)/x")}


def with_declared_ranges(program: Program, settings: Settings, number: str = "double") -> Program:
    """Return a program whose inputs have the declared ranges, with series where these allow them.

    Parameters
    ----------
    program : Program
    settings : Settings
        States the largest angle increment in rad, and ranges of other inputs.
    number : str, optional
        Type of the numbers, "double" or "float": a remainder is at most a quarter of their unit roundoff.

    Returns
    -------
    Program
        Its inputs have a `limit`, and an assignment that is a series its `remainder`. The notes state both.

    Raises
    ------
    InputError
        If no input has a declared range, or the settings have ranges of other inputs than the program.
    """
    settings = settings.for_program(program.increments_per_step, program.kernel)
    names = [signal.name for signal in program.inputs]
    for name in settings.ranges:
        checks.choice(f"input of {program.kernel}", name, names)
    format_ = NUMBERS[number]
    declared = replace(
        program, inputs=tuple(_limited(signal, settings, format_) for signal in program.inputs)
    )
    limited = [signal for signal in declared.inputs if signal.limit is not None]
    if not limited:
        raise InputError(f"kernel {program.kernel} takes no increments; a largest angle does not go with it")
    stated = [settings.range_options] * any(signal.name in ROTATION_INPUTS for signal in limited)
    stated += [f"--range {name}={value}" for name, value in settings.ranges.items()]
    arguments = " ".join([program.arguments, *stated])
    declared = replace(declared, info=replace(program.info, arguments=arguments))
    return _with_series(declared, SHARE * format_.unit)


def _limited(signal: Signal, settings: Settings, number: NumberFormat) -> Signal:
    """Return an input with its declared range, if there is one; the nearest number to its end lies inside."""
    angle = settings.largest_angle if signal.name in ROTATION_INPUTS else None
    declared = settings.ranges.get(signal.name, angle)
    return signal if declared is None else replace(signal, limit=max(declared, number.rounded(declared)))


@dataclass(frozen=True)
class _Function:
    """A function of a multiple of a root."""

    kind: str
    factor: Fraction
    radicand: Node


def _with_series(program: Program, tolerance: Fraction) -> Program:
    """Replace the functions of multiples of roots of a proved range, with remainders of at most a tolerance."""
    values = {assignment.name: assignment.value for assignment in program.body}
    found: dict[Node, _Function] = {
        node: function
        for value in values.values()
        for node in walk(value)
        if isinstance(node, Operation) and (function := _function(node, values)) is not None
    }
    largest = _largest(program, {function.radicand for function in found.values()})
    found = {
        node: function
        for node, function in found.items()
        if (most := largest.get(function.radicand)) is not None
        and function.factor**2 * most <= _LARGEST_ARGUMENT**2
    }
    if not found:
        return program
    work = _Replacement(program, found, largest, tolerance)
    for assignment in program.body:
        work.add(assignment)
    whole = replace(program, body=tuple(work.body))
    used = whole.used()
    notes = (*program.notes, f"Series in place of functions: {'; '.join(work.notes)}.")
    return replace(
        whole, body=tuple(a for a in work.body if a.name in used), info=replace(program.info, notes=notes)
    )


def _function(node: Operation, values: Mapping[str, Node]) -> _Function | None:
    """Return a cosine or sin(x)/x whose argument is a multiple of a root; None for any other operation."""
    if node.kind not in _FUNCTIONS:
        return None
    factor, argument = Fraction(1), node.arguments[0]
    while True:
        match argument:
            case Reference(name) if name in values:
                argument = values[name]
            case Operation("sqrt", (radicand,)):
                return _Function(node.kind, factor, radicand)
            case Operation("negate", (inner,)):
                argument = inner
            case Operation("multiply", (Constant(value), inner) | (inner, Constant(value))):
                factor, argument = factor * value, inner
            case Operation("divide", (inner, Constant(value))) if value:
                factor, argument = factor / value, inner
            case _:
                return None


def _largest(program: Program, radicands: set[Node]) -> dict[Node, Fraction]:
    """Return the proved largest value of each radicand that depends on inputs of a declared range alone."""
    limited = {signal.name: signal.limit for signal in program.inputs if signal.limit is not None}
    inputs = tuple(signal for signal in program.inputs if signal.name in limited)
    known = {element for signal in inputs for element in signal.elements}
    box = {e: Interval.symmetric(limited[signal.name]) for signal in inputs for e in signal.elements}
    body = []
    for assignment in program.body:
        if names_in(assignment.value) <= known:
            known.add(assignment.name)
            body.append(assignment)
    proper = [radicand for radicand in radicands if names_in(radicand) <= known]
    needed = {name for radicand in proper for name in names_in(radicand)}
    for assignment in reversed(body):
        if assignment.name in needed:
            needed |= names_in(assignment.value)
    part = replace(
        program,
        inputs=inputs,
        body=tuple(assignment for assignment in body if assignment.name in needed),
        outputs=(),
        transition=None,
    )
    expressions = Expressions.of(part)
    places = {radicand: expressions.place_of(radicand) for radicand in proper}
    from strapgen.fixedpoint.floating.exact_ranges import ExactRanges  # loads numpy, as only proofs do

    try:
        exact = ExactRanges(part, expressions, box)
    except (NoBoundError, ArithmeticError):
        return {}
    if exact.conditions:  # a range that holds under conditions is not one of the declared box
        return {}
    return {radicand: exact.ranges[place].highest for radicand, place in places.items()}


@dataclass
class _Replacement:
    """The assignments so far, and the names of the values that several of them share."""

    program: Program
    functions: Mapping[Node, _Function]
    largest: Mapping[Node, Fraction]
    tolerance: Fraction
    body: list[Assignment] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    known: dict[Node, Reference] = field(default_factory=dict)  # squares and series

    def __post_init__(self) -> None:
        taken = {element for signal in self.program.inputs for element in signal.elements}
        taken |= {assignment.name for assignment in self.program.body}
        self._squares, self._series = (
            (name for name in _numbered(stem) if name not in taken) for stem in ("length_square", "series")
        )

    def add(self, assignment: Assignment) -> None:
        """Add an assignment of the program with series for its functions."""
        if assignment.value in self.functions and assignment.value not in self.known:
            self._add_series(assignment.name, assignment.value, assignment.meaning)
            return
        self.body.append(replace(assignment, value=self._replaced(assignment.value)))

    def _replaced(self, node: Node) -> Node:
        if node in self.functions:
            if node not in self.known:
                self._add_series(next(self._series), node)
            return self.known[node]
        if isinstance(node, Operation):
            return Operation(node.kind, tuple(map(self._replaced, node.arguments)))
        return node

    def _add_series(self, name: str, node: Node, meaning: str = "") -> None:
        function = self.functions[node]
        first, text = _FUNCTIONS[function.kind]
        square, most = self._square(function.radicand), self.largest[function.radicand]
        reach = max(root(function.factor**2 * most), self.tolerance)
        scale = reach if first else Fraction(1)  # sin(x)/x has the remainder of the sine over x
        coefficients, left_out = sine_series(first, reach, self.tolerance * scale)
        terms = [c * function.factor ** (2 * k) for k, c in enumerate(coefficients)]
        remainder = left_out / scale
        self.body.append(Assignment(name, _alternating(terms, square), meaning, remainder))
        self.known[node] = Reference(name)
        note = f"{text} for x up to {above(reach)} rad, off by at most {above(remainder)}"
        if note not in self.notes:
            self.notes.append(note)

    def _square(self, radicand: Node) -> Reference:
        if isinstance(radicand, Reference):
            return radicand
        if radicand not in self.known:
            name = next(self._squares)
            self.body.append(Assignment(name, radicand))
            self.known[radicand] = Reference(name)
        return self.known[radicand]


def _numbered(stem: str) -> Iterator[str]:
    """Yield a name, and then the name with numbers behind it."""
    yield stem
    yield from (f"{stem}_{number}" for number in count(2))


def _alternating(terms: list[Fraction], variable: Node) -> Node:
    """Return a polynomial of coefficients that alternate in sign, by Horner's scheme."""
    *others, last = (Constant(abs(term)) for term in terms)
    start: Node = last
    return reduce(
        lambda rest, term: Operation("subtract", (term, Operation("multiply", (rest, variable)))),
        reversed(others),
        start,
    )
