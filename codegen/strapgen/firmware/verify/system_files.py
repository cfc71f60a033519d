"""Files of described systems and of two speeds as more back ends of a system that is compared."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from fractions import Fraction

    from strapgen.firmware.verify.header_command import HeaderCommand
    from strapgen.ir.fixed_settings import Settings
    from strapgen.navigation.systems.system_comparison import RunsSamples
    from strapgen.navigation.systems.wiring import Description


def runner_of_file(
    file: Path, description: Description, algorithms: Iterable[str], run_differing: bool
) -> tuple[RunsSamples, Settings | None]:
    """Return what runs a file as it stands, and the settings that its header states."""
    from strapgen.firmware.verify import header_command
    from strapgen.firmware.verify.whole_verification import whole_header
    from strapgen.run.generated_files import command_of, text_of

    header = whole_header(file)
    if header is None:
        raise InputError(f"{file} is no source or header of a described system or of two speeds")
    command = header_command.read(command_of(text_of(header)) or "")
    of_kind = {"system": _of_system, "two-speed": _of_loops}
    if command.name not in of_kind:
        raise InputError(
            f"{file} is a commit-late unit; one of a described system or of two speeds is needed"
        )
    return of_kind[command.name](header, command, description, algorithms, run_differing)


def _of_system(
    header: Path,
    command: HeaderCommand,
    description: Description,
    algorithms: Iterable[str],
    run_differing: bool,
) -> tuple[RunsSamples, Settings | None]:
    from strapgen.firmware.verify.whole_verification import sources_of_files
    from strapgen.navigation.systems.system_runner import CompiledSystem
    from strapgen.run.backends import BACKENDS

    fit, sources = command.system(algorithms)
    _require_rate(header, fit.description.system.sample_hz, description)
    if fit.description.system != description.system:
        raise InputError(
            f"{header} is {fit.description.system.name} as {command.values['file']} describes it, and another "
            f"{description.system.name} is compared"
        )
    of_target = next(name for name, entry in BACKENDS.items() if entry.target == fit.target)
    files = sources_of_files(header, sources, run_differing=run_differing)
    return CompiledSystem(fit, of_target, files), fit.settings


def _of_loops(
    header: Path,
    command: HeaderCommand,
    description: Description,
    algorithms: Iterable[str],
    run_differing: bool,
) -> tuple[RunsSamples, Settings | None]:
    from strapgen.firmware.verify.whole_verification import sources_of_files
    from strapgen.navigation.two_speed import two_speed_sources
    from strapgen.navigation.two_speed.two_speed_runner import LoopFiles, LoopSources, TwoSpeed

    request, system = command.two_speed(), description.system
    kernels = two_speed_sources.kernels(request.algorithm, request.sculling)
    if tuple(stage.kernel for stage in system.stages) != kernels:
        raise InputError(f"{header} has the loops {', '.join(kernels)}, which are not those of {system.name}")
    words = [] if request.settings is None else request.settings.stated.split()
    if "--sample-hz" in words:
        stated = checks.number("--sample-hz", words[words.index("--sample-hz") + 1])
        _require_rate(header, stated, description)
    files = sources_of_files(header, two_speed_sources.sources(*request), run_differing=run_differing)
    parts = LoopSources(two_speed_sources.loops(*request), system, files)
    return LoopFiles(TwoSpeed.of_sources(str(header), parts), system), request.settings


def _require_rate(header: Path, sample_hz: Fraction, description: Description) -> None:
    """Refuse files for another rate of the samples."""
    here = description.system.sample_hz
    if sample_hz != here:
        raise InputError(
            f"{header} is for {float(sample_hz):g} Hz, and {float(here):g} Hz is compared; --step sets it"
        )
