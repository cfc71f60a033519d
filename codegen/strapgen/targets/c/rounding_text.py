"""Writes the proved rounding of a function in floating point in words, for the head of its file."""

from __future__ import annotations

from dataclasses import replace

from strapgen.ir.formats import above, below
from strapgen.ir.interfaces import Condition, RoundingBounds
from strapgen.ir.program import Program


def with_names(bounds: RoundingBounds, program: Program, named: Program) -> RoundingBounds:
    """Return the bounds of a program with the names that are printed."""
    # A value on the way may have the name of an input or of an output.
    inputs = _renamed([s.name for s in program.inputs], [s.name for s in named.inputs])
    values = _renamed([a.name for a in program.body], [a.name for a in named.body])
    outputs = _renamed([r.signal.name for r in program.outputs], [r.signal.name for r in named.outputs])

    def renamed(condition: Condition, names: dict[str, str]) -> Condition:
        words, space, name = condition.value.rpartition(" ")
        return replace(condition, value=words + space + names[name])

    return replace(
        bounds,
        inputs=tuple(renamed(condition, inputs) for condition in bounds.inputs),
        conditions=tuple(renamed(c, outputs | inputs | values) for c in bounds.conditions),
        errors={outputs[name]: errors for name, errors in bounds.errors.items()},
    )


def _renamed(names: list[str], printed: list[str]) -> dict[str, str]:
    return dict(zip(names, printed, strict=True))


def rounding_text(
    bounds: RoundingBounds,
    program: Program,
    flag: str = "-ffp-contract=off",
    library: str = "the C library",
) -> str:
    """Return the error bounds of a call and of a run, with their conditions, as sentences without the last full stop.

    `flag` keeps a compiler from fusing a product and a sum, "" where none does so; `library` computes the sines.
    """
    if bounds.reason:
        return f"no bound: {bounds.reason}"
    if not any(bounds.worst.values()):
        return "none; every output is exact"
    text = f"against exact arithmetic on the same inputs, {_errors(bounds)}"
    if bounds.accumulation is not None:
        row = "row of the error" if len(program.inputs[0].shape) == 2 else "error"
        growth = bounds.accumulation.growth - 1
        stretched = f" exp({above(growth)} N)" if growth else ""
        text += (
            f"; the {row} after N steps is at most {above(bounds.accumulation.per_step)} N{stretched} long"
        )
    return f"{text}. This holds for {_conditions(bounds, flag, library)}"


def _errors(bounds: RoundingBounds) -> str:
    """Return the largest error of every output."""
    parts = [
        f"error of {name} <= {above(worst)}" if worst else f"{name} is exact"
        for name, worst in bounds.worst.items()
    ]
    if len(parts) == 1:
        parts[0] += f" ({above(bounds.worst.popitem()[1] / bounds.unit)} ulp of 1)"
    return ", ".join(parts)


def _conditions(bounds: RoundingBounds, flag: str, library: str) -> str:
    """Return the conditions of the bounds."""
    sizes: dict[str, list[str]] = {}
    for condition in bounds.inputs:
        sizes.setdefault(f"up to {below(condition.high)}", []).append(condition.value)
    for condition in bounds.conditions:
        limits = f"from {above(condition.low)} to {below(condition.high)}"
        sizes.setdefault(limits, []).append(condition.value)
    parts = [f"{', '.join(names)} {size}" for size, names in sizes.items()]
    if bounds.functions:
        names = " and ".join(bounds.functions)
        parts.append(f"{names} of {library} within 1 ulp")
    parts += ["IEEE 754, each operation rounded to the nearest", *filter(None, [flag])]
    return "; ".join(parts)
