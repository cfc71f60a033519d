"""The terms of the bound of a pass, each by hand or with an input that attains it."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import sympy

from strapgen import derive, lower
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import Format
from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import KernelBuilder
from strapgen.navigation.systems import system_bounds as pass_bounds
from strapgen.navigation.systems.fitting import GeneratedStages, clipped, fitted
from strapgen.navigation.systems.system_bounds import bounds, moved
from strapgen.navigation.systems.system_file import parsed
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.navigation.systems.wiring import Description, wired

#: Intervals are rounded outward by units of 2^-160.
GRID = Fraction(1, 2**140)


def described(*stages: dict[str, object], **inputs: dict[str, object]) -> Description:
    """Return a system of stages."""
    return wired(parsed({"sample_hz": 100, "inputs": inputs, "stage": list(stages)}, "chain"))


GYRO = {"unit": "rad", "frame": "b", "range": "0.02"}


def attitude(word: int, **more: object) -> dict[str, object]:
    """Return a stage that turns an attitude by two increments."""
    return {
        "name": "step",
        "kernel": "euler",
        "every": 2,
        "word": word,
        "wires": {"increments": "gyro"},
    } | more


def matrix(word: int, **more: object) -> dict[str, object]:
    """Return a stage that takes the attitude as a matrix, in another word."""
    wires = {"state": "step.state"}
    return {"name": "matrix", "kernel": "dcm-from-euler", "every": 2, "word": word, "wires": wires} | more


def own(fit: GeneratedStages, stage: str) -> tuple[Fraction, ...]:
    """Return the error bounds of a stage's last output by itself."""
    interface = fit.sources[stage].fixed
    assert interface is not None
    return interface.outputs[-1].errors


@pytest.mark.parametrize("words", [(16, 32), (32, 16), (24, 16), (17, 16), (32, 32)], ids=str)
def test_error_of_an_input_widens_its_range_and_lost_bits_add_half_a_unit(words):
    """C_11 = s^2 + x^2 - y^2 - z^2 moves by 2 (L + e) e with each; C_12 = 2 (x y - s z) by 2 (L + e) with all four."""
    fit = fitted(described(attitude(words[0]), matrix(words[1]), gyro=GYRO), "fixed-model", Settings())
    state = fit.sources["matrix"].fixed.inputs[0]
    lost = state.format.unit / 2 if words[1] < words[0] else 0
    errors = [error + lost for error in own(fit, "step")]
    largest = state.high * state.unit + max(errors)
    moves = 2 * largest * sum(errors)
    for place in (0, 1):
        expected = own(fit, "matrix")[place] + moves
        assert expected <= bounds(fit).errors["matrix_attitude"][place] < expected + GRID


@pytest.mark.parametrize("words", [(32, 16), (24, 16), (17, 16)], ids=str)
def test_half_a_unit_is_lost_on_a_wire_and_the_bound_is_that_of_its_loss(words):
    """A transformed 1 is a row of the matrix, whose integers are all half a unit from those of the shorter word."""
    delayed = {"state": 1}
    turned = {
        "name": "turned",
        "kernel": "dcm-acceleration",
        "every": 2,
        "word": words[1],
        "wires": {"state": "matrix.attitude", "acceleration": "force"},
        "delay": delayed,
    }
    eye = {"attitude": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}
    force = {"unit": "m/s^2", "frame": "b", "range": 1}
    system = described(attitude(words[0]), turned, matrix(words[0], initial=eye), gyro=GYRO, force=force)
    runner = system_runner(system, "fixed-model", Settings())
    fit, memory = runner.fit, runner.begin()
    source, state = fit.arguments["matrix_attitude"], fit.sources["turned"].fixed.inputs[0]
    half = 1 << (source.format.fraction - state.format.fraction - 1)
    rows = np.full((1, 9), half, object if words[0] > 32 else np.int64) + (np.arange(9) * 2 * half) * 10
    memory.cells["matrix_attitude"] = rows
    one = fit.arguments["force"].high
    runner.call(memory, {"gyro": np.zeros((1, 3), int), "force": np.full((1, 3), one)}, runner.system.rates)
    result = fit.arguments["turned_transformed"]
    exact = [
        sum(int(x) for x in row) * source.unit * one * fit.arguments["force"].unit
        for row in rows.reshape(3, 3)
    ]
    off = [
        abs(int(x) * result.unit - y)
        for x, y in zip(memory.cells["turned_transformed"][0], exact, strict=True)
    ]
    loss = 3 * state.format.unit / 2 * one * fit.arguments["force"].unit
    for error, limit, rounding in zip(
        off, bounds(fit).errors["turned_transformed"], own(fit, "turned"), strict=True
    ):
        assert loss - rounding <= error <= limit
        assert loss <= limit - rounding < loss + GRID


