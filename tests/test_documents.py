"""README, docs, CONTRIBUTING and examples: what they show is what happens."""

from __future__ import annotations

import doctest
import json
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path

import derived
import numpy as np
import pytest
import typer.main
from shared_results import shared_results  # noqa: F401

import strapgen
from strapgen.catalogue import METHODS, Choice
from strapgen.catalogue.kinematics import SAVAGE
from strapgen.catalogue.methods.windows import named_window
from strapgen.cli import app, main
from strapgen.run import octave, standard_tree
from strapgen.run.frameworks import FRAMEWORKS

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "paths").glob("*.md")])
#: The pages by their names below docs/, without the ending.
DOCS = {path.relative_to(ROOT / "docs").with_suffix("").as_posix(): path.read_text() for path in PAGES}
README = (ROOT / "README.md").read_text()
#: A newcomer decides in so many lines of the README whether to read on.
FIRST_SCREEN = 60


def shown_commands(text: str) -> list[str]:
    """Return the commands that stand in lines of their own, continued lines joined."""
    joined = re.sub(r"\\+\n\s*", "", text)
    return re.findall(r"^ +(?:Example: )?(strapgen [a-z].*)$", joined, re.MULTILINE)


def blocks(text: str, kind: str) -> list[str]:
    """Return the fenced blocks of a kind, without the fences."""
    return re.findall(rf"^```{kind}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def run(command: str, capsys: pytest.CaptureFixture[str]) -> str:
    """Run a command that must succeed, and return what it prints."""
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(command)[1:])
    printed = capsys.readouterr()
    assert stop.value.code == 0, printed.err
    return printed.out


def git(*arguments: str) -> list[str]:
    """Return the lines that git prints; the test is skipped where there is no git, or no checkout."""
    try:
        done = subprocess.run(["git", "-C", ROOT, *arguments], capture_output=True, text=True, check=True)
    except (FileNotFoundError, subprocess.CalledProcessError):
        pytest.skip("no git, or no checkout")
    return done.stdout.splitlines()


def files_of(folder: Path) -> set[str]:
    """Return the files of a folder, without those of git itself."""
    return {
        str(path.relative_to(folder))
        for path in folder.rglob("*")
        if path.is_file() and ".git" not in path.parts
    }


def not_ignored(paths: Iterable[str]) -> list[str]:
    """Return which paths of a checkout would be new files that git does not ignore."""
    names = sorted(paths)
    known = git("ls-files", *names)
    ignored = subprocess.run(
        ["git", "-C", ROOT, "check-ignore", "--stdin"], input="\n".join(names), capture_output=True, text=True
    )
    return sorted({*names} - {*known, *ignored.stdout.splitlines()})


# README

#: Runs the README's Python and its commands in the folder where it starts; one process, so that SymPy is loaded once.
DRIVER = """
import contextlib, io, json, shlex, sys
import strapgen
from strapgen.cli import main

def captured(function, *arguments):
    out, err, status = io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            function(*arguments)
        except SystemExit as stop:
            status = stop.code
    return {"status": status, "out": out.getvalue(), "err": err.getvalue()}

task = json.load(sys.stdin)
done = {command: captured(main, shlex.split(command)[1:]) for command in task["commands"]}
done["python"] = captured(exec, task["python"], {})
json.dump({"package": strapgen.__file__, "done": done}, sys.stdout)
"""


@pytest.fixture(scope="module")
def new_clone(tmp_path_factory: pytest.TempPathFactory) -> tuple[set[str], dict[str, dict[str, str | int]]]:
    """Run the README's Python and commands in a new copy of the project's files.

    Returns the files that they wrote, and the status and the output of each.
    """
    clone = tmp_path_factory.mktemp("clone") / "strapgen"
    names = git("ls-files", "--cached", "--others", "--exclude-standard")
    # Python's bytecode comes along, to spare compiling it again: it is used where it is that of the source alone.
    bytecode = [str(path.relative_to(ROOT)) for path in (ROOT / "codegen").rglob("*.pyc")]
    for name in [*names, *bytecode]:
        if (ROOT / name).is_file():
            (clone / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, clone / name)
    before = files_of(clone)
    (code,) = blocks(README, "python")
    done = subprocess.run(
        [sys.executable, "-c", DRIVER],
        input=json.dumps({"commands": shown_commands(README), "python": code}),
        capture_output=True,
        text=True,
        check=True,
        cwd=clone,
        env=os.environ | {"PYTHONPATH": str(clone / "codegen")},
    )
    answer = json.loads(done.stdout)
    assert Path(answer["package"]).is_relative_to(clone)
    return files_of(clone) - before, answer["done"]


