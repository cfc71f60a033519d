"""Reads spectra of random vibration and computes the mean rates that it causes, by equations (68) to (83)."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, partial
from itertools import islice, pairwise
from numbers import Real
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from strapgen.analysis.vibration.mean_rates import Assessment, Rates
from strapgen.ir import checks
from strapgen.ir.checks import counted, needed
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.read_only import ReadOnly
from strapgen.lab.recordings.formats.csv_table import csv_rows, line_blocks

Array = NDArray[Any]

#: Outputs of the transfer functions, with the unit of each for an input of unit 1.
TRANSFERS = {"angle_x": "rad", "angle_y": "rad", "acceleration_x": "m_s2", "acceleration_y": "m_s2"}

#: Most rows of a file.
_MOST_ROWS = 100_000


@dataclass(frozen=True)
class Spectrum(ReadOnly):
    """A stationary random input, and the angles and accelerations that it excites.

    The input n has the one-sided power spectral density P, so that E[n^2] is the integral of P over frequencies in Hz.
    The transfer function H of an angle or acceleration turns n = Re(c exp(j omega t)) into Re(H c exp(j omega t)).
    Each function takes an array of frequencies in Hz, (N,), and returns an array of that shape or one number.

    Parameters
    ----------
    density : callable
        P in the unit of n squared per Hz; not below 0.
    transfers : dict of str to callable
        Complex transfer functions, per unit of n: "angle_x" and "angle_y" in rad, "acceleration_x" and
        "acceleration_y" in m/s^2. At least one is needed; a missing one means no motion.
    edges : tuple of float
        Rising frequencies in Hz: the lowest, all at which a function or its slope jumps, and the highest.

    Raises
    ------
    InputTypeError
        If a density or transfer function is no function, or an edge is no number.
    InputError
        If a transfer function has an unknown name, there is none, or the edges do not rise from 0 or above.

    Examples
    --------
    >>> turning = {"angle_x": np.ones_like, "angle_y": lambda f: -1j + 0 * f}
    >>> flat = Spectrum(lambda f: 1e-6 + 0 * f, turning, (5.0, 50.0))
    >>> sorted(flat.amplitudes(np.array([10.0])))
    ['angle_x', 'angle_y']
    """

    density: Callable[[Array], Array]
    transfers: Mapping[str, Callable[[Array], Array]]
    edges: tuple[float, ...]

    __repr__ = short_repr

    def __post_init__(self) -> None:
        if not isinstance(self.transfers, Mapping):
            raise InputTypeError(
                f"the transfer functions are {self.transfers!r}; a dict of functions by name is needed"
            )
        for name in self.transfers:
            if name not in TRANSFERS:
                raise InputError(f"transfer function {name!r} is not known; allowed: {', '.join(TRANSFERS)}")
        if not self.transfers:
            raise InputError(f"nothing moves; a transfer function is needed: {', '.join(TRANSFERS)}")
        for what, function in {"density": self.density, **self.transfers}.items():
            if not callable(function):
                raise InputTypeError(f"{what} is {function!r}; a function of frequency is needed")
        edges = self.edges
        if isinstance(edges, str) or not isinstance(edges, Sequence | np.ndarray):
            raise InputTypeError(f"the edges are {edges!r}; frequencies in Hz are needed")
        for edge in edges:
            if not isinstance(edge, Real) or isinstance(edge, bool):
                raise InputTypeError(f"the edges hold {edge!r}; frequencies in Hz are needed")
        rising = all(low < high for low, high in pairwise(edges))
        if len(edges) < 2 or edges[0] < 0 or not rising or not math.isfinite(edges[-1]):
            raise InputError(
                "the edges of a spectrum must be two rising frequencies in Hz or more, from 0 or above"
            )
        super().__post_init__()

    def densities(self, hertz: Array) -> Array:
        """Return the density at frequencies.

        Parameters
        ----------
        hertz : array, (N,)
            Frequencies in Hz.

        Returns
        -------
        array, (N,)
            In the unit of the input squared per Hz.

        Raises
        ------
        InputTypeError
            If the function returns no real numbers.
        InputError
            If it returns another shape, or a number below 0.
        """
        density = _evaluate("density", self.density(hertz), hertz, "fiu").astype(float)
        if (density < 0).any():
            place = int(np.argmax(density < 0))
            raise InputError(
                f"density is {density[place]:g} at {hertz[place]:.9g} Hz; no number below 0 is allowed"
            )
        return density

    def amplitudes(self, hertz: Array) -> dict[str, Array]:
        """Return the transfer functions of the channels at frequencies, with velocities instead of accelerations.

        Parameters
        ----------
        hertz : array, (N,)
            Frequencies in Hz, above 0.

        Returns
        -------
        dict of str to array, (N,)
            Complex amplitudes per unit of the input: angles in rad, velocities in m/s.

        Raises
        ------
        InputTypeError
            If a function returns no numbers.
        InputError
            If one returns another shape.
        """
        channels = {}
        for name, function in self.transfers.items():
            values = _evaluate(name, function(hertz), hertz, "fiuc").astype(complex)
            if name.startswith("acceleration"):
                values = values / (2j * np.pi * hertz)
            channels[name.replace("acceleration", "velocity")] = values
        return channels


def _evaluate(what: str, values: Any, hertz: Array, kinds: str) -> Array:
    """Return the values of a function, broadcast to the shape of the frequencies."""
    try:
        array = np.asarray(values)
    except ValueError:
        raise InputError(f"{what} returns rows of different lengths; shape {hertz.shape} is needed") from None
    if array.dtype.kind not in kinds:
        numbers = "numbers" if "c" in kinds else "real numbers"
        raise InputTypeError(f"{what} returns {array.dtype}; {numbers} are needed")
    if array.shape not in ((), hertz.shape):
        raise InputError(f"{what} returns shape {array.shape}; {hertz.shape} like the frequencies is needed")
    return np.broadcast_to(array, hertz.shape)


class RandomRates(NamedTuple):
    """Mean rates under a spectrum, with the estimated errors of their integrals.

    Parameters
    ----------
    rates : Rates
    quadrature : Rates
        Estimated error of the integral of each; that of `computed` is the sum of the other two.

    Examples
    --------
    >>> from strapgen import vibration
    >>> turning = {"angle_x": np.ones_like, "angle_y": lambda f: -1j + 0 * f}
    >>> flat = vibration.Spectrum(lambda f: 1e-6 + 0 * f, turning, (5.0, 50.0))
    >>> found = vibration.random_rates(vibration.of("euler"), flat, "0.01")
    >>> abs(found.quadrature.error) < 1e-6 * abs(found.rates.error)
    True
    """

    rates: Rates
    quadrature: Rates

    def __repr__(self) -> str:
        """Return both in two lines."""
        return f"<RandomRates {self.rates}\n  quadrature {self.quadrature}>"


def random_rates(
    assessment: Assessment,
    spectrum: Spectrum,
    step: float | str | Fraction,
    *,
    cycles: int | None = None,
    tolerance: float = 1e-10,
) -> RandomRates:
    """Return the mean rates about z under a random vibration.

    In a band df the spectrum is equivalent to an oscillation of amplitude c with ``|c|^2/2 = P df``. The integrand is
    therefore 2 P times the real part of the factor of each pair of channels, times the transfer function of one and
    the conjugate of the other.

    Parameters
    ----------
    assessment : Assessment
    spectrum : Spectrum
    step, cycles
        As for `Assessment.rates`.
    tolerance : float, optional
        Allowed error of the integrals, relative to the integrals of the magnitudes.

    Returns
    -------
    RandomRates

    Raises
    ------
    InputTypeError
        If an argument has the wrong type, or a function of the spectrum returns no numbers.
    InputError
        If a function or an integral is not finite, a density is below 0, or an integral does not converge.

    Examples
    --------
    >>> from strapgen import vibration
    >>> turning = {"angle_x": np.ones_like, "angle_y": lambda f: -1j + 0 * f}
    >>> flat = Spectrum(lambda f: 1e-6 + 0 * f, turning, (5.0, 50.0))
    >>> f"{random_rates(vibration.of('euler'), flat, '0.01').rates.error:.1e} rad/s"
    '-4.3e-04 rad/s'
    """
    if not isinstance(assessment, Assessment):
        raise InputTypeError(f"assessment is {assessment!r}; what vibration.of returns is needed")
    if not isinstance(spectrum, Spectrum):
        raise InputTypeError(f"spectrum is {spectrum!r}; a Spectrum is needed")
    allowed = float(checks.number("tolerance", tolerance, positive=True))
    longest = float(max(assessment.lengths(step, cycles).values()))
    if assessment.resonant and spectrum.edges[-1] * longest >= 1:
        raise InputError(
            f"{assessment.kernel} takes {1 / longest:g} Hz, whole periods in a step, for a turn and has no mean rate "
            f"there; the spectrum reaches to {spectrum.edges[-1]:g} Hz"
        )

    def rate(part: str, hertz: Array) -> Array:
        channels = spectrum.amplitudes(hertz)
        total = np.zeros(len(hertz))
        for (first, second), factor in assessment.factors(part, hertz, step, cycles).items():
            if first in channels and second in channels:
                total = total + 2 * (factor * channels[first] * channels[second].conj()).real
        return (total * spectrum.densities(hertz))[None]

    # The true rate comes first, since its factors need no more than double nearly everywhere. A spectrum that does not
    # converge is thus refused early, before the factors of the error, which need many digits.
    integrals = {
        part: integrate(partial(rate, part), spectrum.edges, 1 / longest, allowed)
        for part in ("continuous", "error")
    }
    continuous, error = (float(one.values[0]) for one in integrals.values())
    spread = [float(one.errors[0]) for one in integrals.values()]
    rates = Rates(continuous, continuous + error, error)
    if not np.isfinite(rates).all():
        raise InputError(f"{assessment.kernel}: the rates are beyond the range of double")
    return RandomRates(rates, Rates(spread[0], sum(spread), spread[1]))


def read_spectrum(path: str | Path) -> Spectrum:
    r"""Read a spectrum from a file of comma-separated values.

    The first line names the columns: ``frequency_hz``; ``density``, in the unit of the input squared per Hz; and any
    of ``angle_x_rad``, ``angle_y_rad``, ``acceleration_x_m_s2``, ``acceleration_y_m_s2``, the magnitudes of the
    transfer functions per unit of the input. Each may have a column for its phase in rad, for instance
    ``angle_y_phase_rad``; without it the phase is zero. Frequencies rise from row to row. Between two rows the
    logarithm of the density is linear in that of frequency, as vibration is usually specified; if a density is zero at
    either end, the density itself is linear in frequency. Magnitudes and phases are linear in frequency. Outside the
    rows there is no vibration.

    Parameters
    ----------
    path : path

    Returns
    -------
    Spectrum

    Raises
    ------
    InputTypeError
        If `path` is no path.
    InputError
        If the file cannot be read, or a column, a number or the order of the rows is not allowed.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> file = Path(mkdtemp()) / "spectrum.csv"
    >>> _ = file.write_text("frequency_hz,density,angle_x_rad\n5,1e-6,1\n50,1e-6,1\n")
    >>> read_spectrum(file).edges
    (5.0, 50.0)
    """
    if not isinstance(path, str | os.PathLike):
        raise InputTypeError(f"spectrum is {path!r}; the path of a file is needed")
    columns = _columns(Path(path))
    hertz, density = columns["frequency_hz"], columns["density"]
    transfers = {}
    for name, unit in TRANSFERS.items():
        if f"{name}_{unit}" in columns:
            size = columns[f"{name}_{unit}"]
            phase = columns.get(f"{name}_phase_rad", np.zeros(len(hertz)))
            transfers[name] = _transfer(hertz, size, phase)
    return Spectrum(_density(hertz, density), transfers, tuple(map(float, hertz)))


def _transfer(hertz: Array, size: Array, phase: Array) -> Callable[[Array], Array]:
    def transfer(at: Array) -> Array:
        values: Array = np.interp(at, hertz, size) * np.exp(1j * np.interp(at, hertz, phase))
        return values

    return transfer


def _density(hertz: Array, density: Array) -> Callable[[Array], Array]:
    def straight(at: Array) -> Array:
        values: Array = np.interp(at, hertz, density)
        place = np.clip(np.searchsorted(hertz, at, side="right") - 1, 0, len(hertz) - 2)
        low, high = hertz[place], hertz[place + 1]
        ends = density[place], density[place + 1]
        curved = (low > 0) & (ends[0] > 0) & (ends[1] > 0) & (at > 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            below, above = np.log(ends)
            power = np.exp(below + (above - below) * (np.log(at / low) / np.log(high / low)))
        return np.where(curved, power, values)

    return straight


def _columns(path: Path) -> dict[str, Array]:
    allowed = ["frequency_hz", "density"]
    for name, unit in TRANSFERS.items():
        allowed += [f"{name}_{unit}", f"{name}_phase_rad"]
    read = csv_rows(path, line_blocks(path))
    rows = [*islice(((line, row) for line, row in read if any(map(str.strip, row))), _MOST_ROWS + 1)]
    if len(rows) > _MOST_ROWS:
        raise InputError(f"{path} has over {_MOST_ROWS} rows; that is too many for a spectrum")
    if len(rows) < 3:
        raise InputError(
            f"{path} holds {counted(max(0, len(rows) - 1), 'row')} below its header; at least 2 are needed"
        )
    header = [cell.strip().lower() for cell in rows[0][1]]
    for name in header:
        if name not in allowed:
            raise InputError(f"{path}: column {name!r} is not known; allowed: {', '.join(allowed)}")
        if header.count(name) > 1:
            raise InputError(f"{path}: column {name!r} is there twice")
        if name.endswith("_phase_rad"):
            of = name.removesuffix("_phase_rad")
            if f"{of}_{TRANSFERS[of]}" not in header:
                raise InputError(f"{path}: column {name!r} has no column {of}_{TRANSFERS[of]} beside it")
    for name in allowed[:2]:
        if name not in header:
            raise InputError(f"{path}: no column {name!r}")
    if not any(f"{name}_{unit}" in header for name, unit in TRANSFERS.items()):
        raise InputError(f"{path}: nothing moves; a column {', '.join(allowed[2::2])} is needed")
    values = [_numbers(path, line, row, header) for line, row in rows[1:]]
    columns = dict(zip(header, np.array(values).T, strict=True))
    for (line, _), low, high in zip(rows[2:], *_neighbours(columns["frequency_hz"]), strict=True):
        if not low < high:
            raise InputError(f"{path}, line {line}: frequency_hz {high:g} does not rise above {low:g}")
    for name in header:
        lowest = columns[name].min()
        if lowest < 0 and not name.endswith("_phase_rad"):
            raise InputError(f"{path}: {name} is {lowest:g} in a row; no number below 0 is allowed")
    return columns


def _neighbours(values: Array) -> tuple[Array, Array]:
    return values[:-1], values[1:]


def _numbers(path: Path, line: int, row: list[str], header: list[str]) -> list[float]:
    if len(row) != len(header):
        raise InputError(f"{path}, line {line}: {counted(len(row), 'cell')}; {needed(len(header))}")
    numbers = []
    for cell, name in zip(row, header, strict=True):
        number = checks.double(cell)
        if not math.isfinite(number):
            raise InputError(f"{path}, line {line}: {name} is {cell.strip()!r}; a finite number is needed")
        numbers.append(number)
    return numbers


#: Points of the two Gauss rules on every panel; the second one gives the value, their difference the error.
_POINTS = (8, 15)
#: Most halvings of a panel, and most panels in all.
_MOST_HALVINGS = 60
_MOST_PANELS = 100_000


class Integral(NamedTuple):
    """Integrals of several functions."""

    #: (n,)
    values: Array
    #: (n,): sum over the panels of the difference between a rule and one with about half as many points. The
    #: values are those of the better rule, so their error is far smaller
    errors: Array


@cache
def _rules() -> tuple[tuple[Array, Array], ...]:
    return tuple(np.polynomial.legendre.leggauss(points) for points in _POINTS)


def integrate(
    function: Callable[[Array], Array], edges: Sequence[float], width: float, tolerance: float = 1e-10
) -> Integral:
    """Integrate functions over a range.

    `function`: ``function(x)`` takes x of shape (N,) and returns the values of n functions, (n, N).

    >>> integral = integrate(lambda x: np.array([np.sin(x), x**2]), [0, np.pi], 1.0)
    >>> integral.values.round(9), bool(np.all(integral.errors < 1e-10))
    (array([ 2.        , 10.33542556]), True)
    """
    with np.errstate(all="ignore"):  # values that are not finite are refused later
        return _integrate(function, edges, width, tolerance)


def _integrate(
    function: Callable[[Array], Array], edges: Sequence[float], width: float, tolerance: float
) -> Integral:
    starts: list[float] = []
    ends: list[float] = []
    for low, high in pairwise(edges):
        least = (high - low) / width
        if len(starts) + least > _MOST_PANELS:
            raise _too_many()
        count = max(1, int(np.ceil(least)))
        grid = np.linspace(low, high, count + 1)
        starts += grid[:-1].tolist()
        ends += grid[1:].tolist()
    panels = np.array([starts, ends])
    done: list[tuple[Array, Array]] = []
    total_size: Array | None = None
    used = 0
    for _ in range(_MOST_HALVINGS):
        used += panels.shape[1]
        if used > _MOST_PANELS:
            break
        (rough, _), (fine, size) = (_on_panels(function, panels, *rule) for rule in _rules())
        errors = np.abs(fine - rough)
        if total_size is None:
            total_size = size.sum(axis=1)
            span = panels[1, -1] - panels[0, 0]
            if not np.isfinite(total_size).all():
                raise InputError("the integral of the spectrum is beyond the range of double")
        share = (panels[1] - panels[0]) / span
        small = np.all(
            errors <= np.maximum(tolerance * total_size[:, None] * share, 64 * np.finfo(float).eps * size),
            axis=0,
        )
        done.append((fine[:, small].sum(axis=1), errors[:, small].sum(axis=1)))
        panels = panels[:, ~small]
        if not panels.size:
            values, spread = (np.sum(parts, axis=0) for parts in zip(*done, strict=True))
            return Integral(values, spread)
        middle = panels.mean(axis=0)
        panels = np.hstack([np.array([panels[0], middle]), np.array([middle, panels[1]])])
    raise _too_many()


def _too_many() -> InputError:
    return InputError(
        f"the spectrum takes over {_MOST_PANELS} panels to integrate: it jumps where no edge is given, or reaches to "
        "frequencies far above those of the samples"
    )


def _on_panels(
    function: Callable[[Array], Array], panels: Array, nodes: Array, weights: Array
) -> tuple[Array, Array]:
    """Return the integrals of the functions and of their magnitudes by a rule, (n, panels) each."""
    half, middle = (panels[1] - panels[0]) / 2, panels.mean(axis=0)
    points = middle[:, None] + half[:, None] * nodes
    values = function(points.ravel())
    if not np.isfinite(values).all():
        worst = points.ravel()[~np.isfinite(values).all(axis=0)][0]
        raise InputError(f"the spectrum is not finite at {worst:.9g} Hz")
    values = values.reshape(len(values), *points.shape)
    weighted = weights * half[:, None]
    return (values * weighted).sum(axis=2), (np.abs(values) * weighted).sum(axis=2)
