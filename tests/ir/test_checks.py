"""Checks of names, numbers and arrays: each message names the thing, the value and what is allowed."""

from __future__ import annotations

import math
import re
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import strapgen
from strapgen.ir import checks
from strapgen.ir.checks import MOST_NAMES, some, suggestions, unknown
from strapgen.ir.exceptions import InputError, InputTypeError, StrapgenError
from strapgen.lab.recordings import recording
from strapgen.run import exact


def test_choice():
    assert checks.choice("method", "rk4", {"rk1": 1, "rk4": 2}) == "rk4"


def with_limits(name, value):
    return checks.count(name, value, largest=8)


def of_three(name, value):
    return checks.real_array(name, value, (3,))


def of_matrices(name, value):
    return checks.real_array(name, value, (3, 3))


def of_shape(shape):
    return np.zeros(shape)


REFUSED = [
    (
        lambda name, value: checks.choice(name, value, ["rk1", "rk4"]),
        r"x 'rk5' is not known \(did you mean rk1 or rk4\?\); allowed: rk1, rk4",
        ["rk5"],
    ),
    (
        checks.number,
        "x is .*; a finite number is needed",
        [
            *("", "x", "nan", "-inf", "Infinity", "1e999", "1e999999999", "1/0", "1 2", "0x10", "1,5", "--1"),
            *(
                "1_0",
                "1_0/8",
                "1/1_0",
                "٣",
                "٣/٤",
                "1/00000",
                math.nan,
                -math.inf,
                np.nan,
                None,
                True,
                [1.0],
                1j,
            ),
        ],
    ),
    (
        lambda name, value: checks.number(name, value, positive=True),
        "x is .*; a number above 0 is needed",
        ["0", -0.0, "-1e-9", Fraction(-1, 3), "1e-400"],
    ),
    (
        with_limits,
        "x is .*; a whole number from 1 to 8 is needed",
        [0, -1, 9, 1.5, "2", None, True, np.float64(9), math.nan, math.inf, np.True_, 2j],
    ),
    (checks.count, "x is 0; a whole number at least 1 is needed", [0]),
    (
        lambda name, value: checks.multiple(name, *map(Fraction, value[:1]), "step", Fraction(value[1])),
        "x .* s is not a whole multiple of the step .* s.*",
        [("180", "0.7"), ("0.05", "0.1"), ("1", "3")],
    ),
    (
        lambda name, value: checks.multiple(name, Fraction(value), "step", Fraction("1e-300")),
        "x .* that is too many",
        ["1e308", "1e9"],
    ),
    (
        of_three,
        "x has dtype .*; numbers are needed.*",
        [[True] * 3, ["a"] * 3, [1j] * 3, [None] * 3, None, "abc"],
    ),
    (
        of_three,
        r"x has shape \(.*\); \(\.\.\., 3\) is needed",
        [*map(of_shape, [(), (2,), (4,), (3, 1), (3, 0)])],
    ),
    (
        of_matrices,
        r".*\(\.\.\., 3, 3\) is needed",
        [*map(of_shape, [(9,), (3,), (3, 4), (4, 3, 2), ()])],
    ),
    (of_three, "x has rows of different lengths.*", [[[1.0, 2.0, 3.0], [1.0]]]),
    (of_three, r"x holds inf at index \(0,\).*", [[np.inf, -np.inf, 0.0]]),  # which cancel
]


@pytest.mark.parametrize(
    ("check", "said", "value"), [(check, said, value) for check, said, values in REFUSED for value in values]
)
def test_a_value_is_refused_in_one_line(check, said, value):
    kind = InputTypeError if "dtype" in said else InputError
    with pytest.raises(kind, match=f"^{said}$"):
        check("x", value)


@pytest.mark.parametrize(
    ("value", "exact"),
    [
        ("0.1", Fraction(1, 10)),
        (" 1e-3 ", Fraction(1, 1000)),
        ("1/8", Fraction(1, 8)),
        ("-2.50", Fraction(-5, 2)),
        (0.1, Fraction(1, 10)),
        (np.float64(0.1), Fraction(1, 10)),
        (np.float32(0.1), Fraction(1, 10)),
        (3, Fraction(3)),
        (np.int64(3), Fraction(3)),
        (Fraction(1, 3), Fraction(1, 3)),
        ("0", Fraction(0)),
        ("1e-400", Fraction(0)),
        ("-1e-999999999", Fraction(0)),
    ],
)
def test_number_is_exact(value, exact):
    assert checks.number("step", value) == exact


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_number_of_a_float_is_its_shortest_decimal(value):
    exact = checks.number("step", value)
    assert float(exact) == value
    assert exact == checks.number("step", repr(value)) == Fraction(repr(value))


