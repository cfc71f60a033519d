"""Projects of every kind: their builds' own tools accept them, and the C that they build passes its vectors."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
import tarfile
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from c_programs import needed
from commands import run, says

from strapgen.cli import project_kinds
from strapgen.storage.drafts import temporary_folder

ROOT = Path(__file__).parents[2]
#: What is put into projects: the commands, without the kind.
COMMANDS = {
    "step": "generate euler --target c-fixed --carry full --max-rate-deg-s 400 --step 0.01",
    "float": "generate dcm --target c-float",
    "call": "generate euler-angles-from-dcm --target c",
    "two-speed": "two-speed dcm --target c-float",
    "late": "window generate window-3-3 --target c-fixed",
    "system": f"system {ROOT / 'examples/strapdown.toml'} --target c-fixed",
}
BUILT = ["zephyr", "esp-idf", "platformio", "python"]
KINDS = ["cmake", *BUILT, "arduino"]
#: A file of each kind that describes the project.
CHANGED = {
    "cmake": "CMakeLists.txt",
    "zephyr": "Kconfig",
    "esp-idf": "idf_component.yml",
    "platformio": "library.json",
    "python": "pyproject.toml",
    "arduino": "library.properties",
}
#: Every kind with a step and a whole; the other commands where they are quick.
PAIRS = [
    *((kind, "step") for kind in BUILT),
    *((kind, command) for kind in ("zephyr", "python") for command in ("float", "late")),
    ("esp-idf", "two-speed"),
    ("platformio", "system"),
    ("python", "system"),
    ("python", "call"),
    ("python", "two-speed"),
]


@cache
def files_of(kind: str, command: str) -> dict[str, str]:
    with temporary_folder() as folder:
        run([*shlex.split(COMMANDS[command]), "--project", kind, "--out", str(folder)])
        paths = sorted(path for path in folder.rglob("*") if path.is_file())
        return {path.relative_to(folder).as_posix(): path.read_text() for path in paths}


@pytest.fixture
def project(tmp_path, capsys):
    """Return a function that writes a project of a kind into a folder."""

    def write(kind: str, command: str) -> Path:
        folder = tmp_path / "project"
        for name, text in files_of(kind, command).items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text)
        capsys.readouterr()
        return folder

    return write


def printed(*words: str | Path, cwd: Path, status: int = 0, **more: str) -> str:
    done = subprocess.run(
        [*map(str, words)], cwd=cwd, capture_output=True, text=True, check=False, env={**os.environ, **more}
    )
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout + done.stderr


def test_kinds_are_those_that_are_registered():
    assert [name for name in project_kinds.titles() if not name.startswith("fmu")] == [
        *KINDS[:4],
        "arduino",
        "python",
    ]


@pytest.mark.parametrize("kind", KINDS)
def test_every_file_says_its_licence(kind):
    """The line stands in the file, or the file has none to put it in and is one of those that REUSE.toml names."""
    files = files_of(kind, "float")
    line = "SPDX-License-Identifier: 0BSD"
    (rest,) = tomllib.loads(files["REUSE.toml"])["annotations"]
    assert (rest["path"], rest["precedence"], rest["SPDX-License-Identifier"]) == ("**", "closest", "0BSD")
    without = [name for name, text in files.items() if line not in text]
    for name in without:
        in_header = name.endswith(".c") and any(
            line in text
            for other, text in files.items()
            if other.endswith(f"/{Path(name).stem}.h") or other == f"{Path(name).stem}.h"
        )
        assert in_header or name.endswith((".csv", ".json", "py.typed")), name


@pytest.mark.parametrize("kind", KINDS)
def test_generated_c_is_that_of_the_command_without_a_project(kind, tmp_path, capsys):
    run([*COMMANDS["float"].split(), "--out", str(tmp_path)])
    for path in tmp_path.iterdir():
        (there,) = [
            text for name, text in files_of(kind, "float").items() if name.rpartition("/")[2] == path.name
        ]
        assert there == path.read_text()


@pytest.mark.parametrize(("kind", "place"), [("zephyr", "src"), ("arduino", "src"), ("python", "c")])
def test_the_c_of_a_project_is_verified_where_it_is(kind, place, project, capsys):
    folder = project(kind, "float")
    (source,) = (folder / place).glob("*.c")
    assert says(f"verify {source}", capsys)[0] == 0
    source.write_text(source.read_text().replace(" = d1_x + d2_x;", " = d1_x - d2_x;"))
    status, out, _ = says(f"verify {source}", capsys)
    assert status == 1 and str(source) in out


@pytest.mark.parametrize("kind", ["zephyr", "platformio"])
def test_the_whole_of_a_project_is_verified(kind, project, capsys):
    folder = project(kind, "late")
    assert says(f"verify {folder}", capsys)[0] == 0
    next(iter((folder / "src").glob("*norm*.c"))).unlink()
    status, out, _ = says(f"verify {folder}", capsys)
    assert status == 1 and "is not there" in out


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_user_has_changed_stays(kind, project, capsys):
    folder = project(kind, "float")
    command = f"{COMMANDS['float']} --project {kind} --out {folder}"
    assert says(command, capsys)[0] == 0
    assert says(f"{command} --check", capsys)[0] == 0
    stays(folder / CHANGED[kind], command, capsys)


@pytest.mark.parametrize(
    "name", ["late", *(pytest.param(name, marks=pytest.mark.long) for name in ("two-speed", "system"))]
)
def test_what_a_user_has_changed_stays_with_other_commands(name, project, capsys):
    folder = project("zephyr", name)
    stays(folder / "Kconfig", f"{COMMANDS[name]} --project zephyr --out {folder}", capsys)


def stays(changed: Path, command: str, capsys: Any) -> None:
    """Change a file of a project, which is then found, and written over when that is forced."""
    before = changed.read_text()
    changed.write_text(before + "\n# mine\n")
    status, _, error = says(command, capsys)
    assert status == 2 and error.count("\n") == 1
    assert f"{changed} exists and differs from what --project writes; --force writes over it" in error
    status, out, error = says(f"{command} --check", capsys)
    assert status == 1 and "-# mine" in out and str(changed) in out
    assert error.endswith(
        "out of step; the same command without --check writes the files again, with --force over those that you have "
        "changed\n"
    )
    assert says(f"{command} --force", capsys)[0] == 0 and changed.read_text() == before


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("generate euler --target c --project arduino", "--target c: double has 32 bits on AVR; c-float or"),
        ("two-speed dcm --project arduino", "--target c: double has 32 bits on AVR"),
        ("window generate window-3-3 --project arduino", "--target c: double has 32 bits on AVR"),
        (
            "generate euler --target numpy --project python",
            "--project goes with targets in C, not with numpy",
        ),
        ("system two-speed-dcm --target numpy --out . --project", "targets in C, not with numpy"),
        ("system two-speed-dcm --project", "--project needs --out"),
        (
            "generate euler --target c --with-runs --project zephyr",
            "--with-runs does not go with --project z",
        ),
        ("two-speed dcm --project sled", "project 'sled' is not known; allowed: cmake, zephyr, "),
        ("window generate window-3-3 --project sled", "project 'sled' is not known"),
        ("system two-speed-dcm --out . --project sled", "project 'sled' is not known"),
    ],
)
def test_what_does_not_go_together_is_refused_in_one_line(command, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    status, _, error = says(command, capsys)
    assert status == 2 and message in error and error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_variant_brings_the_algorithm_and_the_line_the_kind(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "strapgen.toml").write_text('[variant.a]\nalgorithm = "euler-product"\ntarget = "c"\n')
    assert says("generate --variant a --project zephyr --out there", capsys)[0] == 0
    assert (tmp_path / "there/zephyr/module.yml").is_file()


# What the builds' own tools say of the files that describe a project


@pytest.mark.parametrize("command", ["step", "call"])
def test_zephyr_reads_the_options(command, project):
    """Kconfig in the language of the kernel, read by its own implementation in Python, with Zephyr's options above."""
    kconfiglib = pytest.importorskip("kconfiglib")
    folder = project("zephyr", command)
    top = folder.parent / "Kconfig"
    top.write_text(
        'config REQUIRES_FULL_LIBC\n\tbool "complete C library"\n'
        'config MAIN_STACK_SIZE\n\tint "stack"\n\tdefault 1024\n'
        f'source "{folder / "Kconfig"}"\n'
    )
    options = kconfiglib.Kconfig(str(top), warn_to_stderr=False)
    (name,) = [name for name in options.syms if name.startswith("STRAPGEN_")]
    assert options.syms[name].str_value == "n"
    options.load_config(str(folder / "tests/vectors/prj.conf"))
    assert options.warnings == [] and options.syms[name].str_value == "y"
    assert f"CONFIG_{name}" in (folder / "CMakeLists.txt").read_text()
    selects = [str(target.name) for target, _ in options.syms[name].selects]
    assert selects == (["REQUIRES_FULL_LIBC"] if command == "call" else [])


