"""Many kernels in one module: names carry their kernel's, so that all files make one translation unit."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from itertools import product
from pathlib import Path

import pytest

from strapgen import catalogue, pipeline
from strapgen.catalogue import Choice
from strapgen.catalogue.names import KERNELS
from strapgen.ir.fixed_settings import Settings
from strapgen.storage import resources
from strapgen.targets.names import external

#: The folders of generated/ with the ending of their names.
FOLDERS = {"c": "", "c_float": "_float", "c_fixed": "_w32"}


def files(folder: str) -> list[Path]:
    paths = sorted((resources.folder("generated") / folder).glob("*.c"))
    assert len(paths) > 30
    return paths


def names_of_the_file(text: str) -> set[str]:
    """Return the names that a C source defines for itself: static functions, constants and types."""
    code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    both = code.count(
        "__attribute__((noinline))"
    )  # a product has a form for some processors, and one for all others
    code = code.replace("__attribute__((noinline)) ", "")
    static = list(dict.fromkeys(re.findall(r"^static [^;{=]*?(\w+)\s*\(", code, re.MULTILINE)))
    assert len(static) == len(re.findall(r"\bstatic\b", code)) - both
    constants = [
        name for body in re.findall(r"\benum\s*\{(.*?)\}", code) for name in re.findall(r"[A-Za-z_]\w*", body)
    ]
    return {*static, *constants, *re.findall(r"\btypedef\b[^;]*?(\w+);", code)}


def recurring(texts: Iterable[str]) -> list[str]:
    counts = Counter(name for text in texts for name in names_of_the_file(text))
    assert counts
    return [name for name, count in counts.items() if count > 1]


def test_no_static_name_recurs_in_two_files():
    texts = [path.read_text() for folder in FOLDERS for path in files(folder)]
    for word in (16, 64):  # words of 64 bits bring types of their own
        for kernel in ("euler-product", "euler-normalize", "euler-from-dcm"):
            sources = pipeline.compile(Choice(kernel), "c-fixed", Settings(word=word))
            texts += [text for name, text in sources.files.items() if name.endswith(".c")]
    assert recurring(texts) == []
    fixed = files("c_fixed")[0].read_text()
    assert recurring([fixed, fixed])


@pytest.mark.parametrize("folder", FOLDERS)
def test_static_names_begin_with_the_name_of_their_kernel(folder):
    for path in files(folder):
        names = names_of_the_file(path.read_text())
        assert [name for name in names if not name.lower().startswith(f"{path.stem}_")] == []


def external_names(kernel: str, ending: str) -> list[str]:
    name = external(kernel.replace("-", "_"), ending)
    return [name, *(f"{name}_{what}" for what in ("array", "batch", "propagate"))]


def test_external_names_of_the_catalogue_differ_in_the_31_characters_that_c99_promises():
    kernels = dict.fromkeys([*KERNELS, *(choice.kernel for choice in catalogue.standard())])
    names = [
        name
        for pair in product(kernels, ("", "_float", "_w16", "_w32", "_w64"))
        for name in external_names(*pair)
    ]
    assert len(names) == len(set(names))
    assert [start for start, count in Counter(name[:31] for name in names).items() if count > 1] == []


def test_a_kernel_of_a_user_s_that_has_the_short_name_of_another_is_told_apart():
    catalogued = [kernel.replace("-", "_") for kernel in KERNELS]
    shortened = [external(name) for name in catalogued if external(name) != name]
    assert "dcm_orth_optimal" in shortened
    assert {external(name) for name in shortened}.isdisjoint(shortened)
    long = ("orthonormalize", "orth")
    users = [f"of_a_user_{first}_then_{second}" for first, second in product(long, long)]
    assert len({external(name).lower() for name in users}) == 4


def test_names_that_fit_are_not_shortened():
    assert external("mrp_norm") == "mrp_norm"
    assert external("dcm_orthonormalize") == "dcm_orthonormalize"
    assert external("cayley_klein_normalize", "_w32") == "cayley_klein_normalize_w32"
    assert external("normalizer_of_twenty_four") == "normalizer_of_twenty_four"
