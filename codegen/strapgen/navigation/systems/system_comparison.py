"""Compares a described system on several back ends: along a run, and pass by pass with the certified bounds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from strapgen.ir.fixed_settings import Settings
from strapgen.ir.units import Sensor
from strapgen.navigation.systems.compiled_system import CompiledSystem
from strapgen.navigation.systems.system_agreement import PassAgreement, agreement, distance
from strapgen.navigation.systems.system_backends import SystemRun, system_runner
from strapgen.navigation.systems.system_runner import carried
from strapgen.navigation.systems.wiring import Description
from strapgen.results.records import entry
from strapgen.run.backends import BACKENDS


@dataclass(frozen=True)
class OutputComparison:
    """An output of a system on a back end beside a reference."""

    backend: str = field(metadata=entry("", align="<"))
    output: str = field(metadata=entry("output", align="<"))
    unit: str = field(metadata=entry("unit", align="<"))
    #: Largest difference of an element over the run, in the unit
    run: float = field(metadata=entry("run", ".3g"))
    #: Largest difference of an element after one pass from equal memories; None for a back end that runs no C
    one_pass: float | None = field(metadata=entry("one pass", ".3g"))
    #: Certified bound of that difference; None where there is none
    bound: float | None = field(metadata=entry("certified", ".3g"))
    #: Largest difference of one pass as a part of its bound
    share: float | None
    #: Why there is no bound
    reason: str


class RunsSamples(Protocol):
    """What runs a system: a back end, or files."""

    def run(self, inputs: Mapping[str, Any]) -> SystemRun:
        """Run cycles of the fastest rate, see `SystemRunner.run`."""


def compare_system(
    description: Description,
    names: Iterable[str],
    reference: str,
    inputs: Mapping[str, Any],
    settings: Settings | None = None,
    files: Mapping[str, RunsSamples] | None = None,
) -> list[OutputComparison]:
    """Run a system on back ends over the same samples and compare its outputs with those of a reference.

    `inputs` (cycles, shape): samples in SI units.
    """
    if settings is not None and settings.sensor is not None:
        inputs = {**inputs, **_counts(description, inputs, settings.sensor)}
    other = system_runner(description, reference, settings if BACKENDS[reference].fixed else None)
    expected = other.run(inputs).values
    rows = []
    runners: dict[str, RunsSamples] = {
        name: system_runner(description, name, settings if BACKENDS[name].fixed else None) for name in names
    }
    for name, runner in (runners | dict(files or {})).items():
        values = runner.run(inputs).values
        passes: PassAgreement | None = None
        if isinstance(runner, CompiledSystem):
            passes = agreement(runner, other, inputs)
        for output in description.system.outputs:
            signal = description.system.cell(output).signal
            difference = float(distance(signal, values[output], expected[output]).max(initial=0))
            rows.append(_row(name, output, signal.unit, difference, passes))
    return rows


def _counts(description: Description, inputs: Mapping[str, Any], sensor: Sensor) -> dict[str, Any]:
    """Return the angle increments in whole counts of a gyro, each with the rounding error of those before."""
    return {
        signal.name: carried(np.asarray(inputs[signal.name], float), sensor.count)
        for signal in description.system.inputs
        if signal.is_angle_increment
    }


def _row(
    backend: str, output: str, unit: str, difference: float, passes: PassAgreement | None
) -> OutputComparison:
    if passes is None:
        return OutputComparison(backend, output, unit, difference, None, None, None, "no pass of it is known")
    return OutputComparison(
        backend,
        output,
        unit,
        difference,
        passes.largest[output],
        passes.certified.get(output),
        passes.share.get(output),
        passes.reasons.get(output, ""),
    )
