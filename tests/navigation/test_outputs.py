"""What a navigator puts on its bus: the kernels, the filter on back ends, words, and the accuracy of flights."""

from __future__ import annotations

import json
import math
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp
from commands import run
from derived import kernel
from hypothesis import given
from hypothesis import strategies as st

import strapgen
from strapgen.catalogue import Choice
from strapgen.ir.exceptions import InputError
from strapgen.navigation import output_filter as experiment
from strapgen.navigation.navigation_kernels import MOUNTINGS
from strapgen.navigation.output_filter import OutputFilter, decibels
from strapgen.navigation.outputs import OUTPUT_WORDS, PRINTED, RAYLEIGH, VariationTable, radial_error_rate


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


EDGE = OutputFilter(3.2, 50)


def test_responses_are_those_of_the_source():
    assert [round(b, 10) for b in EDGE.numerator[:1]] == [0.0312389237]
    assert [round(a, 10) for a in EDGE.denominator[1:]] == [-1.4415303099, 0.5664860047]
    wide = OutputFilter(8, 50)
    responses = (EDGE.analog(10), EDGE.digital(10), wide.analog(10), wide.digital(10))
    assert [round(decibels(r), 5) for r in responses] == [-19.8393, -22.10774, -5.36736, -6.07507]
    assert round(decibels(EDGE.analog(10))) == -20  # printed
    assert [round(1e3 * t, 4) for t in (EDGE.analog_delay_s, EDGE.digital_delay_s)] == [70.3372, 69.3868]
    for edge in (EDGE, wide):
        assert math.isclose(abs(edge.digital(edge.cutoff_hz)), math.sqrt(0.5), rel_tol=1e-14)
        slow = 1e-5  # phase over angular frequency at a frequency that is all but zero
        for response, delay in ((edge.analog, edge.analog_delay_s), (edge.digital, edge.digital_delay_s)):
            assert math.isclose(-np.angle(response(slow)) / (2 * math.pi * slow), delay, rel_tol=1e-6)


def test_no_state_leaves_its_range_and_some_input_takes_it_there():
    values = experiment.filter_evaluator(EDGE, 1.0, "numpy")
    first, response = np.zeros((2, EDGE.settling)), np.zeros(2)
    state = np.array([2 * EDGE.coefficients["coupling"], 2 * EDGE.coefficients["square"]])
    for k in range(EDGE.settling):
        first[:, k] = state
        state = EDGE.transition @ state
    for number, limit in enumerate(EDGE.state_ranges):
        states = [np.zeros(3), np.zeros(3)]
        for sign in np.sign(first[number, ::-1]):
            *states, response = values(*states, np.full(3, sign))
        assert math.isclose(abs(states[number][0]), limit, rel_tol=1e-12)
    assert np.isfinite(response).all()


@pytest.mark.long
def test_sines_measure_the_response_and_no_run_leaves_its_bound(rng):
    lines = (0.32, 3.2, 10.0)
    which = experiment.runs(["numpy", "c-float", "c-fixed32", "c-fixed16"])
    assert len(which) == 6
    for edge in (EDGE, OutputFilter(0.05, 50)):
        for measured in experiment.measure(which, edge, 128.0, lines):
            # Four roundings in a cycle of numbers up to 1, or the bound over the size of the sine.
            epsilon = np.finfo(np.float32 if measured.backend == "c-float" else float).eps
            rounding = 4 * epsilon * edge.accumulated((1.0, 1.0)).max()
            precision = measured.bound / 96 if measured.bound else rounding
            for line, response in zip(lines, measured.responses, strict=True):
                assert abs(response - edge.digital(line)) <= 2 * precision, (measured.backend, line)
            # A sample is rounded by half a unit beside the bound.
            slack = 0.0 if measured.unit is None else measured.unit / 2
            limit = measured.bound or 128 * precision
            assert measured.constant <= limit + slack
            assert measured.rest <= limit
        for word in (16, 32):
            reference = experiment.filter_evaluator(edge, 128.0, "numpy")
            for carry in ("none", "all"):
                fixed = experiment.filter_evaluator(edge, 128.0, f"c-fixed{word}", carry)
                samples = rng.uniform(-128, 128, size=(3000, 2, 3))
                argument = fixed.interface.inputs[-1]
                samples = fixed.numbers(argument, fixed.integers(argument, samples.reshape(-1, 3)))
                samples = samples.reshape(3000, 2, 3)
                error = experiment.run_filter(fixed, samples) - experiment.run_filter(reference, samples)
                bound = experiment.certified_bound(fixed, edge)
                assert np.abs(error).max() <= bound + 1e-10
                # Errors are random and the bound is of the worst; with feedback they do not add up at all.
                assert np.abs(error).max() > bound / (50 if edge is EDGE else 3000)


@pytest.mark.long
def test_error_feedback_keeps_a_slow_filter_from_standing_still():
    slow = OutputFilter(0.05, 50)  # tau is 3 s; without feedback small steps of the state are lost
    plain, fed = experiment.measure([("c-fixed16", "none"), ("c-fixed16", "all")], slow, 128.0, (1.0,))
    assert fed.constant <= 3 * fed.unit
    assert plain.constant > 10 * fed.constant
    assert fed.rest <= 3 * fed.unit


def test_study_has_every_format_and_refuses_invalid_input(tmp_path, capsys):
    image = tmp_path / "filter.png"
    run(["study", "output-filter", "--backend", "numpy", "--format", "json", "--plot", str(image)])
    answer = json.loads(capsys.readouterr().out)
    assert image.stat().st_size > 10_000
    assert answer["responses"][4]["hz"] == 10
    assert round(answer["responses"][4]["digital_db"], 5) == -22.10774
    assert round(answer["measured"][0]["gains_db"][4], 5) == -22.10774
    for words, reason in (
        (
            "--cutoff-hz 25",
            "cutoff-hz is 25; at 50 samples in a second a filter has an edge from 0.0005 to below 25",
        ),
        ("--frequency-hz 30", "frequency 30 Hz is not above 0 and below 25, half of sample-hz"),
        ("--cutoff-hz 0.001", "cycles to measure; at most"),
    ):
        run(["study", "output-filter", *words.split()], 2)
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert reason in said


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
