"""The core of a kernel is its transition as a function of a few vectors that are linear in the inputs."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy as sp

from strapgen.ir.program import Program
from strapgen.ir.signals import Signal
from strapgen.kernel.covariants import Decomposition, Frame, NotCovariantError
from strapgen.kernel.kernel import Kernel, Stage, degree, evaluate_stages
from strapgen.lowering.canonical.vectors import Form, components, independent


@dataclass(frozen=True)
class Core:
    """A transition as a function of vectors."""

    inputs: list[str]  # names of the input vectors
    vectors: dict[str, tuple[Signal, Form]]  # those that the transition needs, along the inputs
    stages: list[Stage]  # lead from these vectors to the transition, which is the last
    #: The sum of the increments of the step if the inputs are increments in the order of time.
    whole: Form | None = None

    @property
    def transition(self) -> Signal:
        """The transition."""
        return self.stages[-1].signal

    def evaluate(self, values: dict[str, Any]) -> list[Any]:
        """Return the elements of the transition for given elements of the vectors."""
        known = evaluate_stages(self.stages, values)
        return [known[name] for name in self.transition.elements]

    def degree(self) -> int:
        """Return an upper bound of the degree of the transition in the vectors."""
        elements = [name for signal, _ in self.vectors.values() for name in signal.elements]
        highest = degree(self.stages, elements, self.transition.elements)
        if highest is None:
            raise NotCovariantError("the transition is no polynomial")
        return highest

    def base(self) -> list[Form]:
        """Return independent vectors that span all the others."""
        forms = [form for _, form in self.vectors.values()]
        return [forms[k] for k in independent(forms)]


def extract(kernel: Kernel) -> Core:
    """Separate the stages of a kernel that are linear in its input vectors, all inputs but the first, from the rest."""
    columns: list[list[sp.Symbol]] = [[], [], []]
    inputs: dict[str, Signal] = {}
    for signal in kernel.inputs[1:]:
        for k in range(0, signal.size, 3):
            vector = Signal.vector(
                signal.elements[k].removesuffix("_x"), signal.elements[k].removesuffix("_x")
            )
            if vector.elements != signal.elements[k : k + 3]:
                raise NotCovariantError(f"{signal.name} does not consist of vectors")
            inputs[vector.name] = vector
            for column, element in zip(columns, vector.elements, strict=True):
                column.append(sp.Symbol(element, real=True))
    vectors: dict[str, tuple[Signal, Form]] = {}
    stages: list[Stage] = []
    for stage in kernel.stages:
        form = _linear(stage, columns)
        if form is None:
            stages.append(stage)
        elif stage.signal.name in vectors:
            raise NotCovariantError(f"two vectors are called {stage.signal.name}")
        else:
            vectors[stage.signal.name] = stage.signal, form
        if stage.signal.name == kernel.transition:
            break
    elements = stages[-1].signal.elements
    prefix = elements[0].rpartition("_")[0]
    if stages[-1].signal.shape != (3, 3) and {*elements} != {f"{prefix}_{label}" for label in "xyzs"}:
        raise NotCovariantError(f"the transition of {kernel.name} is neither a quaternion nor a matrix")
    used = set().union(*(e.free_symbols for stage in stages for e in stage.expressions))
    for k, (name, vector) in enumerate(inputs.items()):
        if used & {column[k] for column in columns}:
            if name in vectors:
                raise NotCovariantError(f"two vectors are called {name}")
            vectors[name] = vector, tuple(Fraction(int(j == k)) for j in range(len(inputs)))
    needed = {symbol.name for symbol in used}
    vectors = {name: (s, form) for name, (s, form) in vectors.items() if needed & set(s.elements)}
    if not vectors:
        raise NotCovariantError(f"the transition of {kernel.name} is always the same")
    whole = None
    if len(kernel.inputs) == 2 and kernel.inputs[1].name == "increments":
        previous = kernel.attitude_step.previous if kernel.attitude_step else 0
        whole = tuple(Fraction(int(k >= previous)) for k in range(len(inputs)))
    return Core(list(inputs), vectors, stages, whole)


def decompose(core: Core) -> Decomposition:
    """Return the covariant decomposition of a core's transition in the vectors of its base.

    The coefficients are solved for in a rotated frame, where many coordinates are zero, and checked in all coordinates.
    """
    base = core.base()
    frame = Frame(len(base))
    elements = _transition(core, base, frame.ring, frame.vectors)
    if core.transition.shape == (3, 3):
        decomposition = frame.matrix(elements)
    else:
        by_label = dict(zip((e[-1] for e in core.transition.elements), elements, strict=True))
        decomposition = frame.quaternion([by_label[axis] for axis in "xyz"], by_label["s"])
    ring, vectors = _coordinates(len(base))
    expected = _transition(core, base, ring, vectors)
    values = decomposition.evaluate(vectors)
    if decomposition.scalar is not None:
        values = [dict(zip("xyzs", values, strict=True))[e[-1]] for e in core.transition.elements]
    if [ring(value) for value in values] != expected:
        raise NotCovariantError("the transition does not turn with its vectors")
    return decomposition


def verify(core: Core, program: Program) -> None:
    """Require that a program computes the transition of a core, as an identity between polynomials.

    The identity covers all elements of all inputs, in coordinates of which the transition needs as few as possible.
    """
    count = len(core.inputs)
    units = [tuple(Fraction(int(j == k)) for j in range(count)) for k in range(count)]
    base = [*core.base(), *units]
    base = [base[k] for k in independent(base)]
    ring, vectors = _coordinates(count)
    values: dict[str, Any] = {}
    for name, unit in zip(core.inputs, units, strict=True):
        vector = _combine(components(unit, base), ring, vectors)
        values |= dict(zip(Signal.vector(name, name).elements, vector, strict=True))
    (computed,) = program.transition_program().run(values).values()
    if [ring(element) for element in computed] != _transition(core, base, ring, vectors):
        raise ArithmeticError(
            f"{program.name}: the canonical form differs from the transition it was derived from"
        )


def _coordinates(count: int) -> tuple[Any, list[list[Any]]]:
    """Return the ring of polynomials in the coordinates of `count` vectors, and the vectors in it."""
    ring, *generators = sp.ring([f"y{k}_{axis}" for k in range(count) for axis in "xyz"], sp.QQ)
    return ring, [generators[3 * k : 3 * k + 3] for k in range(count)]


def _combine(coefficients: list[Fraction], ring: Any, vectors: list[list[Any]]) -> list[Any]:
    return [
        sum(
            (
                u[axis] * sp.Rational(x.numerator, x.denominator)
                for x, u in zip(coefficients, vectors, strict=True)
            ),
            ring.zero,
        )
        for axis in range(3)
    ]


def _transition(core: Core, base: list[Form], ring: Any, vectors: list[list[Any]]) -> list[Any]:
    """Evaluate a core where the vectors of a base have given coordinates."""
    values: dict[str, Any] = {}
    for signal, form in core.vectors.values():
        vector = _combine(components(form, base), ring, vectors)
        values |= dict(zip(signal.elements, vector, strict=True))
    try:
        return [ring(element) for element in core.evaluate(values)]
    except (TypeError, ValueError):  # SymPy's errors where a ring element meets what is no polynomial
        raise NotCovariantError("the transition is no polynomial") from None


def _linear(stage: Stage, columns: list[list[sp.Symbol]]) -> Form | None:
    """Return the coefficients of a stage along the input vectors; None if they differ between the axes."""
    if len(stage.expressions) != 3:
        return None
    forms = []
    for expression, column in zip(stage.expressions, columns, strict=True):
        coefficients = {symbol: sp.Integer(0) for symbol in column}
        for term in sp.Add.make_args(expression):
            coefficient, symbol = term.as_coeff_Mul()
            if not coefficient.is_Rational or symbol not in coefficients:
                return None
            coefficients[symbol] += coefficient
        forms.append(tuple(Fraction(int(c.p), int(c.q)) for c in coefficients.values()))
    return forms[0] if forms[0] == forms[1] == forms[2] and any(forms[0]) else None