def test_zephyr_reads_the_module(project):
    """The keys are those of Zephyr's modules, and each path in them is there."""
    yaml = pytest.importorskip("yaml")
    folder = project("zephyr", "step")
    module = yaml.safe_load((folder / "zephyr/module.yml").read_text())
    assert sorted(module) == ["build", "name", "tests"] and sorted(module["build"]) == ["cmake", "kconfig"]
    assert module["name"] == "strapgen_euler_rk4_2_w32"
    assert (folder / module["build"]["cmake"] / "CMakeLists.txt").is_file()
    assert (folder / module["build"]["kconfig"]).is_file()
    (place,) = [path.parent for test in module["tests"] for path in (folder / test).rglob("testcase.yaml")]
    (case,) = yaml.safe_load((place / "testcase.yaml").read_text())["tests"].values()
    assert case["harness_config"]["regex"] == ["all vectors passed"]
    assert (place / "prj.conf").is_file() and (place / "CMakeLists.txt").is_file()


@pytest.mark.long
def test_espressif_packs_the_component(project, tmp_path):
    pytest.importorskip("idf_component_manager")
    folder = project("esp-idf", "step")
    home = {"IDF_TOOLS_PATH": str(tmp_path / "tools"), "HOME": str(tmp_path)}
    tool = Path(sys.executable).with_name("compote")
    pack = (tool, "component", "pack", "--name", "strapgen_step", "--dest-dir", tmp_path / "packed")
    printed(*pack, "--project-dir", folder, cwd=folder, **home)
    (archive,) = [path for path in (tmp_path / "packed").glob("*.tgz") if "examples" not in path.name]
    with tarfile.open(archive) as packed:
        names = {name.removeprefix("./") for name in packed.getnames()}
    code = [name for name in files_of("esp-idf", "step") if not name.startswith("examples/")]
    assert {*code} <= names and "include/euler_rk4_2_w32.h" in names
    (folder / "idf_component.yml").write_text("version: never\n")
    printed(*pack, "--project-dir", folder, cwd=folder, status=2, **home)


