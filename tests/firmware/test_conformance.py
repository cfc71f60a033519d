"""Standard behaviour: our own algorithms have it, and every fault that a user may make is found and named."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from strapgen import catalogue
from strapgen.catalogue import choose
from strapgen.catalogue.methods.coning_coefficients import FORMS, design
from strapgen.firmware.check_code import conformance
from strapgen.firmware.check_code import coning_causes as causes
from strapgen.firmware.check_code.check_foreign import finding_text
from strapgen.firmware.check_code.foreign import Convention, rotation_vectors
from strapgen.firmware.check_code.probes import Products, pairs
from strapgen.firmware.check_code.rotation import IN_PLACE, explanation
from strapgen.ir.exceptions import InputError

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "modified_rodrigues.py"


def findings(choice: catalogue.Choice) -> dict[str, conformance.Finding]:
    return {finding.name: finding for finding in conformance.findings(choice)}


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
from strapgen.catalogue.methods.method import increments_signal
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
        conformance.check(choose("euler", rates=True))


DESIGNS = [
    (samples, previous, form)
    for samples, previous in ((1, 1), (1, 2), (1, 3), (2, 0), (2, 1), (3, 0), (4, 0), (4, 1), (5, 0))
    for form in FORMS
]


def tables(samples: int, previous: int, form: str, factor: float = 1.0, delay: int = 0) -> Products:
    """Return the coefficients of a design times a factor, its calls corrected `delay` samples late."""
    at_once, finally_ = (dict.fromkeys(pairs(samples), 0.0) for _ in range(2))
    for (older, newer), c in design(samples, previous, form).pairs.items():
        i, j = older - previous - delay, newer - previous - delay
        if (i, j) in at_once:
            at_once[i, j] += factor * float(c)
        # What one call leaves to a later one counts for the pair as it stands in its own call.
        calls = 0 if j >= 0 else -(j // samples)
        if (pair := (i + calls * samples, j + calls * samples)) in finally_:
            finally_[pair] += factor * float(c)
    return Products(samples, at_once, finally_)


def one_by_one(samples: int, factor: float, distance: int = 1) -> Products:
    """Return the coefficients of a function that turns by each sample, corrected with one from before it."""
    table = {
        (i, j): (0.5 if i >= 0 else 0.0) + (factor / 12 if j - i == distance else 0.0)
        for i, j in pairs(samples)
    }
    return Products(samples, table, table)


@pytest.mark.long
@pytest.mark.parametrize("chosen", DESIGNS)
def test_a_published_correction_has_no_fault(chosen):
    assert causes.cause(tables(*chosen)) is None
    standard = causes.standard_design(tables(*chosen))
    assert (standard.increments, standard.previous) == chosen[:2]


@pytest.mark.parametrize(
    ("factor", "cause"),
    [(0, causes.ABSENT), (-1, causes.WRONG_SIGN), (2, causes.FACTOR_TWO), (0.5, causes.FACTOR_TWO)],
)
def test_a_factor_is_named_on_every_published_correction(factor, cause):
    named = {chosen: causes.cause(tables(*chosen, factor)) for chosen in DESIGNS}
    assert set(named.values()) == {cause}, named


def test_one_sample_of_delay_is_named():
    late = {
        chosen: causes.cause(tables(*chosen, delay=1))
        for chosen in DESIGNS
        if chosen[1] == 0 or chosen[0] == 1
    }
    assert set(late.values()) == {causes.LATE}, late
    assert causes.cause(one_by_one(1, 1, distance=2)) == causes.LATE


def test_a_correction_from_three_kept_samples_is_known_when_its_older_sample_is_late():
    # It reads samples 1 to 4 before the call; no other correction has these coefficients, and its size is no multiple.
    for form in FORMS:
        table = dict.fromkeys(pairs(1), 0.0)
        for (older, newer), c in design(1, 3, form).pairs.items():
            if newer == 3:
                table[older - 4, 0] = float(c)
        assert set(table) == {*pairs(1)}  # a probe looks at all of them
        assert causes.cause(Products(1, table, table)) == causes.LATE


def test_coefficients_of_three_kept_samples_are_wanted_where_they_are_seen():
    for form in FORMS:
        for factor in (1, -1, 0.7):
            seen = tables(1, 3, form, factor)
            right = tables(1, 3, form)
            assert causes.wanted(seen) == pytest.approx(right.at_once), (form, factor)
            assert causes.standard_design(right).previous == 3


def test_ratio_is_that_of_the_coning_condition():
    for chosen in DESIGNS:
        assert causes.ratio(tables(*chosen)) == pytest.approx(1, abs=1e-12)
        assert causes.ratio(tables(*chosen, 0.96)) == pytest.approx(0.96, abs=1e-12)
        assert causes.corrects_coning(tables(*chosen, 0.996))
        assert not causes.corrects_coning(tables(*chosen, 0.994))


def test_wrong_correction_about_one_axis_is_quantified():
    right, wrong = (tables(1, 1, "compressed", factor).finally_ for factor in (1, -1))
    mean = {pair: c / 3 for pair, c in right.items()}
    products = Products(1, mean, mean, by_axis=(right, wrong, right))
    assert causes.cause(products) == "the corrections about x, y, z differ: 1, -1, 1 of what is needed"
    assert not causes.corrects_coning(Products(1, right, right, by_axis=(right, wrong, right)))


def test_faults_that_make_up_a_known_size_are_no_known_fault():
    # The moment is twice that of a right correction, but no coefficient is.
    table = {pair: 0.0 for pair in pairs(1)} | {(-1, 0): -1 / 12, (-3, 0): 1 / 12}
    assert causes.ratio(Products(1, table, table)) == pytest.approx(2)
    said = causes.cause(Products(1, table, table))
    assert said == "coefficients of no single fault that is known, 2 of what coning needs"


@pytest.mark.parametrize("samples", [1, 2, 4])
def test_samples_that_are_turned_one_by_one_are_known(samples):
    assert causes.cause(one_by_one(samples, 1)) is None
    assert causes.wanted(one_by_one(samples, -1)) == pytest.approx(one_by_one(samples, 1).at_once)
    standard = causes.standard_design(one_by_one(samples, 1))
    assert (standard.increments, standard.previous) == (1, 1)
    named = {factor: causes.cause(one_by_one(samples, factor)) for factor in (0, -1, 2, 0.5)}
    wanted = [causes.ABSENT, causes.WRONG_SIGN, causes.FACTOR_TWO, causes.FACTOR_TWO]
    assert list(named.values()) == wanted
    assert causes.cause(one_by_one(samples, 1, distance=2)) == causes.LATE


@pytest.mark.parametrize("samples", [2, 3, 4])
def test_samples_in_reverse_order_are_known(samples):
    # The recursion by hand: sample k of a call is its sample N - 1 - k, and the one before the first the last call's 0.
    known = dict.fromkeys(pairs(samples), 0.0)
    absent = known | {(i, j): -0.5 for i, j in known if i >= 0}
    assert causes.cause(Products(samples, absent, absent)) == f"{causes.REVERSED}; {causes.ABSENT}"
    table = (
        absent | {(k, k + 1): -0.5 - 1 / 12 for k in range(samples - 1)} | {(-samples, samples - 1): 1 / 12}
    )
    assert causes.cause(Products(samples, table, table)) == causes.REVERSED


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("samples", "used", "kept"), [(1, 2, 2), (1, 3, 3), (1, 2, 3), (1, 1, 3), (2, 2, 2), (2, 3, 3)]
)
def test_earlier_samples_in_reverse_order_are_known(samples, used, kept, form):
    """With those of 4 before: what stands at -1 belongs to the oldest one that is kept, and the reverse."""
    right = tables(samples, used, form)
    at_once = dict(right.at_once)
    for place in range(1, kept + 1):
        for newer in range(samples):
            at_once[-place, newer] = right.at_once[place - kept - 1, newer]
    seen = Products(samples, at_once, at_once)
    assert causes.cause(right) is None
    assert causes.cause(tables(4, 1, form, 0.993)) != causes.EARLIER_REVERSED, (
        "its earlier samples hardly count"
    )
    assert causes.cause(seen) == (None if at_once == right.at_once else causes.EARLIER_REVERSED)


def test_wrong_size_is_quantified():
    table = {(0, 1): 0.6} | {pair: 0.0 for pair in pairs(2) if pair != (0, 1)}
    assert causes.cause(Products(2, table, table)) == "correction 0.9 times as large as needed"


def test_samples_of_which_one_counts_more_are_told():
    plain = tables(2, 0, "compressed")
    assert causes.cause(Products(2, plain.at_once, plain.finally_, (1.0, 1.0))) is None
    said = causes.cause(Products(2, plain.at_once, plain.finally_, (3.0, -1.0)))
    assert said == "samples weighted by 3, -1 in place of 1"


@pytest.mark.parametrize("error", [0.00002, -0.00002])
def test_the_error_of_a_probe_changes_no_name(error):
    for factor, cause in ((1, None), (0, causes.ABSENT), (-1, causes.WRONG_SIGN), (2, causes.FACTOR_TWO)):
        exact = tables(1, 1, "compressed", factor)
        off = {pair: c + error for pair, c in exact.at_once.items()}
        assert causes.cause(Products(1, off, off)) == cause


@pytest.mark.parametrize(("downwards", "elements"), [(False, "elements 0, 1, 2"), (True, "elements 1, 2, 3")])
def test_an_update_in_place_is_explained_in_either_order(downwards, elements):
    # The product of quaternions, scalar first, element by element into the state that is read.
    convention = Convention("first")
    states = np.array([[0.5, 0.5, -0.5, 0.5], [0.1, -0.7, 0.5, 0.5], [0.8, 0.36, 0.48, 0.0]])
    states = np.repeat(states / np.linalg.norm(states, axis=1, keepdims=True), 3, axis=0)
    vectors = np.tile(0.02 * np.array([[1.0, 0, 0], [0, 1, 0.5], [0.3, 0, 1]]), (3, 1))
    after = states.copy()
    half = vectors / 2
    signs = [(0, ((1, 0, -1), (2, 1, -1), (3, 2, -1))), (1, ((0, 0, 1), (2, 2, 1), (3, 1, -1))),
             (2, ((0, 1, 1), (1, 2, -1), (3, 0, 1))), (3, ((0, 2, 1), (1, 1, 1), (2, 0, -1)))]  # fmt: skip
    for k, terms in signs[:: -1 if downwards else 1]:
        sine, cosine = np.sinc(np.linalg.norm(half, axis=1) / np.pi), np.cos(np.linalg.norm(half, axis=1))
        after[:, k] = cosine * after[:, k] + sum(
            s * after[:, j] * half[:, axis] * sine for j, axis, s in terms
        )
    turned = np.swapaxes(convention.matrices(states), 1, 2) @ convention.matrices(after)
    said = explanation(convention, states, vectors, rotation_vectors(turned) - vectors)
    assert said is not None and said.startswith(f"{elements} {IN_PLACE.split(' that of')[0]}")
