"""Reads the variants of a folder; a variant states options of commands by their names, with _ in place of -."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

from strapgen.catalogue import toml_files, toml_models
from strapgen.catalogue.toml_models import Key
from strapgen.cli import generate_command, program
from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import CommandOptions, Option
from strapgen.cli.options import MethodOptions
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

#: The file of a folder, and the one whose table tool.strapgen is the same.
NAME, PYPROJECT = "strapgen.toml", "pyproject.toml"
#: Parameters of ``strapgen generate`` that say what it does with files that are there.
_NOT_OF_A_VARIANT = ("all_", "check", "force", "format", "variant")
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


class VariantFile:
    """The kind of file, with its JSON Schema."""

    what = "a file of variants"
    most_bytes = 1 << 20

    def find(self, start: Path) -> Path:
        """Return the file of a folder or of the nearest one above it."""
        for folder in (start, *start.parents):
            if (folder / NAME).is_file():
                return folder / NAME
            place = folder / PYPROJECT
            if place.is_file() and "strapgen" in self._content(place).get("tool", {}):
                return place
        raise InputError(
            f"no {NAME} is here or above, nor tool.strapgen in a {PYPROJECT}; strapgen init writes one"
        )

    def read(self, path: Path) -> dict[str, Variant]:
        """Return the variants of a file by name; every refusal begins with the path."""
        data = self._content(path)
        if path.name == PYPROJECT:
            data = data.get("tool", {}).get("strapgen", {})
        return self._variants(path, data)

    def parse(self, path: Path, text: str) -> dict[str, Variant]:
        """Return the variants of a text that a file will have."""
        return self._variants(path, tomllib.loads(text, parse_float=Decimal))

    def _variants(self, path: Path, data: dict[str, Any]) -> dict[str, Variant]:
        try:
            for key in data.keys() - {"variant"}:
                raise InputError(f"{key} is unknown; variant is the one key, as in [variant.attitude]")
            tables = data.get("variant")
            if not isinstance(tables, dict) or not tables:
                raise InputError("no variant is there; one has a table such as [variant.attitude]")
            return {name: _variant(name, path.parent, table) for name, table in tables.items()}
        except InputError as error:
            located = InputError(f"{path.name}: {error}")
            located.in_file = True
            raise located from None

    def _content(self, path: Path) -> dict[str, Any]:
        return toml_files.content(path, self.what, self.most_bytes)

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema of such a file."""
        options = {key: _key_schema(option) for key, option in _keys().items()}
        variant = {
            "type": "object",
            "properties": options | {"checks": toml_models.schema(Checks)},
            "required": ["algorithm"],
            # a table of another command's options
            "additionalProperties": {"type": "object"},
        }
        return {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "title": "Variants for strapgen",
            "description": "Named variants of generated code, which strapgen build generates and holds.",
            "type": "object",
            "properties": {
                "variant": {
                    "type": "object",
                    "description": "Variants by name; a variant states options of strapgen generate by their names, "
                    "with _ in place of -, and those of another command in a table with its name",
                    "patternProperties": {"^[A-Za-z][A-Za-z0-9_-]*$": variant},
                    "additionalProperties": False,
                }
            },
            "required": ["variant"],
            "additionalProperties": False,
        }


VARIANTS = VariantFile()


def variants(start: Path | None = None) -> dict[str, Variant]:
    """Return the variants of the nearest file."""
    return VARIANTS.read(VARIANTS.find(start or Path.cwd()))


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
        elif command == "generate" or (group is not None and issubclass(group, MethodOptions)):
            value = variant.options.get(key)
        elif group is not None and issubclass(group, FixedOptions):
            value = variant.options.get(key) if is_fixed else None
        elif key == "target":
            value = variant.targets[0]
        elif key == "backend":
            value = _backend(variant)
        elif key == "step" and "duration" in options.options and option.kind is not tuple:
            value = variant.step
        else:
            continue
        if group is not None and issubclass(group, FixedOptions) and not is_fixed:
            continue
        if (
            key == "word"
            and "backend" in keys
            and _given(arguments, "--backend", "--backends") != "fixed-model"
        ):
            continue  # the back end has its word
        if key == "word" and isinstance(value, list | tuple):
            value = value[0]
        if key == "project" and value and not _is_compiled(_target(variant, arguments)):
            continue
        if value is not None:
            yield name, _word(option, value, variant.folder)


