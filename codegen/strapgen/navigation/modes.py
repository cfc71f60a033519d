"""Modes of a reference: a switch with two thresholds, and the sequence of off, align, navigate and attitude."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.ir.signals import ANY, Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_rates import FENNER

#: The modes by their numbers.
MODES = ("off", "align", "navigate", "attitude")
_HALF = sp.Rational(1, 2)
#: Most cycles that a mode lasts until it is ready: 600 s at 50 Hz are 30000.
_MOST_CYCLES = Fraction((1 << 15) - 1)


def _flag(name: str, meaning: str) -> Signal:
    return Signal.scalar(name, unit="1", meaning=f"{meaning}: 1 or 0", bound=Fraction(1))


def _by_mode(number: sp.Symbol, *values: sp.Expr | int) -> sp.Expr:
    """Return the value of a mode by its number, of those of off, align, navigate and attitude."""
    pairs = [(value, number >= k - _HALF) for k, value in enumerate(values) if k and value != values[k - 1]]
    return sp.Piecewise(*reversed(pairs), (values[0], True))


def hysteresis() -> Kernel:
    """Return a switch with two thresholds: on from the upper one, off below the lower one, and as it was between them.

    Returns: inputs ``is_on``, a state, ``value``, ``lower`` and ``upper``, in one unit; output ``next_is_on``.
    """
    build = KernelBuilder()
    state = _flag("is_on", "whether the switch is on")
    before = build.scalar(state)
    value, lower, upper = (
        build.scalar(Signal.scalar(name, unit=ANY, meaning=meaning))
        for name, meaning in (
            ("value", "what is watched"),
            ("lower", "threshold below which the switch goes off"),
            ("upper", "threshold from which the switch is on, not below the lower one"),
        )
    )
    build.feedback(state, [sp.Piecewise((1, value >= upper), (before, value >= lower), (0, True))])
    return build.kernel(
        "hysteresis",
        "Switch with two thresholds",
        f"{FENNER} and LTR-81 name it; thresholds lost, derived",
        notes=("Unit any stands for the unit of the value.",),
    )


def mode_sequence() -> Kernel:
    """Return a cycle of the modes: the next mode, the cycles until it is ready, and whether velocities are set to zero.

    From off the reference aligns, and navigates after the alignment if that is selected. Below a ground speed it goes
    back to a short alignment, which lasts its time whatever is selected. Attitude has priority, and only off ends it.

    Returns: inputs ``mode`` and ``left``, states, ``selected``, ``ground_speed`` in m/s, ``slow``, the speed below
    which an alignment begins again, and the cycles ``alignment``, ``realignment`` and ``attitude_start``; outputs
    ``next_mode``, ``next_left``, ``ready`` and ``reset``. Modes are the numbers of `MODES`.
    """
    build = KernelBuilder()
    numbers = ", ".join(f"{number} {name}" for number, name in enumerate(MODES))
    mode = Signal.scalar("mode", unit="1", meaning=f"mode: {numbers}", bound=Fraction(3))
    left = Signal.scalar("left", unit="1", meaning="cycles until the mode is ready", bound=_MOST_CYCLES)
    m, rest, wanted = map(build.scalar, (mode, left, replace(mode, name="selected", elements=("selected",))))
    speed, slow, full, short, start = (
        build.scalar(Signal.scalar(name, unit=unit, meaning=meaning, bound=bound))
        for name, unit, meaning, bound in (
            ("ground_speed", "m/s", "horizontal velocity relative to the earth", Fraction(2108)),
            ("slow", "m/s", "speed below which an alignment may begin; printed 20 knots", Fraction(2108)),
            ("alignment", "1", "cycles of one from off; printed 10 s and 10 min", _MOST_CYCLES),
            ("realignment", "1", "cycles of one after navigation; printed 30 s", _MOST_CYCLES),
            ("attitude_start", "1", "cycles until full performance; printed 20 s", _MOST_CYCLES),
        )
    )
    # A row has a column for each mode, of those selected first.
    stopped = build.value(
        "stopped", sp.Piecewise((2, speed >= slow), (1, True)), "navigation, align selected"
    )
    aligned = build.value("aligned", sp.Piecewise((2, rest <= 1), (1, True)), "align, navigation selected")
    rows = ((0, 1, 1, 3), (0, 1, aligned, 3), (0, stopped, 2, 3), (0, 3, 3, 3))
    after = [
        build.value(f"after_{name}", _by_mode(wanted, *row), f"mode after {name}")
        for name, row in zip(MODES, rows, strict=True)
    ]
    new = build.value("new", _by_mode(m, *after), "next mode")
    going_on = build.value("going_on", sp.Max(rest - 1, 0), "cycles left of what goes on")
    in_align = build.value(
        "in_align", _by_mode(m, full, going_on, short, full), "cycles left of an alignment"
    )
    in_attitude = build.value(
        "in_attitude", _by_mode(m, start, start, start, going_on), "cycles left of the start"
    )
    remaining = build.value("remaining", _by_mode(new, 0, in_align, 0, in_attitude), "cycles left")
    over = build.value(
        "over", sp.Piecewise((0, remaining >= _HALF), (1, True)), "whether none is left: 1 or 0"
    )
    moved = build.value("moved", _by_mode(m, 0, 0, 1, 0), "whether the mode was navigate: 1 or 0")
    build.feedback(mode, [new])
    build.feedback(left, [remaining])
    build.output(_flag("ready", "whether the mode is on, no cycles left"), [_by_mode(new, 0, over, 1, over)])
    build.output(_flag("reset", "whether velocities are set to zero"), [_by_mode(new, 0, moved, 0, 0)])
    return build.kernel(
        "mode-sequence",
        "Sequence of the modes off, align, navigate and attitude",
        f"{FENNER}, sequences and times printed in words, recursion derived",
        notes=(
            "Times are counted in cycles, which every word holds exactly; one of more than 32767 takes a slower cycle.",
        ),
    )
