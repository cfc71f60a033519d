"""The page of ``strapgen check --report``: it says what the command says, escapes text, and works in a browser."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path

import pytest
from browser_checks import WIDTHS, opened

from strapgen.cli import main
from strapgen.firmware.check_code.check_foreign import ForeignResult, MeasuredCoefficient
from strapgen.firmware.check_code.conformance import Finding
from strapgen.report.check_page import check_page

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "check_foreign_c" / "wrong_sign.c"
COMMAND = f"{EXAMPLE} --function integrator_update --scalar first --init integrator_init".split()
RESULT = ForeignResult(
    *("<b>.py", "f & g", (Finding("drift", False, "<i>wrong</i>", 2.0, 1.0), Finding("NaN", None, "stays"))),
    *(2.0, 3.0, 1.5, "a <cause>", (1.0, 2.0, -2.0), (MeasuredCoefficient(-1, 0, -0.1, 0.2),), -0.5),
    *(0.75, "another", "const double x = 1;", "strapgen generate euler"),
)


def run(*words: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(["check", *words])
    return ended.value.code


def test_the_page_has_all_findings_and_no_markup_of_a_user():
    page = check_page(RESULT, "strapgen check '<b>.py'")
    shown = html.unescape(re.sub(r"<style>.*?</style>|<[^>]*>", " ", page, flags=re.DOTALL))
    for text in (
        "f & g of <b>.py",
        "<i>wrong</i>",
        "a <cause>",
        "Confidence 0.75",
        "another",
        "-0.1",
        "0.2",
        "stays",
    ):
        assert text in shown
    assert "<i>" not in page and "<cause>" not in page
    assert "3 deg/h" in shown and "1, 2, -2 about x, y, z" in shown and "1.5 deg/h" in shown
    assert "const double x = 1;" in shown and "strapgen generate euler" in shown
    assert "http" not in page.replace("http-equiv", "")


def test_a_page_of_what_holds_has_no_cause():
    held = ForeignResult("a.c", "f", (Finding("calls", True, "all calls return"),), None, None, None, None)
    page = check_page(held, "strapgen check a.c")
    assert "Likely cause" not in page and 'class="good">holds' in page


@pytest.mark.long
def test_the_command_writes_the_page_that_a_browser_shows(browser, capsys, tmp_path):
    page, data = tmp_path / "check.html", tmp_path / "check.json"
    assert run(*COMMAND, "--report", str(page), "--format", "json", "--out", str(data)) == 1
    assert f"wrote {page}" in capsys.readouterr().err
    result, text = json.loads(data.read_text()), html.unescape(page.read_text())
    assert result["cause"] in text and result["replacement"] in text
    for width, dark in ((WIDTHS[0], False), (WIDTHS[1], True)):
        with opened(browser, page, width, dark) as window:
            assert not window.view().faults()


@pytest.mark.parametrize(
    ("report", "out", "says"),
    [
        (str(EXAMPLE), "out.txt", "is a file that the command reads; another one is needed"),
        ("same.html", "same.html", "--out and --report are both same.html; two files are needed"),
        ("file/check.html", "out.txt", "file"),
    ],
)
def test_the_page_is_written_over_no_other_file(tmp_path, monkeypatch, capsys, report, out, says):
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("")
    before = EXAMPLE.read_text()
    assert run(*COMMAND, "--report", report, "--out", out) == 2
    said = capsys.readouterr().err
    assert says in said and said.count("\n") == 1 and EXAMPLE.read_text() == before
    assert not Path(out).exists()
