"""Faults of recordings: each is named once with its option, and repaired as that says."""

from __future__ import annotations

import numpy as np
import pytest

import strapgen
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings import faults
from strapgen.lab.recordings.faults import REACH, examined, restoring_taps
from strapgen.lab.recordings.recording import InertialRecording, Recording, propagate

COUNT, STEP = 400, 0.01
TIME = STEP * np.arange(1, COUNT + 1)
#: A motion in the band that a lost sample is restored in: 0.9 of its end.
RATES = np.column_stack(
    [np.cos(2 * np.pi * f * TIME + phase) for f, phase in ((18.6, 0.1), (3.3, 1.0), (0.7, 2.0))]
)


def noisy(rng, size=1e-3):
    """Return rates no two of which are equal."""
    return RATES + rng.normal(0, size, RATES.shape)


def read(time, rates, **options) -> Recording:
    return Recording.from_rates(time, rates, **options)


def refused(time, rates, *said: str, **options) -> None:
    with pytest.raises(InputError) as refusal:
        read(time, rates, **options)
    message = str(refusal.value)
    assert "\n" not in message and message.startswith("the recording")
    for words in said:
        assert words in message


def test_a_recording_without_faults_has_its_rates_times_the_interval():
    got = read(TIME, RATES)
    np.testing.assert_allclose(got.samples, RATES * STEP, rtol=1e-12)
    assert (got.start, len(got.pieces)) == (pytest.approx(0, abs=1e-12), 1)
    assert got.remarks == (
        f"{COUNT} rates are means over the intervals that end at their times, {COUNT} increments",
    )
    at_instants = read(TIME, RATES, input="instants")
    assert len(at_instants.samples) == COUNT - 1 and "second order" in at_instants.remarks[0]
    assert at_instants.start == TIME[0]


def test_rows_without_numbers_are_restored_in_the_band():
    broken = RATES.copy()
    broken[100, 1], broken[250] = np.nan, np.inf
    refused(TIME, broken, "row 100: column rate_y is nan; a finite number is needed; 2 rows", "--repair nan")
    got = read(TIME, broken, repair="nan")
    np.testing.assert_allclose(got.samples, RATES * STEP, atol=2e-6 * STEP)
    assert f"2 lost samples restored by a filter of {REACH} samples on each side" in got.remarks


def test_a_single_lost_sample_is_restored_and_several_are_on_a_line(rng):
    kept = np.ones(COUNT, bool)
    kept[[50, 200, 201, 202]] = False
    refused(
        TIME[kept], RATES[kept], "row 199: a gap of 0.04 s", "4 samples lost in 2 places", "--gaps bridge"
    )
    got = read(TIME[kept], RATES[kept], gaps="bridge")
    assert len(got.samples) == COUNT and got.interval == pytest.approx(STEP, rel=1e-12)
    np.testing.assert_allclose(got.samples[50], RATES[50] * STEP, atol=2e-6 * STEP)
    line = RATES[199] + np.multiply.outer([0.25, 0.5, 0.75], RATES[203] - RATES[199])
    np.testing.assert_allclose(got.samples[200:203], line * STEP, rtol=1e-9)
    np.testing.assert_allclose(got.samples[204:], RATES[204:] * STEP, rtol=1e-9)
    assert "3 lost samples put on the line between neighbours" in got.remarks


@pytest.mark.parametrize("lost", [[3], [COUNT - 4], [100, 105]])
def test_a_lost_sample_without_enough_good_ones_beside_it_is_on_a_line(lost):
    kept = np.ones(COUNT, bool)
    kept[lost] = False
    got = read(TIME[kept], RATES[kept], gaps="bridge")
    for place in lost:
        np.testing.assert_allclose(
            got.samples[place], (RATES[place - 1] + RATES[place + 1]) / 2 * STEP, rtol=1e-9
        )
    assert not any("filter" in text for text in got.remarks)


