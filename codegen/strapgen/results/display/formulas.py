"""Formulas of kernels and programs as text, LaTeX or plain data.

>>> from strapgen import derive, formulas
>>> print(formulas.as_text(derive("euler-normalize")).splitlines()[0])
Euler parameters: normalization to length 1, exact
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

from strapgen.ir.notebook_display import short_repr
from strapgen.ir.program import Program
from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, Stage
from strapgen.lowering.canonical.vector_form import vector_form
from strapgen.results.display.expressions import named_equations
from strapgen.results.display.stages import stages_latex, vectors_latex
from strapgen.results.records import INTERNAL, entry
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.targets.contract import operations_text
from strapgen.targets.printer import ExactPrinter

#: Most rows of formulas that are seen at a glance.
_MOST_ROWS = 12
#: Most lines of formulas in vectors that are.
_MOST_LINES = 30
_PROGRAM_COLUMNS = (Column("name", "<"), Column("value", "<"))
_OPERATION_COLUMNS = (Column("operation", "<"), Column("number"))


def as_text(kernel: Kernel, notes: Sequence[str] | None = None) -> str:
    """Return a kernel's formulas as text, stage by stage, with notes, by default the kernel's own.

    Examples
    --------
    >>> from strapgen import derive
    >>> print(as_text(derive("euler-normalize")).splitlines()[-1])
      next_s = e_s*inverse_norm
    """
    lines = [kernel.title, f"source: {kernel.source}", ""]
    for signal in kernel.inputs:
        shape = " x ".join(map(str, signal.shape)) or "scalar"
        lines.append(f"in   {signal.name} ({shape}, unit {signal.unit}): {signal.meaning}")
    for stage in kernel.outputs:
        lines.append(f"out  {stage.signal.name} (unit {stage.signal.unit}): {stage.signal.meaning}")
    if kernel.order is not None:
        lines.append(f"order {kernel.order.step}: {kernel.order}")
    if kernel.unknowns:
        lines.append(f"unknowns {', '.join(kernel.unknowns)}")
    lines += [f"note {note}" for note in (kernel.notes if notes is None else notes)]
    for stage in (*kernel.stages, *kernel.outputs):
        lines += [
            "",
            f"{stage.signal.name}: {stage.signal.meaning}" if stage.signal.meaning else stage.signal.name,
        ]
        lines += [
            f"  {name} = {sp.sstr(expression)}"
            for name, expression in zip(stage.signal.elements, stage.expressions, strict=True)
        ]
    return "\n".join(lines)


def program_as_text(program: Program) -> str:
    """Return the straight-line code of a program with exact constants.

    Examples
    --------
    >>> from strapgen import algorithm
    >>> print(program_as_text(algorithm("euler", "rk4", increments=2).program()).splitlines()[0])
    Euler parameters: step by classical fourth-order Runge-Kutta method from 2 angle increments
    """
    printer = ExactPrinter()
    lines = [program.title, f"operations: {operations_text(program)}"]
    for assignment in program.body:
        if assignment.meaning:
            lines += ["", f"  # {assignment.meaning}"]
        lines.append(f"  {assignment.name} = {printer.text(assignment.value)}")
    return "\n".join(lines)


def operations_as_text(kernel: Kernel, program: Program) -> str:
    """Return the number of operations of each kind, and of temporaries, as a table.

    Examples
    --------
    >>> from strapgen import algorithm
    >>> alg = algorithm("euler", "rk4", increments=2)
    >>> print(operations_as_text(alg.derive(), alg.program()).splitlines()[-1])
      temporaries    15
    """
    columns = (Column(align="<", least=12), Column(least=5, gap=0))
    return "\n".join([kernel.name, *TextTable(columns, _counts(program)).lines("  ")])


def _counts(program: Program) -> list[tuple[str, int]]:
    return list({**program.operations, "temporaries": program.temporaries}.items())


@dataclass(frozen=True)
class StageData:
    """A stage of a kernel: expressions by element are text that SymPy can read.

    Examples
    --------
    >>> from strapgen import derive
    >>> StageData.of(derive("euler-normalize").outputs[0]).signal.name
    'next'
    """

    signal: Signal = field(metadata=entry(spread=True))
    expressions: dict[str, str]

    @staticmethod
    def of(stage: Stage) -> StageData:
        """Return a stage as text."""
        texts = map(sp.sstr, stage.expressions)
        return StageData(stage.signal, dict(zip(stage.signal.elements, texts, strict=True)))


@dataclass(frozen=True)
class KernelResult(Result):
    """The formulas, the program and the operations of a kernel; expressions are text that SymPy can read.

    Examples
    --------
    >>> from strapgen import algorithm
    >>> alg = algorithm("euler", "rk4", increments=2)
    >>> KernelResult.of(alg.derive(), alg.program()).temporaries
    15
    """

    of_kernel: Kernel = field(metadata=INTERNAL)
    of_program: Program | None = field(metadata=INTERNAL)
    #: "text", "latex", "program" or "operations"
    shown: str = field(metadata=INTERNAL)
    kernel: str
    title: str
    source: str
    notes: tuple[str, ...]
    inputs: tuple[Signal, ...]
    stages: list[StageData]
    outputs: list[StageData]
    #: Operations of the program by kind
    operations: Mapping[str, int] | None = field(metadata=entry(optional=True))
    #: Number of values on the way
    temporaries: int | None = field(metadata=entry(optional=True))
    #: Coefficients that are not known
    unknowns: tuple[str, ...] | None = field(metadata=entry(optional=True))
    #: The formulas as an align environment
    latex_text: str | None = field(metadata=entry(key="latex", optional=True))
    #: Straight-line code by the names that it assigns, with exact constants
    program: dict[str, str] | None = field(metadata=entry(optional=True))

    @staticmethod
    def of(kernel: Kernel, program: Program | None, shown: str = "text") -> KernelResult:
        """Return a kernel; one with unknowns has no program."""
        return KernelResult(
            of_kernel=kernel,
            of_program=program,
            shown=shown,
            kernel=kernel.name,
            title=kernel.title,
            source=kernel.source,
            notes=tuple(kernel.notes),
            inputs=tuple(kernel.inputs),
            stages=list(map(StageData.of, kernel.stages)),
            outputs=list(map(StageData.of, kernel.outputs)),
            operations=None if program is None else program.operations,
            temporaries=None if program is None else program.temporaries,
            unknowns=tuple(kernel.unknowns) if program is None else None,
            latex_text=as_latex(kernel) if shown == "latex" else None,
            program=program_as_data(program) if program is not None and shown == "program" else None,
        )

    def text(self) -> str:
        """Return the selected part: the formulas, their LaTeX, the program or its operations."""
        if self.shown == "latex":
            return as_latex(self.of_kernel)
        if self.of_program is None or self.shown == "text":
            return as_text(self.of_kernel, None if self.of_program is None else self.of_program.notes)
        if self.shown == "program":
            return program_as_text(self.of_program)
        return operations_as_text(self.of_kernel, self.of_program)

    def rows(self) -> Sequence[tuple[str, str | int]] | None:
        """Return the program or its operations."""
        if self.program is not None:
            return list(self.program.items())
        return None if self.of_program is None or self.shown != "operations" else _counts(self.of_program)

    def table(self) -> TextTable:
        """Return the program or its operations as a table."""
        columns = _OPERATION_COLUMNS if self.program is None else _PROGRAM_COLUMNS
        return TextTable(columns, self.rows() or [])

    def latex(self) -> str | None:
        """Return the formulas, or the table."""
        return as_latex(self.of_kernel) if self.rows() is None else self.table().as_latex()


class _Text(str):
    """A text that the prompt of IPython shows as `print` does."""

    __slots__ = ()

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        printer.text(str(self))


@dataclass(frozen=True)
class Formulas:
    """The formulas of a kernel: they print as text, and a notebook shows them as LaTeX.

    Parameters
    ----------
    kernel : Kernel
    straight_line : Program or None
        Its program; None for a kernel with unknowns, which has none.

    Examples
    --------
    >>> from strapgen import algorithm
    >>> algorithm("euler", "rk4", increments=2).formulas.operations["add"]
    31
    """

    kernel: Kernel
    straight_line: Program | None

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"of {self.kernel.name}: {self.kernel.title}"

    def __str__(self) -> str:
        return as_text(self.kernel, None if self.straight_line is None else self.straight_line.notes)

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        printer.text(str(self))

    def _repr_latex_(self) -> str | None:
        return short_latex(self.kernel)

    @property
    def latex(self) -> _Text:
        """The formulas as an align environment."""
        return _Text(as_latex(self.kernel))

    @property
    def program(self) -> _Text:
        """The straight-line code with exact constants, and above it the operations."""
        return _Text(program_as_text(self._known()))

    @property
    def operations(self) -> dict[str, int]:
        """Number of operations by kind, and of temporaries."""
        return dict(_counts(self._known()))

    def _known(self) -> Program:
        """Return the program, which a kernel with unknowns does not have."""
        self.kernel.require_known()
        assert self.straight_line is not None
        return self.straight_line


def program_as_data(program: Program) -> dict[str, str]:
    """Return the straight-line code of a program by the names that it assigns, in order, with exact constants.

    Examples
    --------
    >>> from strapgen import algorithm
    >>> len(program_as_data(algorithm("euler", "rk4", increments=2).program()))
    19
    """
    printer = ExactPrinter()
    return {assignment.name: printer.text(assignment.value) for assignment in program.body}


def as_latex(kernel: Kernel) -> str:
    """Return a kernel's formulas as one LaTeX align environment, broken at the width of a page.

    A step is in vectors, their scalar and cross products, as its program computes it. Where that would be longer than
    the stages, these are written, as sums and products of vectors, quaternions (a vector has the scalar part 0) and
    matrices; what is no such sum is written element by element.

    Examples
    --------
    >>> from strapgen import derive
    >>> as_latex(derive("euler", "rk4", 2)).count("&=")
    4
    """
    return _in_vectors(kernel) or elements_latex(kernel)


def short_latex(kernel: Kernel) -> str | None:
    """Return a kernel's formulas as LaTeX; None if they are longer than half a page.

    Examples
    --------
    >>> from strapgen import derive
    >>> len(short_latex(derive("euler", "rk4", 2)).splitlines())
    6
    """
    text = _in_vectors(kernel)
    if text is None:
        rows = sum(stage.signal.size for stage in (*kernel.stages, *kernel.outputs))
        return elements_latex(kernel) if rows <= _MOST_ROWS else None
    return text if len(text.splitlines()) <= _MOST_LINES else None


def _in_vectors(kernel: Kernel) -> str | None:
    """Return a step as its program computes it, or the stages of a kernel, in vectors; None if there are none."""
    form = None if kernel.unknowns else vector_form(kernel)
    if form is None:
        return stages_latex(kernel)
    state = kernel.inputs[0].elements[0].partition("_")[0]  # the letter of its elements
    return vectors_latex(form, state)


def elements_latex(kernel: Kernel) -> str:
    """Return a kernel's formulas element by element as one LaTeX align environment.

    A function or root that no line holds gets a letter with a number, and a line of its own before.

    Examples
    --------
    >>> from strapgen import derive
    >>> elements_latex(derive("euler", "rk4", 2)).count("&=")
    45
    """
    names = {
        sp.Symbol(element, real=True): _latex_name(element)
        for signal in (*kernel.inputs, *(stage.signal for stage in (*kernel.stages, *kernel.outputs)))
        for element in signal.elements
    }
    return named_equations(
        (
            (_latex_name(element), expression)
            for stage in (*kernel.stages, *kernel.outputs)
            for element, expression in zip(stage.signal.elements, stage.expressions, strict=True)
        ),
        names,
    )


def _latex_name(element: str) -> str:
    head, _, label = element.rpartition("_")
    if not head:
        return element if len(element) == 1 else f"\\mathit{{{element}}}"
    numbered = re.fullmatch(r"([a-z])(\d+)", head)
    if numbered:
        return f"{numbered[1]}_{{{numbered[2]}{label}}}"
    words = head.replace("_", "\\_")
    return f"{words}_{{{label}}}" if len(head) == 1 else f"\\mathit{{{words}}}_{{{label}}}"
