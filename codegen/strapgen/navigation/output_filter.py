"""The Butterworth filter of second order before an output, and its responses on back ends, as a result and drawn."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from strapgen import catalogue
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.results import figures
from strapgen.results.records import INTERNAL
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.run import backends as run
from strapgen.run.evaluators import Evaluator

#: Damping coefficient of the filter.
_ROOT = math.sqrt(2)
#: Part of a response at which its sum is cut off.
_NEGLIGIBLE = 1e-16
#: Edges for which the filter is run, as part of the sampling rate; a lower one takes too long to settle.
LOWEST_EDGE = 1e-5


@dataclass(frozen=True)
class OutputFilter:
    """A Butterworth filter of second order, sampled by the bilinear transformation with its edge kept.

    >>> edge = OutputFilter(3.2, 50)
    >>> [round(b, 10) for b in edge.numerator], [round(a, 10) for a in edge.denominator]
    ([0.0312389237, 0.0624778474, 0.0312389237], [1.0, -1.4415303099, 0.5664860047])
    """

    #: Edge: the frequency that is damped by 3 dB
    cutoff_hz: float
    #: Samples in a second
    sample_hz: float

    def __post_init__(self) -> None:
        if not 0 < self.sample_hz < math.inf:
            raise InputError(f"sample-hz is {self.sample_hz:g}; a number above 0 is needed")
        low, high = LOWEST_EDGE * self.sample_hz, self.sample_hz / 2
        if not low <= self.cutoff_hz < high:
            raise InputError(
                f"cutoff-hz is {self.cutoff_hz:g}; at {self.sample_hz:g} samples in a second a filter has an edge "
                f"from {low:g} to below {high:g}"
            )

    @property
    def warped(self) -> float:
        """K = tan(pi fc/fs), half the angle of the edge in a cycle, prewarped."""
        return math.tan(math.pi * self.cutoff_hz / self.sample_hz)

    @property
    def coefficients(self) -> dict[str, float]:
        """The coefficients of the kernel ``butterworth-2``, by the names of its inputs."""
        K = self.warped
        n = 1 + _ROOT * K + K**2
        return {"loss": (_ROOT * K + K**2) / n, "coupling": K / n, "square": K**2 / n}

    @property
    def numerator(self) -> tuple[float, float, float]:
        """Coefficients b of the transfer function in 1/z."""
        b = self.coefficients["square"]
        return b, 2 * b, b

    @property
    def denominator(self) -> tuple[float, float, float]:
        """Coefficients 1, a1, a2 of the transfer function in 1/z."""
        K = self.warped
        n = 1 + _ROOT * K + K**2
        return 1.0, 2 * (K**2 - 1) / n, (1 - _ROOT * K + K**2) / n

    @property
    def transition(self) -> NDArray[np.float64]:
        """How a cycle changes the states, (2, 2)."""
        loss, coupling, square = self.coefficients.values()
        return np.array([[1 - 2 * loss, -2 * coupling], [2 * coupling, 1 - 2 * square]])

    @property
    def settling(self) -> int:
        """Cycles after which earlier samples no longer matter in double precision."""
        return math.ceil(2 * math.log(_NEGLIGIBLE) / math.log(self.denominator[2]))

    @property
    def state_ranges(self) -> tuple[float, float]:
        """Largest magnitude of the first and of the second state for samples up to 1: the sums of their responses."""
        _, coupling, square = self.coefficients.values()
        response, total = np.array([2 * coupling, 2 * square]), np.zeros(2)
        for _ in range(self.settling):
            total += np.abs(response)
            response = self.transition @ response
        return float(total[0]), float(total[1])

    def accumulated(self, errors: tuple[float, float]) -> NDArray[np.float64]:
        """Return the largest errors of both states in a run of any length whose cycles each add up to `errors`."""
        power, total = np.eye(2), np.zeros((2, 2))
        for _ in range(self.settling):
            total += np.abs(power)
            power = self.transition @ power
        return np.asarray(total @ np.array(errors))

    def analog(self, frequency_hz: float) -> complex:
        """Return the response of the analog filter at a frequency."""
        s = 1j * frequency_hz / self.cutoff_hz
        return 1 / (s**2 + _ROOT * s + 1)

    def digital(self, frequency_hz: float) -> complex:
        """Return the response of the sampled filter at a frequency."""
        late = cmath.exp(-2j * math.pi * frequency_hz / self.sample_hz)
        top = sum(b * late**k for k, b in enumerate(self.numerator))
        return top / sum(a * late**k for k, a in enumerate(self.denominator))

    @property
    def analog_delay_s(self) -> float:
        """Delay of slow changes by the analog filter in s."""
        return _ROOT / (2 * math.pi * self.cutoff_hz)

    @property
    def digital_delay_s(self) -> float:
        """Delay of slow changes by the sampled filter in s."""
        return _ROOT / (2 * self.warped * self.sample_hz)


def decibels(response: complex) -> float:
    """Return the magnitude of a response in dB; -inf for none.

    >>> decibels(0.1)
    -20.0
    """
    return 20 * math.log10(abs(response)) if response else -math.inf


Array = NDArray[np.float64]
KERNEL = "butterworth-2"
#: Largest sample that is run, as part of the range: sines and constants.
_PART = 0.75
#: Cycles at least in which a response is measured, and the most that a run may take.
_SHORTEST, _LONGEST = 200, 200_000


@dataclass(frozen=True)
class Measured:
    """The measured responses of the filter on a back end."""

    #: Output over input at each frequency
    responses: tuple[complex, ...] = field(metadata=INTERNAL)
    backend: str
    #: Error feedback; None in floating point
    carry: str | None
    #: At each frequency; None for a gain of nothing
    gains_db: list[float | None]
    phases_rad: list[float]
    #: Largest error of a constant input, once settled
    constant: float
    #: Largest output after the input has become zero, once settled
    rest: float
    #: Certified bound of the error in a run of any length; None in floating point
    bound: float | None
    #: What a bit of the output is worth; None in floating point
    unit: float | None

    @property
    def label(self) -> str:
        """The back end with its error feedback."""
        return self.backend + _CARRIES[self.carry]


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
    gains = [_finite(decibels(response)) for response in responses]
    phases = [math.atan2(response.imag, response.real) for response in responses]
    bound, unit = None, None
    if evaluator.sources.fixed is not None:
        unit = float(evaluator.interface.outputs[-1].unit)
        bound = certified_bound(evaluator, output_filter)
    return Measured(responses, name, carry or None, gains, phases, constant, rest, bound, unit)


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


_DB = ".5f"
_CARRIES = {None: "", "none": ", no feedback", "all": ", feedback"}


def _finite(number: float) -> float | None:
    """Return a number, or None for one that JSON does not have."""
    return number if math.isfinite(number) else None


@dataclass(frozen=True)
class KnownResponse:
    """The gains of the filter at a frequency; None for none."""

    hz: float
    analog_db: float | None
    digital_db: float | None


@dataclass(frozen=True)
class FilterResult(Result):
    """The responses of an output's filter: analog, digital and measured."""

    drawn_by: ClassVar[str] = f"{__name__}:output_filter_image"

    output_filter: OutputFilter = field(metadata=INTERNAL)
    #: Largest magnitude of a sample
    largest: float = field(metadata=INTERNAL)
    cutoff_hz: float
    sample_hz: float
    #: Coefficients of the kernel by name
    coefficients: Mapping[str, float]
    numerator: tuple[float, ...]
    denominator: tuple[float, ...]
    #: Delay of slow changes
    analog_delay_s: float
    digital_delay_s: float
    #: Largest magnitudes of the states
    state_ranges: list[float]
    responses: list[KnownResponse]
    measured: list[Measured]

    @staticmethod
    def of(
        edge: OutputFilter, largest: float, frequencies: Sequence[float], measured: list[Measured]
    ) -> FilterResult:
        """Return the responses of a filter for samples up to a size, at frequencies in Hz."""
        same = ("cutoff_hz", "sample_hz", "coefficients", "numerator", "denominator", "analog_delay_s")
        return FilterResult(
            output_filter=edge,
            largest=largest,
            **{name: getattr(edge, name) for name in (*same, "digital_delay_s")},
            state_ranges=[largest * part for part in edge.state_ranges],
            responses=[
                KnownResponse(f, _finite(decibels(edge.analog(f))), _finite(decibels(edge.digital(f))))
                for f in frequencies
            ],
            measured=measured,
        )

    def rows(self) -> list[float]:
        """Return the frequencies."""
        return [one.hz for one in self.responses]

    def table(self) -> TextTable:
        """Return the gain at each frequency in dB."""
        columns = [Column("Hz", spec="g"), Column("analog, dB", spec=_DB), Column("digital, dB", spec=_DB)]
        columns += [Column(one.label, spec=_DB) for one in self.measured]
        rows = []
        for number, frequency in enumerate(self.rows()):
            known = (self.output_filter.analog(frequency), self.output_filter.digital(frequency))
            responses = (*known, *(one.responses[number] for one in self.measured))
            rows.append([frequency, *map(decibels, responses)])
        return TextTable(columns, rows)

    def text(self) -> str:
        """Return coefficients, responses, and the error after settling."""
        return "\n".join(_lines(self))


