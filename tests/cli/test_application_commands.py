"""Commands of applications: designed coning coefficients, sensor errors of runs, the appendix of the thesis."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from commands import says
from shared_results import shared_results  # noqa: F401

from strapgen.catalogue.methods.shaped_coning import read
from strapgen.cli import main

DESIGN = "coning --samples 1 --previous 3 --objective"
SPECTRUM = "--spectrum shaken.csv --sample-hz 100"


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    """Return a function that runs a command line in a folder of its own, and returns its status and what it says."""
    monkeypatch.chdir(tmp_path)
    rows = ["frequency_hz,density,angle_x_rad,angle_y_rad", "2,1e-8,1,1", "40,1e-8,1,1"]
    (tmp_path / "shaken.csv").write_text("\n".join(rows))

    return lambda command: says(command, capsys)


@pytest.mark.long
@pytest.mark.parametrize(
    ("options", "keys"),
    [
        ("band --band-hz 20 --sample-hz 100 --powers 1", {"largest_rad_step", "largest_annulling_rad_step"}),
        (f"worst {SPECTRUM}", {"worst_deg_h", "worst_annulling_deg_h"}),
        ("band --band 1.3 --products 1", {"largest_rad_step"}),
        (f"random {SPECTRUM} --noise-rad 1e-6 --pulse-rad 1e-6", {"random_deg_h", "random_annulling_deg_h"}),
        (f"worst {SPECTRUM} --response butterworth:3:40+instants", {"worst_deg_h"}),
    ],
)
def test_a_design_is_shown_with_its_drift_and_written_as_a_file(run, options, keys, tmp_path):
    status, out, error = run(f"{DESIGN} {options} --format json")
    assert status == 0, error
    data = json.loads(out)
    assert keys <= data.keys() and len(data["drift"]) == 16
    for key in keys:
        if "annulling" not in key:
            what, _, unit = key.partition("_")
            # The best ones are better than those that annul powers; noise costs little of it here.
            assert data[key] < data[f"{what}_annulling_{unit}"]
    assert run(f"{DESIGN} {options} --name Mine --format toml --out mine.toml")[0] == 0
    shape = read(tmp_path / "mine.toml")
    assert [str(c) for c in shape.coefficients] == data["coefficients"]
    # The command in the file writes the same file.
    first = (tmp_path / "mine.toml").read_text()
    line = first.splitlines()[0].removeprefix("# Designed by: strapgen ")
    assert run(line)[0] == 0
    assert (tmp_path / "mine.toml").read_text() == first


@pytest.mark.long
def test_a_design_goes_wherever_a_method_goes(run, tmp_path):
    assert run(f"{DESIGN} band --band 1.3 --name Mine --format toml --out mine.toml")[0] == 0
    wave = "--step 0.01 --frequency-hz 10 --theta-x-rad 0.01 --theta-y-rad 0.01 --phase-rad 1.5"
    motion = "--motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 --step 0.125 --duration 1"
    for command in (
        "derive rotation-vector",
        "generate euler --target c --out code",
        f"simulate dcm --backend numpy {motion}",
        f"vibration sculling {wave.replace('--theta-y-rad 0.01', '--acceleration-y 1')}",
        f"vibration euler {wave}",
        "series euler",
    ):
        status, _, error = run(f"{command} --coning mine.toml")
        assert status == 0, (command, error)
    assert "--coning mine.toml" in (tmp_path / "code" / "euler_mine_1_previous3.h").read_text()
    text = run(f"{DESIGN} band --band 1.3")[1]
    assert "largest drift over the band to 1.3 rad a sample" in text


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("band", "a band is needed, as --band in rad a sample, or as --band-hz with --sample-hz"),
        ("band --band 3.1", "the band is 3.1 rad a sample; a number below 3 is needed"),
        ("band --band 1 --spectrum shaken.csv", "--spectrum needs --objective worst or random"),
        ("band --band 1 --noise-rad 1e-6", "--noise-rad needs --objective random"),
        (
            "band --band 1 --sample-hz 100",
            "--sample-hz needs --band-hz, --response, --gyro-bandwidth-hz or --spectrum",
        ),
        ("band --band 1 --powers 4", "--powers is 4; a whole number from 0 to 3 is needed"),
        ("band --band 1 --products 3", "the conditions on 3 coefficients contradict each other"),
        ("band --band 1 --terms", "--objective designs the compressed form; --"),
        ("band --band 1 --form combined", "--objective designs the compressed form; --"),
        ("worst", "--objective worst needs --spectrum"),
        ("worst --spectrum shaken.csv", "--spectrum needs --sample-hz"),
        (f"worst {SPECTRUM} --band 1", "--band needs --objective band"),
        (f"worst {SPECTRUM} --pulse-rad 1", "--pulse-rad needs --objective random"),
        ("worst --spectrum none.csv --sample-hz 100", "none.csv"),
        (f"random {SPECTRUM} --noise-rad -1", "--noise-rad is -1; a number that is not below 0 is needed"),
        ("least --band 1", "objective 'least' is not known; allowed: band, worst, random"),
        ("band --band 1 --format toml --out shaken.csv --name 3d", "name '3d' must begin with a letter"),
    ],
)
def test_options_that_do_not_go_together_get_one_line(run, options, words):
    status, out, error = run(f"{DESIGN} {options}")
    assert (status, out) == (2, "")
    assert words in error and error.count("\n") == 1


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("coning --samples 3 --band 1", "--band needs --objective band, worst or random"),
        ("coning --samples 3 --format toml", "--format toml needs --objective"),
        ("coning --samples 1 --objective band --band 1", "samples 1 and previous 0 have no pairs of samples"),
        ("derive euler --coning none.toml", "none.toml cannot be read"),
        (
            "derive euler --coning none.toml --method rk4",
            "--method and --coning are both given",
        ),
        ("derive dcm-product --coning none.toml", "none.toml cannot be read"),
    ],
)
def test_wrong_options_get_one_line(run, command, words):
    status, out, error = run(command)
    assert (status, out) == (2, "")
    assert words in error and error.count("\n") == 1


@pytest.mark.long
def test_a_band_too_narrow_for_so_many_samples_is_refused(run):
    status, out, error = run("coning --samples 1 --previous 8 --objective band --band 0.001")
    assert (status, out) == (2, "")
    assert (
        "the drift on coning over 0.001 rad a sample does not converge; a wider band or fewer samples"
        in error
    )


EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
MOTION = "--motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 --duration 2"
VIBRATION = (
    "vibration euler --step 0.01 --frequency-hz 20 --theta-x-rad 0.01 --theta-y-rad 0.01 --phase-rad 0"
)
LOG = "--recording log.csv"


@pytest.fixture
def in_folder(capsys, tmp_path, monkeypatch):
    """Return a function that runs a command in an empty folder, and returns status, output and what stderr says."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "none.toml").write_text("")
    (tmp_path / "bias.toml").write_text("[gyro]\nbias_deg_h = 3600\n")
    (tmp_path / "pulse.toml").write_text("[gyro]\npulse_arcsec = 1\n")
    (tmp_path / "force.toml").write_text("[gyro]\ng_deg_h_g = { xz = 360 }\n")
    (tmp_path / "bad.toml").write_text("[gyro]\nbias = 3600\n")
    # Two of the slowest cycles of what reads it.
    (tmp_path / "log.csv").write_text(
        "".join((EXAMPLES / "inertial_log.csv").read_text().splitlines(keepends=True)[:201])
    )
    (tmp_path / "inc.csv").write_text(
        "t,dx,dy,dz\n" + "".join(f"{k / 100},0,0,{0.001 * (k % 3)}\n" for k in range(1, 51))
    )

    def result(command: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(command))
        printed = capsys.readouterr()
        return int(stop.value.code or 0), printed.out, printed.err

    return result


