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
from strapgen.cli.output import Output
from strapgen.ir.exceptions import InputError
from strapgen.results import figures
from strapgen.results.table import ANGLE, ERROR, Column, TextTable
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
    run = f"strapdown dcm --recording {log} --fast-cycles 4 --slow-cycles 50"
    assert answer(f"{run} --format markdown --plot course.svg").startswith("| time_s | C_11 |")
    assert "heading, deg" in (tmp_path / "course.svg").read_text()


def test_several_back_ends_stand_side_by_side_without_more_words(answer):
    said = answer("converge euler --method rk1 --step 1/2,1/4 --duration 1 --backend numpy,exact")
    assert said.splitlines()[3].split("  ")[-2:] == ["euler-rk1-2, numpy", "euler-rk1-2, exact"]


def test_one_kind_of_names_is_listed(answer):
    every = json.loads(answer("list --format json"))
    schema = {"schema": every.pop("schema")}
    for kind in every:
        said = json.loads(answer(f"list {kind} --format json"))
        assert ("groups" in said) == (kind == "kernels")
        assert {key: said[key] for key in said if key != "groups"} == {**schema, kind: every[kind]}
    assert answer("list method") == answer("list methods")
    lines = answer("list methods").splitlines()
    assert [line.split()[0] for line in lines] == list(every["methods"])
    assert lines[0].split(maxsplit=1)[1] == every["methods"]["rk1"]


def test_the_title_of_a_run_has_the_parameters_of_its_motion(answer):
    assert "motion constant (y_deg_s=10), step_s 0.5" in answer(f"simulate euler {RUN}").splitlines()[0]


def test_aliases_and_lists_equal_singular_options(answer):
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


SHORT = "--motion constant --set x_deg_s=1 --step 0.125 --duration 1"
WITH_PLOTS = (
    f"simulate euler {SHORT}",
    "converge euler --method rk1 --steps 1/2,1/4",
    "series euler --method rk1 --motion constant",
    "study word-length --words 16 --carries none --duration 1",
    f"compare euler {SHORT}",
    "tables --table 1",
    "rate-table --duration 1",
)


