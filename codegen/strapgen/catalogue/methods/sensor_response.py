"""`Response` is what a sensor makes of a rate: its filters, their decimation and delay, and how it samples.

With b in rad a sample, sample j of the rate e^{iwt} is e^{ibj} K(b) for each unit of rate times the sampling interval.
A sensor that integrates the rate and does nothing else has K = e^{ib/2} S(b), S(b) = sin(b/2)/(b/2). `Response.gain` is
K by that.

>>> response = parse("response", "butterworth:4:40+delay:0.003")
>>> response.words, round(abs(complex(response.gain(40.0))), 6)
('butterworth:4:40+delay:0.003', 0.707107)
"""

from __future__ import annotations

import csv
import re
from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from functools import cache, cached_property
from itertools import pairwise
from math import factorial
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar

from strapgen.catalogue import toml_models
from strapgen.catalogue.toml_models import Key
from strapgen.ir import checks
from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.renamed import renamed
from strapgen.storage import streams

#: A rational that rounds to pi in double precision; with it the conditions of a sensor are rational.
PI = Fraction(245850922, 78256779)
#: Filters by name, whose transfer function is 1/P(s/w), and the highest order.
FILTERS, HIGHEST_ORDER = ("second-order", "butterworth", "bessel"), 8
#: What a sample is: the integral of the rate over its interval, or the rate as that begins, times its length.
INPUTS = ("increments", "instants")
#: Most rows of a table, most taps, and most rows through which the response between two of them goes.
MOST_ROWS, MOST_TAPS, _THROUGH = 5000, 256, 4
#: Binary digits behind the point of coefficients that are no rationals.
_BITS = 80
#: What stands between the parts of a response in words, no sign of an exponent; and the parts, for messages.
_PARTS = re.compile(r"\+(?=[A-Za-z./])")
FORMS = (
    "second-order:HZ:DAMPING, butterworth:ORDER:HZ, bessel:ORDER:HZ, fir:TAP:TAP:..., decimation:N, delay:S, instants, "
    "or a CSV file, with + between several"
)


