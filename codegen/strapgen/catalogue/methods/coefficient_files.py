"""Keys that files of coefficients have in common, the name that a title gives, and the files themselves by name."""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Generic, TypeVar

from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.toml_models import Key
from strapgen.ir.exceptions import InputError

T = TypeVar("T")

#: Keys that all files of coefficients have.
Title = Annotated[
    str,
    Key(
        "Name for readers; in lower case with hyphens it is the name in code",
        pattern=r"[^A-Za-z0-9]*[A-Za-z].*",
        form="a text that begins with a letter from a to z",
    ),
]
Source = Annotated[str, Key("Where it comes from", pattern=r".*\S.*", form="a text that is not empty")]


Band = Annotated[
    Fraction, Key("Highest angular frequency; pi is half the sampling rate", "rad a sample", above=0, below=3)
]
Gyro = Annotated[Response, Key("Response of the gyro, which is compensated; ideal without it")]


def check_gyro(gyro: Response | None) -> None:
    """Refuse a response without its sampling frequency."""
    if gyro is not None and gyro.sample_hz is None:
        raise InputError("gyro.sample_hz is missing; a number above 0 in Hz is needed")


def slug(title: str) -> str:
    """Return a title as a name on the command line.

    >>> slug("Bogacki & Shampine 3(2)")
    'bogacki-shampine-3-2'
    """
    name = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")
    if not name[:1].isalpha():
        raise InputError(f"name {title!r} must begin with a letter from a to z, for its name in code")
    return name


class CoefficientFiles(Mapping[str, T], Generic[T]):
    """Coefficients by name; a file is read when they are first used, and again when it has changed."""

    def __init__(
        self, files: Mapping[str, Path], read: Callable[[Path, str], T], without: Container[str] = ()
    ) -> None:
        self.files: Mapping[str, Path] = files
        self._read, self._without = read, without
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
