"""Users' TOML files: a kind of file has a model, a dataclass whose annotations say what each key holds.

A field of a model is ``Annotated[type, Key(...)]``. The type says what is read:

- ``Fraction`` and ``float``: a number, or a text such as "1/3"; exactly, or rounded to double;
- ``Number``: the same with square roots; ``int``, ``bool`` and ``str`` themselves;
- ``tuple[X, ...]`` and ``tuple[X, X, X]``: a list, of any length or of this one;
- ``Mapping[str, X]``: a table with names of the user's; a dataclass: a table with the keys of its fields;
- ``X | None``: a key that may be left out; ``X | tuple[X, X, X]``: either, by what stands there;
- a class with `from_toml`: what that returns.

The same annotations give the JSON Schema of a file; the schemas are files of the folder ``schemas`` of the package. An
editor that knows the directive ``#:schema`` checks a file that begins with it while it is written.
"""

from __future__ import annotations

import dataclasses
import json
import math
import re
import tomllib
import types
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import (
    Annotated,
    Any,
    ClassVar,
    Generic,
    Protocol,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from strapgen import registration
from strapgen.catalogue import coefficients
from strapgen.ir import checks
from strapgen.ir.checks import alternatives, counted, unknown
from strapgen.ir.exceptions import InputError
from strapgen.ir.renamed import warn
from strapgen.storage import streams

#: Fractions take no time to read, and those of filters for a gyro are long.
_FRACTION, _MOST_CHARACTERS = re.compile(r"-?[0-9]+(/[1-9][0-9]*)?"), 4000
#: Texts of numbers in a JSON Schema: rational ones, and those with square roots.
_RATIONAL, _ALGEBRAIC = r"^[0-9eE+\-*/(). ]+$", r"^[0-9eEsqrt+\-*/(). ]+$"


@dataclass(frozen=True)
class Key:
    """Description, unit and limits of a key."""

    #: One line for readers
    text: str = ""
    unit: str = ""
    #: Limits of a number, or of the number of entries of a list
    above: float | None = None
    least: float | None = None
    below: float | None = None
    most: float | None = None
    #: The values that are allowed
    choices: Collection[Any] = ()
    #: The names that a table of numbers may have; any by default
    names: tuple[str, ...] = ()
    #: Regular expression of a text, and what a message calls such a text
    pattern: str = ""
    form: str = "a text"
    #: The key in the file where that is no name in Python
    name: str = ""

    @property
    def described(self) -> dict[str, str]:
        """The description of the key in a JSON Schema, with its unit."""
        if not self.unit:
            return {"description": self.text}
        return {"description": f"{self.text} [{self.unit}]", "unit": self.unit}

    def excludes(self, number: Any) -> bool:
        """Return whether a number is outside the limits."""
        above, least, below, most = (
            None if limit is None else Fraction(str(limit))  # 1e-5 is 1/100000 here
            for limit in (self.above, self.least, self.below, self.most)
        )
        number = number if isinstance(number, int | Fraction) else float(number)
        return (
            (above is not None and number <= above)
            or (least is not None and number < least)
            or (below is not None and number >= below)
            or (most is not None and number > most)
            or (bool(self.choices) and number not in self.choices)
        )

    @property
    def limits(self) -> str:
        """The limits in words."""
        words = {"above": self.above, "of at least": self.least, "below": self.below, "of at most": self.most}
        stated = {w: int(x) if x == int(x) else f"{x:g}" for w, x in words.items() if x is not None}
        if list(stated) == ["of at least", "of at most"]:
            return " from {} to {}".format(*stated.values())
        return " and".join(f" {word} {limit}" for word, limit in stated.items())


_NO_KEY = Key()


class Readable(Protocol):
    """A class of values with a form of their own in a file."""

    #: What a message says that is needed, and the keywords of a JSON Schema
    WORDS: str
    SCHEMA: Mapping[str, Any]

    @classmethod
    def from_toml(cls, where: str, value: Any) -> Any:
        """Return the value of an entry; `where` is its path."""


def shown(value: Any) -> str:
    """Return a value as TOML, on one line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list) and any(isinstance(one, dict) for one in value):
        return "a list of tables"
    if isinstance(value, list):
        text = f"[{', '.join(map(shown, value))}]"
        return text if len(text) <= 60 else f"{text[:60]}..."
    return checks.shown(value) if isinstance(value, str) else str(value).lower()


def refused(where: str, value: Any, words: str) -> InputError:
    """Return the error for a value; `words` state the requirement."""
    return InputError(f"{where} is {shown(value)}; {words} is needed")


def rational(where: str, value: Any) -> Fraction:
    """Return a rational number, exactly: of a number its decimal digits, of a text its value."""
    number = algebraic(where, value)
    if not isinstance(number, Fraction):
        raise refused(where, value, "a rational number")
    return number


def algebraic(where: str, value: Any) -> coefficients.Number:
    """Return an exact number; a text may have square roots."""
    if isinstance(value, str):
        if len(value) <= _MOST_CHARACTERS and _FRACTION.fullmatch(value):
            top, _, bottom = value.partition("/")
            return Fraction(int(top), int(bottom or 1))
        return coefficients.number(where, value)
    if isinstance(value, bool) or not isinstance(value, int | float | Decimal | Fraction):
        raise refused(where, value, 'a number or a text such as "1/3"')
    if isinstance(value, int):
        return coefficients.number(where, value)
    if not math.isfinite(value):
        raise refused(where, value, "a finite number")
    return checks.number(where, str(value))


class _Form:
    """The form of a value: its type in TOML, its name in messages, its reader and its JSON Schema."""

    takes: ClassVar[tuple[type, ...]]
    #: What several are called
    plural: ClassVar[str] = "entries"
    words: str

    def accepts(self, value: Any) -> bool:
        return isinstance(value, self.takes) and not isinstance(value, bool)

    def read(self, where: str, value: Any) -> Any:
        if not self.accepts(value):
            raise refused(where, value, self.words)
        return self._read(where, value)

    def _read(self, where: str, value: Any) -> Any:
        raise NotImplementedError

    def schema(self) -> dict[str, Any]:
        raise NotImplementedError


class _Number(_Form):
    """A number of the type `int`, `float`, `Fraction`, or `coefficients.Number` with square roots."""

    plural = "numbers"

    def __init__(self, kind: Any, key: Key) -> None:
        self.kind, self.key, self.limited = kind, key, bool(key.limits or key.choices)
        self.takes = (int,) if kind is int else (int, float, Decimal, Fraction, str)  # type: ignore[misc]
        unit = "" if key.unit in ("", "1") else f" in {key.unit}"
        self.words = f"a {'whole ' if kind is int else ''}number{key.limits}{unit}"
        if key.choices:
            self.words = alternatives(list(map(str, key.choices)))

    def _read(self, where: str, value: Any) -> Any:
        if self.kind is int:
            number = value
        else:
            number = algebraic(where, value) if self.kind is coefficients.Number else rational(where, value)
        if self.limited and self.key.excludes(number):
            raise refused(where, value, self.words)
        return float(number) if self.kind is float else number

    def schema(self) -> dict[str, Any]:
        key = self.key
        if key.choices:
            return {"enum": list(key.choices)}
        limits = {"exclusiveMinimum": key.above, "minimum": key.least, "exclusiveMaximum": key.below}
        stated = {name: limit for name, limit in {**limits, "maximum": key.most}.items() if limit is not None}
        if self.kind is int:
            return {"type": "integer", **stated}
        text = _ALGEBRAIC if self.kind is coefficients.Number else _RATIONAL
        return {"type": ["number", "string"], **stated, "pattern": text}


class _Text(_Form):
    """A text."""

    takes, plural = (str,), "texts"

    def __init__(self, key: Key) -> None:
        self.key, self.words = key, alternatives(list(map(repr, key.choices))) if key.choices else key.form

    def _read(self, where: str, value: Any) -> Any:
        if self.key.choices:
            return checks.choice(where, value, self.key.choices)
        text = checks.text(where, value)
        if self.key.pattern and not re.fullmatch(self.key.pattern, text):
            raise refused(where, value, self.words)
        return text

    def schema(self) -> dict[str, Any]:
        if self.key.choices:
            return {"enum": list(self.key.choices)}
        return {"type": "string"} | ({"pattern": f"^(?:{self.key.pattern})$"} if self.key.pattern else {})


class _Flag(_Form):
    """True or false."""

    plural, words = "flags", "true or false"

    def accepts(self, value: Any) -> bool:
        return isinstance(value, bool)

    def _read(self, where: str, value: Any) -> Any:
        return value

    def schema(self) -> dict[str, Any]:
        return {"type": "boolean"}


class _List(_Form):
    """A list of entries of one form: `count` of them, or as many as the key allows."""

    takes, plural = (list, tuple), "lists"

    def __init__(self, item: _Form, count: int | None, key: Key) -> None:
        self.item, self.key = item, replace(key, least=count, most=count) if count is not None else key
        self.count = key.limits.replace(" of ", " ") if count is None else f" {count}"
        self.words = f"a list of{self.count.removeprefix(' from')} {item.plural}"

    def _read(self, where: str, value: Any) -> Any:
        if self.key.excludes(len(value)):
            raise InputError(f"{where} has {counted(len(value), 'entry', 'entries')};{self.count} are needed")
        return tuple([self.item.read(_label(where, number, one), one) for number, one in enumerate(value, 1)])

    def schema(self) -> dict[str, Any]:
        sizes = {"minItems": self.key.least, "maxItems": self.key.most}
        stated = {name: size for name, size in sizes.items() if size is not None}
        return {"type": "array", **stated, "items": self.item.schema()}


def _label(where: str, number: int, entry: Any) -> str:
    """Return the path of an entry of a list: by its name if it has a short one."""
    name = entry.get("name") if isinstance(entry, dict) else None
    is_label = isinstance(name, str) and name.isprintable() and 0 < len(name) <= 40
    return f"{where}[{name if is_label else number}]"


class _Names(_Form):
    """A table whose keys are names of the user's, or some of a few."""

    takes, plural, words = (dict,), "tables", "a table"

    def __init__(self, name: _Form, item: _Form) -> None:
        self.name, self.item = name, item

    def _read(self, where: str, value: Any) -> Any:
        return {
            self.name.read(f"key of {where}", key): self.item.read(f"{where}.{key}", entry)
            for key, entry in value.items()
        }

    def schema(self) -> dict[str, Any]:
        return {
            "type": "object",
            "propertyNames": self.name.schema(),
            "additionalProperties": self.item.schema(),
        }


class _Either(_Form):
    """One of several forms, selected by the type of the value."""

    def __init__(self, forms: list[_Form]) -> None:
        self.forms, self.words = forms, alternatives([form.words for form in forms])

    def accepts(self, value: Any) -> bool:
        return any(form.accepts(value) for form in self.forms)

    def _read(self, where: str, value: Any) -> Any:
        return next(form for form in self.forms if form.accepts(value)).read(where, value)

    def schema(self) -> dict[str, Any]:
        return {"anyOf": [form.schema() for form in self.forms]}


class _Custom(_Form):
    """A class that reads itself, a `Readable`."""

    def __init__(self, kind: Any) -> None:
        self.words, self._kind = kind.WORDS, kind

    def accepts(self, value: Any) -> bool:
        return True

    def _read(self, where: str, value: Any) -> Any:
        return self._kind.from_toml(where, value)

    def schema(self) -> dict[str, Any]:
        return dict(self._kind.SCHEMA)


class _Table(_Form):
    """A table with the keys of a dataclass."""

    takes, plural = (dict,), "tables"

    def __init__(self, model: Any) -> None:
        self.model, hints = model, get_type_hints(model, include_extras=True)
        #: Field, form and key by the name in the file
        self.keys: dict[str, tuple[dataclasses.Field[Any], _Form, Key]] = {}
        for field in filter(lambda field: field.init, dataclasses.fields(model)):
            form, key = _form(hints[field.name])
            self.keys[key.name or field.name] = field, form, key
        self.words = f"a table with {', '.join(self.keys)}"
        missing = dataclasses.MISSING
        self.needed = [n for n, (f, *_) in self.keys.items() if f.default is missing is f.default_factory]

    def _read(self, where: str, value: Any) -> Any:
        start = f"{where}." if where else ""
        for old, new in getattr(self.model, "OLD_KEYS", {}).items():
            if old in value and new not in value:
                warn(f"{start}{old}", f"{start}{new}")
                value = {new if name == old else name: entry for name, entry in value.items()}
        for name in value:
            if name not in self.keys:
                raise InputError(f"{where}{': ' if where else ''}{unknown('key', name, self.keys)}")
        for name in self.needed:
            if name not in value:
                raise InputError(f"{start}{name} is missing; {self.keys[name][1].words} is needed")
        values = {}
        for name, entry in value.items():
            field, form, _ = self.keys[name]
            values[field.name] = form.read(f"{start}{name}", entry)
        try:
            return self.model(**values)
        except InputError as error:  # of what the values of several keys cannot be together
            begins_with_key = str(error).partition(" ")[0] in self.keys
            raise InputError(f"{start if begins_with_key or not where else f'{where}: '}{error}") from None

    def schema(self) -> dict[str, Any]:
        properties = {
            name: {"title": name, **key.described, **form.schema(), **_default(field)}
            for name, (field, form, key) in self.keys.items()
        }
        needed = {"required": self.needed} if self.needed else {}
        return {"type": "object", "properties": properties, **needed, "additionalProperties": False}


def _default(field: dataclasses.Field[Any]) -> dict[str, Any]:
    """Return the default of a field as a JSON Schema has it."""
    value = field.default
    if isinstance(value, Fraction):
        value = int(value) if value.denominator == 1 else str(value)
    return {"default": value} if isinstance(value, str | int | float) and value != "" else {}


def _form(hint: Any, key: Key = _NO_KEY) -> tuple[_Form, Key]:
    """Return the form of an annotation, and its key."""
    if get_origin(hint) is Annotated:
        hint, key = get_args(hint)[:2]
    if get_origin(hint) in (Union, types.UnionType):
        forms = [one for one in get_args(hint) if one is not types.NoneType]
        if len(forms) == 1:
            return _form(forms[0], key)
        return _Either([_form(one, key)[0] for one in forms]), key
    return _form_of(hint, key), key


def _form_of(hint: Any, key: Key) -> _Form:
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is tuple:
        # Where the number of entries is fixed, the limits of a key are those of each.
        if arguments[-1] is Ellipsis:
            return _List(_form(arguments[0])[0], None, key)
        return _List(_form(arguments[0], key)[0], len(arguments), _NO_KEY)
    if origin is not None:
        names = _Text(Key(choices=key.names)) if key.names else _form(arguments[0])[0]
        return _Names(names, _form(arguments[1], key)[0])
    if hint is str:
        return _Text(key)
    if hint is bool:
        return _Flag()
    if hasattr(hint, "from_toml"):
        return _Custom(hint)
    return _table(hint) if hasattr(hint, "__dataclass_fields__") else _Number(hint, key)


#: The form of a dataclass.
_table = cache(_Table)


def parse(hint: Any, value: Any, where: str = "") -> Any:
    """Convert a value of a file by an annotation, for instance a model.

    Raises
    ------
    InputError
        If something is wrong: one line with its path, what it is, and what is needed.
    """
    return _form(hint)[0].read(where, value)


def check_kind(table: Any, what: str, kinds: Mapping[str, tuple[Collection[str], Collection[str]]]) -> None:
    """Refuse a table without a key that its `kind` needs, or with one that its kind does not have.

    `kinds` holds the keys that each needs and those that it may have; a key is there unless it is None or empty.
    """
    needed, further = kinds[table.kind]
    values = {field.name: getattr(table, field.name) for field in dataclasses.fields(table)}
    stated = [name for name, value in values.items() if name != "kind" and value not in (None, ())]
    for name in needed:
        if name not in stated:
            raise InputError(f"{what} of kind {table.kind} needs {name}")
    for name in stated:
        if name not in (*needed, *further):
            takes = ", ".join((*needed, *further)) or "no other key"
            raise InputError(f"{what} of kind {table.kind} has no {name}; it takes {takes}")


def keys(model: Any) -> dict[str, Key]:
    """Return the keys of a model by its fields."""
    return {field.name: key for field, _, key in _table(model).keys.values()}


def schema(hint: Any) -> dict[str, Any]:
    """Return the JSON Schema of an annotation, for instance of a model."""
    return _form(hint)[0].schema()


T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True)
class UserFile(Generic[T]):
    """A kind of files."""

    #: What a message calls one, as "a brief"
    what: str
    #: Dataclass of its keys, see `toml_models`
    model: type[T]
    #: A longer file is refused
    most_bytes: int

    def read(self, path: str | Path) -> T:
        """Return the model of a file."""
        return self.convert(path, lambda model: model)

    def convert(self, path: str | Path, then: Callable[[T], R]) -> R:
        """Return `then` of the model of a file; every error message begins with the path."""
        data = self.content(path)
        try:
            return then(parse(self.model, data))
        except InputError as error:
            located = InputError(f"{path}: {error}")
            located.in_file = True
            raise located from None

    def content(self, path: str | Path) -> dict[str, Any]:
        """Return the tables of a file, whose decimals keep their digits."""
        return content(path, self.what, self.most_bytes)

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema of such a file, with the unit of each key."""
        return {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "title": f"{self.what[0].upper()}{self.what[1:]} for strapgen",
            "description": " ".join((self.model.__doc__ or "").split("\n\n")[0].split()),
            **schema(self.model),
        }


def content(path: str | Path, what: str, most_bytes: int) -> dict[str, Any]:
    """Return the content of a TOML file of at most `most_bytes`; error messages say `what` it holds."""
    place = checks.path("path", path)
    try:
        with streams.opened(place) as file:
            data = file.read(most_bytes + 1)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from None
    if len(data) > most_bytes:
        raise InputError(f"{path} is over {most_bytes} bytes long; {what} is shorter")
    try:
        return tomllib.loads(data.decode("utf-8-sig").replace("\r\n", "\n"), parse_float=Decimal)
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 (byte {error.start})") from None
    except (ValueError, ArithmeticError, RecursionError) as error:
        raise InputError(f"{path} is not TOML ({error})") from None


#: Folder of the files, each with the name of its kind.
FOLDER = Path(registration.__file__).parent / "schemas"


def schemas() -> dict[str, Callable[[], dict[str, Any]]]:
    """Return the functions that return the JSON Schema of each kind, by name.

    >>> schemas()["coning"]()["properties"]["band"]["unit"]
    'rad a sample'
    """
    known = registration.schemas().items()
    return {name.removesuffix(".toml"): one.read for name, one in known if one.kind == "file"}


def schema_text(kind: str) -> str:
    """Return the text of the file of a schema."""
    return json.dumps(schemas()[kind](), indent=1, ensure_ascii=False) + "\n"