def writing(step: int, norm: int) -> GeneratedStages:
    """Return a normalization at half the rate that replaces the state of a step."""
    stage = {
        "name": "norm",
        "kernel": "euler-normalize-first-order",
        "every": 4,
        "word": norm,
        "wires": {"state": "step.state"},
        "writes": {"next": "step.state"},
    }
    return fitted(described(attitude(step), stage, gyro=GYRO), "fixed-model", Settings())


def nothing_but(monkeypatch: pytest.MonkeyPatch, stage: str) -> None:
    """Leave of all errors of a pass the rounding of one stage."""
    rounding = pass_bounds._Pass._rounding

    def of_one(self, other, limits):
        known = rounding(self, other, limits)
        return known if other.name == stage else {name: (Fraction(0),) * 4 for name in known}

    monkeypatch.setattr(pass_bounds._Pass, "_rounding", of_one)
    monkeypatch.setattr(
        pass_bounds, "moved", lambda program, *_: {r.signal.name: (Fraction(0),) * 4 for r in program.outputs}
    )


@pytest.mark.parametrize("words", [(16, 32), (16, 24), (32, 16), (16, 16)], ids=str)
def test_bits_that_a_shorter_cell_loses_add_half_a_unit(words, monkeypatch):
    nothing_but(monkeypatch, "norm")
    fit = writing(*words)
    lost = fit.arguments["step_state"].unit / 2 if words[1] > words[0] else 0
    assert bounds(fit).errors["step_state"] == tuple(error + lost for error in own(fit, "norm"))


def test_cell_of_two_rates_has_the_larger_bound(monkeypatch):
    """In every other cycle the state is that of the step alone, whatever the normalization leaves of its error."""
    nothing_but(monkeypatch, "step")
    fit = writing(16, 16)
    assert bounds(fit).errors["step_state"] == own(fit, "step")


def test_cell_without_a_bound_at_one_rate_has_none(monkeypatch):
    """The slower rate stores the state of another step, normalized."""
    other = attitude(16) | {"name": "other"}
    norm = {
        "name": "norm",
        "kernel": "euler-normalize-first-order",
        "every": 4,
        "wires": {"state": "other.state"},
        "writes": {"next": "step.state"},
    }
    fit = fitted(described(attitude(16), other, norm, gyro=GYRO), "fixed-model", Settings(word=16))
    rounding = pass_bounds._Pass._rounding

    def unknown(self, stage, limits):
        if stage.name == "step":
            raise InputError("it jumps")
        return rounding(self, stage, limits)

    monkeypatch.setattr(pass_bounds._Pass, "_rounding", unknown)
    assert bounds(fit).reasons == {"step_state": "stage step: it jumps"}


def two_words(limit: str) -> Description:
    """Return two speeds whose slow loop has a shorter word, and a range of the sum of velocity increments."""
    sums = ("angle_sum", "coning", "velocity_sum", "sculling")
    fast = {
        "name": "fast",
        "kernel": "two-speed-fast-2",
        "every": 1,
        "word": 32,
        "wires": {"increment": "gyro", "velocity_increment": "accelerometer"},
        "ranges": {"angle_sum": "1/16", "coning": "1/512", "velocity_sum": 2, "sculling": "1/16"},
    }
    slow = {
        "name": "slow",
        "kernel": "euler-two-speed-slow-2",
        "every": 2,
        "word": 16,
        "wires": {name: f"fast.{name}" for name in sums} | {"turn": "turn"},
        "ranges": {"velocity_sum": limit, "navigation_velocity": 8, "navigation_rotation": "1/128"},
    }
    names = ("state", "navigation_rotation", "navigation_velocity")
    frame = {
        "name": "frame",
        "kernel": "euler-two-speed-navigation",
        "every": 4,
        "wires": {name: f"slow.{name}" for name in names},
    }
    force = {"unit": "m/s", "frame": "b", "range": "0.5"}
    turn = {"unit": "rad", "frame": "n", "range": "1/4096"}
    return described(fast, slow, frame, gyro=GYRO, accelerometer=force, turn=turn)


@pytest.mark.parametrize("sign", [1, -1])
def test_stage_refuses_values_beyond_its_word(sign):
    """A sum of 1.4 m/s is rescaled to the end of the word, 1, which lies beyond the range."""
    runner = system_runner(two_words("0.999"), "fixed-model", Settings())
    memory = runner.begin()
    runner.set(memory, "fast_velocity_sum", np.array([sign * 1.4, 0, 0]))
    still = {signal.name: np.zeros((1, 3), int) for signal in runner.system.inputs}
    with pytest.raises(InputError, match=r"stage slow: .* velocity_sum lies outside -32736 to 32736"):
        runner.call(memory, still, runner.system.rates[:2])


