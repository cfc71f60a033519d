"""The command ``strapgen coning`` derives coning coefficients and their residual drift, or designs them for a band."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from strapgen.analysis.vibration.vibration_command import BandOptions
from strapgen.cli.option_groups import Excludes, Needs, Rule, Shown, command_line, grouped, rules
from strapgen.cli.options import option
from strapgen.cli.output import TEXT_OUTPUT, Output, format_option
from strapgen.cli.progress import waiting
from strapgen.cli.values import NotNegative, names, whole
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.design.coning_design import ConingBrief


_Text = str | None

#: Samples, those before the slow cycle included, for which terms of third and fourth order are listed.
_MOST_SAMPLES = 6
#: The format of a file that --coning reads.
_FILE_FORMAT = "toml"


@dataclass(frozen=True)
class ConingDesign(BandOptions):
    """Options of the band or the spectrum for which coefficients are designed."""

    panel: ClassVar[str] = "Design"
    rules: ClassVar[tuple[Rule, ...]] = (
        Needs(
            "--band --band-hz --sample-hz --response --gyro-bandwidth-hz --gyro-damping --spectrum --powers --products "
            "--noise-rad --pulse-rad --name",
            "--objective=band|worst|random",
        ),
        Needs("--band --band-hz", "--objective=band"),
        Needs("--spectrum", "--objective=worst|random"),
        Needs("--noise-rad --pulse-rad", "--objective=random"),
        Needs("--objective=worst|random", "--spectrum"),
        *BandOptions.rules,
    )

    objective: Annotated[
        _Text,
        option(
            "--objective",
            metavar="NAME",
            help="Design for a band (band: least largest drift) or a spectrum (worst: least drift at the worst phases, "
            "random: least mean square for random ones).  [default: annul powers of the frequency]",
            read=names("strapgen.catalogue.methods.shaped_coning:OBJECTIVES"),
        ),
    ] = None
    spectrum: Annotated[
        Path | None,
        option("--spectrum", metavar="FILE", help="CSV file of the vibration, as for strapgen vibration."),
    ] = None
    powers: Annotated[
        int | None,
        option(
            "--powers",
            metavar="N",
            help="Number of powers of the frequency, from the third on, that vanish in the drift.  [default: 0]",
        ),
    ] = None
    products: Annotated[
        int | None,
        option(
            "--products",
            metavar="N",
            help="Highest total degree of products of two powers of time in the rate for which the design is exact.  "
            "[default: 0]",
        ),
    ] = None
    noise_rad: Annotated[
        NotNegative | None,
        option(
            "--noise-rad",
            metavar="RAD",
            help="Standard deviation of the noise of an increment, with --objective random.",
        ),
    ] = None
    pulse_rad: Annotated[
        NotNegative | None,
        option("--pulse-rad", metavar="RAD", help="Pulse of the gyro, with --objective random."),
    ] = None
    name: Annotated[
        _Text,
        option(
            "--name",
            metavar="NAME",
            help="Title of the design, from which its name follows.  [default: from samples and band]",
        ),
    ] = None

    def brief(self, samples: int, previous: int) -> ConingBrief:
        """Return the requirements from the options."""
        from strapgen.analysis.vibration.spectrum import read_spectrum
        from strapgen.design.coning_design import ConingBrief, of_spectrum

        lines = None
        if self.spectrum is not None:
            assert self.sample_hz is not None, "a spectrum goes with it"
            lines = of_spectrum(read_spectrum(self.spectrum), self.sample_hz)
        unknowns = max(0, samples + previous - 1)
        powers, products = (
            checks.count(f"--{what}", value or 0, smallest=0, largest=unknowns)
            for what, value in (("powers", self.powers), ("products", self.products))
        )
        return ConingBrief(
            samples,
            previous,
            self.objective or "",
            None if lines is not None else self.radians(),
            lines,
            powers,
            self.gyro(),
            Fraction(self.noise_rad or 0),
            Fraction(self.pulse_rad or 0),
            self.name or "",
            products,
        )


@dataclass(frozen=True)
class ConingOutput(Output):
    """Options for the output of the coefficients."""

    format: Annotated[_Text, format_option((*Output.formats, _FILE_FORMAT))] = "text"
    formats: ClassVar[tuple[str, ...]] = (*Output.formats, _FILE_FORMAT)


@grouped
@rules(
    Excludes("--objective", "--terms --form", reason="--objective designs the compressed form"),
    Needs("--format=toml", "--objective"),
)
def coning(
    samples: Annotated[
        int,
        option(
            *("--samples", "--increments"),
            metavar="N",
            help="Number of gyro samples in a slow cycle, 1 to 8.",
            panel="Algorithm",
            read=whole(1, 8),
        ),
    ],
    previous: Annotated[
        int,
        option(
            "--previous",
            metavar="N",
            help="Number of samples before the slow cycle that it also uses, 0 to 32.",
            panel="Algorithm",
            read=whole(0, 32),
        ),
    ] = 0,
    form: Annotated[
        str,
        option(
            "--form",
            metavar="NAME",
            help="Form of the correction: compressed suits coning, uncompressed polynomial rates, combined both.",
            panel="Algorithm",
            read=names("strapgen.catalogue.methods.coning_coefficients:FORMS"),
        ),
    ] = "compressed",
    terms: Annotated[
        bool,
        option(
            "--terms",
            help="Also list the third- and fourth-order terms of the rotation vector, for up to six samples in all.",
            panel="Output",
        ),
    ] = False,
    *,
    design: ConingDesign,
    output: Annotated[ConingOutput, Shown(only=TEXT_OUTPUT)],
) -> None:
    """Derive coning coefficients and their residual drift.

    A coefficient multiplies the cross product older sample x newer sample. The pairs are in the order of the newer
    sample, then of the older one, so that the newest pair is last. The residual is the mean drift on coning in rad/s,
    computed minus true, to second order in alpha. It is an expression that SymPy can read, in the symbols alpha
    (half-angle of the cone in rad), omega (its frequency in rad/s) and T (time between samples in s).

    With --objective the newest sample is crossed with a weighted sum of older ones, whose weights are the best ones
    for a band or a spectrum of vibration. Such coefficients correct coning alone. --format toml writes the file that
    --coning takes.

    Example: strapgen coning --samples 4 --form combined

    Example: strapgen coning --samples 1 --previous 8 --objective band --band 1.3 --out out/shaped.toml --format toml
    """
    output.check(design.spectrum)
    if design.objective is not None:
        return _deliver_design(design, samples, previous, output)
    if terms and samples + previous > _MOST_SAMPLES:
        raise InputError(
            f"terms of third and fourth order are listed for up to {_MOST_SAMPLES} samples; "
            f"{samples + previous} are given"
        )
    from strapgen.catalogue.methods import coning_coefficients
    from strapgen.design.coning_report import ConingResult

    output.show(ConingResult.of(coning_coefficients.design(samples, previous, form), terms))


def _deliver_design(options: ConingDesign, samples: int, previous: int, output: ConingOutput) -> None:
    """Design coefficients, and write them as a report or as a file."""
    brief = options.brief(samples, previous)
    from strapgen.catalogue.methods import shaped_coning
    from strapgen.design import coning_design
    from strapgen.design.coning_report import ShapedDrift, ShapedResult, figure_lines

    with waiting("designing"):
        shape = coning_design.design(brief)
        shaped_coning.verify(shape)
        drift = ShapedDrift(shape, brief.lines)
        if output.format != _FILE_FORMAT:
            output.show(ShapedResult.of(drift))
            return
        figures = figure_lines(drift)
    numbers = {"--samples": samples, "--previous": previous}
    place = {"--format": _FILE_FORMAT, "--out": output.file and output.file.name}
    command = command_line("coning", numbers, options, place, files_by_name=True)
    output.deliver(coning_design.written(shape, command, figures))
