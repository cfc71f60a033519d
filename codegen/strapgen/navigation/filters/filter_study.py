"""The responses of a filter on back ends, as a result and drawn: that of a file, or the one before an output."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from strapgen import catalogue
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import float_above
from strapgen.navigation.filters.filter_file import Filter
from strapgen.navigation.filters.proof import ROOM, bounds
from strapgen.navigation.filters.sections import LOWEST_EDGE, Cascade, Prototype, Section, low_pass
from strapgen.results import figures
from strapgen.results.records import INTERNAL
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.run import backends as run
from strapgen.run.evaluators import Evaluator


@dataclass(frozen=True)
class OutputFilter(Cascade):
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
    def heading(self) -> str:
        """The filter in words."""
        return f"Butterworth filter of second order, {self.cutoff_hz:g} Hz, {self.sample_hz:g} samples in a second"

    @cached_property
    def designs(self) -> tuple[Prototype, ...]:  # type: ignore[override]
        """The one section."""
        response = Response("butterworth", 2, Fraction(self.cutoff_hz))
        return tuple(low_pass(response, Fraction(self.sample_hz)))

    @cached_property
    def coefficients(self) -> dict[str, float]:
        """The coefficients of the kernel ``butterworth-2``, by the names of its inputs."""
        (design,) = self.designs
        width = design.width or Fraction(0)
        n = 1 + width + design.square
        coupling = math.sqrt(design.square) / float(n)
        return {"loss": float(1 - 1 / n), "coupling": coupling, "square": float(design.square / n)}

    @cached_property
    def sections(self) -> tuple[Section, ...]:
        """The section with the coefficients of the kernel, as exact as their decimals."""
        loss, coupling, square = (Fraction(str(value)) for value in self.coefficients.values())
        return (Section(square, coupling, loss, coupling),)


AnyFilter = OutputFilter | Filter


def decibels(response: complex) -> float:
    """Return the magnitude of a response in dB; -inf for none.

    >>> decibels(0.1)
    -20.0
    """
    return 20 * math.log10(abs(response)) if response else -math.inf


Array = NDArray[np.float64]
#: Room that is tried above the ranges that exact arithmetic has, for what rounding adds.
_ROOMS = (ROOM, Fraction(3, 2), Fraction(3))
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


def usual_frequencies(one: AnyFilter) -> tuple[float, ...]:
    """Return frequencies at which a filter is measured: of a file its corners, with half and twice of each."""
    if isinstance(one, OutputFilter):
        return (0.32, 1, 3.2, 8, 10, 20)
    several = {design.hz * part for design in one.designs for part in (0.5, 1, 2)}
    return tuple(sorted(hertz for hertz in several if hertz < one.sample_hz / 2))


def check_frequencies(one: AnyFilter, frequencies: Sequence[float]) -> tuple[float, ...]:
    """Return frequencies that the samples can have."""
    half = one.sample_hz / 2
    for frequency in frequencies:
        if not 0 < frequency < half:
            raise InputError(
                f"frequency {frequency:g} Hz is not above 0 and below {half:g}, half of sample-hz"
            )
    if not frequencies:
        raise InputError("no frequency is named; at least one is needed")
    cycles = cycles_needed(one, min(frequencies))
    if cycles > _LONGEST:
        raise InputError(
            f"the filter or the lowest frequency takes {cycles} cycles to measure; at most {_LONGEST} are run"
        )
    return tuple(frequencies)


def cycles_needed(one: AnyFilter, lowest_hz: float) -> int:
    """Return the cycles of a run that settles twice, and then lasts three periods of the lowest frequency."""
    return 2 * one.settling + max(_SHORTEST, math.ceil(3 * one.sample_hz / lowest_hz))


def measure(
    which: Iterable[tuple[str, str]],
    one: AnyFilter,
    largest: float,
    frequencies: Sequence[float],
) -> Iterator[Measured]:
    """Run the filter on back ends, its coefficients constants of the code.

    `frequencies`: in Hz.
    """
    for name, carry in which:
        evaluator = filter_evaluator(one, largest, name, carry)
        yield _measured(evaluator, name, carry, one, largest, frequencies)


def filter_evaluator(one: AnyFilter, largest: float, name: str, carry: str = "") -> Evaluator:
    """Return the filter with its coefficients as constants, on a back end.

    In fixed point the ranges of the states hold what exact arithmetic needs and what errors add up to; a word too short
    for that is refused.
    """
    if isinstance(one, OutputFilter):
        chosen = catalogue.choose("butterworth-2", constants=one.coefficients)
    else:
        chosen = catalogue.choose("filter", layout=one)
    entry, proved = run.BACKENDS[name], bounds(one.sections)
    if not entry.fixed:
        return run.evaluator(chosen, name)
    word, size = entry.word or 32, Fraction(largest)
    for room in _ROOMS:
        ranges = {state: size * part * room for state, part in zip(one.states, proved.states, strict=True)}
        settings = Settings(word=word, carry=carry, ranges={**ranges, "sample": size})
        evaluator = run.evaluator(chosen, name, settings)
        errors = proved.errors(call_errors(evaluator)[:-1])
        needed = (size * part + error for part, error in zip(proved.states, errors, strict=True))
        if all(most <= room for most, room in zip(needed, ranges.values(), strict=True)):
            return evaluator
    raise InputError(f"words of {word} bits are too short for the filter: errors may exceed twice its states")


def call_errors(evaluator: Evaluator) -> list[Fraction]:
    """Return by how much one call may be wrong in each state and in the output."""
    return [max(argument.errors) for argument in evaluator.interface.outputs]


def _measured(
    evaluator: Evaluator,
    name: str,
    carry: str,
    one: AnyFilter,
    largest: float,
    frequencies: Sequence[float],
) -> Measured:
    """Run sines, a constant, and a constant that becomes zero, side by side."""
    start = 2 * one.settling
    cycles = cycles_needed(one, min(frequencies))
    samples = _samples(one, _PART * largest, frequencies, cycles)
    outputs = run_filter(evaluator, samples)
    angles = np.asarray(2 * math.pi * np.arange(start, cycles) / float(one.sample_hz), np.float64)
    responses = tuple(
        complex(np.mean(_phasors(outputs[start:, k], angles * f) / _phasors(samples[start:, k], angles * f)))
        for k, f in enumerate(frequencies)
    )
    count = len(frequencies)
    last = outputs[start:]
    settled = float(math.prod(part.low for part in one.sections)) * samples[-1, count]
    constant = float(np.abs(last[:, count] - settled).max())
    rest = float(np.abs(last[:, count + 1]).max())
    gains = [_finite(decibels(response)) for response in responses]
    phases = [math.atan2(response.imag, response.real) for response in responses]
    bound, unit = None, None
    if evaluator.sources.fixed is not None:
        unit = float(evaluator.interface.outputs[-1].unit)
        bound = certified_bound(evaluator, one)
    return Measured(responses, name, carry or None, gains, phases, constant, rest, bound, unit)


def certified_bound(evaluator: Evaluator, one: AnyFilter) -> float:
    """Return by how much the output in fixed point may differ from that of exact arithmetic, in a run of any length.

    What a call adds to the errors of the states dies out as the filter forgets, and the sum of that is finite. No limit
    cycle is larger, since exact arithmetic has none.
    """
    *states, output = call_errors(evaluator)
    return float_above(bounds(one.sections).output_error(states, output))


def _samples(one: AnyFilter, size: float, frequencies: Sequence[float], cycles: int) -> Array:
    """Return samples (cycles, frequencies and 2, 3): sines, a constant, and one that ends once it has settled."""
    times = np.arange(cycles) / float(one.sample_hz)
    phases = 2 * np.pi * (np.multiply.outer(times, frequencies)[..., None] + np.arange(3) / 3)
    constant = np.broadcast_to(size * np.array([1.0, 0.371, -0.7377]), (cycles, 1, 3))
    ending = constant * (np.arange(cycles) < one.settling)[:, None, None]
    return np.concatenate([size * np.sin(phases), constant, ending], axis=1)


def run_filter(evaluator: Evaluator, samples: Array) -> Array:
    """Run the filter from rest, its coefficients constants of the code.

    `samples` has shape (cycles, runs, 3). Returns (cycles, runs, 3).
    """
    outputs = np.empty(samples.shape)
    rows = evaluator.stored(-1, samples.reshape(-1, 3)).reshape(samples.shape)
    states = [np.zeros(samples.shape[1:], evaluator.number)] * (len(evaluator.function.inputs) - 1)
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

    drawn_by: ClassVar[str] = f"{__name__}:filter_image"

    filter: AnyFilter = field(metadata=INTERNAL)
    #: Largest magnitude of a sample
    largest: float = field(metadata=INTERNAL)
    cutoff_hz: float | None
    sample_hz: float
    #: Name in the file; None of the one before an output
    name: str | None
    #: Coefficients of the kernel by name
    coefficients: Mapping[str, float]
    numerator: tuple[float, ...]
    denominator: tuple[float, ...]
    #: Delay of slow changes; None where none pass
    analog_delay_s: float | None
    digital_delay_s: float | None
    #: Largest magnitudes of the states
    state_ranges: list[float]
    responses: list[KnownResponse]
    measured: list[Measured]

    @staticmethod
    def of(
        one: AnyFilter, largest: float, frequencies: Sequence[float], measured: list[Measured]
    ) -> FilterResult:
        """Return the responses of a filter for samples up to a size, at frequencies in Hz."""
        return FilterResult(
            filter=one,
            largest=largest,
            cutoff_hz=one.cutoff_hz if isinstance(one, OutputFilter) else None,
            sample_hz=float(one.sample_hz),
            name=None if isinstance(one, OutputFilter) else one.title,
            coefficients=one.coefficients,
            numerator=one.numerator,
            denominator=one.denominator,
            analog_delay_s=_finite(one.analog_delay_s),
            digital_delay_s=_finite(one.digital_delay_s),
            state_ranges=[float_above(Fraction(largest) * part) for part in bounds(one.sections).states],
            responses=[
                KnownResponse(f, _finite(decibels(one.analog(f))), _finite(decibels(one.digital(f))))
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
            known = (self.filter.analog(frequency), self.filter.digital(frequency))
            responses = (*known, *(one.responses[number] for one in self.measured))
            rows.append([frequency, *map(decibels, responses)])
        return TextTable(columns, rows)

    def text(self) -> str:
        """Return coefficients, responses, and the error after settling."""
        return "\n".join(_lines(self))


def filter_image(result: FilterResult, path: str | Path) -> bytes:
    """Return the responses over frequency: analog and digital as lines, measured ones as points."""
    one, frequencies = result.filter, result.rows()
    figure, grid = figures.grid_of_axes(1, 1, (8.5, 4.4))
    axes = grid[0, 0]
    corners = [design.hz for design in one.designs]
    line = np.geomspace(min(*corners, *frequencies) / 3, 0.999 * float(one.sample_hz) / 2, 400)
    line = np.sort(np.append(line, [hertz for hertz in corners if hertz < line[-1]]))
    for name, response, style in (("analog", one.analog, "--"), ("digital", one.digital, "-")):
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
    known = [decibels(one.digital(f)) for f in (*line[line <= max(*corners, *frequencies)], *frequencies)]
    axes.set_ylim(max(-120, min(known)) - 10, max(0, *known) + 5)
    axes.set_xlabel("frequency, Hz")
    axes.set_ylabel("gain, dB")
    figures.style(axes)
    figures.common_legend(figure, [axes], loc="outside right center")
    figures.title(figure, one.heading)
    return figures.image(figure, path)


def _lines(result: FilterResult) -> Iterator[str]:
    one = result.filter
    yield one.heading
    names = [f"{name} {value:.10f}" for name, value in one.coefficients.items()]
    yield f"coefficients of the kernel: {', '.join(names)}"
    if isinstance(one, OutputFilter):
        _, a1, a2 = one.denominator
        yield f"b0 {one.numerator[0]:.10f}, a1 {a1:.10f}, a2 {a2:.10f}"
    else:
        for letter, values in (("b", one.numerator), ("a", one.denominator)):
            yield f"{letter}: {', '.join(f'{value:.10g}' for value in values)}"
    if result.digital_delay_s is not None:
        analog, digital = 1e3 * one.analog_delay_s, 1e3 * one.digital_delay_s
        yield f"delay of slow changes: analog {analog:.4f} ms, digital {digital:.4f} ms"
    names = [f"{name} {size:.6g}" for name, size in zip(one.states, result.state_ranges, strict=True)]
    yield f"ranges for samples up to {result.largest:g}: {', '.join(names)}"
    yield from ["", *result.table().lines(), ""]
    yield "errors of a constant input and of none, once settled, and the bound of a run of any length"
    columns = [
        Column("back end", "<"),
        *(Column(name, spec=".3g") for name in ("constant", "rest", "bound", "bit")),
    ]
    rows = [[one.label, one.constant, one.rest, one.bound, one.unit] for one in result.measured]
    yield from ["", *TextTable(columns, rows).lines()]
