"""Replaces roots, quotients and functions whose arguments have a declared range by certified series.

The cosine and sin(x)/x are even: where x is a multiple of the root of s, both are series in s. They alternate, so that
what is cut off is less than its first term where the terms fall. A root and the inverse of what stays near 1, as the
square of the length of a rotation before it is normalized, are binomial series. With ranges proved from those of the
inputs, a polynomial of known remainder takes the place of each, and has no branch.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import count

from strapgen.fixedpoint.floating.errors import NUMBERS, Expressions, NoBoundError, NumberFormat
from strapgen.fixedpoint.format_plan import MOST_GUARD_BITS, limits
from strapgen.fixedpoint.intervals import Interval, root
from strapgen.fixedpoint.series import binomial_series, sine_series
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import ROTATION_INPUTS, Settings
from strapgen.ir.formats import above, below
from strapgen.ir.program import Assignment, Constant, Node, Operation, Program, Reference, names_in, walk
from strapgen.ir.signals import Signal

#: Largest magnitude of an argument for which a series is taken; beyond, it needs more terms than it saves.
_LARGEST_ARGUMENT = 2
#: Part of the unit roundoff of the numbers that a remainder may be.
SHARE = Fraction(1, 4)
#: Most terms of a series in place of a root or a quotient, which take about as long as ten products in double.
_MOST_TERMS = 10
#: The first degree of the sine's or the cosine's series that each function takes, and its text.
_FUNCTIONS = {"cos": (0, "cos(x)"), "sinc": (1, "sin(x)/x")}
#: The exponent of every other operation, and its text.
_POWERS = {
    "sqrt": (Fraction(1, 2), "sqrt(x)"),
    "inverse root": (Fraction(-1, 2), "1/sqrt(x)"),
    "inverse": (Fraction(-1), "1/x"),
}
#: Operations for which there are series.
KINDS = frozenset((*_FUNCTIONS, *_POWERS))


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
    box = {e: Interval.symmetric(s.limit) for s in limited if s.limit is not None for e in s.elements}
    series, notes = with_series(declared, box, SHARE * format_.unit)
    if not notes:
        return declared
    said = f"Series in place of functions: {'; '.join(notes)}."
    return replace(series, info=replace(declared.info, notes=(*program.notes, said)))


def without_roots(program: Program, settings: Settings) -> Program:
    """Return a program with series for roots and quotients, as far as the ranges of fixed point allow them.

    A remainder is at most an eighth of the last place of a word that holds 1, as those of sines and cosines.
    """
    box: dict[str, Interval] = {}
    for limit in limits(program, settings):
        whole = limit.range(0)
        for guard_bits in range(1, MOST_GUARD_BITS + 1):
            whole = whole.join(limit.range(guard_bits))
        box |= dict.fromkeys(limit.signal.elements, whole)
    return with_series(program, box, Fraction(1, 1 << (settings.word + 1)), _POWERS)[0]


def _limited(signal: Signal, settings: Settings, number: NumberFormat) -> Signal:
    """Return an input with its declared range, if there is one; the nearest number to its end lies inside."""
    angle = settings.largest_angle if signal.name in ROTATION_INPUTS else None
    declared = settings.ranges.get(signal.name, angle)
    return signal if declared is None else replace(signal, limit=max(declared, number.rounded(declared)))


@dataclass(frozen=True)
class _Function:
    """An operation for which there may be a series."""

    kind: str
    argument: Node  # what is under the root, or divided by
    factor: Fraction = Fraction(1)  # of the root in the argument of a cosine or sin(x)/x
    numerator: Node | None = None  # of a quotient

    def series(
        self, range_: Interval, tolerance: Fraction
    ) -> tuple[Sequence[Fraction], Fraction, str] | None:
        """Return a series on a range of the argument, its remainder and its text; None for one that is too long."""
        if self.kind in _POWERS:
            exponent, text = _POWERS[self.kind]
            reach = (range_ - Interval.of(1)).magnitude
            if reach > Fraction(1, 2):
                return None
            coefficients, left_out = binomial_series(exponent, reach, tolerance)
            ends = f"x from {below(range_.lowest)} to {above(range_.highest)}"
            return None if len(coefficients) > _MOST_TERMS else (coefficients, left_out, f"{text} for {ends}")
        first, text = _FUNCTIONS[self.kind]
        reach = max(root(self.factor**2 * range_.magnitude), tolerance)
        if reach > _LARGEST_ARGUMENT:
            return None
        scale = reach if first else Fraction(1)  # sin(x)/x has the remainder of the sine over x
        coefficients, left_out = sine_series(first, reach, tolerance * scale)
        terms = [c * self.factor ** (2 * k) for k, c in enumerate(coefficients)]
        return terms, left_out / scale, f"{text} for x up to {above(reach)} rad"


def with_series(
    program: Program, box: Mapping[str, Interval], tolerance: Fraction, kinds: Container[str] = KINDS
) -> tuple[Program, list[str]]:
    """Return a program with series of remainders up to a tolerance, and their ranges and remainders in words.

    `box` has the ranges of elements of inputs: what depends on others keeps its operations, as do other `kinds`.
    """
    values = {assignment.name: assignment.value for assignment in program.body}
    found: dict[Node, _Function] = {
        node: function
        for value in values.values()
        for node in walk(value)
        if isinstance(node, Operation)
        and (function := _function(node, values)) is not None
        and function.kind in kinds
    }
    ranges = _ranges(program, box, {function.argument for function in found.values()})
    work = _Replacement(program, found, ranges, tolerance)
    for assignment in program.body:
        work.add(assignment)
    if not work.notes:
        return program, []
    whole = replace(program, body=tuple(work.body))
    used = whole.used()
    return replace(whole, body=tuple(a for a in work.body if a.name in used)), work.notes


def _function(node: Operation, values: Mapping[str, Node]) -> _Function | None:
    """Return an operation for which there may be a series; None for any other."""
    if node.kind == "sqrt":
        return _Function("sqrt", node.arguments[0])
    if node.kind == "divide":
        numerator, divisor = node.arguments
        under_root = _under_root(divisor, values)
        if under_root is not None and under_root[0] == 1:
            return _Function("inverse root", under_root[1], numerator=numerator)
        return None if isinstance(divisor, Constant) else _Function("inverse", divisor, numerator=numerator)
    if node.kind in _FUNCTIONS and (under_root := _under_root(node.arguments[0], values)) is not None:
        return _Function(node.kind, under_root[1], under_root[0])
    return None


def _under_root(node: Node, values: Mapping[str, Node]) -> tuple[Fraction, Node] | None:
    """Return the factor and the radicand of a multiple of a root; None for any other node."""
    factor = Fraction(1)
    while True:
        match node:
            case Reference(name) if name in values:
                node = values[name]
            case Operation("sqrt", (radicand,)):
                return factor, radicand
            case Operation("negate", (inner,)):
                factor, node = -factor, inner
            case Operation("multiply", (Constant(value), inner) | (inner, Constant(value))):
                factor, node = factor * value, inner
            case Operation("divide", (inner, Constant(value))) if value:
                factor, node = factor / value, inner
            case _:
                return None


def _ranges(program: Program, box: Mapping[str, Interval], arguments: set[Node]) -> dict[Node, Interval]:
    """Return the proved range of each argument that depends on inputs in the box alone."""
    inputs = tuple(signal for signal in program.inputs if box.keys() >= {*signal.elements})
    known = {element for signal in inputs for element in signal.elements}
    body = []
    for assignment in program.body:
        if names_in(assignment.value) <= known:
            known.add(assignment.name)
            body.append(assignment)
    proper = [argument for argument in arguments if names_in(argument) <= known]
    needed = {name for argument in proper for name in names_in(argument)}
    for assignment in reversed(body):
        if assignment.name in needed:
            needed |= names_in(assignment.value)
    if not proper:
        return {}
    part = replace(
        program,
        inputs=inputs,
        body=tuple(assignment for assignment in body if assignment.name in needed),
        outputs=(),
        transition=None,
    )
    expressions = Expressions.of(part)
    places = {argument: expressions.place_of(argument) for argument in proper}
    from strapgen.fixedpoint.floating.exact_ranges import ExactRanges  # loads numpy, as only proofs do

    try:
        exact = ExactRanges(part, expressions, box, sharp={*places.values()})
    except (NoBoundError, ArithmeticError):
        return {}
    if exact.conditions:  # a range that holds under conditions is not one of the declared box
        return {}
    return {argument: exact.ranges[place] for argument, place in places.items()}


@dataclass
class _Replacement:
    """The assignments so far, and the names of the values that several of them share."""

    program: Program
    functions: Mapping[Node, _Function]
    ranges: Mapping[Node, Interval]
    tolerance: Fraction
    body: list[Assignment] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    known: dict[Node, Reference] = field(default_factory=dict)  # variables of series
    made: dict[_Function, Reference] = field(default_factory=dict)

    def __post_init__(self) -> None:
        taken = {element for signal in self.program.inputs for element in signal.elements}
        taken |= {assignment.name for assignment in self.program.body}
        self._names = {
            stem: (name for name in _numbered(stem) if name not in taken)
            for stem in ("length_square", "excess", "series")
        }

    def add(self, assignment: Assignment) -> None:
        """Add an assignment of the program with series for its functions."""
        value = self._replaced(assignment.value, assignment)
        if value is not None:
            self.body.append(replace(assignment, value=value))

    def _replaced(self, node: Node, whole: Assignment | None = None) -> Node | None:
        """Return a node with series; None where a series is the value of the whole assignment, and stands there."""
        function = self.functions.get(node)
        if function is not None and function.argument in self.ranges:
            numerator = function.numerator
            alone = numerator is None or numerator == Constant(Fraction(1))
            key = replace(function, numerator=None)
            if alone and whole is not None and key not in self.made and self._add_series(key, whole):
                return None
            if key in self.made or self._add_series(key):
                return (
                    self.made[key]
                    if alone
                    else Operation("multiply", (self._part(numerator), self.made[key]))
                )
        if isinstance(node, Operation):
            return Operation(node.kind, tuple(map(self._part, node.arguments)))
        return node

    def _part(self, node: Node | None) -> Node:
        part = None if node is None else self._replaced(node)
        assert part is not None, "a part of a value is no assignment"
        return part

    def _add_series(self, function: _Function, whole: Assignment | None = None) -> bool:
        """Add a series as the value of an assignment or of one of its own; return whether there is a short one."""
        known = function.series(self.ranges[function.argument], self.tolerance)
        if known is None:
            return False
        coefficients, remainder, text = known
        variable = self._variable(function)
        name = next(self._names["series"]) if whole is None else whole.name
        meaning = "" if whole is None else whole.meaning
        self.body.append(Assignment(name, _horner(coefficients, variable), meaning, remainder))
        self.made[function] = Reference(name)
        note = f"{text}, off by at most {above(remainder)}"
        if note not in self.notes:
            self.notes.append(note)
        return True

    def _variable(self, function: _Function) -> Reference:
        """Return the variable of a series: what is under a root, or its distance from 1."""
        argument = self._part(function.argument)
        stem = "length_square"
        if function.kind in _POWERS:
            argument, stem = Operation("subtract", (argument, Constant(Fraction(1)))), "excess"
        if isinstance(argument, Reference):
            return argument
        if argument not in self.known:
            name = next(self._names[stem])
            self.body.append(Assignment(name, argument))
            self.known[argument] = Reference(name)
        return self.known[argument]


def _numbered(stem: str) -> Iterator[str]:
    """Yield a name, and then the name with numbers behind it."""
    yield stem
    yield from (f"{stem}_{number}" for number in count(2))


def _horner(coefficients: Sequence[Fraction], variable: Node) -> Node:
    """Return a polynomial whose first coefficient is positive by Horner's scheme, without negative constants."""
    *others, last = coefficients
    rest: Node = Constant(abs(last))
    positive = last > 0
    for coefficient in reversed(others):
        product = Operation("multiply", (rest, variable))
        kind = "add" if positive == (coefficient > 0) else "subtract"
        rest, positive = Operation(kind, (Constant(abs(coefficient)), product)), coefficient > 0
    return rest
