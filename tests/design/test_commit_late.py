"""Attitudes that are committed late and answered now: what is committed, the start, the end, gaps and resets."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import strapgen
from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.design.commit_late.commit_late import CommitLate
from strapgen.design.commit_late.commit_late_sources import family, parts, sources
from strapgen.design.commit_late.late_filters import LateFilters, polynomial
from strapgen.design.commit_late.late_recording import recording_attitudes
from strapgen.design.commit_late.late_unit import GapError, SampleKind
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.fixed_settings import Settings
from strapgen.lab.runs import drift_between
from strapgen.run import compiler

WINDOW = "window-3-3"
P, L, W = 3, 3, 7
#: The same without filters of its own for the start, as words have it.
CALM = replace(WINDOWS[WINDOW], start=())
GOOD, LOST, MERGED = SampleKind
#: A gyro that counts 0.03 deg/s a unit, up to 700 deg/s.
COUNTS = {"lsb": "0.03dps", "sample_hz": 100, "max_rate_deg_s": 700}
#: Rounding of a few dozen steps, each of some hundred operations on numbers up to 1.
ROUNDING = 2e-14


@cache
def samples(count: int = 40, name: str = "random") -> np.ndarray:
    """Return the increments of a motion at 100 Hz in rad."""
    settings = {
        "random": {"rate_deg_s": 200},
        "cone": {"half_angle_deg": 1, "frequency_hz": 10},
        "slew": {"onset_s": 0.05},
    }[name]
    # The first slew is at 3 s.
    first = 280 if name == "slew" else 0
    return strapgen.motion(name, **settings).samples(Fraction(1, 100), first, first + count)


def steps(increments: np.ndarray) -> list[np.ndarray]:
    """Return the transition of every interval of a recording, by the catalogue's steps with the right filters."""
    transitions = []
    for number in range(len(increments)):
        first = min(max(number - P, 0), len(increments) - W)
        before = number - first
        window = WINDOWS[f"window-{before}-{W - 1 - before}"]
        window = WINDOWS[WINDOW].start[before] if before < P else window
        backend = strapgen.backend("euler", window)
        transitions.append(backend.step(backend.identity, increments[first : first + W]))
    return transitions


def product(transitions: list[np.ndarray], start: np.ndarray | None = None) -> np.ndarray:
    multiply = strapgen.evaluator("euler-product")
    state = np.array([0.0, 0, 0, 1]) if start is None else start
    for transition in transitions:
        state = multiply(state, transition)
    return state


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """Return the angle between two attitudes in rad."""
    return float((Rotation.from_quat(one).inv() * Rotation.from_quat(other)).magnitude())


@pytest.mark.long
def test_every_interval_has_the_filters_of_the_catalogue_for_its_place_in_the_recording():
    increments = samples(16)
    unit = CommitLate(WINDOW)
    committed: list[np.ndarray] = []
    for sample in increments:
        assert unit.push(sample) == len(unit.committed)
        committed += unit.committed
    assert len(committed) == len(increments) - L
    now = unit.now()
    assert unit.flush() == len(unit.committed) == L
    committed += unit.committed
    transitions = steps(increments)
    for number, attitude in enumerate(committed, 1):
        np.testing.assert_allclose(attitude, product(transitions[:number]), rtol=0, atol=ROUNDING)
    # The first order of normalization is all that now is without.
    np.testing.assert_allclose(now, committed[-1], rtol=0, atol=ROUNDING)


def test_now_is_an_answer_and_changes_nothing():
    asked, silent = CommitLate(WINDOW), CommitLate(WINDOW)
    for sample in samples(20):
        asked.push(sample)
        silent.push(sample)
        for _ in range(2):
            asked.now()
    np.testing.assert_array_equal(asked.attitude, silent.attitude)
    np.testing.assert_array_equal(asked.now(), silent.now())


@pytest.mark.long
def test_present_attitude_is_committed_l_samples_later():
    unit, now, committed = CommitLate("window-5-5"), [], []
    for sample in samples(60, "cone"):
        unit.push(sample)
        committed += unit.committed
        now.append(unit.now())
    errors = [apart(one, other) for one, other in zip(now[15:], committed[15:], strict=False)]
    assert 1e-9 < max(errors) < 1e-5


