"""The wiring of described systems: cells, rates, shared states, collected samples, what is cleared and recorded."""

from __future__ import annotations

import dataclasses
from fractions import Fraction

import numpy as np
import pytest
from derived import kernel, program
from hypothesis import given, settings
from hypothesis import strategies as st
from navigation.described_files import ATTITUDE, TWO_SPEEDS, description
from precisions import single

import strapgen
from strapgen.catalogue import choose
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.signals import ANY, FRAMES
from strapgen.navigation.systems.system import Push
from strapgen.navigation.systems.system_file import parsed, read
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.navigation.systems.wiring import wired


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    return description(tmp_path_factory.mktemp("two"), TWO_SPEEDS).system


@pytest.fixture(scope="module")
def attitude(tmp_path_factory):
    return description(tmp_path_factory.mktemp("att"), ATTITUDE).system


def test_rates_stand_from_the_fastest_and_meet_after_their_common_multiple(two, attitude):
    assert [(rate.every, [stage.name for stage in rate.stages]) for rate in two.rates] == [
        (1, ["fast"]),
        (8, ["slow"]),
        (16, ["navigation"]),
    ]
    assert (two.cycle, attitude.cycle) == (16, 8)
    assert [rate.every for rate in attitude.rates] == [1, 2, 4, 8]


def test_a_sum_is_cleared_by_the_rate_that_takes_it_and_nothing_else_is(two):
    assert [set(rate.cleared) for rate in two.rates] == [
        set(),
        {"fast_angle_sum", "fast_coning", "fast_velocity_sum", "fast_sculling"},
        {"slow_navigation_rotation", "slow_navigation_velocity"},
    ]


def test_a_state_that_two_stages_have_is_one_cell(two, attitude):
    (navigation,) = two.rates[2].stages
    assert dict(navigation.results)["next"] == "slow_state"
    assert [cell.name for cell in two.cells if cell.name.endswith("_state")] == ["slow_state"]
    assert two.every("slow_state") == 8
    normalization = attitude.stages[-1]
    assert {wire.source for wire in normalization.wires} == {"step_state"}
    assert (
        attitude.cell("norm_next").signal.constraint == "unit"
    )  # it writes the state only where the file says so


def test_an_output_that_writes_a_state_has_no_cell_of_its_own(tmp_path):
    text = f'{ATTITUDE}writes = {{ next = "step.state" }}\n'
    system = description(tmp_path, text).system
    assert dict(system.stages[-1].results) == {"next": "step_state"}
    assert "norm_next" not in [cell.name for cell in system.cells]


def test_a_step_collects_increments_of_the_faster_rate(attitude):
    (push,) = attitude.rates[0].steps
    assert push == Push("step_increments", "gyro", external=True)
    cell = attitude.cell("step_increments")
    assert (cell.samples, cell.signal.shape, cell.initial) == (2, (2, 3), (Fraction(0),) * 6)
    (gyro, _) = attitude.inputs
    assert gyro.elements == ("gyro_x", "gyro_y", "gyro_z")
    assert gyro.bound == Fraction(1, 50)


def test_recorded_outputs_are_stated_or_unread(two, attitude):
    assert attitude.outputs == ("step_state", "turned_transformed")
    assert two.outputs == ("slow_state", "navigation_velocity_change")


def test_a_state_begins_as_no_rotation_or_as_stated(two, attitude):
    assert two.cell("slow_state").initial == (0, 0, 0, 1)
    assert attitude.cell("matrix_attitude").initial == (1, 0, 0, 0, 1, 0, 0, 0, 1)
    assert not any(two.cell("fast_coning").initial)


def test_numbers_are_read_exactly_and_in_the_cycle_of_their_stage():
    text = parsed(
        {
            "sample_hz": 100,
            "inputs": {"gyro": {"unit": "rad", "range": "2*T"}},
            "stage": [
                {
                    "name": "a",
                    "kernel": "k",
                    "every": "50 Hz",
                    "constants": {"c": [["1/3", 2], [Fraction("0.1"), "1/T"]]},
                    "ranges": {"r": "3*T"},
                }
            ],
        },
        "name",
    )
    (stage,) = text.stages
    assert text.inputs[0].range == Fraction(1, 50)
    assert (stage.every, stage.ranges["r"]) == (2, Fraction(3, 50))
    assert stage.constants["c"] == (Fraction(1, 3), 2, Fraction(1, 10), 50)


def test_a_file_may_have_a_mark_of_its_encoding_and_any_ends_of_lines(tmp_path):
    plain, other = tmp_path / "a.toml", tmp_path / "My-System 2.toml"
    text = TWO_SPEEDS.replace('name = "two"\n', "")
    plain.write_text(text)
    other.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    assert read(other).name == "my_system_2"
    assert dataclasses.replace(read(other), name="a") == read(plain)
    assert read(plain, Fraction(1600)).sample_hz == 1600


factors = st.lists(st.integers(1, 4), min_size=1, max_size=4)


