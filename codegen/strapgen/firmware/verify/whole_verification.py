"""Holds the files of a command that generates several functions to it: their text, and what the functions compute."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from strapgen.firmware.verify.verification import Verification, differing_lines, present_runs, verify
from strapgen.ir.exceptions import InputError
from strapgen.ir.sources import Sources
from strapgen.results.records import entry, properties
from strapgen.results.result import Result
from strapgen.run.kernel_sources import Request
from strapgen.run.standard_tree import command_of, text_of

#: What the commands begin with that generate several functions and a whole that calls them.
_COMMANDS = ("strapgen system ", "strapgen two-speed ", "strapgen window generate ")
_VERSION = re.compile(r'_VERSION "(.*)"')


@dataclass(frozen=True)
class WholeVerification(Result):
    """What the generated files of a whole were found to be."""

    computed = properties(holds=entry())

    #: Header of the whole
    header: Path
    #: Number of files that were compared
    files: int
    #: What differs from generated files, a line of text each; empty if nothing does
    differences: tuple[str, ...]
    #: The function of each stage, held to its contract
    stages: tuple[Verification, ...]

    @property
    def holds(self) -> bool:
        """Whether all files are in step, and every stage computes what it promises."""
        return not self.differences and all(stage.holds for stage in self.stages)

    def text(self) -> str:
        """Return the differences, and what the calls of each stage returned."""
        state = "out of step" if self.differences else "in step"
        lines = [*self.differences, f"{self.header}: {self.files} files, {state} with the command"]
        return "\n".join([*lines, *(f"{stage.file.stem}: {stage.in_words}" for stage in self.stages)])


def whole_header(place: Path) -> Path | None:
    """Return the header of a whole: in a folder, or the named file; None for a file of another kind."""
    if not place.is_dir():
        header = place.with_suffix(".h")
        return header if place.suffix in (".c", ".h") and _is_whole(header) else None
    headers = sorted(path for path in place.glob("*.h") if _is_whole(path))
    if len(headers) != 1:
        names = ", ".join(path.name for path in headers) or "none"
        raise InputError(
            f"{place} holds {names} of the headers of a system, of two speeds or of a commit-late unit; a folder with "
            "one is needed"
        )
    return headers[0]


def _is_whole(header: Path) -> bool:
    if not header.is_file():
        return False
    command = command_of(text_of(header)) or ""
    return command.startswith(_COMMANDS) and not command.endswith((" --with-runs", " --project"))


def verify_whole(
    header: Path, sources: Sources, stages: Mapping[str, Request], *, run_differing: bool = False
) -> WholeVerification:
    """Compare the files of a whole with generated ones, and hold its stages to their contracts."""
    folder, generated = header.parent, sources.step_files
    here = _present(header, sources)
    expected = [*generated, *(present_runs(folder, sources))]
    checked = tuple(
        verify(folder / name, request, run_differing=run_differing)
        for name, request in stages.items()
        if all((folder / name).with_suffix(ending).is_file() for ending in (".h", ".c"))
    )
    return WholeVerification(
        header, len(expected), tuple(_differences(header, sources, here, expected)), checked
    )


def sources_of_files(header: Path, sources: Sources, *, run_differing: bool = False) -> Sources:
    """Return the sources of a whole with the text of its files, which must be what their command generates."""
    here = _present(header, sources)
    expected = [*sources.step_files, *(present_runs(header.parent, sources))]
    difference = next(_differences(header, sources, here, expected), None)
    if difference is not None and not run_differing:
        raise InputError(f"{difference}; --run-differing compiles and runs the file as it stands")
    return replace(sources, files={**sources.files, **here})


def _present(header: Path, sources: Sources) -> dict[str, str]:
    """Return the text of the files of a whole that are there."""
    folder = header.parent
    here = {name: text_of(folder / name) for name in sources.step_files if (folder / name).is_file()}
    return here | {name: text for name, text in present_runs(folder, sources).items() if text}


def _differences(
    header: Path, sources: Sources, here: Mapping[str, str], expected: Iterable[str]
) -> Iterator[str]:
    """Yield what differs from generated files, a line of text each."""
    if header.name not in sources.step_files:
        first = next(name for name in sources.step_files if name.endswith(".h"))
        yield f"{header}: other options: the command in it generates {first}"
    for name in expected:
        path, text = header.parent / name, sources.files[name]
        if name in here:
            yield from differing_lines(path, here[name], text, _reason(here[name], text))
        else:
            yield f"{path}: is not there"


def _reason(here: str, generated: str) -> str:
    """Return why a file may differ from the generated one."""
    old, new = _VERSION.search(here), _VERSION.search(generated)
    if old is not None and new is not None and old[1] != new[1]:
        return f"strapgen {old[1]}, this is {new[1]}"
    if command_of(here) != command_of(generated):
        return "other options"
    return "edited"
