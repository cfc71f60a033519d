"""A `Registry` maps names to the objects of one kind that strapgen and installed packages register."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Iterator, Mapping
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from strapgen.ir import packages
from strapgen.ir.exceptions import InputError, StrapgenError
from strapgen.ir.notebook_display import names_table, short_repr
from strapgen.registration import KINDS, built_in, loaded, read, table

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

T = TypeVar("T")

#: So many names are shown, and of more their number.
_FEW = 30


class Item(NamedTuple):
    """The object that an installed package registers under a name: entry point, place, and value once loaded."""

    point: EntryPoint
    place: str
    record: Callable[[], Any]


class Names(Mapping[str, T], Generic[T]):
    """Values by name: the names complete as keys in IPython, which shows them as a table with their titles.

    >>> print(Merged({"dcm": "direction cosine matrix", "euler": "Euler parameters"}))
    dcm    direction cosine matrix
    euler  Euler parameters
    """

    __repr__ = short_repr

    def _in_words(self) -> str:
        return ", ".join(self)

    def __str__(self) -> str:
        return str(names_table(Titles(self)).as_text())

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        printer.text(str(self))

    def _repr_html_(self) -> str:
        return str(names_table(Titles(self)).as_html())

    def _ipython_key_completions_(self) -> list[str]:
        return list(self)


class _BuiltIn(Names[T]):
    """The objects of a kind that strapgen itself registers, by name."""

    def __init__(self, kind: str, keep: Callable[[Any], bool] | None, first: str) -> None:
        self._kind, self._keep, self._first = kind, keep, first

    def _in_words(self) -> str:
        return ", ".join(self) if len(self) <= _FEW else f"{len(self)} {self._kind}"

    @cached_property
    def _records(self) -> dict[str, T]:
        places = [place for one in built_in().values() for place in getattr(one, self._kind)]
        records = [pair for place in places for pair in table(self._kind, place).items()]
        records.sort(key=lambda pair: pair[0] != self._first)
        return {name: record for name, record in records if self._keep is None or self._keep(record)}

    def __getitem__(self, name: str) -> T:
        return self._records[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._records)

    def __len__(self) -> int:
        return len(self._records)


class Registry(Names[T]):
    """The objects of a kind by name: those of strapgen, then those of installed packages.

    Looking up a name of a package that cannot be used raises an `InputError`; another name is not disturbed by it.

    Parameters
    ----------
    kind : str
        A key of `KINDS`.
    record : type
        The class of the records.
    keep : callable, optional
        ``keep(record)`` returns whether a record belongs here; by default all do.
    group : str, optional
        A group of entry points, each of which brings one record under its own name.
    first : str, optional
        The name that stands before all others.

    Attributes
    ----------
    own : mapping
        What strapgen's folders bring.
    """

    def __init__(
        self,
        kind: str,
        record: type[T],
        keep: Callable[[Any], bool] | None = None,
        group: str = "",
        first: str = "",
    ) -> None:
        self.own: _BuiltIn[T] = _BuiltIn(kind, keep, first)
        self._kind, self._record, self._keep, self._group = kind, record, keep, group

    def _in_words(self) -> str:
        return self.own._in_words()

    def _items(self) -> Iterator[tuple[str, Item]]:
        """Yield the objects of installed packages by name; entry points of the group are imported when used."""
        for point, one in read():
            for place in getattr(one, self._kind, ()):
                table = loaded(point, place, self._kind)
                for name, record in table.items() if isinstance(table, Mapping) else ():
                    if self._keep is None or self._keep(record):
                        yield name, Item(point, place, lambda record=record: record)  # type: ignore[misc]
        for point in packages.entry_points(self._group) if self._group else ():
            yield point.name, Item(point, point.value, lambda point=point: loaded(point, point.value))  # type: ignore[misc]

    def item(self, name: str) -> Item | None:
        """Return the object of an installed package by name; None for a name of strapgen or an unknown one."""
        if name in self.own:
            return None
        items = {item.place: item for other, item in self._items() if other == name}
        if len(items) > 1:
            raise InputError(
                f"{KINDS[self._kind]} {name} is in several packages: {', '.join(sorted(items))}; one may have it"
            )
        return next(iter(items.values()), None)

    def __getitem__(self, name: str) -> T:
        if name in self.own:
            return self.own[name]
        item = self.item(name)
        if item is None:
            raise KeyError(name)
        record: T | InputError = item.record()
        if isinstance(record, InputError):
            raise record
        if not isinstance(record, self._record):
            raise InputError(
                f"{KINDS[self._kind]} {name} ({item.place}) is of type {type(record).__name__}; "
                f"a {self._record.__module__}.{self._record.__name__} is needed"
            )
        return record

    def __contains__(self, name: object) -> bool:
        return name in self.own or any(other == name for other, _ in self._items())

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys([*self.own, *(name for name, _ in self._items())]))

    def __len__(self) -> int:
        return len(list(iter(self)))

    def taken(self) -> dict[str, str]:
        """Return a line for each name of an installed package that strapgen uses already."""
        why = f"cannot be used: strapgen has a {KINDS[self._kind]} {{}}; another name is needed"
        return {f"{n} ({item.place})": why.format(n) for n, item in self._items() if n in self.own}

    def code(self, name: str) -> str:
        """Return a hash of the code of an installed package's object; "" for one of strapgen or an unknown one."""
        item = self.item(name)
        return "" if item is None else _code(item.point)

    def guarded(self, name: str, duty: str) -> Any:
        """Run code of an installed package; its failure becomes an error message of one line."""
        item = self.item(name)
        if item is None:
            return contextlib.nullcontext()
        label = f"{KINDS[self._kind]} {name} ({item.place})"
        return packages.guarded(label, duty, packages.belongs_to(item.point.module))


class Titles(Mapping[str, str]):
    """A line for every name of a mapping: its title, or the reason why it cannot be used."""

    def __init__(self, records: Mapping[str, Any], line: Callable[[str, Any], str] | None = None) -> None:
        self._records, self._line = records, line

    def __getitem__(self, name: str) -> str:
        try:
            record = self._records[name]
            if self._line is not None:
                return self._line(name, record)
            return record if isinstance(record, str) else str(record.title)
        except StrapgenError as error:
            return f"cannot be used: {error}"

    def __contains__(self, name: object) -> bool:
        return name in self._records

    def __iter__(self) -> Iterator[str]:
        return iter(self._records)

    def __len__(self) -> int:
        return len(self._records)


@cache
def _code(point: EntryPoint) -> str:
    """Return a hash of all files of an entry point's package, and of what else its distribution installed."""
    parts = [point.value, *packages.contents(point.module), *packages.installed_with(point)]
    return hashlib.sha256(repr(parts).encode()).hexdigest()


class Merged(Names[T]):
    """Several mappings as one; the first that has a name gives its value. The first of all is `own`."""

    def __init__(self, *parts: Mapping[str, T]) -> None:
        self.own: Mapping[str, T] = parts[0]
        self._parts = parts

    def __getitem__(self, name: str) -> T:
        for part in self._parts:
            if name in part:
                return part[name]
        raise KeyError(name)

    def __contains__(self, name: object) -> bool:
        return any(name in part for part in self._parts)

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys(name for part in self._parts for name in part))

    def __len__(self) -> int:
        return len(list(iter(self)))
