"""Measures the filter of an output on back ends with sines, and what is left of a constant and of nothing."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from strapgen import catalogue
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.outputs.output_filter import OutputFilter
from strapgen.run import backends as run
from strapgen.run.evaluators import Evaluator

Array = NDArray[np.float64]
KERNEL = "butterworth-2"
#: Largest sample that is run, as part of the range: sines and constants.
_PART = 0.75
#: Cycles at least in which a response is measured, and the most that a run may take.
_SHORTEST, _LONGEST = 200, 200_000


@dataclass(frozen=True)
class Measured:
    """What a back end makes of the filter."""

    #: The error feedback is "" in floating point
    backend: str
    carry: str
    #: Output over input at each frequency
    responses: tuple[complex, ...]
    #: Largest error of a constant input, once settled, in the unit of the samples
    constant: float
    #: Largest output after the input has become zero, once settled
    rest: float
    #: Certified bound of the output's error in a run of any length; None in floating point
    bound: float | None
    #: What a bit of the output is worth; None in floating point
    unit: float | None


@dataclass(frozen=True)
class FilterStudy:
    """The responses of a filter: analog, digital and measured."""

    output_filter: OutputFilter
    #: Largest magnitude of a sample
    largest: float
    #: In Hz
    frequencies: tuple[float, ...]
    measured: tuple[Measured, ...]


def runs(names: Iterable[str]) -> list[tuple[str, str]]:
    """Return back ends with their error feedback: in fixed point without and with it."""
    return [
        (name, carry)
        for name in dict.fromkeys(names)
        for carry in (("none", "all") if run.BACKENDS[name].fixed else ("",))
    ]


def check_frequencies(output_filter: OutputFilter, frequencies: Sequence[float]) -> tuple[float, ...]:
    """Return frequencies that the samples can have."""
    half = output_filter.sample_hz / 2
    for frequency in frequencies:
        if not 0 < frequency < half:
            raise InputError(
                f"frequency {frequency:g} Hz is not above 0 and below {half:g}, half of sample-hz"
            )
    if not frequencies:
        raise InputError("no frequency is named; at least one is needed")
    cycles = cycles_needed(output_filter, min(frequencies))
    if cycles > _LONGEST:
        raise InputError(
            f"the filter or the lowest frequency takes {cycles} cycles to measure; at most {_LONGEST} are run"
        )
    return tuple(frequencies)


def cycles_needed(output_filter: OutputFilter, lowest_hz: float) -> int:
    """Return the cycles of a run that settles twice, and then lasts three periods of the lowest frequency."""
    return 2 * output_filter.settling + max(_SHORTEST, math.ceil(3 * output_filter.sample_hz / lowest_hz))


def measure(
    which: Iterable[tuple[str, str]],
    output_filter: OutputFilter,
    largest: float,
    frequencies: Sequence[float],
) -> Iterator[Measured]:
    """Run the filter on back ends, its coefficients constants of the code.

    `frequencies`: in Hz.
    """
    for name, carry in which:
        evaluator = filter_evaluator(output_filter, largest, name, carry)
        yield _measured(evaluator, name, carry, output_filter, largest, frequencies)


def filter_evaluator(output_filter: OutputFilter, largest: float, name: str, carry: str = "") -> Evaluator:
    """Return the filter with its coefficients as constants, on a back end."""
    chosen = catalogue.choose(KERNEL, constants=output_filter.coefficients)
    entry = run.BACKENDS[name]
    if not entry.fixed:
        return run.evaluator(chosen, name)
    # A sixteenth above the ranges that exact arithmetic has, for what rounding adds.
    first, second = (Fraction(largest * part * 17 / 16) for part in output_filter.state_ranges)
    ranges = {"sample": Fraction(largest), "first": first, "second": second}
    return run.evaluator(chosen, name, Settings(word=entry.word or 32, carry=carry, ranges=ranges))


def _measured(
    evaluator: Evaluator,
    name: str,
    carry: str,
    output_filter: OutputFilter,
    largest: float,
    frequencies: Sequence[float],
) -> Measured:
    """Run sines, a constant, and a constant that becomes zero, side by side."""
    start = 2 * output_filter.settling
    cycles = cycles_needed(output_filter, min(frequencies))
    samples = _samples(output_filter, _PART * largest, frequencies, cycles)
    outputs = run_filter(evaluator, samples)
    angles = np.asarray(2 * math.pi * np.arange(start, cycles) / output_filter.sample_hz, np.float64)
    responses = tuple(
        complex(np.mean(_phasors(outputs[start:, k], angles * f) / _phasors(samples[start:, k], angles * f)))
        for k, f in enumerate(frequencies)
    )
    count = len(frequencies)
    last = outputs[start:]
    constant = float(np.abs(last[:, count] - samples[-1, count]).max())
    rest = float(np.abs(last[:, count + 1]).max())
    if evaluator.sources.fixed is None:
        return Measured(name, carry, responses, constant, rest, None, None)
    unit = float(evaluator.interface.outputs[-1].unit)
    bound = certified_bound(evaluator, output_filter)
    return Measured(name, carry, responses, constant, rest, bound, unit)


def certified_bound(evaluator: Evaluator, output_filter: OutputFilter) -> float:
    """Return by how much the output in fixed point may differ from that of exact arithmetic, in a run of any length.

    What a call adds to the errors of the states dies out as the filter forgets, and the sum of that is finite.
    """
    errors = [float(max(argument.errors)) for argument in evaluator.interface.outputs]
    first, second = output_filter.accumulated((errors[0], errors[1]))
    coefficients = output_filter.coefficients
    return float(coefficients["coupling"] * first + (1 - coefficients["square"]) * second + errors[2])


def _samples(output_filter: OutputFilter, size: float, frequencies: Sequence[float], cycles: int) -> Array:
    """Return samples (cycles, frequencies and 2, 3): sines, a constant, and one that ends once it has settled."""
    times = np.arange(cycles) / output_filter.sample_hz
    phases = 2 * np.pi * (np.multiply.outer(times, frequencies)[..., None] + np.arange(3) / 3)
    constant = np.broadcast_to(size * np.array([1.0, 0.371, -0.7377]), (cycles, 1, 3))
    ending = constant * (np.arange(cycles) < output_filter.settling)[:, None, None]
    return np.concatenate([size * np.sin(phases), constant, ending], axis=1)


def run_filter(evaluator: Evaluator, samples: Array) -> Array:
    """Run the filter from rest, its coefficients constants of the code.

    `samples` has shape (cycles, runs, 3). Returns (cycles, runs, 3).
    """
    outputs = np.empty(samples.shape)
    rows = evaluator.stored(-1, samples.reshape(-1, 3)).reshape(samples.shape)
    states = [np.zeros(samples.shape[1:], evaluator.number)] * 2
    feedback = evaluator.fresh(samples.shape[1])
    for number, row in enumerate(rows):
        (*states, filtered), feedback = evaluator.run([*states, row], feedback)
        outputs[number] = evaluator.in_si(-1, filtered)
    return outputs


def _phasors(values: Array, angles: Array) -> Array:
    """Return the complex amplitudes of the columns of values that follow a sine of angles."""
    design = np.stack([np.sin(angles), np.cos(angles), np.ones_like(angles)], axis=1)
    along, across, _ = np.linalg.lstsq(design, values, rcond=None)[0]
    return np.asarray(along + 1j * across)
