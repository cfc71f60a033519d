"""Searches for passes of systems and of two speeds on integers that go beyond their bounds, in odd words."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest
from navigation.described_files import ATTITUDE, TWO_SPEEDS, description
from navigation.test_system_study import TABLES

from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import Format
from strapgen.ir.interfaces import Argument
from strapgen.ir.signals import Signal
from strapgen.navigation.systems.fitting import GeneratedStages, fitted
from strapgen.navigation.systems.system_bounds import SystemBounds, bounds
from strapgen.navigation.systems.system_comparison import agreement
from strapgen.navigation.systems.system_file import parsed
from strapgen.navigation.systems.system_runner import (
    CompiledSystem,
    SystemMemory,
    SystemRunner,
    rescaled,
    system_runner,
)
from strapgen.navigation.systems.wiring import Description, described, read_system, wired
from strapgen.navigation.two_speed import two_speed_sources
from strapgen.navigation.two_speed.two_speed_sources import ALGORITHMS, LOOPS, SCULLING, sources
from strapgen.run import compiler
from strapgen.run.evaluators import Array
from strapgen.run.exact import DIGITS, number


@dataclass(frozen=True)
class Passes:
    """Memories and samples, one pass a row: integers by the names of cells, inputs and error feedback."""

    cells: Mapping[str, Array]
    feedback: Mapping[str, Array]
    samples: Mapping[str, Array]

    def rows(self, chosen: Array) -> Passes:
        """Return some passes."""
        parts = ({name: rows[chosen] for name, rows in part.items()} for part in self._parts())
        return Passes(*parts)

    def with_rows(self, chosen: Array, other: Passes) -> Passes:
        """Return passes of which some are replaced."""
        parts = []
        for part, new in zip(self._parts(), other._parts(), strict=True):
            parts.append({name: rows.copy() for name, rows in part.items()})
            for name, rows in parts[-1].items():
                rows[chosen] = new[name][chosen]
        return Passes(*parts)

    def _parts(self) -> tuple[Mapping[str, Array], ...]:
        return self.cells, self.feedback, self.samples

    def __len__(self) -> int:
        return len(next(iter(self.cells.values())))


class PassErrors:
    """Runs passes of a system on integers and in 40 digits, and compares them with the bound of each cell.

    A pass is that of all rates, or of so many of the fastest that are due, with the bounds of all; or of one rate alone
    that has a single stage, with the bounds in the header of its function.
    """

    def __init__(self, runner: SystemRunner, due: int | None = None, alone: int | None = None) -> None:
        self.runner, self.system = runner, runner.system
        self.rates = runner.system.rates[:due]
        self.exact = system_runner(runner.fit.description, "exact")
        self.bounds: SystemBounds = bounds(runner.fit)
        self.arguments: Mapping[str, Argument] = runner.fit.arguments
        if alone is not None:
            self.rates = (runner.system.rates[alone],)
            (stage,) = self.rates[0].stages
            known = runner.fit.arguments_of(stage)
            self.bounds = SystemBounds({cell: known[output].errors for output, cell in stage.results})

    def begin(self, random: np.random.Generator, count: int) -> Passes:
        """Return random passes, some of whose integers are at the ends of their ranges; most attitudes are proper."""
        cells = {c.name: self._drawn(random, c.signal, c.name, count) for c in self.system.cells}
        samples = {s.name: self._drawn(random, s, s.name, count) for s in self.system.inputs}
        feedback = self.runner.fresh(count)
        for name, words in feedback.items():
            word = self.runner.fit.sources[name].fixed.settings.word
            drawn = [[int(random.integers(0, 1 << 62)) >> (62 - min(word, 62)) for _ in row] for row in words]
            feedback[name] = np.array(drawn, words.dtype).reshape(words.shape)
        return Passes(cells, feedback, samples)

    def _drawn(self, random: np.random.Generator, signal: Signal, name: str, count: int) -> Array:
        argument = self.arguments[name]
        shape = (count, signal.size)
        # From the ends of the range, from all of it, or from near zero.
        part = random.choice([-1.0, 1.0], shape) * random.random(shape) ** random.choice(
            [0.01, 1, 3], (count, 1)
        )
        values = part * argument.high * 2.0 ** -random.choice([0, 0, 4, 12], (count, 1))
        if signal.constraint:
            if signal.constraint == "rotation":
                rows = np.linalg.qr(random.normal(size=(count, 3, 3)))[0].reshape(shape)
            else:
                rows = random.normal(size=shape)
                rows /= np.linalg.norm(rows, axis=1)[:, None]
            proper = random.random((count, 1)) < 0.8
            values = np.where(proper, rows / float(argument.unit), part * argument.high)
        whole = [[min(max(round(x), argument.low), argument.high) for x in row] for row in values.tolist()]
        return np.array(whole, _kind(argument)).reshape(shape)

    def moved(self, random: np.random.Generator, passes: Passes) -> Passes:
        """Return passes with some integers moved a little, or turned to the other sign."""
        result = passes.with_rows(np.arange(0), passes)
        for part in (result.cells, result.samples):
            for name, rows in part.items():
                argument = self.arguments[name]
                hit = random.random(rows.shape) < 0.25
                step = np.rint(
                    random.normal(size=rows.shape) * 4.0 ** random.integers(0, 8, (len(rows), 1))
                ).astype(np.int64)
                new = np.where(hit, rows + step, rows)
                if not self._is_attitude(name):
                    new = np.where(random.random(rows.shape) < 0.03, -new, new)
                part[name][...] = np.clip(new, argument.low, argument.high)
        for rows in result.feedback.values():
            if rows.size and random.integers(2):
                rows[...] = random.permutation(rows, axis=0)
        return result

    def _is_attitude(self, name: str) -> bool:
        return bool(self.arguments[name].signal.constraint)

    def errors(self, passes: Passes) -> dict[str, Array]:
        """Return the error of every element of a cell after each pass, in units of its bound; -1 for a refused pass."""
        after = SystemMemory(dict(passes.cells), dict(passes.feedback))
        try:
            self.runner.call(after, passes.samples, self.rates)
        except InputError:
            return self._halves(passes)
        with mpmath.workdps(DIGITS):
            truth = SystemMemory(
                {name: self._digits(name, rows) for name, rows in passes.cells.items()},
                self.exact.fresh(len(passes)),
            )
            measured = {name: self._digits(name, rows) for name, rows in passes.samples.items()}
            self.exact.call(truth, measured, self.rates)
            shares = {}
            for name, limits in self.bounds.errors.items():
                off = abs(self._digits(name, after.cells[name]) - truth.cells[name])
                off = off[:, [k for k, limit in enumerate(limits) if limit or off[:, k].any()]]
                scale = [number(limit) if limit else mpmath.mpf(0) for limit in limits if limit]
                shares[name] = np.array(
                    [[float(x / s) for x, s in zip(row, scale, strict=True)] for row in off]
                ).reshape(len(passes), len(scale))
        return shares

    def _halves(self, passes: Passes) -> dict[str, Array]:
        if len(passes) == 1:
            return {
                name: np.full((1, sum(map(bool, limits))), -1.0)
                for name, limits in self.bounds.errors.items()
            }
        middle = len(passes) // 2
        parts = [self.errors(passes.rows(part)) for part in np.split(np.arange(len(passes)), [middle])]
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def _digits(self, name: str, rows: Array) -> Array:
        unit = number(self.arguments[name].unit)
        result = np.empty(rows.shape, object)
        result[...] = [[int(x) * unit for x in row] for row in rows.tolist()]
        return result


def _kind(argument: Argument) -> type:
    return object if argument.format.word > 32 else np.int64


def two_speeds(algorithm: str, sculling: int, settings: Settings) -> GeneratedStages:
    """Return the loops of an algorithm in two speeds as the stages of a system; no wire is rescaled."""
    description = two_speed_sources.description(algorithm, sculling)
    stages = description.system.stages
    loops = two_speed_sources.loops(algorithm, sculling, "fixed-model", settings)
    names = (stage.name for stage in stages)
    fit = GeneratedStages(description, "fixed-model", settings, dict(zip(names, loops, strict=True)))
    arguments: dict[str, Argument] = {}
    for stage in stages:
        known = fit.arguments_of(stage)
        for name, cell in (*((wire.input, wire.source) for wire in stage.wires), *stage.results):
            assert arguments.setdefault(cell, known[name]).format == known[name].format
    return replace(fit, arguments=arguments)


def search(
    passes: PassErrors, cell: str, count: int, generations: int, seed: int
) -> tuple[float, Passes, dict[str, float]]:
    """Return the largest part of a cell's bound that climbs reach, with its pass, and the largest of every cell."""
    random = np.random.default_rng(seed)
    best = passes.begin(random, count)
    errors = passes.errors(best)
    worst = {name: float(rows.max(initial=0)) for name, rows in errors.items()}
    share = errors[cell].max(axis=1)
    for _ in range(generations):
        tried = passes.moved(random, best)
        errors = passes.errors(tried)
        worst = {name: max(worst[name], float(rows.max(initial=0))) for name, rows in errors.items()}
        new = errors[cell].max(axis=1)
        better = new >= share
        best, share = best.with_rows(better, tried), np.maximum(share, new)
    place = int(share.argmax())
    return float(share[place]), best.rows(np.array([place])), worst


