"""Holds the generated C of a described system to its command: the text of every file, and what its stages compute."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from strapgen.experiments.verification import Verification, differing_lines, verify
from strapgen.library.generated_files import command_of, text_of
from strapgen.library.generation import Request
from strapgen.support.exceptions import InputError

_COMMAND = "strapgen system "
_VERSION = re.compile(r'_VERSION "(.*)"')


@dataclass(frozen=True)
class SystemVerification:
    """What the generated files of a system were found to be.

    Parameters
    ----------
    header : Path
        Header of the whole.
    files : int
        Number of files that its command generates.
    differences : tuple of str
        What differs from them, a line of text each; empty if nothing does.
    stages : tuple of Verification
        The function of each stage, held to its contract.
    """

    header: Path
    files: int
    differences: tuple[str, ...]
    stages: tuple[Verification, ...]

    @property
    def holds(self) -> bool:
        """Whether all files are in step, and every stage computes what it promises."""
        return not self.differences and all(stage.holds for stage in self.stages)


def system_header(place: Path) -> Path | None:
    """Return the header of a system's C: in a folder, or the named file; None for a file of another kind.

    Raises
    ------
    InputError
        If a folder holds none, or several.
    """
    if not place.is_dir():
        header = place.with_suffix(".h")
        return header if place.suffix in (".c", ".h") and _is_system(header) else None
    headers = sorted(path for path in place.glob("*.h") if _is_system(path))
    if len(headers) != 1:
        names = ", ".join(path.name for path in headers) or "none"
        raise InputError(
            f"{place} holds {names} of the headers of strapgen system; a folder with one is needed"
        )
    return headers[0]


def _is_system(header: Path) -> bool:
    if not header.is_file():
        return False
    text = text_of(header)
    return (command_of(text) or "").startswith(_COMMAND) and "_runs_h" not in text[:4000]


def verify_system(
    header: Path, generated: Mapping[str, str], stages: Mapping[str, Request]
) -> SystemVerification:
    """Compare the files of a system with generated ones, and hold its stages to their contracts.

    Parameters
    ----------
    header : Path
        Header of the whole.
    generated : mapping of str to str
        The text that its command generates, by file name.
    stages : mapping of str to Request
        What generates each stage, by the name of its header.

    Returns
    -------
    SystemVerification

    Raises
    ------
    CompilerError
        If a stage in step does not compile.
    """
    folder, lines = header.parent, []
    if header.name not in generated:
        first = next(name for name in generated if name.endswith(".h"))
        lines.append(f"{header}: other options: the command in it generates {first}")
    for name, text in generated.items():
        path = folder / name
        if path.is_file():
            here = text_of(path)
            lines += differing_lines(path, here, text, _reason(here, text))
        else:
            lines.append(f"{path}: is not there")
    checked = tuple(
        verify(folder / name, request)
        for name, request in stages.items()
        if all((folder / name).with_suffix(ending).is_file() for ending in (".h", ".c"))
    )
    return SystemVerification(header, len(generated), tuple(lines), checked)


def _reason(here: str, generated: str) -> str:
    """Return why a file may differ from the generated one."""
    old, new = _VERSION.search(here), _VERSION.search(generated)
    if old is not None and new is not None and old[1] != new[1]:
        return f"strapgen {old[1]}, this is {new[1]}"
    if command_of(here) != command_of(generated):
        return "other options"
    return "edited"
