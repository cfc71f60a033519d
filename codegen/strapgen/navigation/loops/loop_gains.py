"""Gains of the loops of an attitude and heading reference by pole placement, from the formulas of their kernels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache

import sympy as sp

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.kernel.algebra import Wrapped
from strapgen.kernel.kernel import Kernel
from strapgen.navigation.loops.loop_kernels import erection, heading_loop, level_loop, vertical_loop

s, z = sp.symbols("s z")
tau, g, R, T = sp.symbols("tau g R T", positive=True)
#: Gravity in m/s^2 and radius of the earth in m of the source.
GRAVITY, RADIUS = Fraction(981, 100), Fraction(6_373_388)
#: Digits to which poles of a cycle are computed, of which three that nearly coincide lose two thirds.
_DIGITS, _MOST_STEPS = 60, 2000


@dataclass(frozen=True)
class ClosedLoop:
    """A loop with its plant, in error form, as matrices of its gains."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    gains: tuple[sp.Symbol, ...]
    #: A of x' = A x + D d
    continuous: sp.Matrix
    #: D, a column for each input
    disturbance: sp.Matrix
    #: Change of the states by a cycle T of the kernel and of the plant, which goes on between the calls
    cycle: sp.Matrix
    #: Change of the states by constant inputs in a cycle
    cycle_disturbance: sp.Matrix


def _symbol(name: str) -> sp.Symbol:
    return sp.Symbol(name, real=True)


def _linear(
    step: sp.Matrix, states: tuple[str, ...], inputs: tuple[str, ...], gains: tuple[str, ...]
) -> ClosedLoop:
    """Return the matrices of a cycle that is linear in states and inputs."""
    x, d = (sp.Matrix([_symbol(name) for name in names]) for names in (states, inputs))
    step = step.applyfunc(sp.expand)
    cycle, driven = step.jacobian(x), step.jacobian(d)
    A, D = (matrix.diff(T).subs(T, 0) for matrix in (cycle, driven))
    symbols = tuple(_symbol(name) for name in gains)
    return ClosedLoop(states, inputs, symbols, A, D, cycle, driven)


def _outputs(kernel: Kernel, values: dict[str, sp.Expr]) -> dict[str, list[sp.Expr]]:
    """Return the outputs of a kernel for some inputs; gains are their own symbols, and all others are zero."""
    names = [name for signal in kernel.inputs for name in signal.elements]
    known = {name: _symbol(name) if name.startswith("k") else sp.S.Zero for name in names}
    # Errors are small: no heading error needs to be reduced by a turn.
    return kernel.expand(known | {"cycle": T} | values)


def _level() -> ClosedLoop:
    """Return the channel of V_y and phi_x of the levelling loop; the other one is the same with phi turned."""
    V, phi, B, Vr, drift, force = map(_symbol, ("V", "phi", "B", "Vr", "drift", "force"))
    kernel, known = level_loop(), {"curvature": 1 / R, "Vr_y": Vr}
    rate = _outputs(kernel, known | {"cycle": sp.S.Zero, "V_y": V, "B_x": B})["level_rate"][0]
    tilt = phi + T * (drift - rate)
    change = T * (g * (phi + tilt) / 2 + force)
    later = _outputs(kernel, known | {"V_y": V, "B_x": B, "change_y": change})
    step = sp.Matrix([later["next_level_velocity"][1], tilt, later["next_level_bias"][0]])
    return _linear(step, ("V", "phi", "B"), ("drift", "force", "Vr"), ("k1", "k2", "k3"))


def _erection() -> ClosedLoop:
    """Return the channel of V_y and phi_x of erection."""
    V, phi, drift, force = map(_symbol, ("V", "phi", "drift", "force"))
    kernel = erection()
    rate = _outputs(kernel, {"cycle": sp.S.Zero, "V_y": V})["level_rate"][0]
    tilt = phi + T * (drift - rate)
    later = _outputs(kernel, {"V_y": V, "change_y": T * (g * (phi + tilt) / 2 + force)})
    step = sp.Matrix([later["next_level_velocity"][1], tilt])
    return _linear(step, ("V", "phi"), ("drift", "force"), ("k1", "k2"))


def _heading() -> ClosedLoop:
    """Return the heading loop, whose plant integrates the commanded rate exactly."""
    psi, B, drift, magnetic = map(_symbol, ("psi", "B", "drift", "psi_m"))
    later = _outputs(heading_loop(), {"heading": psi, "magnetic_heading": magnetic, "heading_bias": B})
    (rate,), (bias,) = (
        [_unwrap(value) for value in later[name]] for name in ("heading_rate", "next_heading_bias")
    )
    step = sp.Matrix([psi + T * (drift - rate), bias])
    return _linear(step, ("psi", "B"), ("drift", "psi_m"), ("k1", "k2"))


def _unwrap(expression: sp.Expr) -> sp.Expr:
    """Return an expression without the reduction of angles by a turn, of which errors are far."""
    return expression.replace(Wrapped, lambda angle: angle)


