"""Programs as functions of other frameworks, by `Program.run` on their numbers; each is loaded when asked for.

Where a framework differentiates, a cosine and sin(x)/x of a root become functions of the radicand: the root has no
slope at zero, but these have one. What a selection leaves out is evaluated at a place where it has a slope.
"""

from __future__ import annotations

import importlib
import keyword
import math
import operator
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, InputTypeError, MissingExtraError
from strapgen.ir.program import OPERATIONS, Constant, Node, Operation, Program, Reference, references
from strapgen.ir.signals import Signal

#: Radicands from which on sin(x)/x and the cosine are computed as such, and the terms of the series below it.
_SMALL, _TERMS = 1.0, 13
_Guard = Callable[[Node, int], Node]


def function_of(program: Program, framework: str) -> Any:
    """Return a program as a function of a framework, see `Program.function`."""
    checks.choice("framework", framework, FRAMEWORKS)
    try:
        module = importlib.import_module(framework)
    except ModuleNotFoundError as error:
        if error.name != framework:
            raise
        raise MissingExtraError(f"{framework} is needed: pip install 'strapgen[{framework}]'") from None
    return FRAMEWORKS[framework](program, module)


def _jax(program: Program, jax: Any) -> Callable[..., Any]:
    def array(value: Any) -> Any:
        if not jax.config.jax_enable_x64:
            raise InputError(
                'jax computes in float32 here; jax.config.update("jax_enable_x64", True) is needed'
            )
        return jax.numpy.asarray(value, jax.numpy.float64)

    array(0.0)
    return _on_arrays(program, jax.numpy, array)


def _torch(program: Program, torch: Any) -> Callable[..., Any]:
    return _on_arrays(program, torch, lambda value: torch.as_tensor(value, dtype=torch.float64))


def _on_arrays(program: Program, library: Any, array: Callable[[Any], Any]) -> Callable[..., Any]:
    """Return a function of arrays with any leading dimensions."""
    smooth = _smooth(program)
    operations = _operations(library, library.arctan2, library.maximum, library.where)

    def call(*values: Any) -> Any:
        elements: dict[str, Any] = {}
        batches = []
        for signal, value in zip(program.inputs, _arguments(program, values), strict=True):
            given = array(value)
            lead = len(given.shape) - len(signal.shape)
            if lead < 0 or tuple(given.shape[lead:]) != signal.shape:
                raise _wrong_shape(signal, given.shape, "..., ")
            batches.append(tuple(given.shape[:lead]))
            flat = given.reshape((*batches[-1], signal.size))
            elements.update((name, flat[..., k]) for k, name in enumerate(signal.elements))
        try:
            batch = tuple(library.broadcast_shapes(*batches))
        except (ValueError, RuntimeError):
            listed = ", ".join(map(str, batches))
            raise InputError(f"the leading dimensions {listed} of the inputs do not go together") from None
        results = smooth.run(elements, lambda exact: array(float(exact)), operations).values()
        return _each(
            library.stack([library.broadcast_to(x, batch) for x in parts], -1).reshape(
                batch + result.signal.shape
            )
            for parts, result in zip(results, program.outputs, strict=True)
        )

    return _described(call, program)


def _casadi(program: Program, casadi: Any) -> Any:
    inputs = [casadi.SX.sym(signal.name, *_rows_and_columns(signal)) for signal in program.inputs]
    elements = {
        name: value[divmod(k, value.shape[1])]
        for signal, value in zip(program.inputs, inputs, strict=True)
        for k, name in enumerate(signal.elements)
    }
    operations = _operations(casadi, casadi.atan2, casadi.fmax, casadi.if_else)
    results = _smooth(program).run(elements, lambda exact: casadi.SX(float(exact)), operations)
    outputs = [
        casadi.reshape(casadi.vertcat(*results[signal.name]), *reversed(_rows_and_columns(signal))).T
        for signal in (result.signal for result in program.outputs)
    ]
    names = [signal.name for signal in program.inputs]
    return casadi.Function(program.name, inputs, outputs, names, [*results])


