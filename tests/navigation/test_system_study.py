"""What a described system navigates on every back end, and each single pass held to its bounds."""

import json
import math
from fractions import Fraction

import numpy as np
import pytest
from commands import run

from strapgen.analysis.vibration.spectrum import read_spectrum
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.lab.motions.motions import motion
from strapgen.navigation.systems import system_study
from strapgen.navigation.systems.fitting import fitted
from strapgen.navigation.systems.system_bounds import bounds
from strapgen.navigation.systems.system_comparison import agreement
from strapgen.navigation.systems.system_file import parsed
from strapgen.navigation.systems.system_flight import begun
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.navigation.systems.system_runs import cycles_of, samples
from strapgen.navigation.systems.wiring import described, wired
from strapgen.navigation.vehicle.vehicle_motions import shaken as shaken_by
from strapgen.navigation.vehicle.vehicle_motions import vibration

EXAMPLE = "examples/strapdown.toml"
#: One count of the gyros in rad.
COUNT = 3 * math.pi / 648000


def sensed(description, vehicle, seconds):
    """Samples of a system on a vehicle."""
    cycles = cycles_of(description.system, Fraction(seconds))
    return samples(description, *vehicle.both_samples(1 / description.system.sample_hz, 0, cycles))


@pytest.fixture(scope="module")
def shaken():
    return shaken_by(motion("swinging"), vibration(read_spectrum("examples/vibration.csv")))


def test_increments_repeat_with_the_motion(shaken):
    for increments in motion("swinging").both_samples(Fraction(1, 10), 0, 1300):
        assert (increments[1200:] == increments[:100]).all()
    first, again = np.array([0.25, 0.5]), np.array([120.25, 120.5])
    assert np.allclose(shaken.navigation_attitude(again), shaken.navigation_attitude(first), atol=1e-9)
    # Phases of up to 461 Hz are 3.5e5 rad after two minutes, and rounded to 8e-11; accelerations add up to less than
    # 1000 m/s^2.
    for name in ("rate", "force"):
        one, other = (getattr(shaken.sensed(times), name) for times in (again, first))
        assert np.allclose(one, other, rtol=0, atol=1e-7)


@pytest.mark.long
def test_the_chain_finds_the_attitude_of_a_vehicle_that_turns():
    description = described(EXAMPLE)
    result = system_study.study(description, motion("swinging"), Fraction(4), ["c-fixed32", "c-fixed16"])
    # Half a count on each axis, and what compensation leaves to second order, 1e-6 of the angles.
    assert result.double.sizes[0].max() < 2 * COUNT
    fine, coarse = (flight.sizes for flight in result.differences.values())
    assert fine[0].max() < 1e-8 * 16  # units of 2^-30 over 200 passes, with error feedback
    assert 1e-6 < coarse[0].max() < 2e-3
    assert fine[1].max() < 1e-5
    assert fine[2].max() < 0.1


@pytest.mark.long
@pytest.mark.parametrize(
    ("rate", "seconds", "backend", "reference"),
    [
        (100, 240, "c-fixed32", "numpy"),
        (100, 120, "c-fixed16", "numpy"),
        (100, 30, "c", "numpy"),
        (100, 8, "c-fixed32", "exact"),
        (3200, 5, "c-fixed16", "numpy"),
    ],
)
def test_every_pass_of_the_chain_is_within_the_sum_of_the_bounds(shaken, rate, seconds, backend, reference):
    description = described(EXAMPLE, Fraction(rate))
    inputs = sensed(description, shaken, seconds)
    runner = system_runner(description, backend)
    start = begun(runner, shaken)
    result = agreement(runner, system_runner(description, reference), inputs, start)
    assert result.holds, {name: share for name, share in result.share.items() if share > 1}
    assert set(result.reasons) == {"angles_previous", "geographic_previous"}  # angles jump by a turn
    assert max(result.largest[name] for name in result.reasons) < 1e-3
    assert (result.share["velocity_velocity"] > 0.05) == (backend != "c")


@pytest.mark.long
def test_the_model_and_the_c_have_the_same_bits_along_the_chain(shaken):
    description = described(EXAMPLE, Fraction(100))
    inputs = sensed(description, shaken, 5)
    from strapgen.ir.fixed_settings import Settings

    for word in (16, 32):
        runs = [
            system_runner(description, name, Settings(word=word)).run(inputs).values
            for name in (f"c-fixed{word}", "fixed-model")
        ]
        assert all((runs[0][name] == runs[1][name]).all() for name in runs[0])


@pytest.mark.long
def test_the_command_prints_differences(capsys):
    def printed(*options):
        run(["study", "system", EXAMPLE, "--sample-hz", "100", "--duration", "2", *options])
        return capsys.readouterr().out

    assert "algorithm, in double" in printed("--backend", "c-fixed16")
    data = json.loads(printed("--backend", "c-fixed32", "--format", "json"))
    assert data["sample_hz"] == 100
    assert data["from_double"][0]["backend"] == "c-fixed32"
    assert 0 < data["from_double"][0]["attitude_arcsec"] < 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--duration", "0.05"], "no whole number of cycles of the slowest rate, 0.1 s"),
        (["--sample-hz", "70"], "which does not divide the 70 Hz of the samples"),
        (["--backend", "c-fixed8"], "backend 'c-fixed8' is not known"),
    ],
)
def test_invalid_runs_get_one_line(options, message, capsys):
    run(["study", "system", EXAMPLE, *options], 2)
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_inputs_that_no_vehicle_measures_are_refused(shaken):
    description = described(EXAMPLE, Fraction(100))
    choices = {**description.choices, "gyro": description.choices["cosines"]}
    with pytest.raises(InputError, match=r"gyro_counts \(unit 1, frame b\) is no gyro or accelerometer"):
        sensed(type(description)(**{**vars(description), "choices": choices}), shaken, 1)


