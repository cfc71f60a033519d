"""Reads what files of exact coefficients hold: keys, rationals, the name that a title gives; those of packages."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Container, Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any, Generic, TypeVar

from strapgen.catalogue.methods import coefficients
from strapgen.catalogue.methods.window import GyroResponse
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

T = TypeVar("T")

_FRACTION = re.compile(r"-?[0-9]+(/[1-9][0-9]*)?")
#: Most characters of a fraction; those of filters for a gyro are long.
MOST_CHARACTERS = 4000


def check_keys(data: Mapping[str, Any], keys: Collection[str], optional: Collection[str]) -> None:
    """Check that a table has all keys that it needs and no other, and that its name and source are texts."""
    for key in data:
        if key not in keys:
            raise InputError(f"key {key!r} is not known; allowed: {', '.join(keys)}")
    for key in keys:
        if key not in data and key not in optional:
            raise InputError(
                f"key {key} is missing; needed: {', '.join(k for k in keys if k not in optional)}"
            )
    for key in ("name", "source"):
        if key in keys and not checks.text(key, data[key]).strip():
            raise InputError(f"{key} is empty; a text is needed")


def entries(what: str, value: Any) -> list[Any]:
    """Return a value that must be a list."""
    if not isinstance(value, list):
        raise InputError(f"{what} is of type {type(value).__name__}; a list is needed")
    return value


def slug(title: str) -> str:
    """Return a title as a name on the command line.

    >>> slug("Bogacki & Shampine 3(2)")
    'bogacki-shampine-3-2'
    """
    name = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")
    if not name[:1].isalpha():
        raise InputError(f"name {title!r} must begin with a letter from a to z, for its name in code")
    return name


def rational(what: str, value: Any) -> Fraction:
    """Return an entry that must be a whole number or a text of a rational number, see `coefficients.number`."""
    # The whole of a large family is read: what is plainly a fraction does not take the way of an expression.
    if isinstance(value, str) and len(value) <= MOST_CHARACTERS and _FRACTION.fullmatch(value):
        top, _, bottom = value.partition("/")
        return Fraction(int(top), int(bottom or 1))
    number = coefficients.number(what, value)
    if not isinstance(number, Fraction):
        raise InputError(f"{what} is {value!r}; a rational number is needed")
    return number


def not_negative(what: str, value: Any) -> Fraction:
    """Return an entry that must be a rational number from 0 on."""
    number = rational(what, value)
    if number < 0:
        raise InputError(f"{what} is {value}; a number that is not below 0 is needed")
    return number


def band(value: Any) -> Fraction:
    """Return an entry that must be the end of a band in rad a sample, above 0 and below half the sampling rate."""
    highest = rational("band", value)
    if not 0 < highest < 3:
        raise InputError(
            f"band is {value} rad a sample; a number between 0 and 3 is needed, pi is half the sampling rate"
        )
    return highest


def gyro(table: Any) -> GyroResponse | None:
    """Return the table of a gyro of second order, or None without a table."""
    if table is None:
        return None
    if not isinstance(table, dict):
        raise InputError(f"gyro is of type {type(table).__name__}; a table is needed")
    check_keys(table, GyroResponse._fields, ())
    values = [not_negative(f"gyro {key}", table[key]) for key in GyroResponse._fields]
    for key, value in zip(GyroResponse._fields, values, strict=True):
        if not value:
            raise InputError(f"gyro {key} is 0; a number above 0 is needed")
    return GyroResponse(*values)


class CoefficientFiles(Mapping[str, T], Generic[T]):
    """Coefficients by name; a file is read when they are first used, and again when it has changed."""

    def __init__(
        self, files: Mapping[str, Path], read: Callable[[Path, str], T], without: Container[str] = ()
    ) -> None:
        self.files, self._read, self._without = files, read, without
        self._known: dict[tuple[str, int], T] = {}

    def __getitem__(self, name: str) -> T:
        if name not in self:
            raise KeyError(name)
        path = self.files[name]
        key = name, path.stat().st_mtime_ns
        if key not in self._known:
            self._known[key] = self._read(path, name)
        return self._known[key]

    def __contains__(self, name: object) -> bool:
        return name not in self._without and name in self.files

    def __iter__(self) -> Iterator[str]:
        return (name for name in self.files if name not in self._without)

    def __len__(self) -> int:
        return len(list(iter(self)))
