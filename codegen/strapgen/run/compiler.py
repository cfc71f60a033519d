"""Building turns source text into a module that can be called.

Python code is executed as it is. C is compiled with the wrapper that cffi writes in API mode; C++ and Rust, which bring
a C interface, into shared libraries with the declarations of their functions beside them. All are cached by content, so
that a second call compiles nothing. Many sources can be compiled into one module, which costs little more than one of
them: starting the compiler, reading Python's headers and linking take longer than a kernel.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

from strapgen.ir.exceptions import CompilerError, InputError
from strapgen.ir.sources import Sources
from strapgen.ir.timing import timed
from strapgen.ir.version import VERSION
from strapgen.storage import cache
from strapgen.targets import TARGETS

#: How far the compilers optimize, by language; tests that are not about optimization compile with less of it.
OPTIMIZATION = {"C": "-O3", "C++": "-O3", "Rust": "-Copt-level=3"}
#: Without contraction to fused multiply-add every machine computes the same bits.
C_FLAGS = ("-std=c99", OPTIMIZATION["C"], "-ffp-contract=off", "-g0")
#: Text after the headers. The wrappers of cffi only pass arguments on and are not worth optimizing.
_UNOPTIMIZED = '\n#if defined(__GNUC__) && !defined(__clang__)\n#pragma GCC optimize ("O0")\n#endif\n'
#: The root of a library in Rust. Generated code never panics: the handler is there because the language needs one.
_CRATE = """#![no_std]
#[panic_handler]
fn panicked(_: &core::panic::PanicInfo) -> ! {
    loop {}
}
#[no_mangle]
pub extern "C" fn rust_eh_personality() {}
"""
#: Kind of cache entry that says in which module of many a source was compiled, its file, and that beside a library.
_SHARED, _POINTER, _DECLARATIONS = "shared", "build", "declarations.h"
#: What compiled modules begin with: ELF, Mach-O of one and of several processors, and PE.
_LIBRARIES = (b"\x7fELF", b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe", b"MZ")

#: MSVC, and Clang in its place: what they are called.
_MSVC = ("cl", "clang-cl")
_ON_WINDOWS = sys.platform == "win32"
#: Windows loads every code anywhere; Clang refuses the option there.
_ANYWHERE = () if _ON_WINDOWS else ("-fPIC",)

_loaded: dict[str, Any] = {}
_modules: dict[Path, Any] = {}


def program_command(what: str, variable: str, default: str, package: str) -> list[str]:
    """Return the path and the options of a program, which a variable of the environment may name."""
    text = os.environ.get(variable, "").strip() or default
    try:
        # A path of Windows has backslashes, which are no quotation marks.
        program, *options = [text] if shutil.which(text) else shlex.split(text)
    except ValueError:  # a quotation mark that is not closed
        program, options = text, []
    path = shutil.which(program)
    if path is None:
        raise CompilerError(
            f"no {what}: {program!r} is not on the PATH; install {package} (or set {variable}), or use the numpy "
            "back end"
        )
    return [str(Path(path).absolute()), *options]


@dataclass(frozen=True)
class Compiler:
    """A compiler of one language: the variable with its command, the command without one, and what to install."""

    language: str
    variable: str
    default: str
    package: str
    flags: tuple[str, ...]
    ending: str  # of its files

    def command(self) -> list[str]:
        """Return the path of the compiler and its own options."""
        # MSVC is looked for where there is no other compiler, and told by its name.
        names = (self.default, *_MSVC) if self.language in ("C", "C++") else (self.default,)
        default = next(filter(shutil.which, names), self.default)
        words = program_command(f"{self.language} compiler", self.variable, default, self.package)
        if Path(words[0]).stem.lower() in _MSVC:
            raise CompilerError(
                f"{words[0]} takes the options of MSVC; to run generated {self.language}, GCC or Clang is needed: "
                f"install {self.package} (or set {self.variable}), or use the numpy back end"
            )
        return words

    def path(self) -> str:
        """Return the path of the compiler."""
        return self.command()[0]

    def flags_in_effect(self) -> list[str]:
        """Return the flags of a library that computes the bits of the C."""
        return [OPTIMIZATION[self.language], *self.flags]

    def identity(self, flags: Sequence[str] | None = None) -> str:
        """Return the other inputs of a build beside its sources: compiler, flags, machine and Python."""
        import _cffi_backend

        path, *options = self.command()
        executable = Path(path).resolve()
        status, machine = (
            executable.stat(),
            (platform.machine(), sys.platform, sysconfig.get_config_var("SOABI")),
        )
        used = self.flags_in_effect() if flags is None else flags
        return repr(
            (
                executable,
                status.st_size,
                status.st_mtime_ns,
                options,
                used,
                machine,
                _cffi_backend.__version__,
            )
        )


#: A module calls its own functions, whatever others of the same names the process has.
C = Compiler(
    "C",
    "CC",
    "gcc" if _ON_WINDOWS else "cc",  # Windows has no name for whichever there is
    "gcc",
    ("-std=c99", "-ffp-contract=off", "-g0", *_ANYWHERE, "-fvisibility=hidden"),
    ".c",
)
_CPP = ("-std=c++14", "-ffp-contract=off", "-g0", *_ANYWHERE, "-shared", "-fvisibility-inlines-hidden")
_RUST = ("--edition=2021", "--crate-type=cdylib", "--crate-name=strapgen", "-Cpanic=abort")
#: The compilers of shared libraries by language.
COMPILERS = {
    "C++": Compiler("C++", "CXX", "g++" if _ON_WINDOWS else "c++", "g++", _CPP, ".cpp"),
    "Rust": Compiler("Rust", "RUSTC", "rustc", "rustc", _RUST, ".rs"),
}


def load(sources: Sources) -> Any:
    """Return the module through which a generated function is called.

    For Python it is the generated module; for compiled languages it has ``ffi`` and ``lib`` of cffi, which may hold
    other functions too.
    """
    key, language = (
        cache.digest([sources.target, *sources.files, *sources.files.values()]),
        _language(sources),
    )
    if key not in _loaded:
        with timed("build", f"{sources.kernel} for {sources.target}"):
            if _compiler_of(sources):
                _loaded[key] = _compile_module(sources)
            elif language == "Python":
                _loaded[key] = _import_text(sources)
            else:
                raise InputError(
                    f"sources of {sources.kernel} for {sources.target} are {language or 'of no stated language'}; "
                    "C, C++ and Rust can be compiled, and Python imported"
                )
    return _loaded[key]


def compile_together(many: Iterable[Sources]) -> None:
    """Compile sources that are not in the cache into as few modules as names allow, for `load`.

    Parameters
    ----------
    many : iterable of Sources
        Of any target; Python needs no compiling. Two functions of one name go into two modules.

    Raises
    ------
    CompilerError
        If there is no C compiler, or it fails.

    Examples
    --------
    >>> from strapgen import algorithm, build
    >>> many = [algorithm(name, "rk2").generate("c") for name in ("euler", "dcm")]
    >>> compile_together(many)
    >>> [build(sources).name for sources in many]
    ['c', 'c']
    """
    # Of one language each, in which no file has its name twice: so often has a file had its name before.
    groups: dict[tuple[str, int], dict[str, Sources]] = {}
    last: dict[str, int] = {}
    for key, sources in {build_key([sources]): sources for sources in many if _compiler_of(sources)}.items():
        if not _shared(key) and not cache.lookup("builds", key):
            turn = max(last.get(file, -1) for file in sources.files) + 1
            last.update(dict.fromkeys(sources.files, turn))
            groups.setdefault((_language(sources), turn), {})[key] = sources
    for group in groups.values():
        (key, sources), *others = group.items()
        if not others:  # as `load` compiles it, which finds it without a pointer
            _alone(sources, key)
            continue
        together = build_key(group.values())
        _build([*group.values()], f"strapgen_{together}", together)
        for key in group:
            cache.entry(_SHARED, key, partial(_point, together))


def _point(together: str, draft: Path) -> None:
    (draft / _POINTER).write_text(together, encoding="utf-8", newline="\n")


def _language(sources: Sources) -> str:
    """Return the language of sources; "" for those of a back end that runs the program itself."""
    return TARGETS[sources.target].language if sources.target in TARGETS else ""


def _compiler_of(sources: Sources) -> Compiler | None:
    """Return the compiler of sources; None if they are not compiled."""
    language = _language(sources)
    return C if language == "C" else COMPILERS.get(language)


def _import_text(sources: Sources) -> ModuleType:
    (name, text), *_ = sources.files.items()
    module = ModuleType(name.removesuffix(".py"))
    exec(compile(text, f"<generated {name}>", "exec"), module.__dict__)
    return module


def _compile_module(sources: Sources) -> Any:
    key = build_key([sources])

    def module() -> Any:
        file = _shared(key) or _alone(sources, key)
        return _modules.get(file) or _modules.setdefault(file, _import_file(file))

    return cache.persistently(module)


def _shared(key: str) -> Path | None:
    """Return the module of many in which a source was compiled, if it is still there."""
    place = cache.lookup(_SHARED, key)
    if place is None:
        return None
    together = cache.read(place, _POINTER).decode()
    folder = cache.lookup("builds", together)
    return folder and folder / _library(f"strapgen_{together}")


def _alone(sources: Sources, key: str) -> Path:
    """Return the file of the module of one source, compiled if it is not in the cache."""
    name = f"strapgen_{sources.function.name}"
    return _build([sources], name, key) / _library(name)


def _library(name: str) -> str:
    """Return the file name of a compiled module."""
    return name + importlib.machinery.EXTENSION_SUFFIXES[0]


def _import_file(file: Path) -> Any:
    """Import a compiled module of the cache: the very file of which it was checked that it is the user's alone."""
    name = file.name.partition(".")[0]
    with cache.loadable(file) as (path, _):
        if (file.parent / _DECLARATIONS).is_file():
            from cffi import FFI

            ffi = FFI()
            ffi.cdef(cache.read(file.parent, _DECLARATIONS).decode())
            return SimpleNamespace(ffi=ffi, lib=ffi.dlopen(path))
        loader = importlib.machinery.ExtensionFileLoader(name, path)
        spec = importlib.util.spec_from_file_location(name, path, loader=loader)
        if spec is None:
            raise CompilerError(f"{file} cannot be loaded")
        module = importlib.util.module_from_spec(spec)
        loader.exec_module(module)
    module.__file__ = str(file)  # where a reader finds it
    return module