#: Three rates, a delayed wire, sums, a state in another stage's cell, and words of two lengths.
TABLES = {
    "sample_hz": 100,
    "inputs": {
        "gyro": {"unit": "rad", "frame": "b", "range": "2*T"},
        "accelerometer": {"unit": "m/s", "frame": "b", "range": "30*T"},
    },
    "stage": [
        {
            "name": "fast",
            "kernel": "two-speed-fast-2",
            "every": 1,
            "word": 16,
            "wires": {"increment": "gyro", "velocity_increment": "accelerometer"},
            "ranges": {"angle_sum": "1/16", "coning": "1/512", "velocity_sum": 1, "sculling": "1/16"},
        },
        {
            "name": "slow",
            "kernel": "euler-two-speed-slow-2",
            "every": 2,
            "wires": {
                **{name: f"fast.{name}" for name in ("angle_sum", "coning", "velocity_sum", "sculling")},
                "turn": "turn.turn",
            },
            "delay": {"turn": 1},
            "ranges": {"navigation_velocity": 8, "navigation_rotation": "1/1024", "turn": "1/65536"},
            "initial": {"state": ["0.6", 0, 0, "0.8"]},
        },
        {
            "name": "frame",
            "kernel": "euler-two-speed-navigation",
            "every": 10,
            "wires": {
                "state": "slow.state",
                "navigation_rotation": "slow.navigation_rotation",
                "navigation_velocity": "slow.navigation_velocity",
            },
        },
        {
            "name": "norm",
            "kernel": "euler-normalize-first-order",
            "every": 10,
            "wires": {"state": "slow.state"},
            "writes": {"next": "slow.state"},
        },
        {
            "name": "earth",
            "kernel": "earth-rate",
            "every": 10,
            "wires": {"position": "place.next_position"},
            "constants": {"sidereal_rate": "7.292115e-5"},
            "delay": {"position": 1},
        },
        {
            "name": "place",
            "kernel": "position-step",
            "every": 10,
            "wires": {"transport_rate": "earth.earth_rate"},  # not a navigator, but a rate in n
            "constants": {"cycle": "T"},
        },
        {
            "name": "turn",
            "kernel": "navigation-turn",
            "every": 10,
            "wires": {"earth_rate": "earth.earth_rate", "transport_rate": "earth.earth_rate"},
            "constants": {"cycle": "0.02"},
        },
    ],
}


@pytest.fixture(scope="module")
def description():
    return wired(parsed(TABLES, "chain"))


@pytest.fixture(scope="module")
def inputs():
    time = np.arange(400) / 100
    wave = np.stack([np.sin(9 * time), np.cos(7 * time), np.sin(5 * time + 1)], axis=1)
    return {"gyro": 0.015 * wave, "accelerometer": 0.1 * wave[:, ::-1] + [0, 0, 0.1]}


@pytest.mark.parametrize(
    ("backend", "settings"),
    [
        ("c-fixed16", Settings()),
        pytest.param("c", None, marks=pytest.mark.long),
        pytest.param("c-float", None, marks=pytest.mark.long),
        pytest.param("c-fixed32", Settings(carry="full"), marks=pytest.mark.long),
        pytest.param("c-fixed32", Settings(rounding="truncation"), marks=pytest.mark.long),
        pytest.param("c-fixed16", Settings(word=16, carry="full"), marks=pytest.mark.long),
    ],
)
def test_no_pass_goes_beyond_the_bounds_of_its_stages(description, inputs, backend, settings):
    runner = system_runner(description, backend, settings)
    result = agreement(runner, system_runner(description, "numpy"), inputs)
    assert result.holds, {name: share for name, share in result.share.items() if share > 1}
    assert result.cycles == 400
    assert not result.reasons
    if (
        settings is not None
    ):  # in fixed point bounds are near what happens: on most cells within a factor of 50
        near = [share for name, share in result.share.items() if result.certified[name]]
        assert np.median(near) > 0.02


@pytest.mark.long
def test_passes_in_exact_arithmetic_and_in_the_model_say_the_same(description, inputs):
    few = {name: rows[:60] for name, rows in inputs.items()}
    runner = system_runner(description, "c-fixed16")
    exact = agreement(runner, system_runner(description, "exact"), few)
    assert exact.holds
    model = system_runner(description, "fixed-model", Settings(word=16)).run(few).values
    for name, values in runner.run(few).values.items():
        assert (values == model[name]).all()


@pytest.mark.long
def test_a_bound_counts_every_stage_that_comes_before(description):
    fit = fitted(description, "c-fixed", Settings())
    errors = bounds(fit).errors
    turn = max(errors["turn_turn"])
    own = max(fit.sources["turn"].fixed.outputs[0].errors)
    earth = max(fit.sources["earth"].fixed.outputs[0].errors)
    assert turn >= own + earth * 4 / 100 * (1 - 1e-9)  # two rates of the earth times 0.02 s
    assert turn <= own + earth * 4 / 100 * (1 + 1e-6)


def test_only_c_tells_the_memory_of_every_cycle(description, inputs):
    numpy = system_runner(description, "numpy")
    with pytest.raises(InputError, match="back end numpy runs no C"):
        agreement(numpy, numpy, inputs)
