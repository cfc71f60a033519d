"""The command ``strapgen study system`` runs a described system on every back end from the counts of one vehicle."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import Duration, Processor, a_backend, option
from strapgen.cli.output import Output
from strapgen.cli.values import Number, Positive


@grouped
def study_system(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="TOML file that describes the system.")],
    *,
    backend: Annotated[
        tuple[str, ...],
        option(
            "--backend",
            metavar="NAME,...",
            help="Back ends beside C in double, with commas between; strapgen list backends shows all.",
            panel="Run",
            read=a_backend,
        ),
    ] = ("c-float", "c-fixed32", "c-fixed16"),
    sample_hz: Annotated[
        Positive | None,
        option(
            "--sample-hz",
            metavar="HZ",
            help="Samples of the sensors in a second, in place of those in the file.",
            panel="Input",
        ),
    ] = None,
    duration: Duration = Positive("60"),
    turn_rate_deg_s: Annotated[
        Positive,
        option("--turn-rate-deg-s", metavar="RATE", help="Largest rate of heading in deg/s.", panel="Input"),
    ] = Positive("70"),
    latitude_deg: Annotated[
        Number, option("--latitude-deg", metavar="DEG", help="Latitude of the vehicle in deg.", panel="Input")
    ] = Number("45"),
    spectrum: Annotated[
        Path | None,
        option(
            "--spectrum",
            metavar="FILE",
            help="CSV file with the spectrum of a vibration, as strapgen vibration takes it.",
            panel="Input",
        ),
    ] = None,
    cpu: Processor = None,
    fixed: Annotated[FixedOptions, Shown(only=("rounding", "carry", "allowance"))],
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
    from strapgen.navigation.systems.system_study_report import system_study_report
    from strapgen.navigation.systems.turning_vehicle import TurningVehicle
    from strapgen.navigation.systems.wiring import described

    turning, latitude = math.radians(turn_rate_deg_s), math.radians(latitude_deg)
    vehicle = TurningVehicle(latitude, turning, None if spectrum is None else read_spectrum(spectrum))
    result = study(described(file, sample_hz), vehicle, duration, backend, fixed.settings(1), cpu or "")
    output.report(system_study_report(result))
