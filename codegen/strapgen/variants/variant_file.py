"""Reads the variants of a folder; a variant states options of commands by their names, with _ in place of -."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, ClassVar

from strapgen.catalogue import toml_models
from strapgen.catalogue.toml_models import Key, UserFile
from strapgen.cli import generate_command, program
from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import CommandOptions, Option
from strapgen.cli.options import MethodOptions
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.results.records import UNITS

#: The file of a folder, and the one whose table tool.strapgen is the same.
NAME, PYPROJECT = "strapgen.toml", "pyproject.toml"
#: Parameters of ``strapgen generate`` that say what it does with files that are there.
_NOT_OF_A_VARIANT = ("all_", "file", "check", "force", "format", "variant")
#: Keys that may have a list, of which each has its code; the names that a variant may have.
_SEVERAL = ("target", "word")
_VARIANT_NAME = r"[A-Za-z][A-Za-z0-9_-]*"
_GENERATE: CommandOptions = generate_command.generate.__dict__["options"]


@dataclass(frozen=True)
class CostLimit:
    """The most that a call may cost on a processor."""

    cpu: Annotated[str, Key("Processor, as `strapgen cost --cpu` takes it")]
    executed: Annotated[int | None, Key("Most instructions that a call executes", least=1)] = None
    code_bytes: Annotated[int | None, Key("Most bytes of code", unit="B", least=1)] = None
    stack_bytes: Annotated[int | None, Key("Most bytes of stack", unit="B", least=0)] = None


@dataclass(frozen=True)
class Checks:
    """What `strapgen build --check` holds beside the files being in step."""

    verify: Annotated[bool, Key("Compile each C file and compare it with the model within its bound")] = True
    vectors: Annotated[
        int, Key("Test vectors, written beside the C and run with it; 0 for none", least=0)
    ] = 0
    cost: Annotated[tuple[CostLimit, ...], Key("Limits on processors")] = ()
    evidence: Annotated[tuple[str, ...], Key('Tools of `strapgen evidence`; ["all"] for each')] = ()


@dataclass(frozen=True)
class Variant:
    """A named variant."""

    name: str
    #: The folder that its paths are relative to
    folder: Path
    #: Options of ``strapgen generate`` by key, and those of other commands by command
    options: Mapping[str, Any]
    of_command: Mapping[str, Mapping[str, Any]]
    checks: Checks

    @property
    def targets(self) -> tuple[str, ...]:
        """The kinds of code."""
        return tuple(_listed(self.options.get("target", ["numpy"])))

    @property
    def words(self) -> tuple[int | None, ...]:
        """The lengths of words in bits; None for the default."""
        return tuple(_listed(self.options.get("word", [None])))

    @property
    def step(self) -> str | None:
        """The step length in s, which may follow from the sampling rate; None if nothing states it."""
        if "step" in self.options:
            return str(self.options["step"])
        if "sample_hz" not in self.options:
            return None
        samples = Fraction(str(self.options.get("increments", 2)))
        return str(samples / checks.number("sample_hz", str(self.options["sample_hz"])))


class Variants:
    """Named variants of generated code, which strapgen build generates and holds."""

    WORDS = "a table with variant"

    @classmethod
    def from_toml(cls, where: str, value: Any) -> dict[str, Variant]:
        """Return the variants of the content of a file by name."""
        for key in value.keys() - {"variant"}:
            raise InputError(f"{checks.unknown('key', key, ['variant'])}, as in [variant.attitude]")
        tables = value.get("variant")
        if not isinstance(tables, dict) or not tables:
            raise InputError("no variant is there; one has a table such as [variant.attitude]")
        return {name: _variant(name, table) for name, table in tables.items()}

    #: Set below, where the options are known
    SCHEMA: ClassVar[dict[str, Any]] = {}


#: The kind of file.
VARIANTS = UserFile("a file of variants", Variants, 1 << 20)


def find(start: Path) -> Path:
    """Return the file of a folder or of the nearest one above it."""
    for folder in (start, *start.parents):
        if (folder / NAME).is_file():
            return folder / NAME
        place = folder / PYPROJECT
        if place.is_file() and "strapgen" in VARIANTS.content(place).get("tool", {}):
            return place
    raise InputError(
        f"no {NAME} is here or above, nor tool.strapgen in a {PYPROJECT}; strapgen init writes one"
    )


def read(path: Path) -> dict[str, Variant]:
    """Return the variants of a file by name; every refusal begins with the name of the file."""
    data = VARIANTS.content(path)
    if path.name == PYPROJECT:
        data = data.get("tool", {}).get("strapgen", {})
    return {name: replace(one, folder=path.parent) for name, one in parse(path, data).items()}


def parse(path: Path, data: Mapping[str, Any]) -> dict[str, Variant]:
    """Return the variants of the content that a file has or will have."""
    try:
        known: dict[str, Variant] = toml_models.parse(Variants, data)
    except InputError as error:
        located = InputError(f"{path.name}: {error}")
        located.in_file = True
        raise located from None
    return known


def variants(start: Path | None = None) -> dict[str, Variant]:
    """Return the variants of the nearest file."""
    return read(find(start or Path.cwd()))


def titles() -> dict[str, str]:
    """Return the names of the variants of the nearest file, with what each generates."""
    return {name: str(one.options["algorithm"]) for name, one in variants().items()}


def chosen(name: str, start: Path | None = None) -> Variant:
    """Return a variant by name."""
    known = variants(start)
    return known[checks.choice("--variant", name, known)]


def words_of(name: str, command: str, arguments: Sequence[str]) -> dict[str, Any]:
    """Return the words that a variant states for the parameters of a command; those of the command line win."""
    variant = chosen(name)
    options = program.options_of(command)
    found = dict(_words(variant, command, options, arguments))
    if not found:
        raise InputError(f"strapgen {command} takes no option from a variant; --variant does not go with it")
    return found


def _words(
    variant: Variant, command: str, options: CommandOptions, arguments: Sequence[str]
) -> Iterator[tuple[str, Any]]:
    group_of = {one.parameter.name: group.kind for group in options.groups.values() for one in group.options}
    keys = {_key(option) for option in options.options.values()}
    own = variant.of_command.get(command.replace(" ", "-"), {})
    is_fixed = _is_fixed(variant, options, arguments)
    for name, option in options.options.items():
        key, group = _key(option), group_of.get(name)
        if key in own:
            value = own[key]
        elif option.is_argument and key in ("algorithm", "algorithms", "kernels"):
            value = variant.options["algorithm"]
        elif command == "generate" or (group is not None and issubclass(group, MethodOptions | FixedOptions)):
            value = variant.options.get(key)
        elif key == "target":
            value = variant.targets[0]
        elif key == "backend":
            value = _backend(variant)
        elif key == "step" and "duration" in options.options and option.kind is not tuple:
            value = variant.step
        else:
            continue
        if group is not None and issubclass(group, FixedOptions):
            is_taken = not is_fixed and "target" in keys if key == "sums" else is_fixed
            if not is_taken:
                continue
        if (
            key == "word"
            and "backend" in keys
            and program.value_of(arguments, "--backend", "--backends") != "fixed-model"
        ):
            continue  # the back end has its word
        if key == "word" and isinstance(value, list | tuple):
            value = value[0]
        if key == "project" and not (value and _is_compiled(_target(variant, arguments))):
            continue
        if value is not None:
            yield name, _word(option, value, variant.folder)


def _is_fixed(variant: Variant, options: CommandOptions, arguments: Sequence[str]) -> bool:
    """Return whether the options of fixed point go with the target or the back ends of a command line."""
    from strapgen.run.backend_names import BACKENDS
    from strapgen.targets import TARGETS

    if "backend" in {_key(option) for option in options.options.values()}:
        named = program.value_of(arguments, "--backend", "--backends") or _backend(variant)
        return all(name in BACKENDS and BACKENDS[name].fixed for name in named.split(","))
    # Several targets of which one alone is fixed are refused by the command.
    targets = (program.value_of(arguments, "--target") or ",".join(variant.targets)).split(",")
    return any(name not in TARGETS or TARGETS[name].fixed for name in targets)


def _is_compiled(target: str) -> bool:
    from strapgen.targets import TARGETS

    return target in TARGETS and TARGETS[target].compiled


def _target(variant: Variant, arguments: Sequence[str]) -> str:
    return (program.value_of(arguments, "--target") or variant.targets[0]).partition(",")[0]


def _backend(variant: Variant) -> str:
    """Return the back end of the variant's first target, with its word."""
    from strapgen.run.backend_names import BACKENDS

    target, word = variant.targets[0], variant.words[0] or 32
    fitting = [name for name, entry in BACKENDS.items() if entry.target == target]
    return next(
        (name for name in fitting if BACKENDS[name].word in (None, word)), next(iter(fitting), "numpy")
    )


