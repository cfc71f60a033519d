"""Redundant sensors: the numbers of the hexad, failures by brute force, moment arm, quantization and boresight."""

from __future__ import annotations

import json
import math
import shlex
from fractions import Fraction
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import strapgen
from strapgen.catalogue import Choice
from strapgen.cli import main
from strapgen.ir.exceptions import InputError
from strapgen.navigation.navigation_kernels import HEXAD_TRIADS, REDUNDANCY
from strapgen.navigation.redundancy import redundancy_kernels
from strapgen.navigation.redundancy.geometry import HEXAD, SensorGeometry, geometry
from strapgen.navigation.redundancy.geometry_report import (
    GeometryResult,
    _different,
    failure_table,
    failure_tables,
)
from strapgen.navigation.redundancy.redundancy_kernels import SensorSet, kernels, read
from strapgen.navigation.redundancy.redundancy_study import SensorErrors
from strapgen.run.compiled_code import ModelEvaluator

#: The parity vectors of the six sensors, by the sensors of each.
VECTORS = {
    "0123": [-2, -2, 1, 3],
    "0124": [1, -2, -2, 3],
    "0125": [-2, 1, -2, 3],
    "0134": [-1, -2, 2, 1],
    "0135": [-2, -1, 2, 1],
    "0145": [-1, 1, -1, 1],
    "0234": [1, -1, -1, 1],
    "0235": [-2, -1, 1, 2],
    "0245": [-1, -2, 1, 2],
    "0345": [-3, 2, -1, 2],
    "1234": [-2, -1, 1, 2],
    "1235": [1, -1, -1, 1],
    "1245": [-1, -2, 2, 1],
    "1345": [3, -2, -2, 1],
    "2345": [-3, -1, 2, 2],
}
#: Six axes of which no three lie in a plane, with Pythagorean components, and five of them.
USERS = geometry(
    [
        [1, 0, 0],
        ["-1/3", "2/3", "2/3"],
        ["2/7", "3/7", "-6/7"],
        ["4/9", "-7/9", "4/9"],
        ["6/11", "6/11", "7/11"],
        ["2/3", "-1/3", "-2/3"],
    ]
)
PENTAD = SensorGeometry(USERS.axes[:5])
TETRAD = SensorGeometry(USERS.axes[:4])
AXES = np.array(HEXAD.axes, float)
EQUATIONS = np.array(HEXAD.equations, float)
LENGTHS = np.linalg.norm(EQUATIONS, axis=1)
TRIP = 1e-3


def test_the_second_triad_is_the_first_turned_by_60_degrees_about_the_cone_axis():
    axis = sp.Matrix([1, 1, 1]) / sp.sqrt(3)
    skew = sp.Matrix(3, 3, lambda i, j: -sum(sp.LeviCivita(i, j, k) * axis[k] for k in range(3)))
    turn = sp.eye(3) + sp.sqrt(3) / 2 * skew + skew**2 / 2
    rows = sp.Matrix([[sp.Rational(x.numerator, x.denominator) for x in row] for row in HEXAD.axes])
    assert rows[:3, :] == sp.eye(3)
    assert sp.simplify(rows[3:, :] - turn.T) == sp.zeros(3)
    assert rows.T * rows == 2 * sp.eye(3)
    angles = [sp.deg(sp.acos((rows[k, :] * axis)[0])) for k in range(6)]
    assert {f"{float(angle):.4f}" for angle in angles} == {"54.7356"}


def test_the_parity_vectors_are_these_integers_and_the_null_space():
    assert len(HEXAD.equations) == 15
    for (sensors, values), equation in zip(VECTORS.items(), HEXAD.equations, strict=True):
        vector = [0] * 6
        for sensor, value in zip(map(int, sensors), values, strict=True):
            vector[sensor] = value
        assert equation == tuple(vector)
        null = np.linalg.svd(AXES[[*map(int, sensors)]].T)[2][-1]
        np.testing.assert_allclose(np.abs(null @ values), np.linalg.norm(values), rtol=1e-12)
    m = strapgen.derive("parity-hexad").expand()["parity"]
    vector = sp.symbols("x y z")
    measured = {sp.Symbol(f"m_{k}", real=True): sp.Matrix(HEXAD.axes[k]).dot(vector) for k in range(6)}
    assert all(sp.expand(p.subs(measured)) == 0 for p in m)
    assert f"{(np.abs(EQUATIONS)[EQUATIONS != 0].reshape(15, 4) / LENGTHS[:, None]).min():.7f}" == "0.2357023"


