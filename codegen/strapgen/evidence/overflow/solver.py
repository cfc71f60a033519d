"""z3 proves from the C, for all inputs, that nothing overflows and that every output lies in its range."""

from __future__ import annotations

from functools import partial
from importlib.metadata import version
from pathlib import Path

from strapgen.evidence.overflow.c_types import MODELS, Model
from strapgen.evidence.subjects import Subject
from strapgen.evidence.verdicts import Result, Tool, Verdict, verdict


def _version() -> str:
    return version("z3-solver")


TOOL = Tool("z3", ("cc",), "z3-solver and pycparser from PyPI", _version, ("z3", "pycparser"))


def prove(subject: Subject, folder: Path) -> list[Verdict]:
    """Have z3 prove that no operation of a kernel overflows and that every output lies in its stated range."""
    for name, text in subject.sources.step_files.items():
        (folder / name).write_text(text)
    return [
        verdict(
            subject.name,
            f"no overflow: {name}",
            TOOL,
            partial(judge, subject, subject.sources.step_files, model),
        )
        for name, model in MODELS.items()
    ]


def judge(subject: Subject, files: dict[str, str], model: Model) -> tuple[Result, str]:
    """Return whether everything is proved of the C in some files, and what is not."""
    from strapgen.evidence.overflow.proof import Proof

    opened = Proof(subject, files, model).opened()
    if not opened:
        return "proved", ""
    return "fails", f"{len(opened)} open, the first in {opened[0].place}: {opened[0].text}"
