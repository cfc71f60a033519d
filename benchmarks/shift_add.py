"""Counts what constants as shifts and additions cost on a Cortex-M0 and on an AVR, beside multiplication.

Instructions of a call on the Cortex-M0 run in QEMU, as `strapgen cost` counts them; cycles of a call on the AVR are
read from its timer in simavr. The tools are those of `make evidence-tools`.

    python benchmarks/shift_add.py
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from fractions import Fraction
from pathlib import Path

import strapgen
from strapgen.catalogue import Choice
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.lab.cost import cost
from strapgen.lab.processors import PROCESSORS

#: Kernels with their constants and settings.
KERNELS: dict[str, tuple[Choice, dict]] = {
    "pulse-torque": (
        strapgen.choose(
            "pulse-torque",
            constants={
                "gain": "9/32", "lag_gain": "3/64", "lag_pole": "1/2", "integral_gain": "1/32", "leak": "1/128"
            },
        ),
        {},
    ),
    "butterworth-2": (
        strapgen.choose("butterworth-2", constants={"loss": "0.39", "coupling": "0.14", "square": "0.0312389237"}),
        {"ranges": {"sample": Fraction(128), "first": Fraction(128), "second": Fraction(192)}},
    ),
    "euler rk4": (
        strapgen.choose("euler", "rk4", 2),
        {"max_rate_deg_s": 400, "step": "0.01", "increments": 2},
    ),
}  # fmt: skip
WAYS = {"product": {}, "all digits": {"multiply": "shift-add"}} | {
    f"{digits} digits": {"multiply": "shift-add", "digits": digits} for digits in (4, 2)
}
#: A main program that times a call with the timer of the processor, and writes the cycles to the console.
MAIN = """
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/interrupt.h>
#include "{header}"

static void write(char c) {{ while (!(UCSR0A & (1 << UDRE0))) {{ }} UDR0 = c; }}

int main(void)
{{
{arrays}
    volatile uint16_t empty, used;
    UCSR0B = 1 << TXEN0;
    TCCR1B = 1;
    uint16_t begin = TCNT1;
    uint16_t end = TCNT1;
    empty = end - begin;
    begin = TCNT1;
    const int status = {call};
    end = TCNT1;
    used = end - begin - empty;
    if (status != 0) {{ write('?'); }}
    for (uint16_t unit = 10000; unit; unit /= 10) {{ write((char)('0' + used / unit % 10)); }}
    write('\\n');
    cli();
    sleep_enable();
    sleep_cpu();
}}
"""


def avr_cycles(sources: Sources, word: int) -> int:
    """Return the cycles of a call on an AVR, for input inside its range."""
    assert sources.fixed is not None
    names, arrays = [], []
    for argument in [*sources.fixed.inputs, *sources.fixed.outputs]:
        values = (
            ", ".join([str(argument.high // 3)] * argument.signal.size)
            if argument in sources.fixed.inputs
            else "0"
        )
        arrays.append(
            f"    static volatile int{word}_t {argument.signal.name}[{argument.signal.size}] = {{{values}}};"
        )
        names.append(f"(int{word}_t *){argument.signal.name}")
    header = next(file for file in sources.step_files if file.endswith(".h"))
    call = f"{sources.function.name}({', '.join(names)})"
    with tempfile.TemporaryDirectory() as folder:
        for file, text in sources.step_files.items():
            (Path(folder) / file).write_text(text)
        (Path(folder) / "main.c").write_text(MAIN.format(header=header, arrays="\n".join(arrays), call=call))
        files = [file for file in sources.step_files if file.endswith(".c")]
        flags = [*PROCESSORS["avr"].flags, "-std=gnu99", "-O2"]
        subprocess.run(["avr-gcc", *flags, "main.c", *files, "-o", "main.elf"], cwd=folder, check=True)
        done = subprocess.run(
            ["simavr", "-m", "atmega2560", "-f", "16000000", "main.elf"],
            cwd=folder,
            capture_output=True,
            timeout=60,
        )
    said = re.sub(r"\x1b\[[0-9;]*m", "", (done.stdout + done.stderr).decode(errors="replace"))
    (cycles,) = re.findall(r"^([0-9]{5})\.?", said, flags=re.MULTILINE)
    return int(cycles)


def main() -> None:
    """Print the counts of every kernel, word and way."""
    print(
        f"{'kernel':14} {'word':>4} {'way':10} {'M0 instructions':>15} {'AVR cycles':>10} {'error, places':>13}"
    )
    for name, (choice, stated) in KERNELS.items():
        for word in (16, 32):
            for way, more in WAYS.items():
                settings = Settings.of(word=word, **stated, **more)
                sources = strapgen.pipeline.compile(choice, "c-fixed", settings)
                executed = cost(sources, "cortex-m0").executed
                result = sources.fixed.outputs[-1]
                places = float(max(result.errors) / result.format.unit)
                print(
                    f"{name:14} {word:4} {way:10} {executed:15} {avr_cycles(sources, word):10} {places:13.3g}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
