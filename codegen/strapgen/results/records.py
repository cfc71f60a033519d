"""Records: dataclasses whose fields say how they are written, as plain data, as rows of tables and as JSON Schema."""

from __future__ import annotations

import dataclasses
import inspect
import re
import sys
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeAlias

from strapgen.results.table import Column, TextTable

#: Units by the ends of names that state them, the longest first.
UNITS = {
    "rad_sample": "rad/sample",
    "rad_step": "rad/step",
    "deg_sqrt_h": "deg/sqrt(h)",
    "deg_h": "deg/h",
    "deg_s": "deg/s",
    "rad_s": "rad/s",
    "m_s2": "m/s^2",
    "m_s": "m/s",
    "ns_per_step": "ns",
    "per_sample": "1/sample",
    "per_s": "1/s",
    "arcsec": "arcsec",
    "bytes": "B",
    "seconds": "s",
    "hours": "h",
    "ulp": "ulp",
    "rad": "rad",
    "deg": "deg",
    "hz": "Hz",
    "db": "dB",
    "s": "s",
    "m": "m",
}
#: Digits of the numbers of a table whose field states no format.
_DIGITS = ".6g"
_METADATA = "entry"


@dataclass(frozen=True)
class Entry:
    """How a field is written."""

    #: The column of a table for a reader; None where such a table leaves it out
    column: Column | None = None
    #: Unit of a number; by default the one that the name ends with
    unit: str = ""
    #: One sentence; by default the comment above the field, or what the docstring of the class says of it
    meaning: str = ""
    #: Name in data; by default that of the field
    key: str = ""
    #: Type of what is written, in place of the annotation
    kind: Any = None
    #: Returns what is written of a value that is not None
    write: Callable[[Any], Any] | None = None
    #: Returns the cell of a table for a reader
    cell: Callable[[Any], Any] | None = None
    #: Left out if the value is None
    optional: bool = False
    #: The parts of a record or a mapping stand beside the other fields; for None they are null
    spread: bool = False
    #: A table for programs has a column for each part of a mapping
    split: bool = False
    #: Part of the record in Python alone
    internal: bool = False


def entry(
    header: str | None = None,
    spec: str = "",
    *,
    align: str = ">",
    group: str = "",
    missing: str = "-",
    least: int = 0,
    **more: Any,
) -> Mapping[str, Entry]:
    """Return the metadata of a field: a column for a reader, and what `Entry` has besides."""
    column = None if header is None else Column(header, align, spec, least, missing=missing, group=group)
    return {_METADATA: Entry(column, **more)}


#: Metadata of a field that no format writes.
INTERNAL = {_METADATA: Entry(internal=True)}


#: Properties that a record writes, with their metadata.
Properties: TypeAlias = Mapping[str, Mapping[str, Entry]]


def properties(**metadata: Mapping[str, Entry]) -> Properties:
    """Return the properties that a record writes, with their metadata."""
    return metadata


class Record:
    """A dataclass as plain data; `computed` has the metadata of the properties that are written after its fields."""

    computed: ClassVar[Properties] = {}

    def as_dict(self) -> dict[str, Any]:
        """Return the record as plain JSON data."""
        return plain_record(self)


def entries(kind: type) -> dict[str, Entry]:
    """Return how a dataclass is written, by name: its fields, then the properties that it has in `computed`."""
    metadata = {one.name: one.metadata for one in dataclasses.fields(kind)} | getattr(kind, "computed", {})
    return {name: one.get(_METADATA, Entry()) for name, one in metadata.items()}


def plain_record(record: Any) -> dict[str, Any]:
    """Return a dataclass as an object of plain JSON data."""
    data: dict[str, Any] = {}
    for name, one in entries(type(record)).items():
        value = None if one.internal else getattr(record, name)
        written = value if one.write is None or value is None else one.write(value)
        if one.internal or (one.optional and written is None):
            continue
        if not one.spread:
            data[one.key or name] = plain(written)
        else:
            data |= plain(written) if written is not None else dict.fromkeys(entries(one.kind))
    return data


