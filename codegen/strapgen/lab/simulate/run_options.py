"""Options of a run on a motion or a recording: its start, its intervals, and where its result goes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

from strapgen.cli.option_groups import Excludes, Needs, Rule
from strapgen.cli.options import option
from strapgen.cli.output import Output, format_option, plot_option
from strapgen.cli.values import Positive, Vector, line

_Text = str | None


@dataclass(frozen=True)
class RunOptions:
    """Options of the attitude at the start, and of the times between orthonormalizations and between records."""

    panel: ClassVar[str] = "Run"

    orthonormalize: Annotated[
        Positive | None,
        option(
            "--orthonormalize",
            metavar="S",
            help="Time from one orthonormalization to the next in s.  [default: never]",
        ),
    ] = None
    scheme: Annotated[
        _Text,
        option(
            "--scheme",
            metavar="NAME",
            help="Kernel that orthonormalizes; strapgen list kernels shows all.  [default: the thesis's scheme]",
        ),
    ] = None
    record: Annotated[
        Positive | None,
        option(
            "--record",
            metavar="S",
            help="Time from one record to the next in s; it must divide the duration.  [default: every step]",
        ),
    ] = None
    initial: Annotated[
        Vector | None,
        option(
            "--initial-deg",
            metavar="R,P,H",
            help="Roll, pitch and heading at the start of a motion in deg.  [default: zero rotation]",
        ),
    ] = None

    def start(self) -> Any:
        """Return the matrix at the start of a run, (3, 3); None for zero rotation."""
        if self.initial is None:
            return None
        import numpy as np

        from strapgen.run.backends import evaluator

        return evaluator("dcm-from-euler-angles")(np.radians([*map(float, self.initial)]))


@dataclass(frozen=True)
class RunOutput(Output):
    """Where the result of a run goes; without --format, the attitude along a recording is CSV."""

    rules: ClassVar[tuple[Rule, ...]] = (
        Needs("--matrices", "--format=json"),
        Excludes("--print", "--format=json|csv|markdown|latex"),
    )

    plot: Annotated[Path | None, plot_option("the plots")] = None
    format: Annotated[_Text, format_option(Output.formats, "  [default: text; csv for recorded data]")] = None
    title: Annotated[
        _Text, option("--title", metavar="TEXT", help="Title of the text, and of the plots.", read=line)
    ] = None
    print_every: Annotated[
        Positive | None,
        option(
            "--print",
            metavar="S",
            help="Time in s from one print of the matrices to the next in the text.  [default: at the end alone]",
        ),
    ] = None
    matrices: Annotated[
        bool, option("--matrices", help="Add the computed and the true matrices to the JSON output.")
    ] = False