# The keys of a variant


def _key(option: Option) -> str:
    return option.parameter.name if option.is_argument else option.spelling[2:].replace("-", "_")


def _keys() -> dict[str, Option]:
    """Return the options of ``strapgen generate`` that a variant may state, by key."""
    return {_key(one): one for name, one in _GENERATE.options.items() if name not in _NOT_OF_A_VARIANT}


def _listed(value: Any) -> Sequence[Any]:
    return (
        value if isinstance(value, list | tuple) else value.split(",") if isinstance(value, str) else [value]
    )


def _variant(name: str, table: Any) -> Variant:
    where = f"variant.{name}"
    if not re.fullmatch(_VARIANT_NAME, name):
        raise InputError(f"{where}: letters, digits, - and _ are needed in a name, a letter first")
    if not isinstance(table, dict):
        raise toml_models.refused(where, table, "a table")
    known = _keys()
    options: dict[str, Any] = {}
    of_command: dict[str, dict[str, Any]] = {}
    for key, value in table.items():
        path = f"{where}.{key}"
        if key == "checks":
            continue
        if key in known:
            options[key] = value
            for one in value if isinstance(value, list) and key in _SEVERAL else [value]:
                _read(known[key], path, one)
        elif isinstance(value, dict) and (command := key.replace("-", " ")) in program.commands():
            of_command[key] = _of_command(program.options_of(command), path, value)
        else:
            raise InputError(f"{path}: {checks.unknown('key', key, [*known, 'checks'])}")
    if "algorithm" not in options:
        raise InputError(f"{where}.algorithm is missing; strapgen list kernels shows the names")
    for key in _SEVERAL:
        if options.get(key) == []:
            raise toml_models.refused(f"{where}.{key}", [], "at least one value")
    stated = toml_models.parse(Checks, table.get("checks", {}), where=f"{where}.checks")
    return Variant(name, Path(), options, of_command, stated)


