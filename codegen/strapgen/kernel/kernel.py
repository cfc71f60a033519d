"""Kernels are exact symbolic algorithms; each formula is written once, in a kernel."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import sympy as sp

from strapgen.ir.exceptions import InputError
from strapgen.ir.kernel_info import AttitudeStep, KernelInfo, Recursion
from strapgen.ir.notebook_display import counted_shape, notebook_latex, short_repr
from strapgen.ir.program import RESOLUTION
from strapgen.ir.renamed import current, renamed
from strapgen.ir.signals import Signal, after
from strapgen.kernel import reading
from strapgen.kernel.algebra import evaluate

#: The distance from 1 to the next number of the target that a kernel is lowered for; 0 in exact arithmetic.
EPSILON = sp.Symbol(RESOLUTION, real=True)
#: Fields of a kernel by their names of the version before.
_RENAMED = {"companions": "attitude_step", "own": "bundled_kernels"}


def symbols(signal: Signal) -> sp.Matrix:
    """Return the real symbols of a signal: 3 x 3 for a matrix, otherwise one column.

    >>> symbols(Signal.vector("rate", "w")).T
    Matrix([[w_x, w_y, w_z]])
    """
    shape = signal.shape if len(signal.shape) == 2 else (signal.size, 1)
    return sp.Matrix(*shape, [sp.Symbol(name, real=True) for name in signal.elements])


@dataclass(frozen=True)
class Stage:
    """A named quantity and the expressions of its elements.

    Parameters
    ----------
    signal : Signal
        Name, elements, unit and meaning.
    expressions : tuple of Expr
        One for each element, in row-major order.

    Examples
    --------
    >>> from strapgen import derive
    >>> derive("euler", "rk4", 2).stages[0].expressions[0]
    3*d1_x/2 - d2_x/2
    """

    signal: Signal
    expressions: tuple[sp.Expr, ...]

    __repr__ = short_repr

    def _in_words(self) -> str:
        shape = counted_shape(self.signal.shape)
        return f"{self.signal.name} ({shape}, unit {self.signal.unit}): {self.signal.meaning}".rstrip(": ")


def evaluate_stages(
    stages: Iterable[Stage],
    values: Mapping[str, Any],
    number: Callable[[sp.Rational], Any] | None = None,
    function: Callable[[sp.Expr, list[Any]], Any] | None = None,
) -> dict[str, Any]:
    """Return the given values and those of all elements of the stages, evaluated in order.

    There is a value for every symbol that no stage defines; `number` and `function` are those of `algebra.evaluate`.
    """
    known = {RESOLUTION: sp.S.Zero, **values}
    for stage in stages:
        for name, expression in zip(stage.signal.elements, stage.expressions, strict=True):
            known[name] = evaluate(expression, known, number, function)
    return known


@renamed(**_RENAMED)
@dataclass(frozen=True, repr=False)
class Kernel(KernelInfo):
    """An algorithm as exact expressions. Its `KernelInfo` is the words and names that every stage passes on.

    Parameters
    ----------
    name, title, source, arguments, notes, attitude_step, order, recursion
        See `KernelInfo`.
    inputs : tuple of Signal
        Inputs; their elements are the free symbols of the expressions.
    outputs : tuple of Stage
        Outputs, each with one expression an element.
    stages : tuple of Stage
        Intermediate quantities in order; later expressions may use their symbols.
    transition : str or None
        Name of the stage on which the state's update depends linearly, see `Program.transition`.
    bundled_kernels : tuple of Kernel
        Kernels that `attitude_step` names and the catalogue does not have.
    unknowns : tuple of str
        Names of the coefficients that are not known yet. Series and conditions are polynomials in them; no code can be
        generated before `substitute` has replaced all of them.
    previous, ahead : int
        Of a step of velocity and position, numbers of samples from before it and from after it that it takes in
        addition; `attitude_step` has those of an attitude step.

    Examples
    --------
    >>> from strapgen import derive
    >>> kernel = derive("euler", "rk4", 2)
    >>> kernel.name, [signal.name for signal in kernel.inputs]
    ('euler-rk4-2', ['state', 'increments'])
    """

    inputs: tuple[Signal, ...]
    outputs: tuple[Stage, ...]
    stages: tuple[Stage, ...] = ()
    transition: str | None = None
    bundled_kernels: tuple[Kernel, ...] = ()
    unknowns: tuple[str, ...] = ()
    previous: int = 0
    ahead: int = 0

    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        ins = ", ".join(f"{signal.name} ({counted_shape(signal.shape)})" for signal in self.inputs)
        outs = ", ".join(
            f"{stage.signal.name} ({counted_shape(stage.signal.shape)})" for stage in self.outputs
        )
        order = "" if self.order is None else f"; order {self.order.step}"
        return f"{self.name}: {self.title}\n{ins} -> {outs}{order}"

    @property
    def info(self) -> KernelInfo:
        """Names, source, orders and recursion, which programs and sources of the kernel keep."""
        return KernelInfo(**{field.name: getattr(self, field.name) for field in fields(KernelInfo)})

    @property
    def takes_velocity(self) -> bool:
        """Whether it is a step of velocity and position, from increments of both kinds."""
        return [signal.name for signal in self.inputs] == ["increments", "velocity_increments"]

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Inputs, stages and outputs."""
        return (*self.inputs, *(stage.signal for stage in (*self.stages, *self.outputs)))

    def expand(
        self, values: Mapping[str, Any] | None = None, number: Callable[[sp.Rational], Any] | None = None
    ) -> dict[str, list[Any]]:
        """Evaluate the outputs with all stages substituted.

        Parameters
        ----------
        values : mapping of str to number or ring element, optional
            A value for every input element: numbers, polynomials or symbols. By default the inputs' own
            symbols, which gives each output as one expression of the inputs.
        number : callable, optional
            Converts a rational number, as for `algebra.evaluate`.

        Returns
        -------
        dict of str to list
            For each output its elements, row-major.
        """
        if values is None:
            values = {n: sp.Symbol(n, real=True) for signal in self.inputs for n in signal.elements}
        values = {name: sp.Symbol(name, real=True) for name in self.unknowns} | dict(values)
        known = evaluate_stages((*self.stages, *self.outputs), values, number)
        return {stage.signal.name: [known[n] for n in stage.signal.elements] for stage in self.outputs}

    def polynomials(self) -> dict[str, list[Any]]:
        """Return every output element as a polynomial of the inputs, with rational coefficients.

        Returns
        -------
        dict of str to list of ring element
            For each output its elements, row-major; the unknowns are the last generators of their ring.

        Raises
        ------
        TypeError
            If the kernel divides or calls functions.
        """
        names = [*(name for signal in self.inputs for name in signal.elements), *self.unknowns]
        ring, *generators = sp.ring(names, sp.QQ)
        try:
            outputs = self.expand(dict(zip(names, generators, strict=True)))
            return {name: [ring(element) for element in elements] for name, elements in outputs.items()}
        except (TypeError, ValueError):  # SymPy's errors where a ring element meets what is no polynomial
            raise TypeError(f"{self.name} is no polynomial: it divides or calls functions") from None

    def require_known(self) -> None:
        """Refuse a kernel with unknowns where numbers are needed.

        Raises
        ------
        InputError
            If it has any.
        """
        if self.unknowns:
            raise InputError(
                f"kernel {self.name} holds the unknowns {', '.join(self.unknowns)}; strapgen solve states what they "
                "may be, and --constant or Kernel.substitute sets them"
            )

    def substitute(self, values: Mapping[str, Any]) -> Kernel:
        """Return the kernel with values, or expressions in the unknowns that remain, in place of unknowns.

        Parameters
        ----------
        values : mapping of str to number or Expr
            By the name of the unknown; a text is read exactly, such as "57/80" or "1 - a/2".

        Returns
        -------
        Kernel
            An ordinary kernel once no unknown is left.

        Raises
        ------
        InputError
            If the kernel has no such unknown, or a value holds an unknown symbol, an inexact number, or none.

        Examples
        --------
        >>> build = KernelBuilder()
        >>> w = build.scalar(Signal.scalar("w"))
        >>> a, b = build.parameter("a", "b")
        >>> _ = build.output(Signal.scalar("sum"), [a * w + b])
        >>> kernel = build.kernel("sum", "a sum", "this example")
        >>> kernel.substitute({"a": "1/2"}).expand(), kernel.substitute({"a": "b/2"}).unknowns
        ({'sum': [b + w/2]}, ('b',))
        """
        chosen = reading.values_of_unknowns(f"kernel {self.name}", self.unknowns, values)

        def replaced(stages: tuple[Stage, ...]) -> tuple[Stage, ...]:
            return tuple(Stage(s.signal, tuple(x.xreplace(chosen) for x in s.expressions)) for s in stages)

        stages, outputs = replaced(self.stages), replaced(self.outputs)
        if any(x.has(sp.nan, sp.zoo) for stage in (*stages, *outputs) for x in stage.expressions):
            raise InputError(f"kernel {self.name} divides by zero with these values of its unknowns")
        remaining = reading.remaining_unknowns(self.unknowns, chosen)
        return replace(self, stages=stages, outputs=outputs, unknowns=remaining)


