"""Generated numpy functions on work arrays, and scans over them, have the bits of the functions themselves."""

from __future__ import annotations

import numpy as np
import pytest

import strapgen
from strapgen.run import numpy_evaluator
from strapgen.run.numpy_evaluator import ArrayProgram, work_arrays

#: Sums and products, divisions, a root, an output that is an input, and conditions, with which a function runs whole.
KERNELS = {
    "euler-product": True,
    "dcm-orthonormalize": True,
    "euler-normalize": True,
    "euler-from-cayley-klein": True,
    "euler-from-dcm": False,
}
PLACES = (3, 50)


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_program_has_the_bits_of_its_function(kernel, rng):
    evaluator = strapgen.evaluator(kernel, "numpy")
    shapes = [signal.shape for signal in evaluator.function.inputs]
    inputs = [rng.normal(size=(*PLACES, *shape)) for shape in shapes]
    program = ArrayProgram(evaluator.generated, shapes)
    expected = evaluator.generated(*inputs).reshape(*PLACES, -1)
    first = [np.moveaxis(x.reshape(*PLACES, -1), -1, 0) for x in inputs]
    out = np.empty((expected.shape[-1], *PLACES))
    work = work_arrays(program.temporaries, out[0].size)[:, : out[0].size].reshape(-1, *PLACES)
    work.fill(np.nan)
    program(first, out, work)
    assert np.moveaxis(out, 0, -1).tobytes() == expected.tobytes()
    assert (program._operations != program._whole) == KERNELS[kernel]


def test_work_arrays_serve_again_and_begin_a_line():
    backend = strapgen.backend("euler", backend="numpy")
    transition = backend.evaluator._transition
    assert 0 < transition.temporaries < backend.sources.operations["multiply"] / 2
    assert {row.ctypes.data % 64 for row in work_arrays(5, 13)} == {0}


@pytest.mark.parametrize(("runs", "steps"), [(1, 1003), (7, 64), (90, 5)])
@pytest.mark.parametrize("every", [None, 10])
def test_the_bits_of_a_scan_do_not_depend_on_how_many_samples_go_together(
    monkeypatch, rng, runs, steps, every
):
    backend = strapgen.backend("euler", backend="numpy")
    increments = rng.normal(scale=0.05, size=(runs, steps, 2, 3))
    monkeypatch.setattr(numpy_evaluator, "_WIDTH", 60)
    whole = backend.propagate(increments, orthonormalize_every=every)
    for samples in (1, 50, 200):
        monkeypatch.setattr(numpy_evaluator, "_PASS", samples)
        assert backend.propagate(increments, orthonormalize_every=every).tobytes() == whole.tobytes()