def _is_fixed(variant: Variant, options: CommandOptions, arguments: Sequence[str]) -> bool:
    """Tell whether the options of fixed point go with the target or the back ends of a command line."""
    from strapgen.run.registry import BACKENDS
    from strapgen.targets import TARGETS

    if "backend" in {_key(option) for option in options.options.values()}:
        named = _given(arguments, "--backend", "--backends") or _backend(variant)
        return all(name in BACKENDS and BACKENDS[name].fixed for name in named.split(","))
    # Several targets of which one alone is fixed are refused by the command.
    named = (_given(arguments, "--target") or ",".join(variant.targets)).split(",")
    return any(name not in TARGETS or TARGETS[name].fixed for name in named)


def _is_compiled(target: str) -> bool:
    from strapgen.targets import TARGETS

    return target in TARGETS and TARGETS[target].compiled


def _target(variant: Variant, arguments: Sequence[str]) -> str:
    return (_given(arguments, "--target") or variant.targets[0]).partition(",")[0]


def _backend(variant: Variant) -> str:
    """Return the back end of the variant's first target, with its word."""
    from strapgen.run.registry import BACKENDS

    target, word = variant.targets[0], variant.words[0] or 32
    fitting = [name for name, entry in BACKENDS.items() if entry.target == target]
    return next(
        (name for name in fitting if BACKENDS[name].word in (None, word)), next(iter(fitting), "numpy")
    )


def _given(arguments: Sequence[str], *names: str) -> str:
    """Return the value of an option of a command line; "" if it is not there."""
    for word, following in pairwise([*arguments, ""]):
        if word in names:
            return following
        if word.partition("=")[0] in names:
            return word.partition("=")[2]
    return ""


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


def _variant(name: str, folder: Path, table: Any) -> Variant:
    where = f"variant.{name}"
    if not isinstance(table, dict):
        raise toml_models.refused(where, table, "a table")
    known, options, of_command = _keys(), {}, {}
    for key, value in table.items():
        path = f"{where}.{key}"
        if key == "checks":
            continue
        if key in known:
            options[key] = value
            for one in _listed(value) if key in ("word", "target") else [value]:
                _read(known[key], path, one, folder)
        elif isinstance(value, dict) and (command := key.replace("-", " ")) in program.commands():
            of_command[key] = _of_command(program.options_of(command), path, value, folder)
        else:
            raise InputError(f"{path}: {checks.unknown('key', key, [*known, 'checks'])}")
    if "algorithm" not in options:
        raise InputError(f"{where}.algorithm is missing; strapgen list kernels shows the names")
    stated = toml_models.parse(Checks, table.get("checks", {}), where=f"{where}.checks")
    return Variant(name, folder, options, of_command, stated)


def _of_command(options: CommandOptions, where: str, table: dict[str, Any], folder: Path) -> dict[str, Any]:
    known = {_key(option): option for option in options.options.values()}
    for key, value in table.items():
        if key not in known:
            raise InputError(f"{where}.{key}: {checks.unknown('key', key, known)}")
        _read(known[key], f"{where}.{key}", value, folder)
    return table


def _read(option: Option, where: str, value: Any, folder: Path) -> None:
    """Refuse a value that the option would refuse."""
    if (option.kind is bool) != isinstance(value, bool):
        words = "true or false" if option.kind is bool else "a number, a text or a list"
        raise toml_models.refused(where, value, words)
    try:
        option.value(_word(option, value, folder))
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _word(option: Option, value: Any, folder: Path) -> Any:
    """Return a value as the command line has it; a path is relative to the folder of the file."""
    if isinstance(value, bool):
        return value
    if isinstance(value, dict):
        return [f"{key}={one}" for key, one in value.items()]
    if option.kind is Path:
        place = folder / str(value)
        return str(place.relative_to(Path.cwd()) if place.is_relative_to(Path.cwd()) else place)
    if option.kind is list:
        return [str(one) for one in _listed(value)]
    return ",".join(map(str, value)) if isinstance(value, list) else str(value)


def _key_schema(option: Option) -> dict[str, Any]:
    about = {"description": option.help}
    if option.kind is bool:
        return about | {"type": "boolean"}
    if option.kind is int:
        kinds: Any = [{"type": "integer"}]
    elif option.kind in (dict, Mapping):
        return about | {"type": "object"}
    elif option.kind in (str, Path, list, tuple):
        kinds = [{"type": "string"}]
    else:
        kinds = [{"type": "number"}, {"type": "string"}]
    if option.kind in (tuple, list) or _key(option) == "word":
        kinds.append({"type": "array", "items": kinds[0], "minItems": 1})
    return about | (kinds[0] if len(kinds) == 1 else {"anyOf": kinds})
