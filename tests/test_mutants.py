"""The faults of `make mutants`: each applies, the operators make what they say, and the tests of a line come first."""

from __future__ import annotations

import ast
import json
import random
import tomllib
from dataclasses import replace
from functools import cache
from itertools import accumulate
from pathlib import Path

import execution_map
import mutants
import mutation_operators
import pytest
from chosen_tests import ordered
from gathering import each
from mutation_operators import Site

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


def test_the_operators_count_characters_and_not_bytes():
    source = 'x = ["θ", 1 + 2]\n'
    assert 'x = ["θ", 1 - 2]' in changes(mutation_operators.of_python("f.py", source), source)


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


def test_shares_are_in_proportion_and_none_is_empty():
    assert mutation_operators._shares({"a": 1, "b": 900, "c": 99}, 13) == {"a": 1, "b": 10, "c": 2}


def test_a_line_belongs_to_the_innermost_block():
    assert execution_map.block_of_line(SOURCE, 6) == 3
    assert execution_map.block_of_line(SOURCE, 8) == 8
    assert execution_map.block_of_line(SOURCE, 2) is None


def test_probes_tell_what_runs(monkeypatch):
    blocks: set[int] = set()
    values: dict[str, object] = {execution_map._PROBE: blocks.add, "g": max}
    exec(compile(execution_map._probed(SOURCE, 100), "f.py", "exec"), values)
    assert values["f"](1) == "no"
    assert blocks == {103}
    assert values["f"].__doc__ == "Return 1 + 1."
    with pytest.raises(ValueError):
        values["f"](0)
    assert blocks == {103, 105}


@pytest.fixture
def tests() -> list[mutants.MappedTest]:
    base = execution_map._LINES
    return [
        mutants.MappedTest("tests/b/test_g.py::test_far", 0.1, frozenset({base + 3})),
        mutants.MappedTest("tests/b/test_f.py::test_mirrored", 0.1, frozenset({base + 3, base + 8})),
        mutants.MappedTest("tests/b/test_f.py::test_narrow", 0.1, frozenset({base + 3})),
        mutants.MappedTest("tests/b/test_f.py::test_other", 0.1, frozenset({base + 5})),
        mutants.MappedTest("tests/c/test_h.py::test_elsewhere", 0.1, frozenset({2 * base + 3})),
    ]


def test_the_tests_of_a_line_execute_it_and_the_nearest_come_first(tests):
    numbers = {"codegen/strapgen/b/f.py": 1}

    def names(line: int) -> list[str]:
        chosen = mutants.executing_tests("codegen/strapgen/b/f.py", line, SOURCE, tests, numbers)
        return [test.name.partition("::")[2] for test in chosen]

    assert names(6) == ["test_narrow", "test_mirrored", "test_far"]
    assert names(8) == ["test_mirrored"]
    assert set(names(1)) == {"test_narrow", "test_mirrored", "test_far", "test_other"}  # when it is imported


def test_the_first_session_has_two_cases_of_every_function_before_more(tests):
    cases = [mutants.MappedTest(f"tests/b/test_f.py::test_x[{k}]", 0.1, frozenset()) for k in range(4)]
    names = [test.name.partition("::")[2] for test in mutants.first_of([*cases, *tests])]
    assert names[:3] == ["test_x[0]", "test_x[1]", "test_far"]
    assert names[-2:] == ["test_x[2]", "test_x[3]"]
    long = mutants.MappedTest("tests/b/test_f.py::test_long", 2.0 * mutants.FIRST_S, frozenset())
    assert mutants.first_of([long, *tests]) == mutants.first_of(tests)


def test_the_second_session_begins_with_the_files_whose_tests_execute_most(tests):
    wide = mutants.MappedTest("tests/w.py::test_all", 1.0, frozenset(range(50)))
    narrow = mutants.MappedTest("tests/w.py::test_one", 1.0, frozenset())
    session = mutants.second_of([*tests, narrow, wide])
    assert session[:2] == [narrow, wide]
    assert set(session) == {*tests, narrow, wide}


def test_chosen_tests_come_in_their_order_and_others_after_them():
    names = list("abcde")
    assert ordered(names, {"first": ["d", "x", "b"], "without": ["c"], "others": True}) == [
        "d",
        "b",
        "a",
        "e",
    ]
    assert ordered(names, {"first": ["d", "b"], "without": [], "others": False}) == ["d", "b"]


