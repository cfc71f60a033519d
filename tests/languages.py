"""What tests on several back ends and targets share."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.run import compiler
from strapgen.run.backends import BACKENDS, of_sources
from strapgen.run.evaluators import Evaluator
from strapgen.targets import BUILT_IN

#: Back ends in other languages than Python and C, and what each needs. They have the bits of C, which tests/targets
#: holds of every kernel and tests/run of the back ends themselves.
OTHERS = {
    name: {"C++": "c++", "Rust": "rustc", "MATLAB": "octave-cli"}[BUILT_IN[entry.target].language]
    for name, entry in BACKENDS.items()
    if entry.target in BUILT_IN and BUILT_IN[entry.target].language not in ("Python", "C")
}
#: Short words have the code of long ones, C in float that of double, and the integer model gives the bits of the C.
MORE_OF_THE_SAME = ("c-float", "c-fixed16", "fixed-model")


def cases(names: Iterable[str]) -> list[Any]:
    """Return back ends as values of a parameter: the quick tests have those that differ most."""
    return [
        pytest.param(
            name,
            marks=[
                *([pytest.mark.long] if name in (*OTHERS, *MORE_OF_THE_SAME) else []),
                *([pytest.mark.needs(OTHERS[name])] if name in OTHERS else []),
            ],
        )
        for name in names
    ]


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
    compiled, other = ([pipeline.compile(choice, name) for choice in choices] for name in (target, c))
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


def check_integers_of_c(
    choices: Iterable[Choice], target: str, settings: Settings, rng: np.random.Generator
) -> None:
    """Check that kernels return on a target the integers and the residuals of C, or refuse the same samples."""
    both = [[pipeline.compile(choice, name, settings) for name in (target, "c-fixed")] for choice in choices]
    compiler.compile_together(sources for pair in both for sources in pair)
    pairs = [[of_sources(sources) for sources in pair] for pair in both]
    accepted = 0
    for evaluators in pairs:
        ranges = [(a.low, a.high, a.signal.size) for a in evaluators[0].interface.inputs]
        samples = [
            [rng.integers(low, high, size=(1, size)) for low, high, size in ranges] for _ in range(SAMPLES)
        ]
        one, reference = ([_answer(evaluator, sample) for sample in samples] for evaluator in evaluators)
        assert one == reference, evaluators[0].kernel
        accepted += sum(isinstance(answer, bytes) for answer in one)
    assert accepted > SAMPLES * len(pairs) / 4


def _answer(evaluator: Evaluator, sample: list[np.ndarray]) -> bytes | str:
    """Return what a function makes of a sample: its outputs and residuals, or why it refuses."""
    try:
        outputs, residuals = evaluator.run(sample, evaluator.fresh(1))
    except InputError as error:
        return str(error)
    return b"".join(array.tobytes() for array in (*outputs, residuals))
