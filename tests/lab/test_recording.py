"""Recorded gyro data: what a file may look like, what is refused and where, exact resampling, propagation."""

from __future__ import annotations

import math
import re
import runpy
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation
from tolerances import certified

import strapgen
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings.recording import Recording, propagate, read_increments, read_rates
from strapgen.run.increments import pulses

DATA = Path(__file__).parents[1] / "data"
MAKER = runpy.run_path(str(DATA / "make_recordings.py"))

EVEN = [["0.01", "1e-3", "2e-3", "3e-3"], ["0.02", "4e-3", "5e-3", "6e-3"], ["0.03", "7e-3", "8e-3", "9e-3"]]
INCREMENTS = np.array(EVEN, float)[:, 1:]


@pytest.fixture
def write(tmp_path: Path):
    """Write rows of cells, or a text as it is, into a file."""

    def to_file(rows: list[list[str]] | str | bytes, newline: str = "\n") -> Path:
        path = tmp_path / "gyro.csv"
        if isinstance(rows, list):
            rows = "".join(",".join(row) + newline for row in rows)
        path.write_bytes(rows if isinstance(rows, bytes) else rows.encode())
        return path

    return to_file


def rates(path: Path, **rest: object) -> Recording:
    """Read rates, from a file that says increments in its header too."""
    text = path.read_bytes().decode(errors="replace").lower() if path.is_file() else ""
    columns = "t,dx,dy,dz" if "dx" in text else None
    return read_rates(path, "rad/s", columns=columns, **rest)


READERS = {"increments": read_increments, "rates": rates}


@pytest.fixture(params=list(READERS))
def read(request: pytest.FixtureRequest):
    return READERS[request.param]


# The files of this test


def test_files_are_the_output_of_their_script():
    texts = MAKER["recordings"]()
    assert {path.name for path in DATA.glob("*.csv")} == texts.keys()
    for name, text in texts.items():
        assert (DATA / name).read_text() == text


def truth(time: float) -> Rotation:
    """Return the true attitude at a time, by another integrator."""

    def slope(t: float, q: np.ndarray) -> np.ndarray:
        w = np.radians([MAKER["rate"](axis, t) for axis in range(3)])
        return 0.5 * np.concatenate([q[3] * w + np.cross(q[:3], w), [-q[:3] @ w]])

    return Rotation.from_quat(solve_ivp(slope, (0, time), [0, 0, 0, 1], rtol=1e-9, atol=1e-12).y[:, -1])


def loaded(name: str) -> Recording:
    if name == "increments.csv":
        return read_increments(DATA / name)
    return strapgen.read(DATA / name, input="instants", repair="clock")


@pytest.mark.long
@pytest.mark.parametrize("name", ["increments.csv", "rates_even.csv", "rates_uneven.csv"])
def test_recordings_lead_to_the_true_attitude(name, make):
    backend = make("euler", largest=0.01, carry="full")
    history = propagate(backend, loaded(name))
    # Times that are taken as even have the mean departure of the stamps.
    within = 1e-3 if name == "rates_uneven.csv" else 1e-9
    assert history.time[[0, -1]] == pytest.approx([0, 4], abs=within)
    error = Rotation.from_quat(history.states[-1]) * truth(4.0).inv()
    # Noise of 0.05 deg/s in 400 samples of 0.01 s walks 0.01 deg on each axis; increments hardly walk.
    noise = 1e-3 if name == "increments.csv" else 0.06
    steps = len(history.time) - 1
    assert math.degrees(error.magnitude()) < noise + math.degrees(2 * certified(backend, steps))


# What a file may look like


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"], ids=["plain", "mark"])
@pytest.mark.parametrize("header", [True, False])
def test_line_endings_and_byte_order_mark(newline, mark, header, write, read):
    path = write([["t", "dx", "dy", "dz"]] * header + EVEN, newline)
    path.write_bytes(mark + path.read_bytes())
    assert len(read(path).samples) == (3 if read is read_increments else 2)


def test_increments_are_read(write):
    got = read_increments(write(EVEN))
    np.testing.assert_array_equal(got.samples, INCREMENTS)
    assert got.interval == pytest.approx(0.01, rel=1e-12)
    assert got.start == pytest.approx(0, abs=1e-15), "the first increment begins before its time"


@pytest.mark.parametrize("order", ["t dx dy dz", "dz t dy dx", "dx dy dz t"])
def test_increments_by_name_in_any_order(order, write):
    names = [*order.split(), "temperature"]
    place = {"t": 0, "dx": 1, "dy": 2, "dz": 3}
    rows = [[row[place[name]] if name in place else "warm" for name in names] for row in EVEN]
    shouted = [f" {name.upper()} " for name in names]
    np.testing.assert_array_equal(read_increments(write([shouted, *rows])).samples, INCREMENTS)


