"""The command ``strapgen coning`` derives coning coefficients and their residual drift."""

from __future__ import annotations

from typing import Annotated

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import option, whole
from strapgen.cli.output import TEXT_OUTPUT, Output
from strapgen.support import checks
from strapgen.support.exceptions import InputError

#: Samples, those before the slow cycle included, for which terms of third and fourth order are listed.
_MOST_SAMPLES = 6


@grouped
def coning(
    samples: Annotated[
        str,
        option(
            *("--samples", "--increments"),
            metavar="N",
            help="Number of gyro samples in a slow cycle, 1 to 8.",
            panel="Algorithm",
        ),
    ],
    previous: Annotated[
        str,
        option(
            "--previous",
            metavar="N",
            help="Number of samples from before the slow cycle that it uses as well, 0 to 32.",
            panel="Algorithm",
        ),
    ] = "0",
    form: Annotated[
        str,
        option(
            "--form",
            metavar="NAME",
            help="Form of the correction: compressed suits coning, uncompressed polynomial rates, combined both.",
            panel="Algorithm",
        ),
    ] = "compressed",
    terms: Annotated[
        bool,
        option(
            "--terms",
            help="Also list the third- and fourth-order terms of the rotation vector, for up to six samples in all.",
            panel="Output",
        ),
    ] = False,
    *,
    output: Annotated[Output, Shown(only=TEXT_OUTPUT)],
) -> None:
    """Derive exact coning coefficients and the drift that remains.

    A coefficient multiplies the cross product older sample x newer sample. The pairs are in the order of the newer
    sample, then of the older one, so that the newest pair is last. The residual is the mean drift on coning in rad/s,
    computed minus true, to second order in alpha. It is an expression that SymPy can read, in the symbols alpha
    (half-angle of the cone in rad), omega (its frequency in rad/s) and T (time between samples in s).

    Example: strapgen coning --samples 4 --form combined
    """
    output.check()
    from strapgen import catalogue
    from strapgen.catalogue.methods import coning_coefficients
    from strapgen.reports.coning import coning_data, coning_report

    count = checks.count("samples", whole("samples", samples), largest=catalogue.MOST_INCREMENTS)
    before = checks.count(
        "previous", whole("previous", previous), smallest=0, largest=coning_coefficients.MOST_KEPT
    )
    checks.choice("form", form, coning_coefficients.FORMS)
    if terms and count + before > _MOST_SAMPLES:
        raise InputError(
            f"terms of third and fourth order are listed for up to {_MOST_SAMPLES} samples; {count + before} are given"
        )
    design = coning_coefficients.design(count, before, form)
    output.report(coning_report(design, coning_data(design, terms)))