def test_the_triads_have_the_determinants_conditions_and_gains_of_the_page():
    determinants = [abs(triad.determinant) for triad in HEXAD.triads]
    assert [determinants.count(Fraction(n, 3)) for n in (3, 2, 1)] == [2, 12, 6]
    conditions = {round(np.linalg.cond(AXES[list(triad.sensors)]), 3) for triad in HEXAD.triads}
    assert conditions == {1, 2.618, 5.828}
    assert max(max(triad.squared_gains) for triad in HEXAD.triads) == 17
    assert max(triad.squared_gain for triad in HEXAD.triads) == 19
    assert all(sum(x * x for x in row) == Fraction(1, 2) for row in HEXAD.least_squares)
    assert tuple("".join(map(str, triad.sensors)) for triad in HEXAD.triads) == HEXAD_TRIADS
    for name in (f"triad-hexad-{three}" for three in HEXAD_TRIADS):
        kernel = strapgen.derive(name)
        assert kernel.name == name
        x = sp.symbols("x y z")
        axes = [sp.Matrix(HEXAD.axes[int(k)]).dot(x) for k in name[-3:]]
        known = dict(zip(kernel.inputs[0].elements, axes, strict=True))
        assert [sp.expand(e) for e in kernel.expand(known)["increment"]] == list(x)
    known = {f"m_{k}": sp.Matrix(HEXAD.axes[k]).dot(x) for k in range(6)}
    assert [sp.expand(e) for e in strapgen.derive("all-hexad").expand(known)["increment"]] == list(x)


def test_parity_is_exact_in_fixed_point_where_the_format_of_the_input_is_that_of_the_output():
    fixed = strapgen.quantize(
        strapgen.lower(strapgen.derive("parity-hexad")),
        strapgen.Settings(word=16, formats={"measurement": "Q1.14"}),
    )
    assert fixed.error_bounds["parity"] == 0


def select(parity, excluded=()):
    flags = np.zeros(6)
    flags[list(excluded)] = 1
    return strapgen.evaluator("select-hexad")(parity, TRIP * LENGTHS, flags)


def sensors_of(triad) -> set[int]:
    return {*HEXAD.triads[int(triad)].sensors}


def test_two_failures_are_isolated_whichever_sensors_they_hit_and_a_third_is_detected():
    parity, true = strapgen.evaluator("parity-hexad"), AXES @ [0.01, 0.02, -0.03]
    assert [float(np.sum(x)) for x in select(parity(true))] == [0, 0, 0]
    least = TRIP / (np.sqrt(2) / 6)
    for first, sign in zip(range(6), (1, -1) * 3, strict=True):
        failure = np.eye(6)[first] * sign * least
        tripped = np.abs(parity(true + 1.0001 * failure)) >= TRIP * LENGTHS
        assert np.array_equal(tripped, EQUATIONS[:, first] != 0) and tripped.sum() == 10
        assert (np.abs(parity(true + 0.9999 * failure)) >= TRIP * LENGTHS).sum() < 10
        detected, failed, triad = select(parity(true + 1.0001 * failure))
        assert detected == 1 and [*failed] == [*np.eye(6)[first]] and first not in sensors_of(triad)
        for second in {*range(6)} - {first}:
            both = true + 1.0001 * failure + 1.01 * least * np.eye(6)[second]
            left = EQUATIONS[:, first] == 0
            assert (np.abs(parity(both)) >= TRIP * LENGTHS)[left].sum() == 4 and left.sum() == 5
            detected, failed, triad = select(parity(both), [first])
            assert detected == 1 and [*failed] == [*np.eye(6)[second]]
            assert not {first, second} & sensors_of(triad)
            third = min({*range(6)} - {first, second})
            detected, failed, triad = select(parity(both + 1.01 * least * np.eye(6)[third]), [first, second])
            assert detected == 1 and not failed.any() and not {first, second} & sensors_of(triad)


