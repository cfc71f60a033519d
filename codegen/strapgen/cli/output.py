"""Options for the output of a command, on the terminal or in files written whole or not at all."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from strapgen.cli import project_kinds, terminal
from strapgen.cli.options import option
from strapgen.ir import checks
from strapgen.ir.checks import alternatives
from strapgen.ir.exceptions import InputError
from strapgen.storage import streams

if TYPE_CHECKING:
    from strapgen.results.result import Result

_TABLE = ("text", "json", "csv", "markdown", "latex")
_PLAIN = ("text", "json")
#: The value of --out that stands for the terminal.
_TERMINAL = streams.STANDARD


def format_option(formats: tuple[str, ...], default: str = "") -> Any:
    """Return the option --format; `default` tells of its default in words, where that depends."""
    return option(
        "--format",
        metavar="NAME",
        help=f"Format of the output: {alternatives([*formats])}.{default}",
        panel="Output",
        words=formats,
    )


def plot_option(what: str) -> Any:
    """Return the option --plot with a help text on its picture."""
    return option("--plot", metavar="FILE", help=f"Image file for {what}; its ending says the type.")


#: The format of a command that writes source files.
Format = Annotated[str, format_option(_PLAIN)]
#: The folder of a command that writes source files.
Folder = Annotated[
    Path | None,
    option("--out", metavar="FOLDER", help="Folder for the files.  [default: here]", panel="Output"),
]
#: The folder of a command that may write none.
NewFolder = Annotated[
    Path | None,
    option("--out", metavar="FOLDER", help="Folder for the files.  [default: no files]", panel="Output"),
]
WithRuns = Annotated[
    bool,
    option(
        "--with-runs",
        help="In C: write the loops over samples and runs too, for simulations on a host.",
        panel="Output",
    ),
]
#: The kind of a project that builds and tests the C.
Project = Annotated[
    str | None,
    option(
        "--project",
        metavar="KIND",
        help="In C: write a project for a build: cmake, zephyr, esp-idf, platformio, arduino, python, fmu2 or fmu3.  "
        f"[without a value: {project_kinds.DEFAULT}]",
        panel="Output",
        read=project_kinds.read_kind,
        words="strapgen.cli.project_kinds:titles",
    ),
]


@dataclass(frozen=True)
class Output:
    """Options for the place and the format of a result."""

    panel: ClassVar[str] = "Output"
    formats: ClassVar[tuple[str, ...]] = _TABLE

    out: Annotated[
        Path | None,
        option("--out", metavar="FILE", help="File for the output; - is the terminal.  [default: -]"),
    ] = None
    plot: Annotated[Path | None, plot_option("the plot")] = None
    format: Annotated[str | None, format_option(_TABLE)] = "text"

    def check(self, *read: str | Path | None) -> None:
        """Check the format, the type of the image, and that no file is written over another or one that is read."""
        if self.format is not None:
            checks.choice("format", self.format, self.formats)
        if self.plot == _TERMINAL:
            raise InputError("--plot - is no file; an image is not written to the terminal")
        if self.file is not None and self.plot is not None and self.file.resolve() == self.plot.resolve():
            raise InputError(f"--out and --plot are both {self.out}; two files are needed")
        files = {os.path.realpath(path) for path in read if path is not None and Path(path).is_file()}
        for name, path in (("--out", self.file), ("--plot", self.plot)):
            if path is not None and os.path.realpath(path) in files:
                raise InputError(f"{name} {path} is a file that the command reads; another one is needed")
        if self.plot is not None:
            from strapgen.results.figures import require_kind

            require_kind(self.plot)

    @property
    def file(self) -> Path | None:
        """The file for the output; None for the terminal."""
        return None if self.out == _TERMINAL else self.out

    def show(self, result: Result) -> None:
        """Deliver a result in the format of the options, and its plot if one is asked for."""
        from strapgen.results.result import plot

        text = result.written(self.format or "text")
        self.deliver(text, None if self.plot is None else plot(result, self.plot))

    def deliver(self, content: str | bytes, image: bytes | None = None) -> None:
        """Print the text, or write it and the image into their files, all or none; stderr names those written."""
        from strapgen.storage.files import write_files

        files: dict[str, str | bytes] = {}
        if isinstance(content, str):
            content = f"{content.rstrip(chr(10))}\n"
        if self.file is not None:
            files[str(self.file)] = content
        if self.plot is not None and image is not None:
            files[str(self.plot)] = image
        written = write_files(Path(), files)
        if self.file is None and isinstance(content, str):
            terminal.write(content.rstrip("\n"))
        if written:
            terminal.remark(f"wrote {' and '.join(map(str, written))}")


#: The options of a result without a picture.
TEXT_OUTPUT = ("out", "format")


def check_format(value: str) -> str:
    """Check the value of --format of a command that writes source files."""
    return checks.choice("format", value, _PLAIN)


def show(result: Result, format: str) -> None:
    """Print the result of a command that writes source files."""
    terminal.write(result.written(format).rstrip("\n"))
