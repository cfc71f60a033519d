"""Reads the declaration of the arguments of a user's function in C or C++ from one line of text.

The line has the arguments in their order in C, the attitude that the function computes behind an arrow::

    state[4], increments[2][3] -> next[4]
    filter_t *filter, rates[3], dt -> filter.q[4]
    nav_t *nav, increments[3], velocity_increments[3], dt -> nav.q[4], velocity = nav.v[3]
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from math import prod
from pathlib import Path

from strapgen.ir import checks
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
_ARGUMENTS_OF_RESULTS = (STATE, NEXT, ROTATION, *TRANSLATIONS, _NEXT + VELOCITY, _NEXT + POSITION)
#: Arguments that are filled before a call beside the samples of the gyro.
_FED = (PUSHES, (GRAVITY,), (FRAME_RATE,))
#: Most samples in a call, and most from before it.
_MOST_SAMPLES, _MOST_PREVIOUS = 8, 3
_ARRAY = re.compile(r"(?:(global)\s+)?([A-Za-z_][\w.]*)\s*((?:\[\s*\d+\s*\]\s*)*)")
_MEMORY_PATTERN = re.compile(r"((?:[A-Za-z_][\w:]*\s+)*[A-Za-z_][\w:]*)\s*([*&])\s*([A-Za-z_]\w*)")
_ALLOWED = (
    "state[4] or state[3][3], increments[K][3] or rates[K][3], previous[P][3], velocity_increments[K][3] or "
    "forces[K][3], velocity[3], position[3], gravity[3], frame_rate[3], dt, step, or memory as TYPE *name"
)


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
    #: Of a result beside the attitude, which of `TRANSLATIONS` it is
    meaning: str = ""

    @property
    def size(self) -> int:
        """Number of elements."""
        return prod(self.shape)


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
    def fed(self) -> list[ForeignArgument]:
        """The arguments that are filled before every call, in the order of their numbers."""
        fed = (self.named(PREVIOUS), self.samples, *(self.named(*names) for names in _FED))
        return [argument for argument in fed if argument]

    @property
    def results(self) -> list[ForeignArgument]:
        """The places of all results, the attitude first."""
        return [each for each in (self.result, *self.translations) if each.size]

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


def read_arguments(text: str) -> ForeignArguments:
    """Read the arguments of a function.

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
    parameters = [_argument(part.strip()) for part in inputs.split(",")]
    results = [_result(part.strip(), parameters) for part in outputs.split(",")]
    attitudes = [result for result in results if not result.meaning]
    translations = tuple(result for result in results if result.meaning)
    result = attitudes[0] if attitudes else ForeignArgument("", (0,))
    _refuse_what_does_not_fit(parameters, result)
    _refuse_other_results(parameters, attitudes, translations)
    names = {argument.name for argument in parameters}
    new = [each for each in results if each.name in _ARGUMENTS_OF_RESULTS and each.name not in names]
    place = 0 if backwards else len(parameters)
    parameters[place:place] = new
    return ForeignArguments(tuple(parameters), result, translations)


