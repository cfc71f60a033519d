"""The kernels of a navigator's outputs and of two rows: what they compute."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp
from derived import kernel

import strapgen
from strapgen.catalogue import Choice
from strapgen.ir.exceptions import InputError
from strapgen.navigation.navigation_kernels import MOUNTINGS
from strapgen.navigation.outputs import VariationTable


@pytest.mark.long
def test_the_filter_is_the_bilinear_transform_and_no_cycle_lengthens_its_state():
    K, k, z, x, s1, s2 = sp.symbols("K k z x s1 s2", positive=True)
    n = 1 + k * K + K**2  # k = sqrt(2) in what follows; the identities hold for any
    states = {f"{name}_{axis}": value for name, value in (("first", s1), ("second", s2)) for axis in "xyz"}
    sample = {f"x_{axis}": x for axis in "xyz"}
    coefficients = {"loss": 1 - 1 / n, "coupling": K / n, "square": K**2 / n}
    values = kernel(Choice("butterworth-2")).expand({**states, **sample, **coefficients})
    first, second, filtered = (values[name][0] for name in ("next_first", "next_second", "filtered"))
    M, N = sp.Matrix([first, second]).jacobian([s1, s2]), sp.Matrix([first, second]).diff(x)
    D = (z * sp.eye(2) - M).applyfunc(sp.cancel)
    state = D.adjugate() * N / D.det()
    H = filtered.diff(s1) * state[0] + filtered.diff(s2) * state[1] + filtered.diff(x)
    s = (z - 1) / (z + 1) / K
    assert sp.cancel(H - 1 / (s**2 + k * s + 1)) == 0
    b, a1, a2 = K**2 / n, 2 * (K**2 - 1) / n, (1 - k * K + K**2) / n
    assert sp.cancel(H - b * (1 + 1 / z) ** 2 / (1 + a1 / z + a2 / z**2)) == 0
    # What a cycle takes from the square of the state's length is a square: lengths never grow, at any edge.
    lost = s1**2 + s2**2 - (first**2 + second**2).subs(x, 0)
    assert sp.cancel(lost - k * K * (2 * (s1 - K * s2) / n) ** 2) == 0
    # A constant passes unchanged with any coefficients, since they multiply zeros alone.
    symbols = {name: sp.Symbol(name) for name in coefficients}
    rest = {f"first_{axis}": 0 for axis in "xyz"} | {f"second_{axis}": x for axis in "xyz"}
    values = kernel(Choice("butterworth-2")).expand({**rest, **sample, **symbols})
    assert [values[name] for name in ("filtered", "next_first", "next_second")] == [[x] * 3, [0] * 3, [x] * 3]


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


def test_two_rows_do_what_all_three_do():
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
