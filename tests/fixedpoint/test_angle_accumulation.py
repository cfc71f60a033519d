"""The bound of the angle of a run: above what an adversary reaches, at most three times as much."""

from __future__ import annotations

import importlib.util
import math
import sys
from dataclasses import fields, replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from derived import program, quantized
from scipy.spatial.transform import Rotation

import strapgen
from strapgen.catalogue import Choice
from strapgen.fixedpoint import quantize
from strapgen.fixedpoint.accumulation import StepErrors
from strapgen.fixedpoint.angle_accumulation import (
    _dual_rows,
    _matrix_angles,
    _parameter_angles,
    _Sizes,
    _sizes,
    _steps,
    _turning,
    _unsteadiness,
)
from strapgen.fixedpoint.intervals import Interval
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.interfaces import LARGEST_ERROR
from strapgen.ir.program import Operation, Program
from strapgen.ir.signals import Signal
from strapgen.run import exact
from strapgen.run.backends import KEEP_THE_ATTITUDE

BENCHMARK = Path(__file__).resolve().parents[2] / "benchmarks" / "adversarial_run.py"
RATES = {"max_rate_deg_s": 400, "step": "0.01", "increments": 2}
#: Times the error of the adversary that a bound may be; with error feedback what is fed back is hard to steer.
LARGEST_RATIO = {"none": 3, "state": 20, "full": 20}


@pytest.fixture(scope="module")
def adversarial_run():
    spec = importlib.util.spec_from_file_location("adversarial_run", BENCHMARK)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def attitudes(states: np.ndarray) -> Rotation:
    """Return the attitude of parameters; of matrices, the nearest rotation."""
    if states.shape[-1] == 4:
        return Rotation.from_quat(states)
    left, _, right = np.linalg.svd(states)
    return Rotation.from_matrix(left @ right)


def angles_apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return (attitudes(one) * attitudes(other).inv()).magnitude()


def assert_holds(errors: np.ndarray, bounds: np.ndarray, carry: str) -> None:
    """Assert that a bound is above an adversary's errors, and not far above the last."""
    assert np.all(errors <= bounds)
    assert bounds[-1] <= LARGEST_RATIO[carry] * errors[-1]