@pytest.mark.long
def test_the_commands_of_the_readme_run_in_a_new_clone(new_clone):
    written, done = new_clone
    assert len(done) >= 8
    assert {command: answer["err"] for command, answer in done.items() if answer["status"] != 0} == {}
    assert {"out/attitude.csv", "out/course.csv"} <= written
    assert not_ignored(written) == []


def missing(excerpt: str, text: str) -> list[str]:
    """Return which parts of an excerpt, between three dots at ends of lines, do not stand in a text in this order."""
    place, lost = 0, []
    for part in re.split(r"\.\.\.\n", excerpt):
        start = text.find(part, place)
        if start < 0:
            lost.append(part)
        else:
            place = start + len(part)
    return lost


@pytest.mark.long
def test_readme_formulas_and_c_are_printed_by_its_python(new_clone):
    _, done = new_clone
    (formulas,), (code,) = blocks(README, "text"), blocks(README, "c")
    assert 10 <= sum(line != "..." for line in code.splitlines()) <= 15
    printed = str(done["python"]["out"])
    assert missing(formulas, printed) + missing(code, printed) == []


def test_an_excerpt_that_differs_is_seen():
    assert missing("a\nb\n...\nd\n", "a\nb\nc\nd\n") == []
    assert missing("a\nc\n", "a\nb\nc\n") == ["a\nc\n"]
    assert missing("c\n...\na\n", "a\nb\nc\n") == ["a\n"]
    assert missing("a, ...\nc\n", "a, b\nc\n") == [] and missing("a, ...\nc\n", "a b\nc\n") == ["a, "]


def test_readme_is_short_and_begins_with_the_essentials():
    lines = README.splitlines()
    assert len(lines) <= 120
    assert len(shown_commands(README)) <= 15
    first_screen = "\n".join(lines[:FIRST_SCREEN])
    parts = ("| what you get |", "\n![", "pip install .", "```python\n", "```text\n", "```c\n")
    places = [README.index(part) for part in parts]
    assert places == sorted(places)
    assert len(re.findall(r"^!\[", first_screen, flags=re.MULTILINE)) == 1
    assert len(blocks(first_screen, "python")[0].splitlines()) <= 12


def readme_row(start: str) -> str:
    """Return the row of the first table of the README that begins with these words."""
    (row,) = (line for line in README.splitlines() if line.startswith(f"| {start}"))
    return row


def readme_command(start: str) -> str:
    (command,) = (command for command in shown_commands(README) if command.startswith(start))
    return command


def test_the_instructions_in_the_readme_are_those_of_the_page_on_cost():
    """Which tests/test_microcontrollers.py measures."""
    executed = re.findall(
        r"^\| (.*?by hand|32 bits) \| \d+ \| (\d+) \|", DOCS["microcontrollers"], re.MULTILINE
    )
    ours, textbook, tuned = (dict(executed)[name] for name in ("32 bits", "by hand", "tuned by hand"))
    assert re.search(rf"Cortex-M3 \| {ours} \| {textbook}, .*; {tuned}, ", readme_row("few instructions"))


def test_the_bound_in_the_readme_is_that_of_its_header():
    """The header in the README is what its Python prints, as another test sees."""
    ((bound, ulp),) = re.findall(r"error <= (\S+) \((\S+) ulp\)", blocks(README, "c")[0])
    words = f"| {float(bound):.2e}, or {float(ulp):.2f} units of the last place"
    assert words in readme_row("a proved bound")


@pytest.mark.long
def test_the_drifts_in_the_readme_are_those_of_its_command(capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    rows = json.loads(run(f"{readme_command('strapgen frontier')} --format json", capsys))["algorithms"]
    ours, published = sorted(rows, key=lambda row: row["drift_deg_h"]["cone"])
    assert "Ignagni" in published["source"] and ours["algorithm"].startswith("pair-1-8")
    cells = [
        rf"{row['drift_deg_h']['cone']:.2g} °/h, .* {row['multiply_per_sample']:.0f} multiplications a sample"
        for row in (ours, published)
    ]
    assert re.search(".*\\| ".join(cells), readme_row("little drift"))


#: Pictures of the pages that a command on a page draws, by what its file of that command is called.
DRAWN = {
    "cone-drift": "README",
    "frontier-sensors": "design",
    "orders": "paths/paper",
    "bounds": "paths/firmware",
    "word-length": "fixed-point",
    "flight-polar": "flights",
    "order-or-step": "thesis",
}


@pytest.mark.long
@pytest.mark.parametrize("picture", DRAWN)
def test_picture_is_the_output_of_its_command(picture, workplace):
    """In a process of its own, since `shared_results` leaves the layout of figures out."""
    text = README if DRAWN[picture] == "README" else DOCS[DRAWN[picture]]
    (command,) = (c for c in shown_commands(text) if f"--plot out/{picture}.svg" in c)
    main_program = [sys.executable, "-c", "from strapgen.cli import main; main()"]
    subprocess.run([*main_program, *shlex.split(command)[1:]], check=True, capture_output=True)
    # The names of clips depend on positions; the rest is text and numbers.
    drawn, shown = (
        re.sub(r'(?:url\(#|id=")p[0-9a-f]{10}', "", path.read_text())
        for path in (Path(f"out/{picture}.svg"), ROOT / "docs" / f"{picture}.svg")
    )
    number = r"-?\d+(?:\.\d+)?(?:e-?\d+)?"
    assert re.sub(number, "#", drawn) == re.sub(number, "#", shown)
    ours, theirs = (np.array(re.findall(number, one), float) for one in (drawn, shown))
    # Pixels: the last digits of a mathematical library do not show.
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=0.5)


