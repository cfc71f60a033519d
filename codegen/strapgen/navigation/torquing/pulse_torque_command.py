"""The command ``strapgen study pulse-torque`` runs the loop that holds a gyro's float with pulses."""

from __future__ import annotations

from fractions import Fraction
from typing import Annotated

from strapgen.cli.option_groups import grouped
from strapgen.cli.options import option
from strapgen.cli.output import Output
from strapgen.cli.progress import track
from strapgen.cli.values import filled


@grouped
def study_pulse_torque(
    *,
    settings: Annotated[
        dict[str, Fraction] | None,
        option(
            "--set",
            metavar="KEY=VALUE...",
            help="Constants: gain, lag_gain, lag_pole, integral_gain, leak, quantum_arcsec, lag_s, cycle_hz, "
            "largest_deg_s, largest_pulses, delay_cycles.  [default: those of a fit to the printed responses]",
            panel="Input",
        ),
    ] = None,
    output: Output,
) -> None:
    """Run a pulse torquing loop beside the figures of its source.

    You see rise, overshoot, offset, bandwidth and the angle under an angular acceleration, for the linear loop and for
    one with quanta and limits, beside what the source prints. A loop that is unstable is refused.

    Example: strapgen study pulse-torque --plot out/pulse-torque.png
    """
    output.check()
    from strapgen.navigation.torquing.torquing import TorqueLoop
    from strapgen.navigation.torquing.torquing_report import torquing_image, torquing_report
    from strapgen.navigation.torquing.torquing_study import PRINTED, torquing_rows

    loop = filled(TorqueLoop, settings)
    loop.require_stable()
    rows = list(track(torquing_rows(loop), "running", len(PRINTED)))
    output.report(torquing_report(loop, rows), lambda path: torquing_image(loop, path))