def _argument(text: str) -> ForeignArgument:
    """Return one argument before the arrow."""
    if memory := _MEMORY_PATTERN.fullmatch(text):
        return ForeignArgument(memory[3], (), memory[1], memory[2])
    argument = _array(text)
    vectors = dict.fromkeys((VELOCITY, POSITION, GRAVITY, FRAME_RATE), ((3,),))
    shapes = {STATE: ATTITUDES, INTERVAL: ((),), STEP: ((),), **vectors}
    if argument.name in (*SAMPLES, PREVIOUS, *PUSHES):
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
    """Return a result: the argument `next` or `state`, a field of memory, or a global array; or a translation."""
    what, equals, place = (part.strip() for part in text.partition("="))
    result = _array(place if equals else text)
    meaning = what if equals else result.name.removeprefix(_NEXT)
    if equals and meaning not in TRANSLATIONS:
        raise InputError(f"--arguments: {shown(text)} names no result; allowed: {', '.join(TRANSLATIONS)}")
    memories = {argument.name for argument in parameters if argument.type}
    head = result.name.partition(".")[0]
    read_after = result.name.startswith("global ") or ("." in result.name and head in memories)
    if result.name not in _ARGUMENTS_OF_RESULTS and not read_after:
        raise InputError(
            f"--arguments: the result {shown(text)} is not known; allowed: next[4], state[4], rotation[3], a field of "
            "memory, as name.q[4], or a global array, as global q[4]; in place of [4] also [9] and [3][3]; "
            f"and {', '.join(f'{name}[3]' for name in TRANSLATIONS)}, or as velocity = name.v[3]"
        )
    if meaning in TRANSLATIONS:
        if result.shape != (3,):
            raise InputError(f"--arguments: the result {shown(text)} has another shape; [3] is needed")
        return replace(result, meaning=meaning)
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
    if (
        state is not None
        and result.size
        and (state.size != result.size or (result.name == STATE and state != result))
    ):
        raise InputError(
            f"--arguments: state has {state.size} numbers in the shape {list(state.shape)}, the result {result.size} "
            f"in {list(result.shape)}; they must agree"
        )


def _refuse_other_results(
    parameters: list[ForeignArgument],
    attitudes: list[ForeignArgument],
    translations: tuple[ForeignArgument, ...],
) -> None:
    """Refuse results beside the attitude, and arguments, that say nothing without each other."""
    meanings = [each.meaning for each in translations]
    known = {argument.name: argument for argument in parameters}
    pushes = [known[name] for name in PUSHES if name in known]
    if len(attitudes) > 1 or len(set(meanings)) < len(meanings):
        raise InputError("--arguments: a result stands twice behind the arrow; each is allowed once")
    if bool(meanings) != (len(pushes) == 1):
        raise InputError(
            "--arguments: velocity, position or velocity_change behind the arrow and one of velocity_increments[K][3] "
            "and forces[K][3] before it need each other"
        )
    samples = next(argument for argument in parameters if argument.name in SAMPLES)
    if pushes and pushes[0].size != samples.size:
        raise InputError(
            f"--arguments: {pushes[0].name} has {pushes[0].size} numbers, {samples.name} {samples.size}; "
            "they must agree"
        )
    if VELOCITY in meanings and (not attitudes or attitudes[0].size == 3):
        raise InputError(
            "--arguments: a velocity behind the arrow is in reference axes, and needs an attitude there; "
            "velocity_change[3] is that of a call in body axes"
        )
    for name in (POSITION, GRAVITY, VELOCITY):
        if (name in known or name in meanings) and VELOCITY not in meanings:
            raise InputError(f"--arguments: {name} needs a velocity behind the arrow")
    for name in (VELOCITY, POSITION):
        if name in [each.name for each in translations] and name not in known:
            raise InputError(
                f"--arguments: the result {name} stands behind the arrow alone; before it, it is needed too, or "
                f"{_NEXT}{name}[3] behind it"
            )
    if {VELOCITY, VELOCITY_CHANGE} <= {*meanings}:
        raise InputError(
            "--arguments: velocity and velocity_change are one result in two forms; one is allowed"
        )
    if POSITION in known and POSITION not in meanings:
        raise InputError("--arguments: position stands before the arrow alone; behind it, it is needed too")
    for name, without in ((STATE, ()), (FRAME_RATE, (ROTATION,))):
        if name in known and [each for each in attitudes if each.name not in without] == []:
            raise InputError(f"--arguments: {name} needs an attitude behind the arrow")


