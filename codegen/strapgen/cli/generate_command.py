"""The command ``strapgen generate``: source code of a kernel or of the standard catalogue."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import typer

from strapgen import registration
from strapgen.cli import project_kinds, terminal
from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Excludes, OneOf, grouped, rules, stated
from strapgen.cli.options import MethodOptions, OptionalAlgorithm, option
from strapgen.cli.output import Format, Project, WithRuns, check_format, show
from strapgen.cli.progress import track
from strapgen.cli.values import names
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.storage import streams

if TYPE_CHECKING:
    from strapgen.ir.fixed_settings import Settings
    from strapgen.ir.sources import Sources
    from strapgen.run.kernel_sources import Request
    from strapgen.targets.naming import Naming


def _folder_or_terminal(option: str, path: Path) -> Path:
    return path


@dataclass(frozen=True)
class SourceOptions:
    """Options for the files that are written, their names, and files that are overwritten."""

    panel: ClassVar[str] = "Output"

    out: Annotated[
        Path | None,
        option(
            "--out",
            metavar="FOLDER",
            help="Folder for the files; - prints one file.  [default: here; generated/ with --all]",
            read=_folder_or_terminal,
        ),
    ] = None
    file: Annotated[
        str | None,
        option("--file", metavar="NAME", help="Write one file alone, by its name or its ending, as .h."),
    ] = None
    name: Annotated[
        str | None,
        option(
            "--name",
            metavar="NAME",
            help="In C, C++, Rust and MATLAB: name of the function and of its files.",
        ),
    ] = None
    prefix: Annotated[
        str | None,
        option(
            "--prefix",
            metavar="TEXT",
            help="In C, C++, Rust and MATLAB: what the name of the function begins with.",
        ),
    ] = None
    variant: Annotated[
        str | None,
        option(
            "--variant",
            metavar="NAME",
            help="Take options from this variant of strapgen.toml, which headers then name; others that you state here "
            "win.",
        ),
    ] = None
    with_runs: WithRuns = False
    project: Project = None
    check: Annotated[
        bool,
        option(
            "--check",
            help="Write nothing; print a diff and exit with 1 if the files in the folder differ.",
        ),
    ] = False
    force: Annotated[
        bool,
        option("--force", help="Write over files of another command, and over those that you have changed."),
    ] = False

    @property
    def naming(self) -> Naming:
        """The name that the options choose."""
        from strapgen.targets.naming import Naming

        return Naming(self.name, self.prefix, self.variant)

    def require_language(self, target: str) -> None:
        """Check that the options go with the language of a target."""
        from strapgen.targets import TARGETS

        if not TARGETS[target].nameable:
            for name in ("--name", "--prefix", "--with-runs"):
                if name in stated(self):
                    raise InputError(
                        f"{name} goes with targets in C, C++, Rust and MATLAB, not with {target}"
                    )
        if self.project and not TARGETS[target].compiled:
            raise InputError(f"--project goes with targets in C, not with {target}")

    def files(self, sources: Sources, point: str, *task: Any) -> dict[str, str | bytes]:
        """Return the files to write: those of sources, in a project if one is asked for.

        `task` are the arguments of the function of the extension point that writes projects.
        """
        files: dict[str, str | bytes] = dict(sources.files if self.with_runs else sources.step_files)
        if self.project is None:
            return files
        if self.project != project_kinds.DEFAULT:
            if self.with_runs:
                raise InputError(f"--with-runs does not go with --project {self.project}")
            files = {}
        project_kinds.require_target(self.project, sources.target)
        writer = registration.extension(point, "--project")
        project: Mapping[str, str | bytes] = writer.project_files(*task, kind=self.project)
        if not self.check:
            new = {name: text for name, text in project.items() if name not in files}
            if not self.force:
                writer.refuse_changed(self.out or Path(), new, "--force writes over it")
        return {**files, **project}

    @property
    def is_printed(self) -> bool:
        """Whether the file goes to the terminal."""
        return self.out == streams.STANDARD

    def chosen(self, files: Mapping[str, str | bytes]) -> dict[str, str | bytes]:
        """Return the file that the options choose, or all; refuse several that are printed."""
        if self.file is not None:
            known = ", ".join(files)
            end = self.file if self.file.startswith(".") else None
            files = {
                name: text
                for name, text in files.items()
                if name == self.file or (end is not None and name.endswith(end))
            }
            if len(files) != 1:
                count = "none" if not files else "more than one"
                raise InputError(f"--file {self.file} is {count} of the files, which are {known}")
        if self.is_printed and len(files) > 1:
            raise InputError(f"--out - prints one file; --file chooses it of {', '.join(files)}")
        return dict(files)

    def write(self, files: Mapping[str, str | bytes]) -> list[Path]:
        """Write files into the folder, but over none that has another contract, unless that is forced."""
        from strapgen.run.standard_tree import command_of, text_of
        from strapgen.storage.files import write_files

        folder = self.out or Path()
        for name, text in files.items():
            path, new = folder / name, command_of(text) if isinstance(text, str) else None
            try:
                if self.force or new is None or not path.is_file():
                    continue
                there = command_of(text_of(path))
            except OSError as error:
                raise InputError(f"{path} cannot be written ({error.strerror})") from None
            if there is None:
                raise InputError(f"{path} is there and was not generated by strapgen; --force writes over it")
            if there != new:
                raise InputError(f"{path} is there, generated by '{there}'; --force writes over it")
        return write_files(folder, files)

    def show_difference(self, files: Mapping[str, str | bytes], format: str) -> None:
        """Print a diff from the files in the folder to generated ones, and exit with 1 if there is one."""
        from strapgen.run import standard_tree

        folder = self.out or Path()
        difference = standard_tree.difference(folder, files)
        show_step(difference, format)
        if difference:
            over = ", with --force over those that you have changed" if self.project else ""
            refuse_out_of_step(folder, f"the same command without --check writes the files again{over}")
        if format == "text":
            terminal.write(f"{folder}: {len(files)} files, in step")


@grouped
@rules(
    OneOf("ALGORITHM --all", needed="an algorithm is needed, or --all; strapgen list kernels shows them"),
    Excludes(
        "--all",
        "@method @fixed --name --prefix --with-runs --project --force --file --out=-",
        reason="--all generates the whole catalogue",
    ),
    Excludes("--out=-", "--check --force --project --format=json", reason="--out - prints one file"),
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
    """Generate source code for an algorithm, or for the catalogue.

    For the targets c-fixed and fixed-model, state the largest body rate and the step length. The formats and the
    error bounds then hold for all increments up to that rate. Targets in double and float take them too: series
    then stand for sines and roots where the rate allows it.

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
    groups = [output.files(sources, "generate.project", *task) for task, sources in results]
    files = output.chosen(_together(groups))
    groups = [{name: text for name, text in group.items() if name in files} for group in groups]
    if output.is_printed:
        terminal.write("".join(map(str, files.values())).rstrip("\n"))
        return
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


