"""Exact Jacobians of an attitude step, for Kalman filters and least squares, and of the vectors of a step.

The step is bilinear in state and transition, so its Jacobian by the state holds the elements of the transition. That by
the increments follows from the covariant form of the transition: a polynomial transition of few vectors is
differentiated as a function of those; of a rotation vector that is one, the exponential follows by the chain rule;
every other transition is differentiated stage by stage, as are rotation vector, sculling term, velocity and position.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import sympy as sp

from strapgen.catalogue.kernels import attitude_step, velocity_position
from strapgen.catalogue.kernels.attitude_step import chosen, smooth
from strapgen.catalogue.kinematics import DCM, EULER, KINEMATICS, Kinematics
from strapgen.catalogue.methods.method import PHI, Method, Samples, increments_signal
from strapgen.ir.signals import Signal
from strapgen.kernel import algebra
from strapgen.kernel.covariants import Decomposition, Frame, NotCovariantError
from strapgen.kernel.derivatives import CovariantFunction, add_tangents, tangent
from strapgen.kernel.kernel import Kernel, KernelBuilder, Stage, degree, evaluate_stages

#: Most vectors of a transition that is differentiated as a function of them, and of a rotation vector.
_FEW, _SOME = 2, 6
#: Highest degree of a polynomial that is expanded.
_HIGHEST = 8
#: Highest power of the rotation vector in the derivative of its exponential.
SERIES = 16


def dcm(method: Method, increments: int, previous: int = 0, ahead: int = 0) -> Kernel:
    """Derive the Jacobians of a step of direction cosines, see `jacobians`."""
    return jacobians("dcm", method, (increments, previous, ahead))


def euler(method: Method, increments: int, previous: int = 0, ahead: int = 0) -> Kernel:
    """Derive the Jacobians of a step of Euler parameters, see `jacobians`."""
    return jacobians("euler", method, (increments, previous, ahead))


def cayley_klein(method: Method, increments: int, previous: int = 0, ahead: int = 0) -> Kernel:
    """Derive the Jacobians of a step of Cayley-Klein parameters, see `jacobians`."""
    return jacobians("cayley-klein", method, (increments, previous, ahead))


def jacobians(name: str, method: Method, counts: tuple[int, int, int]) -> Kernel:
    """Derive the Jacobians of the next state by the state (N, N) and by K increments (N, 3 K) in 1/rad.

    Rows and columns count elements row by row, each taken as independent.
    """
    kinematics = KINEMATICS[name]
    build = KernelBuilder()
    state = build.input(kinematics.state)
    turn = transition(build, kinematics, method, counts)
    size = kinematics.state.size
    units = [sp.zeros(*kinematics.identity.shape) for _ in range(size)]
    for place, unit in enumerate(units):
        unit[place] = sp.Integer(1)
    build.output(
        _matrix("state_jacobian", (size, size), "next state by the state", ""),
        _side_by_side([kinematics.product(unit, turn.value) for unit in units]),
    )
    columns = turn.columns(state)
    build.output(
        _matrix("increments_jacobian", (size, len(columns)), "next state by the increments", "1/rad"),
        _side_by_side(columns),
    )
    suffix, option, source = chosen(method, *counts)
    return build.kernel(
        f"{name}-jacobian-{suffix}",
        f"{kinematics.title}: Jacobians of the step by {method.title} from {source}",
        f"{kinematics.source}; {method.title}: {method.source}; its derivatives",
        order=method.step_order(*counts),
        arguments=f"{name}-jacobian {option}",
    )


def error_state(method: Method, increments: int, previous: int = 0, ahead: int = 0) -> Kernel:
    """Derive the matrices F, R, L by which attitude errors, and errors of K increments, go through a step.

    With the right error r, C_true = C (I + [r x]) in body axes, r+ = A^T r + R e for errors e (3 K,) of the increments,
    where A turns from the body axes at the end of the step to those at its start and F = A^T. With the left error l,
    C_true = (I + [l x]) C in reference axes, l+ = l + C L e with the attitude C at the start of the step.
    """
    counts = increments, previous, ahead
    build = KernelBuilder()
    turn = transition(build, EULER, method, counts)
    matrix = algebra.quaternion_matrix(turn.value).applyfunc(sp.expand)
    build.output(
        Signal.matrix(
            "right_transition",
            "F",
            meaning="transition of a small attitude error, from the axes at the start of the step to those at its end",
            frame="b to b",
        ),
        matrix.T,
    )
    for name, before, axes in (("right", False, "end"), ("left", True, "start")):
        what = f"attitude error, in the axes at the {axes} of the step, by the increments"
        columns = turn.angles(before)
        build.output(_matrix(f"{name}_noise", (3, len(columns)), what, ""), _side_by_side(columns))
    suffix, option, source = chosen(method, *counts)
    return build.kernel(
        f"error-state-{suffix}",
        f"Attitude error over a step by {method.title} from {source}",
        f"{method.source}; its derivatives",
        order=method.step_order(*counts),
        arguments=f"error-state {option}",
    )


@dataclass(frozen=True)
class _StepTransition:
    """The transition of a step under construction and its derivatives."""

    kinematics: Kinematics
    value: sp.Matrix  # the transition
    parts: Sequence[sp.Matrix]  # its derivatives along directions; they take the state before they are summed
    sums: Sequence[Sequence[sp.Expr]]  # weights of these directions, for every element of the increments
    build: KernelBuilder

    def columns(self, state: sp.Matrix) -> list[sp.Matrix]:
        """Add stages for the derivatives of the next state by every element of the increments."""
        along = []
        for place, part in enumerate(self.parts):
            meaning = f"derivative of the next state along direction {place}"
            product = self.kinematics.product(state, part)
            along.append(_stage(self.build, self.kinematics, f"along_{place}", meaning, product))
        return self._sum_directions(along)

    def angles(self, before: bool) -> list[sp.Matrix]:
        """Add stages for the step's rotations by the increments, axes at its start if `before`, else at its end."""
        conjugate = algebra.quaternion_conjugate(self.value)
        name, axes = ("left", "start") if before else ("right", "end")
        along = []
        for place, part in enumerate(self.parts):
            pair = (part, conjugate) if before else (conjugate, part)
            turned = 2 * algebra.quaternion_product(*pair)[:3, :]
            meaning = f"rotation by direction {place}, axes at the {axes} of the step"
            along.append(
                self.build.stage(Signal.vector(f"{name}_{place}", f"{name}_{place}", meaning=meaning), turned)
            )
        return self._sum_directions(along)

    def _sum_directions(self, along: Sequence[sp.Matrix]) -> list[sp.Matrix]:
        """Return the derivatives by the elements of the increments from those along the directions."""
        columns = []
        for weights in self.sums:
            total = sp.zeros(*along[0].shape)
            for weight, part in zip(weights, along, strict=True):
                if weight != 0:
                    total += weight * part
            columns.append(total)
        return columns


