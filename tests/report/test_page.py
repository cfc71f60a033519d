"""Reports: their numbers are those of the commands, and the page works in a browser that has no network."""

from __future__ import annotations

import json
import os
import re
import shlex
from dataclasses import replace
from pathlib import Path

import pytest
from browser_checks import WIDTHS, opened
from commands import run

from strapgen import Settings, backend, compare
from strapgen.catalogue import choose, standard
from strapgen.cli import main
from strapgen.evidence import collection
from strapgen.evidence.collection import Subject, Verdict
from strapgen.evidence.evidence_report import evidence_page, read_page
from strapgen.ir.version import VERSION
from strapgen.report.algorithm_view import view
from strapgen.report.dossier import Conditions, dossier
from strapgen.report.page import Content, report_page
from strapgen.thesis import thesis_tables

ROOT = Path(__file__).resolve().parents[2]
#: A step and a kernel that is none, on a few back ends and beside a few methods.
COMMAND = "report euler euler-product --beside rk4:2,magnus4:2 --backend numpy,c-fixed32 --duration 1/2 --sample-hz 50"


@pytest.fixture(scope="module", autouse=True)
def one_table():
    """Let the thesis have one table: a report takes all that there are, and the command prints the same."""
    (third,) = (table for table in thesis_tables.TABLES if table.number == 3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(thesis_tables, "TABLES", (third,))
        for name in ("build_all", "run_tables"):
            function = getattr(thesis_tables, name)
            patch.setattr(
                function,
                "__defaults__",
                tuple(
                    (third,) if isinstance(default, tuple) and third in default else default
                    for default in function.__defaults__
                ),
            )
        yield


@pytest.fixture(scope="module")
def page(tmp_path_factory, one_table):
    """Return the file of a report."""
    path = tmp_path_factory.mktemp("report") / "report.html"
    # In this process, where the commands beside the numbers find what it has derived.
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as stop:
        patch.setattr(os, "cpu_count", lambda: 1)
        main([*shlex.split(COMMAND), "--out", str(path)])
    assert stop.value.code == 0
    return path


@pytest.fixture(scope="module")
def data(page):
    """Return the data that the report embeds."""
    return json.loads(re.search(r'id="data">(.*?)</script>', page.read_text())[1])


def printed(command, capsys, folder):
    """Return what a command prints as JSON."""
    words = shlex.split(command)[1:]
    extra = ["--out", str(folder)] if words[0] == "generate" else ["--jobs", "1"] * (words[0] == "frontier")
    run([*words, *extra])
    return json.loads(capsys.readouterr().out)


def comparable(name, result):
    """Return a result without the times of steps, which are measured, and the files, which a report does not write."""
    if name == "compare":
        return [{key: value for key, value in row.items() if key != "ns_per_step"} for row in result]
    if name == "generate":
        return result | {"files": [], "results": [one | {"files": []} for one in result["results"]]}
    return result


def test_all_numbers_are_those_of_the_commands_beside_them(page, data, capsys, tmp_path):
    results = [(name, of) for several in data["results"].values() for name, of in several.items()]
    assert sorted(name for name, _ in results) == sorted(
        ["frontier", "tables", "derive", "generate", "simulate", "compare", "converge", "derive", "generate"]
    )
    text = page.read_text()

    for name, result in results:
        answer = comparable(name, printed(result["command"], capsys, tmp_path))
        assert comparable(name, result["data"]) == answer
        assert result["command"].split(" --format")[0] in text.split('id="data"')[0].replace("&#39;", "'")


def test_the_program_of_the_documentation_reads_the_data(page, monkeypatch, capsys, data):
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "evidence.md").read_text(), re.DOTALL)
    assert "out/report.html" in code
    monkeypatch.chdir(page.parent)
    (page.parent / "out").mkdir()
    (page.parent / "out" / "report.html").write_text(page.read_text())
    exec(code, {})
    order = data["results"]["euler-rk4-2"]["converge"]["data"][0]["observed_order"]
    assert capsys.readouterr().out == f"{order}\n"


def test_the_page_states_the_command_that_writes_it(page):
    (line,) = {*re.findall(r"<code>(strapgen report .*?)</code>", page.read_text())}
    assert line.startswith(f"strapgen {COMMAND.partition(' --')[0]} --")
    assert {*line.split(" --")[1:]} == {*COMMAND.split(" --")[1:]}


@pytest.mark.long
def test_a_report_works_in_every_window(browser, page):
    opened_all = "document.querySelectorAll('details').forEach(one => { one.open = true; })"
    for width, dark in ((WIDTHS[0], False), (WIDTHS[1], True)):
        with opened(browser, page, width, dark) as window:
            window.page.evaluate(opened_all)
            assert not window.view().faults()


