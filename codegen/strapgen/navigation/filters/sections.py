"""Sections of a filter: designs by the bilinear transformation, as exact rational coefficients of short words."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from strapgen.catalogue.methods.sensor_response import Response
from strapgen.ir.exceptions import InputError

#: Edges of filters, as parts of the sampling rate; a lower one takes too long to settle.
LOWEST_EDGE, _HALF = 1e-5, Fraction(1, 2)
#: Relative errors of a width and of the square of a frequency that rounding may make, and the bits that are tried.
_WIDTH, _SQUARE, _FEWEST_BITS, _MOST_BITS = 2.0**-8, 2.0**-10, 10, 62
#: Significant bits of gains, which words of 16 bits hold.
_GAIN_BITS = 15
#: Precision of numbers that are not rational, in bits, and the part of a root that is no number but its rounding.
_PRECISION, _REAL = 200, 2.0**-50
#: Part of a response at which it counts as settled, and how much longer several sections take than the slowest.
_NEGLIGIBLE, _SEVERAL = 1e-16, 1.25
#: Gain at a notch below which one is designed as for this.
_SMALLEST_GAIN = 1e-4


@dataclass(frozen=True)
class Prototype:
    """A design (high s^2 + centre width s + low square)/(s^2 + width s + square), s = (z - 1)/(z + 1).

    Without a width it is (high s + low square)/(s + square). The gains are those at half the sampling rate, where the
    phase of the denominator is a right angle, and at rest.
    """

    #: Frequency of the analog filter, at which s^2 is -square
    hz: float
    square: Fraction
    width: Fraction | None = None
    high: Fraction = Fraction(0)
    centre: Fraction = Fraction(0)
    low: Fraction = Fraction(1)

    def response(self, s: complex) -> complex:
        """Return the response at a point of the plane of s."""
        if self.width is None:
            return (float(self.high) * s + float(self.low * self.square)) / (s + float(self.square))
        top = float(self.high) * s * s + float(self.centre * self.width) * s + float(self.low * self.square)
        return top / (s * s + float(self.width) * s + float(self.square))

    def analog(self, hertz: float) -> complex:
        """Return the response of the analog filter at a frequency."""
        own = float(self.square) if self.width is None else math.sqrt(self.square)
        return self.response(1j * own * hertz / self.hz)

    def delay(self, analog: bool, sample_hz: float) -> float:
        """Return the delay of slow changes in s; nan for a filter that stops them."""
        if not self.low:
            return math.nan
        square = float(self.square)
        slope = 1 - float(self.high / self.low)
        if self.width is not None:
            slope, square = float(self.width * (1 - self.centre / self.low)), math.sqrt(square)
            slope /= square
        return slope / (2 * math.pi * self.hz) if analog else slope / (2 * square * sample_hz)


@dataclass(frozen=True)
class Section:
    """One or two trapezoidal integrators whose weighted states make any transfer function of first or second order.

    With a = x - second, a cycle adds 2 (enter a - loss first) to the first state and 2 (cross first + square a) to the
    second one. A section of first order has the second state alone, and no loss.
    """

    square: Fraction
    enter: Fraction = Fraction(0)
    loss: Fraction | None = None
    cross: Fraction = Fraction(0)
    high: Fraction = Fraction(0)
    centre: Fraction = Fraction(0)
    low: Fraction = Fraction(1)

    @property
    def states(self) -> tuple[str, ...]:
        """The names of its states."""
        return ("second",) if self.loss is None else ("first", "second")

    @property
    def band(self) -> tuple[Fraction, Fraction]:
        """Coefficients of the difference and of the first state in the part of the sample at the centre."""
        width = self.loss - self.square if self.loss is not None else Fraction(0)
        return width, width * self.cross / self.square

    @property
    def denominator(self) -> tuple[Fraction, ...]:
        """Coefficients 1, a1 and a2 of the transfer function in 1/z."""
        if self.loss is None:
            return Fraction(1), 2 * self.square - 1
        own, other = 1 - 2 * self.loss, 1 - 2 * self.square
        return Fraction(1), -own - other, own * other + 4 * self.enter * self.cross

    @property
    def numerator(self) -> tuple[Fraction, ...]:
        """Coefficients b of the transfer function in 1/z, which follow from the gains."""
        _, a1, *rest = self.denominator
        a2 = rest[0] if rest else Fraction(0)
        low, high = self.low * (1 + a1 + a2), self.high * (1 - a1 + a2)
        if not rest:
            return (low + high) / 2, (low - high) / 2
        odd = self.centre * (1 - a2)
        return (low + high) / 4 + odd / 2, (low - high) / 2, (low + high) / 4 - odd / 2

    def require_stable(self) -> None:
        """Refuse poles on or outside the unit circle, by the criterion of Jury in rational numbers."""
        _, a1, *rest = self.denominator
        a2 = rest[0] if rest else Fraction(0)
        if not (abs(a1) < 1 + a2 and a2 < 1):
            raise InputError("a pole is on or outside the unit circle; all must be inside")

    @property
    def radius(self) -> float:
        """Largest magnitude of a pole."""
        _, a1, *rest = map(float, self.denominator)
        if not rest:
            return abs(a1)
        root = cmath.sqrt(a1 * a1 - 4 * rest[0])
        return max(abs(a1 + root), abs(a1 - root)) / 2

    @property
    def prototype(self) -> Prototype:
        """The transfer function in s."""
        if self.loss is None:
            return Prototype(math.nan, self.square / (1 - self.square), None, self.high, low=self.low)
        keep = 1 - self.loss
        return Prototype(
            math.nan,
            self.square / keep,
            (self.loss - self.square) / keep,
            *(self.high, self.centre, self.low),
        )

    @staticmethod
    def of(design: Prototype) -> Section:
        """Return a design with coefficients as short binary fractions; a word that holds them changes nothing.

        They are rounded together, so that the gains stay exact: the width may be off by 2^-8 of it, the frequency by
        less than 2^-10, and by still less where a notch is narrow or deep.
        """
        gains = {name: _significant(getattr(design, name)) for name in ("high", "centre", "low")}
        keep, square = _rounded(design)
        if design.width is None:
            return Section(square, **gains)
        # A power of two near the scale at which no cycle without input lengthens the vector of the states.
        scale = Fraction(2) ** round(math.log2(keep / square) / 2)
        return Section(square, keep / scale, 1 - keep, square * scale, **gains)


def _rounded(design: Prototype) -> tuple[Fraction, Fraction]:
    """Return p = 1/(1 + width + square) and q = square p as short binary fractions.

    Of those whose width is near enough, the ones with the nearest frequency.
    """
    square, width = design.square, design.width or Fraction(0)
    exact = 1 / (1 + width + square)
    gains = [abs(float(gain)) for gain in (design.high, design.centre, design.low) if gain]
    part = max(min(gains, default=1.0), _SMALLEST_GAIN) / max(gains, default=1.0)
    narrow = min(1.0, float(width) / math.sqrt(square) * min(1.0, 100 * part)) if width else 0.25
    for bits in range(_FEWEST_BITS, _MOST_BITS):
        unit, found = 2**bits, []
        # By so much p may change the width.
        reach = min(math.floor(_WIDTH * exact**2 * width * unit), 64)
        for top in range(round(exact * unit) - reach, round(exact * unit) + reach + 1):
            below = round(square * top) if width else unit - top
            left = unit - top - below
            if min(top, below, left if width else 1) <= 0 or abs(left - width * top) > _WIDTH * width * top:
                continue
            found.append((abs(Fraction(below, top) / square - 1), top, below))
        if found and min(found)[0] <= _SQUARE * narrow:
            _, top, below = min(found)
            return Fraction(top, unit), Fraction(below, unit)
    return exact, square * exact


def _significant(value: Fraction) -> Fraction:
    """Return a number with few significant bits."""
    if not value:
        return value
    unit = Fraction(2) ** (math.frexp(value)[1] - _GAIN_BITS)
    return round(value / unit) * unit


class Cascade:
    """Sections one after the other, with what follows from them."""

    #: Samples in a second
    sample_hz: float | Fraction
    designs: tuple[Prototype, ...]

    @property
    def sections(self) -> tuple[Section, ...]:
        """The sections with coefficients as the code has them."""
        raise NotImplementedError

    @property
    def numbered(self) -> tuple[tuple[str, Section], ...]:
        """The sections with what their names end in, nothing where there is one."""
        several = self.sections
        return tuple((f"_{k}" if len(several) > 1 else "", one) for k, one in enumerate(several, 1))

    @property
    def states(self) -> tuple[str, ...]:
        """The names of the states, in the order of the kernel."""
        return tuple(f"{name}{suffix}" for suffix, one in self.numbered for name in one.states)

    @property
    def numerator(self) -> tuple[float, ...]:
        """Coefficients b of the transfer function in 1/z."""
        return tuple(map(float, _product(one.numerator for one in self.sections)))

    @property
    def denominator(self) -> tuple[float, ...]:
        """Coefficients 1, a1, a2 and so on of the transfer function in 1/z."""
        return tuple(map(float, _product(one.denominator for one in self.sections)))

    @property
    def settling(self) -> int:
        """Cycles after which earlier samples no longer matter in double precision."""
        slowest = max(one.radius for one in self.sections)
        cycles = math.log(_NEGLIGIBLE) / math.log(slowest) if slowest else 1.0
        return math.ceil(cycles * (1 if len(self.sections) == 1 else _SEVERAL))

    def analog(self, hertz: float) -> complex:
        """Return the response of the analog filter at a frequency."""
        return math.prod((one.analog(hertz) for one in self.designs), start=1 + 0j)

    def designed(self, hertz: float) -> complex:
        """Return the response of the sampled filter before its coefficients are rounded."""
        return self._at(hertz, self.designs)

    def digital(self, hertz: float) -> complex:
        """Return the response of the sampled filter at a frequency."""
        return self._at(hertz, [one.prototype for one in self.sections])

    def _at(self, hertz: float, several: Sequence[Prototype]) -> complex:
        s = 1j * math.tan(math.pi * hertz / self.sample_hz)
        return math.prod((one.response(s) for one in several), start=1 + 0j)

    @property
    def analog_delay_s(self) -> float:
        """Delay of slow changes by the analog filter in s; nan for a filter that stops them."""
        return sum(one.delay(True, float(self.sample_hz)) for one in self.designs)

    @property
    def digital_delay_s(self) -> float:
        """Delay of slow changes by the sampled filter in s; nan for a filter that stops them."""
        return sum(one.prototype.delay(False, float(self.sample_hz)) for one in self.sections)


def _product(several: Iterable[Sequence[Fraction]]) -> list[Fraction]:
    found = [Fraction(1)]
    for one in several:
        found = convolved(found, one)
    return found


# Designs


def context() -> Any:
    """Return the arithmetic of numbers that are not rational."""
    from mpmath.ctx_mp import MPContext  # names and files do without it

    found: Any = MPContext()
    found.prec = _PRECISION
    return found


def _rational(value: Any) -> Fraction:
    """Return a number of the context as it is."""
    top, exponent = value.man_exp  # of the magnitude
    return (-1 if value < 0 else 1) * Fraction(int(top)) * Fraction(2) ** int(exponent)


def warped(hertz: Fraction, sample_hz: Fraction) -> Fraction:
    """Return K = tan(pi f/fs), the frequency in the plane of s."""
    c = context()
    part = hertz / sample_hz
    return _rational(c.tan(c.pi * part.numerator / part.denominator))


def ratio(decibels: Fraction) -> Fraction:
    """Return the ratio of amplitudes of a number of decibels."""
    c = context()
    return _rational(c.power(10, c.mpf(decibels.numerator) / decibels.denominator / 20))


def low_pass(kind: Response, sample_hz: Fraction) -> list[Prototype]:
    """Return a Butterworth or Bessel filter, or one of second order, its most damped section first."""
    c, hertz = context(), kind.frequency_hz
    assert hertz is not None, "a filter has a frequency"
    own = warped(hertz, sample_hz)
    if kind.damping is not None:
        return [Prototype(float(hertz), own**2, 2 * kind.damping * own)]
    coefficients = [c.mpf(value.numerator) / value.denominator for value in reversed(kind.polynomial)]
    found = []
    for root in c.polyroots(coefficients, maxsteps=400, extraprec=2 * _PRECISION):
        size = _rational(abs(root))
        damping, at = -2 * _rational(root.real) / size, float(hertz * size)
        if abs(root.imag) <= _REAL * abs(root):
            found.append((damping, Prototype(at, own * size)))
        elif root.imag > 0:
            found.append((damping, Prototype(at, (own * size) ** 2, damping * own * size)))
    return [one for _, one in sorted(found, key=lambda pair: -pair[0])]


def lead_lag(
    order: int, hertz: Fraction, gain: Fraction, damping: Fraction, sample_hz: Fraction
) -> Prototype:
    """Return a filter that passes fast changes times a gain, about its frequency the root of it."""
    c = context()
    size = c.mpf(gain.numerator) / gain.denominator
    apart = _rational(c.root(size, 2 * order))  # of the frequencies of the poles and of their mean
    pole = warped(hertz, sample_hz) * apart
    at = float(hertz * apart)
    if order == 1:
        return Prototype(at, pole, None, gain)
    return Prototype(at, pole**2, 2 * damping * pole, gain, _rational(c.sqrt(size)))


def notch(hertz: Fraction, width_hz: Fraction, gain: Fraction, sample_hz: Fraction) -> Prototype:
    """Return a notch with a gain at its frequency; where its power is the mean of both ends, it has its width."""
    square = warped(hertz, sample_hz) ** 2
    width = warped(width_hz, sample_hz) * (1 + square)
    return Prototype(float(hertz), square, width, Fraction(1), gain)


#: Real and imaginary part; a number above the real axis stands for its conjugate too.
Root = tuple[Fraction, Fraction]


def poles_and_zeros(
    poles: Sequence[Root], zeros: Sequence[Root], gain: Fraction, sample_hz: Fraction
) -> list[Prototype]:
    """Return gain times the product of z - zero over that of z - pole as sections, those nearest the circle last."""
    if _count(zeros) > _count(poles):
        raise InputError(
            f"zeros are {_count(zeros)}, poles {_count(poles)}; no more zeros than poles are needed"
        )
    for real, imaginary in poles:
        if real**2 + imaginary**2 >= 1:
            raise InputError(
                f"pole {float(real):g}{f' +- {float(imaginary):g} i' if imaginary else ''} is on or outside the unit "
                "circle; all must be inside"
            )
    reals = sorted(pole for pole in poles if not pole[1])
    groups = [[pole] for pole in poles if pole[1]] + [reals[k : k + 2] for k in range(0, len(reals), 2)]
    groups.sort(key=lambda group: max(real**2 + other**2 for real, other in group))
    taken: list[list[Root]] = [[] for _ in groups]
    for zero in sorted(zeros, key=lambda root: -root[1]):
        # To the section with the nearest pole, of those with room; pairs come first.
        free = [k for k, group in enumerate(groups) if _count(group) >= _count([*taken[k], zero])]
        nearest = min(free, key=lambda k: sum((a - b) ** 2 for a, b in zip(groups[k][0], zero, strict=True)))
        taken[nearest].append(zero)
    several = [_section(group, own, sample_hz) for group, own in zip(groups, taken, strict=True)]
    last = several[-1]
    several[-1] = replace(last, high=gain * last.high, centre=gain * last.centre, low=gain * last.low)
    return several


def _count(roots: Sequence[Root]) -> int:
    return sum(1 + bool(imaginary) for _, imaginary in roots)


def _section(poles: list[Root], zeros: list[Root], sample_hz: Fraction) -> Prototype:
    """Return a section of monic polynomials in z."""
    order, top = _count(poles), _polynomial(zeros)
    _, a1, a2 = (*_polynomial(poles), Fraction(0))[:3]
    b0, b1, b2 = (*(Fraction(0),) * (order + 1 - len(top)), *top, Fraction(0))[:3]
    half, rest = 1 - a1 + a2, 1 + a1 + a2
    square = rest / half
    hertz = float(sample_hz) / math.pi * math.atan(square if order == 1 else math.sqrt(square))
    width = None if order == 1 else 2 * (1 - a2) / half
    return Prototype(hertz, square, width, (b0 - b1 + b2) / half, (b0 - b2) / (1 - a2), (b0 + b1 + b2) / rest)


def _polynomial(roots: Sequence[Root]) -> tuple[Fraction, ...]:
    """Return the coefficients of a monic polynomial, those of the highest power first."""
    return tuple(_product([Fraction(1), -2 * r, r**2 + i**2] if i else [Fraction(1), -r] for r, i in roots))


def convolved(one: Sequence[Fraction], other: Sequence[Fraction]) -> list[Fraction]:
    """Return the product of two polynomials."""
    found = [Fraction(0)] * (len(one) + len(other) - 1)
    for i, a in enumerate(one):
        for j, b in enumerate(other):
            found[i + j] += a * b
    return found
