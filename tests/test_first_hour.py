"""The session in IPython of the page of the API: what it prints, and what completion offers at each step."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import strapgen

PAGE = (Path(__file__).resolve().parents[1] / "docs" / "python-api.md").read_text()
(SESSION,) = re.findall(r"^```ipython\n(.*?)^```", PAGE, flags=re.MULTILINE | re.DOTALL)
#: Input and what stands below it, in order.
STEPS = re.findall(r"^In \[\d+\]: (.*)\n((?:(?!In \[).*\n)*)", SESSION, flags=re.MULTILINE)


@pytest.fixture(scope="module")
def shell():
    return pytest.importorskip("IPython.core.interactiveshell").InteractiveShell()


def offered(shell, text: str) -> list[str]:
    """Return what completion offers, without the words of Python and of IPython in a call."""
    completer = pytest.importorskip("IPython.core.completer")
    with completer.provisionalcompleter():
        found = [one.text for one in shell.Completer.completions(text, len(text))]
    in_a_call = "(" in text
    return sorted({one.lstrip(".") for one in found if not in_a_call or one.endswith("=")})


@pytest.mark.filterwarnings("ignore")  # of IPython and jedi, about themselves
def test_the_first_hour(shell):
    assert len(STEPS) >= 14 and sum("<TAB>" in line for line, _ in STEPS) >= 5
    for line, below in STEPS:
        if line.endswith("<TAB>"):
            assert offered(shell, line.removesuffix("<TAB>")) == below.split(), line
            continue
        done = shell.run_cell(line, store_history=True, silent=False)
        assert done.success, line
        number = shell.execution_count - 1
        text = shell.display_formatter.format(done.result)[0]["text/plain"] if done.result is not None else ""
        shown = re.sub(rf"^Out\[{number}\]:\s", "", below.strip())
        assert shown == text, line


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("jedi", [True, False])
def test_an_old_name_works_and_is_not_offered(shell, jedi):
    shell.Completer.use_jedi = jedi
    shell.run_cell("import strapgen; alg = strapgen.algorithm('euler')")
    names = offered(shell, "alg.")
    assert {"generate", "quantize"} <= {*names} and "c" not in names
    with pytest.raises(AttributeError, match="has no attribute 'cc'"):
        strapgen.algorithm("euler").cc  # noqa: B018


def test_help_begins_with_a_screen():
    text = strapgen.__doc__
    assert len(text.splitlines()) <= 24 and max(map(len, text.splitlines())) <= 120
    named = {*re.findall(r"\b\w+\b", text)} & {*strapgen.__all__}
    assert len(named) >= 45
    assert {f"alg.{job}" for job in ("formulas", "series", "simulate", "compare", "generate")} <= {
        *re.findall(r"alg\.\w+", text)
    }