def by_ranks(one: SensorGeometry) -> int:
    """Return the failures that are isolated, from ranks in floating point: no two failures explain one measurement."""
    axes = np.array(one.axes, float)
    for failures in range(one.count):
        for removed in combinations(range(one.count), failures):
            rest = [k for k in range(one.count) if k not in removed]
            for pair in combinations(rest, 2):
                both = np.hstack([axes[rest], np.eye(one.count)[np.ix_(rest, pair)]])
                if np.linalg.matrix_rank(both) < 5:
                    return failures
    return one.count


@pytest.mark.parametrize("one", [HEXAD, USERS, PENTAD, TETRAD])
def test_failures_that_are_isolated_agree_with_ranks(one):
    expected = {6: 2, 5: 1, 4: 0}[one.count]
    assert one.fail_operate == by_ranks(one) == expected
    assert one.fail_safe


def test_a_geometry_with_two_alike_axes_detects_their_failures_and_isolates_none():
    alike = geometry([[1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, "3/5", "4/5"]])
    assert (alike.fail_operate, alike.fail_safe) == (0, True)
    assert (0, 1) in alike.ambiguous()
    assert (-1, 1, 0, 0, 0) in alike.equations


def test_two_gyros_of_two_axes_check_the_axis_that_both_have(capsys):
    """LTR-81: the second vertical axis is a test of the first, and no test of the horizontal ones."""
    file = EXAMPLE.with_name("ltr81_gyros.toml")
    data = json.loads(run(f"redundancy {file} --format json", capsys))
    assert data["equations"] == [[0, 0, -1, 1]] and data["in_no_equation"] == [0, 1]
    assert (data["fail_operate"], data["next_is_detected"]) == (0, False)
    assert "in no equation, so that no failure is detected: 0, 1" in run(f"redundancy {file}", capsys)
    (table,) = failure_tables(read(file).geometry)
    assert {verdict.status: (verdict.failed, verdict.triad) for verdict in table.verdicts.values()} == {
        "0": (None, 0),
        "1": (None, 0),
    }


def test_a_failure_of_a_sensor_in_no_equation_changes_nothing_but_the_vector():
    sensors = read(EXAMPLE.with_name("ltr81_gyros.toml"))
    parity, select = (
        strapgen.evaluator(Choice.of_user(kernel))
        for kernel in (redundancy_kernels.parity(sensors), redundancy_kernels.select(sensors))
    )
    rates = np.array([[0.01, -0.02, 0.03, 0.03]] * 4) + np.eye(4) * 0.005
    detected, failed, triad = select(parity(rates), np.full((4, 1), 0.004), np.zeros((4, 4)))
    assert detected.tolist() == [0, 0, 1, 1] and not failed.any() and not triad.any()
    # With one of the vertical axes taken out, nothing is left that could fail.
    gone = np.array([[0, 0, 1, 0]] * 4)
    detected, failed, triad = select(parity(rates), np.full((4, 1), 0.004), gone)
    assert not detected.any() and triad.tolist() == [1] * 4


@pytest.mark.parametrize("backend", ["numpy", "c"])
def test_the_median_of_three_units_is_that_of_numpy_and_tells_who_is_off(backend, rng):
    units = rng.uniform(-1, 1, (3, 200, 3))
    trip = rng.uniform(0.2, 1.5, 200)
    median, off = strapgen.evaluator("median-3", backend)(*units, trip)
    expected = np.median(units, axis=0)
    np.testing.assert_array_equal(median, expected)
    np.testing.assert_array_equal(off.T, (np.abs(units - expected) >= trip[:, None]).any(axis=2))
    assert 0 < off.mean() < 1


