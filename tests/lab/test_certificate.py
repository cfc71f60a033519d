"""A certificate holds what arithmetic of 50 digits gives, and notices a unit in the last place."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy as sp
from commands import says

from strapgen import Recording, Settings, backend, catalogue, certify, motion, pipeline, propagate
from strapgen.catalogue import choose_step
from strapgen.ir.exceptions import InputError
from strapgen.ir.program import OPERATIONS
from strapgen.lab.certificate import balls, band_bound
from strapgen.lab.certificate import certificate as certificate_module
from strapgen.lab.motions.rate_expressions import time_symbol
from strapgen.lab.motions.rate_motion import RateMotion

flint = pytest.importorskip("flint")

BACKENDS = ("numpy", "c", "c-float", "c-fixed32", "c-fixed16", "fixed-model")


def turns(count, seed=1, size=0.01):
    """Return increments in rad of a motion that is as rough as a float allows."""
    return np.random.default_rng(seed).normal(0, size, (count, 3))


def run_of(choice, name="c-fixed32", count=240, every=3, **settings):
    """Return a run with a state at the end of every third step."""
    samples = turns(count)
    made = Settings(**settings).fitted(np.abs(samples).max()) if "fixed" in name else None
    run = propagate(backend(choice, backend=name, settings=made), Recording(0.0, 0.01, samples))
    return replace(run, time=run.time[::every], states=run.states[::every])


def in_digits(run):
    """Return the attitude that exact arithmetic on the increments of a run ends at, in 50 digits, as a matrix."""
    made, choice = run.backend, run.backend.choice
    step = pipeline.program(choice)
    count, width = made.increments, made.samples_per_step
    state = [mpmath.mpf(float(x)) for x in np.ravel(run.states[0])]
    names = [name for signal in step.inputs for name in signal.elements]
    samples = run.taken.recording.samples
    for k in range(round((run.time[-1] - run.time[0]) / run.step)):
        window = made.representable(samples[k * count : k * count + width][None])[0]
        values = [*state, *(mpmath.mpf(float(x)) for x in np.ravel(window))]
        functions = {"sqrt": mpmath.sqrt, "sin": mpmath.sin, "cos": mpmath.cos, "sinc": mpmath.sinc}
        found = step.run(
            dict(zip(names, values, strict=True)),
            lambda x: mpmath.mpf(x.numerator) / x.denominator,
            {**OPERATIONS, **functions},
        )
        state = found[step.outputs[0].signal.name]
    return matrix(state)


def matrix(state):
    """Return the direction cosines of Euler parameters, scalar last, or of a matrix itself, in 50 digits."""
    if len(state) == 9:
        return mpmath.matrix(3, 3) + mpmath.matrix([state[:3], state[3:6], state[6:]])
    x, y, z, s = state
    size = x * x + y * y + z * z + s * s
    return (
        mpmath.matrix(
            [
                [s * s + x * x - y * y - z * z, 2 * (x * y - s * z), 2 * (x * z + s * y)],
                [2 * (x * y + s * z), s * s - x * x + y * y - z * z, 2 * (y * z - s * x)],
                [2 * (x * z - s * y), 2 * (y * z + s * x), s * s - x * x - y * y + z * z],
            ]
        )
        / size
    )


def turn_between(first, second):
    """Return the rotation vector from the second matrix to the first one, of the nearest rotation."""
    error = first * second**-1
    for _ in range(8):
        error = (error + (error**-1).T) / 2
    sines = [
        (error[2, 1] - error[1, 2]) / 2,
        (error[0, 2] - error[2, 0]) / 2,
        (error[1, 0] - error[0, 1]) / 2,
    ]
    size = mpmath.sqrt(sum(x * x for x in sines))
    return [x * mpmath.asin(size) / size for x in sines]


@pytest.fixture
def digits():
    with mpmath.workdps(50):
        yield


@pytest.mark.parametrize("name", BACKENDS)
@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_rounding_is_that_of_50_digits(algorithm, name, digits):
    run = run_of(choose_step(algorithm, "rk4", 2), name)
    certificate = certify(run, with_method=False)
    computed = matrix([mpmath.mpf(float(x)) for x in np.ravel(run.states[-1])])
    expected = turn_between(computed, in_digits(run))
    for found, wanted in zip(certificate.rounding_axes_rad, expected, strict=True):
        assert abs(found - wanted) <= certificate.rounding_radius_rad
    assert certificate.rounding_radius_rad < 1e-9 * certificate.rounding_rad
    assert certificate.steps == 120
    if name != "numpy":
        assert certificate.rounding_rad < certificate.header_bound_rad


@pytest.mark.parametrize(
    "choice",
    [
        choose_step("cayley-klein", "rk4", 2),
        choose_step("euler", "pair-1-5"),
        choose_step("euler", "coning-combined", 2, previous=1),
        choose_step("euler", "taylor4", 2),
    ],
    ids=lambda choice: choice.kernel,
)
def test_every_step_that_multiplies_by_a_transition_is_certified(choice, digits):
    run = run_of(choice, carry="full")
    certificate = certify(run)
    if choice.name == "euler":
        computed = matrix([mpmath.mpf(float(x)) for x in run.states[-1]])
        expected = turn_between(computed, in_digits(run))
        for found, wanted in zip(certificate.rounding_axes_rad, expected, strict=True):
            assert abs(found - wanted) <= certificate.rounding_radius_rad
    assert 0 < certificate.rounding_rad < certificate.header_bound_rad
    assert (certificate.truncation_rad is None) == (choice.method_name == "pair-1-5")


@pytest.mark.parametrize("element", range(4))
def test_a_unit_in_the_last_place_moves_the_certificate_by_that_unit(element):
    """From the step on in which a word is one off, all that comes after is turned by that."""
    choice = choose_step("euler", "rk4", 2)
    run = run_of(choice, every=1)
    made, samples = run.backend, run.taken.recording.samples
    states = np.array(run.states)
    wrong = states[60].copy()
    wrong[element] += made.unit
    rest = Recording(run.time[60], 0.01, samples[120:])
    on = made.propagate(rest.samples.reshape(-1, 2, 3), initial=wrong)
    faulty = replace(run, states=np.concatenate([states[:60], on]))
    honest, moved = certify(run, with_method=False), certify(faulty, with_method=False)
    # What rounding does after it is another draw, of at most half a unit a step.
    apart = np.linalg.norm(np.subtract(honest.rounding_axes_rad, moved.rounding_axes_rad))
    alone = certify(replace(faulty, time=run.time[:61], states=faulty.states[:61]), with_method=False)
    before = certify(replace(run, time=run.time[:61], states=states[:61]), with_method=False)
    q = states[60] / np.linalg.norm(states[60])
    across = math.sqrt(1 - q[element] ** 2)  # along the state a unit changes the length alone
    turned = np.linalg.norm(np.subtract(alone.rounding_axes_rad, before.rounding_axes_rad))
    assert turned == pytest.approx(2 * made.unit * across, rel=1e-6)
    assert apart < turned + 2 * made.angle_bound(60)


@pytest.mark.parametrize("algorithm", ["euler", "dcm", "cayley-klein"])
def test_a_normalization_is_no_fault(algorithm):
    """It lies in intervals that are shorter than the time from one to the next."""
    samples = turns(400)
    made = backend(algorithm, backend="c-fixed32", settings=Settings().fitted(np.abs(samples).max()))
    run = propagate(made, Recording(0.0, 0.01, samples), orthonormalize="0.04")
    certificate = certify(run, with_method=False)
    assert certificate.faults == []
    wrong = np.array(run.states)
    wrong[101:] = made.propagate(samples[202:].reshape(-1, 2, 3), initial=wrong[101] + 2.0**-18)
    assert certify(replace(run, states=wrong), with_method=False).faults


def test_what_an_orthonormalization_turns_is_no_rounding():
    """In double it is what the scheme makes of the skew that truncation has left."""
    samples = turns(240)
    run = propagate(
        backend(choose_step("dcm", "rk1", 2), backend="c"),
        Recording(0.0, 0.01, samples),
        orthonormalize="0.06",
    )
    whole = certify(run, with_method=False)
    assert whole.rounding_rad < 1e-14
    assert whole.orthonormalization_rad > 1e-9
    assert "orthonormalization, beside it" in whole.text()
    thinned = certify(replace(run, time=run.time[::40], states=run.states[::40]), with_method=False)
    assert thinned.rounding_rad < 1e-14  # with several in a block
    assert thinned.orthonormalization_rad == pytest.approx(whole.orthonormalization_rad, rel=0.1)
    with pytest.raises(InputError, match="the states are not those"):  # more than rounding turns them
        certify(replace(run, taken=replace(run.taken, orthonormalize_every=0)), with_method=False)


def test_a_flipped_bit_is_found_with_its_time():
    run = run_of(choose_step("euler", "rk4", 2), every=1, carry="none")
    states = np.array(run.states)
    flipped = states[70].copy()
    flipped[1] += 2.0**-20
    rest = run.backend.propagate(run.taken.recording.samples[140:].reshape(-1, 2, 3), initial=flipped)
    certificate = certify(replace(run, states=np.concatenate([states[:70], rest])))
    (fault,) = certificate.faults
    assert (fault.from_s, fault.to_s) == pytest.approx((1.38, 1.4))
    assert fault.angle_rad == pytest.approx(2 * 2.0**-20, rel=0.1)
    assert "a fault from 1.38 s to 1.4 s" in certificate.text()


@pytest.mark.parametrize(
    "wrong",
    [
        lambda run: replace(run, states=np.roll(run.states, 1, axis=0)),
        lambda run: replace(run, states=run.states * [1, 1, 1, -1]),
        lambda run: replace(
            run,
            backend=backend(
                choose_step("euler", "rk1", 2), backend="c-fixed32", settings=run.backend.interface.settings
            ),
        ),
    ],
    ids=["a row late", "another sense", "another algorithm"],
)
def test_states_of_another_run_are_refused(wrong):
    run = run_of(choose_step("euler", "rk4", 2), every=1)
    with pytest.raises(InputError, match="the states are not those of euler-rk"):
        certify(wrong(run))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda run: replace(run, taken=None), "along which increments it went"),
        (lambda run: replace(run, time=run.time + 0.004), "at no end of a step"),
        (lambda run: replace(run, time=run.time[::-1]), "is not after that before it"),
        (lambda run: replace(run, time=run.time + 5), "do not lie along"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(change, message):
    with pytest.raises(InputError, match=message):
        certify(change(run_of(choose_step("euler", "rk4", 2))))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"band_hz": 10}, "amplitude_deg_s is needed too"),
        ({"amplitude_deg_s": 10}, "band_hz is needed too"),
        ({"band_hz": 50, "amplitude_deg_s": 900}, "below half the sampling rate, 50 Hz"),
        ({"band_hz": 10, "amplitude_deg_s": 10}, "turns at"),
    ],
)
def test_a_band_that_cannot_be_is_refused(options, message):
    with pytest.raises(InputError, match=message):
        certify(run_of(choose_step("euler", "rk4", 2)), **options)


def test_a_band_bounds_nothing_for_a_pair():
    with pytest.raises(InputError, match="fits no rate"):
        certify(run_of(choose_step("euler", "pair-1-5")), band_hz=10, amplitude_deg_s=900)


@pytest.mark.parametrize("method", ["coning-compressed", "rk4"])
def test_error_feedback_leaves_no_bias(method):
    """A bias of a hundredth of a unit a step would be 30 units here; what feedback leaves is a few."""
    choice = (
        choose_step("euler", method, 1, previous=1) if method != "rk4" else choose_step("euler", method, 2)
    )
    random = motion("random", rate_deg_s=60)
    count = choice.increments_per_step
    samples = random.samples(Fraction(1, 100 * count), 0, 3000 * count + choice.previous)
    made = backend(choice, backend="c-fixed32", settings=Settings(carry="full").fitted(np.abs(samples).max()))
    certificate = certify(propagate(made, Recording(0.0, 0.01 / count, samples)), with_method=False)
    assert certificate.largest_rounding_rad < 10 * made.unit


# The method


def test_truncation_is_that_of_the_exact_rotation_of_the_fitted_rate(digits):
    """The method that sums the series to the power 16 of time is nearer to it than the digits that are compared."""
    run = run_of(choose_step("euler", "rk2", 2), "c")
    certificate = certify(run)
    exact = replace(run, backend=backend(choose_step("euler", "fit-exact", 2), backend="c"))
    between = turn_between(in_digits(run), in_digits(exact))
    size = float(mpmath.sqrt(sum(x * x for x in between)))
    assert certificate.truncation_rad == pytest.approx(size, rel=1e-9)
    assert certificate.truncation_radius_rad < 1e-15


def test_the_exact_rotation_of_the_fit_has_no_truncation():
    certificate = certify(run_of(choose_step("euler", "fit-exact", 2), "c"))
    assert certificate.truncation_rad < 1e-18 + certificate.truncation_radius_rad


# The true attitude

CONES = [(1.0, 10.0), (5.0, 5.0), (1.0, 19.0), (0.1, 3.0)]


@pytest.mark.parametrize(("half", "frequency"), CONES)
@pytest.mark.parametrize("method", ["window-7-7", "rk4"])
def test_a_cone_lies_within_the_bound_at_every_instant(method, half, frequency):
    choice = choose_step("euler", method) if method != "rk4" else choose_step("euler", "rk4", 2)
    cone = motion("cone", half_angle_deg=half, frequency_hz=frequency)
    samples = cone.samples(Fraction(1, 100), 0, 300)
    run = propagate(backend(choice, backend="c"), Recording(0.0, 0.01, samples))
    lines = math.degrees(2 * math.pi * frequency * math.sin(math.radians(half)))
    constant = math.degrees(2 * math.pi * frequency * (1 - math.cos(math.radians(half))))
    amplitude = math.hypot(lines, lines, constant) * (1 + 1e-9)
    begin = cone.attitude(run.time[:1])[0]
    for steps in (30, 100, len(run.time) - 1):
        some = replace(run, time=run.time[: steps + 1], states=run.states[: steps + 1])
        bound = certify(some, band_hz=frequency, amplitude_deg_s=amplitude).band_bound_rad
        true = begin.T @ cone.attitude(run.time[steps : steps + 1])[0]
        error = run.backend.matrices(run.states[steps]) @ true.T
        angle = (
            np.linalg.norm([error[2, 1] - error[1, 2], error[0, 2] - error[2, 0], error[1, 0] - error[0, 1]])
            / 2
        )
        assert angle <= bound + 1e-15 * steps  # doubles of the truth and of the increments
    assert certify(run, band_hz=frequency, amplitude_deg_s=amplitude).band_bound_status == "proved"


def line_motion(seed):
    """Return a rate of up to five lines on each axis, its highest frequency in Hz and its amplitude in deg/s."""
    draws = np.random.default_rng(seed)
    t, highest = time_symbol(), int(draws.integers(4, 24))
    rate, sums = [], []
    for _ in range(3):
        lines = int(draws.integers(1, 6))
        sizes = [sp.Rational(int(draws.integers(1, 2000)), 1000) for _ in range(lines)]  # rad/s
        places = [sp.Rational(int(draws.integers(1, 10 * highest)), 10) for _ in range(lines)]
        phases = [sp.Rational(int(draws.integers(0, 628)), 100) for _ in range(lines)]
        waves = [a * sp.cos(2 * sp.pi * f * t + p) for a, f, p in zip(sizes, places, phases, strict=True)]
        rate.append(sp.Add(*waves))
        sums.append(float(sum(sizes)))
    return RateMotion(f"lines {seed}", {}, tuple(rate)), highest, math.degrees(math.hypot(*sums)) * (1 + 1e-9)


@pytest.mark.parametrize(
    "seed", [pytest.param(k, marks=[] if k < 2 else [pytest.mark.long]) for k in range(16)]
)
def test_lines_lie_within_the_bound_at_every_instant(seed):
    """The truth is integrated in 50 digits, with a proved error."""
    motion, highest, amplitude = line_motion(seed)
    choice = choose_step("euler", "window-7-7" if seed % 2 else "fit-exact", None if seed % 2 else 3)
    count, first = choice.increments_per_step, choice.previous
    samples = motion.samples(Fraction(1, 100), -first, 60 * count + choice.ahead)
    run = propagate(backend(choice, backend="c"), Recording(-first / 100, 0.01, samples))
    whole = certify(run, band_hz=highest, amplitude_deg_s=amplitude)
    assert whole.band_bound_rad < 1  # it says something
    with mpmath.workdps(50):
        for steps in range(1, len(run.time), 7):
            some = replace(run, time=run.time[: steps + 1], states=run.states[: steps + 1])
            bound = certify(some, band_hz=highest, amplitude_deg_s=amplitude).band_bound_rad
            true = matrix(motion.attitude_in_digits(Fraction(steps * count, 100)))
            computed = matrix([mpmath.mpf(x) for x in run.states[steps].tolist()])
            angle = mpmath.sqrt(sum(x * x for x in turn_between(computed, true)))
            assert angle <= bound + 1e-17 * steps  # increments are rounded to double


@pytest.mark.parametrize(("m", "frequency"), [(1, 0.3), (2, 0.7), (4, 1.2), (0, 0.5)])
def test_a_level_is_above_the_distance_of_a_filter_at_any_frequency(m, frequency):
    """The response of samples is summed directly, the wanted one is a Bessel function of mpmath."""
    choice = choose_step("euler", "window-7-7")
    taps = [float(x) for x in catalogue.fit(choice).legendre(m)]
    largest = 0.0
    for b in np.linspace(0.01, 1.3, 60):
        edges = np.arange(len(taps) + 1) - choice.previous - 0.5
        samples = (np.exp(1j * b * edges[1:]) - np.exp(1j * b * edges[:-1])) / (1j * b)
        wanted = (2 * m + 1) * 1j**m * float(mpmath.sqrt(mpmath.pi / b) * mpmath.besselj(m + 0.5, b / 2))
        largest = max(largest, abs(samples @ taps - wanted))
    exact = [Fraction(int(x.p), int(x.q)) for x in catalogue.fit(choice).legendre(m)]
    level = band_bound.level(exact, m, 1, choice.previous, 1.3)
    assert largest <= level + 1e-15
    assert level <= largest * 1.05 + 1e-14


@pytest.mark.parametrize("m", [1, 2, 3])
def test_what_is_missed_turns_by_no_more_than_the_bound(m):
    """At a constant rate about x and a Legendre polynomial about y: products of m + 1 factors lead."""
    rate, missed = 0.2, 1e-9
    bound = band_bound.BandBound(np.ones((1, 1)), np.where(np.arange(32) == m, missed, 0.0))
    times, weights = np.polynomial.legendre.leggauss(40)
    size = missed * np.polynomial.legendre.Legendre.basis(m)(times)
    turned = rate * (times + 1) / 2  # of y into z
    along = [weights @ (size * turn(turned)) / 2 for turn in (np.cos, np.sin)]
    angle = np.hypot(*along)
    (found,) = bound.angles(np.array([[[rate, 0.0, 0.0]]]))
    assert angle <= found
    if m < 3:  # then nearly all of the bound is of these products
        assert found < 1.5 * angle


def test_factors_are_integrals_of_legendre_polynomials():
    import sympy as sp

    s, t, r = sp.symbols("s t r")

    def p(m, x):
        return sp.legendre(m, 2 * x - 1)

    for (i, j), row in band_bound.factors(2, 2).items():
        inner = sp.integrate(p(j, t) * sp.integrate(p(i, s), (s, 0, t)), (t, 0, r))
        for m in range(5):
            assert row.get(m, 0) == sp.integrate(sp.expand(p(m, r) * inner), (r, 0, 1))


# Balls, files, the command


def test_a_rotation_vector_is_held_at_every_size():
    with flint.ctx.workprec(128):
        for angle in (0.0, 1e-30, 1e-9, 0.1, 1.5):
            c, s = flint.arb(angle).cos(), flint.arb(angle).sin()
            turn = flint.arb_mat(3, 3, [c, -s, 0, s, c, 0, 0, 0, 1]) * flint.arb(1.25)
            *_, z = balls.rotation_vector(turn)
            assert abs(z - angle) < 1e-30 + 1e-15 * angle * angle
            assert (z - angle).contains(0)
        assert not balls.rotation_vector(flint.arb_mat(3, 3, [0, -1, 0, 1, 0, 0, 0, 0, 1]) * 1)[2].is_finite()


def test_a_long_run_is_certified_in_parts(monkeypatch):
    run = run_of(choose_step("euler", "window-3-3"))
    whole = certify(run)
    monkeypatch.setattr(certificate_module, "_TOGETHER", 30)
    parts = certify(run)
    assert parts.rounding_axes_rad == whole.rounding_axes_rad
    assert parts.truncation_rad == pytest.approx(whole.truncation_rad, rel=1e-12)  # series end where they may


def test_an_interrupted_certificate_goes_on_to_the_same(tmp_path):
    run = run_of(choose_step("euler", "rk4", 2))
    whole = certify(run)
    file = tmp_path / "parts.jsonl"
    assert certify(run, results=file) == whole
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join(lines[:1]) + lines[-1][: len(lines[-1]) // 2])
    assert certify(run, results=file) == whole
    with pytest.raises(InputError, match="holds another study: states"):
        certify(replace(run, states=run.states * (1 + 2.0**-40)), results=file)


def test_the_command_certifies_a_log_and_logged_states(tmp_path, capsys):
    samples = turns(400)
    flight, log = tmp_path / "flight.csv", tmp_path / "states.csv"
    rows = [f"{(k + 1) / 100:.2f},{x},{y},{z}" for k, (x, y, z) in enumerate(samples.tolist())]
    flight.write_text("\n".join(["t [s],dx [rad],dy,dz", *rows]) + "\n")
    words = ["certify", "euler", "--recording", str(flight), "--max-angle-rad", "1/16", "--format", "json"]
    status, out, _ = says(words, capsys)
    said = json.loads(out)
    assert (status, said["steps"], said["faults"]) == (0, 200, [])
    assert said["rounding_rad"] < said["header_bound_rad"]
    made = backend("euler", backend="c-fixed32", settings=Settings(largest_angle=Fraction(1, 16)))
    run = propagate(made, Recording(0.0, 0.01, samples))
    right = (run.states / made.unit).astype(int)

    def logged(states):
        body = [
            f"{t:.2f},{','.join(map(str, row))}" for t, row in zip(run.time[::50], states[::50], strict=True)
        ]
        log.write_text("\n".join([f"time_s,{','.join(made.elements)}", *body]) + "\n")
        status, out, _ = says([*words, "--states", str(log)], capsys)
        return status, json.loads(out)

    status, again = logged(right)
    assert status == 0
    assert again["rounding_rad"] == pytest.approx(said["rounding_rad"], rel=1e-12)
    begin = right[100].copy()
    begin[2] ^= 1 << 24  # in memory, after step 100
    rest = made.propagate(samples[200:].reshape(-1, 2, 3), initial=begin * made.unit)
    status, faulty = logged(np.concatenate([right[:100], (rest / made.unit).astype(int)]))
    assert status == 1
    assert [fault["to_s"] for fault in faulty["faults"]] == pytest.approx([2.0])


@pytest.mark.parametrize(
    ("header", "row", "message"),
    [
        ("time_s,e_x,e_y,e_z", "0.0,0,0,0", "e_x, e_y, e_z, e_s are needed"),
        ("time_s,e_x,e_y,e_z,e_s", "0.0,0,0,0,0.5", "holds fractions"),
        ("time_s,e_x,e_y,e_z,e_s", "0.0,0,0,0,99999999999", "beyond words of 32 bits"),
        ("time_s,e_x,e_y,e_z,e_s", "0.0,0,0,,1073741824", "has no number"),
    ],
)
def test_a_log_of_states_that_does_not_fit_is_one_line(tmp_path, capsys, header, row, message):
    flight, log = tmp_path / "flight.csv", tmp_path / "states.csv"
    flight.write_text("t [s],dx [rad],dy,dz\n" + "".join(f"{k / 100},0,0,1e-3\n" for k in range(1, 21)))
    log.write_text(f"{header}\n{row}\n{row.replace('0.0,', '0.1,', 1)}\n")
    status, out, error = says(f"certify euler --recording {flight} --states {log}", capsys)
    assert (status, out) == (2, "")
    assert message in error
    assert len(error.strip().splitlines()) == 1
