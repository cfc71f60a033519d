"""Recordings as loggers write them, from the command line: read by names and units, or refused with the option."""

from __future__ import annotations

import json
import math
import shlex
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapgen.cli import main

DATA = Path(__file__).parents[1] / "data" / "recordings"
#: A turn of 36 deg/s about z, in rad/s.
RATE = "0.628318530717959"


def simulated(arguments: list[str], capsys, tmp_path: Path) -> tuple[int, np.ndarray | None, str]:
    """Return the status, the last attitude and what is said on stderr."""
    out = tmp_path / "attitude.csv"
    with pytest.raises(SystemExit) as stop:
        main(["simulate", "euler", "--input", "instants", "--recording", *arguments, "--out", str(out)])
    said = capsys.readouterr().err
    last = np.array(out.read_text().split("\n")[-2].split(","), float) if out.is_file() else None
    return int(stop.value.code or 0), last, said


@pytest.mark.parametrize("method", ["rk4", "coning-compressed"])
@pytest.mark.parametrize("name", ["time_in_ms", "accelerometer_first", "index_first", "two_comment_lines"])
def test_recording_is_read_by_its_header(name, method, capsys, tmp_path):
    """It turns by 180 deg in 5 s."""
    arguments = [str(DATA / f"{name}.csv"), "--rate-unit", "rad/s", "--method", method]
    status, last, said = simulated(arguments, capsys, tmp_path)
    assert status == 0 and "left out" not in said
    np.testing.assert_allclose(last, [5, 0, 0, 1, 0], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "refusal", "options", "said"),
    [
        (
            "dropout",
            "line 603: a gap of 0.064 s",
            ["--gaps", "bridge"],
            "15 lost samples put on the line between neighbours",
        ),
        (
            "twice_the_same",
            "line 253: its time is that of the row before; 1 row repeats a time",
            ["--repair", "repeats"],
            "line 253: its time is that of the row before; 1 row repeats a time",
        ),
    ],
)
def test_refusal_names_the_option_that_helps(name, refusal, options, said, capsys, tmp_path):
    arguments = [str(DATA / f"{name}.csv"), "--rate-unit", "rad/s"]
    status, last, error = simulated(arguments, capsys, tmp_path)
    assert (
        (status, last, error.count("\n")) == (2, None, 1) and refusal in error and " ".join(options) in error
    )
    status, last, error = simulated([*arguments, *options], capsys, tmp_path)
    assert status == 0 and said in error
    np.testing.assert_allclose(last, [5, 0, 0, 1, 0], atol=1e-9)


def test_increment_left_over_is_said(capsys, tmp_path):
    arguments = [str(DATA / "one_left_over.csv"), "--rate-unit", "rad/s"]
    status, last, said = simulated(arguments, capsys, tmp_path)
    assert status == 0 and last[0] == pytest.approx(0.18)
    assert "1 increment at the end fills no step of 2 and is left out" in said
    _, _, said = simulated([*arguments, "--increments", "8"], capsys, tmp_path)
    assert "3 increments at the end fill no step of 8 and are left out" in said


@pytest.mark.parametrize("form", ["text", "csv", "json"])
def test_increment_left_over_in_two_speeds_is_said_once(capsys, form):
    log = str(Path(__file__).parents[2] / "examples/inertial_log.csv")
    with pytest.raises(SystemExit) as ended:
        main(
            [
                "strapdown",
                "dcm",
                "--recording",
                log,
                "--fast-cycles",
                "3",
                "--slow-cycles",
                "7",
                "--format",
                form,
            ]
        )
    assert not ended.value.code
    out, said = capsys.readouterr()
    assert out.count("left out") + said.count("left out") == 1


#: Headers and rows of loggers, from which 1 s at 36 deg/s about z is read.
LOGS = {
    "phyphox": (
        '"Time (s)","Gyroscope x (rad/s)","Gyroscope y (rad/s)","Gyroscope z (rad/s)"',
        "{s},0,0,{rad}",
    ),
    "euroc": (
        "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2]",
        "{ns},0,0,{rad},9.8",
    ),
    "dps": ("t_ms,ax_g,ay_g,az_g,gx_dps,gy_dps,gz_dps", "{ms},0,0,1,0,0,{deg}"),
    "blackbox": (
        "loopIteration, time (us), gyroADC[0] (deg/s), gyroADC[1], gyroADC[2]",
        "{k},{us},0,0,{deg}",
    ),
    "semicolons": ("zeit;time [s];gyr_x [deg/s];gyr_y [deg/s];gyr_z [deg/s]", "x;{comma};0,0;0,0;36,0"),
    "tabs": (
        "timestamp (us)\tangular_velocity_x\tangular_velocity_y\tangular_velocity_z (°/s)",
        "{us}\t0\t0\t{deg}",
    ),
    "blanks": ("% a comment\ntime omega_x omega_y omega_z", "{s}  0 0   {rad}"),
}
STATED = {"blanks": ["--rate-unit", "rad/s"]}


