"""The page that runs strapgen in the reader's browser: what it computes, what it shows, what it needs."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from browser_checks import HEIGHT, WIDTHS, opened, served

from strapgen import choose_step, derive, generate, lower, rounding_bounds
from strapgen.analysis import vibration
from strapgen.catalogue.methods import tableaux
from strapgen.catalogue.names import METHODS
from strapgen.fixedpoint.floating import proved

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "docs" / "site"), str(ROOT / "docs" / "site" / "try")]

import answers  # noqa: E402
import build  # noqa: E402
import vendor  # noqa: E402

#: Milliseconds after which Python is taken not to start, on however busy a machine.
PATIENCE = 300_000
SHOWN = "name => document.getElementById('try-status').textContent === `${name} is shown below.`"
FILE = "name => [files.get(name).text, document.getElementById('try-code').textContent]"

# What the page asks strapgen


def answered(part: str, *arguments: object) -> dict[str, object]:
    return json.loads(answers.answer(part, *arguments))


def test_the_answers_are_those_of_strapgen():
    choice = choose_step("euler", "rk1", 1)
    program = lower(derive(choice))
    formula = answered("formula", "euler", "rk1", 1)
    assert formula["kernel"] == "euler-rk1-1"
    assert formula["operations"] == {name: n for name, n in program.operations.items() if n}
    assert all(row["left"].startswith("<math>") and row["parts"] for row in formula["rows"])
    code = answered("code", "euler", "rk1", 1)
    assert code["files"] == {target: generate(program, target).step_files for target in answers.TARGETS}
    assert not code["unproved"]
    series = answered("series", "euler", "rk1", 1)
    assert series["text"].startswith("euler-rk1-1, general motion") and len(series["rows"]) >= 2


def test_the_drift_on_a_cone_scales_with_angle_and_time():
    """As chart.js takes it: with the square of the half-angle, and the inverse of the time between samples."""
    coning = answered("coning", "euler", "rk2", 2)
    response, (alpha, sampling) = vibration.of(choose_step("euler", "rk2", 2)), (0.01, 0.005)
    for k in (20, 100):
        frequency = coning["ratios"][k] / sampling
        rates = response.rates(
            frequency, 2 * sampling, theta_x=alpha, theta_y=alpha, phase=3.141592653589793 / 2
        )
        # Sines and sums of a few terms in double precision on both sides.
        assert coning["drift"][k] * alpha**2 / sampling == pytest.approx(abs(rates.error), rel=1e-9)


def test_a_tableau_of_the_reader_is_a_method(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs" / "site" / "try" / "page.html").read_text()
    text = page.split("<textarea")[1].split(">", 1)[1].split("</textarea>")[0]
    code = answered("code", "euler", "own", 1, text)
    program = lower(derive("euler", tableaux.read("own.toml"), 1))
    assert code["files"]["c"] == generate(program, "c").step_files
    assert code["command"].startswith("strapgen generate euler --tableau own.toml --increments 1")
    line = answered("formula", "euler", "own", 1, text.replace('"3/4"', '"1/2"'))["error"]
    assert line.startswith("own.toml: ") and "\n" not in line


def test_refusals_on_the_page_are_one_line():
    for part in answers.PARTS:
        line = answered(part, "euler", "rk9", 2)
        assert [*line] == ["error"]
        assert line["error"].startswith("method 'rk9' is not known") and "\n" not in line["error"]


# What the build brings


def test_every_method_has_one_heading():
    names = [name for group in vendor.GROUPS.values() for name in group]
    assert sorted(names) == sorted(METHODS)
    assert {*vendor.PROVED} <= {*METHODS}


def test_the_archive_holds_strapgen_and_is_the_same_twice(tmp_path, monkeypatch):
    program = lower(derive("euler", "rk1", 1))
    bounds = {proved.key(program, "double"): rounding_bounds(program).as_dict()}
    monkeypatch.setattr(vendor, "bounds", lambda: json.dumps(bounds).encode())
    wheel = tmp_path / "a-1-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as file:
        for name in (
            "a/b.py",
            "a/_fast.so",
            "a/tests/t.py",
            "a-1.dist-info/METADATA",
            "a-1.dist-info/LICENSE",
        ):
            file.writestr(name, name)
    monkeypatch.setattr(vendor, "_wheels", lambda folder: [wheel])
    data = vendor._archive(tmp_path)
    assert data == vendor._archive(tmp_path)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        names = {*archive.namelist()}
    assert {name for name in names if name.startswith("a")} == {
        "a/b.py",
        "a-1.dist-info/LICENSE",
        "answers.py",
    }
    assert {"strapgen/__init__.py", "strapgen/_data/templates/c/source.c.j2", "bounds.json"} <= names
    assert not any(name.endswith((".so", ".pyc")) for name in names)


def test_where_nothing_can_be_brought_the_page_says_so_and_the_rest_is_built(tmp_path, monkeypatch, capsys):
    with monkeypatch.context() as without_npm:
        without_npm.setenv("PATH", str(tmp_path))
        assert build._brought(tmp_path / "downloads") is False
    line = "docs: strapgen does not run on its page, which is left out: npm is needed to bring Python for the browser"
    assert capsys.readouterr().err == f"{line}: on Debian, apt-get install npm\n"
    assert not (tmp_path / "downloads").exists()
    build.Site(build.Stage(tmp_path / "source"), runs=False).write_pages()
    text = (tmp_path / "source" / "try.md").read_text()
    assert build.LEFT_OUT in text and "<form" not in text


def test_a_wheel_with_another_checksum_is_not_used(tmp_path, monkeypatch):
    (tmp_path / "sympy-1.14.0-py3-none-any.whl").write_bytes(b"other")
    assert vendor._wheels(tmp_path) == []
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    with pytest.raises(RuntimeError, match=r"^pip download failed: [^\n]+$"):
        vendor._download_wheels(tmp_path)


# The page in a browser


@pytest.fixture(scope="module")
def runnable(site) -> Path:
    if not (site / "try" / "manifest.json").is_file():
        pytest.skip("Python for the browser could not be brought when the site was built")
    return site


@pytest.mark.long
def test_page_derives_as_the_command_line(runnable, browser, tmp_path):
    command = "generate euler --method rk4 --increments 2 --target c,cpp,numpy --out"
    subprocess.run(
        [sys.executable, "-m", "strapgen", *command.split(), str(tmp_path)], check=True, capture_output=True
    )
    written = {path.name: path.read_text() for path in tmp_path.iterdir()}
    # In a folder of the server, as on hosts of many projects.
    with (
        served(runnable.parent) as address,
        opened(browser, f"{address}/{runnable.name}/try.html#euler-rk4-2", WIDTHS[0]) as window,
    ):
        page = window.page
        page.wait_for_function(SHOWN, arg="euler-rk4-2", timeout=PATIENCE)
        assert {*written} == {f"euler_rk4_2.{ending}" for ending in ("c", "h", "hpp", "py")}
        for name, text in written.items():
            page.locator("#try-tabs button", has_text=re.compile(f"^{re.escape(name)}$")).click()
            assert page.evaluate(FILE, name) == [text, text], name
        for width in WIDTHS:
            page.set_viewport_size({"width": width, "height": HEIGHT})
            assert window.view().faults() == [], width
        assert page.locator("#try-cost").inner_text().split()[:4] == ["order", "4", "multiplications", "37"]
        _compare(window)
        _own(window)
        _refuse(window)
        assert window.view().faults() == []


def _compare(window):
    """Keep a curve, choose another algorithm in the form, and read the curves with the keyboard."""
    page = window.page
    page.get_by_role("button", name="Keep this curve").click()
    page.get_by_label("Method", exact=True).select_option("coning-compressed")
    page.wait_for_function(SHOWN, arg="euler-coning-compressed-2", timeout=PATIENCE)
    assert page.url.endswith("#euler-coning-compressed-2")
    names = [text.split("\n")[0] for text in page.locator("#try-legend li").all_inner_texts()]
    assert names == ["euler-coning-compressed-2", "euler-rk4-2", "without any correction"]
    assert page.locator("#try-chart path.curve").count() == 3
    before = page.locator("#try-reading").inner_text()
    page.get_by_label("Read the curve at").press("ArrowRight")
    assert page.locator("#try-reading").inner_text() != before


def _own(window):
    """Choose the tableau of the page, and then spoil it."""
    page = window.page
    page.get_by_label("Method", exact=True).select_option("own")
    page.wait_for_function(SHOWN, arg="euler-own-2", timeout=PATIENCE)
    assert "Heun's third-order method" in page.locator("#try-title").inner_text()
    assert page.get_by_role("tab", name="euler_heun_s_third_order_method_2.c").count() == 1
    assert window.view().faults() == []
    page.get_by_label("Butcher tableau").fill("order = 3")
    page.get_by_role("button", name="Derive").click()
    page.get_by_role("alert").filter(has_text="own.toml").wait_for(timeout=PATIENCE)


def _refuse(window):
    """Open an address that strapgen refuses."""
    page = window.page
    page.evaluate("location.hash = 'euler-rk9-2'")
    page.get_by_role("alert").filter(has_text="method 'rk9' is not known").wait_for(timeout=PATIENCE)
    assert "\n" not in page.locator("#try-error").inner_text()
    assert not page.locator("#try-results").is_visible()


@pytest.mark.long
def test_a_page_from_disk_says_how_to_open_it(runnable, browser):
    for width in WIDTHS:
        with opened(browser, runnable / "try.html", width) as window:
            assert "make docs-serve" in window.page.get_by_role("alert").inner_text()
            assert not window.page.locator("#try-form").is_visible()
            assert window.view().faults() == []


@pytest.mark.long
def test_a_file_that_is_missing_is_named_in_one_line(runnable, browser):
    with served(runnable) as address, opened(browser, f"{address}/genindex.html", WIDTHS[0]) as window:
        window.page.route("**/pyodide.asm.wasm", lambda route: route.fulfill(status=404, body=""))
        window.page.goto(f"{address}/try.html")
        line = window.page.get_by_role("alert").filter(has_text="could not be loaded")
        line.wait_for(timeout=PATIENCE)
        assert line.inner_text() == "try/pyodide/pyodide.asm.wasm could not be loaded: 404 Not Found"
