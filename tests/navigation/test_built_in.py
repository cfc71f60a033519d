"""The built-in systems: algorithms in two speeds as files, from which `strapgen two-speed` takes its loops."""

from __future__ import annotations

import numpy as np
import pytest

from strapgen.ir.exceptions import InputError
from strapgen.navigation.systems import built_in
from strapgen.navigation.systems.fitting import copies, summed
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.navigation.systems.wiring import described
from strapgen.navigation.two_speed.two_speed_runner import TwoSpeed
from strapgen.navigation.two_speed.two_speed_sources import ALGORITHMS, SCULLING, description, kernels

FORMS = [(algorithm, sculling) for algorithm in ALGORITHMS for sculling in SCULLING]


def test_every_file_is_a_system_and_every_form_in_two_speeds_has_one():
    forms = {description(*form).system.title: kernels(*form) for form in FORMS}
    files = {name: described(name) for name in built_in.names()}
    stages = {d.system.title: tuple(stage.kernel for stage in d.system.stages) for d in files.values()}
    assert stages == forms
    assert built_in.names() == {name: d.system.title for name, d in files.items()}
    assert len(set(forms.values())) == len(FORMS)
    for name in files:
        assert built_in.is_system(name)
    assert not built_in.is_system("euler") and built_in.is_system("mine.toml")
    with pytest.raises(InputError, match=r"system 'two-speed-eulre' .*two-speed-euler"):
        described("two-speed-eulre")


@pytest.mark.parametrize(("algorithm", "sculling"), FORMS)
def test_copies_and_sums_are_read_off_the_formulas(algorithm, sculling):
    programs = description(algorithm, sculling).programs
    assert copies(programs["fast"]) == {"previous_increment": "increment"}
    assert copies(programs["slow"]) == {"previous_turn": "turn"}
    assert summed(programs["fast"]) == {"angle_sum": "increment", "velocity_sum": "velocity_increment"}
    assert not summed(
        programs["slow"]
    )  # rotations and velocities of the slow cycles are turned before they are added


@pytest.mark.parametrize(
    ("backend", "form"),
    [
        ("numpy", ("euler", 2)),
        *(pytest.param("c", form, marks=pytest.mark.long) for form in FORMS),
    ],
)
def test_file_agrees_with_the_two_speed_algorithm(backend, form, rng):
    name = f"two-speed-{form[0]}" + ("" if form[1] == 2 else "-1")
    described_system = system_runner(described(name), backend)
    cycles = 640
    angles, velocities = (rng.uniform(-1, 1, (cycles, 3)) * size for size in (5e-4, 0.01))
    turn = np.array([1e-6, -2e-6, 3e-5])
    run = described_system.run(
        {"gyro": angles, "accelerometer": velocities, "turn": np.tile(turn, (cycles, 1))}
    )
    reference = TwoSpeed(*form, backend)
    turns = np.tile(turn, (cycles // 64 + 1, 1))
    turns[0] = 0  # a system knows of no cycle before the first
    other = reference.run(angles, velocities, fast_cycles=64, slow_cycles=5, turns=turns)
    np.testing.assert_array_equal(run.values["slow_state"], other.attitudes)
    np.testing.assert_array_equal(run.values["nav_velocity_change"], other.velocity_changes)


@pytest.mark.long
@pytest.mark.parametrize("backend", ["c-float", "c-fixed16", "c-fixed32"])
def test_every_file_runs_at_the_ends_of_its_ranges(backend):
    for name in built_in.names():
        runner = system_runner(described(name), backend)
        ends = {
            signal.name: np.full((640, 3), 0.95 * float(signal.bound or 0)) / np.sqrt(3)
            for signal in runner.system.inputs
        }
        attitude = runner.run(ends).values["slow_state"]
        assert len(attitude) == 10 and np.isfinite(attitude).all()