#: Name of the memory of a function in the text; no other name of the file is like it.
_MEMORY = "strapgen_memory"
_BRIDGE = """
#include "{file}"
#include <math.h>
#include <string.h>
/* The arguments are those of --arguments: what does not fit the function is an error. */
#pragma GCC diagnostic error "-Wincompatible-pointer-types"
#pragma GCC diagnostic error "-Wimplicit-function-declaration"
#pragma GCC diagnostic error "-Wint-conversion"
#ifdef __clang__
#pragma clang diagnostic ignored "-Wincompatible-pointer-types-discards-qualifiers"
#endif
typedef {precision} strapgen_number;
/* An array between bytes that must stay as they are. */
#define STRAPGEN_GUARDED(name, size, shape) \\
    static struct {{ \\
        unsigned char before[64]; \\
        union {{ strapgen_number all[size]; strapgen_number array shape; }} of; \\
        unsigned char after[64]; \\
    }} name, name##_before
{declarations}
#ifdef __cplusplus
extern "C"
#endif
__attribute__((visibility("default"))) int strapgen_foreign_run(
    long calls, const double *identity, const double *input, double *output)
{{
    int flags = 0;
    for (long call = 0; call < calls; ++call) {{
        if (*input++ != 0.0) {{
#line 1 "--init"
            {reset}
        }}
        const strapgen_number strapgen_dt = (strapgen_number)*input++;
        const strapgen_number strapgen_step = (strapgen_number)*input++;
        (void)strapgen_dt;
        (void)strapgen_step;
        {before}
#line 1 "--arguments"
        {call};
        {after}
    }}
    (void)identity;
    return flags;
}}
"""


@dataclass(frozen=True)
class ForeignSource:
    """A function in a user's file."""

    #: The file in C or C++
    file: Path
    #: Name of the function
    function: str
    arguments: ForeignArguments
    #: Name of the function that begins a run; "" if there is none
    init: str = ""
    #: "double" or "float"
    precision: str = "double"

    def __post_init__(self) -> None:
        checks.choice("precision", self.precision, PRECISIONS)
        for option, name in (("--function", self.function), ("--init", self.init)):
            if not re.fullmatch(r"[A-Za-z_]\w*(::[A-Za-z_]\w*)*", name) and (name or option == "--function"):
                raise InputError(f"{option} is {name!r}; the name of a function is needed")
        if not is_foreign(self.file):
            raise InputError(
                f"{self.file} is no file in C or C++ by its suffix; allowed: {', '.join(FOREIGN_SUFFIXES)}"
            )
        if not self.file.is_file():
            raise InputError(f"{self.file} is no file")

    @property
    def is_cpp(self) -> bool:
        """Whether it is C++."""
        return self.file.suffix == ".C" or self.file.suffix.lower() in CPP_SUFFIXES


def bridge_text(source: ForeignSource) -> str:
    """Return the text that includes a user's file and calls its function."""
    arguments = source.arguments
    arrays = [argument for argument in arguments.parameters if argument.shape]
    memory = arguments.memory
    declarations = [
        f"STRAPGEN_GUARDED(strapgen_{argument.name}, {argument.size}, {_shape(argument)});"
        for argument in arrays
    ]
    if memory:
        declarations.append(f"static {memory.type} {_MEMORY};")
    return _BRIDGE.format(
        file=source.file.resolve().as_posix(),
        precision=source.precision,
        declarations="\n".join(declarations),
        reset=" ".join(_reset(source, memory)),
        before=" ".join(_before(arguments, arrays)),
        call=f"{source.function}({', '.join(map(_passed, arguments.parameters))})",
        after=" ".join(_after(arguments, arrays)),
    )


def _shape(argument: ForeignArgument) -> str:
    return "".join(f"[{length}]" for length in argument.shape)


def _passed(argument: ForeignArgument) -> str:
    if argument.type:
        return f"&{_MEMORY}" if argument.reference == "*" else _MEMORY
    return f"strapgen_{argument.name}" + (".of.array" if argument.shape else "")