def test_polynomials_give_the_rate_until_a_window_is_full():
    unit = CommitLate(WINDOW)
    np.testing.assert_array_equal(unit.now(), unit.identity)
    rotation = strapgen.evaluator("euler-legendre-4")
    for count in range(1, W):
        increments = samples()[:count]
        unit.push(increments[-1])
        state = unit.identity
        for place in range(count):
            number = min(count, 4)
            first = min(max(place - 1, 0), count - number)
            rows = np.array(polynomial(number, place - first, 4), float)
            state = rotation(state, *(rows @ increments[first : first + number]))
        np.testing.assert_allclose(unit.now(), state, rtol=0, atol=ROUNDING)
    assert unit.pending == W - 1
    assert unit.flush() == W - 1


@pytest.mark.long
def test_a_recording_that_runs_backwards_gives_the_way_back():
    # With the filters of now at both ends, which are each other's mirror images.
    increments, ways = samples(20), []
    for row in (increments, -increments[::-1]):
        unit = CommitLate(CALM)
        for sample in row:
            unit.push(sample)
        unit.flush()
        ways.append(unit.attitude)
    np.testing.assert_allclose(product([ways[1]], ways[0]), [0, 0, 0, 1], rtol=0, atol=ROUNDING)


def test_a_reset_replaces_the_committed_attitude_and_keeps_the_samples():
    start = Rotation.from_rotvec([0.3, -0.5, 0.9]).as_quat()
    one, other = CommitLate(WINDOW), CommitLate(WINDOW)
    for sample in samples(15):
        one.push(sample)
        other.push(sample)
    before = one.attitude
    one.reset(start)
    np.testing.assert_array_equal(one.attitude, start)
    for sample in samples(25)[15:]:
        one.push(sample)
        other.push(sample)
    moved = product([other.attitude], before * [-1, -1, -1, 1])
    np.testing.assert_allclose(one.attitude, product([moved], start), rtol=0, atol=ROUNDING)


def test_samples_after_a_flush_go_on():
    unit, through = CommitLate(WINDOW), CommitLate(WINDOW)
    for number, sample in enumerate(samples(60, "cone")):
        unit.push(sample)
        through.push(sample)
        if number == 30:
            assert unit.flush() == L
            assert unit.flush() == 0
    assert unit.flush() == through.flush() == L
    # Intervals that were committed with fewer samples ahead have the error of now.
    assert apart(unit.attitude, through.attitude) < 1e-4


def run(name: str, window: str, kinds: dict[int, int], count: int = 44, backend: str = "c") -> CommitLate:
    """Return a unit after a motion whose samples are lost or merged at some numbers."""
    unit = CommitLate(window, backend=backend)
    increments = samples(count, name)
    for number, sample in enumerate(increments):
        kind = kinds.get(number, GOOD)
        unit.push(sample + increments[number - 1] if kind == MERGED else sample, kind)
    return unit


@pytest.mark.long
@pytest.mark.parametrize("name", ["random", "cone", "slew"])
@pytest.mark.parametrize(
    "kinds",
    [{8: LOST}, {14: LOST}, {22: LOST}, {24: LOST, 33: LOST}, {22: LOST, 23: MERGED}, {8: LOST, 9: MERGED}],
    ids=str,
)
def test_a_lost_sample_costs_nothing_within_the_band(name, kinds):
    whole, gap = run(name, "window-7-7", {}), run(name, "window-7-7", kinds)
    assert whole.pending == gap.pending
    # The restoring filter leaves 4e-7 of a sample at the ends of the band, of rates of 300 deg/s at most.
    assert apart(whole.attitude, gap.attitude) < 6e-8 * len([k for k in kinds.values() if k == LOST])


def test_intervals_wait_for_eight_samples_after_a_gap():
    unit, counts = CommitLate("window-7-7"), []
    for number, sample in enumerate(samples(44)):
        counts.append(unit.push(sample, LOST if number == 20 else GOOD))
    assert counts[14:20] == [8, 1, 1, 1, 1, 1]
    assert counts[20:30] == [0] * 8 + [9, 1]
    first = CommitLate("window-7-7")
    counts = [first.push(sample, LOST if number == 14 else GOOD) for number, sample in enumerate(samples(24))]
    assert max(counts) == counts[22] == LateFilters(WINDOWS["window-7-7"]).most_commits == 16


