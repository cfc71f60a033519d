"""What tests on several back ends and targets share."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

from strapgen.ir.sources import Sources
from strapgen.run.backends import BACKENDS
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


def check_lines(sources: Sources) -> None:
    """Check that no line of generated text is long."""
    long = [
        f"{name}:{number}"
        for name, text in sources.files.items()
        for number, line in enumerate(text.splitlines(), 1)
        if len(line) > 99
    ]
    assert not long
