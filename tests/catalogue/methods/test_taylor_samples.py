"""Taylor series on three samples and more: a rotation, whatever the samples are, and the best of the series."""

from __future__ import annotations

from random import Random

import mpmath
import numpy as np
import pytest
import sympy as sp

from strapgen import InputError, backend, choose, derive, motion, simulate
from strapgen.catalogue.methods import rate_fit
from strapgen.kernel.kernel import Kernel, evaluate_stages
from strapgen.lab.motions.motions import Motion


def cone(frequency_hz: float) -> Motion:
    """Return a cone of half-angle 5 degrees."""
    half_angle, omega = np.radians(5), 2 * np.pi * frequency_hz
    return motion(
        "coning",
        a_rad_s=omega * np.sin(half_angle),
        b_rad_s=omega,
        g_rad_s=-omega * (1 - np.cos(half_angle)),
    )


def transition(kernel: Kernel, samples: list[mpmath.mpf]) -> mpmath.matrix:
    """Return the elements of the transition, in many digits."""
    state = dict.fromkeys(kernel.inputs[0].elements, mpmath.mpf(0))
    signal = next(stage.signal for stage in kernel.stages if stage.signal.name == "transition")
    values = state | dict(zip(kernel.inputs[1].elements, samples, strict=True))
    known = evaluate_stages(
        kernel.stages,
        values,
        lambda number: mpmath.mpf(number.p) / number.q,
        lambda power, arguments: arguments[0] ** (mpmath.mpf(power.exp.p) / power.exp.q),
    )
    flat = [known[name] for name in signal.elements]
    return mpmath.matrix([flat[k : k + 3] for k in (0, 3, 6)] if signal.shape == (3, 3) else flat)


@pytest.mark.long
@pytest.mark.parametrize(
    ("algorithm", "order", "count", "previous"),
    [("dcm", 2, 3, 0), ("euler", 4, 1, 3), ("cayley-klein", 4, 4, 0), ("euler", 8, 5, 0)],
)
def test_three_minutes_on_a_fast_cone_end_on_a_rotation(algorithm, order, count, previous):
    # Five samples a turn of the cone.
    runner = backend(algorithm, f"taylor{order}", count, previous=previous)
    step = f"{count}/100"
    run = simulate(runner, cone(20), step, 180, record=step)
    gram = np.einsum("nik,njk->nij", run.computed, run.computed)
    assert np.abs(gram - np.eye(3)).max() < 1e-9


@pytest.mark.parametrize(
    ("order", "count", "frequency_hz", "most_deg"),
    [
        (4, 3, 5, 0.005),
        *(
            pytest.param(*more, marks=pytest.mark.long)
            for more in ((6, 4, 5, 0.0004), (4, 4, 5, 0.012), (8, 4, 20, 1.3), (8, 5, 10, 0.025))
        ),
    ],
)
def test_the_series_from_the_middle_converges_where_that_from_the_beginning_does_not(
    order, count, frequency_hz, most_deg
):
    run = simulate(
        backend("euler", f"taylor{order}", count), cone(frequency_hz), f"{count}/100", "1.2", record="1.2"
    )
    assert np.degrees(run.mean_drift) < most_deg


@pytest.mark.long
@pytest.mark.parametrize(("algorithm", "order", "count"), [("dcm", 4, 3), ("dcm", 5, 4)])
def test_time_reversed_takes_the_step_back(algorithm, order, count):
    # Hence the order is even.
    kernel, random = derive(algorithm, f"taylor{order}", count), Random(1969)
    with mpmath.workdps(60):
        samples = [mpmath.mpf(random.randint(-999, 999)) / 1000 for _ in range(3 * count)]
        back = [-samples[3 * (count - 1 - k) + axis] for k in range(count) for axis in range(3)]
        product = transition(kernel, samples) * transition(kernel, back)
        assert mpmath.mnorm(product - mpmath.eye(3)) < mpmath.mpf(10) ** -50


def test_a_series_on_two_samples_is_no_rotation():
    assert not derive("euler", "taylor4", 2).attitude_step.isometry
    assert not derive("euler", "taylor4", 1, previous=1).attitude_step.isometry


def test_a_series_that_leaves_out_part_of_the_rate_is_refused():
    for order, count, previous, ahead in ((3, 4, 0, 0), (1, 8, 0, 0), (4, 2, 1, 2), (20, 8, 13, 0)):
        samples = count + previous + ahead
        needed = f"taylor{samples} to taylor20 and fit-exact keep" if samples < 20 else "fit-exact keeps"
        message = (
            f"method taylor{order} leaves out part of the rate through {samples} samples, "
            f"those beside the step included; {needed} all of it"
        )
        with pytest.raises(InputError, match=f"^{message}$"):
            choose("euler", f"taylor{order}", count, previous=previous, ahead=ahead)
    assert choose("euler", "taylor20", 8, previous=12).method == "taylor20"


def test_what_it_would_leave_out_is_of_first_order():
    # Five samples: without the fourth power of time, about the middle of the step, it would not turn by their sum.
    fit, half = rate_fit.from_increments(5), sp.Rational(1, 2)
    angles = [
        sum(
            (sp.Matrix(fit.taylor(k, half)) * 2 * half ** (k + 1) / (k + 1) for k in range(0, powers, 2)),
            sp.zeros(5, 1),
        )
        for powers in (5, 4)
    ]
    assert list(angles[0]) == [1] * 5 and not set(angles[1]) & {1}
