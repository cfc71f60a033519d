"""Writes the text that calls a user's function in C or C++: a shim that fills its arguments and reads its results."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from strapgen.firmware.check_code import reading
from strapgen.firmware.check_code.foreign_arguments import (
    ARGUMENTS_OF_RESULTS,
    CONSTANT,
    CPP_SUFFIXES,
    FOREIGN_SUFFIXES,
    INTERVALS,
    PRECISIONS,
    STATE,
    STEP,
    ZEROS,
    ForeignArgument,
    ForeignArguments,
    is_foreign,
    is_whole,
)
from strapgen.firmware.check_code.signature import (
    Signature,
    SourceFile,
    SourceReader,
    Value,
    options_of,
    read_options,
)
from strapgen.ir import checks
from strapgen.ir.exceptions import CompilerError, InputError
from strapgen.run import compiler

_BRIDGE = """\
#include "{file}"
#include <math.h>
#include <string.h>
{declarations}
#ifdef __cplusplus
#include <new>
extern "C"
#else
#pragma GCC diagnostic error "-Wincompatible-pointer-types"
#pragma GCC diagnostic error "-Wimplicit-function-declaration"
#pragma GCC diagnostic error "-Wint-conversion"
#endif
__attribute__((visibility("default"))) int strapgen_foreign_run(
    long calls, const double *identity, const double *input, double *output)
{{
    int flags = 0;
    long last = 0, period = 0, count = 0;
    for (long call = 0; call < calls; ++call) {{
        const double begins = *input++;
        if (begins != 0.0) {{
            if (begins == 1.0) {{
{cleared}
            }}
{reset}
#line 1 "--init"
            {begins}
        }}
#line 1 "--arguments"
        const double strapgen_dt = *input++;
        const double strapgen_step = *input++;
        for (int part = 1; part <= {publishes}; ++part) {{
            int published = part == {publishes};
{before}
{call}
{after}
            ++count;
            if (published) {{
                period = count - last;
                last = count;
            }}
            if (published != (part == {publishes}))
                flags |= 4;
        }}
        output += {elements};
        (void)strapgen_dt;
        (void)strapgen_step;
    }}
    (void)identity;
    return flags | (int)((period > 1000 ? 0 : period) << 8);
}}
"""
_GUARD = "static struct {{ unsigned char before[64]; {type} of{shape}; unsigned char after[64]; }} {name};"
_TOUCHED = """\
static int strapgen_touched(const unsigned char *bytes)
{
    int touched = 0;
    for (int k = 0; k < 64; ++k)
        touched |= bytes[k] != 0x5a;
    return touched;
}"""
_STORED = """\
typedef {type} {name}_t;
alignas({name}_t) static unsigned char {name}_bytes[sizeof({name}_t)];
static {name}_t &{name} = *reinterpret_cast<{name}_t *>({name}_bytes);
static bool {name}_lives = false;"""


@dataclass(frozen=True)
class ForeignSource:
    """A function in a user's file, and how it is called."""

    read: SourceFile
    #: Its name as the user has it
    function: str
    signature: Signature
    arguments: ForeignArguments
    #: What begins a run, as the user has it, and its statement; "" if there is none
    init: str = ""
    begins: str = ""
    #: Memory, and the arguments of its constructor
    constructor: tuple[str, str] = ("", "")
    #: "double", "float", or an integer such as "int32"
    precision: str = "double"
    #: Calls to a result; 0 if the function says by what it returns when it has one
    publishes: int = 1
    #: An expression that changes with every result; "" if there is none
    counter: str = ""
    #: Further files that are compiled
    sources: tuple[Path, ...] = ()
    #: The file of another language that was compiled, and options that link it
    origin: Path | None = None
    libraries: tuple[str, ...] = ()

    @property
    def file(self) -> Path:
        """The file, as the user has it."""
        return self.origin or self.read.path

    @property
    def is_integer(self) -> bool:
        """Whether its numbers are integers."""
        return self.precision not in PRECISIONS


