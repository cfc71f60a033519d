"""Projects around generated C for the builds of Zephyr, ESP-IDF, PlatformIO and Arduino."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from strapgen.firmware.project import Project
from strapgen.ir.version import VERSION
from strapgen.targets.registry import BUILT_IN
from strapgen.targets.rendering import render

#: Folders of the headers and of the sources.
HEADERS, SOURCES = "include", "src"
_MAIN = "int main(void)\n"


def values_of(project: Project) -> dict[str, Any]:
    """Return what the templates of all kinds know of a project."""
    code = project.code(".c")
    return {
        "name": project.name,
        "package": f"strapgen_{project.name}",
        "title": project.sources.info.title[:1].upper() + project.sources.info.title[1:],
        "command": project.command,
        "version": VERSION,
        "code": code,
        "headers": project.code(".h"),
        "floating": bool(BUILT_IN[project.sources.target].number),
        "library": any("#include <math.h>" in project.sources.step_files[file] for file in code),
        "tests": project.programs,
    }


def rendered(folder: str, project: Project, files: Mapping[str, str], **more: Any) -> dict[str, str]:
    """Return files by path, each from a template of a folder."""
    values = values_of(project) | more
    return {path: render(f"project_{folder}/{template}.j2", **values) for path, template in files.items()}


def code_in(project: Project, headers: str = HEADERS, sources: str = SOURCES) -> dict[str, str]:
    """Return the C in the folders of its headers and sources."""
    return {
        f"{headers if name.endswith('.h') else sources}/{name}": text
        for name, text in project.sources.step_files.items()
    }


def functions(project: Project, folder: str) -> dict[str, str]:
    """Return the tests in a folder, each as a function with the name of its file, in place of a program."""
    files = {}
    for name, text in project.tests.items():
        if name.endswith(".csv"):
            continue
        function = f"int {Path(name).stem}(void)"
        files[f"{folder}/{name}"] = text.replace(_MAIN, f"{function};\n\n{function}\n")
    return files


def main_of(project: Project, entry: str) -> str:
    """Return a program that calls the tests, which begins with `entry`, such as ``int main``."""
    return render("project_parts/main.c.j2", **values_of(project), entry=entry)


def zephyr_files(project: Project) -> dict[str, str]:
    """Return the files of a module of Zephyr."""
    files = {
        "zephyr/module.yml": "module.yml",
        "Kconfig": "Kconfig",
        "CMakeLists.txt": "CMakeLists.txt",
        "tests/vectors/CMakeLists.txt": "test.CMakeLists.txt",
        "tests/vectors/prj.conf": "prj.conf",
        "tests/vectors/testcase.yaml": "testcase.yaml",
    }
    tests = "tests/vectors/src"
    return {
        **code_in(project),
        **rendered("zephyr", project, files),
        f"{tests}/main.c": main_of(project, "int main"),
        **functions(project, tests),
    }


def esp_idf_files(project: Project) -> dict[str, str]:
    """Return the files of a component of ESP-IDF."""
    main = "examples/vectors/main"
    files = {
        "idf_component.yml": "idf_component.yml",
        "CMakeLists.txt": "CMakeLists.txt",
        "examples/vectors/CMakeLists.txt": "example.CMakeLists.txt",
        f"{main}/idf_component.yml": "example_component.yml",
        f"{main}/CMakeLists.txt": "main.CMakeLists.txt",
    }
    return {
        **code_in(project),
        **rendered("esp_idf", project, files),
        f"{main}/main.c": main_of(project, "void app_main"),
        **functions(project, main),
    }


def platformio_files(project: Project) -> dict[str, str]:
    """Return the files of a library of PlatformIO."""
    folder = "examples/vectors"
    tests = functions(project, folder)
    files = ["main.c", *(Path(path).name for path in tests)]
    return {
        **code_in(project),
        **rendered("platformio", project, {"library.json": "library.json"}, example_files=files),
        f"{folder}/main.c": main_of(project, "int main"),
        **tests,
    }


def arduino_files(project: Project) -> dict[str, str]:
    """Return the files of a library of Arduino, with a sketch for every test, since the memory is small."""
    files = code_in(project, SOURCES, SOURCES)
    files |= rendered("arduino", project, {"library.properties": "library.properties"})
    command = project.command
    for test in project.programs:
        folder = f"examples/{test}"
        files[f"{folder}/{test}.ino"] = render(
            "project_arduino/sketch.ino.j2", test=test, header=f"{project.name}.h", command=command
        )
        own = (f"{test}.c", f"{test.removeprefix('test_')}_vectors.h")
        files |= {path: text for path, text in functions(project, folder).items() if Path(path).name in own}
    return files
