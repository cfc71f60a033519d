"""What the tests share: one fixture over all back ends, and one over all attitude algorithms."""

from __future__ import annotations

import atexit
import gc
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import browser_checks
import hypothesis
import numpy as np
import pytest
import session_library
import typer
import typer.main
from covering import beyond_two_rounds, mark_combinations
from gathering import SEED

import strapgen
from strapgen import cli
from strapgen.catalogue import ALGORITHMS
from strapgen.ir.exceptions import CompilerError
from strapgen.ir.fixed_settings import Settings
from strapgen.results import figures
from strapgen.run import compiler, octave, processes
from strapgen.run.backends import BACKENDS, Backend
from strapgen.run.compiler import COMPILERS
from strapgen.targets import BUILT_IN

if TYPE_CHECKING:
    from playwright.sync_api import Browser

#: The back ends. Short words have the code of long ones, C in float that of double, and the integer model gives the
#: bits of the C: they run with the long tests.
BACKEND_NAMES = [
    pytest.param(name, marks=pytest.mark.long) if name in ("c-float", "c-fixed16", "fixed-model") else name
    for name in BACKENDS
]


#: Back ends on which Cayley-Klein parameters run too. Their programs are those of Euler parameters but for names, which
#: tests/lowering proves: numpy and C in double show it, the others would compile the same C again.
CAYLEY_KLEIN = ("numpy", "c")


#: Where all tests run in Octave too, which takes a program a thousand times as long as C: what holds of the behaviour
#: there, and of the bits of all kernels in tests/targets/test_matlab.py, says the rest.
IN_OCTAVE = Path(__file__).parent / "run"
#: Where no test runs in C++ and Rust, folders and files: tests/targets holds every kernel there to the bits and the
#: integers of the C, on which these tests run, and the back ends themselves behave as tests/backends says.
NOT_IN_OTHER_LANGUAGES = (
    *("catalogue", "lab", "navigation", "design", "firmware"),
    *("test_claims.py", "test_constant_rate.py"),
)

#: Objects made since the last search for garbage at which a session searches again, by generation. A search takes a
#: second for a million objects, most of which stay; the processes of a session share what its tests make.
GARBAGE = (6_000_000, 10, 10)


def pytest_configure(config: pytest.Config) -> None:
    """Let properties that say no number of examples of their own take a quarter of them, except in the long tests."""
    processes._GARBAGE = GARBAGE  # for commands that run in process too
    if hasattr(config, "workerinput"):  # no status depends on these processes
        # Before anything that tests leave to the end, and so called after it: the system frees at once what a process
        # has derived, Python one object after another, for seconds.
        atexit.register(os._exit, 0)
    config.addinivalue_line("markers", "needs(*programs): skipped where one of the programs is missing")
    config.addinivalue_line(
        "markers", "every_combination: the long tests run every combination of its parameters"
    )
    if config.getoption("markexpr") == "not long":
        hypothesis.settings.register_profile("quick", max_examples=25, deadline=None)
        hypothesis.settings.load_profile("quick")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that writes the forecast of the session's library."""
    parser.addoption(
        "--record-modules",
        metavar="FILE",
        type=Path,
        help="append a line to FILE for every compiled kernel that tests load",
    )
    parser.addoption(
        "--site",
        metavar="FOLDER",
        type=Path,
        help="test the pages of a site that was built before",
    )
    parser.addoption(
        "--all-combinations",
        action="store_true",
        help="with -m long: run every combination of the parameters of a test",
    )


@pytest.hookimpl(tryfirst=True)
def pytest_pycollect_makeitem(collector: pytest.Collector, obj: object) -> list[pytest.Item] | None:
    """Make no cases of a long test that is not to run."""
    marks = getattr(obj, "pytestmark", ())
    is_quick = collector.config.getoption("markexpr") == "not long"
    return [] if is_quick and any(mark.name == "long" for mark in marks) else None


def _other_language(values: Mapping[str, object]) -> Callable[[], object] | None:
    """Return what finds the compiler of C++ or Rust or the Octave that a test needs, by the back end it runs on."""
    for name in (values.get(key) for key in ("backend_name", "backend", "name")):
        target = BACKENDS[name].target if isinstance(name, str) and name in BACKENDS else ""
        if target in BUILT_IN and BUILT_IN[target].language in COMPILERS:
            return COMPILERS[BUILT_IN[target].language].path
        if target == "matlab":
            return octave.command
    return None


@cache
def _missing(program: Callable[[], object]) -> str:
    """Return why a program cannot be used; "" if it is there."""
    try:
        program()
    except CompilerError as error:
        return str(error)
    return ""