def test_double_and_number_read_the_same_texts():
    assert [checks.double(text) for text in ("1", " -2.5e3 ", "\t.5", "1e999")] == [1, -2500, 0.5, math.inf]
    unread = ("", "x", "1_0", "1e1_0", "٣", "1/8", "0x10", "nan")
    assert [text for text in unread if not math.isnan(checks.double(text))] == []


def test_whole_reads_digits_alone():
    assert [checks.whole("word", text) for text in ("16", " 16 ", "-3", "+007")] == [16, 16, -3, 7]
    for text in ("", "x", "1_0", "٣", "1.0", "1e3", "0x10", "1 2"):
        with pytest.raises(InputError, match=rf"^word is {re.escape(repr(text))}; a whole number is needed$"):
            checks.whole("word", text)


@pytest.mark.parametrize("value", [1, 8, np.int32(3), np.uint8(2)])
def test_count(value):
    counted = checks.count("increments", value, largest=8)
    assert counted == value
    assert type(counted) is int


def test_count_without_limit():
    assert checks.count("record_every", 10**6) == 10**6


def test_multiple():
    assert checks.multiple("duration", Fraction(180), "step", Fraction("0.125")) == 1440
    assert checks.multiple("duration", Fraction("0.3"), "step", Fraction("0.1")) == 3


def test_real_array_avoids_copies():
    given_ = np.ones((4, 3))
    assert checks.real_array("increments", given_, (3,)) is given_
    assert checks.real_array("increments", [[0.5, 0.0, 1.0]], (3,)).dtype == np.float64
    assert checks.real_array("increments", np.ones((2, 3), np.float32), (3,)).dtype == np.float64
    assert checks.real_array("increments", np.ones((3, 2)).T, (3,)).flags.c_contiguous
    assert checks.real_array("time", 1.5, ()).shape == ()
    whole = checks.real_array("increments", [[1, 2, 3]], (3,))
    assert whole.dtype == np.float64 and whole.tolist() == [[1.0, 2.0, 3.0]]
    assert checks.real_array("increments", np.empty((0, 3)), (3,)).shape == (0, 3)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_array_that_is_not_finite_names_the_place(bad):
    values = np.zeros((5, 2, 3))
    values[3, 1, 2] = bad
    with pytest.raises(
        InputError, match=rf"^rate holds {bad} at index \(3, 1, 2\); finite numbers are needed$"
    ):
        checks.real_array("rate", values, (3,))


@pytest.mark.filterwarnings("error")
def test_large_numbers_whose_sum_overflows_are_allowed():
    values = np.full(3, 1e308)
    np.testing.assert_array_equal(checks.real_array("rate", values, (3,)), values)


@pytest.mark.filterwarnings("error")
def test_range_of_single_precision():
    with pytest.raises(InputError, match=r"^rate holds numbers beyond the range of float32$"):
        checks.real_array("rate", [1e39, 0.0, 0.0], (3,), np.float32)
    assert checks.real_array("rate", [1e38, 0.0, 0.0], (3,), np.float32).dtype == np.float32


def test_errors_have_the_python_types_too():
    assert issubclass(InputError, StrapgenError) and issubclass(InputError, ValueError)
    assert issubclass(InputTypeError, StrapgenError) and issubclass(InputTypeError, TypeError)


Z = np.zeros((3, 2, 3))


def test_a_short_list_is_whole_and_a_long_one_is_cut():
    few = [f"n{k}" for k in range(MOST_NAMES)]
    assert unknown("form", "x", few).endswith(f"allowed: {', '.join(few)}")
    many = [f"n{k}" for k in range(50)]
    assert unknown("method", "x", many).endswith("n6, n7 and 42 more; strapgen list methods shows all")
    assert some(few) == ", ".join(few)
    # Without a section of the list that shows them, a message is the only place for the names.
    assert unknown("form", "x", many).endswith("n48, n49")