@pytest.mark.parametrize(
    ("algorithm", "carry", "steps", "every"),
    [
        ("euler", "none", 600, 0),
        ("euler", "full", 1200, 0),  # long enough that what the first residuals add once is small
        ("dcm", "none", 600, 0),
        *(
            pytest.param(
                algorithm, carry, 2_000 if algorithm == "euler" else 1200, every, marks=pytest.mark.long
            )
            for algorithm, carry, every in (
                *(("euler", carry, every) for carry in LARGEST_RATIO for every in (0, 100)),
                *(("dcm", carry, every) for carry in LARGEST_RATIO for every in (0, 600)),
            )
        ),
    ],
)
def test_no_adversary_gets_above_the_bound_nor_far_below(adversarial_run, algorithm, carry, steps, every):
    name, settings = "c-fixed32", Settings.of(**RATES, carry=carry)
    adversary = adversarial_run.Adversary(algorithm, settings, name)
    result = adversary.run(steps, every)
    assert_holds(result.errors, result.bounds, carry)
    # Every part of the run adds as much as any other: what holds now holds after a million steps.
    half = result.errors[len(result.errors) // 2 - 1]
    assert result.errors[-1] == pytest.approx(2 * half, rel=0.1)
    # A bound that claims as much less a step is passed.
    angles = adversary.interface.angle_accumulation
    weak = replace(angles, per_step=angles.per_step / LARGEST_RATIO[carry])
    with pytest.raises(AssertionError):
        assert_holds(result.errors, np.array([weak.bound(int(n)) for n in result.steps]), carry)


@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_the_errors_of_the_adversary_are_those_of_forty_digits(adversarial_run, algorithm):
    adversary = adversarial_run.Adversary(algorithm, Settings.of(**RATES), "c-fixed32")
    result = adversary.run(60)
    states = exact.propagate(program(Choice(algorithm, "rk4", 2)), result.increments)
    (angle,) = angles_apart(result.final[None], states[-1:])
    assert angle == pytest.approx(result.errors[-1], rel=1e-4)


@pytest.mark.long
@pytest.mark.parametrize("carry", ["none", "state", "full"])
@pytest.mark.parametrize(
    ("word", "rounding"),
    [(32, "nearest"), (12, "truncation"), pytest.param(16, "nearest", marks=pytest.mark.long)],
)
@pytest.mark.parametrize(
    ("algorithm", "orthonormalization"),
    [
        ("euler", None),
        ("cayley-klein", "cayley-klein-normalize-first-order"),
        ("dcm", "dcm-orthonormalize-first-order"),
    ],
)
def test_any_run_keeps_the_bound_along_it(algorithm, orthonormalization, word, rounding, carry, rng):
    settings = Settings(word, Fraction(1, 100), rounding, carry)
    steps, every = 120, 20
    by = {
        name: strapgen.backend(
            algorithm, "rk4", 2, name, orthonormalization, settings if name == "fixed-model" else None
        )
        for name in ("fixed-model", "numpy")
    }
    increments = rng.uniform(-1, 1, (1, 1, 3)) / 125 + rng.normal(scale=5e-4, size=(steps, 2, 3))
    increments = increments.clip(-0.01, 0.01)
    fixed = by["fixed-model"]
    for inputs in (fixed.representable(increments), increments):
        rounded = inputs is increments
        for normalize_every in (0, every):
            runs = [
                backend.propagate(given, **({"orthonormalize_every": every} if normalize_every else {}))
                for backend, given in ((fixed, inputs), (by["numpy"], inputs))
            ]
            bounds = [
                fixed.angle_bound(n, rounded, normalize_every, shortest=0.9375) for n in range(1, steps + 1)
            ]
            if (
                None in bounds
            ):  # 12 bits are too short for an orthonormalization of a matrix that says anything
                assert (algorithm, word, bool(normalize_every)) == ("dcm", 12, True)
                continue
            assert np.all(angles_apart(*runs)[1:] <= np.array(bounds) + 1e-12)


def test_error_feedback_bounds_a_step_with_a_cosine_as_it_does_others(rng):
    settings = {carry: Settings.of(**RATES, carry=carry) for carry in ("none", "full")}
    fixed = {
        carry: strapgen.backend("euler", "coning-compressed", 2, "fixed-model", settings=one)
        for carry, one in settings.items()
    }
    per_step = {carry: one.interface.angle_accumulation.per_step for carry, one in fixed.items()}
    # What is rounded off a transition near 1 comes back times its distance from 1.
    assert per_step["full"] < per_step["none"] / 5
    turn = rng.uniform(-1, 1, (1, 2, 3)) * 0.03
    increments = fixed["full"].representable(np.repeat(turn, 500, axis=0))  # steady: rounding adds up
    double = strapgen.backend("euler", "coning-compressed", 2).propagate(increments)
    bounds = [fixed["full"].angle_bound(n, shortest=0.9375) for n in range(1, 501)]
    apart = {carry: angles_apart(one.propagate(increments), double)[1:] for carry, one in fixed.items()}
    assert np.all(apart["full"] <= np.array(bounds) + 1e-13)
    assert 5 * apart["full"][-1] < apart["none"][-1]


def test_a_matrix_of_a_rotation_vector_takes_the_increments_apart(rng):
    # The squares under the root have names, and their sum is not below 0 although increments are split off.
    settings = Settings.of(**RATES, carry="state")
    fixed = strapgen.backend("dcm", "coning-compressed", 2, "fixed-model", settings=settings)
    increments = fixed.representable(rng.uniform(-0.034, 0.034, (200, 2, 3)))
    double = strapgen.backend("dcm", "coning-compressed", 2).propagate(increments)
    bounds = [fixed.angle_bound(n, shortest=0.9375) for n in range(1, 201)]
    assert np.all(angles_apart(fixed.propagate(increments), double)[1:] <= np.array(bounds) + 1e-13)
    assert bounds[-1] < 200 * 1e-9 / 2


@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_a_state_stays_proper_for_as_many_steps_as_are_proved(algorithm):
    settings = Settings.of(**RATES)
    backend = strapgen.backend(algorithm, "rk4", 2, "c-fixed32", settings=settings)
    angles = backend.interface.angle_accumulation
    limit = backend.interface.inputs[1].high * backend.increment_unit
    signs = np.array([[[1, 1, 1], [1, 1, 1]], [[1, -1, 1], [-1, 1, 1]], [[1, 1, 0], [-1, 1, 0]]])
    longest = math.sqrt(2 - angles.shortest**2)
    for row in signs * limit:
        increments = np.repeat(row[None], backend.interface.normalized_within, axis=0)
        final = backend.propagate(increments, record_every=len(increments))[-1]
        sizes = np.linalg.svd(np.atleast_2d(final), compute_uv=False)
        assert angles.shortest <= sizes.min() <= sizes.max() <= longest


def test_normalization_rotates_by_at_most_its_bound(rng):
    for carry in ("none", "full"):
        fixed = quantized(Choice("euler", "rk4", 2), Settings.of(**RATES, carry=carry))
        angles = fixed.interface.angle_accumulation
        for kernel in ("euler-normalize", "euler-normalize-first-order"):
            normalize = strapgen.evaluator(kernel, "fixed-model", fixed.interface.companion_settings)
            (argument,) = normalize.interface.inputs
            states = rng.normal(size=(2000, 4))
            states *= rng.uniform(0.95, 1.05, (2000, 1)) / np.linalg.norm(states, axis=1, keepdims=True)
            integers = normalize.integers(argument, states)
            feedback = rng.integers(0, 1 << 32, (2000, len(normalize.interface.residuals))).astype(object)
            ((result,), _) = normalize.run([integers], feedback)
            worst = angles_apart(*(normalize.numbers(argument, array) for array in (result, integers))).max()
            assert float(angles.per_normalization) / 20 < worst <= float(angles.per_normalization)


@pytest.mark.parametrize("kernel", [*sorted(KEEP_THE_ATTITUDE), "dcm-orthonormalize"])
def test_orthonormalizations_keep_the_attitude(kernel, rng):
    normalize = strapgen.evaluator(kernel)
    shape = normalize.function.inputs[0].shape
    states = np.random.default_rng(1).normal(size=(50, *shape))
    if len(shape) == 2:
        states = np.linalg.qr(states)[0]
        states *= np.sign(np.linalg.det(states))[:, None, None]
        states += rng.uniform(-0.01, 0.01, states.shape)
    else:
        states /= np.linalg.norm(states, axis=1, keepdims=True) * rng.uniform(0.95, 1.05, (50, 1))
    turned = angles_apart(normalize(states), states).max()
    # Dual rows turn the nearest rotation a little.
    assert turned > 1e-10 if kernel == "dcm-orthonormalize" else turned < 1e-13


def test_a_run_without_proof_has_no_bound():
    backend = strapgen.backend("dcm", "rk4", 2, "c-fixed32", settings=Settings.of(**RATES))
    angles = backend.interface.angle_accumulation
    assert backend.angle_bound(1000) is not None
    # Dual rows have one where they follow upon each other soon enough.
    apart = angles.dual_rows_apart
    assert backend.angle_bound(1000, orthonormalize_every=apart) is not None
    assert backend.angle_bound(1000, orthonormalize_every=apart + 1) is None
    assert angles.bound(1000, 10, 2 * angles.dual_rows_error, dual_rows=True) == math.inf
    # Nor has one of more steps than are proved, unless the caller knows more of its states.
    assert backend.angle_bound(10_000) is None
    ratio = backend.angle_bound(10_000, shortest=0.95) / backend.angle_bound(1000)
    assert ratio == pytest.approx(10 * float(angles.beyond), rel=1e-6)


def test_a_run_with_dual_rows_keeps_the_bound(rng):
    increments = rng.uniform(-1, 1, (1000, 2, 3)) * 0.0349
    fixed = strapgen.backend("dcm", "rk4", 2, "c-fixed32", settings=Settings.of(**RATES))
    double = strapgen.backend("dcm", "rk4", 2, "numpy")
    inputs = fixed.representable(increments)
    runs = [backend.propagate(inputs, orthonormalize_every=100) for backend in (fixed, double)]
    bounds = [fixed.angle_bound(n, orthonormalize_every=100) for n in range(1, 1001)]
    assert np.all(angles_apart(*runs)[1:] <= bounds)


def test_dual_rows_stretch_a_difference_by_at_most_their_bound(rng):
    angles = quantized(Choice("dcm", "rk4", 2), Settings.of(**RATES)).interface.angle_accumulation
    e, orthonormalize = (1 - float(angles.shortest)) / 16, strapgen.evaluator("dcm-orthonormalize")
    square = 9 / 8 * e**2
    weight = (float(angles.dual_rows_growth) - square**2) / (1.5 * square)
    count, small = 2000, 1e-4
    left, right = np.linalg.qr(rng.normal(size=(2, count, 3, 3)))[0]
    left *= np.sign(np.linalg.det(left @ right))[:, None, None]
    matrices = (left * (1 + rng.choice([-e, 0, e], (count, 1, 3)))) @ right
    changes = rng.normal(size=(count, 3, 3))
    # Half of them are turns, in which the rest of a change cannot be seen.
    changes[::2] -= changes[::2].swapaxes(1, 2)
    after = [orthonormalize(matrices + sign * small * changes @ matrices) for sign in (1, -1)]
    changed = (after[0] - after[1]) / (2 * small) @ np.linalg.inv(orthonormalize(matrices))

    def size(change: np.ndarray) -> np.ndarray:
        skew, symmetric = (
            np.linalg.norm(change + sign * change.swapaxes(1, 2), axis=(1, 2)) / 2 for sign in (-1, 1)
        )
        return skew + weight * symmetric

    growth = size(changed) / size(changes) - 1
    assert growth.max() <= float(angles.dual_rows_growth) + 1e-7  # which the differences are off by
    assert np.median(growth[1::2]) < 0


def _with_output(made: Program, change) -> Program:
    """Return a program with one assignment of its state changed."""
    body = tuple(
        replace(one, value=change(one.value)) if one.name == made.outputs[0].nodes[0].name else one
        for one in made.body
    )
    return replace(made, body=body)


@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_other_steps_than_products_have_no_bound(algorithm):
    made, settings = program(Choice(algorithm, "rk4", 2)), Settings.of(**RATES)
    assert quantize(made, settings).interface.angle_accumulation is not None

    def flipped(node):
        assert node.kind in ("add", "subtract")
        return Operation("subtract" if node.kind == "add" else "add", node.arguments)

    changed = quantize(_with_output(made, flipped), settings).interface
    assert changed.angle_accumulation is None
    assert changed.accumulation is not None


def test_a_bound_adds_up():
    angles = quantized(
        Choice("dcm", "rk4", 2), Settings.of(**RATES, carry="full")
    ).interface.angle_accumulation
    one, ten = angles.bound(100), angles.bound(1000)
    assert ten - one == pytest.approx(900 * float(angles.per_step), rel=1e-12)
    assert angles.bound(1000, rounded_inputs=True) > ten
    assert angles.bound(1000, 10, Fraction(1, 1 << 29)) > ten
    assert angles.bound(1000, 10, 2 * LARGEST_ERROR) == math.inf


HALF = Fraction(1, 2)
NOTHING = StepErrors((), (), (), Fraction(0), (), ())


def sizes(**more) -> _Sizes:
    """Return the sizes of a step that rounds nothing and stretches nothing, but for these; the state has length 1/2."""
    zeros = {field.name: Fraction(0) for field in fields(_Sizes)}
    ones = {"longest": Fraction(1), "contraction": Fraction(1), "expansion": Fraction(1), "shortest": HALF}
    return _Sizes(**(zeros | ones | {name: Fraction(size) for name, size in more.items()}))


def tangent(sine: Fraction | float) -> float:
    """Return the tangent of the angle of a sine, which is not below the angle."""
    return float(sine) / (1 - float(sine) ** 2) ** 0.5


def percent(count: int | Fraction) -> Fraction:
    return Fraction(count, 100)


@pytest.mark.parametrize(
    ("errors", "sine"),
    [
        # An error of 1/100 of a state of 1/2.
        ({"local": percent(1)}, percent(2)),
        # The state before, with an error of 1/100 of it, is up to 100/99 as long as the one after; shorter transitions
        # make it longer still.
        ({"transition": percent(1)}, Fraction(1, 99)),
        ({"transition": percent(1), "contraction": percent(90)}, Fraction(1, 89)),
        # An error of 1/100 took up to 2/100 of the length.
        ({"transition": percent(1), "local": percent(1)}, percent(2) + Fraction(102, 99) / 100),
        # What is fed back, turned less itself: 1/100 times 1/5, of a state of 1/2 less what is fed back.
        ({"state_feedback": percent(1), "away": percent(20)}, Fraction(2, 1000) / (HALF - percent(1))),
        # Errors of the transition turn what is fed back of the state no further, but the state before was longer by two
        # roundings, of 2/100 each.
        (
            {"state_feedback": percent(1), "transition": percent(1)},
            Fraction(104, 99) / 100 / (1 - percent(2)),
        ),
        # Feedback g of the transition acts on the state now, where it was told of the one before. They differ by
        # transitions 1/5 from the identity each, and by the feedback itself, there and back. All is told in the length
        # after two steps, each of which shortens by up to 2 g; so is what has been fed back by now.
        (
            {"transition_feedback": percent(1), "away": percent(20)},
            percent(1) * Fraction(100, 98) ** 2 * percent(42) / (1 - Fraction(1, 98)),
        ),
        (
            {"transition_feedback": percent(1)},
            percent(1) * Fraction(100, 98) ** 2 * percent(2) / (1 - Fraction(1, 98)),
        ),
        # The state differs by its rounding too: an error of 1/100 of 1/2, or feedback there and back.
        (
            {"transition_feedback": percent(1), "local": percent(1)},
            (percent(2) + percent(1) * (Fraction(102, 98) ** 2 * percent(2) + percent(2)))
            / (1 - Fraction(102, 98) / 100),
        ),
        (
            {"transition_feedback": percent(1), "state_feedback": percent(1)},
            percent(1)
            * (Fraction(104, 98) ** 2 * percent(2) + percent(4))
            / (1 - percent(2) - Fraction(104, 98) / 100),
        ),
        # And by the error of the transition before, which shortens as much.
        (
            {"transition_feedback": percent(1), "transition": percent(1)},
            (Fraction(100, 97) / 100 + percent(1) * Fraction(100, 97) ** 2 * percent(3))
            / (1 - Fraction(1, 97)),
        ),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, dict) else "",
)
def test_the_angle_that_a_step_of_parameters_adds(errors, sine):
    angles = _parameter_angles(sizes(**errors), NOTHING, Fraction(0))
    assert float(angles.per_step) == pytest.approx(2 * tangent(sine), rel=1e-12)


def test_the_ends_of_a_run_of_parameters():
    """What is fed back turns the first state and the last one, of attitudes twice as far: 1/100 of 1/2, and of g."""
    angles = _parameter_angles(sizes(state_feedback=percent(1)), NOTHING, Fraction(0))
    assert float(angles.once) == pytest.approx(4 * tangent(percent(2)), rel=1e-12)
    fed = Fraction(100, 98) / 100  # of the state before, which may have been longer
    angles = _parameter_angles(sizes(transition_feedback=percent(1)), NOTHING, Fraction(0))
    assert float(angles.once) == pytest.approx(4 * tangent(fed), rel=1e-12)


def test_a_normalization_of_parameters_rounds_four_words_of_the_shortest_state():
    """Each by 1/1000: 2/1000 of 1/2; with feedback three times, and what is fed back before and after is forgotten."""
    rounding = Fraction(1, 1000)
    angles = _parameter_angles(sizes(), NOTHING, rounding)
    assert float(angles.per_normalization) == pytest.approx(2 * tangent(Fraction(4, 1000)), rel=1e-12)
    for fed_back in ({"state_feedback": percent(1)}, {"transition_feedback": percent(Fraction(98, 50))}):
        angles = _parameter_angles(sizes(**fed_back), NOTHING, rounding)
        end = float(angles.once) / 4
        expected = 2 * (tangent(Fraction(12, 1000)) + 2 * end)
        assert float(angles.per_normalization) == pytest.approx(expected, rel=1e-12)


def test_rounded_increments_are_an_error_of_the_transition():
    errors = replace(NOTHING, moves=(percent(3), percent(4)))
    angles = _parameter_angles(sizes(transition=percent(1)), errors, Fraction(0))
    more = _parameter_angles(sizes(transition=percent(6)), NOTHING, Fraction(0))
    assert angles.per_step + angles.input_rounding == pytest.approx(more.per_step, rel=1e-12)


@pytest.mark.parametrize(
    ("errors", "room", "lost"),
    [
        # Seven eighths of the way from 1 to 1/2 are 7/16.
        ({"local": percent(1)}, Fraction(7, 16), percent(1)),
        ({"contraction": percent(98)}, Fraction(7, 16), percent(2)),
        ({"transition": percent(1)}, Fraction(7, 16), Fraction(100, 99) ** 2 * percent(1)),
        ({"state_feedback": percent(1), "local": percent(2)}, Fraction(7, 16) - percent(2), percent(2)),
        (
            {"transition_feedback": percent(1), "local": percent(2), "longest": 3},
            Fraction(7, 16) - percent(6),
            percent(2) + percent(1) * (3 * percent(2) + percent(2)),
        ),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, dict) else "",
)
def test_steps_are_proved_while_there_is_room(errors, room, lost):
    angles = _parameter_angles(sizes(**errors), NOTHING, Fraction(0))
    assert angles.start == Fraction(15, 16)
    assert angles.proved_steps == int(room / lost)
    assert _steps(Fraction(-1), lost) == 0 == _steps(room, Fraction(0))


def test_a_step_that_may_turn_by_more_than_a_twelfth_of_a_turn_has_no_bound():
    """The sine of 1/2 is the largest for which a bound is worth anything."""
    assert _parameter_angles(sizes(local=percent(25)), NOTHING, Fraction(0)).per_step > 0
    with pytest.raises(ValueError):
        _parameter_angles(sizes(local=percent(26)), NOTHING, Fraction(0))
    with pytest.raises(ValueError):  # nor has one of which nothing may be left
        _parameter_angles(sizes(transition=percent(99)), NOTHING, Fraction(0))


# Matrices


@pytest.mark.parametrize(
    ("errors", "added", "fed_back"),
    [
        ({"local": percent(1)}, percent(1), 0),
        ({"transition": percent(1), "longest": 2}, percent(2), 0),
        ({"state_feedback": percent(1), "away": percent(20)}, Fraction(2, 1000), percent(1)),
        # As for parameters; lengths are those of the longest matrix, here 2.
        (
            {"transition_feedback": percent(1), "longest": 2, "away": percent(20)},
            percent(1) * 2 * percent(42),
            percent(2),
        ),
        (
            {"transition_feedback": percent(1), "longest": 2, "transition": percent(1)},
            percent(2) + percent(1) * 2 * percent(3),
            percent(2),
        ),
        (
            {"transition_feedback": percent(1), "local": percent(3)},
            percent(3) + percent(1) * (percent(2) + percent(3)),
            percent(1),
        ),
        (
            {"transition_feedback": percent(1), "state_feedback": percent(3)},
            percent(1) * (percent(2) + percent(6)),
            percent(4),
        ),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, dict) else "",
)
def test_the_angle_that_a_step_of_matrices_adds(errors, added, fed_back):
    """What a step adds to M is over the smallest singular value: of the state with its feedback, less what is added.

    Singular values from 1/2 to the longest turn an uneven change of M by more than its skew half.
    """
    step = sizes(**errors)
    assert step.added == added
    assert step.fed_back == fed_back
    angles = _matrix_angles(step, NOTHING)
    uneven = (float(step.longest) - 1 / 2) / (float(step.longest) + 1 / 2)
    proper = ((1 + uneven**2) / 2) ** 0.5
    assert float(angles.per_step) == pytest.approx(
        proper * float(added / (HALF - fed_back - added)), rel=1e-12
    )
    # The first state and the last one, told from states without what is fed back.
    assert float(angles.once) == pytest.approx(
        2 * proper * float(fed_back / (HALF - 2 * fed_back)), rel=1e-12
    )
    assert float(_turning(Fraction(uneven))) == pytest.approx(proper)
    assert float(angles.beyond) == pytest.approx(1 / proper)


SHORTEST = Fraction(15, 16)
LONGEST = float(2 - SHORTEST**2) ** 0.5
START = 1 - Fraction(1, 128)


@pytest.mark.parametrize(
    ("errors", "shorter", "longer"),
    [
        ({"local": percent(Fraction(1, 10))}, 0.001, 0.001),
        ({"contraction": percent(99)}, 0.01, 0),
        ({"expansion": percent(101)}, 0, LONGEST / 100),
        ({"local": percent(Fraction(1, 10)), "state_feedback": percent(Fraction(1, 2))}, 0.001, 0.001),
        ({"local": percent(Fraction(1, 10)), "expansion": percent(101)}, 0.001, LONGEST / 100 + 0.001),
        ({"local": percent(Fraction(1, 10)), "contraction": percent(99)}, 0.011, 0.001),
        ({"local": 1e-4, "expansion": 1.001}, 1e-4, LONGEST / 1000 + 1e-4),
        ({"local": 1e-4, "contraction": 0.999, "state_feedback": 0.005}, 0.0011, 1e-4),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, dict) else "",
)
def test_matrices_stay_proper_at_both_ends(errors, shorter, longer):
    step = sizes(**errors, shortest=SHORTEST, longest=Fraction(LONGEST))
    angles = _matrix_angles(step, NOTHING)
    fed_back = 2 * float(step.fed_back)
    rooms = (float(START - SHORTEST) - fed_back, LONGEST - float(2 - START**2) ** 0.5 - fed_back)
    steps = [int(room / lost) for room, lost in zip(rooms, (shorter, longer), strict=True) if lost]
    # Where nothing is lost at one end no step is proved; the code always loses something.
    assert angles.proved_steps == (min(steps) if shorter and longer else 0)
    assert angles.start == START


def test_orthonormalization_leaves_part_of_a_symmetric_error():
    """f(s) = s (3 - s^2)/2 has the slope 3/2 (1 - s^2), the same size at both ends, over what is restored."""
    shortest = float(SHORTEST)
    restored = min(s * (3 - s * s) / 2 for s in (shortest, LONGEST))
    unsteady = 1.5 * (1 - shortest**2) * LONGEST / restored
    assert float(_unsteadiness(SHORTEST, START)) == pytest.approx(unsteady, rel=1e-12)
    angles = _matrix_angles(sizes(shortest=SHORTEST, longest=Fraction(LONGEST), local=percent(1)), NOTHING)
    uneven = (LONGEST - shortest) / (LONGEST + shortest)
    factor = ((1 + ((uneven + unsteady) / (1 - unsteady)) ** 2) / 2) ** 0.5
    proper = ((1 + uneven**2) / 2) ** 0.5
    assert float(angles.orthonormalized) == pytest.approx(factor / proper, rel=1e-9)
    # Three elements of a row, over the smallest singular value: the length of a matrix of nine elements is three.
    assert float(angles.per_element) == pytest.approx(3 * factor / shortest, rel=1e-9)
    fed_back = sizes(shortest=SHORTEST, longest=Fraction(LONGEST), state_feedback=percent(1))
    angles = _matrix_angles(fed_back, NOTHING)
    assert float(angles.per_normalization) == pytest.approx(float(angles.once) * factor / proper, rel=1e-9)
    # Restored singular values less the error of a matrix must be those of a start.
    highest = Fraction(restored) - 3 * LARGEST_ERROR
    assert _unsteadiness(SHORTEST, highest - Fraction(1, 10**12)) is not None
    assert _unsteadiness(SHORTEST, highest + Fraction(1, 10**12)) is None


def test_dual_rows_have_room_for_the_steps_between():
    """An eighth of e is left of it; seven eighths are for the stretch, the rounding and what is fed back."""
    e = 1 / 256
    for errors, lost, fed_back in (
        ({"local": 1e-6}, 1e-6, 0),
        ({"contraction": 1 - 1e-5, "local": 1e-6}, 1.1e-5, 0),
        ({"expansion": 1 + 1e-5, "local": 1e-6}, 1e-5 * (1 + e) + 1e-6, 0),
        ({"state_feedback": 1e-4, "local": 1e-6}, 1e-6, 1e-4),
    ):
        step = sizes(**errors, shortest=SHORTEST, longest=Fraction(LONGEST))
        apart, growth = _dual_rows(step, Fraction(1, 4))
        assert apart == pytest.approx((7 / 8 * e - 2 * fed_back) / lost, abs=1)
    square = 9 / 8 * e**2
    turned, rest = e / (1 - e), 13 / 5 * e
    weight = (1.01 * turned + 1.1 * rest) / (1 - 1.5 * square * turned - 1.1 * rest)
    assert float(growth) == pytest.approx(square**2 + weight * 1.5 * square, rel=1e-9)
    assert _dual_rows(step, Fraction(weight) - Fraction(1, 10**6))[0] == 0
    assert _dual_rows(step, None) == (0, 0)


# The sizes themselves


@pytest.mark.parametrize("rounding", [HALF, Fraction(1)])
def test_sizes_are_lengths_of_all_elements_and_feedback_is_told_from_its_middle(rounding):
    state = Signal("state", (2, 2), tuple("abcd"), bound=1)
    attitude_step = SimpleNamespace(isometry=True)
    context = SimpleNamespace(
        program=SimpleNamespace(inputs=(state,), attitude_step=attitude_step),
        settings=SimpleNamespace(allowance=Fraction(1, 16), carry="full"),
        quantities=None,
        rounding_error=rounding,
    )
    four = (Fraction(3), Fraction(0), Fraction(0), Fraction(4))
    errors = StepErrors(four, four, four, Fraction(7), four, four)
    told = _sizes(context, None, errors, True)
    assert (told.local, told.transition, told.away) == (5, 5, 5)
    middle = HALF / rounding
    assert (told.state_feedback, told.transition_feedback) == (middle * 14, middle * 5)
    assert (told.shortest, told.contraction, told.expansion) == (SHORTEST, 1, 1)
    assert float(told.longest) == pytest.approx(LONGEST)
    context.settings.carry = "none"
    assert _sizes(context, None, errors, True).state_feedback == 0


@pytest.mark.parametrize(
    ("stretched", "contraction", "expansion"),
    [
        (None, 0.75, 1.25),
        (Interval.of(Fraction(-7, 16), Fraction(9, 16)), 0.75, 1.25),
        (Interval.of(Fraction(-9, 25), Fraction(11, 25)), 0.8, 1.2),
        (Interval.of(-1, Fraction(9, 16)), 0.75, 1.25),  # nothing is known of the least singular value
    ],
)
def test_transition_stretches_by_its_known_bound(stretched, contraction, expansion, monkeypatch):
    monkeypatch.setattr("strapgen.fixedpoint.angle_accumulation.stretch", lambda *_: stretched)
    state = Signal("state", (4,), tuple("abcd"), bound=1)
    context = SimpleNamespace(
        program=SimpleNamespace(inputs=(state,)),
        settings=SimpleNamespace(allowance=Fraction(1, 16), carry="none"),
        rounding_error=HALF,
    )
    errors = replace(NOTHING, away=(Fraction(1, 4),))
    told = _sizes(context, None, errors, False)
    assert float(told.contraction) == pytest.approx(contraction, rel=1e-12)
    assert float(told.expansion) == pytest.approx(expansion, rel=1e-12)
