"""Messages about names say in one line what was perhaps meant, and what is allowed."""

from __future__ import annotations

import numpy as np
import pytest

import strapgen
from strapgen.ir.checks import MOST_NAMES, some, suggestions, unknown
from strapgen.ir.exceptions import StrapgenError

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
def test_what_was_meant(value, meant):
    assert suggestions("algorithm", value, ["dcm", "euler", "cayley-klein"]) == meant


def test_a_synonym_leads_only_to_what_is_allowed():
    assert suggestions("backend", "fixed", ["c-fixed16", "numpy"]) == ["c-fixed16"]


def test_a_value_that_is_no_text_or_very_long_stays_on_one_line():
    assert "\n" not in unknown("backend", np.eye(3), ["c"])
    assert len(unknown("backend", "x" * 1000, ["c"])) < 150


CALLS = {
    "increments is 'a'; an array of numbers is needed": lambda: strapgen.gyro.pulses("a", 1),
    "increments has shape (3,); (..., N, K, 3) is needed": lambda: strapgen.gyro.pulses([1, 2, 3], 1),
    "increments is 'b'; an array of numbers": lambda: strapgen.gyro.windows("b", 1),
    "increments is 'c'; an array of numbers": lambda: strapgen.exact.propagate(
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
