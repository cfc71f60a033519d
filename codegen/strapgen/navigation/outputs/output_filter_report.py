"""The responses of an output's filter, as a result and drawn."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from strapgen.navigation.outputs.output_filter import decibels
from strapgen.navigation.outputs.output_filter_study import FilterStudy, Measured
from strapgen.results import figures
from strapgen.results.records import INTERNAL
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

_DB = ".5f"
_CARRIES = {"": "", "none": ", no feedback", "all": ", feedback"}


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
class MeasuredResponse:
    """What a back end makes of the filter."""

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

    @staticmethod
    def of(one: Measured) -> MeasuredResponse:
        """Return gains and phases."""
        gains = [_finite(decibels(response)) for response in one.responses]
        phases = [math.atan2(response.imag, response.real) for response in one.responses]
        settled = (one.constant, one.rest, one.bound, one.unit)
        return MeasuredResponse(one.backend, one.carry or None, gains, phases, *settled)


@dataclass(frozen=True)
class FilterResult(Result):
    """The responses of an output's filter: analog, digital and measured."""

    drawn_by = f"{__name__}:output_filter_image"

    study: FilterStudy = field(metadata=INTERNAL)
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
    measured: list[MeasuredResponse]

    @staticmethod
    def of(study: FilterStudy) -> FilterResult:
        """Return the responses of a study."""
        edge = study.output_filter
        same = ("cutoff_hz", "sample_hz", "coefficients", "numerator", "denominator", "analog_delay_s")
        return FilterResult(
            study=study,
            **{name: getattr(edge, name) for name in (*same, "digital_delay_s")},
            state_ranges=[study.largest * part for part in edge.state_ranges],
            responses=[
                KnownResponse(f, _finite(decibels(edge.analog(f))), _finite(decibels(edge.digital(f))))
                for f in study.frequencies
            ],
            measured=list(map(MeasuredResponse.of, study.measured)),
        )

    def rows(self) -> Sequence[float]:
        """Return the frequencies."""
        return self.study.frequencies

    def table(self) -> TextTable:
        """Return the gain at each frequency in dB."""
        return _responses(self.study)

    def text(self) -> str:
        """Return coefficients, responses, and what is left once settled."""
        return "\n".join(_lines(self.study))


def output_filter_image(result: FilterResult, path: str | Path) -> bytes:
    """Return the responses over frequency: analog and digital as lines, measured ones as points."""
    study, edge = result.study, result.study.output_filter
    figure, grid = figures.grid_of_axes(1, 1, (8.5, 4.4))
    axes = grid[0, 0]
    low = min(edge.cutoff_hz, *study.frequencies) / 3
    line = np.geomspace(low, 0.999 * edge.sample_hz / 2, 400)
    for name, response, style in (("analog", edge.analog, "--"), ("digital", edge.digital, "-")):
        axes.plot(line, [decibels(response(f)) for f in line], style, color="0.35", linewidth=1.2, label=name)
    for number, measured in enumerate(study.measured):
        gains = [decibels(response) for response in measured.responses]
        axes.plot(
            *(study.frequencies, gains, "osD^v<>"[number % 7]),
            color=figures.several_colours(number + 1)[-1],
            markersize=9 - min(6, number),
            fillstyle="none",
            label=_name(measured),
        )
    axes.set_xscale("log")
    lowest = min(decibels(edge.digital(f)) for f in (*study.frequencies, edge.cutoff_hz))
    axes.set_ylim(max(-120, lowest) - 10, 5)
    axes.set_xlabel("frequency, Hz")
    axes.set_ylabel("gain, dB")
    figures.style(axes)
    figures.common_legend(figure, [axes], loc="outside right center")
    figures.title(
        figure, f"Butterworth filter of second order, {edge.cutoff_hz:g} Hz at {edge.sample_hz:g} Hz"
    )
    return figures.image(figure, path)


def _name(measured: Measured) -> str:
    return measured.backend + _CARRIES[measured.carry]


def _responses(study: FilterStudy) -> TextTable:
    """Return the gain of each frequency in dB."""
    columns = [Column("Hz", spec="g"), Column("analog, dB", spec=_DB), Column("digital, dB", spec=_DB)]
    columns += [Column(_name(measured), spec=_DB) for measured in study.measured]
    rows = []
    for number, frequency in enumerate(study.frequencies):
        known = (study.output_filter.analog(frequency), study.output_filter.digital(frequency))
        responses = (*known, *(measured.responses[number] for measured in study.measured))
        rows.append([frequency, *map(decibels, responses)])
    return TextTable(columns, rows)


def _settled(study: FilterStudy) -> TextTable:
    """Return what is left of a constant and of nothing."""
    columns = [
        Column("back end", "<"),
        *(Column(name, spec=".3g") for name in ("constant", "rest", "bound", "bit")),
    ]
    rows = [[_name(m), m.constant, m.rest, m.bound, m.unit] for m in study.measured]
    return TextTable(columns, rows)


def _lines(study: FilterStudy) -> Iterator[str]:
    edge = study.output_filter
    yield f"Butterworth filter of second order, {edge.cutoff_hz:g} Hz, {edge.sample_hz:g} samples in a second"
    names = [f"{name} {value:.10f}" for name, value in edge.coefficients.items()]
    yield f"coefficients of the kernel: {', '.join(names)}"
    _, a1, a2 = edge.denominator
    yield f"b0 {edge.numerator[0]:.10f}, a1 {a1:.10f}, a2 {a2:.10f}"
    analog, digital = 1e3 * edge.analog_delay_s, 1e3 * edge.digital_delay_s
    yield f"delay of slow changes: analog {analog:.4f} ms, digital {digital:.4f} ms"
    first, second = (study.largest * part for part in edge.state_ranges)
    yield f"ranges for samples up to {study.largest:g}: first {first:.6g}, second {second:.6g}"
    yield from ["", *_responses(study).lines(), ""]
    yield "errors of a constant input and of none, once settled, and the bound of a run of any length"
    yield from ["", *_settled(study).lines()]
