"""The command ``strapgen study velocity-position`` measures velocity and position along a motion with a force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from strapgen.cli.option_groups import grouped
from strapgen.cli.options import Duration, a_backend, option
from strapgen.cli.output import Output
from strapgen.cli.progress import track
from strapgen.cli.values import Positive, names
from strapgen.ir.exceptions import InputError
from strapgen.lab.run_options import in_words, motion_option


@dataclass(frozen=True)
class FlightOptions:
    """Options of the motion, the specific force and the sampling."""

    panel: ClassVar[str] = "Input"

    motion: Annotated[str, motion_option()] = "random"
    settings: Annotated[
        dict[str, str] | None,
        option(
            "--set",
            metavar="KEY=VALUE...",
            help="Parameters of the motion; strapgen list motions shows their names.  [default: rate_deg_s=60]",
        ),
    ] = None
    force: Annotated[
        str,
        option(
            "--force",
            metavar="NAME",
            help="Specific force in body axes: constant, random, oscillation, or lever for sensors on an arm.",
        ),
    ] = "random"
    force_settings: Annotated[
        dict[str, str] | None,
        option(
            "--force-set",
            metavar="KEY=VALUE...",
            help="Parameters of the force, such as rms_m_s2, swing_y_g, frequency_hz, x_m.  "
            "[default: rms_m_s2=10 z_g=1]",
        ),
    ] = None
    sample_hz: Annotated[Positive, option("--sample-hz", metavar="HZ", help="Sampling rate in Hz.")] = (
        Positive("100")
    )
    duration: Duration = Positive("60")

    def described(self) -> str:
        """Return the motion and the force in words."""
        motion, force = map(in_words, self.stated())
        return f"{self.motion} motion ({motion}), {self.force} specific force ({force})"

    def stated(self) -> tuple[dict[str, str], dict[str, str]]:
        """Return the settings of the motion and of the force, with their defaults."""
        motion = {"rate_deg_s": "60"} if self.motion == "random" else {}
        force = {"rms_m_s2": "10", "z_g": "1"} if self.force == "random" else {}
        return self.settings or motion, self.force_settings or force


@grouped
def study_velocity_position(
    *,
    methods: Annotated[
        tuple[str, ...] | None,
        option(
            *("--method", "--methods"),
            metavar="NAME,...",
            help="Methods, each with all of its samples or one choice of them, as in coning-combined:3+3; "
            "two-speed:N is the recursion with N samples in a slow cycle.  [default: one of each kind]",
            panel="Algorithm",
        ),
    ] = None,
    backend: Annotated[
        str,
        option(
            "--backend",
            metavar="NAME",
            help="Back end; strapgen list backends shows all.",
            panel="Algorithm",
            read=a_backend,
        ),
    ] = "numpy",
    carry: Annotated[
        str,
        option(
            "--carry",
            metavar="NAME",
            help="Error feedback of the attitude in fixed point: none, state, full.",
            panel="Algorithm",
            read=names(("none", "state", "full")),
        ),
    ] = "none",
    flight: FlightOptions,
    output: Output,
) -> None:
    """Measure velocity and position along a motion with a specific force.

    Every method of the attitude has one for velocity and position, on the same samples. You see the largest errors of
    both beside the operations for each sample. Gravity acts along -z; its part is exact. In a back end of fixed point
    its rounding comes on top.

    Example: strapgen study velocity-position --method rk4:2,coning-combined:3+3 --duration 6

    Example: strapgen study velocity-position --method window-7-7 --motion cone --set half_angle_deg=1 frequency_hz=10
    --force oscillation --force-set swing_y_g=1 frequency_hz=10 z_g=1 --backend c
    """
    output.check()
    from strapgen.lab.motions.specific_forces import force
    from strapgen.lab.motions.users_motions import any_motion
    from strapgen.navigation.velocity_position import velocity_position_study as experiment
    from strapgen.navigation.velocity_position.velocity_position_report import TranslationResult
    from strapgen.run.backends import BACKENDS

    if carry != "none" and not BACKENDS[backend].fixed:
        raise InputError(f"--carry goes with a back end of fixed point, not with {backend}")
    motion_settings, force_settings = flight.stated()
    several = experiment.candidates(methods or experiment.DEFAULT)
    course = experiment.Flight(
        any_motion(flight.motion, flight.duration, motion_settings),
        force(flight.force, **force_settings),
        flight.sample_hz,
        flight.duration,
        backend,
        carry,
    )
    standings = list(track(experiment.study(several, course), "running", len(several)))
    output.show(TranslationResult(standings, course, flight.described()))
