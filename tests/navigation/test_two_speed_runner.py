"""Algorithms in two speeds: the figures that are known, the truth, and all back ends beside each other."""

from __future__ import annotations

import pickle
import shutil
import subprocess
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from precisions import precision, single
from scipy.integrate import quad_vec
from scipy.spatial.transform import Rotation

from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.two_speed.two_speed_runner import Loops, LoopSources, TwoSpeed
from strapgen.navigation.two_speed.two_speed_sources import ALGORITHMS, SCULLING, loops, sources
from strapgen.run import compiler
from strapgen.run.backend_names import evaluator_class
from strapgen.run.backends import BACKENDS

FORMS = [(a, s) for a in ALGORITHMS for s in SCULLING]
STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-O1"]


@cache
def made(algorithm: str, sculling: int, backend: str, carry: str = "none") -> TwoSpeed:
    settings = Settings(carry=carry) if BACKENDS[backend].fixed else None
    return TwoSpeed(algorithm, sculling, backend, settings)


def rotations(runner: TwoSpeed, attitudes: np.ndarray) -> Rotation:
    of = Rotation.from_matrix if attitudes.shape[-1] == 3 else Rotation.from_quat
    return of(np.concatenate([runner.identity[None], attitudes]))


# The vibration of the source: f = 7 Hz, fast cycles of 10 ms, slow ones of 100 ms

FREQUENCY, FAST, SLOW = 7.0, 0.01, 0.1


def vibration(cycles: int) -> tuple[np.ndarray, np.ndarray]:
    """Return angle and velocity increments, the first of them before the start."""
    phase = 2 * np.pi * FREQUENCY * FAST * np.arange(-1, 10 * cycles + 1)
    zero = np.zeros(10 * cycles + 1)
    x, y = np.diff(0.01 * np.sin(phase)), np.diff(0.013 * np.sin(phase + 0.9))
    v = np.diff(-3 / (2 * np.pi * FREQUENCY) * np.cos(phase + 0.9))
    return np.stack([x, y, zero], axis=-1), np.stack([zero, v, zero], axis=-1)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_coning_is_that_of_the_source_in_every_slow_cycle(algorithm, backend_name):
    runner = made(algorithm, 2, backend_name)
    angles, _ = vibration(4)
    run = runner.run(angles[1:], np.zeros((40, 3)), fast_cycles=10, previous=angles[0])
    turned = rotations(runner, run.attitudes)
    drift = (turned[:-1].inv() * turned[1:]).as_rotvec()[:, 2] / SLOW
    # In floating point what an attitude near 1 is rounded to; in fixed point its certified bound.
    allowed = 2e-5 if single(backend_name) else 1e-10
    if BACKENDS[backend_name].fixed:
        coning, attitude = runner.loops[0].fixed.outputs[1], runner.loops[1].fixed.outputs[0]
        allowed = 8 * float(attitude.errors[0] + 10 * coning.errors[0]) / SLOW
    assert np.abs(drift + 2.720926166e-3).max() <= allowed


@pytest.mark.long
@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("sculling", SCULLING)
def test_sculling_is_that_of_the_source_in_every_slow_cycle(algorithm, sculling):
    runner = made(algorithm, sculling, "numpy")
    angles, velocities = vibration(4)
    angles[:, 1:] = 0
    run = runner.run(angles[1:], velocities[1:], fast_cycles=10, previous=angles[0])
    turned = rotations(runner, run.attitudes)
    # In the body at the start of each slow cycle: u + beta x u / 2 + S2.
    body = turned[:-1].apply(run.velocity_changes.copy(), inverse=True)
    beta, u = (x[1:].reshape(4, 10, 3).sum(axis=1) for x in (angles, velocities))
    s2 = body - u - np.cross(beta, u) / 2
    assert np.abs(s2[:, 2] / SLOW - 1.1042645359e-2).max() <= 1e-10
    assert np.abs(s2[:, :2]).max() <= 1e-15


# Against the truth: steady turns of the body and of the navigation frame, a steady force on the body

RATE, FRAME, FORCE = np.array([0.3, -0.2, 0.5]), np.array([0.01, -0.02, 0.015]), np.array([1.0, -2.0, 9.0])
SPAN = 0.8