EXAMPLES = Path(__file__).parents[2] / "examples"
ROUNDINGS = ("nearest", "truncation")


def with_words(system: Description, words: itertools.cycle) -> Description:
    """Return a system whose stages have words in turn."""
    rates = []
    for rate in system.system.rates:
        steps = (replace(s, word=next(words)) if s in rate.stages else s for s in rate.steps)
        rates.append(replace(rate, steps=tuple(steps)))
    return replace(system, system=replace(system.system, rates=tuple(rates)))


def climbs(passes: PassErrors, count: int, generations: int, seed: int, cells: int = 100) -> dict[str, float]:
    """Return the largest part of its bound that each cell reaches, where one after the other is sought."""
    uncertain = [name for name, limits in passes.bounds.errors.items() if any(limits)]
    worst = dict.fromkeys(uncertain, 0.0)
    for cell in uncertain[-cells:]:
        _, _, largest = search(passes, cell, count, generations, seed)
        worst = {name: max(worst[name], largest[name]) for name in uncertain}
    return worst


@pytest.mark.parametrize("rounding", ROUNDINGS)
def test_passes_in_three_words_stay_below_their_bounds_and_come_near(rounding):
    system = with_words(wired(parsed(TABLES, "chain")), itertools.cycle([16, 24, 32, 17]))
    passes = PassErrors(system_runner(system, "fixed-model", Settings(rounding=rounding)))
    share, _, worst = search(passes, "turn_turn", 16, 10, 1)
    assert not passes.bounds.reasons
    assert 0.5 < share <= 1, "after three stages and two changes of words"
    assert max(worst.values()) <= 1


