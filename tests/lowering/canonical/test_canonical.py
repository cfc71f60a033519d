"""Canonical forms of the catalogue's steps: exact, short, readable and found quickly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from itertools import combinations, combinations_with_replacement
from types import SimpleNamespace

import pytest
import sympy as sp
from derived import kernel, program

from strapgen.catalogue import STANDARD_METHODS, Choice
from strapgen.catalogue.kinematics import EULER
from strapgen.catalogue.methods.method import increments_signal
from strapgen.ir.kernel_info import AttitudeStep
from strapgen.ir.program import Program
from strapgen.ir.signals import Signal
from strapgen.kernel import algebra
from strapgen.kernel.algebra import cross, dot, quaternion_product, skew
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.lowering import candidates, canonical, lower
from strapgen.lowering.canonical import plan
from strapgen.lowering.canonical.core import decompose
from strapgen.lowering.passes import cost, optimize
from strapgen.lowering.trees import is_temporary, operation_count

#: Cayley-Klein parameters have the programs of Euler parameters by other names, which tests/lowering proves.
STEPS = [Choice(a, m, n) for a in ("dcm", "euler") for m in STANDARD_METHODS for n in (1, 2, 3, 4, 5, None)]


def is_quick(choice: Choice) -> bool:
    return choice.increments == 2 or (choice.method, choice.increments) == ("rk4", None)


#: Two increments, and steps of fourth order that take rates; all others with the long tests.
EVERY = pytest.mark.parametrize(
    "choice",
    [pytest.param(c, marks=() if is_quick(c) else pytest.mark.long, id=c.kernel) for c in STEPS],
)


def is_the_kernel(made: Program, choice: Choice) -> bool:
    """Tell whether a program's next state is the kernel's, as polynomials of state and increments."""
    names = [name for signal in made.inputs for name in signal.elements]
    ring, *generators = sp.ring(names, sp.QQ)
    results = made.run(dict(zip(names, generators, strict=True)))
    elements = {name: [ring(element) for element in found] for name, found in results.items()}
    return elements == kernel(choice).polynomials()


@EVERY
def test_the_transition_is_that_of_the_stages(choice):
    core, made = canonical.extract_core(kernel(choice)), program(choice)
    canonical.verify(core, made)
    # Another way to the same: through all stages, in the elements of the inputs themselves.
    assert is_the_kernel(made, choice)
    assert not any(made.operations[kind] for kind in ("divide", "sqrt", "select", "function"))
    # Where scalars and vectors have names nothing is left to be found that has none.
    temporaries = [a.name for a in made.body if a.name.startswith(("shared_", "factor_"))]
    assert choice.name == "dcm" or not temporaries


@pytest.mark.parametrize(
    "choice",
    [
        Choice("euler", "rk4", 2),
        pytest.param(Choice("euler", "rk3", 3), marks=pytest.mark.long),
        pytest.param(Choice("dcm", "rk3", 3), marks=pytest.mark.long),
        Choice("dcm", "rk4", 2),
    ],
    ids=lambda choice: choice.kernel,
)
def test_every_candidate_is_exact_not_only_the_one_that_is_taken(choice):
    core = canonical.extract_core(kernel(choice))
    made = list(candidates(kernel(choice), core))
    assert len(made) == 1 + len(canonical.forms(core)) > 3
    for candidate in made:
        canonical.verify(core, candidate)
        assert is_the_kernel(candidate, choice)


def test_plans_that_are_not_written_are_exact_too_and_nearly_as_long_as_estimated(monkeypatch):
    """In a step on three increments some vectors are multiples of those that have a name."""
    choice = Choice("euler", "rk2", 3)
    core = canonical.extract_core(kernel(choice))
    plans = plan.plans(core, decompose(core))
    monkeypatch.setattr(canonical, "_WRITTEN", len(plans))
    _, *written = candidates(kernel(choice), core)
    for one, form, candidate in zip(plans, canonical.forms(core), written, strict=True):
        canonical.verify(core, candidate)
        count = sum(operation_count(assignment.value) for assignment in form)
        # An estimate knows neither the scalar products that a polynomial shares nor the signs that a sum absorbs.
        assert abs(plan._estimate(one) - count) <= 2


@pytest.mark.parametrize(
    ("choice", "multiplications", "additions"),
    [
        # The product with the state takes 16 and 12 of them, or 27 and 18.
        (Choice("euler", "rk4", 1), 25, 17),
        (Choice("euler", "rk4", 2), 37, 31),
        (Choice("cayley-klein", "rk4", 2), 37, 31),
        pytest.param(Choice("euler", "rk4", 3), 58, 49, marks=pytest.mark.long),
        (Choice("dcm", "rk4", 1), 45, 32),
        (Choice("dcm", "rk4", 2), 75, 66),
        pytest.param(Choice("dcm", "rk4", 3), 96, 88, marks=pytest.mark.long),
    ],
    ids=lambda value: value.kernel if isinstance(value, Choice) else str(value),
)
def test_operations_of_the_fourth_order_step(choice, multiplications, additions):
    operations = program(choice).operations
    assert operations["multiply"] <= multiplications
    assert operations["add"] <= additions


def test_the_canonical_form_is_shorter_than_the_stages():
    for choice, share in ((Choice("euler", "rk4", 2), 0.5), (Choice("dcm", "rk4", 2), 0.7)):
        staged = optimize(next(candidates(kernel(choice), canonical.extract_core(kernel(choice)))))
        assert sum(program(choice).operations.values()) < share * sum(staged.operations.values())


def test_names_and_meanings_are_those_of_the_field():
    made = program(Choice("euler", "rk4", 2))
    names = {a.name for a in made.body}
    assert {"sigma_x", "sigma_dot_sigma", "p_x", "p_s"} <= names
    meanings = {a.name: a.meaning for a in made.body if a.meaning}
    assert meanings["sigma_x"] == "the angle increment of the whole step"
    # It is said once for a vector, where it begins.
    assert not {"sigma_y", "sigma_z", "p_y"} & meanings.keys()


def test_a_transition_depends_on_nothing_but_the_increments():
    for choice in (Choice("euler", "rk4", 2), Choice("dcm", "rk4", 2)):
        made = program(choice).transition_program()
        assert [signal.name for signal in made.inputs] == ["increments"]
        assert made.operations["multiply"] == program(choice).operations["multiply"] - (
            27 if choice.name == "dcm" else 16
        )


@EVERY
def test_values_have_descriptive_names(choice):
    # Only partial sums and factors that a pass shares have no meaning: few in a matrix, none in a quaternion.
    temporaries = [a.name for a in program(choice).body if is_temporary(a.name)]
    assert len(temporaries) <= (3 if choice.name == "dcm" else 0)


@pytest.mark.parametrize("vectors", [1, 2, 3])
@pytest.mark.parametrize("degree", [0, 1, 2, 3, 4, 5])
def test_the_stated_terms_are_all_products_up_to_the_degree(degree, vectors, monkeypatch):
    """They are monomials in the scalar products, alone and with each vector and each cross product."""
    monkeypatch.setattr(canonical, "_MOST_TERMS", {"few": 0, "many": 0})
    scalar_products = list(combinations_with_replacement(range(vectors), 2))
    beside = [0, *[1] * vectors, *(2 for _ in combinations(range(vectors), 2))]
    terms = sum(
        1
        for size in beside
        for count in range(degree // 2 + 1)
        for _ in combinations_with_replacement(scalar_products, count)
        if size + 2 * count <= degree
    )
    transition = SimpleNamespace(base=lambda: range(vectors), degree=lambda: degree)
    assert f"degree {degree} in {vectors} vectors, up to {terms} terms" in canonical.expansion(transition)


def two_sample(stage: str, prefix: str, transition: tuple[str, ...], increments: tuple[str, str]) -> Kernel:
    """Return a step whose sum of increments, transition and increments are called as told."""
    build = KernelBuilder()
    state = build.input(EULER.state)
    elements = tuple(f"{vector}_{axis}" for vector in increments for axis in "xyz")
    d = build.input(replace(increments_signal(2), elements=elements))
    first, second = d[0, :].T, d[1, :].T
    total = build.stage(Signal.vector(stage, prefix), first + second)
    phi = build.stage(Signal.vector("phi", "phi"), total + sp.Rational(2, 3) * algebra.cross(first, second))
    p = build.stage(
        Signal("p", (4,), transition),
        [*(phi * (sp.Rational(1, 2) - algebra.dot(phi, phi) / 48)), 1 - algebra.dot(phi, phi) / 8],
    )
    build.output(EULER.next, algebra.quaternion_product(state, p))
    attitude_step = AttitudeStep("euler-product", "euler-normalize", "dcm-from-euler", (0, 0, 0, 1))
    return build.kernel("two-sample", "Two samples", "this test", transition="p", attitude_step=attitude_step)


@pytest.mark.parametrize(
    "transition", [("p_x", "p_y", "p_z", "p_s"), tuple("xyzs"), ("a_x", "b_y", "c_z", "d_s")]
)
@pytest.mark.parametrize(
    ("stage", "prefix", "increments"),
    [
        ("total", "total", ("d_1", "d_2")),
        ("d_1", "total", ("d_1", "d_2")),
        ("d_1_cross_d_2", "d_1_cross_d_2", ("d_1", "d_2")),
        ("total", "total", ("sigma", "delta")),
        ("total", "total", ("sigma_cross_delta", "delta")),
        ("total", "total", ("p_lever", "p_sigma")),
        ("sigma_dot_sigma", "sigma", ("shared_1", "factor_1")),
    ],
)
def test_a_step_is_lowered_to_the_same_polynomials(stage, prefix, increments, transition):
    kernel = two_sample(stage, prefix, transition, increments)
    names = [name for signal in kernel.inputs for name in signal.elements]
    ring, *generators = sp.ring(names, sp.QQ)
    result = lower(kernel).run(dict(zip(names, generators, strict=True)))
    assert [ring(element) for element in result["next"]] == kernel.polynomials()["next"]


#: Elements of state and increment of a step from one.
NAMES = ("e_x", "e_y", "e_z", "e_s", "d1_x", "d1_y", "d1_z")

#: From a builder and the increments to the transition.
Transition = Callable[[KernelBuilder, list[sp.Matrix]], list]
#: Adds outputs, from a builder, the increments and the transition.
More = Callable[[KernelBuilder, list[sp.Matrix], sp.Matrix], object]


def increments(build: KernelBuilder, count: int, prefix: str = "d") -> list[sp.Matrix]:
    names = tuple(f"{prefix}{k}_{axis}" for k in range(1, count + 1) for axis in "xyz")
    d = build.input(Signal("increments", (count, 3), names, unit="rad"))
    return [d[k, :].T for k in range(count)]


def quaternion_step(
    transition: Transition, count: int = 1, state: str = "e", more: More | None = None
) -> Kernel:
    build = KernelBuilder()
    e = build.input(Signal.labelled("state", state, "xyzs", meaning="Euler parameters"))
    d = increments(build, count)
    p = build.stage(Signal.labelled("transition", "p", "xyzs", meaning="the step"), transition(build, d))
    build.output(Signal.labelled("next", "next", "xyzs"), quaternion_product(e, p))
    if more:
        more(build, d, p)
    return build.kernel("own", "A user's step", "this test", transition="transition")


def matrix_step(transition: Transition, count: int = 2) -> Kernel:
    build = KernelBuilder()
    c = build.input(Signal.matrix("state", "c"))
    m = build.stage(Signal.matrix("transition", "m"), transition(build, increments(build, count)))
    build.output(Signal.matrix("next", "n"), c * m)
    return build.kernel("own", "A user's step", "this test", transition="transition")


def polynomials(program: Program) -> dict[str, list]:
    names = [name for signal in program.inputs for name in signal.elements]
    ring, *generators = sp.ring(names, sp.QQ)
    results = program.run(dict(zip(names, generators, strict=True)))
    return {name: [ring(element) for element in elements] for name, elements in results.items()}


def second_order(build: KernelBuilder, d: list[sp.Matrix]) -> list:
    """I + g + g g/2 with the quaternion g = (d/2, 0), written down as it stands."""
    g = build.stage(Signal.labelled("generator", "g", "xyzs"), [*(d[0] / 2), sp.Integer(0)])
    square = build.stage(Signal.labelled("square", "gg", "xyzs"), quaternion_product(g, g))
    return sp.Matrix([0, 0, 0, 1]) + g + square / 2


def two_steps(build: KernelBuilder, d: list[sp.Matrix]) -> list:
    """The product of the second-order steps of two increments."""
    parts = [
        build.stage(Signal.labelled(name, name, "xyzs"), [*(v / 2), 1 - dot(v, v) / 8])
        for name, v in zip(("first", "second"), d, strict=True)
    ]
    return quaternion_product(*parts)


def rodrigues(build: KernelBuilder, d: list[sp.Matrix]) -> list:
    """Second order in the sum of two increments, with their commutator."""
    K = skew(build.stage(Signal.vector("turn", "turn"), d[0] + d[1] + cross(d[0], d[1]) * sp.Rational(2, 3)))
    return sp.eye(3) + K + K * K / 2


def test_a_second_order_step_from_one_increment_gets_a_canonical_form():
    kernel = quaternion_step(second_order)
    core = canonical.extract_core(kernel)
    assert core.inputs == ["d1"]
    assert canonical.forms(core)
    program = lower(kernel)
    assert polynomials(program) == kernel.polynomials()
    # d/2 and 1 - d.d/8, and the product with the state
    transition = program.transition_program().operations
    assert transition["multiply"] <= 3 + 3 + 1
    assert transition["add"] <= 2 + 1
    assert sum(program.operations.values()) == sum(transition.values()) + 16 + 12


def test_the_program_does_not_depend_on_how_the_step_was_written():
    def plain(build: KernelBuilder, d: list[sp.Matrix]) -> list:
        return [*(d[0] / 2), 1 - dot(d[0], d[0]) / 8]

    def in_stages(build: KernelBuilder, d: list[sp.Matrix]) -> list:
        half = build.stage(Signal.vector("half", "h"), d[0] / 2)
        return [*half, build.value("cosine", 1 - build.value("square", dot(half, half)) / 2)]

    costs = {cost(lower(quaternion_step(written))) for written in (second_order, plain, in_stages)}
    assert len(costs) == 1


@pytest.mark.long
@pytest.mark.parametrize(
    "kernel",
    [
        quaternion_step(second_order),
        quaternion_step(two_steps, 2),
        matrix_step(rodrigues),
        matrix_step(lambda build, d: sp.eye(3) + skew(d[0] + d[1]) + skew(d[0]) * skew(d[1])),
        matrix_step(lambda build, d: d[0] * d[1].T),
        pytest.param(matrix_step(lambda build, d: skew(d[0]) * 2, 1), marks=pytest.mark.long),
        pytest.param(
            matrix_step(lambda build, d: (1 - dot(d[0], d[0])) * sp.eye(3), 1), marks=pytest.mark.long
        ),
        matrix_step(lambda build, d: skew(d[0]) * skew(d[1]) * skew(d[2]), 3),
    ],
    ids=[
        "second order",
        "two steps",
        "with a commutator",
        "mixed product",
        "outer product",
        "skew",
        "multiple of the unit matrix",
        "three skew matrices",
    ],
)
def test_covariant_transitions_have_exact_canonical_forms(kernel):
    core = canonical.extract_core(kernel)
    assert canonical.forms(core)
    expected = kernel.polynomials()
    for candidate in candidates(kernel, core):
        assert polynomials(candidate) == expected
        assert polynomials(optimize(candidate)) == expected  # `lower` takes one of them


def test_a_product_of_three_skew_matrices_is_shorter_than_it_was_written():
    kernel = matrix_step(lambda build, d: skew(d[0]) * skew(d[1]) * skew(d[2]), 3)
    staged = optimize(next(candidates(kernel, canonical.extract_core(kernel))))
    assert sum(lower(kernel).operations.values()) < sum(staged.operations.values())


def test_vectors_that_come_one_by_one_keep_their_meaning():
    build = KernelBuilder()
    e = build.input(Signal.labelled("state", "e", "xyzs"))
    rate, bias = (build.input(Signal.vector(name, name)) for name in ("rate", "bias"))
    net = build.stage(Signal.vector("net", "net", meaning="rate without its bias"), rate - bias)
    first, second = sp.Matrix([*net, 1]), sp.Matrix([*(rate / 2), 1 - dot(net, net)])
    p = build.stage(Signal.labelled("transition", "p", "xyzs"), quaternion_product(first, second))
    build.output(Signal.labelled("next", "next", "xyzs"), quaternion_product(e, p))
    kernel = build.kernel("own", "A user's step", "this test", transition="transition")
    (*_, form) = candidates(kernel, canonical.extract_core(kernel))
    assert polynomials(lower(kernel)) == polynomials(form) == kernel.polynomials()
    assert {a.name: a.meaning for a in form.body}.get("net_x") == "rate without its bias"
    assert not [a.meaning for a in form.body if "half" in a.meaning]


def unequal_axes(build: KernelBuilder, d: list[sp.Matrix]) -> list:
    x, y, z = d[0]
    return [x**2, y / 3, z * x, 1 - x]


def test_a_step_that_does_not_turn_with_its_inputs_is_written_as_its_stages():
    kernel = quaternion_step(unequal_axes)
    assert canonical.forms(canonical.extract_core(kernel)) == []
    program = lower(kernel)
    assert polynomials(program) == kernel.polynomials()
    assert not [a.name for a in program.body if "dot" in a.name or "cross" in a.name]


def test_two_vectors_that_are_mixed_axis_by_axis_are_written_as_their_stages():
    def mixed(build: KernelBuilder, d: list[sp.Matrix]) -> list:
        a, b = d
        first = build.stage(Signal.vector("mixed", "u"), [a[0] * b[0], a[1] * b[1], a[2] * b[2]])
        return [*first, 1 - dot(a, b)]

    kernel = quaternion_step(mixed, 2)
    assert canonical.forms(canonical.extract_core(kernel)) == []
    assert polynomials(lower(kernel)) == kernel.polynomials()


def test_a_step_that_turns_with_its_inputs_in_the_rotated_frame_alone():
    # Where y and z are zero this is 1 - d.d/8: the rest is not seen there.
    def hidden(build: KernelBuilder, d: list[sp.Matrix]) -> list:
        x, y, z = d[0]
        return [x / 2, y / 2, z / 2, 1 - dot(d[0], d[0]) / 8 + x * y * z + y * z]

    kernel = quaternion_step(hidden)
    assert polynomials(lower(kernel)) == kernel.polynomials()


def test_a_transition_with_roots_and_functions():
    def exact(build: KernelBuilder, d: list[sp.Matrix]) -> list:
        half = build.value("half", sp.sqrt(dot(d[0], d[0])) / 2)
        return [*(sp.sinc(half) / 2 * d[0]), sp.cos(half)]

    kernel = quaternion_step(exact)
    values = dict(zip(NAMES, (0.1, -0.2, 0.3, 0.9, 0.4, 0.5, -0.6), strict=True))
    (expected,) = kernel.expand({name: sp.Float(x) for name, x in values.items()}).values()
    (found,) = lower(kernel).run(values).values()
    assert found == pytest.approx([float(x) for x in expected], rel=1e-14)


def test_a_transition_that_divides():
    def cayley(build: KernelBuilder, d: list[sp.Matrix]) -> list:
        quarter = build.value("quarter", dot(d[0], d[0]) / 16)
        return [*(d[0] / 2 / (1 + quarter)), (1 - quarter) / (1 + quarter)]

    kernel = quaternion_step(cayley)
    values = {name: sp.Rational(k, 7) for k, name in enumerate(NAMES, -2)}
    exact = {name: Fraction(int(x.p), int(x.q)) for name, x in values.items()}
    assert lower(kernel).run(exact) == kernel.expand(values)


def test_a_transition_that_is_always_the_same():
    kernel = quaternion_step(lambda build, d: [0, 0, sp.Rational(3, 5), sp.Rational(4, 5)])
    assert polynomials(lower(kernel)) == kernel.polynomials()


def test_linear_stage_may_have_any_element_names():
    def transition(build: KernelBuilder, d: list[sp.Matrix]) -> list:
        w = build.stage(Signal("turn", (3,), ("roll", "pitch", "yaw")), d[0] / 2)
        return [*w, 1 - dot(w, w) / 2]

    kernel = quaternion_step(transition)
    assert polynomials(lower(kernel)) == kernel.polynomials()


@pytest.mark.parametrize(
    "more",
    [
        lambda build, d, p: build.output(Signal.vector("angle", "angle"), 2 * d[0]),
        lambda build, d, p: build.output(Signal.scalar("half"), [sp.Symbol("gg_s", real=True) / 2]),
        lambda build, d, p: build.output(
            Signal.scalar("length"), [1 + build.value("squares", dot(p, p)) / 2]
        ),
    ],
    ids=["the increments", "an earlier stage", "a later stage"],
)
def test_outputs_may_need_more_than_the_transition(more):
    kernel = quaternion_step(second_order, more=more)
    assert polynomials(lower(kernel)) == kernel.polynomials()


@pytest.mark.parametrize("name", ["sigma", "sigma_cross_d1"])
def test_a_kernel_may_use_the_names_that_vectors_get(name):
    kernel = quaternion_step(
        two_steps, 2, more=lambda build, d, p: build.output(Signal.vector("o", name), 2 * p[:3, :])
    )
    assert polynomials(lower(kernel)) == kernel.polynomials()
