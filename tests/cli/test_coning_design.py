"""``strapgen coning --objective`` designs coefficients, and ``--coning`` takes them wherever a method goes."""

from __future__ import annotations

import json
import shlex

import pytest

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

    def answer(command: str) -> tuple[object, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(command))
        said = capsys.readouterr()
        return stop.value.code, said.out, said.err

    return answer


@pytest.mark.long
@pytest.mark.parametrize(
    ("options", "keys"),
    [
        ("band --band-hz 20 --sample-hz 100 --powers 1", {"largest_rad_step", "largest_annulling_rad_step"}),
        (f"worst {SPECTRUM}", {"worst_deg_h", "worst_annulling_deg_h"}),
        ("band --band 1.3 --products 1", {"largest_rad_step"}),
        (f"random {SPECTRUM} --noise-rad 1e-6 --pulse-rad 1e-6", {"random_deg_h", "random_annulling_deg_h"}),
        (f"worst {SPECTRUM} --gyro-bandwidth-hz 40 --gyro-damping 0.7071", {"worst_deg_h"}),
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
            "--sample-hz needs --band-hz, --gyro-bandwidth-hz or --spectrum",
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