@pytest.mark.parametrize(
    ("value", "meant"),
    [
        ("eulr", ["euler"]),
        ("Euler_Parameters", ["euler"]),
        ("DCM", ["dcm"]),
        ("rotation matrix", ["dcm"]),
        ("xyz", []),
    ],
)
def test_similar_names_are_suggested(value, meant):
    assert suggestions("algorithm", value, ["dcm", "euler", "cayley-klein"]) == meant


def test_synonym_leads_only_to_allowed_names():
    assert suggestions("backend", "fixed", ["c-fixed16", "numpy"]) == ["c-fixed16"]


def test_a_value_that_is_no_text_or_very_long_stays_on_one_line():
    assert "\n" not in unknown("backend", np.eye(3), ["c"])
    assert len(unknown("backend", "x" * 1000, ["c"])) < 150


CALLS = {
    "samples is 'a'; an array of numbers is needed": lambda: strapgen.gyro.pulses("a", 1),
    "samples has shape (3,); (..., N, K, 3) is needed": lambda: strapgen.gyro.pulses([1, 2, 3], 1),
    "samples is 'b'; an array of numbers": lambda: strapgen.gyro.windows("b", 1),
    "samples is 'c'; an array of numbers": lambda: strapgen.exact.propagate(
        strapgen.lower(strapgen.derive("euler")), "c"
    ),
    "path is None; the path of a file is needed": lambda: strapgen.read_rates(None, "rad/s"),
    "path is 4; the path of a file": lambda: strapgen.read_increments(4),
    "path is 5; the path of a file": lambda: strapgen.tableaux.read(5),
    "initial has shape (2,); (..., 4) is needed": lambda: strapgen.backend("euler").propagate(
        Z, initial=[1.0, 0.0]
    ),
    "record_every is array([[1., 0., 0.], [0., 1., 0.], [0., 0., 1.]]); a whole number": lambda: (
        strapgen.backend("dcm").propagate(Z, np.eye(3))
    ),
    "got 1 input; 2 are needed: state, transition": lambda: strapgen.evaluator("dcm-product")([1.0]),
    "got 0 inputs; 1 is needed: computed": lambda: strapgen.evaluator("dcm-orthonormalize")(),
    "max_rate_deg_s and step go together; step is missing": lambda: strapgen.Settings.of(max_rate_deg_s=1),
    "(max_rate_deg_s 1e+300, step 1)": lambda: strapgen.Settings.of(max_rate_deg_s=1e300, step=1),
    "method 'rk9' is not known (did you mean rk1, rk2 or rk3?)": lambda: strapgen.study.cases(methods="rk9"),
    "word is 70": lambda: strapgen.study.cases(words=70),
    "algorithm 'quaternion' is not known (did you mean euler?)": lambda: strapgen.choose("quaternion"),
}


@pytest.mark.parametrize("said", CALLS)
def test_python_is_answered_in_one_line_with_its_own_names(said):
    with pytest.raises(StrapgenError) as error:
        CALLS[said]()
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_study_takes_a_single_value_for_a_list_of_one():
    single = strapgen.study.cases(methods="rk4", words="16", carries="none", steps="0.125")
    assert single == strapgen.study.cases(methods=["rk4"], words=[16], carries=["none"], steps=["0.125"])


@cache
def arguments() -> dict[str, object]:
    """Return one argument of every stage, in what order they come, and what is none."""
    kernel = strapgen.derive("euler", method="rk1", increments=1)
    program = strapgen.lower(kernel)
    sources = strapgen.generate(program, "numpy")
    return {
        "name": "euler",
        "choice": strapgen.choose("euler", "rk1", 1),
        "object": strapgen.algorithm("euler", "rk1", 1),
        "kernel": kernel,
        "program": program,
        "fixed": strapgen.quantize(program),
        "sources": sources,
        "backend": strapgen.build(sources),
        "motion": strapgen.motion("constant", x_deg_s=1),
        "settings": strapgen.Settings(),
        "none": None,
        "number": 3,
        "array": np.zeros((2, 2)),
    }


