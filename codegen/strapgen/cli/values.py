"""Typed values of options: each text is read once; a refusal names the option and what is allowed, in one line."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, ClassVar, NamedTuple, Self, TypeVar, get_args, get_origin, get_type_hints

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.storage import streams

#: Reads a word of the command line: the option's name and the word, which is a path where the type is one.
Reader = Callable[[str, Any], Any]
Record = TypeVar("Record")
#: The comma before the next of several settings; others are in the value of one.
_NEXT_PAIR = re.compile(r",\s*(?=[A-Za-z_][\w.:-]*=)")
_IN_WORDS = {2: "two", 3: "three"}


class Number(Fraction):
    """An exact rational, which prints as it was written."""

    text: str
    #: Whether it must be above 0, or at least 0
    above_zero: ClassVar[bool] = False
    from_zero: ClassVar[bool] = False

    def __new__(cls, numerator: Any = 0, denominator: Any = None) -> Self:
        """Return a number as `Fraction` does."""
        self = super().__new__(cls, numerator, denominator)
        self.text = str(numerator) if denominator is None else f"{numerator}/{denominator}"
        return self

    @classmethod
    def read(cls, option: str, text: str) -> Self:
        """Read the number of an option."""
        self = cls(checks.number(option, text, positive=cls.above_zero))
        if cls.from_zero and self < 0:
            raise InputError(f"{option} is {text}; a number that is not below 0 is needed")
        self.text = text
        return self

    def __str__(self) -> str:
        return self.text

    def __format__(self, form: str) -> str:  # from Python 3.12 on a Fraction's own does not ask __str__
        return super().__format__(form) if form else self.text

    def __reduce__(self) -> Any:
        return type(self), (self.numerator, self.denominator), {"text": self.text}

    def __deepcopy__(self, memo: Any) -> Self:
        return self


class Positive(Number):
    """A number above 0."""

    above_zero = True


class NotNegative(Number):
    """A number from 0 on."""

    from_zero = True


#: Numbers about three axes
Vector = tuple[Number, Number, Number]


def line(option: str, text: str) -> str:
    """Read one line of text."""
    if not text.isprintable():
        raise InputError(f"{option} is {text!r}; one line of text is needed")
    return text


def single(option: str, text: str) -> str:
    """Read one name; refuse a list."""
    if "," in text:
        raise InputError(f"{option} {text} is a list; one name is needed here")
    return text


class Names(NamedTuple):
    """A reader of one name: of several, or of those that a registry "module:name" has when it is asked."""

    allowed: str | tuple[str, ...]

    def __call__(self, option: str, text: str) -> str:
        """Read the name."""
        from strapgen import registration

        known = registration.load(self.allowed) if isinstance(self.allowed, str) else self.allowed
        return checks.choice(option[2:], single(option, text), known)


names = Names


def whole(smallest: int, largest: int | None = None) -> Reader:
    """Return a reader of a whole number of a range."""
    return lambda option, text: checks.count(
        option, checks.whole(option, text), smallest=smallest, largest=largest
    )


def path(option: str, word: str | Path) -> Path:
    """Return the path of a word; what is there can be read."""
    is_path = "\0" not in str(word)  # what opens it refuses it otherwise
    if is_path and os.access(word, os.F_OK) and not os.access(word, os.R_OK):
        raise InputError(f"{option} {word} cannot be read; its permissions are in the way")
    return Path(word)


def folder(option: str, path: Path) -> Path:
    """Return a folder; elsewhere - stands for the terminal."""
    if path == streams.STANDARD:
        raise InputError(f"{option} - is no folder; files are not written to the terminal")
    return path


def split(kind: Any) -> tuple[Any, tuple[Any, ...]]:
    """Return a type without None, the first of several, and the types that are its parts."""
    kinds = (
        [part for part in get_args(kind) if part is not NoneType] if NoneType in get_args(kind) else [kind]
    )
    kind = kinds[0]
    kind = kind.__origin__ if get_origin(kind) is Annotated else kind
    return get_origin(kind) or kind, get_args(kind)


def reader(kind: Any, read: Reader | None) -> Reader | None:
    """Return the reader of values of a type; `read` reads one of several. None for text without conversion."""
    whole_kind, parts = split(kind)
    if whole_kind is tuple:
        return _tuple_reader(
            parts, read or reader(parts[0], None) or (path if parts[0] is Path else _as_it_is)
        )
    if issubclass(whole_kind, Mapping):
        return _pairs_reader(read or reader(parts[1], None) or _as_it_is)
    if read is not None:
        return read
    if issubclass(whole_kind, Number):
        return whole_kind.read  # type: ignore[no-any-return]
    readers: dict[Any, Reader] = {int: checks.whole, Fraction: checks.number}
    return readers.get(whole_kind)


def _as_it_is(option: str, text: str) -> str:
    return text


def listed(option: str, text: str) -> list[str]:
    """Return the values of a comma-separated list, each once, at least one."""
    values = list(dict.fromkeys(value.strip() for value in text.split(",") if value.strip()))
    if not values:
        raise InputError(f"{option} is {text!r}; at least one value is needed")
    return values


def _tuple_reader(parts: tuple[Any, ...], read: Reader) -> Reader:
    def several(option: str, text: str | Sequence[str]) -> tuple[Any, ...]:
        if not isinstance(text, str):  # given several times
            text = ",".join(text)
        if ... in parts:
            return tuple(read(option, value) for value in listed(option, text))
        values = text.split(",")
        if len(values) != len(parts):
            count = _IN_WORDS[len(parts)]
            raise InputError(f"{option} is {text!r}; {count} numbers with commas between are needed")
        return tuple(read(option, value) for value in values)

    return several


def _pairs_reader(read: Reader) -> Reader:
    def pairs(option: str, texts: Iterable[str]) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for text in (part for several in texts for part in _NEXT_PAIR.split(several)):
            name, equals, value = text.partition("=")
            if not equals or not name or not value:
                raise InputError(f"{option} {text!r} is no setting; NAME=VALUE is needed")
            if name in values:
                raise InputError(f"{option} {name} is given twice; one is needed")
            values[name] = read(f"{option} {name}", value)
        return values

    return pairs


def filled(kind: type[Record], settings: Mapping[str, Fraction] | None) -> Record:
    """Return a dataclass of numbers with those that --set states."""
    types = get_type_hints(kind)
    stated: dict[str, Any] = {}
    for key, value in (settings or {}).items():
        checks.choice("--set", key, types)
        if types[key] is int and value.denominator != 1:
            raise InputError(f"--set {key} is {value}; a whole number is needed")
        stated[key] = types[key](value)
    return kind(**stated)


def written(value: Any) -> str:
    """Return a value as on a command line."""
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
