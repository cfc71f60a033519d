"""Standard behaviour: our own algorithms have it, and every fault that a user may make is found and named."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from strapgen import catalogue
from strapgen.catalogue import choose
from strapgen.firmware.check_code import conformance
from strapgen.firmware.check_code.check_foreign import finding_text
from strapgen.ir.exceptions import InputError

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "modified_rodrigues.py"


def findings(choice: catalogue.Choice) -> dict[str, conformance.Finding]:
    return {finding.name: finding for finding in conformance.check(choice)}


@pytest.mark.parametrize(
    ("method", "increments", "previous"),
    [
        ("rk4", 2, 0),
        pytest.param("magnus4", 2, 0, marks=pytest.mark.long),
        pytest.param("munthe-kaas4", 1, 2, marks=pytest.mark.long),
        pytest.param("dormand-prince5", 3, 1, marks=pytest.mark.long),
    ],
)
@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
def test_our_own_algorithms_hold(algorithm, method, increments, previous):
    found = findings(choose(algorithm, method, increments, previous=previous))
    assert [finding for finding in found.values() if finding.holds is False] == []
    for name in (
        "at rest",
        "order",
        "direction",
        "no preferred axis",
        "back end numpy",
        "back end c",
        "loop c",
    ):
        assert found[name].holds is True
    json.dumps([finding.as_dict() for finding in found.values()])


@pytest.mark.parametrize(
    ("method", "increments"), [("rk4", 2), pytest.param("butcher6", 4, marks=pytest.mark.long)]
)
def test_the_example_holds(method, increments):
    found = findings(choose(str(EXAMPLE), method, increments))
    assert [finding for finding in found.values() if finding.holds is False] == []
    assert found["orthonormalization"].text == "there is none"
    assert found["drift"].measured < 1e-5  # through five whole turns: the set is switched on the way


STEP = """
import sympy as sp
from strapgen import algebra
from strapgen.catalogue.kinematics import EULER
from strapgen.catalogue.methods.samples import increments_signal
from strapgen.ir.kernel_info import AttitudeStep
from strapgen.kernel.kernel import KernelBuilder
from strapgen.ir.kernel_info import Order

def algorithm():
    build = KernelBuilder()
    state = build.input(EULER.state)
    increments = build.input(increments_signal(2))
    first, second = increments[0, :].T, increments[1, :].T
    phi = {phi}
    p = build.stage(EULER.transition, {transition})
    build.output(EULER.next, algebra.quaternion_product(state, p))
    return build.kernel("two-sample", "Two-sample algorithm", "a test", transition="transition", order={order},
        attitude_step=AttitudeStep("euler-product", "euler-normalize", "dcm-from-euler", {identity}))
"""
RIGHT = {
    "phi": "first + second + sp.Rational(2, 3) * algebra.cross(first, second)",
    "transition": "algebra.quaternion(phi)",
    "order": "Order(4, 4, 2, 4)",
    "identity": "(0, 0, 0, 1)",
}


@pytest.mark.parametrize(
    ("fault", "fails", "says"),
    [
        pytest.param({}, [], "", marks=pytest.mark.long),
        pytest.param({"order": "None"}, [], "", marks=pytest.mark.long),
        (
            {"phi": "first + second - sp.Rational(2, 3) * algebra.cross(first, second)"},
            ["order"],
            "observed 2",
        ),
        pytest.param({"phi": "first + second"}, ["order"], "observed 2", marks=pytest.mark.long),
        (
            {"transition": "algebra.quaternion(-phi)"},
            ["direction", "order"],
            "a sign, or a transposed matrix",
        ),
        pytest.param(
            {"phi": "2 * (first + second)"},
            ["direction", "order"],
            "wrong in size or axis",
            marks=pytest.mark.long,
        ),
        (
            {"phi": "first + second + sp.Rational(2, 3) * sp.Matrix([first[1] * second[2], 0, 0])"},
            ["no preferred axis", "order"],
            "does not turn with them",
        ),
        pytest.param(
            {"transition": "algebra.quaternion(phi + sp.Matrix([0, 0, sp.Rational(1, 10**6)]))"},
            ["at rest", "no preferred axis"],
            "without rotation the state moves",
            marks=pytest.mark.long,
        ),
        pytest.param(
            {"identity": "(0, 0, 1, 0)"}, ["no rotation"], "not the unit matrix", marks=pytest.mark.long
        ),
    ],
)
def test_a_fault_is_found(fault, fails, says, tmp_path, monkeypatch):
    if fails:  # back ends compute what is derived, be it right or wrong
        monkeypatch.setattr(conformance, "_back_ends", lambda *_: [])
    path = tmp_path / "two_sample.py"
    path.write_text(STEP.format(**(RIGHT | fault)))
    found = findings(choose(str(path)))
    failed = [finding for finding in found.values() if finding.holds is False]
    assert set(fails) <= {finding.name for finding in failed}
    if not fails:
        assert failed == []
    assert any(says in finding.text for finding in failed) or not says
    assert any("FAILS" in finding_text(finding) for finding in found.values()) == bool(fails)


def test_a_step_from_rates_is_refused():
    with pytest.raises(InputError, match="takes no increments"):
        list(conformance.check(choose("euler", rates=True)))