def test_the_filter_restores_what_is_in_its_band():
    """Its response is 1 up to the end of the band, where another design from the same page has it."""
    taps = restoring_taps()
    places = np.array([*range(-REACH, 0), *range(1, REACH + 1)])
    for b in np.linspace(0.01, 1.3, 40):
        assert abs((taps * np.exp(1j * b * places)).sum() - 1) < 2e-6
    assert np.sqrt(np.square(taps).sum()) == pytest.approx(1.8, abs=0.1)


def test_pieces_start_anew():
    kept = np.ones(COUNT, bool)
    kept[150:170] = False
    got = read(TIME[kept], RATES[kept], gaps="split")
    assert [len(piece.samples) for piece in got.pieces] == [150, 230]
    assert got.pieces[1].start == pytest.approx(TIME[169], abs=1e-12)
    backend = strapgen.backend("euler", backend="numpy")
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    history = propagate(backend, got, initial=turn)
    assert [*np.unique(history.piece, return_counts=True)[1]] == [76, 116]
    for number in (1, 2):
        own = propagate(backend, got.pieces[number - 1], initial=turn)
        np.testing.assert_array_equal(history.states[history.piece == number], own.states)
        np.testing.assert_array_equal(history.time[history.piece == number], own.time)
        np.testing.assert_allclose(own.states[0], [0, 0, np.sqrt(0.5), np.sqrt(0.5)], atol=1e-15)


@pytest.mark.parametrize("places", [[60], [60, 300], [300]])
def test_rows_are_restored_within_pieces(places):
    kept, broken = np.ones(COUNT, bool), RATES.copy()
    kept[150:170], broken[places, 0] = False, np.nan
    got = read(TIME[kept], broken[kept], gaps="split", repair="nan")
    assert [len(piece.samples) for piece in got.pieces] == [150, 230]
    whole = np.concatenate([RATES[:150], RATES[170:]]) * STEP
    np.testing.assert_allclose(got.samples, whole, atol=2e-6 * STEP)


def test_short_pieces_are_left_out():
    kept = np.ones(COUNT, bool)
    kept[[101, 103]] = False
    got = read(TIME[kept], RATES[kept], gaps="split")
    assert [len(piece.samples) for piece in got.pieces] == [101, 1, 296]
    history = propagate(strapgen.backend("euler", backend="numpy"), got)
    assert set(history.piece) == {1, 2} and history.unused == 1 + 1


def test_repeated_rows_are_left_out():
    rows = np.repeat(np.arange(COUNT), 1 + (np.arange(COUNT) % 50 == 7))
    refused(
        TIME[rows],
        RATES[rows],
        "row 8: its time is that of the row before; 8 rows repeat",
        "--repair repeats",
    )
    rates = RATES[rows]
    rates[1:][np.diff(rows) == 0] = 9  # the first of them counts
    np.testing.assert_allclose(read(TIME[rows], rates, repair="repeats").samples, RATES * STEP, rtol=1e-9)


def test_rows_out_of_order_are_sorted():
    rows = np.arange(COUNT)
    rows[[20, 21]], rows[[300, 303]] = rows[[21, 20]], rows[[303, 300]]
    refused(TIME[rows], RATES[rows], "row 21: its time lies 0.01 s before", "--repair order")
    np.testing.assert_allclose(read(TIME[rows], RATES[rows], repair="order").samples, RATES * STEP, rtol=1e-9)


def test_rows_that_run_backwards_are_turned_round():
    back = slice(None, None, -1)
    refused(
        TIME[back], RATES[back], "row 1: its time lies 0.01 s before", "backwards in time", "--repair order"
    )
    broken = RATES[back].copy()
    broken[40] = np.nan
    got = read(TIME[back], broken, repair="order,nan")
    np.testing.assert_allclose(got.samples, RATES * STEP, atol=2e-6 * STEP)
    assert got.start == pytest.approx(TIME[0] - STEP)


def test_times_that_are_all_the_same_are_refused():
    same = np.zeros(COUNT)
    refused(same, RATES, f"{COUNT - 1} rows repeat a time", "--repair repeats")
    refused(same, RATES, "holds 1 sample without faults; 2 are needed", repair="all", gaps="bridge")


