"""A long run ends near exact arithmetic on its integers, and the balls hold the exact states."""

from __future__ import annotations

import importlib.util
import re
import shutil
from dataclasses import replace
from fractions import Fraction

import pytest

from strapgen.catalogue import choose
from strapgen.evidence import long_run
from strapgen.evidence.subjects import Subject
from strapgen.ir.fixed_settings import Settings
from strapgen.lab.processors import RUNNERS, Runner

flint = pytest.importorskip("flint", reason="python-flint is not installed")

HOST = Runner("host", ("cc",), ("env",), "cc", "gcc")


@pytest.fixture
def short(monkeypatch):
    """Let a run be short, and on the machine itself."""
    monkeypatch.setattr(long_run, "ROWS", 101)
    monkeypatch.setattr(long_run, "PASSES", 3)
    monkeypatch.setattr(long_run, "RUNNERS", {long_run.PROCESSOR: HOST})


@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_the_balls_hold_the_exact_states(algorithm):
    """Fractions, step by step, are the reference; an odd number of rows leaves one without a pair."""
    subject = Subject(choose(algorithm), Settings(carry="full"))
    run = long_run.noisy_run(subject, 3, 2)
    state, samples = subject.sources.fixed.inputs
    names = [name for argument in (state, samples) for name in argument.signal.elements]
    exact, expected = [word * state.unit for word in run.identity], []
    for number, row in enumerate(long_run.noisy_integers(run)):
        values = dict(zip(names, [*exact, *(value * samples.unit for value in row)], strict=True))
        (exact,) = subject.program.run(values).values()
        if number % 3 == 2:
            expected.append(exact)
    states = long_run.exact_states(subject, run)
    for balls, numbers in zip(states, expected, strict=True):
        for ball, number in zip(balls, numbers, strict=True):
            with flint.ctx.workprec(10 * long_run.PRECISION):
                assert ball.contains(long_run.ball(Fraction(number)))
            assert ball.rad() < 1e-100


@pytest.mark.long
def test_a_short_run_ends_near_the_balls(short, tmp_path):
    (verdict,) = long_run.million_steps(Subject(choose("euler")), tmp_path)
    assert (verdict.kernel, verdict.claim) == ("euler_rk4_2_w32", "error of a million steps: host")
    assert verdict.result == "agrees", verdict.detail
    assert verdict.detail.startswith(
        "303 steps of coning with noise, formats of --word 32 --max-angle-rad 1/256 "
    )
    error = float(re.search(r"at most ([\d.]+) units", verdict.detail)[1])
    # Half a unit is lost where the state is rounded, and fed back; the rest comes from values in between.
    assert 0.3 < error < 2


def test_a_changed_shift_is_seen(short, monkeypatch, tmp_path):
    noisy_run = long_run.noisy_run

    def faulty(subject, rows, passes):
        run = noisy_run(subject, rows, passes)
        name = f"{subject.name}.c"
        text, count = re.subn(
            r"(sigma_dot_sigma = .*?), (\d+)\);",
            lambda match: f"{match[1]}, {int(match[2]) - 1});",
            run.sources.files[name],
            count=1,
            flags=re.DOTALL,
        )
        assert count
        return replace(run, sources=replace(run.sources, files=run.sources.files | {name: text}))

    monkeypatch.setattr(long_run, "noisy_run", faulty)
    (verdict,) = long_run.million_steps(Subject(choose("euler")), tmp_path)
    assert verdict.result == "fails"


def test_a_refused_step_is_seen():
    subject = Subject(choose("euler"), long_run.SETTINGS)
    run = long_run.noisy_run(subject, 1, 2)
    states = long_run.states_of("state 00000000 00000000 00000000 40000000\nrefused 0 0 0 0\n")
    assert states == [[0, 0, 0, 1 << 30]]
    assert long_run.compared(states, long_run.exact_states(subject, run), run) == (
        "fails",
        "a step is refused in pass 2",
    )


def test_balls_that_are_too_wide_prove_nothing():
    subject = Subject(choose("euler"), long_run.SETTINGS)
    run = long_run.noisy_run(subject, 1, 1)
    wide = [[flint.arb(0, 1e-10), flint.arb(0), flint.arb(0), flint.arb(1)]]
    result, detail = long_run.compared([run.identity], wide, run)
    assert result == "fails"
    assert detail.endswith("balls of a radius below 1e+00")


@pytest.mark.parametrize(
    ("kernel", "settings"),
    [("dcm", None), ("euler-product", None), ("euler", Settings(word=16)), ("euler", Settings(carry="full"))],
)
def test_other_kernels_have_no_claim(kernel, settings, tmp_path):
    assert long_run.million_steps(Subject(choose(kernel), settings), tmp_path) == []


def test_without_the_library_of_balls_nothing_is_claimed(short, monkeypatch, tmp_path):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "flint" else find(name))
    (verdict,) = long_run.million_steps(Subject(choose("euler")), tmp_path)
    assert (verdict.result, verdict.detail) == ("not installed", "install gcc, python-flint")


def test_the_emulated_processor_takes_the_steps(short, monkeypatch, tmp_path):
    runner = RUNNERS[long_run.PROCESSOR]
    for command in runner.commands:
        if shutil.which(command) is None:
            pytest.skip(f"{command} is not on this machine")
    monkeypatch.setattr(long_run, "RUNNERS", RUNNERS)
    (verdict,) = long_run.million_steps(Subject(choose("euler")), tmp_path)
    assert (verdict.claim, verdict.result) == ("error of a million steps: cortex-m3", "agrees"), (
        verdict.detail
    )
