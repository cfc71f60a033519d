"""Bounds of how far results move with their inputs."""

from fractions import Fraction

import numpy as np
import pytest
import sympy

from strapgen import derive, lower
from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import KernelBuilder
from strapgen.navigation.systems.system_bounds import moved


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


def test_length_of_what_may_be_zero_moves_with_its_parts():
    """Its root has no derivative at zero: from (0, 0) the length moves by as much as one of its parts."""
    length = program(lambda x, y, z: sympy.sqrt(x**2 + y**2) + z)
    assert moved(length, LIMITS, {"x": ERROR})["result"] == ERROR
    assert moved(length, LIMITS, {"x": ERROR, "y": ERROR})["result"] == (2 * ERROR[0],)
    assert length.run({"x_1": 1e-3, "y_1": 0.0, "z_1": 0.0}, float)["result"] == [1e-3]


def test_root_of_what_may_be_zero_and_is_no_length_has_no_bound():
    root = program(lambda x, y, z: sympy.sqrt(sympy.Max(x, 0)) + y * z)
    with pytest.raises(InputError, match=r"the radicand in .* may be zero"):
        moved(root, LIMITS, {"x": ERROR})


@pytest.mark.parametrize("name", ["x", "y"])
def test_comparison_that_an_error_may_turn_has_no_bound(name):
    selected = program(lambda x, y, z: sympy.Piecewise((z, x >= y), (-z, True)))
    assert moved(selected, LIMITS, {"z": ERROR})["result"] == ERROR
    with pytest.raises(InputError, match="an error of its input may turn a comparison in r_1"):
        moved(selected, LIMITS, {name: ERROR})


def test_comparison_of_what_may_be_equal_has_no_bound():
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
