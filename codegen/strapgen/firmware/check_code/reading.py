"""Says which argument of a function in C or C++ is what: by `--arguments`, or by names that say what they are."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Protocol

from strapgen.firmware.check_code.foreign_arguments import (
    ARGUMENTS_OF_RESULTS,
    CONSTANT,
    INTERVALS,
    MEMORY,
    NEXT,
    PREVIOUS,
    PUSHES,
    ROTATION,
    SAMPLES,
    STATE,
    STEP,
    VELOCITY_CHANGE,
    ZEROS,
    ForeignArgument,
    ForeignArguments,
    read_arguments,
    require_consistent,
)
from strapgen.firmware.check_code.signature import Signature, SourceFile, Value
from strapgen.ir.checks import alternatives
from strapgen.ir.exceptions import InputError

#: What a name means, the first that fits; each is looked for in a name of small letters.
_VECTORS = (
    ("increments", r"del(ta)?_?(ang|theta)|d_?ang|d_?theta|increment|ang(le)?_?inc"),
    (ZEROS, r"acc|mag|specific_?force|del(ta)?_?vel"),
    ("rates", r"gyr|omega|rate|ang(ular)?_?vel|^w_?(b|ib|nb)?$"),
)
_SCALARS = {"g": "rates", "w": "rates", "p": "rates", "a": ZEROS, "m": ZEROS}
_ATTITUDE = re.compile(
    r"^(m_|_)?(get_?)?((delta_?)?q|q_?\d|q_?[bni]{2}|\w*quat\w*|att|attitude|state|orient\w*|rot|rotation_?matrix|dcm|matrix|"
    r"[cr]_?[bni]?[bni]?|(q_?)?(out|new|next|result))_?$"
)
_MATRIX = re.compile(r"(m_|_)?(rot|dcm|matrix|[cr]_?[bni]?[bni]?_?$)")
_ROTATIONS = re.compile(r"rot(ation)?_?vec\w*|^phi$|^rotation$|^rv$")
_TIME = re.compile(
    r"^_?(dt|delta_?t(ime)?|d_?time|period|interval|(sample|time)_?(step|time|period|interval)|t_?s|h)_?(s|ms|us)?_?$"
)
_DEGREES = re.compile(r"deg|dps")
_OUT = re.compile(r"out|next|new|result")


class Reader(Protocol):
    """What tells which values a file has beside the parameters of its functions."""

    file: SourceFile

    def results(self, places: Iterable[str], before: Sequence[str] = ()) -> dict[str, Value]:
        """Return what expressions are that are read after a call, by their text, without those that are nothing."""

    def fields(self, name: str, before: Sequence[str]) -> list[tuple[str, bool]]:
        """Return fields of an object and its methods that take nothing, each with whether it is public."""

    def variables(self) -> list[str]:
        """Return the names of the variables outside of functions."""


def joined(signature: Signature, text: str, reader: Reader) -> ForeignArguments:
    """Return the arguments that a text names, with the parameters that carry each."""
    memories = [value.name for value in signature.parameters if value.is_object]
    stated = read_arguments(text, (*memories, *([MEMORY] if signature.owner else [])))
    left = list(signature.parameters)
    parameters = []
    if signature.owner:
        parameters.append(ForeignArgument(MEMORY, (), signature.owner, "."))
    for argument in stated.parameters:
        if argument.name != MEMORY or not signature.owner:
            state = next((each for each in parameters if each.name == STATE and not each.type), argument)
            shape = argument.shape or (state.shape if argument.name == NEXT else ())
            parameters.append(_carried(signature, replace(argument, shape=shape), left))
    if left and not left[0].has_default:
        raise InputError(
            f"--arguments {text!r} leaves out `{left[0].text}` of {signature.name}; what it is has to be said, "
            "a constant for instance as =0"
        )
    known = {argument.name: argument for argument in parameters if not argument.type}
    results = []
    for result in stated.results:
        place = known.get(result.name) or _read_after(signature, result, parameters, reader)
        results.append(replace(place, meaning=result.meaning))
        parameters = [results[-1] if each is place else each for each in parameters]
    attitude = next((each for each in results if not each.meaning), stated.result)
    translations = tuple(each for each in results if each.meaning)
    require_consistent(parameters, attitude, translations)
    return ForeignArguments(tuple(parameters), attitude, translations)


def _carried(signature: Signature, argument: ForeignArgument, left: list[Value]) -> ForeignArgument:
    """Return an argument with the parameters that carry it, which are taken from those that are left."""
    returns = signature.returns if signature.returns and signature.returns.elements else None
    by_return = ARGUMENTS_OF_RESULTS if returns and returns.open else (NEXT, ROTATION, VELOCITY_CHANGE)
    if returns and argument.name in by_return and (not left or left[0].has_default):
        value = replace(returns, passed="return")
        return _sized(argument, (value.holding(argument.size or _usual(argument)),))
    if not left:
        raise InputError(
            f"--arguments: {signature.name} takes no argument for {argument.name}; it takes "
            f"{', '.join(value.text for value in signature.parameters) or 'none'}"
        )
    value = left.pop(0)
    if argument.type or argument.name == CONSTANT:
        return replace(argument, type=value.type if argument.type else "", carriers=(value,))
    if not value.elements:
        raise InputError(f"--arguments: {argument.name} is `{value.text}`, of which no numbers are known")
    if argument.name in (*INTERVALS, STEP):
        if len(value.elements) != 1:
            raise InputError(f"--arguments: {argument.name} is `{value.text}`; one number is needed")
        return replace(argument, carriers=(value,))
    count = argument.size or _usual(argument)
    if len(value.elements) == 1 and (not value.open or together([value, *left]) == count):
        carriers = [value, *left[: count - 1]]
        if len(carriers) < count or any(
            len(each.elements) != 1 or each.open != value.open for each in carriers
        ):
            raise InputError(f"--arguments: {argument.name} needs {count} numbers from `{value.text}` on")
        del left[: count - 1]
        return _sized(argument, tuple(carriers))
    count = len(value.elements) if len(value.elements) > 1 else _usual(argument)
    return _sized(argument, (value.holding(argument.size or count),))


def _usual(argument: ForeignArgument) -> int:
    """Return how many numbers an argument has if neither the text nor the source says it."""
    return 4 if argument.name in (STATE, NEXT) else 3


def _sized(argument: ForeignArgument, carriers: tuple[Value, ...]) -> ForeignArgument:
    """Return an argument with its parameters, and with the shape that they have."""
    count = sum(len(value.elements) for value in carriers)
    if argument.size > 1 and argument.size != count:
        text = ", ".join(value.text for value in carriers)
        raise InputError(f"--arguments: {argument.name} has {argument.size} numbers, `{text}` {count}")
    is_read_after = not carriers[0].type and not argument.meaning
    allowed: tuple[int, ...] = (
        (3, 4, 9) if is_read_after else (4, 9) if argument.name in (STATE, NEXT) else (3,)
    )
    if argument.name in (*SAMPLES, PREVIOUS, *PUSHES):
        allowed = tuple(3 * k for k in range(1, 9 if argument.name != PREVIOUS else 4))
    if count not in allowed and argument.name != ZEROS:
        needed = alternatives([str(each) for each in allowed])
        raise InputError(
            f"--arguments: {argument.name} is `{carriers[0].text}` with {count} numbers; {needed} are needed"
        )
    shape = (count // 3, 3) if argument.name in (*SAMPLES, PREVIOUS, *PUSHES) and count > 3 else (count,)
    return replace(argument, shape=argument.shape or shape, carriers=carriers)


def _read_after(
    signature: Signature, result: ForeignArgument, parameters: Sequence[ForeignArgument], reader: Reader
) -> ForeignArgument:
    """Return a result that is a field of memory, or a global array, with the places of its numbers."""
    before, parts = places(result.name, parameters, reader)
    known = reader.results(parts, before)
    if missing := [place for place in parts if place not in known]:
        raise InputError(
            f"--arguments: the result {result.name} is not in {reader.file.path}"
            f"{'' if len(parts) == 1 else f', for lack of {missing[0]}'}"
        )
    values = [replace(known[place], type="") for place in parts]
    if len(values) == 1 and result.size:
        values[0] = values[0].holding(result.size)
    if values[0].open or not values[0].elements:
        raise InputError(f"--arguments: the result {result.name} has no numbers that are known")
    if len(values) == 4:
        values = _named_last(values)
    return _sized(result, tuple(values))


def places(name: str, parameters: Sequence[ForeignArgument], reader: Reader) -> tuple[list[str], list[str]]:
    """Return the declarations and the expressions of a result, one for each of its parts."""
    first, *rest = name.removeprefix("global ").split()
    owner, _, field = first.partition(".")
    memory = next((argument for argument in parameters if argument.type and argument.name == owner), None)
    if memory is None:
        return [], [first, *rest]
    first = f"{variable(memory)}.{field}"
    return [declared(memory, reader)], [first, *(f"{first.rpartition('.')[0]}.{each}" for each in rest)]


def variable(memory: ForeignArgument) -> str:
    """Return the name of memory in the text that calls a function; no other name of the file is like it."""
    return f"strapgen_at_{memory.name}"


def declared(memory: ForeignArgument, reader: Reader) -> str:
    """Return the declaration of memory."""
    return f"extern {memory.type} {'&' if reader.file.is_cpp else ''}{variable(memory)};"


def _named_last(values: list[Value]) -> list[Value]:
    """Return four numbers with the scalar part last if their names say which it is."""
    letters = [value.name[-1].lower() for value in values]
    if sorted(letters) != ["w", "x", "y", "z"]:
        return values
    return [replace(values[letters.index(letter)], named=True) for letter in "xyzw"]


# Names


def proposed(signature: Signature, reader: Reader, takes: str, is_angle_said: bool) -> str:
    """Return the arguments as their names and types say them; a name that says nothing is refused."""
    words, left, results = [], list(signature.parameters), []
    has_time = any(_TIME.match(value.name.lower()) for value in left)
    is_read = any(_vector(value) in SAMPLES and not value.written for value in left)
    while left:
        value = left.pop(0)
        role = _role(value, left)
        if role == "" and value.has_default:
            break
        if role == "":
            raise InputError(
                f"{signature.name}: what `{value.text}` is, its name does not say; --arguments is needed, as "
                '"state, increments -> state"'
            )
        if role in SAMPLES:
            if _DEGREES.search(value.name.lower()) and not is_angle_said:
                raise InputError(
                    f"`{value.text}` names degrees; --angle-unit deg or --angle-unit rad is needed"
                )
            if is_read and value.written and role == "increments" and _is_vector(value):
                role = ROTATION  # another argument has the samples
            elif takes:
                role = "increments" if takes == "increments" else "rates"
            elif role == "rates" and not has_time:
                raise InputError(
                    f"`{value.text}` may be an increment or a rate, since {signature.name} takes no time; "
                    "--input increments, rates or instants is needed"
                )
        if role == STATE and value.written:
            role = NEXT if STATE in words else STATE
            results.append(role)
        elif role in (NEXT, ROTATION):
            results.append(role)
        is_matrix = role in (STATE, NEXT) and value.open and _MATRIX.match(value.name.lower())
        words.append(f"{role}[9]" if is_matrix and len(value.elements) == 1 else role)
    return f"{', '.join(words)} -> {results[0] if results else _found(signature, reader)}"


def _is_vector(value: Value) -> bool:
    return value.open or len(value.elements) % 3 == 0


def _vector(value: Value) -> str:
    """Return what a vector is by its name."""
    name = value.name.lower()
    return next((role for role, pattern in _VECTORS if re.search(pattern, name)), "")


def _role(value: Value, left: list[Value]) -> str:
    """Return what a parameter is, and take those that belong to it from the ones that follow."""
    name, count = value.name.lower(), len(value.elements)
    if count == 0:
        return f"memory *{value.name}"
    if count == 1:
        if time := _TIME.match(name):
            return f"dt_{time[5]}" if time[5] in ("us", "ms") else "dt"
        if name == STEP:
            return STEP
        if not value.open or together([value, *left]) > 1:
            return _scalars(value, left)
    if value.written and _ROTATIONS.search(name):
        return ROTATION
    if (count in (4, 9) or value.open) and _ATTITUDE.match(name):
        return NEXT if value.written and _OUT.search(name) else STATE
    found = _vector(value) if _is_vector(value) else ""
    return found or (f"memory *{value.name}" if value.is_object and value.passed and value.written else "")


def together(values: Sequence[Value]) -> int:
    """Return how many of the first numbers belong together by their names: 4 of an attitude, 3 of a vector, or 1."""
    names = [each.name.lower() for each in values[:4]]
    for count, ends in ((4, ("0123", "wxyz", "xyzw")), (3, ("xyz",))):
        heads = {name[:-1] for name in names[:count]}
        if len(heads) == 1 and "".join(name[-1] for name in names[:count]) in ends:
            return count
    return 3 if names[:3] == [*"pqr"] else 1


def _scalars(value: Value, left: list[Value]) -> str:
    """Return what numbers are that belong together by their names, and take the others from the ones that follow."""
    name, count, role = value.name.lower(), together([value, *left]), ""
    head = name[:-1].rstrip("_")
    if count == 4 and (not head or _ATTITUDE.match(head)):
        role = NEXT if value.written and _OUT.search(head) else STATE
    elif count == 3:
        role = "rates" if name == "p" else _SCALARS.get(head) or _vector(replace(value, name=head))
    if role:
        del left[: count - 1]
    return role


def _found(signature: Signature, reader: Reader) -> str:
    """Return the attitude that a function leaves in what it returns, in memory, or in global numbers."""
    returns = signature.returns
    if returns is not None and returns.elements and (returns.open or len(returns.elements) in (3, 4, 9)):
        return ROTATION if len(returns.elements) == 3 else NEXT
    memories = [ForeignArgument(MEMORY, (), signature.owner, ".")] if signature.owner else []
    memories += [
        ForeignArgument(value.name, (), value.type)
        for value in signature.parameters
        if value.is_object and value.written
    ]
    found = []
    for memory in memories:
        before, name = [declared(memory, reader)], variable(memory)
        fields = reader.fields(name, before)
        public = _attitudes(reader, [field for field, is_public in fields if is_public], before, "")
        every = public or _attitudes(reader, [field for field, _ in fields], before, "")
        found += [each.replace(name, memory.name) for each in every]
    if not memories:
        found = _attitudes(reader, reader.variables(), [], "global ")
    if len(found) != 1:
        several = f"may be {' or '.join(found)}" if found else "is nowhere that its name says"
        raise InputError(
            f"{signature.name}: the attitude that it computes {several}; --arguments says it behind the arrow"
        )
    return found[0]


def _last(name: str) -> str:
    """Return the last part of a name, in small letters."""
    return re.split(r"\.|::", name)[-1].removesuffix("()").lower()


def _attitudes(reader: Reader, names: Sequence[str], before: Sequence[str], prefix: str) -> list[str]:
    """Return those names that are attitudes, four numbers whose names belong together as one."""
    known = reader.results([name for name in names if _ATTITUDE.match(_last(name))], before)
    found = [f"{prefix}{name}" for name, value in known.items() if len(value.elements) in (4, 9)]
    for k in range(len(names) - 3) if not found else ():
        four, parent = names[k : k + 4], names[k].rpartition(".")[0]
        ends = [name.removeprefix(f"{parent}.") for name in four]
        if together([Value(end, end) for end in ends]) == 4 and all(
            len(value.elements) == 1 for value in reader.results(four, before).values()
        ):
            found.append(f"{prefix}{parent}{'.' * bool(parent)}{' '.join(ends)}")
    return found


# Words


def in_words(name: str, arguments: ForeignArguments, takes: str, unit: str) -> str:
    """Return how a function is called, in one line."""
    kinds = {"increments": unit, "rates": f"{unit}/s, means", "instants": f"{unit}/s at instants"}
    parts = []
    for argument in arguments.parameters:
        if argument.reference == "." or any(value.passed == "return" for value in argument.carriers):
            continue
        said = ", ".join(value.name for value in argument.carriers)
        shape = "".join(f"[{length}]" for length in argument.shape)
        role = "memory" if argument.type else f"{argument.name}{shape}"
        role = f"{role} in {kinds[takes]}" if argument.name in SAMPLES else role
        role = f"{CONSTANT}{argument.text}" if argument.name == CONSTANT else role
        parts.append(said if role == said else f"{said}: {role}")
    shape = "".join(f"[{length}]" for length in arguments.result.shape)
    return f"{name}({', '.join(parts)}) -> {arguments.result.name}{shape}"
