"""Random vibration: Savage's integrals, single frequencies as the limit, kernels that run on noise, and quadrature."""

from __future__ import annotations

import math
import re
from itertools import pairwise

import numpy as np
import pytest

import strapgen
from strapgen import catalogue
from strapgen.analysis import vibration
from strapgen.analysis.vibration import Spectrum, random_rates, read_spectrum
from strapgen.analysis.vibration.spectrum import integrate
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.lab.runs import attitude
from strapgen.run.increments import windows

choose = catalogue.choose


def resonance(size, hertz, damping):
    return lambda f: size / (1 - (f / hertz) ** 2 + 2j * damping * f / hertz)


#: A structure that is shaken by 1e-4 units^2/Hz, less at high frequencies.
SHAKEN = Spectrum(
    lambda f: 1e-4 / (1 + (f / 60) ** 2),
    {
        "angle_x": resonance(0.02, 22, 0.1),
        "angle_y": resonance(0.03, 31, 0.2),
        "acceleration_x": resonance(2.0, 40, 0.2),
        "acceleration_y": resonance(3.0, 31, 0.15),
    },
    (2.0, 150.0),
)
FAST, CYCLES = 0.004, 10
SLOW = FAST * CYCLES


def savage(integrand):
    """Return an integral of the paper over omega, by Simpson's rule; P per rad/s."""
    f = np.linspace(2.0, 150.0, 40001)
    omega = 2 * np.pi * f
    density = SHAKEN.density(f) / (2 * np.pi)
    moved = {name: function(f) for name, function in SHAKEN.transfers.items()}
    size = {name: np.abs(value) for name, value in moved.items()}
    phase = {name: np.angle(value) for name, value in moved.items()}
    values = integrand(omega, size, phase) * density
    weights = np.full(len(f), 2.0)
    weights[1::2] = 4.0
    weights[[0, -1]] = 1.0
    return float(weights @ values * (omega[1] - omega[0]) / 3)


def coning(omega, size, phase):
    return -omega * size["angle_x"] * size["angle_y"] * np.sin(phase["angle_y"] - phase["angle_x"])


def sculling(omega, size, phase):
    first = np.cos(phase["angle_x"] - phase["acceleration_y"]) * size["angle_x"] * size["acceleration_y"]
    second = np.cos(phase["angle_y"] - phase["acceleration_x"]) * size["angle_y"] * size["acceleration_x"]
    return first - second


def slow(omega):
    return np.sin(omega * SLOW) / (omega * SLOW)


def fast(omega):
    return np.sin(omega * FAST) / (omega * FAST)


def recursion_26(omega):
    return (1 + (1 - np.cos(omega * FAST)) / 3) * fast(omega)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "quantity", "moved", "algorithm"),
    [
        ("coning-fast", "drift", coning, recursion_26),  # (68), (77), (78)
        ("sculling-fast-2", "sculling", sculling, fast),  # (74), (82), (83)
    ],
)
def test_equations_68_74_77_78_82_and_83(name, quantity, moved, algorithm):
    found = random_rates(vibration.of(choose(name), quantity), SHAKEN, SLOW, cycles=CYCLES)

    def integral(factor):
        return savage(lambda omega, *rest: moved(omega, *rest) * factor(omega))

    wanted = [
        integral(lambda omega: 1 - slow(omega)),
        integral(lambda omega: algorithm(omega) - slow(omega)),
        integral(lambda omega: algorithm(omega) - 1),
    ]
    assert found.rates == pytest.approx(wanted, rel=1e-9)
    assert max(found.quadrature) < 1e-9 * abs(found.rates.continuous)


