"""Generated C and C++ as MSVC reads them: no attribute that it has not, and words of 64 bits refused in one line."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.ir.fixed_settings import Settings

#: What MSVC has not: with these definitions the use of it is an error.
ABSENT = ("__attribute__(x)", "__extension__", "__int128", "__builtin_prefetch", "__builtin_cpu_supports")
#: Clang's likeness of MSVC.
MSVC = [
    "--target=x86_64-pc-windows-msvc",
    *("-fms-compatibility", "-fms-extensions", "-fms-compatibility-version=19.30", "-U__SIZEOF_INT128__"),
    *("-nostdlibinc", "-isystem", "system", "-fsyntax-only", "-Wall", "-Wextra", "-Werror"),
    *(f"-D{name}=no_word_of_msvc" for name in ABSENT),
]
#: Its headers, as far as generated code takes anything from them.
HEADERS = {
    "math.h": "".join(f"double {n}(double); float {n}f(float);\n" for n in ("sqrt", "fabs", "sin", "cos"))
    + "double fmax(double, double); float fmaxf(float, float); double atan2(double, double);\n"
    "float atan2f(float, float);\n",
    "cstdint": "#include <stdint.h>\nnamespace std { using ::int16_t; using ::int32_t; using ::int64_t;\n"
    "using ::uint16_t; using ::uint32_t; using ::uint64_t; }\n",
    "cfloat": "#include <float.h>\n",
    "cmath": "namespace std { double sqrt(double); }\n",
    "array": "#include <stddef.h>\nnamespace std { template <class T, size_t N> struct array {\n"
    "T words[N]; constexpr T &operator[](size_t k) { return words[k]; }\n"
    "constexpr const T &operator[](size_t k) const { return words[k]; } }; }\n",
}


def read_by_msvc(folder: Path, target: str, word: int | None = None) -> str:
    """Return what the compiler says of the step of Euler parameters with its runs; "" if nothing."""
    sources = pipeline.compile(
        choose("euler", "rk4", 2), target, None if word is None else Settings(word=word)
    )
    for name, text in HEADERS.items():
        (folder / "system").mkdir(exist_ok=True)
        (folder / "system" / name).write_text(text)
    for name, text in sources.files.items():
        (folder / name).write_text(text)
    language = ["-std=c++14", "-x", "c++"] if target.startswith("cpp") else ["-std=c11", "-x", "c"]
    parts = [name for name in sources.files if name.endswith((".c", ".hpp"))]
    assert parts
    (folder / "main.cpp").write_text("".join(f'#include "{name}"\n' for name in parts))
    parts = ["main.cpp"] if target.startswith("cpp") else parts  # a header is not compiled by itself
    done = subprocess.run(
        ["clang", *MSVC, *language, *parts], cwd=folder, capture_output=True, text=True, check=False
    )
    assert bool(done.returncode) == ("error" in done.stderr)
    return done.stderr


@pytest.mark.needs("clang")
@pytest.mark.parametrize(
    ("target", "word"),
    [("c", None), ("c-float", None), ("c-fixed", 16), ("c-fixed", 32), ("cpp", None), ("cpp-fixed", 32)],
)
def test_msvc_has_nothing_to_say(target, word, tmp_path):
    assert read_by_msvc(tmp_path, target, word) == ""


@pytest.mark.needs("clang")
@pytest.mark.parametrize("target", ["c-fixed", "cpp-fixed"])
def test_words_of_64_bits_are_refused_by_a_line_of_the_source(target, tmp_path):
    assert "words of 64 bits need a compiler with 128-bit products" in read_by_msvc(tmp_path, target, 64)
