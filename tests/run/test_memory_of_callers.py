"""Arrays of a caller: samples are read where they lie and checked by the run itself, results go where `out` is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import strapgen
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.run.compiled_code import CEvaluator

COMPILED = ["c", "c-float"]


@pytest.fixture
def samples(rng: np.random.Generator) -> np.ndarray:
    return rng.normal(scale=0.01, size=(3, 40, 2, 3))


def test_a_result_is_written_into_memory_of_the_caller(backend_name, samples):
    backend = strapgen.backend("euler", backend=backend_name)
    wanted = backend.propagate(samples, 2)
    room = np.full((wanted.shape[0] + 2, *wanted.shape[1:]), 7.0, backend.dtype)
    out = room[1:-1]
    returned = backend.propagate(samples, 2, out=out)
    assert returned is out
    assert out.tobytes() == wanted.tobytes()
    assert (room[[0, -1]] == 7.0).all(), "written outside"


def test_parts_are_written_into_memory_of_the_caller(monkeypatch, samples):
    monkeypatch.setattr("strapgen.run.backends.PART", 16)
    monkeypatch.setattr("strapgen.run.increments.PART", 16)
    backend, row = strapgen.backend("euler", backend="c"), samples[0]
    out = np.empty((11, 4))
    returned = backend.propagate_parts(lambda first, count: row[first : first + count], 40, 4, out=out)
    assert returned is out
    assert out.tobytes() == backend.propagate(row, 4).tobytes()


@pytest.mark.parametrize("back_end", COMPILED)
def test_compiled_loops_write_there_themselves(back_end, samples, monkeypatch):
    backend = strapgen.backend("euler", backend=back_end)
    d, out = samples.astype(backend.dtype), np.empty((3, 41, 4), backend.dtype)
    places: dict[str, list[Any]] = {"read": [], "written": []}
    pointer = CEvaluator.pointer

    def watched(self, array):
        places["read"] += [array.ctypes.data] if np.shares_memory(array, d) else []
        places["written"] += [array.ctypes.data] if np.shares_memory(array, out) else []
        return pointer(self, array)

    monkeypatch.setattr(CEvaluator, "pointer", watched)
    assert not np.shares_memory(backend.propagate(d), out)
    backend.propagate(d, out=out)
    assert places == {"read": [d.ctypes.data] * 2, "written": [out.ctypes.data]}


SHAPE = (3, 41, 4)


@pytest.mark.parametrize(
    ("out", "error", "words"),
    [
        (7, InputTypeError, "out is 7; a writeable array (3, 41, 4) of float64 in C order is needed"),
        (np.empty((3, 40, 4)), InputError, "out has shape (3, 40, 4) and dtype float64; a writeable array"),
        (np.empty(SHAPE, "f4"), InputError, "out has shape (3, 41, 4) and dtype float32; a writeable array"),
        (np.empty(SHAPE, ">f8"), InputError, "out has shape (3, 41, 4) and dtype >f8; a writeable array"),
        (np.empty(SHAPE[::-1]).T, InputError, "out is not in C order; a writeable array"),
        (np.broadcast_to(0.0, SHAPE), InputError, "out is read-only; a writeable array"),
        (np.ma.zeros(SHAPE), InputTypeError, "out is a MaskedArray; a writeable array"),
        (
            np.empty(3 * 41 * 4 * 8 + 1, "u1")[1:].view("f8").reshape(SHAPE),
            InputError,
            "out is not aligned; a writeable array",
        ),
    ],
)
def test_memory_that_does_not_fit_is_refused(out, error, words, samples):
    with pytest.raises(error) as caught:
        strapgen.backend("euler", backend="c").propagate(samples, out=out)
    assert str(caught.value).startswith(words)
    assert "\n" not in str(caught.value)


def test_memory_of_an_input_is_refused(rng):
    backend = strapgen.backend("euler", backend="c")
    memory = np.zeros(1000)
    d, out = memory[:300].reshape(50, 2, 3)[:20], memory[100:184].reshape(21, 4)
    with pytest.raises(InputError, match="out overlaps an input; memory of its own is needed"):
        backend.propagate(d, out=out)
    with pytest.raises(InputError, match="out overlaps an input"):
        backend.propagate(np.zeros((20, 2, 3)), initial=memory[100:104], out=out)


# Samples that are not finite


STEPS = [
    (("euler", "rk4", 2), True),
    (("dcm", "rk1", 2), True),
    (("euler", "magnus4", 2), False),  # it has sines and quotients
]


@pytest.mark.parametrize("back_end", COMPILED)
@pytest.mark.parametrize(("step", "spreads"), STEPS)
def test_a_step_of_sums_and_products_spreads_what_is_not_finite(step, spreads, back_end):
    assert strapgen.backend(*step, back_end).evaluator.spreads_nonfinite is spreads


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("place", [0, 17, 33, 39])
@pytest.mark.parametrize("every", [(1, None), (4, None), (7, None), (50, None), (1, 5)])
@pytest.mark.parametrize(("step", "spreads"), STEPS)
def test_a_sample_that_is_not_finite_is_named(step, spreads, every, place, value, samples):
    backend = strapgen.backend(*step, "c")
    samples[1, place, 1, 2] = value
    with pytest.raises(InputError) as caught:
        backend.propagate(samples, *every)
    assert (
        str(caught.value) == f"samples holds {value} at index (1, {place}, 1, 2); finite numbers are needed"
    )


@pytest.mark.parametrize("order", ["sequential", "scan"])
def test_finite_samples_whose_states_overflow_are_no_bad_input(order):
    backend = strapgen.backend("euler", backend="c", order=order)
    with np.errstate(all="ignore"):
        history = backend.propagate(np.full((300, 2, 3), 1e100))
    assert not np.isfinite(history[-1]).all()


def test_numbers_beyond_the_range_of_float_are_named():
    backend = strapgen.backend("euler", backend="c-float")
    samples = np.zeros((20, 2, 3))
    samples[3, 0, 1] = 1e200
    with pytest.raises(InputError, match=r"^samples holds numbers beyond the range of float32$"):
        backend.propagate(samples)


@pytest.mark.parametrize("kind", ["f8", "f4"])
def test_an_array_of_the_right_type_and_order_is_not_copied(kind, samples):
    d = samples.astype(kind)
    assert checks.real_array("samples", d, (2, 3), kind) is d
    assert not np.shares_memory(checks.real_array("samples", d[:, ::2], (2, 3), kind), d)