def read_source(
    path: str | Path,
    function: str,
    text: str | None = None,
    init: str = "",
    precision: str | None = None,
    *,
    takes: str = "",
    is_angle_said: bool = False,
    cflags: str = "",
    compile_commands: str | None = None,
    sources: Sequence[str | Path] = (),
    publishes: str = "",
) -> ForeignSource:
    """Read how a function is called; `text` says what its names do not say."""
    path = Path(path)
    for option, name in (("--function", function), ("--init", init)):
        if not re.fullmatch(r"[A-Za-z_]\w*(::[A-Za-z_]\w*)*(\(.*\))?", name) and (
            name or option == "--function"
        ):
            raise InputError(f"{option} is {name!r}; the name of a function is needed")
    if precision is not None:
        checks.choice("precision", precision, PRECISIONS)
    for each in (path, *map(Path, sources)):
        if not is_foreign(each):
            raise InputError(
                f"{each} is no file in C or C++ by its suffix; allowed: {', '.join(FOREIGN_SUFFIXES)}"
            )
        if not each.is_file():
            raise InputError(f"{each} is no file")
    options = _listed(Path(compile_commands), path) if compile_commands else ()
    reader = _reader(path, (*options, *options_of(cflags, Path.cwd())))
    try:
        signature = reader.signature("--function", function)
        if text is None:
            text = reading.proposed(signature, reader, takes, is_angle_said)
        arguments = reading.joined(signature, text, reader)
    except (InputError, CompilerError):
        if error := _syntax_error(reader.file):
            raise CompilerError(f"{path} does not compile: {error}") from None
        raise
    found = _precision(arguments)
    if precision is not None and precision != found:
        value = next(
            value for each in _numeric(arguments) for value in each.carriers if value.number == found
        )
        raise InputError(
            f"{function} does not take these --arguments in --precision {precision}: `{value.text}` is {found}"
        )
    source = ForeignSource(
        reader.file, function, signature, arguments, precision=found, sources=tuple(map(Path, sources))
    )
    source = _with_init(source, init, reader)
    for memory in arguments.memories if source.read.is_cpp else ():
        if memory.name != source.constructor[0] and not reader.expressions([f"{memory.type}()"]):
            name = _last(memory.type)
            raise InputError(
                f'{memory.type} has no constructor without arguments; --init "{name}(...)" states them, as {name}(0.01)'
            )
    return _with_publications(source, publishes, reader)


def _last(name: str) -> str:
    """Return a name without the scopes before it."""
    return name.rpartition("::")[2].removeprefix("struct ").removeprefix("class ")


def is_cpp(path: Path) -> bool:
    """Return whether a file is C++ by its suffix."""
    return path.suffix == ".C" or path.suffix.lower() in CPP_SUFFIXES


def _reader(path: Path, options: tuple[str, ...]) -> SourceReader:
    """Return the reader of a file, whose language its suffix says, or, of a header, what is in it."""
    reader = SourceReader(SourceFile(path, is_cpp(path), options))
    if path.suffix == ".h" and reader.broken():
        other = SourceReader(SourceFile(path, True, options))
        return reader if other.broken() else other
    return reader


def _syntax_error(file: SourceFile) -> str:
    """Return the first error that the compiler finds in a file; "" if it finds none."""
    language = "c++" if file.is_cpp else "c"
    command = [*compiler.C.command(), "-fsyntax-only", "-x", language, *file.options, str(file.path)]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    errors = [line.strip() for line in done.stderr.splitlines() if re.search(r"\berror\b:", line)]
    return errors[0] if errors and done.returncode else ""


