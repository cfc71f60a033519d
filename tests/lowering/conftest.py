"""Programs as text: what the tests of the passes read and compare."""

from __future__ import annotations

import ast
from collections.abc import Callable
from fractions import Fraction

import pytest

from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.program import (
    OPERATIONS,
    Assignment,
    Constant,
    Node,
    Operation,
    Program,
    Reference,
    Result,
    references,
)
from strapgen.ir.signals import Signal

INFIX = {"add": ast.Add(), "subtract": ast.Sub(), "multiply": ast.Mult(), "divide": ast.Div()}
KINDS = {type(operator): kind for kind, operator in INFIX.items()}


def read(tree: ast.expr) -> Node:
    match tree:
        case ast.Constant(value=int(value)):
            return Constant(Fraction(value))
        case ast.Name(id=name):
            return Reference(name)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            inner = read(operand)
            return Constant(-inner.value) if isinstance(inner, Constant) else Operation("negate", (inner,))
        case ast.BinOp(left=left, op=op, right=right):
            return Operation(KINDS[type(op)], (read(left), read(right)))
        case ast.Call(func=ast.Name(id="q"), args=[ast.Constant(value=above), ast.Constant(value=below)]):
            return Constant(Fraction(above, below))
        case ast.Call(func=ast.Name(id=kind), args=arguments) if kind in OPERATIONS:
            return Operation(kind, tuple(map(read, arguments)))
    raise ValueError(ast.unparse(tree))


def written(node: Node) -> ast.expr:
    match node:
        case Reference(name):
            return ast.Name(name)
        case Constant(value) if value.denominator == 1:
            return ast.Constant(value.numerator)
        case Constant(value):
            return ast.Call(
                ast.Name("q"), [ast.Constant(value.numerator), ast.Constant(value.denominator)], []
            )
        case Operation("negate", (inner,)):
            return ast.UnaryOp(ast.USub(), written(inner))
        case Operation(kind, (left, right)) if kind in INFIX:
            return ast.BinOp(written(left), INFIX[kind], written(right))
        case Operation(kind, arguments):
            return ast.Call(ast.Name(kind), list(map(written, arguments)), [])
    raise TypeError(node)


@pytest.fixture
def parse() -> Callable[..., Program]:
    """Make a program from text like ``y = 2 * x; z = y / 3``; q(1, 3) is a number, 1 / 3 a division.

    Results are the names given, or all that stand for something; inputs are the names never assigned.
    """

    def parse(text: str, results: str = "", transition: str = "") -> Program:
        lines = ast.parse(text.replace("; ", "\n")).body
        body = tuple(Assignment(line.targets[0].id, read(line.value)) for line in lines)
        assigned = [assignment.name for assignment in body]
        held = results.split() or [name for name in assigned if not name.startswith(("shared_", "factor_"))]
        moved = transition.split()
        used = {name for assignment in body for name in references(assignment.value)} | {*held, *moved}
        return Program(
            KernelInfo("p", "", ""),
            tuple(map(Signal.scalar, sorted(used - {*assigned}))),
            body,
            tuple(Result(Signal.scalar(f"output_{n}"), (Reference(n),)) for n in held),
            Result(Signal.labelled("transition", "t", moved), tuple(map(Reference, moved)))
            if moved
            else None,
        )

    return parse


@pytest.fixture
def show() -> Callable[[Program], str]:
    """Write a program as text, as `parse` reads it."""
    return lambda program: "; ".join(f"{a.name} = {ast.unparse(written(a.value))}" for a in program.body)
