"""The command ``strapgen vibration`` assesses an algorithm under vibration."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import typer

from strapgen.cli import terminal
from strapgen.cli.option_groups import Excludes, Needs, OneOf, Rule, Shown, grouped, rules, stated
from strapgen.cli.options import ANY_STEP_OPTIONS, MethodOptions, Samples, SeveralMethods, option, samples
from strapgen.cli.output import Output, plot_option
from strapgen.cli.values import Number, Positive, written
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.analysis.vibration import Assessment
    from strapgen.analysis.vibration.mean_rates import Curve
    from strapgen.analysis.vibration.vibration_report import AssessedCase, CaseRates
    from strapgen.catalogue.methods.sensor_response import Response


#: What a response is on the command line.
RESPONSE_WORDS = (
    "a CSV file (frequency_hz, magnitude, and phase_deg or delay_s), or butterworth:ORDER:HZ, bessel:ORDER:HZ, "
    "second-order:HZ:DAMPING, fir:TAP:TAP, decimation:N, delay:S, instants; several with + between"
)
#: The options of before for a gyro of second order
_OLD = "Old: --response second-order:HZ:DAMPING."


def _old_option(name: str, metavar: str) -> Any:
    return option(name, metavar=metavar, help=_OLD, hidden=True)


GYRO_RULES = (
    Needs("--gyro-bandwidth-hz", "--gyro-damping"),
    Needs("--gyro-damping", "--gyro-bandwidth-hz"),
    Excludes("--response", "--gyro-bandwidth-hz"),
)


def say_old(words: str) -> None:
    """Name the option in place of those of before."""
    terminal.remark(f"strapgen: --gyro-bandwidth-hz and --gyro-damping are now --response {words}")


@dataclass(frozen=True)
class BandOptions:
    """Options of the band of the motion, and of the gyro."""

    panel: ClassVar[str] = "Band"
    rules: ClassVar[tuple[Rule, ...]] = (
        OneOf("--band --band-hz"),
        *GYRO_RULES,
        Needs("--band-hz --response --gyro-bandwidth-hz --spectrum", "--sample-hz"),
        Needs("--sample-hz", "--band-hz --response --gyro-bandwidth-hz --spectrum"),
    )

    band: Annotated[
        Positive | None,
        option("--band", metavar="RAD", help="Highest angular frequency of the rate in rad a sample."),
    ] = None
    band_hz: Annotated[
        Positive | None,
        option(
            "--band-hz",
            metavar="HZ",
            help="Highest frequency of the rate in Hz, in place of --band; it goes with --sample-hz.",
        ),
    ] = None
    sample_hz: Annotated[
        Positive | None, option("--sample-hz", metavar="HZ", help="Samples of the gyro in a second.")
    ] = None
    response: Annotated[
        str | None,
        option(
            "--response",
            metavar="FILE|WORDS",
            help=f"Response of the gyro, which the design takes out: {RESPONSE_WORDS}.",
        ),
    ] = None
    gyro_bandwidth_hz: Annotated[Positive | None, _old_option("--gyro-bandwidth-hz", "HZ")] = None
    gyro_damping: Annotated[Positive | None, _old_option("--gyro-damping", "RATIO")] = None

    def radians(self) -> Fraction:
        """Return the band in rad a sample."""
        from strapgen.catalogue.methods.sensor_response import PI

        if self.band is not None:
            band = Fraction(self.band)
        elif self.band_hz is None or self.sample_hz is None:
            raise InputError("a band is needed, as --band in rad a sample, or as --band-hz with --sample-hz")
        else:
            band = Fraction(round(2 * PI * self.band_hz / self.sample_hz * 10**6), 10**6)
        if band >= 3:
            raise InputError(
                f"the band is {float(band):g} rad a sample; a number below 3 is needed, pi is half the sampling rate"
            )
        return band

    def gyro(self) -> Response | None:
        """Return the response of the gyro; None if it is ideal."""
        words = self.response
        if self.gyro_bandwidth_hz is not None and self.gyro_damping is not None:
            words = f"second-order:{self.gyro_bandwidth_hz}:{self.gyro_damping}"
            say_old(words)
        if words is None or self.sample_hz is None:
            return None
        from strapgen.catalogue.methods.sensor_response import parse

        return parse("--response", words).at(Fraction(self.sample_hz))


_Text = str | None

#: Lowest and highest frequency of a plot, by the sampling frequency.
_PLOTTED = 1e-6, 100.0
#: The fast loop and the slow loop together.
_TWO_SPEED = "two-speed"


@dataclass(frozen=True)
class AssessedMethods(SeveralMethods):
    """Options that choose the methods to assess side by side, and the numbers of increments of each."""

    increments: Annotated[
        tuple[Samples, ...] | None,
        option(
            "--increments",
            metavar="N,...",
            help="Numbers of angle increments in a step, 1 to 8; enough: as many as each method needs; of a fast loop "
            "and of two-speed, the fast cycles in a slow cycle.  [default: 2]",
            read=samples,
        ),
    ] = None


@dataclass(frozen=True)
class VibrationSource:
    """Options of the vibration: at one frequency, or random with a spectrum from a file."""

    panel: ClassVar[str] = "Input"
    rules: ClassVar[tuple[Rule, ...]] = GYRO_RULES

    step: Annotated[
        Positive | None,
        option(
            "--step",
            metavar="S",
            help="Step length T in s; for a fast loop and two-speed, the length of the slow cycle.",
        ),
    ] = None
    frequency: Annotated[
        Positive | None, option("--frequency-hz", metavar="HZ", help="Frequency f of the vibration in Hz.")
    ] = None
    theta_x: Annotated[
        Number | None, option("--theta-x-rad", metavar="RAD", help="Amplitude X of the angle about x in rad.")
    ] = None
    theta_y: Annotated[
        Number | None, option("--theta-y-rad", metavar="RAD", help="Amplitude Y of the angle about y in rad.")
    ] = None
    phase: Annotated[
        Number | None, option("--phase-rad", metavar="RAD", help="Phase P in rad by which y leads x.")
    ] = None
    acceleration: Annotated[
        Number | None,
        option(
            "--acceleration-y",
            metavar="M_S2",
            help="Amplitude of the acceleration along y in m/s^2, to assess sculling as well.",
        ),
    ] = None
    spectrum: Annotated[
        Path | None,
        option(
            "--spectrum",
            metavar="FILE",
            help="CSV file of random vibration, in place of one frequency: columns frequency_hz, density, angle_x_rad, "
            "angle_x_phase_rad, ...",
        ),
    ] = None

    response: Annotated[
        tuple[str, ...] | None,
        option(
            "--response",
            metavar="FILE|WORDS,...",
            help=f"Response of the gyro through which the algorithm sees the angles, X,Y for one about each axis: "
            f"{RESPONSE_WORDS}.",
        ),
    ] = None
    gyro_bandwidth_hz: Annotated[
        tuple[Positive, ...] | None, _old_option("--gyro-bandwidth-hz", "HZ,...")
    ] = None
    gyro_damping: Annotated[tuple[Positive, ...] | None, _old_option("--gyro-damping", "RATIO,...")] = None

    def through_gyro(self, assessment: Assessment, samples: int) -> Assessment:
        """Return the assessment of an algorithm that sees the vibration through the gyro, if there is one.

        `samples`: samples of a step.
        """
        if not self._responses:
            return assessment
        from strapgen.analysis import vibration
        from strapgen.catalogue.methods.sensor_response import parse

        assert self.step is not None, "it is checked"
        x, y = (parse("--response", one).at(Fraction(samples / self.step)) for one in self._responses)
        return vibration.through_gyros(assessment, x, y)

    @cached_property
    def _responses(self) -> tuple[str, ...]:
        """The responses about x and y in words; one is that of both, and there may be none."""
        several = self.response or ()
        if self.gyro_bandwidth_hz is not None and self.gyro_damping is not None:
            most = max(len(self.gyro_bandwidth_hz), len(self.gyro_damping))
            numbers = (one * (most + 1 - len(one)) for one in (self.gyro_bandwidth_hz, self.gyro_damping))
            several = tuple(f"second-order:{hertz}:{ratio}" for hertz, ratio in zip(*numbers, strict=False))
        if len(several) > 2:
            raise InputError(
                f"--response is {written(several)!r}; one or two with a comma between are needed"
            )
        if self.gyro_bandwidth_hz is not None:
            say_old(written(several))
        return several * (3 - len(several)) if several else ()

    @property
    def gyro_words(self) -> str:
        """The gyro for a reader; empty without one."""
        return f", through {written(tuple(dict.fromkeys(self._responses)))}" if self._responses else ""

    def check(self) -> None:
        """Check that there is one frequency or a spectrum, with all that it needs."""
        if self.step is None:
            raise InputError("--step in s is needed")
        if self.spectrum is not None:
            return
        needed = {
            "--frequency-hz": self.frequency,
            "--theta-x-rad": self.theta_x,
            "--phase-rad": self.phase,
        }
        for name, value in needed.items():
            if value is None:
                raise InputError(f"{name} is needed, or a --spectrum")
        if self.theta_y is None and self.acceleration is None:
            raise InputError("--theta-y-rad is needed for the drift, or --acceleration-y for sculling")

    @property
    def amplitudes(self) -> dict[str, Any]:
        """The vibration at one frequency, by the parameters of its assessment."""
        return {
            "theta_x": self.theta_x,
            "theta_y": "0" if self.theta_y is None else self.theta_y,
            "phase": self.phase,
            "acceleration_y": "0" if self.acceleration is None else self.acceleration,
        }

    @property
    def words(self) -> str:
        """The amplitudes of the vibration at one frequency, for a reader."""
        words = f"amplitudes {self.theta_x} rad about x"
        words += "" if self.theta_y is None else f", {self.theta_y} rad about y"
        words += "" if self.acceleration is None else f", {self.acceleration} m/s^2 along y"
        return f"{words}, phase {self.phase} rad{self.gyro_words}"

    def rates(self, cases: list[AssessedCase]) -> tuple[list[CaseRates], str]:
        """Return the mean rates of every case that the vibration excites, and the vibration in words."""
        from strapgen.analysis import vibration
        from strapgen.analysis.vibration.vibration_report import CaseRates

        step = self.step
        assert step is not None, "it is needed"
        if self.spectrum is None:
            assert self.frequency is not None, "it is needed without a spectrum"
            outcomes = []
            for case in cases:
                rates = case.assessment.rates(self.frequency, step, cycles=case.cycles, **self.amplitudes)
                outcomes.append(CaseRates(case, rates))
            return outcomes, f"{self.frequency} Hz, {self.words}"
        shaken = vibration.read_spectrum(self.spectrum)
        outcomes = []
        for case in cases:
            if case.moved(set(shaken.transfers)):
                random = vibration.random_rates(case.assessment, shaken, step, cycles=case.cycles)
                outcomes.append(CaseRates(case, random.rates, random.quadrature))
        if not outcomes:
            raise InputError(
                f"{self.spectrum} moves {', '.join(shaken.transfers)}; angles about x and y, or an angle and "
                f"an acceleration across it, are needed for {cases[0].assessment.kernel}"
            )
        return (
            outcomes,
            f"spectrum {self.spectrum.name}, {shaken.edges[0]:g} to {shaken.edges[-1]:g} Hz{self.gyro_words}",
        )


@dataclass(frozen=True)
class VibrationOutput(Output):
    """Options for the output of the mean rates, and for a plot over frequency."""

    plot: Annotated[Path | None, plot_option("the errors over frequency")] = None
    span: Annotated[
        tuple[Positive, Positive] | None,
        option(
            "--plot-hz",
            metavar="LOW,HIGH",
            help="Lowest and highest frequency of the plot in Hz.  [default: up to half the sampling frequency]",
        ),
    ] = None

    def frequencies(self, sampling: float, marked: float) -> tuple[float, float]:
        """Return the ends of the plot in Hz, checked like the marked frequency against the sampling frequency."""
        low, high = sampling / 200, sampling / 2
        if self.span is not None:
            low, high = map(float, self.span)
        lowest, highest = (times * sampling for times in _PLOTTED)
        for name, end in (("--plot-hz", low), ("--plot-hz", high), ("--frequency-hz", marked)):
            if not lowest <= end <= highest < math.inf:
                raise InputError(
                    f"{name} is {end:g}; a plot takes {lowest:g} to {highest:g} Hz, "
                    f"{_PLOTTED[0]:g} to {_PLOTTED[1]:g} times the sampling frequency"
                )
        return low, high


@grouped
@rules(
    Excludes(
        "--spectrum",
        "--frequency-hz --theta-x-rad --phase-rad --theta-y-rad --acceleration-y --plot --plot-hz --format=latex",
    ),
    Needs("--plot-hz", "--plot"),
)
def vibration(
    algorithm: Annotated[
        str,
        typer.Argument(
            metavar="ALGORITHM",
            help="dcm, euler, cayley-klein, rotation-vector, sculling, a fast loop (coning-fast, sculling-fast-1, "
            "sculling-fast-2, two-speed-fast-1, two-speed-fast-2), two-speed (both loops), or a Python file of your "
            "own.",
        ),
    ],
    *,
    methods: Annotated[AssessedMethods, Shown(only=ANY_STEP_OPTIONS)],
    source: VibrationSource,
    output: VibrationOutput,
) -> None:
    """Show the drift of an algorithm under vibration.

    You see the computed mean drift rate about z, the true one, and the error. The angles are X sin(2 pi f t)
    about x and Y sin(2 pi f t + P) about y; an acceleration along y has the phase P too. The rates are closed forms to
    second order in the amplitudes, derived from the algorithm itself. Several methods, or numbers of increments, are
    shown side by side.

    For your own kernel with unknowns you see the closed forms alone.

    For a fast loop alone, the continuous and the computed rate leave out a term in the slow cycle T_m: the slow loop
    adds that to both, so that the error is that of both loops.

    Example: strapgen vibration euler --method coning-compressed --increments 4 --frequency-hz 10 --step 0.04
    --theta-x-rad 0.01 --theta-y-rad 0.01 --phase-rad 1.5 --acceleration-y 5
    """
    output.check(algorithm, *methods.files, source.spectrum)
    from strapgen.analysis.vibration.vibration_report import ClosedFormsResult, VibrationResult

    if cases := _cases_with_unknowns(algorithm, methods, source, output):
        output.show(ClosedFormsResult(cases))
        return
    source.check()
    cases = [case for method in methods.each() for case in _assess(algorithm, method, source)]
    outcomes, words = source.rates(cases)
    drawn = ((), "", None) if output.plot is None else _curves(cases, source, output)
    output.show(VibrationResult(outcomes, cases, f"{words}; step {source.step} s", *drawn))


def _cases_with_unknowns(
    algorithm: str, methods: AssessedMethods, source: VibrationSource, output: VibrationOutput
) -> list[AssessedCase]:
    """Return the cases of a user's kernel with unknowns, whose rates have closed forms but no numbers."""
    if not algorithm.endswith(".py"):
        return []
    choices = methods.choices(algorithm, step=False)
    if not any(choice.user_kernel is not None and choice.user_kernel.unknowns for choice in choices):
        return []
    if output.plot or source.spectrum or output.format not in ("text", "json"):
        raise InputError(
            f"{algorithm} holds unknowns: its rates have closed forms, as text or json, and no numbers"
        )
    source = replace(source, theta_y=source.theta_y or Number("0"))
    return [case for method in methods.each() for case in _assess(algorithm, method, source)]


