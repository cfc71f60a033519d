"""Reads the text of a described system: its tables, keys and numbers, before any kernel is looked at."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

from strapgen.catalogue import toml_files
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import CARRIES
from strapgen.ir.formats import check_word
from strapgen.ir.signals import ANY, FRAMES
from strapgen.ir.suggestions import alternatives, shown, suggestions, unknown
from strapgen.navigation.systems.reserved import check_names

#: A longer file is refused.
_MOST_BYTES = 1 << 20
#: Most stages of a system, and most cycles from one call of a stage to the next.
MOST_STAGES, MOST_CYCLES = 64, 1 << 20
_NAME = re.compile(r"[a-z][a-z0-9_]{0,30}")

_SYSTEM_KEYS = ("name", "title", "sample_hz", "inputs", "stage", "outputs")
_INPUT_KEYS = ("unit", "frame", "range", "meaning")
_STAGE_KEYS = (
    *("name", "kernel", "method", "increments", "previous", "ahead", "every", "word", "carry"),
    *("wires", "writes", "delay", "constants", "initial", "ranges", "formats"),
)


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
    """A stage as the file states it."""

    name: str
    kernel: str
    every: int
    #: What `catalogue.choose` takes beside the name
    options: Mapping[str, Any]
    word: int | None
    carry: str
    #: Sources of inputs, and destinations of outputs that replace the value of another stage
    wires: Mapping[str, str]
    writes: Mapping[str, str]
    #: Cycles by which a wire lags, by the name of the input
    delay: Mapping[str, int]
    constants: Mapping[str, tuple[Fraction, ...]]
    initial: Mapping[str, tuple[Fraction, ...]]
    ranges: Mapping[str, Fraction]
    formats: Mapping[str, str]


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


def read(path: str | Path, sample_hz: Fraction | None = None) -> SystemText:
    """Read the file of a system."""
    place = checks.path("path", path)
    tables = toml_files.content(path, "a system", _MOST_BYTES, _decimal)
    try:
        return parsed(tables, re.sub(r"[^a-z0-9]+", "_", place.stem.lower()).strip("_"), sample_hz)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _decimal(text: str) -> Fraction | str:
    """Return a number of the file exactly as its decimal digits say; the text of one that is not finite."""
    try:
        return checks.number("number", text)
    except InputError:
        return text  # refused where it stands, by name


def parsed(tables: Mapping[str, Any], name: str = "system", sample_hz: Fraction | None = None) -> SystemText:
    """Return the description that tables hold."""
    _check_keys("the system", tables, _SYSTEM_KEYS, ("sample_hz", "inputs", "stage"))
    stages = tables["stage"]
    if not isinstance(stages, list) or not stages:
        raise InputError("stage is no list of tables; [[stage]] begins each")
    if len(stages) > MOST_STAGES:
        raise InputError(f"{len(stages)} stages are described; at most {MOST_STAGES} are allowed")
    outputs = tables.get("outputs", [])
    if not isinstance(outputs, list) or not all(isinstance(entry, str) for entry in outputs):
        raise InputError('outputs is no list of texts; ["stage.output"] is needed')
    rate = _positive("'sample_hz'", tables["sample_hz"])
    rate = rate if sample_hz is None else sample_hz
    described = SystemText(
        _name("name", tables.get("name", name)),
        checks.text("title", tables.get("title", "A described system")),
        rate,
        tuple(_input(key, value, 1 / rate) for key, value in _table("inputs", tables["inputs"]).items()),
        tuple(_stage(number, value, rate) for number, value in enumerate(stages, 1)),
        tuple(outputs),
    )
    _check_unique(described)
    return described


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


def _input(name: str, value: Any, cycle: Fraction) -> InputText:
    """Return an input of the system."""
    where = f"input {name}"
    _name("inputs", name)
    table = _table(where, value)
    if "range" not in table:
        raise InputError(f"{where}: range is missing; the largest magnitude of an element is needed")
    _check_keys(where, table, _INPUT_KEYS, ("unit", "range"))
    return InputText(
        name,
        _unit(where, table["unit"]),
        _frame(where, table.get("frame", "")),
        _positive(f"{where}: range", table["range"], cycle),
        checks.text(f"{where}: meaning", table.get("meaning", name.replace("_", " "))),
    )


def _unit(where: str, value: Any) -> str:
    """Return the unit of an input, which is a real one."""
    unit = checks.text(f"{where}: unit", value)
    if not unit.strip() or unit == ANY:
        raise InputError(f"{where}: unit is {unit!r}; a unit is needed, '1' for a pure number")
    return unit


def _frame(where: str, value: Any) -> str:
    """Return the frame of an input; "" for one that has none."""
    frame = checks.text(f"{where}: frame", value)
    if frame and not set(frame.split(" to ", maxsplit=1)) <= set(FRAMES):
        raise InputError(
            f"{where}: {unknown('frame', frame, FRAMES, 'an attitude such as b to n, or no frame')}"
        )
    return frame


def _stage(number: int, value: Any, sample_hz: Fraction) -> StageText:
    """Return a stage."""
    table = _table(f"stage {number}", value)
    name = _name(f"name of stage {number}", table.get("name", ""))
    where = f"stage {name}"
    _check_keys(where, table, _STAGE_KEYS, ("name", "kernel", "every"))
    word = table.get("word")
    try:
        carry = checks.choice("carry", table["carry"], CARRIES) if "carry" in table else ""
        every = _every(table["every"], sample_hz)
        word = None if word is None else check_word(word)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    cycle = every / sample_hz
    options = {key: table[key] for key in ("method", "increments", "previous", "ahead") if key in table}
    return StageText(
        name,
        checks.text(f"{where}: kernel", table["kernel"]),
        every,
        options,
        word,
        carry,
        _texts(f"{where}: wires", table.get("wires", {})),
        _texts(f"{where}: writes", table.get("writes", {})),
        _delays(f"{where}: delay", table.get("delay", {})),
        _numbers(f"{where}: constants", table.get("constants", {}), cycle),
        _numbers(f"{where}: initial", table.get("initial", {}), cycle),
        {
            key: _positive(f"{where}: range of {key}", entry, cycle)
            for key, entry in _table(f"{where}: ranges", table.get("ranges", {})).items()
        },
        _texts(f"{where}: formats", table.get("formats", {})),
    )


def _check_keys(
    where: str, table: Mapping[str, Any], keys: tuple[str, ...], required: tuple[str, ...]
) -> None:
    for key in table:
        if key not in keys:
            meant = suggestions("key", key, keys)
            question = f" (did you mean {alternatives(list(map(repr, meant)))}?)" if meant else ""
            raise InputError(f"{where}: key {key!r} is not known{question}; allowed: {_quoted(keys)}")
    for key in required:
        if key not in table:
            raise InputError(f"{where}: {key!r} is missing; needed: {_quoted(required)}")


def _quoted(keys: tuple[str, ...]) -> str:
    """Return keys as they stand in a message, which are no options of the command line."""
    return ", ".join(map(repr, keys))


def _name(what: str, value: Any) -> str:
    if not isinstance(value, str) or not _NAME.fullmatch(value) or "__" in value or value.endswith("_"):
        raise InputError(
            f"{what} is {value!r}; a name of at most 31 lower-case letters, digits and single underscores is "
            "needed, which begins with a letter"
        )
    return value


def _table(what: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{what} is no table")
    return value


def _texts(what: str, value: Any) -> dict[str, str]:
    return {key: checks.text(f"{what}: {key}", entry) for key, entry in _table(what, value).items()}


def _delays(what: str, value: Any) -> dict[str, int]:
    for key, entry in _table(what, value).items():
        if isinstance(entry, bool) or entry != 1:
            raise InputError(f"{what} of {key} is {entry!r}; 1, for one cycle, is allowed")
    return dict(value)


def _every(value: Any, sample_hz: Fraction) -> int:
    """Return the cycles of the fastest rate from one call to the next, of a number or a text as "50 Hz"."""
    match = re.fullmatch(r"([0-9.]+) ?Hz", value) if isinstance(value, str) else None
    if match is None and not isinstance(value, int):
        number = float(value) if isinstance(value, Fraction) else value
        raise InputError(
            f"every is {shown(number)}; a whole number of cycles is needed, or a text as '50 Hz'"
        )
    if match is None:
        return checks.count("every", value, largest=MOST_CYCLES)
    rate = checks.number("every", match[1])
    if rate <= 0:
        raise InputError(f"every is {value!r}; a rate above 0 Hz is needed")
    cycles = sample_hz / rate
    if cycles.denominator != 1:
        raise InputError(
            f"every is {value!r}, which does not divide the {float(sample_hz):g} Hz of the samples"
        )
    return checks.count("every", int(cycles), largest=MOST_CYCLES)


def _positive(what: str, value: Any, cycle: Fraction = Fraction(1)) -> Fraction:
    number = _quantity(what, value, cycle)
    if number <= 0:
        raise InputError(f"{what} is {value}; a number above 0 is needed")
    return number


def _numbers(what: str, value: Any, cycle: Fraction) -> dict[str, tuple[Fraction, ...]]:
    return {key: tuple(_flat(f"{what}: {key}", entry, cycle)) for key, entry in _table(what, value).items()}


def _flat(what: str, value: Any, cycle: Fraction) -> list[Fraction]:
    """Return the numbers of an entry, which may be nested lists, row-major."""
    if isinstance(value, list):
        return [number for entry in value for number in _flat(what, entry, cycle)]
    return [_quantity(what, value, cycle)]


def _quantity(what: str, value: Any, cycle: Fraction) -> Fraction:
    """Return a number, or a product or quotient of numbers and T, the cycle of the stage in s."""
    if isinstance(value, bool) or not isinstance(value, (int, str, Fraction)):
        raise InputError(f'{what} is {shown(value)}; a number is needed, or a text as "1/3" or "90*T"')
    if not isinstance(value, str):
        return Fraction(value)
    result, inverse = Fraction(1), False
    for part in re.split(r"([*/])", value):
        if part in ("*", "/"):
            inverse = part == "/"
            continue
        factor = cycle if part.strip() == "T" else checks.number(what, part)
        if inverse and not factor:
            raise InputError(f"{what} is {value!r}, which divides by 0")
        result = result / factor if inverse else result * factor
    return result
