"""A choice says which kernel to derive. `choose` returns it, and all later stages take it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

from strapgen.catalogue.constants import Constants, options
from strapgen.catalogue.method_names import INTEGRATORS, named_method
from strapgen.catalogue.methods.method_spec import MethodSpec
from strapgen.catalogue.methods.window import Window
from strapgen.catalogue.names import KERNELS, LAYOUT_KERNELS
from strapgen.catalogue.user_kernel import UserKernel
from strapgen.ir.kernel_info import Description
from strapgen.ir.notebook_display import full_text, short_repr

if TYPE_CHECKING:
    from strapgen.kernel.kernel import Kernel


#: What chooses a method: its name, or the value that holds its coefficients.
AnyMethod: TypeAlias = str | MethodSpec


@dataclass(frozen=True)
class Choice:
    """The choice of a kernel, with everything that its derivation needs.

    Parameters
    ----------
    name : str
        Name of the algorithm or kernel; of a user's the name of its kernel.
    method : str, Tableau, Window or ShapedConing, optional
        Method of an attitude step of the catalogue, or of a vector of one.
    increments : int, optional
        Increments of a step. A step of the catalogue without increments takes the body rate at every node of its
        method.
    previous, ahead : int, optional
        Numbers of increments from before the step and from after it that it takes in addition to its own.
    user_kernel : UserKernel, optional
        A user's kernel itself, with the kernels that it brings; None for one of the catalogue.
    constants : tuple of (str, tuple of Fraction), optional
        Inputs that are constants, sorted by name, each with its numbers in row-major order; of kernels that are no
        attitude steps.
    layout : Description, optional
        What a file describes for the kernel, such as the gyros whose rate and acceleration it separates.
    """

    name: str
    method: AnyMethod | None = None
    increments: int | None = None
    previous: int = 0
    ahead: int = 0
    # Equality compares the kernels; the hash leaves them out, because most choices differ in name or numbers.
    user_kernel: UserKernel | None = field(default=None, hash=False, repr=False)
    constants: Constants = ()
    layout: Description | None = None

    __repr__ = short_repr

    @classmethod
    def of_user(cls, kernel: Kernel | UserKernel) -> Choice:
        """Return the choice of a user's kernel: an attitude step, or a kernel that comes with one."""
        user_kernel = kernel if isinstance(kernel, UserKernel) else UserKernel.of(kernel)
        head = user_kernel.head
        beside, step = head.beside, head.attitude_step
        if step is not None and not step.nodes:
            beside = step.previous, step.ahead
        if beside is None:
            return cls(head.name, user_kernel=user_kernel)
        previous, ahead = beside
        increments = head.samples - previous - ahead
        return cls(head.name, None, increments, previous, ahead, user_kernel)

    @property
    def takes_velocity(self) -> bool:
        """Whether it is a step of velocity and position, from increments of both kinds."""
        if self.user_kernel is not None:
            return self.user_kernel.head.beside is not None
        return self.name == "velocity-position"

    @property
    def method_spec(self) -> MethodSpec | None:
        """The method, also where `method` is a name."""
        return None if self.method is None else named_method(self.method)

    @property
    def method_name(self) -> str | None:
        """Name of the method."""
        spec = self.method_spec
        return None if spec is None else spec.name

    @property
    def window(self) -> Window | None:
        """The window, if the method is one."""
        spec = self.method_spec
        return spec if isinstance(spec, Window) else None

    @property
    def kernel(self) -> str:
        """Name of the kernel."""
        if self.layout is not None:
            return f"{self.name}-{self.layout.name}"
        if self.method is None:
            return self.name
        if self.window is not None:  # its name says how many samples it takes
            return f"{self.name}-{self.method_name}"
        before = f"-previous{self.previous}" if self.previous else ""
        after = f"-ahead{self.ahead}" if self.ahead else ""
        return f"{self.name}-{self.method_name}-{self.increments or 'rates'}{before}{after}"

    @cached_property
    def identity(self) -> str:
        """Text that differs between choices with different kernels or generated files: the key of the library's cache.

        It is the name of the kernel with its constants and, where that is a user's to choose, the tableau or layout
        with its file, or the kernel.
        """
        if self.user_kernel is not None:
            return f"{self.kernel} {self.user_kernel.text}"
        if self.method is not None and not isinstance(self.method, str):
            return f"{self.kernel} {full_text(self.method)} {self.method.file}"
        words = [self.kernel, options(self.constants), *self._code_of_packages()]
        if self.layout is not None:
            words += [full_text(self.layout), self.layout.file]
        return " ".join(filter(None, words))

    def _code_of_packages(self) -> Iterator[str]:
        """Yield hashes of the code of installed packages that derives the kernel."""
        yield KERNELS.code(self.name) or LAYOUT_KERNELS.code(self.name)
        if self.method is not None:
            yield INTEGRATORS.code(str(self.method))

    @property
    def increments_per_step(self) -> int:
        """Number of increments in a step; 1 for a step that takes rates, where each covers the whole step."""
        return self.increments or 1

    @property
    def orthonormalizations(self) -> list[str]:
        """Names of the kernels that orthonormalize the state; for a user's step, the one that it names."""
        if self.user_kernel is None:
            return orthonormalizations(self.name)
        step = self.user_kernel.head.attitude_step
        return [] if step is None or step.orthonormalize is None else [step.orthonormalize]

    def companion(self, name: str) -> Choice:
        """Return the choice of a kernel that a step needs: the user's own if there is one, else that of the catalogue.

        Parameters
        ----------
        name : str
            Name of the product, orthonormalization or attitude kernel in the step's `attitude_step`.

        Examples
        --------
        >>> Choice("euler", "rk4", 2).companion("dcm-from-euler").kernel
        'dcm-from-euler'
        """
        if self.user_kernel is None or name not in self.user_kernel.head.brought:
            return Choice(name)
        return next(
            Choice.of_user(kernel)
            for kernel in self.user_kernel.kernel.bundled_kernels
            if kernel.name == name
        )


def orthonormalizations(algorithm: str) -> list[str]:
    """Return the kernels that orthonormalize the state of an algorithm of the catalogue."""
    starts = (f"{algorithm}-orthonormalize", f"{algorithm}-normalize")
    return [name for name in KERNELS if name.startswith(starts)]
