"""Processors return the integers of the model; a fault in the C, or in what a processor reports, is seen."""

from __future__ import annotations

import importlib.util
import math
import re
import shutil
import subprocess
from dataclasses import replace

import pytest

from strapgen.catalogue import choose
from strapgen.evidence import processor_runs
from strapgen.evidence.collection import Subject
from strapgen.evidence.processor_runs import Part, model_parts, motion_rows, read_parts
from strapgen.ir.fixed_settings import Settings
from strapgen.lab.processors import RUNNERS, Runner
from strapgen.lab.runner_c import MOST, NEEDED, CallRun

pytest.importorskip("flint")

#: The machine itself: a program that runs its argument stands for an emulator.
HOST = Runner("host", ("cc",), ("env",), "cc", "gcc")


def on(monkeypatch: pytest.MonkeyPatch, *runners: Runner) -> None:
    """Run on these processors alone; skip the test where a program is missing."""
    for runner in runners:
        for command in runner.commands:
            if shutil.which(command) is None:
                pytest.skip(f"{command} is not on this machine")
    monkeypatch.setattr(processor_runs, "RUNNERS", {runner.name: runner for runner in runners})


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
    (verdict,) = processor_runs.same_bits(Subject(choose("euler-product")), tmp_path)
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
        ("euler", Settings(multiply="high")),
        ("euler", Settings(multiply="half")),
    ],
)
def test_every_kind_of_argument_is_run(kernel, settings, monkeypatch, tmp_path):
    """Error feedback, short words, counts of a gyro, a state that saturates; `strapgen evidence --all` has the rest."""
    on(monkeypatch, HOST)
    (verdict,) = processor_runs.same_bits(Subject(choose(kernel), settings), tmp_path)
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
    (verdict,) = processor_runs.same_bits(with_fault(Subject(choose(kernel)), old, new), tmp_path)
    assert verdict.result == "fails"
    assert re.search(said, verdict.detail, re.DOTALL)


def test_a_processor_without_an_emulator_is_not_installed(monkeypatch, tmp_path):
    monkeypatch.setattr(processor_runs, "RUNNERS", {"host": replace(HOST, emulator=("no-such-emulator",))})
    (verdict,) = processor_runs.same_bits(Subject(choose("euler-product")), tmp_path)
    assert (verdict.result, verdict.detail) == ("not installed", "install gcc")


def test_words_of_64_bits_have_no_claim(tmp_path):
    assert processor_runs.same_bits(Subject(choose("euler-product"), Settings(word=64)), tmp_path) == []


@pytest.mark.long
def test_a_program_can_be_run_again_by_hand(monkeypatch, tmp_path):
    on(monkeypatch, HOST)
    subject = Subject(choose("euler-product"))
    processor_runs.same_bits(subject, tmp_path)
    folder = tmp_path / "processors" / "host"
    said = subprocess.run(["sh", "run.sh"], cwd=folder, capture_output=True, text=True, check=True).stdout
    assert [part.name for part in read_parts(said)] == ["coning", "random"]
    for name, text in subject.sources.step_files.items():
        assert (tmp_path / "processors" / name).read_text() == text


def test_a_run_that_accepts_too_little_fails(monkeypatch, tmp_path):
    on(monkeypatch, HOST)
    expected = [Part("coning", MOST, NEEDED - 1, 0)]
    monkeypatch.setattr(processor_runs, "model_parts", lambda *_: expected)
    (verdict,) = processor_runs.same_bits(Subject(choose("euler-product")), tmp_path)
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

    class Noted(processor_runs._ModelRun):
        def call(self, elements, feedback):
            seen.append(tuple(elements))
            return super().call(elements, feedback)

    model = processor_runs.ModelEvaluator(
        processor_runs.pipeline.compile(subject.choice, processor_runs.MODEL, None)
    )
    processor_runs._random(Noted(subject, run, model))
    for place, (low, high) in enumerate(run.limits):
        values = {elements[place] for elements in seen}
        assert {low, high} <= values
        assert len(values) > NEEDED // 2


def test_the_parts_of_a_run_are_coning_and_random_input():
    subject = Subject(choose("euler-product"))
    run = CallRun(subject.sources, motion_rows(subject.sources.fixed, 250))
    parts = [*model_parts(subject, run)]
    assert [part.name for part in parts] == ["coning", "random"]
    assert all(part.accepted == NEEDED for part in parts)


@pytest.fixture
def short(monkeypatch):
    """Let a run be short, and on the machine itself."""
    monkeypatch.setattr(processor_runs, "PASS_STEPS", 101)
    monkeypatch.setattr(processor_runs, "PASSES", 3)
    monkeypatch.setattr(processor_runs, "RUNNERS", {processor_runs.PROCESSOR: HOST})


