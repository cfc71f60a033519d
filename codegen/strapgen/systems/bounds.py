"""Adds up the error bounds of stages along the wires: what one pass through a system may lose to rounding."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from strapgen.ir.fixed_interface import Argument
from strapgen.ir.fixed_settings import DEFAULT_ANGLE, TURNING, Settings
from strapgen.ir.system import Push, SystemStage
from strapgen.rounding import rounding_bounds
from strapgen.rounding.propagation import moved
from strapgen.support.exceptions import InputError
from strapgen.systems.fitting import Fitted, fitted
from strapgen.targets import TARGETS

Errors = tuple[Fraction, ...]


@dataclass(frozen=True)
class SystemBounds:
    """Bounds of the distance of one pass through a system from exact arithmetic on the same memory and samples.

    The pass is a cycle in which all rates fall together; in every other cycle fewer stages run, and the bounds hold
    for the cells that they write.

    Parameters
    ----------
    errors : mapping of str to tuple of Fraction
        A bound for every element of a cell, in its unit.
    reasons : mapping of str to str
        Why there is none, by the name of the cell.
    """

    errors: Mapping[str, Errors] = field(default_factory=dict)
    reasons: Mapping[str, str] = field(default_factory=dict)


def bounds(fit: Fitted) -> SystemBounds:
    """Return the error bounds of one pass through a system.

    Every stage has the bound of its own rounding, and passes on the errors of its inputs by at most its derivatives,
    which interval arithmetic bounds over the ranges of its inputs.

    Parameters
    ----------
    fit : Fitted
        The generated stages, in C of any number or as integer model.
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
    cleared: dict[str, Errors] = field(default_factory=dict)

    def run(self) -> SystemBounds:
        """Go through all rates, from the fastest."""
        system = self.fit.description.system
        self.errors = {cell.name: (Fraction(0),) * cell.signal.size for cell in system.cells}
        self.errors |= {signal.name: (Fraction(0),) * signal.size for signal in system.inputs}
        for rate in system.rates:
            for step in rate.steps:
                if isinstance(step, Push):
                    self._push(step)
                else:
                    self._call(step)
            for name in rate.cleared:
                self.cleared[name] = self.errors[name]
                self.errors[name] = (Fraction(0),) * len(self.errors[name])
        cells = [cell.name for cell in system.cells]
        known = {
            name: self.cleared.get(name, self.errors[name]) for name in cells if name not in self.reasons
        }
        return SystemBounds(known, {name: self.reasons[name] for name in cells if name in self.reasons})

    def _push(self, push: Push) -> None:
        """Put a new sample last; those before move."""
        new = self._wired(push.source, self.fit.arguments.get(push.cell))
        self.errors[push.cell] = self.errors[push.cell][len(new) :] + new
        if push.source in self.reasons:
            self.reasons[push.cell] = self.reasons[push.source]

    def _wired(self, source: str, here: Argument | None) -> Errors:
        """Return the errors at the end of a wire, rescaled to the format there."""
        there = self.fit.arguments.get(source)
        errors = self.errors[source]
        if there is None or here is None or there.format.fraction <= here.format.fraction:
            return errors
        return tuple(error + here.format.unit / 2 for error in errors)

    def _call(self, stage: SystemStage) -> None:
        """Add the rounding of a stage to what its inputs bring."""
        program = self.fit.description.programs[stage.name]
        arguments = self._arguments(self.fit, stage)
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
            if unknown:
                self.reasons[cell] = unknown
                continue
            self.errors[cell] = tuple(a + b for a, b in zip(brought[output], added[output], strict=True))
            there, here = arguments.get(output), self.fit.arguments.get(cell)
            if there is not None and here is not None and there.format.fraction > here.format.fraction:
                self.errors[cell] = tuple(error + here.format.unit / 2 for error in self.errors[cell])

    def _arguments(self, fit: Fitted, stage: SystemStage) -> dict[str, Argument]:
        interface = fit.sources[stage.name].fixed
        if interface is None:
            return {}
        return {a.signal.name: a for a in (*interface.inputs, *interface.outputs)}

    def _limits(self, stage: SystemStage, errors: Mapping[str, Errors]) -> dict[str, Fraction]:
        """Return the largest magnitudes of a stage's inputs, with their errors."""
        known = self._arguments(self.ranges, stage)
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