# Links


def anchors(text: str) -> set[str]:
    """Return the anchors that GitHub gives to the headings of a page."""
    prose = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    titles = re.findall(r"^#+ (.*)$", prose, flags=re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


def test_every_link_leads_somewhere():
    broken = []
    for page in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *PAGES):
        for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
            if "://" in target:
                continue
            name, _, anchor = target.partition("#")
            path = page.parent / name if name else page
            if not path.exists() or (anchor and anchor not in anchors(path.read_text())):
                broken.append(f"{page.relative_to(ROOT)}: {target}")
    assert broken == []


def test_the_index_names_every_page():
    linked = set(re.findall(r"\]\(([\w/-]+)\.md\)", DOCS["README"]))
    assert linked == {*DOCS} - {"README"}


def test_the_glossary_is_sorted_and_other_pages_refer_to_it():
    terms = re.findall(r"^### (.*)\n(\S.*)$", DOCS["glossary"], flags=re.MULTILINE)
    assert len(terms) == DOCS["glossary"].count("\n### ") >= 40
    names = [re.sub(r"[^a-z ]", " ", name.lower()) for name, _ in terms]
    assert names == sorted(names)
    linked = "".join(text for name, text in DOCS.items() if name != "glossary").count("glossary.md#")
    assert linked >= 15


# The pages

#: Pages that take seconds: many kernels, or the integer model.
LONG_PAGES = (
    *(
        "ahrs",
        "canonical-form",
        "compensation",
        "coning",
        "fixed-point",
        "kalman",
        "navigation",
        "redundancy",
        "series",
        "systems",
    ),
    *("two-speed", "vibration"),
)


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=pytest.mark.long if page in LONG_PAGES else ())
        for page, text in DOCS.items()
        if ">>> " in text and page != "frameworks"
    ],
)
def test_the_python_of_a_page(page, monkeypatch):
    monkeypatch.chdir(ROOT)
    result = doctest.testfile(str(ROOT / "docs" / f"{page}.md"), module_relative=False)
    assert result.attempted >= 3
    assert result.failed == 0


@pytest.mark.parametrize(
    "section", DOCS["frameworks"].split("\n## ")[1:], ids=lambda text: text.split("\n")[0]
)
def test_the_python_of_a_framework(section):
    (imported,) = {*FRAMEWORKS} & {*re.findall(r"\w+", re.findall(r">>> import (.*)", section)[0])}
    pytest.importorskip(imported)
    examples = doctest.DocTestParser().get_doctest(section, {}, imported, None, None)
    assert len(examples.examples) >= 3
    assert doctest.DocTestRunner().run(examples).failed == 0


