"""Many runs side by side, in vectors, threads and numpy scans: the bits of single runs and of single steps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import strapgen
from strapgen.ir.exceptions import InputError
from strapgen.run import numpy_evaluator
from strapgen.run.compiled_code import _parts
from strapgen.run.numpy_evaluator import ArrayProgram, work_arrays

#: Attitude, method and increments of steps whose transitions differ in all: Taylor, staged, windows, odd sizes.
STEPS = [
    ("euler", "rk4", 2),
    ("dcm", "rk4", 2),
    *(
        pytest.param(step, marks=pytest.mark.long)
        for step in (("cayley-klein", "rk2", 1), ("euler", "rk1", 3), ("dcm", "taylor5", 3))
    ),
]
TARGETS = ["c", "c-float"]


def runs_of(backend: Any, rng: np.random.Generator, runs: int, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Return increments of some runs and their starts, all different."""
    increments = rng.normal(scale=0.05, size=(runs, steps, backend.samples_per_step, 3)).astype(backend.dtype)
    first = rng.normal(scale=0.5, size=(runs, backend.samples_per_step, 3)).astype(backend.dtype)
    return increments, backend.step(np.broadcast_to(backend.identity, (runs, *backend.state_shape)), first)


def one_by_one(backend: Any, increments: np.ndarray, initial: np.ndarray) -> np.ndarray:
    """Return the history of single calls of the step."""
    history = [initial]
    for number in range(increments.shape[1]):
        history.append(
            np.stack(
                [backend.step(s, d) for s, d in zip(history[-1], increments[:, number], strict=True)]
            ).reshape(initial.shape)
        )
    return np.stack(history, axis=1)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("step", STEPS, ids=lambda step: "-".join(map(str, step)))
def test_many_runs_have_the_bits_of_single_calls(step, target, rng):
    backend = strapgen.backend(*step, target)
    increments, initial = runs_of(backend, rng, 37, 11)
    expected = one_by_one(backend, increments, initial)
    assert np.abs(expected[:, 1:] - expected[:, :-1]).max() > 1e-3
    for jobs in (1, 2, 3):
        for every in (1, 4):
            history = backend.propagate(increments, every, initial=initial, jobs=jobs)
            assert history.tobytes() == expected[:, ::every].tobytes(), (jobs, every)


@pytest.mark.parametrize("target", TARGETS)
def test_any_number_of_runs_steps_and_threads_has_the_bits_of_single_runs(target):
    backend = strapgen.backend("euler", backend=target)

    @settings(max_examples=40, deadline=None, database=None)
    @given(
        runs=st.integers(1, 70),
        steps=st.integers(0, 13),
        every=st.tuples(st.integers(1, 6), st.none() | st.integers(1, 6)),
        jobs=st.integers(1, 3),
        seed=st.integers(0, 9),
    )
    def check(runs, steps, every, jobs, seed):
        increments, initial = runs_of(backend, np.random.default_rng(seed), runs, steps)
        together = backend.propagate(increments, *every, initial, jobs)
        for run in range(runs):
            alone = backend.propagate(increments[run], *every, initial[run])
            assert alone.tobytes() == together[run].tobytes()

    check()


def test_leading_axes_keep_their_places(rng):
    backend = strapgen.backend("euler", backend="c")
    increments, _ = runs_of(backend, rng, 60, 5)
    flat = backend.propagate(increments)
    shaped = backend.propagate(increments.reshape(3, 20, *increments.shape[1:]), jobs=2)
    assert shaped.shape == (3, 20, 6, 4)
    assert shaped.tobytes() == flat.tobytes()


def test_threads_are_accepted_by_every_back_end(make, rng):
    backend = make("euler")
    increments = rng.normal(scale=0.01, size=(3, 4, 2, 3))
    np.testing.assert_array_equal(backend.propagate(increments, jobs=2), backend.propagate(increments))


@pytest.mark.parametrize("jobs", [0, -1, 1.5, "two", None, True])
def test_a_wrong_number_of_threads_is_refused_in_one_line(jobs):
    with pytest.raises((InputError, TypeError), match=r"^jobs is .*") as caught:
        strapgen.backend("euler", backend="c").propagate(np.zeros((2, 3, 2, 3)), jobs=jobs)
    assert "\n" not in str(caught.value)


def test_every_run_is_in_one_part():
    for runs in (1, 15, 16, 17, 100, 10_000):
        for jobs in (1, 2, 3, 7, 10**9):
            parts = _parts(runs, jobs)
            assert [k for part in parts for k in range(runs)[part]] == list(range(runs))
            assert len(parts) <= jobs
            assert all(part.stop - part.start for part in parts)


def test_parts_are_of_like_size():
    sizes = [part.stop - part.start for part in _parts(10_000, 3)]
    assert max(sizes) - min(sizes) <= 2 * 16


@pytest.mark.parametrize("batch", [(3,), (50, 2), (1,), (0,), ()])
def test_numpy_evaluates_blocks_as_it_does_samples(monkeypatch, rng, batch):
    backend = strapgen.backend("dcm", backend="numpy")
    state = backend.step(backend.identity, rng.normal(scale=0.3, size=(*batch, 2, 3)))
    increments = rng.normal(scale=0.01, size=(*batch, 2, 3))
    for first, second in ((state, increments), (backend.identity, increments), (state, np.zeros((2, 3)))):
        whole = backend.step(first, second)
        monkeypatch.setattr(numpy_evaluator, "_BLOCK", 2)
        assert backend.step(first, second).tobytes() == whole.tobytes()
        monkeypatch.setattr(numpy_evaluator, "_BLOCK", 1 << 40)
        assert backend.step(first, second).tobytes() == whole.tobytes()
        monkeypatch.undo()


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
