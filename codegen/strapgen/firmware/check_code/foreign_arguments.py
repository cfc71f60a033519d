"""Reads the declaration of the arguments of a user's function from one line of text.

The line has the arguments in their order, the attitude that the function computes behind an arrow; numbers in brackets
are needed only where the source leaves open how many there are::

    state, increments[2][3] -> next
    filter, rates, dt -> filter.q
    nav, increments, velocity_increments, dt -> nav.q, velocity = nav.v
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING

from strapgen.ir.checks import shown
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.firmware.check_code.signature import Value

#: Suffixes of files in C++, and of all files with code of users that is compiled; .C is C++ too.
CPP_SUFFIXES = (".cc", ".cpp", ".cxx", ".c++", ".cp", ".hpp", ".hh", ".hxx", ".h++")
RUST = ".rs"
FOREIGN_SUFFIXES = (".c", ".h", *CPP_SUFFIXES)
#: Names that say what an argument is.
STATE, NEXT, INCREMENTS, RATES, PREVIOUS = "state", "next", "increments", "rates", "previous"
INTERVAL, STEP = "dt", "step"
#: The sampling interval by its unit, in s.
INTERVALS = {INTERVAL: 1.0, "dt_ms": 1e-3, "dt_us": 1e-6}
#: Numbers that are not looked at, fed as zeros; a constant of C, as =0; the object of a method.
ZEROS, CONSTANT, MEMORY = "zeros", "=", "self"
SAMPLES = (INCREMENTS, RATES)
#: Result of a function that computes the rotation vector of its call and leaves the attitude to others.
ROTATION = "rotation"
#: The specific force: velocity increments in m/s, or the force in m/s^2, samples of the same intervals.
VELOCITIES, FORCES = "velocity_increments", "forces"
PUSHES = (VELOCITIES, FORCES)
#: Gravity in m/s^2, and the rate of the reference axes against inertial space in rad/s, both in reference axes.
GRAVITY, FRAME_RATE = "gravity", "frame_rate"
#: Results beside the attitude: in reference axes, or the velocity change of the call in the body axes of its start.
VELOCITY, POSITION, VELOCITY_CHANGE = "velocity", "position", "velocity_change"
TRANSLATIONS = (VELOCITY, POSITION, VELOCITY_CHANGE)
PRECISIONS = ("double", "float")
#: Begin of the name of a result that has an array of its own, and all results that are arguments.
_NEXT = "next_"
ARGUMENTS_OF_RESULTS = (STATE, NEXT, ROTATION, *TRANSLATIONS, _NEXT + VELOCITY, _NEXT + POSITION)
#: Arguments that are filled before a call beside the samples of the gyro.
_FED = (PUSHES, (GRAVITY,), (FRAME_RATE,))
#: Most vectors of what is a row of samples, and the shapes of all else; a time is one number.
_MOST = {**dict.fromkeys((*SAMPLES, *PUSHES), 8), PREVIOUS: 3}
_ATTITUDES = ((4,), (9,), (3, 3))
_SHAPES = {
    **dict.fromkeys((STATE, NEXT), _ATTITUDES),
    **dict.fromkeys((*ARGUMENTS_OF_RESULTS[2:], GRAVITY, FRAME_RATE, ZEROS), ((3,),)),
    **dict.fromkeys((*INTERVALS, STEP), ()),
}
_ARRAY = re.compile(r"(?:(global)\s+)?([A-Za-z_](?:[\w.:]|\(\))*(?: +\w+)*)\s*((?:\[\s*\d+\s*\]\s*)*)")
_MEMORY_PATTERN = re.compile(r"((?:[A-Za-z_][\w:]*\s+)*[A-Za-z_][\w:]*)\s*([*&])\s*([A-Za-z_]\w*)")
_ALLOWED = (
    "state[4] or state[3][3], increments[K][3] or rates[K][3], previous[P][3], velocity_increments[K][3] or "
    "forces[K][3], velocity[3], position[3], gravity[3], frame_rate[3], dt, dt_ms, dt_us, step, zeros[3], "
    "a constant as =0, or memory as TYPE *name"
)


def is_foreign(path: str | Path) -> bool:
    """Return whether the name of a file is one of C or C++.

    >>> is_foreign("integrator.c"), is_foreign("integrator.C++"), is_foreign("euler"), is_foreign("integrator.h")
    (True, True, False, True)
    """
    return Path(path).suffix.lower() in FOREIGN_SUFFIXES


@dataclass(frozen=True)
class ForeignArgument:
    """One argument of a user's function, or the place where it leaves its result."""

    #: What it is: one of the names of this module, or the name of memory
    name: str
    #: Empty for one number, and where the source says how many there are
    shape: tuple[int, ...] = ()
    #: The type of memory, which the function keeps from call to call; "" for numbers
    type: str = ""
    #: "*" or "&" for memory that is passed as a pointer or as a reference, "." for the object of a method
    reference: str = ""
    #: Of a result beside the attitude, which of `TRANSLATIONS` it is
    meaning: str = ""
    #: The parameters in C or C++ that carry it, one or several; of a result also what is read after the call
    carriers: tuple[Value, ...] = ()
    #: The text of a constant
    text: str = ""

    @property
    def size(self) -> int:
        """Number of elements; 0 where the source says it."""
        return prod(self.shape) if self.shape else 0