def test_range_that_ends_with_its_word_is_refused_on_a_wire_that_may_hold_more():
    """Its end, 32767, would pass for all that lies beyond."""
    message = "stage slow: the range of velocity_sum ends where its word of 16 bits does"
    with pytest.raises(InputError, match=message):
        fitted(two_words("0.99995"), "fixed-model", Settings())


def test_range_of_a_word_is_exact():
    argument = fitted(described(attitude(16), gyro=GYRO), "fixed-model", Settings()).arguments["step_state"]
    here = replace(argument, format=Format(16, 14))
    top = (1 << 15) - 1

    def held(quarters: int, low: bool = False) -> bool:
        """Tell whether so many quarters of a unit, rounded to the nearest, are clipped."""
        ends = {"low": -quarters, "high": 0} if low else {"low": 0, "high": quarters}
        return clipped([replace(argument, format=Format(32, 16), **ends)], here)

    assert not held(4 * top + 1)
    assert held(4 * top + 2)
    assert held(4 * top + 4, low=True)
    inside = replace(argument, format=Format(32, 16), low=0, high=1)
    assert clipped([inside, replace(inside, high=4 * top + 2)], here)
    assert not clipped([replace(argument, low=-top, high=2 * top)], here), "a value is not rescaled"
    assert not clipped([], here)


def test_cell_that_does_not_hold_a_result_has_no_bound():
    """The step may return 1.13, and the word of the cell ends at 1."""
    fit = writing(32, 16)
    cell = replace(fit.arguments["step_state"], format=Format(32, 31))
    shorter = replace(fit, arguments={**fit.arguments, "step_state": cell})
    assert bounds(shorter).reasons["step_state"] == "its word does not hold all that next of step may be"


@pytest.mark.parametrize("beyond", [1, 2])
def test_cell_that_does_not_hold_a_sample_has_no_bound(beyond):
    """Samples in quarters of a unit that end at 2^15 - 1 of them, and one or two quarters."""
    fit = fitted(described(attitude(16), gyro=GYRO), "fixed-model", Settings())
    cell = fit.arguments["step_increments"]
    sample = replace(
        cell, format=Format(32, cell.format.fraction + 2), high=4 * cell.format.largest + beyond, low=0
    )
    result = bounds(replace(fit, arguments={**fit.arguments, "gyro": sample}))
    if beyond == 2:
        assert result.reasons["step_increments"] == "its word does not hold all that gyro may be"
    else:
        new = cell.unit / 2  # of the two samples the newer, which this pass rescales
        assert result.errors["step_increments"] == (0, 0, 0, new, new, new)


def test_matrix_with_an_error_has_no_bound_as_euler_parameters():
    """Near a half turn an error of the matrix turns all signs over."""
    step = attitude(32, kernel="dcm")
    converted = {
        "name": "parameters",
        "kernel": "euler-from-dcm",
        "every": 2,
        "wires": {"state": "step.state"},
    }
    system = described(step, converted, gyro=GYRO)
    runner, exact = system_runner(system, "fixed-model", Settings()), system_runner(system, "exact")
    assert "may turn a comparison" in runner.rounding.reasons["parameters_converted"]
    count, rng = 100, np.random.default_rng(1)
    memory, truth = runner.begin(count), exact.begin(count)
    nearly = np.array([1, 0, 0, 0, -1, 0, 0, 0, -1]) * 2**30 + rng.integers(-1, 2, (count, 9))
    memory.cells |= {"step_state": nearly, "step_increments": rng.integers(-2, 3, (count, 6))}
    truth.cells |= {name: exact.stored(name, runner.in_si(name, rows)) for name, rows in memory.cells.items()}
    runner.call(memory, {"gyro": np.zeros((count, 3), int)}, system.system.rates)
    exact.call(truth, {"gyro": exact.stored("gyro", np.zeros((count, 3)))}, system.system.rates)
    state, parameters = (
        np.abs(runner.in_si(name, memory.cells[name]) - exact.in_si(name, truth.cells[name])).max()
        for name in ("step_state", "parameters_converted")
    )
    assert state <= float(max(runner.rounding.errors["step_state"]))
    assert parameters > 1.9