#: Commands that take a third of a second or more: many kernels, many terms, a compiler, or long runs.
LONG_COMMANDS = (
    "strapgen check ",
    "strapgen compare ",
    "strapgen coning --samples 1 --previous ",
    "strapgen coning --samples 3 --previous ",
    "strapgen cost ",
    "strapgen derive examples/three_samples.py --constant ",
    "strapgen derive separate ",
    "strapgen derive torques ",
    "strapgen design ",
    "strapgen frontier ",
    "strapgen generate euler --method window",
    "strapgen window ",
    "strapgen converge euler --method rk1,rk2,rk4,butcher6",
    "strapgen derive dcm --method butcher6",
    "strapgen evidence ",
    "strapgen generate --all --target ",
    "strapgen generate dcm ",
    "strapgen generate error-state ",
    "strapgen generate separate ",
    "strapgen generate euler --method rk4 --",
    "strapgen rate-table ",
    "strapgen kalman ",
    "strapgen redundancy ",
    "strapgen report euler ",
    "strapgen series euler ",
    "strapgen series examples/three_samples.py ",
    "strapgen simulate ",
    "strapgen stability ",
    "strapgen statements",
    "strapgen strapdown dcm ",
    "strapgen study ",
    "strapgen system ",
    "strapgen tableau examples/fifth_order.toml",
    "strapgen tableau examples/kutta4.toml",
    "strapgen tables",
    "strapgen two-speed dcm --target c-fixed",
    "strapgen verify ",
    "strapgen two-speed euler ",
    "strapgen vibration ",
)
#: Parts of commands that ask for much of the same, and what they run with: fewer methods, samples, words, algorithms or
#: workers, a lower order, a shorter run; one tool, since `make evidence` runs them all.
LESS = {
    "--aligned --runs 200": "--aligned --runs 10",
    "velocity-position-jacobian --method magnus4": "velocity-position-jacobian --method rk1",
    "rates_at_nodes.py --order 4": "rates_at_nodes.py --order 3",
    "--method coning-compressed,magnus4,rk4,taylor2": "--method coning-compressed:2,magnus4:2,rk4:2,taylor2",
    "guidance.toml --method coning-combined,rk4": "guidance.toml --method coning-combined:3,rk4:2",
    "--method rk4 --cluster local:2": "--method rk4:2 --cluster local:1",
    "--length 200 --cluster local:2": "--length 200 --cluster local:1",
    "coning-compressed,coning-combined,coning-least-squares,coning-shaped-8,pair-2-7": "pair-2-7",
    "--method rk1,rk2,rk4,butcher6,cooper-verner8": "--method rk1,rk2,butcher6",
    "--word 8,10,12,14,16,18,20,24,28,32": "--word 8,10,32",
    "--word 12,16,20,24,28,32": "--word 12,32",
    "rk4,butcher5,fehlberg5,dormand-prince5,butcher6,taylor6,magnus4 --plot": "rk4,butcher5,magnus4 --plot",
    "strapgen evidence euler --method rk4": "strapgen evidence euler --method rk4 --tool z3",
    "--beside rk4,magnus4,coning-compressed": "--beside rk4:2,magnus4:2,coning-compressed:2",
    "--beside rk4,magnus4 --out": "--beside rk4:2,magnus4:2 --out",
    "--algorithm euler,two-speed --carry full": "--algorithm two-speed --carry full",
    "own_rate.py --step 0.125 --duration 10": "own_rate.py --step 0.125 --duration 1",
}
#: What commands run beside Python and gcc, by a pattern of the command.
PROGRAMS = {
    r"--backend \S*cpp": "c++",
    r"--backend \S*rust": "rustc",
    r"cost .*--cpu cortex": "arm-none-eabi-gcc",
}
#: Pages whose commands need a file that the page shows, and commands that other tests run: tests/cli the second.
OWN_FILES = ("own-algorithms",)
TABLES = "strapgen tables"
PREDICTED = f"{TABLES} --predict"


