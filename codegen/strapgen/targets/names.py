"""Changes a kernel's names in generated code where the language or the template already uses them.

A program is first printed with marks in place of its names. Every identifier without a mark then belongs to the
template, and the scope in which it stands shows the marks with which it can collide. So no list of a template's
variables is needed, and a name that collides with none stays.
"""

from __future__ import annotations

import keyword
import re
import symtable
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import count, islice
from typing import NamedTuple, TypeVar

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.integer_program import FixedProgram, IntegerOperation, IntegerSum, Scaled, Term, Value
from strapgen.ir.interfaces import Argument, ErrorFeedback, Interface
from strapgen.ir.program import Node, Operation, Program, Reference, Result
from strapgen.ir.signals import Signal
from strapgen.targets.c_library import LIBRARY

#: Keywords of C99 to C23 and of C++, which reads the headers too, and macros without arguments in lower case.
_C_TEXT = """
I alignas alignof and and_eq asm auto bitand bitor bool break case catch char char16_t char32_t char8_t class
co_await co_return co_yield compl complex concept const const_cast consteval constexpr constinit continue
decltype default delete do double dynamic_cast else enum errno explicit export extern false float for fortran
friend goto i386 if imaginary inline int linux long math_errhandling mutable namespace new noexcept noreturn
not not_eq nullptr operator or or_eq private protected public register reinterpret_cast requires restrict
return short signed sizeof static static_assert static_cast stderr stdin stdout struct switch template this
thread_local throw true try typedef typeid typename typeof typeof_unqual union unix unsigned using virtual
void volatile wchar_t while xor xor_eq
"""
_C_WORDS = frozenset(_C_TEXT.split())
#: Macros without arguments of the standard headers.
_C_MACROS = re.compile(
    r"NULL|EOF|WEOF|NAN|INFINITY|HUGE(_VAL[FL]?)?|MAXFLOAT|DECIMAL_DIG|BUFSIZ|L_tmpnam|RAND_MAX|TMP_MAX|TIME_UTC"
    r"|CLOCKS_PER_SEC|MB_(CUR|LEN)_MAX|F(ILENAME|OPEN)_MAX|DOMAIN|SING|OVERFLOW|UNDERFLOW|[PT]LOSS|X_TLOSS"
    r"|M_(E|PI(_[24])?|[12]_PI|2_SQRTPI|LN2|LN10|LOG2E|LOG10E|SQRT2|SQRT1_2)[fl]?"
    r"|E(2BIG|[A-Z][A-Z0-9]{2,})|SIG[A-Z0-9_]{2,}"
    r"|(U?INT(MAX|PTR|(_LEAST|_FAST)?\d+)?|FLT|L?DBL|[SU]?CHAR|U?SHRT|U?L?LONG|WCHAR|WINT|S?SIZE|PTRDIFF|SIG_ATOMIC|FP|FE|LC"
    r"|EXIT|SEEK|MATH|SA)_[A-Z0-9_]+|(PRI|SCN)[diouxX](LEAST|FAST)?(\d+|MAX|PTR)"
)
_P = TypeVar("_P", Program, FixedProgram)

#: A letter that no name has: admission lets letters of ASCII alone in.
_MARK = "ж"
#: Most names that are tried in place of one that is not free.
_MOST_TRIED = 1000
_IDENTIFIER = re.compile(rf"(?<![\w.])[A-Za-z_{_MARK}]\w*")


@dataclass(frozen=True)
class Language:
    r"""The rules of a language for names, by which `strapgen.targets.names.printed` changes those that collide.

    Parameters
    ----------
    allows : callable
        ``allows(name)`` returns whether an identifier can name a quantity: False for words that the language reserves.
    scopes : callable
        ``scopes(texts)`` returns the identifiers of each scope of some files, a list of sets; those that stand in one
        scope have to differ. Names are tried as marks with letters beyond ASCII, which count as letters of identifiers.
    most : int, optional
        Characters of a value's name above which words in it are abbreviated.

    Raises
    ------
    InputTypeError
        If a rule is no function, or `most` no count.

    Examples
    --------
    >>> import re
    >>> shell = Language(lambda name: name not in {"fi", "done"}, lambda texts: [{*re.findall(r"\w+", *texts)}])
    >>> shell.allows("done"), sorted(*shell.scopes(["a = b"]))
    (False, ['a', 'b'])
    """

    allows: Callable[[str], bool]
    scopes: Callable[[Iterable[str]], list[set[str]]]
    most: int | None = None

    def __repr__(self) -> str:
        return f"<Language of {getattr(self.allows, '__module__', 'no module')}>"

    def __post_init__(self) -> None:
        for name in ("allows", "scopes"):
            if not callable(getattr(self, name)):
                found = checks.describe(getattr(self, name))
                raise InputTypeError(f"{name} of a Language is {found}; a function is needed")
        if self.most is not None:
            checks.count("most of a Language", self.most)

    def identifiers(self, texts: Mapping[str, str]) -> list[set[str]]:
        """Return the identifiers of each scope of some files."""
        found = self.scopes(texts.values())
        if not isinstance(found, list) or not all(isinstance(scope, set) for scope in found):
            raise InputTypeError(
                f"scopes of {self!r} returned {checks.describe(found)}; a list of sets is needed"
            )
        return found


