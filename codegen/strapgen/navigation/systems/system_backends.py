"""Described systems on every back end: `system_runner` returns one."""

from __future__ import annotations

from strapgen.ir import checks
from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.systems.compiled_system import CompiledSystem
from strapgen.navigation.systems.fitting import Fitted, fitted
from strapgen.navigation.systems.system_memory import SystemMemory, SystemRun
from strapgen.navigation.systems.system_runner import SystemRunner
from strapgen.navigation.systems.wiring import Description
from strapgen.run.backend_names import BACKENDS
from strapgen.run.backends import fitted as fitted_settings
from strapgen.run.kernel_sources import sources_of_choice
from strapgen.targets import TARGETS

__all__ = ["SystemMemory", "SystemRun", "SystemRunner", "system_runner"]


def system_runner(
    description: Description, backend: str = "numpy", settings: Settings | None = None
) -> SystemRunner:
    """Return a described system on a back end.

    Parameters
    ----------
    description : Description
        What `strapgen.navigation.systems.wiring.described` returned.
    backend : str, optional
        A key of `strapgen.BACKENDS`.
    settings : Settings, optional
        Word, rounding and error feedback in fixed point where a stage states none.

    Raises
    ------
    InputError
        If a name is not known, or a stage does not go with the settings.
    CompilerError
        If the back end needs a C compiler and there is none.
    """
    entry = BACKENDS[checks.choice("backend", backend, BACKENDS)]
    chosen = fitted_settings(backend, settings)
    if entry.target not in TARGETS:
        sources = {name: sources_of_choice(c, entry.target) for name, c in description.choices.items()}
        return SystemRunner(Fitted(description, entry.target, None, sources), backend)
    fit = fitted(description, entry.target, chosen)
    compiled = TARGETS[entry.target].compiled
    return (CompiledSystem if compiled else SystemRunner)(fit, backend)
