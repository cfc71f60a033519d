"""Building turns source text into a module that can be called.

The numpy target is imported as it is. C is compiled through cffi in API mode and cached by content, so that
a second call compiles nothing.
"""

from __future__ import annotations

import atexit
import importlib.machinery
import importlib.util
import json
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import threading
from pathlib import Path
from types import ModuleType
from typing import Any

from strapgen import cache
from strapgen.exceptions import CompilerError
from strapgen.targets import Sources

#: Flags in addition to those of Python. Without contraction to fused multiply-add every machine computes the same bits.
#: Without notes for debuggers, which Python's flags switch on, compiling takes a tenth less time.
C_FLAGS = ("-std=c99", "-O3", "-ffp-contract=off", "-g0")

_loaded: dict[str, Any] = {}


def load(sources: Sources) -> Any:
    """Return the module through which a generated function is called.

    Parameters
    ----------
    sources : Sources

    Returns
    -------
    module
        For Python the generated module; for C a cffi module with ``ffi`` and ``lib``.

    Raises
    ------
    CompilerError
        If there is no C compiler, or it fails.
    """
    key = cache.digest([sources.target, *sources.files, *sources.files.values()])
    if key not in _loaded:
        _loaded[key] = _compiled(sources) if sources.target.startswith("c") else _import_text(sources)
    return _loaded[key]


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
    chosen = _chosen_compiler() or "cc"
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


def _chosen_compiler() -> str:
    return os.environ.get("CC", "").strip()


def _compiled(sources: Sources) -> Any:
    # Compiling with another compiler, or for another Python, makes another entry.
    path = compiler()
    executable = Path(path).resolve()
    stat = executable.stat()
    key = cache.digest(
        [
            *sources.files,
            *sources.files.values(),
            *C_FLAGS,
            _chosen_compiler(),
            f"{executable} {stat.st_size} {stat.st_mtime_ns}",
            f"{platform.machine()} {sys.platform} {sysconfig.get_config_var('SOABI')}",
            _cffi_version(),
        ]
    )
    name = f"strapgen_{sources.function.name}"
    folder = cache.entry("builds", key, lambda draft: _compile(sources, name, path, draft))
    file = folder / _library(name)
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise CompilerError(f"{file} cannot be loaded")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def code_size(sources: Sources) -> int | None:
    """Return the size in bytes of the code and constants of a compiled C source; None if it cannot be determined.

    Parameters
    ----------
    sources : Sources
        Sources of any target; those of Python have no object code.

    Returns
    -------
    int or None

    Raises
    ------
    CompilerError
        If there is no C compiler.
    """
    if not any(name.endswith(".c") for name in sources.files):
        return None
    path, counter = compiler(), shutil.which("size")
    if counter is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        for name, text in sources.files.items():
            (Path(folder) / name).write_text(text)
        code = next(name for name in sources.files if name.endswith(".c"))
        command = [*shlex.split(_chosen_compiler() or path), *C_FLAGS, "-c", code, "-o", "code.o"]
        if subprocess.run(command, cwd=folder, capture_output=True, check=False).returncode:
            return None
        said = subprocess.run([counter, "code.o"], cwd=folder, capture_output=True, text=True, check=False)
    match = re.match(r"\s*(\d+)\s", said.stdout.partition("\n")[2])
    return int(match[1]) if match else None


def _cffi_version() -> str:
    import _cffi_backend

    return str(_cffi_backend.__version__)


def _compile(sources: Sources, name: str, path: str, draft: Path) -> None:
    for file, text in sources.files.items():
        (draft / file).write_text(text)
    header = next(file for file in sources.files if file.endswith(".h"))
    request = {
        "name": name,
        "cdef": _declarations(sources.files[header]),
        "header": header,
        "sources": [str(draft / file) for file in sources.files if file.endswith(".c")],
        "flags": C_FLAGS,
        "libraries": [] if sys.platform == "win32" else ["m"],
        "folder": str(draft),
    }
    # Flags in the environment would change the bits of the result, but the key of the cache does not include them.
    environment = {
        k: v for k, v in os.environ.items() if k not in ("CFLAGS", "CPPFLAGS", "LDFLAGS", "LDSHARED")
    }
    with _one_at_a_time:
        answer = _service().ask(request | {"environment": environment | {"CC": _chosen_compiler() or path}})
    built = Path(answer["path"] or draft)
    if not built.is_file():
        said = answer["said"].splitlines()
        reasons = (
            [line.strip() for line in said if "error" in line.lower()] or said[-1:] or ["no output file"]
        )
        raise CompilerError(f"{path} failed on {name}: {reasons[0]}")
    library = draft / _library(name)
    built.rename(library)
    for leftover in draft.iterdir():
        if leftover.is_dir():
            shutil.rmtree(leftover)
        elif leftover != library:
            leftover.unlink()


class _Service:
    """A process that compiles one request after another until this process ends."""

    def __init__(self) -> None:
        self._owner = os.getpid()
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(Path(__file__).with_name("extension.py"))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        atexit.register(self.stop)

    @property
    def serves(self) -> bool:
        """Whether it runs and this process started it; a fork must not share its pipes."""
        return self._owner == os.getpid() and self._process.poll() is None

    def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        """Send a request and return the answer; after an interruption or a failure the process is stopped."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            print(json.dumps(request), file=self._process.stdin, flush=True)
            answer: dict[str, Any] = json.loads(self._process.stdout.readline())
        except BaseException as error:
            self.stop()
            if isinstance(error, (OSError, ValueError)):
                raise CompilerError("the process that compiles has ended before it was done") from None
            raise
        return answer

    def stop(self) -> None:
        """End the process."""
        atexit.unregister(self.stop)
        if self._owner == os.getpid():
            self._process.kill()
            self._process.communicate()


_running: list[_Service] = []
_one_at_a_time = threading.Lock()


def _service() -> _Service:
    """Return the process that compiles; start one if none runs."""
    if not _running or not _running[0].serves:
        _running[:] = [_Service()]
    return _running[0]


def _library(name: str) -> str:
    """Return the file name of a compiled module."""
    return name + importlib.machinery.EXTENSION_SUFFIXES[0]


def _declarations(header: str) -> str:
    """Return the declarations of a generated header, without its preprocessor lines."""
    lines = [line for line in header.splitlines() if not line.startswith("#")]
    text = "\n".join(lines).replace('extern "C" {', "")
    head, _, tail = text.rpartition("}")
    return head + tail
