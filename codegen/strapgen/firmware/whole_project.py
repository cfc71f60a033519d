"""Returns the files of a project around C of several functions: a described system, or a late commit by a window."""

from __future__ import annotations

from collections.abc import Mapping

from strapgen.cli.project_kinds import DEFAULT, kinds
from strapgen.firmware import header_command
from strapgen.firmware.fmu import archive, units
from strapgen.firmware.project import Project, with_kind
from strapgen.firmware.project import refuse_changed as refuse_changed
from strapgen.firmware.prototypes import prototypes
from strapgen.firmware.vectors import vectors_of_choice
from strapgen.ir.exceptions import InputError
from strapgen.ir.sources import Sources
from strapgen.navigation.systems.fitting import GeneratedStages
from strapgen.run.standard_tree import command_of
from strapgen.targets.rendering import render


def project_files(
    sources: Sources, fit: GeneratedStages | None = None, *, kind: str = DEFAULT
) -> Mapping[str, str | bytes]:
    """Return the files of a project around the C of several functions, each of which has test vectors.

    `fit`: the stages of a described system, whose outputs the main program prints; None of a late commit, which has the
    attitude of now.
    """
    name, tables = sources.function.name, []
    header = sources.step_files[f"{name}.h"]
    command_line = with_kind(command_of(header) or "", kind)
    if kind in archive.VERSIONS:
        if fit is None:
            raise InputError(f"--project {kind} goes with generate, two-speed and system")
        return archive.project_files(units.of_system(fit, sources, command_line), kind)
    for file, text in sources.step_files.items():
        stated = command_of(text) or ""
        if file.endswith(".h") and stated.startswith("strapgen generate "):
            command = header_command.read(stated)
            choice, target, settings, naming = command.request([command.values["algorithm"]])
            tables.append(vectors_of_choice(choice, target, settings, kinds()[kind].vectors, naming=naming))
    system = None if fit is None else fit.description.system
    known = {one.name.removeprefix(f"{name}_"): one for one in prototypes(header)}
    begin, step = ("begin", "cycle") if system else ("init", "push")
    main = render(
        "project_c/main_whole.c.j2",
        name=name,
        command=command_line,
        begin=known[begin].name,
        step=known[step],
        now=known.get("now"),
        outputs={} if system is None else {one: system.cell(one).signal.size for one in system.outputs},
    )
    return Project(sources, command_line, main, tables).files(kind)
