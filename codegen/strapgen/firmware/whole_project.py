"""Returns the files of a project around C of several functions: a described system, or a late commit by a window."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from strapgen.cli.project_kinds import DEFAULT, kinds
from strapgen.firmware import header_command
from strapgen.firmware.project import Project, with_kind
from strapgen.firmware.project import refuse_changed as refuse_changed
from strapgen.firmware.prototypes import prototypes
from strapgen.firmware.vectors import vectors_of_choice
from strapgen.ir.sources import Sources
from strapgen.run.standard_tree import command_of
from strapgen.targets.rendering import render


def project_files(
    sources: Sources, outputs: Mapping[str, int] = MappingProxyType({}), *, kind: str = DEFAULT
) -> dict[str, str]:
    """Return the files of a project around the C of several functions, each of which has test vectors.

    `outputs`: fields of the memory that the main program prints, with their lengths; by default what _now returns.
    """
    name, tables = sources.function.name, []
    header = sources.step_files[f"{name}.h"]
    for file, text in sources.step_files.items():
        stated = command_of(text) or ""
        if file.endswith(".h") and stated.startswith("strapgen generate "):
            command = header_command.read(stated)
            choice, target, settings, naming = command.request([command.values["algorithm"]])
            tables.append(vectors_of_choice(choice, target, settings, kinds()[kind].vectors, naming=naming))
    command_line = with_kind(command_of(header) or "", kind)
    known = {one.name.removeprefix(f"{name}_"): one for one in prototypes(header)}
    begin, step = ("begin", "cycle") if outputs else ("init", "push")
    main = render(
        "project_c/main_whole.c.j2",
        name=name,
        command=command_line,
        begin=known[begin].name,
        step=known[step],
        now=known.get("now"),
        outputs=outputs,
    )
    return Project(sources, command_line, main, tables).files(kind)
