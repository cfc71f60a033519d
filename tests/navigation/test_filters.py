"""Filters: designs against SciPy, their kernels, the proofs of fixed point, and the study of their responses."""

from __future__ import annotations

import json
import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import scipy.signal as independent
import sympy as sp
from commands import run
from derived import kernel
from hypothesis import given, settings
from hypothesis import strategies as st
from languages import cases

import strapgen
from strapgen.catalogue import Choice
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import IntegerSum
from strapgen.navigation.filters import filter_study as experiment
from strapgen.navigation.filters import sections
from strapgen.navigation.filters.filter_file import Filter, read
from strapgen.navigation.filters.filter_study import OutputFilter, decibels
from strapgen.navigation.filters.proof import bounds, cycle
from strapgen.navigation.filters.sections import Section
from strapgen.navigation.systems.system_file import parsed
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.navigation.systems.wiring import wired
from strapgen.run.backends import BACKENDS

FILES = Path(__file__).resolve().parents[2] / "examples" / "filters"
#: The filters of the MFCRS: the frequency at which the gain in dB is printed, both None where none is.
PRINTED = {
    "dither-notch": (411, -60),
    "pitch-notch": (8.5, -15),
    "roll-notch": (9.5, -30),
    "lag-lead": (24.999, 3),
    "lead-lag": (24.999, 5),
    "accelerometer-lag": (1 / (2 * math.pi * 0.1), decibels(math.sqrt(0.5))),
}


def described(name: str) -> Filter:
    return read(FILES / f"{name}.toml")


def written(tmp_path: Path, *parts: str, sample_hz: float = 50) -> Filter:
    """Return the filter of sections, each the lines of its keys."""
    text = "".join(f"[[section]]\n{part}\n" for part in parts)
    path = tmp_path / "one.toml"
    path.write_text(f'name = "One"\nsource = "a test"\nsample_hz = {sample_hz}\n{text}')
    return read(path)


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


@pytest.mark.long
def test_sines_measure_the_response_and_no_run_leaves_its_bound(rng):
    lines = (0.32, 3.2, 10.0)
    which = experiment.runs(["numpy", "c-float", "c-fixed32", "c-fixed16"])
    assert len(which) == 6
    for edge in (EDGE, OutputFilter(0.05, 50)):
        for measured in experiment.measure(which, edge, 128.0, lines):
            # Four roundings in a cycle of numbers up to 1, or the bound over the size of the sine.
            epsilon = np.finfo(np.float32 if measured.backend == "c-float" else float).eps
            rounding = 4 * epsilon * float(max(bounds(edge.sections).errors((Fraction(1), Fraction(1)))))
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


# Designs


@pytest.mark.parametrize("order", range(1, 9))
@pytest.mark.parametrize("kind", ["butterworth", "bessel"])
def test_low_passes_are_those_of_scipy(kind, order, tmp_path):
    """Of Bessel's filters the bilinear transformation of the poles that SciPy has, with the frequency kept."""
    one = written(tmp_path, f'kind = "{kind}"\norder = {order}\nfrequency_hz = 4')
    if kind == "butterworth":
        numerator, denominator = independent.butter(order, 4, fs=50)
    else:
        edge = 2 * 50 * math.tan(math.pi * 4 / 50)
        analog = independent.bessel(order, edge, analog=True, norm="mag")
        numerator, denominator = independent.bilinear(*analog, fs=50)
    hertz = np.array([0.1, 1, 3, 4, 6, 10, 18])
    _, expected = independent.freqz(numerator, denominator, hertz, fs=50)
    np.testing.assert_allclose([one.designed(f) for f in hertz], expected, rtol=1e-9)
    apart = [decibels(one.digital(f)) - decibels(one.designed(f)) for f in hertz]
    assert 0 < np.abs(apart).max() < 0.05  # rounded to short words
    np.testing.assert_allclose(one.denominator, denominator, atol=0.02)


