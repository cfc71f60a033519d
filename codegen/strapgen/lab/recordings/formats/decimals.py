"""Decimal numbers in the bytes of a table, whole columns at a time, each rounded as `float` rounds it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

#: Zeros before a block: what is read together before the first cell.
PAD = 24
#: Most digits together: a number of 19 digits is below 2^64.
_DIGITS = 19
_POWERS = np.array([10**k for k in range(_DIGITS + 1)], np.uint64)
_EXACT = 10.0 ** np.arange(23)
#: The last so many of eight bytes.
_LAST = np.array([(2**64 - 1) ^ (2 ** (64 - 8 * k) - 1) for k in range(9)], np.uint64)
#: Whether a long double has 64 digits, with which 19 decimal ones are rounded as they should be, or seen to be a tie.
_HAS_64_BITS = np.finfo(np.longdouble).nmant == 63
#: Largest power of ten in 64 bits.
_MOST_EXACT = 27
_LONG_POWERS = np.longdouble(10) ** np.arange(_MOST_EXACT + 1)


def _u(value: int) -> np.uint64:
    return np.uint64(value)


class Marks:
    """Where the cells of a block of rows end, and where points and exponents stand in them.

    `block`: whole lines, each ended by a line feed. `mark`: the separator. `is_plain` is whether each line has as many
    cells as the table is wide.
    """

    def __init__(self, block: bytes, mark: bytes, width: int) -> None:
        padded = b"\n" * PAD + block
        self._bytes = np.frombuffer(padded, np.uint8)
        self._words = np.ndarray((len(padded) - 7,), "<u8", padded, strides=(1,))
        is_mark = np.zeros(256, bool)
        is_mark[[*b"\n.eE", mark[0]]] = True
        self._marks = np.flatnonzero(is_mark[self._bytes[PAD - 1 :]]) + (PAD - 1)
        self._kinds = self._bytes[self._marks]
        ends = np.flatnonzero((self._kinds == 10) | (self._kinds == mark[0]))
        self._is_end = np.zeros(len(self._marks), bool)
        self._is_end[ends] = True
        self._ends = ends[1:]
        is_line_end = self._kinds[self._ends] == 10
        self.rows = int(is_line_end.sum())
        self.is_plain = len(self._ends) == self.rows * width and bool(is_line_end[width - 1 :: width].all())
        self._width, self._before = width, ends[:-1]

    def cells(self, column: int) -> tuple[Array, Array]:
        """Return where the cells of a column begin and end, without a blank on either side."""
        start = self._marks[self._before[column :: self._width]] + 1
        end = self._marks[self._ends[column :: self._width]]
        start = start + (self._bytes[start] == 32)
        return start, end - ((self._bytes[end - 1] == 32) & (end > start))

    def text(self, start: int, end: int) -> str:
        """Return a cell."""
        return self._bytes[start:end].tobytes().decode("utf-8", "replace")

    def numbers(self, column: int) -> tuple[Array, Array, Array, bool]:
        """Return a column: doubles, integers, which of the cells are read, and whether all of those are integers."""
        start, end = self.cells(column)
        place = self._ends[column :: self._width]
        sign = self._bytes[start]
        first = start + ((sign == 45) | (sign == 43))
        has_exponent = self._kinds[place - 1] | 32 == 101
        power: Array | int = 0
        stop, good = end, np.ones(len(start), bool)
        if has_exponent.any():
            place = place - has_exponent
            stop = np.where(has_exponent, self._marks[place], end)
            power, good = self._exponents(np.where(has_exponent, stop + 1, end), end)
            good |= ~has_exponent
            power = np.where(has_exponent, power, 0)
        has_point = self._kinds[place - 1] == 46
        point = np.where(has_point, self._marks[place - 1], stop)
        good &= self._is_end[place - 1 - has_point]
        decimals = stop - point - has_point
        good &= (point - first + decimals > 0) & (decimals <= _DIGITS) & (decimals >= 0)
        decimals = np.where(good, decimals, 0)
        whole, fits = self._whole(point, point - first)
        part, has_digits = self._whole(stop, decimals)
        good &= fits & has_digits & (whole < _POWERS[_DIGITS - decimals])
        digits = whole * _POWERS[decimals] + part
        good_integers = bool((~(has_point | has_exponent) & (digits < _u(2**63)))[good].all())
        values, exact = _scaled(digits, power - decimals)
        negative = sign == 45
        integers = digits.view(np.int64)
        return (
            np.where(negative, -values, values),
            np.where(negative, -integers, integers),
            good & exact,
            good_integers,
        )

    def _exponents(self, start: Array, end: Array) -> tuple[Array, Array]:
        sign = self._bytes[start]
        start = start + ((sign == 45) | (sign == 43))
        size = end - start
        size = np.where((size > 0) & (size <= 4), size, 0)
        digits, good = self._eight(end, size)
        return np.where(sign == 45, -1, 1) * digits.astype(np.int64), good & (size > 0)

    def _whole(self, end: Array, size: Array) -> tuple[Array, Array]:
        """Return the numbers that end at places in so many digits, and which are numbers."""
        longest = int(size.max(initial=0))
        total, good = self._eight(end, np.minimum(size, 8).clip(0))
        for count in range(8, min(longest, PAD), 8):
            more, fits = self._eight(end - count, (size - count).clip(0, 8))
            good &= fits
            if count == 16:
                good &= more < _u(1000)
            total = total + more * _POWERS[count]
        return total, good & (size <= PAD) & (size >= 0)

    def _eight(self, end: Array, size: Array) -> tuple[Array, Array]:
        """Return numbers of up to eight digits, which are worked on as the bytes of one word."""
        word = (self._words[end - 8] ^ _u(0x3030303030303030)) & _LAST[size]
        good = ((word + _u(0x7676767676767676)) | word) & _u(0x8080808080808080) == 0
        word = word * _u(10) + (word >> _u(8))
        pairs = _u(0x000000FF000000FF)
        word = (word & pairs) * _u(0x000F424000000064) + ((word >> _u(16)) & pairs) * _u(0x0000271000000001)
        return word >> _u(32), good


def _scaled(digits: Array, power: Array) -> tuple[Array, Array]:
    """Return digits times powers of ten, and which of them are rounded correctly."""
    size = np.abs(power)
    exact = (size == 0) | (digits <= _u(2**53)) & (size <= 22)
    factor = _EXACT[np.minimum(size, 22)]
    values = digits.astype(np.float64)
    values = np.where(power < 0, values / factor, values * factor)
    if exact.all() or not _HAS_64_BITS:
        return values, exact
    rest = np.flatnonzero(~exact & (size <= _MOST_EXACT))
    wide, factors = digits[rest].astype(np.longdouble), _LONG_POWERS[size[rest]]
    wide = np.where(power[rest] < 0, wide / factors, wide * factors)
    values[rest] = wide
    # Half-way between two doubles it may have been rounded to: `float` decides.
    exact[rest] = wide.view(np.uint64)[::2] & _u(0x7FF) != _u(0x400)
    return values, exact
