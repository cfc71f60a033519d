"""Completion in bash, zsh and fish: names of options' values and arguments, nothing else, and no SymPy."""

import os
import re
import subprocess
import sys

import pytest

from strapgen import registration
from strapgen.cli import completion, main


@pytest.fixture
def completed(monkeypatch, capsys):
    """Return the words that a shell gets for a line."""

    def complete(line: str, shell: str = "bash", position: int | None = None) -> list[str]:
        monkeypatch.setenv("_STRAPGEN_COMPLETE", f"complete_{shell}")
        monkeypatch.setenv("COMP_WORDS" if shell == "bash" else "_TYPER_COMPLETE_ARGS", line)
        last = len(line.split("\n" if "\n" in line else " ")) - 1
        monkeypatch.setenv("COMP_CWORD", str(last if position is None else position))
        if shell == "fish":
            monkeypatch.setenv("_TYPER_COMPLETE_FISH_ACTION", "get-args")
        with pytest.raises(SystemExit) as stop:
            main([])
        said = capsys.readouterr()
        assert (said.err, stop.value.code) == ("", 0)
        if shell == "zsh":
            return re.findall(r'^(?:_arguments.*\(\()?"(\S*?)"', said.out, re.MULTILINE)
        return [word.partition("\t")[0] for word in said.out.split("\n") if word]

    return complete


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
@pytest.mark.parametrize(
    ("line", "some"),
    [
        ("strapgen gen", ["generate"]),
        ("strapgen study word", ["word-length"]),
        ("strapgen simulate euler --step 0.1 --du", ["--duration"]),
        ("strapgen derive cay", ["cayley-klein", "cayley-klein-product"]),
        ("strapgen derive euler --method rk", ["rk1", "rk2", "rk3", "rk4"]),
        ("strapgen compare euler --method rk4,magn", ["rk4,magnus4", "rk4,magnus6"]),
        ("strapgen simulate euler --motion con", ["constant", "coning"]),
        ("strapgen generate euler --target c", ["c", "c-fixed", "c-float", "cpp"]),
        ("strapgen compare euler --backend num", ["numpy"]),
        ("strapgen window show window-7", ["window-7-7"]),
        ("strapgen cost euler --cpu cortex-m", ["cortex-m0", "cortex-m3"]),
        ("strapgen compare euler --format j", ["json"]),
        ("strapgen coning --format t", ["text", "toml"]),
        ("strapgen generate euler --rounding t", ["truncation"]),
        ("strapgen list ker", ["kernels"]),
        ("strapgen schema comp", ["comparison"]),
        ("strapgen system two-speed-d", ["two-speed-dcm"]),
        ("strapgen study sensor-errors ins", ["ins-0.1", "ins-1"]),
        ("strapgen tableau butch", ["butcher5", "butcher6"]),
        ("strapgen evidence euler --tool ga", ["gappa"]),
        ("strapgen series euler --versus d", ["dcm"]),
        ("strapgen help ", ["generate", "study"]),
        ("strapgen help mon", []),
        ("strapgen help study mon", ["monte-carlo"]),
        ("strapgen simulate euler --motion coning --set a_", ["a_deg_s=", "a_rad_s="]),
        ("strapgen simulate --motion=cone --set half_angle_deg=1 --step 0.01 --set fr", ["frequency_hz="]),
        ("strapgen converge euler --motion coning --set a_deg_s=1 b_deg_s=2 g_d", ["g_deg_s="]),
        ("strapgen study word-length --set a_d", ["a_deg_s="]),
        ("strapgen study velocity-position --set ", ["rate_deg_s=", "rate_rad_s="]),
        ("strapgen study velocity-position --force lever --force-set x_m=1 y", ["y_m="]),
        ("strapgen study redundancy --set scale", ["scale_ppm="]),
        ("strapgen study pulse-torque --set gain=1 lag_", ["lag_gain=", "lag_pole=", "lag_s="]),
        ("strapgen study loops --set tilt_deg=2 --set h", ["heading_deg=", "height_m="]),
        ("strapgen study loops --set tilt_deg=2 --fo", ["--format"]),
    ],
)
def test_names_are_completed(line, some, shell, completed):
    words = completed(line, shell)
    assert {*some} <= {*words}
    assert all(word.startswith(line.rpartition(" ")[2]) for word in words)