@pytest.mark.parametrize("name", LOGS)
def test_log_is_read_by_names_and_units(name, capsys, tmp_path):
    header, row = LOGS[name]
    rows = [
        row.format(
            k=k,
            s=f"{k / 100:.2f}",
            ms=10 * k,
            us=10_000 * k,
            ns=10_000_000 * k,
            rad=RATE,
            deg=36,
            comma=f"{k / 100:.2f}".replace(".", ","),
        )
        for k in range(101)
    ]
    log = tmp_path / "log.csv"
    log.write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    status, last, _ = simulated([str(log), *STATED.get(name, [])], capsys, tmp_path)
    assert status == 0
    half = np.deg2rad(18)
    np.testing.assert_allclose(last, [1, 0, 0, np.sin(half), np.cos(half)], atol=1e-9)


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        (
            "t [s],gx [deg/s],gy [deg/s],gz [deg/s]\n0,0,0,1\n0.1,0,0,1\n",
            ["--rate-unit", "rad/s"],
            "contradicts",
        ),
        ("t,gx [deg/s],gy [rad/s],gz\n0,0,0,1\n0.1,0,0,1\n", [], "the rates are in deg/s and rad/s"),
        ("t [ms],gx,gy,gz\n0,0,0,1\n10,0,0,1\n", ["--rate-unit", "rad/s", "--time-unit", "s"], "is in ms"),
        ("t,gx,gy,gz\n0,0,0,1\n0.1,0,0,1\n", [], "--rate-unit is needed"),
        ("t,gx,gy,gz\n0,0,0,1\n4000,0,0,1\n", ["--rate-unit", "rad/s"], "--time-unit s, ms, us or ns"),
        ("0,0,0,1\n4000,0,0,1\n", ["--rate-unit", "rad/s"], "--sample-hz the sampling rate"),
        ("0,0,0,1,9\n0.1,0,0,1,9\n", ["--rate-unit", "rad/s"], "--columns says by their numbers"),
        ("t,acc_x,acc_y,acc_z\n0,0,0,1\n0.1,0,0,1\n", ["--rate-unit", "rad/s"], "no rates about three axes"),
        ("t,ax,ay,az,x,y,z\n0,0,0,1,0,0,1\n", ["--rate-unit", "rad/s"], "--columns NAME"),
        ("t,gx [m/s^2],gy,gz\n0,0,0,1\n0.1,0,0,1\n", ["--rate-unit", "rad/s"], "no rates about three axes"),
        ("time,seconds,x,y,z\n0,0,0,0,1\n", ["--rate-unit", "rad/s"], "several columns of time"),
        ("t,x,y,z\n0,0,0,1\n0,1,0,0,0,0,1,0\n", ["--rate-unit", "rad/s"], "line 3: 8 columns; 4 are needed"),
        ("t,x,y,z\n0,0,0,1\n0.1,0,0\n", ["--rate-unit", "rad/s"], "line 3: 3 columns; 4 are needed"),
        ("t,gx,gy,gz\n0,0,0,1\n0.1,0,0,1\n", ["--rate-unit", "rpm"], "rate unit 'rpm' is not known"),
        (
            "t,gx,gy,gz\n0,0,0,1\n",
            ["--rate-unit", "rad/s", "--columns", "t,gx"],
            "names 2 columns; 4 are needed",
        ),
    ],
)
def test_open_meaning_is_refused_in_one_line(text, options, said, capsys, tmp_path):
    log = tmp_path / "log.csv"
    log.write_text(text)
    status, last, error = simulated([str(log), *options], capsys, tmp_path)
    assert (status, last, error.count("\n")) == (2, None, 1) and said in error


