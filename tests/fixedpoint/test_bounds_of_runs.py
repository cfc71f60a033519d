"""Ranges and error bounds: never exceeded, value by value, call by call, run by run; and not far above the worst."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from derived import precisely, program, quantized
from fixed_inputs import corners_and_random, in_double
from scipy.spatial.transform import Rotation

import strapgen
from strapgen import catalogue, generate
from strapgen.catalogue import Choice, standard
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import IntegerSum
from strapgen.run import backends as run
from strapgen.run import exact
from strapgen.run.backends import backend as make_backend
from strapgen.run.backends import evaluator as make_evaluator
from strapgen.run.compiled_code import ModelEvaluator
from strapgen.run.exact import propagate
from strapgen.run.increments import windows

STEPS = [choice for choice in standard() if choice.method]


def evaluator_of(fixed) -> ModelEvaluator:
    return ModelEvaluator(generate(fixed, "fixed-model"))


@pytest.mark.parametrize("word", [16, 32])
@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_the_bound_of_a_step_is_near_the_worst_of_many(algorithm, word, rng):
    settings = Settings.of(word=word, max_rate_deg_s=400, step="0.01", increments=2)
    fixed = quantized(Choice(algorithm, "rk4", 2), settings)
    model = evaluator_of(fixed)
    inputs = corners_and_random(model, 100_000, rng)
    (computed,), _ = model.run(inputs, model.fresh(len(inputs[0])))
    doubles = {
        name: array[:, k].astype(float) * float(argument.format.unit)
        for argument, array in zip(fixed.interface.inputs, inputs, strict=True)
        for k, name in enumerate(argument.signal.elements)
    }
    (wanted,) = in_double(fixed.program, doubles).values()
    (result,) = fixed.interface.outputs
    for k, bound in enumerate(result.errors):
        worst = np.abs(computed[:, k] * float(result.format.unit) - wanted[k]).max()
        # Doubles round at 1e-16 of the value, a ten-millionth of the bound at 32 bits.
        assert worst <= float(bound) * (1 + 1e-6)
        assert float(bound) <= 1.6 * worst


@pytest.mark.long
@pytest.mark.parametrize("carry", ["none", "state", "full"])
@pytest.mark.parametrize("rounding", ["nearest", pytest.param("truncation", marks=pytest.mark.long)])
@pytest.mark.parametrize("word", [12, 32, pytest.param(16, marks=pytest.mark.long)])
@pytest.mark.parametrize("algorithm", ["dcm", "euler", "cayley-klein"])
def test_the_bound_of_a_run_holds_along_it(algorithm, word, rounding, carry, rng):
    settings = Settings(word, Fraction(1, 60), rounding, carry)
    made = make_backend(algorithm, "rk4", 2, "fixed-model", settings=settings)
    # A steady turn with noise on it: some errors repeat from step to step, others do not.
    increments = rng.uniform(-1, 1, (1, 1, 3)) / 80 + rng.normal(scale=1e-3, size=(200, 2, 3))
    given = made.representable(np.clip(increments, -1 / 60, 1 / 60))
    double = make_backend(algorithm, "rk4", 2, "numpy")
    apart = made.propagate(given) - double.propagate(given)
    lengths = np.linalg.norm(apart, axis=-1)
    lengths = lengths if lengths.ndim == 1 else lengths.max(axis=-1)
    bounds = np.array([made.rounding_bound(n) for n in range(201)])
    assert np.all(lengths[1:] <= bounds[1:] * (1 + 1e-6) + 1e-13)
    exact_inputs = double.propagate(increments.clip(-1 / 60, 1 / 60))
    apart = np.linalg.norm(made.propagate(increments.clip(-1 / 60, 1 / 60)) - exact_inputs, axis=-1)
    apart = apart if apart.ndim == 1 else apart.max(axis=-1)
    assert np.all(apart[1:] <= [made.rounding_bound(n, True) + 1e-13 for n in range(1, 201)])


@pytest.mark.long
@pytest.mark.parametrize("rounding", ["nearest", "truncation"])
@pytest.mark.parametrize("angle", [Fraction(1, 10**6), Fraction(1, 10**4), Fraction(1, 600)])
def test_small_increments_keep_the_bound_in_c(angle, rounding, rng):
    # What is far below the last place is shifted out: by no more bits than a number has.
    size = float(angle)
    increments = rng.uniform(-size, size, (100, 2, 3))
    for name, carry in (("c-fixed16", "full"), ("c-fixed32", "state"), ("c-fixed16", "none")):
        settings = Settings(32, angle, rounding, carry)
        made = make_backend("euler", "rk4", 2, name, settings=settings)
        given = made.representable(increments)
        apart = made.propagate(given) - make_backend("euler", "rk4", 2, "numpy").propagate(given)
        assert np.linalg.norm(apart, axis=-1).max() <= made.rounding_bound(100) * (1 + 1e-6) + 1e-13
        settings = replace(settings, word=made.interface.settings.word)
        model = make_backend("euler", "rk4", 2, "fixed-model", settings=settings)
        np.testing.assert_array_equal(model.propagate(given), made.propagate(given))


@pytest.mark.long
@pytest.mark.parametrize("choice", STEPS, ids=lambda choice: choice.kernel)
def test_no_transition_stretches_more_than_the_bound_says(choice, rng):
    angle = 1 / 40
    fixed = quantized(choice, Settings(32, Fraction(1, 40)))
    growth = float(fixed.interface.accumulation.growth)
    part = program(choice).transition_program()
    rows = np.concatenate([rng.choice([-angle, angle], size=(64, 6)), rng.uniform(-angle, angle, (200, 6))])
    (elements,) = part.run(dict(zip(part.inputs[0].elements, rows.T, strict=True)), float).values()
    arrays = np.stack(np.broadcast_arrays(*elements), axis=-1)
    is_matrix = arrays.shape[1] == 9
    norms = (
        np.linalg.norm(arrays.reshape(-1, 3, 3), 2, (1, 2)) if is_matrix else np.linalg.norm(arrays, axis=1)
    )
    largest = norms.max()
    assert largest <= growth * (1 + 1e-12)
    assert growth - 1 <= {"rk1": 0.03, "rk2": 0.03, "rk3": 0.01, "rk4": 1e-4}[choice.method]


# What the formats are for: the figures that a long run keeps.


def three_axes():
    motion = strapgen.motion("constant", x_deg_s=10, y_deg_s=10, z_deg_s=10)
    return motion.increments(Fraction(1, 8), 1440, 2)


def angles_apart(made, increments) -> np.ndarray:
    """Return the rotation in deg, about each axis, between a run and the exact one on the same increments."""
    given = made.representable(increments)
    wanted = in_many_places(given)
    apart = Rotation.from_quat(made.propagate(given)) * Rotation.from_quat(wanted).inv()
    return np.degrees(apart.as_rotvec())


@pytest.mark.parametrize(
    ("name", "carry", "limit"),
    [
        ("c-fixed32", "none", 2e-6),
        pytest.param("c-fixed32", "state", 2e-6, marks=pytest.mark.long),
        ("c-fixed32", "full", 1e-7),
        pytest.param("c-fixed16", "none", 0.3, marks=pytest.mark.long),
        pytest.param("c-fixed16", "state", 0.04, marks=pytest.mark.long),
        ("c-fixed16", "full", 0.008),
    ],
)
def test_a_turn_about_three_axes(name, carry, limit):
    # The largest increment of the turn is 0.0109 rad.
    settings = Settings(largest_angle=Fraction(3, 256), carry=carry)
    made = make_backend("euler", "rk4", 2, name, settings=settings)
    angles = angles_apart(made, three_axes())
    assert np.linalg.norm(angles[-1]) < limit, "what has accumulated after 180 s"
    assert np.abs(angles).max() < limit, "on each axis all along the run"
    assert np.linalg.norm(angles, axis=1).max() <= np.degrees(2 * made.rounding_bound(1440)) * (1 + 1e-6)


def classical_coning(steps: int) -> np.ndarray:
    """Increments of a cone of 1 deg at 10 Hz in steps of 2 ms: the exact integrals of its rate."""
    frequency, angle, h = 2 * np.pi * 10, np.radians(1), 0.002
    phase = frequency * np.arange(2 * steps + 1) * h / 2
    x = np.sin(angle) * np.diff(np.cos(phase))
    y = np.sin(angle) * np.diff(np.sin(phase))
    z = np.full(2 * steps, 2 * frequency * np.sin(angle / 2) ** 2 * h / 2)
    return np.stack([x, y, z], axis=-1).reshape(steps, 2, 3)


def in_many_places(increments: np.ndarray, places: int = 128) -> np.ndarray:
    """Run Euler parameters on integers of many places: as exact as is needed, and faster than any library.

    Increments of doubles above 2**-60 are integers there; a million steps of rounding at 2**-128 cannot be seen.
    """
    split = program(Choice("euler", "rk4", 2)).transition_program()
    (transition,) = split.outputs

    class Many(int):
        def __add__(self, other):
            return Many(int(self) + int(other))

        def __sub__(self, other):
            return Many(int(self) - int(other))

        def __mul__(self, other):
            return Many(int(self) * int(other) >> places)

        def __neg__(self):
            return Many(-int(self))

    def number(value: Fraction):
        return Many((value.numerator << places) // value.denominator)

    names, cache_ = split.inputs[0].elements, {}
    x, y, z, s = 0, 0, 0, 1 << places
    states = [(x, y, z, s)]
    for row in increments.reshape(len(increments), -1):
        key = row.tobytes()
        if key not in cache_:
            values = {
                n: Many(int(v * 2.0**60) << (places - 60)) for n, v in zip(names, row.tolist(), strict=True)
            }
            cache_[key] = [int(v) for v in split.run(values, number)[transition.signal.name]]
        px, py, pz, ps = cache_[key]
        x, y, z, s = (
            (s * px + x * ps + y * pz - z * py) >> places,
            (s * py - x * pz + y * ps + z * px) >> places,
            (s * pz + x * py - y * px + z * ps) >> places,
            (s * ps - x * px - y * py - z * pz) >> places,
        )
        states.append((x, y, z, s))
    return np.array([[value / 2**places for value in state] for state in states])


@pytest.mark.long
def test_coning_for_long():
    """`strapgen evidence --all` has an emulated processor take a million steps with all feedback."""
    steps = 100_000
    increments, wanted = classical_coning(steps), None
    for carry, limit in {"none": 400, "full": 4}.items():
        settings = Settings.of(max_rate_deg_s=100, step="0.002", increments=2, carry=carry)
        made = make_backend("euler", "rk4", 2, "c-fixed32", settings=settings)
        given = made.representable(increments)
        if wanted is None:
            wanted = in_many_places(given)
        apart = np.abs(made.propagate(given) - wanted).max()
        assert made.unit == 2.0**-30
        assert apart < limit * made.unit
        assert apart <= made.rounding_bound(steps)


def test_the_reference_in_many_places_is_that_of_mpmath():
    settings = Settings.of(max_rate_deg_s=400, step="0.01", increments=2)
    made = make_backend("euler", "rk4", 2, "c-fixed32", settings=settings)
    given = made.representable(classical_coning(300))
    wanted = exact.propagate(program(Choice("euler", "rk4", 2)), given)
    np.testing.assert_allclose(in_many_places(given), wanted, rtol=0, atol=3e-16)


def test_a_transition_kept_beside_the_increments_needs_no_residual():
    # With the state's residuals alone, the transition is split: its rounding is that of its terms of higher order.
    fixed = quantized(Choice("euler", "rk4", 2), Settings(16, Fraction(1, 76), carry="state"))
    (rest,) = (value for value in fixed.body if value.name == "p_x")
    plain = quantized(Choice("euler", "rk4", 2), Settings(16, Fraction(1, 76)))
    (whole,) = (value for value in plain.body if value.name == "p_x")
    assert rest.error < whole.error / 15
    assert isinstance(rest.definition, IntegerSum) and rest.definition.residual is None


def test_guards_refuse_inputs_far_from_proper_ones():
    normalize = make_evaluator("euler-normalize", "fixed-model")
    unit = 2.0**-30
    half = np.array([0.3, 0.4, 0.5, 0.6])
    assert abs(np.linalg.norm(normalize(half / np.linalg.norm(half))) - 1) < 4 * unit
    with pytest.raises(InputError, match="refuses its input"):
        normalize(half / 10)


EXPONENTIALS = ("magnus2", "magnus4", "magnus6", "munthe-kaas4")


def unit_state(algorithm: str, rng: np.random.Generator) -> np.ndarray:
    if algorithm == "dcm":
        return strapgen.motion("coning", a_deg_s=30, b_deg_s=20, g_deg_s=10).attitude(rng.uniform(1, 9))
    state = rng.normal(size=4)
    return state / np.linalg.norm(state)


def exact_step(
    kernel: strapgen.kernel.kernel.Kernel, state: np.ndarray, samples: np.ndarray
) -> list[mpmath.mpf]:
    names = [name for signal in kernel.inputs for name in signal.elements]
    numbers = map(mpmath.mpf, [*state.ravel().tolist(), *samples.ravel().tolist()])
    known = precisely(kernel, dict(zip(names, numbers, strict=True)))
    return [known[name] for name in kernel.outputs[0].signal.elements]


@pytest.mark.long
@pytest.mark.parametrize(
    ("method", "previous"), [*((m, 0) for m in EXPONENTIALS), ("magnus4", 1), ("rk4", 2)]
)
@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
def test_a_call_is_inside_its_bound(algorithm, method, previous, rng):
    kernel = strapgen.derive(algorithm, method, 2, previous=previous)
    backend = strapgen.backend(algorithm, method, 2, "fixed-model", previous=previous)
    evaluator = backend.evaluator
    state_argument = backend.interface.inputs[0]
    (result,) = backend.interface.outputs
    worst = 0.0
    with mpmath.workdps(40):
        for size in (0.124, 0.01, 1e-6, 0.0):
            state = evaluator.numbers(
                state_argument, evaluator.integers(state_argument, unit_state(algorithm, rng))
            )
            increments = backend.representable(rng.uniform(-size, size, size=(2 + previous, 3)))
            found = backend.step(state, increments)
            exact = exact_step(kernel, state, increments)
            for value, wanted, bound in zip(found.ravel(), exact, result.errors, strict=True):
                off = abs(mpmath.mpf(float(value)) - wanted)
                assert off <= float(bound)
                worst = max(worst, float(off / result.format.unit))
    assert worst > 0.3, "something is rounded"


@pytest.mark.parametrize("method", EXPONENTIALS)
@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
def test_the_bound_of_an_exponential_is_a_few_places(algorithm, method):
    # The root of a small square is inexact; cosine and sin(x)/x are taken from the square itself.
    fixed = quantized(Choice(algorithm, method, 2), Settings())
    unit = fixed.formats["next"].unit
    assert fixed.error_bounds["next"] <= 5 * unit
    # Its transitions are rotations: errors add up and do not grow.
    assert fixed.interface.accumulation.growth == 1


@pytest.mark.parametrize(
    "carry", ["none", *(pytest.param(c, marks=pytest.mark.long) for c in ("state", "full"))]
)
@pytest.mark.parametrize("name", ["c-fixed32", pytest.param("c-fixed16", marks=pytest.mark.long)])
@pytest.mark.parametrize(("algorithm", "method"), [("euler", "magnus4"), ("dcm", "munthe-kaas4")])
def test_a_run_of_exponentials_is_inside_its_bound(algorithm, method, name, carry, rng):
    settings = Settings(carry=carry).fitted(0.03)
    backend = strapgen.backend(algorithm, method, 2, name, settings=settings)
    increments = rng.uniform(-0.03, 0.03, size=(200, 2, 3))
    for given, rounded in ((backend.representable(increments), False), (increments, True)):
        exact = propagate(program(Choice(algorithm, method, 2)), given)
        off = np.linalg.norm(backend.propagate(given) - exact, axis=-1).max()
        bound = backend.rounding_bound(200, rounded)
        assert off <= bound < (3e-6 if name == "c-fixed32" else 0.2)


@pytest.mark.parametrize("largest", [Fraction(1, 100), Fraction(1, 2), 2, 4])
def test_an_exponential_for_increments_of_any_size(largest):
    # Beyond 5/4 rad the angle is reduced, and the root is taken.
    fixed = quantized(Choice("euler", "magnus4", 2), Settings().fitted(float(largest)))
    few_places, root_near_zero = Fraction(8) / 2**30, Fraction(1, 500)
    assert fixed.error_bounds["next"] < (few_places if largest < 1 else root_near_zero)


@pytest.mark.long
def test_a_minute_of_a_window_is_the_integers_of_the_model():
    """Six thousand steps with all feedback; `benchmarks/window_fixed_point.py` runs an hour."""
    samples = strapgen.motion("random", rate_deg_s=60).samples(Fraction(1, 100), -7, 6_007)
    windows = np.lib.stride_tricks.sliding_window_view(samples, 15, axis=0).swapaxes(1, 2)
    c, model = (
        strapgen.backend("euler", "window-7-7", None, name, settings=Settings(carry="full")).propagate(
            windows
        )
        for name in ("c-fixed32", "fixed-model")
    )
    assert len(c) == 6_001
    np.testing.assert_array_equal(c, model)


@pytest.mark.long
@pytest.mark.parametrize("carry", ["none", "full"])
@pytest.mark.parametrize("method", ["magnus4", pytest.param("munthe-kaas4", marks=pytest.mark.long)])
def test_c_gives_the_integers_of_the_model(method, carry, rng):
    increments = rng.normal(scale=0.01, size=(200, 2, 3))
    settings = Settings(carry=carry)
    by = [
        strapgen.backend("euler", method, 2, name, settings=settings) for name in ("c-fixed32", "fixed-model")
    ]
    found = [backend.propagate(increments) for backend in by]
    np.testing.assert_array_equal(*found)
    exact = strapgen.backend("euler", method, 2, "numpy").propagate(by[0].representable(increments))
    # Every call adds at most its bound, and the transitions are rotations.
    (result,) = by[0].interface.outputs
    most = 200 * 2 * float(max(result.errors)) * (2 if carry == "full" else 1)
    assert np.abs(found[0] - exact).max() <= most


@pytest.mark.parametrize("carry", ["none", "full"])
@pytest.mark.parametrize(
    ("algorithm", "count", "previous"), [("euler", 1, 2), pytest.param("dcm", 1, 2, marks=pytest.mark.long)]
)
def test_a_run_with_previous_increments_is_inside_its_bound(algorithm, count, previous, carry, rng):
    settings = Settings(carry=carry)
    backend = strapgen.backend(algorithm, "rk4", count, "c-fixed32", settings=settings, previous=previous)
    row = rng.normal(scale=0.01, size=(previous + 300 * count, 3))
    increments = backend.representable(windows(row, count, previous))
    found = backend.propagate(increments)
    exact = strapgen.backend(algorithm, "rk4", count, "numpy", previous=previous).propagate(increments)
    off = np.linalg.norm(found - exact, axis=-1).max()
    bound = backend.rounding_bound(300)
    # Double precision is off itself by less than 16 units of round-off a step.
    assert off <= bound + 300 * 16 * 2.0**-53
    assert bound < 1e-5


#: A count is 5/1024 of the unit of an output in this format.
SCALE, FORMAT, UNIT = "5/1073741824", "Q-5.20", Fraction(1, 1 << 20)


def sent(backend, carry, counts):
    """Return the outputs for counts, one call after the other, in units."""
    settings = Settings(
        word=16, carry=carry, ranges={"count": Fraction(60)}, formats={"count": "Q15.0", "increment": FORMAT}
    )
    choice = catalogue.choose("angle-counts", constants={"scale": SCALE})
    evaluator = run.evaluator(choice, backend, settings)
    feedback, rows = evaluator.fresh(1), []
    for row in counts:
        (output,), feedback = evaluator.run([row[None]], feedback)
        rows.append(output[0])
    return np.array(rows, int)


@pytest.mark.parametrize("backend", ["fixed-model", "c-fixed16"])
def test_remainder_of_an_increment_goes_into_the_next(backend, rng):
    counts = rng.integers(-60, 61, (300, 3)) + np.array([0, 20, -20])
    counts = counts.clip(-60, 60)
    exact = counts.cumsum(axis=0) * 5 / 1024
    assert np.abs(sent(backend, "all", counts).cumsum(axis=0) - exact).max() <= 0.5
    # Without it every increment, of less than half a unit, is rounded to zero.
    assert not sent(backend, "none", counts).any()


def test_sums_are_fed_back_too():
    names = {
        carry: [
            feedback.name
            for feedback in run.evaluator(
                "two-speed-fast-2", "fixed-model", Settings(carry=carry)
            ).interface.residuals
        ]
        for carry in ("full", "all")
    }
    assert set(names["full"]) < set(names["all"])
    assert {"residual_next_coning_x", "residual_next_eta_z"} <= set(names["all"])