@pytest.mark.parametrize(("algorithm", "word"), [("dcm", 16), ("euler", 24)])
def test_loops_of_two_speeds_stay_below_their_bounds_and_come_near(algorithm, word):
    settings = Settings(word=word, rounding="truncation", carry="full")
    runner = SystemRunner(two_speeds(algorithm, 2, settings), "fixed-model")
    for loop, cell in enumerate(("fast_sculling", "slow_navigation_rotation", "nav_velocity_change")):
        share, _, worst = search(PassErrors(runner, alone=loop), cell, 12, 5, 1)
        assert 0.5 < share <= 1
        assert max(worst.values()) <= 1
    _, _, worst = search(PassErrors(runner), "nav_velocity_change", 12, 5, 1)
    assert max(worst.values()) <= 1


@pytest.mark.parametrize(("words", "formats"), [((16, 32), {}), ((32,), {"angle_sum": "Q9.22"})], ids=str)
def test_worst_pass_in_c_agrees_with_the_model(words, formats):
    """In a cycle where all rates fall together, with values that are rescaled between words, or inside one."""
    stages = [stage | ({"formats": formats} if stage["name"] == "slow" else {}) for stage in TABLES["stage"]]
    system = with_words(wired(parsed(TABLES | {"stage": stages}, "chain")), itertools.cycle(words))
    settings = Settings(rounding="truncation", carry="full")
    passes = PassErrors(system_runner(system, "fixed-model", settings))
    cell = "slow_state" if formats else "turn_turn"
    share, worst, largest = search(passes, cell, 12, 4, 1)
    assert share > 0, "a pass is refused"
    assert max(largest.values()) <= 1
    after = memory_of(worst, system.system.cycle - 1)
    passes.runner.call(after, worst.samples, passes.rates)
    compiled = CompiledSystem(fitted(system, "c-fixed", settings), "c-fixed32")
    _, stored = compiled._run(worst.samples, 1, memory_of(worst, system.system.cycle - 1))
    for part in ("cells", "feedback"):
        for name, rows in getattr(stored, part).items():
            assert rows.tolist() == getattr(after, part)[name].tolist(), name


