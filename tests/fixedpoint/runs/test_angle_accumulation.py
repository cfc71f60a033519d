"""The bound of the angle of a run: above what an adversary reaches, at most three times as much."""

from __future__ import annotations

import importlib.util
import math
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from derived import program, quantized
from scipy.spatial.transform import Rotation

import strapgen
from strapgen.catalogue import Choice
from strapgen.fixedpoint import quantize
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.interfaces import LARGEST_ERROR
from strapgen.ir.program import Operation, Program
from strapgen.run import exact
from strapgen.run.backends import KEEP_THE_ATTITUDE

BENCHMARK = Path(__file__).resolve().parents[3] / "benchmarks" / "adversarial_run.py"
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
        ("euler", "full", 600, 0),
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


def test_a_normalization_turns_by_no_more_than_is_told(rng):
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


def test_dual_rows_stretch_a_difference_by_no_more_than_is_told(rng):
    angles = quantized(Choice("dcm", "rk4", 2), Settings.of(**RATES)).interface.angle_accumulation
    e, orthonormalize = (1 - float(angles.shortest)) / 16, strapgen.evaluator("dcm-orthonormalize")
    square = 9 / 8 * e**2
    weight = (float(angles.dual_rows_growth) - square**2) / (1.5 * square)
    count, small = 2000, 1e-4
    left, right = np.linalg.qr(rng.normal(size=(2, count, 3, 3)))[0]
    left *= np.sign(np.linalg.det(left @ right))[:, None, None]
    matrices = (left * (1 + rng.choice([-e, 0, e], (count, 1, 3)))) @ right
    changes = rng.normal(size=(count, 3, 3))
    changes[::2] -= changes[::2].mT  # half of them are turns, in which the rest of a change cannot be seen
    after = [orthonormalize(matrices + sign * small * changes @ matrices) for sign in (1, -1)]
    changed = (after[0] - after[1]) / (2 * small) @ np.linalg.inv(orthonormalize(matrices))

    def size(change: np.ndarray) -> np.ndarray:
        skew, symmetric = (np.linalg.norm(change + sign * change.mT, axis=(1, 2)) / 2 for sign in (-1, 1))
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
def test_what_is_no_product_of_attitudes_has_no_bound(algorithm):
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
