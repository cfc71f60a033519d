"""Options that say where the cases of a study run: in processes on this machine, or on a cluster."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

from strapgen.cli.option_groups import OneOf, Rule
from strapgen.cli.options import option
from strapgen.cli.values import whole

if TYPE_CHECKING:
    from strapgen.lab.study.clusters import Cluster

#: Most processes of a study on this machine.
_MOST = 1024


@dataclass(frozen=True)
class WorkerOptions:
    """Where the cases of a study run."""

    panel: ClassVar[str] = "Run"
    rules: ClassVar[tuple[Rule, ...]] = (OneOf("--jobs --scheduler --cluster"),)

    jobs: Annotated[
        int | None,
        option(
            "--jobs",
            metavar="N",
            help="Number of processes that run side by side.  [default: one for each processor]",
            read=whole(1, _MOST),
        ),
    ] = None
    scheduler: Annotated[
        str | None,
        option(
            "--scheduler",
            metavar="ADDRESS",
            help="Dask scheduler whose workers run the cases, as tcp://10.0.0.7:8786.",
        ),
    ] = None
    cluster: Annotated[
        str | None,
        option(
            "--cluster",
            metavar="CLUSTER",
            help="local:N runs the cases on a Dask cluster of N workers on this machine.",
        ),
    ] = None

    def workers(self) -> Cluster | None:
        """Return the cluster, checked; None where none is stated."""
        from strapgen.lab.study.clusters import Cluster

        return Cluster.of(self.scheduler, self.cluster)