def test_the_result_is_printed_or_written_and_stderr_names_the_files(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Output().deliver("1\n2\n\n")
    assert capsys.readouterr() == ("1\n2\n", "")
    Output(Path("folder/run.txt"), Path("run.png")).deliver("1\n2\n", b"image")
    assert capsys.readouterr() == ("", "wrote folder/run.txt and run.png\n")
    assert (tmp_path / "folder" / "run.txt").read_text() == "1\n2\n"
    assert (tmp_path / "run.png").read_bytes() == b"image"
    Output(plot=Path("other.png")).deliver("1", b"image")
    assert capsys.readouterr() == ("1\n", "wrote other.png\n")


def test_nothing_is_written_where_one_file_cannot_be(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run.txt").write_text("of yesterday")
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(InputError, match="cannot be written"):
        Output(Path("run.txt"), Path("taken/run.png")).deliver("1", b"image")
    assert capsys.readouterr() == ("", "")
    assert (tmp_path / "run.txt").read_text() == "of yesterday"


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("command", WITH_PLOTS)
def test_a_plot_that_cannot_be_written_is_refused_before_the_run(tmp_path, monkeypatch, capsys, command):
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    for files, line in (
        ("--out run.png --plot ./run.png", "--out and --plot are both run.png; two files are needed\n"),
        ("--plot run.docx", "plot run.docx: file type 'docx' is not known; allowed: "),
    ):
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(f"{command} {files}"))
        said = capsys.readouterr()
        assert (stop.value.code, said.out) == (2, "")
        assert said.err.startswith(f"strapgen: {line}") and said.err.count("\n") == 1
        assert not list(tmp_path.iterdir())


def test_command_names_written_files_and_prints_only_its_result(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(f"simulate euler {SHORT} --format csv --out out/attitude.csv"))
    assert (stop.value.code, *capsys.readouterr()) == (0, "", "wrote out/attitude.csv\n")
    with pytest.raises(SystemExit):
        main(shlex.split(f"simulate euler {SHORT} --format csv"))
    said = capsys.readouterr()
    assert (said.out, said.err) == ((tmp_path / "out" / "attitude.csv").read_text(), "")


def test_a_file_that_a_command_reads_is_not_written_over(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    log = "t,dx,dy,dz\n" + "".join(f"{k / 100},0,0,0.001\n" for k in range(1, 9))
    Path("log.csv").write_text(log)
    Path("link.csv").symlink_to("log.csv")
    for out in ("--out log.csv", "--out ./log.csv", "--out link.csv", "--plot log.csv"):
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(f"simulate euler --recording log.csv {out}"))
        said = capsys.readouterr()
        assert (stop.value.code, said.out) == (2, "")
        assert "is a file that the command reads; another one is needed" in said.err
    assert Path("log.csv").read_text() == log


COLUMNS = (
    Column("name", "<"),
    Column("drift, deg", spec=ANGLE),
    Column("error", spec=ERROR, gap=4),
    Column("most from", "<"),
)
ROWS = (("euler", 0.123456, 1e-12, "rounding"), ("two-speed", None, 2, ""))


def test_columns_are_as_wide_as_their_widest_cell():
    assert TextTable(COLUMNS, ROWS).lines() == [
        "name       drift, deg        error  most from",
        "euler           0.123    1.000e-12  rounding",
        "two-speed           -    2.000e+00",
    ]


def test_no_line_ends_in_spaces_and_all_have_the_indent():
    text = TextTable(COLUMNS, ROWS).as_text("  ")
    assert all(line == "  " + line.strip() for line in text.splitlines())


def test_a_table_without_headers_has_rows_alone():
    rows = [("a", 1), ("long", 20)]
    assert TextTable([Column(align="<"), Column()], rows).lines() == ["a      1", "long  20"]
    assert TextTable([Column(align="<"), Column()], []).lines() == []


def test_a_wide_cell_widens_its_column_in_every_row_and_under_its_title():
    columns = [
        Column("s", spec=".0f", least=2, group="t"),
        *(Column(a, least=3, gap=gap, group="rate") for a, gap in (("x", 2), ("y", 1))),
    ]
    assert TextTable(columns, [(1, 2, 3)]).lines() == [" t   rate", " s    x   y", " 1    2   3"]
    assert TextTable(columns, [(1, 2, 3), (1000, 2, 3)]).lines() == [
        "   t   rate",
        "   s    x   y",
        "   1    2   3",
        "1000    2   3",
    ]


def test_csv_has_numbers_in_full_and_an_empty_cell_for_none():
    read = list(csv.reader(TextTable(COLUMNS, ROWS).as_csv().splitlines()))
    assert read == [
        ["name", "drift, deg", "error", "most from"],
        ["euler", "0.123456", "1e-12", "rounding"],
        ["two-speed", "", "2", ""],
    ]


def test_markdown_has_the_cells_of_the_text_and_their_alignment():
    lines = (
        TextTable((*COLUMNS, Column("x", "^", group="rate")), [(*ROWS[0], "a|b")]).as_markdown().splitlines()
    )
    assert lines == [
        "| name | drift, deg | error | most from | rate x |",
        "| :-- | --: | --: | :-- | :-: |",
        r"| euler | 0.123 | 1.000e-12 | rounding | a\|b |",
    ]


@pytest.mark.parametrize("row", [("euler",), ("euler", 1, 2, "rounding", "more")])
def test_a_row_that_does_not_fit_its_columns_is_refused(row):
    with pytest.raises(ValueError, match=r"zip"):
        TextTable(COLUMNS, [row]).lines()


def test_latex_has_rules_powers_of_ten_and_no_characters_that_it_reads_otherwise():
    rows = [("a_b & 50%", -0.5, 1e-12, "x < y"), ("c", None, 2, "")]
    assert TextTable(COLUMNS, rows).as_latex().splitlines() == [
        r"\begin{tabular}{lrrl}",
        r"\hline",
        r"name & drift, deg & error & most from \\",
        r"\hline",
        r"a\_b \& 50\% & $-0.5$ & $1.000 \cdot 10^{-12}$ & x $<$ y \\",
        r"c & - & $2.000 \cdot 10^{0}$ &  \\",
        r"\hline",
        r"\end{tabular}",
    ]


def test_latex_has_a_second_table_for_columns_that_a_page_does_not_hold():
    columns = [Column("name", "<"), *(Column(f"a long column {k}") for k in range(8))]
    text = TextTable(columns, [("x", *range(8))]).as_latex()
    assert text.count(r"\begin{tabular}") == 3
    assert text.count("name &") == 3 and text.count("a long column 7") == 1


def test_latex_has_another_table_for_rows_that_a_page_does_not_hold():
    text = TextTable([Column("name", "<"), Column("n")], [("x", n) for n in range(100)]).as_latex()
    assert text.count(r"\begin{tabular}{lr}") == 3 and text.count("name & n") == 3
    assert all(f"x & {n} " in text for n in range(100))


def test_html_has_the_text_of_the_cells():
    text = TextTable(COLUMNS, [("<b>", 0.5, 1e-12, "")]).as_html("a caption & more")
    assert "&lt;b&gt;" in text and "<b>" not in text and "a caption &amp; more" in text
    assert '<td style="text-align:right">1.000e-12</td>' in text
    assert text.count("<th ") == 4
