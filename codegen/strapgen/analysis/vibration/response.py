"""Derives in closed form the mean growth that a kernel computes under vibration, to second order in the amplitudes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import sympy as sp

from strapgen.analysis.vibration.systems import CHANNELS, T_L, T_M, F, System, T
from strapgen.analysis.vibration.waves import Number, Shift, Wave, combine, resolvent
from strapgen.ir.exceptions import InputError

#: Two channels, in the order of `CHANNELS`.
Pair = tuple[str, str]


class Form(NamedTuple):
    """The complex factor H of two channels with amplitudes a and b, whose mean rate is the real part of H a b*."""

    #: Functions of the frequency f in Hz and the times of the algorithm in s
    real: sp.Expr
    imaginary: sp.Expr


class _Motion(NamedTuple):
    """A state to first order: its oscillation with the samples, and the part that is constant over a slow cycle."""

    wave: dict[str, Wave]
    constant: dict[str, Wave]


def forms(system: System) -> dict[Pair, Form]:
    """Return the factors of all pairs of channels, averaged over the phase of the vibration.

    The samples are s_k(l) = Re(sigma_k z^l) with z = exp(j omega T). To first order the states follow from
    x(l + 1) = P x(l) + R s(l), so x(l) = Re(U z^l + V) with U = (z I - P)^-1 R sigma; V makes a state that is reset
    start from zero. The watched sum grows by products of two states or samples, and the mean of Re(u z^l) Re(v z^l) is
    Re(u v*)/2.
    """
    states = list(system.following)
    domain = system.domain
    zero, one = domain.zero, domain.one
    matrix = [[system.following[i].linear.get(k, zero) for k in states] for i in states]
    _require_sum(system, states, matrix)
    motions = _motions(system, states, matrix, one)
    for name, waves in system.samples.items():
        motions[name] = _Motion(waves, {})
    quadratic: dict[tuple[str, str], Number] = {}
    for name, weight in system.watched.items():
        for pair, c in system.following[name].square.items():
            quadratic[pair] = quadratic.get(pair, zero) + weight * c
    half = domain.from_sympy(sp.S.Half)
    steady: dict[Pair, Wave] = {}
    ending: dict[Pair, Wave] = {}
    for (a, b), c in quadratic.items():
        if c:
            _collect(system, steady, ending, motions[a], motions[b], half * c)
    cycle = T if system.slow_cycle is None else T_L
    factors = {}
    for pair in sorted({*steady, *ending}, key=lambda pair: tuple(map(CHANNELS.index, pair))):
        parts = [(steady.get(pair), cycle), (ending.get(pair), T_M)]
        parts_in_time = [_form(system, wave, time) for wave, time in parts if wave is not None and wave.terms]
        form = Form(sp.Add(*(m.real for m in parts_in_time)), sp.Add(*(m.imaginary for m in parts_in_time)))
        if form != (0, 0):
            factors[pair] = form
    return factors


def _require_sum(system: System, states: list[str], matrix: list[list[Number]]) -> None:
    zero = system.domain.zero
    for column, name in enumerate(states):
        total = sum(
            (weight * matrix[states.index(row)][column] for row, weight in system.watched.items()), zero
        )
        if total != system.watched.get(name, zero):
            raise InputError(
                f"kernel {system.kernel.name} does not hand on what it sums: without samples it does not stay"
            )


def _motions(
    system: System, states: list[str], matrix: list[list[Number]], one: Number
) -> dict[str, _Motion]:
    """Return the states to first order."""
    inverse = resolvent(matrix, one)
    if inverse is None:
        raise InputError(f"kernel {system.kernel.name} has states that neither stay nor go to zero at once")
    powers, zeros, ones = inverse
    channels = list(dict.fromkeys(channel for waves in system.samples.values() for channel in waves))
    driven = {
        name: {
            channel: combine(
                system.cycle,
                [
                    (c, system.samples[sample][channel])
                    for sample, c in system.following[name].linear.items()
                    if channel in system.samples.get(sample, {})
                ],
            )
            for channel in channels
        }
        for name in states
    }
    motions: dict[str, _Motion] = {}
    for i, name in enumerate(states):
        waves = {}
        for channel in channels:
            total = Wave(system.cycle, {})
            for power, adjugate in enumerate(powers):
                shift = tuple((power - zeros) * length for length in system.cycle)
                row = [(adjugate[i][k], driven[other][channel]) for k, other in enumerate(states)]
                total = total + combine(system.cycle, row).shifted(shift)
            for _ in range(ones):
                total = total.summed()
            waves[channel] = total
        constant = {}
        if name in system.reset:
            constant = {channel: wave.scaled(-one) for channel, wave in waves.items()}
        motions[name] = _Motion(waves, constant)
    for i, name in enumerate(states):  # a constant part must not change within a slow cycle
        for channel in channels:
            held = [(matrix[i][k], motions[other].constant.get(channel)) for k, other in enumerate(states)]
            moved = combine(system.cycle, [(c, wave) for c, wave in held if wave is not None])
            constant_after = motions[name].constant.get(channel) or Wave(system.cycle, {})
            if (moved + constant_after.scaled(-one)).terms:
                raise InputError(
                    f"kernel {system.kernel.name} grows to first order within a slow cycle, or forgets what begins anew"
                )
    return motions


def _collect(
    system: System,
    steady: dict[Pair, Wave],
    ending: dict[Pair, Wave],
    left: _Motion,
    right: _Motion,
    factor: Number,
) -> None:
    """Add the mean of a product, both the part of every cycle and the part of a slow cycle as a whole."""
    for a in left.wave:
        for b in right.wave:
            pair, swapped = ((a, b), False) if CHANNELS.index(a) <= CHANNELS.index(b) else ((b, a), True)
            constants = left.constant.get(a), right.constant.get(b)
            per_cycle = left.wave[a] * right.wave[b].conjugate()
            if constants[0] is not None and constants[1] is not None:
                per_cycle = per_cycle + constants[0] * constants[1].conjugate()
            at_end = Wave(system.cycle, {})
            if constants[1] is not None:
                at_end = at_end + _over_cycles(system, left.wave[a]) * constants[1].conjugate()
            if constants[0] is not None:
                at_end = at_end + constants[0] * _over_cycles(system, right.wave[b]).conjugate()
            for total, wave in ((steady, per_cycle), (ending, at_end)):
                scaled = wave.scaled(factor)
                scaled = scaled.conjugate() if swapped else scaled
                total[pair] = total[pair] + scaled if pair in total else scaled


def _over_cycles(system: System, wave: Wave) -> Wave:
    """Return the sum of wave z^l over the cycles of a slow cycle, which is wave (exp(j omega T_m) - 1)/(z - 1)."""
    assert system.slow_cycle is not None
    one = system.domain.one
    return (wave.shifted(system.slow_cycle) + wave.scaled(-one)).summed()


def _form(system: System, wave: Wave, time: sp.Symbol) -> Form:
    """Write a wave, divided by a time, in sines and cosines.

    It uses 1/(z - 1) = exp(-j omega T/2)/(2 j sin(omega T/2)).
    """
    cycle = _time(system, wave.cycle)
    cosines: dict[sp.Expr, sp.Expr] = {}
    sines: dict[sp.Expr, sp.Expr] = {}
    for shift, c in wave.terms.items():
        angle = sp.expand(2 * sp.pi * F * (_time(system, shift) - wave.poles * cycle / 2))
        sign = 1
        if angle.could_extract_minus_sign():
            angle, sign = -angle, -1
        number = system.domain.to_sympy(c)
        cosines[angle] = cosines.get(angle, sp.S.Zero) + number
        sines[angle] = sines.get(angle, sp.S.Zero) + sign * number
    real = sp.Add(*(sp.expand(c) * sp.cos(angle) for angle, c in cosines.items()))
    imaginary = sp.Add(*(sp.expand(c) * sp.sin(angle) for angle, c in sines.items()))
    for _ in range(wave.poles):  # each divides by j
        real, imaginary = imaginary, -real
    below = time * (2 * sp.sin(sp.pi * F * cycle)) ** wave.poles
    above = (2 * sp.pi * F * cycle) ** 2 if system.rates else sp.S.One
    return Form(_distribute(real, above / below), _distribute(imaginary, above / below))


def _distribute(total: sp.Expr, factor: sp.Expr) -> sp.Expr:
    return sp.Add(*(factor * term for term in sp.Add.make_args(total)))


def _time(system: System, shift: Shift) -> sp.Expr:
    return sp.Add(*(count * time for count, time in zip(shift, system.times, strict=True)))


def true_forms(kind: str, endless: bool) -> dict[Pair, Form]:
    """Return the factors of the true mean rate of an integral, from its definition.

    `kind`: "coning" is half the integral of beta x w, equation (22); "S1" the integral of beta x a; "S2" half
    the integral of beta x a + u x w, equation (50). Here beta and u are the integrals of w and a since the slow
    cycle began.
    """
    omega = sp.Symbol("omega", positive=True)
    # beta or u over its amplitude is exp(j omega t) - 1, and w or a is its derivative. The mean of their product with
    # one conjugated is (1/T_m) integral_0^T_m (exp(j omega t) - 1) (-j omega) exp(-j omega t) dt
    # = -j omega + (1 - exp(-j omega T_m))/T_m, whose second part is lost in a very long time.
    mean = -sp.I * omega
    if not endless:
        mean += (1 - sp.exp(-sp.I * omega * T_M)) / T_M
    half = sp.Rational(1, 2)  # of the mean over the phase
    turned = half * mean, half * sp.conjugate(mean)
    parts: Mapping[Pair, Any]
    if kind == "coning":
        parts = {("angle_x", "angle_y"): (turned[0] - turned[1]) / 2}
    elif kind == "S1":
        parts = {("angle_x", "velocity_y"): turned[0], ("angle_y", "velocity_x"): -turned[0]}
    else:
        both = (turned[0] - turned[1]) / 2
        parts = {("angle_x", "velocity_y"): both, ("angle_y", "velocity_x"): -both}
    return {
        pair: Form(*(sp.expand(part).subs(omega, 2 * sp.pi * F) for part in value.as_real_imag()))
        for pair, value in parts.items()
    }
