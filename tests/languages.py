"""What the tests of the targets in C++ and Rust share."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from strapgen.backends import of_sources
from strapgen.catalogue import Choice
from strapgen.ir.sources import Sources
from strapgen.library import generated_sources
from strapgen.toolchain import compiler

#: Kernels with every kind of operation that code in floating point has, with scalar inputs and with several outputs.
DOUBLE = [
    ("euler",),
    ("dcm-orthonormalize",),
    ("euler-from-dcm",),
    ("euler-angles-from-dcm",),
    ("coning-truth",),
]
#: Samples of a comparison.
SAMPLES = 40


def check_bits_of_c(choices: Iterable[Choice], target: str, c: str, rng: np.random.Generator) -> None:
    """Check that kernels return on a target, as one library, the very bits that C returns."""
    choices = list(choices)
    compiled, other = (
        [generated_sources.sources(choice, name) for choice in choices] for name in (target, c)
    )
    compiler.compile_together(compiled)
    compiler.compile_together(other)
    differing = []
    for one, reference in zip(compiled, other, strict=True):
        samples = [
            rng.uniform(-0.3, 0.3, (SAMPLES, *s.shape)).astype(of_sources(one).dtype)
            for s in one.function.inputs
        ]
        results = [of_sources(sources).evaluate(samples, (SAMPLES,)) for sources in (one, reference)]
        same = all(a.tobytes() == b.tobytes() for a, b in zip(*results, strict=True))
        differing += [] if same else [one.kernel]
    assert choices
    assert not differing


def check_lines(sources: Sources) -> None:
    """Check that no line of generated text is long."""
    long = [
        f"{name}:{number}"
        for name, text in sources.files.items()
        for number, line in enumerate(text.splitlines(), 1)
        if len(line) > 99
    ]
    assert not long