def test_lag_and_lead_lag_are_bilinear_with_their_frequency_kept():
    for name, order in (("accelerometer-lag", 1), ("lag-lead", 1), ("lead-lag", 2)):
        one = described(name)
        hertz = {"accelerometer-lag": 1 / (2 * math.pi * 0.1), "lag-lead": 3.0, "lead-lag": 4.0}[name]
        w = 100 * math.tan(math.pi * hertz / 50)  # so that SciPy's transformation keeps it
        gain = 1.0 if name == "accelerometer-lag" else 10 ** ({"lag-lead": 3, "lead-lag": 5}[name] / 20)
        apart = gain ** (1 / 2 / order)
        pole, zero = w * apart, w / apart
        if order == 2:
            analog = [1 / zero**2, 1.4 / zero, 1], [1 / pole**2, 1.4 / pole, 1]
        else:
            analog = [1] if gain == 1 else [1 / zero, 1], [1 / pole, 1]
        _, expected = independent.freqz(*independent.bilinear(*analog, fs=50), np.arange(1, 25), fs=50)
        np.testing.assert_allclose([one.designed(f) for f in range(1, 25)], expected, rtol=1e-6)


def test_a_deep_notch_is_the_one_of_scipy(tmp_path):
    one = written(tmp_path, 'kind = "notch"\nfrequency_hz = 8\nwidth_hz = 2\ndepth_db = 120')
    hertz = np.array([1, 4, 7, 7.5, 8.5, 9, 12, 20])
    _, expected = independent.freqz(*independent.iirnotch(8, 4, fs=50), hertz, fs=50)
    np.testing.assert_allclose([one.designed(f) for f in hertz], expected, rtol=1e-9, atol=1e-5)


roots = st.tuples(
    st.fractions(-1, 1, max_denominator=97),
    st.one_of(st.just(Fraction(0)), st.fractions(0, 1, max_denominator=89)),
)


@settings(deadline=None, max_examples=60)
@given(
    poles=st.lists(roots.filter(lambda r: r[0] ** 2 + r[1] ** 2 < Fraction(49, 50)), min_size=1, max_size=4),
    zeros=st.lists(roots, max_size=4),
    gain=st.fractions(-5, 5, max_denominator=50),
)
def test_poles_and_zeros_are_those_of_the_sections(poles, zeros, gain):
    def whole(several):
        return [complex(*map(float, r)) for r in several] + [
            complex(float(r[0]), -float(r[1])) for r in several if r[1]
        ]

    if len(whole(zeros)) > len(whole(poles)):
        with pytest.raises(InputError, match="no more zeros than poles"):
            sections.poles_and_zeros(poles, zeros, gain, Fraction(50))
        return
    several = sections.poles_and_zeros(poles, zeros, gain, Fraction(50))
    hertz = np.array([0.3, 2, 7, 15, 24])
    z = np.exp(2j * np.pi * hertz / 50)
    expected = (
        float(gain)
        * np.prod([z - x for x in whole(zeros)] or [1 + 0 * z], 0)
        / np.prod([z - x for x in whole(poles)], 0)
    )
    s = 1j * np.tan(np.pi * hertz / 50)
    found = np.prod([[one.response(x) for x in s] for one in several], 0)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    for design in several:  # rounded or not, a pole stays inside
        Section.of(design).require_stable()


def test_stability_is_decided_exactly():
    inside = Fraction(8, 10) - Fraction(1, 10**30)
    for imaginary, is_stable in ((Fraction(8, 10), False), (inside, True)):
        poles = [(Fraction(6, 10), imaginary)]
        if is_stable:
            (design,) = sections.poles_and_zeros(poles, [], Fraction(1), Fraction(50))
            assert 0 < design.width < Fraction(1, 10**29)
        else:
            with pytest.raises(InputError, match=r"pole 0\.6 \+- 0\.8 i is on or outside the unit circle"):
                sections.poles_and_zeros(poles, [], Fraction(1), Fraction(50))
    for change, is_stable in ((Fraction(0), False), (Fraction(1, 10**30), True)):
        # A turn by some angle with a length of 1, or less.
        one = Section(Fraction(1, 5) + change, Fraction(2, 5), Fraction(1, 5) + change, Fraction(2, 5))
        assert (one.denominator[2] < 1) == is_stable
        if is_stable:
            one.require_stable()
        else:
            with pytest.raises(InputError, match="a pole is on or outside"):
                one.require_stable()
    for square in (0, 1):
        with pytest.raises(InputError, match="a pole is on or outside"):
            Section(Fraction(square)).require_stable()