@settings(max_examples=8, deadline=None)
@given(factors, st.sampled_from([*FRAMES]), st.sampled_from(["rad", "m/s", "1"]), st.integers(0, 2**31))
def test_a_random_chain_of_sums_loses_nothing(steps, frame, unit, seed):
    """Each stage sums up what the one before has summed; unit and frame go through all of them."""
    tables = {
        "sample_hz": 1000,
        "inputs": {"gyro": {"unit": unit, "frame": frame, "range": 1}},
        "stage": [],
        "outputs": [f"s{len(steps)}.increment_share"],
    }
    every, source = 1, "gyro"
    for number, step in enumerate([1, *steps]):
        every *= step
        is_last = number == len(steps)
        kernel = {"kernel": "hold-3", "constants": {"share": 1}} if is_last else {"kernel": "sum-3"}
        ranges = {} if is_last else {"ranges": {"sum": 4 ** (number + 1) * 4}}
        name = f"s{number}"
        tables["stage"].append(
            {"name": name, "every": every, "wires": {"increment": source}, **kernel, **ranges}
        )
        source = f"{name}.sum"
    system = wired(parsed(tables))
    assert all((cell.signal.unit, cell.signal.frame) == (unit, frame) for cell in system.system.cells)
    assert system.system.cycle == every
    values = np.random.default_rng(seed).integers(-1000, 1001, (3 * every - 1, 3)) / 1024  # sums are exact
    (shares,) = system_runner(system).run({"gyro": values}).values.values()
    assert np.array_equal(shares, values[: 2 * every].reshape(2, every, 3).sum(axis=1))


#: Settings and constants with which each runs in fixed point; a unit that is not known has no range of its own.
RANGES = {
    "sum-3": {"sum": Fraction(1), "increment": Fraction(1, 8)},
    "hold-3": {"increment": Fraction(1, 8)},
    "angle-counts": {},
    "velocity-counts": {},
}
CONSTANTS = {
    "hold-3": {"share": "1/3"},
    "angle-counts": {"scale": "1.4544e-5"},
    "velocity-counts": {"scale": "0.01"},
}


def named(name, **values):
    """Return elements by their names in a program, in fractions."""
    signals = {signal.name: signal for signal in program(choose(name)).inputs}
    return {
        element: Fraction(number)
        for key, numbers in values.items()
        for element, number in zip(signals[key].elements, np.atleast_1d(numbers).tolist(), strict=True)
    }


def test_shares_of_an_increment_sum_up_to_it():
    parts, total = 32, [Fraction(0)] * 3
    increment = [Fraction(1, 7), Fraction(-2, 9), Fraction(3)]
    (share,) = (
        program(choose("hold-3")).run(named("hold-3", increment=increment, share=Fraction(1, parts))).values()
    )
    for _ in range(parts):
        (total,) = program(choose("sum-3")).run(named("sum-3", sum=total, increment=share)).values()
    assert total == increment


def test_counts_become_increments_in_the_unit_of_their_scale():
    counts = [3, -2, 1 << 15]
    for name, scale, unit in (("angle-counts", "1/68755", "rad"), ("velocity-counts", "1/100", "m/s")):
        (output,) = (stage.signal for stage in kernel(choose(name)).outputs)
        assert (output.unit, output.frame, output.over) == (unit, "b", "cycle")
        (increment,) = program(choose(name)).run(named(name, count=counts, scale=Fraction(scale))).values()
        assert increment == [count * Fraction(scale) for count in counts]


def test_a_sum_begins_anew_and_is_a_value_at_an_instant_while_increments_are_not():
    sum_, hold = kernel(choose("sum-3")), kernel(choose("hold-3"))
    assert sum_.recursion.reset == ("sum",)
    signals = {
        s.name: s for s in (*sum_.inputs, *hold.inputs, sum_.outputs[0].signal, hold.outputs[0].signal)
    }
    assert (
        {s.unit for s in signals.values() if s.shape}
        == {s.frame for s in signals.values() if s.shape}
        == {ANY}
    )
    over = {name: signal.over for name, signal in signals.items()}
    assert over["sum"] == over["next_sum"] == "" and over["increment_share"] == "cycle"
    assert (
        sum_.inputs[1].over == "cycle" and hold.inputs[0].over == ""
    )  # an increment that is held is sampled again


@pytest.mark.parametrize(
    "name", [name if name == "sum-3" else pytest.param(name, marks=pytest.mark.long) for name in RANGES]
)
def test_every_back_end_stays_within_its_bound(name, backend_name, rng):
    choice = choose(name, constants=CONSTANTS.get(name))
    settings = None
    if strapgen.BACKENDS[backend_name].fixed:
        settings = Settings(word=strapgen.BACKENDS[backend_name].word or 32, ranges=RANGES[name])
    evaluator = strapgen.evaluator(choice, backend_name, settings)
    unit = Fraction(1, 1 << (24 if single(backend_name) else 53))
    for _ in range(10):
        inputs = {
            signal.name: [Fraction(int(k), 512) for k in rng.integers(-64, 65, size=3)]
            for signal in program(choice).inputs
        }
        (expected,) = program(choice).run(named(name, **inputs)).values()
        computed = evaluator(*(np.array(x, float).astype(evaluator.dtype) for x in inputs.values()))
        # In floating point a constant and one operation are rounded to the nearest.
        bounds = [abs(y) * ((1 + unit) ** 2 - 1) for y in expected]
        if settings is not None:
            bounds = evaluator.sources.fixed.outputs[0].errors
        for x, y, bound in zip(computed, expected, bounds, strict=True):
            assert abs(Fraction(float(x)) - y) <= bound
