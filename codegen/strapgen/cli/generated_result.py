"""Generated sources as results: what `generate` writes, and whether files are in step."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from strapgen.ir.formats import above, places_above
from strapgen.ir.interfaces import Interface, RoundingBounds
from strapgen.ir.signals import CYCLE, after
from strapgen.ir.sources import Sources
from strapgen.results.records import INTERNAL, entry
from strapgen.results.result import Result

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.ir.sources import Sources


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
    from strapgen.targets.contract import argument_text

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


@dataclass(frozen=True)
class FloatBounds:
    """Bounds of the code in floating point, rounded to the safe side."""

    #: Largest magnitude of each input for which they hold
    inputs: dict[str, float]
    #: Ranges of values on the way for which they hold
    conditions: dict[str, list[float]]
    #: Functions of the library that are trusted
    functions: list[str]
    #: Error of each element of each output; None where none is known
    errors: dict[str, list[float]] | None
    #: The same in any order of the operations, as -ffast-math allows; None where none is known
    errors_in_any_order: dict[str, list[float]] | None
    #: What a step adds to the error of a run, and by what part the error grows
    run: dict[str, float] | None
    #: Why there is no bound
    reason: str | None


@dataclass(frozen=True)
class FixedBounds:
    """Formats, ranges and bounds of the code in fixed point, rounded to the safe side."""

    #: The settings as `strapgen.Settings` reads them
    settings: dict[str, Any]
    formats: dict[str, str]
    #: Lower and upper end of each value
    ranges: dict[str, list[float]]
    #: Largest error of each output
    error_bound: dict[str, float]
    error_bound_by_element: dict[str, float]
    #: Operations of the integer code by kind
    integer_operations: dict[str, int]
    #: How errors add up in a run; None where no bound is known
    accumulation: dict[str, float] | None
    #: How the angle of the error adds up in a run; None where no bound is known
    angle_accumulation: dict[str, Any] | None


@dataclass(frozen=True)
class GeneratedSources:
    """The code of a kernel for a target."""

    kernel: str
    target: str
    #: Where they were written
    files: Sequence[str]
    #: Operations of a call by kind
    operations: Mapping[str, int]
    #: Number of values on the way
    temporaries: int
    #: In floating point
    error_bounds: Mapping[str, Any] | None = field(metadata=entry(optional=True, kind=FloatBounds))
    #: In fixed point
    fixed: Mapping[str, Any] | None = field(metadata=entry(spread=True, optional=True, kind=FixedBounds))

    @staticmethod
    def of(choice: Choice, sources: Sources, target: str, files: Sequence[str]) -> GeneratedSources:
        """Return the code for a target, under the requested name."""
        from strapgen import pipeline

        kinds = ("add", "multiply", "divide", "sqrt")
        fixed, rounding = sources.fixed, sources.rounding
        return GeneratedSources(
            kernel=sources.kernel,
            target=target,
            files=files,
            operations={kind: sources.operations[kind] for kind in kinds},
            temporaries=sources.temporaries,
            error_bounds=None if rounding is None else rounding.as_data(),
            fixed=None if fixed is None else pipeline.fixed_program(choice, fixed.settings).as_data(),
        )


@dataclass(frozen=True)
class GenerateResult(Result):
    """The code of a kernel, for one target or several."""

    each: ClassVar[type | None] = GeneratedSources

    generated: Sequence[GeneratedSources]
    said: str = ""

    def results(self) -> Sequence[GeneratedSources]:
        """Return the code for each target."""
        return self.generated

    def text(self) -> str:
        """Return operations, files and contracts."""
        return self.said


@dataclass(frozen=True)
class StepCheck(Result):
    """Whether files agree with the output of their command."""

    #: True if nothing differs
    in_step: bool
    #: What differs
    difference: str

    def text(self) -> str:
        """Return the differences."""
        return self.difference


@dataclass(frozen=True)
class CatalogueResult(Result):
    """The files of the standard catalogue that were written."""

    files: Sequence[Path]
    said: str = field(metadata=INTERNAL)

    def text(self) -> str:
        """Return the number of files."""
        return self.said
