"""Proofs by z3 of the functions in generated C that shift and take square roots, from its syntax tree.

Shifts are executed on bit vectors: they must round down without undefined behaviour. The loop of the square root is
proved step by step: it must return the integer next to the root.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import z3
from pycparser import c_ast, c_parser

from strapgen.evidence.overflow.c_types import IntegerType, Model
from strapgen.storage.drafts import temporary_folder

_BITS = (8, 16, 32, 64)
_STDINT = "\n".join(
    [
        *(f"typedef int int{n}_t;\ntypedef unsigned int uint{n}_t;" for n in _BITS),
        *(f"#define INT{n}_C(x) ((int{n}_t)(x))\n#define UINT{n}_C(x) ((uint{n}_t)(x##u))" for n in _BITS),
        *(f"#define INT{n}_MAX ((int{n}_t){(1 << (n - 1)) - 1})" for n in _BITS),
        *(f"#define INT{n}_MIN ((int{n}_t)(-{(1 << (n - 1)) - 1} - 1))" for n in _BITS),
        *(f"#define UINT{n}_MAX ((uint{n}_t){(1 << n) - 1}u)" for n in _BITS),
        "",
    ]
)
# Types of 128 bits are a compiler's own; `c_types` knows them by the names that a file gives to them.
_EXTENSIONS = (
    "-D__SIZEOF_INT128__=16",
    "-D__extension__=",
    "-D__int128=long long int",
    "-D__attribute__(x)=",
)


class ParsedSource:
    """A C source file as a syntax tree."""

    def __init__(self, files: Mapping[str, str], source: str, defined: Sequence[str] = ()) -> None:
        self._files, self._source, self._defined = files, source, defined

    @cached_property
    def functions(self) -> dict[str, c_ast.FuncDef]:
        """The functions that the file defines, by name."""
        tree = c_parser.CParser().parse(self._preprocess())
        return {node.decl.name: node for node in tree.ext if isinstance(node, c_ast.FuncDef)}

    def _preprocess(self) -> str:
        with temporary_folder() as folder:
            for file, text in {**self._files, "stdint.h": _STDINT, "stddef.h": ""}.items():
                (folder / file).write_text(text, encoding="utf-8", newline="\n")
            macros = [f"-D{macro}=1" for macro in self._defined]
            command = ["cc", "-E", "-P", "-undef", "-nostdinc", "-I.", *_EXTENSIONS, *macros, self._source]
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
        return done.stdout


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
    return _returns(function, result, x >> places)


def rounds_to_nearest(function: c_ast.FuncDef, model: Model) -> bool:
    """Return whether a function of ``x`` is proved to return its high word, rounded to the nearest, likewise."""
    executed = BitVectorFunction(function, model)
    kind = executed.kind("x")
    x = z3.BitVec("x", kind.bits)
    result = executed.result({"x": Bits(kind, x)})
    word = result.kind.bits
    return _returns(executed, result, (z3.SignExt(1, x) + (1 << (word - 1))) >> word)


def _returns(function: BitVectorFunction, result: Bits, quotient: Any) -> bool:
    """Return whether a result is proved to be a quotient wherever its type holds that."""
    bits = quotient.size()
    solver = z3.SolverFor("QF_BV")
    solver.add(
        quotient >= z3.BitVecVal(result.kind.low, bits), quotient <= z3.BitVecVal(result.kind.high, bits)
    )
    solver.add(z3.Not(z3.And(*function.safe, result.extended(bits) == quotient)))
    return bool(solver.check() == z3.unsat)


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
        """Return the result of a call."""
        known = dict(arguments)
        for statement in self._function.body.block_items:
            match statement:
                case c_ast.Decl():
                    value = self._value(statement.init, known)
                    known[statement.name] = self._convert(value, self._kind(statement.type))
                case c_ast.Return():
                    value = self._value(statement.expr, known)
                    return self._convert(value, self._kind(self._function.decl.type.type))
        raise NotImplementedError(f"{self._function.decl.name} does not return")

    def kind(self, parameter: str) -> IntegerType:
        """Return the type of a parameter."""
        (node,) = (p for p in self._function.decl.type.args.params if p.name == parameter)
        return self._kind(node.type)

    def _kind(self, node: Any) -> IntegerType:
        return self._model.named(tuple(node.type.names))

    def _require(self, condition: Any) -> None:
        self.safe.append(z3.Implies(z3.And(self._path), condition))

    def _convert(self, value: Bits, kind: IntegerType) -> Bits:
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
                return self._convert(self._value(node.expr, known), self._kind(node.to_type.type))
            case c_ast.UnaryOp(op="~"):
                value = self._promote(node.expr, known)
                return Bits(value.kind, ~value.vector)
            case c_ast.UnaryOp(op="-"):
                value = self._promote(node.expr, known)
                return self._fit(value.kind, -value.extended(value.kind.bits + 1))
            case c_ast.BinaryOp():
                return self._binary(node, known)
            case c_ast.TernaryOp():
                return self._choose(node, known)
        raise NotImplementedError(f"{type(node).__name__} in {self._function.decl.name}")

    def _promote(self, node: Any, known: Mapping[str, Bits]) -> Bits:
        value = self._value(node, known)
        return self._convert(value, self._model.promoted(value.kind))

    def _fit(self, kind: IntegerType, vector: Any) -> Bits:
        """Return a result of more bits than its type has: it must fit, or without a sign its low bits stay."""
        low = z3.Extract(kind.bits - 1, 0, vector)
        if kind.signed:
            self._require(z3.SignExt(vector.size() - kind.bits, low) == vector)
        return Bits(kind, low)

    def _binary(self, node: c_ast.BinaryOp, known: Mapping[str, Bits]) -> Bits:
        left, right = self._promote(node.left, known), self._promote(node.right, known)
        if node.op == ">>":
            return self._shift(left, right)
        kind = self._model.common(left.kind, right.kind)
        left, right = self._convert(left, kind), self._convert(right, kind)
        more = kind.bits + 1
        vectors = left.extended(more), right.extended(more)
        match node.op:
            case "+":
                return self._fit(kind, vectors[0] + vectors[1])
            case "-":
                return self._fit(kind, vectors[0] - vectors[1])
            case "&":
                return Bits(kind, left.vector & right.vector)
            case "|":
                return Bits(kind, left.vector | right.vector)
        raise NotImplementedError(f"{node.op} in {self._function.decl.name}")

    def _shift(self, left: Bits, right: Bits) -> Bits:
        bits = left.kind.bits
        places = Bits(right.kind, right.vector).extended(64)
        self._require(z3.And(places >= 0, places < bits))
        if left.kind.signed:
            self._require(left.vector >= 0)
        wide = z3.Extract(bits - 1, 0, places) if bits <= 64 else z3.ZeroExt(bits - 64, places)
        return Bits(left.kind, z3.LShR(left.vector, wide))

    def _choose(self, node: c_ast.TernaryOp, known: Mapping[str, Bits]) -> Bits:
        condition = self._condition(node.cond, known)
        values = []
        for way, branch in ((condition, node.iftrue), (z3.Not(condition), node.iffalse)):
            self._path.append(way)
            values.append(self._promote(branch, known))
            self._path.pop()
        kind = self._model.common(values[0].kind, values[1].kind)
        first, second = (self._convert(value, kind).vector for value in values)
        return Bits(kind, z3.If(condition, first, second))

    def _condition(self, node: c_ast.BinaryOp, known: Mapping[str, Bits]) -> Any:
        left, right = self._promote(node.left, known), self._promote(node.right, known)
        kind = self._model.common(left.kind, right.kind)
        more = kind.bits + 1
        first, second = (self._convert(value, kind).extended(more) for value in (left, right))
        return {
            "<": first < second,
            ">": first > second,
            "<=": first <= second,
            ">=": first >= second,
            "==": first == second,
        }[node.op]


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
    if not _prove(
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
    """Return whether the body of the loop preserves its invariant."""
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
    return _prove(holds, claims)


def _ends(statements: list[Any], square: Any, bits: int, nearest: bool) -> bool:
    """Return whether the statements after the loop round the root and return it."""
    part = z3.Real("part")
    holds = [part >= 0, part * part <= square, square <= part * part + 2 * part, square < 2 ** (bits - 1)]
    run = _Run({"rest": square - part * part, "root": part}, bits)
    run.block(statements)
    root = run.result
    if not nearest:
        return _prove(holds, [*run.safe, root == part])
    # rest and root are integers, so that rest > root says rest >= root + 1
    up = square - part * part > part
    near = [root == z3.If(up, part + 1, part)]
    below = [*holds, z3.Or(square - part * part <= part, square - part * part >= part + 1)]
    return _prove(below, [*run.safe, *near, root * root - root <= square, square <= root * root + root])


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
                    self.known[statement.lvalue.name] = self._assign(statement)
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

    def _assign(self, statement: c_ast.Assignment) -> Any:
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


def _prove(holds: list[Any], claims: list[Any]) -> bool:
    for claim in claims:
        solver = z3.SolverFor("QF_NRA")
        solver.add(*holds, z3.Not(claim))
        if solver.check() != z3.unsat:
            return False
    return True
