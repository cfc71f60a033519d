"""Generated sources of algorithms in two speeds: loops whose formats fit together, and the C of the whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction

from strapgen.catalogue import Choice
from strapgen.ir.fixed_settings import DEFAULT_ANGLE, Settings
from strapgen.ir.sources import Sources
from strapgen.library import generated_sources
from strapgen.support import checks
from strapgen.support.exceptions import InputError
from strapgen.targets import FIXED
from strapgen.targets.contract import options
from strapgen.targets.two_speed_c.emit import whole

#: Attitude algorithms in two speeds.
ALGORITHMS = {"dcm": "direction cosine matrix", "euler": "Euler parameters, scalar last"}


#: Which sculling integral the fast loop makes.
SCULLING = {1: "with the rotation compensation in it", 2: "with the rotation compensation in the slow loop"}


#: Room for the rounding of sums, and the smallest increments that formats are made for.
_SPARE = Fraction(33, 32)


_LEAST = Fraction(1, 2**16)


#: What has the range and the format of another input, unless its own is stated.
_AS = {"previous_increment": "increment", "previous_turn": "turn"}


#: What is summed in a cycle, and the increments of which it is the sum: exact where both have one format.
_SUMMED = {
    "angle_sum": ("increment", "previous_increment"),
    "velocity_sum": ("velocity_increment",),
}


def kernels(algorithm: str, sculling: int = 2) -> tuple[str, str, str]:
    """Return the names of the fast, slow and navigation loop.

    Parameters
    ----------
    algorithm : str
        A key of `ALGORITHMS`.
    sculling : int, optional
        A key of `SCULLING`.

    Raises
    ------
    InputError
        If one is unknown.

    Examples
    --------
    >>> kernels("dcm")
    ('two-speed-fast-2', 'dcm-two-speed-slow-2', 'dcm-two-speed-navigation')
    """
    checks.choice("algorithm", algorithm, ALGORITHMS)
    checks.count("sculling", sculling, largest=len(SCULLING))
    return (
        f"two-speed-fast-{sculling}",
        f"{algorithm}-two-speed-slow-{sculling}",
        f"{algorithm}-two-speed-navigation",
    )


def ranges(
    angle: float, velocity: float = 0.0, fast_cycles: int = 1, slow_cycles: int = 1
) -> dict[str, Fraction]:
    """Return ranges for the loops' inputs in fixed point that hold what increments of a stated size sum up to.

    Parameters
    ----------
    angle, velocity : float
        Largest magnitude of an element of the angle increments in rad, and of the velocity increments in m/s.
    fast_cycles, slow_cycles : int, optional
        As for `TwoSpeed.run`.

    Returns
    -------
    dict of str to Fraction
        For `Settings`: by the names of inputs.

    Examples
    --------
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
    """Return the generated loops; in fixed point in formats that fit together.

    The increments get the format of their sums, so that no sum is ever rounded.

    Parameters
    ----------
    algorithm, sculling
        As for `kernels`.
    target : str, optional
        A key of `strapgen.targets.TARGETS`.
    settings : Settings, optional
        What fixed point is made for; ranges and formats by the names of the loops' inputs.

    Returns
    -------
    tuple of Sources

    Raises
    ------
    InputError
        If a name is unknown, or a range or a format does not go with the loops.
    """
    names = kernels(algorithm, sculling)
    if target not in FIXED:
        if settings is not None:
            raise InputError(f"target {target} takes no fixed-point settings; these do: {', '.join(FIXED)}")
        fast, slow, navigation = (generated_sources.sources(Choice(name), target) for name in names)
        return fast, slow, navigation
    asked = _without_largest_angle(settings or Settings())
    inputs = [
        {s.name for s in generated_sources.sources(Choice(name), "numpy").function.inputs} for name in names
    ]
    for what, given in (("range", asked.ranges), ("format", asked.formats)):
        unknown = set(given) - set().union(*inputs)
        if unknown:
            known = ", ".join(sorted(set().union(*inputs)))
            raise InputError(f"no loop has an input {sorted(unknown)[0]!r} for a {what}; inputs are: {known}")

    stated = {
        **{name: asked.ranges[other] for name, other in _AS.items() if other in asked.ranges},
        **asked.ranges,
    }

    def made(number: int, formats: Mapping[str, str]) -> Sources:
        own = inputs[number]
        chosen = replace(
            asked,
            ranges={name: value for name, value in stated.items() if name in own},
            formats={name: text for name, text in formats.items() if name in own},
        )
        loop = generated_sources.sources(Choice(names[number]), target, chosen)
        if chosen.carry == "none" or loop.fixed is None or loop.fixed.residuals:
            return loop
        # A loop that rounds nothing to carry on is the one that `strapgen generate` makes without the option.
        return generated_sources.sources(Choice(names[number]), target, replace(chosen, carry="none"))

    formats = dict(asked.formats)
    natural = _formats(made(0, formats))
    for total, increments in _SUMMED.items():
        formats |= {name: natural[total] for name in increments if name not in formats}
    result = []
    for number in range(len(names)):
        result.append(made(number, formats))
        formats |= {name: text for name, text in _formats(result[-1]).items() if name not in formats}
    fast, slow, navigation = result
    return fast, slow, navigation


def _formats(sources: Sources) -> dict[str, str]:
    assert sources.fixed is not None
    return {argument.signal.name: str(argument.format) for argument in sources.fixed.inputs}


def sources(
    algorithm: str, sculling: int = 2, target: str = "c", settings: Settings | None = None
) -> Sources:
    """Return the C of all loops: one function each, and one for the whole.

    Parameters
    ----------
    algorithm, sculling, target, settings
        As for `loops`; the target is one of C.

    Returns
    -------
    Sources

    Raises
    ------
    InputError
        If a name is unknown, or the target is not C.

    Examples
    --------
    >>> list(sources("dcm").files)[:2]
    ['dcm_two_speed_2.h', 'dcm_two_speed_2.c']
    """
    checks.choice("target", target, ("c", "c-float", "c-fixed"))
    if target in FIXED:
        settings = _without_largest_angle(settings or Settings())
    parts = loops(algorithm, sculling, target, settings)
    command = f"strapgen two-speed {algorithm} --sculling {sculling} --target {target}"
    if settings is not None:
        command += f" {options(settings)}"
    title = f"Two speeds: {ALGORITHMS[algorithm]}, sculling {SCULLING[sculling]}"
    return whole(f"{algorithm}-two-speed-{sculling}", title, command, parts)


def _without_largest_angle(settings: Settings) -> Settings:
    """Return settings without the largest angle of a step's increments, which no loop has."""
    return replace(settings, largest_angle=DEFAULT_ANGLE, stated="")
