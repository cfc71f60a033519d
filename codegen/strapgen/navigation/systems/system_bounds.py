"""Adds up the error bounds of stages along the wires: the rounding error of one pass through a system."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from strapgen.fixedpoint.floating import rounding_bounds
from strapgen.fixedpoint.floating.errors import Expression, Expressions, NoBoundError, sensitivities, slopes
from strapgen.fixedpoint.floating.exact_ranges import ExactRanges
from strapgen.fixedpoint.intervals import Interval
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import DEFAULT_ANGLE, ROTATION_INPUTS, Settings
from strapgen.ir.interfaces import Argument
from strapgen.ir.program import Program
from strapgen.navigation.systems.fitting import GeneratedStages, clipped, fitted
from strapgen.navigation.systems.system import Push, SystemStage
from strapgen.targets import TARGETS

Errors = tuple[Fraction, ...]


@dataclass(frozen=True)
class SystemBounds:
    """Bounds of the distance of one pass through a system from exact arithmetic on the same memory and samples.

    The pass is a cycle in which all rates fall together; in every other cycle fewer stages run, and the bounds hold
    for the cells that they write. So a cell that several rates write has the largest bound of them.
    """

    #: A bound for every element of a cell, in its unit
    errors: Mapping[str, Errors] = field(default_factory=dict)
    #: Why there is none, by the name of the cell
    reasons: Mapping[str, str] = field(default_factory=dict)


def bounds(fit: GeneratedStages) -> SystemBounds:
    """Return the error bounds of one pass through a system.

    Every stage has the bound of its own rounding, and passes on the errors of its inputs by at most its derivatives,
    which interval arithmetic bounds over the ranges of its inputs.
    """
    ranges = fit
    if not TARGETS[fit.target].fixed:
        ranges = fitted(fit.description, "fixed-model", Settings())
    return _Pass(fit, ranges).run()


@dataclass
class _Pass:
    """The errors along one pass, during the computation."""

    fit: GeneratedStages
    ranges: GeneratedStages
    errors: dict[str, Errors] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)
    faster: dict[str, Errors] = field(default_factory=dict)

    def run(self) -> SystemBounds:
        """Go through all rates, from the fastest."""
        system = self.fit.description.system
        self.errors = {cell.name: (Fraction(0),) * cell.signal.size for cell in system.cells}
        self.errors |= {signal.name: (Fraction(0),) * signal.size for signal in system.inputs}
        for rate in system.rates:
            # A cell that this rate replaces or clears stays as faster ones leave it where this one is not due.
            self.faster, unknown = dict(self.errors), dict(self.reasons)
            for step in rate.steps:
                if isinstance(step, Push):
                    self._push(step)
                else:
                    self._call(step)
            self.reasons |= unknown
        cells = [cell.name for cell in system.cells]
        known = {name: self.errors[name] for name in cells if name not in self.reasons}
        return SystemBounds(known, {name: self.reasons[name] for name in cells if name in self.reasons})

    def _push(self, push: Push) -> None:
        """Put a new sample last; those before move."""
        new = self._at_wire(push.source, self.fit.arguments.get(push.cell))
        self.errors[push.cell] = self.errors[push.cell][len(new) :] + new
        if push.source in self.reasons:
            self.reasons[push.cell] = self.reasons[push.source]
        elif clipped(self.fit.held(push.source), self.fit.arguments.get(push.cell)):
            self.reasons[push.cell] = f"its word does not hold all that {push.source} may be"

    def _at_wire(self, source: str, here: Argument | None) -> Errors:
        """Return the errors at the end of a wire, rescaled to the format there."""
        return _rescale(self.errors[source], self.fit.arguments.get(source), here)

    def _call(self, stage: SystemStage) -> None:
        """Add the rounding of a stage to the propagated errors of its inputs."""
        program = self.fit.description.programs[stage.name]
        arguments = self.fit.arguments_of(stage)
        unknown = next((self.reasons[w.source] for w in stage.wires if w.source in self.reasons), "")
        errors = {wire.input: self._at_wire(wire.source, arguments.get(wire.input)) for wire in stage.wires}
        limits = self._limits(stage, errors)
        brought, added = {}, {}
        if not unknown:
            try:
                brought, added = moved(program, limits, errors), self._rounding(stage, limits)
            except InputError as error:
                unknown = f"stage {stage.name}: {error}"
        for output, cell in stage.results:
            self.reasons.pop(cell, None)
            there, here = arguments.get(output), self.fit.arguments.get(cell)
            if unknown:
                self.reasons[cell] = unknown
                continue
            if there is not None and clipped([there], here):
                self.reasons[cell] = f"its word does not hold all that {output} of {stage.name} may be"
                continue
            new = tuple(a + b for a, b in zip(brought[output], added[output], strict=True))
            self.errors[cell] = tuple(map(max, self.faster[cell], _rescale(new, there, here)))

    def _limits(self, stage: SystemStage, errors: Mapping[str, Errors]) -> dict[str, Fraction]:
        """Return the largest magnitudes of a stage's inputs, with their errors."""
        known = self.ranges.arguments_of(stage)
        return {
            name: known[name].unit * max(known[name].high, -known[name].low)
            + max(errors[name], default=Fraction(0))
            for name in errors
        }

    def _rounding(self, stage: SystemStage, limits: Mapping[str, Fraction]) -> dict[str, Errors]:
        """Return the bound of a stage's own rounding."""
        interface = self.fit.sources[stage.name].fixed
        if interface is not None:
            return {argument.signal.name: argument.errors for argument in interface.outputs}
        program = self.fit.description.programs[stage.name]
        plain = {
            signal.name: limits[signal.name]
            for signal in program.inputs
            if not signal.constraint and signal.name not in ROTATION_INPUTS
        }
        angle = max((limits[name] for name in ROTATION_INPUTS if name in limits), default=DEFAULT_ANGLE)
        result = rounding_bounds(
            program, TARGETS[self.fit.target].number, Settings(ranges=plain, largest_angle=angle)
        )
        if not result.errors:
            raise InputError(result.reason)
        return dict(result.errors)


