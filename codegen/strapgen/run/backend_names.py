"""The back ends by name, as plain data: listing them imports none of their classes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from strapgen import registration, targets
from strapgen.ir.exceptions import InputError
from strapgen.registry import Registry
from strapgen.targets import TARGETS

if TYPE_CHECKING:
    from strapgen.ir.sources import Sources
    from strapgen.run.evaluators import Evaluator


class Entry(NamedTuple):
    """A back end of the table."""

    title: str  # one line that says what it is
    target: str  # the target whose text it runs; a name that is no target where it runs the program itself
    evaluator: str  # the class that runs a kernel, and the loop over its steps, "module:name"
    word: int | None = None  # bits in fixed point; None where the user chooses them, or in floating point
    #: Whether Python executes every single operation. A run on all back ends leaves such a one out by default.
    slow: bool = False
    #: Whether it computes in so many digits that rounding cannot be seen; the class has methods that return them.
    many_digits: bool = False
    #: Whether a run on all back ends takes it by default; not those that compute the bits of another back end.
    by_default: bool = True

    @property
    def fixed(self) -> bool:
        """Whether it computes in fixed point, and so takes settings."""
        target = TARGETS.get(self.target)
        return target is not None and target.fixed


_C = f"{__package__}.compiled_code:CEvaluator"

#: The back ends of strapgen by name.
BUILT_IN = {
    "numpy": Entry(
        "generated numpy code in double",
        "numpy",
        f"{__package__}.numpy_evaluator:NumpyEvaluator",
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
        f"{__package__}.octave:OctaveEvaluator",
        by_default=False,
    ),
    "fixed-model": Entry(
        "integer model of the fixed-point C in Python, any word",
        "fixed-model",
        f"{__package__}.compiled_code:ModelEvaluator",
        slow=True,
    ),
    "exact": Entry(
        "arithmetic of 40 digits in Python, rounded to double at the end",
        "exact",
        f"{__package__}.exact:ExactEvaluator",
        slow=True,
        many_digits=True,
    ),
}

#: Other names of back ends, which every command takes too.
ALIASES = {"c-q31": "c-fixed32", "c-q15": "c-fixed16"}


class _Backends(Registry[Entry]):
    """Back ends by name; one can be looked up by its other name, too."""

    def __getitem__(self, name: str) -> Entry:
        return super().__getitem__(ALIASES.get(name, name))

    def __contains__(self, name: object) -> bool:
        return super().__contains__(ALIASES.get(str(name), name))


#: Back ends by name.
BACKENDS = _Backends("backends", Entry)

#: Back ends on which an experiment runs by default.
DEFAULT_BACKENDS = tuple(name for name, entry in BACKENDS.own.items() if entry.by_default and not entry.slow)


def evaluator_class(target: str) -> Callable[[Sources], Evaluator]:
    """Return the class that runs a kernel for a target."""
    for entry in BACKENDS.values():
        if entry.target == target:
            loaded: Callable[[Sources], Evaluator] = registration.load(entry.evaluator)
            return loaded
    runnable = ", ".join(
        dict.fromkeys(e.target for e in BACKENDS.own.values() if e.target in targets.BUILT_IN)
    )
    raise InputError(f"no back end runs code for target {target}; those for these targets run: {runnable}")


def of_sources(sources: Sources) -> Evaluator:
    """Return any kernel as a callable from its sources."""
    return evaluator_class(sources.target)(sources)
