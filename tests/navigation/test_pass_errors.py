"""Searches for passes of systems and of two speeds on integers that go beyond their bounds, in odd words."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import pytest
from navigation.described_files import ATTITUDE, TWO_SPEEDS, description
from navigation.test_system_bounds import TABLES
from system_errors import PassErrors, Passes, search, two_speeds

from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.systems.compiled_system import CompiledSystem
from strapgen.navigation.systems.fitting import fitted
from strapgen.navigation.systems.system_backends import SystemMemory, system_runner
from strapgen.navigation.systems.system_file import parsed
from strapgen.navigation.systems.system_runner import SystemRunner
from strapgen.navigation.systems.wiring import Description, read_system, wired
from strapgen.navigation.two_speed.two_speed_c import LOOPS
from strapgen.navigation.two_speed.two_speed_sources import ALGORITHMS, SCULLING, sources
from strapgen.run import compiler

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
def test_worst_pass_in_c_stores_what_the_model_stores(words, formats):
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
def test_worst_cycles_of_two_speeds_in_c_store_what_the_model_stores(algorithm):
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
