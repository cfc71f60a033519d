"""Logs how long the generator's stages take, to the logger "strapgen" at level INFO; ``strapgen --verbose`` shows it.

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
    """Log how long the block takes; a block that raises logs nothing.

    Parameters
    ----------
    stage : str
        The stage: "derive", "lower", "quantize", "generate", "compile" or "build".
    what : str
        What it works on, for instance a kernel and a target.
    """
    start = time.perf_counter()
    yield
    seconds = time.perf_counter() - start
    fields = {"stage": stage, "what": what, "seconds": seconds}
    LOGGER.info("%s %s: %.3f s", stage, what, seconds, extra=fields)


def from_cache(what: str) -> None:
    """Log that something comes from the cache, where no stage runs."""
    LOGGER.info("%s: from the cache", what, extra={"stage": "cache", "what": what, "seconds": 0.0})
