"""Names whose application was left out of the installation: one line says so in place of an error of an import."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from strapgen.ir.exceptions import MissingExtraError

_PACKAGE = "strapgen"


@contextmanager
def needing(what: str) -> Iterator[None]:
    """Say in one line which folder of strapgen is not there; `what` is the name that needs it."""
    try:
        yield
    except ModuleNotFoundError as error:
        package, _, rest = (error.name or "").partition(".")
        folder = rest.partition(".")[0]
        if package != _PACKAGE or find_spec(f"{package}.{folder}") is not None:
            raise
        raise MissingExtraError(
            f"{what} needs the application {folder} of strapgen, which is not installed"
        ) from None