def test_bad_geometries_are_refused_in_one_line_with_the_reason(tmp_path):
    file = tmp_path / "bad.toml"
    good = "[1, 0, 0], [0, 1, 0], [0, 0, 1]"
    for text, reason in (
        (f"axes = [{good}]", "axes has 3 entries; from 4 to 10 are needed"),
        ("axes = [[1, 0, 0], [0, 1, 0], [1, 1, 0], [1, 2, 0]]", "all axes lie in one plane"),
        (f"axes = [{good}, [0, 0, 0]]", "axis 3 is zero"),
        (f'axes = [{good}, [1, 2, "x"]]', "axes[4][3] is 'x': numbers, + - * /"),
        (f"axes = [{good}, [1e308, 0, 0]]", "axes[4][1] is 1e+308; a number from -1000 to 1000 is needed"),
        (f"axes = [{good}, [1{'0' * 400}, 0, 0]]", "axes[4][1] is 1000"),
        (f"axes = [{good}, [0, 0, nan]]", "axes[4][3] is nan; a finite number is needed"),
        (f'axes = [{good}, ["sqrt(6)-sqrt(2)*sqrt(3)", 0, 0.0]]', "axis 3 is zero"),
        (
            f'axes = [{good}, ["sqrt(2)", "sqrt(3)", 0], ["sqrt(5)", "sqrt(7)", 0]]',
            "over three different square roots",
        ),
        (f"axes = [{good}, [1, 2]]", "axes[4] has 2 entries; 3 are needed"),
        ("axes = 3", "axes is 3; a list of 4 to 10 lists is needed"),
        ("", "axes is missing; a list"),
        (f"axes = [{good}, [1, 1, 1]]\nrange = 0", "range is 0"),
        (f"axes = [{good}, [1, 1, 1]]\nname = '../x'", "name is '../x'; at most eight small letters"),
        (f"axes = [{good}, [1, 1, 1]]\nsensor = 'gyros'", "sensor"),
        (f"axes = [{good}, [1, 1, 1]]\nkind = 1", "kind"),
        ("axes = [", "is not TOML"),
    ):
        file.write_text(text)
        with pytest.raises(InputError) as error:
            read(file)
        assert reason in str(error.value) and "\n" not in str(error.value), text


#: Sensors on a cone, as its drawing has them, and the same with rows that are no unit vectors.
CONE = """
axes = [
    [1, 0, 0], ["-1/2", "sqrt(3)/2", 0], ["-0.5", "-sqrt(3)/2", 0], [0, 0, 1],
    [0.5, 0, "sqrt(3)/2"], ["1/4", "sqrt(3)/4", "sqrt(3)/2"],
]
"""


def test_axes_with_roots_and_decimals_are_exact(tmp_path):
    """Equations and matrices are those of exact arithmetic with SymPy's own numbers."""
    file = tmp_path / "cone.toml"
    file.write_text(CONE)
    cone = read(file).geometry
    assert cone.axes[4] == (Fraction(1, 2), 0, sp.sqrt(3) / 2) and cone.lengths == (1,) * 6
    assert cone.equations[:2] == ((1, 1, 1, 0, 0, 0), (-1, 0, 0, -sp.sqrt(3), 2, 0))
    rows = sp.Matrix([[sp.sympify(x) for x in row] for row in cone.axes])
    for equation in cone.equations:
        assert (sp.Matrix([equation]) * rows).applyfunc(sp.expand) == sp.zeros(1, 3)
    for triad in cone.triads:
        inverse = sp.Matrix([[sp.sympify(x) for x in row] for row in triad.inverse])
        assert (inverse * rows[list(triad.sensors), :]).applyfunc(sp.expand) == sp.eye(3)
        gains = [sp.expand((inverse[k, :] * inverse[k, :].T)[0]) for k in range(3)]
        assert [sp.sympify(x) for x in triad.squared_gains] == gains
    gains = [float(triad.squared_gain) for triad in cone.triads]
    assert gains == sorted(gains) and len(gains) == 16
    least = sp.Matrix([[sp.sympify(x) for x in row] for row in cone.least_squares])
    assert (least * rows).applyfunc(sp.expand) == sp.eye(3)
    assert len(cone.parity_basis) == 3 and np.linalg.matrix_rank(np.array(cone.parity_basis, float)) == 3
    assert cone.fail_operate == by_ranks(cone) == 1


