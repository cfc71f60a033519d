"""The size of compiled code: measured once for each content and compiler, and never that of another one."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from strapgen import pipeline
from strapgen.lab import cost


@pytest.fixture(autouse=True)
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(tmp_path / "cache"))


@pytest.mark.long
def test_the_cache_keeps_the_size_of_each_code(monkeypatch):
    small, large = (
        pipeline.generate(pipeline.lower(pipeline.derive(kernel)), "c")
        for kernel in ("euler-normalize", "euler-product")
    )
    sizes = [cost.code_size(sources) for sources in (small, large)]
    assert None not in sizes and sizes[0] != sizes[1]

    def never(*_: object) -> None:
        raise AssertionError("measured again")

    monkeypatch.setattr(cost, "_measured_size", never)
    assert [cost.code_size(sources) for sources in (small, large)] == sizes


def test_a_compiler_that_fails_leaves_nothing_in_the_cache(tmp_path, monkeypatch):
    sources = pipeline.generate(pipeline.lower(pipeline.derive("euler-normalize")), "c")
    failing = tmp_path / "failing-cc"
    failing.write_text(f'#!/bin/sh\ntest -e {tmp_path}/works || exit 1\nexec cc "$@"\n')
    failing.chmod(0o755)
    monkeypatch.setenv("CC", os.fspath(failing))
    assert cost.code_size(sources) is None
    (tmp_path / "works").touch()
    assert cost.code_size(sources) > 0
