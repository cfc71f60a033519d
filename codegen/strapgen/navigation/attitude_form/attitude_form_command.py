"""The command ``strapgen study attitude-form`` counts what each form of the attitude costs in a navigator."""

from __future__ import annotations

from typing import Annotated

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import Processor, option
from strapgen.cli.output import Output
from strapgen.cli.progress import track
from strapgen.cli.values import NotNegative, Number, Positive


@grouped
def study_attitude_form(
    *,
    update_hz: Annotated[
        Positive, option("--update-hz", metavar="HZ", help="Slow cycles in a second.", panel="Rates")
    ] = Positive("50"),
    navigation_hz: Annotated[
        NotNegative,
        option(
            "--navigation-hz", metavar="HZ", help="Cycles of the navigation frame in a second.", panel="Rates"
        ),
    ] = NotNegative("10"),
    orthonormalize_hz: Annotated[
        NotNegative,
        option(
            "--orthonormalize-hz",
            metavar="HZ",
            help="Orthonormalizations in a second; 0: none.",
            panel="Rates",
        ),
    ] = NotNegative("1"),
    max_rate_deg_s: Annotated[
        Positive,
        option("--max-rate-deg-s", metavar="DEG_S", help="Largest body rate in deg/s.", panel="Rates"),
    ] = Positive("70"),
    velocity_error: Annotated[
        Number,
        option(
            "--velocity-error",
            metavar="PART",
            help="Error of (47) that is allowed, as a part of the velocity increment.",
            panel="Rates",
        ),
    ] = Number("1e-4"),
    without: Annotated[
        tuple[str, ...] | None,
        option(
            "--without",
            metavar="PART,...",
            help="Parts that are there already: update, matrix, velocity, orthonormalization, navigation.",
            panel="Run",
        ),
    ] = None,
    cpu: Processor = None,
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

    from strapgen.lab import cost
    from strapgen.navigation.attitude_form import attitude_form as forms
    from strapgen.navigation.attitude_form.attitude_form_report import FormResult

    rates = forms.PartRates(float(update_hz), float(navigation_hz), float(orthonormalize_hz))
    which = forms.pairs(without or ())
    loss = forms.truncation(rates, math.radians(max_rate_deg_s), float(velocity_error))
    if cpu is not None:
        cost.processors(cpus=[cpu])
    settings = fixed.settings(1) if cpu else None
    costs = forms.part_costs(which, rates, cpu or "", settings)
    study = forms.FormStudy(rates, tuple(track(costs, "counting", len(which))), loss, cpu or "")
    output.show(FormResult.of(study))