@pytest.mark.parametrize("command", ["step", "system"])
def test_platformio_takes_the_manifest(command, project, monkeypatch):
    manifests = pytest.importorskip("platformio.package.manifest.schema")
    from platformio.package.manifest.parser import ManifestParserFactory

    # It asks the network which licences there are.
    licences = {"licenses": [{"licenseId": "0BSD"}]}
    monkeypatch.setattr(manifests.ManifestSchema, "load_spdx_licenses", staticmethod(lambda: licences))
    folder = project("platformio", command)
    read = manifests.ManifestSchema().load_manifest(ManifestParserFactory.new_from_dir(str(folder)).as_dict())
    assert read["license"] == "0BSD" and read["name"].startswith("strapgen_")
    assert (read["frameworks"], read["platforms"]) == (["*"], ["*"])
    for header in read["headers"]:
        assert (folder / "include" / header).is_file()
    (example,) = read["examples"]
    assert all((folder / example["base"] / file).is_file() for file in example["files"])
    for key, wrong in {"version": "", "name": "", "license": "free"}.items():
        with pytest.raises(manifests.ManifestValidationError, match=key):
            manifests.ManifestSchema().load_manifest({**read, key: wrong})


# Builds: CMake's functions of Zephyr and of ESP-IDF are stood in for by a few lines that do the same on this machine


