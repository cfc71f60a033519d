"""Returns what a back end runs: the generated text of a kernel or, for a back end that interprets it, its program."""

from __future__ import annotations

from dataclasses import dataclass

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.ir.exceptions import InputTypeError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.program import Program
from strapgen.ir.sources import Function, Sources
from strapgen.run import generated_sources
from strapgen.targets import TARGETS


@dataclass(frozen=True, kw_only=True)
class ProgramSources(Sources):
    """Sources without text, for a back end that runs the program of a kernel.

    Parameters
    ----------
    program : Program
    """

    program: Program


def sources_of_program(program: Program, target: str, settings: Settings | None = None) -> Sources:
    """Return what a back end runs of a program.

    Parameters
    ----------
    program : Program
    target : str
        The target of the back end, see `registry.Entry`.
    settings : Settings, optional
        Settings of fixed point.

    Returns
    -------
    Sources
        Generated text where `target` is one, else the program itself.
    """
    if target in TARGETS:
        return pipeline.generate(program, target, settings)
    return ProgramSources(
        kernel=program.kernel,
        target=target,
        files={},
        function=Function(program.name, program.inputs, tuple(result.signal for result in program.outputs)),
        operations=program.operations,
        temporaries=program.temporaries,
        companions=program.companions,
        recursion=program.recursion,
        own=program.own,
        program=program,
    )


def sources_of_choice(choice: Choice, target: str, settings: Settings | None = None) -> Sources:
    """Return what a back end runs of a chosen kernel, from the cache; parameters are those of `sources_of_program`."""
    if target in TARGETS:
        return generated_sources.sources(choice, target, settings)
    return sources_of_program(generated_sources.program(choice), target)


def program_of(sources: Sources) -> Program:
    """Return the program that sources hold.

    Raises
    ------
    InputTypeError
        If they are generated text.
    """
    if not isinstance(sources, ProgramSources):
        raise InputTypeError(
            f"sources of {sources.kernel} for {sources.target} hold text; a program is needed"
        )
    return sources.program