def test_code_of_axes_with_roots_is_inside_its_bound(tmp_path, rng):
    file = tmp_path / "cone.toml"
    file.write_text(CONE)
    parity = strapgen.lower(next(kernels(read(file))))
    fixed = strapgen.quantize(parity, strapgen.Settings(word=32))
    model = ModelEvaluator(strapgen.generate(fixed, "fixed-model"))
    (measured,), (result,) = fixed.interface.inputs, fixed.interface.outputs
    words = rng.integers(measured.low, measured.high, (20, 6), endpoint=True)
    (computed,), _ = model.run([words], model.fresh(20))
    equations, worst = sp.Matrix(read(file).geometry.equations), 0.0
    for row, outcome in zip(words, computed, strict=True):
        exact = equations * sp.Matrix([int(word) for word in row]) * sp.sympify(measured.unit)
        off = [abs(int(w) * sp.sympify(result.unit) - x) for w, x in zip(outcome, exact, strict=True)]
        assert all(sp.N(x - sp.sympify(e), 30) <= 0 for x, e in zip(off, result.errors, strict=True))
        worst = max(worst, *(float(x) for x in off))
    assert worst > float(max(result.errors)) / 4


def test_axis_is_divided_by_its_length_where_that_is_in_the_field():
    one = geometry([[1, 0, 0], [0, 2, 0], [0, 0, "0.5"], [1, 2, 2], ["sqrt(2)", "sqrt(2)", 0], [1, 1, 1]])
    third = Fraction(1, 3)
    assert one.axes[1:4] == ((0, 1, 0), (0, 0, 1), (third, 2 * third, 2 * third))
    assert one.axes[4] == (sp.sqrt(2) / 2, sp.sqrt(2) / 2, 0)
    # The root of 3 is not among these numbers.
    assert one.axes[5] == (1, 1, 1) and one.lengths == (1, 1, 1, 1, 1, sp.sqrt(3))
    sensors = SensorSet("six", one)
    assert float(sensors.parity.bound) >= max(np.abs(np.array(one.equations, float)).sum(axis=1)) / 8
    said = GeometryResult.of(sensors, []).written("text")
    assert said.count("stands as it is") == 1
    assert "axis 5 stands as it is: its length sqrt(3) is not in the field of the axes" in said
    data = json.loads(GeometryResult.of(sensors, []).written("json"))
    assert data["lengths"][5] == "sqrt(3)" and data["axes"][4][0] == "sqrt(2)/2"


def test_the_kernels_of_a_file_are_those_of_its_sensors(tmp_path):
    file = tmp_path / "tetrad.toml"
    file.write_text(
        'sensor = "accelerometer"\naxes = [[1, 0, 0], [0, 1, 0], [0, 0, 1], ["2/3", "2/3", "1/3"]]'
    )
    names = [kernel.name for kernel in kernels(read(file))]
    assert names[:4] == ["parity-tetrad", "parity-rest-tetrad", "select-tetrad", "all-tetrad"]
    assert len(names) == 4 + 4
    parity = next(kernels(read(file)))
    assert (parity.inputs[0].unit, parity.arguments) == ("m/s", f"strapgen redundancy {file}")


