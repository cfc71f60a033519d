"""Steps by windows: the lean rotation vector, mirrored filters, operations, what a series leaves out, and accuracy."""

from __future__ import annotations

from fractions import Fraction
from random import Random

import mpmath
import pytest

import strapgen
from strapgen import choose, derive, lower
from strapgen.analysis.series.series import series
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.methods.window import Window
from strapgen.catalogue.methods.windows import WINDOWS, read
from strapgen.design.family import FamilyBrief, design
from strapgen.fixedpoint.floating.bounds import rounding_bounds
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.kernel_info import Truncation
from strapgen.lab.runs import angles, drift, steady_drift

Vector = list[Fraction]


def cross(a: Vector, b: Vector) -> Vector:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a: Vector, b: Vector) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def added(*terms: tuple[Fraction, Vector]) -> Vector:
    return [sum((weight * vector[axis] for weight, vector in terms), Fraction(0)) for axis in range(3)]


def published(c: list[Vector]) -> Vector:
    """Return the rotation vector to fourth order from the Legendre coefficients c_0 to c_4, as it is published."""
    c0, c1, c2, c3, c4 = c
    first = Fraction(1)
    bracket = dot(c0, c0) / 360 - dot(c1, c1) / 840 + dot(c0, c2) / 252 - dot(c2, c2) / 840
    return added(
        (first, c0),
        (first / 6, cross(c0, c1)),
        (first / 30, cross(c1, c2)),
        (first / 70, cross(c2, c3)),
        (first / 126, cross(c3, c4)),
        ((dot(c0, c2) - dot(c1, c1)) / 60, c0),
        (dot(c0, c1) / 60, c1),
        (-dot(c0, c0) / 60, c2),
        (dot(c0, c2) / 420, c2),
        (-dot(c2, c2) / 420, c0),
        (dot(c1, c1) / 210, c2),
        (-dot(c1, c2) / 210, c1),
        (bracket, cross(c0, c1)),
        (-dot(c0, c1) / 630, cross(c0, c2)),
        (dot(c0, c0) / 280, cross(c1, c2)),
    )


def random_samples(count: int, seed: int = 1969) -> list[Vector]:
    chance = Random(seed)
    return [[Fraction(chance.randrange(-99, 100), 1000) for _ in "xyz"] for _ in range(count)]


def rotation_vector(name: str, samples: list[Vector]) -> Vector:
    kernel = derive("rotation-vector", name)
    flat = [element for sample in samples for element in sample]
    values = dict(zip(kernel.inputs[0].elements, flat, strict=True))
    (phi,) = kernel.expand({n: strapgen.kernel.algebra.exact(x) for n, x in values.items()}).values()
    return [Fraction(int(x.p), int(x.q)) for x in phi]


@pytest.mark.parametrize("name", ["window-3-3", "window-4-2", "window-0-6"])
def test_the_lean_form_is_the_published_series_exactly(name):
    window = WINDOWS[name]
    samples = random_samples(window.total_increments)
    coefficients = [added(*zip(row, samples, strict=True)) for row in window.filters]
    assert rotation_vector(name, samples) == published(coefficients)


@pytest.mark.parametrize(("name", "mirrored"), [("window-3-3", "window-3-3"), ("window-5-1", "window-1-5")])
def test_a_motion_that_runs_backwards_turns_backwards(name, mirrored):
    samples = random_samples(WINDOWS[name].total_increments)
    backwards = [[-x for x in sample] for sample in reversed(samples)]
    assert rotation_vector(mirrored, backwards) == [-x for x in rotation_vector(name, samples)]


# Operations


@pytest.mark.long
def test_operations_of_a_window_are_few():
    normalize = lower(derive("euler-normalize-first-order")).operations
    for name in ("window-3-3", "window-7-7"):
        step, ahead = lower(derive("euler", name)).operations, WINDOWS[name].ahead
        multiply = step["multiply"] + normalize["multiply"]
        add = step["add"] + normalize["add"]
        # 12 and 18 for every sample ahead: those of four filters that act on sums and differences of two samples.
        assert multiply <= 12 * ahead + 121 and add <= 18 * ahead + 74
        assert not any(step[kind] for kind in ("divide", "sqrt", "function", "select"))
    assert (multiply, add) <= (205, 200)


