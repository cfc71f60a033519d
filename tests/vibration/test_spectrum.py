"""Random vibration: Savage's integrals, single frequencies as the limit, and kernels that run on noise."""

from __future__ import annotations

import math

import numpy as np
import pytest

import strapgen
from strapgen import catalogue, gyro, vibration
from strapgen.exceptions import InputError
from strapgen.simulation import attitude
from strapgen.vibration import Spectrum, random_rates, read_spectrum

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
    increments = gyro.windows(np.diff(angles, axis=0), 2)
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


def test_a_density_of_zero_is_reached_in_a_straight_line(tmp_path):
    rows = "frequency_hz,density,angle_x_rad,angle_y_rad\n0,1,1,1\n10,1,1,1\n20,0,1,1\n"
    found = read_spectrum(written(tmp_path, rows))
    assert found.density(np.array([0.0, 5.0, 15.0, 20.0])) == pytest.approx([1, 1, 0.5, 0])
    assert random_rates(vibration.of(choose("euler")), found, "0.02").rates == pytest.approx(
        (0, 0, 0), abs=1e-12
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("frequency_hz,density,angle_x_rad\n1,1,1\n", "holds 1 rows below its header; at least 2"),
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
    ("transfers", "edges", "said"),
    [
        ({"angle_z": abs}, (1.0, 2.0), "transfer function 'angle_z' is not known"),
        ({}, (1.0,), "two rising frequencies"),
        ({}, (2.0, 1.0), "two rising frequencies"),
        ({}, (-1.0, 1.0), "two rising frequencies"),
        ({}, (1.0, math.inf), "two rising frequencies"),
    ],
)
def test_spectra_that_are_refused(transfers, edges, said):
    with pytest.raises(InputError, match=said):
        Spectrum(np.ones_like, transfers, edges)
