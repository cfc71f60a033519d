"""Programs without an operating system: what a processor starts from, where its memory lies, how they are linked."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

from strapgen.ir.exceptions import CompilerError
from strapgen.lab.cost.processors import Processor

_VECTORS = """
extern char stack_top[];
void start(void);
__attribute__((section(".start"), used)) void *const vectors[2] = {(void *)stack_top, (void *)start};
"""
_ENTRY = """
__asm__(".section .start,\\"ax\\"\\n.globl entry\\nentry: la sp, stack_top\\n call start\\n1: j 1b\\n.text\\n");
"""
_START = """
#include <stddef.h>
#include <stdint.h>
{start}
/* What compilers call even where there is no library. */
void *memcpy(void *to, const void *from, size_t count);
void *memcpy(void *to, const void *from, size_t count)
{{
    for (size_t k = 0; k < count; ++k)
        ((volatile char *)to)[k] = ((const char *)from)[k];
    return to;
}}
void *memset(void *to, int byte, size_t count);
void *memset(void *to, int byte, size_t count)
{{
    for (size_t k = 0; k < count; ++k)
        ((volatile char *)to)[k] = (char)byte;
    return to;
}}
/* Ends the emulator. */
void stop(void);
__attribute__((noinline, used)) void stop(void)
{{
    *(volatile uint32_t *)(uintptr_t){address}u = {word}u;
    for (;;) {{
    }}
}}
"""
_LAYOUT = """
SECTIONS
{{
    . = {code};
    .start : {{ KEEP(*(.start)) }}
    .text : {{ *(.text*) *(.rodata*) *(.srodata*) }}
    .ARM.exidx : {{ *(.ARM*) }}
    . = {data};
    .data : {{ *(.data*) *(.sdata*) *(.bss*) *(.sbss*) *(COMMON) }}
    . = ALIGN(16);
    . += 0x1800;
    stack_top = .;
}}
"""
#: Flags that link a program without a library; `layout.ld` says where its parts lie.
LINKING = ("-nostartfiles", "-nostdlib", "-T", "layout.ld", "-Wl,--no-warn-rwx-segments")

#: Name of the source of the start.
START = "start.c"


def start_text(processor: Processor) -> str:
    """Return C text with what a processor starts from, which calls ``start()``; ``stop()`` ends the emulator."""
    address, word = processor.stop
    start = _VECTORS if processor.start == "vectors" else _ENTRY
    return _START.format(start=start, address=address, word=word)


def write_start(processor: Processor, folder: Path, rest: str, name: str = START) -> None:
    """Write a source with `start_text`, and the layout of the memory beside it."""
    (folder / name).write_text(start_text(processor) + rest)
    (folder / "layout.ld").write_text(_LAYOUT.format(code=processor.code, data=processor.data))


def compiled(command: Sequence[str], folder: Path) -> None:
    """Let a compiler run in a folder."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise CompilerError(f"{command[0]} failed: {_first_error(done.stderr)}")


def _first_error(said: str) -> str:
    return next(
        (line for line in said.splitlines() if "error" in line or "undefined" in line), said.strip()[:200]
    )
