"""Files that describe layouts: what they may hold, how exact it is, and what is refused in one line."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest
import sympy as sp

from strapgen.catalogue import choose, derive
from strapgen.ir.exceptions import InputError
from strapgen.navigation.instruments.layout import Unbalance, read

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "layouts"
GOOD = (EXAMPLES / "turned.toml").read_text()


def test_numbers_are_exact_and_a_spin_axis_stands_for_a_torquer_axis():
    first, second, third = read(EXAMPLES / "turned.toml").gyros
    assert first.y == (0, -1, 0)  # spin cross x, so that x cross y is the spin
    assert (first.turn_deg, second.turn_deg, third.turn_deg) == (10, 30, 0)
    assert read(EXAMPLES / "skewed.toml").gyros[0].turn_deg == Fraction(45, 2)
    assert read(EXAMPLES / "skewed.toml").gyros[2].unbalance == Unbalance(Fraction(-1, 90))
    assert read(EXAMPLES / "diagonal.toml").gyros[1].x == (sp.sqrt(2) / 2, -sp.sqrt(2) / 2, 0)


@pytest.mark.parametrize(
    ("text", "unbalance"),
    [
        ('"B"', Unbalance(Fraction(1), "B")),
        ('"- B2 / 3"', Unbalance(Fraction(-1, 3), "B2")),
        ('"sqrt(2)*B1/2"', Unbalance(sp.sqrt(2) / 2, "B1")),
        ('"0*B"', Unbalance(Fraction(0))),
        ('"-1/90"', Unbalance(Fraction(-1, 90))),
        ("2", Unbalance(Fraction(2))),
    ],
)
def test_an_unbalance_is_a_number_or_a_multiple_of_a_symbol(text, unbalance, tmp_path):
    file = tmp_path / "layout.toml"
    file.write_text(GOOD.replace('"B3"', text))
    assert read(file).gyros[2].unbalance == unbalance


REFUSED = [
    ("turn_deg = 10", "turn_deg = nan", "gyros[1].turn_deg is nan; a finite number is needed"),
    ("turn_deg = 10", 'turn_deg = "sqrt(2)"', "gyros[1].turn_deg is 'sqrt(2)'; a rational number"),
    ("x = [0, 0, 1]", "x = [0, 1, 1]", "gyros[1].x is [0, 1, 1], of length sqrt(2); length 1 is needed"),
    ("x = [0, 0, 1]", "x = [0, 1]", "gyros[1].x has 2 entries; 3 are needed"),
    ("spin = [1, 0, 0]", "spin = [0, 0, 1]", "gyros[1].x and spin are not perpendicular"),
    ("spin = [1, 0, 0]", "", "gyros[1]: neither y nor spin is there; one is needed"),
    ("spin = [1, 0, 0]", "spin = [1, 0, 0]\ny = [0, -1, 0]", "gyros[1].y and spin are there; one is needed"),
    ("unbalance = 0", "unbalanced = 0", "gyros[1]: key 'unbalanced' is not known (did you mean unbalance?)"),
    ("unbalance = 0\n", "", "gyros[1].unbalance is missing; a number, or a multiple"),
    ("sign = -1", "sign = 2", "sign is 2; 1 or -1 is needed"),
    ("sign = -1", "sign = true", "sign is true; 1 or -1 is needed"),
    ('"B3"', '"C3"', 'or a multiple of B or of B0 to B9, such as "-B"'),
    ('"B3"', '"1+2*B"', "gyros[3].unbalance is '1+2*B'; a number, or a multiple of B"),
    ('"B3"', '"B/0"', "it divides by zero"),
    (GOOD[GOOD.rindex("[[gyros]]") :], "", "gyros has 2 entries; 3 are needed"),
    ('"an example of strapgen"', '"*/"', "source holds */"),
    ("[[gyros]]", "[[gyros", "is not TOML"),
]


@pytest.mark.parametrize(("old", "new", "words"), REFUSED)
def test_invalid_layouts_are_refused_in_one_line(old, new, words, tmp_path):
    file = tmp_path / "layout.toml"
    assert old in GOOD
    file.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(InputError) as refusal:
        read(file)
    message = str(refusal.value)
    assert message.startswith(str(file)) and words in message and "\n" not in message


@pytest.mark.parametrize(
    ("old", "new", "motion"),
    [
        ('"B3"', '"B2"', "the rate (B2, 0, 0) together with the acceleration (1, 0, 0)"),
        ('"B3"', "0", "the rate (0, 0, 0) together with the acceleration (0, 1, 0)"),
        ('"B2"', "0", "the rate (0, 0, 0) together with the acceleration (0, 0, 1)"),
        # Spin axes 2 and 3 are parallel.
        ("[0, 1, 0]\nspin = [0, 0, 1]", "[0, 0, 1]\nspin = [0, 1, 0]", "the acceleration (0, 1, 0)"),
    ],
)
def test_singular_layout_is_refused_with_unobserved_axes(old, new, motion, tmp_path):
    file = tmp_path / "layout.toml"
    file.write_text(GOOD.replace(old, new))
    assert file.read_text() != GOOD
    with pytest.raises(InputError) as refusal:
        derive(choose("separate", layout=file))
    message = str(refusal.value)
    assert message.startswith(f"{file}: the layout is singular: no torquer measures") and motion in message
    assert "\n" not in message


def test_a_layout_belongs_to_the_choice_of_a_kernel_that_takes_one(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(GOOD)
    choice = choose("separate", layout=file)
    assert choice.kernel == "separate-turned-torquers" and choice == choose("separate", layout=read(file))
    file.write_text(GOOD.replace("turn_deg = 10", "turn_deg = 11"))
    assert choose("separate", layout=file).identity != choice.identity
    file.write_text(GOOD.replace("Turned torquers", "canonical"))
    for arguments, words in (
        (
            ("separate", None),
            "separate needs a file: layout names it, .* kernels of built-in ones are",
        ),
        (
            ("separate-45", EXAMPLES / "turned.toml"),
            "separate-45 takes no layout; these do: separate, torques",
        ),
        (("euler", EXAMPLES / "turned.toml"), "euler takes no layout"),
        (("separate", file), "would make the kernel separate-canonical, which exists"),
        (("torques", tmp_path / "absent.toml"), "absent.toml cannot be read"),
    ):
        with pytest.raises(InputError, match=words):
            choose(arguments[0], layout=arguments[1])
