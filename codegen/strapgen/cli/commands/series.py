"""strapgen series."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapgen.catalogue import MOTIONS
from strapgen.cli.inputs import MotionSettings, pairs
from strapgen.cli.options import (
    Increments,
    Method,
    Previous,
    Rates,
    TableauFile,
    check_format,
    chosen,
    print_json,
    whole,
)
from strapgen.cli.progress import track
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.catalogue import Choice

_Text = str | None


def series(
    algorithm: Annotated[
        _Text,
        typer.Argument(
            help="dcm, euler or cayley-klein, or a Python file with an algorithm of your own.",
            show_default=False,
        ),
    ] = None,
    method: Method = None,
    tableau: TableauFile = None,
    increments: Increments = None,
    previous: Previous = None,
    rates: Rates = False,
    motion: Annotated[
        str,
        typer.Option("--motion", help="general, or constant, sinusoidal, coning or polynomial."),
    ] = "general",
    terms: Annotated[
        str,
        typer.Option(
            "--terms", metavar="N", help="Terms of drift, scale and skew that are not zero, 1 to 6."
        ),
    ] = "2",
    versus: Annotated[
        _Text,
        typer.Option(
            "--versus",
            metavar="ALGORITHM",
            help="Another algorithm: both, and their exact ratio.",
            show_default=False,
        ),
    ] = None,
    versus_method: Annotated[
        _Text,
        typer.Option(
            "--versus-method", metavar="NAME", help="Its method.  [default: the same]", show_default=False
        ),
    ] = None,
    versus_increments: Annotated[
        _Text,
        typer.Option(
            "--versus-increments", metavar="N", help="Its increments.  [default: as many]", show_default=False
        ),
    ] = None,
    all_of_them: Annotated[
        bool,
        typer.Option(
            "--all",
            help="The whole catalogue side by side, on as many increments as each method needs; with ALGORITHM or "
            "--method NAME,... only these.",
        ),
    ] = False,
    settings: MotionSettings = None,
    steps: Annotated[
        _Text,
        typer.Option(
            "--steps",
            metavar="S,...",
            help="Steps of the plot in s.  [default: 1/8 to 1/64]",
            show_default=False,
        ),
    ] = None,
    duration: Annotated[
        str, typer.Option("--duration", metavar="S", help="Duration of the plot in s.")
    ] = "2",
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot",
            help="Image file: predicted against simulated drift on the motion with the parameters --set.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="File for the output.  [default: the terminal]", show_default=False),
    ] = None,
    format: Annotated[str, typer.Option("--format", help="text, latex or json.")] = "text",
) -> None:
    """Show what an algorithm loses: drift, scale and skew as exact power series in the step length h.

    For the general smooth rate w0 + w1 t + w2 t^2/2 + ... in vector-invariant form, S(a, b) = a b' + b a'; for the
    motions of the catalogue in their own symbols, t the time at the beginning of the step, with what adds up in a run,
    and at a constant rate in closed form.

    Example: strapgen series euler --method rk4 --increments 2 --motion constant

    Example: strapgen series dcm --method rk1 --motion constant --versus euler
    """
    check_format(format, "latex")
    count = whole("terms", terms)
    if all_of_them:
        refused = {
            "--versus": versus,
            "--plot": plot,
            "--tableau": tableau,
            "--increments": increments,
            "--previous": previous,
            "--rates": rates or None,
        }
        for option, value in refused.items():
            if value is not None:
                raise InputError(f"--all and {option} do not go together")
        _emit(*_overview(algorithm, method, format), format, out, {})
        return
    if algorithm is None:
        raise InputError("an algorithm is needed, or --all")
    if versus is None and (versus_method or versus_increments):
        raise InputError("--versus-method and --versus-increments need --versus")
    if plot is None and (settings or steps):
        raise InputError("--set and --steps are for --plot")
    if plot is not None and (versus is not None or motion == "general"):
        raise InputError("--plot needs a --motion of the catalogue, and no --versus")
    if out is not None and plot is not None and out.resolve() == plot.resolve():
        raise InputError(f"--out and --plot are both {out}; two files are needed")
    choice = chosen(algorithm, method, tableau, increments, previous, rates)
    if versus is not None:
        other = chosen(
            versus,
            versus_method or method,
            tableau if versus_method is None else None,
            versus_increments or increments,
            previous,
            rates,
        )
        _emit(*_versus(choice, other, motion, count, format), format, out, {})
        return
    from strapgen.analysis.error_analysis import analyse
    from strapgen.reports.series import series_latex, series_text

    files = {} if plot is None else _plotted(choice, motion, settings, steps, duration, count, plot)
    analysis = analyse(choice, motion, 2 if count is None else count)
    text = series_latex(analysis) if format == "latex" else series_text(analysis)
    _emit(text, analysis.as_dict(), format, out, files)


def _emit(text: str, data: Any, format: str, out: Path | None, files: dict[str, str | bytes]) -> None:
    """Write files, and print or write the output."""
    from strapgen.support.files import write_files

    if out is not None:
        files[str(out)] = f"{json.dumps(data, indent=1) if format == 'json' else text}\n"
    write_files(Path(), files)
    if out is None:
        if format == "json":
            print_json(data)
        else:
            typer.echo(text)


def _overview(algorithm: _Text, method: _Text, format: str) -> tuple[str, Any]:
    from strapgen import catalogue
    from strapgen.analysis import overview
    from strapgen.reports.overview import overview_text
    from strapgen.support import checks

    if format == "latex":
        raise InputError("--all is printed as text or json, not as latex")
    algorithms = list(catalogue.ALGORITHMS)
    if algorithm is not None:
        algorithms = [checks.choice("algorithm", algorithm, catalogue.ALGORITHMS)]
    names = None
    if method is not None:
        names = [name.strip() for name in method.split(",") if name.strip()]
        for name in names:
            checks.choice("method", name, catalogue.METHODS)
    choices = overview.choices(algorithms, names)
    if not choices:
        raise InputError("--method names no method")
    rows = list(track(overview.overview(choices), "deriving", len(choices)))
    return overview_text(rows), [row.as_dict() for row in rows]


def _versus(first: Choice, second: Choice, motion: str, count: int | None, format: str) -> tuple[str, Any]:
    from strapgen.analysis import ratios
    from strapgen.reports.ratios import ratio_latex, ratio_text

    found = ratios.versus(first, second, motion, 2 if count is None else count)
    return ratio_latex(found) if format == "latex" else ratio_text(found), found.as_dict()


def _plotted(
    choice: Choice,
    motion: str,
    settings: list[str] | None,
    steps: _Text,
    duration: str,
    count: int | None,
    plot: Path,
) -> dict[str, str | bytes]:
    from strapgen.analysis import agreement
    from strapgen.reports import plots
    from strapgen.simulation.motions import motion as make_motion
    from strapgen.support import checks

    checks.choice("motion", motion, MOTIONS)
    given = pairs(settings) if settings else agreement.SETTINGS[motion]
    ladder = agreement.default_steps(choice)
    if steps is not None:
        ladder = tuple(step.strip() for step in steps.split(",") if step.strip())
    profile = make_motion(motion, **given)
    plots.require_kind(plot)
    found = [
        agreement.agreement(choice, profile, ladder, duration, powers)
        for powers in ((1,) if count == 1 else (1, 3))  # every other power may be without drift
    ]
    words = ", ".join(f"{key}={value}" for key, value in given.items())
    title = f"{found[0].kernel}: drift, predicted and simulated\n{duration} s of {motion} motion, {words}"
    return {str(plot): plots.agreement_image(found, title, plot)}
