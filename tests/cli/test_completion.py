"""Completion answers with words or with nothing: no error appears in the prompt."""

from __future__ import annotations

import pytest

from strapgen.cli import main


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        ("strapgen simulate euler --step 0.1 --du", "--duration"),
        ("strapgen generate euler --target ", ""),
        ("strapgen simulate --motion ", ""),
        ("strapgen generate euler --out ", ""),
        ("strapgen nowhere --st", ""),
    ],
)
def test_completion_prints_words_alone(words, answer, capsys, monkeypatch):
    monkeypatch.setenv("_STRAPGEN_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split(" ")) - 1))
    with pytest.raises(SystemExit) as stop:
        main([])
    said = capsys.readouterr()
    assert (said.out.strip(), said.err) == (answer, "") and stop.value.code == 0