def output_filter_image(result: FilterResult, path: str | Path) -> bytes:
    """Return the responses over frequency: analog and digital as lines, measured ones as points."""
    edge, frequencies = result.output_filter, result.rows()
    figure, grid = figures.grid_of_axes(1, 1, (8.5, 4.4))
    axes = grid[0, 0]
    low = min(edge.cutoff_hz, *frequencies) / 3
    line = np.geomspace(low, 0.999 * edge.sample_hz / 2, 400)
    for name, response, style in (("analog", edge.analog, "--"), ("digital", edge.digital, "-")):
        axes.plot(line, [decibels(response(f)) for f in line], style, color="0.35", linewidth=1.2, label=name)
    for number, measured in enumerate(result.measured):
        gains = [decibels(response) for response in measured.responses]
        axes.plot(
            *(frequencies, gains, "osD^v<>"[number % 7]),
            color=figures.several_colours(number + 1)[-1],
            markersize=9 - min(6, number),
            fillstyle="none",
            label=measured.label,
        )
    axes.set_xscale("log")
    lowest = min(decibels(edge.digital(f)) for f in (*frequencies, edge.cutoff_hz))
    axes.set_ylim(max(-120, lowest) - 10, 5)
    axes.set_xlabel("frequency, Hz")
    axes.set_ylabel("gain, dB")
    figures.style(axes)
    figures.common_legend(figure, [axes], loc="outside right center")
    figures.title(
        figure, f"Butterworth filter of second order, {edge.cutoff_hz:g} Hz at {edge.sample_hz:g} Hz"
    )
    return figures.image(figure, path)


