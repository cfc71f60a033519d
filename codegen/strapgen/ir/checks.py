"""Checks the names, numbers and arrays that a caller passes in; a refusal is one line."""

from __future__ import annotations

import math
import os
from collections.abc import Container, Iterable
from fractions import Fraction
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.suggestions import shown, unknown

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Most steps, samples or records of a run, whose arrays then still fit into a few gigabytes of memory.
MOST = 20_000_000

#: Most characters of a text.
MOST_TEXT = 500

#: Character sequences that could begin or end a comment or a string in generated code, or escape its end.
_MARKS = ("/*", "*/", '"""', "\\")


def choice(what: str, value: str, allowed: Iterable[str], also: str = "", section: str = "") -> str:
    """Return `value` if it is one of `allowed`; `also` and `section` complete the message of a refusal."""
    names = allowed if isinstance(allowed, Container) else list(allowed)  # a mapping may know other names
    if not isinstance(value, str) or value not in names:
        raise unknown_name(what, value, list(names), also, section)
    return value


def unknown_name(
    what: str, value: object, names: Iterable[str], also: str = "", section: str = ""
) -> InputError:
    """Return the refusal of a name that nothing has."""
    error = InputError(unknown(what, value, names, also, section))
    error.unknown_name = True
    return error


def double(text: str) -> float:
    """Return the number that a text holds, in double precision; nan if it is no number.

    Every number that a file or a command line holds is read here or by `whole`: digits are 0 to 9, without underscores.

    >>> double(" -2.5e3 "), double("1_0")
    (-2500.0, nan)
    """
    if not _is_plain(text):
        return math.nan
    try:
        return float(text)
    except ValueError:
        return math.nan


def whole(what: str, text: str) -> int:
    """Return the whole number that a text holds."""
    try:
        if _is_plain(text):
            return int(text)
    except ValueError:
        pass
    raise InputError(f"{what} is {text!r}; a whole number is needed")


def _is_plain(text: str) -> bool:
    """Tell whether a text holds none of the characters that Python alone takes for parts of a number."""
    return "_" not in text and text.strip().isascii()


def number(what: str, value: str | float | Fraction, *, positive: bool = False) -> Fraction:
    """Read a finite number exactly.

    A float stands for its shortest decimal form, so that 0.1 means 1/10. A number too small for a double is read as 0.

    >>> number("step", "0.125", positive=True)
    Fraction(1, 8)
    """
    text = str(value).strip()
    try:
        # Double comes first, because exact arithmetic would write out all digits of a number like 1e-999999999.
        near = float(Fraction(text)) if "/" in text and _is_plain(text) else double(text)
        exact = Fraction(text if near and math.isfinite(near) else 0)
    except (ValueError, ZeroDivisionError, OverflowError):
        near = math.nan
    if not math.isfinite(near):
        raise InputError(f"{what} is {shown(str(value))}; a finite number is needed")
    if positive and exact <= 0:
        raise InputError(f"{what} is {value}; a number above 0 is needed")
    return exact


def count(what: str, value: Any, *, smallest: int = 1, largest: int | None = None) -> int:
    """Return `value` as a whole number from `smallest` to `largest`."""
    limit = f"at least {smallest}" if largest is None else f"from {smallest} to {largest}"
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    if not whole or value < smallest or (largest is not None and value > largest):
        raise InputError(f"{what} is {shown(value)}; a whole number {limit} is needed")
    return int(value)


def multiple(what: str, value: Fraction, of: str, unit: Fraction) -> int:
    """Return `value` / `unit`, two times in s, which must be a whole number from 1 to `MOST`."""
    ratio = value / unit
    if ratio > MOST:
        raise InputError(
            f"{what} {float(value):g} s is over {MOST:.0e} times the {of} {float(unit):g} s; that is too many"
        )
    if ratio.denominator != 1 or ratio < 1:
        raise InputError(
            f"{what} {float(value):g} s is not a whole multiple of the {of} {float(unit):g} s "
            f"(their ratio is {float(ratio):.9g})"
        )
    return int(ratio)


def text(what: str, value: Any) -> str:
    """Return `value` if it is one line of text that is safe in a comment of generated code."""
    if not isinstance(value, str) or not value.isprintable() or len(value) > MOST_TEXT:
        raise InputError(f"{what} is no text of one line and at most {MOST_TEXT} characters")
    for mark in _MARKS:
        if mark in value:
            raise InputError(f"{what} holds {mark}, which has a meaning in generated code; leave it out")
    return value


def real_array(what: str, value: Any, tail: tuple[int, ...], dtype: Any = float) -> NDArray[Any]:
    """Return `value` as a finite array of `dtype`, in C order, whose last axes have the shape `tail`."""
    import numpy as np  # imported here, since most commands do not need numpy and start faster without it

    if np.ma.isMaskedArray(value):
        raise InputTypeError(f"{what} is a masked array; an array without missing values is needed")
    try:
        array = np.asarray(value)
    except ValueError:
        raise InputError(f"{what} has rows of different lengths; an array of numbers is needed") from None
    if array.dtype.kind in "iu":
        array = array.astype(np.float64)
    if array.dtype.kind != "f":
        raise InputTypeError(f"{what} has dtype {array.dtype}; numbers are needed")
    if array.shape[array.ndim - len(tail) :] != tail or array.ndim < len(tail):
        needed = ", ".join(["...", *map(str, tail)])
        raise InputError(f"{what} has shape {array.shape}; ({needed}) is needed")
    # If the sum is finite, so is every term, and it is faster than a test of each; an overflow needs the full test.
    with np.errstate(over="ignore", invalid="ignore"):
        if not np.isfinite(array.sum()) and not np.isfinite(array).all():
            worst = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
            raise InputError(f"{what} holds {array[worst]} at index {worst}; finite numbers are needed")
        converted: NDArray[Any] = np.asarray(array, dtype=dtype, order="C")
    if converted.dtype.itemsize < array.dtype.itemsize and not np.isfinite(converted).all():
        raise InputError(f"{what} holds numbers beyond the range of {converted.dtype}")
    return converted


def numbers(what: str, value: Any, tail: tuple[int | None, ...] = ()) -> NDArray[Any]:
    """Return `value` as an array of doubles whose last axes have the shape `tail`, None standing for any length."""
    import numpy as np

    try:
        array = np.asarray(value)
    except ValueError:
        raise InputError(f"{what} has rows of different lengths; an array of numbers is needed") from None
    if array.dtype.kind not in "fiu":
        raise InputTypeError(f"{what} is {shown(value)}; an array of numbers is needed")
    last = array.shape[array.ndim - len(tail) :] if array.ndim >= len(tail) else None
    if last is None or any(want not in (None, have) for want, have in zip(tail, last, strict=True)):
        letters = iter("NKLM")
        axes = ", ".join(["...", *(next(letters) if length is None else str(length) for length in tail)])
        raise InputError(f"{what} has shape {array.shape}; ({axes}) is needed")
    return np.asarray(array, np.float64)


def path(what: str, value: Any) -> Path:
    """Return `value` as a path."""
    if not isinstance(value, str | os.PathLike):
        raise InputTypeError(f"{what} is {shown(value)}; the path of a file is needed")
    place = Path(value)
    if "\0" in str(place):
        raise InputError(f"{what} is {shown(str(place))}; the path of a file is needed")
    return place
