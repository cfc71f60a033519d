"""The text that says what a user's function takes: all forms that C has for it, and one line for what is wrong."""

from __future__ import annotations

import pytest

from strapgen.firmware.check_code.foreign_arguments import is_foreign, read_arguments
from strapgen.ir.exceptions import InputError


@pytest.mark.parametrize(
    ("text", "names", "count", "elements"),
    [
        ("state[4], increments[2][3] -> next[4]", "state increments next", 2, 4),
        ("state[4],increments[6]->next[4]", "state increments next", 2, 4),
        ("next[4] <- state[4], increments[3]", "next state increments", 1, 4),
        ("state[3][3], rates[ 1 ][ 3 ], dt -> state[3][3]", "state rates dt", 1, 9),
        ("dt, state[9], rates[4][3] -> state[9]", "dt state rates", 4, 9),
        ("filter_t *filter, rates[3], step -> filter.attitude.q[4]", "filter rates step", 1, 4),
        ("struct filter *f, increments[3] -> next[4]", "f increments next", 1, 4),
        ("nav::Filter &f, increments[3] -> f.q[4]", "f increments", 1, 4),
        ("rates[3], dt -> global q[4]", "rates dt", 1, 4),
        ("increments[4][3] -> rotation[3]", "increments rotation", 4, 3),
        ("state[4], previous[2][3], increments[3] -> next[4]", "state previous increments next", 1, 4),
    ],
)
def test_arguments_are_read_in_the_order_of_c(text, names, count, elements):
    arguments = read_arguments(text)
    assert [argument.name for argument in arguments.parameters] == names.split()
    assert (arguments.count, arguments.elements) == (count, elements)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("state[4], increments[3]", "has no single arrow; 'state.*next.4.' is an example"),
        ("state[4] -> increments[3] -> next[4]", "has no single arrow"),
        (
            "state[4], gyro[3] -> next[4]",
            "'gyro.3.' is not known; allowed: state.4. or state.3..3., increments",
        ),
        ("state[5], increments[3] -> next[5]", "has another shape"),
        (
            "state[4], increments[4] -> next[4]",
            r"increments has the shape \[4\]; \[3\], \[K\]\[3\] or",
        ),
        ("state[4], increments[9][3] -> next[4]", "with K from 1 to 8"),
        (
            "state[4], previous[4][3], increments[3] -> next[4]",
            "previous has the shape .* with K from 1 to 3",
        ),
        ("state[4], increments[3], dt[2] -> next[4]", r"'dt\[2\]' has another shape"),
        ("state[4], increments(3) -> next[4]", "cannot be read"),
        ("state[4], increments[3], increments[3] -> next[4]", "name one thing twice"),
        ("a *b, c *d, increments[3] -> next[4]", "name one thing twice"),
        ("state[4], dt -> next[4]", "lack the samples"),
        ("increments[3], rates[3] -> next[4]", "lack the samples"),
        ("increments[3] -> state[4]", "stands behind the arrow alone"),
        ("state[4], increments[3] -> next[3][3]", "state has 4 numbers .* the result 9"),
        ("state[9], increments[3] -> state[3][3]", "they must agree"),
        ("increments[3] -> filter.q[4]", "the result 'filter.q.4.' is not known; allowed: next"),
        ("increments[3] -> next[3]", r"has another shape; allowed: \[4\], \[9\], \[3\]\[3\], or"),
        ("increments[3] -> next[4], dt", "cannot be read"),
    ],
)
def test_what_cannot_be_called_gets_one_line(text, says):
    with pytest.raises(InputError, match=says) as caught:
        read_arguments(text)
    assert "\n" not in str(caught.value) and "--arguments" in str(caught.value)


def test_suffixes_of_c_and_cpp():
    assert all(
        is_foreign(f"a{suffix}") for suffix in (".c", ".C", ".cc", ".cpp", ".cxx", ".C++", ".c++", ".CPP")
    )
    assert not any(is_foreign(name) for name in ("euler", "a.h", "a.py", "a.toml", "c", ".c/none"))
