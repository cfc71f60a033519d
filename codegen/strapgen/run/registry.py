"""`BACKENDS` lists the back ends by name, and functions here load their classes when they are needed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

from strapgen import applications
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import short_repr
from strapgen.targets import BUILT_IN

if TYPE_CHECKING:
    from strapgen.ir.sources import Sources
    from strapgen.run.evaluators import Evaluator


class Entry(NamedTuple):
    """A back end of the table.

    Parameters
    ----------
    title : str
        One line that says what it is.
    target : str
        The target whose text it runs; a name that is no target where it runs the program itself.
    evaluator : str
        The class that runs a kernel, and the loop over its steps, "module:name".
    word : int or None
        Bits of a word in fixed point; None where the user chooses them, or in floating point.
    slow : bool
        Whether Python executes every single operation. A run on all back ends leaves such a one out by default.
    many_digits : bool
        Whether it computes in so many digits that rounding cannot be seen; the class then has methods that return them.
    by_default : bool
        Whether a run on all back ends takes it by default; not those that compute the bits of another back end.
    """

    title: str
    target: str
    evaluator: str
    word: int | None = None
    slow: bool = False
    many_digits: bool = False
    by_default: bool = True

    @property
    def fixed(self) -> bool:
        """Whether it computes in fixed point, and so takes settings."""
        return self.target in BUILT_IN and BUILT_IN[self.target].fixed


_C = "strapgen.run.c:CEvaluator"

#: Other names of back ends, which every command takes too.
ALIASES = {"c-q31": "c-fixed32", "c-q15": "c-fixed16"}


class _Backends(Mapping[str, Entry]):
    """Back ends by name; one can be looked up by its other name, too."""

    __repr__ = short_repr

    def _in_words(self) -> str:
        return ", ".join(self)

    def __init__(self, entries: Mapping[str, Entry]) -> None:
        self._entries = entries

    def __getitem__(self, name: str) -> Entry:
        return self._entries[ALIASES.get(name, name)]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)


#: Back ends by name.
BACKENDS: Mapping[str, Entry] = _Backends(
    {
        "numpy": Entry(
            "generated numpy code in double",
            "numpy",
            "strapgen.run.numpy_evaluator:NumpyEvaluator",
        ),
        "c": Entry("generated C in double, compiled", "c", _C),
        "c-float": Entry("generated C in float, compiled", "c-float", _C),
        "c-fixed32": Entry("generated C in 32-bit fixed point, compiled", "c-fixed", _C, word=32),
        "c-fixed16": Entry("generated C in 16-bit fixed point, compiled", "c-fixed", _C, word=16),
        "cpp": Entry("generated C++ in double, compiled", "cpp", _C, by_default=False),
        "cpp-float": Entry("generated C++ in float, compiled", "cpp-float", _C, by_default=False),
        "cpp-fixed32": Entry(
            "generated C++ in 32-bit fixed point, compiled",
            "cpp-fixed",
            _C,
            word=32,
            by_default=False,
        ),
        "rust": Entry("generated Rust in double, compiled", "rust", _C, by_default=False),
        "rust-float": Entry("generated Rust in float, compiled", "rust-float", _C, by_default=False),
        "rust-fixed32": Entry(
            "generated Rust in 32-bit fixed point, compiled",
            "rust-fixed",
            _C,
            word=32,
            by_default=False,
        ),
        "octave": Entry(
            "generated MATLAB in double, run by GNU Octave",
            "matlab",
            "strapgen.run.octave:OctaveEvaluator",
            by_default=False,
        ),
        "fixed-model": Entry(
            "integer model of the fixed-point C in Python, any word",
            "fixed-model",
            "strapgen.run.fixed:ModelEvaluator",
            slow=True,
        ),
        "exact": Entry(
            "arithmetic of 40 digits in Python, rounded to double at the end",
            "exact",
            "strapgen.run.exact:ExactEvaluator",
            slow=True,
            many_digits=True,
        ),
    }
)

#: Back ends on which an experiment runs by default.
DEFAULT_BACKENDS = tuple(name for name, entry in BACKENDS.items() if entry.by_default and not entry.slow)


def _of_target(target: str) -> Entry:
    for entry in BACKENDS.values():
        if entry.target == target:
            return entry
    runnable = ", ".join(dict.fromkeys(e.target for e in BACKENDS.values() if e.target in BUILT_IN))
    raise InputError(f"no back end runs code for target {target}; those for these targets run: {runnable}")


def evaluator_class(target: str) -> Callable[[Sources], Evaluator]:
    """Return the class that runs a kernel for a target."""
    loaded: Callable[[Sources], Evaluator] = applications.load(_of_target(target).evaluator)
    return loaded


def of_sources(sources: Sources) -> Evaluator:
    """Return any kernel as a callable from its sources."""
    return evaluator_class(sources.target)(sources)