# What the series leaves out


@pytest.mark.parametrize(("algorithm", "scale"), [("euler", 2), ("cayley-klein", 2), ("dcm", 1)])
def test_the_series_leaves_out_no_more_than_is_stated(algorithm, scale):
    truncation = derive(algorithm, "window-3-3").attitude_step.truncation
    assert truncation.scale == Fraction(1, scale)
    with mpmath.workdps(60):
        for angle in ("0.01", "0.25", "1", "3"):
            x = mpmath.mpf(angle) / scale
            rest = mpmath.exp(x) - sum(x**k / mpmath.factorial(k) for k in range(truncation.order + 1))
            bound = truncation.bound(Fraction(angle) ** 2)
            # All that follows, and less than a quarter above it.
            assert rest <= mpmath.mpf(bound.numerator) / bound.denominator <= rest * 1.25
    assert Truncation(2, Fraction(1), "square").bound(Fraction(16)) is None


@pytest.mark.long
def test_bounds_include_the_truncation_error():
    program = lower(derive("euler", "window-3-3"))
    near, far = (
        max(rounding_bounds(program, settings=Settings(largest_angle=Fraction(1, part))).errors["next"])
        for part in (8, 1)
    )
    assert near < 1e-15 < 1e-9 < far  # rounding alone does not grow so
    fixed = [
        strapgen.quantize(program, Settings(largest_angle=Fraction(1, part))).interface.outputs[0].errors
        for part in (8, 1)
    ]
    assert max(fixed[0]) < 1e-9 and max(fixed[1]) > max(far / 2, 1e-8)
    growth = strapgen.quantize(program, Settings()).interface.accumulation.growth
    assert growth == 1  # with what is left out, the transition is a rotation


# Choices


def test_names_of_windows_choose_their_samples():
    choice = choose("euler", "window-3-3")
    assert (choice.increments, choice.previous, choice.ahead) == (1, 3, 3)
    assert choice.kernel == "euler-window-3-3" == derive(choice).name
    sided = choose("euler", "window-3-3", ahead=0)
    assert sided.kernel == "euler-window-6-0" and sided == choose("euler", "window-3-3", previous=6)
    assert derive(sided).arguments == "euler --method window-6-0"
    assert choose("euler", "window-3-3-exact", ahead=2).kernel == "euler-window-4-2-exact"
    for window in (WINDOWS["window-3-3"], WINDOWS["window-4-2"]):
        assert choose("euler", window) == choose("euler", window.name)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"increments": 2}, "increments is 2; a step of window-3-3 has 1"),
        ({"ahead": 7}, "window-3-3 has no filters with 7 of its samples ahead"),
        (
            {"ahead": 2, "previous": 3},
            "previous 3 and ahead 2 are no samples of window-3-3, which has 6 beside",
        ),
        ({"rates": True}, "window-3-3 takes increments; rates at nodes do not go with it"),
    ],
)
def test_samples_that_a_window_does_not_have_are_refused(options, message):
    with pytest.raises(InputError, match=message):
        choose("euler", "window-3-3", **options)


def test_vectors_take_windows_whose_rotation_has_one():
    with pytest.raises(InputError, match="computes a rotation, not its vector; window-3-3 does"):
        choose("rotation-vector", "window-3-3-exact")
    with pytest.raises(InputError, match="sculling goes with no window"):
        choose("sculling", "window-3-3")