def _reset(source: ForeignSource, memory: ForeignArgument | None) -> list[str]:
    """Return the statements that begin a run."""
    lines = []
    if memory:
        cleared = (
            f"{_MEMORY} = {memory.type}();" if source.is_cpp else f"memset(&{_MEMORY}, 0, sizeof {_MEMORY});"
        )
        lines.append(cleared)
    state = source.arguments.named(STATE)
    place = 0
    for result in source.arguments.results:
        if held := source.arguments.before(result):
            lines.append(
                f"for (int k = 0; k < {held.size}; ++k) "
                f"strapgen_{held.name}.of.all[k] = (strapgen_number)identity[{place} + k];"
            )
        place += result.size
    if source.init:
        takes = definitions(source.file).get(source.init.rpartition("::")[2], "")
        target = memory or state
        lines.append(f"{source.init}({_passed(target) if takes and target else ''});")
    return lines


def _before(arguments: ForeignArguments, arrays: list[ForeignArgument]) -> list[str]:
    """Return the statements before a call, which fill the inputs and mark the outputs."""
    lines = []
    for argument in arguments.fed:
        lines.append(
            f"for (int k = 0; k < {argument.size}; ++k) "
            f"strapgen_{argument.name}.of.all[k] = (strapgen_number)*input++;"
        )
    for result in arguments.results:
        held = arguments.before(result)
        if result.name in _ARGUMENTS_OF_RESULTS and (held is None or held.name != result.name):
            lines.append(f"for (int k = 0; k < {result.size}; ++k) strapgen_{result.name}.of.all[k] = NAN;")
    for argument in arrays:
        name = f"strapgen_{argument.name}"
        lines.append(f"memset({name}.before, 0x5a, 64); memset({name}.after, 0x5a, 64);")
        lines.append(f"{name}_before = {name};")
    return lines


def _after(arguments: ForeignArguments, arrays: list[ForeignArgument]) -> list[str]:
    """Return the statements after a call, which look at what it wrote and keep its result."""
    lines = []
    for argument in arrays:
        name = f"strapgen_{argument.name}"
        for side in ("before", "after"):
            lines.append(f"flags |= memcmp({name}.{side}, {name}_before.{side}, 64) != 0;")
        if argument.name not in [result.name for result in arguments.results]:
            lines.append(f"flags |= memcmp(&{name}.of, &{name}_before.of, sizeof {name}.of) != 0 ? 2 : 0;")
    for result in arguments.results:
        place = f"strapgen_{result.name}.of.array"
        if result.name not in _ARGUMENTS_OF_RESULTS:  # a field or a global array, of any type of numbers
            memory, _, field = result.name.partition(".")
            place = f"{_MEMORY}.{field}" if field else memory.removeprefix("global ")
        element = f"({place})[k / 3][k % 3]" if len(result.shape) == 2 else f"({place})[k]"
        for_all = f"for (int k = 0; k < {result.size}; ++k)"
        lines.append(f"{for_all} *output++ = (double){element};")
        held = arguments.before(result)
        if held and held.name != result.name:
            lines.append(f"{for_all} strapgen_{held.name}.of.all[k] = (strapgen_number){element};")
    return lines


def definitions(file: Path) -> dict[str, str]:
    """Return the functions that a file defines, each with the text of its parameters; "" for none."""
    text = re.sub(
        r"/\*.*?\*/|//[^\n]*", "", file.read_text(errors="replace", encoding="utf-8"), flags=re.DOTALL
    )
    pattern = r"^[A-Za-z_][\w\s*&:<>]*?[\s*&]([A-Za-z_]\w*)\s*\(((?:[^;{}()]|\([^;{}()]*\))*)\)\s*\{"
    functions = {
        name: " ".join(parameters.split())
        for name, parameters in re.findall(pattern, text, flags=re.MULTILINE)
    }
    return {
        name: "" if parameters == "void" else parameters
        for name, parameters in functions.items()
        if name not in ("if", "for", "while", "switch")
    }
