"""Answers what the page asks about an algorithm, part by part; it runs in the reader's browser, without numpy."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import strapgen
from strapgen.analysis.error_analysis import analyse, series_latex, series_text
from strapgen.catalogue.methods import tableaux
from strapgen.fixedpoint.floating import proved, rounding_bounds
from strapgen.ir.program import Program
from strapgen.kernel.kernel import Kernel
from strapgen.report.mathml import equations
from strapgen.results.display.formulas import as_latex

#: The method that stands for the reader's own tableau, and the file that the tableau goes into.
OWN = "own"
FILE = Path(f"{OWN}.toml")
#: Bounds of rounding that were proved when the site was built, beside this file.
BOUNDS = Path(__file__).with_name("bounds.json")
#: Targets whose code needs neither numpy to print nor a word length to choose.
TARGETS = ("c", "cpp", "numpy")
#: Frequencies of the coning motion over the rate of the samples: from a thousandth to half of it, in equal ratios.
_COUNT = 120
RATIOS = tuple(0.001 * 500 ** ((k + 0.5) / _COUNT) for k in range(_COUNT))


@lru_cache(maxsize=1)
def _load_bounds() -> None:
    if BOUNDS.is_file():
        proved.load(json.loads(BOUNDS.read_text()))


@lru_cache(maxsize=4)
def _derived(
    algorithm: str, method: str, increments: int, tableau: str
) -> tuple[strapgen.Choice, Kernel, Program]:
    if method == OWN:
        FILE.write_text(tableau)
        choice = strapgen.choose_step(algorithm, tableaux.read(FILE), increments)
    else:
        choice = strapgen.choose_step(algorithm, method, increments)
    kernel = strapgen.derive(choice)
    return choice, kernel, strapgen.lower(kernel)


def _rows(latex: str) -> list[dict[str, Any]]:
    """Return the rows of an align environment as MathML."""
    body = latex[latex.index(r"\begin") :]
    return [{"left": row.left, "parts": list(row.parts)} for row in equations(body)]


def formula(algorithm: str, method: str, increments: int, tableau: str = "") -> dict[str, Any]:
    """Return the formulas of a step, its order and the operations of its program.

    Parameters
    ----------
    algorithm, method : str
    increments : int
    tableau : str, optional
        The reader's own, in TOML, for the method `OWN`.
    """
    _, kernel, program = _derived(algorithm, method, increments, tableau)
    assert kernel.order is not None
    return {
        "kernel": kernel.name,
        "title": kernel.title,
        "source": kernel.source,
        "notes": list(program.notes),
        "order": kernel.order.step,
        "order_text": str(kernel.order),
        "operations": {name: count for name, count in program.operations.items() if count},
        "temporaries": program.temporaries,
        "rows": _rows(as_latex(kernel)),
        "latex": as_latex(kernel),
    }


def code(algorithm: str, method: str, increments: int, tableau: str = "") -> dict[str, Any]:
    """Return the generated files of a step, by target, and why its header states no bound of rounding, if so.

    Parameters
    ----------
    algorithm, method : str
    increments : int
    tableau : str, optional
        The reader's own, in TOML, for the method `OWN`.
    """
    _load_bounds()
    _, _, program = _derived(algorithm, method, increments, tableau)
    files = {target: strapgen.generate(program, target).step_files for target in TARGETS}
    of_method = f"--tableau {FILE}" if method == OWN else f"--method {method}"
    options = f"{algorithm} {of_method} --increments {increments}"
    return {
        "files": files,
        "command": f"strapgen generate {options} --target {{target}} --out firmware",
        "unproved": rounding_bounds(program).reason == proved.WITHOUT_NUMPY,
    }


def coning(algorithm: str, method: str, increments: int, tableau: str = "") -> dict[str, Any]:
    """Return the drift on a cone whose half-angle is 1 rad, for samples that are 1 s apart, by frequency.

    It is of second order in the half-angle, and inversely proportional to the time between samples.

    Parameters
    ----------
    algorithm, method : str
    increments : int
    tableau : str, optional
        The reader's own, in TOML, for the method `OWN`.
    """
    choice, _, _ = _derived(algorithm, method, increments, tableau)
    response = strapgen.vibration.of(choice)
    rates = [response.rates(ratio, increments, theta_x=1, theta_y=1, phase=math.pi / 2) for ratio in RATIOS]
    return {
        "ratios": RATIOS,
        "drift": [abs(rate.error) for rate in rates],
        "motion": [abs(rate.continuous) for rate in rates],
        "resonant": response.resonant,
    }


def series(algorithm: str, method: str, increments: int, tableau: str = "", terms: int = 1) -> dict[str, Any]:
    """Return what one step loses on any smooth motion, as a series in the length of the step.

    Parameters
    ----------
    algorithm, method : str
    increments : int
    tableau : str, optional
        The reader's own, in TOML, for the method `OWN`.
    terms : int, optional
        Number of terms that are not zero.
    """
    choice, _, _ = _derived(algorithm, method, increments, tableau)
    analysis = analyse(choice, terms=terms)
    return {"rows": _rows(series_latex(analysis)), "text": series_text(analysis), "terms": terms}


PARTS: dict[str, Callable[..., dict[str, Any]]] = {
    part.__name__: part for part in (formula, code, coning, series)
}


def answer(part: str, *arguments: Any) -> str:
    """Return a part of the page as JSON; what strapgen refuses is under "error", in one line.

    Parameters
    ----------
    part : str
        A key of `PARTS`.
    *arguments : str or int
        Those of its function.
    """
    try:
        return json.dumps(PARTS[part](*arguments))
    except (strapgen.StrapgenError, NotImplementedError) as error:
        return json.dumps({"error": str(error)})
