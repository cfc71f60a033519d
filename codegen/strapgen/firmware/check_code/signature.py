"""Reads the signature of a function in C or C++ with libclang: its parameters, and how their numbers are reached."""

from __future__ import annotations

import re
import shlex
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from strapgen.ir.checks import did_you_mean
from strapgen.ir.exceptions import CompilerError, InputError, MissingExtraError
from strapgen.run import compiler

#: What is tried for each expression: itself, and what reaches a number of an object without public fields.
_ACCESS = ("", ".x()", ".w()", "(0, 0)", "[0]", "(0)")
#: Names of elements of which one says that it is the scalar part, in the order in which they are taken.
_NAMED = ("x", "y", "z", "w")
#: Numbers of elements of what is no memory: a number, a vector, and an attitude.
_SIZES = (1, 3, 4, 9)
#: Options of a compiler that say what is read.
_OPTIONS_READ = ("-I", "-D", "-U", "-std", "-isystem", "-iquote", "-include")
_NUMBERS = {"FLOAT": "float", "DOUBLE": "double", "BOOL": "bool"}
_HIDDEN = ("PRIVATE", "PROTECTED")
_MOST_LEVELS = 3


@dataclass(frozen=True)
class Value:
    """A parameter, a result or a field: what C declares, and how its numbers are reached."""

    name: str
    #: As the source has it, for messages
    text: str
    #: Type of a variable that holds it, and what follows the variable's name, as "[2][3]"
    type: str = ""
    shape: tuple[int, ...] = ()
    #: "&" if its address is passed, else ""
    passed: str = ""
    #: Whether a call can change it
    written: bool = False
    #: What follows the variable's name for each number of it; none of memory
    elements: tuple[str, ...] = ()
    #: "float", "double", "bool", or an integer such as "int32"
    number: str = ""
    #: Whether names say which element is the scalar part, which then stands last
    named: bool = False
    #: Whether a pointer leaves open how many there are
    open: bool = False

    @property
    def is_object(self) -> bool:
        """Whether it is a struct, a union or a class."""
        return not self.elements or self.elements[0][:1] in (".", "(")

    @property
    def has_default(self) -> bool:
        """Whether a call may leave it out."""
        return "=" in self.text

    def holding(self, count: int) -> Value:
        """Return the same for so many numbers, where a pointer leaves their number open."""
        if not self.open or count == len(self.elements):
            return self
        length = count // len(self.elements)
        places = tuple(f"[{k}]{each}" for k in range(length) for each in self.elements)
        passed = self.passed.replace("&", "")
        return replace(self, shape=(length, *self.shape), passed=passed, elements=places, open=False)


@dataclass(frozen=True)
class Signature:
    """A function."""

    name: str
    parameters: tuple[Value, ...]
    #: The class of a method; "" for a function
    owner: str = ""
    #: What it returns; None for nothing
    returns: Value | None = None


@dataclass(frozen=True)
class SourceFile:
    """A file in C or C++, and how it is compiled."""

    path: Path
    is_cpp: bool
    #: Options of the compiler, paths in them absolute
    options: tuple[str, ...] = ()