ZEPHYR = """project(Zephyr-Kernel LANGUAGES C)
file(STRINGS ${CMAKE_CURRENT_SOURCE_DIR}/prj.conf options REGEX "^CONFIG_")
foreach(option ${options})
  string(REPLACE "=" ";" pair ${option})
  list(GET pair 0 key)
  list(GET pair 1 value)
  set(${key} ${value})
endforeach()
set(CMAKE_C_STANDARD 99)
add_executable(app)
target_link_libraries(app PRIVATE m)
macro(zephyr_library_named name)
  set(current ${name})
  add_library(${name} STATIC)
  target_link_libraries(app PRIVATE ${name})
endmacro()
function(zephyr_library_sources)
  target_sources(${current} PRIVATE ${ARGN})
endfunction()
function(zephyr_library_compile_options)
  target_compile_options(${current} PRIVATE ${ARGN})
endfunction()
function(zephyr_include_directories)
  foreach(folder ${ARGN})
    target_include_directories(${current} PUBLIC ${CMAKE_CURRENT_SOURCE_DIR}/${folder})
  endforeach()
endfunction()
foreach(module ${ZEPHYR_EXTRA_MODULES})
  add_subdirectory(${module} module)
endforeach()
"""
IDF = """macro(project name)
  _project(${name} LANGUAGES C)
  set(CMAKE_C_STANDARD 99)
  add_subdirectory(${CMAKE_SOURCE_DIR}/../.. component)
  add_subdirectory(main)
  file(WRITE ${CMAKE_BINARY_DIR}/start.c "void app_main(void); int main(void) { app_main(); return 0; }")
  add_executable(app ${CMAKE_BINARY_DIR}/start.c)
  target_link_libraries(app PRIVATE idf_main idf_component m)
endmacro()
function(idf_component_register)
  cmake_parse_arguments(part "" "" "SRCS;INCLUDE_DIRS" ${ARGN})
  if(CMAKE_CURRENT_SOURCE_DIR MATCHES "/main$")
    set(lib idf_main)
  else()
    set(lib idf_component)
  endif()
  set(COMPONENT_LIB ${lib} PARENT_SCOPE)
  add_library(${lib} STATIC ${part_SRCS})
  target_include_directories(${lib} PUBLIC ${part_INCLUDE_DIRS})
  if(lib STREQUAL "idf_main")
    target_link_libraries(${lib} PRIVATE idf_component)
  endif()
endfunction()
"""


def built(kind: str, folder: Path, tmp_path: Path) -> str:
    """Build a project as its kind does, run its vectors, and return what is printed."""
    if kind == "zephyr":
        (tmp_path / "ZephyrConfig.cmake").write_text(ZEPHYR)
        return _cmake(folder / "tests/vectors", tmp_path, f"-DZephyr_DIR={tmp_path}")
    if kind == "esp-idf":
        place = tmp_path / "idf/tools/cmake/project.cmake"
        place.parent.mkdir(parents=True)
        place.write_text(IDF)
        return _cmake(folder / "examples/vectors", tmp_path, IDF_PATH=str(tmp_path / "idf"))
    if kind == "platformio":
        needed("gcc")
        manifest = json.loads((folder / "library.json").read_text())
        example = folder / manifest["examples"][0]["base"]
        sources = [*(folder / "src").glob("*.c"), *example.glob("*.c")]
        flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", *manifest["build"]["flags"]]
        printed("gcc", *flags, "-I", folder / "include", *sources, "-o", "program", "-lm", cwd=tmp_path)
        return printed(tmp_path / "program", cwd=tmp_path)
    return _python(folder, tmp_path)


