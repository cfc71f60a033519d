"""Generates the sources of an algorithm in two speeds: its three loops, with formats that match, and their C.

The loops, what passes between them and what is reset are those of the built-in system of the same name. How many cycles
of one loop make one of the next is an argument of the generated functions, so that the rates of the file do not matter.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from functools import cache

from strapgen import pipeline, targets
from strapgen.catalogue import Choice
from strapgen.fixedpoint.format_plan import ranges_of_copies
from strapgen.fixedpoint.sensor_scale import counted
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import DEFAULT_ANGLE, Settings
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.navigation.systems import built_in, system_file
from strapgen.navigation.systems.sums import copies, summed
from strapgen.navigation.systems.wiring import Description, wired
from strapgen.navigation.two_speed.two_speed_c import whole
from strapgen.targets import BUILT_IN, TARGETS
from strapgen.targets.contract import options

#: Attitude algorithms in two speeds.
ALGORITHMS = {"dcm": "direction cosine matrix", "euler": "Euler parameters, scalar last"}
#: Forms of the sculling integral that the fast loop computes.
SCULLING = {1: "with the rotation compensation in it", 2: "with the rotation compensation in the slow loop"}

#: Factor on stated increments that leaves room for the rounding of sums.
_SPARE = Fraction(33, 32)
#: Smallest increments that formats are chosen for, in rad and m/s.
_LEAST = Fraction(1, 2**16)


def kernels(algorithm: str, sculling: int = 2) -> tuple[str, str, str]:
    """Return the names of the fast, slow and navigation loop.

    >>> kernels("dcm")
    ('two-speed-fast-2', 'dcm-two-speed-slow-2', 'dcm-two-speed-navigation')
    """
    fast, slow, navigation = (stage.kernel for stage in _text(algorithm, sculling).stages)
    return fast, slow, navigation


def description(algorithm: str, sculling: int = 2) -> Description:
    """Return the built-in system with the loops of an algorithm; parameters and errors are those of `kernels`.

    >>> [rate.every for rate in description("dcm").system.rates]
    [1, 64, 320]
    """
    return wired(_text(algorithm, sculling))


def _text(algorithm: str, sculling: int) -> system_file.SystemText:
    """Return the file of the built-in system with the loops of an algorithm."""
    checks.choice("algorithm", algorithm, ALGORITHMS)
    checks.count("sculling", sculling, largest=len(SCULLING))
    return _read(f"two-speed-{algorithm}" if sculling == 2 else f"two-speed-{algorithm}-{sculling}")


@cache
def _read(name: str) -> system_file.SystemText:
    return system_file.read(built_in.file_of(name))


def ranges(
    angle: float, velocity: float = 0.0, fast_cycles: int = 1, slow_cycles: int = 1
) -> dict[str, Fraction]:
    """Return ranges of the loops' inputs that hold the sums of increments up to a stated size, for fixed point.

    `angle, velocity`: largest magnitude of an element of the angle increments in rad, and of the velocity
    increments in m/s.

    >>> {name: round(float(value), 4) for name, value in ranges(0.01, 0.1, 4).items() if "velocity" not in name}
    {'increment': 0.0103, 'previous_increment': 0.0103, 'angle_sum': 0.0413, 'coning': 0.0009, 'sculling': 0.017}
    """
    turned, moved = (max(Fraction(value), _LEAST) * _SPARE for value in (angle, velocity))
    sums = turned * fast_cycles, moved * fast_cycles
    return {
        "increment": turned,
        "previous_increment": turned,
        "angle_sum": sums[0],
        # The sum of |beta x d|/2 <= |beta| |d| over the cycles, an element; so for sculling.
        "coning": sums[0] ** 2 / 2,
        "velocity_increment": moved,
        "velocity_sum": sums[1],
        "sculling": sums[0] * sums[1],
        # In any direction, turned by at most the angle: each element up to the length.
        "navigation_velocity": 2 * (sums[1] + 2 * sums[0] * sums[1]) * slow_cycles,
    }


def loops(
    algorithm: str, sculling: int = 2, target: str = "c", settings: Settings | None = None
) -> tuple[Sources, Sources, Sources]:
    """Return the generated loops; in fixed point the formats of what passes between them match.

    The increments have the format of their sums, so that no sum is rounded.
    """
    names = kernels(algorithm, sculling)
    targets.require(target, settings)
    if not TARGETS[target].fixed:
        fast, slow, navigation = (pipeline.compile(Choice(name), target) for name in names)
        return fast, slow, navigation
    programs = {name: pipeline.program(Choice(name)) for name in names}
    settings = _in_ranges(settings or Settings(), programs[names[0]])
    inputs = {name: {signal.name for signal in program.inputs} for name, program in programs.items()}
    _require_inputs(settings, set().union(*inputs.values()))
    earlier = {state: name for program in programs.values() for state, name in copies(program).items()}
    ranges = {name: settings.ranges[other] for name, other in earlier.items() if other in settings.ranges}
    wider = ranges_of_copies(programs[names[0]], settings, copies(programs[names[0]]))
    settings = replace(settings, ranges=ranges | wider | dict(settings.ranges))

    def loop(name: str, formats: Mapping[str, str]) -> Sources:
        chosen = settings if counted(programs[name]) else settings.without_counts()
        return _fixed_loop(name, target, _of_inputs(replace(chosen, formats=formats), inputs[name]))

    formats = dict(settings.formats)
    natural = _formats(loop(names[0], formats))
    counts = {s.name for s in counted(programs[names[0]]) if settings.input_bits is not None}
    for total, increment in summed(programs[names[0]]).items():
        if increment in counts:
            continue
        alike = [increment, *(state for state, name in earlier.items() if name == increment)]
        formats |= {name: natural[total] for name in alike if name not in formats}
    result = []
    for name in names:
        result.append(loop(name, formats))
        formats |= {other: text for other, text in _formats(result[-1]).items() if other not in formats}
    fast, slow, navigation = result
    return fast, slow, navigation


def _require_inputs(settings: Settings, known: set[str]) -> None:
    """Check that every range and format is for an input of some loop."""
    for what, stated in (("range", settings.ranges), ("format", settings.formats)):
        for name in sorted(set(stated) - known):
            inputs = ", ".join(sorted(known))
            raise InputError(f"no loop has an input {name!r} for a {what}; inputs are: {inputs}")


def _of_inputs(settings: Settings, inputs: set[str]) -> Settings:
    """Return settings with the ranges and formats of some inputs alone."""
    return replace(
        settings,
        ranges={name: value for name, value in settings.ranges.items() if name in inputs},
        formats={name: text for name, text in settings.formats.items() if name in inputs},
    )


def _fixed_loop(kernel: str, target: str, settings: Settings) -> Sources:
    """Return a loop in fixed point; without error feedback where it rounds nothing that goes on to the next call."""
    loop = pipeline.compile(Choice(kernel), target, settings)
    if settings.carry == "none" or loop.fixed is None or loop.fixed.residuals:
        return loop
    # The same sources as from `strapgen generate` without the option.
    return pipeline.compile(Choice(kernel), target, replace(settings, carry="none"))


def _formats(sources: Sources) -> dict[str, str]:
    """Return the formats of a loop's inputs; not of counts, whose format follows from their bits."""
    assert sources.fixed is not None
    word = sources.fixed.settings.word
    return {a.signal.name: str(a.format) for a in sources.fixed.inputs if a.format.word == word}