class SourceReader:
    """Reads functions, and what expressions in the file are."""

    def __init__(self, file: SourceFile) -> None:
        self.file = file
        self.unit = self._parse("")
        self.functions = [*_walk(self.unit.cursor, ("FUNCTION_DECL", "CXX_METHOD"), (*_CLASSES, *_OPEN))]

    def _parse(self, text: str) -> Any:
        try:
            from clang.cindex import Index, TranslationUnit, TranslationUnitLoadError
        except ImportError:
            raise MissingExtraError(
                "the signature of a function is read by libclang: pip install 'strapgen[check]'"
            ) from None
        language = "c++" if self.file.is_cpp else "c"
        options = ["-x", language, "-ferror-limit=0", "-DEIGEN_DONT_VECTORIZE", *_include_paths(language)]
        options += ["-fno-access-control"] if self.file.is_cpp else []
        options += [*read_options(compiler.C.command()[1:]), *read_options(self.file.options)]
        name = str(self.file.path.resolve().parent / "strapgen_signature.h")
        whole = f'#include "{self.file.path.resolve().as_posix()}"\n{text}'
        try:
            return Index.create().parse(
                name, options, [(name, whole)], TranslationUnit.PARSE_SKIP_FUNCTION_BODIES
            )
        except TranslationUnitLoadError:
            raise CompilerError(f"{self.file.path} cannot be read by libclang") from None

    def broken(self) -> bool:
        """Return whether libclang sees an error in the file."""
        return any(each.severity >= each.Error for each in self.unit.diagnostics)

    def _cursor(self, option: str, name: str) -> tuple[str, Any]:
        """Return the full name and the declaration of a function."""
        plain, bracket, _ = name.partition("(")
        found: dict[str, tuple[str, Any]] = {}
        for full, cursor in self.functions:
            if full == plain or full.endswith(f"::{plain}"):
                shown = full.rpartition("::")[0] + "::" * ("::" in full) + cursor.displayname
                if not bracket or _squeezed(shown).endswith(_squeezed(name)):
                    found.setdefault(cursor.canonical.get_usr(), (full, cursor))
        exact = {usr: each for usr, each in found.items() if each[0] == plain}
        found = exact or found
        if not found:
            names = list(dict.fromkeys(full for full, cursor in self.functions if self._is_own(cursor)))
            guess = did_you_mean("function", name, names)
            raise CompilerError(
                f"{option}: {self.file.path} has no function {name}{guess}; it has {', '.join(names[:20]) or 'none'}"
            )
        if len(found) > 1:
            several = ", ".join(f'"{cursor.displayname}"' for _, cursor in found.values())
            raise InputError(f"{option}: {name} has several meanings; one of {several} is needed")
        return next(iter(found.values()))

    def signature(self, option: str, name: str) -> Signature:
        """Return the signature of a function."""
        full, cursor = self._cursor(option, name)
        types = [
            (argument.spelling or f"argument {k}", _text(argument), argument.type)
            for k, argument in enumerate(cursor.get_arguments(), 1)
        ]
        count, result = len(types), cursor.result_type
        is_void = result.kind.name == "VOID"
        values = self.values([*types, *([] if is_void else [("return", result.spelling, result)])])
        is_method = cursor.kind.name == "CXX_METHOD" and not cursor.is_static_method()
        owner = full.rpartition("::")[0] if is_method else ""
        return Signature(full, tuple(values[:count]), owner, None if is_void else values[-1])

    def values(self, types: Sequence[tuple[str, str, Any]]) -> list[Value]:
        """Return what variables are, by their names, their declarations, and their types of libclang."""
        plain = [_Declared.of(kind) for _, _, kind in types]
        sign = "&" if self.file.is_cpp else ""
        before = [f"extern {each.type} {sign}strapgen_{k};" for k, each in enumerate(plain) if each.is_record]
        places = [
            f"strapgen_{k}{access}" for k, each in enumerate(plain) if each.is_record for access in _ACCESS
        ]
        known = self.expressions(places, before)
        return [
            each.value(*types[k][:2], known.get(f"strapgen_{k}"), f"strapgen_{k}", known)
            for k, each in enumerate(plain)
        ]

    def expressions(self, texts: Iterable[str], before: Sequence[str] = ()) -> dict[str, Any]:
        """Return the types of libclang of those expressions that have one, by their text."""
        texts = list(texts)
        lines = [
            f"auto &&strapgen_e{k} = {text};"
            if self.file.is_cpp
            else f"extern __typeof__({text}) *strapgen_e{k};"
            for k, text in enumerate(texts)
        ]
        if not texts:
            return {}
        unit = self._parse("\n".join([*before, *lines]))
        wrong = {
            said.location.line
            for said in unit.diagnostics
            if said.severity >= said.Error
            and said.location.file
            and "strapgen_sig" in said.location.file.name
        }
        found = {}
        for cursor in unit.cursor.get_children():
            number = re.fullmatch(r"strapgen_e(\d+)", cursor.spelling)
            if number and cursor.location.line not in wrong:
                found[texts[int(number[1])]] = cursor.type.get_canonical().get_pointee().get_canonical()
        return found

    def results(self, places: Iterable[str], before: Sequence[str] = ()) -> dict[str, Value]:
        """Return what expressions are that are read after a call, by their text, without those that are nothing."""
        places = list(places)
        known = self.expressions([place + access for place in places for access in _ACCESS], before)
        return {
            place: replace(
                _Declared.of(known[place]).value(place, place, None, place, known), passed="", written=True
            )
            for place in places
            if place in known
        }

    def fields(self, name: str, before: Sequence[str]) -> list[tuple[str, bool]]:
        """Return fields of an object and its methods that take nothing, each with whether it is public."""
        kind = self.expressions([name], before).get(name)
        return [] if kind is None else [*_fields(kind, name, _MOST_LEVELS)]

    def variables(self) -> list[str]:
        """Return the names of the variables that the file declares outside of functions."""
        known = _walk(self.unit.cursor, ("VAR_DECL",), ("NAMESPACE", *_OPEN))
        return [full for full, cursor in known if self._is_own(cursor)]

    def _is_own(self, cursor: Any) -> bool:
        file = cursor.location.file
        return file is not None and Path(file.name).resolve().parent == self.file.path.resolve().parent


