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
_LAST_OF_FOUR = (_LAST[:5] >> np.uint64(32)).astype(np.uint32)
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
        self._halves = np.ndarray((len(padded) - 3,), "<u4", padded, strides=(1,))
        self._has_exponents = b"e" in block or b"E" in block
        view = self._bytes[PAD - 1 :]
        is_mark = view == 10
        for other in (mark[0], *b"."):
            is_mark |= view == other
        if self._has_exponents:
            is_mark |= (view | 32) == 101
        self._marks = np.flatnonzero(is_mark)
        self._marks += PAD - 1
        self._kinds = self._bytes[self._marks]
        self._has_blanks = b" " in block
        self._is_end = self._kinds == 10
        self._is_end |= self._kinds == mark[0]
        ends = np.flatnonzero(self._is_end)
        is_line_end = self._kinds[ends[1:]] == 10
        self.rows = int(np.count_nonzero(is_line_end))
        self.is_plain = len(is_line_end) == self.rows * width and bool(is_line_end[width - 1 :: width].all())
        self._width, self._ends = width, ends

    def cells(self, column: int) -> tuple[Array, Array]:
        """Return where the cells of a column begin and end, without a blank on either side."""
        start = self._marks[self._ends[column : -1 : self._width]]
        start += 1
        end = self._marks[self._ends[column + 1 :: self._width]]
        if not self._has_blanks:
            return start, end
        start = start + (self._bytes[start] == 32)
        return start, end - ((self._bytes[end - 1] == 32) & (end > start))

    def text(self, start: int, end: int) -> str:
        """Return a cell."""
        return self._bytes[start:end].tobytes().decode("utf-8", "replace")

    def numbers(self, column: int) -> tuple[Array, Array, Array, bool]:
        """Return a column: doubles, integers, which of the cells are read, and whether all of those are integers."""
        start, end = self.cells(column)
        place = self._ends[column + 1 :: self._width] - 1
        sign = self._bytes[start]
        first = start + ((sign == 45) | (sign == 43))
        power = np.zeros(len(start), np.int64)
        stop, good = end, np.ones(len(start), bool)
        is_integer = True
        rows = np.flatnonzero(self._kinds[place] | 32 == 101) if self._has_exponents else ()
        if len(rows):
            is_integer = False
            stop = end.copy()
            stop[rows] = self._marks[place[rows]]
            place[rows] -= 1
            power[rows], good[rows] = self._exponents(stop[rows] + 1, end[rows])
        has_point = self._kinds[place] == 46
        point = np.where(has_point, self._marks[place], stop)
        place -= has_point
        good &= self._is_end[place]
        decimals = stop - point
        decimals -= has_point
        size = point - first
        good &= size + decimals > 0
        good &= decimals <= _DIGITS
        np.minimum(decimals, _DIGITS, out=decimals)
        digits = self._whole(point, size, good)
        good &= digits < _POWERS[_DIGITS - decimals]
        if not has_point.any():
            is_integer = is_integer and not (digits[good] >= _u(2**63)).any()
        else:
            is_integer = is_integer and not has_point[good].any()
            digits *= _POWERS[decimals]
            digits += self._whole(stop, decimals, good)
        power -= decimals
        values = _scaled(digits, power, good)
        integers = digits.view(np.int64)
        if (negative := sign == 45).any():
            np.negative(values, out=values, where=negative)
            np.negative(integers, out=integers, where=negative)
        return values, integers, good, is_integer

    def _exponents(self, start: Array, end: Array) -> tuple[Array, Array]:
        sign = self._bytes[start]
        size = end - start - ((sign == 45) | (sign == 43))
        good = (size > 0) & (size <= 4)
        digits = self._eight(end, np.where(good, size, 0), good)
        return np.where(sign == 45, -1, 1) * digits.astype(np.int64), good

    def _whole(self, end: Array, size: Array, good: Array) -> Array:
        """Return the numbers that end at places in so many digits, and note those that are none."""
        longest = int(size.max(initial=0))
        if longest <= 4 and int(size.min(initial=0)) >= 0:
            return self._four(end, size, good)
        good &= size <= PAD
        good &= size >= 0
        total = self._eight(end, size.clip(0, 8), good)
        for count in range(8, min(longest, PAD), 8):
            more = self._eight(end - count, (size - count).clip(0, 8), good)
            if count == 16:
                good &= more < _u(1000)
            more *= _POWERS[count]
            total += more
        return total

    def _eight(self, end: Array, size: Array, good: Array) -> Array:
        """Return numbers of up to eight digits, which are worked on as the bytes of one word."""
        word: Array = self._words[end - 8]
        word ^= _u(0x3030303030303030)
        word &= _LAST[size]
        other = word + _u(0x7676767676767676)
        other |= word
        other &= _u(0x8080808080808080)
        good &= other == 0
        np.right_shift(word, _u(8), out=other)
        word *= _u(10)
        word += other
        np.right_shift(word, _u(16), out=other)
        other &= _u(0x000000FF000000FF)
        other *= _u(0x0000271000000001)
        word &= _u(0x000000FF000000FF)
        word *= _u(0x000F424000000064)
        word += other
        word >>= _u(32)
        return word

    def _four(self, end: Array, size: Array, good: Array) -> Array:
        """Return numbers of up to four digits."""
        word: Array = self._halves[end - 4]
        word ^= np.uint32(0x30303030)
        word &= _LAST_OF_FOUR[size]
        other = word + np.uint32(0x76767676)
        other |= word
        other &= np.uint32(0x80808080)
        good &= other == 0
        np.right_shift(word, np.uint32(8), out=other)
        word *= np.uint32(10)
        word += other
        np.right_shift(word, np.uint32(16), out=other)
        other &= np.uint32(0xFF)
        word &= np.uint32(0xFF)
        word *= np.uint32(100)
        word += other
        return word.astype(np.uint64)


def _scaled(digits: Array, power: Array, good: Array) -> Array:
    """Return digits times powers of ten, and note those that are not rounded correctly."""
    size = np.abs(power)
    values = digits.astype(np.float64)
    exact = size == 0
    exact |= (digits <= _u(2**53)) & (size <= 22)
    factor = _EXACT[np.minimum(size, 22)]
    if power.max(initial=0) <= 0:
        values /= factor
    else:
        values = np.where(power < 0, values / factor, values * factor)
    if exact.all():
        return values
    if _HAS_64_BITS:
        rest = np.flatnonzero(~exact & (size <= _MOST_EXACT))
        wide, factors = digits[rest].astype(np.longdouble), _LONG_POWERS[size[rest]]
        wide = np.where(power[rest] < 0, wide / factors, wide * factors)
        values[rest] = wide
        # Half-way between two doubles it may have been rounded to: `float` decides.
        exact[rest] = wide.view(np.uint64)[::2] & _u(0x7FF) != _u(0x400)
    good &= exact
    return values