def truth() -> tuple[Rotation, np.ndarray]:
    """Return attitude and change of velocity after the span, in navigation axes as they turn."""

    def attitude(t: float) -> Rotation:
        return Rotation.from_rotvec(FRAME * t).inv() * Rotation.from_rotvec(RATE * t)

    change, _ = quad_vec(lambda t: attitude(t).apply(FORCE), 0, SPAN, epsabs=1e-13)
    return attitude(SPAN), change


def off(algorithm: str, sculling: int, slow: int, cycles: int) -> tuple[float, float]:
    runner = made(algorithm, sculling, "c")
    count = 8 * slow
    run = runner.run(
        np.tile(RATE * SPAN / count, (count, 1)),
        np.tile(FORCE * SPAN / count, (count, 1)),
        fast_cycles=8,
        slow_cycles=slow // cycles,
        turns=np.tile(FRAME * SPAN / slow, (slow + 1, 1)),
        previous=RATE * SPAN / count,
    )
    attitude, change = truth()
    turned = rotations(runner, run.attitudes)[-1]
    total = run.velocity_changes.sum(axis=0)
    return (turned.inv() * attitude).magnitude(), float(np.abs(total - change).max())


@pytest.mark.long
@pytest.mark.parametrize(("algorithm", "sculling"), FORMS)
def test_a_turn_with_a_steady_force_comes_out(algorithm, sculling):
    # A steady turn has no coning, so that the attitude is exact; (51) and (52) miss the third power of a slow
    # cycle's angle, (59) the second of the navigation frame's, so that finer cycles bring the velocity nearer.
    coarse, fine = off(algorithm, sculling, 8, 2), off(algorithm, sculling, 16, 4)
    assert max(coarse[0], fine[0]) <= 1e-14
    assert coarse[1] < 3e-3
    assert fine[1] < coarse[1] / 3.5


# Back ends