@pytest.mark.long
def test_the_acceleration_at_the_end_of_a_moment_arm():
    rate, change, arm = np.array([0.5, -0.2, 0.3]), np.array([1.0, 2, -3]), [-2.8, 0, 0.1]
    cycle = 0.02
    step = strapgen.evaluator("moment-arm")
    before = cycle * (rate - cycle * change)
    moved, _ = step(cycle * np.array([1, -2, 9]), cycle * rate, before, arm, 1 / cycle)
    np.testing.assert_allclose(moved / cycle, [1.579, 6.574, 14.151], atol=5e-4)
    kernel = strapgen.derive("moment-arm")
    w, a, r = (sp.Matrix(sp.symbols(f"{n}x {n}y {n}z")) for n in "war")
    t, dw = sp.Symbol("T"), sp.Matrix(sp.symbols("cx cy cz"))
    values = [*(t * a), *(t * w), *(t * (w - t * dw)), *r, 1 / t]
    known = dict(zip([e for s in kernel.inputs for e in s.elements], values, strict=True))
    outcome = sp.Matrix(kernel.expand(known)["arm_velocity_increment"]) / t
    assert (outcome - (a + dw.cross(r) + w.cross(w.cross(r)))).applyfunc(sp.simplify) == sp.zeros(3, 1)


def test_quantized_angles_make_the_noise_of_the_law(rng):
    """The relative error of a standard deviation over n samples that follow one another is about sqrt(2/n)."""
    quantum, cycle, arm, count = np.radians(3 / 3600), 0.02, 2.8, 40_000
    rate_noise = np.degrees(quantum / (cycle * np.sqrt(6)))
    arm_noise = arm * quantum / (cycle**2 * np.sqrt(2))
    assert (f"{rate_noise:.7f}", f"{arm_noise:.7f}") == ("0.0170103", "0.0719912")
    angle = np.cumsum(cycle * rng.uniform(-0.01, 0.01, count))
    increment = np.diff(quantum * np.floor(angle / quantum))
    rates = np.zeros((count - 2, 2, 3))
    rates[:, 0, 1], rates[:, 1, 1] = increment[1:], increment[:-1]
    true = np.diff(angle)
    zero, r = np.zeros((count - 2, 3)), np.tile([arm, 0, 0], (count - 2, 1))
    moved, _ = strapgen.evaluator("moment-arm")(
        zero, rates[:, 0], rates[:, 1], r, np.full(count - 2, 1 / cycle)
    )
    exact = -arm * np.diff(true) / cycle
    assert np.std(np.degrees((increment - true) / cycle)) == pytest.approx(rate_noise, rel=0.03)
    assert np.std(moved[:, 2] - exact) / cycle == pytest.approx(arm_noise, rel=0.03)


def rotation(vector) -> np.ndarray:
    skew = np.cross(np.eye(3), vector)
    return np.linalg.solve(np.eye(3) - skew / 2, np.eye(3) + skew / 2)


def test_the_boresight_is_the_nearest_rotation_to_the_mean_of_eight_alignments(rng):
    true, arcmin = rotation([0.3, -0.2, 0.1]), np.radians(1 / 60)
    errors = 1.5 * np.sqrt(8) * arcmin / np.sqrt(3) * rng.normal(size=(8, 3))
    mean, step = np.zeros((3, 3)), strapgen.evaluator("boresight")
    for number, error in enumerate(errors, 1):
        b = rotation(rng.normal(size=3))
        mean = step(b @ true @ rotation(error), b, mean, 1 / number)
    nearest = strapgen.evaluator("dcm-orthonormalize-optimal")(mean)
    left = true.T @ nearest
    vector = np.array([left[2, 1] - left[1, 2], left[0, 2] - left[2, 0], left[1, 0] - left[0, 1]]) / 2
    largest = np.abs(errors).max()
    np.testing.assert_allclose(vector, errors.mean(axis=0), atol=10 * largest**2)
    assert np.linalg.norm(vector) < np.linalg.norm(errors, axis=1).mean()


def test_parity_at_rest_becomes_a_bias_that_no_equation_sees(rng):
    parity, rest = strapgen.evaluator("parity-hexad"), strapgen.evaluator("parity-rest-hexad")
    biases, mean = 1e-3 * rng.normal(size=6), np.zeros(15)
    for number in range(1, 5):
        mean, corrected = rest(parity(biases), mean, 1 / number)
    np.testing.assert_allclose(mean, EQUATIONS @ biases, atol=1e-15)
    _, corrected = rest(parity(biases + AXES @ [0.01, 0.02, 0.03]), mean, 0.0)
    np.testing.assert_allclose(corrected, 0, atol=1e-15)