@pytest.mark.long
def test_now_goes_on_with_an_estimate_while_a_gap_is_open():
    whole, gap = CommitLate("window-7-7"), CommitLate("window-7-7")
    for number, sample in enumerate(samples(40, "slew")):
        whole.push(sample)
        gap.push(sample, LOST if number == 30 else GOOD)
        # Four samples of an onset of 50 ms tell the next one to some per cent of a sample, 0.05 rad.
        assert apart(whole.now(), gap.now()) < (0 if number < 30 else 3e-3) + 1e-15
    assert apart(whole.now(), gap.now()) < 1e-7


def test_an_open_gap_is_flushed_with_its_estimate():
    whole, gap = run("slew", WINDOW, {}, 35), run("slew", WINDOW, {30: LOST}, 35)
    assert gap.pending == whole.pending + 5
    now = gap.now()
    assert gap.flush() == L + 5
    np.testing.assert_allclose(gap.attitude, now, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize(
    ("before", "kind", "reason"),
    [
        ({12: LOST}, LOST, "lost 1 after"),
        ({9: LOST}, LOST, "lost 4 after"),
        ({}, MERGED, "follows no lost sample"),
        ({11: LOST}, MERGED, "follows no lost sample"),
    ],
    ids=["at once", "within eight", "without a gap", "too late"],
)
@pytest.mark.parametrize("backend", ["numpy", "c"])
def test_gaps_that_no_filter_restores_are_refused_and_change_nothing(before, kind, reason, backend):
    unit, other = (run("random", WINDOW, before, 13, backend) for _ in range(2))
    with pytest.raises(GapError, match=reason):
        unit.push([0.0, 0.0, 0.0], kind)
    for sample in samples(30)[13:]:
        assert unit.push(sample) == other.push(sample)
        np.testing.assert_array_equal(unit.now(), other.now())


def test_a_gap_in_the_first_eight_samples_is_refused():
    unit = run("random", WINDOW, {}, 7)
    with pytest.raises(GapError, match="after 7 samples"):
        unit.push([0.0, 0.0, 0.0], LOST)
    unit.push(samples()[7])
    unit.push([0.0, 0.0, 0.0], LOST)


def test_the_direction_cosine_matrix_is_that_of_the_euler_parameters():
    parameters, matrix = CommitLate(WINDOW, "euler"), CommitLate(WINDOW, "dcm")
    for sample in samples(20):
        assert parameters.push(sample) == matrix.push(sample)
    convert = strapgen.evaluator("dcm-from-euler")
    for one, other in ((parameters.attitude, matrix.attitude), (parameters.now(), matrix.now())):
        np.testing.assert_allclose(convert(one), other, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("sample", [[1.0, 2.0], [[1.0, 2.0, 3.0]], [0.0, 0.0, np.nan], "xyz"], ids=str)
def test_samples_and_attitudes_are_finite_numbers_of_their_shape(sample):
    unit = CommitLate(WINDOW)
    for call in (unit.push, unit.reset):
        with pytest.raises((InputError, InputTypeError)):
            call(sample)
    with pytest.raises(InputError, match="kind is 3"):
        unit.push([0.0, 0.0, 0.0], 3)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("window-2-2",), "window is 'window-2-2'"),
        ((WINDOW, "cayley-klein"), "algorithm"),
        (("window-4-2",), "whole family"),
        (("window-9-9", "euler", "c-fixed32"), "only that to fourth order"),
        ((WINDOW, "euler", "exact"), "these commit late: numpy, c, c-float, c-fixed32"),
    ],
)
def test_unknown_names_are_refused(arguments, reason):
    with pytest.raises(InputError, match=reason):
        CommitLate(*arguments)


# Generated C


#: Every window, run and algorithm once.
QUICK_RUNS = {
    ("window-3-3", "random", "euler"),
    ("window-3-3", "cone", "dcm"),
    ("window-3-3", "slew", "euler"),
}


