"""Messages that a name is not known: the names perhaps meant, and those allowed, in one line."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

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
    """Return the allowed names that were perhaps meant, the likeliest first: at most three, by synonym or by likeness.

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


def unknown(what: str, value: object, allowed: Iterable[str], also: str = "", section: str = "") -> str:
    """Return the message that a name is not known; `also` and `section` say where others are.

    >>> unknown("target", "numpi", ["numpy", "c"])
    "target 'numpi' is not known (did you mean numpy?); allowed: numpy, c"
    """
    names = list(allowed)
    section = section or SECTIONS.get(what, "")
    meant = suggestions(what, value, names) if isinstance(value, str) else []
    question = f" (did you mean {alternatives(meant)}?)" if meant else ""
    cut = bool(section) and len(names) > MOST_NAMES + 1
    listed = some(names) if cut else ", ".join(names)
    listed += f", or {also}" if also else ""
    listed += f"; strapgen list {section} shows all" if cut else ""
    return f"{what} {shown(value)} is not known{question}; allowed: {listed}"


def shown(value: object) -> str:
    """Return a value on one line; of a long one the beginning."""
    line = " ".join(repr(value).split())
    return line if len(line) <= _MOST_CHARACTERS else f"{line[:_MOST_CHARACTERS]}..."


def counted(number: int, one: str, many: str = "") -> str:
    """Return a number with its noun, in the plural unless it is 1."""
    return f"{number} {one if number == 1 else many or f'{one}s'}"


def needed(number: int) -> str:
    """Return "1 is needed", "2 are needed"."""
    return f"{number} {'is' if number == 1 else 'are'} needed"


def some(names: Iterable[str]) -> str:
    """Return names in a list; of many the first ones, and the number of the others."""
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