def output(in_folder, command: str) -> str:
    status, text, said = in_folder(command)
    assert status == 0, said
    return text


def without_errors(text: str) -> object:
    data = json.loads(text)
    if isinstance(data, dict):
        data.pop("errors", None)
    return data


@pytest.mark.parametrize(
    "command",
    [
        f"simulate euler {MOTION} --step 0.02 --format json",
        f"simulate dcm --method rk2 {MOTION} --step 0.02 --format json --backend c",
        "simulate euler --recording inc.csv --format json",
        f"simulate {EXAMPLES}/attitude.toml {MOTION} --format json",
        f"strapdown dcm {LOG} --fast-cycles 4 --slow-cycles 25 --format json",
        f"strapdown {EXAMPLES}/strapdown.toml {LOG} --format json",
    ],
)
def test_a_file_without_errors_changes_no_digit(command, in_folder):
    assert without_errors(output(in_folder, f"{command} --errors none.toml")) == json.loads(
        output(in_folder, command)
    )


def test_compare_without_errors_changes_no_angle(in_folder):
    command = f"compare euler {MOTION} --step 0.02 --backend numpy,c --format json"

    def angles(text: str) -> list[float]:
        return [row["max_abs_rad"] for row in json.loads(text)]

    plain = angles(output(in_folder, command))
    assert len(plain) == 2 and angles(output(in_folder, f"{command} --errors none.toml")) == plain


