"""The kernels of layouts that files describe: each against the torques that define it, on all back ends."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from derived import kernel, quantized

import strapgen
from strapgen.catalogue import Choice, choose
from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.instruments.layout import Layout, read
from strapgen.navigation.instruments.layouts import gyros
from strapgen.navigation.instruments.separation import determinant, measurement_matrix, noise_gains
from strapgen.navigation.systems.system_comparison import agreement
from strapgen.navigation.systems.system_file import parsed
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.navigation.systems.wiring import wired

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "layouts"
NAMES = ("diagonal", "turned", "skewed")
#: Numbers of the symbols, as inputs or constants: 5 deg/s/g is 0.0089.
CONSTANTS = {"turned": {"unbalance_2": "0.02", "unbalance_3": "-1/64"}}
B = Fraction(1, 100)
#: Torques as exact numbers of every back end.
TORQUES = np.array([[1, -2, 3, 0, 5, -7], [64, -64, 32, -32, 16, 60]]) / 128


def layout(name: str) -> Layout:
    return read(EXAMPLES / f"{name}.toml")


def chosen(name: str, what: str = "separate") -> Choice:
    return choose(what, layout=layout(name), constants=CONSTANTS.get(name))


def rows(name: str) -> np.ndarray:
    """Return the torques of rate and acceleration from the numbers of a file, with no symbols."""
    described = layout(name)
    values = {"": 1.0, "B": float(B), "B2": 0.02, "B3": -1 / 64}
    lines = []
    for gyro in described.gyros:
        x, y = (np.array([float(element) for element in axis]) for axis in (gyro.x, gyro.y))
        angle = np.radians(float(gyro.turn_deg))
        unbalance = described.sign * float(gyro.unbalance.factor) * values[gyro.unbalance.symbol]
        for axis in (np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x):
            lines.append([*axis, *(unbalance * axis)])
    return np.array(lines)


@pytest.mark.long
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == "turned" else pytest.mark.long) for name in NAMES]
)
def test_every_back_end_agrees_with_a_numeric_solution(name, backend_name):
    choice, entry = chosen(name), strapgen.BACKENDS[backend_name]
    settings = Settings(word=entry.word or 32) if entry.fixed else None
    separated = strapgen.evaluator(choice, backend_name, settings)
    more = (1 / float(B),) if name == "diagonal" else ()
    reach = np.abs(np.linalg.inv(rows(name)))
    # In double and single precision five products and sums on the way, each rounded.
    tolerance = 16 * np.finfo(separated.dtype).eps * reach.sum(axis=1) if settings is None else 0
    if settings is not None:
        assert (abs(TORQUES) <= 0.5).all()  # exact in a format that holds 1/2 and 7 places
        assert max(x.bit_length() for x in (64, 128)) <= separated.interface.inputs[0].format.fraction
        errors = [float(error) for output in separated.interface.outputs for error in output.errors]
        tolerance = np.array(errors) + 1e-12
        if more:  # 1/B rounded to its format
            tolerance[3:] += float(separated.interface.inputs[1].unit) * float(B) * reach[3:].sum(axis=1)
    for torques in TORQUES:
        computed = np.concatenate(separated(torques.astype(separated.dtype), *more)).astype(float)
        assert (np.abs(computed - np.linalg.solve(rows(name), torques)) <= tolerance).all()


def test_the_diagonal_file_gives_the_kernels_that_are_built_in():
    for what in ("separate", "torques"):
        described, built_in = kernel(chosen("diagonal", what)), kernel(choose(f"{what}-45"))
        assert described.inputs == built_in.inputs
        assert described.expand() == built_in.expand()


@pytest.mark.long
@pytest.mark.parametrize("name", ["turned", pytest.param("skewed", marks=pytest.mark.long)])
def test_the_torques_of_a_motion_are_separated_again(name):
    first, second = (kernel(choose(what, layout=layout(name))) for what in ("torques", "separate"))
    d = [element for signal in first.inputs[:2] for element in signal.elements]
    values = {signal.name: sp.Symbol(signal.name, real=True) for signal in second.inputs[1:]}
    values |= dict(zip(second.inputs[0].elements, first.expand()["torque_increment"], strict=True))
    motion = [output for outputs in second.expand(values).values() for output in outputs]
    for output, symbol in zip(motion, d, strict=True):
        assert sp.simplify(output - sp.Symbol(symbol, real=True)) == 0


@pytest.mark.long
def test_the_notes_state_determinant_and_gains_with_the_rule_of_the_source():
    # Maximise |B2 - B3|: the gain of the acceleration along x is sqrt(2)/|B2 - B3|.
    notes = " ".join(kernel(choose("separate", layout=layout("turned"))).notes)
    assert "M = W - B A" in notes
    assert "determinant of the six torques is |B2|*|B3|*|B2 - B3| in magnitude" in notes
    assert "sqrt(2)/|B2 - B3|, sqrt(2)/|B3| and sqrt(2)/|B2| m/s in the accelerations" in notes
    notes = " ".join(kernel(chosen("skewed")).notes)
    numbers = np.linalg.inv(rows("skewed"))
    assert "is 133/194400000 in magnitude" in notes
    assert np.isclose(abs(np.linalg.det(rows("skewed"))), 133 / 194400000, rtol=1e-12)
    stated = [float(gain) for gain in noise_gains(gyros(layout("skewed")), 1)]
    np.testing.assert_allclose(stated, np.sqrt((numbers**2).sum(axis=1)), rtol=1e-12)
    assert "5/7, sqrt(181)/19 and sqrt(61) in the rates x, y and z" in notes


@pytest.mark.long
def test_any_angles_of_the_torquers_leave_determinant_and_gains():
    angles = sp.symbols("alpha beta gamma", real=True)
    for name in NAMES:
        described = gyros(layout(name))
        turned = [gyro.turned(angle) for gyro, angle in zip(described, angles, strict=True)]
        sign = layout(name).sign
        assert turned[0].x != described[0].x
        assert determinant(turned, sign) == determinant(described, sign)
        assert noise_gains(turned, sign) == noise_gains(described, sign)
    # The determinant is that of the 6 x 6 matrix itself.
    matrix = measurement_matrix(gyros(layout("turned")), -1)
    b2, b3 = sp.symbols("B2 B3", real=True, nonzero=True)
    assert sp.simplify(matrix.det() ** 2 - (b2 * b3 * (b2 - b3)) ** 2) == 0


@pytest.mark.long
def test_unbalances_that_are_inputs_have_no_fixed_point_until_they_are_constants():
    free = choose("separate", layout=layout("turned"))
    assert [signal.name for signal in kernel(free).inputs] == [
        "torque_increment",
        "unbalance_2",
        "unbalance_3",
    ]
    with pytest.raises(strapgen.InputError, match="no fixed point: a division by"):
        quantized(free, Settings())
    assert quantized(chosen("turned"), Settings()).error_bounds["increment"] < 1e-9


@pytest.mark.parametrize(
    "backend", ["numpy", *(pytest.param(name, marks=pytest.mark.long) for name in ("c", "c-fixed32"))]
)
def test_a_system_separates_at_a_fast_rate_and_sums_for_a_slower_one(backend, rng):
    stages = [
        {
            "name": "separate",
            "kernel": "separate-45",
            "every": 1,
            "wires": {"torque_increment": "torques"},
            "constants": {"unbalance_reciprocal": 100},
        }
    ]
    sums = {"angle": ("increment", 2), "velocity": ("velocity_increment", 256)}
    for name, (wire, most) in sums.items():
        adding = {"wires": {"increment": f"separate.{wire}"}, "ranges": {"sum": most}}
        mean = {"wires": {"increment": f"{name}.sum"}, "constants": {"share": "1/4"}}
        stages.insert(1, {"name": name, "kernel": "sum-3", "every": 1} | adding)
        stages.append({"name": f"mean_{name}", "kernel": "hold-3", "every": 4} | mean)
    tables = {"sample_hz": 100, "inputs": {"torques": {"unit": "rad", "range": "1/8"}}, "stage": stages}
    description = wired(parsed(tables, "separated"))
    runner = system_runner(description, backend)
    torques = rng.integers(-(1 << 10), 1 << 10, size=(40, 6)) / (1 << 13)
    if backend != "numpy":
        result = agreement(runner, system_runner(description, "numpy"), {"torques": torques})
        assert result.holds
    values = runner.run({"torques": torques}).values
    d, dv = strapgen.evaluator("separate-45")(torques, np.full(40, 100.0))
    for name, increments in (("angle", d), ("velocity", dv)):
        expected = increments.reshape(10, 4, 3).mean(axis=1)
        computed = values[f"mean_{name}_increment_share"]
        np.testing.assert_allclose(computed, expected, rtol=0, atol=1e-6)
    stages[1]["wires"]["increment"] = "torques"
    with pytest.raises(strapgen.InputError, match=r"shape \(3,\) meets shape \(6,\)"):
        wired(parsed(tables, "separated"))