class KernelBuilder:
    """Collects the inputs, stages and outputs of a kernel as its formulas are written.

    Examples
    --------
    >>> build = KernelBuilder()
    >>> w = build.input(Signal.vector("rate", "w"))
    >>> v = build.stage(Signal.vector("twice", "v"), 2 * w)
    >>> v.T
    Matrix([[v_x, v_y, v_z]])
    """

    __repr__ = short_repr

    def _in_words(self) -> str:
        parts = {"input": self.inputs, "stage": [s.signal for s in self.stages]}
        parts["output"] = [s.signal for s in self.outputs]
        names = {kind: ", ".join(signal.name for signal in signals) for kind, signals in parts.items()}
        return "\n".join(f"{kind} {text or 'none'}" for kind, text in names.items())

    def __init__(self) -> None:
        self.inputs: list[Signal] = []
        self.stages: list[Stage] = []
        self.outputs: list[Stage] = []
        self.unknowns: dict[sp.Symbol, sp.Symbol] = {}
        self.states: dict[str, str] = {}
        self.reset: set[str] = set()

    def parameter(self, *names: str | sp.Symbol) -> Any:
        """Declare coefficients that are not known yet, by name or as symbols, and return their symbols.

        Returns
        -------
        Symbol or tuple of Symbol
            As many as there are arguments. The symbols that were passed may be used in formulas too.

        Examples
        --------
        >>> build = KernelBuilder()
        >>> a, b = build.parameter(*sp.symbols("a b"))
        """
        declared = [sp.Symbol(name, real=True) if isinstance(name, str) else name for name in names]
        self.unknowns |= {symbol: sp.Symbol(symbol.name, real=True) for symbol in declared}
        real = tuple(self.unknowns[symbol] for symbol in declared)
        return real if len(real) != 1 else real[0]

    def input(self, signal: Signal) -> sp.Matrix:
        """Declare an input and return its symbols."""
        self.inputs.append(signal)
        return symbols(signal)

    def scalar(self, signal: Signal) -> sp.Symbol:
        """Declare a scalar input and return its symbol."""
        return self.input(signal)[0]

    def stage(self, signal: Signal, expressions: Iterable[Any]) -> sp.Matrix:
        """Name an intermediate quantity and return its symbols, which later expressions may use."""
        self.stages.append(Stage(signal, _expressions(expressions)))
        return symbols(signal)

    def value(self, name: str, expression: Any, meaning: str = "") -> sp.Symbol:
        """Name a scalar intermediate quantity and return its symbol."""
        return self.stage(Signal.scalar(name, meaning=meaning), [expression])[0]

    def output(self, signal: Signal, expressions: Iterable[Any]) -> sp.Matrix:
        """Declare an output and return its symbols, which later outputs may use."""
        self.outputs.append(Stage(signal, _expressions(expressions)))
        return symbols(signal)

    def feedback(
        self, signal: Signal, expressions: Iterable[Any], output: Signal | None = None, reset: bool = False
    ) -> sp.Matrix:
        """Declare the output that takes the place of an input in the next call, and return its symbols.

        Parameters
        ----------
        signal : Signal
            The input.
        expressions : iterable of Expr
            Its elements in the next call.
        output : Signal, optional
            By default the input's signal with ``next_`` before its names.
        reset : bool, optional
            Whether the input is zero again at the start of each cycle of a slower loop.

        Examples
        --------
        >>> build = KernelBuilder()
        >>> x = build.scalar(Signal.scalar("x"))
        >>> _ = build.feedback(Signal.scalar("x"), [x / 2])
        >>> build.kernel("lag", "a lag", "this example").recursion.states
        (('x', 'next_x'),)
        """
        output = output or after(signal)
        self.states[signal.name] = output.name
        if reset:
            self.reset.add(signal.name)
        return self.output(output, expressions)

    def kernel(self, name: str, title: str, source: str, **rest: Any) -> Kernel:
        """Return the kernel; `rest` are further fields of `Kernel`.

        Of an attitude step, `previous` and `ahead` go into its `attitude_step`, where its back ends read them.

        Raises
        ------
        InputError
            If its `attitude_step` states other numbers.
        """
        rest = current(rest, _RENAMED)
        if self.states:
            retained = tuple(state for state in self.states if state not in self.reset)
            rest.setdefault("recursion", Recursion(tuple(self.states.items()), retained))
        step = rest.get("attitude_step")
        if isinstance(step, AttitudeStep):
            stated = {what: rest.pop(what) for what in ("previous", "ahead") if rest.get(what)}
            for what, number in stated.items():
                if getattr(step, what) not in (0, number):
                    raise InputError(
                        f"kernel {name}: {what} is {number}, and {getattr(step, what)} in its attitude_step"
                    )
            rest["attitude_step"] = replace(step, **stated)
        stages, outputs = (
            tuple(Stage(s.signal, tuple(self._real(x) for x in s.expressions)) for s in stages)
            for stages in (self.stages, self.outputs)
        )
        unknowns = tuple(dict.fromkeys(symbol.name for symbol in self.unknowns.values()))
        return Kernel(name, title, source, tuple(self.inputs), outputs, stages, unknowns=unknowns, **rest)

    def _real(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression with the real symbols of the unknowns."""
        return expression.xreplace(self.unknowns) if self.unknowns else expression


def _expressions(items: Iterable[Any] | Sequence[Any]) -> tuple[sp.Expr, ...]:
    return tuple(sp.sympify(item) for item in items)


@dataclass(frozen=True)
class _Degree:
    """The degree of a polynomial; sums and products of degrees follow those of the polynomials."""

    value: int

    def __add__(self, other: _Degree) -> _Degree:
        return max(self, other, key=lambda degree: degree.value)

    def __mul__(self, other: _Degree) -> _Degree:
        return _Degree(self.value + other.value)

    def __pow__(self, exponent: int) -> _Degree:
        return _Degree(self.value * exponent)


def degree(stages: Iterable[Stage], variables: Iterable[str], results: Sequence[str]) -> int | None:
    """Return an upper bound of the degree of the elements `results` in the variables; None if they are no polynomials.

    >>> from strapgen import derive
    >>> step = derive("euler", "rk4", increments=2)
    >>> degree(step.stages, [e for s in step.inputs for e in s.elements], ["p_x", "p_s"])
    4
    """
    try:
        known = evaluate_stages(stages, {name: _Degree(1) for name in variables}, lambda number: _Degree(0))
        return max(int(known[name].value) for name in results)
    except (AttributeError, TypeError, ValueError):  # SymPy's errors where no sum or product is left
        return None


#: Decimal digits of a rounded constant: twice those of the arithmetic that programs are compared with.
DIGITS = 80


def rationalize(kernel: Kernel) -> Kernel:
    """Return a kernel with its irrational constants rounded and a note that says so; itself if it has none."""
    stages, outputs = (tuple(map(_round_stage, group)) for group in (kernel.stages, kernel.outputs))
    if stages == kernel.stages and outputs == kernel.outputs:
        return kernel
    note = f"Irrational constants are rounded to {DIGITS} digits, and once more to the format of the target."
    return replace(kernel, stages=stages, outputs=outputs, notes=(*kernel.notes, note))


def _round_stage(stage: Stage) -> Stage:
    return replace(stage, expressions=tuple(map(_round, stage.expressions)))


def _round(expression: sp.Expr) -> sp.Expr:
    numbers = expression.atoms(sp.Pow, sp.NumberSymbol, sp.Function)
    if not any(part.is_number and not part.is_Rational for part in numbers):
        return expression  # rebuilding it could make SymPy multiply it out
    if expression.is_number:
        return sp.Rational(sp.N(expression, DIGITS))
    if expression.is_Mul:  # all its numbers together are one constant
        numbers, rest = expression.as_independent(*expression.free_symbols, as_Add=False)
        if numbers != 1:
            return sp.Mul(_round(numbers), _round(rest))
    return expression.func(*map(_round, expression.args))