@renamed(bandwidth_hz="frequency_hz")
@dataclass(frozen=True)
class Response:
    """The response of a sensor: the product of those of a table, of a filter, of taps and of a delay.

    Parameters
    ----------
    filter : str
        "second-order", 1/(1 + 2 zeta s/w + s^2/w^2); "butterworth" or "bessel", which pass half of the power at their
        frequency; empty for none.
    order : int
        Of a Butterworth or Bessel filter, 1 to 8.
    frequency_hz : Fraction
        The frequency of the filter, w/(2 pi).
    damping : Fraction
        zeta of a filter of second order.
    table : tuple of (Fraction, Fraction, Fraction)
        Rising frequencies in Hz, with the magnitude and the delay in s at each. Between rows both are polynomials of
        third degree in the square of the frequency; above the last row they are as there.
    taps : tuple of Fraction
        Weights of the internal samples, the newest first; by default those of an interval have the same one.
    decimation : int
        Internal samples in an interval.
    delay_s : Fraction
        In s.
    input : str
        One of `INPUTS`.
    sample_hz : Fraction
        Sampling frequency in Hz.

    Raises
    ------
    InputError
        If a number is missing, or does not go with the others.

    Examples
    --------
    >>> anti_alias = Response("butterworth", order=4, frequency_hz=Fraction(40))
    >>> round(abs(complex(anti_alias.gain(20.0))), 4)
    0.9981
    """

    filter: Annotated[str, Key("Filter before the samples; none without it", choices=FILTERS)] = ""
    order: Annotated[
        int | None, Key("Order of a Butterworth or Bessel filter", "1", least=1, most=HIGHEST_ORDER)
    ] = None
    frequency_hz: Annotated[
        Fraction | None,
        Key(
            "Frequency of the filter, where half of the power passes; of second order w/(2 pi)", "Hz", above=0
        ),
    ] = None
    damping: Annotated[Fraction | None, Key("Damping ratio zeta of second order", "1", above=0)] = None
    table: Annotated[
        tuple[tuple[Fraction, Fraction, Fraction], ...],
        Key("Rows of a frequency in Hz, the magnitude, and the delay in s", least=2, most=MOST_ROWS),
    ] = ()
    taps: Annotated[
        tuple[Fraction, ...], Key("Weights of internal samples, the newest first", least=1, most=MOST_TAPS)
    ] = ()
    decimation: Annotated[
        int,
        Key(
            "Internal samples in an interval; a sample is their mean without taps",
            "1",
            least=1,
            most=MOST_TAPS,
        ),
    ] = 1
    delay_s: Annotated[Fraction, Key("Delay", "s", least=-10, most=10)] = Fraction(0)
    input: Annotated[
        str, Key("A sample is the integral over its interval, or the rate as that begins", choices=INPUTS)
    ] = INPUTS[0]
    sample_hz: Annotated[Fraction | None, Key("Sampling frequency", "Hz", above=0)] = None

    __repr__ = short_repr

    #: Keys of files of before, by those in their place
    OLD_KEYS: ClassVar[dict[str, str]] = {"bandwidth_hz": "frequency_hz"}

    def __post_init__(self) -> None:
        """Refuse what does not go together; a damping alone says that the filter is of second order."""
        if not self.filter and self.damping is not None:
            object.__setattr__(self, "filter", FILTERS[0])
        own = "damping" if self.filter == FILTERS[0] else "order"
        needed = ("frequency_hz", own) if self.filter else ()
        for name in ("frequency_hz", "order", "damping"):
            if (getattr(self, name) is None) == (name in needed):
                what = f"a filter {self.filter} has" if self.filter else "there is no filter, which has"
                wrong = "missing" if name in needed else "there"
                raise InputError(f"{name} is {wrong}; {what} {' and '.join(needed or ('one',))}")
        if any(low[0] >= high[0] for low, high in pairwise(self.table)):
            raise InputError("table has frequencies that do not rise")
        if any(row[0] < 0 or row[1] <= 0 for row in self.table):
            raise InputError("table has a frequency below 0, or a magnitude that is not above 0")
        if self.taps and not sum(self.taps):
            raise InputError("taps sum to 0; a constant rate must pass")

    def at(self, sample_hz: Fraction) -> Response:
        """Return the response with its sampling frequency in Hz; what states one states the same one."""
        if self.sample_hz not in (None, sample_hz):
            raise InputError(
                f"sample_hz of the response is {float(self.sample_hz or 0):g}, not {float(sample_hz):g}"
            )
        return replace(self, sample_hz=sample_hz)

    def stretched(self, factor: Fraction) -> Response:
        """Return the response with its table, filter and delay at frequencies higher by a factor."""
        rows = tuple((hertz * factor, size, delay / factor) for hertz, size, delay in self.table)
        hertz = self.frequency_hz and self.frequency_hz * factor
        return replace(self, table=rows, frequency_hz=hertz, delay_s=self.delay_s / factor)

    @property
    def changes(self) -> bool:
        """Whether samples are anything but integrals of the rate."""
        return replace(self, sample_hz=None) != Response()

    @property
    def sampled(self) -> bool:
        """Whether it depends on the sampling frequency."""
        return bool(self.taps) or self.decimation > 1 or self.input != INPUTS[0]

    @property
    def words(self) -> str:
        """The response as on the command line, where a table has no words of its own."""
        filters = self.filter, self.order, self.frequency_hz, self.damping
        parts = [
            "table" * bool(self.table),
            ":".join(_shown(value) for value in filters if value),
            ":".join(["fir", *map(_shown, self.taps)]) * bool(self.taps),
            f"decimation:{self.decimation}" * (self.decimation > 1),
            f"delay:{_shown(self.delay_s)}" * bool(self.delay_s),
            self.input,
        ]
        return "+".join(part for part in parts if part and part != INPUTS[0]) or INPUTS[0]

    @property
    def title(self) -> str:
        """The response in the title of what is designed for it."""
        if self.damping is not None and "+" not in self.words:
            return f"{_shown(self.frequency_hz)} Hz"
        return re.sub(r"(fir):[^+]*", r"\1", self.words).replace(":", " ").replace("+", ", ")

    @property
    def facts(self) -> dict[str, Any]:
        """The fields that differ from their defaults, by name."""
        return {
            one.name: getattr(self, one.name)
            for one in fields(self)
            if getattr(self, one.name) != one.default
        }

    @property
    def plain(self) -> dict[str, Any]:
        """The same as JSON data; of second order with the key of before as well."""
        data = {name: _plain(value) for name, value in self.facts.items()}
        return data | ({"bandwidth_hz": data["frequency_hz"]} if self.damping else {})

    @cached_property
    def polynomial(self) -> tuple[Fraction, ...]:
        """The coefficients of P, from the constant 1 on."""
        if self.damping is not None:
            return Fraction(1), 2 * self.damping, Fraction(1)
        return _polynomial(self.filter, self.order or 0)

    @property
    def weights(self) -> tuple[Fraction, ...]:
        """The weights of the internal samples, the newest first."""
        return self.taps or (Fraction(1, self.decimation),) * self.decimation

    @property
    def _lead(self) -> Fraction:
        """The middle of the newest internal sample after that of the interval, in intervals."""
        return (
            Fraction(self.decimation - 1, 2 * self.decimation) if self.input == INPUTS[0] else Fraction(-1, 2)
        )

    def gain(self, hertz: Any, context: Any = None) -> Any:
        """Return K(b) e^{-ib/2}/S(b), by which the rate that a sensor integrates has the samples of this one.

        Parameters
        ----------
        hertz : float or array, or number of the context
            Frequencies in Hz, from 0 on.
        context : optional
            Of mpmath; by default double precision.

        Returns
        -------
        complex or array, or number of the context
        """
        c = context or _double()
        number = _number(c)
        s, value = 2 * c.j * number(PI) * hertz, 1 + 0 * c.j * hertz
        if self.table:
            size, delay = self._between(hertz, c)
            value = value * size * c.exp(-s * delay)
        if self.frequency_hz is not None:
            x, below = c.j * hertz / number(self.frequency_hz), 0
            for coefficient in reversed(self.polynomial):
                below = below * x + number(coefficient)
            value = value / below
        if self.delay_s:
            value = value * c.exp(-s * number(self.delay_s))
        if self.sampled:
            turn = s / number(self._rate)  # ib
            inner = turn / self.decimation
            total = sum(number(weight) * c.exp(-k * inner) for k, weight in enumerate(self.weights))
            value = value * total * c.exp(number(self._lead) * turn) / c.sinc(turn / 2 / c.j)
            if self.input == INPUTS[0]:
                value = value * c.sinc(inner / 2 / c.j)
        return value

    def series(self, count: int) -> list[Fraction]:
        """Return K e^{-ib/2} as a power series in ib: the moments of a sample about the middle of its interval.

        >>> [str(c) for c in Response().series(5)]
        ['1', '0', '1/24', '0', '1/1920']
        """
        series = _exponential([Fraction(0), self._lead], count)
        if self.input == INPUTS[0]:  # sinh(x)/x
            half = Fraction(1, 2 * self.decimation)
            series = product(series, [half**k / factorial(k + 1) * (1 - k % 2) for k in range(count)])
        inner = [(weight, Fraction(-k, self.decimation)) for k, weight in enumerate(self.weights)]
        zero = Fraction(0)
        series = product(
            series, [sum((w * x**i for w, x in inner), zero) / factorial(i) for i in range(count)]
        )
        if self.frequency_hz is not None:
            inverse = self._rate / (2 * PI * self.frequency_hz)  # 1/(w T)
            series = quotient(series, [c * inverse**k for k, c in enumerate(self.polynomial)])
        if self.table:
            # The square of a frequency is -(s rate/(2 pi))^2, s in units of the sampling frequency.
            square = -((self._rate / (2 * PI)) ** 2)
            size, delay = ([c * square**k for k, c in enumerate(row)] for row in self._at_rest)
            late = [zero, *(-self._rate * c for c in _of_square(delay))]
            series = product(product(series, _of_square(size)), _exponential(late, count))
        if self.delay_s:
            series = product(series, _exponential([zero, -self.delay_s * self._rate], count))
        return series

    @property
    def _rate(self) -> Fraction:
        if self.sample_hz is None:
            raise InputError("sample_hz is missing; the samples of a sensor depend on it")
        return self.sample_hz

    def _between(self, hertz: Any, c: Any) -> tuple[Any, Any]:
        """Return magnitude and delay of the table at one frequency, or at many."""
        if getattr(hertz, "shape", ()):
            pairs = zip(*(self._between(float(one), c) for one in hertz.ravel()), strict=True)
            size, delay = (c.array(part).reshape(hertz.shape) for part in pairs)
            return size, delay
        number, through = _number(c), min(_THROUGH, len(self.table))
        place = bisect(self._hertz, float(hertz))
        start = min(max(0, place - through // 2), len(self.table) - through)
        x = min(hertz, number(self.table[-1][0])) ** 2
        rows = [tuple(map(number, (f * f, *rest))) for f, *rest in self.table[start : start + through]]
        size = delay = 0
        for own, one, other in rows:
            weight = 1
            for root, *_ in rows:
                weight = weight if root == own else weight * (x - root) / (own - root)
            size, delay = size + weight * one, delay + weight * other
        return size, delay

    @cached_property
    def _hertz(self) -> list[float]:
        return [float(row[0]) for row in self.table]

    @cached_property
    def _at_rest(self) -> tuple[list[Fraction], list[Fraction]]:
        """The coefficients of magnitude and delay in the square of a frequency next to 0, to `_BITS`."""
        size, delay = (
            _through([(hertz**2, row[k]) for hertz, *row in self.table[:_THROUGH]]) for k in range(2)
        )
        return size, delay


def _through(points: Sequence[tuple[Fraction, Fraction]]) -> list[Fraction]:
    """Return the coefficients, to `_BITS`, of the polynomial through points."""
    total = [Fraction(0)] * len(points)
    for own, value in points:
        basis = [value]
        for root, _ in points:
            if root != own:
                pairs = zip([Fraction(0), *basis], [*basis, Fraction(0)], strict=True)
                basis = [(low - root * high) / (own - root) for low, high in pairs]
        total = [a + b for a, b in zip(total, basis, strict=True)]
    return [Fraction(round(c * 2**_BITS), 2**_BITS) for c in total]


def _number(context: Any) -> Any:
    return lambda value: context.mpf(value.numerator) / value.denominator


@cache
def _double() -> Any:
    """Return double precision as a context, for numbers and for arrays of them."""
    import numpy as np

    return SimpleNamespace(
        mpf=float, j=1j, exp=np.exp, array=np.array, sinc=lambda x: np.sinc(x.real / np.pi)
    )


def _of_square(values: Sequence[Fraction]) -> list[Fraction]:
    """Return the coefficients of a polynomial in a square as those in what is squared."""
    return [c for value in values for c in (value, Fraction(0))]


def product(one: Sequence[Fraction], other: Sequence[Fraction]) -> list[Fraction]:
    """Return the product of power series, of as many terms as the first one has."""
    pairs = ((range(max(0, n + 1 - len(other)), n + 1), n) for n in range(len(one)))
    return [sum((one[k] * other[n - k] for k in places), Fraction(0)) for places, n in pairs]


def quotient(one: Sequence[Fraction], other: Sequence[Fraction]) -> list[Fraction]:
    """Return the quotient of power series, of as many terms as the first one has; the other begins with no 0."""
    result: list[Fraction] = []
    for n, value in enumerate(one):
        places = range(1, min(n, len(other) - 1) + 1)
        rest = value - sum((other[k] * result[n - k] for k in places), Fraction(0))
        result.append(rest / other[0])
    return result


def _exponential(series: Sequence[Fraction], count: int) -> list[Fraction]:
    """Return the exponential of a power series that begins with 0, from n e_n = sum_k k a_k e_(n-k)."""
    result = [Fraction(1)]
    for n in range(1, count):
        places = range(1, min(n, len(series) - 1) + 1)
        result.append(sum((k * series[k] * result[n - k] for k in places), Fraction(0)) / n)
    return result


@cache
def _polynomial(filter: str, order: int) -> tuple[Fraction, ...]:
    """Return the coefficients of P of a filter that passes half of the power at w, to `_BITS`.

    >>> [[round(float(c), 6) for c in _polynomial(*one)] for one in (("butterworth", 3), ("bessel", 2))]
    [[1.0, 2.0, 2.0, 1.0], [1.0, 1.361654, 0.618034]]
    """
    from mpmath.ctx_mp import MPContext  # names and files do without it

    c: Any = MPContext()
    c.prec = 2 * _BITS
    number = _number(c)
    if filter == "butterworth":
        values, part = [c.mpf(1)], c.pi / (2 * order)
        for k in range(1, order + 1):
            values.append(values[-1] * c.cos((k - 1) * part) / c.sin(k * part))
    else:
        # The reverse Bessel polynomial has (2n - k)!/(2^(n-k) k! (n - k)!) of x^k.
        n, ratios = order, [Fraction(1)]
        for k in range(n):
            ratios.append(ratios[-1] * Fraction(2 * (n - k), (2 * n - k) * (k + 1)))
        values = [number(value) for value in ratios]
        low, high = c.mpf(0), c.mpf(order + 1)
        while high - low > c.ldexp(1, 8 - c.prec):
            middle = (low + high) / 2
            below = abs(c.polyval(values[::-1], c.j * middle)) ** 2
            low, high = (middle, high) if below < 2 else (low, middle)
        values = [value * low**k for k, value in enumerate(values)]
    return tuple(Fraction(int(c.nint(c.ldexp(value, _BITS))), 1 << _BITS) for value in values)


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return list(map(_plain, value))
    return float(value) if isinstance(value, Fraction) else value


def _shown(value: Any) -> str:
    return f"{float(value):.12g}" if isinstance(value, Fraction) else str(value)


def files_in(text: str) -> list[str]:
    """Return the files in the words of a response.

    >>> files_in("aa.csv+delay:0.003")
    ['aa.csv']
    """
    return [part for part in _PARTS.split(text) if part.endswith(".csv")]


def parse(what: str, text: str, folder: Path = Path()) -> Response:
    """Return the response of words, or of a CSV file in a folder.

    >>> parse("--response", "bessel:3:80+instants").words
    'bessel:3:80+instants'
    """
    found: dict[str, Any] = {}
    for part in _PARTS.split(text):
        name, *numbers = part.split(":")
        if name in FILTERS and len(numbers) == 2:
            keys = ("frequency_hz", "damping") if name == FILTERS[0] else ("order", "frequency_hz")
            one: dict[str, Any] = {"filter": name, **dict(zip(keys, numbers, strict=True))}
        elif name == "fir" and numbers:
            one = {"taps": numbers}
        elif name in ("decimation", "delay") and len(numbers) == 1:
            one = {"delay_s" if name == "delay" else name: numbers[0]}
        elif name in INPUTS and not numbers:
            one = {"input": name}
        elif part.endswith(".csv"):
            one = {"table": read_table(folder / part)}
        else:
            raise InputError(f"{what} {part!r} is not known; allowed: {FORMS}")
        if twice := one.keys() & found.keys():
            raise InputError(f"{what} {text!r} has {min(twice)} twice; one is needed")
        found |= one
    whole = {
        key: checks.whole(f"{what} {key}", found[key]) for key in ("order", "decimation") if key in found
    }
    response: Response = toml_models.parse(Response, found | whole, what)
    return response


def read_table(path: Path) -> tuple[tuple[Fraction, ...], ...]:
    """Read the table of a response: columns frequency_hz, magnitude, and phase_deg or delay_s."""
    try:
        with streams.opened(path) as file:
            rows = [row for row in csv.reader(file.read().decode("utf-8-sig").splitlines()) if any(row)]
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read ({getattr(error, 'strerror', 'not UTF-8')})") from None
    header = [cell.strip().lower() for cell in rows[0]] if rows else []
    last = "delay_s" if "delay_s" in header else "phase_deg"
    columns = ("frequency_hz", "magnitude", last)
    if sorted(header) != sorted(columns):
        raise InputError(
            f"{path} has the columns {', '.join(header) or 'none'}; {', '.join(columns[:2])}, and phase_deg or delay_s "
            "are needed"
        )
    if not 2 <= len(rows) - 1 <= MOST_ROWS:
        raise InputError(f"{path} has {counted(len(rows) - 1, 'row')}; 2 to {MOST_ROWS} are needed")
    table: list[tuple[Fraction, ...]] = []
    for number, row in enumerate(rows[1:], 2):
        if len(row) != len(columns):
            raise InputError(f"{path}, line {number}: {counted(len(row), 'cell')}; {len(columns)} are needed")
        cells, where = dict(zip(header, row, strict=True)), f"{path}, line {number}"
        table.append(tuple(checks.number(f"{where}: {name}", cells[name].strip()) for name in columns))
    return tuple(table if last == "delay_s" else _delays(path, table))


def _delays(path: Path, table: list[tuple[Fraction, ...]]) -> list[tuple[Fraction, ...]]:
    """Return rows with delays in place of phases in degrees, of which no two neighbours differ by half a turn."""
    turns, before = 0, Fraction(0)
    rows: list[tuple[Fraction, ...]] = []
    for hertz, size, phase in table:
        turns -= round((phase + 360 * turns - before) / 360)
        before = phase + 360 * turns
        if hertz:
            rows.append((hertz, size, -before / 360 / hertz))
        elif before:
            raise InputError(f"{path} has a phase of {float(phase):g} deg at 0 Hz; 0 is needed")
    if len(rows) < len(table):  # the delay at 0 Hz is that of the polynomial through the next rows
        at_rest = _through([(hertz**2, delay) for hertz, _, delay in rows[:_THROUGH]])[0]
        rows.insert(0, (table[0][0], table[0][1], at_rest))
    return rows
