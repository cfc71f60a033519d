"""The command ``strapgen check`` tests a step and exits with 1 if it fails."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import typer

from strapgen import registration
from strapgen.cli import terminal
from strapgen.cli.option_groups import Shown, command_line, grouped, stated
from strapgen.cli.options import STEP_OPTIONS, CheckedAlgorithm, MethodOptions, option
from strapgen.cli.output import TEXT_OUTPUT, Output
from strapgen.cli.values import Positive, Vector
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.firmware.check_code.bridge import ForeignSource
    from strapgen.firmware.check_code.conformance import Finding
    from strapgen.firmware.check_code.foreign import ForeignStep
    from strapgen.firmware.check_code.interpreted import InterpretedSource

_Text = str | None


@dataclass(frozen=True)
class ForeignOptions:
    """Options of a function in a file in C or C++; None where the command line does not say."""

    panel: ClassVar[str] = "A function in C or C++"

    function: Annotated[
        _Text, option("--function", metavar="NAME", help="Name of the function in the file.")
    ] = None
    arguments: Annotated[
        _Text,
        option(
            "--arguments",
            metavar="TEXT",
            help="What it takes, in the order of C, and the attitude behind an arrow, where names do not say it, for "
            'instance "state, increments[2][3] -> next" or "filter, rates, dt, =0 -> filter.q".',
        ),
    ] = None
    scalar: Annotated[
        _Text,
        option(
            "--scalar",
            metavar="NAME",
            help="Where the scalar part of four elements stands: first or last.  [default: last]",
            words=("first", "last"),
        ),
    ] = None
    sense: Annotated[
        _Text,
        option(
            "--sense",
            metavar="NAME",
            help="body-to-reference or reference-to-body.  [default: body-to-reference]",
            words=("body-to-reference", "reference-to-body"),
        ),
    ] = None
    input: Annotated[
        _Text,
        option(
            "--input",
            metavar="NAME",
            help="What the samples are: increments in rad; rates in rad/s, means over the sampling interval; or "
            "instants in rad/s, the rates at the time of each sample.  [default: the name of the argument]",
            words=("increments", "rates", "instants"),
        ),
    ] = None
    sample_hz: Annotated[
        Positive | None,
        option(
            "--sample-hz",
            metavar="HZ",
            help="Samples in a second: dt and step follow from it, and rates from the increments.  "
            "[default: 100]",
        ),
    ] = None
    gravity_m_s2: Annotated[
        Vector | None,
        option(
            "--gravity-m-s2",
            metavar="X,Y,Z",
            help="Gravity in reference axes that it adds to the velocity.  [default: none; 0,0,-9.80665 for an "
            "argument gravity]",
        ),
    ] = None
    frame_rate_rad_s: Annotated[
        Vector | None,
        option(
            "--frame-rate-rad-s",
            metavar="X,Y,Z",
            help="Rate of its reference axes against inertial space, in these axes.  [default: none; that of north, "
            "east, down at 45 deg of latitude for an argument frame_rate]",
        ),
    ] = None
    init: Annotated[
        _Text,
        option(
            "--init",
            metavar="NAME",
            help="The function or constructor that begins a run, if there is one; with arguments as "
            '"begin(memory, 100)" or "Filter(0.01f)".',
        ),
    ] = None
    precision: Annotated[
        _Text,
        option(
            "--precision",
            metavar="NAME",
            help="What its numbers must be: float or double.  [default: those of the source]",
            words=("float", "double"),
        ),
    ] = None
    angle_unit: Annotated[
        _Text,
        option(
            "--angle-unit",
            metavar="UNIT",
            help="Unit of its angles and rates: rad, deg, or the rad of one count, as 2**-20.  [default: rad]",
            words=("rad", "deg"),
        ),
    ] = None
    state_bits: Annotated[
        int | None,
        option(
            "--state-bits",
            metavar="BITS",
            help="Bits behind the point of an attitude in integers: 30 where 2**30 stands for 1.",
        ),
    ] = None
    publishes: Annotated[
        _Text,
        option(
            "--publishes",
            metavar="N",
            help="Calls to a result, or a number that changes with every result, as filter.count.  "
            "[default: as its return value says, else 1]",
        ),
    ] = None
    source: Annotated[
        tuple[Path, ...] | None,
        option("--source", metavar="FILE,...", help="Other files of its code, with commas between."),
    ] = None
    cflags: Annotated[
        _Text,
        option("--cflags", metavar="TEXT", help='Options of the compiler, as "-Iinclude -DFAST=1".'),
    ] = None
    compile_commands: Annotated[
        _Text,
        option(
            "--compile-commands",
            metavar="FILE",
            help="A compile_commands.json, whose options for the file are taken.",
        ),
    ] = None
    show_shim: Annotated[
        bool | None,
        option("--show-shim", help="Print the generated code that calls it, and check nothing."),
    ] = None
    keep_shim: Annotated[
        _Text,
        option("--keep-shim", metavar="FILE", help="Write the generated code that calls it to a file."),
    ] = None

    report: Annotated[
        Path | None, option("--report", metavar="FILE", help="Write the findings as one HTML page to a file.")
    ] = None

    def read(self, file: str) -> ForeignSource | InterpretedSource:
        """Return the function of a file, and how it is called."""
        from strapgen.firmware.check_code.bridge import read_source
        from strapgen.firmware.check_code.foreign_arguments import RUST
        from strapgen.firmware.check_code.interpreted import interpreted_source, is_callable
        from strapgen.firmware.check_code.rust_source import rust_source

        if is_callable(file):
            return interpreted_source(
                *(file, self.function, self.arguments, self.init or "", self.precision or "double"),
                takes=self.input or "",
                is_angle_said=self.angle_unit is not None,
            )
        if self.function is None:
            raise InputError(f"{file} needs --function; --function NAME says which one is checked")
        read = rust_source if Path(file).suffix == RUST else read_source
        return read(
            *(Path(file), self.function, self.arguments, self.init or "", self.precision),
            takes=self.input or "",
            is_angle_said=self.angle_unit is not None,
            cflags=self.cflags or "",
            compile_commands=self.compile_commands,
            sources=self.source or (),
            publishes=self.publishes or "",
        )

    def step(self, source: ForeignSource | InterpretedSource) -> ForeignStep:
        """Return a function, compiled."""
        from strapgen.firmware.check_code.foreign import INTERVAL, Convention, ForeignStep
        from strapgen.firmware.check_code.foreign_arguments import RATES

        arguments, scalar = source.arguments, self.scalar
        if scalar is not None and arguments.elements != 4:
            raise InputError(
                f"--scalar {scalar} goes with a result of four elements; this one has {arguments.elements}"
            )
        if scalar == "first" and arguments.names_scalar:
            raise InputError(
                f"--scalar {scalar} contradicts the source, whose names say which element is the scalar part"
            )
        convention = Convention(scalar or "last", self.sense or "body-to-reference")
        gravity, frame = (
            None if vector is None else tuple(map(float, vector))
            for vector in (self.gravity_m_s2, self.frame_rate_rad_s)
        )
        return ForeignStep(
            source,
            convention,
            self.input or ("rates" if arguments.named(RATES) else "increments"),
            INTERVAL if self.sample_hz is None else 1 / self.sample_hz,
            gravity,
            frame,
            angle_unit=angle_unit(self.angle_unit or "rad"),
            state_bits=checks.count("--state-bits", self.state_bits or 0, smallest=0, largest=62),
        )


def angle_unit(text: str) -> float:
    """Return the rad of a unit of angles.

    >>> angle_unit("rad"), angle_unit("2**-20") == 2.0**-20
    (1.0, True)
    """
    if text in ("rad", "deg"):
        return math.radians(1) if text == "deg" else 1.0
    base, power, exponent = text.partition("**")
    try:
        value = checks.number("--angle-unit", base, positive=True)
        value = value ** int(exponent) if power else value
        size = float(value)
    except (InputError, ValueError, OverflowError):
        size = 0.0
    if not 0 < size < math.inf:
        raise InputError(
            f"--angle-unit is {checks.shown(text)}; rad, deg, or the rad of a count as 2**-20 is needed"
        )
    return size


@grouped
def check(
    algorithm: CheckedAlgorithm,
    *,
    method: Annotated[MethodOptions, Shown(only=STEP_OPTIONS)],
    foreign: ForeignOptions,
    output: Annotated[Output, Shown(only=TEXT_OUTPUT)],
) -> None:
    """Run the conformance tests; exit 1 on failure.

    Identities are checked in arithmetic of 40 digits, the order is measured on a ladder of step lengths, and every back
    end is compared with exact arithmetic. A line that begins with a dash is a measurement without a limit.

    A function in a file of C or C++ is compiled, run along motions with known attitude, and put to the same tests. If
    it fails one, the likely cause is named.

    Example: strapgen check examples/modified_rodrigues.py

    Example: strapgen check examples/check_foreign_c/correct.c --function integrator_update
    --scalar first --init integrator_init
    """
    _check_report(foreign.report, output, algorithm, *(foreign.source or ()), foreign.compile_commands)
    output.check(algorithm, *method.files, *(foreign.source or ()), foreign.compile_commands)
    from strapgen.firmware.check_code.foreign_arguments import FOREIGN_SUFFIXES, RUST, is_foreign
    from strapgen.firmware.check_code.interpreted import is_callable

    if is_foreign(algorithm) or is_callable(algorithm) or Path(algorithm).suffix == RUST:
        _refuse(stated(method), f"goes with an algorithm of strapgen; {algorithm} is code of your own")
        _check_foreign(algorithm, foreign, output)
    else:
        _refuse(
            stated(foreign),
            f"goes with a file in C or C++ ({', '.join(FOREIGN_SUFFIXES)}), one in Rust or MATLAB, or "
            f"package.module:function; {algorithm} is none",
        )
        _check_step(algorithm, method, output)


def _check_report(report: Path | None, output: Output, *read: str | Path | None) -> None:
    """Check that the page is written over no file that is read or written, and that its folder can hold it."""
    from strapgen.storage.files import check_folder

    if report is None:
        return
    if report.resolve() in [Path(file).resolve() for file in read if file is not None]:
        raise InputError(f"--report {report} is a file that the command reads; another one is needed")
    if output.file is not None and report.resolve() == output.file.resolve():
        raise InputError(f"--out and --report are both {report}; two files are needed")
    check_folder(report.parent)


def _refuse(options: Iterable[str], reason: str) -> None:
    """Refuse options that do not apply to the checked algorithm."""
    for name in options:
        raise InputError(f"{name} {reason}")


def _check_step(algorithm: str, method: MethodOptions, output: Output) -> None:
    """Check an attitude step of the catalogue or of a user."""
    choice = method.choose(algorithm)
    from strapgen import pipeline
    from strapgen.firmware.check_code import conformance

    kernel = pipeline.derive(choice)
    # A person sees each finding as soon as it is there.
    live = output.format == "text" and output.file is None
    if live:
        typer.echo(f"{kernel.name}: {kernel.title}\n")
    findings = []
    for finding in conformance.findings(choice):
        findings.append(finding)
        if live:
            terminal.write(conformance.finding_text(finding))
    if not live:
        output.show(conformance.FindingsResult(kernel.name, kernel.title, findings))
    _fail(kernel.name, findings)


def _check_foreign(file: str, foreign: ForeignOptions, output: Output) -> None:
    """Check a function of a file in C or C++."""
    if foreign.input == "rates-at-ends":
        terminal.remark("strapgen: --input rates-at-ends is now --input instants")
        foreign = replace(foreign, input="instants")
    source = foreign.read(file)
    if foreign.show_shim or foreign.keep_shim:
        from strapgen.firmware.check_code.bridge import ForeignSource, bridge_text
        from strapgen.storage.files import write_files

        if not isinstance(source, ForeignSource):
            raise InputError(f"--show-shim and --keep-shim go with a file in C or C++; {file} is none")
        if foreign.keep_shim:
            read = [each.resolve() for each in (Path(file), *(foreign.source or ()))]
            if Path(foreign.keep_shim).resolve() in read:
                raise InputError(
                    f"--keep-shim {foreign.keep_shim} is a file that the command reads; another one is needed"
                )
            for path in write_files(Path(), {foreign.keep_shim: bridge_text(source)}):
                terminal.remark(f"wrote {path}")
        if foreign.show_shim:
            typer.echo(bridge_text(source))
            return
    from strapgen.firmware.check_code.check_foreign import check_foreign

    result = check_foreign(foreign.step(source))
    if foreign.report is not None:
        from strapgen.storage.files import write_files

        page = registration.extension("check.report", "--report")
        for path in write_files(
            Path(), {str(foreign.report): page(result, command_line("check", file, foreign))}
        ):
            terminal.remark(f"wrote {path}")
    output.show(result)
    _fail(file, result.findings, f"; likely cause: {result.cause}" if result.cause else "")


def _fail(name: str, findings: Sequence[Finding], cause: str = "") -> None:
    """End with status 1 if anything fails."""
    if failed := [finding.name for finding in findings if finding.holds is False]:
        typer.echo(f"strapgen: {name} fails: {', '.join(failed)}{cause}", err=True)
        raise typer.Exit(1)