@each(
    ("status", "by"),
    [
        (0, None),
        (5, None),
        (1, "t::failed"),
        (None, "time or memory, in t::running"),
        (-11, "signal 11, in t::running"),
    ],
)
def test_a_fault_is_noticed_by_a_failure_a_crash_or_a_test_without_end(status, by):
    assert mutants.verdict(status, "t::failed", "t::running") == by


def test_the_requirement_is_all_written_and_most_drawn_faults():
    def fault(part: str, number: int) -> mutants.Fault:
        return mutants.Fault(part, Site("f.py", number, number, "", "sign"), number, f"a{number}", "b")

    draw = mutants.DRAWS["random"]
    listed = [fault("seeded", k) for k in range(2)] + [fault("random", k) for k in range(draw.count)]
    outcomes = {f.key: mutants.Outcome(f.key, "caught", "a test", 1.0) for f in listed}
    assert mutants.summary(listed, outcomes)[1]
    spared = random.Random(0).sample(listed[2:], draw.count - draw.least)
    few = outcomes | {f.key: mutants.Outcome(f.key, "survived", "", 9.0) for f in spared}
    lines, met = mutants.summary(listed, few)
    assert met
    assert sum("survived" in line for line in lines) == len(spared)
    assert "a test" in mutants.table(listed, few)
    for fault_too_many in (listed[0], next(f for f in listed[2:] if f not in spared)):
        del few[fault_too_many.key]
        assert not mutants.summary(listed, few)[1]
        few[fault_too_many.key] = outcomes[fault_too_many.key]


def test_tests_that_read_the_lists_of_faults_notice_none():
    assert (mutants.ROOT / mutants.ABOUT_FAULTS).samefile(__file__)
    assert f"--ignore={mutants.ABOUT_FAULTS}" in mutants.command(["-x"])


def test_a_fault_is_put_into_a_copy_and_taken_out_again(tmp_path, monkeypatch):
    monkeypatch.setattr(mutants, "ROOT", tmp_path / "root")
    for folder in ("root", "copy"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "f.py").write_text(SOURCE)
    place = SOURCE.index("x + (y")
    fault = mutants.Fault("seeded", Site("f.py", place, place + 5, "x - (", "sign"), 6, "", "")
    copy = tmp_path / "copy" / "f.py"
    mutants.put(tmp_path / "copy", fault, 1)
    first = copy.stat().st_mtime_ns
    assert "x - (y" in copy.read_text()
    mutants.take_out(tmp_path / "copy", fault, 2)
    assert copy.read_text() == SOURCE == (tmp_path / "root" / "f.py").read_text()
    assert copy.stat().st_mtime_ns // 10**9 != first // 10**9


def test_a_fault_meets_first_what_noticed_it_before_in_whatever_line_it_stands(tests, tmp_path, monkeypatch):
    monkeypatch.setattr(mutants, "ROOT", tmp_path)
    file = "codegen/strapgen/b/f.py"
    (tmp_path / file).parent.mkdir(parents=True)
    (tmp_path / file).write_text(SOURCE)
    place = SOURCE.index("x + (y")
    fault = mutants.Fault("seeded", Site(file, place, place + 5, "x - (", "sign"), 6, "x + (y", "x - (y")
    first, *_ = mutants.sessions_of(fault, tests, {file: 1}, "tests/c/test_h.py::test_elsewhere")
    assert first.tests[0].name == "tests/c/test_h.py::test_elsewhere"
    assert len(first.tests) == len(set(first.tests)) > 1
    state = tmp_path / "state"
    (tmp_path / "noticed.jsonl").write_text(
        json.dumps({"fault": fault.lasting_key, "test": "t::last"}) + "\n"
    )
    moved = replace(fault, line=60)
    assert mutants.noticed_before(state)[moved.lasting_key] == "t::last"
    assert mutants.noticed_before(tmp_path / "other" / "state") == {}


@pytest.mark.long
def test_the_longer_draw_takes_its_faults_from_the_way_to_integers_and_text():
    drawn = mutants.faults("lowering", mutants.SEED)
    assert len({fault.key for fault in drawn}) == mutants.DRAWS["lowering"].count == 200
    folders = {Path(fault.site.file).parts[2] for fault in drawn}
    assert folders == {"fixedpoint", "lowering", "targets"}
