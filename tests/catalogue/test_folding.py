"""Constants in a kernel: exact, with fewer operations, and on every back end what the kernel computes with inputs."""

from __future__ import annotations

import pickle
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp
from derived import kernel, program

import strapgen
from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings

#: No term of the error model has products of increments.
NO_PRODUCTS = {
    "anisoinertia": [0] * 3,
    "anisoelasticity": [0] * 5,
    "rate_products": [0] * 3,
    "acceleration_products": [0] * 6,
}
#: One misalignment and no other error, in a cycle of 20 ms.
ALMOST_NONE = NO_PRODUCTS | {
    "cycle": "0.02",
    "cycle_rate": 50,
    "rate_bias": [0] * 3,
    "rate_scale": [[Fraction(1, 2000), 0, 0], [0, 0, 0], [0, 0, 0]],
    "g_sensitivity": [0] * 7,
    "acceleration_bias": [0] * 3,
    "rate_sensitivity": [0] * 9,
    "acceleration_scale": np.zeros((3, 3)),
}
#: All coefficients of an example.
UNIT = {
    "cycle": "0.02",
    "cycle_rate": 50,
    "rate_bias": [1e-4, -2e-4, 3e-4],
    "rate_scale": [1e-4, 2e-4, 3e-4, 4e-4, 5e-4, 6e-4, 7e-4, 8e-4, 9e-4],
    "anisoinertia": [1e-4, 2e-4, 3e-4],
    "g_sensitivity": [1e-6, 2e-6, 3e-6, 4e-6, 5e-6, 6e-6, 7e-6],
    "anisoelasticity": [1e-7, 2e-7, 3e-7, 4e-7, 5e-7],
    "acceleration_bias": [1e-3, -2e-3, 3e-3],
    "rate_sensitivity": [1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3, 7e-3, 8e-3, 9e-3],
    "rate_products": [1e-3, 2e-3, 3e-3],
    "acceleration_scale": [7e-4, 8e-4, 9e-4, 4e-4, 5e-4, 6e-4, 1e-4, 2e-4, 3e-4],
    "acceleration_products": [1e-6, 2e-6, 3e-6, 4e-6, 5e-6, 6e-6],
}
PULSE = {"cycle": "0.01", "scale_error": "1e-3", "scale_error_plus": "-4e-4", "scale_error_minus": "3e-4"}


def count(name, constants=None):
    """Return all operations of a kernel."""
    return sum(program(choose(name, constants=constants)).operations.values())


def exactly(choice, inputs):
    """Return the outputs of a kernel without constants, in fractions, on the constants of a choice and on inputs."""
    full = program(choose(choice.name))
    values = dict(choice.constants) | inputs
    elements = {
        element: number
        for signal in full.inputs
        for element, number in zip(signal.elements, values[signal.name], strict=True)
    }
    return full.run(elements)


def drawn(choice, rng, unit=1024):
    """Return numbers of a grid for the inputs of a choice."""
    return {
        signal.name: tuple(Fraction(int(k), unit) for k in rng.integers(-300, 300, size=signal.size))
        for signal in program(choice).inputs
    }


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "constants"),
    [
        ("imu-compensate", UNIT),
        pytest.param("imu-compensate-2", NO_PRODUCTS, marks=pytest.mark.long),
        ("pulse-compensate", PULSE),
        ("pulse-errors", {"scale_error_plus": 0, "scale_error_minus": 0}),
        ("dcm-update-3", {"rotation_vector": [0.1, 0, -0.3]}),
        ("euler-product", {"transition": [0, 0, 0, 1]}),
        ("navigation-rotation", {"turn": [1e-4, 0, 0]}),
        ("dcm-acceleration", {"state": np.eye(3)}),
        ("temperature-coefficient", {"slope_above": 0, "slope_below": 0, "nominal": 2}),
    ],
)
def test_folded_program_equals_the_whole_kernel(name, constants, rng):
    choice = choose(name, constants=constants)
    folded = program(choice)
    assert {signal.name for signal in folded.inputs}.isdisjoint(constants)
    assert count(name, constants) < count(name)
    for _ in range(5):
        inputs = drawn(choice, rng)
        elements = {
            element: number
            for signal in folded.inputs
            for element, number in zip(signal.elements, inputs[signal.name], strict=True)
        }
        assert folded.run(elements) == exactly(choice, inputs)


