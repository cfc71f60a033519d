"""The command ``strapgen vectors`` writes test vectors of generated C, and the test that runs them on a processor."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import grouped
from strapgen.cli.options import Algorithm, MethodOptions, option
from strapgen.cli.output import Folder, Format, check_format, show
from strapgen.ir.exceptions import InputError


@grouped
def vectors(
    algorithm: Algorithm,
    *,
    method: MethodOptions,
    target: Annotated[
        str,
        option("--target", metavar="NAME", help="Kind of code: c-fixed, c or c-float.", panel="Algorithm"),
    ] = "c-fixed",
    fixed: FixedOptions,
    count: Annotated[
        int,
        option(
            "--count", metavar="N", help="Number of vectors: corners first, then random ones.", panel="Input"
        ),
    ] = 200,
    seed: Annotated[
        int, option("--seed", metavar="N", help="Seed of the random vectors.", panel="Input")
    ] = 1,
    out: Folder = None,
    format: Format = "text",
) -> None:
    """Write test vectors of generated C, for a test on the processor.

    You get the inputs and what each call must return, as a C header and as CSV, and a test that prints how many
    vectors passed. In fixed point the numbers come from the model in Python integers, and a call must return those
    very integers; calls that must be refused are among them.

    Example: strapgen vectors euler --max-rate-deg-s 400 --step 0.01 --count 200 --out firmware
    """
    check_format(format)
    from strapgen.firmware.project import refuse_changed
    from strapgen.firmware.vectors import VectorsResult, vectors_of_choice
    from strapgen.firmware.vectors_c import table_files
    from strapgen.ir.fixed_settings import Settings
    from strapgen.storage.files import write_files
    from strapgen.targets import BUILT_IN

    choice = method.choose(algorithm, step=False)
    settings = fixed.settings(choice.increments_per_step)
    is_floating = target in BUILT_IN and not BUILT_IN[target].fixed
    if is_floating and settings is not None and settings != Settings(sums=settings.sums):
        raise InputError(f"the options of fixed point go with --target c-fixed, not with {target}")
    fixed.check_increments(choice)
    table = vectors_of_choice(choice, target, settings, count, seed)
    fixed.check_feedback(table.sources)
    files = table_files(table)
    refuse_changed(out or Path(), files)
    written = write_files(out or Path(), files)
    refused = sum(row.status != 0 for row in table.rows)
    show(VectorsResult(table.sources.function.name, written, len(table.rows), refused), format)