def _listed(file: Path, path: Path) -> tuple[str, ...]:
    """Return the options of a file in a list of compile commands."""
    try:
        entries = json.loads(file.read_text(encoding="utf-8"))
        known = {(Path(each["directory"]) / each["file"]).resolve(): each for each in entries}
        entry = known.get(path.resolve(), {"command": "", "directory": ""})
        command = shlex.join(entry["arguments"]) if "arguments" in entry else entry["command"]
        base = Path(entry["directory"])
    except OSError as error:
        raise InputError(f"--compile-commands: {file} cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError):
        raise InputError(
            f"--compile-commands: {file} is no list of compile commands with directory, file and command"
        ) from None
    if not command:
        raise InputError(f"--compile-commands: {file} has no entry of {path}")
    return tuple(read_options(options_of(command, base), "-f"))


def _numeric(arguments: ForeignArguments) -> list[ForeignArgument]:
    """Return the arguments and results whose numbers are those of the computation."""
    return [*arguments.fed, *arguments.results]


def _precision(arguments: ForeignArguments) -> str:
    """Return the numbers of the computation: the shortest of its samples and results."""
    numbers = {value.number for each in _numeric(arguments) for value in each.carriers}
    whole = sorted(number for number in numbers if number not in PRECISIONS)
    return whole[0] if whole else "float" if "float" in numbers else "double"


def _with_init(source: ForeignSource, init: str, reader: SourceReader) -> ForeignSource:
    """Return a source with the statement that begins a run."""
    if not init:
        return source
    name, bracket, inside = init.partition("(")
    memories = source.arguments.memories
    said = inside.rpartition(")")[0]
    for each in memories:
        said = re.sub(rf"(?<!\.)\b{each.name}\b", reading.variable(each), said)
    made = next((each for each in memories if _last(each.type) == _last(name)), None)
    if made and source.read.is_cpp:
        return replace(source, constructor=(made.name, said), init=init)
    signature = reader.signature("--init", name)
    if not bracket:
        state = source.arguments.named(STATE)
        passed = []
        for value in signature.parameters:
            memory = next((each for each in memories if value.type == each.type), None)
            if memory:
                passed.append(value.passed + reading.variable(memory))
            elif state and len(state.carriers) == 1 and (value.open or len(value.elements) == state.size):
                passed.append(_passed(state.carriers[0]))
            else:
                raise InputError(
                    f"{init} of --init does not take the memory, the state or nothing: `{value.text}`; "
                    f'--init "{init}(...)" states its arguments'
                )
        said = ", ".join(passed)
    return replace(source, begins=f"{_called(signature, source.arguments)}({said});", init=init)


def _called(signature: Signature, arguments: ForeignArguments) -> str:
    """Return what is called: a function, or a method of the first object in memory."""
    if not signature.owner:
        return signature.name
    return f"{reading.variable(arguments.memories[0])}.{_last(signature.name)}"


def _with_publications(source: ForeignSource, publishes: str, reader: SourceReader) -> ForeignSource:
    """Return a source that says after how many calls there is a result."""
    returns, arguments = source.signature.returns, source.arguments
    is_said = returns is not None and (
        returns.number == "bool" or returns.number.endswith(("int16", "int32"))
    )
    if publishes.isdecimal():
        return _publishing(replace(source, publishes=checks.count("--publishes", int(publishes), largest=64)))
    if publishes:
        before, places = reading.places(publishes, arguments.parameters, reader)
        known = reader.results(places, before)
        if places[0] not in known or len(known[places[0]].elements) != 1:
            raise InputError(
                f"--publishes is {publishes!r}; a whole number from 1 to 64, or a number that changes with every "
                "result is needed, as a field of memory"
            )
        return _publishing(replace(source, publishes=0, counter=places[0]))
    if is_said and not any(value.passed == "return" for each in arguments.results for value in each.carriers):
        return replace(source, publishes=0)
    return source


def _publishing(source: ForeignSource) -> ForeignSource:
    if source.publishes != 1 and len(source.arguments.fed) > 1:
        beside = next(each for each in source.arguments.fed if each is not source.arguments.samples)
        raise InputError(f"--publishes does not go with the argument {beside.name}")
    return source


def bridge_text(source: ForeignSource) -> str:
    """Return the text that includes a user's file and calls its function."""
    arguments = source.arguments
    values = [
        value
        for argument in arguments.parameters
        for value in argument.carriers
        if value.passed != "return" and not argument.type and argument.name != CONSTANT
    ]
    declared = [_TOUCHED]
    for value in values:
        shape = "".join(f"[{length}]" for length in value.shape)
        declared.append(_GUARD.format(type=value.type, shape=shape, name=_variable(value)))
    for memory in arguments.memories:
        form = _STORED if source.read.is_cpp else "static {type} {name};"
        declared.append(form.format(type=memory.type, name=reading.variable(memory)))
    carriers = [value for result in arguments.results for value in result.carriers]
    returned = next((value for value in carriers if value.passed == "return"), None)
    if returned and not source.read.is_cpp:
        declared.append(f"static {returned.text} strapgen_returned;")
    return _BRIDGE.format(
        file=source.read.path.resolve().as_posix(),
        declarations="\n".join(declared),
        cleared=_lines(_cleared(source), 16),
        reset=_lines(_reset(source), 12),
        begins=source.begins,
        before=_lines(_before(source, values), 12),
        call=_lines([_call(source, returned is not None)], 12),
        after=_lines(_after(source, values), 12),
        publishes=max(source.publishes, 1),
        elements=sum(result.size for result in arguments.results),
    )


def _lines(statements: Iterable[str], indent: int) -> str:
    return "\n".join(" " * indent + statement for statement in statements)


def _variable(value: Value) -> str:
    return f"strapgen_of_{value.name.replace(' ', '_')}"


def _passed(value: Value) -> str:
    return f"{value.passed}{_variable(value)}.of"


def numbers_of(argument: ForeignArgument) -> list[str]:
    """Return the expressions of the numbers of an argument or a result."""
    return [_object(value) + end for value in argument.carriers for end in value.elements]


def _object(value: Value) -> str:
    """Return the expression that the numbers of a value are elements of."""
    if not value.type:
        return f"({value.name})"
    return "strapgen_returned" if value.passed == "return" else f"{_variable(value)}.of"


def _call(source: ForeignSource, keeps: bool) -> str:
    """Return the statement of the call."""
    signature, passed = source.signature, []
    for argument in source.arguments.parameters:
        if argument.reference == ".":
            continue
        for value in argument.carriers:
            if argument.type:
                passed.append(value.passed + reading.variable(argument))
            elif argument.name == CONSTANT:
                passed.append(argument.text)
            elif value.passed != "return":
                passed.append(_passed(value))
    call = f"{_called(signature, source.arguments)}({', '.join(passed)});"
    if keeps:
        return f"auto &&strapgen_returned = {call}" if source.read.is_cpp else f"strapgen_returned = {call}"
    if source.publishes != 1 and not source.counter and source.signature.returns is not None:
        return f"published = ({call.rstrip(';')}) != 0;"
    return call


def _cleared(source: ForeignSource) -> list[str]:
    """Return the statements that make memory as it is before a run."""
    lines = []
    for memory in source.arguments.memories:
        name = reading.variable(memory)
        made = dict([source.constructor]).get(memory.name, "")
        if source.read.is_cpp:
            lines += [f"if ({name}_lives)", f"    {name}.~{name}_t();"]
            lines += [f"new ({name}_bytes) {name}_t({made});", f"{name}_lives = true;"]
        else:
            lines.append(f"memset(&{name}, 0, sizeof {name});")
    return lines


def _reset(source: ForeignSource) -> list[str]:
    """Return the statements that set the state at the begin of a run."""
    lines, number = [], 0
    for result in source.arguments.results:
        held = source.arguments.before(result)
        lines += [
            f"{place} = identity[{number + k}];" for k, place in enumerate(numbers_of(held) if held else ())
        ]
        number += result.size
    return lines


def _before(source: ForeignSource, values: Sequence[Value]) -> list[str]:
    """Return the statements before a call, which fill the inputs and mark the outputs."""
    arguments, lines = source.arguments, []
    for argument in arguments.fed:
        lines += [f"{place} = *input++;" for place in numbers_of(argument)]
    times = {name: f"strapgen_dt / {unit!r}" for name, unit in INTERVALS.items()} | {
        STEP: "strapgen_step",
        ZEROS: "0",
    }
    for argument in arguments.parameters:
        for place in numbers_of(argument) if argument.name in times else ():
            nearest = " + 0.5" if is_whole(argument) and argument.name != ZEROS else ""
            lines.append(f"{place} = {times[argument.name]}{nearest};")
    for result in arguments.results:
        held = arguments.before(result)
        is_new = result.name in ARGUMENTS_OF_RESULTS and (held is None or held.name != result.name)
        if is_new and result.carriers[0].passed != "return":
            mark = "0" if source.is_integer else "NAN"
            lines += [f"{place} = {mark};" for place in numbers_of(result)]
    for value in values:
        lines.append(
            f"memset({_variable(value)}.before, 0x5a, 64); memset({_variable(value)}.after, 0x5a, 64);"
        )
    if watched := _watched(arguments):
        lines.append(f"const double strapgen_kept[] = {watched};")
    if source.counter:
        lines.append(f"const double strapgen_counted = (double)({source.counter});")
    return lines


def _watched(arguments: ForeignArguments) -> str:
    """Return the list in C of the numbers that a call must not change; "" if there are none."""
    places = [
        f"(double)({place})"
        for argument in arguments.parameters
        if not (argument in arguments.results or argument.type or argument.name == CONSTANT)
        for place in numbers_of(argument)
    ]
    return f"{{{', '.join(places)}}}" if places else ""


def _after(source: ForeignSource, values: Sequence[Value]) -> list[str]:
    """Return the statements after a call, which look at what it wrote and keep its result."""
    arguments, lines = source.arguments, []
    for value in values:
        name = _variable(value)
        lines.append(f"flags |= strapgen_touched({name}.before) | strapgen_touched({name}.after);")
    if watched := _watched(arguments):
        lines.append(f"const double strapgen_seen[] = {watched};")
        lines.append("flags |= memcmp(strapgen_seen, strapgen_kept, sizeof strapgen_kept) != 0 ? 2 : 0;")
    if source.counter:
        lines.append(f"published = (double)({source.counter}) != strapgen_counted;")
    number = 0
    for result in arguments.results:
        held = arguments.before(result)
        for k, place in enumerate(numbers_of(result)):
            lines.append(f"output[{number}] = (double)({place});")
            if held and held.name != result.name:
                lines.append(f"{numbers_of(held)[k]} = output[{number}];")
            number += 1
    return lines
