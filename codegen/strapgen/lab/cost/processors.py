"""The processors of microcontrollers for which C is compiled and measured: compiler, flags, emulator and memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Processor:
    """A processor, and the programs that compile for it and run its code."""

    #: Cross compiler, of the family of gcc
    compiler: str
    #: Flags that choose the processor
    flags: tuple[str, ...]
    #: QEMU with a machine of this processor; empty if it has none
    emulator: tuple[str, ...] = ()
    #: Addresses of the machine's memory for code, from which it starts, and for data
    code: int = 0
    data: int = 0
    #: "vectors" if it starts from a table of vectors, "code" if at the first instruction
    start: Literal["vectors", "code"] = "vectors"
    #: An address and a word: writing it there ends the emulator
    stop: tuple[int, int] = (0, 0)

    def tool(self, name: str) -> str:
        """Return the name of another program of the compiler's tools, as "objdump"."""
        return self.compiler.removesuffix("gcc") + name


#: Asks for a reset, at which the emulator ends.
_RESET = (0xE000ED0C, 0x05FA0004)


def _cortex(core: str, machine: str, code: int = 0, data: int = 0x20000000) -> Processor:
    return Processor(
        "arm-none-eabi-gcc",
        (f"-mcpu={core}", "-mthumb", "-mfloat-abi=soft"),
        ("qemu-system-arm", "-M", machine),
        code,
        data,
        stop=_RESET,
    )


#: Processors by the names that ``strapgen cost --cpu`` takes.
PROCESSORS = {
    "cortex-m0": _cortex("cortex-m0", "microbit"),
    "cortex-m3": _cortex("cortex-m3", "mps2-an385"),
    "cortex-m4": _cortex("cortex-m4", "mps2-an386"),
    "cortex-m7": _cortex("cortex-m7", "mps2-an500"),
    "cortex-m33": _cortex("cortex-m33", "mps2-an505", 0x10000000, 0x38000000),
    "rv32imc": Processor(
        "riscv64-unknown-elf-gcc",
        ("-march=rv32imc", "-mabi=ilp32"),
        ("qemu-system-riscv32", "-M", "virt", "-bios", "none"),
        0x80000000,
        0x80100000,
        start="code",
        stop=(0x100000, 0x5555),
    ),
    "avr": Processor("avr-gcc", ("-mmcu=atmega2560",)),
}
