"""clang finds nothing in generated C; faults are found by its warnings, clang-tidy and the fuzzer."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import cycle, permutations

import pytest

from strapgen import pipeline
from strapgen.catalogue import Choice, choose
from strapgen.evidence import clang_checks
from strapgen.evidence.collection import Subject
from strapgen.firmware import project, two_speed_project
from strapgen.firmware.vectors import vectors_of_choice
from strapgen.firmware.vectors_c import table_files
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.units import Sensor
from strapgen.navigation.two_speed import two_speed_sources
from strapgen.storage.files import write_files
from strapgen.storage.resources import folder as shipped

#: Words, error feedback, counts of a gyro with a state that saturates.
SETTINGS = {
    "16 bits": Settings(16),
    "64 bits": Settings(64),
    "feedback of state and transition": Settings(carry="full"),
    "feedback of the state, truncation": Settings(16, carry="state", rounding="truncation"),
    "feedback in 64 bits": Settings(64, carry="full"),
    "counts": Settings(32, Fraction(1, 32), sensor=Sensor.of("0.0175dps", Fraction(1, 200)), state="q31"),
}
#: Kernels whose code differs from that of all others in what a setting changes.
KERNELS = ("euler", "dcm", "euler-normalize", "dcm-orthonormalize", "dcm-update", "coning-fast")


pytestmark = pytest.mark.needs("clang", "clang-tidy")


@pytest.fixture(autouse=True)
def few_vectors(monkeypatch):
    """Write a tenth of the vectors of a project: more of them are only more numbers, as in the evidence."""

    def few(choice, target, settings=None, count=0, **others):
        return vectors_of_choice(choice, target, settings, clang_checks._VECTORS, **others)

    for module in (project, two_speed_project):
        monkeypatch.setattr(module, "vectors_of_choice", few)


def findings(files, folder) -> list[str]:
    write_files(folder, files)
    return [*clang_checks.found_by_clang(folder), *clang_checks.found_by_clang_tidy(folder)]


def project_of(kernel: str, target: str, settings: Settings | None = None) -> dict[str, str]:
    choice = choose(kernel)
    sources = pipeline.compile(choice, target, settings)
    return {**sources.step_files, **project.project_files(choice, target, settings)}


def two_speed(algorithm: str, target: str, settings: Settings | None = None) -> dict[str, str]:
    whole = two_speed_sources.sources(algorithm, 2, target, settings)
    return {**whole.files, **two_speed_project.project_files(algorithm, 2, target, settings)}


def with_vectors(choice: Choice, target: str, settings: Settings | None = None) -> dict[str, str]:
    table = vectors_of_choice(choice, target, settings, 20)
    return {**pipeline.compile(choice, target, settings).files, **table_files(table)}


#: A file of each kind; `every_setting` has the others.
KINDS = {
    "project": lambda: project_of("euler", "c-fixed", SETTINGS["counts"]),
    "project of a call": lambda: project_of("euler-normalize", "c-float"),
    "vectors in double": lambda: with_vectors(choose("euler-angles-from-dcm"), "c"),
}


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_nothing_is_in_files_of_any_kind(kind, tmp_path):
    assert findings(KINDS[kind](), tmp_path) == []


def every_setting() -> Iterator[tuple[str, dict[str, str]]]:
    """Yield every setting with two kernels, and with them every kernel."""
    for row, kernel in enumerate(KERNELS):
        for column, (name, settings) in enumerate(SETTINGS.items()):
            if kernel in ("euler", "dcm") if settings.sensor else (row + column) % 3 == 0:
                yield f"{kernel}/{name}", with_vectors(choose(kernel), "c-fixed", settings)


def every_project() -> Iterator[tuple[str, dict[str, str]]]:
    short = Settings(16, carry="full")
    targets = (("c", None), ("c-float", None), ("c-fixed", None), ("c-fixed", short))
    # The step of each algorithm on every target is in the evidence: here it meets each target once.
    for (target, settings), (one, other) in zip(targets, cycle(permutations(("dcm", "euler"))), strict=False):
        place = f"{target}{settings.word if settings else ''}"
        yield f"loops/{one}/{place}", two_speed(one, target, settings)
        yield f"projects/{other}/{place}", project_of(other, target, settings)


@pytest.mark.long
@pytest.mark.parametrize("files", [every_setting, every_project])
def test_nothing_is_in_any_generated_file(files, tmp_path):
    """What `strapgen evidence --all` does not examine: other settings, two speeds, projects."""
    seen: set[str] = set()
    for name, texts in files():
        # Projects share the motion that they run: one text is examined once.
        new = {file: text for file, text in texts.items() if file.endswith(".h") or text not in seen}
        seen |= {*texts.values()}
        assert findings(new, tmp_path / name.replace(" ", "_")) == [], name


def test_nothing_is_in_the_files_that_are_shipped(tmp_path):
    files = {
        f"{name}/{path.name}": path.read_text()
        for name in ("c", "c_float", "c_fixed")
        for path in (shipped("generated") / name).glob("euler_rk4_*.[ch]")
    }
    assert len(files) >= 6
    assert findings(files, tmp_path) == []


#: Bodies of functions of an int, each with the function that finds its fault.
C_FAULTS = {
    "if (a == 1) {\n        return 2;\n    } else {\n        return 2;\n    }": "found_by_clang_tidy",
    "return (a > 0) ? rand() : 0;": "found_by_clang_tidy",
    "unsigned int b = 1u;\n    return b;": "found_by_clang",
    "return missing;": "found_by_clang",
}


@pytest.mark.parametrize("body", C_FAULTS)
def test_a_fault_in_c_is_found(body, tmp_path):
    text = f"#include <stdlib.h>\nint f(int a);\nint f(int a)\n{{\n    {body}\n}}\n"
    write_files(tmp_path, {"part/fault.c": text})
    assert [line for line in getattr(clang_checks, C_FAULTS[body])(tmp_path) if line.startswith("fault.c:")]


@pytest.mark.long
def test_a_finding_fails_the_claim(monkeypatch, tmp_path):
    subject = Subject(choose("euler-product"))
    name = "euler_product_w32.c"
    text = subject.sources.files[name].replace("return 0;", "int nothing = 0;\n    return 0;")
    vars(subject)["sources"] = replace(subject.sources, files=subject.sources.files | {name: text})
    results = {(v.claim, v.tool): (v.result, v.detail) for v in clang_checks.style(subject, tmp_path)}
    assert len(results) == 6
    result, detail = results["style: fixed point", "clang"]
    assert result == "fails"
    assert detail.startswith("1 findings, first euler_product_w32.c:")
    assert results["style: floating point", "clang"] == ("agrees", "")
    assert results["style: floating point", "clang-tidy"] == ("agrees", "")


@pytest.mark.long
def test_no_check_is_left_out_without_need(monkeypatch, tmp_path):
    write_files(tmp_path, with_vectors(choose("euler"), "c-fixed", Settings(16)))
    monkeypatch.setattr(clang_checks, "CHECKS", "-*,bugprone-easily-swappable-parameters")
    assert clang_checks.found_by_clang_tidy(tmp_path)
    for name in ("declaration-after-statement", "padded"):
        monkeypatch.setattr(
            clang_checks,
            "UNWARNED",
            {key: 0 for key in clang_checks.UNWARNED if key != name} | {"unsafe-buffer-usage": 99},
        )
        assert clang_checks.found_by_clang(tmp_path), name


#: Faults of a function: a pattern in the C, what takes its place, and what the driver or a sanitizer says of it.
CONTRACT_FAULTS = [
    pytest.param(
        *(r"    if \(euler", "    next[0] = 1;\n    if (euler", "a refused call writes"),
        id="an output is stored before the range checks",
    ),
    pytest.param(
        *(r"\(INT32_C\(1\) << 29\)", "(INT32_C(1) << 28)", "an input in its range is refused"),
        id="a range ends too early",
    ),
    pytest.param(
        *("1140850688", "1140850689", "an input out of its range is not refused"), id="a range ends too late"
    ),
    pytest.param(
        "    return 0;",
        "    static int calls;\n    next[0] += ++calls & 1;\n    return 0;",
        "the same input gives another result",
        id="a memory",
    ),
    pytest.param(
        *(r"next\[3\] = next_s;", "next[3] = INT32_C(1634820098);", "an output lies outside its range"),
        id="an output too large",
    ),
    pytest.param(
        *(r"next\[1\] = next_y;", "next[1] = next_y + (state[0] - e_x);", "the memory of an input changes"),
        id="an input that is read late",
    ),
    pytest.param(
        *(r"increments\[5\]", "increments[6]", "AddressSanitizer: stack-buffer-overflow"),
        id="an array too short",
    ),
    pytest.param(
        *(r"d1_x \+ d2_x;", "d1_x * 8 + d2_x * 8;", "runtime error: signed integer overflow"),
        id="a sum that overflows",
    ),
]


@pytest.fixture
def fuzzer(monkeypatch):
    """Compile without optimization, which takes half the time; `strapgen evidence --all` does with it."""
    monkeypatch.setattr(
        clang_checks, "_FLAGS", tuple("-O0" if f == "-O1" else f for f in clang_checks._FLAGS)
    )
    if not clang_checks.FUZZER.installed():
        pytest.skip("clang with libFuzzer is not on this machine")


def faulty(subject: Subject, pattern: str, change: str) -> Subject:
    name = f"{subject.name}.c"
    text, count = re.subn(pattern, lambda _: change, subject.sources.files[name], count=1)
    assert count
    changed = Subject(subject.choice, subject.settings)
    vars(changed)["sources"] = replace(subject.sources, files=subject.sources.files | {name: text})
    return changed


@pytest.mark.long
@pytest.mark.parametrize(("pattern", "change", "report"), CONTRACT_FAULTS)
def test_the_fuzzer_finds_a_breach_of_the_contract(pattern, change, report, fuzzer, monkeypatch, tmp_path):
    monkeypatch.setattr(clang_checks, "INPUTS", 20_000)
    (verdict,) = clang_checks.fuzzing(faulty(Subject(choose("euler")), pattern, change), tmp_path)
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
    monkeypatch.setattr(clang_checks, "INPUTS", 2_000)
    (verdict,) = clang_checks.fuzzing(Subject(choose(kernel), settings), tmp_path)
    assert (verdict.claim, verdict.result) == ("no undefined behaviour: fuzzing", "agrees"), verdict.detail
    assert verdict.detail == "2000 inputs"


@pytest.mark.long
def test_a_loop_that_stops_elsewhere_is_found(fuzzer, monkeypatch, tmp_path):
    monkeypatch.setattr(clang_checks, "INPUTS", 20_000)
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
        (verdict,) = clang_checks.fuzzing(changed, tmp_path / good.split()[0])
        assert verdict.result == "fails"
        assert re.search(report, verdict.detail), verdict.detail


@pytest.mark.needs("clang")
def test_c_that_does_not_compile_fails(monkeypatch, tmp_path):
    monkeypatch.setattr(clang_checks, "_links", lambda: True)
    subject = faulty(Subject(choose("euler-product")), "return 0;", "return nothing;")
    (verdict,) = clang_checks.fuzzing(subject, tmp_path)
    assert verdict.result == "fails"
    assert verdict.detail.startswith("clang failed: ")


def test_without_the_fuzzer_nothing_is_claimed(monkeypatch, tmp_path):
    monkeypatch.setattr(clang_checks, "_links", lambda: False)
    (verdict,) = clang_checks.fuzzing(Subject(choose("euler-product")), tmp_path)
    assert (verdict.result, verdict.detail) == ("not installed", "install clang libclang-rt-14-dev")


def test_a_fuzzer_that_is_stopped_is_no_proof():
    assert clang_checks.fuzzer_report("killed\n") == "the fuzzer ends early"


@pytest.mark.long
@pytest.mark.needs("gcc")
def test_the_driver_runs_without_a_fuzzer(tmp_path):
    subject = Subject(choose("euler"))
    for name, text in clang_checks.fuzz_files(subject).items():
        (tmp_path / name).write_text(text)
    (tmp_path / "input").write_bytes(bytes(range(200)))
    code = [name for name in clang_checks.fuzz_files(subject) if name.endswith(".c")]
    command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-DREPLAY", *code, "-o", "replay"]
    subprocess.run(command, cwd=tmp_path, check=True)
    assert subprocess.run(["./replay", "input"], cwd=tmp_path, check=False).returncode == 0
    assert subprocess.run(["./replay", "missing"], cwd=tmp_path, check=False).returncode == 2
