"""Gathers what is known of the standard catalogue: its kernels, their costs, and the tables of the thesis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from strapgen import catalogue, pipeline
from strapgen.experiments import frontier
from strapgen.experiments.dossier.conditions import Conditions
from strapgen.experiments.frontier import Candidate, Standing
from strapgen.experiments.thesis_tables import TableEntry, build_all, run_tables
from strapgen.ir.program import Program
from strapgen.library import generated_sources
from strapgen.symbolic.kernel import Kernel


@dataclass(frozen=True)
class CatalogueDossier:
    """What is known of the standard catalogue.

    Parameters
    ----------
    kernels : tuple of (Kernel, Program)
        All kernels with their formulas and their code.
    tables : tuple of TableEntry
        The five tables of the thesis.
    """

    kernels: tuple[tuple[Kernel, Program], ...]
    tables: tuple[TableEntry, ...]


def catalogue_dossier(backends: Sequence[str]) -> CatalogueDossier:
    """Derive the standard catalogue, and run the tables of the thesis.

    Parameters
    ----------
    backends : sequence of str
        Keys of `strapgen.BACKENDS` on which the tables run.
    """
    names = tuple(backends)
    kernels = [
        (pipeline.derive(choice), generated_sources.program(choice)) for choice in catalogue.standard()
    ]
    for _ in build_all(names):
        pass
    return CatalogueDossier(tuple(kernels), tuple(run_tables(names)))


def candidates(choices: Sequence[catalogue.Choice] = ()) -> list[Candidate]:
    """Return all methods of the catalogue with their samples, and those of some choices where they have a name.

    Examples
    --------
    >>> from strapgen.catalogue import choose
    >>> [one.name for one in candidates([choose("dcm", "rk4", 3)])][-1]
    'rk4:3'
    """
    chosen = [one for choice in choices if (one := candidate(choice)) is not None]
    return list(dict.fromkeys([*frontier.candidates([frontier.EVERY]), *chosen]))


def candidate(choice: catalogue.Choice) -> Candidate | None:
    """Return the method of an attitude step with its samples; None for other kernels, and for methods of files."""
    if (
        not isinstance(choice.method, str)
        or choice.increments is None
        or choice.name not in catalogue.ALGORITHMS
    ):
        return None
    return Candidate(choice.method, choice.increments, choice.previous, choice.ahead)


def standings(
    several: Sequence[Candidate], conditions: Conditions, jobs: int | None = None
) -> Iterator[Standing]:
    """Run algorithms on the motion of some conditions, and yield what each costs and how it drifts.

    Parameters
    ----------
    several : sequence of Candidate
    conditions : Conditions
    jobs : int, optional
        Number of processes; by default one for each processor.

    Yields
    ------
    Standing
        In the order in which they come.
    """
    yield from frontier.frontier(
        several, conditions.sample_hz, conditions.duration, jobs=jobs, motions=motions(conditions)
    )


def motions(conditions: Conditions) -> frontier.Motions:
    """Return the motion of some conditions under its name."""
    return {conditions.motion: (conditions.motion, conditions.settings)}
