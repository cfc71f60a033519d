"""CasADi: an SX function, by its C generator."""

from __future__ import annotations

import os
from pathlib import Path

import casadi

from generators import Case, formulas

LANGUAGE = "c"


def version() -> str:
    """Return the version of the generator."""
    return str(casadi.__version__)


def write(case: Case, folder: Path) -> None:
    """Write the step of a case into a folder."""
    kernel = formulas.kernel(case)
    names = formulas.inputs(kernel)
    vectors = [casadi.SX.sym(word, len(group)) for word, group in zip(("x", "d"), names, strict=True)]
    values = {
        name: vector[k] for vector, group in zip(vectors, names, strict=True) for k, name in enumerate(group)
    }
    results = formulas.translated(kernel, values, lambda p, q: casadi.SX(p) / q)
    function = casadi.Function("generated", vectors, [casadi.vertcat(*results)])
    before = Path.cwd()
    os.chdir(folder)  # it writes into the current folder alone
    try:
        function.generate("generated.c")
    finally:
        os.chdir(before)
    call = (
        "    const double *arguments[2] = {state, samples};\n"
        "    double *results[1] = {out};\n"
        "    casadi_f0(arguments, results, 0, 0, 0);\n"
    )
    (folder / "step.inc").write_text('#include "generated.c"\n' + formulas.calling(call, len(results)))
