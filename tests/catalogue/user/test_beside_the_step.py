"""Samples from before a user's step: `build.kernel(..., previous=1)` is obeyed, and contradictions are refused."""

from __future__ import annotations

import pytest

import strapgen
from strapgen import InputError

STEP = """from strapgen import EULER, AttitudeStep, KernelBuilder, Order, Signal, algebra, increments_signal
import sympy as sp


def algorithm():
    build = KernelBuilder()
    state = build.input(EULER.state)
    increments = build.input(increments_signal(1, previous={said}))
    last, now = (increments[k, :].T for k in range(2)) if {said} else (increments[0, :].T, increments[0, :].T)
    phi = build.stage(
        Signal.vector("phi", "phi", unit="rad", meaning="rotation vector"),
        now + sp.Rational(1, 12) * algebra.cross(last, now),
    )
    p = build.stage(EULER.transition, algebra.quaternion(phi))
    build.output(EULER.next, algebra.quaternion_product(state, p))
    return build.kernel(
        "one-and-one", "Coning from the increment before", "none", transition=EULER.transition.name,
        attitude_step=AttitudeStep("euler-product", "euler-normalize", "dcm-from-euler", (0, 0, 0, 1){step}),
        order=Order(4, 4, 2, 4){declared},
    )
"""


def drift(tmp_path, **texts: object) -> float:
    path = tmp_path / "own.py"
    path.write_text(STEP.format(**({"said": 1, "step": "", "declared": ""} | texts)))
    run = strapgen.algorithm(str(path)).simulate(duration=2)
    return float(abs(run.drift).max())


def test_previous_increments_that_are_declared_are_taken(tmp_path):
    declared = drift(tmp_path, declared=", previous=1")
    assert declared == drift(tmp_path, step=", previous=1") < 1e-6


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        ({}, "its increments say, the first 1 are those before the step, and it declares previous=0"),
        (
            {"declared": ", previous=1", "step": ", previous=2"},
            "previous is 1, and 2 in its attitude_step",
        ),
    ],
)
def test_contradicting_declaration_is_refused(texts, said, tmp_path):
    with pytest.raises(InputError, match=said):
        drift(tmp_path, **texts)
