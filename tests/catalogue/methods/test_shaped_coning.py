"""Coning coefficients for a band: their file, what is checked in it, and the drift of the built-in ones."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

import strapgen
from strapgen import choose, derive
from strapgen.catalogue.methods import shaped_coning
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
def test_built_in_coefficients_are_what_they_are_said_to_be(name):
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
