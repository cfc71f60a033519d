"""What is demanded of a step with unknown coefficients: an order on a motion."""

from __future__ import annotations

from dataclasses import dataclass

from strapgen.ir import checks

#: Motions on which conditions of an attitude step are stated.
OF_ATTITUDE = ("general", "coning", "polynomial")
#: Motions, and parts of the change on any motion, on which those of a step of velocity and position are.
OF_VELOCITY = ("general", "velocity", "position", "polynomial", "sculling")
#: Highest order: on any smooth motion, of an attitude and of a velocity, and to second order in the motion.
MOST_GENERAL, MOST_OF_VELOCITY, MOST_SECOND = 8, 6, 16


@dataclass(frozen=True)
class Demand:
    """A motion and the order that a step is to have on it."""

    #: One of `OF_ATTITUDE` or `OF_VELOCITY`
    motion: str
    #: The last power of the step at which its error has to vanish
    order: int

    def require(self, velocity: bool) -> None:
        """Check the motion and the order."""
        what = "step of velocity and position" if velocity else "attitude step"
        checks.choice(f"motion of the {what}", self.motion, OF_VELOCITY if velocity else OF_ATTITUDE)
        most = MOST_OF_VELOCITY if velocity else MOST_GENERAL
        if self.motion in ("coning", "polynomial", "sculling"):
            most = MOST_SECOND
        checks.count(f"order on {self.motion} motion", self.order, largest=most)