@pytest.mark.parametrize(
    ("sections_of", "said"),
    [
        ("", "section is missing; a list of 1 to 8 tables is needed"),
        ("section = []", "section has 0 entries; from 1 to 8 are needed"),
        ("[section]\nkind = 'lag'", "section is a table; a list of 1 to 8 tables is needed"),
    ],
)
def test_a_filter_has_sections(sections_of, said, tmp_path):
    path = tmp_path / "none.toml"
    path.write_text(f"name = 'None'\nsource = 'a test'\nsample_hz = 50\n{sections_of}\n")
    with pytest.raises(InputError, match=said):
        read(path)


@pytest.mark.parametrize(
    "section",
    [
        'kind = "poles"\npoles = [[0, 0], [0, 0], [0, 0]]\nzeros = [[-1, 0]]',
        'kind = "poles"\npoles = [[0.5, 0.3], [0.2, 0.1]]\nzeros = [[1, 0], [-1, 0]]',
        'kind = "lead-lag"\nfrequency_hz = 5\ngain_db = -40\norder = 2',
        'kind = "butterworth"\norder = 3\nfrequency_hz = 24',
        'kind = "second-order"\nfrequency_hz = 5\ndamping = 10',
        'kind = "lag"\ntime_constant_s = 10',
    ],
)
def test_sections_at_their_limits_run_within_their_bounds(section, tmp_path, rng):
    one = written(tmp_path, section)
    samples = np.rint(rng.uniform(-1, 1, (300, 1, 3)) * 2**14) / 2**14
    exact = experiment.run_filter(experiment.filter_evaluator(one, 1.0, "numpy"), samples)
    expected = independent.lfilter(one.numerator, one.denominator, samples, axis=0)
    np.testing.assert_allclose(exact, expected, atol=1e-9)
    fixed = experiment.filter_evaluator(one, 1.0, "c-fixed16", "none")
    apart = np.abs(experiment.run_filter(fixed, samples) - exact).max()
    assert 0 < apart <= experiment.certified_bound(fixed, one) + 1e-12


# Kernels


@pytest.mark.parametrize("name", [*PRINTED, "cascade"])
def test_a_kernel_has_the_transfer_function(name, rng):
    one = described(name)
    evaluator = experiment.filter_evaluator(one, float(one.range), "numpy")
    samples = rng.normal(size=(400, 1, 3))
    expected = independent.lfilter(one.numerator, one.denominator, samples, axis=0)
    np.testing.assert_allclose(experiment.run_filter(evaluator, samples), expected, atol=1e-11)
    states, x = [Fraction(0)] * len(one.states), Fraction(1)
    for k in range(12):  # and the proofs are of the same cycle
        states, y = cycle(one.sections, states, x)
        impulse = independent.lfilter(one.numerator, one.denominator, np.eye(1, 12)[0])
        assert math.isclose(float(y), impulse[k], abs_tol=1e-12)
        x = Fraction(0)


@pytest.mark.parametrize("name", [*PRINTED, "cascade"])
def test_delays_are_the_phases_of_slow_changes(name):
    one, slow = described(name), 1e-5
    for response, delay in ((one.analog, one.analog_delay_s), (one.digital, one.digital_delay_s)):
        phase = np.angle(response(slow) / response(0))
        assert math.isclose(-phase / (2 * math.pi * slow), delay, rel_tol=1e-5, abs_tol=1e-9)


