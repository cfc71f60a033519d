"""The command ``strapgen report`` writes a page of HTML about algorithms or the standard catalogue."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import typer

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Needs, Rule, Shown, command_line, grouped, rules
from strapgen.cli.options import Duration, FastBackends, GyroRate, SeveralMethods, option
from strapgen.cli.output import Output
from strapgen.cli.progress import track, waiting
from strapgen.cli.values import Positive
from strapgen.lab.motions.motion_names import is_file
from strapgen.lab.run_options import (
    MotionSettings,
    motion_option,
)
from strapgen.thesis.thesis_commands import runnable

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.evidence.evidence_report import EvidencePage
    from strapgen.report.dossier import Conditions

#: The options of fixed point, for which the sampling rate is that of the runs.
_FIXED = (
    *("word", "max_rate_deg_s", "lsb", "lsb_rad", "input_bits", "largest_angle"),
    *("rounding", "carry", "state", "allowance"),
)

#: The options that choose kernels.
_CHOOSING = (
    *("method", "tableau", "window", "coning"),
    *("increments", "previous", "ahead", "constant", "layout"),
)
#: Most names in the heading of a page.
_MOST_NAMES = 3


@dataclass(frozen=True)
class _ReportRuns:
    """Options of the runs that a page shows."""

    panel: ClassVar[str] = "Input"
    rules: ClassVar[tuple[Rule, ...]] = (Needs("--set", "--motion"),)

    motion: Annotated[str | None, motion_option("coning")] = None
    settings: MotionSettings = None
    sample_hz: GyroRate = Positive("100")
    duration: Duration = Positive("20")

    @property
    def files(self) -> list[str]:
        """The files that the options name."""
        return [self.motion] if self.motion is not None and is_file(self.motion) else []

    def conditions(self) -> Conditions:
        """Return the motion, the sampling rate and the duration of the runs, checked."""
        from strapgen.report.dossier import Conditions

        conditions = Conditions(sample_hz=str(self.sample_hz), duration=str(self.duration))
        if self.motion is not None:
            conditions = replace(conditions, motion=self.motion, settings=self.settings or {})
        conditions.profile()  # refuses what is not known
        return conditions


@dataclass(frozen=True)
class _ReportOutput(Output):
    """Where the page goes."""

    out: Annotated[Path, option("--out", metavar="FILE", help="File of the page; - is the terminal.")] = Path(
        "report.html"
    )

    def check(self, *read: str | Path | None) -> None:
        """Check that the page is not written over a file that is read, and that its folder can hold it."""
        from strapgen.storage.files import check_folder

        super().check(*read)
        if self.file is not None:
            check_folder(self.file.parent)


@grouped
@rules(Needs("@methods", "ALGORITHM..."))
def report(
    kernels: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="ALGORITHM...",
            help="dcm, euler, cayley-klein, any other kernel that strapgen list kernels shows, or a Python file.  "
            "[default: the standard catalogue]",
            show_default=False,
        ),
    ] = None,
    *,
    methods: Annotated[SeveralMethods, Shown(only=_CHOOSING)],
    backend: FastBackends = None,
    beside: Annotated[
        tuple[str, ...],
        option(
            "--beside",
            metavar="NAME,...",
            help="Methods that accuracy against cost shows beside the algorithms, as --method of frontier.",
            panel="Algorithm",
        ),
    ] = ("all",),
    runs: _ReportRuns,
    fixed: Annotated[FixedOptions, Shown(only=_FIXED)],
    output: Annotated[_ReportOutput, Shown(only=("out",))],
) -> None:
    """Write one HTML file: formulas, code, bounds, runs and evidence.

    The page is one file that opens anywhere, without a network. It holds the formulas and the code of each algorithm,
    its formats and error bounds in fixed point, its drift on a motion and the order that it shows, back ends side by
    side, accuracy against cost for all methods of the catalogue, the tables of the thesis, and the results of external
    tools on the C. Each result is shown with the command that prints it.

    Example: strapgen report euler --method rk4 --out out/report.html
    """
    names = kernels or []
    output.check(*names, *methods.files, *runs.files)
    conditions = runs.conditions()
    choices = [choice for name in names for choice in methods.choices(name, step=False)]
    options = {"--backend": backend} if backend is not None else {}
    options |= {"--beside": beside} if beside != ("all",) else {}
    where = replace(output, out=Path(output.out.name))
    command = command_line("report", *names, options, methods, runs, fixed, where)
    places = backend or runnable()
    output.deliver(_page(list(dict.fromkeys(choices)), beside, conditions, places, fixed, command))


def _page(
    choices: list[Choice],
    beside: Sequence[str],
    conditions: Conditions,
    places: tuple[str, ...],
    fixed: FixedOptions,
    command: str,
) -> str:
    """Run all that a page shows, and return it."""
    from strapgen import catalogue
    from strapgen.design import frontier
    from strapgen.report import dossier
    from strapgen.report.page import Content, report_page
    from strapgen.run.compiler import versions
    from strapgen.storage import cache

    shown = choices or catalogue.standard()
    if fixed.max_rate_deg_s is not None or fixed.lsb is not None:
        fixed = replace(fixed, sample_hz=Positive(conditions.sample_hz))
    cases = [(choice, conditions, fixed.settings(choice.increments_per_step), places) for choice in shown]
    several = dossier.compared(shown, beside)
    frontier.require_steps(several, conditions.sample_hz, conditions.duration)  # before what takes long
    known = [*track(dossier.dossiers(cases), "gathering", len(cases))]
    drifts_and_costs = [*track(dossier.drifts_and_costs(several, conditions), "comparing", len(several))]
    with waiting("running the tables"):
        tables = dossier.tables(shown, places)
    content = Content(
        _title(choices),
        command,
        conditions,
        places,
        tuple(sorted(known, key=lambda one: shown.index(one.choice))),
        tuple(tables),
        tuple(frontier.in_order(drifts_and_costs, several)),
        dossier.named(several, beside),
        _recorded_evidence(),
    )
    return report_page(content, versions(), cache.generator_digest())


def _title(choices: list[Choice]) -> str:
    """Return the heading of a page."""
    if not choices:
        return "The standard catalogue"
    names = [choice.kernel for choice in choices]
    return ", ".join(names) if len(names) <= _MOST_NAMES else f"{names[0]} and {len(names) - 1} others"


def _recorded_evidence() -> EvidencePage | None:
    """Return the verdicts of tools on the standard catalogue, if its page exists."""
    from strapgen.evidence.evidence_report import read_page
    from strapgen.storage import resources

    page = resources.folder("generated") / "EVIDENCE.md"
    return read_page(page.read_text(encoding="utf-8")) if page.is_file() else None
