"""Counts of a gyro in systems and in two speeds: the kind of an input says what is counted, bounds hold on counts."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from derived import program
from fixed_inputs import corners_and_random
from navigation.described_files import TWO_SPEEDS, description

from strapgen.catalogue import Choice
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.systems.fitting import fitted
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.navigation.two_speed.two_speed_runner import TwoSpeed
from strapgen.navigation.two_speed.two_speed_sources import loops
from strapgen.run.compiled_code import ModelEvaluator

#: A gyro whose counts are no power of two of a rad, at 400 Hz.
GYRO = {"sample_hz": 400, "lsb": "0.0175dps"}
STEP = """
name = "one"
title = "A step on two samples"
sample_hz = 100
[inputs.gyro]
unit = "rad"
frame = "b"
range = 0.07
[[stage]]
name = "step"
kernel = "euler"
method = "rk4"
increments = 2
every = 2
wires = { increments = "gyro" }
"""


@pytest.mark.parametrize("word", [16, 32])
def test_fast_loop_on_counts_is_inside_its_bound(word, rng):
    settings = Settings.of(word=word, max_rate_deg_s=400, **GYRO)
    fast, slow, _ = loops("dcm", 2, "fixed-model", settings)
    model, fixed = ModelEvaluator(fast), fast.fixed
    inputs = corners_and_random(model, 300, rng)
    (increment,) = (argument for argument in fixed.inputs if argument.sensor)
    assert (increment.signal.name, increment.format.word) == ("increment", 16)
    assert increment.unit == settings.sensor.count and not any(a.sensor for a in slow.fixed.inputs)
    outputs, _ = model.run(inputs, model.fresh(300))
    reached = dict.fromkeys([a.signal.name for a in fixed.outputs], Fraction(0))
    for sample in [*range(20), *range(200, 220)]:
        exact = program(Choice(fast.kernel)).run(
            {
                name: int(word) * argument.unit
                for argument, words in zip(fixed.inputs, inputs, strict=True)
                for name, word in zip(argument.signal.elements, words[sample], strict=True)
            }
        )
        for argument, words in zip(fixed.outputs, outputs, strict=True):
            name = argument.signal.name
            for word_of, value, bound in zip(words[sample], exact[name], argument.errors, strict=True):
                off = abs(int(word_of) * argument.unit - value)
                assert off <= bound
                reached[name] = max(reached[name], off / bound if bound else Fraction(0))
    assert reached["next_angle_sum"] > Fraction(1, 4), "the scale of the counts is inside the bound"


def test_sum_of_counts_loses_nothing_with_error_feedback():
    """Without it the rounding of a steady increment adds up; with it the sum stays within a unit of the exact one."""
    lost = {}
    for carry in ("none", "all"):
        fast, *_ = loops("dcm", 2, "fixed-model", Settings.of(word=16, carry=carry, **GYRO))
        model = ModelEvaluator(fast)
        names = [argument.signal.name for argument in fast.fixed.inputs]
        rows = {name: np.zeros((1, 3), np.int64) for name in names}
        rows["increment"] += 123
        feedback = model.fresh(1)
        for _ in range(500):
            outputs, feedback = model.run([rows[name] for name in names], feedback)
            rows["angle_sum"] = outputs[0]
        unit = {argument.signal.name: argument.unit for argument in fast.fixed.inputs}
        exact = 500 * 123 * unit["increment"] / unit["angle_sum"]
        lost[carry] = float(abs(int(rows["angle_sum"][0, 0]) - exact))
    assert lost["all"] <= 1 < 10 < lost["none"]


@pytest.mark.parametrize("backend", ["c-fixed16", "c-fixed32"])
@pytest.mark.parametrize("stated", [GYRO, {"sample_hz": 400, "input_bits": 12}])
def test_largest_count_is_accepted_in_every_cycle(backend, stated):
    """The increment of the cycle before has the range of what was counted, rounded up to whole counts too."""
    settings = Settings.of(max_rate_deg_s="123.4567", **stated)
    runner = TwoSpeed("euler", 2, backend, settings)
    (increment,) = (a for a in runner.loops[0].fixed.inputs if a.signal.name == "increment")
    largest = float(increment.high * increment.unit)
    assert largest > float(settings.largest_angle)
    angles = largest * np.resize([1.0, -1, -1, 1, 1], (24, 3))
    run = runner.run(angles, np.zeros((24, 3)), fast_cycles=4, slow_cycles=2)
    exact = TwoSpeed("euler", 2, "exact").run(angles, np.zeros((24, 3)), fast_cycles=4, slow_cycles=2)
    angle_sum, coning = (float(max(a.errors)) for a in runner.loops[0].fixed.outputs[:2])
    attitude = float(max(runner.loops[1].fixed.outputs[0].errors))
    turned = float(max(runner.loops[2].fixed.outputs[0].errors))
    # Each slow cycle adds the rounding of its sums, at most by half its length in an element, and of its attitude.
    allowed = 6 * (2 * (4 * angle_sum + 4 * coning) + attitude + turned)
    assert np.abs(run.attitudes - exact.attitudes).max() <= allowed


def test_kind_of_an_input_names_the_counted_quantity(tmp_path):
    settings = Settings.of(sample_hz=3200, lsb="0.0175dps")
    fit = fitted(description(tmp_path, TWO_SPEEDS), "fixed-model", settings)
    counted = {name for name, argument in fit.arguments.items() if argument.sensor}
    assert counted == {"gyro"}, "earth is in rad too, and no increment of the body"
    assert {name for name, s in fit.sources.items() if s.fixed.settings.sensor} == {"fast"}
    assert {s.fixed.settings.input_bits for s in fit.sources.values()} == {16, None}


@pytest.mark.parametrize("word", [16, 32])
def test_system_collects_counts(word, tmp_path):
    described = description(tmp_path, STEP)
    settings = Settings.of(word=word, sample_hz=100, lsb="0.0175dps")
    compiled, model = (
        system_runner(described, backend, settings) for backend in (f"c-fixed{word}", "fixed-model")
    )
    assert compiled.fit.arguments["step_increments"].sensor == settings.sensor
    top = compiled.fit.arguments["gyro"].high
    counts = np.resize([top, -top, 17, 0, -3], (40, 3))
    inputs = {"gyro": counts * float(settings.sensor.count)}
    assert np.array_equal(compiled.samples(inputs)["gyro"], counts)
    runs = [runner.run(inputs).values["step_state"] for runner in (compiled, model)]
    assert np.array_equal(*runs)
    exact = system_runner(described, "exact").run(inputs).values["step_state"]
    # Each of 20 passes adds its bound in every element, a vector of at most twice its length, which only turns.
    bound = 20 * float(max(compiled.rounding.errors["step_state"])) * 2
    assert np.abs(runs[0] - exact).max() <= bound


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            STEP[: STEP.index("[[stage]]")]
            + '[[stage]]\nname = "turned"\nkernel = "dcm-update"\nevery = 1\nwires = { rotation_vector = "gyro" }\n',
            "stage turned: rotation_vector takes an angle in rad, and gyro would be counts; no lsb goes with it",
        ),
        (
            STEP[: STEP.index("[inputs")]
            + '[inputs.counts]\nunit = "1"\nframe = "b"\nrange = 1000\n[[stage]]\nname = "a"\n'
            + 'kernel = "angle-counts"\nevery = 1\nwires = { count = "counts" }\nconstants = { scale = 1e-5 }\n',
            "no input of one is an angle increment in body axes, in rad; an lsb does not go with it",
        ),
    ],
    ids=["angle", "counts"],
)
def test_counts_where_angles_are_needed_are_refused(text, said, tmp_path):
    with pytest.raises(InputError, match=said):
        fitted(description(tmp_path, text), "c-fixed", Settings.of(sample_hz=100, lsb="0.0175dps"))


def test_largest_rate_is_the_range_of_the_increments_of_two_speeds():
    settings = Settings.of(max_rate_deg_s=400, sample_hz=400)
    fast, *_ = loops("dcm", 2, "c-fixed", settings)
    high = {a.signal.name: a.high * a.unit for a in fast.fixed.inputs}
    assert high["increment"] == high["previous_increment"]
    assert settings.largest_angle <= high["increment"] < settings.largest_angle * Fraction(1000001, 1000000)
    with pytest.raises(InputError, match="the largest rate and the range of increment are both stated"):
        loops(
            "dcm",
            2,
            "c-fixed",
            Settings.of(max_rate_deg_s=400, sample_hz=400, ranges={"increment": Fraction(1, 8)}),
        )
