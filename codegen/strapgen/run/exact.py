"""The exact back end: programs in arithmetic of 40 digits, the reference for rounding errors of the others.

Nothing is generated: the back end interprets the lowered program of a kernel on numbers of mpmath. Inputs are the exact
numbers that doubles are, and results are rounded to double at the end. An `Interpreter` takes and returns all digits.

>>> from strapgen import algorithm, exact
>>> program = algorithm("euler", "rk4", increments=1).program()
>>> exact.propagate(program, [[[0, 0, 0.5]]])[-1].round(6)
array([0.      , 0.      , 0.247396, 0.968913])
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from fractions import Fraction
from functools import cache, cached_property
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.program import DOUBLE_RESOLUTION, OPERATIONS, RESOLUTION, Program
from strapgen.ir.renamed import renamed_parameters
from strapgen.ir.sources import Sources
from strapgen.run.backends import Backend
from strapgen.run.evaluators import Evaluator
from strapgen.run.kernel_sources import StepSources, program_of, sources_of_program

#: Decimal digits of the arithmetic, of which a million steps lose six.
DIGITS = 40


def _sqrt(x: Any) -> Any:
    """Return the square root; like floating point, not a number below zero."""
    return mpmath.sqrt(x) if x >= 0 else mpmath.nan


#: The functions of programs on numbers of mpmath, roots apart.
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": mpmath.sin,
    "cos": mpmath.cos,
    "sinc": mpmath.sinc,
    "atan2": mpmath.atan2,
    "direction": mpmath.atan2,
    "wrap": lambda x: x - 2 * mpmath.pi * (int(x > mpmath.pi) - int(x < -mpmath.pi)),
}
_OPERATIONS: dict[str, Callable[..., Any]] = {**OPERATIONS, "sqrt": _sqrt, **FUNCTIONS}


def number(value: Fraction) -> Any:
    """Return a fraction in the digits that mpmath is set to.

    Examples
    --------
    >>> number(Fraction(1, 4))
    mpf('0.25')
    """
    return mpmath.mpf(value.numerator) / value.denominator


class _NoNumberError(ArithmeticError):
    """A value is infinite or not a number."""


def _parts(value: Any) -> tuple[int, int]:
    """Return a number of mpmath as an integer and the power of two that it is multiplied by."""
    sign, integer, power, _ = value._mpf_
    if not integer and power:
        raise _NoNumberError
    return -int(integer) if sign else int(integer), power


def _mpf(integer: int, power: int) -> Any:
    """Return an integer times a power of two as a number of mpmath."""
    return mpmath.mp.make_mpf(mpmath.libmp.from_man_exp(integer, power))


#: Operations on integers m times powers of two e, where a and b are two numbers; `round` makes a result one of mpmath.
_ON_INTEGERS = {
    "add": "m, e = ((am << ae - be) + bm, be) if ae >= be else (am + (bm << be - ae), ae); round",
    "subtract": "m, e = ((am << ae - be) - bm, be) if ae >= be else (am - (bm << be - ae), ae); round",
    "multiply": "m, e = am * bm, ae + be; round",
    "negate": "m, e = -am, ae",
    "at_least": "m = (am << ae - be if ae >= be else am) >= (bm if ae >= be else bm << be - ae)",
    "select": "m, e = (bm, be) if am else (cm, ce)",
}
#: Runs of a program before it is compiled for integers, which takes as long as thirty or forty of them.
_FIRST_RUNS = 10
#: The names in these lines that stand for those of a slot.
_NAME = re.compile(r"\b([abc]?[me])\b")
#: To the nearest, of two as near to the even one.
_ROUND = "n = m.bit_length() - bits\n    if n > 0: m, e = m + (1 << n - 1) - 1 + (m >> n & 1) >> n, e + n"


def _on_integers(
    program: Program, constant: Callable[[Fraction], Any]
) -> Callable[[Mapping[str, Any]], dict[str, list[Any]]]:
    """Return a program as a function with the bits of its run on numbers of mpmath, in a fifth of the time.

    Sums and products are of Python's integers, in lines of their own; mpmath makes an object of every value. Its own
    functions do the rest. The function raises `_NoNumberError` where a value is infinite or not a number.
    """
    code = program._instructions
    known: dict[str, Any] = {"parts": _parts, "mpf": _mpf, **{f"f_{k}": f for k, f in _OPERATIONS.items()}}
    lines = ["def run(values):", "    bits = mp.prec"]
    known["mp"] = mpmath.mp
    resolution = constant(DOUBLE_RESOLUTION)
    for slot, name in code.names:
        known[f"c{slot}"] = resolution
        default = f", c{slot}" if name == RESOLUTION else ""
        lines.append(f"    m{slot}, e{slot} = parts(values.get({name!r}{default}))")
    for slot, value in code.constants:
        known[f"m{slot}"], known[f"e{slot}"] = _parts(constant(value))
    for slot, kind, arguments in code.operations:
        text = _ON_INTEGERS.get(kind)
        if text is None:
            numbers = ", ".join(f"mpf(m{k}, e{k})" for k in arguments)
            lines.append(f"    m{slot}, e{slot} = parts(f_{kind}({numbers}))")
            continue
        names = {"m": f"m{slot}", "e": f"e{slot}"}
        for letter, k in zip("abc", arguments, strict=False):
            names |= {f"{letter}m": f"m{k}", f"{letter}e": f"e{k}"}
        pieces = _NAME.split(text.replace("round", _ROUND))
        lines.append("    " + "".join(names.get(piece, piece) for piece in pieces))
    listed = ", ".join(
        f"{name!r}: [{', '.join(f'mpf(m{k}, e{k})' for k in slots)}]" for name, slots in code.results
    )
    lines.append(f"    return {{{listed}}}")
    exec(compile("\n".join(lines), f"<{program.kernel} on integers>", "exec"), known)
    run: Callable[[Mapping[str, Any]], dict[str, list[Any]]] = known["run"]
    return run


class Interpreter:
    """Runs a program on numbers of mpmath, whose precision the caller sets.

    >>> from strapgen import derive, lower
    >>> with mpmath.workdps(DIGITS):
    ...     state = Interpreter(lower(derive("euler-normalize")))([mpmath.mpf(x) for x in (1, 2, 4, 2)])
    >>> float(state[2])
    0.8
    """

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"of {self.program.kernel}"

    def __init__(self, program: Program) -> None:
        self.program = program
        self._constants: dict[Fraction, Any] = {}
        self._runs = 0

    def __reduce__(self) -> tuple[type[Interpreter], tuple[Program]]:
        return type(self), (self.program,)

    def __call__(self, *inputs: Iterable[Any]) -> list[Any]:
        """Return the elements of the last output, from the elements of every input."""
        return list(self.outputs(*inputs).values())[-1]

    def outputs(self, *inputs: Iterable[Any]) -> dict[str, list[Any]]:
        """Return the elements of every output by its name, from the elements of every input."""
        values: dict[str, Any] = {}
        for signal, elements in zip(self.program.inputs, inputs, strict=True):
            values |= zip(signal.elements, elements, strict=True)
        self._runs += 1
        if self._runs > _FIRST_RUNS and all([type(value) is mpmath.mpf for value in values.values()]):
            with suppress(_NoNumberError):
                return self._on_integers(values)
        return self.program.run(values, self._constant, _OPERATIONS)

    @cached_property
    def _on_integers(self) -> Callable[[Mapping[str, Any]], dict[str, list[Any]]]:
        return _on_integers(self.program, self._constant)

    def _constant(self, value: Fraction) -> Any:
        if value not in self._constants:
            self._constants[value] = number(value)
        return self._constants[value]


@renamed_parameters(increments="samples")
def states(program: Program, samples: Iterable[Sequence[Any]], initial: Sequence[Any]) -> list[list[Any]]:
    """Return all states of a run of an attitude step in the digits that mpmath is set to, the initial one first.

    Angle increments of each step, and states, are row-major.

    Examples
    --------
    >>> from strapgen import algorithm
    >>> program = algorithm("euler", "rk4", increments=1).program()
    >>> [float(x) for x in states(program, [[0, 0, 0.5]], [0, 0, 0, 1])[-1]]
    [0.0, 0.0, 0.24739583333333334, 0.9689127604166666]
    """
    return list(itertools.accumulate(samples, Interpreter(program), initial=list(initial)))


@renamed_parameters(increments="samples")
def propagate(program: Program, samples: Any, initial: Any = None) -> NDArray[np.float64]:
    """Run a step over samples in 40 digits.

    Parameters
    ----------
    program : Program
        An attitude step.
    samples : array_like, (N, K, 3)
        Angle increments in rad, the exact numbers that the doubles are.
    initial : array_like, (state shape), optional
        State at the start, by default zero rotation.

    Returns
    -------
    array, (1 + N, state shape)
        All states, rounded to double at the end.

    Raises
    ------
    InputError, InputTypeError
        If the program is no attitude step, or a shape or a value does not fit.

    Examples
    --------
    >>> from strapgen import derive, lower
    >>> propagate(lower(derive("euler")), np.full((2, 2, 3), 0.01))[-1].round(6)
    array([0.019996, 0.019996, 0.019996, 0.9994  ])
    """
    checks.require("propagate", program, Program)
    step = Backend(StepSources(sources_of_program(program, "exact")))
    return step.propagate(checks.numbers("samples", samples), initial=initial)


def interpreter(name: str, step: Program | None = None) -> Interpreter:
    """Return the interpreter of a kernel by name: one that a step brings, or of the catalogue.

    Examples
    --------
    >>> [round(float(x), 6) for x in interpreter("euler-normalize").outputs([0, 0, 3, 4])["next"]]
    [0.0, 0.0, 0.6, 0.8]
    """
    programs = () if step is None else step.bundled_programs
    return Interpreter(next((one for one in programs if one.kernel == name), None) or _program(name))


@cache
def _program(name: str) -> Program:
    return pipeline.program(Choice(name))


class ExactEvaluator(Evaluator):
    """A kernel in 40 digits: doubles go in, and doubles come out; `digits` interprets its program.

    Examples
    --------
    >>> from strapgen import evaluator
    >>> evaluator("euler-normalize", "exact")([0, 0, 3.0, 4.0])
    array([0. , 0. , 0.6, 0.8])
    """

    def __init__(self, sources: Sources) -> None:
        super().__init__(sources, np.float64)
        self.number: np.dtype[Any] = np.dtype(object)
        self.digits: Interpreter = Interpreter(program_of(sources))

    def call(self, inputs: Sequence[Any], feedback: Any, where: str = "") -> tuple[Sequence[Any], Any]:
        """Interpret the program on each row, see `Evaluator.call`."""
        outputs = [np.full((len(feedback), s.size), mpmath.nan, object) for s in self.function.outputs]
        with mpmath.workdps(DIGITS):
            for place in range(len(feedback)):
                # A division by zero leaves its outputs at not a number, as in floating point.
                with suppress(ZeroDivisionError):
                    results = self.digits.outputs(*(rows[place] for rows in inputs))
                    for output, elements in zip(outputs, results.values(), strict=True):
                        output[place] = elements
        return outputs, feedback


@renamed_parameters(increments="samples")
def attitudes(backend: Backend, samples: Iterable[Sequence[Any]]) -> Iterator[list[Any]]:
    """Yield the matrices of a run of the back end "exact", row by row with all digits, from zero rotation on.

    Samples are the increments of each step in rad, row-major, as numbers of mpmath.

    Examples
    --------
    >>> from strapgen import algorithm
    >>> backend = algorithm("euler", "rk4", increments=1).backend("exact")
    >>> [[round(float(x), 3) for x in matrix] for matrix in attitudes(backend, [[0, 0, 0.5]])][-1]
    [0.878, -0.479, 0.0, 0.479, 0.878, 0.0, 0.0, 0.0, 1.0]
    """
    step, convert = backend.evaluator, backend.attitude and backend.companion(backend.attitude)
    assert isinstance(step, ExactEvaluator), "doubles hold no further digits"
    assert backend.sources.attitude_step is not None, "a back end runs an attitude step"
    state = [number(value) for value in backend.sources.attitude_step.identity]
    for after in itertools.accumulate(samples, step.digits, initial=state):
        yield convert.digits(after) if isinstance(convert, ExactEvaluator) else after
