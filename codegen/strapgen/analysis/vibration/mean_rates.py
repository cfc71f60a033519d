"""Mean rates under vibration: computed by an algorithm, true, and their difference.

An `Assessment` holds the rates in closed form and evaluates them. Numbers come from double precision where that is
accurate enough, and from as many digits as are needed where terms cancel.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import mpmath
import sympy as sp

from strapgen.analysis.vibration.response import Form, Pair
from strapgen.analysis.vibration.systems import T_L, T_M, F, T
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.read_only import ReadOnly, ReadOnlyDict

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


#: Amplitudes of the angles in rad, of the acceleration in m/s^2, and the phase in rad, equations (65) and (70).
THETA_X, THETA_Y, PHI, D_Y = sp.symbols("theta_x theta_y phi D_y", real=True)

#: The true rate, the rate of the algorithm, and their difference.
PARTS = ("continuous", "computed", "error")
#: Smallest ratio of a sum to the magnitudes of its terms at which double precision is used.
_CANCELLED = 1e-4
#: Numbers of digits that are tried one after another at smaller ratios.
_DIGITS = (30, 60, 120, 240, 480, 960)


class Rates(NamedTuple):
    """Mean rates about z, in rad/s or m/s^2.

    Parameters
    ----------
    continuous, computed, error : float
        The true rate, the rate of the algorithm, and the latter minus the former.

    Examples
    --------
    >>> Rates(continuous=1e-3, computed=1.5e-3, error=5e-4).error
    0.0005
    """

    continuous: float
    computed: float
    error: float


@dataclass(frozen=True)
class Assessment(ReadOnly):
    """The mean rate about z that an algorithm computes under a vibration, and the true one.

    Parameters
    ----------
    kernel : str
        Name of the kernel.
    unit : str
        "rad/s" or "m/s^2".
    recursion : bool
        Whether the kernel is a recursion over a slow cycle. The symbols of time are then T_l and T_m, otherwise the
        step T.
    computed, continuous : dict of (str, str) to Form
        Factors of the pairs of channels.

    Examples
    --------
    >>> from strapgen import vibration
    >>> assessed = vibration.of("euler")
    >>> assessed.unit, assessed.resonant, sorted(assessed.computed)
    ('rad/s', False, [('angle_x', 'angle_y')])
    """

    kernel: str
    unit: str
    recursion: bool
    computed: Mapping[Pair, Form]
    continuous: Mapping[Pair, Form]

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"of {self.kernel}: mean rate in {self.unit}, {len(self.computed)} pairs of channels"

    @cached_property
    def error(self) -> Mapping[Pair, Form]:
        """Factors of the error, computed minus continuous, by pair of channels."""
        none = Form(sp.S.Zero, sp.S.Zero)
        errors = {}
        for pair in {**self.continuous, **self.computed}:
            true, computed = self.continuous.get(pair, none), self.computed.get(pair, none)
            form = Form(computed.real - true.real, computed.imaginary - true.imaginary)
            if form != none:
                errors[pair] = form
        return ReadOnlyDict(errors)

    @property
    def resonant(self) -> bool:
        """Whether the computed rate has a pole where a step holds a whole number of periods.

        All steps then have equal samples, and an algorithm that does more than add them to first order mistakes the
        vibration for a rotation.
        """
        return any(
            power.exp.is_negative and power.base.has(sp.sin)
            for form in self.computed.values()
            for value in form
            for power in value.atoms(sp.Pow)
        )

    @cached_property
    def unknowns(self) -> tuple[str, ...]:
        """Coefficients of the kernel that are not known, which the closed forms hold: such rates are no numbers."""
        symbols = {x for form in (*self.computed.values(), *self.continuous.values()) for x in form}
        names = {symbol.name for value in symbols for symbol in value.free_symbols}
        return tuple(sorted(names - {symbol.name for symbol in (F, T, T_L, T_M)}))

    @property
    def times(self) -> tuple[sp.Symbol, ...]:
        """The symbols of time."""
        return (T_L, T_M) if self.recursion else (T,)

    def forms(self, part: str) -> Mapping[Pair, Form]:
        """Return the factors of one of `PARTS`.

        Parameters
        ----------
        part : str
            One of `PARTS`.

        Returns
        -------
        mapping of (str, str) to Form

        Raises
        ------
        InputError
            If the part is unknown.
        """
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
            The amplitudes times a sum of sines, in theta_x, theta_y (for accelerations D_y), phi, f, and T (for a
            recursion T_l and T_m).
        """
        return sp.Add(
            *(sp.Mul(wave, ratio, evaluate=ratio.is_number) for wave, ratio in self._products(part))
        )

    def text(self, part: str) -> str:
        """Return a rate in closed form, as from `expression`, as text that SymPy can read."""
        terms = [
            str(wave * ratio) if ratio.is_number else f"{wave}*({ratio})"
            for wave, ratio in self._products(part)
        ]
        return " + ".join(terms) or "0"

    def _products(self, part: str) -> list[tuple[sp.Expr, sp.Expr]]:
        """Return pairs of an ideal rate from the amplitudes, and its factor, which depends on the times alone."""
        omega = 2 * sp.pi * F
        amplitudes = {
            "angle_x": (THETA_X, sp.S.Zero),
            "angle_y": (THETA_Y, PHI),
            "velocity_y": (D_Y / omega, PHI - sp.pi / 2),
        }
        terms = []
        for (first, second), form in self.forms(part).items():
            if second not in amplitudes or first not in amplitudes:
                continue  # this channel does not move
            (a, alpha), (b, beta) = amplitudes[first], amplitudes[second]
            size = a * b * omega / 2
            for value, wave in (
                (form.real, size * sp.cos(alpha - beta)),
                (-form.imaginary, size * sp.sin(alpha - beta)),
            ):
                ratio = sp.Add(*(sp.expand(2 * term / omega, deep=False) for term in sp.Add.make_args(value)))
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
        """Return the rates at one frequency as numbers.

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
            If a number is not allowed, or the rate is not finite, as where every step has the same samples.
        """
        arguments = {
            F: checks.number("frequency-hz", frequency_hz, positive=True),
            THETA_X: checks.number("theta-x-rad", theta_x),
            THETA_Y: checks.number("theta-y-rad", theta_y),
            PHI: checks.number("phase-rad", phase),
            D_Y: checks.number("acceleration-y", acceleration_y),
            **self.lengths(step, cycles),
        }
        values = [_accurate(self._exactly[part], list(arguments.values())) for part in PARTS]
        if not all(map(math.isfinite, values)):
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
        """Return the values in s of the symbols of time from the step, or from the slow cycle and its fast cycles.

        Parameters
        ----------
        step : number
            Step in s; for a recursion its slow cycle.
        cycles : int, optional
            Fast cycles in the slow cycle of a recursion.

        Returns
        -------
        dict of Symbol to Fraction

        Raises
        ------
        InputError
            If a number is not allowed, or `cycles` is set for a step or missing for a recursion.
        """
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
            The mean rate is the real part of the factor times the first amplitude times the conjugate of the second;
            the complex amplitude of a channel is c in Re(c exp(j omega t)).
        """
        import numpy as np  # rates at one frequency do without it

        hertz = np.asarray(frequencies, float)
        lengths = list(self.lengths(step, cycles).values())
        functions = self._in_double[part]
        return {
            pair: _values(real, hertz, lengths) + 1j * _values(imaginary, hertz, lengths)
            for pair, (real, imaginary) in functions.items()
        }

    @cached_property
    def _in_double(self) -> dict[str, dict[Pair, tuple[_Function, _Function]]]:
        symbols = (F, *self.times)
        return {
            part: {
                pair: (_Function(form.real, symbols), _Function(form.imaginary, symbols))
                for pair, form in self.forms(part).items()
            }
            for part in PARTS
        }


class _Function:
    """An expression and the sum of its terms' magnitudes as functions in double, and the expression in many digits."""

    def __init__(self, expression: sp.Expr, symbols: Sequence[sp.Symbol]) -> None:
        self._expression, self._symbols = expression, symbols

    @cached_property
    def value(self) -> Callable[..., Any]:
        function: Callable[..., Any] = sp.lambdify(self._symbols, self._expression, "numpy")
        return function

    @cached_property
    def size(self) -> Callable[..., Any]:
        size = sp.Add(*map(sp.Abs, sp.Add.make_args(self._expression)))
        function: Callable[..., Any] = sp.lambdify(self._symbols, size, "numpy")
        return function

    @cached_property
    def exactly(self) -> Callable[..., Any]:
        function: Callable[..., Any] = sp.lambdify(self._symbols, self._expression, "mpmath")
        return function