def test_sampling_rate_stands_in_place_of_times(capsys, tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("PacketCounter,Gyr_X,Gyr_Y,Gyr_Z\n" + "".join(f"{k},0,0,36\n" for k in range(1000, 1101)))
    status, last, _ = simulated([str(log), "--rate-unit", "dps", "--sample-hz", "100"], capsys, tmp_path)
    assert status == 0
    np.testing.assert_allclose(last, [1, 0, 0, np.sin(np.deg2rad(18)), np.cos(np.deg2rad(18))], atol=1e-9)


@pytest.mark.parametrize("state", ["euler", "dcm"])
def test_attitude_whose_length_has_left_1_is_not_written(state, capsys, tmp_path):
    """Steps of 6 rad, as of times in ms that are read as s, with a method that does not hold the length."""
    log, out = tmp_path / "log.csv", tmp_path / "o.csv"
    log.write_text(
        "t [s],gx [rad/s],gy [rad/s],gz [rad/s]\n" + "".join(f"{10 * k},0,0,0.6\n" for k in range(9))
    )
    with pytest.raises(SystemExit) as stop:
        main(
            [
                "simulate",
                state,
                "--method",
                "rk2",
                "--input",
                "instants",
                "--recording",
                str(log),
                "--out",
                str(out),
            ]
        )
    said = capsys.readouterr().err
    assert stop.value.code == 2 and said.count("\n") == 1 and not out.exists()
    assert "the length of the attitude is" in said or "increments" in said


@pytest.mark.parametrize("unit", ["deg/s", "dps", "rad/s", "mdps", "rad s^-1", "°/s"])
def test_units_of_a_rate_have_their_spellings(unit, capsys, tmp_path):
    log = tmp_path / "log.csv"
    size = {"rad": RATE, "mdp": "36000"}.get(unit[:3], "36")
    log.write_text("t,gx,gy,gz\n" + "".join(f"{k / 100},0,0,{size}\n" for k in range(101)))
    status, last, _ = simulated([str(log), "--rate-unit", unit], capsys, tmp_path)
    assert status == 0
    np.testing.assert_allclose(last[3:], [np.sin(np.deg2rad(18)), np.cos(np.deg2rad(18))], atol=1e-9)


FILES = Path(__file__).resolve().parents[1] / "data" / "foreign"
#: File, and the options that say how its function is called.
COMMANDS = {
    "interval_guard": "--function update --arguments 'rates[3], dt -> next[4]' --scalar first --init begin",
    "coefficient_in_float": "--function rotation_of_call --arguments 'increments[3] -> rotation[3]' --init begin",
    "accumulated_angle_late": "--function delta_angle --arguments 'increments[4][3] -> rotation[3]' --init begin",
    "first_order_matrix": "--function update --arguments 'increments[3] -> next[3][3]' --init begin",
    "rates_at_ends": "--function update --arguments 'rates[3], dt -> next[4]' --scalar first --init begin",
}
SUM_LATE = "the sum of the samples before lacks the last one (one sample late)"


@pytest.fixture
def check(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Run the command and return its exit status and what it writes as JSON, with the checks by their names."""

    def run(name: str, more: str = "", flags: str = "") -> tuple[int, dict]:
        if flags:
            monkeypatch.setenv("CC", f"gcc {flags}")
        out = tmp_path / f"check{len(list(tmp_path.iterdir()))}.json"
        words = shlex.split(f"{COMMANDS[name]} {more} --format json --out")
        with pytest.raises(SystemExit) as stop:
            main(["check", str(FILES / f"{name}.c"), *words, str(out)])
        capsys.readouterr()
        data = json.loads(out.read_text())
        data["fails"] = [each["name"] for each in data.pop("checks") if each["holds"] is False]
        return stop.value.code, data

    return run


@pytest.mark.parametrize("more", ["", pytest.param("--sample-hz 16", marks=pytest.mark.long)])
def test_code_that_guards_its_interval_holds(check, more):
    status, data = check("interval_guard", more)
    assert (status, data["fails"], data["cause"]) == (0, [], None)
    assert (data["order"], data["drift_deg_h"]) == pytest.approx((3.00, 9.783), abs=0.005)


def test_an_interval_that_the_code_refuses_is_no_sample_interval(check):
    status, data = check("interval_guard", "--sample-hz 15")
    assert (status, data["cause"]) == (1, "a small rotation about an axis does not turn the attitude")


@pytest.mark.parametrize(
    ("more", "flags", "within"), [("--precision float", "", 0), ("", "-DNUMBER=double", 0.05)]
)
def test_a_coefficient_4_percent_off_fails_in_either_precision(check, more, flags, within):
    status, data = check("coefficient_in_float", more, flags)
    assert (status, data["fails"]) == (1, ["coefficients", "order", "drift"])
    assert data["cause"] == "correction 0.96 times as large as needed"
    assert data["order"] == pytest.approx(2, abs=within)
    assert data["coefficient_ratio"] == pytest.approx(12 / 12.5, abs=2e-4)
    assert data["drift_deg_h"] == pytest.approx(14.48, abs=0.01)


@pytest.mark.long
@pytest.mark.parametrize("samples", [4, 2])
def test_a_sum_one_sample_late_is_named(check, monkeypatch, samples):
    words = COMMANDS["accumulated_angle_late"].replace("[4]", f"[{samples}]")
    monkeypatch.setitem(COMMANDS, "accumulated_angle_late", words)
    status, data = check("accumulated_angle_late", flags=f"-DN={samples}")
    assert (status, data["fails"], data["cause"]) == (1, ["coefficients", "order", "drift"], SUM_LATE)
    status, data = check("accumulated_angle_late", flags=f"-DN={samples} -DMENDED")
    assert (status, data["fails"], data["cause"]) == (0, [], None)


def test_a_matrix_turned_to_first_order_is_named_with_its_drift(check):
    status, data = check("first_order_matrix")
    assert (status, data["cause"]) == (1, "the rotation itself is of first order")
    assert data["fails"] == ["rotation", "order", "drift", "symmetry"]
    assert data["drift_deg_h"] == pytest.approx(15.1, abs=0.05)
    x, y, z = map(abs, data["drift_by_axis_deg_h"])
    assert (x, math.hypot(y, z)) == pytest.approx((11.4, 9.87), abs=0.05)


def test_rates_at_the_ends_of_intervals_hold_once_they_are_said_to_be(check):
    status, data = check("rates_at_ends")
    assert (status, data["fails"]) == (1, ["delay", "order", "drift"])
    assert data["cause"].startswith("rates at instants are taken for means: ")
    status, data = check("rates_at_ends", "--input rates-at-ends")
    assert (status, data["fails"], data["cause"]) == (0, [], None)
    assert data["order"] == pytest.approx(1.99, abs=0.02)


# Old names, topics, rates with forces, and the attitude at the start

OLD = {
    "--rates-csv tests/data/rates_even.csv": (
        *("--recording tests/data/rates_even.csv --input instants", "--rates-csv is now --recording"),
    ),
    "--increments-csv tests/data/increments.csv": (
        *("--recording tests/data/increments.csv", "--increments-csv is now --recording"),
    ),
    "--rates-csv tests/data/rates_even.csv --resample-hz 50": (
        "--recording tests/data/rates_even.csv --input instants --every 2",
        "--resample-hz is now --every, a whole number of samples",
    ),
}


def said_by(line: str, capsys, status: int = 0) -> tuple[str, str]:
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(line))
    said = capsys.readouterr()
    assert (stop.value.code or 0) == status, said.err
    return said.out, said.err


@pytest.mark.parametrize("old", OLD)
@pytest.mark.parametrize("command", ["simulate euler", "compare euler --backend c --format json"])
def test_old_options_say_their_new_names(old, command, capsys, monkeypatch):
    monkeypatch.chdir(DATA.parents[2])
    new, warning = OLD[old]
    out, err = said_by(f"{command} {old}", capsys)
    assert warning in err
    expected, plain = said_by(f"{command} {new}", capsys)
    assert "is now" not in plain
    if command.startswith("simulate"):
        assert out == expected
    else:
        assert json.loads(out)[0]["max_abs_rad"] == json.loads(expected)[0]["max_abs_rad"]


@pytest.mark.parametrize("backend", ["numpy", "c"])
def test_strapdown_takes_rates_with_forces(backend, tmp_path, capsys, monkeypatch):
    """The example has increments; rates and forces of the same motion give the same course."""
    monkeypatch.chdir(DATA.parents[2])
    names, *lines = (Path("examples") / "inertial_log.csv").read_text().split()
    values = np.array([line.split(",") for line in lines], float)
    rates, forces = np.degrees(values[:, 1:4] / 0.01), values[:, 4:] / 0.01 / 9.80665
    log = tmp_path / "imu.csv"
    rows = (
        ",".join(map(repr, [*row])) for row in np.column_stack([values[:, 0] * 1e3, rates, forces]).tolist()
    )
    log.write_text("\n".join(["t [ms],gx [deg/s],gy,gz,ax [g],ay,az", *rows, ""]))
    command = f"strapdown dcm --fast-cycles 4 --slow-cycles 25 --backend {backend} --format csv --recording"
    of_increments, _ = said_by(f"{command} examples/inertial_log.csv", capsys)
    of_rates, err = said_by(f"{command} {log}", capsys)
    assert "are means over the intervals" in err
    first, second = (
        np.array([line.split(",") for line in text.split()[1:]], float) for text in (of_increments, of_rates)
    )
    np.testing.assert_allclose(second, first, rtol=1e-9, atol=1e-9)
    names = "t=t,x=gx,y=gy,z=gz,fx=ax,fy=ay,fz=az"
    plain = log.read_text().replace(" [g]", "").replace(" [deg/s]", "").replace(" [ms]", "")
    log.write_text(plain)
    options = f"--columns {names} --time-unit ms --rate-unit dps --force-unit g"
    assert said_by(f"{command} {log} {options}", capsys)[0] == of_rates
    assert "--force-unit is needed" in said_by(f"{command} {log} {options[:-15]}", capsys, 2)[1]


@pytest.mark.parametrize("method", ["rk4", "window-3-3"])
@pytest.mark.parametrize("state", ["euler", "dcm"])
def test_a_recording_starts_at_an_attitude(method, state, capsys, monkeypatch):
    monkeypatch.chdir(DATA.parents[2])
    line = f"simulate {state} --method {method} --recording tests/data/increments.csv --format json"
    turned = json.loads(said_by(f"{line} --initial-deg 10,-20,70", capsys)[0])
    assert turned["initial_deg"] == "10,-20,70"
    plain = json.loads(said_by(line, capsys)[0])
    to_matrices = (
        (lambda rows: np.reshape(rows, (-1, 3, 3)))
        if state == "dcm"
        else (lambda rows: Rotation.from_quat(rows).as_matrix())
    )
    start = Rotation.from_euler("ZYX", [70, -20, 10], degrees=True).as_matrix()
    expected = start @ to_matrices(np.array(plain["attitude"]))
    np.testing.assert_allclose(to_matrices(np.array(turned["attitude"])), expected, atol=1e-12)


def test_a_described_system_starts_at_an_attitude_on_a_recording(capsys, monkeypatch):
    monkeypatch.chdir(DATA.parents[2])
    line = "simulate examples/attitude.toml --recording tests/data/increments.csv --format json"
    turned = json.loads(said_by(f"{line} --initial-deg 0,0,90", capsys)[0])
    plain = json.loads(said_by(line, capsys)[0])
    np.testing.assert_allclose(turned["attitude"][0], [0, 0, np.sqrt(0.5), np.sqrt(0.5)], atol=1e-12)
    start = Rotation.from_euler("z", 90, degrees=True)
    expected = start * Rotation.from_quat(plain["attitude"])
    error = expected.inv() * Rotation.from_quat(turned["attitude"])
    assert np.abs(error.magnitude()).max() < 1e-6


def test_split_pieces_are_a_column_and_go_with_simulate_alone(capsys, monkeypatch):
    monkeypatch.chdir(DATA.parents[2])
    options = "--recording tests/data/recordings/dropout.csv --rate-unit rad/s --gaps split"
    out, err = said_by(f"simulate euler {options}", capsys)
    rows = [line.split(",") for line in out.split()]
    assert rows[0][:2] == ["time_s", "piece"] and {row[1] for row in rows[1:]} == {"1", "2"}
    assert "it is split into 2 pieces" in err
    data = json.loads(said_by(f"simulate euler {options} --format json", capsys)[0])
    assert len(data["piece"]) == len(data["time_s"]) and {*data["piece"]} == {1, 2}
    assert "goes with simulate alone" in said_by(f"compare euler {options}", capsys, 2)[1]


def test_axes_of_the_sensor_are_turned(capsys, monkeypatch):
    """A turn about z is one about -z for a body whose z is down."""
    monkeypatch.chdir(DATA.parents[2])
    line = "simulate euler --recording tests/data/recordings/time_in_ms.csv --rate-unit rad/s --format json"
    plain = json.loads(said_by(line, capsys)[0])["attitude"]
    down = json.loads(said_by(f"{line} --axes x,-y,-z", capsys)[0])["attitude"]
    np.testing.assert_allclose(np.array(down) * [1, -1, -1, 1], plain, atol=1e-15)