@pytest.mark.long
@pytest.mark.parametrize("quantity", ["drift", "sculling"])
def test_a_narrow_band_is_one_frequency(quantity):
    """A band of width w and density c^2/2w around f is an oscillation of amplitude c."""
    assessed = vibration.of(choose("euler", "rk4", 2), quantity)
    f, width, size, phase = 11.0, 1e-4, 3e-3, 0.8
    band = Spectrum(
        lambda at: size**2 / (2 * width) + 0 * at,
        {
            "angle_x": lambda at: 1.0 + 0 * at,
            "angle_y": lambda at: 2.0 * np.exp(1j * phase) + 0 * at,
            "acceleration_y": lambda at: 500.0 * np.exp(1j * phase) + 0 * at,
        },
        (f - width / 2, f + width / 2),
    )
    one = assessed.rates(f, "0.02", theta_x=size, theta_y=2 * size, phase=phase, acceleration_y=500 * size)
    assert random_rates(assessed, band, "0.02").rates == pytest.approx(one, rel=1e-8)


def test_a_kernel_runs_on_noise():
    """A sum of oscillations in random phases, each with the strength of its band; over a common period all pairs of
    different frequencies cancel, so that the drift is that of the spectrum however the phases fall.
    """
    choice = choose("dcm", "rk4", 2)
    step, steps, seed = 0.01, 4001, 7
    spectrum = Spectrum(
        SHAKEN.density, {name: SHAKEN.transfers[name] for name in ("angle_x", "angle_y")}, (5.0, 45.0)
    )
    period = step * steps
    lines = np.arange(round(5 * period), round(45 * period)) + 1
    f = lines / period
    random = np.random.default_rng(seed)
    sizes = np.sqrt(2 * spectrum.density(f) / period) * np.exp(2j * np.pi * random.random(len(f)))
    times = step / 2 * np.arange(2 * steps + 1)
    moved = [spectrum.transfers[name](f) * sizes for name in ("angle_x", "angle_y")]
    angles = np.zeros((len(times), 3))
    for axis, amplitudes in enumerate(moved):
        spectral = np.zeros(2 * steps, complex)
        spectral[lines] = amplitudes
        angles[:-1, axis] = (np.fft.ifft(spectral) * 2 * steps).real
    angles[-1] = angles[0]
    increments = windows(np.diff(angles, axis=0), 2)
    ready = strapgen.backend("dcm", "rk4", 2)
    end = attitude(ready, ready.propagate(increments)[-1:])[0]
    measured = math.atan2(end[1, 0] - end[0, 1], end[0, 0] + end[1, 1]) / period
    rates = random_rates(vibration.of(choice), spectrum, "0.01").rates
    # The band is a sum of 1600 lines; beyond the second order there are angles of 1e-3 rad.
    assert measured == pytest.approx(rates.computed, rel=1e-4)
    assert abs(rates.error) > 0.015 * abs(rates.continuous)  # which is told from the true rate


def test_a_resonant_step_takes_no_spectrum_beyond_it():
    assessed = vibration.of(choose("euler", "rk1", 2))
    assert random_rates(assessed, SHAKEN, "0.005").rates.error
    with pytest.raises(InputError, match="takes 100 Hz, whole periods in a step, for a turn"):
        random_rates(assessed, SHAKEN, "0.01")


# Files

ROWS = """frequency_hz,density,angle_x_rad,angle_y_rad,angle_y_phase_rad
5,1e-4,0.02,0.03,-1.0
20,1e-4,0.02,0.01,-1.5

80,1e-6,0.002,0.001,-3.0
"""


def written(tmp_path, text):
    path = tmp_path / "spectrum.csv"
    path.write_text(text)
    return path


def test_a_file_is_a_spectrum(tmp_path):
    found = read_spectrum(written(tmp_path, ROWS))
    f = np.array([5.0, 12.5, 20.0, 40.0, 80.0])
    # From 20 to 80 Hz the density falls by 20 dB in two octaves.
    assert found.density(f) == pytest.approx([1e-4, 1e-4, 1e-4, 1e-5, 1e-6])
    assert found.edges == (5.0, 20.0, 80.0)
    assert list(found.transfers) == ["angle_x", "angle_y"]
    assert found.transfers["angle_x"](f) == pytest.approx([0.02, 0.02, 0.02, 0.014, 0.002])
    assert np.angle(found.transfers["angle_y"](f)) == pytest.approx([-1.0, -1.25, -1.5, -2.0, -3.0])


