"""The kinds of projects around generated C."""

from __future__ import annotations

from strapgen.cli.project_kinds import Kind

_PLACE = __package__

#: Kinds by the value of --project.
KINDS = {
    "cmake": Kind("library with CMake, a run and tests of vectors", f"{_PLACE}.project:cmake_files"),
    "fmu2": Kind("unit for co-simulation by FMI 2.0", f"{_PLACE}.fmu.archive:project_files"),
    "fmu3": Kind("unit for co-simulation by FMI 3.0", f"{_PLACE}.fmu.archive:project_files"),
}
