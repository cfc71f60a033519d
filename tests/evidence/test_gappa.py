"""Gappa proves the error bounds that headers state, of no program that rounds otherwise; Coq checks its proof."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

import pytest
from derived import program, quantized

from strapgen.catalogue import Choice, choose, choose_step, standard
from strapgen.evidence import collection, gappa
from strapgen.evidence.collection import Subject
from strapgen.evidence.gappa_scripts import CannotFollowError, Script, fixed_script, floating_script
from strapgen.fixedpoint.floating.bounds import rounding_bounds
from strapgen.fixedpoint.floating.errors import NUMBERS
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import Coefficient, FixedProgram, IntegerSum, Term
from strapgen.ir.program import Program

pytestmark = pytest.mark.needs("gappa")
needs_coq = pytest.mark.needs("coqc")

EULER, PRODUCT, NORMALIZE = choose_step("euler", "rk1", 2), choose("euler-product"), choose("euler-normalize")

CLAIMS = ["one step", "one step in double", "one step in float"]


def fixed(choice: Choice, **settings: object) -> FixedProgram:
    return quantized(choice, Settings(**settings))


def judged(script: Script, folder) -> tuple[str, str]:
    file = folder / "script.g"
    file.write_text(script.question())
    return gappa.compare_bounds(script, *gappa.proved_bounds(file))


@pytest.mark.parametrize(
    "choice",
    [
        pytest.param(EULER, marks=pytest.mark.long),
        PRODUCT,
        NORMALIZE,
    ],
    ids=lambda choice: choice.name,
)
def test_error_bounds_in_fixed_point_are_proved_and_close(choice, tmp_path):
    """`strapgen evidence --all` proves those of the catalogue, and tells how far above Gappa's they are."""
    script = fixed_script(fixed(choice))
    assert judged(script, tmp_path)[0] == "proved"
    bounds = gappa.proved_bounds(tmp_path / "script.g")[0]
    assert max(script.goals.values()) <= max(bounds) * Fraction(21, 20)
    smaller = replace(script, goals={text: bound * Fraction(19, 20) for text, bound in script.goals.items()})
    assert judged(smaller, tmp_path)[0] == "fails"


@pytest.mark.long
@pytest.mark.parametrize(
    "settings",
    [{"word": 16}, {"carry": "full"}, {"rounding": "truncation"}, {"multiply": "high"}, {"multiply": "half"}],
    ids=str,
)
def test_other_words_error_feedback_and_truncation_are_followed(settings, tmp_path):
    assert judged(fixed_script(fixed(EULER, **settings)), tmp_path)[0] == "proved"


def changed(code: FixedProgram, change: Callable[[IntegerSum], IntegerSum | None]) -> FixedProgram:
    """Return a program with the first sum changed that can be."""
    body = [*code.body]
    for place, value in enumerate(body):
        if isinstance(value.definition, IntegerSum) and value.definition.shift:
            definition = change(value.definition)
            if definition is not None:
                body[place] = replace(value, definition=definition)
                return replace(code, body=tuple(body))
    raise AssertionError("nothing to change")


def with_first(definition: IntegerSum, change: Callable[[Term], Term]) -> IntegerSum:
    return replace(definition, fine=(change(definition.fine[0]), *definition.fine[1:]))


#: Ways in which printed code could differ from its proof.
FAULTS = {
    "a shift that is one longer": lambda total: replace(total, shift=total.shift + 1),
    "a shift that is one shorter": lambda total: replace(total, shift=total.shift - 1),
    "a sign": lambda total: with_first(total, lambda term: replace(term, factor=-term.factor)),
    "no constant for rounding": lambda total: replace(
        total,
        fine=(*total.fine, Term((), -(1 << (total.shift - 1)), coefficient=Coefficient(Fraction(0), 0))),
    ),
    "a term that is missing": lambda total: replace(total, fine=total.fine[1:]),
    "another factor": lambda total: with_first(total, lambda term: replace(term, names=total.fine[-1].names)),
}


@pytest.mark.long
@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("choice", [EULER, PRODUCT], ids=lambda choice: choice.name)
def test_gappa_proves_nothing_of_a_program_with_a_fault(choice, fault, tmp_path):
    result, detail = judged(fixed_script(changed(fixed(choice), FAULTS[fault])), tmp_path)
    assert (result, bool(detail)) == ("fails", True)


def test_a_rounded_coefficient_that_is_off_is_noticed(tmp_path):
    choice = choose("coning-fast")

    def change(total: IntegerSum) -> IntegerSum | None:
        if total.fine[0].coefficient is None:
            return None
        return with_first(total, lambda term: replace(term, factor=term.factor + 64))

    assert judged(fixed_script(changed(fixed(choice), change)), tmp_path)[0] == "fails"


def test_a_rule_that_is_no_identity_is_not_taken_on_trust(tmp_path):
    script = fixed_script(fixed(PRODUCT))
    goal = next(iter(script.goals))
    script.rules.append(f"{goal} -> 0;")
    result, detail = judged(script, tmp_path)
    assert result == "fails"
    assert "not trivially equal" in detail


def test_a_kernel_that_compares_or_calls_a_function_is_not_examined(tmp_path):
    for name, reason in (("euler-from-dcm", "maximum"), ("dcm-from-euler-angles", "cos")):
        verdict = gappa.check(Subject(choose(name)), tmp_path)[0]
        assert verdict.result == "not examined"
        assert reason in verdict.detail


def test_a_state_that_saturates_is_a_branch():
    with pytest.raises(CannotFollowError, match="saturates"):
        fixed_script(fixed(EULER, state="q31"))


