"""The commands that design windows, show them, and write C which commits an attitude late."""

from __future__ import annotations

import csv
import io
import json
import shlex
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

import strapgen
from strapgen.catalogue.methods import windows
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.cli import main
from strapgen.design import window_command
from strapgen.design.commit_late.commit_late_sources import sources
from strapgen.design.family import written
from strapgen.ir.exceptions import InputError
from strapgen.run.standard_tree import command_of

FOLDER = Path(windows.__file__).parent / "window_filters"


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    """Return a function that runs a command line in a folder of its own and returns status, stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def run(command: str) -> tuple[object, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(command))
        return stop.value.code, *capsys.readouterr()

    return run


# Design


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    [
        "window-3-3",
        *(pytest.param(name, marks=pytest.mark.long) for name in ("window-5-5", "window-7-7", "window-9-9")),
    ],
)
def test_a_second_design_gives_the_same_file(name, run, tmp_path):
    schema, text = (FOLDER / f"{name}.toml").read_text().split("\n", 1)
    assert schema.startswith("#:schema ")
    command = text.splitlines()[0].removeprefix("# Designed by: strapgen ")
    status, said, warned = run(command)
    assert (status, said) == (0, "") and f"wrote {name}.toml" in warned
    assert (tmp_path / f"{name}.toml").read_bytes() == text.encode()


@pytest.mark.long
def test_the_file_goes_to_the_terminal_and_warnings_do_not(run, tmp_path):
    status, said, warned = run("window design --kept 2 --ahead 1 --band 2 --now-noise 0 --name 'My gyro'")
    assert status == 0
    (tmp_path / "mine.toml").write_text(said)
    window = windows.read("mine.toml")
    assert (window.name, window.title, window.conditions) == ("my-gyro", "My gyro", 4)
    assert said.startswith(
        "# Designed by: strapgen window design --previous 2 --ahead 1 --band 2 --now-noise 0 --name 'My gyro'\n"
    )
    assert warned == (
        "strapgen: the error of F_1 reaches 0.45 in the band, over 0.0001; a narrower band or more samples lower it\n"
    )


OLD_GYRO = "--gyro-bandwidth-hz 40 --gyro-damping 0.7071"


def test_options_reach_the_file(run):
    command = (
        "window design --previous 3 --ahead 2 --powers 2 --coefficients 2 --band-hz 20 --sample-hz 100 "
        f"{OLD_GYRO} --noise 1e-4 --now-noise 1e-3 --rotation exact --series-terms 20"
    )
    status, said, warned = run(f"{command} --out w.toml")
    assert status == 0 and said == ""
    window = windows.read("w.toml")
    assert (window.previous, window.ahead, window.conditions, window.degree) == (3, 2, 2, 2)
    # 2 pi 20/100, rounded to 1e-6.
    assert window.band == Fraction("1.256637")
    assert window.gyro == Response(
        frequency_hz=Fraction(40), damping=Fraction("0.7071"), sample_hz=Fraction(100)
    )
    assert (window.noise, window.one_sided[0].noise) == (Fraction(1, 10**4), Fraction(1, 10**3))
    assert (window.rotation, window.terms, window.objective) == ("exact", 20, "mean square")
    assert "wrote w.toml" in warned
    assert "--gyro-bandwidth-hz and --gyro-damping are now --response second-order:40:0.7071" in warned
    response = "--response second-order:40:0.7071"
    status, _, warned = run(f"{command.replace(OLD_GYRO, response)} --out again.toml")
    assert status == 0 and "are now" not in warned
    assert windows.read("again.toml").filters == window.filters


@pytest.mark.long
def test_amplifying_window_is_reported(run):
    command = "window design --previous 6 --ahead 0 --band 1.9 --powers 2 --coefficients 1 --noise 1e-9"
    gyro = "--response second-order:40:0.7071 --sample-hz 100 --now-noise 1e-9"
    status, _, warned = run(f"{command} {gyro} --out w.toml")
    assert status == 0
    assert (
        "F_0 with 6 samples before the step and 0 ahead amplifies rates beyond the band by up to 4.35"
        in warned
    )
    status, _, warned = run(
        "window design --previous 9 --ahead 1 --band 1.3 --noise 1e-9 --now-noise 0 --out w.toml"
    )
    assert status == 0
    assert "F_1 with 10 samples before the step and 0 ahead has a noise gain of " in warned
    assert "; a higher --now-noise lowers it\n" in warned and "F_0" not in warned


@pytest.mark.long
def test_a_spectrum_shapes_the_filters(run, tmp_path):
    (tmp_path / "psd.csv").write_text("frequency_hz,density,angle_x_rad\n1,1e-3,1\n5,1e-3,1\n")
    command = "window design --previous 2 --ahead 2 --powers 2 --band 1.3 --coefficients 1"
    files = {}
    for name, options in {
        "flat": "--noise 1e-4",
        "low": "--noise 1e-4 --spectrum psd.csv --sample-hz 100",
    }.items():
        status, _, _ = run(f"{command} {options} --out {name}.toml")
        assert status == 0
        files[name] = windows.read(f"{name}.toml")
    assert files["low"].filters[1] != files["flat"].filters[1]
    assert files["low"].title == "Window 1+2+2 to 1.3 rad, noise 0.0001, for a spectrum"
    assert "--spectrum psd.csv" in (tmp_path / "low.toml").read_text().splitlines()[0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--ahead 2 --band 1", "--previous is needed, a number of samples"),
        ("--previous 2 --band 1", "--ahead is needed, a number of samples"),
        (
            "--samples 2 --previous 2 --ahead 2 --band 1",
            "rotation is 'fourth'; steps of 2 samples take the exact one",
        ),
        (
            "--samples 20 --previous 20 --ahead 2 --band 1",
            "--previous 20 and --ahead 2 with --samples 20 make 42 samples; at most 41 are allowed",
        ),
        (
            "--previous 2 --ahead 2",
            "a band is needed, as --band in rad a sample, or as --band-hz with --sample-hz",
        ),
        ("--previous 2 --ahead 2 --band-hz 20", "--band-hz needs --sample-hz"),
        (
            "--previous 2 --ahead 2 --band 1 --band-hz 20",
            "--band and --band-hz are both given; one is needed",
        ),
        ("--previous 2 --ahead 2 --band 3", "the band is 3 rad a sample; a number below 3 is needed"),
        ("--previous 2 --ahead 2 --band-hz 60 --sample-hz 100", "the band is 3.76991 rad a sample"),
        ("--previous 2 --ahead 2 --band 0", "--band is 0; a number above 0 is needed"),
        (
            "--previous 2 --ahead 2 --band 1 --sample-hz 100",
            "--sample-hz needs --band-hz, --response, --gyro-bandwidth-hz or --spectrum",
        ),
        ("--previous 2 --ahead 2 --band 1 --gyro-bandwidth-hz 4", "--gyro-bandwidth-hz needs --gyro-damping"),
        ("--previous 2 --ahead 2 --band 1 --gyro-damping 0.7", "--gyro-damping needs --gyro-bandwidth-hz"),
        (
            "--previous 2 --ahead 2 --band 1 --gyro-damping 0.7 --gyro-bandwidth-hz 4",
            "--gyro-bandwidth-hz needs --sample-hz",
        ),
        ("--previous 2 --ahead 2 --band 1 --spectrum file", "--spectrum needs --sample-hz"),
        (
            "--previous 2 --ahead 2 --band 1 --spectrum file --sample-hz 100",
            "file holds 0 rows below its header",
        ),
        ("--previous 2 --ahead 2 --band 1 --powers 6", "--powers is 6; a whole number from 1 to 5 is needed"),
        (
            "--previous 2 --ahead 2 --band 1 --coefficients 9",
            "--coefficients is 9; a whole number from 1 to 8",
        ),
        ("--previous 2 --ahead -1 --band 1", "--ahead is -1; a whole number from 0 to 40 is needed"),
        (
            "--previous 30 --ahead 30 --band 1",
            "--previous 30 and --ahead 30 make 61 samples; at most 41 are allowed",
        ),
        (
            "--previous 2 --ahead 2 --band 1 --noise -1",
            "--noise is -1; a number that is not below 0 is needed",
        ),
        ("--previous 2 --ahead 2 --band 1 --rotation second", "rotation 'second' is not known"),
        ("--previous 2 --ahead 2 --band 1 --series-terms 20", "--series-terms needs --rotation exact"),
        (
            "--previous 2 --ahead 2 --band 1 --name 'window 7 7'",
            "--name window 7 7 is that of a window of the catal",
        ),
        ("--previous 9 --ahead 9 --band 0.000001", "the band is too narrow, or the samples are too many"),
    ],
)
def test_wrong_options_are_refused_in_one_line(options, message, run, tmp_path):
    (tmp_path / "file").write_text("")
    status, said, warned = run(f"window design {options} --out out.toml")
    assert (status, said) == (2, "") and message in warned and warned.count("\n") == 1
    assert not (tmp_path / "out.toml").exists()


# Show


def test_a_window_is_shown_with_its_errors_and_taps(run):
    status, said, warned = run("window show window-3-3")
    assert (status, warned) == (0, "")
    assert said.startswith("window-3-3: Window 1+3+3 to 1.3 rad\n")
    lines = said.splitlines()
    assert "exact, as rationals, for  polynomial rates in time of degree up to 3" in lines
    assert any(
        line.split()[:6] == ["3", "3", "2.161e-03", "3.647e-05", "3.113e-04", "3.873e-06"] for line in lines
    )
    assert lines[-1].split()[:3] == ["3", "0", "0.0134378948971269"]


@pytest.mark.long
def test_data_have_the_exact_taps(run):
    status, said, _ = run("window show window-7-7 --format json")
    data = json.loads(said)
    window = WINDOWS["window-7-7"]
    assert status == 0 and data["symmetric"] is True and data["largest_gain"] == 1.0
    for row, taps in zip(data["filters"], window.filters, strict=True):
        assert tuple(map(Fraction, row["taps"])) == taps
    assert [one["name"] for one in data["one_sided"]] == [one.name for one in window.one_sided]
    assert f"{data['filters'][1]['level']:.6e}" == "1.111672e-07"
    assert round(data["one_sided"][6]["filters"][1]["noise_gain"], 1) == 5.2


def test_a_table_has_a_row_for_every_filter(run):
    _, said, _ = run("window show window-14-0 --format csv")
    rows = list(csv.DictReader(io.StringIO(said)))
    assert [row["coefficient"] for row in rows] == ["0", "1", "2", "3", "4"]
    assert {row["name"] for row in rows} == {"window-14-0"} and rows[0]["taps"] == "0 " * 14 + "1"
    status, said, _ = run("window show window-14-0 --format markdown")
    assert status == 0 and len(said.splitlines()) == 7


@pytest.mark.long
def test_a_file_is_shown_and_plotted(run, tmp_path):
    pytest.importorskip("matplotlib")
    (tmp_path / "mine.toml").write_text((FOLDER / "window-3-3.toml").read_text())
    status, said, warned = run("window show mine.toml --plot picture.svg")
    assert status == 0 and said.startswith("window-1-3-3-to-1-3-rad: Window 1+3+3 to 1.3 rad")
    assert warned == "wrote picture.svg\n" and "polynomial" in (tmp_path / "picture.svg").read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("window", "Missing command. Allowed: design, show"),
        ("window show", "Missing argument"),
        ("window show window-7-8", "window 'window-7-8' is not known (did you mean window-7-7"),
        ("window show none.toml", "none.toml cannot be read"),
        ("window show wrong.toml", "wrong.toml: the filter of c_1 gives "),
        ("window show window-7-7 --format html", "format 'html' is not known"),
    ],
)
def test_invalid_windows_are_refused_in_one_line(words, message, run, tmp_path):
    text = (FOLDER / "window-3-3.toml").read_text()
    (tmp_path / "wrong.toml").write_text(text.replace(str(WINDOWS["window-3-3"].filters[1][0]), "1/7"))
    status, said, warned = run(words)
    assert (status, said) == (2, "") and message in warned and warned.count("\n") == 1


def test_now_noise_of_a_brief_is_that_of_an_increment(tmp_path):
    """0.12 deg in a root of an hour is 2e-4 deg in an increment of 10 ms; 100 deg/s turn 1 deg in it."""
    brief = tmp_path / "brief.toml"
    head, tail = "max_rate_deg_s = 100\n[gyro]\nsample_hz = 100\n", "[budget]\ndrift_deg_h = 1\n[processor]\n"
    brief.write_text(f"{head}noise_deg_sqrt_h = 0.12\n{tail}")
    assert window_command._now_noise(str(brief)) == Fraction(2, 10_000)
    assert window_command._now_noise("3e-4") == Fraction(3, 10_000)
    brief.write_text(
        "max_rate_deg_s = 100\n[gyro]\nsample_hz = 100\n[budget]\ndrift_deg_h = 1\n[processor]\n"
    )
    with pytest.raises(InputError, match="noise_deg_sqrt_h is 0"):
        window_command._now_noise(str(brief))


def test_files_are_those_of_the_library_and_are_in_step(run, tmp_path):
    command = "window generate window-3-3 --out out"
    status, said, _ = run(command)
    files = sources("window-3-3").files
    assert status == 0
    assert said.split()[:3] == ["euler_late_3_3", "for", "c"]
    assert {path.name: path.read_text() for path in (tmp_path / "out").iterdir()} == files
    assert run(f"{command} --check") == (0, "out: 8 files, in step\n", "")
    (tmp_path / "out" / "euler_late_3_3.c").write_text("/* mine */\n")
    status, said, _ = run(f"{command} --check")
    assert status == 1
    assert "-/* mine */" in said
    status, _, warned = run(command)
    assert status == 2
    assert "--force writes over it" in warned


def test_options_choose_numbers_attitude_and_name(run):
    status, said, _ = run(
        "window generate window-3-3 --algorithm dcm --target c-float --name nav --format json --out out"
    )
    data = json.loads(said)
    assert status == 0
    assert (data["name"], data["target"]) == ("nav", "c-float")
    assert data["files"][:3] == ["out/nav.h", "out/nav.c", "out/dcm_window_3_3_float.h"]
    assert data["operations"] == sources("window-3-3", "dcm", "c-float").operations


@pytest.mark.long
def test_filters_for_a_gyro_are_refused_at_another_rate(run, tmp_path):
    family = replace(
        WINDOWS["window-3-3"],
        name="slow-gyro",
        title="Slow gyro",
        conditions=1,
        gyro=Response(frequency_hz=Fraction(40), damping=Fraction(7, 10), sample_hz=Fraction(100)),
    )
    one_sided = tuple(replace(one, conditions=1, gyro=family.gyro) for one in family.one_sided)
    family = replace(family, one_sided=one_sided)
    (tmp_path / "gyro.toml").write_text(written(family, "strapgen window design"))
    for option, reason in (
        ("", "no sampling rate is stated"),
        ("--sample-hz 200", "the sampling rate is 200 Hz"),
    ):
        status, said, warned = run(f"window generate gyro.toml {option} --out out")
        assert (status, said) == (2, "")
        assert reason in warned and warned.count("\n") == 1
    assert not (tmp_path / "out").exists()
    status, said, _ = run("window generate gyro.toml --sample-hz 100 --out out")
    assert status == 0
    assert "euler_late_slow_gyro.h" in said


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("window-3-3 --target c-fixed --word 16", "words of 32 bits"),
        ("window-3-4", "window 'window-3-4' is not known"),
        ("window-3-3 --target numpy", "target 'numpy'"),
        ("window-3-3 --sample-hz never", "never"),
        ("missing.toml", "missing.toml"),
    ],
)
def test_wrong_options_of_generate_are_refused_in_one_line(options, message, run, tmp_path):
    status, said, warned = run(f"window generate {options} --out out")
    assert (status, said) == (2, "")
    assert message in warned and warned.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_fixed_point_has_its_options_in_the_command(run, tmp_path):
    options = "--target c-fixed --max-rate-deg-s 400 --sample-hz 100 --carry full"
    status, said, _ = run(f"window generate window-3-3 {options} --out out")
    assert status == 0
    assert "out/euler_late_3_3_w32.h" in said
    header = (tmp_path / "out" / "euler_late_3_3_w32.h").read_text()
    assert command_of(header) == (
        "strapgen window generate window-3-3 --algorithm euler --target c-fixed --word 32 --max-rate-deg-s 400 "
        "--sample-hz 100 --rounding nearest --carry full --drift-allowance 1/16"
    )
    # The command of the header writes the same files.
    again = command_of(header).removeprefix("strapgen ")
    assert run(f"{again} --out out --check")[:2] == (0, "out: 8 files, in step\n")
    status, said, warned = run("window generate window-3-3 --carry full --out other")
    assert (status, said) == (2, "")
    assert "c-fixed" in warned


def test_a_window_runs_over_a_recording_from_end_to_end(run, tmp_path):
    row = strapgen.motion("random", rate_deg_s=200).samples(Fraction(1, 100), 0, 20)
    lines = [f"{0.01 * (k + 1):.2f},{','.join(map(repr, sample.tolist()))}" for k, sample in enumerate(row)]
    (tmp_path / "log.csv").write_text("\n".join(["t,dx,dy,dz", *lines]))
    command = "simulate euler --method window-3-3 --recording log.csv --backend numpy --format json"
    status, said, warned = run(command)
    assert status == 0, warned
    data = json.loads(said)
    times = data["time_s"]
    assert len(times) == 21
    assert times[-1] - times[0] == pytest.approx(0.2)


def test_a_pair_is_shown_with_its_product(run):
    status, said, _ = run("window show pair-1-5")
    assert status == 0
    assert "pair: its level of F_1 is that of the product with F_2/30 - F_0/6\n" in said
    lines = [line.split() for line in said.splitlines()]
    assert ["5", "5", "2.115e-06", "2.541e-06", "-", "-"] in [line[:6] for line in lines]
    assert ["6", "4"] in [line[:2] for line in lines if len(line) == 11 and "-" not in line]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--form pair --band 1", "--form pair needs --u-taps"),
        ("--form pair --u-taps 3 --band 1", "--form pair needs --v-taps"),
        ("--u-taps 3 --v-taps 3 --band 1", "--u-taps needs --form pair"),
        ("--form pair --u-taps 3 --v-taps 3 --ahead 3 --band 1", "--ahead needs --form legendre"),
        (
            "--form pair --u-taps 8 --v-taps 30 --band 1",
            "--u-taps 8 and --v-taps 30 make 61 samples; at most 41 are allowed",
        ),
        (
            "--form pair --u-taps 4 --v-taps 0 --band 1",
            "v-taps is 0; a whole number at least 1 is needed",
        ),
        (
            "--form pair --u-taps 1 --v-taps 1 --band 1",
            "u-taps is 1; a whole number at least 2 is needed",
        ),
        (
            "--form pair --u-taps 3 --v-taps 3 --powers 13 --band 1",
            "--powers is 13; a whole number from 1 to 12 is needed",
        ),
        ("--form two --band 1", "form 'two' is not known; allowed: legendre, pair"),
    ],
)
def test_options_that_are_no_pair_are_refused(options, message, run):
    status, _, warned = run(f"window design {options}")
    assert status == 2 and message in warned


def test_a_pair_is_designed_by_the_command(run, tmp_path):
    command = "window design --form pair --samples 2 --u-taps 3 --v-taps 3 --coefficients 2 --band 1"
    for name in ("first", "second"):
        assert run(f"{command} --out {name}.toml")[0] == 0
    first, second = ((tmp_path / f"{name}.toml").read_text().splitlines() for name in ("first", "second"))
    assert first[1:] == second[1:] and first[0].endswith(
        f"{command.removeprefix('window ')} --out first.toml"
    )
    window = windows.read("first.toml")
    assert (window.form, window.increments, window.previous, window.ahead) == ("pair", 2, 2, 2)


def test_the_option_window_takes_a_name(run):
    status, said, _ = run("derive euler --window pair-1-5-exact")
    assert status == 0 and said == run("derive euler --method pair-1-5-exact")[1]
    status, _, warned = run("derive euler --window pair-1-6")
    assert status == 2 and "window 'pair-1-6' is not known (did you mean pair-1-5" in warned