def page_commands() -> Iterator[str]:
    """Yield every command of the pages once, but those that the README has too."""
    seen = {TABLES, PREDICTED, *shown_commands(README)}
    for page, text in DOCS.items():
        for command in shown_commands(text):
            if command not in seen and page not in OWN_FILES:
                seen.add(command)
                yield command


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty folder to work in, with the examples and a folder for pictures."""
    for name in ("examples", "generated"):
        (tmp_path / name).symlink_to(ROOT / name)
    (tmp_path / "docs").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "command",
    [
        pytest.param(command, marks=pytest.mark.long if command.startswith(LONG_COMMANDS) else (), id=command)
        for command in page_commands()
    ],
)
def test_a_command_of_a_page(command, workplace, capsys, monkeypatch):
    compiler = re.search(r"--cross (\S+)", command)
    needed = [program for pattern, program in PROGRAMS.items() if re.search(pattern, command)]
    for program in [compiler[1], *needed] if compiler else needed:
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not on this machine")
    if "octave" in command and (reason := octave.missing()):
        pytest.skip(reason)
    if command.startswith("strapgen generate --all"):  # of all, in tests/targets
        few = [derived.program(Choice("euler", "rk4", 2))]
        monkeypatch.setattr(standard_tree, "programs", lambda: iter(few))
    if "--variant" in command or command.startswith("strapgen build"):
        shutil.copy(ROOT / "examples/variants/strapgen.toml", workplace)
    run(with_less(command), capsys)


def shown_outputs() -> Iterator[tuple[str, str]]:
    """Yield the commands of the pages that stand above what they print, and that; of several, the last command."""
    for text in DOCS.values():
        for above, output in re.findall(r"((?:^    .*\n)+)\n```text\n((?:(?!```).*\n)*)", text, re.MULTILINE):
            if commands := shown_commands(above):
                yield commands[-1], output


@pytest.mark.parametrize(
    ("command", "output"),
    [
        pytest.param(*pair, marks=pytest.mark.long if pair[0].startswith(LONG_COMMANDS) else (), id=pair[0])
        for pair in shown_outputs()
    ],
)
def test_a_command_prints_what_the_page_shows(command, output, workplace, capsys):
    if "--cpu cortex" in command and shutil.which("arm-none-eabi-gcc") is None:
        pytest.skip("arm-none-eabi-gcc is not on this machine")
    printed = run(command, capsys)
    if (compiler := re.search(r"^compiled by .*", output, re.MULTILINE)) and compiler[0] not in printed:
        pytest.skip(f"{compiler[0]} on the page, another compiler here")
    assert missing(output, printed) == []


def with_less(command: str) -> str:
    for part, less in LESS.items():
        command = command.replace(part, less)
    return command


def test_demanding_statements_are_on_their_pages():
    commands = "\n".join([*page_commands(), *shown_commands(DOCS["own-algorithms"])])
    assert [part for part in LESS if part not in commands] == []
    named = {
        name.partition(":")[0]
        for command in commands.splitlines()
        for option, value in pairwise(shlex.split(command))
        if option == "--method"
        for name in value.split(",")
    }
    assert "cooper-verner8" in named
    files = {name for name in named if name.endswith(".py")}
    assert {name for name in named - files if name not in METHODS and not named_window(name)} == set()


def test_the_page_on_the_command_line_shows_every_command():
    shown = {shlex.split(command)[1] for command in shown_commands(DOCS["command-line"])}
    commands = typer.main.get_command(app).commands.items()
    assert shown == {name for name, command in commands if not command.hidden}


#: Options of `generate` from which the folder and the names of files follow, with their defaults.
NAMING = {
    "--method": "rk4",
    "--window": "",
    "--increments": "2",
    "--previous": "",
    "--target": "",
    "--word": "32",
    "--algorithm": "euler",
    "--name": "",
    "--prefix": "",
    "--out": "-",
}


def written_by(command: str) -> tuple[str, ...]:
    """Return what the files that a command generates are named after; nothing for a command that writes none."""
    words = shlex.split(command)
    if "generate" not in words[1:3] or "--out" not in words:
        return ()
    kernel = words[: words.index("generate") + 2]
    stated = NAMING | {one: value for one, value in pairwise(words) if one in NAMING}
    return (*kernel, *stated.values())


@pytest.mark.parametrize("page", ["README", *DOCS])
def test_commands_of_a_page_do_not_write_over_each_others_files(page):
    """A reader who runs them in their order would be refused: files with other options need --force."""
    before: dict[tuple[str, ...], str] = {}
    for command in shown_commands({"README": README, **DOCS}[page]):
        if files := written_by(command):
            assert before.setdefault(files, command) == command


def test_commands_write_only_ignored_files_into_the_checkout():
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *PAGES]
    pages += [*(ROOT / "examples").glob("*.py"), *(ROOT / "codegen" / "strapgen" / "cli").rglob("*.py")]
    written, writers = {}, ("generate", "two-speed", "vectors")
    for command in (command for page in pages for command in shown_commands(page.read_text())):
        words = shlex.split(command)
        for option, value in pairwise(words):
            if option in ("--out", "--plot", "--draw") and value != "-":
                is_folder = option == "--out" and words[1] in (*writers, "system")
                written[f"{value}/file.c" if is_folder else value] = command
        assert words[1] not in writers or {"--out", "--all"} & {*words}, command
    assert len(written) >= 9
    assert [written[path] for path in not_ignored(written)] == []


def cells(line: str) -> list[str]:
    return re.sub(r"(?<=\d)([*r])", r" \1 ", line).split()


@pytest.mark.long
def test_the_tables_of_the_thesis_are_those_of_the_command(capsys):
    printed = run(TABLES, capsys).strip().splitlines()
    (block,) = re.findall(r"```\n(Table 1.*?)```", DOCS["thesis"], flags=re.DOTALL)
    shown = block.strip().splitlines()
    assert len(shown) == len(printed)
    for ours, theirs in zip(cells("\n".join(shown)), cells("\n".join(printed)), strict=True):
        try:
            value = float(theirs)
        except ValueError:
            assert ours == theirs
            continue
        # Round-off differs from one mathematical library to the next: it rules the figures of single precision
        # at fourth order, and touches double precision below 1e-10 degrees.
        assert float(ours) == pytest.approx(value, rel=1e-3 if value > 1e-3 else 0.5)


@pytest.mark.long
def test_the_statements_of_the_thesis_are_those_of_the_command(capsys):
    printed = run("strapgen statements --format markdown", capsys).strip().splitlines()
    section = DOCS["thesis"].partition("\n## The statements\n")[2].partition("\n## ")[0]
    shown = [line for line in section.splitlines() if line.startswith("|")]
    # Round-off rules the smallest of the numbers, which the tests of the statements hold to their digits.
    words = [[re.sub(r"[\d.]+(e-\d+)?", "#", line) for line in lines] for lines in (shown, printed)]
    assert words[0] == words[1]


@pytest.fixture
def shown_files(workplace: Path) -> Path:
    """Return a folder with the tableau and the algorithm of the page on those of one's own."""
    for kind, name in (("toml", "heun3.toml"), ("python", "two_sample.py")):
        (block,) = blocks(DOCS["own-algorithms"], kind)
        (workplace / name).write_text(block)
    return workplace