def _c_allows(name: str) -> bool:
    reserved = re.match(r"_[A-Z_]", name)
    macro = _C_MACROS.fullmatch(name) and not name.endswith("_")
    return not (reserved or macro or name in _C_WORDS)


def _c_scopes(texts: Iterable[str]) -> list[set[str]]:
    """Return the identifiers of each declaration and function; every one includes the macros of the code."""
    macros: set[str] = set()
    scopes: list[set[str]] = [set()]
    for text in texts:
        macros.update(re.findall(r"^#define (\w+)", text, flags=re.MULTILINE))
        plain = re.sub(r"/\*.*?\*/|^ *#.*?$|^extern \"C\" \{$", " ", text, flags=re.DOTALL | re.MULTILINE)
        depth = 0
        for token in re.findall(rf"[{{}};]|{_IDENTIFIER.pattern}", plain):
            if token in "{}":
                depth = max(0, depth + (1 if token == "{" else -1))
            if token in "};" and not depth:
                scopes.append(set())
            elif token not in "{};":
                scopes[-1].add(token)
    return [scope | macros for scope in scopes if scope]


def _python_allows(name: str) -> bool:
    return not (keyword.iskeyword(name) or (name.startswith("__") and name.endswith("__")))


def _python_scopes(texts: Iterable[str]) -> list[set[str]]:
    """Return the names that the modules use, then those of each function."""
    module: set[str] = set()
    scopes: list[set[str]] = [module]

    def read(table: symtable.SymbolTable) -> set[str]:
        used = set(table.get_identifiers())
        module.update(symbol.get_name() for symbol in table.get_symbols() if symbol.is_global())
        return used.union(*(read(child) for child in table.get_children()))

    for text in texts:
        table = symtable.symtable(text, "generated", "exec")
        module.update(table.get_identifiers())
        module.update(re.findall(r"^(?:import|from) (\w+)", text, flags=re.MULTILINE))
        scopes += [read(child) for child in table.get_children()]
    return scopes


#: Abbreviations of words that lowering puts into the names of parts of a value.
_PARTS = {
    "principal_principal": "principal",
    "denominator": "den",
    "numerator": "num",
    "arctangent": "atan",
    "argument": "arg",
    "radicand": "rad",
    "principal": "wrap",
    "negative": "neg",
    "quadrant": "quad",
    "quotient": "quot",
    "series": "ser",
    "choice": "sel",
    "largest": "max",
    "heading": "hdg",
    "factor": "fac",
}
#: C tells names inside a file apart by 63 characters, but readers by fewer; what prints may put four behind a name.
C = Language(_c_allows, _c_scopes, most=27)
PYTHON = Language(_python_allows, _python_scopes)


#: Most characters of a kernel's name in C. C99 tells external names apart by 31 characters, and those of one kernel,
#: such as ``<name>_float`` and ``<name>_float_array``, differ by then.
_MOST = 23
#: Most characters of a function's name that a user chooses: four more tell the static functions of its file apart.
MOST_CHOSEN = 27
#: What C writes in longer names of the catalogue, a word after the other until the name is short enough.
_SHORT = {
    "orthonormalize": "orth",
    "normalize": "norm",
    "navigation": "nav",
    "continuous": "cont",
    "cayley_klein": "ck",
}


def _replace(name: str, word: str, other: str) -> str:
    """Return a name with another word in place of each that is the same."""
    return re.sub(rf"(?<![a-z]){word}(?![a-z])", other, name)


def _mark(name: str) -> str:
    """Mark the short words of a name that is long enough with long words in their place."""
    longest = marked = name
    for word, short in _SHORT.items():
        longest, marked = _replace(longest, short, word), _replace(marked, short, f"{short}_Kernel")
    return marked if len(longest) > _MOST else name


