"""Options for the output of a command, which goes to the terminal or into files written whole or not at all."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

import typer

from strapgen.support import checks
from strapgen.support.exceptions import InputError

Format = Annotated[str, typer.Option("--format", help="Format of the output: text or json.")]


@dataclass(frozen=True)
class Output:
    """Options that say where the output goes, and in which format."""

    out: Annotated[
        Path | None,
        typer.Option("--out", help="File for the output.  [default: the terminal]", show_default=False),
    ] = None
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Image file for the plot.", show_default=False)
    ] = None
    format: Annotated[
        str | None, typer.Option("--format", help="Format of the output: text, json or csv.")
    ] = "text"
    formats: ClassVar[tuple[str, ...]] = ("text", "json", "csv")

    def check(self, *read: str | Path | None) -> None:
        """Check the format, and that output and plot have files of their own, none of which the command reads."""
        if self.format is not None:
            checks.choice("format", self.format, self.formats)
        if self.out is not None and self.plot is not None and self.out.resolve() == self.plot.resolve():
            raise InputError(f"--out and --plot are both {self.out}; two files are needed")
        files = {os.path.realpath(path) for path in read if path is not None and Path(path).is_file()}
        for option, path in (("--out", self.out), ("--plot", self.plot)):
            if path is not None and os.path.realpath(path) in files:
                raise InputError(f"{option} {path} is a file that the command reads; another one is needed")

    def deliver(self, text: str, image: bytes | None = None) -> None:
        """Print the text, or write it and the image into their files, all or none; stderr says which were written."""
        from strapgen.support.files import write_files

        text = text.rstrip("\n")
        files: dict[str, str | bytes] = {}
        if self.out is not None:
            files[str(self.out)] = f"{text}\n"
        if self.plot is not None and image is not None:
            files[str(self.plot)] = image
        written = write_files(Path(), files)
        if self.out is None:
            typer.echo(text)
        if written:
            typer.echo(f"wrote {' and '.join(map(str, written))}", err=True)


def check_format(value: str, *more: str) -> str:
    """Check the value of --format: text, json, or one of `more`."""
    return checks.choice("format", value, ["text", "json", *more])


def as_json(data: Any) -> str:
    """Return data as JSON: a list on one line, an object indented."""
    return json.dumps(data, indent=None if isinstance(data, list) else 1)


def print_json(data: Any) -> None:
    """Print data as JSON; see `as_json`."""
    sys.stdout.write(as_json(data) + "\n")
