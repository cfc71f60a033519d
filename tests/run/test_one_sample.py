"""A call on one sample takes a shorter way than one on many, to the same bits and the same errors."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import strapgen
from strapgen.run.evaluators import Evaluator
from strapgen.run.numpy_evaluator import FloatProgram

#: A step, sines and cosines, an arc, a root and divisions, several outputs, and one that selects by a condition.
KERNELS = {
    "euler-product": True,
    "dcm-from-euler-angles": True,
    "euler-angles-from-dcm": False,
    "euler-normalize": True,
    "dcm-orthonormalize": True,
    "euler-from-dcm": False,
}
#: Of each type: both are taken as they lie.
BACKENDS = ("numpy", "c", "c-float")
#: With one in fixed point, whose inputs have ranges.
ALL_BACKENDS = (*BACKENDS, "c-fixed32")
#: Settings of steps in fixed point: words, a gyro's counts, states that saturate, and error feedback.
FIXED = {
    "16 bits": {"word": 16},
    "64 bits": {"word": 64},
    "counts": {"lsb": "0.0175dps", "sample_hz": 100, "state": "q31"},
    "long counts": {"lsb": "1e-10rad", "input_bits": 32, "carry": "full"},
}


@pytest.fixture(params=KERNELS)
def kernel(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def inputs_of(evaluator: Evaluator, rng: np.random.Generator) -> list[np.ndarray]:
    return [
        rng.normal(scale=0.4, size=signal.shape).astype(evaluator.dtype)
        for signal in evaluator.function.inputs
    ]


def bits(results: object) -> list[bytes]:
    return [array.tobytes() for array in (results if isinstance(results, tuple) else (results,))]


@pytest.mark.parametrize("backend_name", BACKENDS)
def test_one_sample_has_the_bits_of_a_batch(kernel, backend_name, rng, monkeypatch):
    evaluator = strapgen.evaluator(kernel, backend_name)
    values = inputs_of(evaluator, rng)
    batch = evaluator(*(np.stack([value] * 3) for value in values))
    several = batch if isinstance(batch, tuple) else (batch,)
    monkeypatch.setattr(type(evaluator), "evaluate", None)  # of the longer way
    if backend_name == "numpy" and not KERNELS[kernel]:
        monkeypatch.undo()
    results = evaluator(*values)
    assert bits(results) == [result[1].tobytes() for result in several]
    assert [(x.shape, x.dtype) for x in (results if isinstance(results, tuple) else (results,))] == [
        (signal.shape, evaluator.dtype) for signal in evaluator.function.outputs
    ]


@pytest.mark.parametrize("stated", FIXED.values(), ids=FIXED)
@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_one_sample_in_fixed_point_has_the_bits_of_a_batch(algorithm, stated, rng, monkeypatch):
    settings = strapgen.Settings.of(increments=2, **stated)
    step = strapgen.algorithm(algorithm, "rk4", 2).program()
    backend = strapgen.build(strapgen.generate(step, "c-fixed", settings))
    state, samples = backend.identity * 0.999, rng.normal(scale=1e-3, size=(50, 2, 3))
    batch = backend.step(state, samples)
    monkeypatch.setattr(type(backend.evaluator), "evaluate", None)  # of the longer way
    one = np.stack([backend.step(state, sample) for sample in samples])
    assert one.tobytes() == batch.tobytes()
    assert one.dtype == batch.dtype and len(np.unique(one)) > 30


def test_a_kernel_with_a_root_in_fixed_point_takes_one_sample():
    evaluator = strapgen.evaluator("euler-from-dcm", "c-fixed32")
    assert bits(evaluator(np.eye(3))) == bits(evaluator(np.eye(3)[None]))
    assert evaluator(np.eye(3)).shape == (4,)


@pytest.mark.parametrize("wrong", [1.5, -1e308, 1e-300])
def test_a_range_in_fixed_point_is_held_by_one_sample_too(wrong, recwarn):
    backend = strapgen.backend("euler", backend="c-fixed32")
    state, samples = np.array(backend.identity), np.zeros((2, 3))
    samples[1, 2] = wrong
    if abs(wrong) < 1:
        assert backend.step(state, samples).tobytes() == backend.step(state[None], samples)[0].tobytes()
    else:
        with pytest.raises(
            strapgen.InputError, match=r"increments holds \S+; the formats of .* at most 0\.125"
        ):
            backend.step(state, samples)
    assert not recwarn.list


def test_a_refusal_in_fixed_point_is_that_of_a_batch():
    normalize = strapgen.evaluator("euler-normalize", "c-fixed32")
    short, proper = np.array([0.1, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0])
    with pytest.raises(strapgen.InputError) as known:
        normalize(short[None])
    with pytest.raises(
        strapgen.InputError, match="refuses its input: it is too far from a proper one"
    ) as raised:
        normalize(short)
    assert str(raised.value) == str(known.value)
    assert normalize(proper).tolist() == normalize(proper[None])[0].tolist()


def test_a_function_that_selects_is_not_recorded(kernel):
    evaluator = strapgen.evaluator(kernel, "numpy")
    assert isinstance(evaluator._on_floats, FloatProgram) == KERNELS[kernel]


@pytest.mark.parametrize("backend_name", ALL_BACKENDS)
@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_are_named(backend_name, place, wrong):
    backend = strapgen.backend("euler", backend=backend_name)
    values = [np.array(backend.identity), np.zeros((2, 3), backend.dtype)]
    values[place].flat[-1] = wrong
    name, index = (("state", r"\(3,\)"), ("increments", r"\(1, 2\)"))[place]
    with pytest.raises(strapgen.InputError, match=f"{name} holds {wrong} at index {index}; finite"):
        backend.step(*values)


@pytest.mark.parametrize("backend_name", ALL_BACKENDS)
def test_other_arrays_are_checked_as_before(backend_name):
    backend = strapgen.backend("euler", backend=backend_name)
    state, samples = backend.identity, np.full((2, 3), 0.01, backend.dtype)
    wanted = backend.step(state, samples).tobytes()
    with pytest.raises(strapgen.InputError, match=r"state has shape \(3,\); \(..., 4\) is needed"):
        backend.step(state[:3], samples)
    with pytest.raises(strapgen.InputTypeError, match="increments has dtype complex"):
        backend.step(state, samples.astype(complex))
    with pytest.raises(strapgen.InputTypeError, match="increments is a masked array"):
        backend.step(state, np.ma.masked_less(samples, 0))
    with pytest.raises(strapgen.InputError, match="got 1 input; 2 are needed"):
        backend.evaluator(state)
    strided = np.zeros((3, 2), backend.dtype)
    strided[...] = samples.T
    for same in (strided.T, samples.tolist(), samples.astype(samples.dtype.newbyteorder())):
        assert backend.step(state, same).tobytes() == wanted


@pytest.mark.parametrize("backend_name", ALL_BACKENDS)
def test_a_result_is_the_callers_own(backend_name):
    backend = strapgen.backend("euler", backend=backend_name)
    state, samples = np.array(backend.identity), np.full((2, 3), 0.01, backend.dtype)
    first = backend.step(state, samples)
    before = first.tobytes()
    backend.step(first, samples)[...] = 0
    assert first.tobytes() == before
    assert first.flags.writeable
    assert first.flags.owndata or first.base.size == first.size


def test_numpy_warns_of_what_its_numbers_cannot_hold():
    normalize = strapgen.evaluator("euler-normalize", "numpy")
    with pytest.warns(RuntimeWarning):
        assert not np.isfinite(normalize(np.zeros(4))).any()
    product = strapgen.evaluator("euler-product", "numpy")
    large = np.full(4, 1e200)
    with pytest.warns(RuntimeWarning):
        assert not np.isfinite(product(large, large)).all()


@pytest.mark.parametrize("backend_name", ALL_BACKENDS)
def test_threads_do_not_share_memory(backend_name, rng):
    backend = strapgen.backend("euler", backend=backend_name)
    states = rng.normal(size=(400, 4))
    states = (states / np.linalg.norm(states, axis=1)[:, None]).astype(backend.dtype)
    samples = rng.normal(scale=0.01, size=(400, 2, 3)).astype(backend.dtype)
    wanted = backend.step(states, samples).tobytes()
    with ThreadPoolExecutor(4) as pool:
        made = list(pool.map(backend.step, states, samples))
    assert np.stack(made).tobytes() == wanted


@pytest.mark.parametrize("backend_name", BACKENDS)
def test_a_declared_range_is_held_by_one_sample_too(backend_name):
    settings = strapgen.Settings.of(max_rate_deg_s=400, step="0.01")
    choice = strapgen.choose("euler", "coning-combined", 3, previous=3)
    backend = strapgen.backend(choice, backend=backend_name, settings=settings)
    samples = np.full((6, 3), 0.01, backend.dtype)
    assert backend.step(backend.identity, samples).shape == (4,)
    samples[-1, -1] = -1
    with pytest.raises(strapgen.InputError, match=r"increments holds 1; .* was generated for at most"):
        backend.step(backend.identity, samples)
    samples[0, 0] = np.inf
    with pytest.raises(strapgen.InputError, match=r"increments holds inf at index \(0, 0\); finite"):
        backend.step(backend.identity, samples)
