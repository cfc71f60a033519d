"""The command ``strapgen generate`` writes the source code of a kernel or of the standard catalogue."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import grouped
from strapgen.cli.options import KernelOptions, OptionalAlgorithm, one, option
from strapgen.cli.output import Format, check_format, print_json
from strapgen.cli.progress import track
from strapgen.cli.source_options import SourceOptions, refuse_out_of_step
from strapgen.support import checks
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.ir.float_interface import RoundingBounds
    from strapgen.ir.sources import Sources
    from strapgen.library.generation import Request


@grouped
def generate(
    algorithm: OptionalAlgorithm = None,
    *,
    method: KernelOptions,
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
    output: SourceOptions,
    format: Format = "text",
) -> None:
    """Generate source code for an algorithm, or for the whole catalogue.

    For the targets c-fixed and fixed-model, state the largest body rate and the step length. The formats and the
    error bounds then hold for all increments up to that rate.

    Example: strapgen generate euler --method rk4 --increments 2 --target c --out firmware

    Example: strapgen generate euler --target c-fixed --word 32 --max-rate-deg-s 400 --step 0.01 --out firmware

    Example: strapgen generate euler --target c-fixed --sample-hz 100 --lsb 0.0175dps --out firmware/gyro
    """
    check_format(format)
    if all_:
        _check_alone(algorithm, method, target, fixed, output)
        _generate_all(output, format)
        return
    if algorithm is None:
        raise InputError("an algorithm is needed, or --all; strapgen list kernels shows them")
    task = request(algorithm, method, target, fixed, output)
    sources = task.sources()
    fixed.check_feedback(sources)
    files = sources.files if output.with_runs else sources.step_files
    if output.project:
        files = files | _project_files(task, output)
    if output.check:
        _check_files(files, output, format)
        return
    written = output.write(files)
    if format == "json":
        print_json(_data(task.choice, sources, task.target, written))
    else:
        typer.echo(_text(sources, task.target, written))


def request(
    algorithm: str, method: KernelOptions, target: str | None, fixed: FixedOptions, output: SourceOptions
) -> Request:
    """Return what the options of the command ask for.

    Raises
    ------
    InputError
        If options do not go together.
    """
    from strapgen.library.generation import Request
    from strapgen.targets import TARGETS, fixed_targets

    choice = method.choose(algorithm, step=False)
    settings = fixed.settings(choice.increments_per_step)
    one("--target", target)
    target = checks.choice("target", "numpy" if target is None else target, TARGETS)
    if settings is not None and not TARGETS[target].fixed:
        raise InputError(
            f"the options of fixed point go with --target {' or '.join(fixed_targets())}, not with {target}"
        )
    if output.for_c and not TARGETS[target].compiled:
        raise InputError(f"{output.for_c} goes with targets in C, not with {target}")
    fixed.check_increments(choice)
    return Request(choice, target, settings, output.naming)


def _project_files(task: Request, output: SourceOptions) -> dict[str, str]:
    """Return the files that build and test the C, unless a file of the user is in their place."""
    from strapgen.experiments import project

    files = project.project_files(task.choice, task.target, task.settings, task.naming)
    if not output.check:
        project.refuse_changed(output.out or Path(), files, output.force)
    return files


def _check_files(files: dict[str, str], output: SourceOptions, format: str) -> None:
    """Print how the files in the folder differ from generated ones; exit with 1 if they do."""
    folder = output.out or Path()
    difference = output.compare(files)
    if format == "json":
        print_json({"in_step": not difference, "difference": difference})
    elif difference:
        typer.echo(difference, nl=False)
    if difference:
        refuse_out_of_step(folder, "the same command without --check writes the files again")
    if format == "text":
        typer.echo(f"{folder}: {len(files)} files, in step")


def _check_alone(
    algorithm: str | None,
    method: KernelOptions,
    target: str | None,
    fixed: FixedOptions,
    output: SourceOptions,
) -> None:
    """Refuse options that do not go with --all."""
    for name, value in (
        ("an algorithm", algorithm),
        ("--method", method.method),
        ("--tableau", method.tableau),
        ("--window", method.window),
        ("--coning", method.coning),
        ("--increments", method.increments),
        ("--previous", method.previous),
        ("--ahead", method.ahead),
        ("--rates", method.rates or None),
        ("--constant", method.constant or None),
        ("--layout", method.layout),
        ("--target", target),
        ("a fixed-point option", fixed.stated or None),
        (output.for_c, output.for_c),
        ("--force", output.force or None),
    ):
        if value is not None:
            raise InputError(f"--all generates the whole catalogue; {name} does not go with it")


def _data(choice: Choice, sources: Sources, target: str, written: list[Path]) -> dict[str, Any]:
    from strapgen.library import generated_sources

    operations = sources.operations
    data = {
        "kernel": sources.kernel,
        "target": target,
        "files": [str(path) for path in written],
        "operations": {kind: operations[kind] for kind in ("add", "multiply", "divide", "sqrt")},
        "temporaries": sources.temporaries,
    }
    if sources.rounding is not None:
        data["error_bounds"] = sources.rounding.as_data()
    if sources.fixed is None:
        return data
    return data | generated_sources.fixed_program(choice, sources.fixed.settings).as_data()


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
    if sources.rounding is not None:
        lines += _rounding_lines(sources.rounding)
    return "\n".join(lines)


def _rounding_lines(rounding: RoundingBounds) -> list[str]:
    """Return the error bound of every output in floating point."""
    if rounding.reason:
        return [f"  no error bound is known: {rounding.reason}"]
    return [
        f"  {name}: error at most {float(bound):.4g}, {float(bound / rounding.unit):.4f} of the last place of 1"
        if bound
        else f"  {name}: exact"
        for name, bound in rounding.worst.items()
    ]


def _generate_all(output: SourceOptions, format: str) -> None:
    from strapgen import catalogue
    from strapgen.library import standard_tree
    from strapgen.support import resources
    from strapgen.support.files import check_folder

    out = output.out
    if out is None:
        in_place = resources.checkout() is not None or output.check
        out = resources.folder("generated") if in_place else Path("generated")
    if output.check and not out.is_dir():
        raise InputError(f"{out} is no folder; --check needs the one to look at")
    if not output.check:
        check_folder(out)  # known before the derivation of all kernels
    total = len(catalogue.standard())
    files = standard_tree.tree(track(standard_tree.programs(), "deriving", total))
    if output.check:
        difference = standard_tree.difference(out, files)
        if format == "json":
            print_json({"in_step": not difference, "difference": difference})
        elif difference:
            typer.echo(difference, nl=False)
        if difference:
            left = standard_tree.strangers(out, files)
            remove = f"; {left[0]} is no part of it, and yours to remove" if left else ""
            refuse_out_of_step(out, f"strapgen generate --all rebuilds it{remove}")
        if format == "text":
            typer.echo(f"{out}: {len(files)} files, in step")
        return
    written = standard_tree.write(out, files)
    if format == "json":
        print_json({"files": [str(path) for path in written]})
    else:
        typer.echo(f"{out}: {len(written)} files of {total} kernels")
