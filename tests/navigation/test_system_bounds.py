"""Error bounds that add up along the wires of a system, held to runs."""

import numpy as np
import pytest

from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.systems.fitting import fitted
from strapgen.navigation.systems.system_bounds import bounds
from strapgen.navigation.systems.system_comparison import agreement
from strapgen.navigation.systems.system_file import parsed
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.navigation.systems.wiring import wired

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
