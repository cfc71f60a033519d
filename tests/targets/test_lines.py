"""Lines of generated text are as long as they may be, and no longer."""

from __future__ import annotations

import pytest

from strapgen.targets.lines import fill_arguments, fill_definition, fill_expression


@pytest.mark.parametrize("fill", [fill_arguments, fill_expression])
def test_a_line_may_be_as_long_as_the_width(fill):
    text = "first, second, third"
    assert fill(text, "    ", len(text)) == text
    assert fill(text, "    ", len(text) - 1) == "first, second,\n    third"


@pytest.mark.parametrize("width", range(40, 60))
def test_no_line_of_a_macro_is_longer_than_the_width(width):
    values = ", ".join(f"{10**k}" for k in range(12))
    lines = fill_definition("NAME_OF_A_MACRO", f"{{{values}}}", "powers of ten", width).split("\n")
    assert lines[:2] == ["/* powers of ten */", "#define NAME_OF_A_MACRO \\"]
    assert max(map(len, lines)) <= width
    assert " ".join(line.strip(" \\") for line in lines[2:]) == f"{{{values}}}"