def test_columns_can_be_stated_by_name_or_number(write):
    header = ["Time (s)", "pitch", "roll", "yaw", "note"]
    path = write([header, *([*row, "text"] for row in EVEN)])
    with pytest.raises(InputError, match=r"no rates about three axes are named among .*'pitch'.*--columns"):
        read_rates(path, "rad/s")
    for columns in ("time,pitch,roll,yaw", "Time (s),pitch,roll,yaw", "1,2,3,4"):
        got = read_rates(path, "rad/s", columns=columns)
        np.testing.assert_allclose(got.samples, (INCREMENTS[1:] + INCREMENTS[:-1]) / 2 * 0.01, rtol=1e-13)
        assert got.start == 0.01
    with pytest.raises(InputError, match=r"'speed' is no column of 'Time \(s\)'"):
        read_rates(path, "rad/s", columns="time,pitch,roll,speed")


def test_blank_lines_and_spaces_are_ignored(write, read):
    rows = [
        [],
        ["t", "dx", "dy", "dz"],
        [" "],
        EVEN[0],
        [f"  {c} " for c in EVEN[1]],
        [],
        EVEN[2],
    ]
    plain = write(EVEN).read_bytes()
    wanted = read(write(plain)).samples
    np.testing.assert_array_equal(read(write(rows)).samples, wanted)
    # Empty cells are data that is missing, not a blank line.
    with pytest.raises(InputError, match="line 3: column 1 is nan"):
        read(write([EVEN[0], EVEN[1], ["", "", "", ""], EVEN[2]]))


def test_units_of_rates(write):
    path = write(EVEN)
    degrees, radians = read_rates(path, "deg/s"), read_rates(path, "rad/s")
    np.testing.assert_allclose(degrees.samples, np.radians(radians.samples), rtol=1e-14)


def test_unknown_unit(write):
    with pytest.raises(InputError, match=r"^rate unit 'rpm' is not known; allowed: rad/s, deg/s, "):
        read_rates(write(EVEN), "rpm")


# What is refused, and where


