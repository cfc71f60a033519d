"""The protocol of back ends, on every one of them."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import cache

import mpmath
import numpy as np
import pytest
import sympy as sp
from derived import generated
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from precisions import precision
from tolerances import one_call, roundoff

import strapgen
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.program import Program
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import Wrapped
from strapgen.kernel.kernel import EPSILON, KernelBuilder
from strapgen.run import numpy_evaluator as numpy_module
from strapgen.run.backends import BACKENDS, of_sources
from strapgen.run.increments import windows

STEPS = 1440


def few(backend_name: str, number: int) -> int:
    """Return a number of steps or calls, an eighth of it on a back end that takes its time for each."""
    return number // 8 if BACKENDS[backend_name].slow else number


def random_increments(rng, *shape: int, size: float = 0.01) -> np.ndarray:
    return rng.normal(scale=size, size=(*shape, 3))


@pytest.mark.long
@pytest.mark.parametrize(
    "method", [*(pytest.param(f"rk{order}", marks=pytest.mark.long) for order in (1, 2, 3)), "rk4"]
)
def test_back_ends_agree_over_a_run(make, backend_name, algorithm, method, rng):
    steps = few(backend_name, STEPS)
    increments = random_increments(rng, steps, 2)
    reference = strapgen.backend(algorithm, method, 2, "numpy")
    candidate = make(algorithm, method)
    # Orthonormalized as in the tables, so that a low order does not grow out of the range of the bound.
    history = candidate.propagate(increments, orthonormalize_every=40)
    wanted = reference.propagate(increments, orthonormalize_every=40)
    allowed = 1e-12 if candidate.name in ("numpy", "c") else roundoff(candidate, steps, steps // 40)
    assert np.abs(history - wanted).max() <= allowed


def test_plain_fourth_order_run_agrees(make, backend_name, algorithm, rng):
    steps = few(backend_name, STEPS)
    increments = random_increments(rng, steps, 2)
    candidate = make(algorithm)
    wanted = strapgen.backend(algorithm, backend="numpy").propagate(increments)
    allowed = 1e-12 if candidate.name in ("numpy", "c") else roundoff(candidate, steps)
    assert np.abs(candidate.propagate(increments) - wanted).max() <= allowed


def test_propagation_is_the_step_repeated(make, algorithm, rng):
    backend = make(algorithm)
    increments = random_increments(rng, 50, 2)
    state, states = backend.identity, [backend.identity]
    for d in increments:
        state = backend.step(state, d)
        states.append(state)
    assert np.abs(backend.propagate(increments) - np.array(states)).max() <= roundoff(backend, 50)


def test_orthonormalization_comes_after_every_so_many_steps(make, algorithm, rng):
    backend = make(algorithm, "rk1")
    increments = random_increments(rng, 50, 2)
    state, states = backend.identity, [backend.identity]
    for k, d in enumerate(increments, 1):
        state = backend.step(state, d)
        if k % 7 == 0:
            state = backend.orthonormalize(state)
        states.append(state)
    history = backend.propagate(increments, orthonormalize_every=7)
    assert np.abs(history - np.array(states)).max() <= roundoff(backend, 50)
    assert np.abs(backend.propagate(increments) - history).max() > 1e-4, "orthonormalization must be seen"


@pytest.mark.long
@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    steps=st.integers(0, 120),
    record_every=st.integers(1, 50),
    orthonormalize_every=st.one_of(st.none(), st.integers(1, 60)),
    runs=st.integers(1, 3),
)
def test_records_are_samples_of_the_full_history(
    make, backend_name, steps, record_every, orthonormalize_every, runs
):
    backend = make("euler", "rk2")
    if BACKENDS[backend_name].slow:
        steps %= 20
    increments = random_increments(np.random.default_rng(steps), runs, steps, 2)
    every = backend.propagate(increments, 1, orthonormalize_every)
    assert every.shape == (runs, steps + 1, 4)
    some = backend.propagate(increments, record_every, orthonormalize_every)
    np.testing.assert_array_equal(some, every[:, ::record_every])
    for run in range(runs):
        alone = backend.propagate(increments[run], record_every, orthonormalize_every)
        assert np.abs(alone - some[run]).max() <= roundoff(backend, max(steps, 1))


@pytest.mark.long
@pytest.mark.parametrize("orthonormalize_every", [None, 1, 3, 64, 100, 1000])
@pytest.mark.parametrize("span", [32, 100, 257])
def test_spans_of_the_numpy_scan_join_without_a_seam(monkeypatch, rng, span, orthonormalize_every):
    backend = strapgen.backend("euler", "rk1", 2, "numpy")
    increments = random_increments(rng, 2, 700, 2)
    whole = backend.propagate(increments, 1, orthonormalize_every)
    monkeypatch.setattr(numpy_module, "_SPAN", span)
    monkeypatch.setattr(numpy_module, "_WIDTH", 16)
    monkeypatch.setattr(numpy_module, "_PASS", 64)
    pieces = backend.propagate(increments, 1, orthonormalize_every)
    scale = np.abs(whole).max()  # without orthonormalization first order grows
    assert np.abs(pieces - whole).max() <= scale * roundoff(backend, 700)
    # A record falls on any place of a span.
    some = backend.propagate(increments, 7, orthonormalize_every)
    np.testing.assert_array_equal(some, pieces[:, ::7])


@pytest.mark.long
def test_increments_per_step_from_1_to_8(make, backend_name, algorithm, rng):
    # The same motion in more samples: with an exact fit of a linear rate the step is the same.
    for count in (1, 3, 8):
        backend = make(algorithm, "rk4", count)
        assert backend.increments == count
        turn = np.full((10, count, 3), 0.01 / count)
        wanted = strapgen.backend(algorithm, "rk4", 2, backend_name).propagate(np.full((10, 2, 3), 0.005))
        assert np.abs(backend.propagate(turn) - wanted).max() <= roundoff(backend, 10)


@pytest.mark.parametrize("shape", [(0, 7, 2, 3), (3, 0, 2, 3), (2, 0, 4, 2, 3), (0, 2, 3)])
def test_no_runs_and_no_steps(make, algorithm, shape):
    backend = make(algorithm)
    history = backend.propagate(np.zeros(shape))
    assert history.shape == (*shape[:-3], 1 + shape[-3], *backend.state_shape)


@pytest.mark.parametrize("kind", [">f8", "f4", "f2"])
def test_any_floating_point_layout_is_read(make, kind, rng):
    backend = make("euler")
    increments = random_increments(rng, 3, 20, 2).astype(kind)
    wanted = backend.propagate(increments.astype("f8"))
    np.testing.assert_array_equal(backend.propagate(increments), wanted)
    np.testing.assert_array_equal(backend.propagate(np.asfortranarray(increments)), wanted)
    doubled = np.repeat(increments, 2, axis=0)
    doubled.setflags(write=False)
    np.testing.assert_array_equal(backend.propagate(doubled[::2]), wanted)


def test_masked_arrays_are_refused(make):
    with pytest.raises(InputTypeError, match="samples is a masked array"):
        make("euler").propagate(np.ma.masked_array(np.zeros((4, 2, 3)), mask=True))


def test_zero_increments_leave_the_state(make, algorithm):
    backend = make(algorithm)
    history = backend.propagate(np.zeros((5, 2, 3)))
    np.testing.assert_array_equal(history, np.broadcast_to(backend.identity, history.shape))


def test_a_start_other_than_the_identity(make, algorithm, rng):
    backend = make(algorithm)
    first, second = random_increments(rng, 30, 2), random_increments(rng, 20, 2)
    middle = backend.propagate(first)[-1]
    joined = backend.propagate(np.concatenate([first, second]))[-1]
    assert np.abs(backend.propagate(second, initial=middle)[-1] - joined).max() <= roundoff(backend, 50)
    runs = backend.propagate(np.stack([second, second]), initial=middle)
    np.testing.assert_array_equal(runs[0], runs[1])


def test_step_broadcasts_leading_axes(make, algorithm, rng):
    backend = make(algorithm)
    d = random_increments(rng, 4, 5, 2)
    state = backend.step(backend.identity, d[0, 0])
    together = backend.step(state, d)
    assert together.shape == (4, 5, *backend.state_shape)
    np.testing.assert_array_equal(together[3, 2], backend.step(state, d[3, 2]))


@pytest.mark.parametrize(
    ("increments", "error", "words"),
    [
        (np.zeros((4, 3, 3)), InputError, ["samples", "(4, 3, 3)", "(..., 2, 3)"]),
        (np.zeros((2, 3)), InputError, ["samples", "steps"]),
        (np.zeros((4, 2, 3), complex), InputTypeError, ["samples", "complex128"]),
        ([[["a", "b", "c"]] * 2], InputTypeError, ["samples"]),
        (np.full((4, 2, 3), np.nan), InputError, ["samples", "nan", "finite"]),
        (np.full((4, 2, 3), np.inf), InputError, ["samples", "inf", "finite"]),
    ],
)
def test_increments_that_cannot_be_used(make, increments, error, words):
    with pytest.raises(error) as caught:
        make("euler").propagate(increments)
    assert all(word in str(caught.value) for word in words)


@pytest.mark.parametrize(
    "options",
    [
        {"record_every": 0},
        {"record_every": -1},
        {"record_every": 2**70},
        {"orthonormalize_every": 2**70},
        {"record_every": 1.5},
        {"record_every": True},
        {"orthonormalize_every": 0},
        {"orthonormalize_every": "5"},
        {"initial": np.zeros(3)},
        {"initial": np.full(4, np.nan)},
        {"initial": np.zeros((7, 4))},
    ],
)
def test_options_that_cannot_be_used(make, options):
    with pytest.raises(InputError) as caught:
        make("euler").propagate(np.zeros((4, 2, 3)), **options)
    assert next(iter(options)) in str(caught.value)


def test_number_of_inputs_and_axes_of_an_evaluator(backend_name):
    convert = strapgen.evaluator("dcm-from-euler", backend_name)
    with pytest.raises(InputError, match="2 inputs; 1 is needed: state"):
        convert(np.zeros(4), np.zeros(4))
    error = strapgen.evaluator("error-matrix", backend_name)
    with pytest.raises(InputError, match="do not broadcast"):
        error(np.zeros((2, 3, 3)), np.zeros((3, 3, 3)))


def test_unknown_names():
    with pytest.raises(
        InputError,
        match=r"'dmc' is not known \(did you mean dcm\?\); allowed: dcm, euler, cayley-klein",
    ):
        strapgen.backend("dmc")
    with pytest.raises(InputError, match="method 'rk9'"):
        strapgen.backend("dcm", "rk9")
    with pytest.raises(InputError, match="backend 'fortran' is not known; allowed: numpy, c, c-float"):
        strapgen.backend("dcm", backend="fortran")
    with pytest.raises(InputError, match="increments is 0"):
        strapgen.backend("dcm", increments=0)
    with pytest.raises(InputError, match="orthonormalization 'euler-normalize'"):
        strapgen.backend("dcm", orthonormalization="euler-normalize")
    with pytest.raises(InputError, match="no attitude step"):
        strapgen.build(strapgen.generate(strapgen.lower(strapgen.derive("error-matrix")), "numpy"))


@cache
def lowered(*chosen: object, **more: object) -> Program:
    """Return a program by the stages themselves, once for all back ends that run in this process."""
    return strapgen.lower(strapgen.derive(*chosen, **more))


@pytest.mark.long
def test_the_pipeline_by_hand_gives_the_same_back_end(backend_name, rng):
    built = strapgen.build(generated(lowered("euler", "rk2", 2), backend_name))
    increments = random_increments(rng, 20, 2)
    cached = strapgen.backend("euler", "rk2", 2, backend_name)
    np.testing.assert_array_equal(built.propagate(increments), cached.propagate(increments))


@pytest.mark.long
def test_a_step_from_rates_on_every_back_end(backend_name, rng):
    backend = strapgen.build(generated(lowered("dcm", "rk4", rates=True), backend_name))
    other = strapgen.backend("dcm", "rk4", 2, backend_name)
    d = random_increments(rng, 40, 2, size=0.01)
    # Rate extraction of two increments (thesis, chapter 3 A), at nodes 0, 1/2 and 1.
    turns = np.stack([3 * d[:, 0] - d[:, 1], d[:, 0] + d[:, 1], 3 * d[:, 1] - d[:, 0]], axis=1)
    states = backend.propagate(turns)
    both = roundoff(backend, 40) + roundoff(other, 40)
    np.testing.assert_allclose(states, other.propagate(d), rtol=0, atol=both)
    np.testing.assert_allclose(backend.step(states[0], turns[0]), states[1], rtol=0, atol=roundoff(other, 1))


def test_a_simulation_needs_increments_or_the_nodes_of_rates(backend_name):
    backend = strapgen.build(generated(lowered("dcm", "rk4", rates=True), backend_name))
    with pytest.raises(InputError, match="dcm-rk4-rates takes turns at nodes that its sources do not tell"):
        strapgen.simulate(backend, strapgen.motion("constant", x_deg_s=1), 1, 10)


@pytest.mark.long
def test_every_orthonormalization_restores_the_constraint(make, rng):
    # What each leaves of the excess S = C'C - I (thesis, appendix B); adding the duals cancels S to first order.
    left = {
        "dcm-orthonormalize": lambda S: S**2,
        "dcm-orthonormalize-optimal": lambda S: 0,
        "dcm-orthonormalize-first-order": lambda S: 3 / 4 * S**2 + 1 / 4 * S**3,
        "dcm-orthonormalize-second-order": lambda S: 5 / 8 * S**3 + 15 / 64 * S**4 + 9 / 64 * S**5,
    }
    assert set(left) == set(strapgen.catalogue.orthonormalizations("dcm"))
    rotations = strapgen.motion("coning", a_deg_s=30, b_deg_s=20, g_deg_s=10).attitude(np.arange(50.0))
    computed = rotations + rng.normal(scale=0.01 / 3, size=(50, 3, 3))
    excess = np.linalg.norm(np.swapaxes(computed, 1, 2) @ computed - np.eye(3), ord=2, axis=(1, 2))
    for scheme, residue in left.items():
        backend = make("dcm", orthonormalization=scheme)
        restored = backend.orthonormalize(computed).astype(float)
        after = np.linalg.norm(np.swapaxes(restored, 1, 2) @ restored - np.eye(3), ord=2, axis=(1, 2))
        # 100 units: some dozens of operations on numbers near 1, all well conditioned. An error of the elements is
        # one of twice its spectral norm, at most six times as much, in C'C.
        allowed = one_call(backend.companion(scheme), 100 / 6)
        assert np.all(after <= residue(excess) + 6 * allowed), scheme


def test_conversions_close_on_every_back_end(backend_name, rng):
    to_dcm = strapgen.evaluator("dcm-from-euler", backend_name)
    back = strapgen.evaluator("euler-from-dcm", backend_name)
    e = rng.normal(size=(few(backend_name, 1000), 4))
    e *= np.sign(e[:, 3:]) / np.linalg.norm(e, axis=1, keepdims=True)
    # Each element of the matrix is off by a few units; the largest parameter is at least 1/2, so dividing by
    # four times it magnifies no more than that.
    allowed = max(one_call(to_dcm, 16), one_call(back, 16) + one_call(to_dcm, 0))
    assert np.abs(back(to_dcm(e)) - e).max() <= allowed
    klein = strapgen.evaluator("cayley-klein-from-euler", backend_name)(e)
    unit = getattr(to_dcm, "interface", None) and float(to_dcm.interface.inputs[0].format.unit)
    rounded = np.rint(e / unit) * unit if unit else e.astype(klein.dtype)
    np.testing.assert_array_equal(klein, np.roll(rounded, 1, axis=1))
    via_klein = strapgen.evaluator("dcm-from-cayley-klein", backend_name)(klein)
    np.testing.assert_array_equal(via_klein, to_dcm(e))


# Other methods, and steps that keep increments

METHODS = ("taylor4", "magnus4", "munthe-kaas4")


@pytest.mark.long
@pytest.mark.parametrize(
    ("algorithm", "count", "previous", "ahead"),
    [
        ("dcm", 1, 2, 1),
        *(
            pytest.param(*case, marks=pytest.mark.long)
            for case in (("euler", 2, 1, 0), ("euler", 1, 0, 3), ("cayley-klein", 1, 3, 2))
        ),
    ],
)
def test_a_step_takes_increments_beside_its_own_on_every_back_end(
    make, algorithm, count, previous, ahead, rng
):
    beside = {"previous": previous, "ahead": ahead}
    backend = make(algorithm, "rk4", count, **beside)
    assert (backend.increments, backend.previous, backend.ahead) == (count, previous, ahead)
    assert backend.samples_per_step == count + previous + ahead
    row = random_increments(rng, previous + 60 * count + ahead)
    increments = windows(row, count, previous + ahead)
    wanted = strapgen.backend(algorithm, "rk4", count, "numpy", **beside).propagate(increments)
    history = backend.propagate(increments)
    both = roundoff(backend, 60) + 16 * 60 * 2.0**-53
    assert np.abs(history - wanted).max() <= both
    state = backend.identity
    for step, expected in zip(increments, history[1:], strict=True):
        state = backend.step(state, step)
        assert np.abs(state - expected).max() <= roundoff(backend, 60)


@pytest.mark.long
@pytest.mark.parametrize(("count", "previous", "ahead"), [(1, 1, 0), (1, 0, 1), (2, 2, 1)])
def test_an_exact_fit_needs_no_more_samples(make, count, previous, ahead):
    # A rate that rises linearly: whatever fits it gives the step of two increments.
    backend, other = make("euler", "rk4", count, previous=previous, ahead=ahead), make("euler", "rk4", 2)

    def row(samples: int, before: int, after: int = 0) -> np.ndarray:
        times = np.arange(-before, 20 * samples + after + 1)[:, None] / samples
        angle = 0.004 * times * [1, -2, 1] + 1e-4 * times**2 * [3, 1, -1]
        return np.diff(angle, axis=0)

    found = backend.propagate(windows(row(count, previous, ahead), count, previous + ahead))
    wanted = other.propagate(windows(row(2, 0), 2))
    assert np.abs(found - wanted).max() <= roundoff(backend, 20) + roundoff(other, 20)


def test_increments_that_a_step_keeps_belong_to_its_shape(make):
    backend = make("euler", "rk4", 1, previous=2)
    with pytest.raises(InputError, match=r"samples has shape \(4, 1, 3\); \(\.\.\., 3, 3\) is needed"):
        backend.propagate(np.zeros((4, 1, 3)))


@pytest.mark.long
@pytest.mark.parametrize(("algorithm", "previous"), [("dcm", 0), ("euler", 2)])
@pytest.mark.parametrize("method", METHODS)
def test_methods_without_tableau_agree_in_floating_point(method, algorithm, previous, rng):
    increments = windows(random_increments(rng, previous + 400), 2, previous)
    by = {
        name: strapgen.backend(algorithm, method, 2, name, previous=previous)
        for name in ("numpy", "c", "c-float")
    }
    histories = {name: backend.propagate(increments) for name, backend in by.items()}
    for name in ("c", "c-float"):
        allowed = roundoff(by[name], 200) + roundoff(by["numpy"], 200)
        assert np.abs(histories[name] - histories["numpy"]).max() <= allowed
    for name, backend in by.items():
        state, states = backend.identity, [backend.identity]
        for step in increments:
            state = backend.step(state, step)
            states.append(state)
        assert np.abs(histories[name] - np.array(states)).max() <= roundoff(backend, 200)


@pytest.mark.parametrize("method", ["magnus2", "magnus4", "magnus6", "munthe-kaas4"])
def test_exponentials_stay_rotations_however_long_the_run(method, rng):
    backend = strapgen.backend("euler", method, 2, "c")
    states = backend.propagate(random_increments(rng, 2000, 2, size=0.5))
    assert np.abs(np.linalg.norm(states, axis=-1) - 1).max() <= roundoff(backend, 2000)
    # A method that is none loses the length at such increments.
    others = strapgen.backend("euler", "rk4", 2, "c").propagate(np.full((9, 2, 3), 0.5))
    assert np.abs(np.linalg.norm(others, axis=-1) - 1).max() > 0.01


@pytest.mark.parametrize("size", [0.0, 1e-300, 1e-160, 1e-9])
@pytest.mark.parametrize("method", ["magnus4", pytest.param("munthe-kaas4", marks=pytest.mark.long)])
def test_exponentials_have_no_hole_at_zero(method, algorithm, size):
    # The root of a square that underflows is 0, and sin(x)/x is 1 there.
    for name in ("numpy", "c", "c-float"):
        backend = strapgen.backend(algorithm, method, 2, name)
        turn = np.full((3, 2, 3), size)
        end = backend.propagate(turn)[-1]
        wanted = strapgen.backend(algorithm, "rk4", 2, name).propagate(turn)[-1]
        np.testing.assert_allclose(end, wanted, rtol=0, atol=roundoff(backend, 3))


def test_a_choice_is_a_back_end_like_its_name(backend_name, rng):
    increments = random_increments(rng, 20, 1)
    by_name = strapgen.backend("dcm", "rk2", 1, backend_name)
    by_choice = strapgen.backend(strapgen.choose("dcm", "rk2", 1), backend=backend_name)
    np.testing.assert_array_equal(by_choice.propagate(increments), by_name.propagate(increments))
    with pytest.raises(InputError, match="previous is 1, but the choice of dcm-rk2-1 has its own"):
        strapgen.backend(strapgen.choose("dcm", "rk2", 1), backend=backend_name, previous=1)


def made(backend_name, function, bound=1):
    build = KernelBuilder()
    x = build.scalar(Signal.scalar("x", meaning="argument", bound=Fraction(bound)))
    build.output(Signal("y", (1,), ("y_1",), meaning="value"), [function(x)])
    kernel = build.kernel("tested", "A function", "none")
    return of_sources(generated(strapgen.lower(kernel), backend_name))


def last_place(evaluator, backend_name):
    if BACKENDS[backend_name].fixed:
        return float(evaluator.interface.outputs[0].format.unit)
    return float(np.finfo(evaluator.dtype).eps)


@pytest.mark.parametrize("name", ["asin", "acos"])
def test_inverse_sine_and_cosine(name, backend_name):
    evaluator = made(backend_name, getattr(sp, name))
    unit = last_place(evaluator, backend_name)
    ends = 1 - 2.0 ** -np.arange(1, 53)
    points = np.concatenate([np.linspace(-1, 1, 41), ends, -ends, [1e-9, -1e-300]]).astype(evaluator.dtype)
    if BACKENDS[backend_name].fixed:
        argument = evaluator.interface.inputs[0]
        points = evaluator.numbers(argument, evaluator.integers(argument, points))
        unit = float(evaluator.interface.outputs[0].errors[0])
    else:
        unit *= 4
    for x, y in zip(points, evaluator(points)[:, 0], strict=True):
        assert abs(float(y) - float(getattr(mpmath, name)(mpmath.mpf(float(x))))) <= unit


def test_beyond_the_ends_is_the_end():
    evaluator = made("numpy", sp.asin, 2)
    assert evaluator(1 + 2.0**-52) == pytest.approx(np.pi / 2, abs=1e-15)


def test_whole_turns_are_taken_off(backend_name):
    evaluator = made(backend_name, lambda x: Wrapped(x), 9)
    points = np.array([-9, -4, -3.2, -3.1, 0, 1, 3.1, 3.2, 9])
    wanted = points - 2 * np.pi * np.round(points / (2 * np.pi))
    off = np.abs(evaluator(points.astype(evaluator.dtype))[:, 0] - wanted)
    # The last place of the argument, which is rounded too.
    assert off.max() <= 16 * last_place(evaluator, backend_name)


def test_the_resolution_is_the_targets(backend_name):
    evaluator = made(backend_name, lambda x: x + EPSILON)
    wanted = {"float": 2.0**-23, "32": 2.0**-30, "16": 2.0**-14}
    assert float(evaluator(0.0)[0]) == wanted.get(precision(backend_name), 2.0**-52)


def test_samples_keep_their_old_name_with_a_warning():
    made, turn = strapgen.backend("euler"), np.full((4, 2, 3), 0.01)
    program = strapgen.lower(strapgen.derive("euler"))
    calls = [
        (lambda **given: made.step(made.identity, **given), turn[0]),
        (made.propagate, turn),
        (made.representable, turn),
        (lambda **given: strapgen.gyro.pulses(size=1e-3, **given), turn),
        (lambda **given: strapgen.gyro.windows(count=2, **given), turn[:, 0]),
        (lambda **given: strapgen.exact.propagate(program, **given), turn),
    ]
    for call, array in calls:
        with pytest.warns(DeprecationWarning, match=r"^increments is now samples$"):
            old = call(increments=array)
        np.testing.assert_array_equal(old, call(samples=array))
    with pytest.warns(DeprecationWarning, match=r"^Backend\.samples is now samples_per_step$"):
        assert made.samples == made.samples_per_step == 2


def test_a_recording_keeps_the_old_name_of_its_samples():
    rows = np.full((4, 3), 0.01)
    for make in (
        lambda **given: strapgen.Recording(0.0, 0.01, **given),
        lambda **given: strapgen.InertialRecording(0.0, 0.01, velocity_increments=rows, **given),
    ):
        with pytest.warns(DeprecationWarning, match=r"^increments is now samples$"):
            recording = make(increments=rows)
        with pytest.warns(DeprecationWarning, match=r"increments is now samples$"):
            assert np.shares_memory(recording.increments, rows)
        with pytest.warns(DeprecationWarning, match=r"^increments is now samples$"):
            assert replace(recording, increments=2 * rows).samples.tolist() == (2 * rows).tolist()
