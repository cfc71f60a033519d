"""Series in place of functions of a bounded length: remainders, bounds, every back end, and ranges that are kept."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from commands import says
from languages import cases
from small_programs import EXACT, exactly, node, program

import strapgen
from strapgen import catalogue, pipeline
from strapgen.fixedpoint import bounded_series
from strapgen.fixedpoint.bounded_series import SHARE, with_declared_ranges
from strapgen.fixedpoint.floating import rounding_bounds
from strapgen.fixedpoint.floating.errors import NUMBERS
from strapgen.fixedpoint.quantization import finished, planned
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.program import OPERATIONS, Assignment, Constant, Node, Operation, Program, Reference
from strapgen.run.backends import BACKENDS

#: Largest increments in rad: that of a slow rate, of 400 deg/s in two samples of 5 ms, the default, and a large one.
ANGLES = ["1/1000", "0.035", "1/8", "1/2"]
FLOATING = [name for name, entry in BACKENDS.items() if not entry.fixed and name != "exact"]


def with_series(algorithm: str, method: str, angle: str | Fraction, number: str = "double") -> Program:
    step = pipeline.program(catalogue.choose(algorithm, method, 2))
    return with_declared_ranges(step, Settings.of(largest_angle=angle), number)


#: What the series of a step in the square s of the length of its rotation vector stand for.
FUNCTIONS = (
    lambda s: mpmath.cos(mpmath.sqrt(s) / 2),
    lambda s: mpmath.sinc(mpmath.sqrt(s) / 2),
    lambda s: mpmath.sinc(mpmath.sqrt(s)),
)


def farthest(code: Program, angle: Fraction) -> list[tuple[mpmath.mpf, mpmath.mpf]]:
    """Return how far each series of a step by two increments is from its function, and the remainder that is stated.

    The sum of the increments is the rotation vector, whose largest length is known.
    """
    with mpmath.workdps(50):
        largest = 3 * (2 * mpmath.mpf(angle.numerator) / angle.denominator) ** 2
        places = [largest * k / 64 for k in range(65)]
        return [
            (
                min(max(abs(value(a.value, s) - f(s)) for s in places) for f in FUNCTIONS),
                mpmath.mpf(a.remainder.numerator) / a.remainder.denominator,
            )
            for a in code.body
            if a.remainder
        ]


def value(tree: Node, variable: mpmath.mpf) -> mpmath.mpf:
    """Return the value of a tree of one variable."""
    match tree:
        case Operation(kind, arguments):
            return OPERATIONS[kind](*(value(argument, variable) for argument in arguments))
        case Constant(number):
            return mpmath.mpf(number.numerator) / number.denominator
    return variable


def check_remainders(code: Program, angle: str, number: str) -> None:
    found = farthest(code, Fraction(angle))
    assert len(found) == 2
    for worst, remainder in found:
        assert worst <= remainder <= float(SHARE * NUMBERS[number].unit)
        assert worst > 0.95 * remainder  # and it is no looser than the first term that is left out


@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_remainders_hold_to_fifty_digits(algorithm, angle, number):
    check_remainders(with_series(algorithm, "magnus2", angle, number), angle, number)


@pytest.mark.parametrize("angle", ANGLES)
def test_a_series_that_is_a_term_too_short_is_noticed(angle, monkeypatch):
    whole = bounded_series.sine_series

    def shorter(*arguments):
        coefficients, left_out = whole(*arguments)
        return coefficients[:-1], left_out

    monkeypatch.setattr(bounded_series, "sine_series", shorter)
    with pytest.raises(AssertionError):
        check_remainders(with_series("euler", "magnus2", angle), angle, "double")


@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("method", ["magnus4", "coning-uncompressed", "crouch-grossman3"])
@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_series_leave_no_function_and_a_tight_bound(algorithm, method, number):
    step = pipeline.program(catalogue.choose(algorithm, method, 2))
    code = with_series(algorithm, method, "1/8", number)
    assert step.operations["function"] and step.operations["sqrt"]
    assert not code.operations["function"] and not code.operations["sqrt"]
    more = code.operations["multiply"] - step.operations["multiply"]
    assert more <= 8 * step.operations["function"]
    closed, bounded = (max(rounding_bounds(one, number).errors["next"]) for one in (step, code))
    assert bounded < closed
    assert bounded < 64 * NUMBERS[number].unit  # three exponentials one after the other have the most


def test_a_remainder_enters_every_bound():
    code = with_series("euler", "magnus4", "1/8")
    more = Fraction(1, 1 << 20)
    worse = replace(code, body=tuple(replace(a, remainder=more) if a.remainder else a for a in code.body))
    for bounds in (
        lambda one: rounding_bounds(one).errors["next"],
        lambda one: strapgen.quantize(one, Settings()).error_bounds["next"],
    ):
        difference = np.max(bounds(worse)) - np.max(bounds(code))
        assert more < difference < 4 * more  # by the scalar part, and less by the others


@pytest.mark.parametrize("name", cases(FLOATING))
@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_back_ends_keep_the_bound_against_the_closed_form(algorithm, name, rng):
    angle = Fraction(1, 8)
    settings = Settings.of(largest_angle="1/8")
    made = strapgen.backend(algorithm, "magnus4", 2, name, settings=settings)
    closed = pipeline.program(catalogue.choose(algorithm, "magnus4", 2))
    number = "float" if made.dtype == np.float32 else "double"
    code = with_declared_ranges(closed, settings, number)
    bounds = rounding_bounds(code, number)
    increments = rng.uniform(-1, 1, (12, 2, 3)) * float(angle)
    increments[:4] = rng.choice([-1, 1], (4, 2, 3)) * float(angle)
    increments[4] *= 1e-9
    increments = increments.astype(made.dtype)
    states = np.tile(made.identity, (12, *[1] * made.identity.ndim))
    found = made.step(states, increments)
    names = [element for signal in closed.inputs for element in signal.elements]
    for state, angles, result in zip(states, increments, found, strict=True):
        exact = exactly(closed, dict(zip(names, [*state.ravel(), *angles.ravel()], strict=True)))["next"]
        for value, true, bound in zip(result.ravel(), exact, bounds.errors["next"], strict=True):
            assert abs(Fraction(float(value)) - true) <= bound
    # A run is the same steps, one after the other or several at once.
    run = made.propagate(increments, initial=states[0])
    state = states[0]
    for angles, after in zip(increments, run[1:], strict=True):
        state = made.step(state, angles)
        np.testing.assert_allclose(state, after, rtol=0, atol=8 * made.unit)


def test_loops_of_series_are_vectors():
    choice = catalogue.choose("euler", "magnus4", 2)
    closed, series = (
        pipeline.compile(choice, "c", settings).files["euler_magnus4_2_runs.c"]
        for settings in (None, Settings.of(max_rate_deg_s=400, step="0.01"))
    )
    assert "its operations are not those of vectors" in closed
    assert "vector_size(32)" in series and "<math.h>" not in series


@pytest.mark.parametrize("name", ["numpy", "c"])
def test_increments_beyond_the_declared_range_are_refused(name):
    made = strapgen.backend("euler", "magnus4", 2, name, settings=Settings.of(largest_angle="0.05"))
    inside = np.full((2, 3), 0.05)
    assert made.step(made.identity, inside).shape == (4,)
    message = r"^increments holds 0\.0500001; euler-magnus4-2 was generated for at most 0\.05 in magnitude$"
    with pytest.raises(InputError, match=message):
        made.step(made.identity, inside * 1.000002)
    with pytest.raises(InputError, match=message):
        made.propagate(np.stack([inside, inside * 1.000002]))
    # Without a declared range the closed form takes all.
    assert strapgen.backend("euler", "magnus4", 2, name).step(made.identity, 10 * inside).shape == (4,)


def cosine_of_length(factor: Fraction | int = 1) -> Program:
    """Return the cosine of a multiple of the length of (x, y)."""
    square = node("add", node("multiply", "x", "x"), node("multiply", "y", "y"))
    cosine = node("cos", node("multiply", Fraction(factor), "length"))
    return program({"square": square, "length": node("sqrt", "square"), "c": cosine}, {"x": 1, "y": 1}, "c")


def test_series_need_a_declared_range_of_all_inputs_and_a_small_argument():
    both = {"x": Fraction(1), "y": Fraction(1)}
    kinds = {
        "both declared": (cosine_of_length(), both, 0),
        "one declared": (cosine_of_length(), {"x": Fraction(1)}, 1),
        "too long": (cosine_of_length(2), both, 1),
    }
    for name, (code, ranges, functions) in kinds.items():
        made = with_declared_ranges(code, Settings(ranges=ranges))
        assert made.operations["function"] == made.operations["sqrt"] == functions, name
    values = {"x": 0.6, "y": -0.8}
    made = with_declared_ranges(cosine_of_length(), Settings(ranges=both))
    (closed,), (series,) = (exactly(one, values)["out"] for one in (cosine_of_length(), made))
    assert 0 < abs(closed - series) <= made.body[-1].remainder


def test_a_range_that_holds_of_proper_states_alone_allows_no_series():
    """The length of a state is near 1 of proper ones, and may be zero in the box that is declared."""
    normalize = pipeline.program(catalogue.choose("euler-normalize"))
    square = node("multiply", "inverse_norm", "inverse_norm")
    cosine = Assignment("c", node("cos", node("multiply", Fraction(1, 8), node("sqrt", square))))
    output = replace(normalize.outputs[0], nodes=(Reference("c"),) * 4)
    code = replace(normalize, body=(*normalize.body, cosine), outputs=(output,))
    made = with_declared_ranges(code, Settings(ranges={"state": Fraction(17, 16)}))
    assert made.operations["function"] == 1 and not any(a.remainder for a in made.body)


def test_functions_inside_other_operations_have_values_of_their_own():
    square = node("multiply", "x", "x")
    inside = node("add", node("multiply", "x", node("sinc", node("sqrt", square))), node("sqrt", square))
    code = program({"y": inside}, {"x": 1}, "y")
    made = with_declared_ranges(code, Settings(ranges={"x": Fraction(1)}))
    assert made.operations["function"] == 0 and made.operations["sqrt"] == 1
    (true,), (found,) = (one.run({"x": Fraction(1, 2)}, operations=EXACT)["out"] for one in (code, made))
    assert abs(true - found) <= max(a.remainder for a in made.body)


def test_settings_of_fixed_point_and_ranges_that_do_not_fit_are_refused():
    step = pipeline.program(catalogue.choose("euler", "rk4", 2))
    for settings in (Settings(), Settings(16, Fraction(1, 8)), Settings(rounding="truncation")):
        with pytest.raises(InputError, match=r"^target c takes no fixed-point settings"):
            strapgen.generate(step, "c", settings)
    with pytest.raises(InputError, match="takes no increments; a largest angle does not go with it"):
        strapgen.generate(
            pipeline.program(catalogue.choose("dcm-from-euler")), "c", Settings.of(largest_angle="0.1")
        )
    with pytest.raises(InputError, match="increment"):
        strapgen.generate(step, "c", Settings(ranges={"rates": Fraction(1)}))


def test_the_command_line_declares_a_range(tmp_path, capsys):
    words = f"generate euler --method magnus4 --target c --max-rate-deg-s 400 --step 0.01 --out {tmp_path}"
    assert says(words, capsys)[0] == 0
    header = (tmp_path / "euler_magnus4_2.h").read_text()
    assert "Series in place of functions: cos(x) for x up to 0.0" in header
    assert "--max-rate-deg-s 400 --step 0.01 --target c" in " ".join(header.replace("\n *", "").split())
    assert "at most 0.0349065 in magnitude" in " ".join(header.replace("\n *", "").split())
    status, _, refused = says(f"{words} --word 32", capsys)
    assert status == 2 and refused.startswith("strapgen: the options of fixed point go with --target c-fixed")


#: An operation on what stays near 1, and its exponent.
POWERS = {
    "root": (node("sqrt", "square"), Fraction(1, 2)),
    "inverse root": (node("divide", 1, "length"), Fraction(-1, 2)),
    "inverse": (node("divide", 1, "square"), Fraction(-1)),
}


def power_near_one(value: Operation) -> Program:
    """Return an operation on 1 + x^2 - y^2 / 2, or on its root."""
    square = node("add", 1, node("subtract", node("multiply", "x", "x"), node("multiply", "z", "y")))
    body = {"z": node("multiply", Fraction(1, 2), "y"), "square": square}
    return program(body | {"length": node("sqrt", "square"), "p": value}, {"x": 1, "y": 1}, "p")


@pytest.mark.parametrize("largest", ["0.001", "0.03", "0.12"])
@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("name", POWERS)
def test_powers_of_what_stays_near_one_are_series_to_fifty_digits(name, number, largest):
    value_, exponent = POWERS[name]
    most = Fraction(largest)
    made = with_declared_ranges(power_near_one(value_), Settings(ranges={"x": most, "y": most}), number)
    (series,) = (a for a in made.body if a.remainder)
    assert not made.operations["sqrt"] and not made.operations["divide"]
    with mpmath.workdps(50):
        ends = (-(most**2) / 2, most**2)
        places = [mpmath.mpf(u.numerator * k) / u.denominator / 32 for u in ends for k in range(33)]
        power = mpmath.mpf(exponent.numerator) / exponent.denominator
        worst = max(abs(value(series.value, u) - (1 + u) ** power) for u in places)
        assert worst <= mpmath.mpf(series.remainder.numerator) / series.remainder.denominator
    assert series.remainder <= SHARE * NUMBERS[number].unit
    assert float(worst) > 0.5 * float(series.remainder)


def test_powers_that_need_many_terms_keep_their_operations():
    for value_, _ in POWERS.values():
        wide = with_declared_ranges(
            power_near_one(value_), Settings(ranges=dict.fromkeys("xy", Fraction(2, 3)))
        )
        assert wide.operations["sqrt"] + wide.operations["divide"] > 0
        assert not any(a.remainder for a in wide.body)


def test_a_quotient_by_a_root_is_a_product_with_its_inverse():
    code = power_near_one(node("divide", "x", "length"))
    made = with_declared_ranges(code, Settings(ranges=dict.fromkeys("xy", Fraction(1, 10))))
    assert made.operations["sqrt"] == made.operations["divide"] == 0
    (true,), (found,) = (exactly(one, {"x": 0.1, "y": -0.05})["out"] for one in (code, made))
    assert 0 < abs(true - found) <= max(a.remainder for a in made.body)


def test_exact_steps_normalize_by_a_series():
    step = pipeline.program(catalogue.choose("euler", "taylor3", 3))
    made = with_declared_ranges(step, Settings.of(largest_angle="0.004"))
    assert step.operations["sqrt"] == step.operations["divide"] == 1
    assert made.operations["sqrt"] == made.operations["divide"] == 0


def test_fixed_point_normalizes_by_a_series_where_that_costs_no_error(rng):
    step = pipeline.program(catalogue.choose("euler", "taylor3", 3))
    settings = Settings.of(largest_angle="0.01")
    made = strapgen.quantize(step, settings)
    assert not made.operations.get("sqrt") and not made.operations.get("divide")
    assert made.program == step  # the contract is that of the closed form
    assert made.error_bounds["next"] < finished(planned(step, settings)).error_bounds["next"]
    model = strapgen.build(strapgen.generate(made, "fixed-model"))
    increments = model.representable(rng.choice([-0.01, 0.01], (8, 3, 3)) * 0.999)
    state = np.array([0.5, -0.5, 0.5, 0.5])
    names = [element for signal in step.inputs for element in signal.elements]
    for angles in increments:
        exact = exactly(step, dict(zip(names, [*state, *angles.ravel()], strict=True)))["next"]
        for found, true in zip(model.step(state, angles), exact, strict=True):
            assert abs(Fraction(float(found)) - true) <= made.error_bounds["next"]