@pytest.mark.parametrize("name", [*PRINTED, "cascade"])
def test_ranges_have_room_for_rounding(name):
    one = described(name)
    inputs = kernel(Choice("filter", layout=one)).inputs[: len(one.states)]
    parts = [
        signal.bound / (one.range * most)
        for signal, most in zip(inputs, bounds(one.sections).states, strict=True)
    ]
    # 17/16, rounded upwards to nine or ten bits
    assert all(Fraction(17, 16) <= part < Fraction(17, 16) * (1 + Fraction(1, 256)) for part in parts)


@pytest.mark.parametrize("name", [*PRINTED, "cascade"])
def test_words_of_16_bits_hold_every_coefficient(name):
    fixed = strapgen.quantize(
        strapgen.lower(strapgen.derive("filter", layout=FILES / f"{name}.toml")), Settings(16)
    )
    rounded = [
        term.coefficient
        for value in fixed.body
        if isinstance(value.definition, IntegerSum)
        for term in (*value.definition.fine, *value.definition.coarse)
        if term.coefficient is not None and term.coefficient.value * 2**term.coefficient.fraction % 1
    ]
    assert rounded == []


@pytest.mark.parametrize("backend", cases(BACKENDS))
def test_a_filter_runs_alike_on_every_back_end(backend, rng):
    one, entry = described("cascade"), BACKENDS[backend]
    samples = rng.uniform(-16, 16, (12, 2, 3))
    reference = f"c-fixed{entry.word or 32}" if entry.fixed else "numpy"
    found, expected = (
        experiment.run_filter(experiment.filter_evaluator(one, 16.0, name, "all"), samples)
        for name in (backend, reference)
    )
    if entry.fixed:
        assert np.array_equal(found, expected)
    else:
        np.testing.assert_allclose(found, expected, atol=1e-4 if "float" in backend else 1e-12)


def system_tables(every: int = 1, **stage: str) -> dict:
    """Return a system with a filter as its one stage, or with other keys of it."""
    keys = {"layout": str(FILES / "roll-notch.toml")} | stage
    one = {"name": "notch", "kernel": "filter", "every": every, "wires": {"sample": "rate"}} | keys
    inputs = {"rate": {"unit": "rad/s", "frame": "b", "range": 8}}
    return {"sample_hz": 50, "inputs": inputs, "stage": [one], "outputs": ["notch.filtered"]}


@pytest.mark.parametrize("backend", ["numpy", pytest.param("c-fixed16", marks=pytest.mark.long)])
def test_a_described_system_takes_a_filter(backend, rng):
    samples = rng.uniform(-8, 8, (100, 3))
    values = system_runner(wired(parsed(system_tables())), backend).run({"rate": samples}).values
    one = described("roll-notch")
    expected = independent.lfilter(one.numerator, one.denominator, samples, axis=0)
    allowed = 1e-12 if backend == "numpy" else 0.1
    np.testing.assert_allclose(values["notch_filtered"], expected, atol=allowed)


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        (system_tables(2), "roll-notch.toml is for 50 samples in a second; the stage has 25"),
        (system_tables(layout="absent.toml"), "stage notch: absent.toml cannot be read"),
        (system_tables(kernel="sum-3"), "stage notch: sum-3 takes no layout"),
    ],
)
def test_a_stage_with_a_wrong_filter_is_refused(tables, said):
    with pytest.raises(InputError, match=said):
        wired(parsed(tables))


# Proofs


