"""The faults of `make mutants`: each applies, the operators make what they say, and the tests of a line come first."""

from __future__ import annotations

import ast
import time
import tomllib
from functools import cache
from itertools import accumulate
from pathlib import Path

import mutants
import mutation_operators
import pytest
from coverage import CoverageData
from mutation_operators import Site

pytestmark = pytest.mark.posix

SOURCE = '''\
"""A sum - of 2 terms."""
def f(x: int, y=2):
    """Return 1 + 1."""
    if not x:
        raise ValueError(f"{x} < 1")
    total = x + (y << 3)
    while total < y and total != 4:
        total = min(g(x, y), -total)
    return "no" if total else "yes" + "1"
'''


def changes(sites: list[Site], source: str) -> set[str]:
    """Return the lines that faults lead to."""
    return {site.applied(source).splitlines()[site.line(source) - 1].strip() for site in sites}


@cache
def statements(source: str) -> list[tuple[int, int]]:
    """Return the span of every statement of a module."""
    starts = [0, *accumulate(map(len, source.splitlines(keepends=True)))]
    return [(starts[node.lineno - 1], starts[node.end_lineno or 0]) for node in ast.parse(source).body]


@pytest.mark.long
def test_every_written_fault_applies_once_and_leaves_a_file_that_can_be_read():
    written = mutants.seeded()
    assert len({site for site, _ in written}) == len(written) >= 40
    for site, breaks in written:
        source = (mutants.ROOT / site.file).read_text()
        changed = site.applied(source)
        assert breaks
        assert changed != source
        if site.file.endswith(".py"):
            start, end = next(span for span in statements(source) if span[0] <= site.start < span[1])
            before, after = source[start:end], changed[start : end + len(changed) - len(source)]
            assert ast.dump(ast.parse(after)) != ast.dump(ast.parse(before)), site
        elif site.file.endswith(".toml"):
            assert tomllib.loads(changed) != tomllib.loads(source), site


def test_faults_that_no_test_notices_stand_with_a_reason():
    told = tomllib.loads(mutants.UNNOTICED.read_text())["fault"]
    assert len(mutants.reasons()) == len(told)
    for entry in told:
        lines = " ".join((mutants.ROOT / entry["file"]).read_text().split())
        assert entry["before"] in lines, entry
        assert entry["before"] != entry["after"]
        assert len(entry["reason"].split()) >= 5


def test_written_faults_lie_in_every_folder_that_computes():
    folders = {Path(site.file).parts[2] for site, _ in mutants.seeded() if site.file.startswith("codegen/")}
    assert folders >= set(mutation_operators.FOLDERS) - {"ir"}
    assert sum(site.file.startswith("templates/") for site, _ in mutants.seeded()) >= 3


def test_the_operators_change_signs_terms_bounds_shifts_and_conditions():
    lines = changes(mutation_operators.of_python("f.py", SOURCE), SOURCE)
    assert lines >= {
        "total = x - (y << 3)",
        "total = (x)",
        "total = x + (y >> 3)",
        "total = x + (y << 4)",
        "total = x + (y << 2)",
        "if (x):",
        "while total <= y and total != 4:",
        "while total < y or total != 4:",
        "while total < y and total == 4:",
        "while (not (total < y and total != 4)):",
        "total = max(g(x, y), -total)",
        "total = min(g(y, x), -total)",
        "total = min(g(x, y), (total))",
        "def f(x: int, y=3):",
    }


def test_the_operators_leave_texts_and_messages_alone():
    numbers = {site.line(SOURCE) for site in mutation_operators.of_python("f.py", SOURCE)}
    assert numbers == {2, 4, 6, 7, 8}


def test_templates_change_in_their_code_and_not_in_comments():
    source = "/* a + b << 1 */\n{% if a == b %}\n    x += y << {{ a }} && 2 * z;\n"
    assert changes(mutation_operators.of_template("t.c.j2", source), source) == {
        "x -= y << {{ a }} && 2 * z;",
        "x += y >> {{ a }} && 2 * z;",
        "x += y << {{ a }} || 2 * z;",
        "x += y << {{ a }} && 3 * z;",
    }


@pytest.mark.long
def test_a_draw_has_all_folders_and_all_kinds_and_is_the_same_for_the_same_seed():
    sites = mutation_operators.sites(mutants.ROOT)
    drawn = mutation_operators.drawn(sites, mutants.ROOT, 40, 1)
    assert drawn == mutation_operators.drawn(sites, mutants.ROOT, 40, 1)
    assert drawn != mutation_operators.drawn(sites, mutants.ROOT, 40, 2)
    assert len(set(drawn)) == 40
    folders = {Path(site.file).parts[2 if site.file.startswith("codegen") else 0] for site in drawn}
    assert folders == {*mutation_operators.FOLDERS, "templates"}
    assert len({site.kind for site in drawn}) >= 8