def test_the_tableau_of_a_user_is_checked_as_the_page_says(shown_files, capsys):
    run("strapgen tableau heun3.toml", capsys)
    (failure,) = re.findall(r"^    strapgen: heun3.toml: (.*)$", DOCS["own-algorithms"], flags=re.MULTILINE)
    broken = (shown_files / "heun3.toml").read_text().replace('"1/4", "0", "3/4"', '"0", "0", "1"')
    (shown_files / "heun3.toml").write_text(broken)
    with pytest.raises(SystemExit) as stop:
        main(["tableau", "heun3.toml"])
    assert (stop.value.code, capsys.readouterr().err) == (2, f"strapgen: heun3.toml: {failure}\n")


def test_the_algorithm_of_a_user_is_generated_as_the_page_says(shown_files, capsys):
    assert "two_sample.c" in run("strapgen generate two_sample.py --target c --out firmware", capsys)
    assert "strapgen generate two_sample.py --target c --out firmware" in shown_commands(
        DOCS["own-algorithms"]
    )


@pytest.mark.long
def test_the_commands_on_own_algorithms(shown_files, capsys):
    commands = shown_commands(DOCS["own-algorithms"])
    shown = {"tableau", "generate", "converge", "check", "compare", "simulate", "series"}
    assert {shlex.split(command)[1] for command in commands} == shown
    for command in commands:
        run(with_less(command), capsys)


# The page on fixed point


@pytest.mark.long
def test_back_ends_side_by_side_are_those_of_the_command(capsys):
    (block,) = re.findall(
        r"^```\n(euler-rk4-2: coning motion.*?)^```", DOCS["fixed-point"], re.MULTILINE | re.DOTALL
    )
    (command,) = [c for c in shown_commands(DOCS["fixed-point"]) if "--backend numpy,c,c-float" in c]
    shown, printed = (text.strip().splitlines() for text in (block, run(command, capsys)))
    assert shown[:5] == printed[:5]
    for ours, theirs in zip(shown[5:], printed[5:], strict=True):
        (name, *numbers), (also, *others) = ours.split(), theirs.split()
        assert (name, numbers[7:]) == (also, others[7:])
        # Integers are the same everywhere; time and bytes are those of a machine, doubles those of its library.
        if name.startswith("c-fixed"):
            assert numbers[:5] == others[:5]


@pytest.mark.parametrize(("option", "in_counts"), [("--step 0.01", False), ("--lsb 0.0175dps", True)])
def test_the_page_on_fixed_point_quotes_the_headers_of_its_commands(option, in_counts, workplace, capsys):
    page = DOCS["fixed-point"]
    command = next(c for c in shown_commands(page) if c.startswith("strapgen generate euler") and option in c)
    run(re.sub(r"--out \S+", "--out out", command), capsys)
    header = Path("out/euler_rk4_2_w32.h").read_text()
    quoted = [block for block in blocks(page, "(?:c|text)") if block.startswith(("/* One call", " * "))]
    mine = [block for block in quoted if ("counts of the gyro" in block) == in_counts]
    assert mine and [missing(block, header) for block in mine] == [[]] * len(mine)


def figures(page: str, row: str) -> list[str]:
    """Return the cells of the row of a page's table that begins with some words, without that first one."""
    (found,) = re.findall(rf"^\| {re.escape(row)} \|(.*)\|$", DOCS[page], re.MULTILINE)
    return [cell.strip() for cell in found.split("|")]


