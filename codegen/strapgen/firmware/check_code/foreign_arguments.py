"""Reads what the arguments of a user's function in C or C++ are, from one line of text.

The line has the arguments in their order in C, the attitude that the function computes behind an arrow::

    state[4], increments[2][3] -> next[4]
    filter_t *filter, rates[3], dt -> filter.q[4]
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import prod
from pathlib import Path

from strapgen.ir.checks import shown
from strapgen.ir.exceptions import InputError

#: Suffixes of files in C++, and of all files with code of users that is compiled; .C is C++ too.
CPP_SUFFIXES = (".cc", ".cpp", ".cxx", ".c++", ".cp")
FOREIGN_SUFFIXES = (".c", *CPP_SUFFIXES)
#: Names that say what an argument is.
STATE, NEXT, INCREMENTS, RATES, PREVIOUS = "state", "next", "increments", "rates", "previous"
INTERVAL, STEP = "dt", "step"
SAMPLES = (INCREMENTS, RATES)
#: Numbers of the shapes of an attitude.
ATTITUDES = ((4,), (9,), (3, 3))
#: Result of a function that computes the rotation vector of its call and leaves the attitude to others.
ROTATION = "rotation"
#: Most samples in a call, and most from before it.
_MOST_SAMPLES, _MOST_PREVIOUS = 8, 3

_ARRAY = re.compile(r"(?:(global)\s+)?([A-Za-z_][\w.]*)\s*((?:\[\s*\d+\s*\]\s*)*)")
_MEMORY = re.compile(r"((?:[A-Za-z_][\w:]*\s+)*[A-Za-z_][\w:]*)\s*([*&])\s*([A-Za-z_]\w*)")
_ALLOWED = "state[4] or state[3][3], increments[K][3] or rates[K][3], previous[P][3], dt, step, or memory as TYPE *name"


def is_foreign(path: str | Path) -> bool:
    """Return whether the name of a file is one of C or C++.

    >>> is_foreign("integrator.c"), is_foreign("integrator.C++"), is_foreign("euler"), is_foreign("integrator.h")
    (True, True, False, False)
    """
    return Path(path).suffix.lower() in FOREIGN_SUFFIXES


@dataclass(frozen=True)
class ForeignArgument:
    """One argument of a user's function, or the place where it leaves its result."""

    #: What it is: one of the names of this module, or the name of memory
    name: str
    #: Empty for one number
    shape: tuple[int, ...] = ()
    #: The type of memory, which the function keeps from call to call; "" for numbers
    type: str = ""
    #: "*" or "&" for memory that is passed as a pointer or as a reference
    reference: str = ""

    @property
    def size(self) -> int:
        """Number of its numbers."""
        return prod(self.shape)


@dataclass(frozen=True)
class ForeignArguments:
    """The arguments of a user's function."""

    #: In their order in C
    parameters: tuple[ForeignArgument, ...]
    #: The attitude after a call: an argument, or what is read after the call, such as a field of memory
    result: ForeignArgument

    def named(self, *names: str) -> ForeignArgument | None:
        """Return the argument of one of some names; None if there is none."""
        return next((argument for argument in self.parameters if argument.name in names), None)

    @property
    def samples(self) -> ForeignArgument:
        """The argument with the samples of a call."""
        argument = self.named(*SAMPLES)
        assert argument is not None
        return argument

    @property
    def count(self) -> int:
        """Number of samples in a call."""
        return self.samples.size // 3

    @property
    def previous(self) -> int:
        """Number of samples from before the call that the caller passes too."""
        argument = self.named(PREVIOUS)
        return argument.size // 3 if argument else 0

    @property
    def memory(self) -> ForeignArgument | None:
        """The argument that is memory of the function."""
        return next((argument for argument in self.parameters if argument.type), None)

    @property
    def in_place(self) -> bool:
        """Whether the result takes the place of the state."""
        return self.result.name == STATE

    @property
    def elements(self) -> int:
        """Number of elements of the result: 4 or 9 of an attitude, or 3 of the rotation vector of a call."""
        return self.result.size


