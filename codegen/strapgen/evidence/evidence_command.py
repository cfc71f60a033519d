"""The command ``strapgen evidence`` verifies generated C in fixed point with external tools."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from strapgen.cli import terminal
from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Excludes, Needs, OneOf, grouped, rules
from strapgen.cli.options import MethodOptions, argument, option
from strapgen.cli.output import format_option, show
from strapgen.cli.progress import track
from strapgen.navigation.systems.built_in import is_system

if TYPE_CHECKING:
    from strapgen.evidence.collection import Subject

_FORMATS = ("text", "json", "csv", "markdown", "latex")


@grouped
@rules(
    OneOf("NAME... --all", needed="a kernel is needed, or --all; strapgen list kernels shows them"),
    Excludes("--all", "@method @fixed", reason="--all examines the whole catalogue"),
    Needs("--check", "--page"),
)
def evidence(
    kernels: Annotated[
        list[str] | None,
        argument(
            "NAME...",
            help="dcm, euler, cayley-klein, any other kernel that strapgen list kernels shows, or a Python file, "
            "or a described system, all of whose stages are verified.",
            words="strapgen.catalogue.names:reserved",
        ),
    ] = None,
    *,
    all_: Annotated[
        bool,
        option("--all", help="Examine the standard catalogue in 32-bit fixed point.", panel="Algorithm"),
    ] = False,
    method: MethodOptions,
    fixed: FixedOptions,
    tool: Annotated[
        tuple[str, ...] | None,
        option(
            "--tool",
            metavar="NAME,...",
            help="Tools to run.  [default: all]",
            panel="Evidence",
            words="strapgen.evidence.collection:CHECKS",
        ),
    ] = None,
    complete: Annotated[
        bool,
        option("--complete", help="Fail, with exit status 1, if a tool is not installed.", panel="Evidence"),
    ] = False,
    out: Annotated[
        Path | None,
        option(
            "--out",
            metavar="FOLDER",
            help="Folder for what the tools read; each file says how you run it.  [default: none is kept]",
            panel="Output",
        ),
    ] = None,
    page: Annotated[
        Path | None,
        option("--page", metavar="FILE", help="Write a page of tables in Markdown.", panel="Output"),
    ] = None,
    check: Annotated[
        bool,
        option(
            "--check", help="Compare the page with its file, but for versions; write nothing.", panel="Output"
        ),
    ] = False,
    format: Annotated[str, format_option(_FORMATS)] = "text",
) -> None:
    """Verify the generated C with external tools.

    The command writes a harness for Frama-C, formulas for SMT solvers, a script for Gappa, test programs for processors
    and a driver for a fuzzer, and runs the tools that are installed. They show whether any sum can overflow, whether
    the error bounds hold, and whether other processors return the same bits. The exit status is 1 if a claim fails.

    Example: strapgen evidence euler --method rk4 --out out/evidence
    """
    from strapgen.evidence import collection
    from strapgen.evidence.evidence_report import EvidenceResult, evidence_page
    from strapgen.ir import checks

    checks.choice("format", format, _FORMATS)
    subjects = [*_subjects(kernels or [], method, fixed)]
    with _folder(out) as folder:
        tasks = collection.collect(subjects, folder, tool or ())
        total = len(tool or collection.CHECKS) * len(subjects)
        verdicts = collection.in_order(
            [verdict for part in track(tasks, "examining", total) for verdict in part], subjects
        )
    show(EvidenceResult(verdicts), format)
    # A claim that fails counts unless another tool proves it.
    missing = complete and any(verdict.result == "not installed" for verdict in verdicts)
    status = int(missing or bool(collection.failures(verdicts)))
    if page is not None:
        text = evidence_page(verdicts, {subject.name: subject.digest for subject in subjects})
        status = max(status, _page(page, text, check))
    raise typer.Exit(status)


def _subjects(kernels: list[str], method: MethodOptions, fixed: FixedOptions) -> Iterator[Subject]:
    from strapgen.evidence import collection

    if not kernels:
        yield from collection.standard()
    for kernel in kernels:
        if is_system(kernel):
            yield from _stages(kernel, method, fixed)
            continue
        choice = method.choose(kernel, step=False)
        yield collection.Subject(choice, fixed.settings(choice.increments_per_step))


def _stages(name: str, method: MethodOptions, fixed: FixedOptions) -> Iterator[Subject]:
    """Yield the stages of a described system."""
    from strapgen.evidence import collection
    from strapgen.navigation.systems.system_simulation import refuse_options
    from strapgen.navigation.systems.wiring import described

    refuse_options(method, fixed, ["--constant"] if method.constant else [])
    yield from collection.of_system(described(name), fixed.settings(1))


@contextlib.contextmanager
def _folder(out: Path | None) -> Iterator[Path]:
    if out is None:
        from strapgen.storage.drafts import temporary_folder

        with temporary_folder() as folder:
            yield folder
        return
    yield out


def _page(page: Path, text: str, check: bool) -> int:
    """Write the page, or return 1 if its file differs from it, but for the versions of tools."""
    from strapgen.evidence.evidence_report import without_versions
    from strapgen.storage.files import write_files

    if not check:
        write_files(Path(), {str(page): text})
        return 0
    written = page.read_text(encoding="utf-8") if page.is_file() else ""
    same = without_versions(written) == without_versions(text)
    other = ", of other versions" if same and written != text else ""
    said = f"{page} is {'in step' if same else 'out of step'} with what the tools{other} say"
    if same:
        terminal.remark(said)
    else:
        terminal.write(said, err=True)
    return int(not same)
