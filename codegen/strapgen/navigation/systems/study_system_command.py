"""The command ``strapgen study system`` runs a described system on every back end from the counts of one vehicle."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import Duration, listed, option
from strapgen.cli.output import Output
from strapgen.ir import checks


@grouped
def study_system(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="TOML file that describes the system.")],
    *,
    backend: Annotated[
        str,
        option(
            "--backend",
            metavar="NAME,...",
            help="Back ends beside C in double, with commas between; strapgen list backends shows all.",
            panel="Run",
        ),
    ] = "c-float,c-fixed32,c-fixed16",
    sample_hz: Annotated[
        str | None,
        option(
            "--sample-hz",
            metavar="HZ",
            help="Samples of the sensors in a second, in place of those in the file.",
            panel="Input",
        ),
    ] = None,
    duration: Duration = "60",
    turn_rate_deg_s: Annotated[
        str,
        option("--turn-rate-deg-s", metavar="RATE", help="Largest rate of heading in deg/s.", panel="Input"),
    ] = "70",
    latitude_deg: Annotated[
        str, option("--latitude-deg", metavar="DEG", help="Latitude of the vehicle in deg.", panel="Input")
    ] = "45",
    spectrum: Annotated[
        Path | None,
        option(
            "--spectrum",
            metavar="FILE",
            help="CSV file with the spectrum of a vibration, as strapgen vibration takes it.",
            panel="Input",
        ),
    ] = None,
    cpu: Annotated[
        str | None,
        option(
            "--cpu",
            metavar="NAME",
            help="Count the instructions of the C in fixed point on this processor, as strapgen cost does, for "
            "instance cortex-m3.",
            panel="Run",
        ),
    ] = None,
    fixed: Annotated[FixedOptions, Shown(only=("rounding", "carry", "drift_allowance"))],
    output: Output,
) -> None:
    """Run a described system on several back ends, and compare attitude, velocity and position.

    A vehicle stands on one spot, turns to and fro, rolls, pitches and vibrates; its sensors send counts. You see how
    far the other back ends go from C in double, and this from the truth, and what memory and load they need, beside
    those of 1984. Differences add up in a closed run, and no bound is known for them; strapgen compare holds each
    single pass to its bound.

    Example: strapgen study system examples/strapdown.toml --sample-hz 100 --duration 60
    """
    output.check(file, spectrum)
    import math

    from strapgen.analysis.vibration.spectrum import read_spectrum
    from strapgen.navigation.systems.system_study import study
    from strapgen.navigation.systems.system_study_report import SystemStudyResult
    from strapgen.navigation.systems.turning_vehicle import TurningVehicle
    from strapgen.navigation.systems.wiring import described
    from strapgen.run.backends import BACKENDS

    names = [checks.choice("backend", name, BACKENDS) for name in listed("backend", backend)]
    rate = None if sample_hz is None else checks.number("sample-hz", sample_hz, positive=True)
    turning = math.radians(checks.number("turn-rate-deg-s", turn_rate_deg_s, positive=True))
    latitude = math.radians(checks.number("latitude-deg", latitude_deg))
    seconds = checks.number("duration", duration, positive=True)
    vehicle = TurningVehicle(latitude, turning, None if spectrum is None else read_spectrum(spectrum))
    result = study(described(file, rate), vehicle, seconds, names, fixed.settings(1), cpu or "")
    output.show(SystemStudyResult.of(result))
