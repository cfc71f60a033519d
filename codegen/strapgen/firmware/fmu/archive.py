"""Puts a unit for co-simulation together: model description, sources, a binary for this machine, documentation."""

from __future__ import annotations

import hashlib
import io
import platform
import sys
import uuid
import zipfile
from collections.abc import Mapping

from strapgen.firmware.fmu.units import WIDTH, Unit
from strapgen.firmware.fmu.variables import UNITS
from strapgen.ir.exceptions import InputError
from strapgen.ir.version import VERSION
from strapgen.run import compiler
from strapgen.targets.printer import fill_arguments
from strapgen.targets.rendering import render

#: Versions of FMI by the kind of project.
VERSIONS = {"fmu2": 2, "fmu3": 3}
#: The names of types: those of C in FMI 3, and all others in FMI 2.
_TYPES = {"double": "Float64", "float": "Float32", "int16_t": "Int16", "int32_t": "Int32", "int64_t": "Int64"}
#: Ending of libraries, and folder in FMI 2, by the name of a system in folders of FMI 3.
_SYSTEMS = {
    "linux": (".so", "linux64"),
    "darwin": (".dylib", "darwin64"),
    "windows": (".dll", "win64"),
}
#: What lines of C begin with that are wrapped after their commas.
_LONG = ("FMU_EXPORT ", "static ", "const int ", "(void)memcpy(", "(void)memmove(", '{"')


def project_files(unit: Unit, kind: str) -> dict[str, bytes]:
    """Return the unit as the content of a file ``.fmu``, which is the same for the same sources and compiler."""
    files: dict[str, str | bytes] = {**source_files(unit, VERSIONS[kind])}
    code = {n.removeprefix("sources/"): str(text) for n, text in files.items() if n.startswith("sources/")}
    system = {"win32": "windows", "darwin": "darwin"}.get(sys.platform, "linux")
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(*(platform.machine().lower(),) * 2)
    ending, folder = _SYSTEMS[system]
    if kind == "fmu3" or machine != "x86_64":
        folder = f"{machine}-{system}"
    files[f"binaries/{folder}/{unit.name}{ending}"] = compiler.shared_library(unit.name, code)
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))  # the earliest that an archive can hold
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, files[name], zipfile.ZIP_DEFLATED)
    return {f"{unit.name}.{kind}.fmu": content.getvalue()}


def source_files(unit: Unit, version: int) -> dict[str, str]:
    """Return all files of a unit that are text; the token in them is a digest of their content."""
    if version == 2 and any(variable.type == "int64_t" for variable in unit.variables):
        raise InputError("--project fmu2 has integers of up to 32 bits; words of 64 bits need --project fmu3")
    draft = repr(sorted(_rendered(unit, version, "").items()))
    token = uuid.UUID(bytes=hashlib.sha256(draft.encode()).digest()[:16])
    return _rendered(unit, version, f"{{{token}}}")


def _rendered(unit: Unit, version: int, token: str) -> dict[str, str]:
    own, variables = f"{unit.name}_fmi{version}.c", unit.variables
    scalars = [variable.scalar(place) for variable in variables for place in range(variable.size)]
    values: Mapping[str, object] = {
        **vars(unit),
        **unit.values,
        "version": version,
        "release": VERSION,
        "token": token,
        "types": _TYPES,
        "rows": scalars if version == 2 else variables,
        "units": {v.unit: UNITS.get(v.unit, {}) for v in variables if v.unit},
        "headers": [name for name in unit.files if name.endswith(".h")],
        "code": [own, *(name for name in unit.files if name.endswith(".c"))],
        "width": float(unit.step or WIDTH),
    }
    text = "\n".join(map(_wrapped, render("fmu/fmu.c.j2", **values).split("\n")))
    files = {
        "modelDescription.xml": render(f"fmu/fmi{version}.xml.j2", **values),
        "documentation/index.html": render("fmu/index.html.j2", **values),
        **{f"sources/{name}": part for name, part in {own: text, **unit.files}.items()},
    }
    if version == 3:
        files["sources/buildDescription.xml"] = render("fmu/build.xml.j2", **values)
    return files


def _wrapped(line: str) -> str:
    """Return a line of C over several lines, if it is long and made of a list."""
    indent = line[: len(line) - len(line.lstrip())]
    return fill_arguments(line, f"{indent}    ", 95) if line.lstrip().startswith(_LONG) else line
