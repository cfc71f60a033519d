"""Processors return the integers of the model; a fault in the C, or in what a processor reports, is seen."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace

import pytest

from strapgen.catalogue import choose
from strapgen.evidence import same_bits
from strapgen.evidence.motion_rows import motion_rows
from strapgen.evidence.same_bits import Part, of_model, parts_of
from strapgen.evidence.subjects import Subject
from strapgen.ir.fixed_settings import Settings
from strapgen.lab.processors import RUNNERS, Runner
from strapgen.lab.runner_c import MOST, NEEDED, CallRun

#: The machine itself: a program that runs its argument stands for an emulator.
HOST = Runner("host", ("cc",), ("env",), "cc", "gcc")


def on(monkeypatch: pytest.MonkeyPatch, *runners: Runner) -> None:
    """Run on these processors alone; skip the test where a program is missing."""
    for runner in runners:
        for command in runner.commands:
            if shutil.which(command) is None:
                pytest.skip(f"{command} is not on this machine")
    monkeypatch.setattr(same_bits, "RUNNERS", {runner.name: runner for runner in runners})


def with_fault(subject: Subject, pattern: str, change: str) -> Subject:
    """Return a kernel whose C has a fault: the first match of a pattern is changed."""
    name = f"{subject.name}.c"
    text, count = re.subn(pattern, change, subject.sources.files[name], count=1)
    assert count
    changed = Subject(subject.choice, subject.settings)
    vars(changed)["sources"] = replace(subject.sources, files=subject.sources.files | {name: text})
    return changed


@pytest.mark.long
def test_a_processor_returns_the_integers_of_the_model(monkeypatch, tmp_path):
    """Its int has 16 bits; `strapgen evidence --all` runs every kernel on every processor."""
    name = "avr"
    on(monkeypatch, RUNNERS[name])
    (verdict,) = same_bits.same_bits(Subject(choose("euler-product")), tmp_path)
    assert (verdict.claim, verdict.result) == (f"same bits: {name}", "agrees"), verdict.detail
    assert verdict.detail == "1000 calls of coning and 1000 of random input"
    assert verdict.version


@pytest.mark.long
@pytest.mark.parametrize(
    ("kernel", "settings"),
    [
        ("euler", Settings(carry="full")),
        ("dcm", Settings(word=16, carry="state", rounding="truncation")),
        ("euler", Settings.of(sample_hz=100, lsb="0.0175dps")),
        ("euler", Settings(state="q31")),
    ],
)
def test_every_kind_of_argument_is_run(kernel, settings, monkeypatch, tmp_path):
    """Error feedback, short words, counts of a gyro, a state that saturates; `strapgen evidence --all` has the rest."""
    on(monkeypatch, HOST)
    (verdict,) = same_bits.same_bits(Subject(choose(kernel), settings), tmp_path)
    assert verdict.result == "agrees", verdict.detail


@pytest.mark.parametrize(
    ("kernel", "old", "new", "said"),
    [
        (
            "euler",
            r"INT32_C\(1\) << 28\), 29\)",
            "INT32_C(1) << 28), 28)",
            "^coning: 1000 calls, 1000 accepted",
        ),
        # The numbers that are drawn are inside the ranges: a check that refuses one of them shows.
        ("euler-product", "1140850688", "1140850687", "^random: "),
        ("euler-product", "return 0;", "return nothing;", "cc failed: .*error"),
    ],
    ids=["shift", "range", "syntax"],
)
def test_a_fault_is_seen(kernel, old, new, said, monkeypatch, tmp_path):
    on(monkeypatch, HOST)
    (verdict,) = same_bits.same_bits(with_fault(Subject(choose(kernel)), old, new), tmp_path)
    assert verdict.result == "fails"
    assert re.search(said, verdict.detail, re.DOTALL)


def test_a_processor_without_an_emulator_is_not_installed(monkeypatch, tmp_path):
    monkeypatch.setattr(same_bits, "RUNNERS", {"host": replace(HOST, emulator=("no-such-emulator",))})
    (verdict,) = same_bits.same_bits(Subject(choose("euler-product")), tmp_path)
    assert (verdict.result, verdict.detail) == ("not installed", "install gcc")


def test_words_of_64_bits_have_no_claim(tmp_path):
    assert same_bits.same_bits(Subject(choose("euler-product"), Settings(word=64)), tmp_path) == []


@pytest.mark.long
def test_a_program_can_be_run_again_by_hand(monkeypatch, tmp_path):
    on(monkeypatch, HOST)
    subject = Subject(choose("euler-product"))
    same_bits.same_bits(subject, tmp_path)
    folder = tmp_path / "processors" / "host"
    said = subprocess.run(["sh", "run.sh"], cwd=folder, capture_output=True, text=True, check=True).stdout
    assert [part.name for part in parts_of(said)] == ["coning", "random"]
    for name, text in subject.sources.step_files.items():
        assert (tmp_path / "processors" / name).read_text() == text


def test_a_run_that_accepts_too_little_fails(monkeypatch, tmp_path):
    on(monkeypatch, HOST)
    expected = [Part("coning", MOST, NEEDED - 1, 0)]
    monkeypatch.setattr(same_bits, "of_model", lambda *_: expected)
    (verdict,) = same_bits.same_bits(Subject(choose("euler-product")), tmp_path)
    assert verdict.detail == f"coning: {NEEDED - 1} of {MOST} calls are accepted"


def test_the_motion_fills_the_ranges_and_its_attitudes_are_proper():
    fixed = Subject(choose("dcm")).sources.fixed
    rows = motion_rows(fixed, 50)
    assert all(
        argument.low <= value <= argument.high
        for row in rows
        for argument, value in zip([a for a in fixed.inputs for _ in range(a.signal.size)], row, strict=True)
    )
    largest = max(abs(value) for row in rows for value in row[9:])
    assert largest == pytest.approx(0.9 * fixed.inputs[1].high)
    unit = float(fixed.inputs[0].unit)
    for row in rows:
        # Rounded to the format, each of nine elements by at most half a unit.
        assert sum(value**2 for value in row[:9]) * unit**2 == pytest.approx(3, abs=9 * 2 * unit)


def test_the_random_part_reaches_both_ends_of_every_range():
    subject = Subject(choose("euler-product"))
    run = CallRun(subject.sources, motion_rows(subject.sources.fixed, 250))
    seen = []

    class Noted(same_bits._ModelRun):
        def call(self, elements, feedback):
            seen.append(tuple(elements))
            return super().call(elements, feedback)

    model = same_bits.ModelEvaluator(same_bits.pipeline.compile(subject.choice, same_bits.MODEL, None))
    same_bits._random(Noted(subject, run, model))
    for place, (low, high) in enumerate(run.limits):
        values = {elements[place] for elements in seen}
        assert {low, high} <= values
        assert len(values) > NEEDED // 2


def test_the_parts_of_a_run_are_coning_and_random_input():
    subject = Subject(choose("euler-product"))
    run = CallRun(subject.sources, motion_rows(subject.sources.fixed, 250))
    parts = [*of_model(subject, run)]
    assert [part.name for part in parts] == ["coning", "random"]
    assert all(part.accepted == NEEDED for part in parts)
