"""wrenfold: its C++ generator, on scalars."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import wrenfold
from wrenfold import sym

from generators import Case, formulas

LANGUAGE = "c++"


def version() -> str:
    """Return the version of the generator."""
    return str(wrenfold.__version__)


def write(case: Case, folder: Path) -> None:
    """Write the step of a case into a folder."""
    kernel = formulas.kernel(case)
    state, samples = formulas.inputs(kernel)

    def step_of(*symbols: Any) -> list[Any]:
        values = dict(zip((*state, *samples), symbols, strict=True))
        results = formulas.translated(kernel, values, sym.rational)
        return [wrenfold.OutputArg(result, name=f"out_{k}") for k, result in enumerate(results)]

    def bound(**symbols: Any) -> list[Any]:
        return step_of(*symbols.values())

    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    parameters = [inspect.Parameter(n, kind, annotation=wrenfold.FloatScalar) for n in (*state, *samples)]
    bound.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    bound.__annotations__ = {n: wrenfold.FloatScalar for n in (*state, *samples)}
    text = wrenfold.generate_function(bound, generator=wrenfold.CppGenerator(), name="step_of")
    arguments = [f"state[{k}]" for k in range(len(state))] + [f"samples[{k}]" for k in range(len(samples))]
    arguments += [f"out[{k}]" for k in range(len(state))]
    call = f"    step_of<double>({', '.join(arguments)});\n"
    (folder / "step.inc").write_text(f"#include <cmath>\n{text}\n{formulas.calling(call, len(state))}")
