"""strapgen itself."""

from __future__ import annotations

from pathlib import Path

import strapgen
import strapgen.catalogue.methods.runge_kutta
import strapgen.lowering
import strapgen.targets.rendering
from generators import Case

LANGUAGE = "c"

_ADAPTOR = """#include "{name}.c"
static inline void step(const double *state, const double *samples, double *next)
{{
    {name}(state, samples, next);
}}
#ifndef COUNTED
#include "{name}_runs.c"
#define HAS_LOOPS
static inline void loop(size_t steps, const double *samples, const double *state, double *history)
{{
    {name}_propagate(1, steps, steps, 0, 0, state, samples, history);
}}
static inline void batch(size_t runs, const double *states, const double *samples, double *next)
{{
    {name}_batch(runs, states, samples, next);
}}
#endif
"""


def version() -> str:
    """Return the version of the generator."""
    return strapgen.__version__


def write(case: Case, folder: Path) -> None:
    """Write the step of a case into a folder."""
    rates = case.samples == "rates"
    kernel = strapgen.derive(case.algorithm, "rk4", None if rates else 2, rates=rates)
    sources = strapgen.generate(strapgen.lower(kernel), "c")
    for name, text in sources.files.items():
        (folder / name).write_text(text)
    (folder / "step.inc").write_text(_ADAPTOR.format(name=sources.function.name))
