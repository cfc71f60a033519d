"""``strapgen check`` on files in C and C++: its examples, its exit status, and one line for what it cannot use."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest

from strapgen.cli import main

ROOT = Path(__file__).resolve().parents[2]
PLACE = "examples/check_foreign_c"
DOCUMENT = (ROOT / "docs" / "check-foreign-code.md").read_text()
COMMAND = (
    "--function integrator_update --arguments 'state[4], increments[3] -> state[4]' --scalar first "
    "--init integrator_init"
)


@pytest.fixture
def check(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """Run the command in the checkout and return its exit status, its output and its messages."""
    monkeypatch.chdir(ROOT)

    def run(words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["check", *shlex.split(words)])
        said = capsys.readouterr()
        return stop.value.code, said.out, said.err

    return run


@pytest.mark.long
def test_the_right_example_passes(check):
    status, printed, said = check(f"{PLACE}/correct.c {COMMAND}")
    assert (status, said) == (0, "")
    assert printed.startswith(f"{PLACE}/correct.c: integrator_update\n\n")
    assert "FAILS" not in printed and "cause" not in printed
    assert re.search(
        r"^  holds drift +9\.783 deg/h; closed form on 1 sample and 1 before 9\.784, coning-\w+ 9\.783$",
        printed,
        re.M,
    )


def test_a_fault_exits_with_1_and_names_its_cause(check):
    status, printed, said = check(f"{PLACE}/wrong_sign.c {COMMAND}")
    assert status == 1
    assert printed.endswith("\n\nlikely cause: correction of the wrong sign\n")
    (excerpt,) = re.findall(r"^```text\n(.*?)^```", DOCUMENT, flags=re.MULTILINE | re.DOTALL)
    assert all(part in printed for part in excerpt.split("...\n"))
    fails = "coefficients, order, drift; likely cause: correction of the wrong sign"
    assert said == f"strapgen: {PLACE}/wrong_sign.c fails: {fails}\n"


def test_json_has_what_was_agreed(check, tmp_path):
    out = tmp_path / "check.json"
    status, printed, said = check(f"{PLACE}/state_kept.c {COMMAND} --format json --out {out}")
    assert (status, printed) == (1, "")
    assert said.splitlines()[0] == f"wrote {out}"
    data = json.loads(out.read_text())
    checks = data.pop("checks")
    assert {name: data[name] for name in ("file", "holds", "cause")} == {
        "file": f"{PLACE}/state_kept.c",
        "holds": False,
        "cause": "state kept between runs",
    }
    old, new = {"order", "drift_deg_h", "closed_form_deg_h"}, {"drift_by_axis_deg_h", "coefficient_ratio"}
    assert {*data} == {"schema", "file", "holds", "cause", "coefficients", *old, *new}
    assert data["coefficients"] == [
        {"older": -1, "newer": 0, "seen": pytest.approx(1 / 12, abs=1e-6), "wanted": 1 / 12}
    ]
    assert data["coefficient_ratio"] == pytest.approx(1, abs=1e-5)
    assert all({*each} == {"name", "holds", "value"} for each in checks)
    assert [each["name"] for each in checks if each["holds"] is False] == ["runs"]


@pytest.mark.long
def test_the_page_of_the_examples_names_every_fault_as_the_command_does(check):
    page = (ROOT / PLACE / "README.md").read_text()
    rows = dict(re.findall(r"^\| `(\w+\.c)` \| .*? \| (.*?) \| [\d.]+ \|$", page, flags=re.MULTILINE))
    assert {*rows} == {path.name for path in (ROOT / PLACE).glob("*.c")}
    assert rows.pop("correct.c") == "-"
    assert set(rows.values()) == {
        "correction absent or zero",
        "correction of the wrong sign",
        "correction one sample late",
        "correction off by a factor of 2",
        "state kept between runs",
    }  # tests/experiments runs each of them
    (command,) = re.findall(r"^    strapgen check (.*)$", page.replace("\\\n", ""), flags=re.MULTILINE)
    assert check(command)[0] == 0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (f"{PLACE}/correct.c", "correct.c needs --function; --function NAME --arguments "),
        (f"{PLACE}/correct.c --function f", "correct.c needs --arguments; "),
        (f"{PLACE}/none.c {COMMAND}", "none.c is no file"),
        (
            f"{PLACE}/README.md {COMMAND}",
            r"--function goes with a file in C or C\+\+ \(\.c, .*README.md is none",
        ),
        (f"euler {COMMAND}", "--function goes with a file in C"),
        (
            f"{PLACE}/correct.c {COMMAND} --method rk4",
            "--method goes with an algorithm of strapgen; .* is a file in C",
        ),
        (
            f"{PLACE}/correct.c {COMMAND} --sense body",
            "sense 'body' is not known .did you mean body-to-reference or",
        ),
        (f"{PLACE}/correct.c {COMMAND} --scalar 1", "scalar '1' is not known; allowed: last, first"),
        (f"{PLACE}/correct.c {COMMAND} --sample-hz 0", "--sample-hz is 0; a number above 0 is needed"),
        (f"{PLACE}/correct.c {COMMAND} --sample-hz fast", "--sample-hz is 'fast'; a finite number is needed"),
        (
            f"{PLACE}/correct.c {COMMAND} --input angles",
            "input 'angles' is not known; allowed: increments, rates, rates-at-ends",
        ),
        ("euler --sample-hz 100", "--sample-hz goes with a file in C"),
        (
            f"{PLACE}/correct.c {COMMAND} --precision half",
            "precision 'half' is not known; allowed: double, float",
        ),
        (f"{PLACE}/correct.c {COMMAND} --out {PLACE}/correct.c", "is a file that the command reads"),
        (f"{PLACE}/correct.c {COMMAND} --format xml", "format 'xml' is not known"),
        (
            f"{PLACE}/correct.c --function f --arguments 'q[4] -> q[4]'",
            r"'q\[4\]' is not known; allowed: state\[4\]",
        ),
        (f"{PLACE}/correct.c --function f --arguments ''", "--arguments '' has no single arrow"),
        (
            f"{PLACE}/correct.c --function f --arguments 'state[9], rates[3] -> state[9]' --scalar last",
            "--scalar last goes with a result of four elements; this one has 9",
        ),
        (
            f"{PLACE}/correct.c {COMMAND.replace('update', 'updat')}",
            "no function integrator_updat .did you mean integr",
        ),
        (
            f"{PLACE}/correct.c {COMMAND} --precision float",
            "does not take these --arguments in --precision float",
        ),
    ],
)
def test_what_it_cannot_use_gets_one_line_and_status_2(check, words, says):
    status, printed, said = check(words)
    assert (status, printed) == (2, "")
    assert said.startswith("strapgen: ") and said.count("\n") == 1
    assert re.search(says, said), said


def test_a_file_that_does_not_compile_exits_with_2_and_the_first_error(check, tmp_path):
    (tmp_path / "faulty.c").write_text(
        "void integrator_init(void) {}\nvoid integrator_update(double *q) { q[0] = }\n"
    )
    status, printed, said = check(f"{tmp_path}/faulty.c {COMMAND}")
    assert (status, printed) == (2, "")
    assert said.startswith(f"strapgen: {tmp_path}/faulty.c does not compile: {tmp_path}/faulty.c:2:")
    assert "error: expected" in said and said.count("\n") == 1
