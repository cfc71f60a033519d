"""`cached` decorates a stage: its results stay in memory, and on disk between processes.

The key of an entry is the generator itself, its code and templates, with the `identity` of each argument, or its text:
after a change of either, the stage runs again, and what runs agrees with the derivation.
"""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from strapgen.ir.timing import from_cache
from strapgen.storage import cache

P = ParamSpec("P")
R = TypeVar("R")

#: What this process has had last, by the folder of the cache and all that it depends on.
_results: dict[tuple[Any, ...], Any] = {}
#: So many results are remembered; one takes some ten kilobytes.
_MOST_RESULTS = 512


def cached(
    kind: str, label: str, *, depends: Callable[..., str] = lambda *_: "", copies: bool = False
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that caches the results of a stage, whose first argument is a choice.

    `kind` is the folder of the entries in the cache, and `label` the format of the log's words for a result from the
    arguments, such as "program of {0.kernel}". `depends`, of the arguments behind the choice, refuses what does not go
    together, and returns what else the result depends on. With `copies` each call gets its own copy, since what holds
    the result can be changed.
    """

    def decorate(stage: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(stage)

        @wraps(stage)
        def recall(*args: P.args, **kwargs: P.kwargs) -> R:
            bound = signature.bind(*args, **kwargs)
            bound.apply_defaults()
            parts = [str(getattr(argument, "identity", argument)) for argument in bound.args]
            parts.append(depends(*bound.args[1:]))
            what = label.format(*bound.args)
            data = _remembered(kind, parts, what, lambda: stage(*args, **kwargs), copies)
            result: R = pickle.loads(data) if copies else data
            return result

        return recall

    return decorate


def _remembered(kind: str, parts: list[str], what: str, work: Callable[[], Any], as_bytes: bool) -> Any:
    """Return a result, or its pickle, which a process checks and reads once; the log has every use."""
    place = cache.root(), kind, cache.generator_digest(), *parts
    result = _results.pop(place, None)
    if result is None:
        result = cache.stored(kind, parts, work, what)
        result = pickle.dumps(result) if as_bytes else result
    else:
        from_cache(what)
    _results[place] = result  # the last one now
    if len(_results) > _MOST_RESULTS:
        oldest, *_ = tuple(_results)  # at once, as other threads may add some
        _results.pop(oldest, None)
    return result
