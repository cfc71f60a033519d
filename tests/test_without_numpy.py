"""Deriving, generating and analysing need neither numpy nor cffi, nor what the command line needs: a browser has none.

What is missing here are the packages with compiled code and those of the command line; SymPy, mpmath and Jinja are
pure Python, and are all that the page of the documentation which runs strapgen brings along.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys

import pytest

from strapgen import derive, generate, lower, rounding_bounds
from strapgen.fixedpoint.floating import proved

MISSING = ("numpy", "scipy", "matplotlib", "cffi", "platformdirs", "typer", "click", "rich", "flint", "gmpy2")
HEAD = f"import json, sys\nfor name in {MISSING!r}:\n    sys.modules[name] = None\n"
PROGRAM = """
import strapgen
from strapgen.analysis.error_analysis import analyse
from strapgen.analysis.error_analysis import SeriesResult
from strapgen.results.display.formulas import as_latex
from strapgen.fixedpoint.floating import proved

choice = strapgen.choose(*{choice!r})
kernel = strapgen.derive(choice)
program = strapgen.lower(kernel)
unproved = strapgen.generate(program, "c").files
proved.load(json.load(sys.stdin))
analysis = analyse(choice)
rates = strapgen.vibration.of(choice).rates(50, "1/100", theta_x="1/1000", theta_y="1/1000", phase="3/2")
print(json.dumps({{
    "latex": as_latex(kernel),
    "operations": program.operations,
    "files": {{t: strapgen.generate(program, t).files for t in ("numpy", "c")}},
    "unproved": unproved,
    "series": SeriesResult([analysis]).text(),
    "drift": rates._asdict(),
}}))
"""


def without_numpy(code: str, *choice: str | int, **bounds: object) -> dict[str, object]:
    done = subprocess.run(
        [sys.executable, "-c", HEAD + code.format(choice=choice)],
        input=json.dumps(bounds),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(
    scope="module", params=[("euler", "rk4", 2), pytest.param(("dcm", "taylor2", 1), marks=pytest.mark.long)]
)
def both(request):
    """A program, and what came out of its choice where numpy is missing."""
    program = lower(derive(*request.param))
    bounds = {proved.key(program, "double"): rounding_bounds(program).as_dict()}
    return program, without_numpy(PROGRAM, *request.param, **bounds)


def test_the_code_is_that_of_an_installation_with_numpy(both):
    program, seen = both
    assert seen["files"] == {target: generate(program, target).files for target in ("numpy", "c")}
    assert seen["operations"] == program.operations


def normal(text: str) -> list[str]:
    """The lines of a source that a compiler sees without -ffast-math."""
    text = re.sub(r"#if defined\(__FAST_MATH__\)\n.*?#endif\n", "", text, flags=re.DOTALL)
    return [
        line for line in text.splitlines() if line and "FLT_EVAL_METHOD" not in line and "#error" not in line
    ]


def test_a_bound_that_was_not_proved_is_not_stated(both):
    program, seen = both
    (header,) = (text for name, text in seen["unproved"].items() if name == f"{program.name}.h")
    assert proved.WITHOUT_NUMPY.split()[0] in header
    assert " ulp" not in header
    sources = [name for name in seen["unproved"] if name.endswith(".c")]
    assert sources
    for name in sources:
        assert normal(seen["unproved"][name]) == normal(seen["files"]["c"][name])
    # Code without a bound refuses -ffast-math.
    assert "never -ffast-math" in seen["unproved"][f"{program.name}.c"]
    assert "never -ffast-math" not in seen["files"]["c"][f"{program.name}.c"]


def test_formulas_series_and_coning_are_there(both):
    program, seen = both
    assert seen["latex"].startswith("\\begin{align")
    assert f"{program.kernel}, general motion" in seen["series"]
    assert seen["drift"]["error"] == pytest.approx(seen["drift"]["computed"] - seen["drift"]["continuous"])


def test_a_missing_package_is_missing():
    for name in MISSING[:2]:
        with pytest.raises(AssertionError, match=f"import of {name} halted"):
            without_numpy(f"import {name}")