@pytest.mark.long
def test_every_kernel_names_printed_derived_and_lost_parts():
    for name in REDUNDANCY:
        source = strapgen.derive(name).source
        assert ("Fenner" if name == "median-3" else "Sebring") in source and "derived" in source, name


@pytest.mark.long
def test_the_kernel_and_the_table_agree_wherever_the_kernel_isolates():
    """A status becomes a parity of twice the trip level in the equations that fail, and none in the others."""
    select = strapgen.evaluator("select-hexad")
    for removed in ((), (4,)):
        table = failure_table(HEXAD, removed)
        statuses = np.zeros((len(table.verdicts), 15))
        statuses[:, list(table.equations)] = list(table.verdicts)
        excluded = np.zeros_like(statuses[:, :6])
        excluded[:, list(removed)] = 1
        detected, failed, _ = select(0.002 * statuses, np.full_like(statuses, 0.001), excluded)
        np.testing.assert_array_equal(detected, statuses.any(axis=1))
        isolated = failed.any(axis=1)
        assert {*failed[isolated].argmax(axis=1)} == {*range(6)} - {*removed}
        verdicts = list(table.verdicts.values())
        assert [verdicts[k].failed for k in np.flatnonzero(isolated)] == [*failed[isolated].argmax(axis=1)]


@pytest.mark.long
def test_every_failure_along_its_direction_is_declared_and_not_selected():
    vectors = np.array(HEXAD.equations, float)
    lengths = np.linalg.norm(vectors, axis=1)
    for table in failure_tables(HEXAD):
        valid = {*range(6)} - {*table.removed}
        for sensor in valid:
            status = tuple(
                bool(x)
                for x in np.abs(vectors[list(table.equations), sensor]) * 6 >= lengths[list(table.equations)]
            )
            verdict = table.verdicts[status]
            members = {*HEXAD.triads[verdict.triad].sensors}
            assert members <= valid
            if len(table.removed) < 2:
                assert verdict.failed == sensor and sensor not in members
            else:
                assert verdict.failed is None and any(status)
        still = table.verdicts[(False,) * len(table.equations)]
        assert still.failed is None


def test_without_equations_there_is_no_table():
    with pytest.raises(InputError, match="no parity equation is left"):
        failure_table(HEXAD, (0, 1, 2))


def test_statuses_are_told_apart_in_their_order(rng):
    """As rows of booleans are, of any number of equations."""
    for equations in (1, 8, 15, 20):
        fails = rng.random((equations, 3000)) < 0.2
        fails[-2:] = rng.random((min(equations, 2), 3000)) < 0.9
        statuses, place = _different(fails)
        expected, inverse = np.unique(fails.T, axis=0, return_inverse=True)
        np.testing.assert_array_equal(statuses, expected)
        np.testing.assert_array_equal(place, inverse.reshape(-1))


EXAMPLE = Path(__file__).parents[2] / "examples" / "hexad.toml"


def run(command: str, capsys: pytest.CaptureFixture[str], status: int = 0) -> str:
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(command))
    said = capsys.readouterr()
    assert stop.value.code == status, said.err
    return said.err if status else said.out


def test_trip_levels_are_multiples_of_the_steady_errors_and_of_those_that_grow_with_the_turn():
    """In arc seconds 3 of noise, 4 of counts and 12 of bias make 13; scale and bending act on a turn of 0.05 rad."""
    errors = SensorErrors(
        cycle_s=1,
        noise_arcsec=3,
        pulse_arcsec=4 * 6**0.5,
        bias_deg_h=12,
        scale_ppm=100,
        bending_arcmin_g=2,
        trip_sigmas=2,
        trip_rate=3,
    )
    levels = errors.trip(np.array([[0.0, 0.0, 0.0], [0.03, 0.0, 0.04]]), np.array([3.0, 3.0]))
    steady, bent = math.radians(2 * 13 / 3600), math.radians(6 / 60)
    assert levels == pytest.approx([steady, steady + 3 * (1e-4 + bent) * 0.05], rel=1e-12)


