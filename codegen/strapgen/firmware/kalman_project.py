"""Returns the files of a project around the C of a Kalman filter, each of whose functions has test vectors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from strapgen.cli.project_kinds import DEFAULT, kinds
from strapgen.firmware.fmu import archive
from strapgen.firmware.project import Project, call_main, with_kind
from strapgen.firmware.project import refuse_changed as refuse_changed
from strapgen.firmware.vectors import MODEL, call_vectors
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.navigation.kalman.kalman_filter import KalmanFilter


def project_files(
    whole: Sources,
    model: KalmanFilter,
    functions: Sequence[Sources],
    settings: Settings | None,
    command: str,
    *,
    kind: str = DEFAULT,
) -> Mapping[str, str | bytes]:
    """Return the files of a project around all files of a filter, `whole`; its program calls the time update."""
    if kind in archive.VERSIONS:
        raise InputError(f"--project {kind} goes with generate, two-speed and system")
    command, count = with_kind(command, kind), kinds()[kind].vectors
    references = model.sources("exact" if settings is None else MODEL, settings)
    tables = [
        call_vectors(one, other, command, count) for one, other in zip(functions, references, strict=True)
    ]
    if kind == "python":  # cffi takes declarations alone: there the schedule is the CSV
        code = {name: text for name, text in whole.files.items() if not name.endswith("_gains.h")}
        whole = replace(whole, files=code)
    return Project(whole, command, call_main(tables[0], command), tables).files(kind)