@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_a_state_is_as_far_from_the_exact_one_as_fractions_say(algorithm):
    """Fractions, step by step, are the reference."""
    subject = Subject(choose(algorithm), processor_runs.SETTINGS)
    run = processor_runs.noisy_run(subject, 3, 1)
    state, samples = subject.sources.fixed.inputs
    names = [name for argument in (state, samples) for name in argument.signal.elements]
    exact = [word * state.unit for word in run.identity]
    for row in processor_runs.noisy_integers(run):
        values = dict(zip(names, [*exact, *(value * samples.unit for value in row)], strict=True))
        (exact,) = subject.program.run(values).values()
    off = [0, 3, 0, 0] if algorithm == "euler" else [0, 3, 0, 0, 0, 0, 0, 0, 0]
    words = [round(x / state.unit) + extra for x, extra in zip(exact, off, strict=True)]
    distance = math.hypot(*(float(word - x / state.unit) for word, x in zip(words, exact, strict=True)))
    result, detail = processor_runs.compared([words], subject, run)
    assert result == "agrees"
    found = float(re.search(r"at most ([\d.]+) units", detail)[1])
    assert found == pytest.approx(
        distance, abs=0.02
    )  # two digits are printed; the sum of the squares is of 3 x 3
    words[1] += 40
    assert processor_runs.compared([words], subject, run)[0] == "fails"


@pytest.mark.long
def test_a_short_run_ends_near_the_balls(short, tmp_path):
    (verdict,) = processor_runs.million_steps(Subject(choose("euler")), tmp_path)
    assert (verdict.kernel, verdict.claim) == ("euler_rk4_2_w32", "error of a million steps: host")
    assert verdict.result == "agrees", verdict.detail
    assert verdict.detail.startswith(
        "303 steps of coning with noise, formats of --word 32 --max-angle-rad 1/256 "
    )
    error = float(re.search(r"at most ([\d.]+) units", verdict.detail)[1])
    # Half a unit is lost where the state is rounded, and fed back; the rest comes from values in between.
    assert 0.3 < error < 2


def test_a_changed_shift_is_seen(short, monkeypatch, tmp_path):
    noisy_run = processor_runs.noisy_run

    def faulty(subject, rows, passes):
        run = noisy_run(subject, rows, passes)
        name = f"{subject.name}.c"
        text, count = re.subn(
            r"(sigma_dot_sigma = .*?), (\d+)\);",
            lambda match: f"{match[1]}, {int(match[2]) - 1});",
            run.sources.files[name],
            count=1,
            flags=re.DOTALL,
        )
        assert count
        return replace(run, sources=replace(run.sources, files=run.sources.files | {name: text}))

    monkeypatch.setattr(processor_runs, "noisy_run", faulty)
    (verdict,) = processor_runs.million_steps(Subject(choose("euler")), tmp_path)
    assert verdict.result == "fails"


def test_a_refused_step_is_seen():
    subject = Subject(choose("euler"), processor_runs.SETTINGS)
    run = processor_runs.noisy_run(subject, 1, 2)
    states = processor_runs.read_states("state 00000000 00000000 00000000 40000000\nrefused 0 0 0 0\n")
    assert states == [[0, 0, 0, 1 << 30]]
    assert processor_runs.compared(states, subject, run) == ("fails", "a step is refused in pass 2")


@pytest.mark.parametrize(
    ("kernel", "settings"),
    [("dcm", None), ("euler-product", None), ("euler", Settings(word=16)), ("euler", Settings(carry="full"))],
)
def test_a_million_steps_are_taken_by_one_kernel(kernel, settings, tmp_path):
    assert processor_runs.million_steps(Subject(choose(kernel), settings), tmp_path) == []


def test_without_the_library_of_balls_nothing_is_claimed(short, monkeypatch, tmp_path):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "flint" else find(name))
    (verdict,) = processor_runs.million_steps(Subject(choose("euler")), tmp_path)
    assert (verdict.result, verdict.detail) == ("not installed", "install gcc, python-flint")


def test_the_emulated_processor_takes_the_steps(short, monkeypatch, tmp_path):
    runner = RUNNERS[processor_runs.PROCESSOR]
    for command in runner.commands:
        if shutil.which(command) is None:
            pytest.skip(f"{command} is not on this machine")
    monkeypatch.setattr(processor_runs, "RUNNERS", RUNNERS)
    (verdict,) = processor_runs.million_steps(Subject(choose("euler")), tmp_path)
    assert (verdict.claim, verdict.result) == ("error of a million steps: cortex-m3", "agrees"), (
        verdict.detail
    )
