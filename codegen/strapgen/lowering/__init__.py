"""Lowering: an exact kernel becomes straight-line code.

SymPy ends here. The transition of an attitude step is brought into `canonical` form, in several bases; everything
else goes through `share`, which finds common subexpressions while formulas are still symbolic, and `gate`, which
writes them as a `Program`. The passes that follow are pure functions from program to program. Of all the programs
for one kernel the one with the fewest operations is taken.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import count

from strapgen.kernel import Kernel, Stage
from strapgen.lowering import canonical
from strapgen.lowering.gate import gate
from strapgen.lowering.irrational import rationalized
from strapgen.lowering.passes import PASSES, cost, optimize
from strapgen.lowering.passes.rewriting import rewritten
from strapgen.lowering.share import share
from strapgen.program import Assignment, Node, Program, Reference, Result

__all__ = ["PASSES", "candidates", "lower"]


def lower(kernel: Kernel) -> Program:
    """Turn a kernel into straight-line code with the fewest operations that are known for it.

    Parameters
    ----------
    kernel : Kernel

    Returns
    -------
    Program

    Raises
    ------
    NotImplementedError
        If an expression holds a function that programs do not know.

    Examples
    --------
    >>> from strapgen import derive
    >>> program = lower(derive("euler", method="rk4", increments=2))
    >>> program.operations["multiply"], program.operations["add"]
    (38, 30)
    """
    rational = rationalized(kernel)
    # Rounded constants would leave terms that cancel exactly: such a transition is not expanded.
    core = canonical.extract_core(kernel) if rational is kernel else None
    kernel = rational
    if core is not None and (reason := canonical.expansion(core)):
        core = None
        kernel = replace(kernel, notes=(*kernel.notes, reason))
    programs = [optimize(program) for program in candidates(kernel, core)]
    program = min(programs, key=cost)
    if core is not None and program is not programs[0]:
        canonical.verify(core, program)
    return program


def candidates(kernel: Kernel, core: canonical.Core | None) -> Iterator[Program]:
    """Yield programs for a kernel, before the passes: its formulas, with CSE and without, or canonical forms."""
    yield gate(kernel, share(kernel))
    if core is None:
        yield gate(kernel, share(kernel, common=False))
        return
    update = replace(
        kernel, inputs=(*kernel.inputs, core.transition), stages=_behind(kernel, core), transition=None
    )
    after = gate(update, share(update))
    transition = Result(core.transition, tuple(map(Reference, core.transition.elements)))
    taken = {name for signal in kernel.inputs for name in signal.elements} | {a.name for a in after.body}
    for form in canonical.forms(core):
        body = _renamed(form, taken)
        yield replace(after, inputs=kernel.inputs, body=(*body, *after.body), transition=transition)


def _behind(kernel: Kernel, core: canonical.Core) -> tuple[Stage, ...]:
    """Return the stages that the outputs need beside the transition."""
    wanted = {symbol.name for stage in kernel.outputs for e in stage.expressions for symbol in e.free_symbols}
    wanted -= set(core.transition.elements)
    needed: list[Stage] = []
    for stage in reversed(kernel.stages):
        if stage.signal.name != kernel.transition and wanted & set(stage.signal.elements):
            needed.insert(0, stage)
            wanted |= {symbol.name for e in stage.expressions for symbol in e.free_symbols}
            wanted -= set(core.transition.elements)
    return tuple(needed)


def _renamed(body: list[Assignment], taken: set[str]) -> tuple[Assignment, ...]:
    """Give names that the kernel itself uses for something else another ending."""
    names = {a.name for a in body}
    new: dict[str, str] = {}
    for name in sorted(names & taken):
        new[name] = next(n for k in count(2) if (n := f"{name}_{k}") not in names | taken)
    if not new:
        return tuple(body)

    def rule(node: Node) -> Node:
        return Reference(new.get(node.name, node.name)) if isinstance(node, Reference) else node

    return tuple(replace(a, name=new.get(a.name, a.name), value=rewritten(a.value, rule)) for a in body)
