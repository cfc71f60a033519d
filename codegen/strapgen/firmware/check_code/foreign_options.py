"""Options that say how a user's function in C or C++ is called and read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from strapgen.cli.options import option
from strapgen.cli.values import Positive
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.firmware.check_code.runs import ForeignStep

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
        ),
    ] = None
    sense: Annotated[
        _Text,
        option(
            "--sense",
            metavar="NAME",
            help="body-to-reference or reference-to-body.  [default: body-to-reference]",
        ),
    ] = None
    input: Annotated[
        _Text,
        option(
            "--input",
            metavar="NAME",
            help="What the samples are: increments in rad; rates in rad/s, means over the sampling interval; or "
            "rates-at-ends in rad/s, those at the end of each interval.  [default: the name of the argument]",
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
    init: Annotated[
        _Text,
        option("--init", metavar="NAME", help="Name of the function that begins a run, if there is one."),
    ] = None
    precision: Annotated[
        _Text, option("--precision", metavar="NAME", help="Its numbers: float or double.  [default: double]")
    ] = None

    def step(self, file: str) -> ForeignStep:
        """Return the function of a file, compiled."""
        from strapgen.firmware.check_code.foreign_arguments import RATES, read_arguments
        from strapgen.firmware.check_code.foreign_bridge import ForeignSource
        from strapgen.firmware.check_code.runs import Convention, ForeignStep

        if self.function is None or self.arguments is None:
            missing = "--function" if self.function is None else "--arguments"
            raise InputError(
                f'{file} needs {missing}; --function NAME --arguments "state[4], increments[2][3] -> next[4]" '
                "is an example"
            )
        arguments = read_arguments(self.arguments)
        if self.scalar is not None and arguments.elements != 4:
            raise InputError(
                f"--scalar {self.scalar} goes with a result of four elements; this one has {arguments.elements}"
            )
        convention = Convention(self.scalar or "last", self.sense or "body-to-reference")
        takes = self.input or ("rates" if arguments.named(RATES) else "increments")
        source = ForeignSource(
            Path(file), self.function, arguments, self.init or "", self.precision or "double"
        )
        if self.sample_hz is None:
            return ForeignStep(source, convention, takes)
        return ForeignStep(source, convention, takes, 1 / self.sample_hz)