def test_a_bias_of_a_degree_a_second_is_seen_by_every_command(in_folder):
    rest = "--motion constant --set z_deg_s=0 --duration 2 --errors bias.toml"
    data = json.loads(output(in_folder, f"simulate euler {rest} --step 0.02 --format json"))
    angle = np.radians(2.0)
    # The error matrix of a turn about (1, 1, 1) by sqrt(3) times the angle of an axis; what leads has a negative drift.
    about = -np.sin(angle * np.sqrt(3)) / np.sqrt(3)
    np.testing.assert_allclose(np.radians(data["drift_deg"][-1]), about, rtol=1e-6)
    assert data["errors"] == "bias.toml"
    (row,) = json.loads(output(in_folder, f"compare euler {rest} --step 0.02 --backend c --format json"))
    assert row["drift_deg"] == pytest.approx(2 * np.sqrt(3), rel=1e-2)
    system = json.loads(output(in_folder, f"simulate {EXAMPLES}/attitude.toml {rest} --format json"))
    np.testing.assert_allclose(np.radians(system["drift_deg"][-1]), about, rtol=1e-4)
    log = f"{LOG} --format csv"
    for algorithm in ("dcm --fast-cycles 4 --slow-cycles 25", f"{EXAMPLES}/strapdown.toml"):
        command = f"strapdown {algorithm} {log}"
        assert output(in_folder, f"{command} --errors bias.toml") != output(in_folder, command)


def test_a_class_and_every_example_run(in_folder):
    for name in ("ins-0.1", "ins-1", "ahrs", "midcourse", *sorted((EXAMPLES / "sensors").glob("*.toml"))):
        text = output(
            in_folder,
            f"simulate euler {MOTION} --step 0.02 --record 1 --specific-force 0,0,9.81 --errors {name}",
        )
        assert "errors" in text
    assert len([*(EXAMPLES / "sensors").glob("*.toml")]) == 11


def test_fixed_point_takes_formats_that_hold_the_errors(in_folder):
    rest = "--motion constant --set z_deg_s=0 --duration 2 --step 0.02 --errors bias.toml --format json"
    fixed, plain = (
        json.loads(output(in_folder, f"simulate euler --backend {name} {rest}"))
        for name in ("fixed-model", "numpy")
    )
    # The formats are those of 3.5e-4 rad in a step of 32 bits, far finer than the drift.
    np.testing.assert_allclose(fixed["drift_deg"][-1], plain["drift_deg"][-1], rtol=1e-5)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (f"simulate euler {MOTION} --step 0.02 --errors nothing.toml", "nothing.toml cannot be read"),
        (
            f"simulate euler {MOTION} --step 0.02 --errors bad.toml",
            "bad.toml: gyro: key 'bias' is not known",
        ),
        (f"compare euler {MOTION} --step 0.02 --errors bad.toml", "bad.toml: gyro: key 'bias' is not known"),
        (
            f"strapdown dcm {LOG} --fast-cycles 4 --errors bad.toml",
            "bad.toml: gyro: key 'bias' is not known",
        ),
        (f"simulate euler {MOTION} --step 0.02 --errors force.toml", "a specific force is needed"),
        (f"simulate euler {MOTION} --step 0.02 --rates --errors bias.toml", "the algorithm takes rates"),
        (f"simulate euler {MOTION} --step 0.02 --pulse-arcsec 1 --errors pulse.toml", "are both there"),
        (
            f"simulate euler {MOTION} --step 0.02 --specific-force 0,0,1",
            "--specific-force goes with a described",
        ),
        (f"{VIBRATION} --gyro-bandwidth-hz 80,60,40 --gyro-damping 1", "one or two with a comma"),
        (f"{VIBRATION} --response bessel:9:40", "--response.order is 9; a whole number from 1 to 8"),
        (f"{VIBRATION} --response bessel:2:40 --gyro-bandwidth-hz 80 --gyro-damping 1", "do not go together"),
        (f"{VIBRATION} --gyro-bandwidth-hz 80,0 --gyro-damping 1", "gyro-bandwidth-hz is 0"),
        ("simulate euler --recording inc.csv --errors force.toml", "no velocity increments"),
        (
            f"simulate euler {MOTION} --step 0.02 --errors bias.toml --out bias.toml",
            "is a file that the command reads",
        ),
    ],
)
def test_invalid_input_is_refused_in_one_line(command, words, in_folder):
    status, text, said = in_folder(command)
    assert (status, text) == (2, "")
    assert words in said and said.count("\n") == 1


