"""The command ``strapgen study pulse-torque`` runs the loop that holds a gyro's float with pulses."""

from __future__ import annotations

from dataclasses import fields
from typing import Annotated, Any

from strapgen.cli.option_groups import grouped
from strapgen.cli.options import option
from strapgen.cli.output import Output
from strapgen.cli.progress import track
from strapgen.ir import checks
from strapgen.lab.simulate.sample_source import pairs


@grouped
def study_pulse_torque(
    *,
    settings: Annotated[
        list[str] | None,
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
    from strapgen.navigation.torquing.torquing_report import TorquingResult
    from strapgen.navigation.torquing.torquing_study import PRINTED, torquing_rows

    kinds = {
        one.name: int if one.name in ("largest_pulses", "delay_cycles") else float
        for one in fields(TorqueLoop)
    }
    stated: dict[str, Any] = {}
    for key, value in pairs(settings or []).items():
        checks.choice("--set", key, kinds)
        stated[key] = (
            checks.count(key, checks.whole(key, value), largest=1000)
            if kinds[key] is int
            else float(checks.number(key, value))
        )
    loop = TorqueLoop(**stated)
    loop.require_stable()
    rows = list(track(torquing_rows(loop), "running", len(PRINTED)))
    output.show(TorquingResult(loop, rows))
