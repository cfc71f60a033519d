"""`renamed` returns a program with other names for its function, signals and values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple, TypeVar

from strapgen.ir.integer_program import FixedProgram, IntegerOperation, IntegerSum, Scaled, Term, Value
from strapgen.ir.interfaces import Argument, ErrorFeedback, Interface
from strapgen.ir.program import Assignment, Node, Operation, Program, Reference, Result
from strapgen.ir.signals import Signal

_P = TypeVar("_P", Program, FixedProgram)


class Key(NamedTuple):
    """A named part of a program, of kind "function", "signal", "value" or "residual" (an error feedback)."""

    kind: str
    name: str


def keys(program: Program | FixedProgram, joined: Iterable[str] = ()) -> list[Key]:
    """Return the named parts of a program, each once: the function, signals but those joined to an element, values."""
    plain = program if isinstance(program, Program) else program.program
    signals = [*plain.inputs, *(result.signal for result in plain.results)]
    names = [Key("function", plain.name)]
    names += [Key("signal", signal.name) for signal in signals if signal.name not in joined]
    names += [Key("value", name) for signal in signals for name in signal.elements]
    if isinstance(program, Program):
        names += [Key("value", assignment.name) for assignment in program.body]
    else:
        names += [Key("value", value.name) for value in program.body]
        names += [Key("residual", feedback.name) for feedback in program.interface.residuals]
    return list(dict.fromkeys(names))


def renamed(program: _P, names: Mapping[Key, str], joined: Iterable[str] = ()) -> _P:
    """Return a program with other names; a part that has none keeps its own."""
    work = _Renaming(names, frozenset(joined))
    return work.program(program) if isinstance(program, Program) else work.fixed(program)


class _Renaming:
    """The new names, and a method that renames each kind of part."""

    def __init__(self, names: Mapping[Key, str], joined: frozenset[str]) -> None:
        self.names, self.joined = names, joined

    def value(self, name: str) -> str:
        return self.names.get(Key("value", name), name)

    def signal(self, signal: Signal) -> Signal:
        if signal.name in self.joined:
            name = self.value(*signal.elements)
        else:
            name = self.names.get(Key("signal", signal.name), signal.name)
        return replace(signal, name=name, elements=tuple(map(self.value, signal.elements)))

    # Programs

    def node(self, node: Node) -> Node:
        if isinstance(node, Reference):
            return Reference(self.value(node.name))
        if isinstance(node, Operation):
            return Operation(node.kind, tuple(map(self.node, node.arguments)))
        return node

    def result(self, result: Result) -> Result:
        return Result(self.signal(result.signal), tuple(map(self.node, result.nodes)))

    def program(self, program: Program) -> Program:
        return replace(
            program,
            name=self.names.get(Key("function", program.name), program.name),
            inputs=tuple(map(self.signal, program.inputs)),
            body=tuple(Assignment(self.value(a.name), self.node(a.value), a.meaning) for a in program.body),
            outputs=tuple(map(self.result, program.outputs)),
            transition=program.transition and self.result(program.transition),
        )

    # Programs on integers: their interface and body say all that is printed

    def fixed(self, fixed: FixedProgram) -> FixedProgram:
        interface = fixed.interface
        return replace(
            fixed,
            program=replace(
                fixed.program,
                name=self.names.get(Key("function", fixed.program.name), fixed.program.name),
            ),
            interface=self.interface(interface),
            body=tuple(map(self.fixed_value, fixed.body)),
        )

    def interface(self, interface: Interface) -> Interface:
        return replace(
            interface,
            inputs=tuple(map(self.argument, interface.inputs)),
            outputs=tuple(map(self.argument, interface.outputs)),
            residuals=tuple(map(self.feedback, interface.residuals)),
        )

    def argument(self, argument: Argument) -> Argument:
        values = tuple(map(self.value, argument.values))
        return replace(argument, signal=self.signal(argument.signal), values=values)

    def feedback(self, feedback: ErrorFeedback) -> ErrorFeedback:
        return replace(feedback, name=self.names.get(Key("residual", feedback.name), feedback.name))

    def fixed_value(self, value: Value) -> Value:
        return replace(value, name=self.value(value.name), definition=self.definition(value.definition))

    def definition(
        self, definition: IntegerSum | IntegerOperation | None
    ) -> IntegerSum | IntegerOperation | None:
        match definition:
            case IntegerSum(residual=feedback):
                return replace(
                    definition,
                    fine=tuple(map(self.term, definition.fine)),
                    coarse=tuple(map(self.term, definition.coarse)),
                    residual=feedback and self.feedback(feedback),
                )
            case IntegerOperation(kind, arguments):
                return IntegerOperation(kind, tuple(map(self.scaled, arguments)))
        return None

    def term(self, term: Term) -> Term:
        return replace(term, names=tuple(map(self.value, term.names)))

    def scaled(self, scaled: Scaled) -> Scaled:
        return replace(scaled, value=self.value(scaled.value)) if isinstance(scaled.value, str) else scaled