def noisy(count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return (
        rng.uniform(-0.02, 0.02, (count, 3)),
        rng.uniform(-0.1, 0.1, (count, 3)),
        rng.uniform(-1e-4, 1e-4, (count // 4 + 1, 3)),
    )


@pytest.mark.parametrize(("algorithm", "sculling"), [("dcm", 2), ("euler", 2)])
def test_back_ends_agree(algorithm, sculling, backend_name, rng):
    angles, velocities, turns = noisy(48, rng)
    given = {"fast_cycles": 4, "slow_cycles": 3, "turns": turns}
    run = made(algorithm, sculling, backend_name).run(angles, velocities, **given)
    wanted = made(algorithm, sculling, "numpy").run(angles, velocities, **given)
    assert run.attitudes.shape == (12, *made(algorithm, sculling, "numpy").state.shape)
    assert run.velocity_changes.shape == (4, 3)
    attitude, velocity = {
        "double": (0, 0 if backend_name == "numpy" else 1e-15),
        "exact": (1e-15, 1e-15),
        "float": (4e-6, 4e-6),
        "32": (2e-8, 1e-6),
        "16": (2e-3, 3e-2),
    }[precision(backend_name)]
    assert np.abs(run.attitudes - wanted.attitudes).max() <= attitude
    assert np.abs(run.velocity_changes - wanted.velocity_changes).max() <= velocity


@pytest.mark.parametrize(
    ("backend", "carry"),
    [
        ("c", "none"),
        ("c-fixed32", "none"),
        pytest.param("c-float", "none", marks=pytest.mark.long),
        pytest.param("c-fixed32", "full", marks=pytest.mark.long),
    ],
)
def test_the_whole_is_its_loops_bit_for_bit(backend, carry, rng):
    runner = made("euler", 2, backend, carry)
    angles, velocities, turns = noisy(48, rng)
    whole = runner.run(angles, velocities, fast_cycles=4, slow_cycles=3, turns=turns)
    single = pickle.loads(pickle.dumps(runner))
    single._runner = Loops(
        LoopSources(runner.loops, runner._runner.sources.system), evaluator_class(runner.loops[0].target)
    )
    parts = single.run(angles, velocities, fast_cycles=4, slow_cycles=3, turns=turns)
    for one, other in zip(whole, parts, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("carry", ["none", pytest.param("full", marks=pytest.mark.long)])
def test_c_and_model_agree_bit_for_bit(carry, rng):
    angles, velocities, turns = noisy(48, rng)
    runs = [
        made("dcm", 2, name, carry).run(angles, velocities, fast_cycles=4, slow_cycles=3, turns=turns)
        for name in ("c-fixed32", "fixed-model")
    ]
    for one, other in zip(*runs, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.long
@pytest.mark.parametrize("algorithm", ["euler", pytest.param("dcm", marks=pytest.mark.long)])
def test_error_feedback_in_the_memory_of_the_c_is_that_of_the_model(algorithm):
    """Words of 16 bits, rounded down, on a vibration: bit for bit, and not what runs without feedback."""
    angles, velocities = vibration(16)
    attitudes = {}
    for carry in ("none", "full"):
        settings = Settings(word=16, carry=carry, rounding="truncation")
        runners = [TwoSpeed(algorithm, 2, name, settings) for name in ("c-fixed16", "fixed-model")]
        whole, parts = (
            one.run(angles[1:], velocities[1:], fast_cycles=10, slow_cycles=4, previous=angles[0])
            for one in runners
        )
        for one, other in zip(whole, parts, strict=True):
            np.testing.assert_array_equal(one, other)
        attitudes[carry] = whole.attitudes
    assert (attitudes["full"] != attitudes["none"]).any()


@pytest.mark.long
def test_generated_files_are_the_command_s_whatever_largest_angle_is_stated():
    # No loop has the increments of a step: what bounds them goes into neither the code nor its header.
    plain = sources("euler", 2, "c-fixed", Settings(carry="full")).files
    assert sources("euler", 2, "c-fixed", Settings(carry="full").fitted(0.01)).files == plain
    header = " ".join(plain["euler_two_speed_2_w32.h"].replace("\n * ", " ").split())
    assert "--word 32 --rounding nearest --carry full --drift-allowance 1/16 Do not edit" in header
    assert sources("euler", 2, "c-fixed").files == sources("euler", 2, "c-fixed", Settings()).files


def test_formats_of_loops_fit_together_and_sums_are_exact():
    ranges = {"angle_sum": Fraction(1, 4)}
    made_loops = loops("dcm", 2, "c-fixed", Settings(ranges=ranges))
    formats: dict[str, set[str]] = {}
    for loop in made_loops:
        for argument in loop.fixed.inputs:
            formats.setdefault(argument.signal.name, set()).add(str(argument.format))
        for argument in loop.fixed.outputs:
            held = loop.recursion.inputs.get(argument.signal.name)
            if held:
                formats[held].add(str(argument.format))
    assert {name for name, held in formats.items() if len(held) > 1} == set()
    assert formats["increment"] == formats["angle_sum"] == {"Q-1.32"}
    errors = {a.signal.name: max(a.errors) for a in made_loops[0].fixed.outputs}
    assert errors["next_angle_sum"] == errors["next_velocity_sum"] == errors["next_previous_increment"] == 0


def test_no_angle_is_lost_to_the_format_of_increments():
    # A thousand increments of a third of a unit: their sum is right to a unit.
    runner = made("euler", 2, "c-fixed32")
    unit = float(next(a for a in runner.loops[0].fixed.inputs if a.signal.name == "increment").format.unit)
    angles = np.tile([0.0, 0.0, 1000.3 * unit], (1000, 1))
    run = runner.run(angles, np.zeros((1000, 3)), fast_cycles=1000)
    turned = rotations(runner, run.attitudes)[-1].as_rotvec()[2]
    assert abs(turned - angles[:, 2].sum()) <= 8 * unit


def test_values_out_of_range_are_refused():
    for name in ("c-fixed32", "fixed-model"):
        runner = made("dcm", 2, name)
        with pytest.raises(InputError, match=r"refuses its input"):
            runner.run(np.full((12, 3), 0.1), np.zeros((12, 3)), fast_cycles=12)
        with pytest.raises(InputError, match=r"increment holds 0\.2"):
            runner.run(np.full((2, 3), 0.2), np.zeros((2, 3)), fast_cycles=2)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"samples": np.zeros((5, 3))}, "multiple of 4"),
        ({"samples": np.zeros((4, 2))}, "samples has shape"),
        ({"velocity_increments": np.zeros((8, 3))}, "that of samples"),
        ({"turns": np.zeros((2, 3))}, "turns has shape"),
        ({"fast_cycles": 0}, "fast_cycles"),
        ({"initial": np.eye(2)}, "initial"),
    ],
)
def test_mismatched_shapes_are_refused(given, said):
    wanted = {"samples": np.zeros((4, 3)), "velocity_increments": np.zeros((4, 3)), "fast_cycles": 2}
    wanted |= {"slow_cycles": 2} | given
    with pytest.raises((InputError, InputTypeError), match=said) as caught:
        made("dcm", 2, "numpy").run(wanted.pop("samples"), wanted.pop("velocity_increments"), **wanted)
    assert "\n" not in str(caught.value)


def test_no_samples_make_no_cycles():
    for name in (name for name, entry in BACKENDS.items() if entry.by_default):
        run = made("dcm", 2, name).run(np.zeros((0, 3)), np.zeros((0, 3)), fast_cycles=2)
        assert run.attitudes.shape == (0, 3, 3) and run.velocity_changes.shape == (0, 3)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: TwoSpeed("quaternion"), "algorithm 'quaternion'"),
        (lambda: TwoSpeed("dcm", 3), "sculling"),
        (lambda: TwoSpeed("dcm", backend="fpga"), "backend 'fpga'"),
        (lambda: TwoSpeed("dcm", settings=Settings()), "takes no fixed-point settings"),
        (lambda: sources("dcm", target="numpy"), "target 'numpy'"),
        (
            lambda: loops("dcm", 2, "c-fixed", Settings(ranges={"beta": Fraction(1)})),
            "no loop has an input 'beta'",
        ),
    ],
)
def test_names_that_are_not_there_are_told(call, said):
    with pytest.raises(InputError, match=said):
        call()


