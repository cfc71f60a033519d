"""Reports mean rates under vibration as plain data, text and LaTeX."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from strapgen.analysis.vibration import Assessment
from strapgen.analysis.vibration.mean_rates import Rates
from strapgen.ir.exceptions import InputError
from strapgen.results.display.expressions import expression_latex
from strapgen.results.display.latex import equations
from strapgen.results.records import entry
from strapgen.results.result import Result
from strapgen.results.table import READABLE_UNITS, Column, TextTable

if TYPE_CHECKING:
    from strapgen.analysis.vibration.mean_rates import Curve

#: The units as parts of the names of data.
_UNIT_SUFFIXES = {"rad/s": "rad_s", "m/s^2": "m_s2"}
#: The name of the fast loop and the slow loop together.
_TWO_SPEED = "two-speed"
_FAST_LOOP_NOTE = (
    "continuous and computed are the part of the fast loop within a slow cycle T_m; the slow loop adds the term in T_m "
    "to both, so that the error is that of both loops"
)
#: What of Savage's paper is repaired behind the rates of a unit.
_REPAIRS = {
    "rad/s": (
        "drift has the sign of the angles as (65) of the source prints them; it prints (66) to (68) and (75) to (78) "
        "with the other"
    ),
    "m/s^2": (
        "the accelerations (69) to (72) of the source are reconstructed, their page is not in the scan; it prints the "
        "errors (81) and (83) with the other sign"
    ),
}


@dataclass(frozen=True)
class AssessedCase:
    """An assessment in a report."""

    assessment: Assessment
    #: Fast cycles in a step of an algorithm in two speeds; None for any other algorithm
    cycles: int | None
    #: Samples in a step
    samples: int

    @property
    def label(self) -> str:
        """The kernel, with its fast cycles if it has any."""
        return self.assessment.kernel + ("" if self.cycles is None else f", {self.cycles} cycles")

    @property
    def quantity(self) -> str:
        """The quantity that is assessed, "drift" or "sculling"."""
        return "drift" if self.assessment.unit == "rad/s" else "sculling"

    @property
    def is_fast_loop(self) -> bool:
        """Whether the algorithm is a fast loop alone."""
        return self.cycles is not None and self.assessment.kernel != _TWO_SPEED

    def moved(self, transfers: set[str]) -> bool:
        """Return whether a spectrum with these transfer functions excites the channels of this case."""
        if self.assessment.unit == "rad/s":
            return {"angle_x", "angle_y"} <= transfers
        return {"angle_x", "acceleration_y"} <= transfers or {"angle_y", "acceleration_x"} <= transfers


@dataclass(frozen=True)
class CaseRates:
    """The mean rates of a case."""

    case: AssessedCase
    #: In the unit of the assessment
    rates: Rates
    #: Estimates of the error of quadrature under random vibration; None at one frequency
    quadrature: Rates | None = None


class ClosedForms(NamedTuple):
    """Closed forms of a mean rate, as text that SymPy can read."""

    computed: str
    continuous: str


@dataclass(frozen=True)
class VibrationRates:
    """The mean rates of one algorithm about z; those in rad/s are drift, those in m/s^2 sculling."""

    #: The true rate
    continuous_rad_s: float | None = field(default=None, metadata=entry(optional=True))
    #: The rate of the algorithm
    computed_rad_s: float | None = field(default=None, metadata=entry(optional=True))
    #: The latter less the former
    error_rad_s: float | None = field(default=None, metadata=entry(optional=True))
    #: Estimates of the error of quadrature, under random vibration
    continuous_quadrature_rad_s: float | None = field(default=None, metadata=entry(optional=True))
    computed_quadrature_rad_s: float | None = field(default=None, metadata=entry(optional=True))
    error_quadrature_rad_s: float | None = field(default=None, metadata=entry(optional=True))
    continuous_m_s2: float | None = field(default=None, metadata=entry(optional=True))
    computed_m_s2: float | None = field(default=None, metadata=entry(optional=True))
    error_m_s2: float | None = field(default=None, metadata=entry(optional=True))
    continuous_quadrature_m_s2: float | None = field(default=None, metadata=entry(optional=True))
    computed_quadrature_m_s2: float | None = field(default=None, metadata=entry(optional=True))
    error_quadrature_m_s2: float | None = field(default=None, metadata=entry(optional=True))
    kernel: str = ""
    #: Samples in a step
    increments: int = 0
    #: At one frequency
    drift_closed_form: ClosedForms | None = field(default=None, metadata=entry(optional=True))
    #: At one frequency
    sculling_closed_form: ClosedForms | None = field(default=None, metadata=entry(optional=True))


def vibration_rates(outcomes: Sequence[CaseRates]) -> list[VibrationRates]:
    """Return the mean rates of each algorithm."""
    groups: dict[str, list[CaseRates]] = {}
    for outcome in outcomes:
        groups.setdefault(outcome.case.label, []).append(outcome)
    return [_algorithm_rates(group) for group in groups.values()]


def _algorithm_rates(group: Sequence[CaseRates]) -> VibrationRates:
    """Return the rates of one algorithm, and their closed forms at one frequency."""
    first = group[0].case
    data: dict[str, Any] = {"kernel": first.assessment.kernel, "increments": first.samples}
    for outcome in group:
        unit, assessment = _UNIT_SUFFIXES[outcome.case.assessment.unit], outcome.case.assessment
        data |= {f"{part}_{unit}": value for part, value in outcome.rates._asdict().items()}
        if outcome.quadrature is not None:
            errors = outcome.quadrature._asdict()
            data |= {f"{part}_quadrature_{unit}": value for part, value in errors.items()}
        else:
            forms = ClosedForms(assessment.text("computed"), assessment.text("continuous"))
            data[f"{outcome.case.quantity}_closed_form"] = forms
    return VibrationRates(**data)


def vibration_text(outcomes: Sequence[CaseRates], title: str) -> str:
    """Return mean rates as text: tables for drift and sculling, and closed forms where one algorithm is assessed."""
    lines = [f"mean rates about z, to second order in the amplitudes; {title}"]
    for unit in READABLE_UNITS:
        group = [outcome for outcome in outcomes if outcome.case.assessment.unit == unit]
        if group:
            lines += ["", *_rate_table(group, unit).lines()]
    if any(outcome.case.is_fast_loop for outcome in outcomes):
        lines += ["", _FAST_LOOP_NOTE]
    units = {outcome.case.assessment.unit for outcome in outcomes}
    lines += ["", *(note for unit, note in _REPAIRS.items() if unit in units)]
    one_algorithm = len({outcome.case.label for outcome in outcomes}) == 1
    if one_algorithm and all(outcome.quadrature is None for outcome in outcomes):
        for outcome in outcomes:
            assessment = outcome.case.assessment
            lines += ["", f"closed form of the {outcome.case.quantity} rate in {assessment.unit}"]
            lines += [f"  continuous = {assessment.text('continuous')}"]
            lines += [f"  computed   = {assessment.text('computed')}"]
    return "\n".join(lines)


class UnknownForms(NamedTuple):
    """Closed forms of a mean rate in the unknowns of a kernel, as text that SymPy can read."""

    computed: str
    continuous: str
    error: str


@dataclass(frozen=True)
class UnknownRates:
    """The mean rate of a kernel with unknowns."""

    kernel: str
    #: Samples in a step
    increments: int
    unknowns: tuple[str, ...]
    drift_closed_form: UnknownForms | None = field(metadata=entry(optional=True))
    sculling_closed_form: UnknownForms | None = field(metadata=entry(optional=True))


@dataclass(frozen=True)
class ClosedFormsResult(Result):
    """Mean rates of kernels with unknowns in closed form, without numbers: a row for each."""

    row: ClassVar[type | None] = UnknownRates

    cases: Sequence[AssessedCase]

    def rows(self) -> list[UnknownRates]:
        """Return the rates."""
        rows = []
        for case in self.cases:
            text, unknowns = case.assessment.text, case.assessment.unknowns
            forms = UnknownForms(text("computed"), text("continuous"), text("error"))
            both = (forms, None) if case.quantity == "drift" else (None, forms)
            rows.append(UnknownRates(case.assessment.kernel, case.samples, unknowns, *both))
        return rows

    def text(self) -> str:
        """Return the closed forms."""
        lines = ["mean rates about z, to second order in the amplitudes, in closed form"]
        for case in self.cases:
            lines += ["", f"{case.label}, {case.quantity} rate in {case.assessment.unit}"]
            unknowns = ", ".join(case.assessment.unknowns)
            lines += [f"  unknowns   = {unknowns or 'none'}"]
            lines += [
                f"  {part:10} = {case.assessment.text(part)}" for part in ("continuous", "computed", "error")
            ]
        return "\n".join(lines)


def _rate_table(group: Sequence[CaseRates], unit: str) -> TextTable:
    """Return the rates of one unit, each above its error of quadrature if there is one."""
    readable, factor = READABLE_UNITS[unit]
    rows: list[list[Any]] = []
    for outcome in group:
        label, error = outcome.case.label, outcome.rates.error * factor
        if not math.isfinite(error):
            raise InputError(
                f"{label}: the error in {readable} is beyond the range of double; take smaller amplitudes"
            )
        rows.append([label, *outcome.rates, error])
        if outcome.quadrature is not None:
            rows.append(["  quadrature", *(f"{value:.1e}" for value in outcome.quadrature), ""])
    columns = [
        Column(group[0].case.quantity, "<"),
        *(
            Column(f"{part}, {unit}", spec=".9e", least=least)
            for part, least in zip(Rates._fields, (19, 18, 18), strict=True)
        ),
        Column(f"error, {readable}", spec=".6g", least=18),
    ]
    return TextTable(columns, rows)


@dataclass(frozen=True)
class VibrationResult(Result):
    """Mean rates of algorithms under vibration, computed and true."""

    each: ClassVar[type | None] = VibrationRates
    drawn_by: ClassVar[str] = "strapgen.analysis.analysis_plots:vibration_image"

    outcomes: Sequence[CaseRates]
    cases: Sequence[AssessedCase]
    #: The vibration in words
    title: str
    #: Errors over frequency for a plot, by the label of the algorithm, with a title and the frequency in Hz to mark
    curves: Sequence[tuple[str, Curve]] = ()
    plot_title: str = ""
    marked_hz: float | None = None

    def results(self) -> list[VibrationRates]:
        """Return the rates of each algorithm."""
        return vibration_rates(self.outcomes)

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each quantity of each algorithm."""
        return list(map(_flat, self.outcomes))

    def text(self) -> str:
        """Return tables for drift and sculling, and closed forms where one algorithm is assessed."""
        return vibration_text(self.outcomes, self.title)

    def latex(self) -> str:
        """Return the closed forms."""
        return vibration_latex(self.cases)


def _flat(outcome: CaseRates) -> dict[str, Any]:
    """Return the rates of one case as one row."""
    case = outcome.case
    row = {"kernel": case.assessment.kernel, "increments": case.samples, "quantity": case.quantity}
    row |= {"unit": case.assessment.unit, **outcome.rates._asdict()}
    errors = {} if outcome.quadrature is None else outcome.quadrature._asdict()
    return row | {f"{part}_quadrature": value for part, value in errors.items()}


def vibration_latex(cases: Sequence[AssessedCase]) -> str:
    """Return the closed forms as one LaTeX align environment."""
    rows = []
    for case in cases:
        letter = r"\dot\phi_z" if case.quantity == "drift" else r"\dot v_z"
        for part in ("continuous", "computed", "error"):
            index = rf"\mathrm{{{part}}}" if len(cases) == 1 else rf"\mathrm{{{part},\ {case.label}}}"
            rows.append((f"{letter}^{{{index}}}", expression_latex(case.assessment.expression(part))))
    return equations(rows)