def external(name: str, ending: str = "") -> str:
    """Return the name of a kernel's function in C: shortened if too long, changed if a library or a keyword has it.

    A name that has a short word itself, and could be what a longer name is shortened to, is marked.

    >>> external("euler_rk4_2"), external("hypot"), external("dcm_orthonormalize_optimal", "_float")
    ('euler_rk4_2', 'hypot_Kernel', 'dcm_orth_optimal_float')
    >>> external("dcm_orth_optimal"), external("mrp_norm")
    ('dcm_orth_Kernel_optimal', 'mrp_norm')
    """
    name = _mark(name)
    for word, short in _SHORT.items():
        if len(name) > _MOST:
            name = _replace(name, word, short)
    name += ending
    return name if _is_free(name) else f"{name}_Kernel"  # a capital letter stands in no other kernel's name


def _is_free(name: str) -> bool:
    """Return whether neither C, C++ nor the C library has a name."""
    return _c_allows(name) and name not in LIBRARY and not name.endswith("_t")


def can_be_chosen(name: str) -> bool:
    """Return whether a function in C can have a name that a user chooses."""
    return len(name) <= MOST_CHOSEN and _is_free(name)


def function_name(program: Program, ending: str = "") -> str:
    """Return the name of a program's function in C: that chosen by the user, or else `external`."""
    default = external(program.name, ending)
    return program.chosen_name.format(default) if program.chosen_name else default


def printed(
    program: _P,
    text: Callable[[_P, Mapping[str, str]], dict[str, str]],
    language: Language,
    joined: Iterable[str] = (),
) -> tuple[_P, dict[str, str]]:
    """Print a program with names that collide neither with the language nor with the template.

    `text` prints the files of a renamed program; it gets the kernel's name of every changed one. Signals that are
    `joined` have one name with their only element.
    """
    if not isinstance(language, Language):
        raise InputTypeError(f"printed takes a strapgen.Language, not {checks.describe(language)}")
    names = keys(program, frozenset(joined))
    marks = {key: f"{_MARK}{number}{_MARK}" for number, key in enumerate(names)}
    marked = text(renamed(program, marks, joined), {})
    if not isinstance(marked, Mapping):
        raise InputTypeError(
            f"what prints a program returned {checks.describe(marked)}; texts by file name are needed"
        )
    scopes = language.identifiers(marked)
    if not any(_MARK in name for scope in scopes for name in scope):
        raise InputError(
            f"scopes of {language!r} finds no name of the program in {', '.join(marked)}; "
            "identifiers whose letters may be beyond ASCII are needed"
        )
    chosen = _choose(marks, language, scopes)
    result = renamed(program, chosen, joined)
    return result, text(result, {new: key.name for key, new in chosen.items() if new != key.name})


def _choose(marks: Mapping[Key, str], language: Language, scopes: list[set[str]]) -> dict[Key, str]:
    """Return a name for every mark: that of the kernel if it is free, otherwise a similar one."""
    reserved = [{name for name in scope if _MARK not in name} for scope in scopes]
    places: dict[str, list[tuple[str, set[str]]]] = {mark: [] for mark in marks.values()}
    for scope, names in zip(scopes, reserved, strict=True):
        for token in sorted(name for name in scope if _MARK in name):
            (mark,) = re.findall(rf"{_MARK}\d+{_MARK}", token)
            places[mark].append((token, names))
    chosen: dict[Key, str] = {}

    def settle(key: Key, name: str) -> bool:
        mark = marks[key]
        finals = [(token.replace(mark, name), names) for token, names in places[mark]]
        if any(final in names or not language.allows(final) for final, names in finals):
            return False
        for final, names in finals:
            names.add(final)
        chosen[key] = name
        return True

    waiting = [key for key in marks if not settle(key, _abbreviate(key, language.most))]
    for key in waiting:
        if not any(settle(key, name) for name in islice(_alike(key), _MOST_TRIED)):
            raise InputError(
                f"allows of {language!r} takes neither {key.name} nor a name like {next(_alike(key))}; "
                "False is for the words that a language reserves"
            )
    return chosen


def _abbreviate(key: Key, most: int | None) -> str:
    """Return the name of a value with abbreviated words, as many as it takes."""
    name = key.name
    for word, short in _PARTS.items():
        if most is None or key.kind != "value" or len(name) <= most:
            break
        name = _replace(name, word, short)
    return name


def _alike(key: Key) -> Iterator[str]:
    """Yield names that are similar to one that is not free."""
    if key.kind == "function":
        yield f"{key.name}_Kernel"
    base = key.name.lstrip("_") or "value"
    yield f"{base}_"
    yield from (f"{base}_v{number}" for number in count(2))  # no macro has small letters there


