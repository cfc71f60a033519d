"""Coq checks Gappa's proof of an error bound, its identities included."""

from __future__ import annotations

import pytest
from derived import quantized

from strapgen.catalogue import choose, choose_step, standard
from strapgen.evidence import coq_proof
from strapgen.evidence.gappa_fixed import fixed_script
from strapgen.evidence.gappa_scripts import Script
from strapgen.evidence.subjects import Subject
from strapgen.ir.fixed_settings import Settings

pytestmark = pytest.mark.skipif(not coq_proof.TOOL.installed(), reason="coqc or gappa is not installed")


def script(name: str = "euler-product") -> Script:
    return fixed_script(quantized(choose(name), Settings()))


@pytest.mark.long
def test_a_product_of_quaternions_is_proved_from_the_axioms_of_real_numbers(monkeypatch, tmp_path):
    """`strapgen evidence --all` has the step of fourth order proved in the same way, which takes a while."""
    assert coq_proof.STEP in {choice.kernel for choice in standard()}
    monkeypatch.setattr(coq_proof, "STEP", "euler-product")
    (verdict,) = coq_proof.check(Subject(choose("euler-product")), tmp_path)
    assert verdict.claim == "error bound: one step"
    assert (verdict.result, verdict.detail) == (
        "proved",
        "Gappa's proof and the 8 identities in it; axioms of the real numbers alone",
    )
    text = (tmp_path / "one_step.v").read_text()
    assert "Hypothesis" not in text
    assert text.startswith("(* Run: coqc one_step.v *)")


@pytest.mark.long
def test_a_rule_that_is_no_identity_has_no_proof(tmp_path):
    off = script()
    off.rules += [f"{goal} -> 0;" for goal in off.goals]
    result, detail = coq_proof.checked(off, tmp_path / "product.v")
    assert result == "fails"
    assert "field" in detail


@pytest.mark.long
def test_a_smaller_bound_has_no_proof(tmp_path):
    off = script()
    goal, bound = next(iter(off.goals.items()))
    off.goals = {goal: bound / 2}
    assert coq_proof.checked(off, tmp_path / "product.v") == ("fails", "Gappa finds no proof")


def test_a_hypothesis_that_is_left_is_told():
    text, count = coq_proof.without_hypotheses("Hypothesis a1 : r1 = r2.\nVariable x : R.\n")
    assert (count, "Hypothesis" in text) == (1, False)
    real = "ClassicalDedekindReals.sig_not_dec : forall P : Prop, {~ ~ P} + {~ P}"
    assert coq_proof.strange_axioms(f"Axioms:\n{real}\na7 : (r1 = r2)%R\nClassical_Prop.classic\n") == ["a7"]
    assert coq_proof.strange_axioms(f"Axioms:\n{real}\n") == []
    assert coq_proof.strange_axioms("")


@pytest.mark.parametrize("subject", [Subject(choose("euler-product")), Subject(choose_step("dcm", "rk4", 2))])
def test_other_kernels_have_no_claim(subject, tmp_path):
    assert coq_proof.check(subject, tmp_path) == []