def test_a_file_of_ones_own_goes_wherever_a_method_goes(tmp_path):
    from strapgen.catalogue.methods import windows

    source = windows._BUILT_IN.files["window-3-3"]
    path = tmp_path / "mine.toml"
    path.write_text(source.read_text().replace('name = "Window 1+3+3', 'name = "Mine 1+3+3', 1))
    window = read(path)
    choice = choose("euler", window, ahead=1)
    kernel = derive(choice)
    assert kernel.arguments == f"euler --window {path} --ahead 1"
    assert isinstance(choice.method, Window) and str(path) in choice.identity
    assert derive("euler", window).name == f"euler-{window.name}"
    flat = [x for sample in random_samples(7) for x in sample]
    values = dict(zip(kernel.inputs[1].elements, flat, strict=True)) | dict(
        zip(kernel.inputs[0].elements, (0, 0, 0, 1), strict=True)
    )
    assert kernel.expand(values) == derive("euler", "window-5-1").expand(values)


# Accuracy

CONES = {f"cone {angle}/{hertz}": (angle, hertz) for angle, hertz in ((1, 10), (1, 20), (5, 5), (15, 20))}

#: Drift in deg/h after 60 s at 100 Hz, from an implementation that was written from the formulas alone; tests of the
#: drift have other windows, and the methods beside them.
DRIFTS = {
    "window-7-7": (6.46e-6, 1.45e-4, 1.07e-4, 0.539, 7.53e-4, 9e-9, 1.35e-3, 3.2e-3),
    "window-9-9": (2.3e-7, 1.3e-6, 8.4e-7, 2.9e-4, 3.4e-7, 2e-9, 1.27e-3, 3.2e-3),
}
MOTIONS = (*CONES, "random", "slew of 50 ms", "slew of 10 ms", "ramps")


@pytest.fixture(scope="module")
def motions():
    """The motions, whose true attitudes are computed once."""
    cones = {
        name: strapgen.motion("cone", half_angle_deg=angle, frequency_hz=hertz)
        for name, (angle, hertz) in CONES.items()
    }
    return cones | {
        "random": strapgen.motion("random", rate_deg_s=200),
        "slew of 50 ms": strapgen.motion("slew", onset_s=0.05, rate_deg_s=300),
        "slew of 10 ms": strapgen.motion("slew", onset_s=0.01, rate_deg_s=300),
        "ramps": strapgen.motion("ramps", onset_s=0.05, rate_deg_s=300),
    }


@pytest.mark.long
def test_drift_of_the_exact_rotation(motions):
    backend = strapgen.backend("euler", "window-9-9", backend="c")
    for name, expected in zip(MOTIONS, DRIFTS["window-9-9"], strict=True):
        run = strapgen.simulate(backend, motions[name], "0.01", 60)
        # Below 1e-8 deg/h rounding counts.
        assert drift(run) == pytest.approx(expected, rel=0.1) or max(drift(run), expected) < 1e-8, name


@pytest.mark.long
@pytest.mark.parametrize(("method", "order"), [("window-3-3", 6), ("window-6-0", 5)])
def test_the_stated_order_of_a_window_is_that_of_its_error(method, order):
    choice = choose("euler", method)
    assert derive(choice).order.step == order == series(choice, terms=1).order


@pytest.mark.long
def test_a_window_for_a_gyro_takes_out_its_response():
    # A gyro of second order sees a vibration of forty lines; the window is designed for its bandwidth.
    gyro = Response(frequency_hz=Fraction(40), damping=Fraction(7071, 10000), sample_hz=Fraction(100))
    window = design(FamilyBrief(7, 7, Fraction("1.9"), conditions=2, gyro=gyro))
    vibration = strapgen.motion("vibration", angle_deg=0.1, gyro_hz=40)
    run = strapgen.simulate(strapgen.backend("euler", window, backend="c"), vibration, "0.01", 60)
    assert steady_drift(run) < 1e-3 and angles(run).max() < 1e-6
    ideal = strapgen.simulate(strapgen.backend("euler", "window-7-7", backend="c"), vibration, "0.01", 60)
    assert steady_drift(ideal) > 1 and angles(ideal).max() > 1e-3
