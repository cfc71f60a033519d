"""Building turns source text into a module that can be called.

Python code is executed as it is. C is compiled through cffi in API mode, C++ and Rust into shared libraries; all are
cached by content, so that a second call compiles nothing. Many sources can be compiled into one module, which costs
little more than one of them: starting the compiler, reading Python's headers and linking take longer than a kernel.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import json
import os
import platform
import re
import shlex
import shutil
import sys
import sysconfig
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

from strapgen.ir.exceptions import CompilerError, InputError
from strapgen.ir.sources import Sources
from strapgen.ir.timing import timed
from strapgen.run import shared_libraries
from strapgen.run.compiler_service import compiling_process, one_at_a_time
from strapgen.run.shared_libraries import COMPILERS, declarations
from strapgen.storage import cache
from strapgen.targets import TARGETS

#: Flags in addition to those of Python. Without contraction to fused multiply-add every machine computes the same bits.
#: Without notes for debuggers, which Python's flags switch on, compiling takes a tenth less time.
C_FLAGS = ("-std=c99", "-O3", "-ffp-contract=off", "-g0")

#: A module calls its own functions, whatever other functions of the same names the process has.
_VISIBILITY = "-fvisibility=hidden"
#: The flags in effect; tests that are not about optimization compile with less of it.
_flags: tuple[str, ...] = C_FLAGS
#: Text after the headers. The wrappers of cffi only pass arguments on and are not worth optimizing.
_UNOPTIMIZED = '#if defined(__GNUC__) && !defined(__clang__)\n#pragma GCC optimize ("O0")\n#endif\n'
#: Kind of cache entry that says in which module of many a source was compiled.
_SHARED = "shared"

_loaded: dict[str, Any] = {}
_modules: dict[Path, Any] = {}


def load(sources: Sources) -> Any:
    """Return the module through which a generated function is called.

    Parameters
    ----------
    sources : Sources

    Returns
    -------
    module
        For Python the generated module; for compiled languages a cffi module with ``ffi`` and ``lib``, which may hold
        other functions too.

    Raises
    ------
    CompilerError
        If there is no C compiler, or it fails.
    """
    key = cache.digest([sources.target, *sources.files, *sources.files.values()])
    if key not in _loaded:
        with timed("build", f"{sources.kernel} for {sources.target}"):
            _loaded[key] = _module(sources)
    return _loaded[key]


def compile_together(many: Iterable[Sources]) -> None:
    """Compile what is not in the cache yet into as few modules as names allow, for `load` to find.

    Parameters
    ----------
    many : iterable of Sources
        Of any target; Python needs no compiling. Two functions of one name go into two modules.

    Raises
    ------
    CompilerError
        If there is no C compiler, or it fails.
    """
    missing: dict[str, Sources] = {}
    for sources in many:
        if _is_compiled(sources):
            key = build_key([sources])
            if _shared(key) is None and cache.lookup("builds", key) is None:
                missing[key] = sources
    for group in _groups(missing):
        if len(group) == 1:  # as `load` compiles it, which finds it without a pointer
            for key, sources in group.items():
                _alone(sources, key)
            continue
        together = build_key(group.values())
        name = f"strapgen_{together}"
        folder = _build(list(group.values()), name, together)
        pointer = json.dumps({"name": name, "build": folder.name})
        for key in group:
            cache.entry(_SHARED, key, partial(_point, pointer))


def _point(pointer: str, draft: Path) -> None:
    (draft / "module.json").write_text(pointer)


def _groups(missing: dict[str, Sources]) -> list[dict[str, Sources]]:
    """Return sources by their keys, in groups of one language in which no file and no function has its name twice."""
    groups: list[dict[str, Sources]] = []
    for key, sources in missing.items():
        for group in groups:
            if all(
                _language(sources) == _language(other) and not sources.files.keys() & other.files.keys()
                for other in group.values()
            ):
                group[key] = sources
                break
        else:
            groups.append({key: sources})
    return groups


def _shared(key: str) -> Path | None:
    """Return the module of many in which a source was compiled, if it is still there."""
    place = cache.lookup(_SHARED, key)
    if place is None:
        return None
    module = json.loads(cache.read(place, "module.json"))
    folder = cache.lookup("builds", module["build"])
    return folder and folder / _library(module["name"])


def _language(sources: Sources) -> str:
    """Return the language of sources; "" for those of a back end that runs the program itself."""
    return TARGETS[sources.target].language if sources.target in TARGETS else ""


def _is_compiled(sources: Sources) -> bool:
    return _language(sources) in ("C", *COMPILERS)


def _module(sources: Sources) -> Any:
    """Compile or import sources by their language."""
    language = _language(sources)
    if _is_compiled(sources):
        return _compiled(sources)
    if language == "Python":
        return _import_text(sources)
    raise InputError(
        f"sources of {sources.kernel} for {sources.target} are {language or 'of no stated language'}; "
        "C, C++ and Rust can be compiled, and Python imported"
    )


def _import_text(sources: Sources) -> ModuleType:
    (name, text), *_ = sources.files.items()
    module = ModuleType(name.removesuffix(".py"))
    exec(compile(text, f"<generated {name}>", "exec"), module.__dict__)
    return module


def compiler() -> str:
    """Return the path of the C compiler: $CC, or `cc`.

    Raises
    ------
    CompilerError
        If there is no such program.
    """
    chosen = chosen_compiler() or "cc"
    try:
        command = shlex.split(chosen)[0]
    except ValueError:  # a quotation mark that is not closed
        command = chosen
    path = shutil.which(command)
    if path is None:
        raise CompilerError(
            f"no C compiler: {command!r} is not on the PATH; install gcc (or set CC), or use the numpy back end"
        )
    return path


def command() -> list[str]:
    """Return the words of the compiler's command, its own options included.

    Raises
    ------
    CompilerError
        If there is no such program.
    """
    return [compiler(), *shlex.split(chosen_compiler())[1:]]


def chosen_compiler() -> str:
    """Return the command of $CC; "" if it is not set."""
    return os.environ.get("CC", "").strip()


def _compiled(sources: Sources) -> Any:
    key = build_key([sources])

    def module() -> Any:
        file = _shared(key) or _alone(sources, key)
        return _modules.get(file) or _modules.setdefault(file, _import_file(file))

    return cache.persistently(module)


def _alone(sources: Sources, key: str) -> Path:
    """Return the file of the module of one source, compiled if it is not in the cache."""
    name = f"strapgen_{sources.function.name}"
    return _build([sources], name, key) / _library(name)


def _import_file(file: Path) -> Any:
    """Import a compiled module of the cache: the very file of which it was checked that it is the user's alone."""
    if shared_libraries.is_library(file):
        return shared_libraries.opened(file)
    name = file.name.partition(".")[0]
    with cache.loadable(file) as (path, _):
        loader = importlib.machinery.ExtensionFileLoader(name, path)
        spec = importlib.util.spec_from_file_location(name, path, loader=loader)
        if spec is None:
            raise CompilerError(f"{file} cannot be loaded")
        module = importlib.util.module_from_spec(spec)
        loader.exec_module(module)
    module.__file__ = str(file)  # where a reader finds it
    return module


