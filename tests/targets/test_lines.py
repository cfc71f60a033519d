"""Lines of generated text are as long as they may be, and no longer."""

from __future__ import annotations

import pytest

from strapgen.targets.printer import fill, fill_arguments, fill_definition, fill_expression


@pytest.mark.parametrize("filled", [fill_arguments, fill_expression])
def test_a_line_may_be_as_long_as_the_width(filled):
    text = "first, second, third"
    assert filled(text, "    ", len(text)) == text
    assert filled(text, "    ", len(text) - 1) == "first, second,\n    third"


def test_prose_is_wrapped_at_spaces_and_written_with_single_spaces_for_ends_of_lines():
    text = "first second third"
    assert fill(text, "    ", len(text)) == fill(f"{text} ", "", len(text) + 1) == text
    assert fill(text, "    ", len(text) - 1) == "first second\n    third"
    assert fill("first\nsecond", "", 40) == "first second"
    assert fill("", "") == fill("  ", "") == ""


@pytest.mark.parametrize("width", range(40, 60))
def test_no_line_of_a_macro_is_longer_than_the_width(width):
    values = ", ".join(f"{10**k}" for k in range(12))
    lines = fill_definition("NAME_OF_A_MACRO", f"{{{values}}}", "powers of ten", width).split("\n")
    assert lines[:2] == ["/* powers of ten */", "#define NAME_OF_A_MACRO \\"]
    assert max(map(len, lines)) <= width
    assert " ".join(line.strip(" \\") for line in lines[2:]) == f"{{{values}}}"