def _cmake(source: Path, tmp_path: Path, *words: str, **more: str) -> str:
    needed("cmake")
    build = tmp_path / "build"
    said = printed("cmake", "-S", source, "-B", build, *words, cwd=tmp_path, **more)
    said += printed("cmake", "--build", build, cwd=tmp_path, **more)
    assert "warning" not in said.lower()
    return printed(build / "app", cwd=tmp_path)


def _python(folder: Path, tmp_path: Path) -> str:
    """Build the wheel, install it into an environment of its own, and run the tests of the project there."""
    pytest.importorskip("build")
    needed("gcc")
    printed(
        sys.executable,
        "-m",
        "build",
        "--wheel",
        "--no-isolation",
        "--outdir",
        tmp_path / "dist",
        folder,
        cwd=tmp_path,
    )
    (wheel,) = (tmp_path / "dist").glob("*.whl")
    printed(sys.executable, "-m", "venv", tmp_path / "fresh", "--without-pip", cwd=tmp_path)
    (packages,) = (tmp_path / "fresh").glob("lib/python*/site-packages")
    install = (sys.executable, "-m", "pip", "install", "--no-deps", "--no-index", "--target", packages, wheel)
    printed(*install, cwd=tmp_path)
    # What the wheel needs, numpy and cffi, and pytest are those of this environment; there is no network.
    (packages / "needed.pth").write_text("\n".join(path for path in sys.path if path.endswith("-packages")))
    python = tmp_path / "fresh/bin/python"
    return printed(python, "-m", "pytest", "-q", "-p", "no:cacheprovider", folder / "tests", cwd=tmp_path)


@pytest.mark.long
@pytest.mark.parametrize(("kind", "command"), PAIRS)
def test_a_project_builds_and_passes_its_vectors(kind, command, project, tmp_path):
    said = built(kind, project(kind, command), tmp_path)
    if kind == "python":
        assert " passed" in said and "failed" not in said
    else:
        assert said.endswith("all vectors passed\n") and said.count(" 0 failed") == said.count(" passed, ")


@pytest.mark.long
@pytest.mark.parametrize("kind", ["zephyr", "platformio"])
def test_a_fault_in_the_c_is_seen(kind, project, tmp_path):
    folder = project(kind, "float")
    (source,) = (folder / "src").glob("*.c")
    text = source.read_text()
    assert text.count(" = d1_x + d2_x;") == 1
    source.write_text(text.replace(" = d1_x + d2_x;", " = d1_x - d2_x;"))
    with pytest.raises(AssertionError, match="VECTORS FAILED"):
        assert built(kind, folder, tmp_path).endswith("all vectors passed\n")


@pytest.mark.long
def test_a_package_takes_arrays_and_refuses_others(project, tmp_path):
    """Beside the vectors: arguments of other types and lengths, codes of errors, and the memory of a unit."""
    folder = project("python", "late")
    _python(folder, tmp_path)
    (tmp_path / "use.py").write_text(
        "import numpy as np\n"
        "from strapgen_euler_late_3_3_w32 import Memory\n"
        "one = Memory()\n"
        "one.init()\n"
        "committed = [one.push(np.zeros(3, np.int16), 0) for _ in range(20)]\n"
        "assert sum(committed) > 0 and one['count'] > 0 and one['state'].shape == (4,)\n"
        "assert one.now().dtype == np.int32 and one.now().shape == (4,)\n"
        "def refusal(sample, kind=0):\n"
        "    try:\n"
        "        one.push(sample, kind)\n"
        "    except ValueError as error:\n"
        "        return str(error)\n"
        "print(refusal([0, 0]), refusal([0.5, 0, 0]), refusal([2**40, 0, 0]), refusal([2**30, 0, 0]), sep='\\n')\n"
    )
    lines = printed(tmp_path / "fresh/bin/python", "use.py", cwd=tmp_path).splitlines()
    assert lines[0] == "sample has 2 numbers; 3 are needed"
    assert lines[1:3] == ["sample has numbers that are no integers of 32 bits"] * 2
    assert lines[3].startswith("euler_late_3_3_w32_push refuses the call with code -1;")