def _check_known(algorithm: str, names: tuple[str, ...]) -> None:
    """Check that an algorithm is one that can be assessed: a name, or a user's."""
    from strapgen import catalogue
    from strapgen.catalogue.user import loading

    if algorithm in names or algorithm.endswith(".py") or algorithm in loading.installed():
        return
    if algorithm not in catalogue.reserved():
        checks.choice("algorithm", algorithm, names, "a Python file")
    raise InputError(
        f"algorithm {algorithm!r} has no rate under vibration; allowed: {', '.join(names)}, or a Python file"
    )


def _assess(algorithm: str, method: MethodOptions, source: VibrationSource) -> list[AssessedCase]:
    """Return a case for each requested quantity of an algorithm."""
    from strapgen.analysis.vibration import assessment, systems
    from strapgen.analysis.vibration.vibration_report import AssessedCase

    _check_known(algorithm, (*systems.NAMES, _TWO_SPEED))
    if algorithm == _TWO_SPEED:
        cycles = _cycles(algorithm, method, "is in two speeds")
        for name in stated(method).keys() - {"--increments"}:
            raise InputError(f"{algorithm} takes no {name}")
        quantities = _quantities(algorithm, ("drift", "sculling"), source)
        return [
            AssessedCase(source.through_gyro(assessment.two_speed(quantity), cycles), cycles, cycles)
            for quantity in quantities
        ]
    fast = None
    if algorithm in systems.RECURSIONS:
        fast = _cycles(algorithm, method, "is a recursion")
        method = replace(method, increments=None)
    choice = method.choose(algorithm, step=False)
    of = partial(assessment.of, choice)
    quantities = _quantities(algorithm, assessment.quantities(choice), source)
    samples = fast or choice.increments_per_step
    return [
        AssessedCase(source.through_gyro(of(quantity), samples), fast, samples) for quantity in quantities
    ]


