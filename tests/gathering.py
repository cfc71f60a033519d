"""Many small cases in one test: each runs to its end, and what failed is told together."""

from __future__ import annotations

import inspect
import traceback
from collections.abc import Callable, Iterable
from functools import wraps
from typing import Any

import numpy as np
import pytest

#: Seed of the random numbers of every test and of every case.
SEED = 1969


def each(
    names: str | tuple[str, ...], cases: Iterable[Any], ids: Any = None
) -> Callable[[Callable], Callable]:
    """Run a test on every case, as `pytest.mark.parametrize` does, but as one test: for checks that take no time.

    Fixtures are set up once; random numbers begin anew with every case.
    """
    parameters = [name.strip() for name in names.split(",")] if isinstance(names, str) else list(names)
    every = list(cases)

    def decorate(test: Callable) -> Callable:
        signature = inspect.signature(test)

        @wraps(test)
        def gathered(**fixtures: Any) -> None:
            failures = []
            for case in every:
                values = dict(zip(parameters, case if len(parameters) > 1 else (case,), strict=True))
                if "rng" in fixtures:
                    fixtures["rng"] = np.random.default_rng(SEED)
                try:
                    test(**fixtures, **values)
                except pytest.skip.Exception:
                    raise
                except (Exception, pytest.fail.Exception) as error:
                    failures.append(f"{', '.join(map(_name, values.values()))}: {_told(error)}")
            if failures:
                pytest.fail(f"{len(failures)} of {len(every)} cases\n" + "\n".join(failures), pytrace=False)

        assert every, "a test without cases"
        assert not any(hasattr(case, "marks") for case in every), "cases with marks are tests of their own"
        del gathered.__wrapped__
        rest = [p for p in signature.parameters.values() if p.name not in parameters]
        gathered.__signature__ = signature.replace(parameters=rest)
        return gathered

    return decorate


def _name(value: Any) -> str:
    return str(getattr(value, "kernel", value))


def _told(error: BaseException) -> str:
    """Return the line that failed and what it says."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    if isinstance(error, pytest.fail.Exception):
        return f"{error}"
    return f"{last.filename}:{last.lineno}: {type(error).__name__}: {error}"
