"""Notes which tests execute which parts of the package: a plugin of pytest, with the folder in STRAPGEN_EXECUTION_MAP.

Every block of every function of the package gets a probe when the module is loaded; the files stay as they are. What a
test takes from a cache, in memory or on disk, counts as executed by it: the blocks that filled an entry are noted with
the entry. A tracer of lines would credit all of that to the first test that asks, and takes several times as long.
"""

from __future__ import annotations

import ast
import builtins
import functools
import importlib.abc
import importlib.machinery
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "codegen" / "strapgen"
#: A block is numbered by its file and its first line.
_LINES = 10_000
_PROBE = "__executed_block__"
_real_lru_cache = functools.lru_cache

_blocks: set[int] = set()  # what has been executed since the test began
_seen: dict[int, frozenset[int]] = {}  # sets of blocks that are in it, by identity
# Pytest imports this file once more when it looks for doctests: the probes stay with the plugin.
builtins.__dict__.setdefault(_PROBE, _blocks.add)


def files(root: Path = ROOT) -> list[str]:
    """Return the modules of the package in the order in which blocks are numbered."""
    return sorted(p.relative_to(root).as_posix() for p in (root / "codegen" / "strapgen").rglob("*.py"))


def blocks(tree: ast.Module) -> Iterator[list[ast.stmt]]:
    """Yield the blocks of statements inside functions."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            for node in ast.walk(function):
                for name in ("body", "orelse", "finalbody"):
                    block = getattr(node, name, None)
                    if isinstance(block, list) and not isinstance(node, ast.ClassDef):
                        yield block


def block_of_line(source: str, line: int) -> int | None:
    """Return the first line of the innermost block that holds a line; None if it runs when the module is imported."""
    holding = [
        block[0].lineno
        for block in blocks(ast.parse(source))
        if block and block[0].lineno <= line <= (block[-1].end_lineno or 0)
    ]
    return max(holding, default=None)


def _probed(source: str, base: int) -> ast.Module:
    tree = ast.parse(source)
    for block in {id(b): b for b in blocks(tree) if b}.values():
        first = block[0]
        call = ast.Call(ast.Name(_PROBE, ast.Load()), [ast.Constant(base + first.lineno)], [])
        text = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
        block.insert(int(text), ast.copy_location(ast.Expr(call), first))
    return ast.fix_missing_locations(tree)


class _Loader(importlib.machinery.SourceFileLoader):
    """Loads a module of the package with its probes."""

    def get_code(self, fullname: str) -> CodeType:
        path = Path(self.path)
        base = _numbers()[path.resolve().relative_to(ROOT).as_posix()] * _LINES
        return compile(_probed(path.read_text(), base), self.path, "exec", dont_inherit=True)

    def exec_module(self, module: ModuleType) -> None:
        super().exec_module(module)
        if module.__name__ == "strapgen.storage.cache":
            _note_entries(module)
        elif module.__name__ == "strapgen.storage.stage_cache":
            _note_results(module)


@_real_lru_cache
def _numbers() -> dict[str, int]:
    return {file: number for number, file in enumerate(files())}


class _Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, name: str, path: Any, target: Any = None) -> Any:
        if name.partition(".")[0] != "strapgen":
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path, target)
        if spec is not None and isinstance(spec.loader, importlib.machinery.SourceFileLoader):
            spec.loader = _Loader(spec.loader.name, spec.loader.path)
        return spec


# What is taken from a cache counts as executed


@contextmanager
def _noted() -> Iterator[set[int]]:
    """Gather the blocks of a piece of work; they count for what surrounds it too."""
    before, inside = set(_blocks), set[int]()
    _blocks.clear()
    seen = dict(_seen)
    _seen.clear()
    try:
        yield inside
    finally:
        inside |= _blocks
        _blocks.update(before)
        _seen.update(seen)


def _count(executed: frozenset[int]) -> None:
    if id(executed) not in _seen:
        _seen[id(executed)] = executed
        _blocks.update(executed)


def _lru_cache(maxsize: Any = 128, typed: bool = False) -> Any:
    """Stand in for `functools.lru_cache` on functions of the project, and note what filled each entry."""
    if callable(maxsize):
        return _lru_cache()(maxsize)

    def decorate(function: Callable[..., Any]) -> Any:
        file = getattr(getattr(function, "__code__", None), "co_filename", "")
        if not file.startswith(str(ROOT)):
            return _real_lru_cache(maxsize, typed)(function)

        def work(*arguments: Any, **options: Any) -> tuple[Any, frozenset[int]]:
            with _noted() as executed:
                result = function(*arguments, **options)
            return result, frozenset(executed)

        stored = _real_lru_cache(maxsize, typed)(work)

        @functools.wraps(function)
        def call(*arguments: Any, **options: Any) -> Any:
            result, executed = stored(*arguments, **options)
            _count(executed)
            return result

        for name in ("cache_info", "cache_clear", "cache_parameters"):
            setattr(call, name, getattr(stored, name))
        return call

    return decorate


def _notes(kind: str, key: str) -> Path:
    """Return the file that says what filled an entry of the cache on disk."""
    return Path(os.environ["STRAPGEN_EXECUTION_MAP"]) / "entries" / f"{kind}-{key}.json"


@_real_lru_cache(maxsize=None)
def _known(file: Path) -> frozenset[int]:
    return frozenset(json.loads(file.read_text()))


def _note_entries(cache: ModuleType) -> None:
    """Note the blocks that fill an entry of the cache on disk, and count them wherever it is looked up."""
    entry, lookup = cache.entry, cache.lookup

    def looked_up(kind: str, key: str) -> Path | None:
        place = lookup(kind, key)
        if place is not None and (file := _notes(kind, key)).exists():
            _count(_known(file))
        return place

    def entered(kind: str, key: str, fill: Callable[[Path], None], *rest: Any, **options: Any) -> Path:
        def work(folder: Path) -> None:
            with _noted() as executed:
                fill(folder)
            file = _notes(kind, key)
            file.parent.mkdir(parents=True, exist_ok=True)
            draft = file.with_suffix(f".{os.getpid()}")
            draft.write_text(json.dumps(sorted(executed)))
            draft.rename(file)

        return entry(kind, key, work, *rest, **options)

    cache.entry, cache.lookup = entered, looked_up


def _note_results(stages: ModuleType) -> None:
    """Count what filled the entry of a stage's result where a process has it in memory."""
    remembered = stages._remembered

    @functools.wraps(remembered)
    def called(kind: str, key: str, *rest: Any) -> Any:
        result = remembered(kind, key, *rest)
        if (file := _notes(kind, key)).exists():
            _count(_known(file))
        return result

    stages._remembered = called


# The plugin


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef: Any) -> Any:
    """Leave out what fixtures do that serve the whole session."""
    if fixturedef.scope != "session":
        return (yield)
    with _noted() as executed:
        result = yield
    _blocks.difference_update(executed)
    return result


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Any:
    """Write a line for every test: its name, its seconds of the processor, and its blocks."""
    _blocks.clear()
    _seen.clear()
    begin = time.process_time()
    result = yield
    line = {"test": item.nodeid, "seconds": round(time.process_time() - begin, 4), "blocks": sorted(_blocks)}
    with (Path(os.environ["STRAPGEN_EXECUTION_MAP"]) / f"tests-{os.getpid()}.jsonl").open("a") as file:
        file.write(json.dumps(line) + "\n")
    return result


if "STRAPGEN_EXECUTION_MAP" in os.environ and "strapgen" not in sys.modules:
    functools.lru_cache = _lru_cache
    functools.cache = lambda function: _lru_cache(None)(function)
    sys.meta_path.insert(0, _Finder())
