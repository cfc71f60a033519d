"""Functions of users in Rust with the interface of C: compiled into a static library, and declared in a header."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from strapgen.firmware.check_code.bridge import ForeignSource, read_source
from strapgen.ir.checks import did_you_mean
from strapgen.ir.exceptions import CompilerError, InputError
from strapgen.run import compiler
from strapgen.storage import cache

#: Types of Rust in C.
_TYPES = {
    "f64": "double",
    "f32": "float",
    "bool": "bool",
    "usize": "size_t",
    **{f"{sign}{bits}": f"{'u' * (sign == 'u')}int{bits}_t" for sign in "iu" for bits in (8, 16, 32, 64)},
}
_FLAGS = (
    *("--edition=2021", "--crate-type=staticlib", "-Cpanic=abort", "-Copt-level=1"),
    *("-Crelocation-model=pic", "--crate-name=strapgen_foreign", "--cap-lints=allow"),
)
_FUNCTION = re.compile(r'extern\s+"C"\s+fn\s+(\w+)\s*\(([^)]*)\)\s*(?:->\s*([^{]+?)\s*)?\{')
_STRUCT = re.compile(r"#\[repr\(C\)\][^{;]*?struct\s+(\w+)\s*\{([^}]*)\}")


def rust_source(path: Path, function: str, *how: Any, **more: Any) -> ForeignSource:
    """Compile a file in Rust, and read how its function is called, as `read_source` does of C."""
    if not path.is_file():
        raise InputError(f"{path} is no file")
    text = re.sub(
        r"//[^\n]*|/\*.*?\*/", "", path.read_text(encoding="utf-8", errors="replace"), flags=re.DOTALL
    )
    functions = {found[1]: found for found in _FUNCTION.finditer(text)}
    if function not in functions:
        guess = did_you_mean("function", function, functions)
        raise InputError(
            f'--function: {path} has no extern "C" fn {function}{guess}; it has {", ".join(functions) or "none"}'
        )
    structs = {found[1]: found[2] for found in _STRUCT.finditer(text)}
    lines = ["#include <stdbool.h>", "#include <stddef.h>", "#include <stdint.h>"]
    for name, fields in structs.items():
        inside = " ".join(f"{each};" for each in _declared(path, fields.replace("pub ", ""), structs))
        lines.append(f"typedef struct {{ {inside} }} {name};")
    wanted = (function, how[1].partition("(")[0] if len(how) > 1 else "")
    for name in filter(functions.__contains__, wanted):
        found = functions[name]
        returns = _declaration(path, "", found[3], structs) if found[3] else "void"
        lines.append(f"{returns} {name}({', '.join(_declared(path, found[2], structs)) or 'void'});")
    header = "\n".join([*lines, ""])
    command = [*compiler.COMPILERS["Rust"].command(), *_FLAGS]
    files = [each.read_bytes() for each in sorted(path.parent.glob("**/*.rs"))]
    key = cache.digest([header, repr(path.resolve()), *map(repr, files), *command])

    def fill(draft: Path) -> None:
        (draft / "function.h").write_text(header, encoding="utf-8", newline="\n")
        words = [*command, "-o", str(draft / "libfunction.a"), str(path.resolve())]
        done = subprocess.run(words, capture_output=True, text=True, errors="replace", check=False)
        if done.returncode:
            said = [line.strip() for line in done.stderr.splitlines()]
            at = next((line.removeprefix("--> ") for line in said if line.startswith("-->")), str(path))
            errors = [line for line in said if line.startswith("error")] or said[-1:]
            raise CompilerError(f"{path} does not compile: {errors[0]} ({Path(at).name})")

    built = cache.entry("builds", key, fill, f"compiled {function}")
    source = read_source(built / "function.h", function, *how, **more)
    # A name that the C library has too must be that of the file.
    begin, first = ("_", ()) if sys.platform == "darwin" else ("", ("-Wl,-Bsymbolic",))
    linked = (
        *first,
        *(f"-Wl,-u,{begin}{name}" for name in wanted if name in functions),
        str(built / "libfunction.a"),
    )
    return replace(source, origin=path, libraries=linked)


def _declared(path: Path, text: str, structs: Any) -> list[str]:
    """Return the declarations in C of "name: type, ..." of Rust."""
    parts = [part.strip() for part in re.split(r",(?![^\[]*\])", text) if part.strip()]
    declared = []
    for part in parts:
        name, _, kind = part.removeprefix("mut ").partition(":")
        declared.append(_declaration(path, name.strip(), kind, structs))
    return declared


def _declaration(path: Path, name: str, kind: str, structs: Any) -> str:
    """Return the declaration in C of a name with a type of Rust."""
    kind = kind.strip()
    pointer = re.fullmatch(r"(?:&\s*(mut)?|\*\s*(mut|const))\s*(.*)", kind, flags=re.DOTALL)
    constant = "const " if pointer and "mut" not in pointer.groups() else ""
    inner, lengths = (pointer[3] if pointer else kind).strip(), ""
    while array := re.fullmatch(r"\[\s*(.*?)\s*;\s*(\d+)\s*\]", inner, flags=re.DOTALL):
        inner, lengths = array[1], f"{lengths}[{array[2]}]"
    known = _TYPES.get(inner) or (inner if inner in structs else None)
    if known is None:
        allowed = ", ".join([*_TYPES, *structs])
        raise InputError(
            f"{path}: {name or 'result'} has the type {kind}; allowed: {allowed}, their arrays and pointers"
        )
    star = "*" if pointer and not lengths else ""
    return f"{constant}{known} {star}{name}{lengths}".strip()