@pytest.mark.parametrize(
    ("window", "name", "algorithm", "backends", "settings"),
    [
        *(
            pytest.param(
                window, name, algorithm, ("numpy", "c"), None, marks=() if quick else pytest.mark.long
            )
            for window in ("window-3-3", "window-7-7")
            for name in ("random", "cone", "slew")
            for algorithm in ("euler", "dcm")
            for quick in [(window, name, algorithm) in QUICK_RUNS]
        ),
        (WINDOW, "random", "euler", ("fixed-model", "c-fixed32"), {"carry": "full"}),
        *(
            pytest.param(
                WINDOW, "random", algorithm, ("fixed-model", "c-fixed32"), more, marks=pytest.mark.long
            )
            for algorithm, more in (
                ("euler", {"carry": "none"}),
                ("dcm", {"carry": "full"}),
                ("euler", {"carry": "full", **COUNTS}),
            )
        ),
    ],
)
def test_c_has_the_bits_of_python_and_of_the_model(window, name, algorithm, backends, settings):
    """Operations have one order, so that nothing may differ, with gaps, resets and flushes too."""
    settings = settings and Settings.of(**settings)
    python, c = (CommitLate(window, algorithm, backend, settings=settings) for backend in backends)
    increments = samples(60, name)
    kinds = {9: LOST, 25: LOST, 26: MERGED, 40: LOST, 56: LOST}
    for number, sample in enumerate(increments):
        if number == 33:
            start = python.attitude.T if algorithm == "dcm" else python.attitude * [-1, -1, -1, 1]
            python.reset(start)
            c.reset(start)
        if number == 45:
            assert python.flush() == c.flush() > 0
        kind = kinds.get(number, GOOD)
        value = sample + increments[number - 1] if kind == MERGED else sample
        assert python.push(value, kind) == c.push(value, kind)
        np.testing.assert_array_equal(python.attitude, c.attitude)
        np.testing.assert_array_equal(python.now(), c.now())
        assert python.pending == c.pending


@pytest.mark.long
def test_c_in_float_is_that_in_double_but_for_rounding():
    double, single = CommitLate(WINDOW, backend="c"), CommitLate(WINDOW, backend="c-float")
    for number, sample in enumerate(samples(60)):
        kind = LOST if number == 20 else GOOD
        assert double.push(sample, kind) == single.push(sample, kind)
        # Units of 2^-24 in each of up to 60 steps.
        np.testing.assert_allclose(double.now(), single.now(), rtol=0, atol=60 * 2**-24)
    assert single.attitude.dtype == np.float32


def test_c_refuses_inputs_as_its_header_states_and_writes_nothing():
    built = sources(WINDOW)
    module = compiler.load(built)
    ffi, lib = module.ffi, module.lib
    memory = ffi.new("euler_late_3_3_memory *")
    sample, state = ffi.new("double[3]"), ffi.new("double[4]")
    null = ffi.NULL
    assert lib.euler_late_3_3_init(null) == lib.euler_late_3_3_flush(null) == -4
    assert lib.euler_late_3_3_init(memory) == 0
    for _ in range(20):
        assert lib.euler_late_3_3_push(memory, sample, 0) >= 0
    before = bytes(ffi.buffer(memory))
    assert lib.euler_late_3_3_push(null, sample, 0) == lib.euler_late_3_3_push(memory, null, 0) == -4
    assert lib.euler_late_3_3_push(memory, sample, 3) == lib.euler_late_3_3_push(memory, sample, -1) == -5
    assert lib.euler_late_3_3_push(memory, sample, 2) == -3
    assert lib.euler_late_3_3_now(memory, null) == lib.euler_late_3_3_now(null, state) == -4
    assert lib.euler_late_3_3_reset(memory, null) == lib.euler_late_3_3_reset(null, state) == -4
    assert bytes(ffi.buffer(memory)) == before
    assert lib.euler_late_3_3_push(memory, null, 1) == 0  # a lost sample need not be there
    assert lib.euler_late_3_3_push(memory, sample, 1) == -3
    for name, value in {"GAP": -3, "NULL": -4, "KIND": -5, "LOST": 1, "MERGED": 2, "LATENCY": 3}.items():
        text = f"({value})" if value < 0 else str(value)
        assert f"#define EULER_LATE_3_3_{name} {text}\n" in built.files["euler_late_3_3.h"]


