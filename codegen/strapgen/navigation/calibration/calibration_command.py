"""The command ``strapgen study calibration`` shows what a scheme of positions tells of an inertial measurement unit."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from strapgen.cli.option_groups import grouped
from strapgen.cli.options import option
from strapgen.cli.output import Output
from strapgen.cli.progress import track
from strapgen.cli.values import Vector
from strapgen.ir.exceptions import InputError


@grouped
def study_calibration(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="TOML file with the positions.", show_default=False)
    ],
    *,
    rate_deg_s: Annotated[
        Vector | None,
        option(
            "--rate-deg-s",
            metavar="X,Y,Z",
            help="Rate in flight, body axes, to show what compensation leaves there.",
            panel="Input",
        ),
    ] = None,
    acceleration_g: Annotated[
        Vector | None,
        option(
            "--acceleration-g", metavar="X,Y,Z", help="Acceleration in flight in g, body axes.", panel="Input"
        ),
    ] = None,
    output: Output,
) -> None:
    """Show which coefficients of an inertial measurement unit a scheme of positions sees, and how well.

    In each position the errors of rate and acceleration are measured at rest. You see the exact rank, combinations of
    coefficients that leave no trace, and the standard deviation of every other coefficient by least squares; with
    measured errors in the file, the estimates as well.

    Example: strapgen study calibration examples/positions-20.toml --plot out/calibration.png
    """
    output.check(file)
    from strapgen.navigation.calibration.calibration import QUANTITIES, calibrated
    from strapgen.navigation.calibration.calibration_file import read
    from strapgen.navigation.calibration.calibration_report import calibration_image, calibration_report

    content = read(file)
    steps = (calibrated(content.scheme, quantity) for quantity in QUANTITIES)
    several = list(track(steps, "solving", len(QUANTITIES)))
    estimates, remaining = {}, {}
    for one in several:
        if one.quantity in content.errors:
            try:
                estimates[one.quantity] = one.estimate(content.errors[one.quantity])
            except InputError as error:
                raise InputError(f"{file}: {error}") from None
        if rate_deg_s is not None or acceleration_g is not None:
            turning = [math.radians(value) for value in rate_deg_s or (0, 0, 0)]
            covariance = one.error_covariance(turning, [*map(float, acceleration_g or (0, 0, 0))])
            remaining[one.quantity] = covariance * content.sigma[one.quantity] ** 2
    output.report(
        calibration_report(content, several, estimates, remaining),
        lambda path: calibration_image(content, several, path),
    )
