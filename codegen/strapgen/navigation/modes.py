"""Modes of a reference: a switch with two thresholds, and the sequence of off, align, navigate and attitude."""

from __future__ import annotations

from fractions import Fraction

import sympy as sp

from strapgen.ir.signals import ANY, Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_rates import FENNER

#: The modes by their numbers.
MODES = ("off", "align", "navigate", "attitude")
_OFF, _ALIGN, _NAVIGATE, _ATTITUDE = map(sp.Integer, range(4))
#: Most cycles that a mode lasts until it is ready: 600 s at 50 Hz are 30000.
_MOST_CYCLES = Fraction((1 << 15) - 1)


def _flag(name: str, meaning: str) -> Signal:
    return Signal.scalar(name, unit="1", meaning=f"{meaning}: 1 or 0", bound=Fraction(1))


def hysteresis() -> Kernel:
    """Return a switch with two thresholds: on from the upper one, off below the lower one, and as it was between them.

    Returns: inputs ``switch``, a state, ``value``, ``lower`` and ``upper``, in one unit; output ``next_switch``.
    """
    build = KernelBuilder()
    state = _flag("switch", "whether the switch is on")
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
    mode, selected = (
        Signal.scalar(name, unit="1", meaning=f"{meaning}: {numbers}", bound=Fraction(3))
        for name, meaning in (("mode", "mode of the reference"), ("selected", "mode that is selected"))
    )
    left = Signal.scalar("left", unit="1", meaning="cycles until the mode is ready", bound=_MOST_CYCLES)
    m, rest, wanted = build.scalar(mode), build.scalar(left), build.scalar(selected)
    speed, slow = (
        build.scalar(Signal.scalar(name, unit="m/s", meaning=meaning, bound=Fraction(2108)))
        for name, meaning in (
            ("ground_speed", "horizontal velocity relative to the earth"),
            ("slow", "ground speed below which an alignment may begin again; printed 20 knots"),
        )
    )
    full, short, start = (
        build.scalar(Signal.scalar(name, unit="1", meaning=meaning, bound=_MOST_CYCLES))
        for name, meaning in (
            ("alignment", "cycles of an alignment from off; printed 10 s and 10 min"),
            ("realignment", "cycles of an alignment after navigation; printed 30 s"),
            ("attitude_start", "cycles until full performance of the attitude mode; printed 20 s"),
        )
    )

    def is_at_least(value: sp.Symbol, number: sp.Integer) -> sp.Expr:
        """Compare numbers of modes half way to the one below."""
        return value >= number - sp.Rational(1, 2)

    def choose(name: str, meaning: str, *cases: tuple[sp.Expr, sp.Expr]) -> sp.Symbol:
        """Name the value of the first case that holds; one without a condition holds."""
        return build.value(name, sp.Piecewise(*cases), meaning)

    fast = choose("fast", "mode after navigation, align selected", (_NAVIGATE, speed >= slow), (_ALIGN, True))
    aligned = choose(
        "aligned", "mode after an alignment, navigation selected", (_NAVIGATE, rest <= 1), (_ALIGN, True)
    )
    moving = choose(
        "moving", "mode after navigation", (_NAVIGATE, is_at_least(wanted, _NAVIGATE)), (fast, True)
    )
    waiting = choose(
        "waiting", "mode after aligning", (aligned, is_at_least(wanted, _NAVIGATE)), (_ALIGN, True)
    )
    free = choose(
        "free",
        "mode without off and attitude",
        (moving, is_at_least(m, _NAVIGATE)),
        (waiting, is_at_least(m, _ALIGN)),
        (_ALIGN, True),
    )
    level = choose(
        "level",
        "mode without off, not attitude before",
        (_ATTITUDE, is_at_least(wanted, _ATTITUDE)),
        (free, True),
    )
    held = choose("held", "mode without off", (_ATTITUDE, is_at_least(m, _ATTITUDE)), (level, True))
    after = choose("after", "next mode", (held, is_at_least(wanted, _ALIGN)), (_OFF, True))
    # Align and attitude last their cycles, and the others none.
    begun = choose(
        "begun", "cycles of an alignment that begins", (short, is_at_least(m, _NAVIGATE)), (full, True)
    )
    going_on = build.value("going_on", sp.Max(rest - 1, 0), "cycles left of what goes on")
    in_alignment = choose(
        "in_alignment",
        "cycles left of an alignment",
        (begun, is_at_least(m, _NAVIGATE)),
        (going_on, is_at_least(m, _ALIGN)),
        (begun, True),
    )
    in_attitude = choose(
        "in_attitude",
        "cycles left until full performance",
        (going_on, is_at_least(m, _ATTITUDE)),
        (start, True),
    )
    moved = choose(
        "moved", "whether the mode was navigate or attitude", (1, is_at_least(m, _NAVIGATE)), (0, True)
    )
    build.feedback(mode, [after])
    following = build.feedback(
        left,
        [
            sp.Piecewise(
                (in_attitude, is_at_least(after, _ATTITUDE)),
                (0, is_at_least(after, _NAVIGATE)),
                (in_alignment, is_at_least(after, _ALIGN)),
                (0, True),
            )
        ],
    )[0]
    build.output(
        _flag("ready", "whether the mode is on and has no cycles left"),
        [sp.Piecewise((0, following >= sp.Rational(1, 2)), (1, is_at_least(after, _ALIGN)), (0, True))],
    )
    build.output(
        _flag("reset", "whether velocities are set to zero, since an alignment begins"),
        [sp.Piecewise((0, is_at_least(after, _NAVIGATE)), (moved, is_at_least(after, _ALIGN)), (0, True))],
    )
    return build.kernel(
        "mode-sequence",
        "Sequence of the modes off, align, navigate and attitude",
        f"{FENNER}, sequences and times printed in words, recursion derived",
        notes=("Times are counted in cycles, which every word holds exactly.",),
    )