def memory_of(passes: Passes, cycle: int) -> SystemMemory:
    """Return the memory before a pass."""
    return SystemMemory(dict(passes.cells), dict(passes.feedback), cycle)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_worst_two_speed_cycles_in_c_agree_with_the_model(algorithm):
    settings = Settings(word=16, rounding="truncation", carry="full")
    passes = PassErrors(SystemRunner(two_speeds(algorithm, 1, settings), "fixed-model"))
    _, worst, _ = search(passes, "nav_velocity_change", 12, 4, 1)
    memory = memory_of(worst, 0)
    loops = sources(algorithm, 1, "c-fixed", settings)
    module, name = compiler.load(loops), loops.function.name
    held = module.ffi.new(f"{name}_memory *")
    places = {cell.name: cell.name.split("_", 1)[1] for cell in passes.system.cells}
    for cell, rows in memory.cells.items():
        if hasattr(held, places[cell]):
            setattr(held, places[cell], rows[0].tolist())
    for which, words in zip(LOOPS, memory.feedback.values(), strict=True):
        if words.size:
            setattr(held, f"residuals_{which}", words[0].tolist())
    change = module.ffi.new("int16_t[3]")
    for which, rate in zip(LOOPS, passes.system.rates, strict=True):
        passes.runner.call(memory, worst.samples, [rate])
        samples = [module.ffi.new("int16_t[]", worst.samples[key][0].tolist()) for key in rate.inputs]
        outputs = [change] if which == LOOPS[-1] else []
        assert getattr(module.lib, f"{name}_{which}")(held, *samples, *outputs) == 0
        for cell, rows in memory.cells.items():
            if hasattr(held, places[cell]):
                assert [*getattr(held, places[cell])] == rows[0].tolist(), (which, cell)
    assert [*change] == memory.cells["nav_velocity_change"][0].tolist()


def examples(folder: Path) -> dict[str, Description]:
    """Return described systems of many kinds."""
    systems = {name: read_system(EXAMPLES / f"{name}.toml") for name in ("strapdown", "ahrs", "attitude")}
    for name, text in (("two", TWO_SPEEDS), ("att", ATTITUDE)):
        systems[name] = description(folder, text, f"{name}.toml")
    return systems | {"chain": wired(parsed(TABLES, "chain"))}


@pytest.mark.long
@pytest.mark.parametrize(
    ("words", "rounding", "carry"),
    [
        ((16,), "truncation", "none"),
        ((24,), "nearest", "full"),
        ((64,), "truncation", "none"),
        ((16, 32), "nearest", "none"),
        ((32, 24, 64), "truncation", "full"),
        ((20, 16, 48, 32), "nearest", "full"),
    ],
    ids=str,
)
def test_longer_climbs_in_many_systems_stay_below_their_bounds(words, rounding, carry, tmp_path):
    settings = Settings(word=words[0], rounding=rounding, carry=carry)
    reached: dict[str, float] = {}
    for name, system in examples(tmp_path).items():
        runner = system_runner(with_words(system, itertools.cycle(words)), "fixed-model", settings)
        for due in range(1, len(system.system.rates) + 1):
            worst = climbs(PassErrors(runner, due), 16, 4, 2, cells=2)
            assert all(share <= 1 for share in worst.values()), (name, due, worst)
            reached[name] = max(reached.get(name, 0), *worst.values(), 0)
    assert max(reached.values()) > 0.5, reached


