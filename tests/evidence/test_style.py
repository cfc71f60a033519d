"""Two tools find nothing in any kind of generated C, and something where there is something."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from functools import partial
from itertools import cycle, permutations

import pytest

from strapgen import pipeline
from strapgen.catalogue import Choice, choose
from strapgen.evidence import style
from strapgen.evidence.subjects import Subject
from strapgen.firmware.project import project, two_speed_project
from strapgen.firmware.vectors.vectors import vectors_of_choice
from strapgen.firmware.vectors.vectors_c import table_files
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


@pytest.fixture(autouse=True)
def tools():
    for command in ("clang", "clang-tidy"):
        if shutil.which(command) is None:
            pytest.skip(f"{command} is not on this machine")


@pytest.fixture(autouse=True)
def few_vectors(monkeypatch):
    """Write a tenth of the vectors of a project: more of them are only more numbers, as in the evidence."""
    few = partial(vectors_of_choice, count=style._VECTORS)
    for module in (project, two_speed_project):
        monkeypatch.setattr(module, "vectors_of_choice", few)


def findings(files, folder) -> list[str]:
    write_files(folder, files)
    return [*style.found_by_clang(folder), *style.found_by_clang_tidy(folder)]


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
FAULTS = {
    "if (a == 1) {\n        return 2;\n    } else {\n        return 2;\n    }": "found_by_clang_tidy",
    "return (a > 0) ? rand() : 0;": "found_by_clang_tidy",
    "unsigned int b = 1u;\n    return b;": "found_by_clang",
    "return missing;": "found_by_clang",
}


@pytest.mark.parametrize("body", FAULTS)
def test_a_fault_is_found(body, tmp_path):
    text = f"#include <stdlib.h>\nint f(int a);\nint f(int a)\n{{\n    {body}\n}}\n"
    write_files(tmp_path, {"part/fault.c": text})
    assert [line for line in getattr(style, FAULTS[body])(tmp_path) if line.startswith("fault.c:")]


@pytest.mark.long
def test_a_finding_fails_the_claim(monkeypatch, tmp_path):
    subject = Subject(choose("euler-product"))
    name = "euler_product_w32.c"
    text = subject.sources.files[name].replace("return 0;", "int nothing = 0;\n    return 0;")
    vars(subject)["sources"] = replace(subject.sources, files=subject.sources.files | {name: text})
    results = {(v.claim, v.tool): (v.result, v.detail) for v in style.style(subject, tmp_path)}
    assert len(results) == 6
    result, detail = results["style: fixed point", "clang"]
    assert result == "fails"
    assert detail.startswith("1 findings, first euler_product_w32.c:")
    assert results["style: floating point", "clang"] == ("agrees", "")
    assert results["style: floating point", "clang-tidy"] == ("agrees", "")


@pytest.mark.long
def test_no_check_is_left_out_without_need(monkeypatch, tmp_path):
    write_files(tmp_path, with_vectors(choose("euler"), "c-fixed", Settings(16)))
    monkeypatch.setattr(style, "CHECKS", "-*,bugprone-easily-swappable-parameters")
    assert style.found_by_clang_tidy(tmp_path)
    for name in ("declaration-after-statement", "padded"):
        monkeypatch.setattr(
            style, "UNWARNED", {key: 0 for key in style.UNWARNED if key != name} | {"unsafe-buffer-usage": 99}
        )
        assert style.found_by_clang(tmp_path), name


def test_three_warnings_are_left_out():
    assert len(style.UNWARNED) == 3
    assert style.CHECKS.startswith("-*,bugprone-*,cert-*,")
    assert style.CHECKS.count("-bugprone") + style.CHECKS.count("-cert") == 1