# Arduino: the sketch with the core of Debian's package, on a simulated ATmega328P


CORE = Path("/usr/share/arduino/hardware/arduino/avr")


@pytest.mark.long
@pytest.mark.needs("avr-gcc", "avr-g++", "simavr")
@pytest.mark.parametrize("command", ["step", "float", "late"])
def test_arduino_runs_every_sketch(command, project, tmp_path):
    if not CORE.is_dir():
        pytest.skip("arduino-core-avr is not on this machine")
    folder = project("arduino", command)
    library = dict(
        line.split("=", 1)
        for line in (folder / "library.properties").read_text().splitlines()
        if not line.startswith("#")
    )
    assert (folder / "src" / library["includes"]).is_file()
    places = [CORE / "cores/arduino", CORE / "variants/standard", folder / "src"]
    flags = ["-mmcu=atmega328p", "-DF_CPU=16000000L", "-DARDUINO=10819", "-DARDUINO_ARCH_AVR", "-Os"]
    flags += ["-ffunction-sections", "-fdata-sections", *(f"-I{place}" for place in places)]
    core = [*(CORE / "cores/arduino").glob("*.c"), *(CORE / "cores/arduino").glob("*.cpp")]
    objects = _objects(flags, core, tmp_path / "core")
    objects += _objects(
        [*flags, "-Wall", "-Wextra", "-Werror"], (folder / "src").glob("*.c"), tmp_path / "library"
    )
    sketches = sorted((folder / "examples").iterdir())
    assert sketches
    for sketch in sketches:
        text = (sketch / f"{sketch.name}.ino").read_text()
        main = tmp_path / f"{sketch.name}.cpp"
        main.write_text(f"#include <Arduino.h>\n{text}")
        own = _objects(flags, [main, *sketch.glob("*.c")], tmp_path / sketch.name, f"-I{sketch}")
        program = tmp_path / f"{sketch.name}.elf"
        printed(
            "avr-gcc",
            "-mmcu=atmega328p",
            "-Wl,--gc-sections",
            *own,
            *objects,
            "-lm",
            "-o",
            program,
            cwd=tmp_path,
        )
        assert "all vectors passed" in _simulated(program), sketch.name


def _objects(flags: list[str], sources, folder: Path, *more: str) -> list[Path]:
    folder.mkdir()
    found = []
    for source in sources:
        found.append(folder / f"{source.name}.o")
        compiler = ["avr-gcc", "-std=gnu11"]
        if source.suffix == ".cpp":
            compiler = [
                "avr-g++",
                "-std=gnu++11",
                "-fno-exceptions",
                "-fno-threadsafe-statics",
                "-DDECIMAL_DIG=17",
            ]
        printed(*compiler, *flags, *more, "-c", source, "-o", found[-1], cwd=folder)
    return found


def _simulated(program: Path) -> str:
    """Return what a program sends through the serial port until it says how its vectors went."""
    words = ["simavr", "-m", "atmega328p", "-f", "16000000", str(program)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as running:
        assert running.stdout is not None
        said = ""
        for line in running.stdout:
            said += line
            if "all vectors passed" in line or "VECTORS FAILED" in line:
                break
        running.kill()
    return said