@settings(deadline=None, max_examples=25)
@given(
    size=st.floats(0.05, 0.9995),
    angle=st.floats(0.01, 3.1),
    gains=st.lists(st.fractions(-2, 2, max_denominator=8), min_size=3, max_size=3),
)
def test_bounds_are_the_sums_of_the_responses(size, angle, gains):
    pole = Fraction(size * math.cos(angle)), Fraction(size * math.sin(angle))
    low, high, real = gains
    first = sections.Prototype(math.nan, Fraction(1, 3), None, high, low=low)
    several = (
        Section.of(first),
        *map(Section.of, sections.poles_and_zeros([pole], [(real, Fraction(0))], Fraction(1), Fraction(50))),
    )
    proved = bounds(several)
    n = len(proved.states)
    columns = [cycle(several, [Fraction(k == place) for k in range(n)], Fraction(0)) for place in range(n)]
    M = np.array([[float(column[0][row]) for column in columns] for row in range(n)])
    C = np.array([float(column[1]) for column in columns])
    B = np.array([*map(float, cycle(several, [Fraction(0)] * n, Fraction(1))[0])])
    power, growth, outward, states = np.eye(n), np.zeros((n, n)), np.zeros(n), np.zeros(n)
    for _ in range(math.ceil(60 / -math.log(max(size, 0.5)))):
        growth, outward, states = growth + abs(power), outward + abs(C @ power), states + abs(power @ B)
        power = power @ M
    for exact, summed in ((proved.growth, growth), (proved.output_growth, outward), (proved.states, states)):
        bound = np.array(exact, float)
        assert (bound >= summed * (1 - 1e-12)).all()
        np.testing.assert_allclose(bound, summed, rtol=1e-9, atol=1e-10 * bound.max())


def test_a_pole_near_the_circle_is_bounded_by_its_norm_or_refused():
    """Cycles end before the response does; what is left has a bound, or the filter is refused."""
    one = Section.of(sections.Prototype(1.0, Fraction(1, 10**5), None))
    (total,), (state,) = bounds((one,)).growth[0], bounds((one,)).states
    assert Fraction(1, 2) <= one.square * total <= Fraction(1, 2) * (1 + Fraction(1, 10**6))
    assert 1 <= state <= 1 + Fraction(1, 10**6)
    slow = Section.of(sections.Prototype(1.0, Fraction(1, 10**6), None))
    with pytest.raises(InputError, match="does not settle in 200000 cycles"):
        bounds((slow,)) if (1 - 2 * float(slow.square)) ** 200_000 > 1 else bounds(
            (Section(Fraction(1, 10**35)),)
        )


