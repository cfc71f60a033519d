"""The command ``strapgen cost`` measures generated C on microcontrollers."""

from __future__ import annotations

from typing import Annotated

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Excludes, OneOf, Shown, grouped, rules
from strapgen.cli.options import MethodOptions, argument, option
from strapgen.cli.output import TEXT_OUTPUT, Output
from strapgen.cli.progress import waiting


@grouped
@rules(
    OneOf("NAME... --all", needed="a kernel is needed, or --all; strapgen list kernels shows them"),
    Excludes("--all", "@method --target @fixed", reason="--all measures the whole catalogue in fixed point"),
)
def cost(
    kernels: Annotated[
        list[str] | None,
        argument(
            "NAME...",
            help="dcm, euler, cayley-klein, any other kernel that strapgen list kernels shows, or a Python file.",
            words="strapgen.catalogue.names:reserved",
        ),
    ] = None,
    *,
    all_: Annotated[
        bool,
        option(
            "--all",
            help="Measure the standard catalogue in 32-bit fixed point: all of it on cortex-m3, "
            "the steps of fourth order on every processor.",
            panel="Algorithm",
        ),
    ] = False,
    method: MethodOptions,
    target: Annotated[
        str | None,
        option(
            "--target",
            metavar="NAME",
            help="Kind of code: c-fixed, c or c-float.  [default: c-fixed]",
            words=("c-fixed", "c", "c-float"),
            panel="Algorithm",
        ),
    ] = None,
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
        tuple[str, ...] | None,
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
    """Measure size and execution of generated C on microcontrollers.

    You get the instructions and the bytes of the object code, the stack, and, where QEMU is installed, the instructions
    that a call executes, from the entry of the function to its return.

    Example: strapgen cost euler dcm --cross arm-none-eabi-gcc --cpu cortex-m3 --max-rate-deg-s 400 --step 0.01
    """
    output.check(*(kernels or ()))
    from strapgen.ir import checks
    from strapgen.lab import cost as costs
    from strapgen.lab.cost import CostResult
    from strapgen.targets import TARGETS

    processors = costs.processors(cross, cpu or ())
    if all_:
        with waiting("measuring"):
            rows = [*costs.catalogue_costs(processors)]
        output.show(CostResult(rows, of_catalogue=True))
        return
    target = target or "c-fixed"
    checks.choice("target", target, [name for name, entry in TARGETS.items() if entry.compiled])
    rows = []
    for kernel in kernels or ():
        choice = method.choose(kernel, step=False)
        settings = fixed.settings(choice.increments_per_step)
        fixed.check_target(target)
        rows += costs.costs_of([choice], target, settings, processors).costs
    output.show(CostResult(rows))
