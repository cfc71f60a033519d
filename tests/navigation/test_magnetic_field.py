"""The magnetic field by spherical harmonics: against published test values, and against SciPy's Legendre functions."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from derived import kernel
from scipy.special import factorial, lpmv

import strapgen
from strapgen.catalogue import Choice, choose
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.kernel.kernel import evaluate_stages
from strapgen.navigation.frame.magnetic_field import MOST_YEARS, magnetic_field
from strapgen.navigation.frame.magnetic_file import MagneticModel, read

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "examples" / "magnetic" / "WMM2020.COF"
#: Columns: year, height in km, latitude, longitude in deg, X, Y, Z, H, F in nT, I, D in deg.
PUBLISHED = np.loadtxt(ROOT / "tests" / "data" / "WMM2020_test_values.txt")
LAST = 48 * "9"


def of_degree(degree: int) -> MagneticModel:
    """Return the example without its higher degrees."""
    whole = read(FILE)
    harmonics = {place: values for place, values in whole.harmonics.items() if place[0] <= degree}
    return replace(whole, harmonics=harmonics)


def chosen(degree: int, **constants: str) -> Choice:
    return choose("magnetic-field", layout=of_degree(degree), constants=constants or None)


def potential(model: MagneticModel, place: np.ndarray, years: float) -> float:
    """Return R sum (R/r)^(n+1) (g cos + h sin) P in nT m, with the functions of SciPy."""
    r = np.linalg.norm(place)
    longitude, total = math.atan2(place[1], place[0]), 0.0
    for (n, m), c in model.harmonics.items():
        normal = math.sqrt((2 if m else 1) * factorial(n - m) / factorial(n + m)) * (-1) ** m
        g, h = float(c.g + Fraction(years) * c.g_rate), float(c.h + Fraction(years) * c.h_rate)
        wave = g * math.cos(m * longitude) + h * math.sin(m * longitude)
        total += (6371200 / r) ** (n + 1) * wave * normal * lpmv(m, n, place[2] / r)
    return 6371200 * total


def by_differences(
    model: MagneticModel, latitude: float, longitude: float, height: float, years: float
) -> np.ndarray:
    """Return the field to north, east and down: differences of the potential at a point of the ellipsoid."""
    flattening = 1 / 298.257223563
    # The point of the ellipse by its parametric latitude, the height along the normal.
    reduced = math.atan2((1 - flattening) * math.sin(latitude), math.cos(latitude))
    normal = np.array([math.cos(latitude), math.sin(latitude)])
    across, axial = (
        6378137 * np.array([math.cos(reduced), (1 - flattening) * math.sin(reduced)]) + height * normal
    )
    place = np.array([across * math.cos(longitude), across * math.sin(longitude), axial])
    step = 2000.0
    gradient = []
    for axis in np.eye(3):
        near, far = (
            potential(model, place + k * step * axis, years)
            - potential(model, place - k * step * axis, years)
            for k in (1, 2)
        )
        gradient.append((8 * near - far) / (12 * step))
    up = np.array([normal[0] * math.cos(longitude), normal[0] * math.sin(longitude), normal[1]])
    east = np.array([-math.sin(longitude), math.cos(longitude), 0.0])
    return -np.array([np.cross(up, east) @ gradient, east @ gradient, -up @ gradient])


def test_published_values_come_out_in_their_digits():
    assert len(PUBLISHED) == 12
    evaluate = strapgen.evaluator(chosen(12))
    year, height, latitude, longitude, *values = PUBLISHED.T
    field, *others = evaluate(np.radians(latitude), np.radians(longitude), 1000 * height, year - 2020)
    horizontal, total, declination, inclination = others
    computed = np.array([*field.T, horizontal, total])
    assert np.abs(computed - np.array(values[:5])).max() <= 0.05 + 1e-6
    angles = np.degrees([inclination, declination])
    assert np.abs(angles - np.array(values[5:])).max() <= 0.005 + 1e-6


@pytest.mark.parametrize("degree", [1, 12])
def test_the_field_is_the_gradient_of_the_potential_also_at_a_pole(degree, rng):
    model, evaluate = of_degree(degree), strapgen.evaluator(chosen(degree))
    places = [(math.pi / 2, 0.7), (-math.pi / 2, -2.0), (0.0, math.pi)]
    places += [(rng.uniform(-1.5, 1.5), rng.uniform(-3, 3)) for _ in range(5)]
    for latitude, longitude in places:
        height, years = float(rng.integers(-1000, 80000)), float(rng.integers(-10, 11)) / 2
        field = evaluate(latitude, longitude, height, years)[0]
        expected = by_differences(model, latitude, longitude, height, years)
        assert np.abs(field - expected).max() < 2e-3  # the differences' own error


def test_no_proper_input_reaches_the_limits_of_a_degree(rng):
    derived = magnetic_field(of_degree(3))
    names = [signal.name for signal in derived.inputs]
    bounds = [float(signal.bound) for signal in derived.inputs]
    for _ in range(10):
        values = dict(zip(names, rng.choice([-1, 1], 4) * rng.uniform(0.5, 1, 4) * bounds, strict=True))
        known = evaluate_stages(derived.stages, values, float, lambda e, parts: float(e.func(*parts)))
        for n in (1, 2, 3):
            assert all(known[f"degree_{n}_{axis}"] == known[f"limited_{n}_{axis}"] != 0 for axis in "xyz")
    assert float(derived.inputs[3].bound) == MOST_YEARS


@pytest.mark.parametrize("degree", [2, pytest.param(12, marks=pytest.mark.long)])
def test_every_back_end_is_within_its_bound(degree, backend_name, rng):
    choice, entry = chosen(degree), strapgen.BACKENDS[backend_name]
    settings = Settings(word=entry.word or 32, ranges={"latitude": Fraction(5, 4)}) if entry.fixed else None
    if settings is not None and settings.word == 16:
        with pytest.raises(InputError, match="words of 16 bits are too short"):
            strapgen.evaluator(choice, backend_name, settings)
        return
    evaluate, exactly = strapgen.evaluator(choice, backend_name, settings), strapgen.evaluator(choice)
    latitudes, longitudes = rng.uniform(-1.25, 1.25, 40), rng.uniform(-3, 3, 40)
    heights, years = rng.uniform(0, 50000, 40), rng.uniform(-5, 5, 40)
    inputs = [values.astype(evaluate.dtype) for values in (latitudes, longitudes, heights, years)]
    if settings is not None:  # to the places of the formats
        units = [float(argument.format.unit) for argument in evaluate.interface.inputs]
        inputs = [np.rint(values / unit) * unit for values, unit in zip(inputs, units, strict=True)]
        bounds = [float(max(output.errors)) for output in evaluate.interface.outputs]
        assert bounds[0] < 6
    else:
        bounds = [size * np.finfo(evaluate.dtype).eps for size in (1e6, 1e6, 1e6, 100, 100)]
    # None is refused, though the horizontal field becomes small near a magnetic pole.
    results, expected = evaluate(*inputs), exactly(*(values.astype(float) for values in inputs))
    for result, value, bound in zip(results, expected, bounds, strict=True):
        assert np.abs(np.asarray(result, float) - value).max() <= bound


def test_a_time_as_a_constant_is_no_input_and_leaves_the_field():
    free, held = chosen(2), chosen(2, years="5/2")
    assert [signal.name for signal in kernel(held).inputs] == ["latitude", "longitude", "height"]
    place = 0.5, -2.0, 3000.0
    for one, other in zip(
        strapgen.evaluator(free)(*place, 2.5), strapgen.evaluator(held)(*place), strict=True
    ):
        np.testing.assert_allclose(one, other, rtol=1e-14)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "line 1 is no heading; the epoch in years"),
        ("2020.0\n", "line 1 is no heading; the epoch in years"),
        ("soon WMM\n", "line 1: epoch is 'soon'; a finite number is needed"),
        ("2020 3\n1 0 1 0 0 0\n", "must begin with a letter"),
        ("2020 mine\n", "the last row has degree 0, order 0"),
        (f"2020 mine\n{LAST}\n", "the last row has degree 0"),
        ("2020 mine\n1 0 1 0 0\n", "line 2 has 5 entries; degree, order, g and h in nT"),
        ("2020 mine\n1 0 1 0 0 0\n", "the last row has degree 1, order 0; all orders of a degree"),
        ("2020 mine\n0 0 1 0 0 0\n", "line 2 has degree 0, order 0; degree 1, order 0 is next"),
        ("2020 mine\n1 0 1 0 0 0\n1 0 1 0 0 0\n", "line 3 has degree 1, order 0; degree 1, order 1 is next"),
        ("2020 mine\n1 0 nan 0 0 0\n", "line 2: g is 'nan'; a finite number is needed"),
        ("2020 mine\n1 0.5 1 0 0 0\n", "line 2: order is '0.5'; a whole number is needed"),
        ("2020 mine\n1 0 1e6 0 0 0\n", "line 2: g is 1e\\+06; at most 100000 in magnitude is allowed"),
        ("2020 mine\n1 0 0 3 0 0\n", "line 2: h is 3; of order 0 it is 0"),
        ("2020 mine\n1 0 0 0 0 0\n1 1 0 0 0 0\n", "the coefficients are all 0"),
        ("x" * 50000, "over 40000 bytes; coefficients to degree 15 are shorter"),
    ],
)
def test_a_bad_file_is_one_line(text, words, tmp_path):
    path = tmp_path / "bad.COF"
    path.write_text(text)
    with pytest.raises(InputError, match=words) as error:
        choose("magnetic-field", layout=path)
    assert str(error.value).startswith(f"{path}") and "\n" not in str(error.value)


def test_more_degrees_than_code_may_have_are_refused(tmp_path):
    rows = [f"{n} {m} 1 {min(m, 1)} 0 0" for n in range(1, 17) for m in range(n + 1)]
    path = tmp_path / "long.COF"
    path.write_text("\n".join(["2020 mine", *rows]))
    with pytest.raises(InputError, match="has degree 16, order 0; no degree above 15 is next"):
        read(path)
    with pytest.raises(InputError, match=r"absent\.COF cannot be read"):
        read(tmp_path / "absent.COF")
    with pytest.raises(
        InputError, match=r"magnetic-field needs a file: layout names it, in a command --layout or --field$"
    ):
        choose("magnetic-field")


def test_the_coefficients_make_the_identity_of_a_choice():
    assert chosen(2).identity != chosen(3).identity
    assert chosen(2).kernel == "magnetic-field-wmm-2020"
