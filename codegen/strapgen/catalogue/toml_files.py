"""Kinds of users' TOML files: each has a model, a JSON Schema, and errors in one line."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any, Generic, TypeVar

from strapgen.catalogue import toml_models
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

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
        """Return what `then` makes of the model of a file; every refusal begins with the path."""
        data = self.content(path)
        try:
            return then(toml_models.parse(self.model, data))
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
            **toml_models.schema(self.model),
        }


def content(path: str | Path, what: str, most_bytes: int) -> dict[str, Any]:
    """Return the content of a TOML file of at most `most_bytes`; error messages say `what` it holds."""
    place = checks.path("path", path)
    try:
        with place.open("rb") as file:
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
