"""Reports a described system: its stages, its values with units, frames, formats and bounds, and its budget."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from fractions import Fraction
from typing import Any

from strapgen.ir.decimals import above, float_above
from strapgen.ir.fixed_interface import Argument
from strapgen.ir.signals import Signal
from strapgen.navigation.systems.budget import Budget, lines
from strapgen.navigation.systems.fitting import Fitted
from strapgen.navigation.systems.system_bounds import SystemBounds
from strapgen.results.report import Report
from strapgen.results.table import ERROR, Column, TextTable

_STAGES = (
    Column("stage", "<"),
    Column("every"),
    Column("Hz", spec=".6g"),
    Column("kernel", "<"),
    Column("word", missing=""),
    Column("operations"),
    Column("instructions", missing=""),
)
_VALUES = (
    Column("value", "<"),
    Column("every"),
    Column("unit", "<"),
    Column("frame", "<"),
    Column("shape", "<"),
    Column("format", "<", missing=""),
    Column("range", "<", spec=".6g", missing=""),
    Column("error of a pass", spec=ERROR, missing=""),
)


def system_report(fit: Fitted, needs: Budget, errors: SystemBounds) -> Report:
    """Return a described system as a report."""
    return Report(lambda: _text(fit, needs, errors), lambda: system_data(fit, needs, errors))


def system_data(fit: Fitted, needs: Budget, errors: SystemBounds) -> dict[str, Any]:
    """Return a described system as plain JSON data."""
    system = fit.description.system
    return {
        "name": system.name,
        "title": system.title,
        "target": fit.target,
        "sample_hz": float(system.sample_hz),
        "stages": list(_stages(fit, needs)),
        "inputs": [_input(fit, signal) for signal in system.inputs],
        "values": list(_cells(fit, errors)),
        "outputs": list(system.outputs),
        "budget": _budget(needs),
    }


def bound_lines(fit: Fitted, errors: SystemBounds) -> list[str]:
    """Return the error bounds of a pass in lines of text, for the head of generated files."""
    outputs = fit.description.system.outputs
    known = [name for name in outputs if name in errors.errors]
    result = []
    if known:
        bounds = ", ".join(
            f"{name} {above(max(errors.errors[name]), 4, 'e')} {_unit(fit, name)}".rstrip() for name in known
        )
        result.append(
            "Error of one pass through all rates, at most, against exact arithmetic on the same memory and samples: "
            f"{bounds}."
        )
    result += [
        f"No such bound for {name}: {errors.reasons[name]}." for name in outputs if name in errors.reasons
    ]
    return result


def _unit(fit: Fitted, name: str) -> str:
    unit = fit.description.system.cell(name).signal.unit
    return "" if unit == "1" else unit


def _stages(fit: Fitted, needs: Budget) -> Iterator[dict[str, Any]]:
    """Return the stages, from the fastest."""
    words = {stage.name: stage for stage in fit.description.system.stages}
    for rate in needs.rates:
        for stage in rate.stages:
            interface = fit.sources[stage.name].fixed
            yield {
                "name": stage.name,
                "kernel": stage.kernel,
                "every": rate.every,
                "hz": float(rate.hz),
                "word": None if interface is None else interface.settings.word,
                "carry": None if interface is None else interface.settings.carry,
                "wires": {wire.input: wire.source for wire in words[stage.name].wires},
                "operations": dict(stage.operations),
                "constants": stage.constants,
                "executed": stage.executed,
                "code_bytes": stage.code_bytes,
                "stack_bytes": stage.stack_bytes,
            }


def _input(fit: Fitted, signal: Signal) -> dict[str, Any]:
    """Return an input of the system."""
    return {"name": signal.name, "every": 1, **_about(fit, signal.name, signal)}


def _cells(fit: Fitted, errors: SystemBounds) -> Iterator[dict[str, Any]]:
    """Return what is stored between calls."""
    system = fit.description.system
    for cell in system.cells:
        bounds = errors.errors.get(cell.name)
        yield {
            "name": cell.name,
            "every": system.every(cell.name),
            **_about(fit, cell.name, cell.signal),
            "samples": cell.samples,
            "initial": [float(value) for value in cell.initial],
            "error": None if bounds is None else float_above(max(bounds, default=Fraction(0))),
            "no_bound": errors.reasons.get(cell.name),
        }


def _about(fit: Fitted, name: str, signal: Signal) -> dict[str, Any]:
    argument = fit.arguments.get(name)
    largest = signal.bound if argument is None else argument.unit * max(argument.high, -argument.low)
    return {
        "unit": signal.unit,
        "frame": signal.frame,
        "shape": list(signal.shape),
        "format": None if argument is None else _format(argument),
        "range": None if largest is None else float_above(Fraction(largest)),
    }


def _format(argument: Argument) -> str:
    """Return the format of a value, or the bits of the counts that it is."""
    return str(argument.format) if argument.sensor is None else f"{argument.format.word}-bit counts"


def _budget(needs: Budget) -> dict[str, Any]:
    """Return a budget as plain JSON data."""
    rates = [
        {
            "every": rate.every,
            "hz": float(rate.hz),
            "operations": rate.operations,
            "operations_per_second": float(rate.per_second),
            "instructions_per_second": _float(rate.executed_per_second),
        }
        for rate in needs.rates
        if rate.stages
    ]
    sizes = {name: value for name, value in asdict(needs).items() if name.endswith("_bytes")}
    return {
        "rates": rates,
        "operations_per_second": float(needs.per_second),
        "cpu": needs.cpu or None,
        "instructions_per_second": _float(needs.executed_per_second),
        "memory_bytes": needs.memory_bytes,
        **sizes,
    }


def _float(number: Any) -> float | None:
    return None if number is None else float(number)


def _text(fit: Fitted, needs: Budget, errors: SystemBounds) -> str:
    """Return the system for a reader."""
    data = system_data(fit, needs, errors)
    stages = [
        [
            *(stage[key] for key in ("name", "every", "hz", "kernel", "word")),
            sum(stage["operations"].values()),
            stage["executed"],
        ]
        for stage in data["stages"]
    ]
    values = [
        [
            *(value[key] for key in ("name", "every", "unit", "frame")),
            " x ".join(map(str, value["shape"])),
            *(value.get(key) for key in ("format", "range", "error")),
        ]
        for value in [*data["inputs"], *data["values"]]
    ]
    return "\n".join(
        [
            f"{data['title']} ({data['name']}, {data['target']}, {data['sample_hz']:.6g} Hz)",
            "",
            *TextTable(_used(_STAGES, stages), _trimmed(_STAGES, stages)).lines(),
            "",
            *TextTable(_used(_VALUES, values), _trimmed(_VALUES, values)).lines(),
            "",
            f"outputs: {', '.join(data['outputs'])}",
            *(f"no bound for {name}: {reason}" for name, reason in errors.reasons.items()),
            "",
            *lines(needs),
        ]
    )


def _used(columns: tuple[Column, ...], rows: list[list[Any]]) -> list[Column]:
    """Return the columns in which some row has a value."""
    return [column for k, column in enumerate(columns) if any(row[k] is not None for row in rows)]


def _trimmed(columns: tuple[Column, ...], rows: list[list[Any]]) -> list[list[Any]]:
    """Return rows without the values of columns that are empty."""
    used = {id(column) for column in _used(columns, rows)}
    return [[value for column, value in zip(columns, row, strict=True) if id(column) in used] for row in rows]
