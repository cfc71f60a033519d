"""Checks the names, numbers and arrays that a caller passes in; a refusal is one line, with the names perhaps meant."""

from __future__ import annotations

import difflib
import math
import os
import reprlib
from collections.abc import Container, Iterable
from fractions import Fraction
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen.ir.exceptions import InputError, InputTypeError

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
    """Return the error for an unknown name."""
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
    """Return whether a text is ASCII without underscores, which Python alone allows in numbers."""
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


def is_whole(value: Any) -> bool:
    """Return whether a value is a whole number, of any type: of Python, of numpy, or a float such as 2.0."""
    return isinstance(value, Real) and not isinstance(value, bool) and bool(value == value // 1)


def count(what: str, value: Any, *, smallest: int = 1, largest: int | None = None) -> int:
    """Return `value`, a whole number of any type, as an int from `smallest` to `largest`.

    >>> count("increments", 2.0)
    2
    """
    limit = f"at least {smallest}" if largest is None else f"from {smallest} to {largest}"
    if not is_whole(value) or value < smallest or (largest is not None and value > largest):
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


def real_array(
    what: str, value: Any, tail: tuple[int, ...], dtype: Any = float, *, finite: bool = True
) -> NDArray[Any]:
    """Return `value` as a finite array of `dtype`, in C order, whose last axes have the shape `tail`.

    An array of that type and order is returned itself, uncopied. With `finite` False `require_finite` is left to the
    caller.
    """
    import numpy as np  # imported here, since most commands do not need numpy and start faster without it

    if np.ma.isMaskedArray(value):
        raise InputTypeError(f"{what} is a masked array; an array without missing values is needed")
    try:
        array = np.asarray(value)
    except ValueError:
        raise InputError(f"{what} has rows of different lengths; an array of numbers is needed") from None
    if array.dtype.kind not in "fiu":
        raise InputTypeError(f"{what} has dtype {array.dtype}; numbers are needed")
    if array.shape[array.ndim - len(tail) :] != tail or array.ndim < len(tail):
        needed = ", ".join(["...", *map(str, tail)])
        raise InputError(f"{what} has shape {array.shape}; ({needed}) is needed")
    with np.errstate(over="ignore", invalid="ignore"):
        converted: NDArray[Any] = np.asarray(array, dtype=dtype, order="C")
    if finite:
        require_finite(what, array, converted)
    return converted


def require_finite(what: str, value: Any, converted: NDArray[Any]) -> None:
    """Refuse an array that is not finite; `converted` is the same in the type that is needed."""
    import numpy as np

    # If the sum is finite, so is every term, and it is faster than a test of each; an overflow needs the full test.
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(converted.sum()) or np.isfinite(converted).all():
            return
    array = np.asarray(value)
    bad = np.argwhere(~np.isfinite(array))
    if not len(bad):
        raise InputError(f"{what} holds numbers beyond the range of {converted.dtype}")
    worst = tuple(int(i) for i in bad[0])
    raise InputError(f"{what} holds {array[worst]} at index {worst}; finite numbers are needed")


def output_array(
    what: str, value: Any, shape: tuple[int, ...], dtype: Any, *inputs: NDArray[Any]
) -> NDArray[Any]:
    """Return `value`, an array into which results of a shape and a type are written, apart from the inputs."""
    import numpy as np

    needed = f"a writeable array {shape} of {np.dtype(dtype)} in C order is needed"
    if not isinstance(value, np.ndarray) or np.ma.isMaskedArray(value):
        raise InputTypeError(f"{what} is {describe(value)}; {needed}")
    if value.shape != shape or value.dtype != dtype:
        raise InputError(f"{what} has shape {value.shape} and dtype {value.dtype}; {needed}")
    if not value.flags.carray:
        kind = "not aligned" if value.flags.c_contiguous else "not in C order"
        kind = kind if value.flags.writeable else "read-only"
        raise InputError(f"{what} is {kind}; {needed}")
    if any(np.may_share_memory(value, one) for one in inputs):
        raise InputError(f"{what} overlaps an input; memory of its own is needed")
    return value


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


#: Most names that a message writes out; of more, it writes these and says how to see all.
MOST_NAMES = 8
#: Most names that a message suggests.
_MOST_SUGGESTIONS = 3
#: Likeness from which on a name is suggested, the part of all characters that two names share: for a name with the same
#: first letter, and for any other.
_ALIKE, _MORE_ALIKE = 0.6, 0.75
#: Most characters of a value that a message repeats.
_MOST_CHARACTERS = 60

#: Sections of ``strapgen list`` that show all names of a kind.
SECTIONS = {
    "kernel": "kernels",
    "method": "methods",
    "motion": "motions",
    "target": "targets",
    "backend": "backends",
    "reference": "backends",
}

_EULER_PARAMETERS = (
    *("quaternion", "quaternions", "quat", "unit-quaternion", "euler-parameters", "euler-rodrigues"),
    *("euler-symmetric-parameters", "versor", "ep"),
)
_DIRECTION_COSINES = (
    *("direction-cosines", "direction-cosine", "direction-cosine-matrix", "cosines", "cosine-matrix"),
    *("rotation-matrix", "attitude-matrix", "matrix", "dc"),
)
_CAYLEY_KLEIN = ("ck", "cayley", "cayley-klein-parameters", "spinor", "su2")

#: Names that other people use, by kind, and what they are called here.
SYNONYMS: dict[str, dict[str, tuple[str, ...]]] = {
    "algorithm": {
        **dict.fromkeys(_EULER_PARAMETERS, ("euler",)),
        **dict.fromkeys(_DIRECTION_COSINES, ("dcm",)),
        **dict.fromkeys(_CAYLEY_KLEIN, ("cayley-klein",)),
        **dict.fromkeys(("bortz", "rotvec", "phi"), ("rotation-vector",)),
        **dict.fromkeys(
            ("euler-angles", "roll-pitch-yaw"), ("dcm-from-euler-angles", "euler-angles-from-dcm")
        ),
        **dict.fromkeys(("quaternion-product", "quaternion-multiply"), ("euler-product",)),
        "quaternion-normalize": ("euler-normalize",),
    },
    "method": {
        **dict.fromkeys(("heun", "heun2", "heuns-method"), ("rk2",)),
        **dict.fromkeys(("runge", "rk2-midpoint"), ("midpoint",)),
        **dict.fromkeys(("runge-kutta", "rungekutta", "rk", "kutta", "classical"), ("rk4",)),
        **dict.fromkeys(("euler", "forward-euler", "rectangular"), ("rk1",)),
        **dict.fromkeys(("trapezoidal", "trapezoid", "improved-euler"), ("rk2",)),
        **dict.fromkeys(("rkf45", "rkf", "fehlberg"), ("fehlberg4", "fehlberg5")),
        **dict.fromkeys(("rk45", "dopri", "dopri5", "dormand-prince", "ode45"), ("dormand-prince5",)),
        **dict.fromkeys(("dopri8", "dop853", "rk8"), ("dormand-prince8",)),
        **dict.fromkeys(("taylor", "picard", "series"), ("taylor4",)),
        **dict.fromkeys(("magnus", "exponential"), ("magnus4",)),
        **dict.fromkeys(("rkmk", "rkmk4", "munthe-kaas"), ("munthe-kaas4",)),
        **dict.fromkeys(("coning", "savage", "miller"), ("coning-compressed", "coning-combined")),
    },
    "motion": {
        **dict.fromkeys(("cone", "conical", "precession"), ("coning",)),
        **dict.fromkeys(("sine", "sin", "oscillating", "oscillation", "vibration"), ("sinusoidal",)),
        **dict.fromkeys(("steady", "linear", "fixed"), ("constant",)),
    },
    "target": {
        **dict.fromkeys(("python", "py"), ("numpy",)),
        **dict.fromkeys(("double", "c-double", "c99", "c64"), ("c",)),
        **dict.fromkeys(("float", "float32", "c32", "single"), ("c-float",)),
        **dict.fromkeys(
            ("fixed", "fixed-point", "q31", "q15", "c-fixed32", "c-fixed16", "c-q31"), ("c-fixed",)
        ),
        **dict.fromkeys(("model", "integer-model"), ("fixed-model",)),
    },
    "backend": {
        **dict.fromkeys(("python", "py"), ("numpy",)),
        **dict.fromkeys(("double", "c-double", "c99"), ("c",)),
        **dict.fromkeys(("float", "float32", "single"), ("c-float",)),
        **dict.fromkeys(("c-fixed", "fixed", "fixed-point"), ("c-fixed32", "c-fixed16")),
        **dict.fromkeys(("c-w32", "q31", "fixed32"), ("c-fixed32",)),
        **dict.fromkeys(("c-w16", "q15", "fixed16"), ("c-fixed16",)),
        **dict.fromkeys(("model", "integer-model"), ("fixed-model",)),
        **dict.fromkeys(("mpmath", "sympy", "truth", "reference"), ("exact",)),
    },
}
SYNONYMS["kernel"] = SYNONYMS["algorithm"]
SYNONYMS["reference"] = SYNONYMS["backend"]


def suggestions(what: str, value: str, allowed: Iterable[str]) -> list[str]:
    """Return at most three allowed names by synonym or similarity, the likeliest first.

    >>> suggestions("algorithm", "Euler parameters", ["dcm", "euler"])
    ['euler']
    >>> suggestions("target", "numpi", ["numpy", "c"])
    ['numpy']
    """
    names = list(allowed)
    plain = "-".join(value.lower().replace("_", " ").replace("-", " ").split())
    likely = [name for name in SYNONYMS.get(what, {}).get(plain, ()) if name in names]
    if likely:
        return likely
    dashed = {name: name.replace("_", "-") for name in names}
    alike = {name: difflib.SequenceMatcher(None, plain, dashed[name]).ratio() for name in names}
    close = [name for name in names if alike[name] >= (_ALIKE if name[:1] == plain[:1] else _MORE_ALIKE)]
    close.sort(key=lambda name: -alike[name])
    inside = [name for name in names if len(plain) > 2 and plain in dashed[name]]
    return list(dict.fromkeys([*close, *inside]))[:_MOST_SUGGESTIONS]


def did_you_mean(what: str, value: str, allowed: Iterable[str]) -> str:
    """Return the question for a name that is not known, or nothing.

    >>> did_you_mean("target", "numpi", ["numpy", "c"])
    ' (did you mean numpy?)'
    """
    names = suggestions(what, value, allowed)
    return f" (did you mean {alternatives(names)}?)" if names else ""


def unknown(what: str, value: object, allowed: Iterable[str], also: str = "", section: str = "") -> str:
    """Return the message for an unknown name; `also` and `section` refer to further names.

    >>> unknown("target", "numpi", ["numpy", "c"])
    "target 'numpi' is not known (did you mean numpy?); allowed: numpy, c"
    """
    names = list(allowed)
    section = section or SECTIONS.get(what, "")
    question = did_you_mean(what, value, names) if isinstance(value, str) else ""
    cut = bool(section) and len(names) > MOST_NAMES + 1
    listed = some(names) if cut else ", ".join(names)
    listed += f", or {also}" if also else ""
    listed += f"; strapgen list {section} shows all" if cut else ""
    return f"{what} {shown(value)} is not known{question}; allowed: {listed}"


def shown(value: object) -> str:
    """Return a value on one line, cut if it is long."""
    line = " ".join(repr(value).split())
    return line if len(line) <= _MOST_CHARACTERS else f"{line[:_MOST_CHARACTERS]}..."


def counted(number: int, one: str, many: str = "") -> str:
    """Return a number with its noun, in the plural unless it is 1."""
    return f"{number} {one if number == 1 else many or f'{one}s'}"


def needed(number: int) -> str:
    """Return "1 is needed", "2 are needed"."""
    return f"{number} {'is' if number == 1 else 'are'} needed"


def some(names: Iterable[str]) -> str:
    """Return a list of names: the first ones, and the number of the others."""
    every = list(names)
    more = len(every) - MOST_NAMES
    return ", ".join(every) if more < 2 else f"{', '.join(every[:MOST_NAMES])} and {more} more"


def alternatives(names: list[str]) -> str:
    """Return names as alternatives in words.

    >>> alternatives(["rk1", "rk2", "rk3"])
    'rk1, rk2 or rk3'
    """
    *first, last = names
    return f"{', '.join(first)} or {last}" if first else last


#: The call that takes an argument of a class to the next stage, and the class that it returns.
_NEXT = {
    "str": ("derive({})", "Kernel"),
    "Choice": ("derive({})", "Kernel"),
    "Kernel": ("lower({})", "Program"),
    "Program": ("generate({}, target)", "Sources"),
    "FixedProgram": ("generate({}, target)", "Sources"),
    "Sources": ("build({})", "Backend"),
}
#: The call that makes an argument from a name at once.
_NAMED = {"Backend": "backend({})", "Motion": "motion({}, ...)"}
#: The function that makes an argument, where no call leads to it.
_MAKERS = {
    "str": "strapgen list shows the names",
    "Choice": "strapgen.choose makes one",
    "Kernel": "strapgen.derive makes one",
    "Program": "strapgen.lower makes one",
    "FixedProgram": "strapgen.quantize makes one",
    "Sources": "strapgen.generate makes them",
    "Backend": "strapgen.backend makes one",
    "Motion": "strapgen.motion makes one",
    "Settings": "strapgen.Settings makes them",
}
#: The function that takes an argument which was passed to another one.
_TAKERS = {
    "Choice": "strapgen.derive takes it",
    "Kernel": "strapgen.lower takes it",
    "Program": "strapgen.generate takes it",
    "FixedProgram": "strapgen.generate takes it",
    "Sources": "strapgen.build takes them",
    "Backend": "strapgen.simulate takes it",
    "Motion": "strapgen.simulate takes it",
    "Settings": "strapgen.quantize takes them",
}


def require(function: str, value: Any, *classes: type) -> None:
    """Refuse an argument of a wrong class; the message names the call that makes the right one.

    >>> require("derive", 3, str)
    Traceback (most recent call last):
        ...
    strapgen.InputTypeError: derive takes a name, not 3; strapgen list shows the names
    """
    if isinstance(value, classes):
        return
    names = [cls.__name__ for cls in classes]
    needed = " or ".join(map(_with_article, names))
    raise InputTypeError(
        f"{function} takes {needed}, not {describe(value)}; {_remedy(function, value, names[0])}"
    )


def describe(value: Any) -> str:
    """Return a value in a few words: a short one itself, another one by its class."""
    if value is None or isinstance(value, str | int | float):
        return reprlib.repr(value)
    return _with_article(_stage_class(value))


def _stage_class(value: Any) -> str:
    """Return the name of the class of a value; of a class that stages exchange for those derived from it."""
    names = [cls.__name__ for cls in type(value).__mro__]
    return next((name for name in names if name in _MAKERS), names[0])


def _remedy(function: str, value: Any, needed: str) -> str:
    """Return the call that converts a value to a needed class, or else the function that takes the value."""
    reached = _stage_class(value)
    call = describe(value) if reached == "str" else reached.lower()
    if reached == "str" and needed in _NAMED:
        return f"strapgen.{_NAMED[needed].format(call)} makes one"
    while reached in _NEXT:
        template, reached = _NEXT[reached]
        call = f"strapgen.{template.format(call)}"
        if reached == needed:
            return f"{call} makes {'them' if needed == 'Sources' else 'one'}"
    taker = _TAKERS.get(_stage_class(value), "")
    # An argument of the same function, in another place: what makes the right one helps, not what takes this one.
    return _MAKERS[needed] if not taker or taker.startswith(f"strapgen.{function} ") else taker


def _with_article(name: str) -> str:
    if name in ("Sources", "Settings"):
        return name
    article = "an" if name[0] in "AEIOUaeiou" or name == "ndarray" else "a"
    return {"str": "a name", "PathLike": "a path"}.get(name, f"{article} {name}")