def build_key(many: Iterable[Sources], flags: Sequence[str] | None = None) -> str:
    """Return the key of a build: compiling with another compiler, or for another Python, makes another entry."""
    first, *_ = many = list(many)
    texts = [part for sources in many for part in (*sources.files, *sources.files.values())]
    return cache.digest([*texts, _UNOPTIMIZED, _CRATE, (_compiler_of(first) or C).identity(flags)])


def _build(many: Sequence[Sources], name: str, key: str) -> Path:
    """Return the folder of a compiled module."""
    chosen, kernels = _compiler_of(many[0]) or C, ", ".join(sources.kernel for sources in many)
    files = {file: text for sources in many for file, text in sources.files.items()}
    headers = [file for file in files if file.endswith(".h")]
    cdef = "\n".join(declarations(files[header]) for header in headers)

    def fill(draft: Path) -> None:
        with timed("compile", kernels):
            if chosen is C:
                included = "".join(f'#include "{header}"\n' for header in headers)
                reasons = compile_module(draft, name, files, cdef, included, chosen.flags_in_effect())
            else:
                (draft / _DECLARATIONS).write_text(cdef, encoding="utf-8", newline="\n")
                command = [*chosen.command(), *chosen.flags_in_effect()]
                reasons = _compile(command, files, chosen.ending, draft / _library(name))
            if reasons:
                raise CompilerError(
                    f"{chosen.path()} failed on {name if chosen is C else kernels}: {reasons[0]}"
                )

    return cache.entry("builds", key, fill, f"compiled {kernels}")


