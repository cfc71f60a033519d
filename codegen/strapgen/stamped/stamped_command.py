"""The command ``strapgen stamped``: C that takes stamped samples to an even grid."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.generate_command import SourceOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import CTarget, option
from strapgen.cli.output import Format, check_format, show
from strapgen.cli.progress import waiting
from strapgen.cli.values import Positive
from strapgen.ir.exceptions import InputError
from strapgen.stamped.kernel_names import ROUNDS

if TYPE_CHECKING:
    from strapgen.ir.sources import Sources

#: The pairs of both rounds, as the option writes them.
_PAIRS = {f"{first},{second}": (first, second) for first, second in ROUNDS}


@grouped
def stamped_grid(
    *,
    sample_hz: Annotated[
        Positive,
        option(
            "--sample-hz",
            metavar="HZ",
            help="Nominal sampling rate; that of the sensor may be 3 % off and drift.",
            panel="Samples",
        ),
    ],
    tick_hz: Annotated[
        Positive,
        option("--tick-hz", metavar="HZ", help="Ticks of the stamps in a second.", panel="Samples"),
    ],
    stamp_bits: Annotated[
        int,
        option(
            "--stamp-bits",
            metavar="BITS",
            help="Bits of a stamp, after which it wraps: 8 to 64.",
            panel="Samples",
        ),
    ] = 32,
    pairs: Annotated[
        str,
        option(
            "--pairs",
            metavar="N,N",
            help="Pairs of samples of the two rounds of filters: 3,5 or 7,7.",
            panel="Samples",
        ),
    ] = next(iter(_PAIRS)),
    target: CTarget = "c",
    fixed: Annotated[FixedOptions, Shown(only=("max_rate_deg_s", "largest_angle"))],
    output: Annotated[SourceOptions, Shown(only=("out", "name", "check", "force"))],
    format: Format = "text",
) -> None:
    """Generate C that takes stamped samples to an even grid.

    Each sample is passed to a function with its stamp; the samples of the grid follow a few samples late, and go to any
    algorithm.

    Example: strapgen stamped --sample-hz 200 --tick-hz 1e6 --out out/stamped

    Example: strapgen stamped --sample-hz 200 --tick-hz 1e6 --target c-fixed --max-rate-deg-s 400 --out out/stamped
    """
    check_format(format)
    sources = generated(sample_hz, tick_hz, stamp_bits, pairs, target, fixed, output.name)
    files = sources.step_files
    if output.check:
        output.show_difference(files, format)
        return
    written = output.write(files)
    from strapgen.stamped.stamped_sources import StampedResult

    latency = sum(_PAIRS[pairs])
    show(StampedResult(sources.function.name, target, latency, written, sources.operations), format)


def generated(
    sample_hz: Positive,
    tick_hz: Positive,
    stamp_bits: int,
    pairs: str,
    target: str,
    fixed: FixedOptions,
    name: str | None,
) -> Sources:
    """Return the sources for the options."""
    from strapgen.stamped import stamped_sources

    if pairs not in _PAIRS:
        raise InputError(f"--pairs is {pairs}; {' or '.join(_PAIRS)} is needed")
    rated = sample_hz if fixed.max_rate_deg_s is not None else None
    settings = replace(fixed, sample_hz=rated).settings(1)
    with waiting("generating"):
        return stamped_sources.sources(sample_hz, tick_hz, _PAIRS[pairs], target, stamp_bits, name, settings)