def plain(value: Any) -> Any:
    """Return a value as plain JSON data; exact numbers, expressions and paths are text."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if dataclasses.is_dataclass(value):
        return plain_record(value)
    if isinstance(value, Mapping):
        return {str(key): plain(part) for key, part in value.items()}
    if hasattr(value, "_asdict"):
        return plain(value._asdict())
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Iterable) and not hasattr(value, "free_symbols"):
        return [plain(part) for part in value]
    return str(value)


# Tables


def keyed_table(rows: Sequence[Any]) -> TextTable:
    """Return records, or objects of JSON, as a table: a row for each, a column for each key, numbers in full."""
    objects = [row if isinstance(row, Mapping) else _split(row) for row in rows]
    names = list(dict.fromkeys(name for row in objects for name in row))
    values = [[_cell(row.get(name)) for name in names] for row in objects]
    columns = []
    for place, name in enumerate(names):
        kinds = {type(row[place]) for row in values}
        columns.append(Column(name, "<" if str in kinds else ">", _DIGITS if float in kinds else ""))
    return TextTable(columns, values)


def _split(record: Any) -> dict[str, Any]:
    """Return the data of a record with the parts of what is split beside the rest."""
    split = [one.key or name for name, one in entries(type(record)).items() if one.split]
    data: dict[str, Any] = {}
    for name, value in plain_record(record).items():
        data |= value if name in split else {name: value}
    return data


def _cell(value: Any) -> Any:
    """Return a value of JSON as one cell: the parts of an object or a list stand one after the other."""
    if isinstance(value, Mapping):
        return " ".join(f"{key}={part}" for key, part in value.items())
    return " ".join(map(str, value)) if isinstance(value, list | tuple) else value


def reader_table(rows: Sequence[Any], kind: type, *names: str, units: bool = False) -> TextTable:
    """Return records of a kind as a table for a reader: the columns of its fields, or of some in an order.

    `units`: whether headers have their units, where nothing beside the table states them.
    """
    known = entries(kind)
    shown = [
        (name, one, one.column)
        for name, one in ((name, known[name]) for name in names or known)
        if one.column is not None
    ]
    cells = [
        [
            value if one.cell is None else one.cell(value)
            for value, (_, one, _) in zip(row, shown, strict=True)
        ]
        for row in ([getattr(record, name) for name, _, _ in shown] for record in rows)
    ]
    columns = [
        _with_unit(column, one.unit or unit_of(name)) if units else column for name, one, column in shown
    ]
    return TextTable(columns, cells)


def _with_unit(column: Column, unit: str) -> Column:
    """Return a column whose header states the unit."""
    if unit.lower() in column.header.lower():
        return column
    return replace(column, header=f"{column.header}, {unit}")


# JSON Schema


def record_schema(kind: type) -> dict[str, Any]:
    """Return the JSON Schema of a dataclass as `plain_record` writes it, without references."""
    properties: dict[str, Any] = {}
    required: list[str] = []
    more: Any = None
    meanings = _meanings(kind)
    for name, one in entries(kind).items():
        if one.internal:
            continue
        schema = type_schema(one.kind if one.kind is not None else _annotation(kind, name))
        if one.spread and "properties" in schema:
            properties |= schema["properties"]
            required += [] if one.optional else schema["required"]
            continue
        if one.spread:
            more = schema.get("additionalProperties", True)
            continue
        key = one.key or name
        unit = one.unit or (unit_of(key) if _is_number(schema) else "")
        words = {"title": _title(key, unit)}
        if meaning := one.meaning or meanings.get(name, ""):
            words["description"] = meaning
        if unit:
            words["unit"] = unit
        properties[key] = words | schema
        if not one.optional:
            required.append(key)
    result: dict[str, Any] = {
        "type": "object",
        "properties": properties,
        "required": list(dict.fromkeys(required)),
    }
    return result if more is None else result | {"additionalProperties": more}


def type_schema(kind: Any) -> dict[str, Any]:
    """Return the JSON Schema of a type as `plain` writes its values."""
    kind = _meant(kind)
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        schemas = [type_schema(part) for part in parts]
        if all([*one] == ["type"] and isinstance(one["type"], str) for one in schemas):
            return {"type": list(dict.fromkeys(one["type"] for one in schemas))}
        return {"anyOf": schemas}
    if origin is Literal:
        return {"enum": list(parts)}
    if origin is typing.Annotated:
        return type_schema(parts[0])
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return {"type": "object", "additionalProperties": type_schema(parts[1])}
    if isinstance(origin, type) and origin.__name__ == "ndarray":
        return {"type": "array", "items": {"type": ["number", "array"]}}
    if origin is tuple and parts[-1] is not Ellipsis:
        items = [type_schema(part) for part in parts]
        return {"type": "array", "prefixItems": items, "minItems": len(items), "maxItems": len(items)}
    if isinstance(origin, type) and issubclass(origin, Iterable):
        return {"type": "array", "items": type_schema(parts[0])}
    return _plain_type_schema(kind)


def _meant(kind: Any) -> Any:
    """Return what a name of the statement ``type`` stands for, such as NDArray of NumPy 2.5, or the type as it is."""
    name, parts = typing.get_origin(kind) or kind, typing.get_args(kind)
    if not hasattr(name, "__value__"):
        return kind
    return _meant(name.__value__[parts] if parts else name.__value__)


def _plain_type_schema(kind: Any) -> dict[str, Any]:
    """Return the JSON Schema of a type without parameters."""
    if kind is Any:
        return {}
    if dataclasses.is_dataclass(kind):
        return record_schema(typing.cast(type, kind))
    if hasattr(kind, "_fields"):  # of a named tuple
        hints = typing.get_type_hints(kind)
        properties = {name: {"title": name} | type_schema(hints[name]) for name in kind._fields}
        return {"type": "object", "properties": properties, "required": list(kind._fields)}
    names = {
        bool: "boolean",
        int: "integer",
        float: "number",
        str: "string",
        type(None): "null",
        None: "null",
    }
    texts = (Fraction, Path)
    if kind in names:
        return {"type": names[kind]}
    if kind in texts or hasattr(kind, "free_symbols"):
        return {"type": "string"}
    raise TypeError(f"{kind} has no JSON Schema; the field's entry needs a kind")


def _is_number(schema: Mapping[str, Any]) -> bool:
    """Return whether a schema has numbers at its ends, which may have a unit."""
    kinds = schema.get("type", ())
    ends = [kinds] if isinstance(kinds, str) else kinds
    if "number" in ends or "integer" in ends:
        return True
    inner = [schema[key] for key in ("items", "additionalProperties") if isinstance(schema.get(key), dict)]
    return any(map(_is_number, [*inner, *schema.get("prefixItems", ())]))


def _title(key: str, unit: str) -> str:
    """Return the words of a key without its unit."""
    end = next((end for end, one in UNITS.items() if one == unit and key.endswith(f"_{end}")), "")
    return key.removesuffix(f"_{end}").replace("_", " ")


def unit_of(name: str) -> str:
    """Return the unit that the end of a name states; "" for none."""
    return next((unit for end, unit in UNITS.items() if name == end or name.endswith(f"_{end}")), "")


def _annotation(kind: type, name: str) -> Any:
    """Return the type of a field or of a property."""
    for one in kind.__mro__:
        found, text = vars(one).get(name), inspect.get_annotations(one).get(name)
        getter = getattr(found, "fget", getattr(found, "func", None))  # of a property, or a cached one
        if getter is not None:
            text = getter.__annotations__["return"]
        if text is not None:
            return eval(text, vars(sys.modules[one.__module__])) if isinstance(text, str) else text
    raise TypeError(f"{kind.__name__} has no field {name} with a type")


def _meanings(kind: type) -> dict[str, str]:
    """Return the descriptions of fields: from numpydoc, comments "#:", or docstrings of properties."""
    meanings: dict[str, str] = {}
    for one in reversed(kind.__mro__):
        if not dataclasses.is_dataclass(one):
            continue
        docstring = inspect.getdoc(one) or ""
        parameters = docstring.partition("Parameters\n----------\n")[2].partition("\n\n")[0]
        for names, text in re.findall(r"^(\w[^:\n]*) : .*\n((?: +.*\n?)*)", f"{parameters}\n", re.MULTILINE):
            meanings |= dict.fromkeys(re.split(r", ", names), " ".join(text.split()))
        try:
            source = inspect.getsource(one)
        except OSError:
            continue
        for comment, name in re.findall(r"((?:^ +#: .*\n)+) +(\w+):", source, re.MULTILINE):
            meanings[name] = " ".join(re.sub(r"^ +#:", "", comment, flags=re.MULTILINE).split())
    for name in getattr(kind, "computed", ()):
        meanings[name] = (inspect.getdoc(inspect.getattr_static(kind, name)) or "").partition("\n\n")[0]
    return {name: text.replace("`", "") for name, text in meanings.items() if text}