def measured() -> Iterator[tuple[str, str]]:
    """Yield options of `strapgen cost` and the instructions that pages state of them on a Cortex-M3."""
    (names,) = re.findall(r"^\| \| (window-7-7 \| pair-.*) \|$", DOCS["windows"], re.MULTILINE)
    for carry in ("none", "full"):
        stated = figures("windows", f"instructions, `--carry {carry}`")
        for name, figure in zip(names.split(" | "), stated, strict=True):
            yield f"euler --method {name} --carry {carry}", figure
    gyro = "--max-rate-deg-s 400 --sample-hz 100"
    for algorithm, row in (("euler", "Euler parameters"), ("dcm", "direction cosines")):
        (found,) = re.findall(rf"^\| {row} \| (\d+) \| (\d+) \| \d+ % \|$", DOCS["fixed-point"], re.MULTILINE)
        yield from zip([f"{algorithm} {gyro}", f"{algorithm} {gyro} --lsb 0.0175dps"], found, strict=True)
    (found,) = re.findall(r"takes (\d+) instructions in rad and (\d+) in counts", DOCS["fixed-point"])
    options = [f"euler {gyro} --state q31", f"euler {gyro} --lsb 0.0175dps --state q31"]
    yield from zip(options, found, strict=True)


@pytest.mark.long
@pytest.mark.needs("arm-none-eabi-gcc", "qemu-system-arm")
@pytest.mark.parametrize(("options", "figure"), [*measured()])
def test_instructions_on_pages_are_those_of_the_command(options, figure, capsys):
    (row,) = json.loads(run(f"strapgen cost {options} --cpu cortex-m3 --format json", capsys))
    if "12.2.1" not in row["compiler"]:
        pytest.skip(f"the pages have figures of arm-none-eabi-gcc 12.2.1, and this is {row['compiler']}")
    assert f"{row['executed']:,}" == figure


# The page on the lecture of 1984


def lecture_rows() -> list[tuple[set[int], str]]:
    """Return the equations and the rest of each row of the page on the lecture of 1984."""
    rows = []
    for first, rest in re.findall(r"^\| (\([\d() ,to]+\)) \|(.*)$", DOCS["two-speed"], re.MULTILINE):
        rows.append((equations(first), rest))
    return rows


def equations(text: str) -> set[int]:
    """Return the numbers that stand in parentheses, with those between the ends of a range."""
    numbers = set()
    for low, high in re.findall(r"\((\d+)\)(?: to \((\d+)\))?", text):
        numbers |= set(range(int(low), int(high or low) + 1))
    return numbers


def test_the_lecture_is_followed_from_its_first_equation_to_its_last():
    shown = [number for numbers, _ in lecture_rows() for number in numbers]
    assert sorted(shown) == [*range(1, 84)]


def test_kernels_have_the_equations_of_the_lecture_that_the_page_says():
    kernels = [
        (numbers, name) for numbers, rest in lecture_rows() for name in re.findall(r"`([a-z0-9-]+)`", rest)
    ]
    foreign = {
        "dcm-from-euler",
        "dcm-orthonormalize-first-order",
    }  # their source is the thesis, as the page says
    wrong = []
    for numbers, name in kernels:
        source = strapgen.derive(name).source
        if (SAVAGE not in source) if name not in foreign else (SAVAGE in source):
            wrong.append((name, source))
        elif name not in foreign and not numbers <= equations(source):
            wrong.append((name, sorted(numbers), source))
    assert len(kernels) > 30 and wrong == []


# The page on other tools


def test_the_page_on_other_tools_has_the_numbers_of_the_benchmark():
    """Compare the table with the rows of the first section of the results, which the benchmark writes."""
    section = (ROOT / "benchmarks" / "RESULTS.md").read_text().split("\n## ")[1]
    assert section.startswith("Euler parameters, two angle increments")
    rows = {
        cells[1]: cells
        for line in section.splitlines()
        if len(cells := [c.strip() for c in line.split("|")]) > 10
    }
    tools, ours = ("SymForce", "CasADi", "wrenfold"), rows["strapgen"]
    for kind, words in (("staged", "same textbook formulas"), ("transition", "given the transition form")):
        measured = [rows[f"{tool}, {kind}"] for tool in tools]
        for column, what in ((2, "multiplications"), (9, "ns a step")):
            values = " | ".join(row[column] for row in (ours, *measured))
            assert f"| {what}, {words} | {values} |" in DOCS["comparison"]
    values = " | ".join(row[11] for row in (ours, *(rows[f"{tool}, staged"] for tool in tools)))
    assert f"| ms from symbols to source | {values} |" in DOCS["comparison"]


# The page for reviewers