#: Largest errors in rad over 60 s at 100 Hz: of the committed attitude, and of that of now.
LARGEST = [
    ("cone", {"half_angle_deg": 1, "frequency_hz": 10}, 1.9e-9, 3.7e-9),
    ("cone", {"half_angle_deg": 1, "frequency_hz": 20}, 4.2e-8, 7.5e-8),
    ("random", {"rate_deg_s": 200}, 2.2e-7, 5.2e-6),
    ("slew", {"onset_s": 0.05}, 2.6e-12, 6.5e-9),
    ("slew", {"onset_s": 0.01}, 4e-7, 6.2e-6),
    ("ramps", {"onset_s": 0.05}, 9e-7, 5.0e-6),
]


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "settings", "largest", "largest_now"), LARGEST, ids=[str(row[:2]) for row in LARGEST]
)
def test_attitudes_are_as_accurate_as_published(name, settings, largest, largest_now):
    motion = strapgen.motion(name, **settings)
    before, count = 14, 6000
    increments = motion.samples(Fraction(1, 100), -before, count)
    true = motion.attitude(np.arange(count + 1) / 100)
    unit = CommitLate("window-7-7", backend="c")
    for sample in increments[: before + 7]:
        unit.push(sample)
    assert unit.pending == 7  # sample 0 of the motion, and six more
    unit.reset(Rotation.from_matrix(true[0]).as_quat())
    committed, now = [], []
    for sample in increments[before + 7 :]:
        assert unit.push(sample) == 1
        committed.append(unit.attitude)
        now.append(unit.now())
    matrices = [Rotation.from_quat(np.array(attitudes)).as_matrix() for attitudes in (committed, now)]
    late = drift_between(matrices[0], true[1 : count - 6])
    current = drift_between(matrices[1], true[8:])
    assert np.linalg.norm(late, axis=1).max() == pytest.approx(largest, rel=0.1)
    assert np.linalg.norm(current, axis=1).max() == pytest.approx(largest_now, rel=0.1)


@pytest.mark.long
def test_the_start_of_a_recording_is_as_accurate_as_published():
    # 4.2e-8 rad with a full history; with filters of the start as calm as those of now it would be 9.5e-8.
    motion, count = strapgen.motion("cone", half_angle_deg=1, frequency_hz=20), 6000
    true, window = motion.attitude(np.arange(count + 1) / 100), WINDOWS["window-7-7"]
    samples_ = motion.samples(Fraction(1, 100), 0, count)
    largest = []
    for chosen in (window, replace(window, start=())):
        start = Rotation.from_matrix(true[0]).as_quat()
        computed = recording_attitudes(chosen, samples_, backend="c", initial=start)
        apart_ = drift_between(Rotation.from_quat(computed[:-7]).as_matrix(), true[:-7])
        largest.append(np.linalg.norm(apart_, axis=1).max())
    assert largest[0] == pytest.approx(4.7e-8, rel=0.1)
    assert largest[1] > 1.5 * largest[0]


# Fixed point


@pytest.mark.long
def test_normalizations_on_the_way_are_those_of_the_model():
    settings = Settings(carry="state")
    model, c = (CommitLate(WINDOW, "euler", name, settings=settings) for name in ("fixed-model", "c-fixed32"))
    for sample in np.tile(samples(60), (36, 1)):
        assert model.push(sample) == c.push(sample)
    np.testing.assert_array_equal(model.attitude, c.attitude)
    assert abs(np.linalg.norm(c.attitude) - 1) < 1e-8


@pytest.mark.parametrize("backend", ["c-fixed32", "fixed-model"])
def test_samples_and_states_outside_their_ranges_are_refused(backend):
    unit = CommitLate(WINDOW, backend=backend)
    for sample in samples(20):
        unit.push(sample)
    before = unit.now()
    with pytest.raises(InputError, match="sample holds 0"):
        unit.push([0.0, 0.126, 0.0])
    unit.push([0.0, 0.0, 0.0], LOST)
    unit.push([0.0, 0.2, 0.0], MERGED)
    with pytest.raises(InputError, match="attitude"):
        unit.reset([0.0, 0.0, 0.0, 1.2])
    assert unit.pending == L + 2
    assert not np.array_equal(unit.now(), before)


