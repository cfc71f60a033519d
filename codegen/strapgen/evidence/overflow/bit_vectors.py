"""Proofs by z3, bit by bit, that the shifts in generated C round down and have no undefined behaviour."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import z3
from pycparser import c_ast

from strapgen.evidence.overflow.c_types import IntegerType, Model


@dataclass(frozen=True)
class Bits:
    """A number of a C type as a bit vector."""

    kind: IntegerType
    vector: Any

    def extended(self, bits: int) -> Any:
        """Return the same number in more bits."""
        further = bits - self.kind.bits
        return z3.SignExt(further, self.vector) if self.kind.signed else z3.ZeroExt(further, self.vector)


class BitVectorFunction:
    """A C function without loops, executed on bit vectors."""

    def __init__(self, function: c_ast.FuncDef, model: Model) -> None:
        self._function, self._model = function, model
        self._path: list[Any] = []
        self.safe: list[Any] = []

    def result(self, arguments: Mapping[str, Bits]) -> Bits:
        """Return what a call returns."""
        known = dict(arguments)
        for statement in self._function.body.block_items:
            match statement:
                case c_ast.Decl():
                    value = self._value(statement.init, known)
                    known[statement.name] = self._converted(value, self._kind(statement.type))
                case c_ast.Return():
                    value = self._value(statement.expr, known)
                    return self._converted(value, self._kind(self._function.decl.type.type))
        raise NotImplementedError(f"{self._function.decl.name} does not return")

    def kind(self, parameter: str) -> IntegerType:
        """Return the type of a parameter."""
        (node,) = (p for p in self._function.decl.type.args.params if p.name == parameter)
        return self._kind(node.type)

    def _kind(self, node: Any) -> IntegerType:
        return self._model.named(tuple(node.type.names))

    def _require(self, condition: Any) -> None:
        self.safe.append(z3.Implies(z3.And(self._path), condition))

    def _converted(self, value: Bits, kind: IntegerType) -> Bits:
        if kind.bits > value.kind.bits:
            return Bits(kind, value.extended(kind.bits))
        vector = z3.Extract(kind.bits - 1, 0, value.vector)
        if kind.signed:  # the standard leaves it to the compiler what a number out of range becomes
            more = value.kind.bits + 1
            self._require(z3.SignExt(more - kind.bits, vector) == value.extended(more))
        return Bits(kind, vector)

    def _value(self, node: Any, known: Mapping[str, Bits]) -> Bits:
        match node:
            case c_ast.Constant():
                number, kind = self._model.literal(node.value)
                return Bits(kind, z3.BitVecVal(number, kind.bits))
            case c_ast.ID():
                return known[node.name]
            case c_ast.Cast():
                return self._converted(self._value(node.expr, known), self._kind(node.to_type.type))
            case c_ast.UnaryOp(op="~"):
                value = self._promoted(node.expr, known)
                return Bits(value.kind, ~value.vector)
            case c_ast.UnaryOp(op="-"):
                value = self._promoted(node.expr, known)
                return self._fitted(value.kind, -value.extended(value.kind.bits + 1))
            case c_ast.BinaryOp():
                return self._binary(node, known)
            case c_ast.TernaryOp():
                return self._chosen(node, known)
        raise NotImplementedError(f"{type(node).__name__} in {self._function.decl.name}")

    def _promoted(self, node: Any, known: Mapping[str, Bits]) -> Bits:
        value = self._value(node, known)
        return self._converted(value, self._model.promoted(value.kind))

    def _fitted(self, kind: IntegerType, vector: Any) -> Bits:
        """Return a result of more bits than its type has: it must fit, or without a sign its low bits stay."""
        low = z3.Extract(kind.bits - 1, 0, vector)
        if kind.signed:
            self._require(z3.SignExt(vector.size() - kind.bits, low) == vector)
        return Bits(kind, low)

    def _binary(self, node: c_ast.BinaryOp, known: Mapping[str, Bits]) -> Bits:
        left, right = self._promoted(node.left, known), self._promoted(node.right, known)
        if node.op == ">>":
            return self._shifted(left, right)
        kind = self._model.common(left.kind, right.kind)
        left, right = self._converted(left, kind), self._converted(right, kind)
        more = kind.bits + 1
        vectors = left.extended(more), right.extended(more)
        match node.op:
            case "+":
                return self._fitted(kind, vectors[0] + vectors[1])
            case "-":
                return self._fitted(kind, vectors[0] - vectors[1])
            case "&":
                return Bits(kind, left.vector & right.vector)
            case "|":
                return Bits(kind, left.vector | right.vector)
        raise NotImplementedError(f"{node.op} in {self._function.decl.name}")

    def _shifted(self, left: Bits, right: Bits) -> Bits:
        bits = left.kind.bits
        places = Bits(right.kind, right.vector).extended(64)
        self._require(z3.And(places >= 0, places < bits))
        if left.kind.signed:
            self._require(left.vector >= 0)
        wide = z3.Extract(bits - 1, 0, places) if bits <= 64 else z3.ZeroExt(bits - 64, places)
        return Bits(left.kind, z3.LShR(left.vector, wide))

    def _chosen(self, node: c_ast.TernaryOp, known: Mapping[str, Bits]) -> Bits:
        condition = self._condition(node.cond, known)
        values = []
        for way, branch in ((condition, node.iftrue), (z3.Not(condition), node.iffalse)):
            self._path.append(way)
            values.append(self._promoted(branch, known))
            self._path.pop()
        kind = self._model.common(values[0].kind, values[1].kind)
        first, second = (self._converted(value, kind).vector for value in values)
        return Bits(kind, z3.If(condition, first, second))

    def _condition(self, node: c_ast.BinaryOp, known: Mapping[str, Bits]) -> Any:
        left, right = self._promoted(node.left, known), self._promoted(node.right, known)
        kind = self._model.common(left.kind, right.kind)
        more = kind.bits + 1
        first, second = (self._converted(value, kind).extended(more) for value in (left, right))
        return {
            "<": first < second,
            ">": first > second,
            "<=": first <= second,
            ">=": first >= second,
            "==": first == second,
        }[node.op]


def shifts_down(function: c_ast.FuncDef, model: Model, places: Iterable[int]) -> bool:
    """Return whether a function of ``x`` and ``n`` is proved to return x / 2^n, rounded down.

    Returns: true if for every x whose quotient the result's type holds, that is what returns, by defined
    operations alone.
    """
    return all(_shifts_down(BitVectorFunction(function, model), n) for n in places)


def _shifts_down(function: BitVectorFunction, places: int) -> bool:
    kind, place_kind = function.kind("x"), function.kind("n")
    x = z3.BitVec("x", kind.bits)
    result = function.result(
        {"x": Bits(kind, x), "n": Bits(place_kind, z3.BitVecVal(places, place_kind.bits))}
    )
    quotient = x >> places
    low = z3.BitVecVal(result.kind.low, kind.bits)
    high = z3.BitVecVal(result.kind.high, kind.bits)
    solver = z3.SolverFor("QF_BV")
    solver.add(quotient >= low, quotient <= high)
    solver.add(z3.Not(z3.And(*function.safe, result.extended(kind.bits) == quotient)))
    return bool(solver.check() == z3.unsat)
