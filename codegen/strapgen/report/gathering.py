"""Gathers dossiers side by side, and what they are seen beside: all methods by their cost, the tables of the thesis."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from strapgen import pipeline
from strapgen.catalogue import ALGORITHMS, Choice
from strapgen.design import frontier
from strapgen.design.frontier import Candidate, Standing
from strapgen.ir.fixed_settings import Settings
from strapgen.lab.study.resumable import side_by_side
from strapgen.report.conditions import Conditions
from strapgen.report.dossier import AlgorithmDossier, dossier
from strapgen.thesis import thesis_tables
from strapgen.thesis.thesis_tables import TableEntry


def compared(choices: Sequence[Choice], names: Sequence[str] = (frontier.EVERY,)) -> list[Candidate]:
    """Return algorithms to compare with some choices, and after them those of the choices that have a name.

    >>> from strapgen.catalogue import choose
    >>> [one.name for one in compared([choose("dcm", "rk4", 3)], ["magnus4:2"])]
    ['magnus4:2', 'rk4:3']
    """
    if all(choice.increments is None for choice in choices):
        return []
    chosen = [one for choice in choices if (one := candidate(choice)) is not None]
    return list(dict.fromkeys([*frontier.candidates(names), *chosen]))


def named(several: Sequence[Candidate], names: Sequence[str]) -> tuple[str, ...]:
    """Return the names by which `frontier.candidates` returns algorithms: those stated, and what these leave out.

    >>> named(frontier.candidates(["magnus4:2", "rk4:3"]), ["magnus4:2"])
    ('magnus4:2', 'rk4:3')
    """
    stated = frontier.candidates(names) if several else []
    return (*names, *(one.name for one in several if one not in stated))


def candidate(choice: Choice) -> Candidate | None:
    """Return the method of an attitude step with its samples, or the Python file of a user's step."""
    if choice.increments is None:
        return None
    method = choice.method
    if choice.user_kernel is not None:
        method = pipeline.program(choice).arguments
        if not method.endswith(".py") or any(space in method for space in " \t"):
            return None  # built in Python, or with options of its own
    elif choice.name not in ALGORITHMS:
        return None
    if not isinstance(method, str):
        return None
    return Candidate(method, choice.increments, choice.previous, choice.ahead)


def in_tables(choice: Choice) -> bool:
    """Return whether the tables of the thesis have an algorithm.

    >>> from strapgen.catalogue import choose
    >>> in_tables(choose("dcm", "rk4", 2)), in_tables(choose("dcm", "rk3", 2))
    (True, False)
    """
    return choice in [
        Choice(name, f"rk{order}", 2) for name in thesis_tables.ALGORITHMS for order in thesis_tables.ORDERS
    ]


def tables(choices: Iterable[Choice], backends: tuple[str, ...]) -> list[TableEntry]:
    """Return the tables of the thesis where one of some choices stands in them; else nothing."""
    if not any(map(in_tables, choices)):
        return []
    for _ in thesis_tables.build_all(backends):
        pass
    return [*thesis_tables.run_tables(backends)]


@dataclass(frozen=True)
class DossierCase:
    """What a process needs for the dossier of an algorithm: the parameters of `dossier`."""

    choice: Choice
    conditions: Conditions
    settings: Settings | None
    backends: tuple[str, ...]


def dossiers(cases: Sequence[DossierCase], jobs: int | None = None) -> Iterator[AlgorithmDossier]:
    """Yield the dossiers of algorithms, in the order in which they come."""
    numbered = {str(place): case for place, case in enumerate(cases)}
    for _, known in side_by_side(_gathered, numbered, jobs):
        yield known


def _gathered(case: DossierCase) -> AlgorithmDossier:
    return dossier(case.choice, case.conditions, case.settings, case.backends)


def standings(
    several: Sequence[Candidate], conditions: Conditions, jobs: int | None = None
) -> Iterator[Standing]:
    """Run algorithms on the motion of some conditions, and yield what each costs and how it drifts."""
    yield from frontier.frontier(
        several, conditions.sample_hz, conditions.duration, jobs=jobs, motions=motions(conditions)
    )


def motions(conditions: Conditions) -> frontier.Motions:
    """Return the motion of some conditions under its name."""
    return {conditions.motion: (conditions.motion, conditions.settings)}
