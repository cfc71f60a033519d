"""C programs for the tests: compiled as strictly as generated files are, and run on this machine or an emulated one."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterable, Mapping
from pathlib import Path

import pytest

STRICT = [
    *("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion", "-Wshadow"),
    *("-Wcast-qual", "-Wdouble-promotion", "-Wfloat-conversion", "-Werror", "-ffp-contract=off"),
]
#: Compilers and their flags; the library of AVR computes floats as doubles, which there have as many bits.
COMPILERS = {
    "gcc": [],
    "clang": [],
    "arm-none-eabi-gcc": ["-mcpu=cortex-m3", "-mthumb", "--specs=picolibc.specs"],
    "riscv64-unknown-elf-gcc": ["-march=rv32imc", "-mabi=ilp32", "--specs=picolibc.specs"],
    "avr-gcc": ["-mmcu=atmega2560", "-Wno-double-promotion"],
}
#: Addresses of the emulators' memory, and the emulators; what the program prints comes through the debugger's door.
_MEMORY = {"arm-none-eabi-gcc": ("0", "0x20000000"), "riscv64-unknown-elf-gcc": ("0x80000000", "0x80400000")}
_EMULATORS = {
    "arm-none-eabi-gcc": ["qemu-system-arm", "-M", "mps2-an385"],
    "riscv64-unknown-elf-gcc": ["qemu-system-riscv32", "-M", "virt", "-bios", "none"],
}


def needed(*programs: str) -> None:
    """Skip the test, by name, where a program is missing."""
    for program in programs:
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not on this machine")


def written(folder: Path, files: Mapping[str, str]) -> Path:
    """Write files, and return their folder."""
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def complaints(compiler: str, folder: Path, sources: Iterable[str]) -> str:
    """Return what a compiler says about files with all warnings on."""
    command = [compiler, *STRICT, *COMPILERS[compiler], "-fsyntax-only", *sources]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return done.stderr + ("" if done.returncode == 0 else f"exit status {done.returncode}")


def said(folder: Path, sources: Iterable[str], compiler: str = "gcc") -> tuple[int, str]:
    """Compile files into a program with all warnings on, run it, and return its status and what it prints."""
    needed(compiler)
    command = [compiler, *STRICT, *COMPILERS[compiler], "-O0", "-o", "program", *sources, "-lm"]
    run = ["./program"]
    if compiler in _EMULATORS:
        needed(_EMULATORS[compiler][0])
        flash, ram = _MEMORY[compiler]
        sizes = [f"__flash={flash}", "__flash_size=0x400000", f"__ram={ram}", "__ram_size=0x400000"]
        command += ["--oslib=semihost", "--crt0=hosted", *(f"-Wl,--defsym={size}" for size in sizes)]
        run = [*_EMULATORS[compiler], "-display", "none", "-monitor", "none", "-serial", "none"]
        run += ["-semihosting-config", "enable=on,target=native", "-kernel", "program"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    done = subprocess.run(
        run, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, timeout=60
    )
    return done.returncode, done.stdout
