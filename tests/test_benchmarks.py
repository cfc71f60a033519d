"""The benchmark runs, counts what the programs count, and says what it could not run."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

import strapgen

pytestmark = [pytest.mark.long, pytest.mark.needs("g++")]

#: Of the four cases two, which have both algorithms, both kinds of samples, and their titles.
CASES = {
    "euler-increments": ("Euler parameters, two angle increments", "euler", False),
    "dcm-rates": ("Direction cosines, three rate vectors", "dcm", True),
}

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"


@pytest.fixture(scope="module")
def report(tmp_path_factory) -> str:
    out = tmp_path_factory.mktemp("benchmark") / "RESULTS.md"
    names = ["strapgen", "by hand", "SymPy cse + ccode", "CasADi"]
    command = [sys.executable, "compare.py", "--rounds", "2", "--process-rounds", "1", "--out", str(out)]
    subprocess.run(
        [*command, "--generators", *names, "--cases", *CASES], cwd=FOLDER, check=True, capture_output=True
    )
    return out.read_text()


def rows(report: str, title: str) -> dict[str, list[str]]:
    section = report.split(f"## {title}\n")[1].split("\n## ")[0]
    lines = [line.strip("| ").split(" | ") for line in section.splitlines() if line.startswith("|")]
    return {line[0].strip(): [cell.strip() for cell in line[1:]] for line in lines}


@pytest.mark.parametrize(
    ("title", "algorithm", "rates"),
    CASES.values(),
)
def test_counts_of_source_and_code_are_the_program_s(report, title, algorithm, rates):
    counted = strapgen.lower(strapgen.derive(algorithm, "rk4", rates=rates)).operations
    expected = [counted[kind] for kind in ("multiply", "add", "divide", "negate")]
    found = rows(report, title)
    assert list(map(int, found["strapgen"][:4])) == expected
    # gcc may take a product of constants out of the source, or write a doubling as a sum, but adds nothing.
    assert sum(map(int, found["strapgen"][4:7])) <= sum(expected)
    # Every other form of the same step takes more of each.
    for name in ("SymPy cse + ccode, staged", "SymPy cse + ccode, transition"):
        others = list(map(int, found[name][:4]))
        assert others[0] > expected[0] and others[1] > expected[1]
    assert all(float(cell) > 0 for cell in found["strapgen"][7:])


def test_a_generator_that_is_missing_is_reported(report):
    if importlib.util.find_spec("casadi") is None:
        assert len(re.findall(r"^\| CasADi, \w+ \| not run: .*casadi", report, flags=re.MULTILINE)) == 4
        assert "- CasADi: could not be run" in report
    else:
        assert "CasADi, staged" in report


def test_versions_and_machine_are_named(report):
    end = report.split("## Versions and machine")[1]
    assert f"strapgen {strapgen.__version__}" in end
    assert "gcc" in end and "processors" in end


def test_the_fixed_point_step_is_timed_against_one_written_out(tmp_path):
    out = tmp_path / "FIXED_POINT.md"
    command = [sys.executable, "fixed_point.py", "--rounds", "2", "--out", str(out)]
    subprocess.run(command, cwd=FOLDER, check=True, capture_output=True)  # compares all results first
    timed = dict(re.findall(r"^\| (.+?) \| +([\d.]+) \|", out.read_text(), flags=re.MULTILINE))
    words = [
        f"{word} bits, {kept}"
        for word in (32, 16)
        for kept in ("no residuals", "residuals of the state", "all residuals")
    ]
    assert list(timed) == ["double, staged, written out", "double, strapgen", *words]
    assert all(float(time) > 0 for time in timed.values())


def test_logs_are_timed_beside_what_reads_them_too():
    command = [sys.executable, "logs.py", "--rows", "20000", "--rounds", "1"]
    done = subprocess.run(command, cwd=FOLDER, capture_output=True, text=True)
    timed = re.findall(r"^  (.+?): ([\d.]+) s of processor time, (\d+) MB$", done.stdout, flags=re.MULTILINE)
    assert {name for name, *_ in timed} >= {
        "strapgen, CSV",
        "strapgen without pyarrow, CSV",
        "numpy.loadtxt, CSV",
    }
    assert re.search(
        r"^strapgen simulate: [\d.]+ s of processor time, \d+ MB", done.stdout, flags=re.MULTILINE
    )
    assert all(int(megabytes) > 20 for _, _, megabytes in timed)