@pytest.mark.parametrize("cell", ["1_0", "٣", "", "x", "inf"])
def test_a_cell_that_is_no_finite_number(cell, tmp_path):
    path = written(tmp_path, f"frequency_hz,density,angle_x_rad\n5,1,1\n20,{cell},1\n")
    with pytest.raises(
        InputError, match=rf"line 3: density is {re.escape(repr(cell))}; a finite number is needed$"
    ):
        read_spectrum(path)


def test_a_density_of_zero_is_reached_in_a_straight_line(tmp_path):
    rows = "frequency_hz,density,angle_x_rad,angle_y_rad,angle_y_phase_rad\n0,1,1,1,0.7\n10,1,1,1,0.7\n20,0,1,1,0.7\n"
    found = read_spectrum(written(tmp_path, rows))
    assert found.density(np.array([0.0, 5.0, 15.0, 20.0])) == pytest.approx([1, 1, 0.5, 0])
    true = computed = 0.0
    for low, high, density in ((0, 10, lambda f: 1 + 0 * f), (10, 20, lambda f: (20 - f) / 10)):

        def integrand(f, ratio, density=density):
            # An oscillation as strong as a band of width df has the amplitudes sqrt(2 P df).
            return -np.pi * f * np.sin(0.7) * 2 * density(f) * ratio(f)

        true += simpson(low, high, lambda f, drift=integrand: drift(f, lambda f: 1))
        computed += simpson(low, high, lambda f, drift=integrand: drift(f, rk4_2))
    rates = random_rates(vibration.of(choose("euler")), found, "0.02").rates
    assert rates == pytest.approx((true, computed, computed - true), rel=1e-9)


def simpson(low, high, function, points=20001):
    """Return an integral between two rows, without the ends, where a quotient may have no value."""
    f = np.linspace(low, high, points)
    f[0] += 1e-12
    weights = np.full(points, 2.0)
    weights[1::2] = 4.0
    weights[[0, -1]] = 1.0
    return float(weights @ function(f)) * (high - low) / (points - 1) / 3


def rk4_2(f):
    """Return what rk4 on two increments makes of the drift in a step of 0.02 s, of 1."""
    x = np.pi * f * 0.02
    return 4 * np.sin(x) / (3 * x) - np.sin(2 * x) / (6 * x)


#: Rows with a falling and a rising density, and phases that wind; the paper's fast and slow sines over them.
SEVERAL = """frequency_hz,density,angle_x_rad,angle_x_phase_rad,angle_y_rad,angle_y_phase_rad,\
acceleration_x_m_s2,acceleration_x_phase_rad,acceleration_y_m_s2,acceleration_y_phase_rad
3,1e-5,0.02,0.1,0.03,-1.0,2,0.4,1,1.2
11,4e-4,0.05,-0.6,0.01,-1.5,5,0.9,4,-0.3
26,3e-4,0.01,-2.0,0.02,1.4,1,2.5,3,0.2
45,1e-6,0.002,-3.0,0.004,3.0,0.5,2.0,0.7,-1.1
""".replace("\\\n", "")


def drift_of_one(f, moved, phases):
    """Return Savage's coning rate for amplitudes of 1 in a unit of band: (65) with the phase of y before x."""
    turn = np.sin(phases["angle_y"] - phases["angle_x"])
    return -np.pi * f * moved["angle_x"] * moved["angle_y"] * turn


