"""Every result that is a table is written as text, JSON, CSV, Markdown and LaTeX, into files or not."""

from __future__ import annotations

import csv
import io
import json
import re
import shlex
from importlib.util import find_spec
from pathlib import Path

import pytest

from strapgen.cli import main
from strapgen.results import figures
from strapgen.run.backends import BACKENDS

RUN = "--motion constant --set y_deg_s=10 --step 0.5 --duration 1"
WAVE = "--step 0.02 --frequency-hz 10 --theta-x-rad 0.01 --theta-y-rad 0.02 --phase-rad 1.1"
#: Commands with what their first column is called, and the number of rows.
TABLES = {
    "list": ("kind", None),
    "list backends": ("name", len(BACKENDS)),
    "tableau rk4": ("row", 5),
    "coning --samples 3": ("older", 2),
    "window show window-3-3": ("name", 50),
    "derive dcm --method rk1 --show operations": ("operation", None),
    "derive dcm --method rk1 --show program": ("name", None),
    f"simulate euler {RUN}": ("time_s", 3),
    f"compare euler --method rk1,rk2 --backend numpy,exact {RUN}": ("backend", 4),
    "converge euler --method rk1 --step 1/2,1/4 --duration 1 --backend numpy,exact": ("kernel", 4),
    "stability dcm --method rk1,rk2": ("step", 2),
    "series euler --all --method rk1": ("kernel", 1),
    f"vibration euler --method rk1,rk2 {WAVE}": ("kernel", 2),
    "rate-table --algorithm dcm --backend numpy --duration 1": ("motion", 12),
    "study word-length --method rk1 --word 16 --carry none --duration 1": ("algorithm", 1),
    "frontier --method rk4:2,rk4:4 --duration 1 --jobs 1": ("algorithm", 2),
}


@pytest.fixture
def answer(capsys, tmp_path, monkeypatch):
    """Return a function that runs a command line in a folder of its own and returns what it prints."""
    monkeypatch.chdir(tmp_path)

    def run(command: str) -> str:
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(command))
        said = capsys.readouterr()
        assert stop.value.code == 0, said.err
        return said.out

    return run


#: Commands of `TABLES` that draw with one of their formats, with the axis of x; `make test-long` draws them to the end.
DRAWN = {"compare": "time, s", "rate-table": "largest drift of the run, deg"}


@pytest.mark.long
@pytest.mark.parametrize("command", TABLES)
def test_a_table_has_the_same_rows_in_every_format(answer, tmp_path, monkeypatch, command):
    def label_of_x(figure, path):
        figures.pyplot().close(figure)
        return figure.axes[0].get_xlabel().encode()

    monkeypatch.setattr(figures, "image", label_of_x)
    first, count = TABLES[command]
    rows = list(csv.DictReader(io.StringIO(answer(f"{command} --format csv"))))
    assert next(iter(rows[0])) == first
    assert count in (None, len(rows))
    marked = answer(f"{command} --format markdown").splitlines()
    assert len(marked) == len(rows) + 2
    assert re.fullmatch(r"\|( :?-+:? \|)+", marked[1])
    width = {line.replace(r"\|", "").count("|") for line in marked}
    assert len(width) == 1
    typeset = answer(f"{command} --format latex")
    assert typeset.count("\\begin{") == typeset.count("\\end{") > 0
    drawn = DRAWN.get(command.split()[0], "") if find_spec("matplotlib") else ""
    json.loads(answer(f"{command} --format json{' --plot drawn.svg' if drawn else ''}"))
    assert not drawn or (tmp_path / "drawn.svg").read_text() == drawn


def test_a_dash_is_the_terminal_and_a_file_holds_the_same(answer, tmp_path):
    printed = answer("coning --samples 2 --format markdown")
    assert answer("coning --samples 2 --format markdown --out -") == printed
    assert not list(tmp_path.iterdir())
    assert answer("coning --samples 2 --format markdown --out pairs.md") == ""
    assert (tmp_path / "pairs.md").read_text() == printed


@pytest.mark.long
def test_a_course_is_plotted_and_written_as_a_table(answer, tmp_path):
    pytest.importorskip("matplotlib")
    log = Path(__file__).resolve().parents[2] / "examples" / "inertial_log.csv"
    run = f"strapdown dcm --increments-csv {log} --fast-cycles 4 --slow-cycles 50"
    assert answer(f"{run} --format markdown --plot course.svg").startswith("| time_s | C_11 |")
    assert "heading, deg" in (tmp_path / "course.svg").read_text()


def test_several_back_ends_stand_side_by_side_without_more_words(answer):
    said = answer("converge euler --method rk1 --step 1/2,1/4 --duration 1 --backend numpy,exact")
    assert said.splitlines()[3].split("  ")[-2:] == ["euler-rk1-2, numpy", "euler-rk1-2, exact"]


def test_one_kind_of_names_is_listed(answer):
    every = json.loads(answer("list --format json"))
    schema = {"schema": every.pop("schema")}
    for kind in every:
        assert json.loads(answer(f"list {kind} --format json")) == {**schema, kind: every[kind]}
    assert answer("list method") == answer("list methods")
    lines = answer("list methods").splitlines()
    assert [line.split()[0] for line in lines] == list(every["methods"])
    assert lines[0].split(maxsplit=1)[1] == every["methods"]["rk1"]


def test_the_title_of_a_run_has_the_parameters_of_its_motion(answer):
    assert "motion constant (y_deg_s=10), step_s 0.5" in answer(f"simulate euler {RUN}").splitlines()[0]


def test_aliases_and_lists_give_what_the_singular_options_give(answer):
    run = f"--method rk1 --format csv {RUN}"
    one, other = (
        [
            row["max_abs_rad"]
            for row in csv.DictReader(io.StringIO(answer(f"compare euler {option} exact {run}")))
        ]
        for option in ("--backend", "--backends")
    )
    assert one == other
    assert answer("stress --algorithms dcm --backends numpy --duration 1") == answer(
        "rate-table --algorithm dcm --backend numpy --duration 1"
    )


def test_several_methods_stand_side_by_side(answer):
    said = answer("series euler --method rk1,rk2 --motion constant --terms 1 --format json")
    assert [one["kernel"] for one in json.loads(said)["results"]] == ["euler-rk1-2", "euler-rk2-2"]
    said = answer(f"compare dcm --method rk1,rk2 --backend exact {RUN}")
    assert [line.split(":")[0] for line in said.splitlines() if ": constant motion" in line] == [
        "dcm-rk1-2",
        "dcm-rk2-2",
    ]
    assert "y_deg_s=10" in said
