"""The command ``strapgen series`` derives truncation-error series."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import typer

from strapgen.catalogue import MOTIONS
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import MethodOptions, listed, whole
from strapgen.cli.output import Output, as_json
from strapgen.cli.progress import track
from strapgen.cli.sample_source import MotionSettings, pairs
from strapgen.support import checks
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.catalogue import Choice

_Text = str | None


@dataclass(frozen=True)
class Versus:
    """Options of the second algorithm, with which the first one is compared."""

    versus: Annotated[
        _Text,
        typer.Option(
            "--versus",
            metavar="ALGORITHM",
            help="Second algorithm: show the errors of both and their exact ratio.",
            show_default=False,
        ),
    ] = None
    versus_method: Annotated[
        _Text,
        typer.Option(
            "--versus-method",
            metavar="NAME",
            help="Method of the second algorithm.  [default: that of the first]",
            show_default=False,
        ),
    ] = None
    versus_increments: Annotated[
        _Text,
        typer.Option(
            "--versus-increments",
            metavar="N",
            help="Number of increments in a step of the second algorithm.  [default: that of the first]",
            show_default=False,
        ),
    ] = None

    def choose(self, algorithm: str, method: MethodOptions) -> Choice:
        """Return the second algorithm; method and increments are those of the first one unless stated."""
        if self.versus_method is not None:
            method = replace(method, method=self.versus_method, tableau=None)
        if self.versus_increments is not None:
            method = replace(method, increments=self.versus_increments)
        return method.choose(algorithm)


@dataclass(frozen=True)
class DriftPlot:
    """Options of the plot of predicted and simulated drift."""

    settings: MotionSettings = None
    steps: Annotated[
        _Text,
        typer.Option(
            "--steps",
            metavar="S,...",
            help="Step lengths of the plot in s.  [default: 1/8 to 1/64]",
            show_default=False,
        ),
    ] = None
    duration: Annotated[
        str, typer.Option("--duration", metavar="S", help="Duration of the simulated runs of the plot in s.")
    ] = "2"

    def draw(self, choice: Choice, motion: str, count: int | None, path: Path) -> bytes:
        """Return the image of the drift on a motion of the catalogue."""
        from strapgen.analysis import agreement
        from strapgen.reports import plots
        from strapgen.simulation import motions

        checks.choice("motion", motion, MOTIONS)
        settings = pairs(self.settings) if self.settings else agreement.SETTINGS[motion]
        ladder = agreement.default_steps(choice)
        if self.steps is not None:
            ladder = tuple(listed("--steps", self.steps))
        profile = motions.motion(motion, **settings)
        plots.require_kind(path)
        agreements = [
            agreement.agreement(choice, profile, ladder, self.duration, powers)
            for powers in ((1,) if count == 1 else (1, 3))  # every other power may be without drift
        ]
        words = ", ".join(f"{key}={value}" for key, value in settings.items())
        title = (
            f"{agreements[0].kernel}: drift, predicted and simulated\n"
            f"{self.duration} s of {motion} motion, {words}"
        )
        return plots.agreement_image(agreements, title, path)


@dataclass(frozen=True)
class SeriesOutput(Output):
    """Where the series go, and in which format."""

    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot",
            help="Image file for the predicted and the simulated drift on --motion with the parameters --set.",
            show_default=False,
        ),
    ] = None
    format: Annotated[_Text, typer.Option("--format", help="Format of the output: text, latex or json.")] = (
        "text"
    )
    formats: ClassVar[tuple[str, ...]] = ("text", "json", "latex")

    def deliver_report(
        self, report: Any, text: Callable[[Any], str], latex: Callable[[Any], str], image: bytes | None = None
    ) -> None:
        """Deliver a report in the format of the options."""
        if self.format == "json":
            self.deliver(as_json(report.as_dict()), image)
        else:
            self.deliver(latex(report) if self.format == "latex" else text(report), image)


@grouped
def series(
    algorithm: Annotated[
        _Text,
        typer.Argument(
            help="dcm, euler or cayley-klein, or a Python file with your own algorithm.",
            show_default=False,
        ),
    ] = None,
    *,
    method: MethodOptions,
    motion: Annotated[
        str,
        typer.Option(
            "--motion",
            help="Motion: general (any smooth rate), constant, sinusoidal, coning or polynomial.",
        ),
    ] = "general",
    terms: Annotated[
        str,
        typer.Option(
            "--terms", metavar="N", help="Number of nonzero terms to show of drift, scale and skew, 1 to 6."
        ),
    ] = "2",
    versus: Versus,
    all_of_them: Annotated[
        bool,
        typer.Option(
            "--all",
            help="Show the catalogue side by side, each method on as many increments as it needs; ALGORITHM or "
            "--method NAME,... selects some of it.",
        ),
    ] = False,
    plot: DriftPlot,
    output: Annotated[SeriesOutput, Shown(only=("plot", "out", "format"))],
) -> None:
    """Show the truncation error of an algorithm: drift, scale and skew as exact power series in the step length h.

    Without --motion the series hold for every smooth rate w0 + w1 t + w2 t^2/2 + ... and are sums of vectors and cross
    products; S(a, b) stands for a b' + b a'. With --motion they are in the symbols of that motion, where t is the time
    at the beginning of the step, and the drift of a whole run follows where it has a series; at a constant rate all
    errors are also in closed form.

    Example: strapgen series euler --method rk4 --increments 2 --motion constant

    Example: strapgen series dcm --method rk1 --motion constant --versus euler
    """
    output.check(algorithm, method.tableau)
    count = whole("terms", terms)
    if all_of_them:
        _overview(algorithm, method, versus, output)
        return
    if algorithm is None:
        raise InputError("an algorithm is needed, or --all")
    _check_plot(motion, versus, plot, output)
    choice = method.choose(algorithm)
    most = 2 if count is None else count
    if versus.versus is not None:
        from strapgen.analysis import ratios
        from strapgen.reports.ratios import ratio_latex, ratio_text

        ratio = ratios.versus(choice, versus.choose(versus.versus, method), motion, most)
        output.deliver_report(ratio, ratio_text, ratio_latex)
        return
    from strapgen.analysis.error_analysis import analyse
    from strapgen.reports.series import series_latex, series_text

    image = None if output.plot is None else plot.draw(choice, motion, count, output.plot)
    output.deliver_report(analyse(choice, motion, most), series_text, series_latex, image)


def _check_plot(motion: str, versus: Versus, plot: DriftPlot, output: Output) -> None:
    """Check that the options of a plot and of another algorithm go together."""
    if versus.versus is None and (versus.versus_method or versus.versus_increments):
        raise InputError("--versus-method and --versus-increments need --versus")
    if output.plot is None and (plot.settings or plot.steps):
        raise InputError("--set and --steps are for --plot")
    if output.plot is not None and (versus.versus is not None or motion == "general"):
        raise InputError("--plot needs a --motion of the catalogue, and no --versus")


def _overview(algorithm: _Text, method: MethodOptions, versus: Versus, output: Output) -> None:
    """Deliver the table of all algorithms and methods side by side."""
    for option, value in {
        "--versus": versus.versus,
        "--plot": output.plot,
        "--tableau": method.tableau,
        "--increments": method.increments,
        "--previous": method.previous,
        "--rates": method.rates or None,
    }.items():
        if value is not None:
            raise InputError(f"--all and {option} do not go together")
    if output.format == "latex":
        raise InputError("--all is printed as text or json, not as latex")
    from strapgen import catalogue
    from strapgen.analysis import overview
    from strapgen.reports.overview import overview_text

    algorithms = list(catalogue.ALGORITHMS)
    if algorithm is not None:
        algorithms = [checks.choice("algorithm", algorithm, catalogue.ALGORITHMS)]
    names = None
    if method.method is not None:
        names = [
            checks.choice("method", name, catalogue.METHODS)
            for name in listed("--method", method.method, "names no method")
        ]
    choices = overview.choices(algorithms, names)
    rows = list(track(overview.overview(choices), "deriving", len(choices)))
    if output.format == "json":
        output.deliver(as_json([row.as_dict() for row in rows]))
    else:
        output.deliver(overview_text(rows))