def transition(
    build: KernelBuilder, kinematics: Kinematics, method: Method, counts: tuple[int, int, int]
) -> _StepTransition:
    """Add stages for the transition of a step and for its derivatives by the elements of the increments."""
    count = sum(counts)
    increments = build.input(increments_signal(*counts))
    apart = KernelBuilder()
    samples = Samples(apart, counts[0], counts[1], method.nodes, counts[2], method.fit)
    forms = [samples.fit.legendre(m) for m in range(samples.fit.degree + 1)]
    if method.rotation_vector is not None and len(forms) <= _SOME:
        vector = method.rotation_vector(apart, samples)
        function = _function(build, apart.stages, vector, increments, forms)
        if function is not None:
            return _exponential(build, kinematics, *function)
    apart = KernelBuilder()
    samples = Samples(apart, counts[0], counts[1], method.nodes, counts[2], method.fit)
    written = method.transition(apart, smooth(apart, kinematics, SERIES), samples)
    value = apart.stage(kinematics.transition, written)
    if count <= _FEW:
        forms = [
            [sp.Integer(1)] * count,
            *([sp.Integer(int(k == j)) for j in range(count)] for k in range(count - 1)),
        ]
        function = _function(build, apart.stages, value, increments, forms)
        if function is not None:
            covariant, sums = function
            places = _places(kinematics)
            value = build.stage(kinematics.transition, _reorder(kinematics, covariant.values(), places))
            parts = [
                _reorder(kinematics, covariant.derivative(vector, axis), places)
                for vector in range(count)
                for axis in range(3)
            ]
            return _StepTransition(kinematics, value, parts, sums, build)
    return _stage_by_stage(build, kinematics, apart.stages, value, increments)


