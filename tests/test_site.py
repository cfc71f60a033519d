"""The documentation as a site: its navigation, its reference, its links, and what its pages look like."""

from __future__ import annotations

import html
import inspect
import json
import os
import re
import stat
import sys
import types
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from html.parser import HTMLParser
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest
import typer.main
from browser_checks import WIDTHS, faults, looked_at, opened

import strapgen
from strapgen.cli import app

ROOT = Path(__file__).resolve().parents[1]
SITE = ROOT / "docs" / "site"
sys.path[:0] = [str(SITE), str(SITE / "try")]

import build  # noqa: E402
import mathjax  # noqa: E402
import reference_commands  # noqa: E402
import reference_python  # noqa: E402
import repository_pages  # noqa: E402
import site_navigation as navigation  # noqa: E402
import staging  # noqa: E402

# Navigation


def documentation() -> set[str]:
    pages = {path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md")}
    return {page for page in pages if not page.startswith(("docs/site/", "docs/_build/"))}


def test_every_page_is_in_one_section():
    places = Counter(page for s in navigation.SECTIONS for page in (s.landing, *s.pages))
    assert {page: count for page, count in places.items() if count > 1} == {}
    assert documentation() - {*places} == set()


def test_pages_of_the_site_have_names_of_their_own():
    files = [name for name in repository_pages.tracked(ROOT) if name.endswith(".md")]
    pages = {*files, *navigation.GENERATED, *(s.landing for s in navigation.SECTIONS)}
    assert len({navigation.site_file(page).lower() for page in pages}) == len(pages)


def test_the_table_of_a_section_repeats_the_questions_of_the_index():
    asked = navigation.questions(ROOT)
    assert asked["docs/fixed-point.md"].startswith("How do I get C for a processor without floating point")
    assert asked["examples/toy_target/README.md"] == "How do I bring a language that strapgen does not have?"
    firmware = next(section for section in navigation.SECTIONS if section.title == "Firmware")
    text = staging.landing(ROOT, firmware, "# Firmware\n")
    assert f"| [](/fixed-point.md) | {asked['docs/fixed-point.md']} |" in text


# Staging


def test_links_lead_to_pages_of_the_site():
    page = "See [one](coning.md#three-forms), [two\nwords](../examples/own.py), [far](https://a.b/c.md), [here](#x).\n"
    page += '<img alt="a" src="drift.png">\n\n```python\nf[0](coning.md)\n```\n'
    seen = []

    def target(path: str, where: str) -> str:
        seen.append((path, where))
        return "" if path.startswith("examples") else f"/{path}"

    expected = page.replace("[one](coning.md", "[one](/docs/coning.md").replace('"drift', '"/docs/drift')
    assert staging.rewritten(page, "docs/page.md", target) == expected
    assert seen == [(p, "docs/page.md") for p in ("docs/coning.md", "examples/own.py", "docs/drift.png")]


@pytest.fixture(scope="module")
def staged(tmp_path_factory) -> Path:
    """Return the folder of the pages as Sphinx reads them."""
    folder = tmp_path_factory.mktemp("staged")
    build.stage_pages(folder)
    return folder


def test_staged_pages_link_to_staged_files_alone(staged):
    broken, count = [], 0
    for page in staged.rglob("*.md"):
        text = re.sub(r"^(`{3,}).*?^\1", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
        for target in re.findall(r"\]\(([^)\s#]+)", text):
            if "://" in target or re.search(rf"`[^`\n]*{re.escape(target)}[^`\n]*`", text):
                continue
            count += 1
            place = staged / target[1:] if target.startswith("/") else page.parent / target
            if not place.is_file():
                broken.append(f"{page.relative_to(staged)}: {target}")
    assert broken == [] and count > 500


def test_second_staging_keeps_pages_and_drops_removed_ones(staged):
    (staged / "gone.md").write_text("# Gone\n")
    before = {path: path.stat().st_mtime_ns for path in staged.rglob("*") if path.is_file()}
    build.stage_pages(staged)
    after = {path: path.stat().st_mtime_ns for path in staged.rglob("*") if path.is_file()}
    assert after == {path: time for path, time in before.items() if path.name != "gone.md"}


def test_the_home_page_is_the_readme_with_a_card_for_each_section(staged):
    text = (staged / "index.md").read_text()
    for section in navigation.SECTIONS:
        assert f"**[{section.title}](/{navigation.site_file(section.landing)})**" in text
        assert section.invitation in text
    # All paragraphs of the readme but those whose links have other targets here.
    paragraphs = [p for p in (ROOT / "README.md").read_text().split("\n\n") if "](" not in p]
    assert [paragraph for paragraph in paragraphs if paragraph not in text] == []


def test_folder_page_lists_files_and_file_page_shows_text():
    files = ["a/b.c", "a/inner/c.c", "a/inner/d.c", "other"]
    text = repository_pages.folder_page("a", files, orphan=True)
    assert re.findall(r"^- \[(.*)\]\((.*)\)$", text, re.MULTILINE) == [("inner/", "inner"), ("b.c", "b.c")]
    shown = repository_pages.file_page("a/b.md", "````\nfour\n````\n")
    assert "\n`````markdown\n````\nfour\n````\n`````\n" in shown


def test_the_formulas_of_a_notebook_are_formulas_on_its_page():
    text = repository_pages.notebook((ROOT / "examples/notebooks/truncation-error.ipynb").read_text())
    assert text.startswith("# The truncation error of an algorithm of your own")
    assert "```{math}\n:no-wrap:\n\n\\begin{align*}" in text and "```text\n" in text


def test_long_output_of_a_notebook_is_folded_and_all_output_is_in_a_fixed_font():
    def page(lines: int) -> str:
        output = {"text": [f"line {k}\n" for k in range(lines)]}
        cell = {"cell_type": "code", "source": ["run()"], "outputs": [output]}
        return repository_pages.notebook(json.dumps({"cells": [cell]}))

    short, long = page(repository_pages.OPEN_LINES), page(repository_pages.OPEN_LINES + 1)
    assert "<details>" not in short and short.count("```text\nline 0\n") == 1
    assert re.search(r"<details>\n<summary>9 lines of output</summary>\n\n```text\nline 0\n", long)
    assert long.endswith("line 8\n```\n\n</details>\n")


def test_examples_and_notebooks_are_pages_and_folders_of_many_files_are_copies(staged):
    notebooks = {path.name for path in (ROOT / "examples" / "notebooks").glob("*.ipynb")}
    assert {path.stem for path in (staged / "repository/examples/notebooks").glob("*.md")} == notebooks
    assert (staged / "repository/generated/c_fixed/euler_rk4_2_w32.c.txt").is_file()


# Reference


def test_the_reference_opens_with_a_map(staged):
    text = (staged / "reference" / "index.md").read_text()
    assert text.startswith("# Reference\n\n| you look up | it is in |\n")
    targets = set(re.findall(r"\]\(/([^)]+)\)", text.split("\n\n## ")[0]))
    assert {"reference/commands/index.md", "reference/python/index.rst", "user-files.md"} < targets


def test_every_public_name_is_in_the_reference():
    pages = reference_python.pages()
    described = set(
        re.findall(r"^\.\. (?:auto|py:)\w+:: strapgen\.([\w.]+)$", "\n".join(pages.values()), re.MULTILINE)
    )
    assert {*strapgen.__all__} - {"__version__"} - described == set()
    for name in strapgen._NAMESPACES:
        functions = {f"{name}.{member}" for member in reference_python.members(getattr(strapgen, name))}
        assert functions and functions <= described
        assert f"<strapgen.{name}>" in pages["index"]


def test_constants_have_their_comments_in_the_reference():
    text = "\n".join(reference_python.pages().values())
    values = [
        name
        for name in strapgen._EXPORTS
        if not isinstance(getattr(strapgen, name), type | types.FunctionType | types.ModuleType)
    ]
    assert len(values) >= 4
    for name in values:
        assert re.search(rf"^\.\. py:data:: strapgen\.{name}\n\n   \w.*\.$", text, re.MULTILINE), name


TABLE = {"add": len}


@dataclass
class Record:
    """Stands for those of the reference."""

    sizes: dict[str, int] = field(default_factory=dict)
    axes: np.ndarray = field(default_factory=lambda: np.array([[1.0, 0.5]]))
    lag: Fraction = Fraction(1, 8)
    run: Any = sorted
    names: tuple[str, ...] = ("x",)


def of_a_table(value, *, table=TABLE, text="1/8"):
    """Takes a table of the module."""


@pytest.mark.parametrize(
    ("thing", "signature"),
    [
        (Record, "(sizes={}, axes=((1, 0.5),), lag=1/8, run=sorted, names=('x',))"),
        (of_a_table, "(value, *, table=TABLE, text='1/8')"),
    ],
)
def test_defaults_are_written_as_a_user_would(thing, signature):
    inspected = pytest.importorskip("sphinx.util.inspect")
    from signatures import with_plain_defaults

    known = inspected.stringify_signature(inspect.signature(thing), show_annotation=False)
    assert known != signature and with_plain_defaults(known, thing) == signature
    assert with_plain_defaults("(x)", 1) == "(x)"


def test_every_command_is_in_the_reference_with_its_options():
    pages, missing = reference_commands.pages(), []
    for words, command in commands():
        text = pages[words.split()[0]]
        if words not in pages:
            text = text.split(f"## strapgen {words}\n")[1].split("\n## ")[0]
        options = [p for p in command.params if p.param_type_name == "option" and not p.hidden]
        names = [next(name for name in option.opts if name.startswith("--")) for option in options]
        missing += [
            f"{words} {name}" for name in names if not re.search(rf"^`.*{name}\b.*`$", text, re.MULTILINE)
        ]
        assert f"strapgen {words} [OPTIONS]" in text
        assert f"| [`{words}`](" in pages["index"]
    assert missing == []


def commands() -> Iterator[tuple[str, typer.core.TyperCommand]]:
    waiting = [("", typer.main.get_command(app))]
    while waiting:
        words, command = waiting.pop()
        for name, inner in getattr(command, "commands", {}).items():
            if not inner.hidden:
                full = f"{words} {name}".strip()
                waiting.append((full, inner))
                yield full, inner


# MathJax


def npm(folder: Path, script: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Put a program that is called npm in front of all others."""
    path = folder / "bin" / "npm"
    path.parent.mkdir()
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{path.parent}{os.pathsep}{os.environ['PATH']}")


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ('echo "npm error network is unreachable" >&2; exit 1', "failed: npm error network is unreachable"),
        ('echo other > "$4/mathjax.tgz"', "from npm has the checksum"),
        ("exit 0", "it brought no archive"),
    ],
)
def test_without_the_right_mathjax_there_is_one_line_and_no_file(tmp_path, monkeypatch, script, message):
    npm(tmp_path, script, monkeypatch)
    with pytest.raises(RuntimeError, match=message) as error:
        mathjax.vendor(tmp_path / "mathjax")
    assert "\n" not in str(error.value) and not (tmp_path / "mathjax").exists()


def test_missing_npm_names_the_package_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(build, "BUILD", tmp_path / "build")
    assert build.main([str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err == "docs: npm is needed to bring MathJax: on Debian, apt-get install npm\n"
    assert [*tmp_path.iterdir()] == []


def test_more_than_one_folder_is_refused(capsys):
    assert build.main(["a", "b"]) == 2
    assert capsys.readouterr().err == "docs: one folder is allowed, not 2: a b\n"


# The site as Sphinx builds it


class Page(NamedTuple):
    """What a page links to, what it loads, and the anchors that it has."""

    links: list[str]
    loads: list[str]
    anchors: set[str]


class Reader(HTMLParser):
    """Collects the addresses and the anchors of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.page = Page([], [], set())

    def handle_starttag(self, tag, attrs):
        """Note what an element links to or loads, and its anchor."""
        for name, value in attrs:
            if name == "id":
                self.page.anchors.add(value)
            elif name in ("src", "srcset") or (name == "href" and tag == "link"):
                self.page.loads.append(value)
            elif name == "href":
                self.page.links.append(value)


def read(site: Path) -> dict[Path, Page]:
    pages = {}
    for path in site.rglob("*.html"):
        if "_static" not in path.parts:
            reader = Reader()
            reader.feed(path.read_text())
            pages[path] = reader.page
    return pages


@pytest.mark.long
def test_no_link_of_the_site_dangles_and_nothing_is_loaded_from_elsewhere(site):
    pages, dangling, foreign = read(site), [], []
    assert len(pages) > 100
    for path, page in pages.items():
        foreign += [
            f"{path.relative_to(site)}: {a}" for a in page.loads if urlsplit(a).scheme not in ("", "data")
        ]
        for address in (*page.links, *page.loads):
            parts = urlsplit(address)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.is_file() or (
                parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors
            ):
                dangling.append(f"{path.relative_to(site)}: {address}")
    assert sorted(set(dangling)) == [] and foreign == []


@pytest.mark.long
def test_the_built_reference_has_every_name_and_every_command(site):
    texts = {path: path.read_text() for path in (site / "reference").rglob("*.html")}
    anchors = {anchor for path in texts for anchor in re.findall(r'id="([^"]+)"', texts[path])}
    names = [f"strapgen.{name}" for name in strapgen.__all__ if name != "__version__"]
    for name in strapgen._NAMESPACES:
        module = getattr(strapgen, name)
        names += [f"strapgen.{name}.{member}" for member in reference_python.members(module)]
    assert [n for n in names if n not in anchors and f"module-{n}" not in anchors] == []
    methods = [
        f"strapgen.{name}.{method}"
        for name in strapgen._EXPORTS
        if isinstance(cls := getattr(strapgen, name), type)
        for method, value in vars(cls).items()
        if not method.startswith("_") and inspect.isfunction(value) and value.__doc__
    ]
    assert len(methods) > 50 and [method for method in methods if method not in anchors] == []
    plain = html.unescape(re.sub(r"<[^>]*>", "", "".join(texts.values())))
    assert [words for words, _ in commands() if f"strapgen {words} [OPTIONS]" not in plain] == []
    defaults = re.findall(r'class="default_value">(.*?)</span></em>', "".join(texts.values()), re.DOTALL)
    told = [html.unescape(re.sub(r"<[^>]*>", "", text)) for text in defaults]
    assert len(told) > 300
    assert [text for text in told if re.search(r"Fraction|<|array\(| at 0x", text)] == []


@pytest.mark.long
@pytest.mark.parametrize("part", range(4))
def test_pages_fit_a_telephone_and_a_desk_and_ask_nothing_of_others(site, browser, part):
    assert [fault for path in sorted(read(site))[part::4] for fault in faults(browser, path)] == []


#: Code that is wider than its box and has no shade at its edge, and pictures that are drawn too small.
UNREADABLE = """() => {
  const wide = [...document.querySelectorAll("article pre")].filter(box => box.scrollWidth > box.clientWidth + 1);
  const bare = wide.filter(box => getComputedStyle(box).backgroundImage.split("linear-gradient").length !== 5);
  const small = [...document.querySelectorAll("article img")]
    .filter(image => image.getBoundingClientRect().width < 0.7 * Math.min(image.naturalWidth, 800));
  const hidden = [...document.querySelectorAll("article img")]
    .filter(image => image.parentElement.scrollWidth > image.parentElement.clientWidth + 20)
    .filter(image => getComputedStyle(image.parentElement, "::after").position !== "sticky");
  return {wide: wide.length, faults: [...bare.map(box => box.textContent.slice(0, 60)),
    ...[...small, ...hidden].map(image => image.src.split("/").pop())]};
}"""


@pytest.mark.long
def test_on_a_telephone_wide_code_is_marked_and_pictures_can_be_read(site, browser):
    found = {}
    for page in ("index", "paths/firmware", "paths/paper", "conventions", "vibration", "rate-gyro"):
        with opened(browser, site / f"{page}.html", 390) as window:
            found[page] = window.page.evaluate(UNREADABLE)
    assert {page: one["faults"] for page, one in found.items() if one["faults"]} == {}
    assert {page: one["wide"] for page, one in found.items() if not one["wide"]} == {}


@pytest.mark.long
def test_pages_typeset_their_equations(site, browser):
    for page in ("navigation", "canonical-form", "rate-gyro", "coning"):
        with opened(browser, site / f"{page}.html", 390) as window:
            window.page.wait_for_selector("mjx-container svg")
            assert window.page.locator("[data-mjx-error]").count() == 0
            assert window.view().faults() == []


@pytest.mark.long
def test_pages_are_dark_for_readers_who_prefer_it(site, browser):
    for width in WIDTHS:
        assert looked_at(browser, site / "index.html", width, dark=True).faults() == []
    ground = "() => getComputedStyle(document.body).backgroundColor.match(/\\d+/g).slice(0, 3).map(Number)"
    with opened(browser, site / "index.html", 400, dark=True) as window:
        assert max(window.page.evaluate(ground)) < 64
    with opened(browser, site / "index.html", 400) as window:
        assert min(window.page.evaluate(ground)) > 192


@pytest.mark.long
def test_search_and_formulas_work_from_disk(site, browser):
    with opened(browser, f"{(site / 'search.html').as_uri()}?q=sculling", 1400) as window:
        window.page.wait_for_selector("ul.search li a")
        assert window.page.locator("ul.search li a").count() >= 5
        assert window.view().faults() == []
    notebook = site / "repository" / "examples" / "notebooks" / "truncation-error.ipynb.html"
    with opened(browser, notebook, 1400) as window:
        window.page.wait_for_selector("mjx-container svg")
        assert window.page.locator("mjx-container svg").count() == 3
        assert window.page.locator("[data-mjx-error]").count() == 0
        assert window.view().faults() == []