def _cycles(algorithm: str, method: MethodOptions, loop: str) -> int:
    """Return the fast cycles in a step."""
    if method.increments is None:
        raise InputError(f"{algorithm} {loop}: --increments must say how many of its cycles make a step")
    return checks.count("increments", method.increments, largest=checks.MOST)


def _quantities(algorithm: str, possible: tuple[str, ...], source: VibrationSource) -> list[str]:
    """Return the quantities to assess: those that the vibration at one frequency moves, or all that are possible."""
    if source.spectrum is not None:
        return list(possible)
    moved = {"drift": source.theta_y is not None, "sculling": source.acceleration is not None}
    quantities = [name for name, is_moved in moved.items() if is_moved and name in possible]
    if not quantities:
        needed = {"drift": "--theta-y-rad", "sculling": "--acceleration-y"}[possible[0]]
        raise InputError(f"{algorithm} has {' and '.join(possible)} rates alone; {needed} is needed")
    return quantities


def _curves(
    cases: list[AssessedCase], source: VibrationSource, output: VibrationOutput
) -> tuple[list[tuple[str, Curve]], str, float]:
    """Return the errors over frequency by label, a title, and the frequency in Hz to mark."""
    from strapgen.analysis.vibration import mean_rates

    assert source.step and source.frequency, "the source is checked"
    step, marked = source.step, float(source.frequency)
    sampling = max(case.samples for case in cases) / float(step)
    hertz = mean_rates.frequencies(*output.frequencies(sampling, marked))
    drawn = [
        (case.label, mean_rates.curve(case.assessment, hertz, step, cycles=case.cycles, **source.amplitudes))
        for case in cases
    ]
    return drawn, f"Errors under vibration, step {step} s, {source.words}", marked