def _function(
    build: KernelBuilder,
    stages: Sequence[Stage],
    value: sp.Matrix,
    increments: sp.Matrix,
    forms: Sequence[Sequence[sp.Expr]],
) -> tuple[CovariantFunction, list[list[sp.Expr]]] | None:
    """Return a value as a covariant function of sums of the increments, and the weights of its directions.

    None if it is no polynomial of them with rational coefficients, or does not turn with them.
    """
    highest = degree(stages, [element.name for element in increments], [element.name for element in value])
    if highest is None or highest > _HIGHEST:
        return None
    frame = Frame(len(forms))
    form = sp.Matrix([list(row) for row in forms])
    # The value depends on these sums alone, so that any increments with the right sums will do.
    inverse = form.T * (form * form.T).inv()
    if not all(number.is_Rational for number in (*form, *inverse)):
        return None
    known = {}
    for place, element in enumerate(increments):
        row, axis = divmod(place, 3)
        numbers = [sp.QQ(int(x.p), int(x.q)) for x in inverse[row, :]]
        known[element.name] = sum(
            (vector[axis] * x for vector, x in zip(frame.vectors, numbers, strict=True)), frame.ring.zero
        )
    try:
        evaluated = evaluate_stages(stages, known)
        elements = [frame.ring(evaluated[symbol.name]) for symbol in value]
        decomposition = _decompose(frame, value, elements)
    except (
        NotCovariantError,
        TypeError,
        ValueError,
    ):  # the last two: it is no polynomial
        return None
    vectors = []
    for k, weights in enumerate(forms):
        total = sp.zeros(3, 1)
        for m, weight in enumerate(weights):
            total += weight * increments[m, :].T
        single = all(element.is_Symbol for element in total)
        signal = Signal.vector(f"sum_{k}", f"sum_{k}", unit="rad", meaning=f"sum {k} of the increments")
        vectors.append(total if single else build.stage(signal, total))
    sums = [
        [row[m] if axis == other else sp.Integer(0) for row in forms for other in range(3)]
        for m in range(increments.rows)
        for axis in range(3)
    ]
    return CovariantFunction(build, decomposition, vectors), sums


def _decompose(frame: Frame, value: sp.Matrix, elements: list[object]) -> Decomposition:
    """Return the decomposition of a matrix, of a quaternion by the names of its elements, or of a vector."""
    if value.shape == (3, 3):
        return frame.matrix(elements)
    by_label = dict(zip((symbol.name[-1] for symbol in value), elements, strict=True))
    scalar = by_label.get("s", frame.ring.zero)
    return frame.quaternion([by_label[axis] for axis in "xyz"], scalar)


def _exponential(
    build: KernelBuilder,
    kinematics: Kinematics,
    function: CovariantFunction,
    sums: Sequence[Sequence[sp.Expr]],
) -> _StepTransition:
    """Return the transition of a rotation vector, with its derivatives by the elements of that."""
    phi = build.stage(PHI, function.values()[:3])
    square = build.value("phi_square", algebra.dot(phi, phi), "square of the angle of the step")
    written = kinematics.exponential(phi, SERIES, square)
    value = build.stage(kinematics.transition, written)
    parts = []
    for axis in range(3):
        slopes = [sp.diff(x, phi[axis]) + 2 * phi[axis] * sp.diff(x, square) for x in written]
        meaning = f"derivative of the transition along element {axis} of the rotation vector"
        parts.append(_stage(build, kinematics, f"slope_{axis}", meaning, sp.Matrix(*written.shape, slopes)))
    count = len(sums[0]) // 3
    steep = [function.derivative(vector, axis)[:3] for vector in range(count) for axis in range(3)]
    named = []
    for k, one in enumerate(steep):
        meaning = f"derivative of the rotation vector along direction {k}"
        named.append(build.stage(Signal.vector(f"turn_{k}", f"turn_{k}", meaning=meaning), one))
    columns = []
    for place, weights in enumerate(sums):
        total = sp.zeros(3, 1)
        for weight, one in zip(weights, named, strict=True):
            if weight != 0:
                total += weight * one
        signal = Signal.vector(
            f"column_{place}",
            f"column_{place}",
            meaning=f"derivative of the rotation vector by element {place}",
        )
        columns.append(list(build.stage(signal, total)))
    return _StepTransition(kinematics, value, parts, columns, build)


def _stage_by_stage(
    build: KernelBuilder,
    kinematics: Kinematics,
    stages: Sequence[Stage],
    value: sp.Matrix,
    increments: sp.Matrix,
) -> _StepTransition:
    """Return the transition of any method, with its derivatives by the increments by the chain rule."""
    build.stages += stages
    parts = []
    for place, element in enumerate(increments):
        changes = add_tangents(build, stages, {element: sp.Integer(1)}, f"by_{place}", "1")
        parts.append(value.applyfunc(lambda symbol, changes=changes: changes.get(symbol, sp.Integer(0))))
    count = len(parts)
    sums = [[sp.Integer(int(j == k)) for j in range(count)] for k in range(count)]
    return _StepTransition(kinematics, value, parts, sums, build)