@pytest.mark.parametrize("kernel", ["euler-product", "coriolis-gravity", "dcm-velocity-2"])
def test_no_result_moves_further_than_its_bound(kernel, rng):
    program = lower(derive(kernel))
    limits = {signal.name: Fraction(1) for signal in program.inputs}
    errors = {signal.name: (Fraction(1, 1000),) * signal.size for signal in program.inputs}
    bounds = moved(program, limits, errors)
    names = [name for signal in program.inputs for name in signal.elements]
    worst = {name: np.zeros(len(rows)) for name, rows in bounds.items()}
    for _ in range(50):
        corner = rng.choice([-1.0, 1.0], len(names)) * rng.uniform(0.9, 1, len(names))
        values = [
            program.run(dict(zip(names, corner + shift, strict=True)), float)
            for shift in _shifts(rng, len(names))
        ]
        for name, rows in worst.items():
            difference = np.abs(np.array(values[0][name]) - np.array(values[1][name]))
            worst[name] = np.maximum(rows, difference)
    for name, rows in worst.items():
        assert (rows <= [float(bound) * (1 + 2e-3) for bound in bounds[name]]).all()  # second order: 1e-3
        assert (rows >= [float(bound) / 20 for bound in bounds[name]]).all()  # and it is no bound of anything


def _shifts(rng, count):
    return np.zeros(count), rng.choice([-1e-3, 1e-3], count)


def test_exact_inputs_move_nothing_and_a_jump_has_no_bound():
    program = lower(derive("euler-product"))
    assert set(moved(program, {}, {})["next"]) == {0}
    angles = lower(derive("euler-angles-from-dcm"))
    limits = {"state": Fraction(1), "previous": Fraction(4)}
    with pytest.raises(InputError, match="jumps by a turn"):
        moved(angles, limits, {"state": (Fraction(1, 10),) * 9})


def program(value):
    """Return the program of a result of x, y and z, three inputs."""
    build = KernelBuilder()
    inputs = [build.input(Signal.labelled(name, name, "1", meaning="part")) for name in "xyz"]
    build.output(
        Signal.labelled("result", "r", "1", meaning="result"), [value(*(part[0] for part in inputs))]
    )
    return lower(build.kernel("toy", "A test", "none"))


LIMITS = dict.fromkeys("xyz", Fraction(1))
ERROR = (Fraction(1, 1000),)


def test_length_of_possibly_zero_vector_moves_with_its_parts():
    """Its root has no derivative at zero: from (0, 0) the length moves by as much as one of its parts."""
    length = program(lambda x, y, z: sympy.sqrt(x**2 + y**2) + z)
    assert moved(length, LIMITS, {"x": ERROR})["result"] == ERROR
    assert moved(length, LIMITS, {"x": ERROR, "y": ERROR})["result"] == (2 * ERROR[0],)
    assert length.run({"x_1": 1e-3, "y_1": 0.0, "z_1": 0.0}, float)["result"] == [1e-3]


def test_root_of_possibly_zero_number_has_no_bound():
    root = program(lambda x, y, z: sympy.sqrt(sympy.Max(x, 0)) + y * z)
    with pytest.raises(InputError, match=r"the radicand in .* may be zero"):
        moved(root, LIMITS, {"x": ERROR})


@pytest.mark.parametrize("name", ["x", "y"])
def test_comparison_that_an_error_may_turn_has_no_bound(name):
    selected = program(lambda x, y, z: sympy.Piecewise((z, x >= y), (-z, True)))
    assert moved(selected, LIMITS, {"z": ERROR})["result"] == ERROR
    with pytest.raises(InputError, match="an error of its input may turn a comparison in r_1"):
        moved(selected, LIMITS, {name: ERROR})


def test_comparison_of_possibly_equal_values_has_no_bound():
    """x >= y + 2 holds for an x of 1 and a y of -1 alone."""
    selected = program(lambda x, y, z: sympy.Piecewise((z, x >= y + 2), (-z, True)))
    with pytest.raises(InputError, match="may turn a comparison"):
        moved(selected, LIMITS, {"x": ERROR})


@pytest.mark.parametrize("shift", [-2, 3], ids=["always", "never"])
def test_comparison_that_no_error_turns_has_a_bound(shift):
    """x >= y - 2 holds for all x and y up to 1, and x >= y + 3 for none; an x of 5/2 may turn both."""
    selected = program(lambda x, y, z: sympy.Piecewise((z, x >= y + shift), (-z, True)))
    assert moved(selected, LIMITS, {"x": ERROR, "y": ERROR, "z": ERROR})["result"] == ERROR
    with pytest.raises(InputError, match="may turn a comparison"):
        moved(selected, LIMITS | {"x": Fraction(5, 2)}, {"x": ERROR})
