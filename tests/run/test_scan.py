"""The order "scan": a run in blocks of 8 lanes of 16 steps, whose products are combined."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

import strapgen
from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.ir.exceptions import InputError
from strapgen.run import exact

#: Steps of a block.
BLOCK = 8 * 16
TARGETS = ["c", "c-float"]
#: Attitude, method and increments of steps with a product; the functions of magnus4 are not those of vectors.
STEPS = [
    ("euler", "rk4", 2),
    ("dcm", "rk4", 2),
    ("cayley-klein", "rk2", 2),
    ("euler", "magnus4", 2),
]
RODRIGUES = str(Path(__file__).resolve().parents[2] / "examples" / "modified_rodrigues.py")


@pytest.fixture(params=TARGETS)
def target(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(params=STEPS, ids=lambda step: "-".join(map(str, step)))
def scan(request: pytest.FixtureRequest, target: str) -> Any:
    return strapgen.backend(*request.param, target, order="scan")


def sequential(scan: Any) -> Any:
    """Return the same back end with the default order."""
    return type(scan)(scan._parts)


def samples_of(backend: Any, rng: np.random.Generator, *shape: int) -> np.ndarray:
    return rng.normal(scale=0.02, size=(*shape, backend.samples_per_step, 3)).astype(backend.dtype)


@pytest.mark.parametrize("steps", [BLOCK - 1, BLOCK, 5 * BLOCK + 77])
def test_a_scan_is_within_the_proved_rounding_of_50_digits(scan, steps, rng):
    samples = samples_of(scan, rng, steps)
    history = scan.propagate(samples)
    assert history.dtype == scan.dtype
    program = pipeline.program(scan._parts.choice)
    with mpmath.workdps(50):
        start = [mpmath.mpf(float(x)) for x in scan.identity.ravel()]
        rows = [[mpmath.mpf(float(x)) for x in row.ravel()] for row in samples]
        truth = exact.states(program, rows, start)
        errors = [
            [float(mpmath.mpf(float(x)) - y) for x, y in zip(state.ravel(), exactly, strict=True)]
            for state, exactly in zip(history, truth, strict=True)
        ]
    # A state is the product of all transitions before it, and of a product for each lane and block.
    accumulation = scan.sources.rounding.accumulation
    products = steps + steps // 16 + 2
    rows_of_states = np.reshape(errors, (1 + steps, -1, scan.state_shape[-1]))
    lengths = np.linalg.norm(rows_of_states, axis=-1)
    if accumulation is not None:
        assert lengths.max() <= accumulation.bound(products)
    # The steps one by one err no less: roundings add up to the same number.
    unit = np.finfo(scan.dtype).eps
    assert lengths.max() <= 2 * unit * np.sqrt(products) * 10


def test_its_bits_are_those_of_the_default_order_before_the_first_block_alone(scan, rng):
    samples = samples_of(scan, rng, 3 * BLOCK)
    by_steps = sequential(scan)
    assert (scan.order, by_steps.order) == ("scan", "sequential")
    short = samples[: BLOCK - 1]
    assert scan.propagate(short).tobytes() == by_steps.propagate(short).tobytes()
    whole, wanted = scan.propagate(samples), by_steps.propagate(samples)
    assert whole.tobytes() != wanted.tobytes()
    assert np.abs(whole - wanted).max() < 100 * np.finfo(scan.dtype).eps


@pytest.mark.parametrize("every", [2, 7, 16, BLOCK, 3 * BLOCK + 1, 1000])
def test_records_are_samples_of_the_full_history(scan, every, rng):
    samples = samples_of(scan, rng, 4 * BLOCK + 50)
    full = scan.propagate(samples)
    assert scan.propagate(samples, every).tobytes() == full[::every].tobytes()


@pytest.mark.parametrize("record_every", [1, 3, BLOCK + 2])
@pytest.mark.parametrize("every", [5, BLOCK, 2 * BLOCK + 10])
def test_orthonormalizations_cut_a_run(scan, every, record_every, rng):
    samples, state = samples_of(scan, rng, 4 * BLOCK + 50), scan.identity
    wanted = [state]
    for first in range(0, len(samples), every):
        piece = samples[first : first + every]
        states = scan.propagate(piece, initial=state)[1:]
        if len(piece) == every:
            states[-1] = scan.orthonormalize(states[-1])
        state = states[-1]
        wanted += [*states]
    history = scan.propagate(samples, record_every, every)
    assert history.tobytes() == np.stack(wanted)[::record_every].tobytes()


def test_a_run_has_its_bits_among_others_and_in_parts(target, rng, monkeypatch):
    backend = strapgen.backend("euler", backend=target, order="scan")
    samples = samples_of(backend, rng, 19, 2 * BLOCK + 3)
    initial = backend.step(backend.identity, samples_of(backend, rng, 19))
    together = backend.propagate(samples, 2, initial=initial, jobs=3)
    for run in range(19):
        assert together[run].tobytes() == backend.propagate(samples[run], 2, initial=initial[run]).tobytes()
    monkeypatch.setattr("strapgen.run.backends.PART", BLOCK)
    monkeypatch.setattr("strapgen.run.increments.PART", BLOCK)
    row = samples[0]
    for every in (None, 2 * BLOCK):
        parts = backend.propagate_parts(lambda first, count: row[first : first + count], len(row), 3, every)
        assert parts.tobytes() == backend.propagate(row, 3, every).tobytes()


def test_a_large_history_that_is_streamed_has_the_bits_of_its_parts(target, rng):
    backend = strapgen.backend("euler", backend=target, order="scan")
    steps = 600 * BLOCK + 5
    samples = samples_of(backend, rng, steps)
    history = backend.propagate(samples)
    assert history.nbytes > 1 << 20
    part = backend.propagate(samples[: 10 * BLOCK])
    assert history[: len(part)].tobytes() == part.tobytes()
    assert history[::BLOCK].tobytes() == backend.propagate(samples, BLOCK).tobytes()
    # Memory that begins between the vectors of a streaming store.
    room = np.zeros(history.size + 1, history.dtype)
    inside = room[1:].reshape(history.shape)
    assert backend.propagate(samples, out=inside).tobytes() == history.tobytes()


@pytest.mark.parametrize("place", [3, BLOCK + 50, 3 * BLOCK + 1])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_sample_that_is_not_finite_is_named(scan, value, place, rng):
    samples = samples_of(scan, rng, 3 * BLOCK + 2)
    samples[place, 1, 0] = value
    for every in (1, BLOCK, len(samples) - 1):
        with pytest.raises(InputError, match=rf"^samples holds {value} at index \({place}, 1, 0\); "):
            scan.propagate(samples, every)


def test_a_copy_in_another_process_keeps_the_order(target):
    backend = strapgen.backend("euler", backend=target, order="scan")
    assert pickle.loads(pickle.dumps(backend)).order == "scan"


@pytest.mark.parametrize(
    ("step", "back_end", "words"),
    [
        (("euler", "rk4"), "numpy", "it goes with the back ends c and c-float, not with numpy"),
        (("euler", "rk4"), "c-fixed32", "it goes with the back ends c and c-float, not with c-fixed32"),
        (("dcm", "rk1"), "c", "the transition of dcm-rk1-2 holds constants"),
        ((RODRIGUES, "rk1", 1), "c", "a step that is linear in its state is needed"),
    ],
)
def test_steps_that_have_no_scan_are_refused(step, back_end, words):
    with pytest.raises(InputError, match=r"^order is scan; ") as caught:
        strapgen.backend(choose(*step), backend=back_end, order="scan")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_order_is_refused():
    with pytest.raises(InputError, match=r"order 'scam' is not known .* allowed: sequential, scan"):
        strapgen.backend("euler", order="scam")
