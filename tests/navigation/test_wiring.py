"""The wiring of described systems: cells, rates, shared states, collected samples, what is cleared and recorded."""

from __future__ import annotations

import dataclasses
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from navigation.described_files import ATTITUDE, TWO_SPEEDS, description

from strapgen.ir.signals import FRAMES
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


def test_what_is_recorded_is_stated_or_what_no_stage_reads(two, attitude):
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