def sculling_of_one(f, moved, phases):
    """Return the mean of half the cross products both ways: angle about x with y, less angle about y with x."""
    ways = [
        moved[f"angle_{a}"]
        * moved[f"acceleration_{b}"]
        * np.cos(phases[f"angle_{a}"] - phases[f"acceleration_{b}"])
        / 2
        for a, b in ("xy", "yx")
    ]
    return ways[0] - ways[1]


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "quantity", "one", "step", "cycles", "made", "less"),
    [
        ("coning-fast", "drift", drift_of_one, SLOW, CYCLES, lambda f: recursion_26(2 * np.pi * f), True),
        ("sculling-fast-2", "sculling", sculling_of_one, SLOW, CYCLES, lambda f: fast(2 * np.pi * f), True),
        ("euler", "drift", drift_of_one, "0.02", None, rk4_2, False),
        ("euler", "sculling", sculling_of_one, "0.02", None, rk4_2, False),
    ],
)
def test_a_file_of_several_rows_is_integrated(name, quantity, one, step, cycles, made, less, tmp_path):
    """Between rows the density is a power of frequency, magnitudes and phases are straight lines: Simpson's rule."""
    rows = [list(map(float, row.split(","))) for row in SEVERAL.splitlines()[1:]]
    channels = ("angle_x", "angle_y", "acceleration_x", "acceleration_y")

    def between(low, high, factor):
        def integrand(f):
            share = (f - low[0]) / (high[0] - low[0])
            power = math.log(high[1] / low[1]) / math.log(high[0] / low[0])
            line = [a + (b - a) * share for a, b in zip(low, high, strict=True)]
            moved = dict(zip(channels, line[2::2], strict=True))
            phases = dict(zip(channels, line[3::2], strict=True))
            return 2 * low[1] * (f / low[0]) ** power * one(f, moved, phases) * factor(f)

        return simpson(low[0], high[0], integrand)

    ending = (lambda f: slow(2 * np.pi * f)) if less else (lambda f: 0.0)
    true, computed = (
        sum(between(low, high, lambda f, ratio=ratio: ratio(f) - ending(f)) for low, high in pairwise(rows))
        for ratio in (lambda f: 1.0, made)
    )
    found = random_rates(
        vibration.of(choose(name), quantity), read_spectrum(written(tmp_path, SEVERAL)), step, cycles=cycles
    )
    assert found.rates == pytest.approx((true, computed, computed - true), rel=1e-9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("frequency_hz,density,angle_x_rad\n1,1,1\n", "holds 1 row below its header; at least 2"),
        (ROWS.replace("density", "psd"), "column 'psd' is not known; allowed: frequency_hz, density"),
        (ROWS.replace("angle_y_rad", "angle_x_rad"), "column 'angle_x_rad' is there twice"),
        (ROWS.replace("angle_y_rad", "acceleration_y_m_s2"), "has no column angle_y_rad beside it"),
        (ROWS.replace("density", "acceleration_x_m_s2"), "no column 'density'"),
        (
            "frequency_hz,density\n1,1\n2,1\n",
            "nothing moves; a column angle_x_rad, angle_y_rad, acceleration_x_m_s2",
        ),
        (ROWS.replace("20,", "5,"), "line 3: frequency_hz 5 does not rise above 5"),
        (ROWS.replace("0.001", "-0.001"), "angle_y_rad is -0.001 in a row; no number below 0"),
        (ROWS.replace("0.001", "nan"), "line 5: angle_y_rad is 'nan'; a finite number"),
        (ROWS.replace(",0.001", ""), "line 5: 4 cells; 5 are needed"),
    ],
)
def test_files_that_are_refused(text, said, tmp_path):
    with pytest.raises(InputError) as caught:
        read_spectrum(written(tmp_path, text))
    assert said in str(caught.value)


@pytest.mark.parametrize("path", ["none.csv", "binary.csv"])
def test_files_that_cannot_be_read(path, tmp_path):
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(InputError, match=r"cannot be read|is no text file"):
        read_spectrum(tmp_path / path)


