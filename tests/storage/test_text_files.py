"""Text files of the package are UTF-8 with line feeds on every system, whatever its locale."""

import ast
from pathlib import Path

import pytest

import strapgen

PACKAGE = Path(strapgen.__file__).parent
_NEEDS = {"read_text": {"encoding"}, "write_text": {"encoding", "newline"}}


def unstated(source: str) -> list[int]:
    """Return the lines of calls that leave the encoding or the line ends to the system."""
    calls = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)]
    return [
        call.lineno
        for call in calls
        if isinstance(call.func, ast.Attribute)
        and (needs := _NEEDS.get(call.func.attr))
        and not (call.func.attr == "read_text" and call.args)
        and not needs <= {keyword.arg for keyword in call.keywords}
    ]


@pytest.mark.parametrize("call", ["p.read_text()", "p.write_text(t)", "p.write_text(t, encoding='utf-8')"])
def test_a_call_that_leaves_it_open_is_found(call):
    assert unstated(call) == [1]


def test_no_call_leaves_it_open():
    open_calls = {
        str(path.relative_to(PACKAGE)): lines
        for path in PACKAGE.rglob("*.py")
        if (lines := unstated(path.read_text(encoding="utf-8")))
    }
    assert open_calls == {}
