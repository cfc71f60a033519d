"""Adds up the error bounds of stages along the wires: what one pass through a system may lose to rounding."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from strapgen.fixedpoint.floating import rounding_bounds
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import DEFAULT_ANGLE, TURNING, Settings
from strapgen.ir.interfaces import Argument
from strapgen.navigation.systems.error_propagation import moved
from strapgen.navigation.systems.fitting import Fitted, clipped, fitted
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


def bounds(fit: Fitted) -> SystemBounds:
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
    """The errors along one pass, while they are worked out."""

    fit: Fitted
    ranges: Fitted
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
        new = self._wired(push.source, self.fit.arguments.get(push.cell))
        self.errors[push.cell] = self.errors[push.cell][len(new) :] + new
        if push.source in self.reasons:
            self.reasons[push.cell] = self.reasons[push.source]
        elif clipped(self.fit.held(push.source), self.fit.arguments.get(push.cell)):
            self.reasons[push.cell] = f"its word does not hold all that {push.source} may be"

    def _wired(self, source: str, here: Argument | None) -> Errors:
        """Return the errors at the end of a wire, rescaled to the format there."""
        return _rescaled(self.errors[source], self.fit.arguments.get(source), here)

    def _call(self, stage: SystemStage) -> None:
        """Add the rounding of a stage to what its inputs bring."""
        program = self.fit.description.programs[stage.name]
        arguments = self.fit.arguments_of(stage)
        unknown = next((self.reasons[w.source] for w in stage.wires if w.source in self.reasons), "")
        errors = {wire.input: self._wired(wire.source, arguments.get(wire.input)) for wire in stage.wires}
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
            self.errors[cell] = tuple(map(max, self.faster[cell], _rescaled(new, there, here)))

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
            if not signal.constraint and signal.name not in TURNING
        }
        angle = max((limits[name] for name in TURNING if name in limits), default=DEFAULT_ANGLE)
        result = rounding_bounds(
            program, TARGETS[self.fit.target].number, Settings(ranges=plain, largest_angle=angle)
        )
        if not result.errors:
            raise InputError(result.reason)
        return dict(result.errors)


def _rescaled(errors: Errors, there: Argument | None, here: Argument | None) -> Errors:
    """Return the errors of integers after they are rescaled to the nearest: half a unit more where bits are lost."""
    if there is None or here is None or there.format.fraction <= here.format.fraction:
        return errors
    return tuple(error + here.format.unit / 2 for error in errors)