STAGES = {
    "derive": lambda value: strapgen.derive(value),
    "lower": lambda value: strapgen.lower(value),
    "quantize": lambda value: strapgen.quantize(value),
    "generate": lambda value: strapgen.generate(value, "c"),
    "generate in fixed point": lambda value: strapgen.generate(value, "c-fixed"),
    "build": lambda value: strapgen.build(value),
    "backend": lambda value: strapgen.backend(value),
    "evaluator": lambda value: strapgen.evaluator(value),
    "simulate": lambda value: strapgen.simulate(value, arguments()["motion"], 1, 1),
    "simulate along": lambda value: strapgen.simulate(arguments()["backend"], value, 1, 1),
    "recording": lambda value: recording.propagate(value, None),
    "exact": lambda value: exact.propagate(value, np.zeros((1, 1, 3))),
    "compare": lambda value: strapgen.compare(value, backends=["numpy"], samples=np.zeros((1, 1, 3))),
    "choose": lambda value: strapgen.choose(value),
    "choose a step": lambda value: strapgen.choose_step(value),
    "check": lambda value: strapgen.check(value),
    "converge of": lambda value: strapgen.converge(value, steps=["1/2", "1/4"]),
    "unknowns of": lambda value: strapgen.unknowns.series(value, terms=1),
    "converge": lambda value: strapgen.converge(strapgen.choose("euler"), value, ["1/2", "1/4"], 1),
    "recording of": lambda value: recording.propagate(arguments()["backend"], value),
    "settings of compare": lambda value: strapgen.compare(
        "euler", backends=["numpy"], samples=np.zeros((1, 2, 3)), settings=value
    ),
    "settings": lambda value: strapgen.quantize(arguments()["program"], value),
    "settings of generate": lambda value: strapgen.generate(arguments()["program"], "c-fixed", value),
    "target": lambda value: strapgen.generate(arguments()["program"], value),
}

#: What each stage takes; everything else is a wrong pairing.
TAKEN = {
    "derive": {"name", "choice", "object"},
    "lower": {"kernel"},
    "quantize": {"program"},
    "generate": {"program", "fixed"},
    "generate in fixed point": {"program", "fixed"},
    "build": {"sources"},
    "backend": {"name", "choice", "object"},
    "evaluator": {"name", "choice", "object"},
    "simulate": {"backend"},
    "simulate along": {"motion"},
    "recording": {"backend"},
    "exact": {"program"},
    "compare": {"name", "choice", "object"},
    "choose": {"name", "choice", "object"},
    "choose a step": {"name", "choice", "object"},
    "check": {"name", "choice", "object"},
    "converge of": {"name", "choice", "object"},
    "unknowns of": {"name", "choice", "object"},
    "converge": {"motion", "none"},
    "recording of": set(),
    "settings of compare": {"settings", "none"},
    "settings": {"settings", "none"},
    "settings of generate": {"settings", "none"},
    "target": {"name"},
}

SAID = {
    ("lower", "name"): "lower takes a Kernel, not 'euler'; strapgen.derive('euler') makes one",
    ("lower", "program"): "lower takes a Kernel, not a Program; strapgen.generate takes it",
    ("lower", "none"): "lower takes a Kernel, not None; strapgen.derive makes one",
    ("lower", "array"): "lower takes a Kernel, not an ndarray; strapgen.derive makes one",
    ("derive", "kernel"): "derive takes a name or a path or a Choice, not a Kernel; strapgen.lower takes it",
    ("derive", "number"): "derive takes a name or a path or a Choice, not 3; strapgen list shows the names",
    ("quantize", "kernel"): "quantize takes a Program, not a Kernel; strapgen.lower(kernel) makes one",
    ("quantize", "fixed"): "quantize takes a Program, not a FixedProgram; strapgen.generate takes it",
    (
        "generate",
        "kernel",
    ): "generate takes a Program or a FixedProgram, not a Kernel; strapgen.lower(kernel) makes one",
    ("generate", "name"): "generate takes a Program or a FixedProgram, not 'euler'; "
    "strapgen.lower(strapgen.derive('euler')) makes one",
    (
        "generate",
        "sources",
    ): "generate takes a Program or a FixedProgram, not Sources; strapgen.build takes them",
    ("lower", "choice"): "lower takes a Kernel, not a Choice; strapgen.derive(choice) makes one",
    (
        "backend",
        "sources",
    ): "backend takes a name or a path or a Choice, not Sources; strapgen.build takes them",
    (
        "backend",
        "motion",
    ): "backend takes a name or a path or a Choice, not a Motion; strapgen.simulate takes it",
    ("evaluator", "program"): "evaluator takes a name or a Choice, not a Program; strapgen.generate takes it",
    ("build", "program"): "build takes Sources, not a Program; strapgen.generate(program, target) makes them",
    ("build", "kernel"): "build takes Sources, not a Kernel; "
    "strapgen.generate(strapgen.lower(kernel), target) makes them",
    ("build", "backend"): "build takes Sources, not a Backend; strapgen.simulate takes it",
    ("simulate", "name"): "simulate takes a Backend, not 'euler'; strapgen.backend('euler') makes one",
    ("simulate", "motion"): "simulate takes a Backend, not a Motion; strapgen.backend makes one",
    ("simulate", "sources"): "simulate takes a Backend, not Sources; strapgen.build(sources) makes one",
    (
        "simulate along",
        "name",
    ): "simulate takes a Motion, not 'euler'; strapgen.motion('euler', ...) makes one",
    ("settings", "number"): "settings is 3; strapgen.Settings is needed",
    ("target", "settings"): f"target is Settings; a name is needed: {some(strapgen.TARGETS)}",
}


