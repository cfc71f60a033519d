"""Bounds of how far results move with their inputs."""

from fractions import Fraction

import numpy as np
import pytest

from strapgen import derive, lower
from strapgen.rounding.propagation import moved
from strapgen.support.exceptions import InputError


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
