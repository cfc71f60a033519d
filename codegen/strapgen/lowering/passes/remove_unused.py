"""The pass `remove_unused` drops assignments that no result needs."""

from __future__ import annotations

from dataclasses import replace

from strapgen.ir.program import Program


def remove_unused(program: Program) -> Program:
    """Drop assignments that no result needs."""
    used = program.used()
    body = tuple(a for a in program.body if a.name in used)
    return program if len(body) == len(program.body) else replace(program, body=body)