def _vertical() -> ClosedLoop:
    """Return the vertical loop, whose states are all in the kernel."""
    h, V, B, force, hr = map(_symbol, ("h", "V", "B", "force", "hr"))
    known = {
        "height": h,
        "climb": V,
        "vertical_bias": B,
        "reference_height": hr,
        "change_z": -T * force,  # beside gravity
        "gravity_gradient": 2 * g / R,
    }
    later = _outputs(vertical_loop(), known)
    step = sp.Matrix([later[name][0] for name in ("next_height", "next_climb", "next_vertical_bias")])
    return _linear(step, ("h", "V", "B"), ("force", "hr"), ("k1", "k2", "k3"))


_LOOPS: dict[str, Callable[[], ClosedLoop]] = {
    "level": _level,
    "erection": _erection,
    "heading": _heading,
    "vertical": _vertical,
}
#: Orders that a loop can have, by its name; the first is the usual one.
ORDERS = {"level": (3, 2), "erection": (2,), "heading": (2,), "vertical": (3, 2)}


@cache
def closed_loop(name: str, order: int | None = None) -> ClosedLoop:
    """Return a loop of a certain order; in a lower one the estimate of the bias is held, and no longer a state.

    >>> closed_loop("erection").continuous.tolist()
    [[-k1, g], [-k2, 0]]
    """
    loop = _LOOPS[checks.choice("loop", name, _LOOPS)]()
    if order is None or order == len(loop.states):
        return loop
    if order not in ORDERS[name]:
        raise InputError(
            f"the {name} loop has order {order}; {' or '.join(map(str, ORDERS[name]))} is possible"
        )
    matrices = (
        loop.continuous[:order, :order],
        loop.disturbance[:order, :],
        loop.cycle[:order, :order],
        loop.cycle_disturbance[:order, :],
    )
    return ClosedLoop(loop.states[:order], loop.inputs, loop.gains[:order], *matrices)


@cache
def symbolic_gains(name: str, order: int | None = None) -> tuple[sp.Expr, ...]:
    """Return the gains that put all poles to -1/tau, as functions of tau, g and R.

    >>> symbolic_gains("erection")
    (2/tau, 1/(g*tau**2))
    """
    loop = closed_loop(name, order)
    difference = loop.continuous.charpoly(s).as_expr() - (s + 1 / tau) ** len(loop.states)
    (solution,) = sp.linsolve(sp.Poly(sp.expand(difference), s).all_coeffs(), *loop.gains)
    return tuple(sp.expand(value) for value in solution)


def gains(
    name: str,
    time_constant: Fraction,
    order: int | None = None,
    gravity: Fraction = GRAVITY,
    radius: Fraction = RADIUS,
) -> tuple[Fraction, ...]:
    """Return the gains of a time constant, exactly; those of a kernel that an order leaves out are zero.

    `time_constant`: in s. `gravity, radius`: in m/s^2 and m.

    >>> gains("heading", Fraction(40))
    (Fraction(1, 20), Fraction(1, 1600))
    """
    values = {tau: time_constant, g: gravity, R: radius}
    numbers = [_number(gain, values) for gain in symbolic_gains(name, order)]
    missing = len(closed_loop(name).gains) - len(numbers)
    return (*numbers, *[Fraction(0)] * missing)


def _number(expression: sp.Expr, values: dict[sp.Symbol, Fraction]) -> Fraction:
    exact = expression.subs({symbol: sp.Rational(value) for symbol, value in values.items()})
    return Fraction(int(exact.p), int(exact.q))


def poles_of_a_cycle(
    name: str,
    values: tuple[Fraction, ...],
    cycle_s: Fraction,
    gravity: Fraction = GRAVITY,
    radius: Fraction = RADIUS,
) -> tuple[complex, ...]:
    """Return the poles in z of the sampled loop with its plant, the one of largest magnitude first."""
    order = len(values) - (values[-1] == 0)
    loop = closed_loop(name, order if order in ORDERS[name] else None)
    known = dict(zip(loop.gains, values, strict=False)) | {T: cycle_s, g: gravity, R: radius}
    matrix = loop.cycle.subs({symbol: sp.Rational(value) for symbol, value in known.items()})
    # Roots that coincide converge badly, and those that nearly do in a variable where they are not close to 1.
    scale = sp.Rational(values[0] * cycle_s)
    _, factors = sp.Poly(matrix.charpoly(z).as_expr().subs(z, 1 + scale * z), z).sqf_list()
    options = {"n": _DIGITS, "maxsteps": _MOST_STEPS}
    roots = [1 + scale * root for factor, power in factors for root in factor.nroots(**options) * power]
    return tuple(sorted(map(complex, roots), key=abs, reverse=True))


def check_stable(
    name: str,
    values: tuple[Fraction, ...],
    cycle_s: Fraction,
    gravity: Fraction = GRAVITY,
    radius: Fraction = RADIUS,
) -> None:
    """Refuse gains with which the sampled loop is not stable."""
    largest = abs(poles_of_a_cycle(name, values, cycle_s, gravity, radius)[0])
    if not largest < 1:
        shown = ", ".join(f"{float(value):.6g}" for value in values)
        raise InputError(
            f"the {name} loop with gains {shown} and a cycle of {float(cycle_s):g} s is unstable: "
            f"a pole has magnitude {largest:.6f}"
        )
