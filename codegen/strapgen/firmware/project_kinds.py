"""The kinds of projects around generated C."""

from __future__ import annotations

from strapgen.cli.project_kinds import Kind

_PLACE = __package__

#: Kinds by the value of --project.
KINDS = {
    "cmake": Kind("library with CMake, a run and tests of vectors", f"{_PLACE}.project:cmake_files"),
    "zephyr": Kind("module of Zephyr", f"{_PLACE}.packages:zephyr_files"),
    "esp-idf": Kind("component of ESP-IDF", f"{_PLACE}.packages:esp_idf_files"),
    "platformio": Kind("library of PlatformIO", f"{_PLACE}.packages:platformio_files"),
    "arduino": Kind(
        "library of Arduino",
        f"{_PLACE}.packages:arduino_files",
        {"c": "double has 32 bits on AVR; c-float or c-fixed is needed"},
        vectors=40,
    ),
    "python": Kind(
        "package of Python, which compiles the C by cffi", f"{_PLACE}.python_package:python_files"
    ),
    "fmu2": Kind("unit for co-simulation by FMI 2.0", f"{_PLACE}.fmu.archive:project_files"),
    "fmu3": Kind("unit for co-simulation by FMI 3.0", f"{_PLACE}.fmu.archive:project_files"),
}
