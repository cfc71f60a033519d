"""Generates what commits an attitude late and answers it now: functions and filters."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

from strapgen import pipeline, targets
from strapgen.catalogue import Choice, choose_step
from strapgen.catalogue.methods.window import Window
from strapgen.catalogue.methods.windows import named_window
from strapgen.design.commit_late import commit_late_fixed
from strapgen.design.commit_late.commit_late_c import whole
from strapgen.design.commit_late.commit_late_fixed import WORD
from strapgen.design.commit_late.fixed_filters import FixedFilters
from strapgen.design.commit_late.late_filters import LateFilters
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.results.result import Result
from strapgen.targets import BUILT_IN, contract
from strapgen.targets.c import real_of

#: Kinds of C that commit late.
TARGETS = ("c", "c-float", "c-fixed")
#: Most characters that names begin with: C99 tells external names apart by 31, and ``_memory`` comes behind.
MOST_CHARACTERS = 24
_TITLES = {"dcm": "Direction cosine matrix", "euler": "Euler parameters"}

#: Attitude algorithms that commit late, each with the kernel that removes rounding from a committed attitude.
NORMALIZATIONS = {"dcm": "dcm-orthonormalize-first-order", "euler": "euler-normalize-first-order"}


@dataclass(frozen=True)
class LateResult(Result):
    """C that commits an attitude late and answers it now, as it was written."""

    name: str
    target: str
    files: Sequence[Path]
    #: Operations of a call by kind
    operations: Mapping[str, int]

    def text(self) -> str:
        """Return the name and the files."""
        return "\n".join([f"{self.name} for {self.target}", *(f"  {path}" for path in self.files)])


@dataclass(frozen=True)
class LateSources:
    """What commits an attitude late and answers it now."""

    filters: LateFilters
    #: The step of the window, which is committed
    step: Sources
    #: The step from Legendre coefficients, which all other filters share
    rotation: Sources
    #: Removes rounding from a committed attitude
    normalization: Sources
    #: The taps as integers, in fixed point
    fixed: FixedFilters | None = None


def kernels(filters: LateFilters, algorithm: str) -> tuple[Choice, Choice, Choice]:
    """Return the choices of the step, of the step from Legendre coefficients and of the normalization.

    >>> [choice.kernel for choice in kernels(family("window-7-7"), "euler")]
    ['euler-window-7-7', 'euler-legendre-4', 'euler-normalize-first-order']
    """
    checks.choice("algorithm", algorithm, NORMALIZATIONS)
    return (
        choose_step(algorithm, filters.window),
        Choice(f"{algorithm}-legendre-{'exact-' if filters.exact else ''}{filters.degree}"),
        Choice(NORMALIZATIONS[algorithm]),
    )


def family(window: str | Window, sample_hz: float | str | Fraction | None = None) -> LateFilters:
    """Return the filters of a family, if they go with the sampling rate.

    `sample_hz`: sampling rate in Hz, which a family that is designed for a gyro needs.

    >>> family("window-5-5").samples
    11
    """
    chosen = named_window(window) if isinstance(window, str) else window
    if chosen is None:
        raise InputError(f"window is {window!r}; a name as window-7-7, or a family of filters, is needed")
    rate = None if sample_hz is None else checks.number("sample_hz", sample_hz, positive=True)
    if chosen.gyro is not None and rate != chosen.gyro.sample_hz:
        stated = "no sampling rate is stated" if rate is None else f"the sampling rate is {float(rate):g} Hz"
        raise InputError(
            f"{stated}; {chosen.name} is designed for a gyro at {float(chosen.gyro.sample_hz):g} Hz, which is needed"
        )
    return LateFilters(chosen)


def parts(filters: LateFilters, algorithm: str, target: str, settings: Settings | None = None) -> LateSources:
    """Return the generated functions with their filters."""
    choices = kernels(filters, algorithm)
    targets.require(target, settings)
    if targets.TARGETS[target].fixed:
        functions, fixed, rounded = commit_late_fixed.functions(
            filters, choices, target, settings or Settings()
        )
        return LateSources(rounded, *functions, fixed)
    step, rotation, normalization = (pipeline.compile(choice, target) for choice in choices)
    return LateSources(filters, step, rotation, normalization)


def sources(
    window: str | Window,
    algorithm: str = "euler",
    target: str = "c",
    sample_hz: float | str | Fraction | None = None,
    name: str | None = None,
    settings: Settings | None = None,
) -> Sources:
    """Return the C that commits an attitude late and answers it now.

    `settings`: of fixed point, with words of 32 bits; by default increments are up to 1/8 rad.

    >>> list(sources("window-3-3").files)[:4]
    ['euler_late_3_3.h', 'euler_late_3_3.c', 'euler_window_3_3.h', 'euler_window_3_3.c']
    """
    checks.choice("target", target, TARGETS)
    late = parts(family(window, sample_hz), algorithm, target, settings)
    filters = late.filters
    chosen = filters.window
    command = ["strapgen", "window", "generate", chosen.file or chosen.name]
    command += ["--algorithm", algorithm, "--target", target]
    stated = settings is not None and "--sample-hz" in settings.stated
    command += [] if sample_hz is None or stated else ["--sample-hz", str(sample_hz)]
    command += [] if name is None else ["--name", name]
    title = f"{_TITLES[algorithm]}, committed late and answered now: {chosen.title}"
    text = shlex.join(command)
    if late.step.fixed is not None:
        usual = late.step.fixed.settings
        usual = replace(usual, input_bits=usual.default_input_bits)
        text += f" {contract.options(usual, late.step.function.inputs)}"
    functions = late.step, late.rotation, late.normalization
    return whole(_identifier(chosen, algorithm, target, name), title, text, filters, functions, late.fixed)


def _identifier(window: Window, algorithm: str, target: str, name: str | None) -> str:
    """Return what the names of functions and files begin with."""
    infix = f"_w{WORD}" if BUILT_IN[target].fixed else real_of(target).infix
    default = f"{algorithm}_late_{window.name.removeprefix('window-')}".replace("-", "_") + infix
    identifier = default if name is None else name
    if name is not None and not re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII):
        raise InputError(f"--name is {name!r}; letters, digits and underscores are needed, a letter first")
    if len(identifier) > MOST_CHARACTERS:
        raise InputError(
            f"names would begin with {identifier}, which has more than {MOST_CHARACTERS} characters; --name chooses "
            "shorter ones"
        )
    return identifier
