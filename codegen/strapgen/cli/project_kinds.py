"""Kinds of projects around generated C, which applications bring at the extension point ``project.kinds``."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from strapgen import registration
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

#: The kind of --project without a value.
DEFAULT = "cmake"


class Kind(NamedTuple):
    """A kind of project: what it is, and the function that writes its files."""

    title: str
    #: "module:function" of the function that returns the files of a `Project` of firmware by path, or of a `Unit`
    place: str
    #: Targets that do not go with it, each with the reason
    refuses: Mapping[str, str] = MappingProxyType({})
    #: Test vectors of each function
    vectors: int = 200


def kinds() -> dict[str, Kind]:
    """Return the kinds by name."""
    return {name: kind for table in registration.extensions("project.kinds") for name, kind in table.items()}


def titles() -> dict[str, str]:
    """Return the kinds by name, with what each is."""
    return {name: kind.title for name, kind in kinds().items()}


def read_kind(option: str, text: str) -> str:
    """Read the name of a kind."""
    return checks.choice(option[2:], text, kinds())


def require_target(name: str, target: str) -> None:
    """Refuse a target that does not go with a kind."""
    if reason := kinds()[name].refuses.get(target):
        raise InputError(f"--project {name} does not go with --target {target}: {reason}")