def read_arguments(text: str) -> ForeignArguments:
    """Read the arguments of a function.

    >>> arguments = read_arguments("state[4], increments[2][3] -> next[4]")
    >>> [argument.name for argument in arguments.parameters], arguments.count, arguments.elements
    (['state', 'increments', 'next'], 2, 4)
    >>> read_arguments("state[9], rates[3], dt -> state[9]").in_place
    True
    """
    if text.count("->") + text.count("<-") != 1:
        raise InputError(
            f"--arguments {shown(text)} has no single arrow; "
            "'state[4], increments[2][3] -> next[4]' is an example of what is needed"
        )
    backwards = "<-" in text
    first, second = (part.strip() for part in re.split(r"->|<-", text))
    inputs, output = (second, first) if backwards else (first, second)
    parameters = [_argument(part.strip()) for part in inputs.split(",")]
    result = _result(output, parameters)
    _refuse_what_does_not_fit(parameters, result)
    if result.name in (NEXT, ROTATION):
        parameters.insert(0 if backwards else len(parameters), result)
    return ForeignArguments(tuple(parameters), result)


def _argument(text: str) -> ForeignArgument:
    """Return one argument before the arrow."""
    if memory := _MEMORY.fullmatch(text):
        return ForeignArgument(memory[3], (), memory[1], memory[2])
    argument = _array(text)
    shapes = {STATE: ATTITUDES, INTERVAL: ((),), STEP: ((),)}
    if argument.name in (*SAMPLES, PREVIOUS):
        most = _MOST_PREVIOUS if argument.name == PREVIOUS else _MOST_SAMPLES
        _require_vectors(argument, most)
    elif argument.name not in shapes:
        raise InputError(f"--arguments: {shown(text)} is not known; allowed: {_ALLOWED}")
    elif argument.shape not in shapes[argument.name]:
        raise InputError(f"--arguments: {shown(text)} has another shape; allowed: {_ALLOWED}")
    return argument


def _array(text: str) -> ForeignArgument:
    array = _ARRAY.fullmatch(text)
    if array is None:
        raise InputError(f"--arguments: {shown(text)} cannot be read; allowed: {_ALLOWED}")
    name = f"global {array[2]}" if array[1] else array[2]
    return ForeignArgument(name, tuple(map(int, re.findall(r"\d+", array[3]))))


def _require_vectors(argument: ForeignArgument, most: int) -> None:
    """Refuse samples that are not one vector or several, one after the other."""
    shape = argument.shape
    vectors = len(shape) == 2 and shape[1] == 3
    flat = len(shape) == 1 and shape[0] % 3 == 0
    if not (vectors or flat) or not 1 <= argument.size // 3 <= most:
        raise InputError(
            f"--arguments: {argument.name} has the shape {list(shape)}; [3], [K][3] or [3 K] is needed, "
            f"with K from 1 to {most}"
        )


def _result(text: str, parameters: list[ForeignArgument]) -> ForeignArgument:
    """Return the result: the argument `next` or `state`, a field of memory, or a global array."""
    result = _array(text)
    memories = {argument.name for argument in parameters if argument.type}
    head = result.name.partition(".")[0]
    read_after = result.name.startswith("global ") or ("." in result.name and head in memories)
    if result.name not in (STATE, NEXT, ROTATION) and not read_after:
        raise InputError(
            f"--arguments: the result {shown(text)} is not known; allowed: next[4], state[4], rotation[3], a field of "
            "memory, as name.q[4], or a global array, as global q[4]; in place of [4] also [9] and [3][3]"
        )
    vector = result.shape == (3,) and result.name not in (STATE, NEXT)
    if not vector and (result.shape not in ATTITUDES or result.name == ROTATION):
        raise InputError(
            f"--arguments: the result {shown(text)} has another shape; allowed: [4], [9], [3][3], or [3] of a rotation"
        )
    return result


def _refuse_what_does_not_fit(parameters: list[ForeignArgument], result: ForeignArgument) -> None:
    names = [argument.name for argument in parameters]
    if len(set(names)) < len(names) or len([argument for argument in parameters if argument.type]) > 1:
        raise InputError(f"--arguments: {', '.join(names)} name one thing twice; each is allowed once")
    if len([name for name in names if name in SAMPLES]) != 1:
        raise InputError(
            f"--arguments: {', '.join(names)} lack the samples; increments[K][3] or rates[K][3] is needed"
        )
    state = next((argument for argument in parameters if argument.name == STATE), None)
    if result.name == STATE and state is None:
        raise InputError(
            "--arguments: the result state stands behind the arrow alone; before it, it is needed too"
        )
    if state is not None and (state.size != result.size or (result.name == STATE and state != result)):
        raise InputError(
            f"--arguments: state has {state.size} numbers in the shape {list(state.shape)}, the result {result.size} "
            f"in {list(result.shape)}; they must agree"
        )
