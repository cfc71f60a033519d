"""Reads the file of a described system: tables, keys and numbers, without deriving a kernel."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

from strapgen.catalogue.toml_models import Key, UserFile, parse, rational, refused
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import CARRIES
from strapgen.ir.formats import LONGEST_WORD, SHORTEST_WORD
from strapgen.ir.signals import ANY, FRAMES
from strapgen.storage import streams
from strapgen.targets.names import PYTHON, C

#: Most stages of a system, and most cycles from one call of a stage to the next.
MOST_STAGES, MOST_CYCLES = 64, 1 << 20
_NAME = Key(
    "Name; those of inputs and stages are all different",
    pattern="(?!.*__)[a-z][a-z0-9_]{0,30}(?<!_)",
    form="a name of at most 31 lower-case letters, digits and single underscores, which begins with a letter,",
)
_FRAME = "|".join(frame for frame in FRAMES)


@dataclass(frozen=True)
class InputText:
    """An input as the file states it."""

    name: str
    unit: str
    frame: str
    #: Largest magnitude of an element, in its unit
    range: Fraction
    meaning: str


@dataclass(frozen=True)
class StageText:
    """A stage as the file states it, see `StageFile`, in numbers."""

    name: str
    kernel: str
    #: Cycles of the samples from one call to the next
    every: int
    method: str | None
    increments: int | None
    previous: int | None
    ahead: int | None
    layout: str | None
    word: int | None
    carry: str
    wires: Mapping[str, str]
    writes: Mapping[str, str]
    delay: Mapping[str, int]
    constants: Mapping[str, tuple[Fraction, ...]]
    initial: Mapping[str, tuple[Fraction, ...]]
    ranges: Mapping[str, Fraction]
    formats: Mapping[str, str]

    @property
    def options(self) -> dict[str, Any]:
        """The arguments of `catalogue.choose` beside the name."""
        stated = {
            name: getattr(self, name) for name in ("method", "increments", "previous", "ahead", "layout")
        }
        return {name: value for name, value in stated.items() if value is not None}


@dataclass(frozen=True)
class SystemText:
    """A described system as the file states it."""

    name: str
    title: str
    sample_hz: Fraction
    inputs: tuple[InputText, ...]
    stages: tuple[StageText, ...]
    #: Values that a run records; empty for all that no stage takes
    outputs: tuple[str, ...] = field(default=())


@dataclass(frozen=True)
class MultipleOfCycle:
    """A number, times a power of T, the cycle of the stage in s."""

    factor: Fraction
    power: int

    WORDS: ClassVar = 'a number, or a text such as "1/3" or "90*T",'
    SCHEMA: ClassVar[Mapping[str, Any]] = {"type": ["number", "string"], "pattern": r"^[0-9eE+\-*/.T ]+$"}

    @classmethod
    def from_toml(cls, where: str, value: Any) -> Self:
        """Return a number, or a product or quotient of numbers and T."""
        if not isinstance(value, str):
            return cls(rational(where, value), 0)
        factor, power, inverse = Fraction(1), 0, False
        for part in re.split(r"([*/])", value):
            if part in ("*", "/"):
                inverse = part == "/"
            elif part.strip() == "T":
                power += -1 if inverse else 1
            elif (number := checks.number(where, part)) or not inverse:
                factor = factor / number if inverse else factor * number
            else:
                raise InputError(f"{where} is {value!r}, which divides by 0")
        return cls(factor, power)

    def at(self, cycle: Fraction) -> Fraction:
        """Return the number for a cycle in s."""
        return self.factor * cycle**self.power


class PositiveMultiple(MultipleOfCycle):
    """A number above 0, times a power of T."""

    WORDS: ClassVar = 'a number above 0, or a text such as "1/3" or "90*T",'
    SCHEMA: ClassVar[Mapping[str, Any]] = {**MultipleOfCycle.SCHEMA, "exclusiveMinimum": 0}

    @classmethod
    def from_toml(cls, where: str, value: Any) -> Self:
        """Return the number of an entry."""
        number = super().from_toml(where, value)
        if number.factor <= 0:
            raise refused(where, value, cls.WORDS)
        return number


class Numbers(tuple[MultipleOfCycle, ...]):
    """Numbers of a signal: one, a list, or a matrix row by row."""

    WORDS = "a number, a list of numbers or a matrix"
    SCHEMA: ClassVar = {"anyOf": [MultipleOfCycle.SCHEMA, {"type": "array"}]}

    @classmethod
    def from_toml(cls, where: str, value: Any) -> Self:
        """Return the numbers of an entry, which may be nested lists."""
        if isinstance(value, list):
            rows = [cls.from_toml(f"{where}[{number}]", entry) for number, entry in enumerate(value, 1)]
            return cls(number for row in rows for number in row)
        return cls([MultipleOfCycle.from_toml(where, value)])


@dataclass(frozen=True)
class InputFile:
    """An input."""

    unit: Annotated[
        str,
        Key(
            'Unit, "1" for a pure number', pattern=rf"(?!{ANY}$).*\S.*", form="a unit, '1' for a pure number,"
        ),
    ]
    range: Annotated[
        PositiveMultiple,
        Key("Largest magnitude of an element; T is the cycle of the samples in s", "its unit"),
    ]
    frame: Annotated[
        str,
        Key(
            "b body, n navigation, e earth-fixed, i inertial, g geographic, an attitude as b to n; none without it",
            pattern=f"(({_FRAME})( to ({_FRAME}))?)?",
            form=f"one of {', '.join(FRAMES)}, an attitude such as b to n, or no frame",
        ),
    ] = ""
    meaning: Annotated[str, Key("Description in the header; by default its name")] = ""


@dataclass(frozen=True)
class StageFile:
    """A stage: a kernel with its rate, its wires and its numbers; in these T is the cycle of the stage in s."""

    name: Annotated[str, _NAME]
    kernel: Annotated[str, Key("A kernel of strapgen list kernels, an algorithm, or a Python file")]
    every: Annotated[
        int | str,
        Key(
            'Cycles of the samples from one call to the next, or a rate as "50 Hz"',
            least=1,
            most=MOST_CYCLES,
            pattern="[0-9.]+ ?Hz",
            form="a text as '50 Hz'",
        ),
    ]
    method: Annotated[str | None, Key("Method of an attitude step, as for generate")] = None
    increments: Annotated[int | None, Key("Samples of a step", "1")] = None
    previous: Annotated[int | None, Key("Samples from before it", "1")] = None
    ahead: Annotated[int | None, Key("Samples from after it", "1")] = None
    layout: Annotated[
        str | None, Key("File of a kernel that is made from one, such as filter; as for generate")
    ] = None
    word: Annotated[
        int | None,
        Key(
            "Length of its words in fixed point, in place of --word",
            "bit",
            least=SHORTEST_WORD,
            most=LONGEST_WORD,
        ),
    ] = None
    carry: Annotated[
        str, Key("Error feedback in fixed point, in place of --carry", choices=tuple(CARRIES))
    ] = ""
    wires: Annotated[
        Mapping[str, str], Key('Where each input comes from: "input", "stage.output" or "stage.state"')
    ] = field(default_factory=dict)
    writes: Annotated[Mapping[str, str], Key('States that outputs replace: "stage.state" by output')] = field(
        default_factory=dict
    )
    delay: Annotated[
        Mapping[str, int], Key("Delay of a wire that goes back, in calls, by input", "1", choices=(1,))
    ] = field(default_factory=dict)
    constants: Annotated[
        Mapping[str, Numbers], Key("Inputs with a fixed value, which is folded into the code")
    ] = field(default_factory=dict)
    initial: Annotated[
        Mapping[str, Numbers],
        Key("States and outputs before the first cycle; by default no rotation, or zero"),
    ] = field(default_factory=dict)
    ranges: Annotated[
        Mapping[str, PositiveMultiple],
        Key("Largest magnitudes of inputs and states that do not follow from a wire or from the kernel"),
    ] = field(default_factory=dict)
    formats: Annotated[Mapping[str, str], Key('Formats that you choose yourself, as "Q1.14"')] = field(
        default_factory=dict
    )

    def stage(self, sample_hz: Fraction) -> StageText:
        """Return the stage in a system of a rate."""
        every = (
            self.every
            if isinstance(self.every, int)
            else _cycles(f"stage[{self.name}].every", self.every, sample_hz)
        )
        cycle = every / sample_hz
        numbers = {
            name: {key: tuple(one.at(cycle) for one in row) for key, row in getattr(self, name).items()}
            for name in ("constants", "initial")
        }
        ranges = {name: one.at(cycle) for name, one in self.ranges.items()}
        return StageText(**{**vars(self), **numbers, "every": every, "ranges": ranges})


@dataclass(frozen=True)
class SystemFile:
    """A described system: its samples, its stages from the fastest to the slowest, and the recorded values."""

    sample_hz: Annotated[
        Fraction, Key("Cycles of the fastest rate in a second; --sample-hz replaces it", "Hz", above=0)
    ]
    inputs: Annotated[Mapping[Annotated[str, _NAME], InputFile], Key("Measurements of every cycle, by name")]
    stage: Annotated[
        tuple[StageFile, ...],
        Key("Kernels at their rates, from the fastest to the slowest", least=1, most=MOST_STAGES),
    ]
    name: Annotated[str, replace(_NAME, text="Name in code; by default that of the file")] = ""
    title: Annotated[str, Key("One line for the head of the files")] = "A described system"
    outputs: Annotated[
        tuple[str, ...],
        Key(
            'Values that a run records, as "stage.output"; by default the attitudes, and what no stage reads'
        ),
    ] = ()

    def described(self, name: str, sample_hz: Fraction | None = None) -> SystemText:
        """Return the system, by default of its own rate and with a name."""
        rate = sample_hz or self.sample_hz
        inputs = (
            InputText(key, one.unit, one.frame, one.range.at(1 / rate), one.meaning or key.replace("_", " "))
            for key, one in self.inputs.items()
        )
        stages = tuple(stage.stage(rate) for stage in self.stage)
        name = self.name or parse(Annotated[str, _NAME], name, "name")
        system = SystemText(name, self.title, rate, tuple(inputs), stages, self.outputs)
        _check_unique(system)
        return system


SYSTEM = UserFile("a system", SystemFile, 1 << 20)


def read(path: str | Path, sample_hz: Fraction | None = None) -> SystemText:
    """Read the file of a system."""
    place = checks.path("path", path)
    stem = "system" if place == streams.STANDARD else place.stem
    name = re.sub(r"[^a-z0-9]+", "_", stem.lower()).strip("_")
    return SYSTEM.convert(path, lambda file: file.described(name, sample_hz))


def parsed(tables: Mapping[str, Any], name: str = "system") -> SystemText:
    """Return the description that tables hold."""
    file: SystemFile = parse(SystemFile, tables)
    return file.described(name)


def _check_unique(described: SystemText) -> None:
    """Check that every name of an input or a stage stands once."""
    names = [entry.name for entry in described.inputs] + [stage.name for stage in described.stages]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"the name {name!r} stands twice; every input and stage needs its own name")
    check_names(
        described.name,
        [entry.name for entry in described.inputs],
        [stage.name for stage in described.stages],
    )


def _cycles(what: str, every: str, sample_hz: Fraction) -> int:
    """Return the cycles of the samples from one call to the next at a rate as "50 Hz"."""
    rate = checks.number(what, every.removesuffix("Hz"))
    if rate <= 0:
        raise InputError(f"{what} is {every!r}; a rate above 0 Hz is needed")
    cycles = sample_hz / rate
    if cycles.denominator != 1:
        raise InputError(
            f"{what} is {every!r}, which does not divide the {float(sample_hz):g} Hz of the samples"
        )
    return checks.count(what, int(cycles), largest=MOST_CYCLES)


_HEADERS_TEXT = """
assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdalign stdarg stdatomic
stdbool stdckdint stddef stdint stdio stdlib stdnoreturn string tgmath threads time uchar wchar wctype numpy
"""
#: Headers and modules that generated files include or import, or that a file of the same name would hide.
_HEADERS = frozenset(_HEADERS_TEXT.split())
#: What the functions of a system are called behind its name, and members of its memory.
_FUNCTIONS = re.compile(r"begin|cycle|memory|residuals|runs?|every_\d+")
#: Parameters, functions and modules that generated functions use.
_USED = re.compile(r"cycles|done|status|np|memcpy|memmove|memset|(u?int\w*|size|ptrdiff)_t")


def check_names(system: str, inputs: Iterable[str], stages: Iterable[str]) -> None:
    """Check that code can have the names of a system, its inputs and its stages.

    >>> check_names("imu", ["gyro"], ["fast", "slow"])
    >>> check_names("imu", ["int"], ["fast"])
    Traceback (most recent call last):
    strapgen.InputError: input 'int' has a meaning in generated code; another name is needed
    """
    stages = list(stages)
    if system in _HEADERS or not _is_free(system):
        raise _refuse("the name", system)
    for name in stages:
        if _FUNCTIONS.fullmatch(name) or _USED.fullmatch(name) or not _is_free(name):
            raise _refuse("stage", name)
    for name in inputs:
        rest = name.removeprefix(f"{system}_")
        shadowed = rest != name and (_FUNCTIONS.fullmatch(rest) or rest in stages)
        if shadowed or _FUNCTIONS.fullmatch(name) or _USED.fullmatch(name) or not _is_free(name):
            raise _refuse("input", name)


def _is_free(name: str) -> bool:
    return C.allows(name) and PYTHON.allows(name)


def _refuse(what: str, name: str) -> InputError:
    return InputError(f"{what} {name!r} has a meaning in generated code; another name is needed")
