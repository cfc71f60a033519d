"""The filter of an output: its numbers, and what back ends make of sines, of a constant, and of nothing."""

import json
import math

import numpy as np
import pytest
from commands import run

from strapgen.ir.exceptions import InputError
from strapgen.navigation import output_filter as experiment
from strapgen.navigation.output_filter import OutputFilter, decibels
from strapgen.navigation.outputs import PRINTED, RAYLEIGH, radial_error_rate

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


def test_the_study_in_every_format_and_what_it_refuses(tmp_path, capsys):
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


def test_radial_error_rate_is_what_95_of_100_flights_stay_below(rng):
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