@pytest.mark.parametrize(
    ("changed", "kind", "said"),
    [
        ({"transfers": {"angle_z": abs}}, InputError, "transfer function 'angle_z' is not known"),
        ({"transfers": {}}, InputError, "nothing moves; a transfer function is needed: angle_x, angle_y"),
        *(
            ({"edges": edges}, InputError, "two rising frequencies")
            for edges in ((1.0,), (), (2.0, 1.0), (-1.0, 1.0), (1.0, math.inf))
        ),
        ({"density": 1}, InputTypeError, "density is 1; a function of frequency is needed"),
        (
            {"transfers": {"angle_x": 2.0}},
            InputTypeError,
            "angle_x is 2.0; a function of frequency is needed",
        ),
        ({"transfers": None}, InputTypeError, "functions are None; a dict of functions by name is needed"),
        ({"edges": "ab"}, InputTypeError, "the edges are 'ab'; frequencies in Hz are needed"),
        ({"edges": None}, InputTypeError, "the edges are None; frequencies in Hz are needed"),
        ({"edges": (1.0, "b")}, InputTypeError, "the edges hold 'b'; frequencies in Hz are needed"),
        ({"edges": (1.0, 2j)}, InputTypeError, "the edges hold 2j; frequencies in Hz are needed"),
    ],
)
def test_spectra_that_are_refused(changed, kind, said):
    given = {"density": np.ones_like, "transfers": {"angle_x": np.ones_like}, "edges": (1.0, 2.0)}
    with pytest.raises(kind, match=said):
        Spectrum(**{**given, **changed})


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("density", "transfer", "kind", "said"),
    [
        (lambda f: 1j + f, np.ones_like, InputTypeError, "density returns complex128; real numbers"),
        (lambda f: "loud", np.ones_like, InputTypeError, "density returns <U4; real numbers"),
        (lambda f: None, np.ones_like, InputTypeError, "density returns object; real numbers"),
        (
            lambda f: f[1:],
            np.ones_like,
            InputError,
            r"density returns shape \(\d+,\); \(\d+,\) like the frequencies",
        ),
        (
            lambda f: [[1.0], [1.0, 2.0]],
            np.ones_like,
            InputError,
            "density returns rows of different lengths",
        ),
        (lambda f: 1.5 - f, np.ones_like, InputError, r"density is -0\.\d+ at 1\.\d+ Hz; no number below 0"),
        (lambda f: np.nan * f, np.ones_like, InputError, r"the spectrum is not finite at 1\.\d+ Hz"),
        (np.ones_like, lambda f: "far", InputTypeError, "angle_y returns <U3; numbers are needed"),
        (np.ones_like, lambda f: f[:, None], InputError, "angle_y returns shape"),
        (np.ones_like, lambda f: 1e308j * f * 2, InputError, "the spectrum is not finite at"),
    ],
)
def test_functions_that_are_refused(density, transfer, kind, said):
    shaken = Spectrum(density, {"angle_x": np.ones_like, "angle_y": transfer}, (1.0, 2.0))
    with pytest.raises(kind, match=said):
        random_rates(vibration.of(choose("euler")), shaken, "0.02")


def test_functions_may_return_one_number():
    assessed = vibration.of(choose("euler"))
    single = Spectrum(lambda f: 2, {"angle_x": lambda f: 1, "angle_y": lambda f: 1j}, (1.0, 2.0))
    whole = Spectrum(
        lambda f: 2 + 0 * f, {"angle_x": np.ones_like, "angle_y": lambda f: 1j + 0 * f}, (1.0, 2.0)
    )
    rates = random_rates(assessed, single, "0.02").rates
    assert rates == random_rates(assessed, whole, "0.02").rates
    assert rates.continuous == pytest.approx(-math.pi * 3 / 2 * 2 * 2, rel=1e-12)  # pi f times 2 P


