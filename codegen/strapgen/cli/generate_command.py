"""The command ``strapgen generate``: source code of a kernel or of the standard catalogue."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from strapgen import registration
from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import grouped
from strapgen.cli.options import MethodOptions, OptionalAlgorithm, option
from strapgen.cli.output import Format, check_format, show
from strapgen.cli.progress import track
from strapgen.cli.rules import Excludes, OneOf, rules
from strapgen.cli.source_options import SourceOptions, refuse_out_of_step, show_step
from strapgen.cli.values import names
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.ir.fixed_settings import Settings
    from strapgen.ir.sources import Sources
    from strapgen.run.kernel_sources import Request


@grouped
@rules(
    OneOf("ALGORITHM --all", needed="an algorithm is needed, or --all; strapgen list kernels shows them"),
    Excludes(
        "--all",
        "@method @fixed --name --prefix --with-runs --project --force",
        reason="--all generates the whole catalogue",
    ),
)
def generate(
    algorithm: OptionalAlgorithm = None,
    *,
    method: MethodOptions,
    targets: Annotated[
        tuple[str, ...] | None,
        option(
            "--target",
            metavar="NAME,...",
            help="Kinds of code, with commas between; strapgen list targets shows all.  [default: numpy]",
            panel="Algorithm",
            read=names("strapgen.targets:TARGETS"),
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

    Example: strapgen generate euler --method rk4 --increments 2 --target cpp,rust --out firmware

    Example: strapgen generate euler --target c-fixed --word 32 --max-rate-deg-s 400 --step 0.01 --out firmware

    Example: strapgen generate euler --target c-fixed --sample-hz 100 --lsb 0.0175dps --out firmware/gyro
    """
    check_format(format)
    if algorithm is None:
        _generate_all(targets, output, format)
        return
    from strapgen import pipeline

    tasks = [request(algorithm, method, name, fixed, output) for name in targets or ("numpy",)]
    results = [(task, pipeline.compile(*task)) for task in tasks]
    for _, sources in results:
        fixed.check_feedback(sources)
    groups = [sources.files if output.with_runs else sources.step_files for _, sources in results]
    if output.project:
        groups = [
            files | _project_files(task, output) for (task, _), files in zip(results, groups, strict=True)
        ]
    files = _together(groups)
    if output.check:
        output.show_difference(files, format)
        return
    paths = dict(zip(files, output.write(files), strict=True))
    written = [[paths[name] for name in group] for group in groups]
    rows = [(task, sources, place) for (task, sources), place in zip(results, written, strict=True)]
    from strapgen.cli.generated_result import GeneratedSources, GenerateResult

    samples = tasks[0].choice.increments_per_step
    said = "\n".join(_text(sources, place, task.settings, samples) for task, sources, place in rows)
    generated = [
        GeneratedSources.of(task.choice, sources, task.target, [*map(str, place)])
        for task, sources, place in rows
    ]
    show(GenerateResult(generated, said), format)


def _together(groups: list[dict[str, str]]) -> dict[str, str]:
    """Return the files of all targets, which go into one folder."""
    files: dict[str, str] = {}
    for group in groups:
        for name in files.keys() & group.keys():
            raise InputError(f"two of the targets write {name}; generate them into two folders")
        files |= group
    return files


def request(
    algorithm: str, method: MethodOptions, target: str, fixed: FixedOptions, output: SourceOptions
) -> Request:
    """Return the request of the command's options."""
    from strapgen.run.kernel_sources import Request
    from strapgen.targets import TARGETS, fixed_targets

    choice = method.choose(algorithm, step=False)
    settings = fixed.settings(choice.increments_per_step)
    if settings is not None and not TARGETS[target].fixed:
        raise InputError(
            f"the options of fixed point go with --target {' or '.join(fixed_targets())}, not with {target}"
        )
    output.require_language(target)
    fixed.check_increments(choice)
    return Request(choice, target, settings, output.naming)


def _project_files(task: Request, output: SourceOptions) -> dict[str, str]:
    """Return the files that build and test the C, unless a file of the user is in their place."""
    writer = registration.extension("generate.project", "--project")
    files: dict[str, str] = writer.project_files(*task)
    if not output.check:
        writer.refuse_changed(output.out or Path(), files, output.force)
    return files


def _text(sources: Sources, written: list[Path], settings: Settings | None, samples: int) -> str:
    """Return the operations and the files, in fixed point with the gyro and the error of every output."""
    from strapgen.cli import generated_text

    lines = [*generated_text.head(sources, sources.target, written), *_call_rate(settings, samples)]
    return "\n".join([*lines, *(f"  {line}" for line in generated_text.contract(sources))])


def _call_rate(settings: Settings | None, samples: int) -> list[str]:
    """Return how often a step is called, if the sampling rate is stated and a step takes several samples."""
    words = [] if settings is None else settings.stated.split()
    if "--sample-hz" not in words or samples < 2:
        return []
    hertz = checks.number("sample_hz", words[words.index("--sample-hz") + 1]) / samples
    return [f"  a step takes {samples} samples of the gyro: call it at {float(hertz):g} Hz"]


def _generate_all(targets: tuple[str, ...] | None, output: SourceOptions, format: str) -> None:
    from strapgen import catalogue
    from strapgen.run import standard_tree
    from strapgen.storage import resources
    from strapgen.storage.files import check_folder

    out = output.out
    if out is None:
        in_place = resources.checkout() is not None or output.check
        out = resources.folder("generated") if in_place else Path("generated")
    if output.check and not out.is_dir():
        raise InputError(f"{out} is no folder; --check needs the one to look at")
    if not output.check:
        check_folder(out)  # known before the derivation of all kernels
    total = len(catalogue.standard())
    files = standard_tree.tree(track(standard_tree.programs(), "deriving", total), targets)
    if output.check:
        difference = standard_tree.tree_difference(out, files)
        show_step(difference, format)
        if difference:
            left = standard_tree.strangers(out, files)
            remove = f"; {left[0]} is no part of it, and yours to remove" if left else ""
            kinds = f" --target {','.join(targets)}" if targets else ""
            refuse_out_of_step(out, f"strapgen generate --all{kinds} rebuilds it{remove}")
        if format == "text":
            typer.echo(f"{out}: {len(files)} files, in step")
        return
    written = standard_tree.write(out, files)
    from strapgen.cli.generated_result import CatalogueResult

    show(CatalogueResult(written, f"{out}: {len(written)} files of {total} kernels"), format)