def test_zero_coefficients_cost_nothing():
    # D0 T, K d, B dv and A0 T, G d, M dv: 3 + 9 + 9 products each, and as many terms to subtract.
    operations = program(choose("imu-compensate", constants=NO_PRODUCTS)).operations
    assert (operations["multiply"], operations["add"]) == (42, 42)
    assert count("imu-compensate", ALMOST_NONE) == 1
    assert count("dcm-update", {"rotation_vector": [0, 0, 0]}) == 0
    assert count("coning-increments", {"a": 0, "b": 0, "g": 1}) == 0


def test_a_root_of_a_square_is_a_magnitude():
    choice = choose("constant-truth", constants={"x": 0, "y": 0})
    formulas = [e for stage in (*kernel(choice).stages, *kernel(choice).outputs) for e in stage.expressions]
    assert any(formula.has(sp.Abs) for formula in formulas)
    for z in (-0.7, 0.7):
        whole = strapgen.evaluator("constant-truth")(2.0, 0.0, 0.0, z)
        for one, other in zip(strapgen.evaluator(choice)(2.0, z), whole, strict=True):
            np.testing.assert_allclose(
                one, other, rtol=0, atol=4e-16
            )  # each element is a sum of two products


def test_fixed_point_needs_no_range_of_a_constant():
    choice = choose("coning-increments", constants={"a": 0, "b": 1, "middle": 1, "width": "1/100"})
    fixed = strapgen.quantize(program(choice), Settings(ranges={"g": Fraction(7)}))
    assert [argument.signal.name for argument in fixed.interface.inputs] == ["g"]
    with pytest.raises(InputError, match="width"):
        strapgen.quantize(program(choice), Settings(ranges={"g": Fraction(7), "width": Fraction(1)}))


@pytest.mark.parametrize(
    ("name", "constants", "words"),
    [
        (
            "imu-compensate",
            {"cylce": 1},
            "kernel imu-compensate: constant 'cylce' is not known (did you mean cycle?); allowed: increment, velocity_",
        ),
        (
            "imu-compensate",
            {"rate_bias": [1, 2]},
            "kernel imu-compensate: constant rate_bias has 2 numbers; 3 are needed: D0_x, D0_y, D0_z",
        ),
        (
            "scale-factor-heating",
            {"deviation": [0, 0, 0]},
            "kernel scale-factor-heating: deviation is a state, which each call changes, and no constant; allowed: tor",
        ),
        (
            "coning-slow",
            {"angle_sum": [0] * 3, "coning": [0] * 3},
            "kernel coning-slow: all inputs are constants",
        ),
        (
            "pulse-compensate",
            {"scale_error": -1},
            "kernel pulse-compensate: scale_correction has no value with th",
        ),
        ("euler", {"state": [0, 0, 0, 1]}, "algorithm euler takes no constants (got state)"),
        (
            "rotation-vector",
            {"increments": 1},
            "algorithm rotation-vector takes no constants (got increments)",
        ),
    ],
)
def test_invalid_constants_are_refused_in_one_line(name, constants, words):
    with pytest.raises(InputError) as caught:
        strapgen.derive(name, constants=constants)
    assert str(caught.value).startswith(words) and "\n" not in str(caught.value)


def test_choices_with_other_constants_are_other_choices():
    one, other = (
        choose("temperature-coefficient", constants={"nominal": 1, "slope_above": k}) for k in (1, 2)
    )
    same = choose("temperature-coefficient", constants={"slope_above": "1.0", "nominal": Fraction(1)})
    assert one == same and hash(one) == hash(same) and one.identity == same.identity
    assert one != other and one.identity != other.identity != choose("temperature-coefficient").identity
    assert choose("temperature-coefficient", constants={}) == choose("temperature-coefficient")
    assert pickle.loads(pickle.dumps(one)) == one
    texts = {"".join(pipeline.compile(choice, "numpy").files.values()) for choice in (one, other, same)}
    assert len(texts) == 2


def test_a_complete_choice_takes_no_more_constants():
    with pytest.raises(InputError, match=r"constants is .*, but the choice of coning-slow has its own"):
        strapgen.derive(choose("coning-slow"), constants={"coning": [0, 0, 0]})