def refusal(stage: str, argument: str) -> str:
    with pytest.raises(InputTypeError) as refused:
        STAGES[stage](arguments()[argument])
    return str(refused.value)


def test_wrong_wires_are_reported_in_one_line():
    said = {
        (stage, argument): refusal(stage, argument)
        for stage in STAGES
        for argument in arguments()
        if argument not in TAKEN[stage] | ({"name"} if stage == "target" else set())
    }
    assert len(said) >= 120
    assert {pair: text for pair, text in said.items() if "\n" in text or len(text) > 140} == {}
    assert {pair: said[pair] for pair in SAID} == SAID


def test_messages_name_calls_that_exist():
    tables = (checks._NEXT, checks._NAMED, checks._MAKERS, checks._TAKERS)
    names = [
        found for pair in re.findall(r"strapgen\.(\w+)|'(\w+)\(", str(tables)) for found in pair if found
    ]
    assert {"derive", "lower", "generate", "build", "backend", "motion", "choose", "Settings"} <= set(names)
    assert not set(names) - set(dir(strapgen))
    classes = [
        *checks._NEXT,
        *checks._MAKERS,
        *checks._TAKERS,
        *(made for _, made in checks._NEXT.values()),
    ]
    assert not {name for name in classes if name != "str"} - set(dir(strapgen))


def test_accepted_arguments_are_not_refused():
    for stage in (
        "derive",
        "lower",
        "quantize",
        "generate in fixed point",
        "build",
        "simulate",
        "exact",
        "settings",
    ):
        for argument in TAKEN[stage]:
            STAGES[stage](arguments()[argument])


def test_a_long_name_is_shortened():
    assert len(str(refusal("lower", "name"))) < 100
    with pytest.raises(InputTypeError, match=r"^lower takes a Kernel, not 'eu.*\.\.\.") as refused:
        strapgen.lower("euler\n" * 1000)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("two", [2, 2.0, np.int8(2), np.float32(2), np.uint64(2), Fraction(2)])
def test_a_whole_number_is_a_count_whatever_its_type(two):
    assert type(checks.count("x", two)) is int and checks.count("x", two) == 2
    assert strapgen.algorithm("euler", "rk4", two) == strapgen.algorithm("euler", "rk4", 2)
    turn = np.full((8, 2, 3), 0.01)
    backend = strapgen.backend("euler", increments=two, previous=None)
    np.testing.assert_array_equal(
        backend.propagate(turn, record_every=two, orthonormalize_every=two, jobs=two),
        backend.propagate(turn, record_every=2, orthonormalize_every=2),
    )
    assert strapgen.gyro.windows(turn[:, 0], two).shape == (4, 2, 3)
    settings = strapgen.Settings(word=8 * two)
    assert settings == strapgen.Settings(word=16) and type(settings.word) is int
    assert strapgen.unknowns.series("dcm", terms=two) == strapgen.unknowns.series("dcm", terms=2)