def test_arguments_that_are_refused():
    assessed = vibration.of(choose("euler"))
    with pytest.raises(InputTypeError, match=r"assessment is 3; what vibration\.of returns is needed"):
        random_rates(3, SHAKEN, 1)
    with pytest.raises(InputTypeError, match="spectrum is 3; a Spectrum is needed"):
        random_rates(assessed, 3, 1)
    with pytest.raises(InputError, match="tolerance is 0; a number above 0 is needed"):
        random_rates(assessed, SHAKEN, "0.001", tolerance=0)
    with pytest.raises(InputTypeError, match="spectrum is None; the path of a file is needed"):
        read_spectrum(None)


@pytest.mark.filterwarnings("error")
def test_a_density_that_rises_steeply(tmp_path):
    """By 600 orders of magnitude in an octave: no slope in between is beyond the range."""
    rows = "frequency_hz,density,angle_x_rad,angle_y_rad\n10,1e-300,1,1\n20,1e300,1,1\n"
    found = read_spectrum(written(tmp_path, rows))
    f = np.array([10.0, 200**0.5, 20.0])
    assert found.density(f) == pytest.approx([1e-300, 1, 1e300], rel=1e-10)
    assert random_rates(vibration.of(choose("euler")), found, "0.02").rates == (0, 0, 0)  # in phase


@pytest.mark.parametrize("most", [2, 3])
def test_a_file_of_more_rows_than_a_spectrum_has_is_refused(most, tmp_path, monkeypatch):
    monkeypatch.setattr("strapgen.analysis.vibration.spectrum._MOST_ROWS", most)
    path = written(tmp_path, "frequency_hz,density,angle_x_rad\n5,1,1\n20,1,1\n")
    if most == 3:
        assert read_spectrum(path).edges == (5, 20)
    else:
        with pytest.raises(InputError, match=r"has over 2 rows; that is too many for a spectrum$"):
            read_spectrum(path)


@pytest.mark.parametrize(
    ("function", "edges", "value"),
    [
        (lambda x: x**7, [0, 2], 32.0),
        (
            lambda x: np.exp(-x) * np.sin(40 * x),
            [0, 3],
            (40 - np.exp(-3) * (np.sin(120) + 40 * np.cos(120))) / 1601,
        ),
        (lambda x: np.abs(x - 0.3), [0, 0.3, 1], (0.09 + 0.49) / 2),
        (lambda x: 1 / (1e-6 + (x - 0.5) ** 2), [0, 1], 2000 * np.arctan(500)),
        (np.sqrt, [0, 1], 2 / 3),
        (lambda x: 0 * x, [0, 1], 0.0),
    ],
)
def test_integrals(function, edges, value):
    found = integrate(lambda x: np.array([function(x), 3 * function(x)]), edges, 0.5)
    for number, wanted in zip(found.values, (value, 3 * value), strict=True):
        assert abs(number - wanted) <= 2e-10 * abs(wanted)
    assert np.all(np.abs(found.values - [value, 3 * value]) <= found.errors + 1e-13 * abs(value))


def test_divergent_integrals_are_refused():
    with pytest.raises(InputError, match=r"not finite at 0\.5 Hz"):
        integrate(lambda x: np.where(np.abs(x - 0.5) < 1e-3, np.nan, 1.0)[None], [0, 1], 1.0)
    with pytest.raises(InputError, match="panels to integrate"):
        integrate(lambda x: 1 / (x - 0.3)[None], [0, 1], 1.0)
    with pytest.raises(InputError, match="panels to integrate"):
        integrate(lambda x: x[None], [0, 1], 1e-7)
    with pytest.raises(InputError, match="panels to integrate"):
        integrate(lambda x: x[None], [0, 1e308], 1e-7)
    with pytest.raises(InputError, match="the integral of the spectrum is beyond the range of double"):
        integrate(lambda x: 1e308 + 0 * x[None], [0, 100], 1.0)
