"""Coning coefficients for a band: their file, what is checked in it, and the drift of the built-in ones."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest

import strapgen
from strapgen import choose, derive
from strapgen.catalogue.methods import coning_coefficients, coning_drift, shaped_coning
from strapgen.catalogue.methods.coning import BAND, weights
from strapgen.catalogue.methods.coning_drift import ConingShape
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.methods.shaped_coning import SHAPES, read
from strapgen.ir.exceptions import InputError

FOLDER = Path(shaped_coning.__file__).parent / "coning_shapes"


@pytest.fixture
def text() -> str:
    """The file of the built-in coefficients, under another name."""
    content = (FOLDER / "coning-shaped-8.toml").read_text()
    return content.replace('name = "', 'name = "My ')


@pytest.mark.long
@pytest.mark.parametrize("name", SHAPES)
def test_built_in_coefficients_have_their_stated_properties(name):
    shaped_coning.verify(SHAPES[name])
    assert shaped_coning.SHAPE_TITLES[name] == SHAPES[name].title


def test_the_built_in_coefficients_are_those_published():
    published = (
        *(0.17201167, -0.07631754, 0.03328635, -0.01288471),
        *(0.00413782, -0.00102480, 0.000174125, -0.0000153530),
    )
    shape = SHAPES["coning-shaped-8"]
    assert [float(c) for c in shape.coefficients] == pytest.approx(published, abs=5e-9)
    assert float(shape.level) == pytest.approx(7.008e-10, abs=5e-14)


def test_a_file_goes_wherever_a_method_goes(text, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    shape = read(path)
    assert (shape.name, shape.file) == ("my-coning-1-8-to-1-3-rad", str(path))
    assert shape.coefficients == SHAPES["coning-shaped-8"].coefficients
    kernel = derive(choose("euler", shape))
    assert kernel.name == "euler-my-coning-1-8-to-1-3-rad-1-previous8"
    assert f"--coning {path}" in kernel.arguments
    assert derive(choose("sculling", shape)).inputs[1].shape == (9, 3)


def test_the_kernel_crosses_the_newest_sample_with_the_lever():
    """By hand: the sum of the samples of the step plus (sum of K_s times older samples) x the newest one."""
    shape = SHAPES["coning-shaped-8"]
    samples = [[Fraction(7 * k % 5 - 2, 10), Fraction(k % 3, 7), Fraction(k * k % 11, 13)] for k in range(9)]
    lever = [sum(c * samples[8 - s][axis] for s, c in enumerate(shape.coefficients, 1)) for axis in range(3)]
    x, y, z = samples[8]
    crossed = [lever[1] * z - lever[2] * y, lever[2] * x - lever[0] * z, lever[0] * y - lever[1] * x]
    expected = [float(a + b) for a, b in zip(samples[8], crossed, strict=True)]
    numbers = [[float(value) for value in row] for row in samples]
    computed = strapgen.evaluator(choose("rotation-vector", "coning-shaped-8"))(numbers)
    assert computed == pytest.approx(expected, rel=1e-14)


WRONG = {
    "level": (
        'level = "7.00799E-10"',
        'level = "7.00801E-10"',
        "level is 7.00801E-10; the coefficients have 7.00799e-10",
    ),
    "one digit": (
        'level = "7.00799E-10"',
        'level = "1E-8"',
        "level is 1E-8; the coefficients have 7.00799e-10",
    ),
    "high level": (
        'level = "7.00799E-10"',
        'level = "1E+400"',
        "level is 1E+400; the coefficients have 7.00799e-10",
    ),
    "coefficient": ('"99157974445826439/', '"99157974545826439/', "the coefficients have"),
    "powers": ("powers = 0", "powers = 1", "powers is 1, but the drift has the power 3 of the frequency"),
    "products": ("powers = 0", "products = 1", "products is 1, but a step is not exact for all products"),
    "count": ("previous = 8", "previous = 7", "coefficients has 8 numbers; 7 are needed for 1 samples and 7"),
    "no coefficients": (
        "previous = 8",
        "previous = 0",
        "coefficients has 8 numbers; 0 are needed for 1 samples",
    ),
    "rounded": (
        '"99157974445826439/576460752303423488"',
        "0.172",
        "level is 7.00799E-10; the coefficients have 1.64687e-05 over their band",
    ),
    "irrational": ('"99157974445826439/576460752303423488"', '"sqrt(2)"', "a rational number is needed"),
    "objective": (
        'objective = "band"',
        'objective = "least"',
        "objective 'least' is not known; allowed: band",
    ),
    "no band": ('band = "1.3"\n', "", "key band goes with the objective band"),
    "band": ('band = "1.3"', 'band = "3.5"', "band is '3.5'; a number above 0 and below 3 in rad a sample"),
    "spectrum": ('objective = "band"', 'objective = "worst"', "key band goes with the objective band"),
    "level text": ('level = "7.00799E-10"', 'level = "tiny"', "level is 'tiny'; a text of a decimal number"),
    "key": ("powers = 0", "power = 0", "key 'power' is not known"),
    "name": (
        'name = "My Coning 1+8 to 1.3 rad"',
        'name = "coning shaped 8"',
        "is that of the method coning-shaped-8",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_file_gets_one_line(case, text, tmp_path):
    old, new, words = WRONG[case]
    path = tmp_path / "wrong.toml"
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError) as refused:
        read(path)
    assert words in str(refused.value)
    assert str(refused.value).startswith(f"{path}: ") and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"increments": 2}, "increments is 2; a step of coning-shaped-8 has 1"),
        ({"previous": 3}, "previous is 3; a step of coning-shaped-8 has 8"),
        ({"ahead": 1}, "ahead is 1; a step of coning-shaped-8 has 0"),
        ({"rates": True}, "coning-shaped-8 takes increments; rates at nodes do not go with it"),
    ],
)
def test_other_samples_are_refused(options, words):
    with pytest.raises(InputError, match=words):
        choose("euler", "coning-shaped-8", **options)


SAMPLES = pytest.mark.parametrize(("increments", "previous"), [(1, 1), (1, 4), (1, 8), (3, 3), (4, 0)])


def columns(increments: int, previous: int, b: np.ndarray) -> np.ndarray:
    """Return what a weight of 1 on each older sample gives on coning, the youngest first."""
    return np.stack([2 * np.sin(s * b) * (1 - np.cos(b)) for s in range(1, increments + previous)], -1)


def target(increments: int, b: np.ndarray) -> np.ndarray:
    return (increments * b - np.sin(increments * b)) / 2


@SAMPLES
def test_no_other_weights_leave_a_smaller_mean_square(increments, previous):
    """What is left is orthogonal to every column, to the rounding of the columns and of the weights."""
    nodes, parts = np.polynomial.legendre.leggauss(60)
    b = float(BAND) / 2 * (1 + nodes)
    table = columns(increments, previous, b)
    left = table @ [float(weight) for weight in weights(increments, previous)] - target(increments, b)
    scale = np.sqrt(parts @ table**2) * np.sqrt(parts @ target(increments, b) ** 2)
    np.testing.assert_allclose((parts * left) @ table / scale, 0, atol=1e-14)


@SAMPLES
def test_the_mean_square_is_below_that_of_coefficients_for_low_frequencies(increments, previous):
    b = np.linspace(0.01, float(BAND), 500)
    pairs = coning_coefficients.design(increments, previous).pairs
    newest = increments + previous - 1
    annulling = [float(pairs.get((newest - s, newest), 0)) for s in range(1, increments + previous)]
    shaped = [float(weight) for weight in weights(increments, previous)]
    table, exact = columns(increments, previous, b), target(increments, b)
    sizes = [np.sqrt(np.mean((table @ k - exact) ** 2)) for k in (shaped, annulling)]
    assert sizes[0] < 0.7 * sizes[1]


def test_one_sample_has_nothing_to_be_crossed_with():
    assert weights(1) == ()
    turn = np.array([[[0.1, 0.2, 0.3]]])
    single, plain = (strapgen.backend("euler", m, 1) for m in ("coning-least-squares", "coning-compressed"))
    np.testing.assert_array_equal(single.propagate(turn), plain.propagate(turn))


GYRO = Response(frequency_hz=Fraction(40), damping=Fraction(3, 5), sample_hz=Fraction(100))
SIMULATED = [ConingShape(1, 3), ConingShape(3, 0), ConingShape(2, 2, GYRO)]


def response(gyro: Response | None, b: float) -> complex:
    """Return what the gyro does to the frequency b in rad a sample, from its transfer function."""
    if gyro is None:
        return 1.0
    s = 1j * b * float(gyro.sample_hz)
    w = 2 * math.pi * float(gyro.frequency_hz)
    return 1 / (1 + 2 * float(gyro.damping) * s / w + (s / w) ** 2)


@pytest.mark.parametrize("shape", SIMULATED, ids=str)
@pytest.mark.parametrize("b", [0.3, 1.1, 2.5])
def test_the_drift_is_that_of_cross_products_of_samples(shape, b):
    """On a small cone x + iy of the angles is e^{ibt}; u x v about z is Im(conj(u) v)."""
    coefficients = [Fraction(1, 7), Fraction(-1, 30), Fraction(1, 90)][: shape.unknowns]
    ends = np.exp(1j * b * np.arange(-shape.previous, shape.increments + 1)) * response(shape.gyro, b)
    samples = np.diff(ends)
    lever = sum(float(c) * samples[-1 - s] for s, c in enumerate(coefficients, 1))
    true = (shape.increments * b - math.sin(shape.increments * b)) / 2
    # The computed vector of the step, beside the first-order change of angles, whose own product with them remains.
    computed = (np.conj(lever) * samples[-1]).imag
    start, change = ends[shape.previous], ends[-1] - ends[shape.previous]
    # Half of the angle at the start crossed with the change is what the attitude turns by to second order; its mean
    # over the phase is that of its value here, and for an ideal gyro it is what the true rotation vector leaves out.
    leaves = (np.conj(start) * change).imag / 2
    expected = computed + leaves - shape.increments * b / 2
    (value,) = coning_drift.errors(shape, coefficients, [b])
    assert float(value) == pytest.approx(expected, abs=1e-14)
    if shape.gyro is None:
        assert float(value) == pytest.approx(computed - true, abs=1e-14)


def test_the_largest_drift_of_a_band_is_that_of_its_frequencies_through_the_gyro():
    shape = ConingShape(1, 2, GYRO)
    coefficients = [Fraction(1, 7), Fraction(-1, 30), Fraction(1, 90)][: shape.unknowns]
    values = coning_drift.errors(shape, coefficients, np.linspace(0, 1, 301)[1:].tolist())
    # Between 300 frequencies a peak is higher by the square of 1/600, times half of what bends it, at most 10.
    expected = float(max(map(abs, values)))
    assert coning_drift.largest(shape, coefficients, Fraction(1)) == pytest.approx(expected, rel=3e-5)


@pytest.mark.parametrize(("samples", "previous"), [(1, 1), (1, 5), (4, 0), (3, 3)])
def test_compressed_coefficients_annul_every_power_and_have_their_published_drift(samples, previous):
    design = coning_coefficients.design(samples, previous)
    newest = samples + previous - 1
    coefficients = [design.pairs[newest - s, newest] for s in range(1, newest + 1)]
    shape = ConingShape(samples, previous)
    for row, right in coning_drift.powers(shape, shape.unknowns):
        assert sum(a * c for a, c in zip(row, coefficients, strict=True)) == right
    drift = design.residual()
    for b in (0.5, 2.0):
        expected = sum(float(c) * math.sin(m * b) for m, c in drift.sines.items()) - samples * b / 2
        (value,) = coning_drift.errors(shape, coefficients, [b])
        # The closed form cancels in double precision.
        assert float(value) == pytest.approx(expected, abs=1e-13)


@pytest.mark.parametrize("shape", SIMULATED, ids=str)
def test_powers_are_those_of_the_series(shape):
    """Conditions that hold but for 1 leave 1 times the power, with its factor (-1)^q/(2q + 1)!, in E/H."""
    zeros = [Fraction(0)] * shape.unknowns
    with mpmath.workdps(50):

        def drift(b):
            terms, right = coning_drift.terms(shape, b, mpmath)
            h = 1 / abs(mpmath.mpc(response_of(shape.gyro, b))) ** 2 if shape.gyro else 1
            return -right * h if not any(zeros) else terms

        series = mpmath.taylor(drift, 0, 7)
    for q, (_, right) in enumerate(coning_drift.powers(shape, 3), 1):
        power = 2 * q + 1
        expected = -float(right) * (-1) ** q / math.factorial(power)
        assert float(series[power]) == pytest.approx(expected, rel=1e-12)


def response_of(gyro, b):
    """Return the response as `response` does, in many digits, with the rational for pi that the conditions have."""
    x = b * mpmath.mpf(gyro.sample_hz.numerator) / gyro.sample_hz.denominator
    pi = mpmath.mpf(coning_drift.PI.numerator) / coning_drift.PI.denominator
    s = (
        mpmath.mpc(0, 1)
        * x
        / (2 * pi * mpmath.mpf(gyro.frequency_hz.numerator) / gyro.frequency_hz.denominator)
    )
    return 1 / (1 + 2 * mpmath.mpf(gyro.damping.numerator) / gyro.damping.denominator * s + s**2)