SHORT = (
    "derive euler --method rk4 --show latex",
    "derive dcm --method rk4 --format latex",
    "tableau rk4 --format latex",
    "coning --samples 4 --format latex",
    "stability dcm --method rk3,rk4 --format latex",
)
LONG = (
    *SHORT,
    "derive euler --method rk4 --increments 4 --format latex",
    "derive dcm --method rk3 --increments 3 --format latex",
    "derive euler --method rk4 --rates --format latex",
    "derive euler --method butcher6 --increments 3 --format latex",
    "derive dcm --method magnus4 --format latex",
    "derive dcm-orthonormalize --format latex",
    "derive coning-fast --format latex",
    "derive dcm-from-euler --format latex",
    "derive dcm-orthonormalize-optimal --format latex",
    "derive euler-angles-from-dcm --format latex",
    "derive geographic-angles --format latex",
    "derive euler --method crouch-grossman3 --format latex",
    "derive euler --show operations --format latex",
    "derive euler --show program --format latex",
    "tableau dormand-prince8 --format latex",
    "tableau cooper-verner8 --format latex",
    "tableau examples/heun3.toml --format latex",
    "tableau examples/kutta4.toml --format latex",
    "tableau examples/fifth_order.toml --format latex",
    "coning --samples 3 --previous 2 --form uncompressed --format latex",
    "series euler --method rk4 --format latex",
    "series dcm --method rk4 --format latex",
    "series euler --method rk4 --motion coning --terms 1 --format latex",
    "series dcm --method rk1 --motion constant --format latex",
    "series velocity-position --format latex",
    "series dcm --versus euler --format latex",
    "series dcm --method rk3 --motion coning --versus euler --format latex",
    "statements --format latex",
    "series euler --all --method rk1,rk4 --format latex",
    "vibration dcm --method rk4 --step 0.02 --frequency-hz 10 --theta-x-rad 0.01 --theta-y-rad 0.02 --phase-rad 1.1"
    " --format latex",
    "derive examples/three_samples.py --format latex",
    "derive examples/two_velocity_samples.py --format latex",
    "series examples/two_velocity_samples.py --format latex",
    "solve examples/three_samples.py --order 4 --format latex",
    "solve examples/rates_at_nodes.py --order 4 --format latex",
    "list backends --format latex",
    "list methods --format latex",
    "window show window-3-3 --format latex",
    "simulate euler --motion constant --set y_deg_s=10 --step 0.5 --duration 1 --format latex",
    "compare euler --method rk1,rk2 --backend numpy,exact --motion constant --set y_deg_s=10 --step 0.5 --duration 1"
    " --format latex",
    "converge euler --method rk1 --step 1/2,1/4 --duration 1 --backend numpy --format latex",
)


def overfull(log: str) -> list[str]:
    """Return what a log of pdflatex says of boxes larger than the page, and of errors."""
    return re.findall(r"^(?:Overfull .[hv]box|!).*$", log, flags=re.MULTILINE)


def compiled(text: str, folder: Path) -> str:
    """Compile text in the class article, and return the log."""
    if shutil.which("pdflatex") is None:
        pytest.skip("pdflatex is not installed (Debian: texlive-latex-base)")
    source = "\\documentclass{article}\n\\usepackage{amsmath}\n\\allowdisplaybreaks\n\\begin{document}\n"
    (folder / "appendix.tex").write_text(f"{source}{text}\n\\end{{document}}\n")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "appendix.tex"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="replace")
    log = (folder / "appendix.log").read_text(errors="replace")
    assert done.returncode == 0, f"{overfull(log)}\n{log[-2000:]}"
    return log


@pytest.mark.parametrize(
    "commands", [SHORT, pytest.param(LONG, marks=pytest.mark.long)], ids=["short", "long"]
)
def test_an_appendix_compiles_without_overfull_boxes(commands, capsys, tmp_path):
    parts = []
    for command in commands:
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(command))
        printed = capsys.readouterr()
        assert stop.value.code == 0, f"{command}: {printed.err}"
        words = command.replace("_", r"\_").replace("--", "-{}-")
        parts.append(f"\\subsection*{{{words}}}\n\\raggedright\n\\noindent\n{printed.out}")
    assert overfull(compiled("\n".join(parts), tmp_path)) == []


def test_a_line_that_is_too_wide_is_seen(tmp_path):
    assert overfull(compiled(f"\\noindent\\mbox{{{'word ' * 40}}}", tmp_path))