def is_whole(argument: ForeignArgument) -> bool:
    """Return whether the numbers of an argument are integers."""
    return any(value.number not in PRECISIONS for value in argument.carriers)


@dataclass(frozen=True)
class ForeignArguments:
    """The arguments of a user's function."""

    #: In their order in C
    parameters: tuple[ForeignArgument, ...]
    #: The attitude after a call: an argument, or what is read after the call, such as a field of memory; of size 0
    #: if the function computes none
    result: ForeignArgument
    #: The results beside it
    translations: tuple[ForeignArgument, ...] = ()

    def named(self, *names: str) -> ForeignArgument | None:
        """Return the argument of one of some names; None if there is none."""
        return next(
            (argument for argument in self.parameters if argument.name in names and not argument.type), None
        )

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
    def memories(self) -> list[ForeignArgument]:
        """The arguments that are memory of the function."""
        return [argument for argument in self.parameters if argument.type]

    @property
    def fed(self) -> list[ForeignArgument]:
        """The arguments that are filled before every call, in the order of their numbers."""
        fed = (self.named(PREVIOUS), self.samples, *(self.named(*names) for names in _FED))
        return [argument for argument in fed if argument]

    @property
    def results(self) -> list[ForeignArgument]:
        """The places of all results, the attitude first."""
        return [each for each in (self.result, *self.translations) if each.name]

    @property
    def names_scalar(self) -> bool:
        """Whether the names of the source say which element is the scalar part; it stands last then."""
        return any(value.named for value in self.result.carriers)

    @property
    def numbers(self) -> int:
        """Number of elements of all results together."""
        return sum(result.size for result in self.results)

    @property
    def meanings(self) -> tuple[str, ...]:
        """What the results beside the attitude are."""
        return tuple(each.meaning for each in self.translations)

    def before(self, result: ForeignArgument) -> ForeignArgument | None:
        """Return the argument that holds a result before the call; None if the function keeps it."""
        return None if result.meaning == VELOCITY_CHANGE else self.named(result.meaning or STATE)

    @property
    def elements(self) -> int:
        """Number of elements of the attitude: 4 or 9, 3 of the rotation vector of a call, or 0 if there is none."""
        return self.result.size