def _values(function: _Function, hertz: NDArray[np.float64], lengths: list[Fraction]) -> NDArray[np.float64]:
    import numpy as np

    times = list(map(float, lengths))
    with np.errstate(all="ignore"):
        values = np.broadcast_to(function.value(hertz, *times), hertz.shape).astype(float)
        size = np.broadcast_to(function.size(hertz, *times), hertz.shape)
    for k in np.flatnonzero(~(np.abs(values) >= _CANCELLED * size)):
        if size[k]:
            values[k] = _accurate(function.exactly, [Fraction(float(hertz[k])), *lengths])
    return values


def _accurate(function: Callable[..., Any], arguments: Sequence[Fraction]) -> float:
    """Return a value that more digits do not change in double; nan at a pole."""
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
    # Either all terms cancel, or a denominator vanishes.
    cancelled = before is not None and abs(before) < mpmath.mpf(10) ** -(_DIGITS[-1] // 2)
    return 0.0 if cancelled else float("nan")


#: Default number of frequencies of a curve.
POINTS = 400


@dataclass(frozen=True)
class Curve:
    """The mean rates of an algorithm as functions of frequency."""

    #: Name of the kernel
    label: str
    #: "rad/s" or "m/s^2"
    unit: str
    #: (N,)
    frequencies_hz: NDArray[np.float64]
    #: (N,): the true rate, and the error of the algorithm, in that unit
    continuous: NDArray[np.float64]
    error: NDArray[np.float64]


def frequencies(
    low: float | str | Fraction, high: float | str | Fraction, points: int = POINTS
) -> NDArray[np.float64]:
    """Return frequencies in Hz at equal ratios from one end to the other.

    `low, high`: ends in Hz, above 0. Returns (points,).

    >>> frequencies(1, 100, 3)
    array([  1.,  10., 100.])
    """
    import numpy as np

    first, last = (float(checks.number("frequency", end, positive=True)) for end in (low, high))
    if not first < last:
        raise InputError(f"frequencies {low} to {high} Hz do not rise")
    hertz: NDArray[np.float64] = np.geomspace(first, last, points)
    return hertz


def curve(
    assessment: Assessment,
    hertz: NDArray[np.float64],
    step: float | str | Fraction,
    *,
    theta_x: float | str | Fraction,
    theta_y: float | str | Fraction = 0,
    phase: float | str | Fraction = 0,
    acceleration_y: float | str | Fraction = 0,
    cycles: int | None = None,
) -> Curve:
    """Return the rates of an algorithm for the vibration of equation (65) or (70), at many frequencies.

    `hertz` (N,): frequencies in Hz, above 0.
    """
    import numpy as np  # rates at one frequency do without it

    amplitude_x, amplitude_y, angle, amplitude = (
        float(checks.number(what, value))
        for what, value in (
            ("theta-x-rad", theta_x),
            ("theta-y-rad", theta_y),
            ("phase-rad", phase),
            ("acceleration-y", acceleration_y),
        )
    )
    shift = np.exp(1j * angle)
    amplitudes = {
        "angle_x": amplitude_x + 0 * hertz,
        "angle_y": amplitude_y * shift + 0 * hertz,
        "velocity_y": amplitude * shift / (2j * np.pi * hertz),
    }
    rates = {}
    for part in ("continuous", "error"):
        rates[part] = np.zeros(len(hertz))
        for (first, second), factor in assessment.factors(part, hertz, step, cycles).items():
            if first in amplitudes and second in amplitudes:
                with np.errstate(all="ignore"):
                    rates[part] += (factor * amplitudes[first] * np.conj(amplitudes[second])).real
                if not np.isfinite(rates[part][np.isfinite(factor)]).all():
                    raise InputError(
                        f"{assessment.kernel}: the rates of the curve are beyond the range of double"
                    )
    return Curve(assessment.kernel, assessment.unit, hertz, rates["continuous"], rates["error"])