def plain(text: str) -> str:
    """Return a text with its comments' stars and line ends as single spaces."""
    return re.sub(r"\s+(?:\* )?\s*", " ", text)


#: What the page names beside the words of two files: kernels with other codes or limits, other settings, commands.
ELSEWHERE = {
    *("EULER_RK4_2_W32_TOO_FAR", "EULER_RK4_2_W32_FIRST_RESIDUALS", "LOW", "HIGH", "_div", "_rt", "_sat"),
    *("saturates", "in, out residuals", "N passed, N failed", "generate", "verify", "cost"),
}


def test_page_for_reviewers_quotes_generated_files():
    page, folder = DOCS["generated-code"], ROOT / "generated"
    names = ["c_fixed/euler_rk4_2_w32.h", "c_fixed/euler_rk4_2_w32.c", "c_float/euler_rk4_2_float.h"]
    texts = [(folder / name).read_text() for name in [*names, "c_float/euler_rk4_2_float.c"]]
    (code,) = blocks(page, "c")
    assert missing(code, texts[1]) == []
    held = plain("".join([*names, *texts]))
    prose = re.sub(r"^```.*?^```", "", page, flags=re.MULTILINE | re.DOTALL)
    spans = {span.replace("<NAME>", "EULER_RK4_2_W32") for span in re.findall(r"`([^`]+)`", prose)}
    parts = {
        part.strip()
        for span in spans
        if not re.match(r"[-/]|strapgen [a-z]", span)  # options of compilers, and commands
        for part in span.split("...")
    }
    assert len(parts) >= 40
    assert {part for part in parts if part not in held} <= ELSEWHERE
    assert set(re.findall(r"`(_\w+)`", prose)) - {"__FRAMAC__", "__FAST_MATH__", "__GNUC__"} == helpers() | {
        "_sat"
    }


def helpers() -> set[str]:
    """Return how the names of the helpers of the catalogue's fixed-point sources end."""
    ends = set()
    for path in (ROOT / "generated" / "c_fixed").glob("*.c"):
        ends |= set(re.findall(rf"^static .*?\b{path.stem}(_\w+)\(", path.read_text(), flags=re.MULTILINE))
    return ends


#: Scripts that compile or derive many kernels.
LONG_EXAMPLES = (
    "word_length_study",
    "coning_drift",
    "recorded_gyro",
    "compare_orders",
    "certified_bounds",
    "great_circle",
)


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, marks=pytest.mark.long if path.stem in LONG_EXAMPLES else (), id=path.stem)
        for path in sorted((ROOT / "examples").glob("*.py"))
    ],
)
def test_example(path, capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", [str(path)])
    namespace = runpy.run_path(str(path))
    if "algorithm" in namespace:  # for strapgen to load, see `strapgen check`
        kernel = namespace["algorithm"]()
        assert kernel.attitude_step is not None or kernel.takes_velocity
        return
    if "attitude" in namespace:  # a motion, which is checked as it is read
        assert strapgen.read_motion(path).functions.keys() == {"increments", "attitude", "rate"}
        return
    if "rate_expression" in namespace:  # a motion too, which is integrated
        assert strapgen.read_motion(path, 1).error_bound(1.0) < 1e-20
        return
    if path.stem.startswith("make_"):
        made, kept = namespace["text"](), namespace["LOG"].read_text()
        assert made.partition("\n")[0] == kept.partition("\n")[0]
        tables = (np.loadtxt(text.splitlines(), delimiter=",", skiprows=1) for text in (made, kept))
        # Versions of NumPy differ in the last place of a sine.
        np.testing.assert_allclose(*tables, rtol=1e-11, atol=1e-15)
        return
    namespace["main"]()
    assert capsys.readouterr().out.count("\n") >= 3


@pytest.mark.long
def test_example_prints_the_text_of_its_page(capsys):
    pattern = r"^    python examples/(\w+\.py)\n\n```text\n(.*?)^```"
    shown = [pair for text in DOCS.values() for pair in re.findall(pattern, text, re.MULTILINE | re.DOTALL)]
    assert len(shown) >= 3
    for name, text in shown:
        runpy.run_path(str(ROOT / "examples" / name))["main"]()
        assert capsys.readouterr().out == text


def test_the_demonstration_prints_a_function():
    """Its command for that is a pattern in the text of a generated file, and would print nothing without a word."""
    (command,) = re.findall(
        r"^\t@(sed -n .* generated/\S+)$", (ROOT / "Makefile").read_text(), flags=re.MULTILINE
    )
    done = subprocess.run(shlex.split(command), cwd=ROOT, capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    assert lines[0].startswith("void euler_rk1_2(") and lines[-1] == "}" and len(lines) > 10
