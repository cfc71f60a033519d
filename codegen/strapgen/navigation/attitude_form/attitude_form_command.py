"""The command ``strapgen study attitude-form`` counts what each form of the attitude costs in a navigator."""

from __future__ import annotations

from typing import Annotated

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import listed, option
from strapgen.cli.output import Output
from strapgen.cli.progress import track
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError


@grouped
def study_attitude_form(
    *,
    update_hz: Annotated[
        str, option("--update-hz", metavar="HZ", help="Slow cycles in a second.", panel="Rates")
    ] = "50",
    navigation_hz: Annotated[
        str,
        option(
            "--navigation-hz", metavar="HZ", help="Cycles of the navigation frame in a second.", panel="Rates"
        ),
    ] = "10",
    orthonormalize_hz: Annotated[
        str,
        option(
            "--orthonormalize-hz",
            metavar="HZ",
            help="Orthonormalizations in a second; 0: none.",
            panel="Rates",
        ),
    ] = "1",
    max_rate_deg_s: Annotated[
        str, option("--max-rate-deg-s", metavar="DEG_S", help="Largest body rate in deg/s.", panel="Rates")
    ] = "70",
    velocity_error: Annotated[
        str,
        option(
            "--velocity-error",
            metavar="PART",
            help="Error of (47) that is allowed, as a part of the velocity increment.",
            panel="Rates",
        ),
    ] = "1e-4",
    without: Annotated[
        str | None,
        option(
            "--without",
            metavar="PART,...",
            help="Parts that are there already: update, matrix, velocity, orthonormalization, navigation.",
            panel="Run",
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
    fixed: Annotated[FixedOptions, Shown(only=("word",))],
    output: Output,
) -> None:
    """Count what direction cosines, two rows of them, or a quaternion cost in a navigator.

    You see the operations of each part, and those of each form in a second at your rates. Below stands what the
    attitude to first order inside a slow cycle, as the sculling integral has it, costs in velocity.

    Example: strapgen study attitude-form --update-hz 100 --max-rate-deg-s 200
    """
    output.check()
    import math

    from strapgen.lab.cost import cost
    from strapgen.navigation.attitude_form import attitude_form as forms
    from strapgen.navigation.attitude_form.attitude_form_report import FormResult

    numbers = {"navigation-hz": navigation_hz, "orthonormalize-hz": orthonormalize_hz}
    values = {name: float(checks.number(name, text)) for name, text in numbers.items()}
    for name, value in values.items():
        if value < 0:
            raise InputError(f"{name} is {value:g}; a number of at least 0 is needed")
    rates = forms.PartRates(float(checks.number("update-hz", update_hz, positive=True)), *values.values())
    turning = math.radians(checks.number("max-rate-deg-s", max_rate_deg_s, positive=True))
    allowed = float(checks.number("velocity-error", velocity_error))
    which = forms.pairs([] if without is None else listed("--without", without))
    loss = forms.truncation(rates, turning, allowed)
    if cpu is not None:
        cost.processors(cpus=[cpu])
    settings = fixed.settings(1) if cpu else None
    costs = forms.part_costs(which, rates, cpu or "", settings)
    study = forms.FormStudy(rates, tuple(track(costs, "counting", len(which))), loss, cpu or "")
    output.show(FormResult.of(study))
