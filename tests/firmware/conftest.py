"""Checks functions in C or C++ that are given as text."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from strapgen.firmware.check_code.check_foreign import check_foreign
from strapgen.firmware.check_code.foreign import Convention, ForeignStep
from strapgen.firmware.check_code.foreign_arguments import ForeignSource, read_arguments


@pytest.fixture
def outcome(tmp_path: Path):
    """Check a function; its step is `step` unless told otherwise."""

    def check(text: str, arguments: str, convention=Convention(), file="a.c", name="step", init="", **more):  # noqa: B008
        (tmp_path / file).write_text(text)
        source = ForeignSource(
            tmp_path / file, name, read_arguments(arguments), init, more.pop("precision", "double")
        )
        if "sample_hz" in more:
            more["interval"] = 1 / Fraction(more.pop("sample_hz"))
        return check_foreign(ForeignStep(source, convention, **more))

    return check
