"""The functions on which every step in fixed point rests: product, narrowing, shift and range check of a file."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from cffi import FFI
from hypothesis import given
from hypothesis import strategies as st

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.ir.fixed_settings import Settings

#: The product has a second form for processors that multiply words to words alone.
PROCESSORS = {"any": [], "armv6-m": ["-D__ARM_ARCH_6M__"]}
WORDS = (16, 32)


def exported(text: str, name: str) -> str:
    """Return a source with functions that call its static ones."""
    word = 16 if "int16_t state" in text else 32
    kinds = {
        "out": f"int{word}_t",
        "mul": f"int{word}_t",
        "fit": f"int{2 * word}_t",
        "shr": f"int{2 * word}_t",
    }
    lines = [text]
    for helper, kind in kinds.items():
        (result,) = re.findall(rf"^static inline (\w+) {name}_{helper}\(", text, flags=re.MULTILINE)[:1]
        second = "int" if helper in ("fit", "shr") else kind
        lines.append(f"{result} {helper}({kind} x, {second} y) {{ return {name}_{helper}(x, y); }}")
    return "\n".join(lines)


@pytest.fixture(scope="module", params=[(word, processor) for word in WORDS for processor in PROCESSORS])
def arithmetic(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    word, processor = request.param
    folder: Path = tmp_path_factory.mktemp("arithmetic")
    sources = pipeline.compile(choose("euler", "rk4"), "c-fixed", Settings(word))
    name = sources.function.name
    for file, text in sources.step_files.items():
        (folder / file).write_text(exported(text, name) if file.endswith(".c") else text)
    command = [
        "cc",
        "-std=c99",
        "-O1",
        "-shared",
        "-fPIC",
        *PROCESSORS[processor],
        f"{name}.c",
        "-o",
        "its.so",
    ]
    subprocess.run(command, cwd=folder, check=True)
    ffi = FFI()
    ffi.cdef(
        f"int out(int{word}_t, int{word}_t); int{2 * word}_t mul(int{word}_t, int{word}_t);"
        f"int{word}_t fit(int{2 * word}_t, int); int{2 * word}_t shr(int{2 * word}_t, int);"
    )
    return SimpleNamespace(lib=ffi.dlopen(str(folder / "its.so")), word=word, keep=ffi)


def signed(word: int, least: int | None = None) -> st.SearchStrategy[int]:
    """Return numbers of a word, those near powers of two more often than others."""
    top = 1 << (word - 1)
    near = st.builds(
        lambda sign, power, offset: max(-top, min(top - 1, sign * (1 << power) + offset)),
        st.sampled_from((-1, 1)),
        st.integers(0, word - 1),
        st.integers(-2, 2),
    )
    return near | st.integers(-top if least is None else least, top - 1)


@pytest.mark.long
@given(data=st.data())
def test_a_product_is_exact(arithmetic, data):
    a, b = (data.draw(signed(arithmetic.word)) for _ in range(2))
    assert arithmetic.lib.mul(a, b) == a * b


@given(data=st.data())
def test_narrowing_and_shifts_round_down(arithmetic, data):
    x, word = data.draw(signed(2 * arithmetic.word)), arithmetic.word
    shift = data.draw(st.integers(0, 2 * word - 1))
    assert arithmetic.lib.shr(x, shift) == x >> shift
    if -(1 << (word - 1)) <= x >> shift < 1 << (word - 1):  # what the proof of the ranges shows
        assert arithmetic.lib.fit(x, shift) == x >> shift


@pytest.mark.long
@given(data=st.data())
def test_a_number_is_out_if_it_is_larger_than_the_limit(arithmetic, data):
    x, limit = data.draw(signed(arithmetic.word)), data.draw(signed(arithmetic.word, 0).map(abs))
    limit = min(limit, (1 << (arithmetic.word - 1)) - 1)
    assert arithmetic.lib.out(x, limit) == (abs(x) > limit)
