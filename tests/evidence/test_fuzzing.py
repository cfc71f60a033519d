"""The fuzzer finds what a call does against its contract, and kept inputs are replayed without it."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace

import pytest

from strapgen.catalogue import choose
from strapgen.evidence import fuzzing
from strapgen.evidence.subjects import Subject
from strapgen.ir.fixed_settings import Settings

LONG = pytest.mark.long
#: Faults of a function: a pattern in the C, what takes its place, and what the driver or a sanitizer says of it.
FAULTS = [
    pytest.param(
        *(r"    if \(euler", "    next[0] = 1;\n    if (euler", "a refused call writes"),
        id="an output is stored before the range checks",
        marks=LONG,
    ),
    pytest.param(
        *(r"\(INT32_C\(1\) << 29\)", "(INT32_C(1) << 28)", "an input in its range is refused"),
        id="a range ends too early",
        marks=LONG,
    ),
    pytest.param(
        *("1140850688", "1140850689", "an input out of its range is not refused"), id="a range ends too late"
    ),
    pytest.param(
        "    return 0;",
        "    static int calls;\n    next[0] += ++calls & 1;\n    return 0;",
        "the same input gives another result",
        id="a memory",
        marks=LONG,
    ),
    pytest.param(
        *(r"next\[3\] = next_s;", "next[3] = INT32_C(1634820098);", "an output lies outside its range"),
        id="an output too large",
        marks=LONG,
    ),
    pytest.param(
        *(r"next\[1\] = next_y;", "next[1] = next_y + (state[0] - e_x);", "the memory of an input changes"),
        id="an input that is read late",
        marks=LONG,
    ),
    pytest.param(
        *(r"increments\[5\]", "increments[6]", "AddressSanitizer: stack-buffer-overflow"),
        id="an array too short",
        marks=LONG,
    ),
    pytest.param(
        *(r"d1_x \+ d2_x;", "d1_x * 8 + d2_x * 8;", "runtime error: signed integer overflow"),
        id="a sum that overflows",
    ),
]


@pytest.fixture
def fuzzer(monkeypatch):
    """Compile without optimization, which takes half the time; `strapgen evidence --all` does with it."""
    monkeypatch.setattr(fuzzing, "_FLAGS", tuple("-O0" if f == "-O1" else f for f in fuzzing._FLAGS))
    if not fuzzing.FUZZER.installed():
        pytest.skip("clang with libFuzzer is not on this machine")


def faulty(subject: Subject, pattern: str, change: str) -> Subject:
    name = f"{subject.name}.c"
    text, count = re.subn(pattern, lambda _: change, subject.sources.files[name], count=1)
    assert count
    changed = Subject(subject.choice, subject.settings)
    vars(changed)["sources"] = replace(subject.sources, files=subject.sources.files | {name: text})
    return changed


@pytest.mark.long
@pytest.mark.parametrize(("pattern", "change", "report"), FAULTS)
def test_a_fault_is_found(pattern, change, report, fuzzer, monkeypatch, tmp_path):
    monkeypatch.setattr(fuzzing, "INPUTS", 20_000)
    (verdict,) = fuzzing.fuzzing(faulty(Subject(choose("euler")), pattern, change), tmp_path)
    assert verdict.result == "fails"
    assert re.search(report, verdict.detail), verdict.detail
    assert "; input in base 64: " in verdict.detail


@pytest.mark.long
@pytest.mark.parametrize(
    ("kernel", "settings"),
    [("dcm", Settings(16, carry="state", rounding="truncation")), ("euler", Settings(64, carry="full"))],
)
def test_code_that_holds_its_contract_agrees(kernel, settings, fuzzer, monkeypatch, tmp_path):
    """In other settings than `strapgen evidence --all` examines the catalogue."""
    monkeypatch.setattr(fuzzing, "INPUTS", 2_000)
    (verdict,) = fuzzing.fuzzing(Subject(choose(kernel), settings), tmp_path)
    assert (verdict.claim, verdict.result) == ("no undefined behaviour: fuzzing", "agrees"), verdict.detail
    assert verdict.detail == "2000 inputs"


@LONG
def test_a_loop_that_stops_elsewhere_is_found(fuzzer, monkeypatch, tmp_path):
    monkeypatch.setattr(fuzzing, "INPUTS", 20_000)
    subject = Subject(choose("euler"))
    name = f"{subject.name}_runs.c"
    for good, bad, report in (
        ("return k;", "return k + 1;", "the loop over samples stops at another one"),
        (
            "until_record = record_every",
            "until_record = record_every + 1",
            "a run records another state|Sanitizer",
        ),
    ):
        text = subject.sources.files[name]
        assert good in text
        changed = Subject(subject.choice)
        files = subject.sources.files | {name: text.replace(good, bad)}
        vars(changed)["sources"] = replace(subject.sources, files=files)
        (verdict,) = fuzzing.fuzzing(changed, tmp_path / good.split()[0])
        assert verdict.result == "fails"
        assert re.search(report, verdict.detail), verdict.detail


def test_c_that_does_not_compile_fails(monkeypatch, tmp_path):
    if shutil.which("clang") is None:
        pytest.skip("clang is not on this machine")
    monkeypatch.setattr(fuzzing, "_links", lambda: True)
    subject = faulty(Subject(choose("euler-product")), "return 0;", "return nothing;")
    (verdict,) = fuzzing.fuzzing(subject, tmp_path)
    assert verdict.result == "fails"
    assert verdict.detail.startswith("clang failed: ")


def test_without_the_fuzzer_nothing_is_claimed(monkeypatch, tmp_path):
    monkeypatch.setattr(fuzzing, "_links", lambda: False)
    (verdict,) = fuzzing.fuzzing(Subject(choose("euler-product")), tmp_path)
    assert (verdict.result, verdict.detail) == ("not installed", "install clang libclang-rt-14-dev")


def test_a_fuzzer_that_is_stopped_is_no_proof():
    assert fuzzing.reported("killed\n") == "the fuzzer ends early"


@pytest.mark.long
def test_the_driver_runs_without_a_fuzzer(tmp_path):
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not on this machine")
    subject = Subject(choose("euler"))
    for name, text in fuzzing.fuzz_files(subject).items():
        (tmp_path / name).write_text(text)
    (tmp_path / "input").write_bytes(bytes(range(200)))
    code = [name for name in fuzzing.fuzz_files(subject) if name.endswith(".c")]
    command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-DREPLAY", *code, "-o", "replay"]
    subprocess.run(command, cwd=tmp_path, check=True)
    assert subprocess.run(["./replay", "input"], cwd=tmp_path, check=False).returncode == 0
    assert subprocess.run(["./replay", "missing"], cwd=tmp_path, check=False).returncode == 2
