"""The commands ``strapgen window design``, ``show`` and ``generate``: filters of windows, and C that commits late."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import typer

from strapgen.analysis.vibration.vibration_command import BandOptions
from strapgen.cli import terminal
from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.generate_command import SourceOptions
from strapgen.cli.option_groups import Needs, OneOf, Rule, Shown, command_line, grouped, rules
from strapgen.cli.options import CTarget, argument, option
from strapgen.cli.output import Format, Output, check_format, show
from strapgen.cli.program import PlainCommand, PlainGroup
from strapgen.cli.progress import waiting
from strapgen.cli.values import NotNegative, Positive, names
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.design.family import FamilyBrief
    from strapgen.ir.sources import Sources


#: The argument for a window.
WindowArgument = Annotated[
    str,
    argument(
        "NAME|FILE",
        help="A window as window-7-7, or a TOML file with one.",
        words="strapgen.catalogue.methods.windows:WINDOWS",
    ),
]


_Text = str | None

app = typer.Typer(cls=PlainGroup, rich_markup_mode=None)


@app.callback()
def _group() -> None:
    """Design windows, filters of samples on both sides of a step."""


@dataclass(frozen=True)
class WindowSize:
    """Options of the samples that filters take, and of what they estimate."""

    panel: ClassVar[str] = "Window"
    rules: ClassVar[tuple[Rule, ...]] = (
        *(Needs("--form=pair", taps) for taps in ("--u-taps", "--v-taps")),
        Needs("--u-taps --v-taps", "--form=pair"),
        Needs("--previous --ahead", "--form=legendre"),
        OneOf("--previous --u-taps", needed="--previous is needed, a number of samples"),
        OneOf("--ahead --v-taps", needed="--ahead is needed, a number of samples"),
        Needs("--series-terms", "--rotation=exact"),
    )

    form: Annotated[
        str,
        option(
            "--form",
            metavar="NAME",
            help="What the filters are: legendre, each for its coefficient of the rate, or pair, two whose product is "
            "that of coning, with those of legendre for the attitude of now.",
            read=names("strapgen.catalogue.methods.windows:FORMS"),
        ),
    ] = "legendre"
    samples: Annotated[
        int,
        option(
            "--samples",
            metavar="N",
            help="Number of samples in a step; several take --rotation exact, or up to 3 --form pair.",
        ),
    ] = 1
    u_taps: Annotated[
        int | None,
        option(
            "--u-taps",
            metavar="N",
            help="Number of free taps on each side of the middle of the step of the first filter of a pair.",
        ),
    ] = None
    v_taps: Annotated[
        int | None,
        option(
            "--v-taps",
            metavar="N",
            help="The same of the second filter; for odd N it has one in the middle too.",
        ),
    ] = None
    previous: Annotated[
        int | None,
        option(*("--previous", "--kept"), metavar="N", help="Number of samples from before the step."),
    ] = None
    ahead: Annotated[
        int | None, option("--ahead", metavar="N", help="Number of samples ahead of the step.")
    ] = None
    powers: Annotated[
        int,
        option(
            "--powers",
            metavar="N",
            help="Powers of time, from 0 on, on which the filters are exact; 4 is exact on cubic rates.",
        ),
    ] = 4
    coefficients: Annotated[
        int,
        option("--coefficients", metavar="N", help="Highest Legendre coefficient of the rate, 1 to 8."),
    ] = 4
    rotation: Annotated[
        str,
        option(
            "--rotation",
            metavar="NAME",
            help="How the rotation follows: fourth, the rotation vector to fourth order, or exact, a power series.",
            read=names("strapgen.catalogue.methods.windows:ROTATIONS"),
        ),
    ] = "fourth"
    series_terms: Annotated[
        int | None,
        option("--series-terms", metavar="N", help="Terms of that power series.  [default: 16]"),
    ] = None


@dataclass(frozen=True)
class Band(BandOptions):
    """Options of the motion and the gyro for which filters are designed."""

    noise: Annotated[
        NotNegative,
        option(
            "--noise",
            metavar="RATIO",
            help="Noise of an increment by the rate times the sampling interval; above 0, the committed filters are "
            "those of the least mean square error.",
        ),
    ] = NotNegative("0")
    now_noise: Annotated[
        str,
        option(
            "--now-noise",
            metavar="RATIO",
            help="The same for the filters of the attitude of now; or the file of a brief, of whose gyro it is the "
            "noise at the largest rate.",
        ),
    ] = "3e-4"
    start_noise: Annotated[
        NotNegative,
        option("--start-noise", metavar="RATIO", help="The same for the first intervals of a recording."),
    ] = NotNegative("0")
    spectrum: Annotated[
        Path | None,
        option(
            "--spectrum",
            metavar="FILE",
            help="CSV file of the motion, as for strapgen vibration: the filters are those of the least mean square "
            "error on it.",
        ),
    ] = None

    def densities(self, band: Fraction) -> tuple[int, ...] | None:
        """Return the density of the rate over the band; None if it is flat."""
        if self.spectrum is None:
            return None
        from strapgen.analysis.vibration.spectrum import read_spectrum
        from strapgen.design.filters import responses

        assert self.sample_hz is not None, "a spectrum goes with it"
        return responses.weights(read_spectrum(self.spectrum), band, self.sample_hz)


@app.command("design", cls=PlainCommand)
@grouped
def design(
    *,
    size: WindowSize,
    band: Band,
    name: Annotated[
        _Text,
        option(
            "--name",
            metavar="NAME",
            help="Title of the window, from which its name follows.  [default: from samples and band]",
            panel="Output",
        ),
    ] = None,
    output: Annotated[Output, Shown(only=("out",))],
) -> None:
    """Design the filters of a window and write them as a file of exact rationals.

    The file holds the filters that commit an attitude and one-sided ones, with fewer samples ahead, for the attitude of
    now. Each is exact for polynomial rates, and the best one over the band. A second design gives the same file.

    Example: strapgen window design --previous 7 --ahead 7 --band 1.3 --out out/window.toml

    Example: strapgen window design --form pair --u-taps 8 --v-taps 6 --band 1.3 --out out/pair.toml
    """
    output.check(band.spectrum)
    brief = _brief(size, band, name)
    from strapgen.catalogue.methods import windows
    from strapgen.design import family
    from strapgen.design.window_report import window_warnings

    with waiting("designing"):
        window = family.design(brief)
        windows.verify(window)
        out = output.file and output.file.name
        command = command_line(
            "window design", size, band, {"--name": name, "--out": out}, files_by_name=True
        )
        text = family.written(window, command)
        warnings = window_warnings(window)
    output.deliver(text)
    for warning in warnings:
        terminal.remark(f"strapgen: {warning}")


def _brief(size: WindowSize, band: Band, name: str | None) -> FamilyBrief:
    """Return the requirements from the options."""
    from strapgen.catalogue.methods import windows
    from strapgen.design.family import FamilyBrief, pair_side

    increments = checks.count("--samples", size.samples, largest=windows.MOST_SAMPLES)
    pair = size.form == "pair"
    stated = {"--u-taps": size.u_taps, "--v-taps": size.v_taps}
    stated = stated if pair else {"--previous": size.previous, "--ahead": size.ahead}
    (one, first), (other, second) = (
        (name, checks.count(name, value, smallest=0, largest=windows.MOST_SAMPLES - 1))
        for name, value in stated.items()
    )
    previous, ahead = [max(0, pair_side((first, second), increments))] * 2 if pair else (first, second)
    samples = previous + increments + ahead
    if samples > windows.MOST_SAMPLES:
        step = "" if increments == 1 else f" with --samples {increments}"
        raise InputError(
            f"{one} {first} and {other} {second}{step} make {samples} samples; "
            f"at most {windows.MOST_SAMPLES} are allowed"
        )
    radians, gyro = band.radians(), band.gyro()
    # Of a pair it is the taps that are too few for the powers, which its brief says.
    most = windows.MOST_CONDITIONS if pair else min(samples, windows.MOST_CONDITIONS)
    return FamilyBrief(
        previous,
        ahead,
        radians,
        checks.count("--powers", size.powers, largest=most),
        checks.count("--coefficients", size.coefficients, largest=windows.MOST_DEGREE),
        gyro,
        Fraction(band.noise),
        _now_noise(band.now_noise),
        band.densities(radians),
        size.rotation,
        checks.count(
            "--series-terms",
            16 if size.series_terms is None else size.series_terms,
            largest=windows.MOST_TERMS,
        ),
        _title(name),
        Fraction(band.start_noise),
        increments,
        (first, second) if pair else None,
    )


def _now_noise(value: str) -> Fraction:
    """Return the noise of an increment by the rate times the sampling interval: a ratio, or that of a brief's gyro."""
    if not value.endswith(".toml"):
        return Fraction(NotNegative.read("--now-noise", value))
    from strapgen.design.brief import read_brief

    brief = read_brief(Path(value))
    if not brief.gyro.noise_deg_sqrt_h or not brief.max_rate_deg_s:
        raise InputError(
            f"--now-noise {value}: the gyro's noise_deg_sqrt_h is 0; a brief with noise is needed"
        )
    return replace(brief.gyro, pulse_arcsec=Fraction(0)).noise_ratio(brief.max_rate_deg_s)