def compile_module(
    draft: Path,
    name: str,
    files: Mapping[str, str],
    cdef: str,
    header: str,
    flags: Sequence[str],
    of: Compiler = C,
) -> list[str]:
    """Compile files into a module of cffi, which alone is left in a folder; return the errors if there is none.

    `cdef` declares its functions, `header` is the text that its wrapper begins with.
    """
    from cffi import FFI

    ffi = FFI()
    ffi.cdef(cdef)
    ffi.set_source(name, header + _UNOPTIMIZED, compiler_verbose=0)
    command = [*of.command(), *flags, f"-I{sysconfig.get_path('include')}"]
    return _compile(command, files, of.ending, draft / _library(name), ffi)


def shared_library(name: str, files: Mapping[str, str]) -> bytes:
    """Return a shared library for this machine of files in C, which shows the symbols that they export."""
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder, f"{name}.so")
        reasons = _compile([*C.command(), *C.flags_in_effect(), "-shared"], files, C.ending, library)
        if reasons:
            raise CompilerError(f"{C.path()} failed on {name}: {reasons[0]}")
        return library.read_bytes()


def _linking() -> list[str]:
    """Return the options, after all files, that make a module for Python of what a compiler is given."""
    if not _ON_WINDOWS:
        return [*shlex.split(sysconfig.get_config_var("LDSHARED") or "cc -shared")[1:], "-lm"]
    # There a library has to name the one that has the symbols of Python.
    libraries = Path(sys.base_prefix, "libs")
    return ["-shared", f"-L{libraries}", f"-lpython{sys.version_info.major}{sys.version_info.minor}"]


