"""The JSON Schemas of users' TOML files, by kind; files of them are in the folder ``schemas`` of the package.

An editor that knows the directive ``#:schema`` checks a file that begins with it while it is written.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from strapgen import registration
from strapgen.catalogue.toml_files import UserFile

#: Folder of the files, each with the name of its kind.
FOLDER = Path(registration.__file__).parent / "schemas"


def schemas() -> dict[str, Callable[[], dict[str, Any]]]:
    """Return the functions that return the JSON Schema of each kind, by name.

    >>> schemas()["coning"]()["properties"]["band"]["unit"]
    'rad a sample'
    """
    places = (pair for one in registration.built_in().values() for pair in one.files.items())
    return {name: partial(_schema, place) for name, place in places}


def _schema(place: str) -> dict[str, Any]:
    kind: UserFile[Any] = registration.load(place)
    return kind.schema()


def text(kind: str) -> str:
    """Return the text of the file of a schema."""
    return json.dumps(schemas()[kind](), indent=1, ensure_ascii=False) + "\n"
