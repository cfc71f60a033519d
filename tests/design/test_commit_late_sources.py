"""The C that commits late: its files, its names, what its headers say, and that compilers have nothing to warn of."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction

import pytest
from c_programs import COMPILERS, complaints, needed, written

from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.design.commit_late.commit_late_sources import NORMALIZATIONS, TARGETS, family, kernels, sources
from strapgen.evidence import clang_checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.pipeline import program
from strapgen.run.standard_tree import command_of

WINDOW = WINDOWS["window-3-3"]
GYRO = replace(
    WINDOW, gyro=Response(frequency_hz=Fraction(40), damping=Fraction(7, 10), sample_hz=Fraction(100))
)
UNITS = [(a, t) for a in NORMALIZATIONS for t in TARGETS]


@pytest.mark.long
@pytest.mark.parametrize(("algorithm", "target"), UNITS)
def test_files_are_narrow_plain_text_that_says_its_command(algorithm, target):
    unit = sources(WINDOW, algorithm, target)
    ending = {"c": "", "c-float": "_float", "c-fixed": "_w32"}[target]
    name = f"{algorithm}_late_3_3{ending}"
    assert unit.function.name == name
    assert list(unit.files)[:2] == [f"{name}.h", f"{name}.c"]
    assert len(unit.files) == 8
    for file, text in unit.files.items():
        assert text.isascii()
        assert all(line == line.rstrip() and len(line) < 100 for line in text.splitlines()), file
    for file in (f"{name}.h", f"{name}.c"):
        fixed = " --word 32 --max-angle-rad 1/8 --rounding nearest --carry none --drift-allowance 1/16"
        assert command_of(unit.files[file]) == (
            f"strapgen window generate window-3-3 --algorithm {algorithm} --target {target}"
            + (fixed if target == "c-fixed" else "")
        )
    externals = re.findall(rf"\b{name}_[a-z]+\b", unit.files[f"{name}.h"])
    assert len(set(externals)) >= 6
    assert max(map(len, externals)) <= 31
    assert sources(WINDOW, algorithm, target).files == unit.files


@pytest.mark.long
@pytest.mark.parametrize(("algorithm", "target"), UNITS)
@pytest.mark.parametrize(
    "compiler",
    [name if name in ("gcc", "clang") else pytest.param(name, marks=pytest.mark.long) for name in COMPILERS],
)
def test_compilers_do_not_complain(algorithm, target, compiler, tmp_path):
    needed(compiler)
    if (compiler, target) == ("avr-gcc", "c"):
        pytest.skip("a double of that processor has the bits of a float, which the step refuses")
    settings = Settings(carry="full") if target == "c-fixed" else None
    gyro = sources(GYRO, algorithm, target, 100, "gyro_late", settings)
    for folder, unit in (("ideal", sources(WINDOW, algorithm, target)), ("gyro", gyro)):
        place = written(tmp_path, {f"{folder}/{name}": text for name, text in unit.files.items()}) / folder
        code = [name for name in unit.files if name.endswith(".c")]
        assert complaints(compiler, place, code) == ""
        if compiler == "clang":
            assert clang_checks.found_by_clang(place) == []


@pytest.mark.long
@pytest.mark.parametrize(("algorithm", "target"), UNITS)
def test_the_style_is_that_of_other_files(algorithm, target, tmp_path):
    needed("clang-tidy")
    settings = Settings(carry="full") if target == "c-fixed" else None
    written(tmp_path, sources("window-7-7", algorithm, target, settings=settings).files)
    assert clang_checks.found_by_clang_tidy(tmp_path) == []


def test_the_header_counts_operations_and_memory():
    header = " ".join(sources("window-7-7").files["euler_late_7_7.h"].replace("\n *", " ").split())
    step, rotation, normalization = (
        program(choice).operations for choice in kernels(family("window-7-7"), "euler")
    )
    commit = step["multiply"] + normalization["multiply"]
    # Four sums of 15 samples, each of three elements.
    other = rotation["multiply"] + 4 * 15 * 3
    assert f"commits one interval, as nearly all do, {commit:,} multiply" in header
    assert (
        f"8 intervals at the start, {7 * (other + normalization['multiply']) + commit:,} multiply" in header
    )
    most = 7 * (other + normalization["multiply"]) + 9 * commit + 17 * 3
    assert f"16 intervals after a gap, at the end of the start, {most:,} multiply" in header
    assert f"_now: {7 * other:,} multiply" in header
    assert "69 numbers for 23 samples, 4 for the attitude and four counts: 600 bytes" in header
    assert "the committed attitude is 7 sampling intervals old" in header


def test_a_family_for_a_gyro_filters_all_coefficients_and_says_its_rate():
    unit = sources(GYRO, "euler", "c", "100")
    header = " ".join(unit.files["euler_late_3_3.h"].replace("\n *", " ").split())
    assert "designed for 100 Hz and a gyro of 40 Hz" in header
    assert "--sample-hz 100" in header
    assert "sums[5][3]" in unit.files["euler_late_3_3.c"]
    assert "sums[4][3]" in sources(WINDOW).files["euler_late_3_3.c"]


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ((WINDOW, "cayley-klein"), "algorithm"),
        ((WINDOW, "euler", "numpy"), "target"),
        ((GYRO,), "no sampling rate is stated"),
        ((GYRO, "euler", "c", 50), "is 50 Hz"),
        ((WINDOW, "euler", "c", None, "9_lives"), "a letter first"),
        ((WINDOW, "euler", "c", None, "a" * 25), "more than 24 characters"),
        ((replace(WINDOW, name="window-of-my-own-with-a-long-name"),), "--name chooses"),
        (("rk4",), "window is 'rk4'"),
    ],
)
def test_incompatible_arguments_are_refused_in_one_line(arguments, reason):
    with pytest.raises(InputError, match=reason) as refusal:
        sources(*arguments)
    assert "\n" not in str(refusal.value)