def _places(kinematics: Kinematics) -> list[int]:
    """Return the places of a transition's elements in a matrix, or in a quaternion with its scalar last."""
    if kinematics is DCM:
        return list(range(9))
    return ["xyzs".index(element[-1]) for element in kinematics.transition.elements]


def _reorder(kinematics: Kinematics, elements: Sequence[sp.Expr], places: Sequence[int]) -> sp.Matrix:
    return sp.Matrix(*kinematics.identity.shape, [elements[place] for place in places])


def _stage(
    build: KernelBuilder, kinematics: Kinematics, name: str, meaning: str, value: sp.Matrix
) -> sp.Matrix:
    """Name a quantity of the shape of a transition."""
    elements = tuple(f"{name}_{element.rsplit('_', 1)[1]}" for element in kinematics.transition.elements)
    return build.stage(Signal(name, kinematics.transition.shape, elements, meaning=meaning), value)


def _matrix(name: str, shape: tuple[int, int], what: str, unit: str) -> Signal:
    elements = tuple(f"{name}_{row}_{column}" for row in range(shape[0]) for column in range(shape[1]))
    return Signal(name, shape, elements, unit=unit or "1", meaning=f"Jacobian of the {what}, row by row")


def _side_by_side(columns: Sequence[sp.Matrix]) -> list[sp.Expr]:
    """Return the elements of a matrix of columns, row by row."""
    return [column[row] for row in range(len(columns[0])) for column in columns]


def rotation_vector(method: Method, increments: int, previous: int = 0, ahead: int = 0) -> Kernel:
    """Derive the Jacobian of the rotation vector of a step, see `jacobian`."""
    return jacobian(attitude_step.rotation_vector(method, increments, previous, ahead))


def sculling(method: Method, increments: int, previous: int = 0) -> Kernel:
    """Derive the Jacobians of the sculling term of a step, see `jacobian`."""
    return jacobian(attitude_step.sculling(method, increments, previous))


def velocity_and_position(method: Method, increments: int, previous: int = 0, ahead: int = 0) -> Kernel:
    """Derive the Jacobians of the velocity and position change of a step, see `jacobian`."""
    return jacobian(velocity_position.step(method, increments, previous, ahead))


def jacobian(kernel: Kernel) -> Kernel:
    """Derive ``<output>_by_<input>`` for every pair: rows are elements of the output, columns of the input.

    The expressions of the kernel must have derivatives everywhere.
    """
    build = KernelBuilder()
    for signal in kernel.inputs:
        build.input(signal)
    build.stages = list(kernel.stages)
    outputs = []
    for signal in kernel.inputs:
        rows: dict[str, list[list[sp.Expr]]] = {stage.signal.name: [] for stage in kernel.outputs}
        for element in signal.elements:
            along = {sp.Symbol(element, real=True): sp.Integer(1)}
            known = add_tangents(build, kernel.stages, along, f"by_{element}", "1")
            for stage in kernel.outputs:
                symbols = (sp.Symbol(name, real=True) for name in stage.signal.elements)
                pairs = zip(symbols, stage.expressions, strict=True)
                rows[stage.signal.name].append([tangent(*pair, known) for pair in pairs])
        for stage in kernel.outputs:
            outputs.append((_derivatives_signal(stage.signal, signal), rows[stage.signal.name]))
    for matrix, columns in outputs:
        build.output(matrix, [column[row] for row in range(matrix.shape[0]) for column in columns])
    first, _, rest = kernel.arguments.partition(" ")
    return replace(
        build.kernel(
            kernel.name.replace(first, f"{first}-jacobian", 1), f"Jacobians of: {kernel.title}", kernel.source
        ),
        order=kernel.order,
        arguments=f"{first}-jacobian {rest}",
    )


def _derivatives_signal(output: Signal, by: Signal) -> Signal:
    name = f"{output.name}_by_{by.name}"
    elements = tuple(f"{name}_{row}_{column}" for row in range(output.size) for column in range(by.size))
    unit = "1" if output.unit == by.unit else f"({output.unit})/{by.unit}" if by.unit != "1" else output.unit
    meaning = f"derivatives of {output.name} by {by.name}, row by row"
    return Signal(name, (output.size, by.size), elements, unit=unit, meaning=meaning)