def test_integer_c_refuses_inputs_as_its_header_states():
    module = compiler.load(sources(WINDOW, "euler", "c-fixed"))
    ffi, lib = module.ffi, module.lib
    memory, sample = ffi.new("euler_late_3_3_w32_memory *"), ffi.new("int32_t[3]")
    state = ffi.new("int32_t[4]", [0, 0, 0, 1 << 30])
    lib.euler_late_3_3_w32_init(memory)
    for _ in range(20):
        assert lib.euler_late_3_3_w32_push(memory, sample, 0) >= 0
    before = bytes(ffi.buffer(memory))
    sample[1] = (1 << 29) + 1
    assert lib.euler_late_3_3_w32_push(memory, sample, 0) == -1
    sample[1] = -sample[1]
    assert lib.euler_late_3_3_w32_push(memory, sample, 0) == -1
    assert bytes(ffi.buffer(memory)) == before
    sample[1] = 1 << 29
    # A state that no step takes: samples are held until there is no room, and a reset lets them go.
    assert lib.euler_late_3_3_w32_reset(memory, ffi.new("int32_t[4]", [0, 0, 0, 2**31 - 1])) == 0
    assert [lib.euler_late_3_3_w32_push(memory, sample, 0) for _ in range(20)] == [-2] * 20
    assert memory.pending == 17
    assert lib.euler_late_3_3_w32_now(memory, state) == lib.euler_late_3_3_w32_flush(memory) == -2
    assert list(state) == [0, 0, 0, 1 << 30]
    assert lib.euler_late_3_3_w32_reset(memory, state) == 0
    assert lib.euler_late_3_3_w32_flush(memory) == 17


@pytest.mark.long
def test_the_exact_rotation_is_committed_late_too():
    """Its errors of now are those of its filters; committed, it is the best of the catalogue."""
    motion = strapgen.motion("random", rate_deg_s=200)
    increments, true = motion.samples(Fraction(1, 100), 0, 1000), motion.attitude(np.arange(1001) / 100)
    unit, python = (CommitLate("window-9-9", backend=name) for name in ("c", "numpy"))
    start = Rotation.from_matrix(true[0]).as_quat()
    unit.reset(start)
    python.reset(start)
    for number, sample in enumerate(increments):
        assert unit.push(sample) == (0 if number < 18 else 10 if number == 18 else 1)
        if number < 40:
            python.push(sample)
            np.testing.assert_array_equal(unit.now(), python.now())
    # The start is committed with one-sided filters, whose errors stay.
    error = drift_between(Rotation.from_quat(unit.attitude).as_matrix(), true[991])
    assert np.linalg.norm(error) < 1e-7


def test_samples_are_counted_so_that_no_angle_is_lost():
    unit = CommitLate(WINDOW, backend="c-fixed32", settings=Settings(carry="full"))
    for _ in range(300):
        unit.push([0.0, 0.0, 1000.3 * 2.0**-32])
    unit.flush()
    # A third of a unit a sample is 100 units in all; the state has units of 2^-30, and error feedback below them.
    assert apart(unit.attitude, np.array([0.0, 0.0, 150045 * 2.0**-32, 1.0])) < 4 * 2.0**-30


@pytest.mark.long
@pytest.mark.parametrize("carry", ["none", "full"])
def test_the_committed_attitude_stays_within_the_bounds_of_its_steps(carry):
    settings = Settings(carry=carry)
    late = parts(family(WINDOW), "euler", "c-fixed", settings)
    fixed, double = (
        CommitLate(WINDOW, backend="c-fixed32", settings=settings),
        CommitLate(CALM, backend="c"),
    )
    drawn = np.random.default_rng(3).uniform(-0.125, 0.125, (500, 3))
    commits, largest = 0, 0.0
    for sample in np.rint(np.ldexp(drawn, 32)) / 2.0**32:
        commits += fixed.push(sample)
        double.push(sample)
        largest = max(largest, apart(fixed.attitude, double.attitude))
    # The start has P steps by other filters, each with a share of the bound of now, as a length of half the angle.
    start = 2 * float(late.fixed.now_errors.running) * P / L
    bound = start + late.step.fixed.angle_accumulation.bound(commits)
    assert commits == 497
    assert 0 < largest < bound
