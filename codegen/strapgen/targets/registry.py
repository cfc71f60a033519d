"""`TARGETS` has all targets by name: those of the folders here, and those of installed packages.

A package brings targets in a table of its registration, or one by an entry point of the group `GROUP` whose value is
the `Target`. It is imported when it is used or listed, so that a package that is broken disturbs nobody else.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.sources import Sources
from strapgen.registration import load
from strapgen.registry import Registry, Titles

if TYPE_CHECKING:
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

    Examples
    --------
    >>> from strapgen import TARGETS
    >>> TARGETS["c-fixed"].fixed, TARGETS["c-fixed"].language
    (True, 'C')
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
        function: Callable[[Any, str], Sources] = load(self.emit)
        return function


#: The target that other back ends use for what is not theirs, such as the conversion of a state to a matrix.
NUMPY = "numpy"

#: Targets by name; looking up one of an installed package that cannot be used raises an `InputError`.
TARGETS = Registry("targets", Target, group=GROUP, first=NUMPY)
#: The targets of strapgen by name.
BUILT_IN: Mapping[str, Target] = TARGETS.own


def titles() -> dict[str, str]:
    """Return a line on every target by name; of one of an installed package that cannot be used the line says why."""
    return {**Titles(TARGETS), **TARGETS.taken()}


def run(name: str, program: Program | FixedProgram) -> Sources:
    """Return a program as a target prints it; an InputError names an entry point whose code fails."""
    function = TARGETS[name].function
    item = TARGETS.item(name)
    if item is None:
        return function()(program, name)
    label = f"target {name} ({item.place})"
    with TARGETS.guarded(name, "return Sources"):
        sources = function()(program, name)
    if not isinstance(sources, Sources):
        raise InputError(f"{label}: emit returned {type(sources).__name__}; strapgen.Sources are needed")
    for file, text in sources.files.items():
        if Path(file).name != file or not isinstance(text, str):
            raise InputError(
                f"{label}: emit returned a file {file!r}; names without a folder, and texts, are needed"
            )
    return replace(sources, target=name)
