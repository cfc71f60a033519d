"""Preintegration: rotation, velocity and position between two instants, with their covariance and bias Jacobian.

The sums begin at the identity and at zero, and take in one step a call, in the frame of the body at the first instant:
p+ = p + v h + R dr, v+ = v + R dv, R+ = R dR. Gravity, the Earth rate and the velocity at the first instant are in none
of them; they are the factor's. A bias adds the same to every sample, so that the derivatives of a step by it are those
of its formulas along such a change, exactly: of the filters only that of c_0 passes it.

Errors are x = (theta, v, p): right ones in the rotation, R_computed = R_true exp(theta x), with theta in the axes at
the last instant, and sums in v and p. The left one, in the axes at the first instant, is R theta.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations_with_replacement

import sympy as sp

from strapgen.catalogue.kernels import velocity_position
from strapgen.catalogue.kernels.attitude_step import chosen
from strapgen.catalogue.kernels.velocity_position import SERIES
from strapgen.catalogue.methods.method import Method
from strapgen.ir.signals import Signal
from strapgen.kernel import algebra
from strapgen.kernel.algebra import cross, skew
from strapgen.kernel.derivatives import add_tangents
from strapgen.kernel.kernel import Kernel, KernelBuilder, symbols

#: Parts of the error state, with their units, in the order of its covariance.
PARTS = {"rotation": "rad", "velocity": "m/s", "position": "m"}
#: Nonzero blocks of the bias Jacobian: derivatives of a part by the bias of the rate and of the specific force.
BLOCKS = tuple(
    (part, bias) for part in PARTS for bias in ("rate", "force") if (part, bias) != ("rotation", "force")
)
#: Elements of the upper triangle of the covariance.
UPPER = tuple(combinations_with_replacement(range(9), 2))
_BIASES = {"rate": "rate", "force": "specific force"}
_BIAS_UNITS = {"rate": "rad/s", "force": "m/s^2"}


def step(method: Method, increments: int, previous: int = 0, ahead: int = 0) -> Kernel:
    """Derive the sums after a step from those before it."""
    build = KernelBuilder()
    turn, changes = velocity_position.changes_over_step(build, method, (increments, previous, ahead))
    h = build.scalar(Signal.scalar("interval", unit="s", meaning="length of the step"))
    changed = {
        part: _named(build, f"{part}_change", value, "m/s", f"{part} change, axes at the start of the step")
        for part, value in changes.items()
    }
    by_samples = _by_samples(build, turn, changes["velocity"], changed, sp.Rational(1, increments))
    sums = _Sums(build)
    r = sums.states["rotation"]
    dr = _matrix(
        build, "step_rotation", algebra.rotation(turn.vector, SERIES, turn.square), "rotation of the step"
    )
    # By samples that all change alike: the right turn, and velocity and position in the axes at the first instant.
    inputs = {("rotation", "rate"): dr.T * by_samples["rotation", "rate"]} | {
        (part, bias): r * by_samples[part, bias] * (h if part == "position" else 1)
        for part, bias in BLOCKS[1:]
    }
    inputs = {
        block: _matrix(
            build, "_by_".join(block) + "_samples", value, f"{block[0]} by samples of the {block[1]}"
        )
        for block, value in inputs.items()
    }
    levers = {
        part: _matrix(
            build,
            f"{part}_lever",
            r * skew(changed[part] * (h if part == "position" else 1)),
            f"{part} by a turn before the step",
        )
        for part in changed
    }
    nexts: dict[str, Sequence[sp.Expr]] = {
        "rotation": r * dr,
        "velocity": sums.states["velocity"] + r * changed["velocity"],
        "position": sums.states["position"] + h * (sums.states["velocity"] + r * changed["position"]),
        "covariance": _covariance(build, sums.covariance, sums.noise, dr, levers, inputs, h),
    }
    for part, bias in BLOCKS:
        total = sums.states[f"{part}_by_{bias}"]
        if part == "rotation":
            total = dr.T * total
        elif bias == "rate":
            total = total - levers[part] * sums.states["rotation_by_rate"]
        if part == "position":
            total = total + h * sums.states[f"velocity_by_{bias}"]
        nexts[f"{part}_by_{bias}"] = total - h * inputs[part, bias]
    for name, signal in sums.signals.items():
        build.feedback(signal, nexts[name])
    suffix, option, source = chosen(method, increments, previous, ahead)
    return build.kernel(
        f"preintegrate-{suffix}",
        f"Preintegration of a step by {method.title} from {source}".replace("angle ", "angle and velocity "),
        f"{method.source}; velocity and position by transference; covariance and bias Jacobian to first order, as C. "
        "Forster et al., IEEE Trans. Robotics 33 (2017) 1-21, with the derivatives of the step itself",
        order=method.step_order(increments, previous, ahead),
        arguments=f"preintegrate {option}",
        previous=previous,
        ahead=ahead,
        notes=(
            "Errors: R_computed = R_true exp(theta x), theta in the axes at the last instant, left: R theta; sums in v "
            "and p, in the axes at the first one.",
            "Noise enters by the samples of the step alone; what neighbouring steps share by a window's other filters, "
            "about |c_0| |F_1|/6 of a standard deviation, is left out.",
            "Gravity, the Earth rate and the velocity at the first instant are in none of the sums.",
        ),
    )


class _Sums:
    """The inputs of a step that come from the one before, and the noise."""

    def __init__(self, build: KernelBuilder) -> None:
        frame = "axes then, no gravity"
        signals = [
            Signal.matrix(
                "rotation",
                "R",
                meaning="rotation since the first instant, body axes to those then, by rows",
                constraint="rotation",
                frame="b to n",
            ),
            *(
                Signal.vector(
                    part,
                    part,
                    unit=PARTS[part],
                    meaning=f"{part} since the first instant, {frame}",
                    frame="n",
                )
                for part in ("velocity", "position")
            ),
            *(
                Signal.matrix(
                    f"{part}_by_{bias}",
                    f"{part}_by_{bias}",
                    unit=f"({PARTS[part]})/({_BIAS_UNITS[bias]})",
                    meaning=f"derivative of the {'right ' if part == 'rotation' else ''}{part} by the bias of the "
                    f"{_BIASES[bias]}, row by row",
                )
                for part, bias in BLOCKS
            ),
            Signal.labelled(
                "covariance",
                "P",
                [f"{j}_{k}" for j, k in UPPER],
                constraint="covariance",
                meaning="covariance of rotation, velocity, position in SI, upper triangle by rows",
            ),
        ]
        self.signals = {signal.name: signal for signal in signals}
        flat = {signal.name: build.input(signal) for signal in signals}
        self.states = flat
        self.covariance: sp.Matrix = sp.zeros(9, 9)
        for (j, k), element in zip(UPPER, flat["covariance"], strict=True):
            self.covariance[j, k] = self.covariance[k, j] = element
        self.noise: dict[str, sp.Matrix] = {
            bias: build.input(
                Signal.vector(
                    f"{bias}_noise",
                    f"{bias}_noise",
                    unit=unit,
                    meaning=f"variance of the noise of the {what} over the step, each axis",
                    frame="b",
                )
            )
            for bias, unit, what in (
                ("rate", "rad^2", "angle increment"),
                ("force", "(m/s)^2", "velocity increment"),
            )
        }


def _by_samples(
    build: KernelBuilder,
    turn: velocity_position.StepRotation,
    velocity: sp.Matrix,
    changed: dict[str, sp.Matrix],
    part: sp.Rational,
) -> dict[tuple[str, str], sp.Matrix]:
    """Return the derivatives of the step's changes by the sum of its samples, of which each takes the same part.

    They are in the axes at its start; those of the left rotation by the rate are those of the velocity by the force, by
    transference, also where the position follows from the `velocity`.
    """
    stages = tuple(build.stages)
    columns: dict[tuple[str, str], list[sp.Matrix]] = {block: [] for block in BLOCKS}
    angles, forces = (symbols(signal) for signal in build.inputs[:2])
    for axis in range(3):
        along = dict.fromkeys(angles[:, axis], part)
        known = add_tangents(build, stages, along, f"by_rate_{axis}", "1")
        dual = turn.vector.applyfunc(lambda symbol, known=known: known[symbol])
        crossed = build.stage(
            Signal.vector(f"turn_cross_{axis}", f"turn_cross_{axis}", meaning=f"phi x its derivative {axis}"),
            cross(turn.vector, dual),
        )
        left = dual + turn.first * crossed + turn.second * cross(turn.vector, crossed)
        columns["rotation", "rate"].append(left)
        columns["velocity", "rate"].append(changed["velocity"].applyfunc(known.__getitem__))
        columns["position", "rate"].append(changed["position"].applyfunc(known.__getitem__))
    left = _matrix(
        build, "left_by_rate", sp.Matrix.hstack(*columns["rotation", "rate"]), "left turn by the rate"
    )
    for axis in range(3):
        along = dict.fromkeys(forces[:, axis], part)
        along |= {symbol: by for symbol, by in zip(velocity, left[:, axis], strict=True) if symbol.is_Symbol}
        known = add_tangents(build, stages, along, f"by_force_{axis}", "1")
        columns["position", "force"].append(
            changed["position"].applyfunc(lambda symbol, known=known: known.get(symbol, sp.S.Zero))
        )
    blocks = {block: sp.Matrix.hstack(*some) for block, some in columns.items() if some}
    return blocks | {("rotation", "rate"): left, ("velocity", "force"): left}


def _covariance(
    build: KernelBuilder,
    before: sp.Matrix,
    noise: dict[str, sp.Matrix],
    step_rotation: sp.Matrix,
    levers: dict[str, sp.Matrix],
    inputs: dict[tuple[str, str], sp.Matrix],
    h: sp.Symbol,
) -> list[sp.Expr]:
    """Return the upper triangle of the covariance after a step, block by block, without products by zero."""
    places = {part: slice(3 * k, 3 * k + 3) for k, part in enumerate(PARTS)}
    block = {(a, b): before[places[a], places[b]] for a, b in combinations_with_replacement(PARTS, 2)}
    turns, velocities = block["rotation", "rotation"], block["rotation", "velocity"]
    # With the position that the velocity before the step carries on
    carried = _matrix(
        build, "turn_position", block["rotation", "position"] + h * velocities, "covariance before"
    )
    crossed = _matrix(
        build,
        "velocity_position",
        block["velocity", "position"] + h * block["velocity", "velocity"],
        "covariance before",
    )
    squared = block["position", "position"] + h * (block["velocity", "position"].T + crossed)
    v, p = levers["velocity"], levers["position"]
    to_velocity = _matrix(
        build, "turn_velocity_after", velocities - turns * v.T, "covariance in the axes before"
    )
    to_position = _matrix(
        build, "turn_position_after", carried - turns * p.T, "covariance in the axes before"
    )
    half = _matrix(build, "turned", step_rotation.T * turns, "covariance of the turn, turned from one side")
    after = {
        ("rotation", "rotation"): half * step_rotation,
        ("rotation", "velocity"): step_rotation.T * to_velocity,
        ("rotation", "position"): step_rotation.T * to_position,
        ("velocity", "velocity"): block["velocity", "velocity"] - v * to_velocity - (v * velocities).T,
        ("velocity", "position"): crossed - v * to_position - (p * velocities).T,
        ("position", "position"): squared - p * to_position - (p * carried).T,
    }
    weighted = {
        (part, bias): _matrix(
            build,
            f"{part}_{bias}_noise",
            inputs[part, bias] * sp.diag(*noise[bias]),
            f"noise of the {bias} in the {part}",
        )
        for part, bias in BLOCKS
    }
    total = sp.zeros(9, 9)
    for (a, b), value in after.items():
        for bias in noise:
            if (a, bias) in inputs:
                value = value + weighted[a, bias] * inputs[b, bias].T
        total[places[a], places[b]] = value
    return [total[j, k] for j, k in UPPER]


def _named(build: KernelBuilder, name: str, value: sp.Matrix, unit: str, meaning: str) -> sp.Matrix:
    return build.stage(Signal.vector(name, name, unit=unit, meaning=meaning), value)


def _matrix(build: KernelBuilder, name: str, value: sp.Matrix, meaning: str) -> sp.Matrix:
    return build.stage(Signal.matrix(name, name, meaning=meaning), value)