def refused(read, path: Path, *said: str) -> None:
    with pytest.raises(InputError) as refusal:
        read(path)
    message = str(refusal.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    for words in said:
        assert words in message


def changed(line: int, column: int, cell: str) -> list[list[str]]:
    """Return a file with a header, six rows and one cell changed; lines count from 1."""
    rows = [["t", "dx", "dy", "dz"], *([f"0.0{k}", "1e-3", "2e-3", "3e-3"] for k in range(1, 7))]
    rows[line - 1][column - 1] = cell
    return rows


NAMES = ("t", "dx", "dy", "dz")
BAD, PLAIN = changed(5, 2, "bad"), changed(2, 1, "0.01")
REFUSED: list[tuple[list[list[str]] | str | bytes, tuple[str, ...]]] = [
    *(
        (
            changed(*place, cell),
            ("line {}: column {} is {!r}; a finite number is needed".format(*place, cell),),
        )
        for place in ((2, 1), (4, 1), (5, 3), (7, 4))
        for cell in ("twelve", "1.2.3", "0x1f", "1_0", "٣")
    ),
    *(
        (
            changed(*place, cell),
            (f"line {place[0]}: column {NAMES[place[1] - 1]} is {value}; a finite number is needed",),
        )
        for place in ((2, 1), (4, 1), (5, 3), (7, 4))
        for cell, value in {
            "nan": "nan",
            "NaN": "nan",
            "": "nan",
            "1e999": "inf",
            "-Infinity": "-inf",
        }.items()
    ),
    # Line numbers count blank lines.
    ([BAD[0], [], *BAD[1:3], [], [], *BAD[3:]], ("line 8: column 2 is 'bad'",)),
    # A first row with a bad time, or with underscores in its numbers, is no header.
    *(
        (changed(2, 1, cell)[1:], (f"line 1: column 1 is {value}",))
        for cell, value in {"": "nan", "x": "'x'", "nan": "nan"}.items()
    ),
    (
        [["1_0", "1_0", "2_0", "3_0"], ["20", "1", "2", "3"]],
        ("line 1: column 1 is '1_0'; a finite number is",),
    ),
    ([["-1e308", "0", "0", "0"], ["1e308", "0", "0", "0"]], ("1e+308 s are too far apart",)),
    ([*PLAIN[:4], PLAIN[4][:3], *PLAIN[5:]], ("line 5: 3 columns; 4 are needed",)),
    *(
        (
            changed(4, 1, time),
            ("line 4: ", f"its time lies {less} s before that of the row before", "--repair order allows it"),
        )
        for time, less in {"0.015": "0.005", "-1": "1.02"}.items()
    ),
    (
        [*PLAIN[:5], *([f"{0.2 + 0.01 * number:.2f}", *row[1:]] for number, row in enumerate(PLAIN[5:]))],
        (
            "line 6: a gap of 0.16 s, the mean interval is 0.01 s; 15 samples lost in 1 place; --gaps split or --gaps "
            "bridge allows it",
        ),
    ),
    ("", ("holds 0 rows of numbers; at least 2 are needed",)),
    ("t,dx,dy,dz\n", ("holds 0 rows",)),
    ("t,dx,dy,dz\n0.1,0,0,0\n", ("holds 1 row of numbers",)),
    (b"\xff\xfe0\x00,\x001\x00", ("is no text file of comma-separated values",)),
    (b"\x89PNG\r\n\x1a\n\x00\x00", ("is no text file of comma-separated values",)),
    ("t,dx,dy,dz\n" + "x" * 200_000 + ",0,0,0\n", ("line 2: over 20000 characters, which no line may have",)),
    ("t,dx,dy,dz\n" + "0," * 1500 + "0\n", ("line 2: 1501 cells; at most 1000 are allowed",)),
    ('t,dx,dy,dz\n"' + "x\n" * 100_000, ("is no text file of comma-separated values (field larger than",)),
]


@pytest.mark.parametrize(("rows", "said"), REFUSED, ids=[said[-1] for _, said in REFUSED])
def test_a_file_is_refused_in_one_line(rows, said, write, read):
    refused(read, write(rows), *said)


@pytest.mark.parametrize(
    ("name", "said"),
    [("t", "no column of time among"), *((name, "no increments about three axes") for name in NAMES[1:])],
)
def test_missing_column_of_increments(name, said, write):
    rows = [["t", "dx", "dy", "dz"], *EVEN]
    rows[0][rows[0].index(name)] = "other"
    refused(read_increments, write([[], *rows]), said, "--columns NAME,... says which")


def test_uneven_times_name_the_worst_interval(write, read):
    rows = changed(3, 1, "0.0205")  # 0.0105, then 0.0095
    rows[5][0], rows[6][0] = "0.0515", "0.0615"  # 0.0115 is worse
    path = write(rows)
    refused(read, path, "line 6: sample times are not even: the interval of 0.0115 s before it is the worst")
    refused(read, path, "--repair clock allows it")


def test_times_rounded_to_microseconds_are_even(write, read):
    rows = [[f"{k / 128:.6f}", "0", "0", "0"] for k in range(1, 200)]
    assert read(write(rows)).interval == pytest.approx(1 / 128, rel=1e-6)


@pytest.mark.posix
def test_file_that_cannot_be_read(tmp_path, read):
    refused(read, tmp_path / "none.csv", "cannot be read (No such file or directory)")
    refused(read, tmp_path, "cannot be read (Is a directory)")
    refused(read, Path("/dev/null/x"), "cannot be read (Not a directory)")


# Integration of rates


def csv_of(time: np.ndarray, values: np.ndarray) -> list[list[str]]:
    return [[repr(float(cell)) for cell in row] for row in np.column_stack([time, values])]


@st.composite
def samples(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    count = draw(st.integers(2, 30))
    start = draw(st.floats(-100, 100))
    intervals = draw(st.lists(st.floats(0.0097, 0.0103), min_size=count - 1, max_size=count - 1))
    time = start + np.concatenate([[0], np.cumsum(intervals)])
    cells = st.floats(-5, 5).map(lambda x: round(x, 6))
    values = draw(st.lists(st.tuples(cells, cells, cells), min_size=count, max_size=count))
    return time, np.array(values)


@given(samples(), st.integers(1, 4))
@settings(max_examples=25, deadline=None)
def test_the_trapezoid_integrates_a_piecewise_linear_rate_exactly(sampled, every):
    time, values = sampled
    if every >= len(time):
        return
    got = Recording.from_rates(time, values, input="instants", every=every)
    assert got.start == time[0]
    count = (len(time) - 1) // every
    assert got.interval == pytest.approx(every * (time[-1] - time[0]) / (len(time) - 1), rel=1e-12)
    integral = make_interp_spline(time, values, k=1).antiderivative()
    # Round-off of the times counts: at 100 s it is 1e-14 s, times rates of up to 5 rad/s.
    wanted = np.diff(integral(time[: count * every + 1 : every]), axis=0)
    np.testing.assert_allclose(got.samples, wanted, rtol=0, atol=5e-13)


@pytest.mark.parametrize(
    ("hertz", "said"),
    [
        ("0", "resample_hz is 0; a number above 0 is needed"),
        ("-5", "resample_hz is -5; a number above 0 is needed"),
        ("nan", "resample_hz is 'nan'; a finite number is needed"),
        ("often", "resample_hz is 'often'; a finite number is needed"),
        ("0.2", "resample_hz 0.2 makes no whole increment of 401 samples"),
        ("1e-320", "makes no whole increment"),
    ],
)
@pytest.mark.filterwarnings("ignore:resample_hz of read_rates is now every")
def test_invalid_frequencies_are_refused(hertz, said):
    with pytest.raises(InputError, match=said):
        read_rates(DATA / "rates_uneven.csv", "deg/s", hertz)


@pytest.mark.parametrize(("hertz", "every"), [(100, 1), (50, 2), (1000, 1), (34, 3)])
def test_the_old_frequency_sums_whole_samples(hertz, every):
    with pytest.warns(DeprecationWarning, match=r"^resample_hz of read_rates is now every of read"):
        old = read_rates(DATA / "rates_even.csv", "deg/s", hertz)
    new = strapgen.read(DATA / "rates_even.csv", input="instants", every=every)
    np.testing.assert_array_equal(old.samples, new.samples)
    assert old.interval == new.interval == pytest.approx(every / 100)


# Propagation


@pytest.fixture
def even(write) -> Recording:
    """Return a recording of 24 increments of 0.125 s that starts at 10 s."""
    return Recording(10.0, 0.125, np.random.default_rng(3).normal(scale=0.02, size=(24, 3)))


def test_every_step_is_recorded(make, algorithm, even):
    backend = make(algorithm)
    history = propagate(backend, even)
    np.testing.assert_array_equal(history.states, backend.propagate(even.samples.reshape(12, 2, 3)))
    np.testing.assert_array_equal(history.time, 10 + 0.25 * np.arange(13))
    assert (history.step, history.unused) == (0.25, 0)


def test_records_and_orthonormalization_are_counted_in_steps(make, even):
    backend = make("dcm")
    history = propagate(backend, even, orthonormalize="0.5", record="0.75")
    wanted = backend.propagate(even.samples.reshape(12, 2, 3), 3, 2)
    np.testing.assert_array_equal(history.states, wanted)
    np.testing.assert_array_equal(history.time, 10 + 0.75 * np.arange(5))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"record": "0.3"}, "record 0.3 s is not a whole multiple of the step 0.25 s"),
        ({"record": "0.1"}, "record 0.1 s is not a whole multiple"),
        ({"record": "5"}, "record 5 s is longer than the recording, 3 s"),
        ({"record": "0"}, "record is 0; a number above 0"),
        ({"record": "1e300"}, "record 1e300 s is not a whole multiple"),
        ({"orthonormalize": "0.3"}, "orthonormalize 0.3 s is not a whole multiple"),
        ({"orthonormalize": "nan"}, "orthonormalize is 'nan'; a finite number"),
        ({"orthonormalize": "-1"}, "orthonormalize is -1; a number above 0"),
        ({"orthonormalize": "1e300"}, "orthonormalize 1e300 s is not a whole multiple"),
    ],
)
def test_invalid_intervals_are_refused(options, said, even, make):
    with pytest.raises(InputError, match=re.escape(said)):
        propagate(make("euler"), even, **options)


