"""Reads generated C as a syntax tree, after the preprocessor and without any compiler's extensions."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping, Sequence
from functools import cached_property

from pycparser import c_ast, c_parser

from strapgen.storage.drafts import temporary_folder

_BITS = (8, 16, 32, 64)
_STDINT = "\n".join(
    [
        *(f"typedef int int{n}_t;\ntypedef unsigned int uint{n}_t;" for n in _BITS),
        *(f"#define INT{n}_C(x) ((int{n}_t)(x))\n#define UINT{n}_C(x) ((uint{n}_t)(x##u))" for n in _BITS),
        *(f"#define INT{n}_MAX ((int{n}_t){(1 << (n - 1)) - 1})" for n in _BITS),
        *(f"#define INT{n}_MIN ((int{n}_t)(-{(1 << (n - 1)) - 1} - 1))" for n in _BITS),
        *(f"#define UINT{n}_MAX ((uint{n}_t){(1 << n) - 1}u)" for n in _BITS),
        "",
    ]
)
# Types of 128 bits are a compiler's own; `c_types` knows them by the names that a file gives to them.
_EXTENSIONS = (
    "-D__SIZEOF_INT128__=16",
    "-D__extension__=",
    "-D__int128=long long int",
    "-D__attribute__(x)=",
)


class ParsedSource:
    """A C source file as a syntax tree."""

    def __init__(self, files: Mapping[str, str], source: str, defined: Sequence[str] = ()) -> None:
        self._files, self._source, self._defined = files, source, defined

    @cached_property
    def functions(self) -> dict[str, c_ast.FuncDef]:
        """The functions that the file defines, by name."""
        tree = c_parser.CParser().parse(self._preprocessed())
        return {node.decl.name: node for node in tree.ext if isinstance(node, c_ast.FuncDef)}

    def _preprocessed(self) -> str:
        with temporary_folder() as folder:
            for file, text in {**self._files, "stdint.h": _STDINT, "stddef.h": ""}.items():
                (folder / file).write_text(text)
            macros = [f"-D{macro}=1" for macro in self._defined]
            command = ["cc", "-E", "-P", "-undef", "-nostdinc", "-I.", *_EXTENSIONS, *macros, self._source]
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
        return done.stdout
