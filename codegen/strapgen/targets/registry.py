"""`TARGETS` has all targets by name: those here, and those that installed packages bring by an entry point.

A package's target has the name of its entry point in the group `GROUP`, and the value is a `Target`. It is imported
when it is used or listed, so that a package that is broken disturbs nobody else.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen.ir import checks, packages
from strapgen.ir.exceptions import InputError, StrapgenError
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.packages import entry_points
from strapgen.ir.sources import Sources
from strapgen.storage.cache import digest

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

    from strapgen.ir.integer_program import FixedProgram
    from strapgen.ir.program import Program

#: Entry points of installed packages.
GROUP = "strapgen.targets"


@dataclass(frozen=True)
class Target:
    """A kind of code: its printer, and the properties that others ask of it.

    Parameters
    ----------
    title : str
        One line that says what it is.
    emit : callable or str
        ``emit(program, name)`` prints a program as `Sources`; `name` is the target's. As a text, "module:function", it
        is imported when it is used.
    fixed : bool, optional
        Whether it takes a `FixedProgram`, which has settings of fixed point, and no `Program`.
    words : tuple of int, optional
        The lengths of word that it supports in fixed point, in bits; None stands for any.
    language : str, optional
        Language of the files: those in "C", "C++" and "Rust" are compiled, those in "Python" imported, and those
        in "MATLAB" run by Octave.
    number : str, optional
        Type of the numbers in floating point: "double" or "float".
    folder : str, optional
        Folder of the standard catalogue's tree that holds its files; "" if it is not in the tree.

    Raises
    ------
    InputError
        If a value is of another type.
    """

    title: str
    emit: Callable[[Any, str], Sources] | str
    fixed: bool = False
    words: tuple[int, ...] | None = None
    language: str = ""
    number: str = ""
    folder: str = ""

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for name in ("title", "language", "number", "folder"):
            checks.text(f"{name} of a Target", getattr(self, name))
        if not (callable(self.emit) or (isinstance(self.emit, str) and ":" in self.emit)):
            raise InputError(
                f"emit of a Target is {self.emit!r}; a function, or 'module:function', is needed"
            )

    @property
    def program(self) -> type[Program | FixedProgram]:
        """The class of the programs that it takes."""
        from strapgen.ir.integer_program import FixedProgram
        from strapgen.ir.program import Program

        return FixedProgram if self.fixed else Program

    @property
    def compiled(self) -> bool:
        """Whether a C compiler makes a module of its files."""
        return self.language == "C"

    @property
    def nameable(self) -> bool:
        """Whether a user can choose the name of its functions, whose loops stand in files of their own."""
        return self.language in ("C", "C++", "Rust", "MATLAB")

    def function(self) -> Callable[[Any, str], Sources]:
        """Return the function that prints a program, imported if it is a text."""
        if callable(self.emit):
            return self.emit
        module, _, name = self.emit.partition(":")
        loaded: Callable[[Any, str], Sources] = getattr(import_module(module), name)
        return loaded


#: The target that other back ends use for what is not theirs, such as the conversion of a state to a matrix.
NUMPY = "numpy"
_EMIT = f"{__name__.rpartition('.')[0]}.{{}}.emit:emit"
_FIXED = f"{__name__.rpartition('.')[0]}.{{}}.fixed:emit"
#: The targets of strapgen by name.
BUILT_IN = {
    NUMPY: Target(
        "numpy, vectorised over leading axes",
        _EMIT.format("numpy_code"),
        language="Python",
        number="double",
        folder="numpy",
    ),
    "c": Target("C99 in double", _EMIT.format("c"), language="C", number="double", folder="c"),
    "c-float": Target("C99 in float", _EMIT.format("c"), language="C", number="float", folder="c_float"),
    "c-fixed": Target(
        "C99 in fixed point: integers alone, error bounds certified",
        _EMIT.format("c_fixed"),
        fixed=True,
        words=(16, 32, 64),
        language="C",
        folder="c_fixed",
    ),
    "cpp": Target("C++17 in double: one header", _EMIT.format("cpp"), language="C++", number="double"),
    "cpp-float": Target("C++17 in float: one header", _EMIT.format("cpp"), language="C++", number="float"),
    "cpp-fixed": Target(
        "C++17 in fixed point: one header, constexpr, with the bits of the C",
        _FIXED.format("cpp"),
        fixed=True,
        words=(16, 32, 64),
        language="C++",
    ),
    "rust": Target("Rust in double: one module", _EMIT.format("rust"), language="Rust", number="double"),
    "rust-float": Target("Rust in float: one module", _EMIT.format("rust"), language="Rust", number="float"),
    "rust-fixed": Target(
        "Rust in fixed point: one module, no unsafe code, with the bits of the C",
        _FIXED.format("rust"),
        fixed=True,
        words=(16, 32, 64),
        language="Rust",
    ),
    "matlab": Target(
        "MATLAB and GNU Octave in double: one function file",
        _EMIT.format("matlab"),
        language="MATLAB",
        number="double",
    ),
    "fixed-model": Target(  # a reference that tests generate: it is not in the tree
        "Python on integers, bit for bit what the fixed-point C computes",
        _EMIT.format("integer_model"),
        fixed=True,
        language="Python",
    ),
}


class _Targets(Mapping[str, Target]):
    """The targets of strapgen, then those of entry points, each imported when it is looked up."""

    __repr__ = short_repr

    def _in_words(self) -> str:
        return ", ".join(self)

    def __getitem__(self, name: str) -> Target:
        if name in BUILT_IN:
            return BUILT_IN[name]
        return _loaded(_point(name))[0]

    def __contains__(self, name: object) -> bool:
        return name in BUILT_IN or any(point.name == name for point in entry_points(group=GROUP))

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys([*BUILT_IN, *(point.name for point in entry_points(group=GROUP))]))

    def __len__(self) -> int:
        return len(list(iter(self)))


#: Targets by name; looking up one of an entry point that cannot be used raises an `InputError`.
TARGETS: Mapping[str, Target] = _Targets()


def titles() -> dict[str, str]:
    """Return a line on every target by name; of an entry point that cannot be used the line says why."""
    lines = {name: target.title for name, target in BUILT_IN.items()}
    for point in entry_points(group=GROUP):
        if point.name in BUILT_IN:
            lines[_label(point)] = (
                f"cannot be used: strapgen has a target {point.name}; another name is needed"
            )
            continue
        try:
            lines[point.name] = TARGETS[point.name].title
        except StrapgenError as error:
            lines[point.name] = f"cannot be used: {error}"
    return lines


def identity(name: str) -> str:
    """Return a hash of the code of an entry point's target; "" for one of strapgen, whose code is the generator's."""
    return "" if name in BUILT_IN else _loaded(_point(name))[1]


def run(name: str, program: Program | FixedProgram) -> Sources:
    """Return a program as a target prints it; an InputError names an entry point whose code fails."""
    function = TARGETS[name].function
    if name in BUILT_IN:
        return function()(program, name)
    point = _point(name)
    label = f"target {_label(point)}"
    with packages.guarded(label, "return Sources", packages.belongs_to(point.module)):
        sources = function()(program, name)
    if not isinstance(sources, Sources):
        raise InputError(f"{label}: emit returned {type(sources).__name__}; strapgen.Sources are needed")
    for file, text in sources.files.items():
        if Path(file).name != file or not isinstance(text, str):
            raise InputError(
                f"{label}: emit returned a file {file!r}; names without a folder, and texts, are needed"
            )
    return replace(sources, target=name)


def _point(name: str) -> EntryPoint:
    """Return the entry point of a name."""
    points = {point.value: point for point in entry_points(group=GROUP) if point.name == name}
    if not points:
        raise KeyError(name)
    if len(points) > 1:
        raise InputError(
            f"target {name} is in several packages: {', '.join(sorted(points))}; one may have it"
        )
    (point,) = points.values()
    return point


def _label(point: EntryPoint) -> str:
    return f"{point.name} ({point.value})"


@cache
def _loaded(point: EntryPoint) -> tuple[Target, str]:
    """Return the target of an entry point and the hash of its code as it is when it is imported.

    The code is all files of its package, the version of its distribution, and all else that this installed.
    """
    label = f"target {_label(point)}"
    if not point.pattern.match(point.value):
        raise InputError(f"{label}: the entry point is no 'module:name'")
    code = digest([point.value, *packages.contents(point.module), *packages.installed_with(point)])
    with packages.guarded(label, "define a Target", packages.belongs_to(point.module)):
        try:
            target = point.load()
        except StrapgenError as error:
            raise InputError(f"{label}: {error}") from error
    if not isinstance(target, Target):
        raise InputError(f"{label} is of type {type(target).__name__}; a strapgen.Target is needed")
    return target, code
