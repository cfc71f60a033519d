"""Options of fixed point that several commands share, and how they are read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapgen.cli.options import whole
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from fractions import Fraction

    from strapgen.ir.fixed_settings import Settings

Word = Annotated[
    str | None,
    typer.Option(
        "--word",
        metavar="BITS",
        help="Bits of a word: 16, 32 or 64 in C, 8 to 64 in the integer model.  [default: 32]",
        show_default=False,
    ),
]
MaxRate = Annotated[
    str | None,
    typer.Option(
        "--max-rate-deg-s",
        metavar="RATE",
        help="Largest body rate on an axis that fixed-point formats are chosen for, in deg/s; with --step.",
        show_default=False,
    ),
]
Step = Annotated[
    str | None,
    typer.Option("--step", metavar="S", help="Step in s, with --max-rate-deg-s.", show_default=False),
]
MaxAngle = Annotated[
    str | None,
    typer.Option(
        "--max-angle-rad",
        metavar="RAD",
        help="Instead: largest element of an angle increment, in rad.  [default: 1/8]",
        show_default=False,
    ),
]
Rounding = Annotated[
    str | None,
    typer.Option("--rounding", help="nearest or truncation.  [default: nearest]", show_default=False),
]
Carry = Annotated[
    str | None,
    typer.Option(
        "--carry",
        help="Rounding residuals kept between steps: none, state, or full: of state and transition.  [default: none]",
        show_default=False,
    ),
]
Allowance = Annotated[
    str | None,
    typer.Option(
        "--drift-allowance",
        metavar="A",
        help="By how much an element of a state may exceed 1.  [default: 1/16]",
        show_default=False,
    ),
]
Ranges = Annotated[
    list[str] | None,
    typer.Option(
        "--range",
        metavar="NAME=MAX",
        help="Largest magnitude of an input whose range is not known otherwise.",
    ),
]
Fixes = Annotated[
    list[str] | None,
    typer.Option(
        "--fix", metavar="NAME=Qm.n", help="A format that is not to be chosen, of an argument or value."
    ),
]


def read_settings(
    increments: int,
    *,
    word: str | None = None,
    max_rate_deg_s: str | None = None,
    step: str | None = None,
    max_angle_rad: str | None = None,
    rounding: str | None = None,
    carry: str | None = None,
    drift_allowance: str | None = None,
    ranges: Iterable[str] | None = None,
    formats: Iterable[str] | None = None,
) -> Settings | None:
    """Return the settings that options state; None if none of them is given."""
    given = (word, max_rate_deg_s, step, max_angle_rad, rounding, carry, drift_allowance, ranges, formats)
    if not any(given):
        return None
    from strapgen.ir.fixed_settings import Settings
    from strapgen.support import checks

    bits = whole("word", word)
    return Settings.of(
        word=32 if bits is None else bits,
        max_rate_deg_s=max_rate_deg_s,
        step=step,
        increments=increments,
        largest_angle=max_angle_rad,
        rounding=rounding or "nearest",
        carry=carry or "none",
        **(
            {}
            if drift_allowance is None
            else {"allowance": checks.number("drift-allowance", drift_allowance)}
        ),
        ranges=_numbers(ranges or ()),
        formats=dict(_pair("--fix", text) for text in formats or ()),
    )


def check_fixed(backend: str, stated: Mapping[str, Any]) -> None:
    """Refuse options of fixed point for a back end in floating point."""
    from strapgen.backends import BACKENDS
    from strapgen.support import checks
    from strapgen.targets import FIXED

    checks.choice("backend", backend, BACKENDS)
    for name, value in stated.items():
        if value and BACKENDS[backend].target not in FIXED:
            raise InputError(f"--{name.replace('_', '-')} is for fixed-point back ends, not for {backend}")


def settings_for_run(
    backend: str,
    increments: int | None,
    stated: Mapping[str, Any],
    step: float,
    largest: Callable[[], float],
) -> Settings | None:
    """Return what a run in fixed point is made for: what is stated, and else its own increments.

    Parameters
    ----------
    backend : str
    increments : int or None
        Increments a step, None for the default.
    stated : mapping of str to str, or to list of str
        Options by the names that `read_settings` takes, without the step.
    step : float
        Step of the run in s.
    largest : callable
        Tells the largest increment of the run in rad.

    Returns
    -------
    Settings or None
        None for a back end in floating point.
    """
    from strapgen.backends import BACKENDS
    from strapgen.ir.fixed_settings import Settings
    from strapgen.targets import FIXED

    if BACKENDS[backend].target not in FIXED:
        return None
    rate = stated.get("max_rate_deg_s")
    settings = (
        read_settings(increments or 2, **stated, step=None if rate is None else repr(step)) or Settings()
    )
    if stated.get("word") is not None and BACKENDS[backend].word not in (None, settings.word):
        raise InputError(
            f"--word {settings.word} does not go with {backend}, whose words have {BACKENDS[backend].word} bits"
        )
    return settings if rate is not None else settings.fitted(largest())


def _numbers(texts: Iterable[str]) -> dict[str, Fraction]:
    from strapgen.support import checks

    pairs = (_pair("--range", text) for text in texts)
    return {name: checks.number(f"range of {name}", value, positive=True) for name, value in pairs}


def _pair(option: str, text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals or not name or not value:
        raise InputError(f"{option} {text!r} is no setting; NAME=VALUE is needed")
    return name, value