@pytest.mark.long
@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("sculling", SCULLING)
@pytest.mark.parametrize("word", [16, 24, 64])
@pytest.mark.parametrize(
    ("rounding", "carry"), [("nearest", "all"), ("truncation", "none"), ("truncation", "all")]
)
def test_longer_climbs_in_two_speeds_stay_below_their_bounds(rounding, carry, word, sculling, algorithm):
    """With truncation, what error feedback takes over and what is lost have opposite signs, but the bound adds them up:
    no more than half of it can be reached.
    """
    settings = Settings(word=word, rounding=rounding, carry=carry)
    runner = SystemRunner(two_speeds(algorithm, sculling, settings), "fixed-model")
    least = 0.25 if (rounding, carry) == ("truncation", "all") else 0.5
    for loop in range(3):
        worst = climbs(PassErrors(runner, alone=loop), 16, 4, 3)
        assert least < max(worst.values()) <= 1, worst
    worst = climbs(PassErrors(runner), 16, 4, 3, cells=3)
    assert max(worst.values()) <= 1, worst


SYSTEMS = ("two-speed-dcm", "two-speed-dcm-1", "two-speed-euler", "two-speed-euler-1")
CYCLES = 2000
#: Part of a bound that the worst samples reach: all but a twentieth, and half where the words of the feedback of an
#: error that is cut off are counted with their whole range on either side.
NEAR, NEAR_CUT = 0.95, 0.45


def hostile(runner, rng):
    """Yield samples of each kind: all sizes, the ends of the range, both mixed at sizes a decade apart."""
    for part in (0.3, 0.9):
        for kind in range(3):
            samples = {}
            for signal in runner.system.inputs:
                argument = runner.fit.arguments[signal.name]
                most = float(argument.unit * min(argument.high, -argument.low))
                sizes = rng.uniform(-1, 1, (CYCLES, signal.size))
                if kind == 1:
                    sizes = np.sign(sizes)
                elif kind == 2:
                    ends = rng.random(sizes.shape) < 0.5
                    sizes = np.where(ends, np.sign(sizes), sizes) * rng.choice([1, 0.1, 0.01], (CYCLES, 1))
                samples[signal.name] = part * most * sizes
            yield samples


@pytest.mark.parametrize(
    ("system", "word", "rounding", "carry"),
    [
        pytest.param(
            *case, marks=() if case == ("two-speed-dcm", 16, "nearest", "none") else pytest.mark.long
        )
        for case in (
            (system, word, rounding, carry)
            for system in SYSTEMS
            for word in (16, 32)
            for rounding in ("nearest", "truncation")
            for carry in ("none", "full")
        )
    ],
)
def test_no_samples_take_a_pass_above_its_bound_and_some_nearly_reach_it(system, word, rounding, carry, rng):
    description = described(system)
    runner = system_runner(description, f"c-fixed{word}", Settings(word=word, rounding=rounding, carry=carry))
    reference = system_runner(description, "numpy")
    nearest = 0.0
    for samples in hostile(runner, rng):
        found = agreement(runner, reference, samples)
        assert found.holds, {name: share for name, share in found.share.items() if share > 1}
        nearest = max(nearest, *found.share.values())
    assert nearest >= (NEAR_CUT if (rounding, carry) == ("truncation", "full") else NEAR)


@pytest.mark.parametrize("places", range(-9, 10))
@pytest.mark.parametrize(("there", "here"), [(32, 16), (16, 32), (32, 32), (16, 16), (64, 32)])
def test_a_value_between_words_is_rounded_half_up_and_held_at_both_ends(there, here, places):
    """Beside exact rationals: floor(x 2^places + 1/2), between the lowest and the largest integer of the word."""
    top, most = (1 << (there - 1)) - 1, (1 << (here - 1)) - 1
    values = [0, 1, -1, 3, -3, 5, -5, 127, -128, 12345, -12345, top, -top, -top - 1, top - 1]
    moved = rescaled(np.array(values, object), Format(there, 0), Format(here, places))
    for value, result in zip(values, moved.tolist(), strict=True):
        exact = (Fraction(value) * Fraction(2) ** places + Fraction(1, 2)).__floor__()
        assert result == max(-most - 1, min(most, exact))