def test_a_clock_that_is_set_back_goes_on():
    time = TIME.copy()
    time[200:] -= 1.7
    refused(time, RATES, "row 200: its time lies 1.69 s before", "the clock is set back", "--repair clock")
    np.testing.assert_allclose(read(time, RATES, repair="clock").samples, RATES * STEP, rtol=1e-9)


def test_late_stamps_are_no_gaps(rng):
    """Stamps are late by up to six intervals, one sample is lost, and no row is before the one before."""
    time = np.maximum.accumulate(TIME + np.where(rng.random(COUNT) < 0.1, 0.06 * rng.random(COUNT), 0))
    time += 1e-6 * np.arange(COUNT)
    kept = np.arange(COUNT) != 210
    refused(time[kept], RATES[kept], "sample times are not even", "--repair clock")
    got = read(time[kept], RATES[kept], repair="clock", gaps="bridge")
    assert len(got.samples) == COUNT and got.interval == pytest.approx(STEP, rel=2e-3)
    np.testing.assert_allclose(got.samples, RATES * got.interval, atol=1e-4 * STEP)


def test_a_coarse_clock_is_made_even():
    time = np.floor(TIME / 0.03) * 0.03
    refused(time, RATES, "the clock is coarse", "--repair clock")
    got = read(time, RATES, repair="clock")
    assert len(got.samples) == COUNT and got.interval == pytest.approx(STEP, rel=1e-2)


def test_a_stuck_gyro_is_seen_and_a_resting_one_is_not(rng):
    rates = noisy(rng)
    rates[120:150] = rates[120]
    refused(TIME, rates, "row 120: the same values in 30 rows: the gyro is stuck", "--repair stuck")
    got = read(TIME, rates, repair="stuck")
    line = rates[120] + np.multiply.outer(np.arange(1, 30) / 30, rates[150] - rates[120])
    np.testing.assert_allclose(got.samples[121:150], line * STEP, rtol=1e-6, atol=1e-12)
    assert len(read(TIME, np.round(noisy(rng) / 40)).samples) == COUNT  # counts of a gyro that hardly turns


def test_faults_of_all_kinds_together_are_each_said_once(rng):
    rates, time = noisy(rng), TIME.copy()
    rates[30, 0] = np.nan
    rates[300:320] = rates[300]
    rows = np.delete(np.arange(COUNT), [180])
    rows[[60, 61]] = rows[[61, 60]]
    rows = np.insert(rows, 90, rows[90])
    got = read(time[rows], rates[rows], repair="all", gaps="bridge")
    assert len(got.samples) == COUNT
    for word in ("a finite number", "out of order", "repeats a time", "stuck", "a gap of"):
        assert sum(word in text for text in got.remarks) == 1, word


@pytest.mark.parametrize(("axes", "order"), [("x,-y,-z", [0, 1, 2]), ("y,-z,-x", [1, 2, 0])])
def test_forces_follow_the_rates(axes, order, rng):
    forces = rng.normal(0, 1, (COUNT, 3))
    got = read(TIME, np.degrees(RATES), unit="deg/s", force=forces, force_unit="g", axes=axes)
    assert isinstance(got, InertialRecording)
    signs = np.array([1, -1, -1])
    np.testing.assert_allclose(got.samples, RATES[:, order] * STEP * signs, rtol=1e-12)
    np.testing.assert_allclose(got.velocity_increments, forces[:, order] * 9.80665 * STEP * signs, rtol=1e-12)


def test_a_part_of_a_recording_is_read():
    got = read(TIME, RATES, start="0.995", end="1.995", every=3)
    np.testing.assert_allclose(got.samples[0], RATES[100:103].sum(axis=0) * STEP, rtol=1e-9)
    assert (len(got.samples), got.start) == (33, pytest.approx(1.0))
    assert got.remarks[-1] == "1 increment left out, which fill no sum of 3"


