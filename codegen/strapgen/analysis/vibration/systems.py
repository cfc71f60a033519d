"""Writes a kernel under assessment as a recursion, with its states, its samples of the vibration, and a watched sum."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm
from typing import Any

import sympy as sp

from strapgen import catalogue, pipeline
from strapgen.analysis.vibration.waves import Expander, Expansion, Number, Shift, Wave
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.fixed_settings import NODE_ROTATIONS
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import exact
from strapgen.kernel.kernel import Kernel
from strapgen.kernel.power_series import Powers

#: Frequency in Hz, step of an attitude algorithm, fast and slow cycle of a recursion in s.
F, T, T_L, T_M = sp.symbols("f T T_l T_m", positive=True)

#: Oscillating channels: angles in rad and velocities in m/s on the axes x and y.
ANGLES, VELOCITIES = ("angle_x", "angle_y"), ("velocity_x", "velocity_y")
CHANNELS = (*ANGLES, *VELOCITIES)
#: Names of inputs that are samples of the vibration.
SAMPLES = ("increments", "increment", *NODE_ROTATIONS, "velocity_increments", "velocity_increment")
#: Kernels of the catalogue that accumulate sums over a slow cycle.
RECURSIONS = ("coning-fast", "sculling-fast-1", "sculling-fast-2", "two-speed-fast-1", "two-speed-fast-2")
#: Vectors of a step that have a mean rate.
VECTORS = ("rotation-vector", "sculling", "velocity-position")
#: Kernels of the catalogue that can be assessed.
NAMES = (*catalogue.ALGORITHMS, *VECTORS, *RECURSIONS)
#: The kernel that computes attitude and velocity after a step from its rotation vector and sculling term.
_SLOW_LOOP = "dcm-two-speed-slow-2"
#: The output that is the whole change of velocity, and not what comes on top of the sum of the increments.
_WHOLE_CHANGE = "velocity_change"


@dataclass(frozen=True)
class System:
    """A kernel to second order, with the samples that drive it."""

    kernel: Kernel
    #: The field of all numbers
    domain: Any
    #: Every element of the states after a call as a function of the elements before it and of the samples
    following: dict[str, Expansion]
    #: Elements that are reset to zero in every slow cycle; may be empty
    reset: frozenset[str]
    #: The response of every element of the samples to every channel
    samples: dict[str, dict[str, Wave]]
    #: The time from call to call as a shift
    cycle: Shift
    #: The slow cycle as a shift; None if the recursion has no end
    slow_cycle: Shift | None
    #: Basic times of the shifts in s
    times: tuple[sp.Expr, ...]
    #: Weights of the elements in the sum whose growth is assessed
    watched: dict[str, Number]
    #: Its unit: rad or m/s
    unit: str
    #: Whether the samples are rates times the cycle, so that the waves have to be multiplied by j omega T
    rates: bool = False


def of(
    kernel: Kernel,
    unit: str = "rad",
    nodes: Sequence[Fraction | sp.Expr] = (),
    previous: int = 0,
    ahead: int = 0,
) -> System:
    """Return the system of a kernel.

    `unit`: for a recursion that sums coning and sculling, the one to assess: "rad" or "m/s".
    """
    sampled = [signal for signal in require_kernel(kernel).inputs if signal.name in SAMPLES]
    if not any(signal.unit == "rad" for signal in sampled):
        raise InputError(
            f"kernel {kernel.name} takes no samples of a vibration; allowed: {', '.join(NAMES)}, or a kernel of your "
            "own that takes angle increments"
        )
    if kernel.attitude_step is not None:
        return _of_step(kernel, sampled, nodes)
    if kernel.recursion is not None:
        return _of_recursion(kernel, sampled, unit)
    _check_beside(sampled[0], previous, ahead)
    return _of_vector(kernel, sampled, nodes, (previous, ahead))


def _check_beside(signal: Signal, previous: int, ahead: int) -> None:
    """Refuse numbers of samples from beside a step that leave none for the step itself."""
    before = checks.count("previous", previous, smallest=0, largest=signal.size // 3 - 1)
    ahead = checks.count("ahead", ahead, smallest=0, largest=signal.size // 3 - 1 - before)


def require_kernel(kernel: Any) -> Kernel:
    """Return the argument if it is a kernel."""
    if not isinstance(kernel, Kernel):
        raise InputTypeError(f"kernel is {kernel!r}; a Kernel is needed")
    return kernel


def _of_step(kernel: Kernel, sampled: Sequence[Signal], nodes: Sequence[Fraction | sp.Expr]) -> System:
    assert kernel.attitude_step is not None
    name = kernel.attitude_step.attitude
    attitude = None if name is None else catalogue.companion(kernel, name)
    expander = Expander([kernel] if attitude is None else [kernel, attitude])
    state, output = kernel.inputs[0], kernel.outputs[-1].signal
    initial = {
        element: expander.variable(element, exact(value))
        for element, value in zip(state.elements, kernel.attitude_step.identity, strict=True)
    }
    beside = kernel.attitude_step.previous, kernel.attitude_step.ahead
    samples, times, cycle = _waves(expander, kernel, sampled, beside, nodes)
    following = expander(kernel, initial | _variables(expander, samples))[output.name]
    if attitude is None:
        matrix = list(initial.values())
    else:
        shown = attitude.inputs[0].elements
        (matrix,) = expander(attitude, dict(zip(shown, initial.values(), strict=True))).values()
    return System(
        kernel=kernel,
        domain=expander.domain,
        following=_states_after(kernel, expander, initial, dict(zip(state.elements, following, strict=True))),
        reset=frozenset(),
        samples=samples,
        cycle=cycle,
        slow_cycle=None,
        times=times,
        watched=_rotation_about_z(expander, matrix),
        unit="rad",
        rates=sampled[0].name in NODE_ROTATIONS,
    )


def _rotation_about_z(expander: Expander, matrix: Sequence[Powers]) -> dict[str, Number]:
    """Return the rotation about z, (C21 - C12)/2, to first order in the elements of the state."""
    return expander.expansion((matrix[3] - matrix[1]) * expander.number(sp.S.Half)).linear


def _of_vector(
    kernel: Kernel, sampled: Sequence[Signal], nodes: Sequence[Fraction | sp.Expr], beside: tuple[int, int]
) -> System:
    slow = pipeline.derive(Choice(_SLOW_LOOP))
    assert slow.recursion is not None
    expander = Expander([kernel, slow])
    whole = [stage.signal for stage in kernel.outputs if stage.signal.name == _WHOLE_CHANGE]
    output = (whole or [kernel.outputs[-1].signal])[0]
    if output.shape != (3,) or output.unit not in ("rad", "m/s"):
        raise InputError(f"kernel {kernel.name} gives {output.name}; a vector in rad or m/s can be assessed")
    samples, times, cycle = _waves(expander, kernel, sampled, beside, nodes)
    variables = _variables(expander, samples)
    vector = expander(kernel, variables)[output.name]
    inputs = {signal.name: signal for signal in slow.inputs}
    initial = {
        element: expander.variable(element)
        for name, _ in slow.recursion.states
        for element in inputs[name].elements
    }
    for k in (0, 4, 8):
        element = inputs["state"].elements[k]
        initial[element] = expander.variable(element, 1)
    slow_inputs = dict(initial)
    sums = {"angle_sum": vector} if output.unit == "rad" else {"sculling": vector}
    if output.unit == "m/s":
        for signal in sampled:
            name = "angle_sum" if signal.unit == "rad" else "velocity_sum"
            rows = [
                signal.elements[3 * k : 3 * k + 3] for k in range(beside[0], signal.size // 3 - beside[1])
            ]
            zero = expander.constant(0)
            counted = signal.unit == "rad" or not whole
            sums[name] = [
                sum((variables.get(e, zero) for e in axis if counted), zero)
                for axis in zip(*rows, strict=True)
            ]
    for name, elements in sums.items():
        slow_inputs |= dict(zip(inputs[name].elements, elements, strict=True))
    slow_outputs = expander(slow, slow_inputs)
    following = {
        element: value
        for name, after in slow.recursion.states
        for element, value in zip(inputs[name].elements, slow_outputs[after], strict=True)
    }
    if output.unit == "rad":
        watched = _rotation_about_z(expander, [initial[e] for e in inputs["state"].elements])
    else:
        watched = {inputs["navigation_velocity"].elements[2]: expander.domain.one}
    return System(
        kernel=kernel,
        domain=expander.domain,
        following=_states_after(kernel, expander, initial, following),
        reset=frozenset(),
        samples=samples,
        cycle=cycle,
        slow_cycle=None,
        times=times,
        watched=watched,
        unit=output.unit,
        rates=sampled[0].name in NODE_ROTATIONS,
    )


def _of_recursion(kernel: Kernel, sampled: Sequence[Signal], unit: str) -> System:
    assert kernel.recursion is not None
    checks.choice("unit", unit, ("rad", "m/s"))
    expander = Expander([kernel])
    inputs = {signal.name: signal for signal in kernel.inputs}
    other = (
        inputs.keys() - {name for name, _ in kernel.recursion.states} - {signal.name for signal in sampled}
    )
    if other:
        raise InputError(f"kernel {kernel.name} takes {', '.join(sorted(other))}, which is no sample")
    initial = {
        element: expander.variable(element)
        for name, _ in kernel.recursion.states
        for element in inputs[name].elements
    }
    samples, times, cycle = _waves(expander, kernel, sampled, (0, 0), (), T_L)
    outputs = expander(kernel, initial | _variables(expander, samples))
    following: dict[str, Powers] = {}
    summed = []
    for name, after in kernel.recursion.states:
        signal = inputs[name]
        following |= dict(zip(signal.elements, outputs[after], strict=True))
        if (
            signal.unit == unit
            and signal.shape == (3,)
            and any(expander.expansion(element).square for element in outputs[after])
        ):
            summed.append(signal)
    if len(summed) != 1:
        raise InputError(
            f"kernel {kernel.name} has {len(summed) or 'no'} states in {unit} that sum products of samples; "
            "one is needed"
        )
    anew = frozenset(element for name in kernel.recursion.reset for element in inputs[name].elements)
    return System(
        kernel=kernel,
        domain=expander.domain,
        following=_states_after(kernel, expander, initial, following),
        reset=anew,
        samples={
            name: {channel: _with_end(wave) for channel, wave in waves.items()}
            for name, waves in samples.items()
        },
        cycle=(*cycle, 0),
        slow_cycle=(*(0 for _ in cycle), 1),
        times=(*times, T_M),
        watched={summed[0].elements[2]: expander.domain.one},
        unit=unit,
    )


def _with_end(wave: Wave) -> Wave:
    """Return a wave with the slow cycle as a further basic time."""
    return Wave((*wave.cycle, 0), {(*shift, 0): c for shift, c in wave.terms.items()}, wave.poles)


def _variables(expander: Expander, samples: Iterable[str]) -> dict[str, Powers]:
    return {name: expander.variable(name) for name in samples}


def _states_after(
    kernel: Kernel, expander: Expander, initial: Mapping[str, Powers], following: Mapping[str, Powers]
) -> dict[str, Expansion]:
    """Return the elements after a call as expansions; refuse a kernel that changes them without samples."""
    for name, value in following.items():
        if value.start != initial[name].start:
            raise InputError(f"kernel {kernel.name} does not rest: {name} changes without any motion")
    return {name: expander.expansion(value) for name, value in following.items()}


def _waves(
    expander: Expander,
    kernel: Kernel,
    sampled: Sequence[Signal],
    beside: tuple[int, int],
    nodes: Sequence[Fraction | sp.Expr],
    cycle: sp.Symbol = T,
) -> tuple[dict[str, dict[str, Wave]], tuple[sp.Expr, ...], Shift]:
    """Return the responses of the samples to the channels, the basic times in s, and the cycle as a shift."""
    if sampled[0].name in NODE_ROTATIONS:
        return _waves_of_rates(expander, kernel, sampled[0], nodes, cycle)
    previous = beside[0]
    counts = {signal.size // 3 - sum(beside) for signal in sampled}
    if len(counts) != 1:
        raise InputError(f"kernel {kernel.name} takes different numbers of angle and velocity increments")
    (count,) = counts
    one = expander.domain.one
    waves: dict[str, dict[str, Wave]] = {}
    for signal in sampled:
        channels = ANGLES if signal.unit == "rad" else VELOCITIES
        for k in range(signal.size // 3):
            wave = Wave((count,), {(k - previous + 1,): one, (k - previous,): -one})
            for axis, channel in enumerate(channels):
                waves[signal.elements[3 * k + axis]] = {channel: wave}
    return waves, (cycle / count,), (count,)


def _waves_of_rates(
    expander: Expander,
    kernel: Kernel,
    signal: Signal,
    nodes: Sequence[Fraction | sp.Expr],
    cycle: sp.Symbol,
) -> tuple[dict[str, dict[str, Wave]], tuple[sp.Expr, ...], Shift]:
    if len(nodes) != signal.shape[0]:
        raise InputError(
            f"kernel {kernel.name} takes the rate at {signal.shape[0]} nodes; they must be given"
        )
    values = [sp.sympify(exact(node)) for node in nodes]
    whole = lcm(*(int(value.q) for value in values if value.is_Rational), 1)
    others = list(dict.fromkeys(value for value in values if not value.is_Rational))
    size = 1 + len(others)
    period = (whole, *(0 for _ in others))
    waves = {}
    for k, value in enumerate(values):
        shift = [0] * size
        if value.is_Rational:
            shift[0] = int(value * whole)
        else:
            shift[1 + others.index(value)] = 1
        for axis, channel in enumerate(ANGLES):
            wave = Wave(period, {tuple(shift): expander.domain.one})
            waves[signal.elements[3 * k + axis]] = {channel: wave}
    return waves, (cycle / whole, *(cycle * value for value in others)), period
