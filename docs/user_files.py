"""Writes the JSON Schemas of users' TOML files, and the page that lists their keys: python docs/user_files.py.

Both come from the models by which strapgen reads the files; a test holds them in step.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from strapgen.catalogue import toml_models

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "user-files.md"
#: What stands before it is written by hand.
MARK = "<!-- From here on the page comes from the schemas: python docs/user_files.py -->\n"


def files() -> dict[Path, str]:
    """Return the text of every schema and of the page, by path."""
    kinds = toml_models.schemas()
    texts = {toml_models.FOLDER / f"{kind}.json": toml_models.schema_text(kind) for kind in kinds}
    head = PAGE.read_text("utf-8").partition(MARK)[0]
    sections = "".join(f"\n{_section(kind, schema())}" for kind, schema in kinds.items())
    return texts | {PAGE: f"{head}{MARK}{sections}"}


def examples() -> dict[Path, str]:
    """Return the kind of every file of the repository that names its schema, by path."""
    found = {}
    for folder in ("examples", "codegen/strapgen"):
        for path in sorted((ROOT / folder).rglob("*.toml")):
            first = path.read_text("utf-8").partition("\n")[0]
            if first.startswith("#:schema "):
                found[path] = Path(first.removeprefix("#:schema ")).stem
    return found


def _section(kind: str, schema: dict[str, Any]) -> str:
    """Return the section of a kind: what it is, examples, and a row for each key; keys in several tables share it."""
    named = [path for path, other in examples().items() if other == kind]
    shown = ", ".join(f"[{path.name}](../{path.relative_to(ROOT).as_posix()})" for path in named[:4])
    lines = [
        f"## {kind}",
        "",
        f"{schema['description']} Examples: {shown}.",
        "",
        "| key | unit | meaning | allowed | without it |",
        "|---|---|---|---|---|",
    ]
    rows: dict[tuple[str, ...], list[str]] = {}
    for path, key, needed in _keys("", schema):
        default = "refused" if needed else f"`{key['default']}`" if "default" in key else ""
        description = key.get("description", "").partition(" [")[0]
        cells = (key.get("unit", ""), description, _allowed(key), default)
        rows.setdefault((path.rpartition(".")[2], *cells), []).append(f"`{path}`")
    for (_, *others), paths in rows.items():
        cells = (", ".join(paths), *others)
        lines.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
    return "\n".join(lines) + "\n"


def _keys(start: str, schema: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], bool]]:
    """Yield path, schema and whether it is needed of every key of a table, tables inside it after their key."""
    for name, key in schema.get("properties", {}).items():
        yield f"{start}{name}", key, name in schema.get("required", ())
        inner, mark = key, "."
        if key.get("type") == "array":
            inner, mark = key["items"], "[]."
        elif isinstance(key.get("additionalProperties"), dict):
            inner, mark = key["additionalProperties"], ".NAME."
        yield from _keys(f"{start}{name}{mark}", inner)


def _allowed(schema: dict[str, Any]) -> str:
    """Return what a schema allows, in words."""
    if "anyOf" in schema:
        one, *others = schema["anyOf"]
        if others[0].get("items") == one and "minItems" in others[0]:
            return f"{_allowed(one)}, or {others[0]['minItems']} of them"
        return ", or ".join(map(_allowed, schema["anyOf"]))
    if not schema:
        return "numbers"
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    kind = schema["type"]
    if kind == "array":
        least, most = schema.get("minItems"), schema.get("maxItems")
        sizes = {
            (True, False): f" of at least {least}",
            (False, True): f" of at most {most}",
            (False, False): "",
        }
        count = f" of {least}" if least == most else f" of {least} to {most}"
        of = sizes.get((least is not None, most is not None), count)
        several = re.sub("^(whole number|number|list|table|text)", r"\1s", _allowed(schema.get("items", {})))
        return f"list{of or ' of'} {several}".replace("list of of", "list of")
    if kind == "object":
        if "properties" in schema:
            return "table"
        names = schema.get("propertyNames", {}).get("enum")
        return f"table of {', '.join(f'`{name}`' for name in names)}" if names else "table by name"
    if kind in ("string", "boolean"):
        return {"string": "text", "boolean": "`true`, `false`"}[kind]
    words = {"exclusiveMinimum": "above", "minimum": "from", "exclusiveMaximum": "below", "maximum": "to"}
    limits = "".join(f" {word} {float(schema[name]):.7g}" for name, word in words.items() if name in schema)
    return f"{'whole number' if kind == 'integer' else 'number'}{limits}"


def main() -> int:
    """Write the files that are out of step, and name them."""
    toml_models.FOLDER.mkdir(exist_ok=True)
    for path, text in files().items():
        if not path.is_file() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")
            print(path.relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main())
