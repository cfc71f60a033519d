"""strapgen generate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from strapgen.cli.options import Format, Increments, Method, Rates, check_format, print_json, whole
from strapgen.cli.progress import track
from strapgen.exceptions import InputError


def generate(
    algorithm: Annotated[
        str | None, typer.Argument(help="dcm, euler, cayley-klein, or another kernel; see strapgen list.")
    ] = None,
    method: Method = None,
    increments: Increments = None,
    rates: Rates = False,
    target: Annotated[
        str | None,
        typer.Option("--target", help="numpy, c or c-float.  [default: numpy]", show_default=False),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Folder to write to.  [default: here; generated/ with --all]", show_default=False
        ),
    ] = None,
    all_: Annotated[bool, typer.Option("--all", help="Rebuild the whole standard catalogue.")] = False,
    check: Annotated[
        bool, typer.Option("--check", help="With --all: write nothing, exit 1 with a diff if out of step.")
    ] = False,
    format: Format = "text",
) -> None:
    """Generate source code for an algorithm, or for the standard catalogue.

    Example: strapgen generate euler --method rk4 --increments 2 --target c --out firmware
    """
    check_format(format)
    if check and not all_:
        raise InputError("--check goes with --all")
    if all_:
        for name, value in (
            ("an algorithm", algorithm),
            ("--method", method),
            ("--increments", increments),
            ("--rates", rates or None),
            ("--target", target),
        ):
            if value is not None:
                raise InputError(f"--all generates the whole catalogue; {name} does not go with it")
        _generate_all(out, check, format)
        return
    if algorithm is None:
        raise InputError("an algorithm is needed, or --all; strapgen list shows them")
    from strapgen import checks, output, pipeline
    from strapgen.targets import TARGETS

    target = checks.choice("target", "numpy" if target is None else target, TARGETS)
    program = pipeline.lower(pipeline.derive(algorithm, method, whole("increments", increments), rates=rates))
    sources = pipeline.generate(program, target)
    written = output.write_files(out or Path(), sources.files)
    operations = sources.operations
    if format == "json":
        print_json(
            {
                "kernel": sources.kernel,
                "target": target,
                "files": [str(path) for path in written],
                "operations": {kind: operations[kind] for kind in ("add", "multiply", "divide", "sqrt")},
                "temporaries": sources.temporaries,
            }
        )
        return
    counts = ", ".join(f"{number} {kind}" for kind, number in operations.items() if number) or "no operations"
    typer.echo(f"{sources.kernel} for {target}: {counts}, {sources.temporaries} temporaries")
    for path in written:
        typer.echo(f"  {path}")


def _generate_all(out: Path | None, check: bool, format: str) -> None:
    from strapgen import catalogue, resources, standard_tree

    if out is None:
        in_place = resources.checkout() is not None or check
        out = resources.folder("generated") if in_place else Path("generated")
    if check and not out.is_dir():
        raise InputError(f"{out} is no folder; --check needs the one to look at")
    total = len(catalogue.standard())
    files = standard_tree.tree(track(standard_tree.programs(), "deriving", total))
    if check:
        difference = standard_tree.difference(out, files)
        if format == "json":
            print_json({"in_step": not difference, "difference": difference})
        elif difference:
            typer.echo(difference, nl=False)
        if difference:
            typer.echo(f"strapgen: {out} is out of step; strapgen generate --all rebuilds it", err=True)
            raise typer.Exit(1)
        if format == "text":
            typer.echo(f"{out}: {len(files)} files, in step")
        return
    written = standard_tree.write(out, files)
    if format == "json":
        print_json({"files": [str(path) for path in written]})
    else:
        typer.echo(f"{out}: {len(written)} files of {total} kernels")
