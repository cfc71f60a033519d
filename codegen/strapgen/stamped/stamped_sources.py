"""Generates C that takes stamped samples to an even grid."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings, rounded_limit
from strapgen.ir.formats import above, finest
from strapgen.ir.interfaces import Argument
from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.sources import Function, Sources
from strapgen.ir.version import VERSION
from strapgen.results.result import Result
from strapgen.stamped import grid_clock
from strapgen.stamped.boundary_kernels import filters
from strapgen.stamped.grid_clock import OFFSET_BITS, Number, StampScale, StampStatus
from strapgen.stamped.kernel_names import ROUNDS, kernel_name
from strapgen.stamped.rounds import EDGES
from strapgen.targets import BUILT_IN
from strapgen.targets.c import real_of
from strapgen.targets.rendering import render

#: Kinds of C that take stamped samples.
TARGETS = ("c", "c-float", "c-fixed")
#: Bits of a word in fixed point.
WORD = 32
#: By how much corrections make a sample longer at most.
ROOM = Fraction(4, 3)
#: Most characters that names begin with: C99 tells external names apart by 31, and ``_memory`` comes behind.
MOST_CHARACTERS = 24
#: Samples that are held, at the start all of them.
CAPACITY = grid_clock.BLOCK

_SOURCE = (
    "weights of the least largest error up to 1.3 rad a sample, exact on polynomials of the third degree"
)


@dataclass(frozen=True)
class StampedResult(Result):
    """The written C that takes stamped samples to an even grid."""

    name: str
    target: str
    #: Samples after the end of one on the grid that it is known
    latency: int
    files: Sequence[Path]
    #: Operations of a sample by kind
    operations: Mapping[str, int]

    def text(self) -> str:
        """Return the name, the latency and the files."""
        title = f"{self.name} for {self.target}: a sample of the grid is known {self.latency} samples after its end"
        return "\n".join([title, *(f"  {path}" for path in self.files)])


def checked_pairs(pairs: Sequence[int]) -> tuple[int, int]:
    """Return the pairs of both rounds, which are there."""
    chosen = tuple(pairs) if isinstance(pairs, list | tuple) else pairs
    if chosen not in ROUNDS:
        names = " or ".join(f"{first},{second}" for first, second in ROUNDS)
        shown = ",".join(map(str, chosen)) if isinstance(chosen, tuple) else chosen
        raise InputError(f"pairs is {shown}; {names} is needed")
    assert isinstance(chosen, tuple)
    return chosen


def parts(pairs: tuple[int, int], target: str, settings: Settings | None = None) -> dict[int, Sources]:
    """Return the generated functions by their number of pairs; in fixed point all have one format of a sample."""
    fixed = None if settings is None else _of_kernels(settings)
    first, second = (max(filters(number).largest for number in (*EDGES, most)) for most in pairs)
    # Two corrections go into a sample; those of the second round are made of what the first one makes of it.
    assert 1 + 2 * second * (1 + 2 * first) < ROOM, "a sample leaves its range"
    numbers = dict.fromkeys((*EDGES, *pairs))
    return {number: pipeline.compile(Choice(kernel_name(number)), target, fixed) for number in numbers}


def _of_kernels(settings: Settings) -> Settings:
    """Return the settings of the functions: samples and corrections in one format, offsets in that of the clock."""
    if settings.word != WORD:
        raise InputError(f"word is {settings.word}; stamped samples take words of {WORD} bits")
    if settings.sensor is not None or settings.input_bits is not None:
        raise InputError(
            "stamped samples are words in one format, of any unit; counts of a gyro are shifted up to it (no lsb, no "
            "input bits)"
        )
    largest = rounded_limit(settings.largest_angle * ROOM)
    sample = f"Q{WORD - 1 - finest(largest, WORD)}.{finest(largest, WORD)}"
    formats = {
        "increments": sample,
        "correction": sample,
        "offset": f"Q{WORD - 1 - OFFSET_BITS}.{OFFSET_BITS}",
    }
    return Settings(WORD, largest, formats=formats)


def sample_format(functions: Mapping[int, Sources]) -> Argument | None:
    """Return the format of a sample, None in floating point."""
    fixed = next(iter(functions.values())).fixed
    return None if fixed is None else fixed.inputs[0]


def sample_limit(argument: Argument) -> int:
    """Return the largest magnitude of a sample that comes, as an integer."""
    return int(argument.high / ROOM)


def error_bound(pairs: tuple[int, int], functions: Mapping[int, Sources]) -> Fraction:
    """Return a bound of the difference of a sample of the grid from exact arithmetic on the same integers.

    A sample of the grid is one that came, less one correction and with another, exactly. The error of a correction is
    that of its function; in the second round the error of the samples that it is made of adds to it.
    """
    edge = [_error(functions[number]) for number in EDGES]
    first, second = (max(_error(functions[number]), *edge) for number in pairs)
    gain = max(filters(number).largest for number in (*EDGES, pairs[1]))
    return 2 * (second + gain * 2 * first)


def _error(function: Sources) -> Fraction:
    assert function.fixed is not None, "its target is one of fixed point"
    return max(function.fixed.outputs[0].errors)


def sources(
    sample_hz: Number,
    tick_hz: Number,
    pairs: Sequence[int] = ROUNDS[0],
    target: str = "c",
    stamp_bits: int = 32,
    name: str | None = None,
    settings: Settings | None = None,
) -> Sources:
    """Return the C that takes stamped samples to an even grid.

    `settings`: of fixed point, with words of 32 bits; by default samples are up to 1/8 rad.

    >>> list(sources(200, 1e6).files)[:4]
    ['stamped_grid_3_5.h', 'stamped_grid_3_5.c', 'boundary_correction_1.h', 'boundary_correction_1.c']
    """
    checks.choice("target", target, TARGETS)
    scale = StampScale.of(sample_hz, tick_hz, stamp_bits)
    chosen = checked_pairs(pairs)
    is_fixed = BUILT_IN[target].fixed
    if settings is not None and not is_fixed:
        raise InputError(f"target {target} takes no settings of fixed point; c-fixed does")
    if is_fixed:
        settings = settings or Settings()
    functions = parts(chosen, target, settings)
    argument = sample_format(functions)
    identifier = _identifier(chosen, target, name)
    text = f"{chosen[0]},{chosen[1]}"
    command = [
        "strapgen",
        "stamped",
        "--tick-hz",
        str(tick_hz),
        "--pairs",
        text,
        "--stamp-bits",
        str(stamp_bits),
    ]
    stated = (
        [] if settings is None else (settings.stated or f"--max-angle-rad {settings.largest_angle}").split()
    )
    command += [] if "--sample-hz" in stated else ["--sample-hz", str(sample_hz)]
    command += [*stated, "--target", target]
    command += [] if name is None else ["--name", name]
    title = "Stamped samples, taken to an even grid that follows the sensor's clock"
    each = tuple(functions.values())
    operations = {
        kind: sum(functions[number].operations[kind] for number in chosen) for kind in each[0].operations
    }
    values = {
        "name": identifier,
        "title": title,
        "command": shlex.join(command),
        "version": VERSION,
        "guard": f"{identifier}_h".upper(),
        "scale": scale,
        "clock": grid_clock,
        "status": StampStatus,
        "sample_hz": f"{float(checks.number('sample_hz', sample_hz)):g}",
        "tick_hz": f"{float(checks.number('tick_hz', tick_hz)):g}",
        "stamp": f"uint{32 if stamp_bits <= 32 else 64}_t",
        "mask": 0 if stamp_bits in (32, 64) else (1 << stamp_bits) - 1,
        "pairs": chosen,
        "edges": EDGES,
        "latency": sum(chosen),
        "most": CAPACITY - 1,
        "capacity": CAPACITY,
        "functions": {number: one.function.name for number, one in functions.items()},
        "headers": [next(file for file in one.files if file.endswith(".h")) for one in each],
        "operations": operations,
        "source": _SOURCE,
        "fixed": argument,
        "room": ROOM,
        **({} if argument is not None else {"real": real_of(target)}),
        "type": f"int{WORD}_t" if argument is not None else real_of(target).name,
    }
    if argument is not None:
        values["limit"] = sample_limit(argument)
        values["error"] = above(error_bound(chosen, functions) / argument.unit)
    files = {
        f"{identifier}.{end}": render(f"stamped_grid_c/{file}.j2", **values) for end, file in _FILES.items()
    }
    for one in each:
        files |= one.step_files
    function = Function(identifier, each[0].function.inputs[:1], each[0].function.outputs)
    info = KernelInfo(identifier, title, _SOURCE)
    temporaries = sum(one.temporaries for one in each)
    return Sources(info, target, files, function, operations, temporaries, each[0].fixed)


_FILES = {"h": "header.h", "c": "source.c"}


def _identifier(pairs: tuple[int, int], target: str, name: str | None) -> str:
    """Return the prefix of the names of functions and files."""
    if name is None:
        infix = f"_w{WORD}" if BUILT_IN[target].fixed else real_of(target).infix
        return f"stamped_grid_{pairs[0]}_{pairs[1]}{infix}"
    if not re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII):
        raise InputError(f"--name is {name!r}; letters, digits and underscores are needed, a letter first")
    if len(name) > MOST_CHARACTERS:
        raise InputError(
            f"names would begin with {name}, which has more than {MOST_CHARACTERS} characters; --name chooses shorter "
            "ones"
        )
    return name
