"""Builds generated C++ and Rust as shared libraries that Python calls as it calls C: each brings a C interface.

A library of the cache has the declarations of its functions beside it, in C, which cffi reads when it is opened. No C
compiler and no header of Python is needed.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from strapgen.ir.exceptions import CompilerError
from strapgen.ir.sources import Sources
from strapgen.storage import cache

#: The file beside a library with the declarations of its functions.
DECLARATIONS = "declarations.h"
#: How far the compilers optimize, by language; tests that are not about optimization compile with less of it.
OPTIMIZATION = {"C++": "-O3", "Rust": "-Copt-level=3"}
#: The root of a library in Rust. Generated code never panics: the handler is there because the language needs one.
_CRATE = """#![no_std]
#[panic_handler]
fn panicked(_: &core::panic::PanicInfo) -> ! {
    loop {}
}
#[no_mangle]
pub extern "C" fn rust_eh_personality() {}
"""


@dataclass(frozen=True)
class LibraryCompiler:
    """A compiler of shared libraries.

    Parameters
    ----------
    language : str
        Language of the sources, as targets name it.
    variable : str
        Environment variable with its command.
    default : str
        The command where the variable is not set.
    package : str
        What a user installs where there is none.
    flags : tuple of str
        Flags of a shared library that computes the bits of the C.
    ending : str
        Ending of the files.
    """

    language: str
    variable: str
    default: str
    package: str
    flags: tuple[str, ...]
    ending: str

    @property
    def chosen(self) -> str:
        """The command of the environment variable; "" if it is not set."""
        return os.environ.get(self.variable, "").strip()

    def path(self) -> str:
        """Return the path of the compiler.

        Raises
        ------
        CompilerError
            If there is no such program.
        """
        program = self._words()[0]
        path = shutil.which(program)
        if path is None:
            raise CompilerError(
                f"no {self.language} compiler: {program!r} is not on the PATH; install {self.package} (or set "
                f"{self.variable}), or use the numpy back end"
            )
        return path

    def _words(self) -> list[str]:
        text = self.chosen or self.default
        try:
            return shlex.split(text)
        except ValueError:  # a quotation mark that is not closed
            return [text]

    def identity(self) -> list[str]:
        """Return what a build depends on beside its sources: the compiler, its flags and the machine."""
        executable = Path(self.path()).resolve()
        stat = executable.stat()
        machine = os.uname().machine if hasattr(os, "uname") else ""
        chosen = [*self._words(), f"{executable} {stat.st_size} {stat.st_mtime_ns}", machine]
        return [self.language, OPTIMIZATION[self.language], *self.flags, _CRATE, *chosen]

    def build(self, many: Sequence[Sources], library: Path) -> None:
        """Compile sources into one shared library in a folder, with the declarations of its functions.

        Parameters
        ----------
        many : sequence of Sources
            No two have a file of the same name.
        library : Path
            The library; nothing else than it and its declarations is left in its folder.

        Raises
        ------
        CompilerError
            If there is no compiler, or it fails.
        """
        folder, files = library.parent, {f: text for sources in many for f, text in sources.files.items()}
        for file, text in files.items():
            (folder / file).write_text(text)
        parts = [file for file in files if file.endswith(self.ending)]
        root = folder / f"root{self.ending}"
        root.write_text("".join(_parts_of(self.language, parts)))
        command = [self.path(), *self._words()[1:], OPTIMIZATION[self.language], *self.flags]
        run = subprocess.run(
            [*command, "-o", library.name, root.name],
            cwd=folder,
            env=os.environ | {"LC_ALL": "C"},
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
        )
        if run.returncode or not library.is_file():
            said = [line.strip() for line in run.stderr.splitlines()]
            reasons = [line for line in said if "error" in line.lower()] or said[-1:] or ["no output file"]
            kernels = ", ".join(sources.kernel for sources in many)
            raise CompilerError(f"{command[0]} failed on {kernels}: {reasons[0]}")
        headers = [file for file in files if file.endswith(".h")]
        (folder / DECLARATIONS).write_text("\n".join(declarations(files[header]) for header in headers))
        for path in folder.iterdir():
            if path.name not in (library.name, DECLARATIONS):
                path.unlink()


def _parts_of(language: str, files: Sequence[str]) -> list[str]:
    """Return the lines of the file that a compiler reads: one translation unit, or one crate, of all files."""
    if language == "C++":
        return [f'#include "{file}"\n' for file in files]
    return [_CRATE, *(f"pub mod {Path(file).stem};\n" for file in files)]


#: The compilers of shared libraries by language.
COMPILERS = {
    entry.language: entry
    for entry in (
        LibraryCompiler(
            "C++",
            "CXX",
            "c++",
            "g++",
            ("-std=c++17", "-ffp-contract=off", "-g0", "-fPIC", "-shared", "-fvisibility-inlines-hidden"),
            ".cpp",
        ),
        LibraryCompiler(
            "Rust",
            "RUSTC",
            "rustc",
            "rustc",
            ("--edition=2021", "--crate-type=cdylib", "--crate-name=strapgen", "-Cpanic=abort"),
            ".rs",
        ),
    )
}


@dataclass(frozen=True)
class Library:
    """An opened library: cffi's view of its declarations, and its functions."""

    ffi: Any
    lib: Any


def is_library(file: Path) -> bool:
    """Return whether a compiled module of the cache is a shared library with declarations beside it."""
    return (file.parent / DECLARATIONS).is_file()


def opened(file: Path) -> Library:
    """Open a library of the cache: the very file of which it was checked that it is the user's alone."""
    from cffi import FFI

    ffi = FFI()
    ffi.cdef(cache.read(file.parent, DECLARATIONS).decode())
    with cache.loadable(file) as (path, _):
        return Library(ffi, ffi.dlopen(path))


def declarations(header: str) -> str:
    """Return the declarations of a generated header, without its preprocessor lines."""
    text = re.sub(r"^#(?:.*\\\n)*.*$", "", header, flags=re.MULTILINE).replace('extern "C" {', "")
    head, _, tail = text.rpartition("}")
    return head + tail
