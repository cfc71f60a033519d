"""Logs the times of the generator's stages, to the logger "strapgen" at level INFO; ``strapgen --verbose`` shows it.

Each record is one line, and has the fields ``stage``, ``what`` and ``seconds`` for programs that read the log.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager

LOGGER = logging.getLogger("strapgen")


@contextmanager
def timed(stage: str, what: str) -> Iterator[None]:
    """Log the time of a block, unless it raises."""
    start = time.perf_counter()
    yield
    seconds = time.perf_counter() - start
    fields = {"stage": stage, "what": what, "seconds": seconds}
    LOGGER.info("%s %s: %.3f s", stage, what, seconds, extra=fields)


def from_cache(what: str) -> None:
    """Log that something comes from the cache, where no stage runs."""
    LOGGER.info("%s: from the cache", what, extra={"stage": "cache", "what": what, "seconds": 0.0})
