"""A proof by z3, step by step of its loop, that the square root in generated C is the integer next to the root."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import z3
from pycparser import c_ast

from strapgen.evidence.overflow.c_types import Model


def is_root(function: c_ast.FuncDef, model: Model, nearest: bool) -> bool:
    """Return whether a function is proved to return the integer next to the square root of an integer.

    The loop tries one bit of the root at a time. Before the bit 2^k is tried, P is the root so far, a multiple of
    2^(k+1) with P^2 <= square < (P + 2^(k+1))^2; the variables hold ``root = 2^(k+1) P``, ``rest = square - P^2`` and
    ``bit = 4^k``. The body of the loop is executed on formulas for every k, which shows that this stays so, and that no
    step leaves the type. After the last bit ``root`` is P.
    """
    *before, loop = _up_to_loop(function.body.block_items)
    after = function.body.block_items[len(before) + 1 :]
    square = z3.Real("square")
    bits = model.named(tuple(function.decl.type.args.params[0].type.type.names)).bits
    run = _Run({"square": square}, bits)
    run.block(before)
    bit = run.known["bit"].as_long()
    first = bit.bit_length() // 2
    if bit != 4**first or 4 ** (first + 1) < 2 ** (bits - 1) or not _says_more_than_zero(loop.cond):
        return False
    if not _proved(
        [square >= 0, square < 2 ** (bits - 1)], [run.known["rest"] == square, run.known["root"] == 0]
    ):
        return False
    # The end first: of the proof it is the quick part.
    return _ends(after, square, bits, nearest) and all(
        _keeps(loop, square, k, bits) for k in reversed(range(first + 1))
    )


def _up_to_loop(statements: list[Any]) -> list[Any]:
    count = next(k for k, statement in enumerate(statements) if isinstance(statement, c_ast.While))
    return statements[: count + 1]


def _says_more_than_zero(condition: Any) -> bool:
    return (
        isinstance(condition, c_ast.BinaryOp)
        and condition.op == "!="
        and condition.left.name == "bit"
        and int(condition.right.value.rstrip("u")) == 0
    )


def _keeps(loop: c_ast.While, square: Any, k: int, bits: int) -> bool:
    """Return whether the body of the loop keeps what holds of its variables when it tries a bit."""
    unit, part = 2**k, z3.Real("part")
    holds = [
        part >= 0,
        part * part <= square,
        square < (part + 2 * unit) * (part + 2 * unit),
        square < 2 ** (bits - 1),
    ]
    run = _Run({"rest": square - part * part, "root": 2 * unit * part, "bit": z3.RealVal(unit * unit)}, bits)
    run.block(loop.stmt.block_items)
    accepted = (part + unit) * (part + unit) <= square
    after = z3.If(accepted, part + unit, part)
    claims = [
        run.known["root"] == unit * after,
        run.known["rest"] == square - after * after,
        run.known["bit"] == (unit // 2) ** 2,
        after * after <= square,
        square < (after + unit) * (after + unit),
        *run.safe,
    ]
    return _proved(holds, claims)


def _ends(statements: list[Any], square: Any, bits: int, nearest: bool) -> bool:
    """Return whether what follows the loop rounds the root and returns it."""
    part = z3.Real("part")
    holds = [part >= 0, part * part <= square, square <= part * part + 2 * part, square < 2 ** (bits - 1)]
    run = _Run({"rest": square - part * part, "root": part}, bits)
    run.block(statements)
    root = run.result
    if not nearest:
        return _proved(holds, [*run.safe, root == part])
    # rest and root are integers, so that rest > root says rest >= root + 1
    up = square - part * part > part
    near = [root == z3.If(up, part + 1, part)]
    below = [*holds, z3.Or(square - part * part <= part, square - part * part >= part + 1)]
    return _proved(below, [*run.safe, *near, root * root - root <= square, square <= root * root + root])


class _Run:
    """Statements on variables without a sign, executed on formulas."""

    def __init__(self, known: Mapping[str, Any], bits: int) -> None:
        self.known = dict(known)
        self.safe: list[Any] = []
        self.result: Any = None
        self._bits = bits

    def block(self, statements: list[Any]) -> None:
        """Execute statements."""
        for statement in statements:
            match statement:
                case c_ast.Decl():
                    self.known[statement.name] = self._value(statement.init)
                case c_ast.Assignment():
                    self.known[statement.lvalue.name] = self._assigned(statement)
                case c_ast.If(iffalse=None):
                    self._if(statement)
                case c_ast.Return():
                    self.result = self._value(statement.expr)
                case _:
                    raise NotImplementedError(type(statement).__name__)

    def _if(self, statement: c_ast.If) -> None:
        left, right = self._value(statement.cond.left), self._value(statement.cond.right)
        condition = {">=": left >= right, ">": left > right}[statement.cond.op]
        before = dict(self.known)
        self.block(statement.iftrue.block_items)
        for name, value in before.items():
            if self.known[name] is not value:
                self.known[name] = z3.If(condition, self.known[name], value)

    def _assigned(self, statement: c_ast.Assignment) -> Any:
        left, right = self.known[statement.lvalue.name], self._value(statement.rvalue)
        match statement.op:
            case "+=":
                return self._held(left + right)
            case "-=":
                return left - right  # the claims of the loop hold it to what is not negative
            case ">>=":
                # What is shifted is a multiple of the divisor, or the last bit, which becomes 0.
                factor = 2 ** right.as_long()
                value = z3.simplify(left / factor)
                return z3.RealVal(0) if z3.is_rational_value(value) and value.as_fraction() < 1 else value
        raise NotImplementedError(statement.op)

    def _held(self, value: Any) -> Any:
        self.safe.append(z3.And(value >= 0, value < 2**self._bits))
        return value

    def _value(self, node: Any) -> Any:
        match node:
            case c_ast.Constant():
                return z3.RealVal(int(node.value.rstrip("u")))
            case c_ast.ID():
                return self.known[node.name]
            case c_ast.Cast():
                return self._value(node.expr)
            case c_ast.BinaryOp(op="+"):
                return self._held(self._value(node.left) + self._value(node.right))
            case c_ast.BinaryOp(op="<<"):
                return z3.RealVal(self._value(node.left).as_long() << self._value(node.right).as_long())
        raise NotImplementedError(type(node).__name__)


def _proved(holds: list[Any], claims: list[Any]) -> bool:
    for claim in claims:
        solver = z3.SolverFor("QF_NRA")
        solver.add(*holds, z3.Not(claim))
        if solver.check() != z3.unsat:
            return False
    return True
