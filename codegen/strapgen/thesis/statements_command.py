"""The command ``strapgen statements`` runs what the text of the thesis says."""

from __future__ import annotations

from typing import Annotated

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.output import TEXT_OUTPUT, Output
from strapgen.cli.progress import track


@grouped
def statements(*, output: Annotated[Output, Shown(only=TEXT_OUTPUT)]) -> None:
    """Run the statements of the thesis's text, and say whether they hold.

    Chapter 5 of the thesis says more than its tables show. Each of fourteen statements stands beside the numbers of the
    runs that test it, and a verdict.

    Example: strapgen statements --format markdown
    """
    output.check()
    from strapgen.thesis.statements_report import StatementsResult
    from strapgen.thesis.thesis_statements import COUNT
    from strapgen.thesis.thesis_statements import statements as runs

    output.show(StatementsResult(list(track(runs(), "simulating", COUNT))))
