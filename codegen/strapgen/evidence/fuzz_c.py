"""Prints a driver for a fuzzer of a fixed-point function: from any bytes calls, and checks of what they return.

What is checked follows from the function's interface: ranges of inputs and outputs, range checks on the way, error
feedback, and the loops over samples and runs.
"""

from __future__ import annotations

from collections.abc import Sequence

from strapgen.ir.interfaces import Argument
from strapgen.ir.sources import Sources
from strapgen.targets.c.number_text import numbers_of, types_of
from strapgen.targets.definitions import word_literal
from strapgen.targets.rendering import render


def driver_name(sources: Sources) -> str:
    """Return the name of a function's driver."""
    return f"fuzz_{sources.function.name}.c"


def driver_files(sources: Sources, range_checked: bool, commands: Sequence[str] = ()) -> dict[str, str]:
    """Print the driver of a function."""
    assert sources.fixed is not None
    numbers, interface = numbers_of(sources), sources.fixed
    inputs, outputs = interface.inputs, interface.outputs
    prefix = {a.signal.name: f"in_{a.signal.name}" for a in inputs}
    prefix |= {a.signal.name: f"out_{a.signal.name}" for a in outputs}
    feedback = ["feedback"] if interface.residuals else []
    order = [*(prefix[a.signal.name] for a in inputs), *feedback, *(prefix[a.signal.name] for a in outputs)]
    step = sources.attitude_step is not None and len(inputs) == 2
    values = {
        "name": sources.function.name,
        "commands": commands,
        "numbers": numbers,
        "types": types_of(sources),
        "wide": "int64_t",
        "inputs": inputs,
        "outputs": outputs,
        "prefix": prefix,
        "limits": {
            a.signal.name: [word_literal(limit, a.format.word) for limit in (a.low, a.high)]
            for a in (*inputs, *outputs)
        },
        "feedback": interface.residuals,
        "range_checked": range_checked,
        "arrays": order,
        "array_call": ", ".join(f"{name}[0]" for name in order),
        "alias": _alias(inputs, outputs, order),
        "state": inputs[0].signal if step else None,
        "samples": inputs[-1].signal,
    }
    return {driver_name(sources): render("fuzz_c/driver.c.j2", **values)}


def _alias(
    inputs: Sequence[Argument], outputs: Sequence[Argument], order: Sequence[str]
) -> dict[str, str] | None:
    """Return an input and an output of one size and type, and a call in which they have the same memory."""
    for output in outputs:
        for argument in inputs:
            if (argument.signal.size, argument.format.word) == (output.signal.size, output.format.word):
                shared, place = f"in_{argument.signal.name}", f"out_{output.signal.name}"
                names = [shared if name == place else name for name in order]
                call = ", ".join(f"again.{name}" for name in names)
                return {"input": argument.signal.name, "output": output.signal.name, "call": call}
    return None
