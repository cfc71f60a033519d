"""Generates the C of a described system: its stages, and the unit that stores, calls and runs them."""

from __future__ import annotations

from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.support import checks
from strapgen.systems.fitting import Fitted, fitted
from strapgen.systems.wiring import Description
from strapgen.targets import BUILT_IN
from strapgen.targets.system_c import emit


def unit(fit: Fitted, command: str) -> Sources:
    """Return the C of a system whose stages are generated.

    Parameters
    ----------
    fit : Fitted
    command : str
        The command line that generates it.
    """
    system = fit.description.system
    return emit.whole(system, fit.name, (system.title, command), fit.sources, fit.arguments)


def sources(
    description: Description, target: str = "c", settings: Settings | None = None, command: str = ""
) -> Sources:
    """Return the C of a described system.

    Parameters
    ----------
    description : Description
    target : str, optional
        A target of C.
    settings : Settings, optional
        Settings of fixed point for what the stages do not state.
    command : str, optional
        The command line that generates it, for the head of the files.

    Raises
    ------
    InputError
        If the target is not C, or a stage cannot be generated.
    """
    checks.choice("target", target, [name for name, entry in BUILT_IN.items() if entry.compiled])
    return unit(fitted(description, target, settings), command)
