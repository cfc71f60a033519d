"""The command ``strapgen check`` tests a step and exits with 1 if it fails."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import typer

from strapgen.cli import terminal
from strapgen.cli.option_groups import Shown, grouped, stated
from strapgen.cli.options import STEP_OPTIONS, CheckedAlgorithm, MethodOptions, option
from strapgen.cli.output import TEXT_OUTPUT, Output
from strapgen.cli.values import Positive, Vector
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.firmware.check_code.conformance import Finding
    from strapgen.firmware.check_code.foreign import ForeignStep
    from strapgen.firmware.check_code.foreign_arguments import ForeignSource
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
            help="What it takes, in the order of C, and the attitude behind an arrow, for instance "
            '"state[4], increments[2][3] -> next[4]" or "state[9], rates[3], dt -> state[9]".',
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
            "rates-at-ends in rad/s, those at the end of each interval.  [default: the name of the argument]",
            words=("increments", "rates", "rates-at-ends"),
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
        option("--init", metavar="NAME", help="Name of the function that begins a run, if there is one."),
    ] = None
    precision: Annotated[
        _Text,
        option(
            "--precision",
            metavar="NAME",
            help="Its numbers: float or double.  [default: double]",
            words=("float", "double"),
        ),
    ] = None

    def step(self, file: str) -> ForeignStep:
        """Return the function of a file, compiled."""
        from strapgen.firmware.check_code.foreign import INTERVAL, Convention, ForeignStep
        from strapgen.firmware.check_code.foreign_arguments import RATES

        source = self._source(file)
        arguments = source.arguments
        if self.scalar is not None and arguments.elements != 4:
            raise InputError(
                f"--scalar {self.scalar} goes with a result of four elements; this one has {arguments.elements}"
            )
        convention = Convention(self.scalar or "last", self.sense or "body-to-reference")
        takes = self.input or ("rates" if arguments.named(RATES) else "increments")
        interval = INTERVAL if self.sample_hz is None else 1 / self.sample_hz
        gravity, frame = (
            None if vector is None else tuple(map(float, vector))
            for vector in (self.gravity_m_s2, self.frame_rate_rad_s)
        )
        return ForeignStep(source, convention, takes, interval, gravity, frame)

    def _source(self, file: str) -> ForeignSource | InterpretedSource:
        """Return the function with its arguments."""
        from strapgen.firmware.check_code.foreign_arguments import ForeignSource, read_arguments
        from strapgen.firmware.check_code.interpreted import interpreted_source, is_callable

        init, precision = self.init or "", self.precision or "double"
        if is_callable(file):
            return interpreted_source(file, self.function, self.arguments, init, precision)
        if self.function is None or self.arguments is None:
            missing = "--function" if self.function is None else "--arguments"
            raise InputError(
                f'{file} needs {missing}; --function NAME --arguments "state[4], increments[2][3] -> next[4]" '
                "is an example"
            )
        return ForeignSource(Path(file), self.function, read_arguments(self.arguments), init, precision)


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
    --arguments "state[4], increments[3] -> state[4]" --scalar first --init integrator_init
    """
    output.check(algorithm, *method.files)
    from strapgen.firmware.check_code.foreign_arguments import FOREIGN_SUFFIXES, is_foreign
    from strapgen.firmware.check_code.interpreted import is_callable

    if is_foreign(algorithm) or is_callable(algorithm):
        _refuse(stated(method), f"goes with an algorithm of strapgen; {algorithm} is code of your own")
        _check_foreign(algorithm, foreign, output)
    else:
        _refuse(
            stated(foreign),
            f"goes with a file in C or C++ ({', '.join(FOREIGN_SUFFIXES)}), one in MATLAB or package.module:function; "
            f"{algorithm} is none",
        )
        _check_step(algorithm, method, output)


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
    step = foreign.step(file)
    from strapgen.firmware.check_code.check_foreign import check_foreign

    result = check_foreign(step)
    output.show(result)
    _fail(file, result.findings, f"; likely cause: {result.cause}" if result.cause else "")


def _fail(name: str, findings: Sequence[Finding], cause: str = "") -> None:
    """End with status 1 if anything fails."""
    if failed := [finding.name for finding in findings if finding.holds is False]:
        typer.echo(f"strapgen: {name} fails: {', '.join(failed)}{cause}", err=True)
        raise typer.Exit(1)
