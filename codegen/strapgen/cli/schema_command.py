"""The command ``strapgen schema``: JSON Schemas of results and of users' files."""

from __future__ import annotations

from typing import Annotated

import typer

from strapgen import registration
from strapgen.cli.option_groups import grouped
from strapgen.cli.options import option
from strapgen.cli.output import Folder
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError


@grouped
def schema(
    name: Annotated[
        str | None,
        typer.Argument(metavar="NAME", help="Name of a result or of a kind of files.  [default: list them]"),
    ] = None,
    *,
    all_: Annotated[
        bool, option("--all", help="Write those of all results as files.", panel="Output")
    ] = False,
    out: Folder = None,
) -> None:
    """Print the JSON Schema of a result or of users' files.

    JSON says its schema under the key schema, as strapgen/comparison/1; a list says it in each row. Kinds of files end
    with .toml; their schemas come with the package too, in its folder schemas.

    Example: strapgen schema comparison

    Example: strapgen schema tableau.toml

    Example: strapgen schema --all --out out/schemas
    """
    from pathlib import Path

    from strapgen.results.result import as_json
    from strapgen.storage.files import write_files

    known = registration.schemas()
    if all_ and name is not None:
        raise InputError(f"--all writes all schemas; {name} does not go with it")
    if out is not None and not all_:
        raise InputError("--out goes with --all")
    if all_:
        files = {
            f"{name}.json": f"{as_json(one.read())}\n" for name, one in known.items() if one.kind == "result"
        }
        written = write_files(out or Path(), files)
        typer.echo(f"{out or Path()}: {len(written)} schemas")
    elif name is None:
        typer.echo("\n".join(f"{one.kind}  {name}" for name, one in known.items()))
    else:
        typer.echo(as_json(known[checks.choice("schema", name, known)].read()))