def _of_command(options: CommandOptions, where: str, table: dict[str, Any]) -> dict[str, Any]:
    known = {_key(option): option for option in options.options.values()}
    for key, value in table.items():
        if key not in known:
            raise InputError(f"{where}.{key}: {checks.unknown('key', key, known)}")
        _read(known[key], f"{where}.{key}", value)
    return table


#: What may stand under a key by the kind of its option, with the words for it; a number may be a text.
_NUMBER = (int, float, Decimal)
_TAKES: dict[Any, tuple[tuple[type, ...], str]] = {
    bool: ((bool,), "true or false"),
    int: ((int,), "a whole number"),
    str: ((str,), "a text"),
    Path: ((str,), "a text"),
    list: ((str, list), "a text or a list"),
    tuple: ((str, list, *_NUMBER), "a value or a list"),
    dict: ((dict,), "a table"),
}


def _read(option: Option, where: str, value: Any) -> None:
    """Check a value by the reader of its option."""
    if isinstance(value, bool) and option.spelling in program.DEFAULTS:
        return
    kinds, words = _TAKES.get(option.kind, ((str, *_NUMBER), "a number or a text"))
    is_right = isinstance(value, kinds) and (isinstance(value, bool) == (option.kind is bool))
    inner = value if isinstance(value, list) else [*value.values()] if isinstance(value, dict) else []
    if not is_right or any(isinstance(one, bool) or not isinstance(one, (str, *_NUMBER)) for one in inner):
        raise toml_models.refused(where, value, words)
    try:
        option.value(_word(option, value, Path.cwd()))
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _word(option: Option, value: Any, folder: Path) -> Any:
    """Return a value as the command line has it; a path is relative to the folder of the file."""
    if isinstance(value, bool):
        return program.DEFAULTS[option.spelling][0] if option.spelling in program.DEFAULTS else value
    if isinstance(value, dict):
        return [f"{key}={one}" for key, one in value.items()]
    if option.kind is Path:
        place = folder / str(value)
        return str(place.relative_to(Path.cwd()) if place.is_relative_to(Path.cwd()) else place)
    if option.kind is list:
        return [str(one) for one in _listed(value)]
    return ",".join(map(str, value)) if isinstance(value, list) else str(value)


def _schema() -> dict[str, Any]:
    """Return the JSON Schema of a file."""
    checked = {
        "title": "checks",
        "description": "What strapgen build --check holds",
        **toml_models.schema(Checks),
    }
    variant = {
        "type": "object",
        "properties": {key: _key_schema(key, option) for key, option in _keys().items()}
        | {"checks": checked},
        "required": ["algorithm"],
        "additionalProperties": {"type": "object"},  # the options of another command
    }
    named = {
        "title": "variant",
        "description": "Variants by name; each states options of strapgen generate by their names, with _ in place of "
        "-, and those of another command in a table with its name",
        "type": "object",
        "minProperties": 1,
        "propertyNames": {"type": "string", "pattern": f"^(?:{_VARIANT_NAME})$"},
        "additionalProperties": variant,
    }
    table = {"type": "object", "properties": {"variant": named}, "required": ["variant"]}
    return table | {"additionalProperties": False}


def _key_schema(key: str, option: Option) -> dict[str, Any]:
    unit = next((unit for ending, unit in UNITS.items() if key.endswith(f"_{ending}")), "")
    unit = unit or {"step": "s"}.get(key, "")
    text = option.help.partition("  [")[0].rstrip(".")
    about = {"title": key, "description": f"{text} [{unit}]" if unit else text} | (
        {"unit": unit} if unit else {}
    )
    kinds: dict[Any, list[dict[str, Any]]] = {
        bool: [{"type": "boolean"}],
        int: [{"type": "integer"}],
        dict: [{"type": "object"}],
        **{kind: [{"type": "string"}] for kind in (str, Path, tuple, list)},
    }
    one, *more = kinds.get(option.kind, [{"type": "number"}, {"type": "string"}])
    if key in _SEVERAL:
        more = [{"type": "array", "minItems": 1, "items": one}]
    if option.spelling in program.DEFAULTS:
        more = [{"type": "boolean"}]
    return about | (one if not more else {"anyOf": [one, *more]})


Variants.SCHEMA = _schema()
