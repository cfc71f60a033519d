"""Formulas of kernels and programs as text, LaTeX or plain data."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

import sympy as sp

from strapgen.ir.program import Program
from strapgen.kernel.kernel import Kernel, Stage
from strapgen.lowering.canonical.vector_form import vector_form
from strapgen.results.display.expressions import named_equations
from strapgen.results.display.stages import stages_latex
from strapgen.results.display.vectors import vectors_latex
from strapgen.results.report import Report
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
    """Return a kernel's formulas as text, stage by stage, with notes, by default the kernel's own."""
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
    """Return the straight-line code of a program with exact constants."""
    printer = ExactPrinter()
    lines = [program.title, f"operations: {operations_text(program)}"]
    for assignment in program.body:
        if assignment.meaning:
            lines += ["", f"  # {assignment.meaning}"]
        lines.append(f"  {assignment.name} = {printer.text(assignment.value)}")
    return "\n".join(lines)


def operations_as_text(kernel: Kernel, program: Program) -> str:
    """Return the number of operations of each kind, and of temporaries, as a table."""
    columns = (Column(align="<", least=12), Column(least=5, gap=0))
    return "\n".join([kernel.name, *TextTable(columns, _counts(program)).lines("  ")])


def _counts(program: Program) -> list[tuple[str, int]]:
    return list({**program.operations, "temporaries": program.temporaries}.items())


def formulas_report(kernel: Kernel, program: Program, show: str) -> Report:
    """Return as a report the formulas, "text" or "latex", or a table of the "program" or its "operations"."""
    texts: dict[str, Callable[[], str]] = {
        "text": lambda: as_text(kernel, program.notes),
        "latex": lambda: as_latex(kernel),
        "program": lambda: program_as_text(program),
        "operations": lambda: operations_as_text(kernel, program),
    }

    def data() -> dict[str, Any]:
        shown: dict[str, Any] = {}
        if show in ("latex", "program"):
            shown[show] = as_latex(kernel) if show == "latex" else program_as_data(program)
        return as_data(kernel, program) | shown

    def table() -> TextTable:
        if show == "program":
            return TextTable(_PROGRAM_COLUMNS, list(program_as_data(program).items()))
        return TextTable(_OPERATION_COLUMNS, _counts(program))

    if show in ("program", "operations"):
        return Report(texts[show], data, table)
    return Report(texts[show], data, latex=texts["latex"])


def unknown_formulas_report(kernel: Kernel, show: str) -> Report:
    """Return the formulas of a kernel with unknowns, which has no program, as text or LaTeX."""
    texts = {"text": lambda: as_text(kernel), "latex": lambda: as_latex(kernel)}

    def data() -> dict[str, Any]:
        shown = {"latex": as_latex(kernel)} if show == "latex" else {}
        return kernel_as_data(kernel) | {"unknowns": list(kernel.unknowns)} | shown

    return Report(texts[show], data, latex=texts["latex"])


def program_as_data(program: Program) -> dict[str, str]:
    """Return the straight-line code of a program by the names that it assigns, in order, with exact constants."""
    printer = ExactPrinter()
    return {assignment.name: printer.text(assignment.value) for assignment in program.body}


def as_latex(kernel: Kernel) -> str:
    """Return a kernel's formulas as one LaTeX align environment, broken at the width of a page.

    A step is in vectors, their scalar and cross products, as its program computes it. Where that would be longer than
    the stages, these are written, as sums and products of vectors, quaternions (a vector has the scalar part 0) and
    matrices; what is no such sum is written element by element.
    """
    return _in_vectors(kernel) or elements_latex(kernel)


def short_latex(kernel: Kernel) -> str | None:
    """Return a kernel's formulas as LaTeX if a reader sees them at a glance; None for scalars of half a page."""
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


def as_data(kernel: Kernel, program: Program) -> dict[str, Any]:
    """Return a kernel as plain JSON data with the operations of its program."""
    return kernel_as_data(kernel) | {"operations": program.operations, "temporaries": program.temporaries}


def kernel_as_data(kernel: Kernel) -> dict[str, Any]:
    """Return a kernel as plain JSON data; expressions are strings that SymPy parses."""

    def stage_data(stage: Stage) -> dict[str, Any]:
        expressions = map(sp.sstr, stage.expressions)
        return stage.signal.as_dict() | {
            "expressions": dict(zip(stage.signal.elements, expressions, strict=True))
        }

    return {
        "kernel": kernel.name,
        "title": kernel.title,
        "source": kernel.source,
        "notes": list(kernel.notes),
        "inputs": [signal.as_dict() for signal in kernel.inputs],
        "stages": [stage_data(stage) for stage in kernel.stages],
        "outputs": [stage_data(stage) for stage in kernel.outputs],
    }