@dataclass(frozen=True)
class _Declared:
    """A type of libclang without qualifiers, pointer and array."""

    kind: Any
    type: str
    shape: tuple[int, ...]
    passed: str
    written: bool
    open: bool

    @classmethod
    def of(cls, kind: Any) -> _Declared:
        """Return what a type is."""
        kind, shape = kind.get_canonical(), []
        name = kind.kind.name
        written = name in ("LVALUEREFERENCE", "RVALUEREFERENCE", "POINTER", "INCOMPLETEARRAY")
        is_open = name in ("POINTER", "INCOMPLETEARRAY")
        if written:
            kind = kind.element_type if name == "INCOMPLETEARRAY" else kind.get_pointee()
        is_const = (
            re.match(r"(volatile )?const\b", kind.spelling) is not None
        )  # of an array, of its elements too
        while kind.kind.name == "CONSTANTARRAY":
            shape.append(kind.element_count)
            kind, written = kind.element_type, True
        plain = re.sub(r"\b(const|volatile)\b *", "", kind.spelling).strip()
        return cls(kind, plain, tuple(shape), "&" if is_open else "", written and not is_const, is_open)

    @property
    def is_record(self) -> bool:
        return bool(self.kind.kind.name == "RECORD")

    def value(self, name: str, text: str, kind: Any, expression: str, known: dict[str, Any]) -> Value:
        """Return a value of this type, or of one that libclang knows better, with the types of what reaches numbers."""
        numbers = _numbers(kind or self.kind, expression, known)
        places = tuple(index + end for index in _indices(self.shape) for end in numbers.elements)
        how = (self.type, self.shape, self.passed, self.written)
        return Value(name, text, *how, places, numbers.number, numbers.named, self.open)


@dataclass(frozen=True)
class _Numbers:
    elements: tuple[str, ...] = ()
    number: str = ""
    named: bool = False


def _text(cursor: Any) -> str:
    """Return a declaration as the source has it, in one line."""
    start, end = cursor.extent.start, cursor.extent.end
    text = Path(start.file.name).read_bytes()[start.offset : end.offset].decode(errors="replace")
    return " ".join(text.split())


def _numbers(kind: Any, expression: str, known: dict[str, Any]) -> _Numbers:
    """Return how the numbers of a type are reached."""
    canonical = kind.get_canonical()
    name = canonical.kind.name
    if name in _NUMBERS:
        return _Numbers(("",), _NUMBERS[name])
    if name in ("SHORT", "INT", "LONG", "LONGLONG", "USHORT", "UINT", "ULONG", "ULONGLONG", "SCHAR", "UCHAR"):
        return _Numbers(("",), f"{'u' * name.startswith('U')}int{8 * canonical.get_size()}")
    if name == "CONSTANTARRAY":
        inner = _numbers(canonical.element_type, expression, known)
        places = [f"[{k}]{end}" for k in range(canonical.element_count) for end in inner.elements]
        return _Numbers(tuple(places), inner.number, inner.named)
    if name != "RECORD":
        return _Numbers()
    return _of_fields(canonical, expression, known) or _of_access(canonical, expression, known)


def _of_fields(kind: Any, expression: str, known: dict[str, Any]) -> _Numbers | None:
    """Return the numbers of an object by its public fields."""
    fields = [each for each in kind.get_fields()]
    if not fields or any(each.access_specifier.name in _HIDDEN for each in fields):
        return None
    parts = [(each.spelling, _numbers(each.type, expression, known)) for each in fields]
    if kind.get_declaration().kind.name == "UNION_DECL":
        parts = sorted(parts, key=lambda part: not part[1].named)[:1]
    if len({part.number for _, part in parts}) != 1 or not parts[0][1].elements:
        return None
    ends = {
        f"{'.' * bool(name)}{name}{end}": end.strip(".") or name
        for name, part in parts
        for end in part.elements
    }
    if len(ends) not in _SIZES:
        return None
    plain = [re.sub(r"^(q|m)?_?(?=.)|_$", "", name.lower()) for name in ends.values()]
    named = any(part.named for _, part in parts)
    if sorted(plain) == sorted(_NAMED):
        order = [plain.index(each) for each in _NAMED]
        return _Numbers(tuple([*ends][k] for k in order), parts[0][1].number, True)
    return _Numbers(tuple(ends), parts[0][1].number, named)


