"""strapgen generate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from strapgen.cli.fixed_options import (
    Allowance,
    Carry,
    Fixes,
    MaxAngle,
    MaxRate,
    Ranges,
    Rounding,
    Step,
    Word,
    read_settings,
)
from strapgen.cli.options import (
    Format,
    Increments,
    Method,
    Previous,
    Rates,
    TableauFile,
    check_format,
    chosen,
    print_json,
)
from strapgen.cli.progress import track
from strapgen.support.exceptions import InputError


def generate(
    algorithm: Annotated[
        str | None,
        typer.Argument(
            help="dcm, euler, cayley-klein, another kernel of strapgen list, or your own Python file."
        ),
    ] = None,
    method: Method = None,
    tableau: TableauFile = None,
    increments: Increments = None,
    previous: Previous = None,
    rates: Rates = False,
    target: Annotated[
        str | None,
        typer.Option(
            "--target",
            help="numpy, c, c-float, c-fixed or fixed-model.  [default: numpy]",
            show_default=False,
        ),
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
    word: Word = None,
    max_rate_deg_s: MaxRate = None,
    step: Step = None,
    max_angle_rad: MaxAngle = None,
    rounding: Rounding = None,
    carry: Carry = None,
    drift_allowance: Allowance = None,
    ranges: Ranges = None,
    fix: Fixes = None,
    format: Format = "text",
) -> None:
    """Generate source code for an algorithm, or for the standard catalogue.

    Fixed point is made for a largest increment: state the largest rate and the step.

    Example:

    \b
      strapgen generate euler --method rk4 --increments 2 --target c --out firmware

    \b
      strapgen generate euler --target c-fixed --word 32 \\
        --max-rate-deg-s 400 --step 0.01 --out firmware
    """  # noqa: D301
    check_format(format)
    if check and not all_:
        raise InputError("--check goes with --all")
    stated: dict[str, Any] = {
        "word": word,
        "max_rate_deg_s": max_rate_deg_s,
        "step": step,
        "max_angle_rad": max_angle_rad,
        "rounding": rounding,
        "carry": carry,
        "drift_allowance": drift_allowance,
        "ranges": ranges,
        "formats": fix,
    }
    if all_:
        for name, value in (
            ("an algorithm", algorithm),
            ("--method", method),
            ("--tableau", tableau),
            ("--increments", increments),
            ("--previous", previous),
            ("--rates", rates or None),
            ("--target", target),
            ("a fixed-point option", next(filter(None, stated.values()), None)),
        ):
            if value is not None:
                raise InputError(f"--all generates the whole catalogue; {name} does not go with it")
        _generate_all(out, check, format)
        return
    if algorithm is None:
        raise InputError("an algorithm is needed, or --all; strapgen list shows them")
    from strapgen import pipeline
    from strapgen.library import generated_sources
    from strapgen.support import checks
    from strapgen.support.files import write_files
    from strapgen.targets import FIXED, TARGETS

    choice = chosen(algorithm, method, tableau, increments, previous, rates, step=False)
    settings = read_settings(choice.increments_per_step, **stated)
    target = checks.choice("target", "numpy" if target is None else target, TARGETS)
    if settings is not None and target not in FIXED:
        raise InputError(
            f"the options of fixed point go with --target {' or '.join(FIXED)}, not with {target}"
        )
    if max_rate_deg_s or step or max_angle_rad:
        names = {signal.name for signal in generated_sources.program(choice).inputs}
        if not names & {"increments", "turns"}:
            raise InputError(
                f"kernel {choice.kernel} takes no increments; a largest rate or angle does not go with it"
            )
    sources = generated_sources.sources(choice, target, settings)
    fixed = sources.fixed
    if carry not in (None, "none") and fixed is not None and not fixed.residuals:
        raise InputError(
            f"kernel {choice.kernel} rounds no state that goes on to the next step; --carry keeps nothing"
        )
    written = write_files(out or Path(), sources.files)
    operations = sources.operations
    if format == "json":
        data = {
            "kernel": sources.kernel,
            "target": target,
            "files": [str(path) for path in written],
            "operations": {kind: operations[kind] for kind in ("add", "multiply", "divide", "sqrt")},
            "temporaries": sources.temporaries,
        }
        if fixed is not None:
            program = generated_sources.program(choice)
            data |= pipeline.quantize(program, fixed.settings).as_data()
        print_json(data)
        return
    counts = ", ".join(f"{number} {kind}" for kind, number in operations.items() if number) or "no operations"
    typer.echo(f"{sources.kernel} for {target}: {counts}, {sources.temporaries} temporaries")
    for path in written:
        typer.echo(f"  {path}")
    if fixed is not None:
        for output in fixed.outputs:
            bound, unit = max(output.errors), output.format.unit
            places = float(bound / unit)
            useless = 2 * bound >= max(abs(output.low), abs(output.high)) * unit
            typer.echo(
                f"  {output.signal.name}: {output.format}, error at most {float(bound):.4g}, "
                f"{places:.4f} of the last place"
                + (": of the size of the value, which certifies nothing" if useless else "")
            )


def _generate_all(out: Path | None, check: bool, format: str) -> None:
    from strapgen import catalogue
    from strapgen.library import standard_tree
    from strapgen.support import resources
    from strapgen.support.files import check_folder

    if out is None:
        in_place = resources.checkout() is not None or check
        out = resources.folder("generated") if in_place else Path("generated")
    if check and not out.is_dir():
        raise InputError(f"{out} is no folder; --check needs the one to look at")
    if not check:
        check_folder(out)  # known before the derivation of all kernels
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