def test_the_script_in_the_folder_says_how_it_is_run(tmp_path):
    verdicts = gappa.check(Subject(PRODUCT), tmp_path)
    assert [verdict.claim.removeprefix("error bound: ") for verdict in verdicts] == CLAIMS
    assert {(verdict.kernel, verdict.result) for verdict in verdicts} == {("euler_product_w32", "proved")}
    text = (tmp_path / "one_step.g").read_text()
    assert text.startswith("# Run: gappa -Eprecision=256 one_step.g\n")
    assert all(f"c_{name}" in text for signal in program(PRODUCT).inputs for name in signal.elements)


def test_a_missing_gappa_is_a_verdict(monkeypatch, tmp_path):
    monkeypatch.setattr(shutil, "which", lambda _: None)
    verdicts = gappa.check(Subject(PRODUCT), tmp_path)
    assert {(verdict.result, verdict.detail) for verdict in verdicts} == {("not installed", "install gappa")}


def script_of(code: Program, number: str) -> Script:
    return floating_script(code, rounding_bounds(code, number))


@pytest.mark.long
@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize(
    "choice",
    [EULER, choose("dcm-from-euler")],
    ids=lambda choice: str(choice.method or choice.name),
)
def test_error_bounds_in_floating_point_are_proved_and_close(choice: Choice, number, tmp_path):
    text = script_of(program(choice), number)
    assert judged(text, tmp_path)[0] == "proved"
    smaller = replace(text, goals={goal: bound * Fraction(19, 20) for goal, bound in text.goals.items()})
    assert judged(smaller, tmp_path)[0] == "fails"


@pytest.mark.long
def test_a_bound_of_double_does_not_hold_in_float(tmp_path):
    code = program(choose("euler-product"))
    text = replace(script_of(code, "float"), goals=script_of(code, "double").goals)
    assert judged(text, tmp_path)[0] == "fails"


def test_a_wrong_literal_is_noticed(tmp_path):
    off = script_of(program(choose("coning-fast")), "float")
    place = next(k for k, line in enumerate(off.definitions) if re.fullmatch(r"c_\d+ = \d{8}b-\d+;", line))
    off.definitions[place] = re.sub(r"\d{8}", lambda digits: str(int(digits[0]) + 64), off.definitions[place])
    assert judged(off, tmp_path)[0] == "fails"


@pytest.mark.parametrize("name", ["euler-normalize", "euler-from-dcm", "dcm-from-euler-angles"])
def test_conditions_comparisons_and_functions_are_reported(name):
    with pytest.raises(CannotFollowError, match=r"condition|comparison|cos"):
        script_of(program(choose(name)), "double")


@pytest.fixture
def product_script() -> Script:
    return fixed_script(fixed(PRODUCT))


@pytest.mark.long
@needs_coq
def test_coq_proves_a_product_from_the_axioms_of_real_numbers(monkeypatch, tmp_path):
    """`strapgen evidence --all` has the step of fourth order proved in the same way, which takes a while."""
    assert collection.REFERENCE_STEP in {choice.kernel for choice in standard()}
    monkeypatch.setattr(collection, "REFERENCE_STEP", "euler-product")
    (verdict,) = gappa.check_by_coq(Subject(PRODUCT), tmp_path)
    assert verdict.claim == "error bound: one step"
    assert (verdict.result, verdict.detail) == (
        "proved",
        "Gappa's proof and the 8 identities in it; axioms of the real numbers alone",
    )
    text = (tmp_path / "one_step.v").read_text()
    assert "Hypothesis" not in text
    assert text.startswith("(* Run: coqc one_step.v *)")


@pytest.mark.long
@needs_coq
def test_coq_refuses_a_rule_that_is_no_identity(product_script, tmp_path):
    product_script.rules += [f"{goal} -> 0;" for goal in product_script.goals]
    result, detail = gappa.checked(product_script, tmp_path / "product.v")
    assert result == "fails"
    assert "field" in detail


@pytest.mark.long
@needs_coq
def test_coq_refuses_a_smaller_bound(product_script, tmp_path):
    goal, bound = next(iter(product_script.goals.items()))
    product_script.goals = {goal: bound / 2}
    assert gappa.checked(product_script, tmp_path / "product.v") == ("fails", "Gappa finds no proof")


def test_axioms_beyond_real_numbers_are_reported():
    text, count = gappa.without_hypotheses("Hypothesis a1 : r1 = r2.\nVariable x : R.\n")
    assert (count, "Hypothesis" in text) == (1, False)
    real = "ClassicalDedekindReals.sig_not_dec : forall P : Prop, {~ ~ P} + {~ P}"
    assert gappa.extra_axioms(f"Axioms:\n{real}\na7 : (r1 = r2)%R\nClassical_Prop.classic\n") == ["a7"]
    assert gappa.extra_axioms(f"Axioms:\n{real}\n") == []
    assert gappa.extra_axioms("")


@pytest.mark.parametrize("subject", [Subject(PRODUCT), Subject(choose_step("dcm", "rk4", 2))])
def test_coq_examines_no_other_kernel(subject, tmp_path):
    assert gappa.check_by_coq(subject, tmp_path) == []


@pytest.mark.posix
def test_where_processor_time_has_no_limit_a_proof_is_given_up_too(tmp_path, monkeypatch):
    program = tmp_path / "gappa"
    program.write_text("#!/bin/sh\nexec sleep 60\n", encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setattr(gappa, "resource", None)
    monkeypatch.setattr(gappa, "SECONDS", 0.2)
    assert gappa.proved_bounds(tmp_path / "script.g") == ([], "no answer in 0.2 s")
