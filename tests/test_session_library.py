"""The forecasts of the modules that tests compile: a line that cannot be read costs time and fails no other test."""

from __future__ import annotations

import json

import pytest
import session_library
from session_library import choice_by_name, line, settings_of

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.ir.fixed_settings import Settings
from strapgen.targets import TARGETS


@pytest.mark.parametrize("which", session_library.FORECASTS)
def test_every_line_of_a_forecast_can_be_read(which):
    for text in session_library.FORECASTS[which].read_text().splitlines():
        kernel, target, stated = json.loads(text)
        settings = settings_of(stated)
        assert choice_by_name(kernel) is not None, text
        assert TARGETS[target].language in ("C", "C++", "Rust"), text
        assert (settings is not None) == TARGETS[target].fixed, text


@pytest.mark.parametrize(
    ("target", "settings"),
    [
        ("c", None),
        ("c-fixed", Settings()),
        ("c-fixed", Settings(word=16, carry="full").fitted(1 / 16)),
    ],
)
def test_a_line_leads_to_the_sources_that_it_was_written_for(target, settings):
    sources = pipeline.compile(choose("euler", "rk1", 1), target, settings)
    text = line(sources)
    again = session_library.sources_of(json.loads(text))
    assert again.files == sources.files
    assert settings is None or settings_of(json.loads(text)[2]) == sources.fixed.settings
