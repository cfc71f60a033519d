"""Compilers that fail or lie: one line names them, and the cache holds nothing that cannot be loaded."""

from __future__ import annotations

import pytest

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.ir.exceptions import CompilerError
from strapgen.run import compiler

FAILING = "#!/bin/sh\necho 'no licence for this host' >&2\nexit 3\n"
SILENT = "#!/bin/sh\nexit 3\n"
NO_SHEBANG = "\x00"
LYING = """#!/bin/sh
while [ $# -gt 0 ]; do [ "$1" = "-o" ] && echo rubbish > "$2"; shift; done
exit 0
"""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (FAILING, "failed on strapgen_euler_rk1_1: no licence for this host"),
        (SILENT, "strapgen_euler_rk1_1: exit "),
        (NO_SHEBANG, "strapgen_euler_rk1_1: Exec format error"),
        (LYING, "it reports success and writes no library"),
    ],
    ids=["failing", "silent", "no program", "lying"],
)
def test_compiler_that_fails_is_named_in_one_line(text, said, tmp_path, monkeypatch):
    check("CC", "c", text, said, tmp_path, monkeypatch)


@pytest.mark.parametrize(("variable", "target"), [("CXX", "cpp"), ("RUSTC", "rust")])
@pytest.mark.parametrize(
    ("text", "said"),
    [(FAILING, "euler-rk1-1: no licence"), (LYING, "it reports success and writes no library")],
    ids=["failing", "lying"],
)
def test_compilers_of_other_languages_too(variable, target, text, said, tmp_path, monkeypatch):
    check(variable, target, text, said, tmp_path, monkeypatch)


def check(variable, target, text, said, tmp_path, monkeypatch) -> None:
    """Load a step with a compiler that is a script, twice."""
    path = tmp_path / "mycc"
    path.write_text(text)
    path.chmod(0o755)
    monkeypatch.setenv(variable, str(path))
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(tmp_path / "cache"))
    sources = pipeline.compile(choose("euler", "rk1", 1), target)
    for _ in range(2):  # the cache keeps nothing of it
        with pytest.raises(CompilerError) as caught:
            compiler.load(sources)
        assert said in str(caught.value) and str(path) in str(caught.value)
        assert "CalledProcessError" not in str(caught.value) and "\n" not in str(caught.value)
        assert not list((tmp_path / "cache" / "builds").iterdir())
