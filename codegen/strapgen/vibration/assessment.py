"""Assessments: what an algorithm computes of a vibration, what is true, and the difference, symbolic and in numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import mpmath
import numpy as np
import sympy as sp
from numpy.typing import NDArray

from strapgen import catalogue, checks
from strapgen.catalogue import Choice
from strapgen.exceptions import InputError, InputTypeError
from strapgen.kernel import Kernel
from strapgen.vibration import response, systems
from strapgen.vibration.response import Form, Pair
from strapgen.vibration.systems import ANGLES, T_L, T_M, VELOCITIES, F, T

#: Amplitudes of the angles in rad, of the acceleration in m/s^2, and the phase in rad, equations (65) and (70).
THETA_X, THETA_Y, PHI, D_Y = sp.symbols("theta_x theta_y phi D_y", real=True)

#: What of an assessment is asked for.
PARTS = ("continuous", "computed", "error")
#: Double precision serves where the terms do not cancel by more than this.
_CANCELLED = 1e-4
#: Digits that are tried where they do.
_DIGITS = (30, 60, 120, 240, 480, 960)


class Rates(NamedTuple):
    """Mean rates about z, in rad/s or m/s^2.

    Parameters
    ----------
    continuous, computed, error : float
        The true rate, that of the algorithm, and the algorithm's less the true one.
    """

    continuous: float
    computed: float
    error: float


@dataclass(frozen=True)
class Assessment:
    """The mean rate about z that an algorithm computes of a vibration, beside the true one.

    Parameters
    ----------
    kernel : str
        Name of the kernel.
    unit : str
        "rad/s" or "m/s^2".
    recursion : bool
        Whether it is a recursion over a slow cycle; the symbols of time are then T_l and T_m, else the step T.
    computed, continuous : dict of (str, str) to Form
        Factors of the pairs of channels.
    """

    kernel: str
    unit: str
    recursion: bool
    computed: dict[Pair, Form]
    continuous: dict[Pair, Form]

    @cached_property
    def error(self) -> dict[Pair, Form]:
        """Factors of the difference, computed minus continuous."""
        none = Form(sp.S.Zero, sp.S.Zero)
        found = {}
        for pair in {**self.continuous, **self.computed}:
            true, made = self.continuous.get(pair, none), self.computed.get(pair, none)
            form = Form(made.real - true.real, made.imaginary - true.imaginary)
            if form != none:
                found[pair] = form
        return found

    @property
    def resonant(self) -> bool:
        """Whether the computed rate grows beyond bounds where whole periods make a step.

        An algorithm that does not simply add its samples to first order then takes the vibration for a turn.
        """
        return any(
            power.exp.is_negative and power.base.has(sp.sin)
            for form in self.computed.values()
            for value in form
            for power in value.atoms(sp.Pow)
        )

    @property
    def times(self) -> tuple[sp.Symbol, ...]:
        """The symbols of time."""
        return (T_L, T_M) if self.recursion else (T,)

    def forms(self, part: str) -> dict[Pair, Form]:
        """Return the factors of one of `PARTS`."""
        return {"continuous": self.continuous, "computed": self.computed, "error": self.error}[
            checks.choice("part", part, PARTS)
        ]

    def expression(self, part: str) -> sp.Expr:
        """Return a rate in closed form for the vibration of (65), or of (70) for accelerations.

        Parameters
        ----------
        part : str
            One of `PARTS`.

        Returns
        -------
        Expr
            In theta_x, theta_y, phi, f and T, or D_y in place of theta_y, or T_l and T_m in place of T: the amplitudes
            times their sum of sines.
        """
        return sp.Add(
            *(sp.Mul(wave, ratio, evaluate=ratio.is_number) for wave, ratio in self._products(part))
        )

    def text(self, part: str) -> str:
        """Return a rate in closed form as text that SymPy reads; the argument is that of `expression`."""
        terms = [
            str(wave * ratio) if ratio.is_number else f"{wave}*({ratio})"
            for wave, ratio in self._products(part)
        ]
        return " + ".join(terms) or "0"

    def _products(self, part: str) -> list[tuple[sp.Expr, sp.Expr]]:
        """Return what the amplitudes would give in the ideal, and a factor of that, one that depends on time alone."""
        omega = 2 * sp.pi * F
        held = {
            "angle_x": (THETA_X, sp.S.Zero),
            "angle_y": (THETA_Y, PHI),
            "velocity_y": (D_Y / omega, PHI - sp.pi / 2),
        }
        terms = []
        for (first, second), form in self.forms(part).items():
            if second not in held or first not in held:
                continue  # what does not move
            (a, alpha), (b, beta) = held[first], held[second]
            size = a * b * omega / 2
            for value, wave in (
                (form.real, size * sp.cos(alpha - beta)),
                (-form.imaginary, size * sp.sin(alpha - beta)),
            ):
                ratio = sp.Add(*(sp.expand(2 * term / omega) for term in sp.Add.make_args(value)))
                if ratio != 0 and wave != 0:
                    terms.append((wave, ratio))
        return terms

    def rates(
        self,
        frequency_hz: float | str | Fraction,
        step: float | str | Fraction,
        *,
        theta_x: float | str | Fraction,
        theta_y: float | str | Fraction = 0,
        phase: float | str | Fraction = 0,
        acceleration_y: float | str | Fraction = 0,
        cycles: int | None = None,
    ) -> Rates:
        """Return the rates of one frequency in numbers.

        Parameters
        ----------
        frequency_hz : number
        step : number
            Step in s; for a recursion its slow cycle.
        theta_x, theta_y, phase : number
            Amplitudes of the angles in rad, and the phase of the second one, or of the acceleration, in rad.
        acceleration_y : number, optional
            Amplitude in m/s^2, where the unit is m/s^2.
        cycles : int, optional
            Fast cycles in the slow cycle of a recursion.

        Returns
        -------
        Rates

        Raises
        ------
        InputError
            If a number is not allowed, or the rate is not finite: the samples of that frequency all look the same.
        """
        given = {
            F: checks.number("frequency-hz", frequency_hz, positive=True),
            THETA_X: checks.number("theta-x-rad", theta_x),
            THETA_Y: checks.number("theta-y-rad", theta_y),
            PHI: checks.number("phase-rad", phase),
            D_Y: checks.number("acceleration-y", acceleration_y),
            **self.lengths(step, cycles),
        }
        values = [_accurate(self._exactly[part], list(given.values())) for part in PARTS]
        if not all(map(np.isfinite, values)):
            if not self.resonant:
                raise InputError(
                    f"{self.kernel}: the rates at {frequency_hz} Hz are beyond the range of double"
                )
            raise InputError(
                f"{self.kernel} has no mean rate at {frequency_hz} Hz and a step of {step} s: "
                "every step has the same samples, and it turns about their axis"
            )
        return Rates(*values)

    def lengths(self, step: float | str | Fraction, cycles: int | None = None) -> dict[sp.Symbol, Fraction]:
        """Return the values of the symbols of time, from a step, or from a slow cycle and its fast ones."""
        whole = checks.number("step", step, positive=True)
        if not self.recursion:
            if cycles is not None:
                raise InputError(f"kernel {self.kernel} takes no cycles; a recursion does")
            return {T: whole}
        if cycles is None:
            raise InputError(
                f"kernel {self.kernel} is a recursion: the number of its fast cycles in a step is needed"
            )
        return {T_L: whole / checks.count("cycles", cycles), T_M: whole}

    @cached_property
    def _exactly(self) -> dict[str, Callable[..., Any]]:
        symbols = (F, THETA_X, THETA_Y, PHI, D_Y, *self.times)
        return {part: sp.lambdify(symbols, self.expression(part), "mpmath") for part in PARTS}

    def factors(
        self, part: str, frequencies: Any, step: float | str | Fraction, cycles: int | None = None
    ) -> dict[Pair, NDArray[np.complex128]]:
        """Return the factors of all pairs of channels at frequencies.

        Parameters
        ----------
        part : str
            One of `PARTS`.
        frequencies : array_like, (N,)
            In Hz, above 0.
        step, cycles
            As for `rates`.

        Returns
        -------
        dict of (str, str) to array, (N,)
            The mean rate is the real part of factor times the first amplitude times the conjugate of the second, those
            of the channels being complex, as c in Re(c exp(j omega t)).
        """
        hertz = np.asarray(frequencies, float)
        lengths = list(self.lengths(step, cycles).values())
        made = self._in_double[part]
        return {
            pair: _values(real, hertz, lengths) + 1j * _values(imaginary, hertz, lengths)
            for pair, (real, imaginary) in made.items()
        }

    @cached_property
    def _in_double(self) -> dict[str, dict[Pair, tuple[_Function, _Function]]]:
        symbols = (F, *self.times)
        return {
            part: {
                pair: (_Function.of(form.real, symbols), _Function.of(form.imaginary, symbols))
                for pair, form in self.forms(part).items()
            }
            for part in PARTS
        }


class _Function(NamedTuple):
    """An expression in double, the sum of the magnitudes of its terms, and the expression in many digits."""

    value: Callable[..., Any]
    size: Callable[..., Any]
    exactly: Callable[..., Any]

    @classmethod
    def of(cls, expression: sp.Expr, symbols: Sequence[sp.Symbol]) -> _Function:
        size = sp.Add(*map(sp.Abs, sp.Add.make_args(expression)))
        return cls(
            sp.lambdify(symbols, expression, "numpy"),
            sp.lambdify(symbols, size, "numpy"),
            sp.lambdify(symbols, expression, "mpmath"),
        )


def _values(function: _Function, hertz: NDArray[np.float64], lengths: list[Fraction]) -> NDArray[np.float64]:
    times = list(map(float, lengths))
    with np.errstate(all="ignore"):
        found = np.broadcast_to(function.value(hertz, *times), hertz.shape).astype(float)
        size = np.broadcast_to(function.size(hertz, *times), hertz.shape)
    for k in np.flatnonzero(~(np.abs(found) >= _CANCELLED * size)):
        if size[k]:
            found[k] = _accurate(function.exactly, [Fraction(float(hertz[k])), *lengths])
    return found


def _accurate(function: Callable[..., Any], arguments: Sequence[Fraction]) -> float:
    """Return a value of which more digits show no difference in double; nan where there is none."""
    before = None
    for digits in _DIGITS:
        with mpmath.workdps(digits):
            try:
                value = function(*(mpmath.mpf(x.numerator) / x.denominator for x in arguments))
            except ZeroDivisionError:
                return float("nan")
            if before is not None and abs(value - before) <= mpmath.mpf(10) ** -18 * abs(value):
                return float(value)
            before = value
    # Either all terms cancel, or something is divided by what vanishes.
    cancelled = before is not None and abs(before) < mpmath.mpf(10) ** -(_DIGITS[-1] // 2)
    return 0.0 if cancelled else float("nan")


def drift(kernel: Kernel, *, nodes: Sequence[Fraction | sp.Expr] = (), previous: int = 0) -> Assessment:
    """Assess the attitude: the mean drift rate about z in rad/s.

    Parameters
    ----------
    kernel : Kernel
        An attitude step, of the catalogue or a user's; the rotation vector of a step; or a recursion that sums coning.
    nodes : sequence of Fraction or Expr, optional
        Nodes of a step that takes rates.
    previous : int, optional
        How many samples of the rotation vector of a step are those before it; an attitude step says so itself.

    Returns
    -------
    Assessment

    Raises
    ------
    InputError
        If the kernel is none of these, or has no expansion to second order.

    Examples
    --------
    >>> from strapgen import derive
    >>> drift(derive("euler", "rk1", 1)).text("computed")
    '-pi*f*theta_x*theta_y*sin(phi)*(sin(2*pi*T*f)/(2*pi*T*f))'
    """
    system = systems.of(kernel, "rad", nodes, previous)
    if system.unit != "rad":
        raise InputError(f"kernel {kernel.name} computes a velocity; it has a sculling rate, not a drift")
    endless = system.slow_cycle is None
    return Assessment(
        kernel.name, "rad/s", not endless, response.forms(system), response.true_forms("coning", endless)
    )


def sculling(kernel: Kernel, *, nodes: Sequence[Fraction | sp.Expr] = (), previous: int = 0) -> Assessment:
    """Assess the velocity: the mean sculling rate about z in m/s^2.

    A kernel without velocity increments is assessed by duality: the cross product of two angle increments stands for
    that of an angle and a velocity increment.

    Parameters
    ----------
    kernel, nodes, previous
        As for `drift`; or the sculling term of a step, or a recursion that sums sculling.

    Returns
    -------
    Assessment

    Raises
    ------
    InputError
        If the kernel is none of these, has no expansion to second order, or no dual.

    Examples
    --------
    >>> from strapgen import derive
    >>> sculling(derive("sculling-fast-2")).expression("continuous").has(systems.T_M)
    True
    """
    if not _takes_velocities(systems.checked(kernel)):
        if kernel.recursion is not None and kernel.companions is None:
            raise InputError(f"kernel {kernel.name} takes no velocity increments; sculling-fast-1 or -2 does")
        return _dual(drift(kernel, nodes=nodes, previous=previous))
    system = systems.of(kernel, "m/s", nodes, previous)
    computed = response.forms(system)
    if not all(set(pair) & set(ANGLES) and set(pair) & set(VELOCITIES) for pair in computed):
        raise InputError(f"kernel {kernel.name} gives a velocity that is no product of angles and velocities")
    endless = system.slow_cycle is None
    compensated = any(form.real != 0 for form in computed.values())
    true = response.true_forms("S1" if compensated and not endless else "S2", endless)
    return Assessment(kernel.name, "m/s^2", not endless, computed, true)


def _takes_velocities(kernel: Kernel) -> bool:
    return any(signal.name in systems.SAMPLES and signal.unit == "m/s" for signal in kernel.inputs)


def _dual(assessment: Assessment) -> Assessment:
    """Return the assessment of the sculling term that goes with a coning term."""
    pair = ANGLES
    form = assessment.computed.get(pair, Form(sp.S.Zero, sp.S.Zero))
    if set(assessment.computed) - {pair} or form.real != 0:
        raise InputError(
            f"kernel {assessment.kernel} has other terms of second order than cross products of samples; "
            "sculling has no dual of it"
        )
    turned = Form(sp.S.Zero, -form.imaginary)
    computed = {("angle_x", "velocity_y"): form, ("angle_y", "velocity_x"): turned}
    return Assessment(assessment.kernel, "m/s^2", False, computed, response.true_forms("S2", endless=True))


#: Fast loop, and the vector of a slow cycle of one sample, of an algorithm in two speeds.
_LOOPS = {
    "drift": ("coning-fast", ("rotation-vector", "coning-compressed", 1)),
    "sculling": ("sculling-fast-2", ("sculling", "coning-compressed", 1)),
}


@lru_cache
def two_speed(quantity: str = "drift") -> Assessment:
    """Assess a whole algorithm in two speeds: the fast loop, and the slow loop that follows it.

    What the fast loop sums of second order the slow loop adds to what it makes of the sums of the increments alone,
    which are the one sample of a slow cycle. The navigation frame rests.

    Parameters
    ----------
    quantity : str, optional
        "drift" or "sculling".

    Returns
    -------
    Assessment
        Continuous is the true rate, without a term in T_m.

    Raises
    ------
    InputError
        If the quantity is unknown.

    Examples
    --------
    >>> two_speed().text("computed")
    '-pi*f*theta_x*theta_y*sin(phi)*(2*sin(2*pi*T_l*f)/(3*pi*T_l*f) - sin(4*pi*T_l*f)/(12*pi*T_l*f))'
    """
    fast, slow = _LOOPS[checks.choice("quantity", quantity, tuple(_LOOPS))]
    parts = [of(catalogue.choose(fast), quantity), of(catalogue.choose(*slow), quantity)]
    none = Form(sp.S.Zero, sp.S.Zero)
    computed = {}
    for pair in {**parts[0].computed, **parts[1].computed}:
        forms = [part.computed.get(pair, none) for part in parts]
        real, imaginary = (sp.Add(*(form[k].subs(T, T_M) for form in forms)) for k in range(2))
        computed[pair] = Form(real, imaginary)
    return Assessment("two-speed", parts[0].unit, True, computed, parts[1].continuous)


def quantities(choice: Choice) -> tuple[str, ...]:
    """Return which of "drift" and "sculling" can be assessed of a kernel of the catalogue; at least one.

    Raises
    ------
    InputError
        If it is no kernel that takes angle increments.

    Examples
    --------
    >>> [quantities(catalogue.choose(name)) for name in ("euler", "sculling", "two-speed-fast-2")]
    [('drift', 'sculling'), ('sculling',), ('drift', 'sculling')]
    """
    found = []
    reason = None
    for quantity in ("drift", "sculling"):
        try:
            of(choice, quantity)
        except InputError as error:
            reason = reason or error
        else:
            found.append(quantity)
    if not found and reason is not None:
        raise reason
    return tuple(found)


def of(choice: Choice, quantity: str = "drift") -> Assessment:
    """Assess a kernel of the catalogue.

    Parameters
    ----------
    choice : Choice
        What `catalogue.choose` returns.
    quantity : str, optional
        "drift" or "sculling".

    Returns
    -------
    Assessment

    Raises
    ------
    InputTypeError
        If the choice is none.
    InputError
        As `drift` and `sculling` do.

    Examples
    --------
    >>> found = of(catalogue.choose("dcm", "rk4", 2))
    >>> rates = found.rates(10, 0.02, theta_x=0.01, theta_y=0.01, phase=1)
    >>> [float(f"{rate:.6g}") for rate in rates]
    [-0.00264356, -0.00263046, 1.31029e-05]
    """
    if not isinstance(choice, Choice):
        raise InputTypeError(f"choice is {choice!r}; what catalogue.choose returns is needed")
    checks.choice("quantity", quantity, ("drift", "sculling"))
    if choice.user_kernel is not None:  # whose file may change: not to be held for good
        return _of(choice, quantity)
    return _of_catalogue(choice, quantity)


def _of(choice: Choice, quantity: str) -> Assessment:
    kernel = catalogue.derive(choice)
    if quantity == "sculling" and kernel.companions is not None:
        return _dual(of(choice))
    assess = {"drift": drift, "sculling": sculling}[quantity]
    return assess(kernel, nodes=catalogue.nodes(choice), previous=choice.previous)


_of_catalogue = lru_cache(maxsize=64)(_of)