def _of_access(kind: Any, expression: str, known: dict[str, Any]) -> _Numbers:
    """Return the numbers of an object of a class by its methods and operators."""
    x, w, pair, index, call = (known.get(expression + access) for access in _ACCESS[1:])
    one = index or call or x or pair
    if one is None or one.kind.name not in ("FLOAT", "DOUBLE"):
        return _Numbers()
    number, count = _NUMBERS[one.kind.name], kind.get_size() // one.get_size()
    if count == 4 and w and x:
        return _Numbers(tuple(f".{name}()" for name in _NAMED), number, True)
    if count == 9 and pair:
        return _Numbers(tuple(f"({i}, {j})" for i in range(3) for j in range(3)), number)
    if count not in (3, 4):
        return _Numbers()
    if index or call:
        left, right = "[]" if index else "()"
        return _Numbers(tuple(f"{left}{k}{right}" for k in range(count)), number)
    return _Numbers(tuple(f".{name}()" for name in _NAMED[:3]) if count == 3 else (), number)


def _indices(shape: Sequence[int]) -> list[str]:
    """Return the indices of all elements of an array."""
    indices = [""]
    for length in shape:
        indices = [f"{index}[{k}]" for index in indices for k in range(length)]
    return indices


_CLASSES = ("NAMESPACE", "CLASS_DECL", "STRUCT_DECL")
_OPEN = ("LINKAGE_SPEC", "UNEXPOSED_DECL")


def _walk(cursor: Any, kinds: Sequence[str], scopes: Sequence[str]) -> Iterator[tuple[str, Any]]:
    """Yield declarations outside of the system's headers with the names that the file calls them by."""
    for child in cursor.get_children():
        if _of_system(child):
            continue
        if child.kind.name in kinds:
            yield _qualified(child), child
        elif child.kind.name in scopes:
            yield from _walk(child, kinds, scopes)


def _qualified(cursor: Any) -> str:
    names = [cursor.spelling]
    while (cursor := cursor.semantic_parent) is not None and cursor.kind.name in (*_CLASSES, *_OPEN):
        names += [cursor.spelling] if cursor.kind.name in _CLASSES else []
    return "::".join(filter(None, reversed(names)))


def _fields(kind: Any, expression: str, levels: int, *, public: bool = True) -> Iterator[tuple[str, bool]]:
    """Yield fields of an object and its methods that take nothing, each with whether it is public."""
    record = kind.get_canonical()
    if record.kind.name != "RECORD" or not levels:
        return
    for field in record.get_fields():
        open_ = public and field.access_specifier.name not in _HIDDEN
        name = f"{expression}.{field.spelling}" if field.spelling else expression
        if field.spelling:
            yield name, open_
        yield from _fields(field.type, name, levels - 1, public=open_)
    for child in record.get_declaration().get_children():
        is_method = child.kind.name == "CXX_METHOD" and child.access_specifier.name == "PUBLIC"
        if is_method and not [*child.get_arguments()] and child.result_type.kind.name != "VOID":
            yield f"{expression}.{child.spelling}()", public


def _of_system(cursor: Any) -> bool:
    from clang.cindex import conf

    return bool(conf.lib.clang_Location_isInSystemHeader(cursor.location))


def _squeezed(text: str) -> str:
    return re.sub(r"\s", "", text)


def read_options(options: Sequence[str], *others: str) -> list[str]:
    """Return those options of a compiler that say what is read, and others that begin as said."""
    before = ("", *options)
    return [
        word
        for last, word in zip(before, options, strict=False)
        if word.startswith((*_OPTIONS_READ, *others)) or last in _OPTIONS_READ
    ]


def _include_paths(language: str) -> list[str]:
    """Return options with the folders in which the compiler looks for its own headers."""
    command = [*compiler.C.command(), "-E", "-v", "-x", language, "/dev/null"]
    said = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False).stderr
    _, _, listed = said.partition("#include <...>")
    folders = [line.strip() for line in listed.partition("End of search list")[0].splitlines()[1:]]
    return [word for folder in folders for word in ("-isystem", folder)]


def options_of(text: str, base: Path) -> tuple[str, ...]:
    """Return the words of a line of compiler options, with the paths in them made absolute."""
    try:
        words, absolute = shlex.split(text), []
    except ValueError:
        raise InputError(f"--cflags is {text!r}; an option has a quotation mark that is not closed") from None
    for k, word in enumerate(words):
        flag = next((flag for flag in ("-isystem", "-iquote", "-include", "-I") if word.startswith(flag)), "")
        is_path = k > 0 and words[k - 1] in ("-isystem", "-iquote", "-include", "-I")
        if is_path:
            word = str(base / word)
        elif flag and len(word) > len(flag):
            word = flag + str(base / word[len(flag) :])
        absolute.append(word)
    return tuple(absolute)
