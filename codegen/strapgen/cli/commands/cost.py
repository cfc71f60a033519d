"""The command ``strapgen cost`` measures what generated C costs on microcontrollers."""

from __future__ import annotations

from typing import Annotated

import typer

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import MethodOptions, option
from strapgen.cli.output import TEXT_OUTPUT, Output
from strapgen.support.exceptions import InputError


@grouped
def cost(
    kernels: Annotated[
        list[str],
        typer.Argument(
            metavar="NAME...",
            help="dcm, euler, cayley-klein, any other kernel that strapgen list kernels shows, or a Python file.",
            show_default=False,
        ),
    ],
    *,
    method: MethodOptions,
    target: Annotated[
        str,
        option("--target", metavar="NAME", help="Kind of code: c-fixed, c or c-float.", panel="Algorithm"),
    ] = "c-fixed",
    fixed: FixedOptions,
    cross: Annotated[
        str | None,
        option(
            "--cross",
            metavar="COMPILER",
            help="Cross compiler, as arm-none-eabi-gcc.  [default: all that are installed]",
            panel="Processor",
        ),
    ] = None,
    cpu: Annotated[
        str | None,
        option(
            "--cpu",
            metavar="NAME,...",
            help="Processors: cortex-m0, cortex-m3, cortex-m4, cortex-m7, cortex-m33, rv32imc, avr.  "
            "[default: all whose compiler is installed]",
            panel="Processor",
        ),
    ] = None,
    output: Annotated[Output, Shown(only=TEXT_OUTPUT)],
) -> None:
    """Measure what the C of a kernel costs on microcontrollers.

    You get the instructions and the bytes of the object code, the stack, and, where QEMU is installed, the instructions
    that a call executes, from the entry of the function to its return.

    Example: strapgen cost euler dcm --cross arm-none-eabi-gcc --cpu cortex-m3 --max-rate-deg-s 400 --step 0.01
    """
    output.check(*kernels)
    from strapgen.experiments import cost as costs
    from strapgen.library import generated_sources
    from strapgen.reports.cost import cost_report
    from strapgen.support import checks
    from strapgen.targets import TARGETS

    checks.choice("target", target, [name for name, entry in TARGETS.items() if entry.compiled])
    names = [] if cpu is None else [name.strip() for name in cpu.split(",")]
    processors = costs.processors(cross, names)
    rows = []
    for kernel in kernels:
        choice = method.choose(kernel, step=False)
        settings = fixed.settings(choice.increments_per_step)
        if settings is not None and not TARGETS[target].fixed:
            raise InputError(f"the options of fixed point go with --target c-fixed, not with {target}")
        sources = generated_sources.sources(choice, target, settings)
        rows += [costs.cost(sources, name) for name in processors]
    output.report(cost_report(rows))