@pytest.fixture
def executed(tmp_path) -> CoverageData:
    data = CoverageData(str(tmp_path / "coverage"))
    for test, lines in {
        "": [1],
        "tests/b/test_g.py::test_far|run": [6],
        "tests/b/test_f.py::test_mirrored[1]|run": [6, 8],
        "tests/b/test_f.py::test_mirrored[2]|setup": [6],
        "tests/c/test_h.py::test_elsewhere|run": [9],
    }.items():
        data.set_context(test)
        data.add_lines({"codegen/strapgen/b/f.py": lines})
    return data


def test_the_tests_of_a_line_execute_it_and_the_nearest_come_first(executed):
    def names(line: int) -> list[str]:
        found = mutants.executing(executed, "codegen/strapgen/b/f.py", line)
        return [test.partition("::")[2] for test in found]

    assert names(6) == ["test_mirrored", "test_far"]
    assert names(8) == ["test_mirrored"]
    assert names(1) == ["test_mirrored", "test_far", "test_elsewhere"]  # when it is imported


@pytest.mark.parametrize(
    ("status", "said", "result"),
    [
        (0, "1 passed", ("passed", "")),
        (5, "no tests ran", ("passed", "")),
        (4, "ERROR: not found: tests/a.py::test_b", ("passed", "")),
        (4, "ImportError while loading conftest", ("failed", "status 4")),
        (1, "x\nFAILED tests/a.py::test_b[1 - 2] - assert 1\n", ("failed", "tests/a.py::test_b[1")),
        (2, "ERROR tests/a.py\n", ("failed", "tests/a.py")),
        (-11, "", ("failed", "status -11")),
    ],
)
def test_a_fault_is_noticed_by_a_failure_a_crash_or_an_import(status, said, result):
    assert mutants.verdict(status, said) == result


def test_the_requirement_is_all_written_and_most_drawn_faults():
    def fault(part: str, number: int) -> mutants.Fault:
        return mutants.Fault(part, Site("f.py", number, number, "", "sign"), number, f"{part}{number}", "b")

    draw = mutants.DRAWS["random"]
    listed = [fault("seeded", k) for k in range(2)] + [fault("random", k) for k in range(draw.count)]
    caught = {f.key: ("caught", "a test") for f in listed}
    few = caught | {f.key: ("survived", "") for f in listed[2 + draw.least :]}
    lines, met = mutants.summary(listed, few)
    assert met
    assert sum("survived" in line for line in lines) == draw.count - draw.least
    for fault_too_many in listed[1:3]:
        known = {key: outcome for key, outcome in few.items() if key != fault_too_many.key}
        assert not mutants.summary(listed, known)[1]


def test_tests_that_read_the_lists_of_faults_notice_none():
    assert (mutants.ROOT / mutants.ABOUT_FAULTS).samefile(__file__)
    assert f"--ignore={mutants.ABOUT_FAULTS}" in mutants.command(["-x"])


@pytest.mark.long
@pytest.mark.parametrize(("text", "outcome"), [("return 2", "caught"), ("return 1 + 0", "survived")])
def test_a_fault_is_put_into_a_copy_and_noticed_or_not(text, outcome, tmp_path, monkeypatch):
    root = tmp_path / "root"
    files = {
        "codegen/strapgen/__init__.py": "",
        "codegen/strapgen/f.py": "def f():\n    return 1\n",
        "tests/test_f.py": "from strapgen import f\ndef test_f():\n    assert f.f() == 1\n",
        "pyproject.toml": "[tool.pytest.ini_options]\nmarkers = ['long']\n"
        "[tool.coverage.run]\nrelative_files = true\n",
    }
    for name, content in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(content)
    monkeypatch.setattr(mutants, "ROOT", root)
    monkeypatch.setattr(mutants, "_files", lambda: [*files])
    start = files["codegen/strapgen/f.py"].index("return 1")
    fault = mutants.Fault.of("seeded", Site("codegen/strapgen/f.py", start, start + 8, text, "term"))
    (tmp_path / "state").mkdir()
    runner = mutants.Runner(tmp_path / "state", ["tests"], time.monotonic() + 300)
    mutants.run_all(runner, [fault], 1)
    by = "tests/test_f.py::test_f" if outcome == "caught" else ""
    assert mutants.outcomes(runner.state) == {fault.key: (outcome, by)}
    assert (runner.folder / "copy0" / "codegen/strapgen/f.py").read_text() == files["codegen/strapgen/f.py"]


@pytest.mark.long
def test_the_longer_draw_takes_its_faults_from_the_way_to_integers_and_text():
    drawn = mutants.faults("lowering", mutants.SEED)
    assert len({fault.key for fault in drawn}) == mutants.DRAWS["lowering"].count == 200
    folders = {Path(fault.site.file).parts[2] for fault in drawn}
    assert folders == {"fixedpoint", "lowering", "targets"}


@pytest.mark.parametrize(
    ("folder", "module"),
    [("c_fixed", "targets/c_fixed.py"), ("system_svg", "navigation/systems/system_drawing.py")],
)
def test_templates_are_filled_by_their_module(folder, module):
    assert mutants.filling(folder) == f"codegen/strapgen/{module}"
