"""Responses of sensors: filters as SciPy has them, samples by their definition, tables, words, and refusals."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from mpmath.ctx_mp import MPContext

from strapgen.catalogue.methods.sensor_response import Response, parse, read_table
from strapgen.design.family import gyro_lines
from strapgen.ir.exceptions import InputError

RATE = Fraction(100)
HERTZ = np.array([0.5, 7.0, 19.0, 38.0])
WORDS = [
    "increments",
    "second-order:40:0.7071",
    "butterworth:4:40+delay:0.003",
    "bessel:3:60+decimation:4",
    "fir:1/2:1/3:1/6",
    "fir:0.2:0.4:0.3:0.1+decimation:2",
    "instants",
    "butterworth:2:35+instants+decimation:3+delay:0.001",
]


@pytest.mark.parametrize("order", range(1, 9))
@pytest.mark.parametrize("name", ["butterworth", "bessel"])
def test_filters_are_the_prototypes_of_scipy(name, order):
    signal = pytest.importorskip("scipy.signal")
    turns = 2 * np.pi * 40
    if name == "butterworth":
        prototype = signal.butter(order, turns, analog=True)
    else:
        prototype = signal.bessel(order, turns, analog=True, norm="mag")
    expected = signal.freqs(*prototype, 2 * np.pi * HERTZ)[1]
    np.testing.assert_allclose(parse("r", f"{name}:{order}:40").gain(HERTZ), expected, rtol=1e-9)


def sampled(response: Response, hertz: float) -> complex:
    """Return sample 0 of the rate e^{iwt}, by its definition: internal samples, each a mean or an instant."""
    interval, count = 1 / float(RATE), response.decimation
    inner, turn = interval / count, 2j * np.pi * hertz
    total = 0.0
    for k, weight in enumerate(response.weights):
        if response.input == "instants":
            one = np.exp(turn * -k * inner)
        else:
            end = interval - k * inner
            one = (np.exp(turn * end) - np.exp(turn * (end - inner))) / turn / inner
        total += float(weight) * one
    analog = replace(response, taps=(), decimation=1, input="increments")
    return total * analog.gain(hertz)


@pytest.mark.parametrize("words", WORDS)
def test_a_gain_is_that_of_samples_by_their_definition(words):
    response = parse("r", words).at(RATE)
    assert response.words == words.replace("1/2", "0.5").replace(
        "1/3:1/6", "0.333333333333:0.166666666667"
    ) or ("+" in words)
    for hertz in HERTZ:
        b = 2 * np.pi * hertz / float(RATE)
        ideal = np.exp(0.5j * b) * np.sinc(b / 2 / np.pi)
        assert response.gain(hertz) * ideal == pytest.approx(sampled(response, hertz), rel=1e-12)


@pytest.mark.parametrize("words", [*WORDS, "table"])
def test_the_series_is_that_of_the_gain(words, tmp_path):
    response = (table(tmp_path) if words == "table" else parse("r", words)).at(RATE)
    context = MPContext()
    context.prec = 200
    b = context.mpf("0.01")
    pi = context.mpf(245850922) / 78256779
    value = response.gain(b * 100 / (2 * pi), context) * context.sinc(b / 2)
    series = [context.mpf(c.numerator) / c.denominator for c in response.series(9)]
    sum_of_terms = context.polyval(series[::-1], context.mpc(0, b))
    assert abs(value - sum_of_terms) < 1e-13


def table(folder, columns=("frequency_hz", "magnitude", "phase_deg"), step=1.0):
    """Write the response of a Butterworth filter of fourth order at 40 Hz, and read it."""
    hertz = np.arange(step, 50 + step / 2, step)
    gain = parse("r", "butterworth:4:40").gain(hertz)
    values = {
        "frequency_hz": hertz,
        "magnitude": np.abs(gain),
        "phase_deg": np.degrees(np.angle(gain)),  # wrapped
        "delay_s": -np.unwrap(np.angle(gain)) / (2 * np.pi * hertz),
    }
    rows = zip(*(values[name] for name in columns), strict=True)
    path = folder / "aa.csv"
    path.write_text(
        "\n".join([",".join(columns), *(",".join(map(repr, map(float, row))) for row in rows)]) + "\n"
    )
    return parse("r", "aa.csv", folder)


@pytest.mark.parametrize("last", ["phase_deg", "delay_s"])
def test_a_table_is_what_it_was_made_of(tmp_path, last):
    read = table(tmp_path, ("magnitude", "frequency_hz", last))
    between = np.array([0.1, 3.3, 20.5, 29.9, 41.7])
    expected = parse("r", "butterworth:4:40").gain(between)
    np.testing.assert_allclose(read.gain(between), expected, rtol=3e-5)
    assert abs(read.gain(60.0)) == pytest.approx(abs(read.gain(50.0)))  # held above the last row


def test_a_row_at_rest_needs_no_delay(tmp_path):
    (tmp_path / "aa.csv").write_text("frequency_hz,magnitude,phase_deg\n0,1,0\n10,1,-36\n20,1,-72\n")
    rows = np.array(read_table(tmp_path / "aa.csv"), float)
    np.testing.assert_allclose(rows, [[0, 1, 0.01], [10, 1, 0.01], [20, 1, 0.01]], rtol=1e-15)


@pytest.mark.parametrize("words", [word for word in WORDS if "/" not in word])
def test_words_and_the_lines_of_a_file_say_the_same(words):
    import tomllib

    from strapgen.catalogue import toml_models

    response = parse("r", words).at(RATE)
    again = toml_models.parse(Response, tomllib.loads("\n".join(gyro_lines(response))))
    assert again == response == parse("r", response.words).at(RATE)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("butterwort:4:40", "--response 'butterwort:4:40' is not known; allowed: second-order:HZ:DAMPING"),
        ("butterworth:9:40", "order is 9; a whole number from 1 to 8"),
        ("butterworth:x:40", "order is 'x'; a whole number"),
        ("bessel:2:-3", "frequency_hz is '-3'; a number above 0 in Hz"),
        ("fir:1:-1", "taps sum to 0"),
        ("decimation:0", "decimation is 0; a whole number from 1 to 256"),
        ("delay:0.1+delay:0.2", "has delay_s twice; one is needed"),
        ("missing.csv", "missing.csv cannot be read"),
    ],
)
def test_wrong_words_are_refused(words, message):
    with pytest.raises(InputError) as refusal:
        parse("--response", words)
    assert message in str(refusal.value) and "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "frequency_hz,gain\n1,1\n2,1\n",
            "has the columns frequency_hz, gain; frequency_hz, magnitude, and phase_deg",
        ),
        ("frequency_hz,magnitude,phase_deg\n1,1,0\n", "has 1 row; 2 to 5000 are needed"),
        ("frequency_hz,magnitude,phase_deg\n1,1,0\n2,1\n", "line 3: 2 cells; 3 are needed"),
        ("frequency_hz,magnitude,phase_deg\n1,1,0\n2,one,0\n", "line 3: magnitude is 'one'"),
        ("frequency_hz,magnitude,phase_deg\n0,1,5\n2,1,0\n", "has a phase of 5 deg at 0 Hz; 0 is needed"),
        ("frequency_hz,magnitude,delay_s\n2,1,0\n1,1,0\n", "table has frequencies that do not rise"),
        ("frequency_hz,magnitude,delay_s\n1,0,0\n2,1,0\n", "a magnitude that is not above 0"),
    ],
)
def test_wrong_tables_are_refused(tmp_path, text, message):
    (tmp_path / "aa.csv").write_text(text)
    with pytest.raises(InputError) as refusal:
        parse("--response", "aa.csv", tmp_path)
    assert message in str(refusal.value) and "\n" not in str(refusal.value)


def test_what_does_not_go_together_is_refused():
    with pytest.raises(
        InputError, match="frequency_hz is missing; a filter bessel has frequency_hz and order"
    ):
        Response("bessel", order=3)
    with pytest.raises(InputError, match="frequency_hz is there; there is no filter"):
        Response(frequency_hz=Fraction(40))
    with pytest.raises(InputError, match="sample_hz of the response is 100, not 200"):
        Response(sample_hz=Fraction(100)).at(Fraction(200))
    with pytest.raises(InputError, match="sample_hz is missing"):
        Response(input="instants").gain(10.0)
