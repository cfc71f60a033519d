"""The loop over runs in C of an algorithm in two speeds: what it refuses, and that it then writes nothing."""

from __future__ import annotations

import re

import pytest

from strapgen.navigation.two_speed import two_speed_sources
from strapgen.run import compiler


@pytest.mark.parametrize("counts", [(1, 0, 3), (1, 3, 0), (1, 0, 0)], ids=["slow", "fast", "both"])
@pytest.mark.parametrize("target", ["c", "c-fixed"])
def test_run_without_cycles_in_a_loop_is_refused(target, counts):
    sources = two_speed_sources.sources("dcm", target=target)
    module = compiler.load(sources)
    name = next(file for file in sources.files if file.endswith(".h")).removesuffix(".h")
    header = next(text for file, text in sources.files.items() if file == f"{name}_runs.h")
    prototype = " ".join(re.search(rf"int {name}_run\((.*?)\);", header, re.DOTALL)[1].split())
    pointers = prototype.split(",")[3:]
    memory = module.ffi.new(f"{name}_memory *")
    before = bytes(module.ffi.buffer(memory))
    arrays = [module.ffi.new(f"{text.split()[-2]}[64]") for text in pointers[1:]]
    run = getattr(module.lib, f"{name}_run")
    assert run(*counts, memory, *arrays) == 4
    assert bytes(module.ffi.buffer(memory)) == before
    assert all(set(bytes(module.ffi.buffer(array))) == {0} for array in arrays)
