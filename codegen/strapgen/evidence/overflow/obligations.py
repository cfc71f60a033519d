"""Walks through the C of a kernel and lists overflows and range violations that are not excluded by proof."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import z3
from pycparser import c_ast
from pycparser.c_generator import CGenerator

from strapgen.evidence.collection import Subject
from strapgen.evidence.overflow.c_types import IntegerType, Model
from strapgen.evidence.overflow.expressions import (
    ExpressionFormulas,
    Fact,
    Number,
    Obligation,
    Prover,
    Variable,
)
from strapgen.evidence.overflow.lemmas import ParsedSource, is_root, rounds_to_nearest, shifts_down

# What an attempt may take. A later one proves more ranges on the way, where the first does not do.
_EFFORTS = (100_000, 1_000_000, 4_000_000)


def unproved(subject: Subject, files: Mapping[str, str], model: Model) -> list[Obligation]:
    """Return the unproved obligations of the C of a kernel: no overflow, and all integers in their ranges.

    The statements of the kernel become formulas; the functions of its own file are proved as lemmas.
    """
    nearest = subject.fixed.interface.settings.rounding == "nearest"
    ranges = {value.name: (value.low, value.high) for value in subject.fixed.body}
    for output in subject.fixed.interface.outputs:
        for k in range(output.signal.size):
            ranges[f"{output.signal.name}[{k}]"] = output.low, output.high

    functions = _functions(subject, files)
    for effort in _EFFORTS:
        kernel = KernelStatements(functions, subject.name, model, ranges, nearest, effort)
        left = kernel.obligations()
        if not left:
            break
    # A tool may read a simpler form of what shifts down, which must do the same; the rest it reads as it is.
    texts = {name: _text(function) for name, function in functions.items()}
    simpler = {
        name: function
        for name, function in _functions(subject, files, "__FRAMAC__").items()
        if _text(function) != texts.get(name)
    }
    for some in (functions, simpler):
        left = [*left, *_unproved_lemmas(some, subject.name, model, kernel.places, nearest)]
    return left


def _functions(subject: Subject, files: Mapping[str, str], *defined: str) -> dict[str, c_ast.FuncDef]:
    return ParsedSource(files, f"{subject.name}.c", defined).functions


def _unproved_lemmas(
    functions: Mapping[str, c_ast.FuncDef],
    name: str,
    model: Model,
    places: Mapping[str, set[int]],
    nearest: bool,
) -> list[Obligation]:
    """Return the functions of the file whose assumed results are not proved."""
    left = []
    for part in ("fit", "shr", "asr"):
        function = functions.get(f"{name}_{part}")
        if function is not None and not shifts_down(function, model, places[part]):
            left.append(Obligation(f"{name}_{part}", "it must return its argument shifted down"))
    near = functions.get(f"{name}_near")
    if near is not None and not rounds_to_nearest(near, model):
        left.append(
            Obligation(f"{name}_near", "it must return the high word of its argument, to the nearest")
        )
    root = functions.get(f"{name}_rt")
    if root is not None and not is_root(root, model, nearest):
        left.append(Obligation(f"{name}_rt", "it must return the integer next to a square root"))
    return left


class KernelStatements:
    """The C function of a kernel, statement by statement."""

    def __init__(
        self,
        functions: Mapping[str, c_ast.FuncDef],
        name: str,
        model: Model,
        ranges: Mapping[str, tuple[int, int]],
        nearest: bool,
        effort: int,
    ) -> None:
        self._functions, self._name, self._model, self._ranges = functions, name, model, ranges
        self._nearest = nearest
        self._prover = Prover(effort)
        self._open: list[Obligation] = []
        self._expressions = ExpressionFormulas(model, self._prover, self._call, self._open)
        self._half_is_proved = False
        self.places: dict[str, set[int]] = {part: set() for part in ("fit", "shr", "asr")}

    def obligations(self) -> list[Obligation]:
        """Return the unproved obligations; none if the kernel is safe."""
        function = self._functions[self._name]
        known = {}
        for parameter in function.decl.type.args.params:
            kind = self._kind(parameter.type.type)
            for k in range(int(parameter.type.dim.value)):
                place = f"{parameter.name}[{k}]"
                known[place] = Number.of(Variable(place, kind.low, kind.high), kind)
        self._block(function.body.block_items, known)
        return self._open

    def _kind(self, node: Any) -> IntegerType:
        return self._model.named(tuple(node.type.names))

    def _block(self, statements: list[Any], known: dict[str, Number]) -> None:
        """Go through statements, and store the values that they declare and assign."""
        for statement in statements:
            self._expressions.place = f"{self._name}: {_subject(statement)}"
            match statement:
                case c_ast.Decl():
                    if statement.init is not None:
                        kind = self._kind(statement.type)
                        number = self._expressions.value(statement.init, known)
                        self._assign(statement.name, self._expressions.converted(number, kind), known)
                    else:
                        known[statement.name] = Number.constant(0, self._kind(statement.type))
                case c_ast.Assignment(op="="):
                    self._assigned(statement, known)
                case c_ast.If():
                    self._if(statement, known)
                case c_ast.Return():
                    return
                case _:
                    raise NotImplementedError(f"{type(statement).__name__} in {self._name}")

    def _assigned(self, statement: c_ast.Assignment, known: dict[str, Number]) -> None:
        target = statement.lvalue
        name = target.name
        if isinstance(target, c_ast.ArrayRef):
            name = f"{target.name.name}[{target.subscript.value}]"
        number = self._expressions.value(statement.rvalue, known)
        self._assign(name, self._expressions.converted(number, known[name].kind), known)
        if isinstance(target, c_ast.ArrayRef) and name in self._ranges:
            low, high = self._ranges[name]
            if not (low <= known[name].low and known[name].high <= high):
                self._open.append(Obligation(f"{self._name}: {name}", f"it must lie in {low} .. {high}"))

    def _assign(self, name: str, number: Number, known: dict[str, Number]) -> None:
        """Store a value, in the stated range if that is proved."""
        known[name] = number
        low, high = self._ranges.get(name, (number.low, number.high))
        if low <= number.low and number.high <= high:
            return
        if not self._prover.within(number, low, high):
            return
        low, high = max(low, number.low), min(high, number.high)
        if self._prover.path:
            known[name] = Number(number.kind, low, high, number.real, number.variables)
            return
        result = self._expressions.variable(low, high, name)
        result.facts.append(Fact(result.real == number.real, number.variables | {result}))
        known[name] = Number.of(result, number.kind)

    def _if(self, statement: c_ast.If, known: dict[str, Number]) -> None:
        if statement.iffalse is None and isinstance(_items(statement.iftrue)[-1], c_ast.Return):
            self._refuse(statement.cond, known)
            return
        condition = self._expressions.condition(statement.cond, known)
        branches = _items(statement.iftrue), _items(statement.iffalse)
        if isinstance(condition, bool):
            self._block(branches[0 if condition else 1], known)
            return
        after = []
        for fact, items in zip((condition, condition.negated()), branches, strict=True):
            learned = self._learn(statement.cond, fact is condition, known)
            inside = known | learned
            self._expressions.under(fact, lambda: self._block(items, inside))  # noqa: B023
            untouched = {name for name, number in learned.items() if inside[name] is number}
            after.append({name: known[name] if name in untouched else inside[name] for name in known})
        first, second = after
        for name in known:
            if first[name] is not second[name]:
                merged = self._expressions.merged(condition, first[name], second[name])
                self._assign(name, merged, known)

    def _learn(self, condition: Any, true: bool, known: Mapping[str, Number]) -> dict[str, Number]:
        """Return the values in a comparison with the intervals that its outcome leaves to them."""
        if not isinstance(condition, c_ast.BinaryOp) or condition.op not in (">", ">="):
            return {}
        left, right = (self._expressions.value(node, known) for node in (condition.left, condition.right))
        more = int((condition.op == ">") == true)
        sides = [(condition.left, left, right), (condition.right, right, left)]
        (name, larger, least), (other, smaller, most) = sides if true else sides[::-1]
        learned = {}
        if (place := _named(name)) is not None:
            learned[place] = known[place].between(least.low + more, larger.high)
        if (place := _named(other)) is not None:
            learned[place] = known[place].between(smaller.low, most.high - more)
        return learned

    def _refuse(self, condition: Any, known: dict[str, Number]) -> None:
        """Go on where a check has let the values pass."""
        if isinstance(condition, c_ast.BinaryOp) and condition.op == "||":
            self._refuse(condition.left, known)
            self._refuse(condition.right, known)
            return
        if isinstance(condition, c_ast.FuncCall):
            body = self._functions[condition.name.name]
            arguments = [self._expressions.value(node, known) for node in condition.args.exprs]
            inside = self._bound(body, arguments)
            (statement,) = body.body.block_items
            self._refuse(statement.expr, inside)
            return
        fact = self._expressions.condition(condition, known)
        assert not isinstance(fact, bool) or not fact, "a check that always refuses"
        if isinstance(fact, bool):
            return
        assert not self._prover.path, "a check inside a branch"
        passes = fact.negated()
        for variable in fact.variables:
            variable.facts.append(passes)
        self._narrow(condition, known)

    def _narrow(self, condition: c_ast.BinaryOp, known: dict[str, Number]) -> None:
        """Narrow the interval of a value that passes a comparison with a constant."""
        left = self._expressions.value(condition.left, known)
        right = self._expressions.value(condition.right, known)
        assert right.exact and condition.op in "<>", "a check compares with constants"
        low, high = (right.low, left.high) if condition.op == "<" else (left.low, right.low)
        low, high = max(low, left.low), min(high, left.high)
        if len(left.variables) == 1:
            (variable,) = left.variables
            if variable.real is left.real:
                variable.low, variable.high = low, high
        if isinstance(condition.left, c_ast.ID):
            known[condition.left.name] = left.between(low, high)

    def _bound(self, function: c_ast.FuncDef, arguments: list[Number]) -> dict[str, Number]:
        """Return the parameters of a function of the file with their values in a call."""
        return {
            parameter.name: self._expressions.converted(argument, self._kind(parameter.type))
            for parameter, argument in zip(function.decl.type.args.params, arguments, strict=True)
        }

    def _call(self, name: str, arguments: list[Number]) -> Number:
        """Return the result of a function of the file, by its lemma or by its statements."""
        function = self._functions[name]
        inside = self._bound(function, arguments)
        kind = self._kind(function.decl.type.type)
        part = name.removeprefix(f"{self._name}_")
        if part == "near":
            wide, half = inside["x"], 1 << (kind.bits - 1)
            moved = Number(wide.kind, wide.low + half, wide.high + half, wide.real + half, wide.variables)
            return self._expressions.converted(self._expressions.floored(moved, kind.bits), kind)
        if part in ("fit", "shr", "asr"):
            places = inside["n"].low
            self.places[part].add(places)
            return self._expressions.converted(self._expressions.floored(inside["x"], places), kind)
        if part == "half":
            return self._half(function, inside, kind)
        if part == "rt":
            return self._expressions.rooted(inside["square"], kind, self._nearest)
        return self._statements(function, inside, kind)

    def _statements(self, function: c_ast.FuncDef, inside: dict[str, Number], kind: IntegerType) -> Number:
        """Return the result of a function of the file by its statements."""
        *statements, last = function.body.block_items
        place = self._expressions.place
        self._block(statements, inside)
        self._expressions.place = place
        return self._expressions.converted(self._expressions.value(last.expr, inside), kind)

    def _half(self, function: c_ast.FuncDef, inside: dict[str, Number], kind: IntegerType) -> Number:
        """Return a high word from half words, which is proved to be below the product rounded down by up to two."""
        unit = 1 << kind.bits
        if not self._half_is_proved:
            words = [self._expressions.variable(kind.low, kind.high, name) for name in "ab"]
            known = {name: Number.of(word, kind) for name, word in zip("ab", words, strict=True)}
            self._expressions.shifted = []
            result = self._statements(function, known, kind)
            self._expressions.shifted = None
            lost = words[0].real * words[1].real - unit * result.real
            self._half_is_proved = self._prover.holds(
                Fact(z3.And(lost >= 0, lost < 3 * unit), result.variables | {*words})
            )
            if not self._half_is_proved:
                self._open.append(
                    Obligation(function.decl.name, "it must lie below the high word by up to 2")
                )
        a, b = inside["a"], inside["b"]
        ends = [x * y for x in (a.low, a.high) for y in (b.low, b.high)]
        product = Number(kind, min(ends), max(ends), a.real * b.real, a.variables | b.variables)
        word, below = self._expressions.floored(product, kind.bits), self._expressions.variable(0, 2, "below")
        variables = word.variables | {below}
        result = Number(kind, word.low - 2, word.high, word.real - below.real, variables)
        return self._expressions.converted(result, kind)


def _items(node: Any) -> list[Any]:
    if node is None:
        return []
    return node.block_items or [] if isinstance(node, c_ast.Compound) else [node]


def _named(node: Any) -> str | None:
    """Return the name of a value, if an expression is one, whatever type it is converted to."""
    while isinstance(node, c_ast.Cast):
        node = node.expr
    return str(node.name) if isinstance(node, c_ast.ID) else None


def _subject(statement: Any) -> str:
    """Return the variable of a statement, for a message."""
    match statement:
        case c_ast.Decl():
            return str(statement.name)
        case c_ast.Assignment(lvalue=c_ast.ArrayRef() as target):
            return f"{target.name.name}[{target.subscript.value}]"
        case c_ast.Assignment():
            return str(statement.lvalue.name)
    return type(statement).__name__.lower()


def _text(function: c_ast.FuncDef) -> str:
    """Return the C of a function."""
    return str(CGenerator().visit(function))
