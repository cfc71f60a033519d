"""Options of a run along an inertial recording: its cycles, its start, and where its result goes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from strapgen.cli.options import option
from strapgen.cli.output import Output, format_option, plot_option
from strapgen.cli.values import Number, Vector
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.navigation.courses.courses import NavigationFrame


#: The default of three numbers
_ZERO = (Number("0"), Number("0"), Number("0"))


@dataclass(frozen=True)
class CourseOutput(Output):
    """Where the attitude and the velocity changes along a recording go."""

    plot: Annotated[Path | None, plot_option("the attitude and the velocity changes")] = None
    format: Annotated[str | None, format_option(Output.formats, "  [default: text; csv with --out]")] = None


@dataclass(frozen=True)
class Start:
    """Options of the attitude at the start, and of the rate of the navigation frame."""

    panel: ClassVar[str] = "Input"

    initial: Annotated[
        Vector, option("--initial-deg", metavar="R,P,H", help="Roll, pitch and heading at the start in deg.")
    ] = _ZERO
    frame_rate: Annotated[
        Vector,
        option(
            "--frame-rate-deg-h",
            metavar="X,Y,Z",
            help="Rate of the navigation frame in deg/h, in navigation axes.",
        ),
    ] = _ZERO

    def matrix(self) -> Any:
        """Return the attitude at the start as a matrix, (3, 3)."""
        import numpy as np

        from strapgen.run.backends import evaluator

        return evaluator("dcm-from-euler-angles")(np.radians([*map(float, self.initial)]))

    def frame(self) -> NavigationFrame:
        """Return the navigation frame with the attitude at its start."""
        import numpy as np

        from strapgen.navigation.courses.courses import NavigationFrame

        begin, rate = (np.radians([*map(float, three)]) for three in (self.initial, self.frame_rate))
        return NavigationFrame(begin, rate / 3600)


@dataclass(frozen=True)
class CycleCounts:
    """Options of an algorithm in two speeds: the cycles of its loops, and its sculling integral."""

    panel: ClassVar[str] = "Algorithm"

    fast: Annotated[
        int | None,
        option("--fast-cycles", metavar="N", help="Number of fast cycles in a slow cycle."),
    ] = None
    slow: Annotated[
        int | None,
        option(
            "--slow-cycles", metavar="N", help="Number of slow cycles in a navigation cycle.  [default: 1]"
        ),
    ] = None
    sculling: Annotated[
        int | None,
        option(
            "--sculling",
            metavar="N",
            help="Form of the sculling integral: 1 with the rotation compensation, 2 without.  [default: 2]",
        ),
    ] = None

    def counts(self) -> dict[str, int]:
        """Return the cycles and the form of the sculling integral."""
        if self.fast is None:
            raise InputError("--fast-cycles is missing; an algorithm in two speeds needs it")
        return {
            "fast_cycles": self.fast,
            "slow_cycles": 1 if self.slow is None else self.slow,
            "sculling": 2 if self.sculling is None else self.sculling,
        }