@pytest.mark.long
@pytest.mark.parametrize("target", ["c", "c-float", "c-fixed"])
def test_the_whole_compiles_without_a_warning(target, tmp_path):
    if shutil.which("gcc") is None:
        pytest.skip("no gcc")
    files = sources("dcm", 2, target).files
    for name, text in files.items():
        (tmp_path / name).write_text(text)
        assert text.isascii() and all(line == line.rstrip() for line in text.splitlines())
    code = [name for name in files if name.endswith(".c")]
    subprocess.run(["gcc", *STRICT, "-c", *code], cwd=tmp_path, check=True)


def test_run_in_c_continues_from_its_memory(rng):
    # Twice two navigation cycles are four; null pointers and no cycles are refused.
    angles, velocities, turns = noisy(48, rng)
    runner = made("dcm", 2, "c")
    wanted = runner.run(angles, velocities, fast_cycles=4, slow_cycles=3, turns=turns)
    module = compiler.load(sources("dcm", 2, "c"))
    ffi, lib = module.ffi, module.lib
    memory = ffi.new("dcm_two_speed_2_memory *")
    pointer = lambda array: ffi.from_buffer("double[]", np.ascontiguousarray(array))  # noqa: E731
    lib.dcm_two_speed_2_begin(memory, pointer(np.eye(3)))
    memory.previous_turn[0:3] = turns[0].tolist()
    attitudes, changes = np.empty((12, 3, 3)), np.empty((4, 3))
    for half in (0, 1):
        fast, slow = slice(24 * half, 24 * half + 24), slice(6 * half, 6 * half + 6)
        given = (angles[fast], velocities[fast], turns[1:][slow])
        held = [*map(pointer, given), pointer(attitudes[slow]), pointer(changes[2 * half : 2 * half + 2])]
        assert lib.dcm_two_speed_2_run(2, 3, 4, memory, *held) == 0
    np.testing.assert_array_equal(attitudes, wanted.attitudes)
    np.testing.assert_array_equal(changes, wanted.velocity_changes)
    assert lib.dcm_two_speed_2_run(2, 0, 4, memory, *held) == 4
    assert lib.dcm_two_speed_2_run(2, 3, 4, ffi.NULL, *held) == 4
    assert lib.dcm_two_speed_2_run(2, 3, 4, memory, ffi.NULL, *held[1:]) == 4
    np.testing.assert_array_equal(attitudes, wanted.attitudes)


