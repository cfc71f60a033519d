"""The core of a kernel: what is linear in its inputs, and the proof that a program computes the rest."""

from dataclasses import replace
from fractions import Fraction

import pytest
import sympy as sp

from strapgen import catalogue, derive
from strapgen.ir.program import Assignment, Constant, Node, Operation, Program, walk
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import dot, quaternion_product, skew
from strapgen.kernel.covariants import NotCovariantError
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.lowering import lower
from strapgen.lowering.canonical import extract_core
from strapgen.lowering.canonical.core import Core, decompose, extract, verify

#: Two vectors in one signal.
PAIR = Signal("increments", (2, 3), tuple(f"d{k}_{axis}" for k in (1, 2) for axis in "xyz"))


def kernel(build: KernelBuilder, state: sp.Matrix, transition: sp.Matrix) -> Kernel:
    build.output(Signal.labelled("next", "next", "xyzs"), quaternion_product(state, transition))
    return build.kernel("made-up", "Made up", "this test", transition="transition")


def step(vector: sp.Matrix, scalar: sp.Expr, build: KernelBuilder, state: sp.Matrix) -> Kernel:
    return kernel(build, state, build.stage(Signal.labelled("transition", "p", "xyzs"), [*vector, scalar]))


def forms(core: Core) -> dict[str, tuple[Fraction, ...]]:
    return {name: form for name, (_, form) in core.vectors.items()}


def test_rates_of_a_fourth_order_step_are_linear_in_its_increments():
    core = extract(derive("euler", method="rk4", increments=2))
    half = Fraction(1, 2)
    assert core.inputs == ["d1", "d2"]
    assert forms(core) == {
        "half_turn_0": (3 * half, -half),
        "half_turn_1_2": (half, half),
        "half_turn_1": (-half, 3 * half),
    }
    assert [stage.signal.name for stage in core.stages][-2:] == ["slope_4", "transition"]
    assert len(core.stages) == 8
    # The last is a combination of the first two.
    assert core.base() == [(3 * half, -half), (half, half)]


@pytest.mark.parametrize("previous", [0, 1])
def test_the_sum_of_the_increments_of_a_step_leaves_out_those_before_it(previous):
    core = extract(derive("euler", method="rk2", increments=2, previous=previous))
    assert core.whole == (0,) * previous + (1, 1)


def test_an_input_that_is_used_as_it_stands_is_a_vector_too():
    assert forms(extract(derive("dcm", method="rk4", increments=1))) == {"d1": (1,)}
    rates = catalogue.derive(catalogue.choose("dcm", "rk4", rates=True))
    assert forms(extract(rates)) == {"turn_0": (1, 0, 0), "turn_1_2": (0, 1, 0), "turn_1": (0, 0, 1)}


@pytest.mark.parametrize(
    ("stage", "form"),
    [
        (lambda a, b: 2 * a - b / 3, (2, Fraction(-1, 3))),
        (lambda a, b: a, (1, 0)),
        (lambda a, b: -b, (0, -1)),
        (lambda a, b: sp.Matrix([2 * a[0], 2 * a[1], 3 * a[2]]), None),
        (lambda a, b: sp.Matrix([a[1], a[2], a[0]]), None),
        (lambda a, b: a * b[0], None),
        (lambda a, b: a + sp.ones(3, 1), None),
        (lambda a, b: sp.sqrt(2) * a, None),
        (lambda a, b: skew(a) * b, None),
        (lambda a, b: 0 * a, None),
    ],
)
def test_stages_that_are_linear(stage, form):
    build = KernelBuilder()
    state = build.input(Signal.labelled("state", "e", "xyzs"))
    d = build.input(PAIR)
    a, b = d[0, :].T, d[1, :].T
    w = build.stage(Signal.vector("w", "w"), stage(a, b))
    core = extract(step(w + a - b, sp.Integer(1), build, state))
    assert forms(core).get("w") == form
    assert [s.signal.name for s in core.stages] == (["transition"] if form else ["w", "transition"])
    assert core.vectors["d1"][1] == (1, 0)


@pytest.mark.parametrize(("method", "degree"), [("rk1", 1), ("rk2", 2), ("rk4", 4)])
def test_the_degree_is_that_of_the_longest_product_in_any_element(method, degree):
    """In (delta / 2, 1) and (delta / 2, 1 - delta^2 / 8) the degree of the scalar differs from that of the vector."""
    assert extract(derive("euler", method=method, increments=1)).degree() == degree


