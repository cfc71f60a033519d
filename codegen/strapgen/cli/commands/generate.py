"""The command ``strapgen generate`` writes the source code of a kernel or of the standard catalogue."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import grouped
from strapgen.cli.options import MethodOptions, OptionalAlgorithm, one, option
from strapgen.cli.output import Format, WithRuns, check_format, print_json
from strapgen.cli.progress import track
from strapgen.support import checks
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.ir.sources import Sources


@grouped
def generate(
    algorithm: OptionalAlgorithm = None,
    *,
    method: MethodOptions,
    target: Annotated[
        str | None,
        option(
            "--target",
            metavar="NAME",
            help="Kind of code: numpy, c, c-float, c-fixed or fixed-model (Python on integers).  [default: numpy]",
            panel="Algorithm",
        ),
    ] = None,
    all_: Annotated[
        bool, option("--all", help="Generate the whole standard catalogue.", panel="Algorithm")
    ] = False,
    fixed: FixedOptions,
    out: Annotated[
        Path | None,
        option(
            "--out",
            metavar="FOLDER",
            help="Folder for the files.  [default: here; generated/ with --all]",
            panel="Output",
        ),
    ] = None,
    with_runs: WithRuns = False,
    check: Annotated[
        bool,
        option(
            "--check",
            help="With --all: write nothing; print a diff and exit with 1 if the files in the folder differ.",
            panel="Output",
        ),
    ] = False,
    format: Format = "text",
) -> None:
    """Generate source code for an algorithm, or for the whole catalogue.

    For the targets c-fixed and fixed-model, state the largest body rate and the step length. The formats and the
    error bounds then hold for all increments up to that rate.

    Example: strapgen generate euler --method rk4 --increments 2 --target c --out firmware

    Example: strapgen generate euler --target c-fixed --word 32 --max-rate-deg-s 400 --step 0.01 --out firmware
    """
    check_format(format)
    if check and not all_:
        raise InputError("--check goes with --all")
    if all_:
        _check_alone(algorithm, method, target, fixed, with_runs)
        _generate_all(out, check, format)
        return
    if algorithm is None:
        raise InputError("an algorithm is needed, or --all; strapgen list kernels shows them")
    from strapgen.library import generated_sources
    from strapgen.support.files import write_files
    from strapgen.targets import TARGETS, fixed_targets

    choice = method.choose(algorithm, step=False)
    settings = fixed.settings(choice.increments_per_step)
    one("--target", target)
    target = checks.choice("target", "numpy" if target is None else target, TARGETS)
    if settings is not None and not TARGETS[target].fixed:
        raise InputError(
            f"the options of fixed point go with --target {' or '.join(fixed_targets())}, not with {target}"
        )
    if with_runs and not TARGETS[target].compiled:
        raise InputError(f"--with-runs goes with targets in C, not with {target}")
    _check_increments(choice, fixed)
    sources = generated_sources.sources(choice, target, settings)
    if fixed.carry not in (None, "none") and sources.fixed is not None and not sources.fixed.residuals:
        raise InputError(
            f"kernel {choice.kernel} rounds no state that goes on to the next step; --carry keeps nothing"
        )
    written = write_files(out or Path(), sources.files if with_runs else sources.step_files)
    if format == "json":
        print_json(_data(choice, sources, target, written))
    else:
        typer.echo(_text(sources, target, written))


def _check_alone(
    algorithm: str | None, method: MethodOptions, target: str | None, fixed: FixedOptions, with_runs: bool
) -> None:
    """Refuse options that do not go with --all."""
    for name, value in (
        ("an algorithm", algorithm),
        ("--method", method.method),
        ("--tableau", method.tableau),
        ("--increments", method.increments),
        ("--previous", method.previous),
        ("--rates", method.rates or None),
        ("--target", target),
        ("a fixed-point option", fixed.stated or None),
        ("--with-runs", with_runs or None),
    ):
        if value is not None:
            raise InputError(f"--all generates the whole catalogue; {name} does not go with it")


def _check_increments(choice: Choice, fixed: FixedOptions) -> None:
    """Refuse a largest rate or angle for a kernel that takes neither."""
    from strapgen.library import generated_sources

    counted = {*fixed.stated} & {"--sample-hz", "--lsb", "--lsb-rad", "--input-bits"}
    if not counted and not {*fixed.stated} & {"--max-rate-deg-s", "--step", "--max-angle-rad"}:
        return
    names = {signal.name for signal in generated_sources.program(choice).inputs}
    if counted and "increments" not in names:
        raise InputError(f"kernel {choice.kernel} takes no increments; {min(counted)} does not go with it")
    if not names & {"increments", "turns"}:
        raise InputError(
            f"kernel {choice.kernel} takes no increments; a largest rate or angle does not go with it"
        )


def _data(choice: Choice, sources: Sources, target: str, written: list[Path]) -> dict[str, Any]:
    from strapgen import pipeline
    from strapgen.library import generated_sources

    operations = sources.operations
    data = {
        "kernel": sources.kernel,
        "target": target,
        "files": [str(path) for path in written],
        "operations": {kind: operations[kind] for kind in ("add", "multiply", "divide", "sqrt")},
        "temporaries": sources.temporaries,
    }
    if sources.fixed is None:
        return data
    program = generated_sources.program(choice)
    return data | pipeline.quantize(program, sources.fixed.settings).as_data()


def _text(sources: Sources, target: str, written: list[Path]) -> str:
    """Return the operations and the files, in fixed point with the format and the error of every output."""
    counts = [f"{number} {kind}" for kind, number in sources.operations.items() if number]
    head = f"{', '.join(counts) or 'no operations'}, {sources.temporaries} temporaries"
    lines = [f"{sources.kernel} for {target}: {head}", *(f"  {path}" for path in written)]
    for output in sources.fixed.outputs if sources.fixed else ():
        bound, unit = max(output.errors), output.format.unit
        useless = 2 * bound >= max(abs(output.low), abs(output.high)) * unit
        lines.append(
            f"  {output.signal.name}: {output.format}, error at most {float(bound):.4g}, "
            f"{float(bound / unit):.4f} of the last place"
            + (": of the size of the value, which certifies nothing" if useless else "")
        )
    return "\n".join(lines)


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
