"""Velocity and position of a run: orders of convergence, gravity, and the accuracy on a random motion."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import strapgen
from strapgen.catalogue import choose
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motions import motion
from strapgen.lab.motions.specific_forces import force
from strapgen.navigation.translations import translate

CONE, LEVER = motion("coning", a_deg_s=60, b_deg_s=100, g_deg_s=40), force("lever", x_m=1, y_m=2, z_m=3)
WILD, PUSH = motion("random", rate_deg_s=60), force("random", rms_m_s2=10, z_m_s2="9.8")
#: Methods with their samples and the order of their velocity.
ORDERS = {("magnus2", 1, 0): 2, ("rk4", 2, 0): 4, ("coning-combined", 3, 0): 4}


def run(method, increments, previous, step, duration, profile=CONE, push=LEVER, state="euler", **more):
    names = {"previous": previous or None}
    attitude = strapgen.backend(choose(state, method, increments, **names))
    change = strapgen.evaluator(choose("velocity-position", method, increments, **names))
    return translate(attitude, change, profile, push, step, duration, **more)


@pytest.mark.parametrize("case", ORDERS, ids=lambda case: case[0])
def test_velocity_and_position_converge_with_their_order(case):
    errors = [run(*case, step, 4) for step in ("0.1", "0.05")]
    for part in ("velocity_error", "position_error"):
        coarse, fine = (getattr(one, part) for one in errors)
        assert np.log2(coarse / fine) == pytest.approx(ORDERS[case], abs=0.35)


def test_direction_cosines_and_euler_parameters_lead_to_the_same():
    one, other = (run("magnus4", 2, 0, "0.05", 2, state=state) for state in ("dcm", "euler"))
    np.testing.assert_allclose(one.position, other.position, atol=1e-12)


def test_gravity_is_integrated_exactly():
    without = run("magnus4", 2, 0, "0.05", 2, gravity=(0, 0, 0))
    heavy = run("magnus4", 2, 0, "0.05", 2, gravity=(1, 2, -9))
    np.testing.assert_allclose(
        heavy.position - heavy.true_position, without.position - without.true_position, atol=1e-12
    )
    np.testing.assert_allclose(heavy.true_position[-1] - without.true_position[-1], [2, 4, -18], atol=1e-12)


def test_increments_that_are_too_large_are_refused_in_one_line():
    wild = motion("constant", x_rad_s=1e200)
    with pytest.raises(InputError, match="velocity or position is not finite"):
        run("rk4", 2, 0, "1", 4, wild, force("constant", y_m_s2=1))


@pytest.fixture(scope="module")
def truth():
    """The true velocity and position of a minute of the random motion, which the methods have in common."""
    return PUSH.translation(WILD, Fraction(1, 100), 6000)


@pytest.mark.long
@pytest.mark.parametrize(
    ("method", "velocity", "position"),
    # Computed once by others from Gauss-Legendre nodes of the exponential, with the same motion and filters.
    [("window-3-3", 6.4e-4, 2.1e-2), ("window-7-7", 2.1e-7, 4.8e-6)],
)
def test_the_accuracy_on_a_random_motion(method, velocity, position, truth):
    along = run(method, None, None, "0.01", 60, WILD, PUSH, truth=truth)
    assert along.velocity_error == pytest.approx(velocity, rel=0.05)
    assert along.position_error == pytest.approx(position, rel=0.05)