@pytest.mark.parametrize(
    ("name", "word"),
    [
        pytest.param(name, word, marks=() if (name, word) in QUICK else pytest.mark.long)
        for QUICK in [{("dither-notch", 16), ("pitch-notch", 32), ("lag-lead", 16)}]
        for name in [*PRINTED, "cascade"]
        for word in (16, 32)
    ],
)
def test_words_show_the_printed_response_without_a_larger_limit_cycle(name, word, rng):
    one = described(name)
    size, rate = float(one.range), float(one.sample_hz)
    at, printed = PRINTED.get(name, (5.0, None))
    hertz = (at, *(part * rate for part in (0.01, 0.1, 0.2, 0.3, 0.45)))
    for measured in experiment.measure(
        [(f"c-fixed{word}", carry) for carry in ("none", "all")], one, size, hertz
    ):
        # 0.1 dB, and a quarter of what the last bit is worth: in 16 bits the sine at -60 dB has six of them.
        least = measured.unit / 4 / (0.75 * size)
        wanted = [abs(one.designed(f)) for f in hertz]
        wanted += [] if printed is None else [10 ** (printed / 20)]
        for gain, found in zip(
            wanted, [*map(abs, measured.responses), abs(measured.responses[0])], strict=False
        ):
            assert abs(found - gain) < gain * (10 ** (0.1 / 20) - 1) + least, (measured.label, gain)
        assert measured.rest <= measured.bound
        assert measured.constant <= measured.bound + size * 2.0**-word
    for carry in ("none", "all"):
        fixed = experiment.filter_evaluator(one, size, f"c-fixed{word}", carry)
        bound = experiment.certified_bound(fixed, one)
        # From any states, the input zero, what is left in the end is a limit cycle or nothing.
        arguments = fixed.interface.inputs[:-1]
        states = [rng.integers(-a.high // 2, a.high // 2, size=(8, 3)) for a in arguments]
        zero, feedback, largest = np.zeros((8, 3), fixed.number), fixed.fresh(8), 0.0
        for k in range(2 * one.settling + 300):
            (*states, y), feedback = fixed.run([*states, zero], feedback)
            if k >= 2 * one.settling:
                largest = max(largest, np.abs(fixed.in_si(-1, y)).max())
        assert largest <= bound


@pytest.mark.parametrize(
    ("name", "word"),
    [
        pytest.param(name, word, marks=() if (name, word) == ("roll-notch", 16) else pytest.mark.long)
        for name in [*PRINTED, "cascade", "output-filter"]
        for word in (16, 32)
    ],
)
def test_the_worst_input_keeps_ranges_and_the_bound(name, word):
    """Signs of the reversed response of each state, and of the output, as large as a sample may be."""
    one = EDGE if name == "output-filter" else described(name)
    size, length, responses = float(getattr(one, "range", 128)), one.settling, []
    exact = experiment.filter_evaluator(one, size, "numpy")
    impulse = np.zeros((length, 1, 3))
    impulse[0] = 1
    held = [np.zeros((1, 3))] * len(one.states)
    for row in impulse:
        (*held, y), _ = exact.run([*held, row], exact.fresh(1))
        responses.append([*(state[0, 0] for state in held), y[0, 0]])
    signs = np.sign(np.array(responses))[::-1].T  # one row for each state and the output
    samples = size * np.repeat(signs.T[:, :, None], 3, axis=2)
    for carry in ("none", "all"):
        fixed = experiment.filter_evaluator(one, size, f"c-fixed{word}", carry)
        argument = fixed.interface.inputs[-1]
        rows = np.clip(
            fixed.integers(argument, samples * (1 - 2.0 ** (1 - word))), argument.low, argument.high
        )
        stored = fixed.numbers(argument, rows)
        held = [np.zeros(rows.shape[1:], fixed.number)] * len(one.states)
        double = [np.zeros(rows.shape[1:])] * len(one.states)
        feedback, worst = fixed.fresh(rows.shape[1]), 0.0
        added = experiment.call_errors(fixed)[:-1]
        limits = [float(x) for x in bounds(one.sections).errors(added)]
        for row, exactly in zip(rows, stored, strict=True):
            (*held, y), feedback = fixed.run([*held, row], feedback)  # refuses what is beyond a range
            (*double, z), _ = exact.run([*double, exactly], exact.fresh(rows.shape[1]))
            worst = max(worst, np.abs(fixed.in_si(-1, y) - z).max())
            for place, (state, other) in enumerate(zip(held, double, strict=True)):
                apart = np.abs(fixed.in_si(place, state) - other).max()
                assert apart <= limits[place] * (1 + 1e-9)
        assert 0 < worst <= experiment.certified_bound(fixed, one) * (1 + 1e-9)
        for place, most in enumerate(bounds(one.sections).states):
            reached = abs(double[place][place]).max() / size
            assert 0.999 * float(most) < reached <= float(most)


def test_words_that_are_too_short_are_refused():
    with pytest.raises(InputError, match="words of 16 bits are too short for the filter"):
        experiment.filter_evaluator(OutputFilter(0.001, 50), 128.0, "c-fixed16", "all")


def test_the_study_takes_a_file(tmp_path, capsys):
    image, file = tmp_path / "filter.png", str(FILES / "roll-notch.toml")
    run(["study", "output-filter", file, "--backend", "numpy", "--format", "json", "--plot", str(image)])
    answer = json.loads(capsys.readouterr().out)
    assert image.stat().st_size > 10_000
    assert answer["cutoff_hz"] is None and answer["name"] == "Roll notch"
    assert [row["hz"] for row in answer["responses"]] == [4.75, 9.5, 19]
    assert round(answer["measured"][0]["gains_db"][1], 1) == -30
    run(["study", "output-filter", file, "--sample-hz", "60"], 2)
    assert "FILE states the filter; --sample-hz does not go with it" in capsys.readouterr().err
    run(["study", "output-filter", file])
    assert "Roll notch, 50 samples in a second" in capsys.readouterr().out
