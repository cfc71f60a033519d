"""Options of a run along an inertial recording: its cycles, its start, and where its result goes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from strapgen.cli.options import option, whole
from strapgen.cli.output import Output, format_option, plot_option
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.navigation.courses.courses import NavigationFrame


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
        str, option("--initial-deg", metavar="R,P,H", help="Roll, pitch and heading at the start in deg.")
    ] = "0,0,0"
    frame_rate: Annotated[
        str,
        option(
            "--frame-rate-deg-h",
            metavar="X,Y,Z",
            help="Rate of the navigation frame in deg/h, in navigation axes.",
        ),
    ] = "0,0,0"

    def matrix(self) -> Any:
        """Return the attitude at the start as a matrix, (3, 3)."""
        import numpy as np

        from strapgen.run.backends import evaluator

        return evaluator("dcm-from-euler-angles")(np.radians(_three("--initial-deg", self.initial)))

    def frame(self) -> NavigationFrame:
        """Return the navigation frame with the attitude at its start."""
        import numpy as np

        from strapgen.navigation.courses.courses import NavigationFrame

        begin = np.radians(_three("--initial-deg", self.initial))
        return NavigationFrame(begin, np.radians(_three("--frame-rate-deg-h", self.frame_rate)) / 3600)


@dataclass(frozen=True)
class CycleCounts:
    """Options of an algorithm in two speeds: the cycles of its loops, and its sculling integral."""

    panel: ClassVar[str] = "Algorithm"

    fast: Annotated[
        str | None,
        option("--fast-cycles", metavar="N", help="Number of fast cycles in a slow cycle."),
    ] = None
    slow: Annotated[
        str | None,
        option(
            "--slow-cycles", metavar="N", help="Number of slow cycles in a navigation cycle.  [default: 1]"
        ),
    ] = None
    sculling: Annotated[
        str | None,
        option(
            "--sculling",
            metavar="N",
            help="Form of the sculling integral: 1 with the rotation compensation, 2 without.  [default: 2]",
        ),
    ] = None

    @property
    def stated(self) -> list[str]:
        """The options that the command line has."""
        values = {"--fast-cycles": self.fast, "--slow-cycles": self.slow, "--sculling": self.sculling}
        return [name for name, value in values.items() if value is not None]

    def counts(self) -> dict[str, int]:
        """Return the cycles and the form of the sculling integral."""
        if self.fast is None:
            raise InputError("--fast-cycles is missing; an algorithm in two speeds needs it")
        return {
            "fast_cycles": whole("fast_cycles", self.fast) or 0,
            "slow_cycles": whole("slow_cycles", self.slow or "1") or 0,
            "sculling": whole("sculling", self.sculling or "2") or 0,
        }


def _three(name: str, text: str) -> list[float]:
    from strapgen.ir import checks

    parts = text.split(",")
    if len(parts) != 3:
        raise InputError(f"{name} is {text!r}; three numbers with commas between are needed")
    return [float(checks.number(name, part)) for part in parts]
