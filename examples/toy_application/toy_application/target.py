"""A target: the numpy code of strapgen below a line with its licence."""

from dataclasses import replace

from strapgen import Program, Sources, Target
from strapgen.targets.numpy_code import emit as numpy_code


def emit(program: Program, target: str) -> Sources:
    """Print a program."""
    sources = numpy_code(program, target)
    files = {name: f"# SPDX-License-Identifier: MIT\n{text}" for name, text in sources.files.items()}
    return replace(sources, files=files)


TARGETS = {"numpy-licensed": Target("numpy with a licence", emit, language="Python", number="double")}
