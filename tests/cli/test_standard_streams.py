"""The word - for standard input and output, wherever text is read or written."""

import io
import shlex
import sys
from pathlib import Path

import pytest

from strapgen.cli import main
from strapgen.storage import streams

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
METHODS = ROOT / "codegen/strapgen/catalogue/methods"


class Input(io.StringIO):
    """Text on standard input."""

    @property
    def buffer(self):
        """The bytes below it."""
        return io.BytesIO(self.getvalue().encode())


@pytest.fixture
def said(monkeypatch, capsys):
    """Return the status, the output and the errors of a command line with a text on standard input."""

    def run(line: str, text: str = "") -> tuple[int, str, str]:
        streams._standard_input.cache_clear()
        monkeypatch.setattr(sys, "stdin", Input(text))
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(line))
        streams._standard_input.cache_clear()
        return int(stop.value.code or 0), *capsys.readouterr()

    return run


@pytest.mark.parametrize(
    ("line", "file"),
    [
        ("simulate euler --gaps bridge --recording {}", EXAMPLES / "gyro_log.csv"),
        ("tableau {}", EXAMPLES / "heun3.toml"),
        ("derive dcm --tableau {}", METHODS / "butcher_tableaux/butcher5.toml"),
        ("window show {}", METHODS / "window_filters/window-3-3.toml"),
        ("system {}", EXAMPLES / "attitude.toml"),
        ("redundancy {}", EXAMPLES / "hexad.toml"),
        ("kalman {}", EXAMPLES / "kalman/gyrocompass.toml"),
        ("vibration euler --step 0.005 --spectrum {}", EXAMPLES / "vibration.csv"),
        ("derive torques --layout {}", EXAMPLES / "layouts/turned.toml"),
    ],
)
def test_standard_input_is_read_as_a_file_is(line, file, said):
    text = file.read_text(encoding="utf-8")
    status, output, _ = said(line.format("-"), text)
    assert status == 0 and output
    named = said(line.format(shlex.quote(str(file))))[1]
    for name in (str(file), file.name):
        named = named.replace(name, "-")
    assert named.replace("(attitude,", "(system,") == output


def test_what_is_wrong_in_standard_input_has_one_line(said):
    status, output, error = said("simulate euler --recording -", "a,b\n1,2\n")
    assert (status, output) == (2, "") and error.startswith("strapgen: -")
    status, output, error = said("derive dcm --tableau -", "a = [")
    assert (status, output) == (2, "") and error.startswith("strapgen: - is not TOML")


def test_standard_input_is_read_once(said):
    assert said("simulate euler --recording - --errors x.toml --tableau -") == (
        2,
        "",
        "strapgen: --tableau and --recording are both -; standard input is read once\n",
    )


def test_one_file_is_printed(said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert said("generate dcm --target numpy,c --out made")[0] == 0
    assert said("generate dcm --out -")[:2] == (0, (tmp_path / "made/dcm_rk4_2.py").read_text())
    for ending in (".h", ".c", "dcm_rk4_2.c"):
        name = ending if ending[0] != "." else f"dcm_rk4_2{ending}"
        assert said(f"generate dcm --target c --out - --file {ending}")[1] == (
            tmp_path / "made" / name
        ).read_text(encoding="utf-8")
    assert [path.name for path in tmp_path.iterdir()] == ["made"]


def test_one_file_is_written_alone(said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert said("generate dcm --target c --out made --file .h")[0] == 0
    assert [path.name for path in (tmp_path / "made").iterdir()] == ["dcm_rk4_2.h"]


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ("--target c --out -", "--out - prints one file; --file chooses it of dcm_rk4_2.h, dcm_rk4_2.c"),
        ("--target c --file .x", "--file .x is none of the files, which are dcm_rk4_2.h, dcm_rk4_2.c"),
        (
            "--target c --file 2.h,2.c",
            "--file 2.h,2.c is none of the files, which are dcm_rk4_2.h, dcm_rk4_2.c",
        ),
        ("--target numpy,c --file m_rk4_2.c", "--file m_rk4_2.c is none of the files, which are"),
        ("--out - --check", "--out - prints one file; --check does not go with it"),
        ("--out - --format json", "--out - prints one file; --format json does not go with it"),
    ],
)
def test_several_files_are_not_printed(words, error, said):
    status, output, line = said(f"generate dcm {words}")
    assert (status, output) == (2, "") and line.startswith(f"strapgen: {error}")


def test_the_catalogue_is_not_printed(said):
    assert said("generate --all --out -")[2].endswith("; --out - does not go with it\n")


def test_a_header_that_reads_standard_input_is_not_verified(said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tableau = (METHODS / "butcher_tableaux/butcher5.toml").read_text(encoding="utf-8")
    assert said("generate dcm --tableau - --target c --out made", tableau)[0] == 0
    file = next((tmp_path / "made").glob("*.h"))
    status, _, line = said(f"verify made/{file.name}", tableau)
    assert status == 2 and "reads standard input, which nobody has kept" in line
