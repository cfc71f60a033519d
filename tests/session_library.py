"""One library for all tests of a session: its processes compile together what the tests build, before they begin.

A compiled module costs more for the compiler's start, its headers and the linker than for the kernel in it.
tests/data/modules.jsonl lists the kernels that quick tests build, a line each, and modules-long.jsonl those of long
tests. The lists are no more than forecasts: a module that one lacks is built alone when a test needs it, and one too
many costs a few hundredths of a second. ``make test-modules`` writes them anew.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache as memoized
from pathlib import Path
from typing import Any

import pytest

from strapgen import pipeline
from strapgen.catalogue import Choice, choose
from strapgen.catalogue.method_names import ALGORITHMS, METHODS, VECTORS
from strapgen.catalogue.methods.windows import named_window
from strapgen.catalogue.names import KERNELS
from strapgen.ir.exceptions import CompilerError, InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.run import compiler
from strapgen.run.compiler import COMPILERS
from strapgen.storage import cache
from strapgen.targets import TARGETS

#: The kernels that tests build, quick ones and long ones: kernel, target, and what fixed point is made for.
FORECASTS = {
    "not long": Path(__file__).parent / "data" / "modules.jsonl",
    "long": Path(__file__).parent / "data" / "modules-long.jsonl",
}
#: A session of fewer tests builds what it needs.
FEWEST_TESTS = 1000
#: Sources that are compiled in one call of the compiler; several calls keep all processes busy.
_TOGETHER = 48

_STEP = re.compile(
    f"({'|'.join([*ALGORITHMS, *VECTORS])})-({'|'.join(METHODS)})-([0-9]+|rates)"
    "(?:-previous([0-9]+))?(?:-ahead([0-9]+))?"
)


def choice_by_name(kernel: str) -> Choice | None:
    """Return the choice of a kernel of the catalogue; None for the name of any other kernel."""
    if kernel in KERNELS:
        return Choice(kernel)
    step = _STEP.fullmatch(kernel)
    if step is None:
        algorithm, _, method = kernel.rpartition("-window-")
        window = f"window-{method}"
        return choose(algorithm, window) if algorithm in ALGORITHMS and named_window(window) else None
    name, method, count, previous, ahead = step.groups()
    increments = None if count == "rates" else int(count)
    return Choice(name, method, increments, int(previous or 0), int(ahead or 0))


def line(sources: Sources) -> str | None:
    """Return the line of the forecast for sources; None if the catalogue does not lead to the same text."""
    choice = choice_by_name(sources.kernel)
    settings = sources.fixed.settings if sources.fixed else None
    if choice is None:
        return None
    try:
        again = pipeline.compile(choice, sources.target, settings)
    except InputError:
        return None
    if again.files != sources.files:
        return None
    return json.dumps([sources.kernel, sources.target, settings and _stated(settings)])


def _stated(settings: Settings) -> dict[str, Any]:
    """Return what settings have that default ones do not: a new field of all settings changes no line."""
    default = Settings().as_dict()
    return {name: value for name, value in settings.as_dict().items() if value != default[name]}


def settings_of(stated: dict[str, Any] | None) -> Settings | None:
    """Return the settings of a line; None if its target has none."""
    return None if stated is None else Settings.from_dict(Settings().as_dict() | stated)


def sources_of(entry: list[Any]) -> Sources | None:
    """Return the sources of a line; None if the catalogue no longer has them."""
    kernel, target, settings = entry
    choice = choice_by_name(kernel)
    try:
        return choice and pipeline.compile(choice, target, settings_of(settings))
    except (InputError, TypeError):
        return None


@contextmanager
def _lock(path: Path, wait: bool) -> Iterator[bool]:
    """Hold a lock between processes, which ends with this one at the latest; say whether it is held."""
    with path.open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            yield False
        else:
            yield True


def _share(folder: Path, tasks: dict[str, Callable[[], None]]) -> None:
    """Do tasks that other processes do too: each of them once, by whichever comes first; return when all are done."""
    folder.mkdir(parents=True, exist_ok=True)
    for wait in (False, True):  # what others work on comes last
        for name, task in tasks.items():
            done = folder / f"{name}.done"
            if done.exists():
                continue
            with _lock(folder / f"{name}.lock", wait) as held:
                if held and not done.exists():
                    task()
                    done.touch()


def folder(name: str, parts: Iterable[str], fill: Callable[[Path], None]) -> Path:
    """Return a folder that one process of the session fills for all; the parts are what its files depend on."""
    locks = cache.root() / "session-library"
    locks.mkdir(parents=True, exist_ok=True)
    key = cache.digest([cache.generator_digest(), *parts])
    with _lock(locks / f"{name}-{key}.lock", wait=True):
        return cache.entry(name, key, fill)


def place(factory: pytest.TempPathFactory, name: str, fill: Callable[[Path], None]) -> Path:
    """Return a temporary folder that one process of the session fills for all, and that is never moved."""
    base = factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:  # each process has its folder in that of the session
        base = base.parent
    folder = base / name
    with _lock(base / f"{name}.lock", wait=True):
        if not (base / f"{name}.done").exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            fill(folder)
            (base / f"{name}.done").touch()
    return folder


@memoized
def _has_compiler(target: str) -> bool:
    """Tell whether there is a compiler of another language than C, without which tests are skipped; C is needed."""
    other = COMPILERS.get(TARGETS[target].language)
    try:
        return other is None or bool(other.path())
    except CompilerError:
        return False


def provide(forecast: Path) -> None:
    """Compile what a forecast lists, together with the other processes of the session."""
    entries = [
        entry for entry in map(json.loads, forecast.read_text().splitlines()) if _has_compiler(entry[1])
    ]
    state = cache.digest([cache.generator_digest(), forecast.read_bytes(), *compiler.OPTIMIZATION.values()])
    folder = cache.root() / "session-library" / state

    @memoized
    def sources(number: int) -> Sources | None:
        return sources_of(entries[number])

    kernels: dict[str, list[int]] = {}
    for number, (kernel, *_) in enumerate(entries):
        kernels.setdefault(kernel, []).append(number)

    def generate(numbers: list[int]) -> None:
        for number in numbers:
            sources(number)

    # What takes longest comes first: many increments and methods of high order have the longest names.
    ordered = sorted(kernels, key=lambda name: (-len(kernels[name]), name))
    _share(folder, {f"generate-{name}": lambda n=kernels[name]: generate(n) for name in ordered})

    # The nth variant of every kernel goes into the nth layer of its language, in which no name occurs twice.
    layers: dict[tuple[str, int], list[int]] = {}
    variants: dict[tuple[str, str, int], int] = {}
    for number, (kernel, target, settings) in enumerate(entries):
        stated = settings_of(settings)
        name = (kernel, target, stated.word if stated else 0)
        variants[name] = variants.get(name, -1) + 1
        layers.setdefault((TARGETS[target].language, variants[name]), []).append(number)
    groups = [
        numbers[start : start + _TOGETHER]
        for numbers in layers.values()
        for start in range(0, len(numbers), _TOGETHER)
    ]

    def compile_group(numbers: list[int]) -> None:
        compiler.compile_together(s for s in map(sources, numbers) if s is not None)

    _share(
        folder, {f"compile-{number}": lambda g=group: compile_group(g) for number, group in enumerate(groups)}
    )


@contextmanager
def recorded(path: Path) -> Iterator[None]:
    """Append a line to a file for all compiled code that tests load from the session's cache."""
    load, root = compiler._compiled, cache.root()

    def noted(sources: Sources) -> Any:
        if cache.root() == root and (text := line(sources)) is not None:
            with path.open("a") as file:
                file.write(text + "\n")
        return load(sources)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiler, "_compiled", noted)
        yield
