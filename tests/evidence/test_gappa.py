"""Gappa proves the error bounds that headers state, and proves them of no program that rounds otherwise."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

import pytest
from derived import program, quantized

from strapgen.catalogue import Choice, choose, choose_step
from strapgen.evidence import gappa
from strapgen.evidence.gappa_fixed import fixed_script
from strapgen.evidence.gappa_scripts import CannotFollowError, Script
from strapgen.evidence.subjects import Subject
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import Coefficient, FixedProgram, IntegerSum, Term

pytestmark = pytest.mark.skipif(not gappa.TOOL.installed(), reason="gappa is not installed")

EULER, PRODUCT, NORMALIZE = choose_step("euler", "rk1", 2), choose("euler-product"), choose("euler-normalize")

CLAIMS = ["one step", "one step in double", "one step in float"]


def fixed(choice: Choice, **settings: object) -> FixedProgram:
    return quantized(choice, Settings(**settings))


def judged(script: Script, folder) -> tuple[str, str]:
    file = folder / "script.g"
    file.write_text(script.question())
    return gappa.judged(script, gappa.answered(file))


@pytest.mark.parametrize(
    "choice",
    [
        pytest.param(EULER, marks=pytest.mark.long),
        PRODUCT,
        NORMALIZE,
    ],
    ids=lambda choice: choice.name,
)
def test_the_error_bound_of_the_header_is_proved_and_is_as_small_as_gappas(choice, tmp_path):
    """`strapgen evidence --all` proves those of the catalogue, and tells how far above Gappa's they are."""
    script = fixed_script(fixed(choice))
    assert judged(script, tmp_path)[0] == "proved"
    bounds = gappa.answered(tmp_path / "script.g").bounds
    assert max(script.goals.values()) <= max(bounds) * Fraction(21, 20)
    smaller = replace(script, goals={text: bound * Fraction(19, 20) for text, bound in script.goals.items()})
    assert judged(smaller, tmp_path)[0] == "fails"


@pytest.mark.long
@pytest.mark.parametrize("settings", [{"word": 16}, {"carry": "full"}, {"rounding": "truncation"}], ids=str)
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