class Key(NamedTuple):
    """A named part of a program, of kind "function", "signal", "value" or "residual" (an error feedback)."""

    kind: str
    name: str


def keys(program: Program | FixedProgram, joined: Iterable[str] = ()) -> list[Key]:
    """Return the named parts of a program, each once: the function, signals but those joined to an element, values."""
    plain = program if isinstance(program, Program) else program.program
    signals = [*plain.inputs, *(result.signal for result in plain.results)]
    names = [Key("function", plain.name)]
    names += [Key("signal", signal.name) for signal in signals if signal.name not in joined]
    names += [Key("value", name) for signal in signals for name in signal.elements]
    if isinstance(program, Program):
        names += [Key("value", assignment.name) for assignment in program.body]
    else:
        names += [Key("value", value.name) for value in program.body]
        names += [Key("residual", feedback.name) for feedback in program.interface.residuals]
    return list(dict.fromkeys(names))


def renamed(program: _P, names: Mapping[Key, str], joined: Iterable[str] = ()) -> _P:
    """Return a program with other names; a part that has none keeps its own."""
    work = _Renaming(names, frozenset(joined))
    return work.program(program) if isinstance(program, Program) else work.fixed(program)


class _Renaming:
    """The new names, and a method that renames each kind of part."""

    def __init__(self, names: Mapping[Key, str], joined: frozenset[str]) -> None:
        self.names, self.joined = names, joined

    def value(self, name: str) -> str:
        return self.names.get(Key("value", name), name)

    def signal(self, signal: Signal) -> Signal:
        if signal.name in self.joined:
            name = self.value(*signal.elements)
        else:
            name = self.names.get(Key("signal", signal.name), signal.name)
        return replace(signal, name=name, elements=tuple(map(self.value, signal.elements)))

    # Programs

    def node(self, node: Node) -> Node:
        if isinstance(node, Reference):
            return Reference(self.value(node.name))
        if isinstance(node, Operation):
            return Operation(node.kind, tuple(map(self.node, node.arguments)))
        return node

    def result(self, result: Result) -> Result:
        return Result(self.signal(result.signal), tuple(map(self.node, result.nodes)))

    def program(self, program: Program) -> Program:
        return replace(
            program,
            name=self.names.get(Key("function", program.name), program.name),
            inputs=tuple(map(self.signal, program.inputs)),
            body=tuple(replace(a, name=self.value(a.name), value=self.node(a.value)) for a in program.body),
            outputs=tuple(map(self.result, program.outputs)),
            transition=program.transition and self.result(program.transition),
        )

    # Programs on integers: their interface and body say all that is printed

    def fixed(self, fixed: FixedProgram) -> FixedProgram:
        interface = fixed.interface
        return replace(
            fixed,
            program=replace(
                fixed.program,
                name=self.names.get(Key("function", fixed.program.name), fixed.program.name),
            ),
            interface=self.interface(interface),
            body=tuple(map(self.fixed_value, fixed.body)),
        )

    def interface(self, interface: Interface) -> Interface:
        return replace(
            interface,
            inputs=tuple(map(self.argument, interface.inputs)),
            outputs=tuple(map(self.argument, interface.outputs)),
            residuals=tuple(map(self.feedback, interface.residuals)),
        )

    def argument(self, argument: Argument) -> Argument:
        values = tuple(map(self.value, argument.values))
        return replace(argument, signal=self.signal(argument.signal), values=values)

    def feedback(self, feedback: ErrorFeedback) -> ErrorFeedback:
        return replace(feedback, name=self.names.get(Key("residual", feedback.name), feedback.name))

    def fixed_value(self, value: Value) -> Value:
        return replace(value, name=self.value(value.name), definition=self.definition(value.definition))

    def definition(
        self, definition: IntegerSum | IntegerOperation | None
    ) -> IntegerSum | IntegerOperation | None:
        match definition:
            case IntegerSum(residual=feedback):
                return replace(
                    definition,
                    fine=tuple(map(self.term, definition.fine)),
                    coarse=tuple(map(self.term, definition.coarse)),
                    residual=feedback and self.feedback(feedback),
                )
            case IntegerOperation(kind, arguments):
                return IntegerOperation(kind, tuple(map(self.scaled, arguments)))
        return None

    def term(self, term: Term) -> Term:
        return replace(term, names=tuple(map(self.value, term.names)))

    def scaled(self, scaled: Scaled) -> Scaled:
        return replace(scaled, value=self.value(scaled.value)) if isinstance(scaled.value, str) else scaled
