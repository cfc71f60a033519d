"""What the tests share: one fixture over all back ends, and one over all attitude algorithms."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import browser_checks
import hypothesis
import numpy as np
import pytest
import typer
import typer.main
from languages import OTHERS, cases

import strapgen
from strapgen import cli
from strapgen.catalogue import ALGORITHMS
from strapgen.ir.fixed_settings import Settings
from strapgen.run import processes
from strapgen.run.backends import BACKENDS, Backend

if TYPE_CHECKING:
    from playwright.sync_api import Browser


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--site", metavar="FOLDER", type=Path, help="test the pages of a site that was built before"
    )


def pytest_configure(config: pytest.Config) -> None:
    processes.prepare_for_derivations()
    if config.getoption("markexpr") == "not long":
        hypothesis.settings.register_profile("quick", max_examples=25, deadline=None)
        hypothesis.settings.load_profile("quick")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Skip what lacks a program, and choose among combinations of parameters.

    The code of Cayley-Klein parameters is that of Euler parameters but for names, which tests/lowering proves: they
    run with the long tests.
    """
    for item in items:
        programs = [program for mark in item.iter_markers("needs") for program in mark.args]
        if absent := [program for program in programs if shutil.which(program) is None]:
            item.add_marker(pytest.mark.skip(reason=f"no {', '.join(absent)} on this machine"))
        if reason := next(filter(None, map(not_on_this_system, item.iter_markers("posix"))), ""):
            item.add_marker(pytest.mark.skip(reason=reason))
        if "cayley-klein" in item.name:
            item.add_marker(pytest.mark.long)
    for item, number in combinations(item for item in items if not item.get_closest_marker("long")):
        if number > 0:
            item.add_marker(pytest.mark.long)
    if config.getoption("markexpr") == "long":
        left = {item for item, number in combinations(items) if number > 1}
        config.hook.pytest_deselected(items=[*left])
        items[:] = [item for item in items if item not in left]


def not_on_this_system(mark: pytest.Mark) -> str:
    """Return why a test with the mark `posix` cannot run here; "" if it can."""
    root = mark.kwargs.get("root")
    if not hasattr(os, "geteuid"):
        return "users, permissions, signals and scripts are not those of POSIX here"
    if root is None or root == (os.geteuid() == 0):
        return ""
    return "only the administrator can do this" if root else "the administrator may do what others may not"


def combinations(items: Iterable[pytest.Item]) -> Iterator[tuple[pytest.Item, int]]:
    """Number the diagonals of a test's combinations of parameters: 0 and 1 have every value at least once each.

    Where every combination has an expected value of its own, the mark `every_combination` leaves none above 1.
    """
    tests: dict[object, list[pytest.Function]] = {}
    for item in items:
        if isinstance(item, pytest.Function) and hasattr(item, "callspec"):
            tests.setdefault((item.path, item.cls, item.originalname), []).append(item)
    for several in tests.values():
        # A column holds the ids of one list of values, which may be of several parameters.
        columns = zip(*(item.callspec._idlist for item in several), strict=True)
        axes = [[*map(sorted({*column}).index, column)] for column in columns]
        longest, *others = sorted(axes, key=max, reverse=True)
        least = 1 if several[0].get_closest_marker("every_combination") else len(several)
        for k, item in enumerate(several):
            shifts = {(axis[k] - longest[k]) % (1 + max(axis)) for axis in others} or {0}
            yield item, min(max(shifts) if len(shifts) == 1 else len(several), least)


@pytest.fixture(scope="session", autouse=True)
def one_command_line() -> Iterator[None]:
    """Build the commands once: typer reads the signatures of all of them whenever its application is called."""
    assert isinstance(cli.app, typer.Typer)  # with all commands, before one of them is asked for
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typer.main, "get_command", cache(typer.main.get_command))
        yield


@pytest.fixture(params=cases(name for name in BACKENDS if name not in OTHERS))
def backend_name(request: pytest.FixtureRequest) -> str:
    """Name of a back end: a test that asks for it runs on every one, in tests/run in other languages too."""
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
def rng() -> np.random.Generator:
    """A generator of random numbers that gives the same ones each time."""
    return np.random.default_rng(1969)


@pytest.fixture
def full_device() -> Path:
    """A file to which nothing can be written, as on a disk that is full."""
    path = Path("/dev/full")
    return path if path.exists() else pytest.skip(f"there is no {path} on this system")


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
