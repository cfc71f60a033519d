"""The output of a command: on the terminal, or in files that are written whole or not at all."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from strapgen.cli import main
from strapgen.cli.output import Output
from strapgen.ir.exceptions import InputError

RUN = "--motion constant --set x_deg_s=1 --step 0.125 --duration 1"
WITH_PLOTS = (
    f"simulate euler {RUN}",
    "converge euler --method rk1 --steps 1/2,1/4",
    "series euler --method rk1 --motion constant",
    "study word-length --words 16 --carries none --duration 1",
    f"compare euler {RUN}",
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


def test_a_command_says_what_it_wrote_and_prints_its_result_alone(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(f"simulate euler {RUN} --format csv --out out/attitude.csv"))
    assert (stop.value.code, *capsys.readouterr()) == (0, "", "wrote out/attitude.csv\n")
    with pytest.raises(SystemExit):
        main(shlex.split(f"simulate euler {RUN} --format csv"))
    said = capsys.readouterr()
    assert (said.out, said.err) == ((tmp_path / "out" / "attitude.csv").read_text(), "")


def test_a_file_that_a_command_reads_is_not_written_over(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    log = "t,dx,dy,dz\n" + "".join(f"{k / 100},0,0,0.001\n" for k in range(1, 9))
    Path("log.csv").write_text(log)
    Path("link.csv").symlink_to("log.csv")
    for out in ("--out log.csv", "--out ./log.csv", "--out link.csv", "--plot log.csv"):
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(f"simulate euler --increments-csv log.csv {out}"))
        said = capsys.readouterr()
        assert (stop.value.code, said.out) == (2, "")
        assert "is a file that the command reads; another one is needed" in said.err
    assert Path("log.csv").read_text() == log