#: What compiled modules begin with: ELF, Mach-O of one and of several processors, and PE.
_LIBRARIES = (b"\x7fELF", b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe", b"MZ")


def build_key(many: Iterable[Sources], flags: Sequence[str] | None = None) -> str:
    """Return the key of a build: compiling with another compiler, or for another Python, makes another entry."""
    many = list(many)
    text = [part for sources in many for part in (*sources.files, *sources.files.values())]
    if many and _language(many[0]) in COMPILERS:
        return cache.digest([*text, *COMPILERS[_language(many[0])].identity()])
    executable = Path(compiler()).resolve()
    stat = executable.stat()
    return cache.digest(
        [
            *text,
            *(_flags if flags is None else flags),
            _VISIBILITY,
            _UNOPTIMIZED,
            chosen_compiler(),
            f"{executable} {stat.st_size} {stat.st_mtime_ns}",
            f"{platform.machine()} {sys.platform} {sysconfig.get_config_var('SOABI')}",
            _cffi_version(),
        ]
    )


def _build(many: Sequence[Sources], name: str, key: str) -> Path:
    """Return the folder of a compiled module."""
    kernels = ", ".join(sources.kernel for sources in many)

    def fill(draft: Path) -> None:
        with timed("compile", kernels):
            if _language(many[0]) in COMPILERS:
                COMPILERS[_language(many[0])].build(many, draft / _library(name))
            else:
                _compile(many, name, compiler(), draft)

    return cache.entry("builds", key, fill, f"compiled {kernels}")


def _cffi_version() -> str:
    import _cffi_backend

    return str(_cffi_backend.__version__)


def _compile(many: Sequence[Sources], name: str, path: str, draft: Path) -> None:
    files = {file: text for sources in many for file, text in sources.files.items()}
    for file, text in files.items():
        (draft / file).write_text(text)
    headers = [file for file in files if file.endswith(".h")]
    code = [file for file in files if file.endswith(".c")]
    if len(code) > 1:  # one translation unit: loops can take steps in, and the compiler is called once
        (draft / f"{name}_kernels.c").write_text("".join(f'#include "{file}"\n' for file in code))
        code = [f"{name}_kernels.c"]
    request = {
        "name": name,
        "cdef": "\n".join(declarations(files[header]) for header in headers),
        "header": "".join(f'#include "{header}"\n' for header in headers) + _UNOPTIMIZED,
        "sources": [str(draft / file) for file in code],
        "flags": [*_flags, _VISIBILITY],
        "libraries": [] if sys.platform == "win32" else ["m"],
        "folder": str(draft),
    }
    built, reasons = run_request(request)
    if built is None:
        raise CompilerError(f"{path} failed on {name}: {reasons[0]}")
    leave_only(built, draft)


def leave_only(built: Path, draft: Path) -> None:
    """Leave nothing in a folder but the compiled module, under the name that Python imports.

    Parameters
    ----------
    built : Path
        The module, anywhere.
    draft : Path
        The folder.
    """
    library = draft / _library(built.name.partition(".")[0])
    built.rename(library)
    for leftover in draft.iterdir():
        if leftover.is_dir():
            shutil.rmtree(leftover)
        elif leftover != library:
            leftover.unlink()


def run_request(request: dict[str, Any]) -> tuple[Path | None, list[str]]:
    """Let the process that compiles answer a request, see ``worker.py``.

    Parameters
    ----------
    request : dict
        Without the environment, which is that of this process.

    Returns
    -------
    Path or None
        The compiled module.
    list of str
        Where there is none, what the compiler said of it: its errors, at least one line.

    Raises
    ------
    CompilerError
        If there is no C compiler, or the process ends.
    """
    path = compiler()
    # Flags in the environment would change the bits of the result, but the key of the cache does not include them.
    environment = {
        k: v for k, v in os.environ.items() if k not in ("CFLAGS", "CPPFLAGS", "LDFLAGS", "LDSHARED")
    }
    with one_at_a_time:
        answer = compiling_process().ask(
            request | {"environment": environment | {"CC": chosen_compiler() or path}}
        )
    built = Path(answer["path"] or request["folder"])
    if built.is_file():
        with built.open("rb") as file:
            is_library = file.read(4).startswith(_LIBRARIES)
        return (built, []) if is_library else (None, ["it reports success and writes no library"])
    said = [line.strip() for line in answer["said"].splitlines() if line.strip()]
    reasons = [line for line in said if "error" in line.lower()] or said[-1:]
    status = re.search(r"exit (?:code|status) -?\d+", answer["failure"])
    return None, reasons or [status[0] if status else " ".join(answer["failure"].split()) or "no output file"]


def _library(name: str) -> str:
    """Return the file name of a compiled module."""
    return name + importlib.machinery.EXTENSION_SUFFIXES[0]
