"""The commands ``strapgen series`` and ``strapgen stability`` derive the errors and the growth of a step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from strapgen.cli.option_groups import Excludes, Needs, OneOf, Rule, Shown, grouped, rules
from strapgen.cli.options import (
    ANY_STEP_OPTIONS,
    STEP_OPTIONS,
    Duration,
    MethodOptions,
    OptionalStepAlgorithm,
    Samples,
    SeveralMethods,
    StepAlgorithm,
    option,
    samples,
)
from strapgen.cli.output import Output, format_option, plot_option
from strapgen.cli.progress import track
from strapgen.cli.values import Positive
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.lab.run_options import MOTION_NAMES, MotionSettings, in_words

if TYPE_CHECKING:
    from strapgen.analysis.series.prediction import Agreement
    from strapgen.catalogue import Choice


_Text = str | None
#: The kernel of the catalogue for the velocity and position of a step.
VELOCITY_POSITION = "velocity-position"


@dataclass(frozen=True)
class Versus:
    """Options of the second algorithm, with which the first one is compared."""

    panel: ClassVar[str] = "Second algorithm"
    rules: ClassVar[tuple[Rule, ...]] = (Needs("--versus-method --versus-increments", "--versus"),)

    versus: Annotated[
        _Text,
        option(
            "--versus",
            metavar="ALGORITHM",
            help="Second algorithm: show the errors of both and their exact ratio.",
        ),
    ] = None
    versus_method: Annotated[
        _Text,
        option(
            "--versus-method",
            metavar="NAME",
            help="Method of the second algorithm.  [default: that of the first]",
        ),
    ] = None
    versus_increments: Annotated[
        int | None,
        option(
            "--versus-increments",
            metavar="N",
            help="Number of increments in a step of the second algorithm.  [default: that of the first]",
        ),
    ] = None

    def choose(self, algorithm: str, method: MethodOptions) -> Choice:
        """Return the second algorithm; method and increments are those of the first one unless stated."""
        if self.versus_method is not None:
            method = replace(method, method=self.versus_method, tableau=None, window=None, coning=None)
        if self.versus_increments is not None:
            method = replace(method, increments=self.versus_increments)
        return method.choose(algorithm)


@dataclass(frozen=True)
class DriftPlot:
    """Options of the plot of predicted and simulated drift."""

    panel: ClassVar[str] = "Plot"

    settings: MotionSettings = None
    steps: Annotated[
        tuple[Positive, ...] | None,
        option(
            *("--step", "--steps"),
            metavar="S,...",
            help="Step lengths of the plot in s.  [default: 1/8 to 1/64]",
        ),
    ] = None
    duration: Duration = Positive("2")

    def agreements(self, choice: Choice, motion: str, count: int) -> tuple[Sequence[Agreement], str]:
        """Return the drift on a motion of the catalogue, predicted and simulated, with a title."""
        from strapgen.analysis.series import prediction
        from strapgen.catalogue import MOTIONS
        from strapgen.lab.motions import motions

        checks.choice("motion", motion, MOTIONS)
        settings = self.settings or prediction.SETTINGS[motion]
        ladder = self.steps or prediction.default_steps(choice)
        profile = motions.motion(motion, **settings)
        agreements = [
            prediction.agreement(choice, profile, ladder, self.duration, powers)
            for powers in ((1,) if count == 1 else (1, 3))  # every other power may be without drift
        ]
        title = (
            f"{agreements[0].kernel}: drift, predicted and simulated\n"
            f"{self.duration} s of {motion} motion, {in_words(settings)}"
        )
        return agreements, title


@dataclass(frozen=True)
class SeriesOutput(Output):
    """Options for the output of the series."""

    plot: Annotated[
        Path | None,
        plot_option("the predicted and the simulated drift on --motion with the parameters --set"),
    ] = None
    format: Annotated[
        _Text, format_option(("text", "latex", "json"), " With --all: csv and markdown too.")
    ] = "text"
    formats: ClassVar[tuple[str, ...]] = ("text", "json", "latex", "csv", "markdown")


@grouped
@rules(
    OneOf("ALGORITHM --all", needed="an algorithm is needed, or --all", several=True),
    Excludes(
        "--all",
        "--versus --plot --tableau --window --coning --increments --previous --ahead --rates --constant",
    ),
    Needs("--format=csv|markdown", "--all"),
    Needs("--set --step", "--plot"),
    Excludes("--plot", "--versus"),
    Needs("--plot", "--motion"),
)
def series(
    algorithm: OptionalStepAlgorithm = None,
    *,
    methods: Annotated[SeveralMethods, Shown(only=ANY_STEP_OPTIONS)],
    all_of_them: Annotated[
        bool,
        option(
            "--all",
            help="Show the catalogue side by side, each method on as many increments as it needs; ALGORITHM or "
            "--method NAME,... selects some of it.",
            panel="Algorithm",
        ),
    ] = False,
    motion: Annotated[
        str,
        option(
            "--motion",
            metavar="NAME",
            help=f"Motion: general (any smooth rate), {MOTION_NAMES}, or a Python file with a rate in SymPy.",
            words="strapgen.catalogue:MOTIONS",
            panel="Input",
        ),
    ] = "general",
    terms: Annotated[
        int,
        option(
            "--terms",
            metavar="N",
            help="Number of nonzero terms to show of drift, scale and skew, 1 to 6.",
            panel="Output",
        ),
    ] = 2,
    versus: Versus,
    plot: DriftPlot,
    output: SeriesOutput,
) -> None:
    """Derive drift, scale and skew of a step as exact power series.

    Without --motion the series in the step length h hold for every smooth rate w0 + w1 t + w2 t^2/2 + ... and are sums
    of vectors and cross products; S(a, b) stands for a b' + b a'. With --motion they are in the symbols of that motion,
    where t is the time at the beginning of the step, and the drift of a whole run follows where it has a series; at a
    constant rate all errors are also in closed form.

    The algorithm velocity-position stands for the velocity and position change of a step, whose errors are sums of
    vectors and cross products of the rate w0 + w1 t + ... and of the specific force f0 + f1 t + ...; the position is
    divided by h. A file with a step of velocity and position has such a series too.

    Example: strapgen series euler --method rk4 --increments 2 --motion constant

    Example: strapgen series dcm --method rk1 --motion constant --versus euler
    """
    output.check(algorithm, *methods.files)
    if all_of_them or algorithm is None:
        return _overview(algorithm, methods, output)
    if output.plot is not None and motion == "general":
        raise InputError("--plot needs a --motion of the catalogue")
    choices = methods.choices(algorithm, step=not _may_be_velocity(algorithm))
    if choices[0].takes_velocity:
        return _of_velocity(choices, motion, terms, versus, output)
    if len(choices) > 1 and (output.plot is not None or versus.versus is not None):
        raise InputError("--plot and --versus go with one method")
    if versus.versus is not None:
        return _ratios(choices[0], versus.choose(versus.versus, methods.each()[0]), motion, terms, output)
    from strapgen.analysis.error_analysis import SeriesResult, analyse

    drawn = ((), "") if output.plot is None else plot.agreements(choices[0], motion, terms)
    output.show(SeriesResult([analyse(choice, motion, terms) for choice in choices], *drawn))


def _ratios(first: Choice, second: Choice, motion: str, terms: int, output: Output) -> None:
    """Deliver the errors of two algorithms and their ratio."""
    from strapgen.analysis import ratios
    from strapgen.analysis.ratios import RatioResult

    output.show(RatioResult(ratios.versus(first, second, motion, terms)))


def _may_be_velocity(algorithm: str) -> bool:
    """Return whether an algorithm may be a step of velocity and position."""
    from strapgen.catalogue.user import loading

    return algorithm == VELOCITY_POSITION or algorithm.endswith(".py") or algorithm in loading.installed()


def _of_velocity(choices: list[Choice], motion: str, terms: int, versus: Versus, output: Output) -> None:
    """Deliver the series of velocity and position, which hold for any smooth motion and specific force."""
    if motion != "general" or versus.versus is not None or output.plot is not None:
        raise InputError(
            f"series of {choices[0].name} hold for any motion; --motion, --versus and --plot go with an attitude"
        )
    from strapgen.analysis.series import velocity_series
    from strapgen.analysis.series.velocity_series import VelocitySeriesResult

    output.show(VelocitySeriesResult([velocity_series.series(choice, terms) for choice in choices]))


def _overview(algorithm: _Text, methods: SeveralMethods, output: Output) -> None:
    """Deliver the table of all algorithms and methods side by side."""
    from strapgen import catalogue
    from strapgen.analysis import overview
    from strapgen.analysis.overview import OverviewResult

    algorithms = list(catalogue.ALGORITHMS)
    if algorithm is not None:
        algorithms = [checks.choice("algorithm", algorithm, catalogue.ALGORITHMS)]
    names = methods.method and [checks.choice("method", name, catalogue.METHODS) for name in methods.method]
    choices = overview.choices(algorithms, names)
    output.show(OverviewResult(list(track(overview.overview(choices), "deriving", len(choices)))))


@dataclass(frozen=True)
class SteppedMethods(SeveralMethods):
    """Options that choose the methods whose growth is shown side by side."""

    method: Annotated[
        tuple[str, ...] | None,
        option(
            "--method",
            metavar="NAME,...",
            help="Integration methods, with commas between; strapgen list methods shows all.  "
            "[default: rk1,rk2,rk3,rk4; for a Python file, the method it chooses]",
        ),
    ] = None
    increments: Annotated[
        tuple[Samples, ...] | None,
        option(
            "--increments",
            metavar="N,...",
            help="Numbers of angle increments in a step, 1 to 8; enough: as many as each method needs.  "
            "[default: enough]",
            read=samples,
        ),
    ] = None


@grouped
def stability(
    algorithm: StepAlgorithm,
    *,
    methods: Annotated[SteppedMethods, Shown(only=STEP_OPTIONS)],
    output: Output,
) -> None:
    """Show the limits of stability of a step at constant rates.

    At a constant rate w a step of length h turns by the angle x = |w| h. It stretches the part of the state across the
    axis by a factor, whose square is shown exactly, with the angles x at which the factor is at most 1.

    Example: strapgen stability dcm --method rk3,rk4,butcher5 --plot out/stability.png
    """
    output.check(algorithm, *methods.files)
    from strapgen import catalogue

    if algorithm in catalogue.ALGORITHMS:
        if methods.method is None and not any(methods.files):
            methods = replace(methods, method=tuple(catalogue.STANDARD_METHODS))
        if methods.increments is None:
            methods = replace(methods, increments=("enough",))
    choices = methods.choices(algorithm)
    from strapgen.analysis import growth
    from strapgen.analysis.growth import StabilityResult

    output.show(StabilityResult([growth.stability(choice) for choice in choices]))