def read_arguments(text: str, memories: Collection[str] = ()) -> ForeignArguments:
    """Read the arguments of a function; `memories` are those of its parameters that are no numbers.

    >>> arguments = read_arguments("state[4], increments[2][3] -> next[4]")
    >>> [argument.name for argument in arguments.parameters], arguments.count, arguments.elements
    (['state', 'increments', 'next'], 2, 4)
    >>> read_arguments("increments[3], velocity_increments[3] -> rotation[3], velocity_change[3]").meanings
    ('velocity_change',)
    """
    if text.count("->") + text.count("<-") != 1:
        raise InputError(
            f"--arguments {shown(text)} has no single arrow; "
            "'state[4], increments[2][3] -> next[4]' is an example of what is needed"
        )
    backwards = "<-" in text
    first, second = (part.strip() for part in re.split(r"->|<-", text))
    inputs, outputs = (second, first) if backwards else (first, second)
    parameters = [_argument(part.strip(), memories) for part in inputs.split(",")]
    results = [_result(part.strip(), parameters, memories) for part in outputs.split(",")]
    attitudes = [result for result in results if not result.meaning]
    translations = tuple(result for result in results if result.meaning)
    result = attitudes[0] if attitudes else ForeignArgument("", (0,))
    require_consistent(parameters, result, translations)
    if len(attitudes) > 1:
        raise InputError("--arguments: a result stands twice behind the arrow; each is allowed once")
    names = {argument.name for argument in parameters}
    new = [each for each in results if each.name in ARGUMENTS_OF_RESULTS and each.name not in names]
    place = 0 if backwards else len(parameters)
    parameters[place:place] = new
    return ForeignArguments(tuple(parameters), result, translations)


def require_consistent(
    parameters: Sequence[ForeignArgument], result: ForeignArgument, translations: Sequence[ForeignArgument]
) -> None:
    """Refuse arguments and results that say nothing without each other, or whose numbers differ."""
    for reason in _contradictions(parameters, result, translations):
        raise InputError(f"--arguments: {reason}")