def _sympy(program: Program, sympy: Any) -> Callable[..., Any]:
    def select(condition: Any, yes: Any, no: Any) -> Any:
        return sympy.Piecewise((yes, condition), (no, True))

    operations = _operations(sympy, sympy.atan2, sympy.Max, select, half_turn=sympy.pi) | {"sinc": sympy.sinc}

    def call(*values: Any) -> Any:
        elements: dict[str, Any] = {}
        for signal, value in zip(program.inputs, _arguments(program, values), strict=True):
            matrix = sympy.Matrix(value if signal.shape else [value])
            if matrix.shape != _rows_and_columns(signal):
                raise _wrong_shape(signal, matrix.shape)
            elements.update(zip(signal.elements, matrix, strict=True))
        results = program.run(
            elements, lambda exact: sympy.Rational(exact.numerator, exact.denominator), operations
        )
        return _each(
            sympy.Matrix(*_rows_and_columns(result.signal), results[result.signal.name])
            if result.signal.shape
            else results[result.signal.name][0]
            for result in program.outputs
        )

    return _described(call, program)


#: The operations as Python writes them.
_TEXTS = {
    "add": "{} + {}",
    "subtract": "{} - {}",
    "multiply": "{} * {}",
    "divide": "{} / {}",
    "negate": "-{}",
    "sqrt": "math.sqrt({})",
    "sin": "math.sin({})",
    "cos": "math.cos({})",
    "sinc": "math.sin({0}) / {0} if {0} != 0.0 else 1.0",
    "atan2": "math.atan2({}, {})",
    "direction": "math.atan2({}, {})",
    "wrap": "{0} - math.tau if {0} > math.pi else {0} + math.tau if {0} < -math.pi else {0}",
    "maximum": "max({}, {})",
    "at_least": "{} >= {}",
    "select": "{1} if {0} else {2}",
}


def _numba(program: Program, numba: Any) -> Any:
    """Return a compiled function: the program runs on names, and every operation writes a line."""
    names = [signal.name + "_" * keyword.iskeyword(signal.name) for signal in program.inputs]
    lines = [f"def {program.name}({', '.join(names)}):"]

    def line(text: str) -> str:
        lines.append(f"    _{len(lines)} = {text}")
        return f"_{len(lines) - 1}"

    elements: dict[str, str] = {}
    for signal, name in zip(program.inputs, names, strict=True):
        if signal.shape:
            said = f"{signal.name} has another shape; {signal.shape} is needed"
            lines.append(f"    if {name}.shape != {signal.shape}:\n        raise ValueError({said!r})")
        for element, place in zip(signal.elements, _places(signal), strict=True):
            elements[element] = line(f"np.float64({name}{place})")
    operations = {
        kind: lambda *arguments, text=text: line(text.format(*arguments)) for kind, text in _TEXTS.items()
    }
    results = program.run(elements, lambda exact: f"({float(exact)!r})", operations)
    returned = []
    for result in program.outputs:
        parts = results[result.signal.name]
        returned.append(line(f"np.empty({result.signal.shape})") if result.signal.shape else parts[0])
        if result.signal.shape:
            places = _places(result.signal)
            lines += [f"    {returned[-1]}{place} = {x}" for place, x in zip(places, parts, strict=True)]
    lines.append(f"    return {', '.join(returned)}")
    known: dict[str, Any] = {"math": math, "np": importlib.import_module("numpy")}
    exec(compile("\n".join(lines), f"<{program.name} for numba>", "exec"), known)
    return numba.njit(_described(known[program.name], program))


#: The frameworks, and what makes a function of each.
FRAMEWORKS: Mapping[str, Callable[[Program, Any], Any]] = {
    "jax": _jax,
    "torch": _torch,
    "casadi": _casadi,
    "numba": _numba,
    "sympy": _sympy,
}


def _operations(
    library: Any,
    atan2: Callable[..., Any],
    maximum: Callable[..., Any],
    select: Callable[..., Any],
    half_turn: Any = math.pi,
) -> dict[str, Callable[..., Any]]:
    """Return the function of each operation on the numbers of a library, those of `_smooth` among them."""

    def wrap(x: Any) -> Any:
        below = select(x < -half_turn, x + 2 * half_turn, x)
        return select(x > half_turn, x - 2 * half_turn, below)

    def of_square(first: int, closed: Callable[[Any], Any]) -> Callable[[Any], Any]:
        """Return an even function of x with the series of (-x^2)^k / (2k + first)!, by x^2."""

        def value(square: Any) -> Any:
            is_small = square < _SMALL
            near, series = select(is_small, square, 0 * square), 0 * square
            for k in reversed(range(_TERMS)):
                series = 1 / math.factorial(2 * k + first) - near * series
            return select(is_small, series, closed(library.sqrt(select(is_small, 0 * square + 1, square))))

        return value

    return {
        **OPERATIONS,
        **{name: getattr(library, name) for name in ("sqrt", "sin", "cos")},
        "atan2": atan2,
        "direction": atan2,
        "maximum": maximum,
        "at_least": operator.ge,
        "select": select,
        "wrap": wrap,
        "cos_of_square": of_square(0, library.cos),
        "sinc_of_square": of_square(1, lambda x: library.sin(x) / x),
    }


