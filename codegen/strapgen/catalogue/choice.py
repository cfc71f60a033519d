"""A `Choice` selects the kernel to derive: `choose` returns it, and all later stages take it."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from decimal import Context, Decimal
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from strapgen.catalogue.methods.method_spec import MethodSpec
from strapgen.catalogue.methods.tableaux import TITLES
from strapgen.catalogue.methods.window import Window
from strapgen.catalogue.names import ALGORITHMS, INTEGRATORS, KERNELS, LAYOUT_KERNELS, named_method
from strapgen.ir import checks
from strapgen.ir.checks import shown
from strapgen.ir.exceptions import InputTypeError
from strapgen.ir.kernel_info import Description
from strapgen.ir.notebook_display import full_text, short_repr

if TYPE_CHECKING:
    from strapgen.ir.kernel_info import AttitudeStep
    from strapgen.kernel.kernel import Kernel, Stage


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

    Examples
    --------
    >>> Choice("euler", "rk4", 2).kernel
    'euler-rk4-2'
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
        words = [self.kernel, constant_options(self.constants), *self._code_of_packages()]
        if self.layout is not None:
            words += [full_text(self.layout), self.layout.file]
        return " ".join(filter(None, words))

    def _code_of_packages(self) -> Iterator[str]:
        """Yield hashes of the code of installed packages that derives the kernel."""
        if self.name not in ALGORITHMS:
            yield KERNELS.code(self.name) or LAYOUT_KERNELS.code(self.name)
        if self.method is not None and self.method not in TITLES.own:
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


class AlgorithmObject(Protocol):
    """An object for an algorithm, as `strapgen.algorithm` returns one."""

    @property
    def choice(self) -> Choice:
        """The choice of its kernel."""


#: What names an algorithm to every stage: its name, the path of a user's file, a choice, or an object that holds one.
AnyAlgorithm: TypeAlias = str | os.PathLike[str] | Choice | AlgorithmObject


def named(function: str, algorithm: AnyAlgorithm) -> str | os.PathLike[str] | Choice:
    """Return a name, a path, or the choice of an object; refuse what is none of them for a function."""
    value = getattr(algorithm, "choice", algorithm)
    checks.require(function, value, str, os.PathLike, Choice)
    return value  # type: ignore[return-value]


def state_name(function: str, algorithm: AnyAlgorithm, allowed: Iterable[str]) -> str:
    """Return the name of the state of an algorithm, one of those allowed, for a function whose method is its own.

    >>> state_name("course", Choice("euler", "rk4", 2), ("dcm", "euler"))
    'euler'
    """
    chosen = named(function, algorithm)
    name = chosen.name if isinstance(chosen, Choice) else os.fspath(chosen)
    return checks.choice("algorithm", name, allowed)


def orthonormalizations(algorithm: str) -> list[str]:
    """Return the kernels that orthonormalize the state of an algorithm of the catalogue."""
    starts = (f"{algorithm}-orthonormalize", f"{algorithm}-normalize")
    return [name for name in KERNELS if name.startswith(starts)]


@dataclass(frozen=True)
class _KernelProperties:
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
    def of(cls, kernel: Kernel) -> _KernelProperties:
        shape = kernel.inputs[-1].shape if kernel.inputs else ()
        brought = tuple(other.name for other in kernel.bundled_kernels)
        text = _text(replace(kernel, arguments=""))
        samples = shape[0] if shape else 1
        beside = (kernel.previous, kernel.ahead) if kernel.takes_velocity else None
        return cls(kernel.name, samples, kernel.attitude_step, brought, text, kernel.unknowns, beside)


class UserKernel:
    """A user's kernel, loaded from the cache when needed; equal to one with the same formulas and arguments."""

    def __init__(
        self, head: _KernelProperties, restore: Callable[[], Kernel], arguments: str | None = None
    ) -> None:
        self.head: _KernelProperties = head
        self.arguments: str | None = arguments
        self._restore = restore
        self._kernel: Kernel | None = None

    @classmethod
    def of(cls, kernel: Kernel) -> UserKernel:
        """Return a kernel that is at hand."""
        return cls(_KernelProperties.of(kernel), lambda: kernel, kernel.arguments)

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
    """Return the head of a kernel as bytes; None if it has SymPy objects, which are slow to import."""
    head = _KernelProperties.of(kernel)
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


#: Constants as a value: the name of each input with its numbers in row-major order, sorted by the names.
Constants: TypeAlias = tuple[tuple[str, tuple[Fraction, ...]], ...]

#: Most characters of a decimal number that stands as it is, and of an option that stands without spaces.
_SHORT_NUMBER, _SHORT_OPTION = 8, 60


def read_constants(constants: Mapping[str, Any]) -> Constants:
    """Return constants by the name of the input, in its unit and row by row, as a value with exact numbers.

    A number is an int, a Fraction, a decimal or a fraction as text, or a float, which stands for its shortest decimal.

    >>> read_constants({"rate_bias": [0.5, "1/3", 0], "cycle": "0.02"})
    (('cycle', (Fraction(1, 50),)), ('rate_bias', (Fraction(1, 2), Fraction(1, 3), Fraction(0, 1))))
    """
    if not isinstance(constants, Mapping):
        raise InputTypeError(f"constants is {shown(constants)}; a mapping from names of inputs is needed")
    for name in constants:
        if not isinstance(name, str):
            raise InputTypeError(f"constants holds {shown(name)}; the name of an input is needed")
    return tuple(
        (name, tuple(checks.number(f"constant {name}", value) for value in _flat(constants[name])))
        for name in sorted(constants)
    )


def _flat(value: Any) -> Iterator[Any]:
    """Yield the numbers of an array or of nested sequences."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, list | tuple):
        for part in value:
            yield from _flat(part)
    else:
        yield value


def constant_options(constants: Constants) -> str:
    """Return constants as options of the command line; a long one has spaces, at which a header may wrap it.

    Examples
    --------
    >>> constant_options(read_constants({"cycle": "1/50", "rate_bias": [1e-9, -0.5, "1/3"]}))
    '--constant cycle=0.02 --constant rate_bias=1e-9,-0.5,1/3'
    """
    words = []
    for name, numbers in constants:
        texts = [number_text(number) for number in numbers]
        short = f"--constant {name}={','.join(texts)}"
        words.append(short if len(short) <= _SHORT_OPTION else f"--constant '{name}={', '.join(texts)}'")
    return " ".join(words)


def number_text(number: Fraction) -> str:
    """Return a short text that `checks.number` reads as this number.

    Examples
    --------
    >>> number_text(Fraction(1, 4)), number_text(Fraction(-3, 10**9)), number_text(Fraction(2, 3))
    ('0.25', '-3e-9', '2/3')
    """
    places = _decimal_places(number.denominator)
    if places is None:
        return str(number)
    sign = "-" if number < 0 else ""
    digits = str(abs(number.numerator) * (10**places // number.denominator))
    plain = f"{sign}{Decimal(digits).scaleb(-places, Context(len(digits))):f}"
    if len(plain) <= _SHORT_NUMBER:
        return plain
    first, rest = digits[0], digits[1:].rstrip("0")
    short = f"{sign}{first}{'.' if rest else ''}{rest}e{len(digits) - 1 - places}"
    return min(plain, short, str(number), key=len)


def _decimal_places(denominator: int) -> int | None:
    """Return how many decimal places a denominator needs; None if no number of them is enough."""
    powers = []
    for prime in (2, 5):
        powers.append(0)
        while denominator % prime == 0:
            denominator //= prime
            powers[-1] += 1
    return max(powers) if denominator == 1 else None