def _is_of_cayley_klein(value: object) -> bool:
    if type(value).__name__ == "Subject":  # whose name is derived
        value = value.choice
    return str(getattr(value, "name", value)).startswith("cayley-klein")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Let combinations, Cayley-Klein parameters and what opens a browser run with the long tests.

    Every value of every parameter is in a quick test, and in two combinations that are long. Cayley-Klein
    parameters do not run on back ends that show nothing new of them: their kernels and programs are those of Euler
    parameters but for names, which tests/catalogue, tests/lowering and tests/test_claims.py prove.
    """
    left = []
    for item in items:
        values = getattr(getattr(item, "callspec", None), "params", {})
        program = _other_language(values)
        if (
            program is not None
        ):  # the code of C in another language: tests of the targets hold the bits to those of C
            item.add_marker(pytest.mark.long)
            item.add_marker(pytest.mark.skipif(bool(missing := _missing(program)), reason=missing))
        if any(map(_is_of_cayley_klein, values.values())) or "browser" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.long)
        for mark in item.iter_markers("needs"):
            absent = [program for program in mark.args if shutil.which(program) is None]
            item.add_marker(
                pytest.mark.skipif(bool(absent), reason=f"no {', '.join(absent)} on this machine")
            )
        elsewhere = (
            IN_OCTAVE not in item.path.parents
            if program is octave.command
            else program is not None
            and not {*NOT_IN_OTHER_LANGUAGES}.isdisjoint(item.path.relative_to(config.rootpath).parts)
        )
        if elsewhere or (
            values.get("algorithm") == "cayley-klein" and values.get("backend_name", "c") not in CAYLEY_KLEIN
        ):
            left.append(item)
    _leave_out(config, items, left)
    mark_combinations(items)
    if config.getoption("markexpr") == "long" and not config.getoption("all_combinations"):
        _leave_out(config, items, list(beyond_two_rounds(items)))


def _leave_out(config: pytest.Config, items: list[pytest.Item], left: list[pytest.Item]) -> None:
    if left:
        config.hook.pytest_deselected(items=left)
        without = set(left)
        items[:] = [item for item in items if item not in without]


def pytest_collection_finish(session: pytest.Session) -> None:
    """Leave the objects that stay for the whole session out of the search for garbage, and search seldom."""
    gc.collect()
    gc.freeze()
    processes.prepare_for_derivations()


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Leave what the session derived out of the last search for garbage: it ends with the process."""
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def small_images() -> Iterator[None]:
    """Draw images with a third of the resolution, except where they are looked at closely."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "RESOLUTION_DPI", 50)
        yield


@pytest.fixture(scope="session", autouse=True)
def optimization(pytestconfig: pytest.Config) -> Iterator[None]:
    """Compile without optimization what is not about it: without contraction it leaves every bit as it is.

    The tests of the C text itself compile as a user does, and long ones look for undefined behaviour.
    """
    with pytest.MonkeyPatch.context() as patch:
        assert compiler.OPTIMIZATION["C"] == "-O3"
        if pytestconfig.getoption("markexpr") in ("not long", "long"):
            patch.setattr(compiler, "OPTIMIZATION", {"C": "-O0", "C++": "-O0", "Rust": "-Copt-level=1"})
        yield


@pytest.fixture(scope="session", autouse=True)
def compiled(optimization: None, request: pytest.FixtureRequest) -> Iterator[None]:
    """Compile what the tests of a large session need, together and before they begin."""
    with ExitStack() as stack:
        file = request.config.getoption("record_modules")
        if file is not None:
            stack.enter_context(session_library.recorded(file.absolute()))
        if len(request.session.items) >= session_library.FEWEST_TESTS:
            which = request.config.getoption("markexpr")
            session_library.provide(
                session_library.FORECASTS.get(which, session_library.FORECASTS["not long"])
            )
        yield


@pytest.fixture(scope="session", autouse=True)
def one_command_line() -> Iterator[None]:
    """Build the commands once: typer reads the signatures of all of them whenever its application is called."""
    assert isinstance(cli.app, typer.Typer)  # with all commands, before one of them is asked for
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typer.main, "get_command", cache(typer.main.get_command))
        yield


@pytest.fixture(params=BACKEND_NAMES)
def backend_name(request: pytest.FixtureRequest) -> str:
    """Name of a back end: a test that asks for it runs on every one."""
    return str(request.param)


@pytest.fixture(params=list(ALGORITHMS))
def algorithm(request: pytest.FixtureRequest) -> str:
    """Name of an attitude algorithm: a test that asks for it runs on every one."""
    return str(request.param)


@pytest.fixture
def make(backend_name: str):
    """Make a back end of an attitude algorithm on the back end under test.

    In fixed point, formats are chosen for increments of up to `largest`, and `carry` says which residuals are kept.
    """

    def make_backend(
        algorithm: str,
        method: str = "rk4",
        increments: int = 2,
        largest: float | None = None,
        carry: str = "none",
        **rest: object,
    ) -> Backend:
        settings = None
        if BACKENDS[backend_name].fixed:
            settings = Settings(carry=carry) if largest is None else Settings(carry=carry).fitted(largest)
        return strapgen.backend(algorithm, method, increments, backend_name, settings=settings, **rest)

    return make_backend


@pytest.fixture
def rng() -> Iterator[np.random.Generator]:
    """A generator of random numbers that gives the same ones each time."""
    yield np.random.default_rng(SEED)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Headless Chromium, for the checks of pages in browser_checks.py."""
    with browser_checks.chromium() as browser:
        yield browser


@pytest.fixture(scope="session")
def site(pytestconfig: pytest.Config) -> Path:
    """The folder of the documentation as a site that was built before, for the checks of its pages."""
    folder = pytestconfig.getoption("site")
    if folder is None:
        pytest.skip("make docs-check builds the site and opens its pages")
    assert (folder / "index.html").is_file(), f"{folder} holds no site; make docs builds one"
    return folder.resolve()
