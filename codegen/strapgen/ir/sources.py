"""Sources are the text that a target prints, with everything that a back end needs to call it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Self

from strapgen.ir import checks
from strapgen.ir.exceptions import InputTypeError
from strapgen.ir.interfaces import Interface, RoundingBounds
from strapgen.ir.kernel_info import AttitudeStep, KernelInfo, Recursion
from strapgen.ir.notebook_display import notebook_html, short_repr
from strapgen.ir.read_only import ReadOnly
from strapgen.ir.renamed import renamed
from strapgen.ir.signals import Signal

if TYPE_CHECKING:
    from strapgen.ir.integer_program import FixedProgram
    from strapgen.ir.program import Program


@dataclass(frozen=True)
class Function:
    """A generated function: its name, its inputs and its outputs."""

    name: str
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]


@renamed(companions="attitude_step", own="bundled_programs")
@dataclass(frozen=True)
class Sources(ReadOnly):
    """Generated source text and its interface.

    Parameters
    ----------
    info : KernelInfo
        What is said of the kernel.
    target : str
        Name of the target.
    files : mapping of str to str
        Text by file name.
    function : Function
        The generated function.
    operations : mapping of str to int
        Operations of one call, see `Program.operations`.
    temporaries : int
        Intermediate values of one call.
    fixed : Interface or None
        Formats, ranges and error bounds of fixed-point code; None for every other target.
    bundled_programs : tuple of Program
        Programs of the kernels that a user's step brings.
    runs : tuple of str
        Names of the files that hold loops over samples and runs, which a host calls and firmware does not need.
    rounding : RoundingBounds or None
        Error bounds of C in floating point; None for every other target.

    Examples
    --------
    >>> from strapgen import algorithm
    >>> sources = algorithm("euler", "rk4", 2).generate("c")
    >>> list(sources.step_files), sources.kernel
    (['euler_rk4_2.h', 'euler_rk4_2.c'], 'euler-rk4-2')
    """

    info: KernelInfo
    target: str
    files: Mapping[str, str]
    function: Function
    operations: Mapping[str, int]
    temporaries: int
    fixed: Interface | None = None
    bundled_programs: tuple[Program, ...] = ()
    runs: tuple[str, ...] = ()
    rounding: RoundingBounds | None = None

    __repr__ = short_repr
    _repr_html_ = notebook_html

    @classmethod
    def of(
        cls,
        program: Program | FixedProgram,
        target: str,
        function: str,
        files: Mapping[str, str],
        /,
        **rest: Any,
    ) -> Self:
        """Return the files of a target as sources, whose function has this name; `rest` are further fields."""
        checks.text("function of Sources.of", function)
        if not isinstance(files, Mapping):
            raise InputTypeError(
                f"files of Sources.of is {checks.describe(files)}; texts by file name are needed"
            )
        from strapgen.ir.integer_program import FixedProgram  # sources from the cache are there without it

        code = program.program if isinstance(program, FixedProgram) else program
        fixed = program.interface if isinstance(program, FixedProgram) else None
        signature = Function(function, code.inputs, tuple(result.signal for result in code.outputs))
        counts = program.operations, program.temporaries
        return cls(program.info, target, files, signature, *counts, fixed=fixed, **rest)

    def _in_words(self) -> str:
        return f"of {self.kernel} for {self.target}: {', '.join(self.files)}"

    @property
    def kernel(self) -> str:
        """Name of the kernel."""
        return self.info.name

    @property
    def attitude_step(self) -> AttitudeStep | None:
        """The kernels that go with an attitude step; None for every other kernel."""
        return self.info.attitude_step

    @property
    def recursion(self) -> Recursion | None:
        """The outputs that are inputs of the next call."""
        return self.info.recursion

    @property
    def cost(self) -> str:
        """The operations of one call in words."""
        counts = [f"{number} {kind}" for kind, number in self.operations.items() if number]
        return f"{', '.join(counts) or 'no operations'}, {self.temporaries} temporaries"

    @property
    def largest_errors(self) -> dict[str, Fraction]:
        """The largest error bound of a call by the name of the output; empty where none is known."""
        if self.fixed is not None:
            return {argument.signal.name: max(argument.errors) for argument in self.fixed.outputs}
        return {} if self.rounding is None else dict(self.rounding.worst)

    @property
    def step_files(self) -> dict[str, str]:
        """The files without those of `runs`."""
        return {name: text for name, text in self.files.items() if name not in self.runs}