@pytest.mark.long
def test_failures_are_counted_with_errors_of_all_kinds(capsys):
    data = json.loads(run("study redundancy --trials 200 --format json", capsys))
    rows = {(row["removed"], row["size"]): row for row in data["rows"]}
    assert {removed for removed, _ in rows} == {0, 1, 2}
    for (removed, size), row in rows.items():
        assert row["trials"] == 200 and row["wrong"] <= 2, (removed, size)
        assert row["undetected"] == (200 - row["detected"] if size else 0)
        assert row["false_alarms"] == (0 if size else row["detected"]) <= 2
        if size >= 6:  # above 1 / 0.2357 trip levels, with noise of a fifth of one
            assert row["detected"] == 200
            assert row["isolated"] == row["table_isolated"] == (0 if removed == 2 else 200)
            assert removed == 2 or row["selected"] == row["table_selected"] == 200


@pytest.mark.long
def test_the_study_is_the_same_on_every_back_end_and_goes_into_files(tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    texts = [
        run(f"study redundancy --trials 20 --format csv --backend {name}", capsys) for name in ("numpy", "c")
    ]
    assert texts[0] == texts[1] and texts[0].startswith("removed,size,detected,undetected,false_alarms,")
    run(f"study redundancy {EXAMPLE} --trials 20 --format csv --out a.csv --plot a.png", capsys)
    assert Path("a.csv").read_text() == texts[0] and Path("a.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.long
def test_a_geometry_becomes_code_and_tables(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("skew.toml").write_text(
        'axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1], ["2/3", "2/3", "1/3"], [0.6, 0, -0.8]]'
    )
    data = json.loads(run("redundancy skew.toml --target c-fixed --word 16 --out out --format json", capsys))
    assert (data["fail_operate"], data["next_is_detected"]) == (0, True)
    assert data["equations"][0] == [-2, -2, -1, 3, 0]
    assert {Path(name).name for name in data["files"]} == {path.name for path in Path("out").iterdir()}
    assert (
        "Generated by: strapgen redundancy skew.toml --target c-fixed"
        in Path("out/select_skew_w16.h").read_text()
    )
    lines = Path("out/skew_tables.csv").read_text().splitlines()
    assert lines[0] == "removed,equations,status,failed,triad,points"
    assert len(lines) == 1 + sum(len(table["verdicts"]) for table in data["tables"])
    again = "redundancy skew.toml --target c-fixed --word 16 --out out --check"
    assert "in step" in run(again, capsys)
    (tmp_path / "out" / "skew_tables.csv").write_text("changed\n")
    assert "out is out of step" in run(again, capsys, 1)
    said = run(
        "redundancy skew.toml --target c --force --out out", capsys
    )  # other names: all are new but the tables
    assert "no failure is isolated, whichever sensors fail; one more is detected" in said


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ("redundancy flat.toml", "flat.toml: all axes lie in one plane"),
        ("redundancy absent.toml", "absent.toml cannot be read"),
        ("redundancy flat.toml --force", "--force needs --out"),
        ("study redundancy --set noise=3", "noise"),
        ("study redundancy --set noise_arcsec=-3", "noise_arcsec is -3.0"),
        ("study redundancy --set rate_deg_s=1000", "beyond the range 1/8"),
        ("study redundancy --trials 0", "trials is 0"),
        ("study redundancy acc.toml", "are accelerometers"),
        ("study redundancy --backend exact", "backend"),
    ],
)
def test_invalid_studies_are_refused_in_one_line(command, reason, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("flat.toml").write_text("axes = [[1, 0, 0], [0, 1, 0], [1, 1, 0], [1, 2, 0]]")
    Path("acc.toml").write_text(
        "sensor = 'accelerometer'\naxes = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]"
    )
    error = run(command, capsys, 2)
    assert reason in error and error.count("\n") == 1