def _smooth(program: Program) -> Program:
    """Return a program with the same values that has a slope wherever its results have one.

    Its operations are those of programs and ``cos_of_square`` and ``sinc_of_square``, of the square of an angle.
    """
    known = {assignment.name: assignment.value for assignment in program.body}
    nodes = [*known.values(), *(node for result in program.results for node in result.nodes)]
    uses = Counter(name for node in nodes for name in references(node))

    def squared(node: Node) -> Node | None:
        """Return the square of a multiple of a root, without the root."""
        if isinstance(node, Reference) and node.name in known:
            return squared(known[node.name])
        if not isinstance(node, Operation):
            return None
        if node.kind == "sqrt":
            return node.arguments[0]
        *factors, inner = node.arguments
        if node.kind == "negate":
            return squared(inner)
        if node.kind == "multiply" and isinstance(factors[0], Constant):
            square, factor = squared(inner), factors[0].value
            return square and Operation("multiply", (Constant(factor * factor), square))
        return None

    def rewritten(node: Node, guard: _Guard | None) -> Node:
        if guard and isinstance(node, Reference) and uses[node.name] == 1 and node.name in known:
            return rewritten(known[node.name], guard)
        if not isinstance(node, Operation):
            return node
        kind, arguments = node.kind, node.arguments
        if kind in ("cos", "sinc"):
            square = squared(arguments[0])
            if square is None and kind == "sinc":
                square = Operation("multiply", arguments * 2)
            if square is not None:
                return Operation(f"{kind}_of_square", (rewritten(square, guard),))
        if kind == "select":
            condition, *choices = arguments

            def chosen(first: bool) -> _Guard:
                def value(node: Node, safe: int) -> Node:
                    ways = (node, Constant(Fraction(safe)))
                    one = Operation("select", (condition, *(ways if first else reversed(ways))))
                    return guard(one, safe) if guard else one

                return value

            each = (rewritten(way, chosen(first)) for way, first in zip(choices, (True, False), strict=True))
            return Operation(kind, (condition, *each))
        arguments = tuple(rewritten(argument, guard) for argument in arguments)
        if guard and kind in ("divide", "sqrt", "atan2", "direction"):
            arguments = (*arguments[:-1], guard(arguments[-1], 1))
        return Operation(kind, arguments)

    body = tuple(replace(each, value=rewritten(each.value, None)) for each in program.body)
    outputs = tuple(
        replace(each, nodes=tuple(rewritten(node, None) for node in each.nodes)) for each in program.outputs
    )
    return replace(program, body=body, outputs=outputs, transition=None)


def _arguments(program: Program, values: Sequence[Any]) -> Sequence[Any]:
    if len(values) != len(program.inputs):
        names = ", ".join(signal.name for signal in program.inputs)
        raise InputTypeError(f"{program.name} takes {names}; {len(values)} arguments are given")
    return values


def _wrong_shape(signal: Signal, shape: Sequence[int], lead: str = "") -> InputError:
    needed = f"({lead}{', '.join(map(str, signal.shape))})"
    return InputError(f"{signal.name} has shape {tuple(shape)}; {needed} is needed")


def _each(results: Any) -> Any:
    """Return the result, or a tuple of several."""
    listed = tuple(results)
    return listed[0] if len(listed) == 1 else listed


def _rows_and_columns(signal: Signal) -> tuple[int, int]:
    """Return the shape of a signal as a matrix; a vector is a column."""
    columns = signal.shape[-1] if len(signal.shape) > 1 else 1
    return signal.size // columns, columns


def _places(signal: Signal) -> list[str]:
    """Return the indices of the elements of a signal in Python."""
    places = [""]
    for length in signal.shape:
        places = [f"{place}{', ' if place else ''}{k}" for place in places for k in range(length)]
    return [f"[{place}]" if place else "" for place in places]


def _described(function: Callable[..., Any], program: Program) -> Callable[..., Any]:
    """Return a function with the name of its program, and its arguments in words."""
    function.__name__ = function.__qualname__ = program.name
    signals = [*program.inputs, *(result.signal for result in program.outputs)]
    lines = [f"{s.name} {s.shape}: {s.meaning}, unit {s.unit}" for s in signals]
    function.__doc__ = "\n".join([f"{program.title}.", "", *lines])
    return function
