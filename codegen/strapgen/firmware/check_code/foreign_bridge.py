"""Writes the text that includes a user's C or C++ file and calls its function, so that the compiler checks the call."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from strapgen.firmware.check_code.foreign_arguments import (
    CPP_SUFFIXES,
    FOREIGN_SUFFIXES,
    NEXT,
    PREVIOUS,
    ROTATION,
    STATE,
    ForeignArgument,
    ForeignArguments,
    is_foreign,
)
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

PRECISIONS = ("double", "float")

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
    if state:
        lines.append(
            f"for (int k = 0; k < {state.size}; ++k) strapgen_state.of.all[k] = (strapgen_number)identity[k];"
        )
    if source.init:
        takes = definitions(source.file).get(source.init.rpartition("::")[2], "")
        target = memory or state
        lines.append(f"{source.init}({_passed(target) if takes and target else ''});")
    return lines


def _before(arguments: ForeignArguments, arrays: list[ForeignArgument]) -> list[str]:
    """Return the statements before a call, which fill the inputs and mark the outputs."""
    lines = []
    samples = [each for each in (arguments.named(PREVIOUS), arguments.samples) if each]
    for argument in samples:
        lines.append(
            f"for (int k = 0; k < {argument.size}; ++k) "
            f"strapgen_{argument.name}.of.all[k] = (strapgen_number)*input++;"
        )
    if arguments.result.name in (NEXT, ROTATION):
        name = f"strapgen_{arguments.result.name}"
        lines.append(f"for (int k = 0; k < {arguments.elements}; ++k) {name}.of.all[k] = NAN;")
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
        if argument != arguments.result:
            lines.append(f"flags |= memcmp(&{name}.of, &{name}_before.of, sizeof {name}.of) != 0 ? 2 : 0;")
    result = arguments.result
    place = f"strapgen_{result.name}.of.array"
    if result.name not in (STATE, NEXT, ROTATION):  # a field or a global array, of any type of numbers
        memory, _, field = result.name.partition(".")
        place = f"{_MEMORY}.{field}" if field else memory.removeprefix("global ")
    element = f"({place})[k / 3][k % 3]" if len(result.shape) == 2 else f"({place})[k]"
    for_all = f"for (int k = 0; k < {arguments.elements}; ++k)"
    lines.append(f"{for_all} *output++ = (double){element};")
    if arguments.named(STATE) and not arguments.in_place:
        lines.append(f"{for_all} strapgen_state.of.all[k] = (strapgen_number){element};")
    return lines


def definitions(file: Path) -> dict[str, str]:
    """Return the functions that a file defines, each with the text of its parameters; "" for none."""
    text = re.sub(r"/\*.*?\*/|//[^\n]*", "", file.read_text(errors="replace"), flags=re.DOTALL)
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