def _compile(
    command: list[str], files: Mapping[str, str], ending: str, library: Path, wrapper: Any = None
) -> list[str]:
    """Compile files as one unit, so that loops can take steps in; return the errors if there is no library."""
    with tempfile.TemporaryDirectory(dir=library.parent) as folder:
        name, parts = library.name.partition(".")[0], [file for file in files if file.endswith(ending)]
        text = "".join(f'#include "{file}"\n' for file in parts)
        if ending == ".rs":
            text = _CRATE + "".join(f"pub mod {Path(file).stem};\n" for file in parts)
        for file, content in {**files, f"{name}_root{ending}": text}.items():
            Path(folder, file).write_text(content, encoding="utf-8", newline="\n")
        words = [*command, "-o", library.name, f"{name}_root{ending}"]
        if wrapper is not None:
            wrapper.emit_c_code(str(Path(folder, f"{name}_wrapper.c")))
            words += ["-x", "c", f"{name}_wrapper.c", "-x", "none", *_linking()]
        elif ending == C.ending:
            words.append("-lm")
        how: dict[str, Any] = {"capture_output": True, "text": True, "errors": "replace", "check": False}
        try:
            done = subprocess.run(words, cwd=folder, env=os.environ | {"LC_ALL": "C"}, **how)
        except OSError as error:
            return [str(error.strerror)]
        built = Path(folder, library.name)
        if done.returncode == 0 and built.is_file():
            if not built.read_bytes().startswith(_LIBRARIES):
                return ["it reports success and writes no library"]
            built.rename(library)
            return []
    said = [line.strip() for line in (done.stderr + done.stdout).splitlines() if line.strip()]
    status = f"exit status {done.returncode}" if done.returncode else "no output file"
    return [line for line in said if "error" in line.lower()] or said[-1:] or [status]


def declarations(header: str) -> str:
    """Return the declarations of a generated header, without its preprocessor lines."""
    text = re.sub(r"^#(?:.*\\\n)*.*$", "", header, flags=re.MULTILINE).replace('extern "C" {', "")
    head, _, tail = text.rpartition("}")
    return head + tail


_MISSING = "is not installed"
_SHAPES_OUTPUT = ("sympy", "numpy", "jinja2", "cffi", "typer", "rich")


def versions() -> dict[str, str]:
    """Return the versions of strapgen, Python, the packages that shape the output, and the C compiler, by name."""
    known = {"strapgen": VERSION, "python": platform.python_version()}
    for name in _SHAPES_OUTPUT:
        known[name] = _MISSING
        with suppress(PackageNotFoundError):
            known[name] = version(name)
    return known | {"C compiler": _compiler()}


def _compiler() -> str:
    """Return the version message of the compiler."""
    try:
        path = C.path()
    except CompilerError:
        return _MISSING
    said = subprocess.run([path, "--version"], capture_output=True, text=True, check=False).stdout
    return said.splitlines()[0] if said else path
