"""What holds for every generated C file: lines, names, the proof at each value, compilers, and MISRA C:2012."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from strapgen.catalogue import standard
from strapgen.ir.fixed_settings import Settings
from strapgen.library import generated_sources, two_speed_sources
from strapgen.support import resources

ROOT = Path(__file__).parents[2]
FOLDERS = ("c", "c_float", "c_fixed")
STRICT = [
    "-std=c99",
    "-pedantic",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wsign-conversion",
    "-Wshadow",
    "-Wcast-qual",
    "-Wdouble-promotion",
    "-Wfloat-conversion",
    "-Werror",
    "-fsyntax-only",
]
#: Compilers of microcontrollers; the library of AVR computes floats as doubles, which there have as many bits.
CROSS = {
    "clang": [],
    "arm-none-eabi-gcc": ["-mcpu=cortex-m3", "-mthumb"],
    "riscv64-unknown-elf-gcc": ["-march=rv32imc", "-mabi=ilp32"],
    "avr-gcc": ["-mmcu=atmega2560", "-Wno-double-promotion"],
}


def texts() -> dict[str, str]:
    """Return the C of the standard catalogue, and the loops of some steps."""
    folder = resources.folder("generated")
    found = {path.name: path.read_text() for name in FOLDERS for path in (folder / name).glob("*.[ch]")}
    assert len(found) > 200
    for target in ("c", "c-fixed"):
        loops = Settings(carry="full") if target == "c-fixed" else None
        found |= two_speed_sources.sources("dcm", 2, target, loops).step_files
    settings = Settings(32, carry="full")
    for choice in standard():
        if choice.kernel in ("euler-rk4-2", "dcm-rk1-2"):
            for target in ("c", "c-float", "c-fixed"):
                found |= generated_sources.sources(
                    choice, target, settings if target == "c-fixed" else None
                ).files
    return found


def without_comments(text: str) -> str:
    return re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)


def test_lines_have_fewer_than_100_columns():
    long = [
        f"{name}: {line}" for name, text in texts().items() for line in text.splitlines() if len(line) > 99
    ]
    assert long == []


def test_names_have_at_most_31_characters():
    """But for what the loops of a host add to a function's name, and macros: C99 tells these apart by 63 characters."""
    names = {
        word
        for name, text in texts().items()
        if "_runs." not in name
        for word in re.findall(r"[A-Za-z_]\w*", without_comments(text))
    }
    assert [name for name in names if len(name) > (63 if name.isupper() else 31)] == []


FORMAT = r"Q-?\d+\.-?\d+, \S+ \.\. \S+, (exact|error \S+)(; stands for [^*]+)?"


def test_every_fixed_point_value_has_its_format_range_and_error():
    values = 0
    for name, text in texts().items():
        if not name.endswith("_w32.c") or "memset" in text:  # what calls loops computes nothing itself
            continue
        body = text[text.index(f"\nint {name[:-2]}(") :]
        for declaration in re.findall(
            r"^    (?:const )?int(?:32|64)_t (\w+)[ ;][^;]*;?(.*(?:\n +/\*.*)?)", body, re.M
        ):
            variable, rest = declaration
            loaded = re.search(rf"{variable} = \w+\[\d+\];", body)
            if loaded or variable.endswith(("_sum", "_raw")):
                continue
            values += 1
            assert re.search(rf"/\* {FORMAT} \*/", rest) or re.search(
                rf"{variable}(?: =[^;]*)?;\s*/\* {FORMAT} \*/", body
            ), (name, variable)
    assert values > 900


def needed(program: str) -> None:
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not on this machine")


@pytest.mark.parametrize("compiler", CROSS)
def test_strict_compilers_of_microcontrollers_are_silent(compiler):
    needed(compiler)
    place = subprocess.run(
        [compiler, "-print-file-name=picolibc.specs"], capture_output=True, text=True, check=False
    )
    library = ["--specs=picolibc.specs"] if Path(place.stdout.strip()).is_absolute() else []
    folder = resources.folder("generated")
    with_double = "c" if compiler != "avr-gcc" else ""  # AVR has no double of 53 bits, which the files refuse
    files = sorted(p for name in FOLDERS if name != "c" or with_double for p in (folder / name).glob("*.c"))
    together = "".join(f'#include "{path}"\n' for path in files)
    command = [compiler, *STRICT, *CROSS[compiler], *library, "-x", "c", "-"]
    done = subprocess.run(command, input=together, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.long
def test_rules_of_misra_that_are_broken_are_those_of_the_page(tmp_path):
    needed("cppcheck")
    page = (ROOT / "docs" / "misra.md").read_text()
    explained = set(re.findall(r"^\| (\d+\.\d+) \|", page, flags=re.MULTILINE))
    assert 0 < len(explained) <= 8
    for name, text in texts().items():
        if "_runs." not in name and "_float." not in name:  # float differs from double in its type alone
            (tmp_path / name).write_text(text)
    files = sorted(path.name for path in tmp_path.glob("*.c"))
    command = ["cppcheck", "--addon=misra", "--quiet", "-j2", *files]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    broken = set(re.findall(r"misra-c2012-(\d+\.\d+)", done.stderr))
    assert broken == explained
