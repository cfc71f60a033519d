"""Lowering: an exact kernel becomes straight-line code.

No stage after this one uses SymPy. `canonical` writes the transition of an attitude step in several bases. All other
formulas go through `share`, which finds common subexpressions while they are still symbolic, and `gate`, which
writes them as a `Program`. The passes then save operations; each is a pure function from program to program.
`lower` returns the candidate with the fewest operations.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import count

from strapgen.ir.program import Assignment, Node, Program, Reference, Result
from strapgen.kernel.kernel import Kernel, Stage, rationalize
from strapgen.lowering import canonical
from strapgen.lowering.gate import gate
from strapgen.lowering.passes import PASSES, cost, optimize
from strapgen.lowering.trees import rewritten

__all__ = ["PASSES", "candidates", "lower"]

#: Elements of stages from which on common subexpressions are not searched.
_MANY_ELEMENTS = 400


def lower(kernel: Kernel) -> Program:
    """Turn a kernel into straight-line code; of several candidates the one with the fewest operations.

    >>> from strapgen import derive
    >>> program = lower(derive("euler", method="rk4", increments=2))
    >>> program.operations["multiply"], program.operations["add"]
    (37, 31)
    """
    rational = rationalize(kernel)
    # With rounded constants, terms that should cancel would stay: such a transition is not expanded.
    core = canonical.extract_core(kernel) if rational is kernel else None
    kernel = rational
    if core is not None and (reason := canonical.expansion(core)):
        core = None
        kernel = replace(kernel, notes=(*kernel.notes, reason))
    programs = [optimize(program) for program in candidates(kernel, core)]
    program = min(programs, key=cost)
    if core is not None and program is not programs[0]:
        canonical.verify(core, program)
    return replace(program, bundled_programs=tuple(map(lower, kernel.bundled_kernels)))


def candidates(kernel: Kernel, core: canonical.Core | None) -> Iterator[Program]:
    """Yield unoptimized programs for a kernel; without a core, the one of its formulas.

    The first shares common subexpressions; the others do not, or are one for each canonical form. Formulas of many
    elements are never shared without a core: they stand in small stages already, and the passes take less time.
    """
    if core is None:
        if sum(stage.signal.size for stage in kernel.stages) < _MANY_ELEMENTS:
            yield gate(kernel)
        yield gate(kernel, common=False)
        return
    yield gate(kernel)
    update = replace(
        kernel, inputs=(*kernel.inputs, core.transition), stages=_behind(kernel, core), transition=None
    )
    after = gate(update)
    transition = Result(core.transition, tuple(map(Reference, core.transition.elements)))
    reserved = {name for signal in kernel.inputs for name in signal.elements} | {a.name for a in after.body}
    for form in canonical.forms(core):
        body = _rename(form, reserved)
        yield replace(after, inputs=kernel.inputs, body=(*body, *after.body), transition=transition)


def _behind(kernel: Kernel, core: canonical.Core) -> tuple[Stage, ...]:
    """Return the stages that the outputs need in addition to the transition."""
    open_names = {
        symbol.name for stage in kernel.outputs for e in stage.expressions for symbol in e.free_symbols
    }
    open_names -= set(core.transition.elements)
    needed: list[Stage] = []
    for stage in reversed(kernel.stages):
        if stage.signal.name != kernel.transition and open_names & set(stage.signal.elements):
            needed.insert(0, stage)
            open_names |= {symbol.name for e in stage.expressions for symbol in e.free_symbols}
            open_names -= set(core.transition.elements)
    return tuple(needed)


def _rename(body: list[Assignment], reserved: set[str]) -> tuple[Assignment, ...]:
    """Append a number to each name in the body that the kernel uses for another quantity."""
    names = {a.name for a in body}
    new: dict[str, str] = {}
    for name in sorted(names & reserved):
        new[name] = next(n for k in count(2) if (n := f"{name}_{k}") not in names | reserved)
    if not new:
        return tuple(body)

    def rule(node: Node) -> Node:
        return Reference(new.get(node.name, node.name)) if isinstance(node, Reference) else node

    return tuple(replace(a, name=new.get(a.name, a.name), value=rewritten(a.value, rule)) for a in body)
