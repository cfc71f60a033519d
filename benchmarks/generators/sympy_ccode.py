"""SymPy: common subexpressions by `cse`, printed by `ccode`."""

from __future__ import annotations

from pathlib import Path

import sympy as sp

from generators import Case, formulas

LANGUAGE = "c"


def version() -> str:
    """Return the version of the generator."""
    return str(sp.__version__)


def write(case: Case, folder: Path) -> None:
    """Write the step of a case into a folder."""
    kernel = formulas.kernel(case)
    names = [name for group in formulas.inputs(kernel) for name in group]
    results = formulas.translated(kernel, {n: sp.Symbol(n) for n in names}, sp.Rational)
    common, results = sp.cse(results)
    lines = [f"    const double {symbol} = {sp.ccode(expression)};" for symbol, expression in common]
    lines += [f"    next[{k}] = {sp.ccode(expression)};" for k, expression in enumerate(results)]
    body = "\n".join([formulas.loads(kernel), *lines, ""])
    (folder / "step.inc").write_text("#include <math.h>\n" + formulas.definition(body))