def test_names_that_a_list_has_are_not_offered_again(completed):
    assert "rk4,rk4" not in completed("strapgen compare euler --method rk4,")


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("strapgen study loops --set tilt_deg=2 t", []),  # it is set
        ("strapgen study loops --set tilt_deg=", []),  # a number is needed
        ("strapgen simulate euler --set ", []),  # no motion has been named
        ("strapgen simulate euler --motion own.py --set ", []),
        ("strapgen help derive ", []),  # `help` takes the name of a command alone
        ("strapgen help nobody ", []),
        ("strapgen help derive --meth", []),
    ],
)
def test_nothing_is_offered_where_nothing_fits(line, offered, completed):
    assert completed(line) == offered


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("strapgen derive euler --method = rk", ["rk1", "rk2", "rk3", "rk4"]),
        ("strapgen study loops --set tilt_deg = 2 he", ["heading_deg=", "height_m="]),
        ("strapgen study loops --set tilt_deg =", []),
    ],
)
def test_bash_makes_equals_signs_words_of_their_own(words, offered, completed):
    assert completed(words.replace(" ", "\n")) == offered


def test_bash_has_words_behind_the_cursor(completed):
    assert completed("strapgen ge euler", position=1) == ["generate"]


def test_commands_of_a_package_are_groups_too(monkeypatch):
    monkeypatch.setattr(registration, "installed_commands", lambda: iter([("own fit", None, None)]))
    assert completion._is_group(["own"]) and not completion._is_group(["own", "fit"])


def test_variants_of_the_folder_are_completed(tmp_path, monkeypatch, completed):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "strapgen.toml").write_text('[variant.slow]\nalgorithm = "dcm"\n', encoding="utf-8")
    assert completed("strapgen derive --variant ") == ["slow"]
    assert completed("strapgen build s") == ["slow"]
    (tmp_path / "strapgen.toml").write_text("[variant", encoding="utf-8")
    assert completed("strapgen derive --variant ") == []


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
@pytest.mark.parametrize(
    "line",
    [
        "strapgen nowhere --st",
        "strapgen generate euler --out ",
        "strapgen derive euler --variant nobody --method ",
        "strapgen --version ",
        "strapgen derive euler --method rk4 --method ",
        "strapgen derive 'open ",
        "strapgen derive euler --increments -",
        "",
    ],
)
def test_lines_that_are_wrong_are_no_mistake(line, shell, completed):
    assert not [word for word in completed(line, shell) if " " in word]


@pytest.mark.parametrize("shell", ["bash", "zsh", "tcsh", ""])
def test_a_shell_that_says_too_little_gets_no_error(shell, monkeypatch, capsys):
    monkeypatch.setenv("_STRAPGEN_COMPLETE", f"complete_{shell}")
    for name in ("COMP_WORDS", "COMP_CWORD", "_TYPER_COMPLETE_ARGS"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(SystemExit) as stop:
        main([])
    assert (capsys.readouterr().err, stop.value.code) == ("", 0)


@pytest.mark.parametrize(("line", "files"), [("strapgen generate euler --out ", 1), ("strapgen derive ", 0)])
def test_fish_completes_files_where_allowed(line, files, monkeypatch, capsys):
    monkeypatch.setenv("_STRAPGEN_COMPLETE", "complete_fish")
    monkeypatch.setenv("_TYPER_COMPLETE_FISH_ACTION", "is-args")
    monkeypatch.setenv("_TYPER_COMPLETE_ARGS", line)
    with pytest.raises(SystemExit) as stop:
        main([])
    assert (capsys.readouterr(), stop.value.code) == (("", ""), files)


_ENDS_WITH_MODULES = """
import sys
from strapgen.cli import main
try:
    main([])
except SystemExit:
    pass
sys.exit(", ".join(name for name in ("sympy", "mpmath") if name in sys.modules) or 0)
"""


@pytest.mark.parametrize(
    "line",
    [
        "strapgen derive ",
        "strapgen derive euler --method ",
        "strapgen compare euler --motion ",
        "strapgen generate euler --target ",
        "strapgen compare euler --backend ",
        "strapgen cost euler --cpu ",
        "strapgen window show ",
        "strapgen tableau ",
        "strapgen system ",
        "strapgen evidence euler --tool ",
        "strapgen study sensor-errors ",
        "strapgen schema ",
        "strapgen help ",
        "strapgen simulate euler --motion coning --set ",
        "strapgen study loops --set ",
    ],
)
def test_sympy_is_not_imported(line):
    env = os.environ | {
        "_STRAPGEN_COMPLETE": "complete_bash",
        "COMP_WORDS": line,
        "COMP_CWORD": str(line.count(" ")),
    }
    done = subprocess.run(
        [sys.executable, "-c", _ENDS_WITH_MODULES], env=env, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "") and done.stdout
