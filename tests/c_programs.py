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


#: What prints through the serial line of an ATmega2560, where `printf` has no way out by itself.
_SERIAL_LINE = """#include <avr/io.h>
#include <stdio.h>
static int put(char character, FILE *file)
{
    (void)file;
    while (!(UCSR0A & (1 << UDRE0))) {
    }
    UDR0 = (unsigned char)character;
    return 0;
}
static FILE line = FDEV_SETUP_STREAM(put, NULL, _FDEV_SETUP_WRITE);
__attribute__((constructor)) static void begin(void)
{
    UCSR0B = 1 << TXEN0;
    stdout = &line;
}
"""


def line_of_avr(folder: Path, sources: Iterable[str]) -> str:
    """Return the first line that a program prints on an emulated AVR, whose int has 16 bits."""
    needed("avr-gcc", "qemu-system-avr")
    (folder / "serial_line.c").write_text(_SERIAL_LINE)
    command = ["avr-gcc", "-mmcu=atmega2560", "-std=gnu99", "-Os", "-o", "program", *sources, "serial_line.c"]
    subprocess.run(command, cwd=folder, check=True)
    run = ["timeout", "60", "qemu-system-avr", "-M", "mega2560", "-display", "none", "-monitor", "none"]
    with subprocess.Popen(
        [*run, "-serial", "stdio", "-bios", "program"],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as emulator:
        assert emulator.stdout is not None
        line = emulator.stdout.readline()  # the processor never stops by itself
        emulator.terminate()
    return line.strip()
