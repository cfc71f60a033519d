"""Checks functions in C or C++ that are given as text."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from strapgen.firmware.check_code.bridge import read_source
from strapgen.firmware.check_code.check_foreign import check_foreign
from strapgen.firmware.check_code.foreign import Convention, ForeignStep


@pytest.fixture
def outcome(tmp_path: Path):
    """Check a function; its step is `step` unless told otherwise."""

    def check(text: str, arguments=None, convention=Convention(), file="a.c", name="step", init="", **more):  # noqa: B008
        (tmp_path / file).write_text(text)
        how = {key: more.pop(key) for key in ("cflags", "publishes", "sources") if key in more}
        source = read_source(
            *(tmp_path / file, name, arguments, init, more.pop("precision", None)),
            takes=more.get("takes", ""),
            is_angle_said="angle_unit" in more,
            **how,
        )
        more.setdefault("takes", "rates" if source.arguments.named("rates") else "increments")
        if "sample_hz" in more:
            more["interval"] = 1 / Fraction(more.pop("sample_hz"))
        return check_foreign(ForeignStep(source, convention, **more))

    return check
