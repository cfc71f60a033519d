"""Lines on generated sources: operations, files, the gyro and the range of samples, the error of every output."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from strapgen.ir.formats import above, places_above
from strapgen.ir.interfaces import Interface, RoundingBounds
from strapgen.ir.signals import CYCLE, after
from strapgen.ir.sources import Sources
from strapgen.targets.contract import argument_text


def head(sources: Sources, target: str, written: Iterable[Path] = ()) -> list[str]:
    """Return the lines with the operations of sources, and the files that were written."""
    return [f"{sources.kernel} for {target}: {sources.cost}", *(f"  {path}" for path in written)]


def contract(sources: Sources) -> Iterator[str]:
    """Yield lines on the gyro and the range of samples in fixed point, and on the error of outputs."""
    if sources.fixed is not None:
        yield from _fixed(sources.fixed)
    if sources.rounding is not None:
        yield from _floating(sources.rounding)


def _fixed(interface: Interface) -> Iterator[str]:
    states = {argument.signal.name for argument in interface.outputs}
    for argument in interface.inputs:
        if argument.signal.over == CYCLE and after(argument.signal).name not in states:
            yield f"{argument.signal.name}: {argument_text(argument)}"
    for argument in interface.outputs:
        bound, unit = max(argument.errors), argument.format.unit
        useless = 2 * bound >= max(abs(argument.low), abs(argument.high)) * unit
        yield (
            f"{argument.signal.name}: {argument.format}, error <= {above(bound, 4)} "
            f"({places_above(bound / unit)} ulp)"
            + (": of the size of the value, which certifies nothing" if useless else "")
        )


def _floating(rounding: RoundingBounds) -> Iterator[str]:
    if rounding.reason:
        yield f"no error bound: {rounding.reason}"
        return
    for name, bound in rounding.worst.items():
        ulp = f"{places_above(bound / rounding.unit)} ulp of 1"
        yield f"{name}: error <= {above(bound, 4)} ({ulp})" if bound else f"{name}: exact"