def _title(name: str | None) -> str:
    """Return the title of a window, whose name no window of the catalogue has; empty for the default."""
    from strapgen.catalogue.methods import coefficient_files, windows

    if name is None:
        return ""
    if coefficient_files.slug(checks.text("--name", name)) in windows.WINDOWS:
        raise InputError(f"--name {name} is that of a window of the catalogue; another one is needed")
    return name


@app.command("show", cls=PlainCommand)
@grouped
def show_window(
    window: WindowArgument,
    *,
    output: Output,
) -> None:
    """Show the filters of a window, their errors and their gains.

    The conditions are checked exactly. --format json has the exact taps. An argument that ends in .toml or holds a path
    separator is read as a file.

    Example: strapgen window show window-7-7
    """
    output.check(window)
    from strapgen.catalogue.methods import windows
    from strapgen.design.window_report import WindowResult

    family = windows.named_or_read(window)
    with waiting("evaluating the filters"):
        result = WindowResult.of(family)
    output.show(result)


__all__ = ["app", "generate"]


@app.command("generate", cls=PlainCommand)
@grouped
@rules(Needs("--max-rate-deg-s --lsb", "--sample-hz"))
def generate(
    window: WindowArgument,
    *,
    algorithm: Annotated[
        str,
        option("--algorithm", metavar="NAME", help="Attitude: euler or dcm.", panel="Algorithm"),
    ] = "euler",
    target: CTarget = "c",
    sample_hz: Annotated[
        Positive | None,
        option(
            "--sample-hz",
            metavar="HZ",
            help="Samples of the gyro in a second: filters for a gyro need it, --max-rate-deg-s and --lsb do.",
            panel="Algorithm",
        ),
    ] = None,
    fixed: Annotated[
        FixedOptions,
        Shown(
            only=(
                *("word", "max_rate_deg_s", "largest_angle", "lsb", "lsb_rad"),
                *("rounding", "carry", "allowance"),
            )
        ),
    ],
    output: Annotated[SourceOptions, Shown(only=("out", "name", "project", "check", "force"))],
    format: Format = "text",
) -> None:
    """Generate C that commits an attitude late, and estimates the present one.

    Each sample is passed to a function, which commits the attitude a few samples late, by filters on both sides of it;
    another function answers the attitude of now. A lost sample is restored.

    Example: strapgen window generate window-7-7 --target c --out out/late
    """
    check_format(format)
    sources = generated(window, algorithm, target, sample_hz, fixed, output.name)
    files = output.files(sources, "whole.project", sources)
    if output.check:
        output.show_difference(files, format)
        return
    written = output.write(files)
    from strapgen.design.commit_late.commit_late_sources import LateResult

    show(LateResult(sources.function.name, target, written, sources.operations), format)


def generated(
    window: str,
    algorithm: str,
    target: str,
    sample_hz: Positive | None,
    fixed: FixedOptions,
    name: str | None,
) -> Sources:
    """Return the sources for the options."""
    from strapgen.catalogue.methods import windows
    from strapgen.design.commit_late import commit_late_sources

    rated = sample_hz if (fixed.max_rate_deg_s, fixed.lsb) != (None, None) else None
    settings = replace(fixed, sample_hz=rated).settings(1)
    with waiting("generating"):
        family = windows.named_or_read(window)
        return commit_late_sources.sources(family, algorithm, target, sample_hz, name, settings)