def _argument(text: str, memories: Collection[str]) -> ForeignArgument:
    """Return one argument before the arrow."""
    if text.startswith(CONSTANT):
        return ForeignArgument(CONSTANT, text=text.removeprefix(CONSTANT).strip())
    if memory := _MEMORY_PATTERN.fullmatch(text):
        return ForeignArgument(memory[3], (), memory[1], memory[2])
    argument = _array(text)
    name, shape, most = argument.name, argument.shape, _MOST.get(argument.name, 0)
    if most and shape:
        is_row = shape[1:] == (3,) or (len(shape) == 1 and shape[0] % 3 == 0)
        if not (is_row and 1 <= argument.size // 3 <= most):
            raise InputError(
                f"--arguments: {name} has the shape {list(shape)}; [3], [K][3] or [3 K] is needed, "
                f"with K from 1 to {most}"
            )
    elif not most and name not in _SHAPES:
        if text in memories:
            return ForeignArgument(text, (), text)
        raise InputError(f"--arguments: {shown(text)} is not known; allowed: {_ALLOWED}")
    elif shape and shape not in _SHAPES[name]:
        raise InputError(f"--arguments: {shown(text)} has another shape; allowed: {_ALLOWED}")
    return argument


def _array(text: str) -> ForeignArgument:
    array = _ARRAY.fullmatch(text)
    if array is None:
        raise InputError(f"--arguments: {shown(text)} cannot be read; allowed: {_ALLOWED}")
    name = f"global {array[2]}" if array[1] else array[2]
    return ForeignArgument(name, tuple(map(int, re.findall(r"\d+", array[3]))))


def _result(text: str, parameters: list[ForeignArgument], memories: Collection[str]) -> ForeignArgument:
    """Return a result: the argument `next` or `state`, a field of memory, or a global array; or a translation."""
    what, equals, place = (part.strip() for part in text.partition("="))
    result = _array(place if equals else text)
    meaning = what if equals else result.name.removeprefix(_NEXT)
    if equals and meaning not in TRANSLATIONS:
        raise InputError(f"--arguments: {shown(text)} names no result; allowed: {', '.join(TRANSLATIONS)}")
    owner, dot, _ = result.name.partition(".")
    of_memory = dot and owner in {*memories, *(argument.name for argument in parameters if argument.type)}
    if not (result.name in ARGUMENTS_OF_RESULTS or result.name.startswith("global ") or of_memory):
        raise InputError(
            f"--arguments: the result {shown(text)} is not known; allowed: next[4], state[4], rotation[3], a field of "
            "memory, as name.q[4], or a global array, as global q[4]; in place of [4] also [9] and [3][3]; "
            f"and {', '.join(f'{name}[3]' for name in TRANSLATIONS)}, or as velocity = name.v[3]"
        )
    allowed: tuple[tuple[int, ...], ...] = (*_ATTITUDES, (3,))
    needed = "allowed: [4], [9], [3][3], or [3] of a rotation"
    if meaning in TRANSLATIONS:
        result, allowed, needed = replace(result, meaning=meaning), ((3,),), "[3] is needed"
    elif result.name in _SHAPES:
        allowed = _SHAPES[result.name]
    if result.shape and result.shape not in allowed:
        raise InputError(f"--arguments: the result {shown(text)} has another shape; {needed}")
    return result


def _contradictions(
    parameters: Sequence[ForeignArgument], result: ForeignArgument, translations: Sequence[ForeignArgument]
) -> Iterator[str]:
    """Yield why arguments and results do not go together."""
    meanings = [each.meaning for each in translations]
    known = {argument.name: argument for argument in parameters if not argument.type}
    names = [f"{each.type} {each.name}".strip() for each in parameters if each.name not in (CONSTANT, ZEROS)]
    samples, state = [known[name] for name in SAMPLES if name in known], known.get(STATE)
    pushes = [known[name] for name in PUSHES if name in known]
    if len(set(names)) < len(names):
        yield f"{', '.join(names)} name one thing twice; each is allowed once"
    if len(samples) != 1:
        yield f"{', '.join(names)} lack the samples; increments[K][3] or rates[K][3] is needed"
    if result.name == STATE and state is None:
        yield "the result state stands behind the arrow alone; before it, it is needed too"
    differ = state and (state.size != result.size or (result.name == STATE and state != result))
    if state and differ and state.size and result.size:
        sizes = f"state has {state.size} numbers in the shape {list(state.shape)}, the result {result.size}"
        yield f"{sizes} in {list(result.shape)}; they must agree"
    if len(set(meanings)) < len(meanings):
        yield "a result stands twice behind the arrow; each is allowed once"
    if bool(meanings) != (len(pushes) == 1):
        yield (
            "velocity, position or velocity_change behind the arrow and one of velocity_increments[K][3] and "
            "forces[K][3] before it need each other"
        )
    if pushes and pushes[0].size and samples[0].size and pushes[0].size != samples[0].size:
        sizes = f"{pushes[0].name} has {pushes[0].size} numbers, {samples[0].name} {samples[0].size}"
        yield f"{sizes}; they must agree"
    if VELOCITY in meanings and (result.size == 3 or result.name in ("", ROTATION)):
        yield (
            "a velocity behind the arrow is in reference axes, and needs an attitude there; velocity_change[3] is "
            "that of a call in body axes"
        )
    for name in (POSITION, GRAVITY):
        if (name in known or name in meanings) and VELOCITY not in meanings:
            yield f"{name} needs a velocity behind the arrow"
    for name in (VELOCITY, POSITION):
        if name in [each.name for each in translations] and name not in known:
            yield (
                f"the result {name} stands behind the arrow alone; before it, it is needed too, or "
                f"{_NEXT}{name}[3] behind it"
            )
        if name in known and name not in meanings:
            yield f"{name} stands before the arrow alone; behind it, it is needed too"
    if {VELOCITY, VELOCITY_CHANGE} <= {*meanings}:
        yield "velocity and velocity_change are one result in two forms; one is allowed"
    for name, without in ((STATE, ("",)), (FRAME_RATE, ("", ROTATION))):
        if name in known and result.name in without:
            yield f"{name} needs an attitude behind the arrow"
