"""What a log holds, from the command line: a phone's log runs with the printed command; bad logs have one line."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import numpy as np
import pytest

from strapgen.cli import main

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
KEYS = {
    "columns",
    "rate_hz",
    "jitter",
    "gaps",
    "repeats",
    "backwards",
    "nan",
    "saturated",
    "stuck",
    "rest",
    "command",
}


def ran(words: list[str], capsys) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stop:
        main(words)
    said = capsys.readouterr()
    return int(stop.value.code or 0), said.out, said.err


def phone(path: Path, rng: np.random.Generator) -> Path:
    """Write 30 s of a phone: microseconds, deg/s, names of no standard, a gap of 25 samples, two empty numbers."""
    count = 3000
    time = 1_690_000_000_000_000 + np.cumsum(rng.normal(10_000, 150, count)).astype(np.int64)
    turn = np.column_stack(
        [20 * np.sin(np.arange(count) / 70), 15 * np.cos(np.arange(count) / 90), np.full(count, 5)]
    )
    turn[:800] = 0.3
    turn = turn + rng.normal(0, 0.05, turn.shape)
    cells = [
        [str(t), *(f"{x:.4f}" for x in (*w, 0.01, -0.02, 9.81))] for t, w in zip(time, turn, strict=True)
    ]
    cells = [row for k, row in enumerate(cells) if not 1000 <= k < 1025]
    cells[500][2] = cells[2000][3] = "NaN"
    lines = ["Zeitstempel,drehX,drehY,drehZ,bX,bY,bZ", *(",".join(row) for row in cells)]
    path.write_text("\n".join([*lines, ""]))
    return path


def test_the_oddities_of_a_phone_are_named_and_the_printed_command_runs(tmp_path, capsys, rng, monkeypatch):
    monkeypatch.chdir(tmp_path)
    log = phone(tmp_path / "phone.csv", rng)
    status, out, err = ran(["log", str(log), "--format", "json"], capsys)
    assert (status, err) == (0, "")
    data = json.loads(out)
    assert data.keys() > KEYS
    meanings = {one["name"]: (one["meaning"], one["unit"]) for one in data["columns"]}
    assert meanings["Zeitstempel"] == ("time", "us") and meanings["drehY"][0] == "rate y"
    assert data["rate_hz"] == pytest.approx(100, rel=2e-3) and data["jitter"] == pytest.approx(0.015, rel=0.1)
    assert (data["nan"], data["repeats"], data["backwards"], data["stuck"], data["saturated"]) == (
        2,
        0,
        0,
        0,
        0,
    )
    gap = max(data["gaps"], key=lambda one: one["seconds"])
    assert gap["start_s"] == pytest.approx(10, abs=0.1) and gap["seconds"] == pytest.approx(0.26, abs=0.01)
    assert data["rest"] and data["rest"][0]["rate_deg_s"] == pytest.approx([0.3] * 3, abs=0.02)
    remarks = "\n".join(data["remarks"])
    for words in (
        *("no column of time among", "a guess is t=Zeitstempel,x=drehX,y=drehY,z=drehZ"),
        *("us is a guess", "deg/s is a guess", "2 rows hold none", "25 samples lost in 1 place"),
    ):
        assert words in remarks
    status, out, _ = ran(["log", str(log)], capsys)
    command = out.rstrip("\n").splitlines()[-1]
    assert command == data["command"]
    status, out, err = ran(shlex.split(command)[1:], capsys)
    assert status == 0 and out.count("\n") == 1 + 1501
    assert "2 lost samples restored by a filter" in err and "25 lost samples put on the line" in err
    status, _, err = ran(
        [word for word in shlex.split(command)[1:] if word not in ("--gaps", "bridge")], capsys
    )
    assert status == 2 and err.count("\n") == 1 and "--gaps bridge allows it" in err


@pytest.mark.parametrize(
    ("name", "command"),
    [
        ("gyro_log.csv", "--gaps bridge"),
        ("inertial_log.csv", ""),
    ],
)
def test_the_command_of_an_example_runs(name, command, capsys):
    status, out, _ = ran(["log", str(EXAMPLES / name)], capsys)
    printed = out.rstrip("\n").splitlines()[-1]
    assert (
        status == 0 and printed == f"strapgen simulate euler --recording {EXAMPLES / name} {command}".rstrip()
    )
    status, out, _ = ran(shlex.split(printed)[1:], capsys)
    assert status == 0 and out.startswith("time_s,")


def test_range_and_stuck_rows_are_counted(tmp_path, capsys, rng):
    rates = np.clip(rng.normal(0, 100, (500, 3)).cumsum(axis=0) / 20, -60, 60)
    rates[300:330] = rates[300]
    lines = [f"{k / 100},{x:.6f},{y:.6f},{z:.6f}" for k, (x, y, z) in enumerate(rates)]
    log = tmp_path / "log.csv"
    log.write_text("\n".join(["t [s],gx [dps],gy,gz", *lines, ""]))
    data = json.loads(ran(["log", str(log), "--format", "json"], capsys)[1])
    assert data["stuck"] == 29 and data["command"].endswith("--repair stuck")
    assert (
        data["saturated"]
        == int((np.abs(rates) == 60).any(axis=1).sum()) - 29 * (np.abs(rates[300]) == 60).any()
    )
    assert any("the gyro's range may end there" in text for text in data["remarks"])


def test_a_log_without_rates_shows_its_columns(tmp_path, capsys):
    log = tmp_path / "log.csv"
    log.write_text("t,q0,q1,q2,q3,height\n" + "".join(f"{k / 10},1,0,0,0,{k}\n" for k in range(9)))
    data = json.loads(ran(["log", str(log), "--columns", "t,q1,q2,q3", "--format", "json"], capsys)[1])
    assert [one["meaning"] for one in data["columns"]] == [
        "time",
        "attitude w",
        "rate x",
        "rate y",
        "rate z",
        None,
    ]
    log.write_text("t,height\n0,1\n1,2\n")
    status, out, _ = ran(["log", str(log)], capsys)
    assert status == 0 and "no rates about three axes" in out and "simulate" not in out


def swaying(count: int = 300) -> np.ndarray:
    """Return rates in rad/s that fall as often as they rise, after a rest."""
    k = np.arange(count)[:, None]
    return np.where(k < 250, 0, 1) * np.sin(k / [7.0, 9.0, 11.0])


def test_times_that_rise_twice_and_axes_the_other_way_round_are_guessed(tmp_path, capsys):
    log = tmp_path / "log.csv"
    start = 1_700_000_000_123_456_789
    lines = [
        f"{start + 10_000_000 * k},{k / 100},{z},{y},{x}" for k, (x, y, z) in enumerate(swaying().tolist())
    ]
    log.write_text("\n".join(["time,seconds_elapsed,z,y,x", *lines, ""]))
    status, out, _ = ran(["log", str(log)], capsys)
    assert status == 0 and "a guess is t=time,x=x,y=y,z=z" in out
    assert "at rest from 1700000000.11346 s to 1700000002.61346 s" in out


def test_numbers_of_packets_are_no_times(tmp_path, capsys):
    log = tmp_path / "log.csv"
    lines = [f"{k},{x},{y},{z}" for k, (x, y, z) in enumerate(swaying().tolist())]
    log.write_text("\n".join(["PacketCounter,Gyr_X,Gyr_Y,Gyr_Z", *lines, ""]))
    status, out, _ = ran(["log", str(log)], capsys)
    assert status == 0 and "--sample-hz the sampling rate" in out and "simulate" not in out
    status, out, _ = ran(["log", str(log), "--sample-hz", "100"], capsys)
    assert status == 0 and out.rstrip().endswith("--rate-unit rad/s --sample-hz 100")


@pytest.mark.parametrize("time", ["0", "nan"])
def test_a_log_without_a_time_that_grows_has_no_command(tmp_path, capsys, time):
    log = tmp_path / "log.csv"
    log.write_text("t,gx [rad/s],gy,gz\n" + "".join(f"{time},{k},0,0\n" for k in range(20)))
    status, out, err = ran(["log", str(log)], capsys)
    assert (status, err) == (0, "") and "simulate" not in out
    assert "19 rows repeat a time" in out or "20 rows hold none" in out
    for repair in ([], ["--repair", "all", "--gaps", "bridge"]):
        status, out, err = ran(["simulate", "euler", "--recording", str(log), *repair], capsys)
        assert (status, out, err.count("\n")) == (2, "", 1)


def rows(count: int = 40, gyro: str = "0.1,0.2,0.3", step: float = 0.01) -> list[str]:
    """Return rows that are no two alike, so that none looks stuck."""
    return [f"{step * k:.6g},{gyro[:-1]}{k % 7}" for k in range(count)]


def table(lines: list[str], header: str = "t [s],gx [rad/s],gy,gz") -> bytes:
    return "\n".join([header, *lines, ""]).encode()


def with_row(place: int, line: str) -> list[str]:
    return [*rows()[:place], line, *rows()[place + 1 :]]


#: Contents of a log, options, and words of the line in which it is refused.
BAD: dict[str, tuple[bytes, str, str]] = {
    "empty": (b"", "", "holds 0 rows"),
    "blank lines": (b"\n\n \n", "", "holds 0 rows"),
    "header alone": (table([]), "", "holds 0 rows"),
    "one row": (table(rows(1)), "", "holds 1 row"),
    "zero bytes": (b"t,gx,gy,gz\n" + b"\0" * 50, "", "is no text file"),
    "picture": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "", "is no"),
    "gzip cut short": (b"\x1f\x8b\x08\0\0\0\0\0\0\3K", "", "cannot be read"),
    "header of ULog alone": (b"ULog\x01\x12\x35\x01" + b"\0" * 8, "", ""),
    "ULog of rubbish": (b"ULog\x01\x12\x35\x01" + b"\xff" * 300, "", ""),
    "DataFlash of rubbish": (b"\xa3\x95\x80" + b"\x07" * 400, "", ""),
    "DataFlash cut short": (b"\xa3\x95\x80\x80", "", ""),
    "text": (b"Dear Sir,\nthe log is lost.\n", "", ""),
    "JSON": (b'{"gyro": [1, 2, 3]}\n', "", ""),
    "XML": (b"<?xml version='1.0'?>\n<log/>\n", "", ""),
    "word in a cell": (table(with_row(7, "0.07,none-such,0,0")), "", "line 9: column 2 is 'none-such'"),
    "nan": (table(with_row(7, "0.07,0,nan,0")), "", "line 9: column gy is nan; a finite number is needed"),
    "infinite": (table(with_row(7, "0.07,0,0,inf")), "", "--repair nan allows it"),
    "empty cell": (table(with_row(7, "0.07,0,0,")), "", "line 9"),
    "short row": (table(with_row(7, "0.07,0,0")), "", "line 9: 3 columns; 4 are needed"),
    "long row": (table(with_row(7, "0.07,0,0,0,0,5")), "", "line 9: 6 columns"),
    "time twice": (table(with_row(7, "0.06,0,0,0")), "", "--repair repeats allows it"),
    "time back": (table(with_row(7, "0.055,0,0,0")), "", "--repair order allows it"),
    "clock set back": (
        table([*rows(100), *(f"{k / 100 - 5:.2f},0,{k % 3},1" for k in range(100, 200))]),
        *("", "the clock is set back"),
    ),
    "uneven": (table(with_row(7, "0.072,0,0,0")), "", "--repair clock allows it"),
    "gap": (table(rows()[:20] + rows()[25:]), "", "5 samples lost in 1 place; --gaps split or --gaps bridge"),
    "stuck": (
        table(
            [
                *rows(),
                *(f"{k / 100},9,9,9" for k in range(40, 60)),
                *(f"{k / 100},{k},1,1" for k in range(60, 300)),
            ]
        ),
        "",
        "--repair stuck allows it",
    ),
    "no time": (table(rows(), "a,gx [rad/s],gy,gz"), "", "no column of time"),
    "two times": (table(rows(), "time,seconds,gy,gz"), "", "several columns of time"),
    "no rates": (table(rows(), "t,a,b,c"), "", "no rates about three axes"),
    "two gyros": (
        table(
            [f"{row},1,2,3" for row in rows()], "t,gyro1_x [rad/s],gyro1_y,gyro1_z,gyro2_x,gyro2_y,gyro2_z"
        ),
        *("", "2 sets of columns about three axes"),
    ),
    "two units": (table(rows(), "t,gx [rad/s],gy [deg/s],gz"), "", "one unit is needed"),
    "no unit": (table(rows(), "t,gx,gy,gz"), "", "--rate-unit is needed"),
    "unit of a force": (table(rows(), "t,gx [m/s^2],gy [m/s^2],gz [m/s^2]"), "", "no rates"),
    "other unit": (table(rows()), "--rate-unit deg/s", "contradicts the header"),
    "unknown unit": (table(rows()), "--rate-unit rpm", "rate unit 'rpm' is not known"),
    "times in no unit": (table(rows(step=10), "t,gx [rad/s],gy,gz"), "", "--time-unit s, ms, us or ns"),
    "column that is not there": (table(rows()), "--columns t,gx,gy,gw", "'gw' is no column"),
    "two columns": (table(rows()), "--columns t,gx", "names 2 columns; 4 are needed"),
    "key that is not there": (
        table(rows()),
        "--columns t=t,x=gx,y=gy,w=gz",
        "'w' is not known; allowed: t, x, y, z",
    ),
    "topic that is not there": (table(rows()), ":gyro", "topic 'gyro' is not known"),
    "no forces": (table(rows()), "strapdown dcm --fast-cycles 2", "no specific forces along three axes"),
    "nothing between": (table(rows()), "--start 5", "0 rows between --start and --end"),
    "too short for a step": (table(rows(3)), "--increments 4", "a step needs 4"),
    "too short for a sum": (table(rows(5)), "--every 9", "no piece of 9 samples"),
    "left-handed axes": (table(rows()), "--axes x,y,-z", "left-handed"),
    "numbers too large": (table([f"{k / 10},1e308,1e308,1e308" for k in range(9)]), "--method rk2", ""),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_log_is_refused_in_one_line_and_nothing_is_written(name, tmp_path, capsys):
    content, options, said = BAD[name]
    log, out = tmp_path / "bad.log", tmp_path / "out.csv"
    log.write_bytes(content)
    topic, _, options = options.partition(" ") if options.startswith(":") else ("", "", options)
    words = shlex.split(options)
    command = [] if words[:1] == ["strapdown"] else ["simulate", "euler"]
    status, text, err = ran([*command, *words, "--recording", f"{log}{topic}", "--out", str(out)], capsys)
    assert (status, text, err.count("\n"), out.exists()) == (2, "", 1, False), err
    assert err.startswith("strapgen: ") and said in err and "Traceback" not in err
    status, _, err = ran(["log", str(log)], capsys)
    assert status in (0, 2) and err.count("\n") <= 1


def test_there_are_at_least_40_of_them():
    assert len(BAD) >= 40
