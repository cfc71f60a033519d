"""A user's kernel in the catalogue: its head at hand, its formulas loaded when they are needed."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from strapgen.ir.notebook_display import full_text

if TYPE_CHECKING:
    from strapgen.ir.kernel_info import AttitudeStep
    from strapgen.kernel.kernel import Kernel, Stage


@dataclass(frozen=True)
class _Head:
    """The properties of a kernel that need none of its formulas."""

    name: str
    samples: int  # rows of its last input: of an attitude step all increments that it takes
    attitude_step: AttitudeStep | None  # of an attitude step
    brought: tuple[str, ...]  # names of the kernels that come with it
    text: str  # differs between different kernels; without their arguments
    unknowns: tuple[str, ...] = ()
    #: Samples from before and from after a step of velocity and position; None for any other kernel.
    beside: tuple[int, int] | None = None

    @classmethod
    def of(cls, kernel: Kernel) -> _Head:
        shape = kernel.inputs[-1].shape if kernel.inputs else ()
        brought = tuple(other.name for other in kernel.bundled_kernels)
        text = _text(replace(kernel, arguments=""))
        samples = shape[0] if shape else 1
        beside = (kernel.previous, kernel.ahead) if kernel.takes_velocity else None
        return cls(kernel.name, samples, kernel.attitude_step, brought, text, kernel.unknowns, beside)


class UserKernel:
    """A user's kernel, whose formulas may lie in the cache; equal to one with the same formulas and arguments."""

    def __init__(self, head: _Head, restore: Callable[[], Kernel], arguments: str | None = None) -> None:
        self.head, self.arguments = head, arguments
        self._restore = restore
        self._kernel: Kernel | None = None

    @classmethod
    def of(cls, kernel: Kernel) -> UserKernel:
        """Return a kernel that is at hand."""
        return cls(_Head.of(kernel), lambda: kernel, kernel.arguments)

    def with_arguments(self, arguments: str) -> UserKernel:
        """Return the same kernel with other arguments."""
        return UserKernel(self.head, self._restore, arguments)

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Coefficients without a value."""
        return self.head.unknowns

    @property
    def text(self) -> str:
        """Text that differs between different kernels, or the same with different arguments."""
        return f"{self.arguments} {self.head.text}"

    @property
    def kernel(self) -> Kernel:
        """The kernel with its formulas."""
        if self._kernel is None:
            kernel = self._restore()
            self._kernel = kernel if self.arguments is None else replace(kernel, arguments=self.arguments)
        return self._kernel

    def __eq__(self, other: object) -> bool:
        return isinstance(other, UserKernel) and self.text == other.text

    def __hash__(self) -> int:
        return hash(self.text)

    def __reduce__(self) -> tuple[Any, ...]:
        return UserKernel.of, (self.kernel,)


def packed(kernel: Kernel) -> bytes | None:
    """Return the head of a kernel as bytes; None if they hold something of SymPy, which takes long to import."""
    head = _Head.of(kernel)
    if b"sympy" in pickle.dumps(replace(head, text="")):
        return None
    return pickle.dumps(head)


def _text(kernel: Kernel) -> str:
    """Return a kernel as text, its formulas with the class of every part.

    SymPy's own text shows the number pi and a symbol of that name alike.
    """
    from sympy import srepr

    def shown(stages: tuple[Stage, ...]) -> str:
        return full_text([(s.signal, [srepr(x, order="none") for x in s.expressions]) for s in stages])

    rest = replace(kernel, stages=(), outputs=(), bundled_kernels=())
    return " ".join(
        [full_text(rest), shown(kernel.stages), shown(kernel.outputs), *map(_text, kernel.bundled_kernels)]
    )
