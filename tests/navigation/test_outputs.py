"""What a navigator puts on its bus: the kernels, words, and the accuracy of flights."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp
from derived import kernel
from hypothesis import given
from hypothesis import strategies as st

import strapgen
from strapgen.catalogue import Choice
from strapgen.ir.exceptions import InputError
from strapgen.navigation.navigation_kernels import MOUNTINGS
from strapgen.navigation.outputs import OUTPUT_WORDS, PRINTED, RAYLEIGH, VariationTable, radial_error_rate


def test_variation_is_exact_at_corners_and_linear_on_edges():
    v = sp.symbols("variation_1:5")
    r = sp.symbols("r s")

    def value(first, second):
        known = dict(zip(map(str, v), v, strict=True)) | {"first_fraction": first, "second_fraction": second}
        return kernel(Choice("variation")).expand(known)["variation"][0]

    for corner, place in zip(v, ((0, 0), (1, 0), (0, 1), (1, 1)), strict=True):
        assert sp.expand(value(*place) - corner) == 0
    for (first, second), (one, other) in (
        ((r[0], 0), (0, 1)),
        ((r[0], 1), (2, 3)),
        ((0, r[0]), (0, 2)),
        ((1, r[0]), (1, 3)),
    ):
        assert sp.expand(value(first, second) - v[one] - r[0] * (v[other] - v[one])) == 0
    numbers = dict(zip(v, (10, 12, 13, 18), strict=True))
    assert value(sp.Rational(1, 4), sp.Rational(3, 5)).subs(numbers) == sp.Rational(51, 4)
    heading = strapgen.evaluator("magnetic-heading")
    assert math.isclose(heading(3.0, 0.5), 3.5 - 2 * math.pi, rel_tol=1e-15)


def test_a_table_of_variations_is_continuous_over_its_lines_and_over_half_turns():
    latitudes, longitudes = [-60, 0, 73], [-180, -60, 60, 180]
    numbers = [[20, 150, -120, 20], [0, 90, -150, 0], [10, 100, -140, 10]]
    table = VariationTable(latitudes, longitudes, numbers)
    evaluate = strapgen.evaluator("variation")

    def value(latitude, longitude):
        corners, fractions = table.around(latitude, longitude)
        return np.degrees(float(evaluate(*corners, *fractions)))

    def apart(one, other):
        return abs(math.remainder(one - other, 360))

    for row, latitude in enumerate(latitudes):
        for column, longitude in enumerate(longitudes):
            assert apart(value(latitude, longitude), numbers[row][column]) < 1e-12
    for longitude in (-60, 60, 180):
        # The largest slope is 150 deg in 120; both sides of a line differ by no more.
        assert apart(value(-30, longitude - 1e-9), value(-30, longitude + 1e-9)) < 1e-7
    assert apart(value(-60, 0), -165) < 1e-12  # between 150 and -120 over the half turn, not through 0
    for position, reason in (((74, 0), "latitude 74 deg is outside of the grid, -60 to 73 deg"),):
        with pytest.raises(InputError, match=reason):
            table.around(*position)
    with pytest.raises(InputError, match="have to increase"):
        VariationTable([0, 0], [0, 1], np.zeros((2, 2)))
    with pytest.raises(InputError, match=r"the grid has \(2, 2\)"):
        VariationTable([0, 1], [0, 1], np.zeros((2, 3)))


def test_track_angle_and_its_error():
    track = strapgen.evaluator("track-angle")
    knot = 1852 / 3600
    for error, degrees in ((6, 3), (8, 4)):  # printed; both of one ground speed, 114.5916 kn
        speed = error / math.radians(degrees)
        assert round(speed, 4) == 114.5916
        straight, turned = (track([speed * knot, across * knot, 0.0]) for across in (0.0, 1e-3 * error))
        assert math.isclose(math.degrees(turned[0] - straight[0]), 1e-3 * degrees, rel_tol=1e-8)
        assert math.isclose(straight[1], speed * knot, rel_tol=1e-15)
    assert track([0.0, 5.0, 3.0])[0] == math.pi / 2


def test_mountings_are_the_four_turns_about_the_vertical():
    matrices = {}
    for mounting in MOUNTINGS:
        derived = kernel(Choice(f"axes-{mounting}"))
        sensed = sp.Matrix(sp.symbols("s_x s_y s_z", real=True))
        matrices[mounting] = sp.Matrix(derived.expand()["body"]).jacobian(sensed)
    quarter = sp.Matrix([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    for turns, mounting in enumerate(("fore", "right", "aft", "left")):
        assert matrices[mounting] == quarter**turns
    # The x axis of the unit points where the name says: ahead, right, aft, left.
    assert [tuple(matrices[name][:2, 0]) for name in MOUNTINGS] == [(1, 0), (0, 1), (-1, 0), (0, -1)]


def test_two_rows_agree_with_three():
    values = kernel(Choice("dcm-update-5")).expand()
    C = sp.Matrix(3, 3, [sp.Symbol(f"C_{i}{j}", real=True) for i in "123" for j in "123"])
    rows = {f"row_{i}_{axis}": C[i - 1, k] for i in (1, 2) for k, axis in enumerate("xyz")}
    phi = {f"phi_{axis}": sp.Symbol(f"phi_{axis}", real=True) for axis in "xyz"}
    two = kernel(Choice("dcm-two-rows-update-5")).expand({**rows, **phi})
    for place, element in enumerate((*two["next_row_1"], *two["next_row_2"])):
        assert sp.expand(element - values["next"][place]) == 0
    theta = {f"theta_{axis}": sp.Symbol(f"theta_{axis}", real=True) for axis in "xyz"}
    third = dict(zip(C[2, :], C[0, :].cross(C[1, :]), strict=True))
    values = kernel(Choice("dcm-navigation-update-2")).expand()
    two = kernel(Choice("dcm-two-rows-navigation-2")).expand({**rows, **theta})
    for place, element in enumerate((*two["next_row_1"], *two["next_row_2"])):
        assert sp.expand(element - values["next"][place].subs(third)) == 0
    matrix = kernel(Choice("dcm-from-two-rows")).expand(rows)["attitude"]
    assert sp.Matrix(3, 3, matrix) == sp.Matrix.vstack(C[:2, :], C[0, :].cross(C[1, :]))
    two = kernel(Choice("dcm-two-rows-orthonormalize")).expand(rows)
    D = C[:2, :]
    expected = D + (sp.eye(2) - D * D.T) * D / 2  # equation (32) for two rows
    assert (sp.Matrix([two["next_row_1"], two["next_row_2"]]) - expected).expand() == sp.zeros(2, 3)


def test_radial_error_rate_bounds_95_of_100_flights(rng):
    # 200,000 flights of 1 to 10 hours, whose errors grow with time: the part below has a deviation of 5e-4.
    times = rng.uniform(1, 10, 200_000)
    errors = np.hypot(*rng.normal(size=(2, 200_000))) * times
    assert round(RAYLEIGH, 6) == 2.447747
    assert round(RAYLEIGH, 2) == PRINTED
    for factor in (PRINTED, RAYLEIGH):
        below = (errors / times < radial_error_rate(errors, times, factor)).mean()
        assert abs(below - 0.95) < 2e-3
    for arguments, reason in ((([], []), "errors are 0"), (([1.0], [0.0]), "a time is not above 0")):
        with pytest.raises(InputError, match=reason):
            radial_error_rate(*arguments)


#: Bits with the sign for a rounding of a tenth of the printed accuracy.
BITS = {
    "roll": 15, "pitch": 15, "true_heading": 13, "magnetic_heading": 10, "body_acceleration": 12, "body_rate": 14,
    "ground_velocity": 12, "vertical_velocity": 14, "track_angle": 9, "drift_angle": 8, "flight_path_angle": 13,
    "track_acceleration": 9, "vertical_acceleration": 12, "track_angle_rate": 11,
}  # fmt: skip


def test_the_fewest_bits_meet_a_tenth_of_the_accuracy():
    assert {name: one.bits() for name, one in OUTPUT_WORDS.items() if one.accuracy is not None} == BITS
    for name, bits in BITS.items():
        one = OUTPUT_WORDS[name]
        assert one.quantum(bits) / 2 <= one.accuracy / 10 < one.quantum(bits)


@given(st.sampled_from(sorted(OUTPUT_WORDS)), st.fractions(-1000, 1000), st.integers(8, 24))
def test_a_value_comes_back_within_half_a_quantum(name, value, bits):
    one = OUTPUT_WORDS[name]
    word = one.encoded(value, bits)
    assert -(1 << (bits - 1)) <= word < 1 << (bits - 1)
    back = one.decoded(word, bits)
    if one.turns:
        apart = (back - value + one.range) % (2 * one.range) - one.range
        assert abs(apart) <= one.quantum(bits) / 2
    elif abs(value) <= one.range - one.quantum(bits):
        assert abs(back - value) <= one.quantum(bits) / 2
    else:
        assert abs(back) <= one.range and abs(back) >= min(abs(value), one.range) - one.quantum(bits)


def test_outputs_without_accuracy_or_bits_are_refused():
    with pytest.raises(InputError, match="no printed accuracy"):
        OUTPUT_WORDS["inertial_altitude"].bits()
    with pytest.raises(InputError, match="more than 32 bits"):
        OUTPUT_WORDS["roll"].bits(Fraction(1, 10**9))
    with pytest.raises(InputError, match="bits"):
        OUTPUT_WORDS["roll"].quantum(40)
