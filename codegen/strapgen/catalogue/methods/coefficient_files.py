"""Keys that files of coefficients have in common, the name that a title gives, and files of installed packages."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Generic, TypeVar

from strapgen.catalogue.methods.window import GyroResponse
from strapgen.catalogue.toml_models import Key
from strapgen.ir.exceptions import InputError
from strapgen.registry import Registry

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
Gyro = Annotated[GyroResponse, Key("Gyro of second order whose response is taken out; ideal without it")]


def slug(title: str) -> str:
    """Return a title as a name on the command line.

    >>> slug("Bogacki & Shampine 3(2)")
    'bogacki-shampine-3-2'
    """
    name = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")
    if not name[:1].isalpha():
        raise InputError(f"name {title!r} must begin with a letter from a to z, for its name in code")
    return name


class InstalledFiles(Mapping[str, T], Generic[T]):
    """Coefficients in files of installed packages, by the names of the files; each is checked when it is used."""

    def __init__(self, files: Registry[Path], read: Callable[[Path, str], T]) -> None:
        self._files, self._read = files, read
        self._known: dict[tuple[Path, int], T] = {}

    def __getitem__(self, name: str) -> T:
        if name not in self:
            raise KeyError(name)
        path = self._files[name]
        key = path, path.stat().st_mtime_ns
        if key not in self._known:
            self._known[key] = self._read(path, name)
        return self._known[key]

    def __contains__(self, name: object) -> bool:
        return name not in self._files.own and name in self._files

    def __iter__(self) -> Iterator[str]:
        return (name for name in self._files if name not in self._files.own)

    def __len__(self) -> int:
        return len(list(iter(self)))