def _together(groups: Sequence[Mapping[str, str | bytes]]) -> dict[str, str | bytes]:
    """Return the files of all targets, which go into one folder."""
    files: dict[str, str | bytes] = {}
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

    choice = method.choose(algorithm, step=False)
    settings = fixed.settings(choice.increments_per_step)
    fixed.check_target(target)
    output.require_language(target)
    fixed.check_increments(choice)
    return Request(choice, target, settings, output.naming)


def _text(sources: Sources, written: list[Path], settings: Settings | None, samples: int) -> str:
    """Return the operations and the files, in fixed point with the gyro and the error of every output."""
    from strapgen.cli import generated_result

    lines = [*generated_result.head(sources, sources.target, written), *_call_rate(settings, samples)]
    return "\n".join([*lines, *(f"  {line}" for line in generated_result.contract(sources))])


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
            terminal.write(f"{out}: {len(files)} files, in step")
        return
    written = standard_tree.write(out, files)
    from strapgen.cli.generated_result import CatalogueResult

    show(CatalogueResult(written, f"{out}: {len(written)} files of {total} kernels"), format)


def show_step(difference: str, format: str) -> None:
    """Print the difference of files from generated ones; as text only if there is one."""
    from strapgen.cli.generated_result import StepCheck

    if difference or format == "json":
        show(StepCheck(not difference, difference), format)


def refuse_out_of_step(folder: Path, again: str) -> None:
    """Print to stderr that files differ from generated ones, with the command that makes them; exit with 1."""
    terminal.write(f"strapgen: {folder} is out of step; {again}", err=True)
    raise typer.Exit(1)