def _rescale(errors: Errors, there: Argument | None, here: Argument | None) -> Errors:
    """Return the errors of integers after they are rescaled to the nearest: half a unit more where bits are lost."""
    if there is None or here is None or there.format.fraction <= here.format.fraction:
        return errors
    return tuple(error + here.format.unit / 2 for error in errors)


def moved(
    program: Program, limits: Mapping[str, Fraction], errors: Mapping[str, tuple[Fraction, ...]]
) -> dict[str, tuple[Fraction, ...]]:
    """Bound the change of every output when elements of inputs change by at most `errors`, or not at all.

    `limits` bound the inputs, changed and not. The bounds hold under the conditions that `rounding_bounds` states for
    the program, such as a norm near 1.

    >>> from strapgen import derive, lower
    >>> product = lower(derive("euler-product"))
    >>> bounds = moved(product, dict.fromkeys(("state", "transition"), Fraction(1)), {"state": (Fraction(1, 100),) * 4})
    >>> float(bounds["next"][0])
    0.04
    """
    by_element = {
        element: error
        for signal in program.inputs
        for element, error in zip(
            signal.elements, errors.get(signal.name, (Fraction(0),) * signal.size), strict=True
        )
    }
    if not any(by_element.values()):
        return {result.signal.name: (Fraction(0),) * result.signal.size for result in program.outputs}
    box = {
        name: Interval.symmetric(limits[signal.name]) for signal in program.inputs for name in signal.elements
    }
    expressions = Expressions.of(program)
    try:
        ranges = ExactRanges(program, expressions, box).ranges
        expressions, derivatives = _with_lengths(expressions, ranges)
        errors_at = {expressions.names[name]: error for name, error in by_element.items() if error}
        _require_settled(expressions, ranges, derivatives, errors_at)
    except NoBoundError as error:
        raise InputError(f"{program.kernel}: {error}") from None
    except ArithmeticError:
        raise InputError(f"{program.kernel}: its values may overflow") from None
    return {
        output.signal.name: tuple(
            _move(expressions, derivatives, place, errors_at)
            for place in expressions.results[output.signal.name]
        )
        for output in program.outputs
    }


def _move(
    expressions: Expressions,
    derivatives: Sequence[tuple[Interval, ...]],
    place: int,
    errors_at: Mapping[int, Fraction],
) -> Fraction:
    """Return the change of an operation due to the errors of inputs, which are known by their places."""
    moves = sensitivities(expressions, derivatives, place)
    return sum((moves.get(k, Fraction(0)) * error for k, error in errors_at.items()), Fraction(0))


def _with_lengths(
    expressions: Expressions, ranges: Sequence[Interval]
) -> tuple[Expressions, list[tuple[Interval, ...]]]:
    """Return operations and their slopes, where a root that may be zero is the length of the numbers squared under it.

    The root has no derivative at zero; a length moves by no more than its parts do.
    """
    items, derivatives = [*expressions.items], slopes(expressions, ranges)
    for place, item in enumerate(items):
        if item.kind != "sqrt" or ranges[place].low > 0:
            continue
        parts = tuple(expressions.squared(item.arguments[0]))
        if not parts:
            raise NoBoundError(f"the radicand in {expressions.labels[place]} may be zero")
        items[place] = Expression("length", parts)
        derivatives[place] = (Interval.of(-1, 1),) * len(parts)
    return replace(expressions, items=items), derivatives


def _require_settled(
    expressions: Expressions,
    ranges: Sequence[Interval],
    derivatives: Sequence[tuple[Interval, ...]],
    errors_at: Mapping[int, Fraction],
) -> None:
    """Refuse a comparison that the errors of inputs may turn: another value is selected then."""
    for place, item in enumerate(expressions.items):
        if item.kind != "select":
            continue
        condition = expressions.items[item.arguments[0]]
        if condition.kind == "at_least":
            left, right = condition.arguments
            apart = ranges[left] - ranges[right]
            moves = any(_move(expressions, derivatives, k, errors_at) for k in (left, right))
            if not moves or apart.low >= 0 or apart.high < 0:
                continue
        raise NoBoundError(f"an error of its input may turn a comparison in {expressions.labels[place]}")
