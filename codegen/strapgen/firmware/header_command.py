"""Reads the command in the header of a generated file as data; nothing in it is executed or written.

Generated files are back ends of comparisons too: `file_backend` of one function, `runner_of_file` of a described system
or of two speeds.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen.cli import generate_command
from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import CommandOptions, Option
from strapgen.cli.options import MethodOptions
from strapgen.design import window_command
from strapgen.firmware.verification import file_backend as file_backend
from strapgen.firmware.verification import paths_of, sources_of_files, whole_header
from strapgen.ir import checks
from strapgen.ir.checks import alternatives
from strapgen.ir.exceptions import InputError
from strapgen.navigation.preintegration import preintegrate_command
from strapgen.navigation.systems import system_command as system
from strapgen.navigation.two_speed import two_speed_command as two_speed
from strapgen.run.standard_tree import command_of, text_of
from strapgen.stamped import stamped_command
from strapgen.storage import streams

if TYPE_CHECKING:
    from fractions import Fraction

    from strapgen.ir.fixed_settings import Settings
    from strapgen.ir.sources import Sources
    from strapgen.navigation.systems.fitting import GeneratedStages
    from strapgen.navigation.systems.system_comparison import RunsSamples
    from strapgen.navigation.systems.wiring import Description
    from strapgen.run.kernel_sources import Request


#: The commands that generate C; a header can state these alone.
COMMANDS: dict[str, Callable[..., Any]] = {
    "generate": generate_command.generate,
    "two-speed": two_speed.two_speed,
    "window generate": window_command.generate,
    "stamped": stamped_command.stamped_grid,
    "system": system.system,
    "preintegrate": preintegrate_command.preintegrate,
}
#: Parameters of these commands that say what is generated. All others write, print or ask for files beside it.
_VALUES = {
    *("algorithm", "file", "window", "target", "targets"),
    *("sculling", "sample_hz", "cpu", "name", "prefix", "variant"),
    *("tick_hz", "stamp_bits", "pairs", "input"),
    *(field.name for group in (MethodOptions, FixedOptions) for field in fields(group)),
}


@dataclass(frozen=True)
class HeaderCommand:
    """A command that generates C, with the values that its header states."""

    #: The command as the header has it
    text: str
    #: A key of `COMMANDS`
    name: str
    #: The arguments of the command
    values: Mapping[str, Any]

    def request(self, algorithms: Iterable[str] = ()) -> Request:
        """Return the request of a command that generates one function."""
        values = self.values
        targets = values.get("targets") or ("numpy",)
        if self.name != "generate" or len(targets) > 1:
            raise InputError(f"'{self.text}' does not generate one function")
        _require_named(values["algorithm"], algorithms)
        return generate_command.request(
            values["algorithm"], values["method"], targets[0], values["fixed"], values["output"]
        )

    def whole(self, algorithms: Iterable[str] = ()) -> Sources:
        """Return the files of a command that generates several functions; see `request`."""
        values = self.values
        if self.name == "two-speed":
            from strapgen.navigation.two_speed import two_speed_sources

            return two_speed_sources.sources(*self.two_speed())
        if self.name == "window generate":
            return window_command.generated(
                values["window"],
                values["algorithm"],
                values["target"],
                values["sample_hz"],
                values["fixed"],
                values["output"].name,
            )
        if self.name == "stamped":
            stated = ("sample_hz", "tick_hz", "stamp_bits", "pairs", "target", "fixed")
            return stamped_command.generated(
                **{key: values[key] for key in stated}, name=values["output"].name
            )
        if self.name == "preintegrate":
            from strapgen.navigation.preintegration import preintegration_sources

            method, kind, target = (values[key] for key in ("window", "input", "target"))
            return preintegration_sources.sources(method, kind, target, values["output"].name)
        return self.system(algorithms)[1]

    def system(self, algorithms: Iterable[str] = ()) -> tuple[GeneratedStages, Sources]:
        """Return the generated stages of a described system, and its files; see `request`."""
        from strapgen.navigation.systems import built_in, system_file
        from strapgen.navigation.systems.system_bounds import bounds

        values = self.values
        for stage in system_file.read(built_in.file_of(values["file"])).stages:
            _require_named(stage.kernel, algorithms)
        fit, needs, command = system.fitted_stages(
            values["file"], values["target"], values["sample_hz"], values["cpu"], values["fixed"]
        )
        return fit, system.unit(fit, needs, bounds(fit), command)

    def two_speed(self) -> two_speed.TwoSpeedRequest:
        """Return the request of a two-speed command: algorithm, form of sculling, target and settings."""
        values = self.values
        return two_speed.request(values["algorithm"], values["sculling"], values["target"], values["fixed"])


def read(text: str) -> HeaderCommand:
    """Read a command as data."""
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise InputError(f"the header's command cannot be read ({error}): {text}") from None
    name = next(
        (name for name in COMMANDS if words[: 2 + name.count(" ")] == ["strapgen", *name.split()]), None
    )
    if name is None:
        known = alternatives([f"strapgen {command}" for command in COMMANDS])
        raise InputError(f"the header's command is none that generates C, which are {known}: {text}")
    return HeaderCommand(text, name, _values(name, words[2 + name.count(" ") :], text))


def read_file(file: Path) -> HeaderCommand:
    """Read the command that a generated file states."""
    return read(command_of(text_of(file)) or "")


def header_command_of(file: Path) -> HeaderCommand:
    """Return the command in the header of a generated function."""
    return read_file(paths_of(file)[0])


def _values(name: str, words: list[str], text: str) -> dict[str, Any]:
    """Return the arguments of a command from the words behind its name."""
    options: CommandOptions = COMMANDS[name].__dict__["options"]
    known = {
        spelling: one for key, one in options.options.items() if key in _VALUES for spelling in one.spellings
    }
    argument = next((one for one in options.options.values() if one.is_argument), None)
    stated: dict[str, list[str]] = {}
    rest = iter(words)
    for word in rest:
        spelling, equals, value = word.partition("=")
        option = known.get(spelling) if word.startswith("-") else argument
        if option is None:
            raise InputError(f"{spelling} is no option that says what strapgen {name} generates: {text}")
        if option is argument:
            value = word
        elif option.kind is not bool:
            value = value if equals else next(rest, "")
            if not value or (not equals and value.startswith("--")):
                raise InputError(f"{spelling} has no value in the header's command: {text}")
        stated.setdefault(option.parameter.name, []).append(value)
    if argument is not None and argument.parameter.name not in stated:
        raise InputError(f"the header's command names nothing to generate: {text}")
    given = {key: _value(options.options[key], values, text) for key, values in stated.items()}
    if name in ("window generate", "preintegrate") and "window" in given:
        _regular(given["window"])
    return options.typed(given)


def _value(option: Option, words: list[str], text: str) -> Any:
    """Return the words of one option or argument as Typer has them."""
    if option.kind in (list, dict):
        return words
    if len(words) > 1:
        name = option.parameter.name.replace("_", "-")
        raise InputError(f"the header's command states {name} {len(words)} times: {text}")
    if option.kind is bool:
        return True
    return _regular(words[0]) if option.kind is Path else words[0]


def _regular(word: str) -> Path:
    """Return a path; one that is there must be a regular file, since others can wait or have effects.

    Files of the kernel, which can wait too, have no size.
    """
    path = Path(word)
    if path == streams.STANDARD:
        raise InputError("the header's command reads standard input, which nobody has kept")
    if path.exists() and not (path.is_file() and path.stat().st_size):
        raise InputError(f"{word} in the header's command is no regular file, or empty")
    return path


def _require_named(algorithm: str, algorithms: Iterable[str]) -> None:
    """Refuse a user's algorithm, which runs as a program, unless the command line names it too."""
    from strapgen.catalogue.names import reserved
    from strapgen.catalogue.user import loading

    if algorithm in reserved() or not (algorithm.endswith(".py") or algorithm in loading.installed()):
        return
    if not any(algorithm == name or _same(algorithm, name) for name in algorithms):
        raise InputError(
            f"the header names {algorithm}, a user's algorithm, which would run as a program; --algorithm {algorithm} "
            "allows it"
        )


def _same(one: str, other: str) -> bool:
    return one.endswith(".py") and Path(one).resolve() == Path(other).resolve()


def runner_of_file(
    file: Path, description: Description, algorithms: Iterable[str], run_differing: bool
) -> tuple[RunsSamples, Settings | None]:
    """Return a runner of a file, and the settings in its header."""
    header = whole_header(file)
    if header is None:
        raise InputError(f"{file} is no source or header of a described system or of two speeds")
    command = read_file(header)
    of_kind = {"system": _of_system, "two-speed": _of_loops}
    if command.name not in of_kind:
        raise InputError(
            f"{file} comes from strapgen {command.name}; that of a described system or of two speeds is needed"
        )
    return of_kind[command.name](header, command, description, algorithms, run_differing)


def _of_system(
    header: Path,
    command: HeaderCommand,
    description: Description,
    algorithms: Iterable[str],
    run_differing: bool,
) -> tuple[RunsSamples, Settings | None]:
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