def _lines(result: FilterResult) -> Iterator[str]:
    edge = result.output_filter
    yield f"Butterworth filter of second order, {edge.cutoff_hz:g} Hz, {edge.sample_hz:g} samples in a second"
    names = [f"{name} {value:.10f}" for name, value in edge.coefficients.items()]
    yield f"coefficients of the kernel: {', '.join(names)}"
    _, a1, a2 = edge.denominator
    yield f"b0 {edge.numerator[0]:.10f}, a1 {a1:.10f}, a2 {a2:.10f}"
    analog, digital = 1e3 * edge.analog_delay_s, 1e3 * edge.digital_delay_s
    yield f"delay of slow changes: analog {analog:.4f} ms, digital {digital:.4f} ms"
    first, second = result.state_ranges
    yield f"ranges for samples up to {result.largest:g}: first {first:.6g}, second {second:.6g}"
    yield from ["", *result.table().lines(), ""]
    yield "errors of a constant input and of none, once settled, and the bound of a run of any length"
    columns = [
        Column("back end", "<"),
        *(Column(name, spec=".3g") for name in ("constant", "rest", "bound", "bit")),
    ]
    rows = [[one.label, one.constant, one.rest, one.bound, one.unit] for one in result.measured]
    yield from ["", *TextTable(columns, rows).lines()]