def test_vectors_may_come_one_by_one():
    build = KernelBuilder()
    state = build.input(Signal.labelled("state", "e", "xyzs"))
    rate, bias = (build.input(Signal.vector(name, name)) for name in ("rate", "bias"))
    w = build.stage(Signal.vector("net", "net", meaning="net rate"), rate - bias)
    core = extract(step(w, dot(w, w), build, state))
    assert core.inputs == ["rate", "bias"]
    assert forms(core) == {"net": (1, -1)}
    assert decompose(core).scalar == {((0, 0),): 1}


@pytest.mark.parametrize(
    "name", ["euler-product", "error-matrix", "dcm-orthonormalize", "dcm-from-euler", "coning-increments"]
)
def test_a_kernel_without_a_transition_has_no_core(name):
    assert extract_core(catalogue.derive(catalogue.choose(name))) is None


def test_an_input_that_is_no_vector_makes_no_core():
    build = KernelBuilder()
    state = build.input(Signal.labelled("state", "e", "xyzs"))
    time, rate = build.scalar(Signal.scalar("time")), build.input(Signal.vector("rate", "w"))
    made = step(time * rate, sp.Integer(1), build, state)
    with pytest.raises(NotCovariantError, match="time"):
        extract(made)
    assert extract_core(made) is None


def test_a_transition_of_another_kind_makes_no_core():
    build = KernelBuilder()
    build.input(Signal.vector("state", "v"))
    rate = build.input(Signal.vector("rate", "w"))
    build.output(
        Signal.vector("next", "next"), build.stage(Signal.vector("transition", "p"), rate * dot(rate, rate))
    )
    with pytest.raises(NotCovariantError, match="neither"):
        extract(build.kernel("made-up", "Made up", "this test", transition="transition"))


def test_a_core_evaluates_its_stages():
    core = extract(derive("euler", method="rk1", increments=1))
    # (I + half the increment)
    d = [sp.Rational(n, 10) for n in (1, 2, 3)]
    (signal, form) = next(iter(core.vectors.values()))
    values = {element: form[0] * x for element, x in zip(signal.elements, d, strict=True)}
    assert core.evaluate(values) == [x / 2 for x in d] + [1]


@pytest.mark.parametrize(
    ("algorithm", "method", "increments"),
    [("euler", "rk4", 2), ("cayley-klein", "rk2", 3), ("dcm", "rk3", 2)],
)
def test_a_program_that_differs_in_one_coefficient_is_refused(algorithm, method, increments):
    kernel = derive(algorithm, method=method, increments=increments)
    core, program = extract(kernel), lower(kernel)
    verify(core, program)
    needed = program.used([program.transition])
    tampered = [
        changed
        for k, assignment in enumerate(program.body)
        if assignment.name in needed
        for changed in with_one_number_changed(program, k, assignment)
    ]
    assert len(tampered) >= 4
    for wrong in tampered:
        with pytest.raises(ArithmeticError, match=program.name):
            verify(core, wrong)


def with_one_number_changed(program: Program, place: int, assignment: Assignment) -> list[Program]:
    numbers = [node for node in walk(assignment.value) if isinstance(node, Constant)]
    body = list(program.body)
    made = []
    for number in numbers:
        body[place] = replace(assignment, value=exchanged(assignment.value, number))
        made.append(replace(program, body=tuple(body)))
    return made


def exchanged(node: Node, number: Constant) -> Node:
    if node is number:
        return Constant(number.value + Fraction(1, 10**9))
    if isinstance(node, Operation):
        return Operation(node.kind, tuple(exchanged(argument, number) for argument in node.arguments))
    return node


@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_a_program_with_one_sign_changed_is_refused(algorithm):
    kernel = derive(algorithm, method="rk2", increments=2)
    core, program = extract(kernel), lower(kernel)
    needed = program.used([program.transition])
    other = {"add": "subtract", "subtract": "add"}
    changed = 0
    for k, assignment in enumerate(program.body):
        value = assignment.value
        if assignment.name in needed and isinstance(value, Operation) and value.kind in other:
            body = list(program.body)
            body[k] = replace(assignment, value=replace(value, kind=other[value.kind]))
            with pytest.raises(ArithmeticError):
                verify(core, replace(program, body=tuple(body)))
            changed += 1
    assert changed > 10