def sources(
    algorithm: str, sculling: int = 2, target: str = "c", settings: Settings | None = None
) -> Sources:
    """Return the C of all loops, with one function for each and one that runs them all.

    >>> list(sources("dcm").files)[:2]
    ['dcm_two_speed_2.h', 'dcm_two_speed_2.c']
    """
    checks.choice("target", target, [name for name, entry in BUILT_IN.items() if entry.compiled])
    if BUILT_IN[target].fixed:
        settings = settings or Settings()
    parts = loops(algorithm, sculling, target, settings)
    title = f"Two speeds: {ALGORITHMS[algorithm]}, sculling {SCULLING[sculling]}"
    system = description(algorithm, sculling).system
    return whole(
        f"{algorithm}-two-speed-{sculling}",
        title,
        command(algorithm, sculling, target, settings),
        system,
        parts,
    )


def command(algorithm: str, sculling: int, target: str, settings: Settings | None) -> str:
    """Return the command line that generates the C of all loops; parameters are those of `loops`."""
    stated = "" if settings is None else f" {options(settings, keep_stated=True)}"
    return f"strapgen two-speed {algorithm} --sculling {sculling} --target {target}{stated}"


def _in_ranges(settings: Settings, fast: Program) -> Settings:
    """Return settings with the largest angle, if one is stated, as the range of the fast loop's increments."""
    if settings.state:
        raise InputError("an algorithm in two speeds takes no state that saturates")
    ranges = dict(settings.ranges)
    for signal in counted(fast) if "--max-" in settings.stated else ():
        if signal.name in ranges:
            raise InputError(
                f"the largest rate and the range of {signal.name} are both stated; one is needed"
            )
        ranges[signal.name] = settings.largest_angle
    return replace(settings, ranges=ranges, largest_angle=DEFAULT_ANGLE, stated="")