@pytest.mark.long
def test_charts_tables_and_tabs_answer(browser, page):
    with opened(browser, page, WIDTHS[1]) as window:
        shown = window.page
        assert shown.locator(".chart svg[role=img]").count() == 4
        rows = shown.locator("#frontier-rows tr:visible")
        head = shown.get_by_role("columnheader", name="drift, deg/h").get_by_role("button")
        head.click()
        drifts = [float(text) for text in rows.locator("td:nth-child(6)").all_inner_texts()]
        assert drifts == sorted(drifts) and len(drifts) == 2
        head.click()
        assert [float(text) for text in rows.locator("td:nth-child(6)").all_inner_texts()] == drifts[::-1]
        shown.locator("input[data-filter=frontier-rows]").fill("magnus")
        assert rows.count() == 1
        marks = shown.locator("[data-chart=compare] svg[role=img] .dot")
        before = marks.count()
        shown.locator("[data-chart=compare] .legend button", has_text="c-fixed32").click()
        assert 0 < marks.count() < before
        shown.locator("[data-chart=frontier] .dot").first.hover()
        assert "multiplications" in shown.locator("#tip").inner_text()
        shown.locator("details#euler-rk4-2 > summary").click()
        code = shown.locator("details#euler-rk4-2 pre:visible")
        assert "int32_t" in code.last.inner_text() and code.locator(".comment").count()
        shown.locator("details#euler-rk4-2 [role=tab]", has_text="numpy").click()
        assert "import numpy" in code.first.inner_text() and code.count() == 1
        assert not window.view().faults()


def test_evidence_is_shown_for_the_examined_code_only():
    choice = choose("euler-product")
    proof = Verdict("euler_product_w32", "no overflow: AVR", "z3", "4.16", "proved", 0.1)
    recorded = read_page(evidence_page([proof], {proof.kernel: Subject(choice).digest}))
    known = dossier(choice)
    assert view(known, recorded).evidence == {"no overflow: AVR": "proved, z3"}
    changed = read_page(evidence_page([proof], {proof.kernel: "0123456789abcdef"}))
    assert view(known, changed).evidence == {}
    assert view(known, None).evidence == {}


def test_a_new_version_that_generates_the_same_code_keeps_the_evidence(monkeypatch):
    subject = Subject(choose("euler-product"))
    digest = subject.digest
    files = {name: text.replace(VERSION, "9.8.7") for name, text in subject.sources.files.items()}
    assert files != subject.sources.files
    newer = Subject(choose("euler-product"))
    newer.__dict__["sources"] = replace(subject.sources, files=files)
    assert newer.digest != digest
    monkeypatch.setattr(collection, "VERSION", "9.8.7")
    assert newer.digest == digest


def test_user_text_is_escaped():
    conditions = Conditions(motion="</script><script>alert(1)</script>", settings={})
    known = dossier(choose("euler-product"))
    content = Content("<b>bold</b>", "a & b", conditions, (), (known,), (), (), (), None)
    page = report_page(content, {"strapgen": "<1>"}, "0")
    assert "<b>bold" not in page and "alert(1)" in page
    assert page.count("<script") == page.count("</script>") == 2


@pytest.mark.long
def test_every_kernel_of_the_catalogue_has_its_formulas_code_and_bounds():
    conditions = Conditions(duration="1/10")
    chosen = [choice for choice in standard() if choice.increments is None]
    known = tuple(dossier(choice, conditions) for choice in chosen)
    content = Content("all", "", conditions, (), known, (), (), (), None)
    page = report_page(content, {"strapgen": "0"}, "0")
    assert page.count('<details class="algorithm"') == len(chosen)
    for shown in content.views:
        assert len(shown.formulas) and all(row.parts for row in shown.formulas)
        assert bool(shown.values) != bool(shown.no_fixed)
        assert len(shown.code) == (3 if shown.no_fixed else 4)


def test_back_ends_are_certified_beside_exact_arithmetic(page):
    """The run in 40 digits on the rounded increments agrees with balls; the page shows the radius."""
    pytest.importorskip("flint")
    choice, conditions = choose("euler"), Conditions(duration="1/2", sample_hz="50")
    certified = dossier(choice, conditions, None, ("c", "c-fixed32")).runs.certified
    schedule = conditions.schedule(choice)
    samples = conditions.profile().increments(schedule.step, schedule.steps, choice.increments_per_step, 0, 0)
    settings = Settings().for_increments(float(abs(samples).max()))
    taken = backend(choice, backend="c-fixed32", settings=settings).representable(samples)
    (row,) = compare(choice, backends=["c-fixed32"], samples=taken, reference="exact", settings=settings)
    assert certified["c-fixed32"].angle == pytest.approx(row.max_abs_rad, rel=1e-6)
    assert 0 < certified["c"].angle < 1e-14  # the angle between matrices in double is coarser
    assert all(one.radius < 1e-9 * one.angle for one in certified.values())
    assert page.read_text().count("<small>\u00b1 ") == 2
