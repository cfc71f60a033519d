"""What states of a program are by its formulas: copies of inputs, and sums of inputs over a cycle."""

from __future__ import annotations

from strapgen.ir.program import Operation, Program, Reference


def copies(program: Program) -> dict[str, str]:
    """Return the states that are copies of inputs of the call before, with these inputs.

    >>> from strapgen import pipeline
    >>> from strapgen.catalogue import Choice
    >>> copies(pipeline.program(Choice("two-speed-fast-2")))
    {'previous_increment': 'increment'}
    """
    inputs = {signal.elements: signal.name for signal in program.inputs}
    result = {}
    for state, elements in _next_elements(program).items():
        if elements in inputs:
            result[state] = inputs[elements]
    return result


def summed(program: Program) -> dict[str, str]:
    """Return the states that add up an input and nothing else until they are reset, with these inputs.

    >>> from strapgen import pipeline
    >>> from strapgen.catalogue import Choice
    >>> summed(pipeline.program(Choice("two-speed-fast-2")))
    {'angle_sum': 'increment', 'velocity_sum': 'velocity_increment'}
    """
    signals = {signal.name: signal for signal in program.inputs}
    values = {assignment.name: assignment.value for assignment in program.body}
    cleared = () if program.recursion is None else program.recursion.reset
    result = {}
    for state, elements in _next_elements(program).items():
        sums = {_added(values.get(element)) for element in elements}
        for name, signal in signals.items():
            pairs = {frozenset(pair) for pair in zip(signals[state].elements, signal.elements, strict=False)}
            if state in cleared and len(pairs) == len(elements) and sums == pairs:
                result[state] = name
    return result


def _next_elements(program: Program) -> dict[str, tuple[str, ...]]:
    """Return the names of the values that become the elements of each state."""
    outputs = {result.signal.name: result.nodes for result in program.outputs}
    states = () if program.recursion is None else program.recursion.states
    return {
        state: tuple(node.name for node in outputs[output] if isinstance(node, Reference))
        for state, output in states
    }


def _added(node: object) -> frozenset[str]:
    """Return the names of the two values that a node adds up; none if it is something else."""
    if not isinstance(node, Operation) or node.kind != "add":
        return frozenset()
    names = [each.name for each in node.arguments if isinstance(each, Reference)]
    return frozenset(names if len(names) == len(node.arguments) == 2 else ())
