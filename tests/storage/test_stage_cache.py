"""Generated sources by name: never out of step, and quick the second time."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import strapgen
from strapgen import catalogue, pipeline
from strapgen.ir.fixed_settings import Settings
from strapgen.run import compiler
from strapgen.storage import cache

#: Runs with flags of the compiler.
RUN = """
import sys
import numpy as np
import strapgen
from strapgen.run import compiler
compiler.OPTIMIZATION['C'] = sys.argv[1]
for backend in ("numpy", "c"):
    strapgen.backend("euler", "rk1", 2, backend).propagate(np.zeros((4, 2, 3)))
print(*sorted({"sympy", "jinja2", "cffi"} & set(sys.modules)))
"""


def test_a_second_use_loads_neither_sympy_nor_jinja_nor_a_compiler():
    for backend in ("numpy", "c"):
        strapgen.backend("euler", "rk1", 2, backend).propagate(np.zeros((4, 2, 3)))
    command = [sys.executable, "-c", RUN, compiler.OPTIMIZATION["C"]]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip() == ""


def test_sources_are_those_of_the_pipeline():
    choice = catalogue.choose("euler", "rk1", 3)
    program = strapgen.lower(catalogue.derive(choice))
    for target in strapgen.targets.TARGETS:
        assert pipeline.compile(choice, target) == strapgen.generate(program, target)


def test_all_calls_share_sources_that_cannot_be_written():
    sources = pipeline.compile(catalogue.choose("euler-product"), "numpy")
    assert pipeline.compile(catalogue.choose("euler-product"), "numpy") is sources
    for shared in (sources.files, sources.operations):
        with pytest.raises(TypeError, match="cannot be written"):
            shared.clear()


def test_sources_that_this_process_has_had_are_not_read_again(monkeypatch):
    choice = catalogue.choose("euler-product")
    first = pipeline.compile(choice, "numpy"), pipeline.fixed_program(choice)
    monkeypatch.setattr(cache, "entry", None)
    assert (pipeline.compile(choice, "numpy"), pipeline.fixed_program(choice)) == first


def test_process_keeps_the_last_used_entries(monkeypatch, tmp_path):
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(cache, "_results", {})
    monkeypatch.setattr(cache, "_MOST_RESULTS", 2)
    stored, asked = cache.stored, []

    def noted(kind, parts, work, what):
        asked.extend(parts)
        return stored(kind, parts, work, what)

    monkeypatch.setattr(cache, "stored", noted)
    for key in ("a", "b", "a", "c", "a", "b"):
        assert cache._load("kind", [key], "", lambda key=key: key) == key
    assert asked == ["a", "b", "c", "b"]


def test_a_change_of_the_generator_makes_new_sources(monkeypatch, tmp_path):
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(tmp_path))
    choice = catalogue.choose("euler-normalize")
    pipeline.compile(choice, "numpy")
    pipeline.compile(choice, "numpy")
    assert len(list((tmp_path / "sources").iterdir())) == 1
    monkeypatch.setattr(cache, "generator_digest", lambda: "another generator")
    pipeline.compile(choice, "numpy")
    assert len(list((tmp_path / "sources").iterdir())) == 2


def test_another_target_and_other_settings_derive_nothing_again(monkeypatch, tmp_path):
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(tmp_path))
    choice = catalogue.choose("euler-product")
    wanted = strapgen.lower(catalogue.derive(choice))
    pipeline.compile(choice, "numpy")
    monkeypatch.setattr(cache, "_results", {})  # as another process

    def never(_choice):
        raise AssertionError("derived again")

    monkeypatch.setattr(pipeline, "derive", never)
    settings = strapgen.Settings(16)
    assert pipeline.compile(choice, "c-fixed", settings) == strapgen.generate(wanted, "c-fixed", settings)
    assert pipeline.program(choice) == wanted


def test_the_integer_model_takes_the_integers_of_the_c(monkeypatch, tmp_path):
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(tmp_path))
    choice = catalogue.choose("euler-normalize")
    compiled = pipeline.compile(choice, "c-fixed", Settings())

    def never(*_):
        raise AssertionError("quantized again")

    with monkeypatch.context() as patch:
        patch.setattr(pipeline, "quantize", never)
        model = pipeline.compile(choice, "fixed-model", Settings())
    assert model.fixed == compiled.fixed
    others = Settings(word=16)
    assert pipeline.fixed_program(choice, others) == pipeline.quantize(pipeline.program(choice), others)