@pytest.mark.filterwarnings("error")
def test_an_overflowing_attitude_is_refused(make, even):
    large = Recording(even.start, even.interval, np.full((24, 3), 1e30))
    backend = make("dcm")
    said = r"^the attitude is not finite from 1\d"
    if backend.rounding_bound(1) is not None:
        said = r"^increments holds 1e\+30; the formats of dcm-rk4-2 were chosen for at most 0.125"
    with np.errstate(all="ignore"), pytest.raises(InputError, match=said):
        propagate(backend, large)


# Steps that keep increments


@pytest.mark.long
@pytest.mark.parametrize(
    ("count", "previous"),
    [(1, 1), (1, 3), (2, 2), pytest.param(5, 3, marks=pytest.mark.long)],
)
def test_previous_increments_come_from_the_start_of_a_recording(count, previous, even):
    backend = strapgen.backend("euler", "rk4", count, "numpy", previous=previous)
    history = propagate(backend, even)
    steps, unused = divmod(24 - previous, count)
    assert (len(history.time), history.unused) == (1 + steps, unused)
    np.testing.assert_allclose(
        history.time, 10 + 0.125 * (previous + count * np.arange(1 + steps)), rtol=0, atol=1e-12
    )
    state, states = backend.identity, [backend.identity]
    for k in range(steps):
        state = backend.step(state, even.samples[k * count : k * count + previous + count])
        states.append(state)
    # Two orders of the same products of unit quaternions.
    np.testing.assert_allclose(history.states, states, rtol=0, atol=16 * steps * 2.0**-53)