def test_one_cycle_at_a_time_is_a_run():
    """The functions of single cycles on the memory, called as samples come, in C."""
    runner = made("dcm", 2, "c")
    angles, velocities = vibration(2)
    turns = np.full((3, 3), 1e-4)
    whole = runner.run(
        angles[1:],
        velocities[1:],
        fast_cycles=5,
        slow_cycles=2,
        turns=np.full((5, 3), 1e-4),
        previous=angles[0],
    )
    module = compiler.load(sources("dcm", 2, "c"))
    lib, ffi = module.lib, module.ffi

    def pointer(row):
        return ffi.from_buffer("double[]", np.ascontiguousarray(row))

    memory = ffi.new("dcm_two_speed_2_memory *")
    lib.dcm_two_speed_2_begin(memory, pointer(np.eye(3)))
    memory.previous_increment[0:3] = angles[0].tolist()
    memory.previous_turn[0:3] = turns[0].tolist()
    attitudes, changes = [], []
    for k, (angle, velocity) in enumerate(zip(angles[1:], velocities[1:], strict=True), 1):
        assert lib.dcm_two_speed_2_fast(memory, pointer(angle), pointer(velocity)) == 0
        if k % 5 == 0:
            assert lib.dcm_two_speed_2_slow(memory, pointer(turns[0])) == 0
        if k % 10 == 0:
            change = np.empty(3)
            assert lib.dcm_two_speed_2_navigation(memory, pointer(change)) == 0
            changes.append(change)
        if k % 5 == 0:
            attitudes.append(list(memory.state))
    np.testing.assert_array_equal(np.reshape(attitudes, (-1, 3, 3)), whole.attitudes)
    np.testing.assert_array_equal(changes, whole.velocity_changes)


def test_null_pointers_are_refused():
    lib, ffi = compiler.load(sources("dcm", 2, "c")).lib, compiler.load(sources("dcm", 2, "c")).ffi
    memory = ffi.new("dcm_two_speed_2_memory *")
    assert lib.dcm_two_speed_2_fast(memory, ffi.NULL, ffi.NULL) == 4
    assert lib.dcm_two_speed_2_slow(ffi.NULL, ffi.NULL) == 4
    assert lib.dcm_two_speed_2_navigation(memory, ffi.NULL) == 4


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "partner"), [("increment", "previous_increment"), ("turn", "previous_turn")]
)
def test_passed_values_keep_their_ranges(name, partner):
    fixed = {
        argument.signal.name: argument
        for loop in loops("dcm", 2, "c-fixed", Settings(ranges={name: Fraction(1, 2)}))
        for argument in loop.fixed.inputs
    }
    assert fixed[partner].high == fixed[name].high
    assert fixed[partner].format == fixed[name].format


def test_a_refusal_names_the_loop(backend_name):
    if BACKENDS[backend_name].many_digits:  # its numbers have no largest one
        return
    if not BACKENDS[backend_name].fixed:
        with pytest.raises(InputError, match="does not stay finite"):
            made("dcm", 2, backend_name).run(
                np.full((4, 3), 1e200), np.full((4, 3), 1e200), fast_cycles=2, slow_cycles=2
            )
        return
    with pytest.raises(InputError, match="two-speed-slow-2 refuses its input"):
        made("dcm", 2, backend_name).run(
            np.zeros((100, 3)), np.full((100, 3), 0.9), fast_cycles=5, slow_cycles=20
        )


def test_words_that_are_not_the_back_end_s():
    with pytest.raises(InputError, match="word is 16; backend c-fixed32 has words of 32 bits"):
        TwoSpeed("dcm", 2, "c-fixed32", Settings(word=16))
    with pytest.raises(InputTypeError, match=r"settings is 3; strapgen\.Settings is needed"):
        TwoSpeed("dcm", 2, "c-fixed32", 3)
    with pytest.raises(InputError, match="has steps larger than its range"):
        loops("dcm", 2, "c-fixed", Settings(formats={"angle_sum": "Q40.-9"}))


@pytest.mark.long
def test_a_long_word_needs_no_pulses():
    run = TwoSpeed("euler", 2, "fixed-model", Settings(word=64)).run(
        np.full((4, 3), 0.01), np.zeros((4, 3)), fast_cycles=2
    )
    np.testing.assert_allclose(Rotation.from_quat(run.attitudes[-1]).as_rotvec(), 0.04, rtol=1e-12)