def test_stamps_keep_their_digits():
    """A nanosecond since 1970 is beyond the digits of a double."""
    stamps = 1_700_000_000_000_000_123 + 1_000_000 * np.arange(100) + np.arange(100) % 2 * 400
    even = Recording.from_rates(stamps, RATES[:100], time_unit="ns")
    assert even.interval == pytest.approx(1e-3, rel=1e-5)
    samples = examined(1e-9 * (stamps - stamps[0]), RATES[:100], "txyz")
    assert samples.departure == pytest.approx(4e-4, rel=2e-2)
    days = np.datetime64("2026-01-02T03:04:05.000000123") + np.arange(100).astype("timedelta64[ms]")
    assert Recording.from_rates(days, RATES[:100]).interval == pytest.approx(1e-3, rel=1e-12)


FRAMES = ["dict", "pandas", "pandas index", "polars", "xarray", "pyarrow"]


@pytest.mark.parametrize("kind", FRAMES)
def test_data_frames_are_read_alike(kind):
    columns = {"time_us": (TIME * 1e6).round().astype(int)} | {
        f"gyr_{axis} [deg/s]": np.degrees(RATES[:, k]) for k, axis in enumerate("xyz")
    }
    frame = columns
    if kind == "polars":
        frame = pytest.importorskip("polars").DataFrame(columns)
    elif kind == "pyarrow":
        frame = pytest.importorskip("pyarrow").table(columns)
    elif kind == "xarray":
        frame = pytest.importorskip("xarray").Dataset(
            {name: ("row", values) for name, values in columns.items()}
        )
    elif kind.startswith("pandas"):
        pandas = pytest.importorskip("pandas")
        frame = pandas.DataFrame(columns)
        if kind == "pandas index":
            times = pandas.to_datetime(frame.pop("time_us"), unit="us")
            frame = frame.set_index(times.rename("time"))
    got = Recording.from_frame(frame)
    np.testing.assert_allclose(got.samples, RATES * STEP, rtol=1e-9)


def test_missing_values_of_a_data_frame_are_faults():
    polars = pytest.importorskip("polars")
    frame = polars.DataFrame({"t": [0.0, 0.1, 0.2], "x": [1, None, 3], "y": [0, 1, 0], "z": [2, 2, 2]})
    with pytest.raises(InputError, match=r"^the recording, row 1: column x is nan.*--repair nan allows it$"):
        Recording.from_frame(frame, rate_unit="rad/s")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"axes": "x,y,-z"}, "axes x,y,-z is a left-handed set"),
        ({"axes": "x,x,z"}, "axes is 'x,x,z'; each of x, y, z once is needed"),
        ({"gaps": "jump"}, "gaps 'jump' is not known; allowed: refuse, split, bridge"),
        ({"repair": "some"}, "repair 'some' is not known"),
        ({"input": "angles"}, "input 'angles' is not known"),
        ({"every": 0}, "every is 0; a whole number at least 1"),
        ({"every": 1000}, "holds no piece of 1000 samples"),
        ({"start": 3.995}, "between --start and --end; 2 are needed"),
        ({"unit": "rpm"}, "rate unit 'rpm' is not known"),
    ],
)
def test_what_is_not_allowed_is_refused_in_one_line(options, said):
    with pytest.raises(InputError) as refusal:
        read(TIME, RATES, **options)
    assert said in str(refusal.value) and "\n" not in str(refusal.value)


def test_too_long_a_gap_is_not_bridged(monkeypatch):
    monkeypatch.setattr("strapgen.lab.recordings.reading._MOST_SAMPLES", 1000)
    time = np.where(np.arange(COUNT) < 200, TIME, TIME + 50)
    with pytest.raises(InputError, match=r"5000 lost samples are too many to put in; --gaps split"):
        read(time, RATES, gaps="bridge")
    assert len(read(time, RATES, gaps="split").pieces) == 2


def test_repairs_have_the_names_of_the_options():
    from strapgen.lab import run_options

    assert (*faults.REPAIRS, "all") == run_options._REPAIRS and faults.GAPS == run_options._GAPS


@pytest.mark.parametrize("make", [Recording.from_rates, Recording.from_increments])
def test_an_unknown_keyword_is_named_with_those_that_are_allowed(make):
    with pytest.raises(InputError, match=r"^keyword 'gap' is not known \(did you mean gaps\?\)"):
        make([0.1, 0.2], np.zeros((2, 3)), gap="split")