@pytest.mark.long
def test_a_recording_of_one_step_is_run_and_a_shorter_one_refused(even):
    backend = strapgen.backend("euler", "rk4", 2, "numpy", previous=3)
    history = propagate(backend, Recording(even.start, even.interval, even.samples[:5]))
    assert (len(history.time), history.unused) == (2, 0)
    short = Recording(even.start, even.interval, even.samples[:4])
    with pytest.raises(InputError, match=r"^the recording holds 4 increments; a step needs 5$"):
        propagate(backend, short)


def test_pulses_of_a_recording_are_counted_once(even):
    backend = strapgen.backend("euler", "rk4", 1, "numpy", previous=2)
    size = 2.0**-10
    history = propagate(backend, even, pulse=size)
    counted = Recording(even.start, even.interval, pulses(even.samples[:, None], size)[:, 0])
    np.testing.assert_array_equal(history.states, propagate(backend, counted).states)
    assert not np.array_equal(history.states, propagate(backend, even).states)


# Numbers near the end of their range

EXTREME = {
    "large": [(0.1, "1e200"), (0.2, "1e200"), (0.3, "-1e200"), (0.4, "1e200")],
    "largest": [(0.1, "1e308"), (0.2, "1e308"), (0.3, "1e308"), (0.4, "1e308")],
    "smallest": [(0.1, "5e-324"), (0.2, "5e-324"), (0.3, "1e-310"), (0.4, "1e-320")],
    "late": [(1e307, "1e300"), (2e307, "1e300"), (3e307, "1e300"), (4e307, "1e300")],
    "short": [(5e-324, "1"), (1e-323, "1"), (1.5e-323, "1"), (2e-323, "1")],
    "far": [(-1.7e308, "1"), (0, "1"), (1.7e308, "1")],
}


def outcome(call) -> object:
    """Return what a call returns, or the one line in which it refuses; nothing may warn."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return call()
        except InputError as error:
            assert "\n" not in str(error)
            return str(error)


@pytest.mark.long
@pytest.mark.parametrize("name", EXTREME)
def test_extreme_recordings_are_run_or_refused_without_warnings(name, write):
    path = write([[repr(time), *[value] * 6] for time, value in EXTREME[name]])
    outcomes = {}
    for repair in ((), "all"):
        for kind in ("instants", "rates"):
            options = {"input": kind, "rate_unit": "rad/s", "repair": repair, "gaps": "bridge"}
            outcomes[f"{kind} {repair}"] = outcome(lambda o=options: strapgen.read(path, **o))
    outcomes["increments"] = data = outcome(lambda: read_increments(path))
    inertial = outcome(lambda: strapgen.read_inertial(path))
    for backend in (strapgen.backend("euler", "rk4", 1, name) for name in ("numpy", "c-fixed32")):
        for pulse in (None, 1e-6, 1e-306):
            if isinstance(data, Recording):
                run = outcome(lambda b=backend, p=pulse: propagate(b, data, pulse=p))
                outcomes[f"{backend.name} {pulse}"] = run
        if isinstance(inertial, Recording):
            options = {"fast_cycles": 2, "backend": backend.name}
            outcomes[f"course {backend.name}"] = outcome(
                lambda o=options: strapgen.course("dcm", inertial, **o)
            )
    for key, result in outcomes.items():
        if isinstance(result, Recording):
            assert np.isfinite(result.samples).all(), key
        elif not isinstance(result, str):
            assert np.isfinite(result.time).all() and np.isfinite(result.states).all(), key


def test_rates_whose_integral_overflows_are_refused(write):
    path = write([[repr(time), value, "0", "0"] for time, value in EXTREME["late"]])
    with pytest.raises(InputError, match=r"the integral of a rate is beyond the range of double$"):
        read_rates(path, "rad/s", time_unit="s")


def test_intervals_are_matched_to_a_hundredth_of_a_step(even):
    measured = Recording(even.start, 0.1250003, even.samples)
    history = propagate(strapgen.backend("euler", backend="numpy"), measured, record="0.75")
    assert len(history.time) == 5
