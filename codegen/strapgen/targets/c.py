"""The C target: a header with the contract of every function and a C99 source, in double or in float."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from strapgen.fixedpoint.floating import rounding_bounds
from strapgen.ir.interfaces import RoundingBounds
from strapgen.ir.program import Operation, Program, Reference, names_in, walk
from strapgen.ir.signals import Signal
from strapgen.ir.sources import Sources
from strapgen.targets import contract, contract_lines
from strapgen.targets.contract import allows_fast_math, fast_math_text, rounding_text, with_names
from strapgen.targets.names import C, Language, function_name, printed
from strapgen.targets.printer import Printer, fill_expression
from strapgen.targets.registry import TARGETS
from strapgen.targets.rendering import PROPAGATE, macros_of_program, own_call, render_c, runs_of

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True)
class Real:
    """A floating-point type of C."""

    name: str
    suffix: str  # that of its literals and of the functions of math.h
    infix: str  # ending of function and file names, so that the code of both types links into one program
    bytes: int

    @property
    def bits(self) -> dict[str, str]:
        """All bits but the sign, those of infinity and those of a NaN, as literals of unsigned integers."""
        width, fraction = (64, 52) if self.bytes == 8 else (32, 23)
        numbers = {"magnitude": (1 << (width - 1)) - 1, "infinity": (1 << (width - 1)) - (1 << fraction)}
        numbers["nan"] = numbers["infinity"] + (1 << (fraction - 1))
        return {name: f"UINT{width}_C(0x{number:x})" for name, number in numbers.items()}


DOUBLE = Real("double", "", "", 8)
FLOAT = Real("float", "f", "_float", 4)
_REALS = {real.name: real for real in (DOUBLE, FLOAT)}


def real_of(target: str) -> Real:
    """Return the type of a target's numbers."""
    return _REALS[TARGETS[target].number]


FUNCTIONS = {
    "sqrt": "sqrt{s}({})",
    "sin": "sin{s}({})",
    "cos": "cos{s}({})",
    "sinc": "{n}_sc_({})",
    "atan2": "atan2{s}({}, {})",
    "direction": "atan2{s}({}, {})",
    "wrap": "{n}_wr_({})",
    "maximum": "fmax{s}({}, {})",
    "at_least": "{} >= {}",
    "select": "({} ? {} : {})",
}


#: Half a turn and a turn, to more digits than a double has.
HALF_TURNS = tuple(Fraction(k * 314159265358979323846264338327950288, 10**35) for k in (1, 2))


class CPrinter(Printer):
    """Prints nodes as C expressions of one floating-point type, for a file whose static names begin with `name`."""

    def __init__(self, real: Real, name: str = "") -> None:
        self.real: Real = real
        self.name: str = name
        if real is FLOAT:
            self.resolution = Fraction(1, 1 << 23)

    def constant(self, value: Fraction) -> str:
        """Return the shortest literal that reads as the nearest number of the type."""
        text = repr(float(value)) if self.real is DOUBLE else str(_nearest_single(value))
        return text + self.real.suffix

    def function(self, kind: str, arguments: list[str]) -> str:
        """Return a call."""
        return FUNCTIONS[kind].format(*arguments, s=self.real.suffix, n=self.name)

    def declared(self, kind: str, name: str, value: str) -> str:
        """Return the declaration of a value."""
        return f"const {kind} {name} = {value};"


def _nearest_single(value: Fraction) -> np.float32:
    """Return the nearest single; rounding to double first could miss it."""
    import numpy as np  # C in double is printed without it

    near = np.float32(float(value))
    candidates = (near, np.nextafter(near, np.float32(-np.inf)), np.nextafter(near, np.float32(np.inf)))
    return min(candidates, key=lambda c: (abs(Fraction(float(c)) - value), int(c.view(np.uint32)) & 1))


def emit(program: Program, target: str) -> Sources:
    """Print a function on one sample (<name>.h and .c), and loops over samples and, of a step, over runs beside it."""
    name = function_name(program, real_of(target).infix)
    return sources_of(program, target, name, _files, C, runs_of(name))


def sources_of(
    program: Program,
    target: str,
    name: str,
    text: Callable[[Program, str, str, RoundingBounds], dict[str, str]],
    language: Language,
    runs: tuple[str, ...],
) -> Sources:
    """Print a program in floating point; `text` returns the files of one with its printed names."""
    # A scalar input has one name, which is that of its argument and of its element.
    scalars = [signal.name for signal in program.inputs if not signal.shape]
    rounding = rounding_bounds(program, TARGETS[target].number)
    _, files = printed(
        program,
        lambda named, _: text(named, name, target, with_names(rounding, program, named)),
        language,
        scalars,
    )
    return Sources.of(program, target, name, files, runs=runs, rounding=rounding)


def _files(program: Program, name: str, target: str, rounding: RoundingBounds) -> dict[str, str]:
    """Return the header and the source of a program with its printed names."""
    printer = CPrinter(real_of(target), name)
    runs_printer = CPrinter(printer.real, f"{name}_runs")
    values = values_of(program, name, target, printer, rounding) | {
        "guard": f"{name}_h".upper(),
        "definitions": macros_of_program(program, name, printer),
        "result": program.outputs[0].signal,
        "code": code_of(program, printer),
        "propagation": _loop(program, runs_printer, name) if program.attitude_step else None,
    }
    return render_c("c", name, **values)


def values_of(
    program: Program, name: str, target: str, printer: CPrinter, rounding: RoundingBounds
) -> dict[str, Any]:
    """Return the values for the templates of C, C++ and Rust, those of the C interface among them."""
    real, command = printer.real, f"{contract.generating(program)} --target {target}"
    parameters = _parameters(program, real)
    kinds = {node.kind for a in program.body for node in walk(a.value) if isinstance(node, Operation)}
    return {
        "program": program,
        "command": command,
        "contract": contract_lines.of_program(program, name, command, rounding),
        "normalizing": contract.upkeep_text(program, target=target),
        "rounding": rounding_text(rounding, program),
        "fast_math": fast_math_text(rounding, program),
        "rounding_known": not rounding.reason,
        "allows_fast_math": allows_fast_math(rounding, program),
        "real": real,
        "state": program.inputs[0],
        "samples": program.inputs[-1],
        "parameters": ", ".join(parameters),
        "own": own_call(parameters, name),
        "propagate_parameters": _propagate_parameters(program, real, name),
        "arrays": _arrays(program, real),
        "calls": _calls(program),
        "unused": [s.name for s in program.inputs if not program.used() & set(s.elements)],
        "uses_math": bool(kinds & FUNCTIONS.keys() - {"at_least", "select", "wrap"}),
        "functions": kinds,
        "turn": tuple(map(printer.constant, HALF_TURNS)) if "wrap" in kinds else (),
    }


def code_of(
    program: Program,
    printer: CPrinter,
    places: dict[str, str] | None = None,
    depth: int = 1,
    number_type: str | None = None,
) -> dict[str, object]:
    """Return the statements of a program: loads, assignments, stores.

    `places` has the element of a signal by its name, if that is not ``name[{}]``; `depth` is the number of blocks
    around the statements, and `number_type` the type of their numbers, if it is not the printer's.
    """
    kind, used, places = number_type or printer.real.name, program.used(program.outputs), places or {}

    def place(signal: Signal, number: int) -> str:
        return places.get(signal.name, f"{signal.name}[{{}}]").format(number)

    return {
        "loads": [
            printer.declared(kind, element, place(signal, number))
            for signal in program.inputs
            if signal.shape
            for number, element in enumerate(signal.elements)
            if element in used
        ],
        "body": [
            {
                "text": fill_expression(
                    printer.declared(kind, a.name, printer.text(a.value)),
                    " " * 4 * (depth + 1),
                    99 - 4 * depth,
                ),
                "meaning": a.meaning,
            }
            for a in program.body
        ],
        "stores": [
            f"{place(result.signal, number)} = {printer.text(node)};"
            for result in program.outputs
            for number, node in enumerate(result.nodes)
        ],
    }


#: Bytes of the vectors in which several steps of one run are prepared together, which every x86-64 has. Those of AVX2
#: are twice as long.
_VECTOR = 16
#: Bytes of the numbers of all runs that go side by side, an element of the state: whole vectors of any processor, and
#: as many rows of memory as it reads ahead.
_ABREAST = 64
#: Bytes of a run's samples by which memory is fetched ahead: its latency is that of some steps of all runs.
_FETCHED = 512
#: Lanes of a block of a scan, and the steps of each: a block and its states fit into the nearest cache.
_SCAN_LANES, _SCAN_DEPTH = 8, 16
#: Bytes of a history from which on a scan streams it to memory.
_STREAMED = 1 << 20
#: Bytes of a line of the cache.
_LINE = 64
#: Operations that C compilers know on vectors.
_OF_VECTORS = frozenset(("add", "subtract", "multiply", "divide", "negate"))


def _loop(program: Program, printer: CPrinter, name: str) -> dict[str, object]:
    """Return the statements of a step in a loop: in two parts, without the state and with it, and for many runs."""
    ahead, behind = program.split()
    (increments,), (prepared,) = ahead.inputs, ahead.outputs
    state, result = program.inputs[0], program.outputs[0].signal
    signals = [(signal, "const ") for signal in program.inputs]
    signals += [(result.signal, "") for result in program.outputs]
    rows = [(signal, constant, number) for signal, constant in signals for number in range(signal.size)]
    real = printer.real
    lanes, abreast = _VECTOR // real.bytes, _ABREAST // real.bytes

    def in_lanes(wide: str) -> dict[str, object]:
        load = f"{name}{wide}_LANES_OF_".upper() + f"({increments.name}, apart, {{}})"
        places = {increments.name: load, "prepared": "prepared[{}].all"}
        return code_of(ahead, printer, places, number_type=f"{name}{wide}_lanes_")

    states = {state.name: "own[{}][k]", result.name: "own[{}][k]"}
    return {
        "vectors": _in_vectors(ahead),
        "lanes": lanes,
        "abreast": abreast,
        "fetched": max(1, _FETCHED // (increments.size * real.bytes)),
        "prepared": prepared.signal.size,
        "stack": max(4 * _VECTOR * prepared.signal.size, _ABREAST * state.size),
        "ahead": in_lanes(""),
        "wide_ahead": in_lanes("_wide"),
        "behind": code_of(behind, printer, {"prepared": "prepared[{}].one[k]"}),
        "scan": _scan(program, behind, printer, name),
        "abreast_step": code_of(
            program, printer, states | {increments.name: f"{increments.name}[apart * k + {{}}]"}, 2
        ),
        "rows": ", ".join(f"{constant}{real.name} *restrict {s.name}_{k}" for s, constant, k in rows),
        "array_arguments": ", ".join(signal.name for signal, _ in signals),
        "row_arguments": ", ".join(f"{s.name} + {k} * runs" for s, _, k in rows),
        "batch": code_of(
            program, printer, {signal.name: f"{signal.name}_{{}}[k]" for signal, _ in signals}, 2
        ),
    }


def _scan(program: Program, behind: Program, printer: CPrinter, name: str) -> dict[str, object] | None:
    """Return the statements of a scan: a step in lanes, and the product of a state and a transition.

    There is none of a step that is not linear in its state, nor of one whose transition holds constants: the product
    that it has leaves them out.
    """
    kernels, transition = program.attitude_step, program.transition
    if kernels is None or kernels.product is None or transition is None:
        return None
    names = tuple(node.name for node in transition.nodes if isinstance(node, Reference))
    state, prepared = behind.inputs
    complete = len(set(names)) == len(transition.nodes) == state.size
    if not complete or not set(prepared.elements) <= set(names) or not _in_vectors(behind):
        return None
    result, real, block = behind.outputs[0].signal, printer.real, _SCAN_LANES * _SCAN_DEPTH
    total = Signal("transition", (state.size,), names, meaning="product of transitions")
    product = replace(behind, inputs=(state, total))

    def in_lanes(wide: str, part: Program, *places: str) -> dict[str, object]:
        signals = [signal.name for signal in (*part.inputs, result)]
        return code_of(
            part, printer, dict(zip(signals, places, strict=True)), number_type=f"{name}{wide}_lanes_"
        )

    code = {
        f"{wide[1:]}{'_' if wide else ''}{what}": in_lanes(wide, part, *places)
        for wide in ("", "_wide")
        for what, part, places in (
            ("turn", behind, ("own[{}]", "prepared[{}].all", "own[{}]")),
            (
                "products",
                product,
                (f"{state.name}[{{}}].all", "transition[{}].all", f"{result.name}[{{}}].all"),
            ),
        )
    }
    return code | {
        "product": code_of(product, printer),
        "lanes": _SCAN_LANES,
        "depth": _SCAN_DEPTH,
        "identity": ", ".join(map(printer.constant, kernels.identity)),
        "line": _LINE // real.bytes,
        "joined": _VECTOR // real.bytes,
        # Rows that are no whole vectors share lines with their neighbours, which streaming stores would write twice.
        "streams": not state.size * real.bytes % _VECTOR,
        "large": _STREAMED // (state.size * real.bytes),
        "stack": (2 * block + _SCAN_LANES) * state.size * real.bytes,
    }


def _in_vectors(program: Program) -> bool:
    """Return whether each value and output of a program can be a vector of several samples."""
    values = [a.value for a in program.body] + [node for result in program.outputs for node in result.nodes]
    return all(names_in(value) for value in values) and all(
        node.kind in _OF_VECTORS for value in values for node in walk(value) if isinstance(node, Operation)
    )


def _parameters(program: Program, real: Real) -> list[str]:
    """Return the parameters of a function on one sample."""
    inputs = [
        f"const {real.name} {s.name}[{s.size}]" if s.shape else f"{real.name} {s.name}"
        for s in program.inputs
    ]
    outputs = [f"{real.name} {r.signal.name}[{r.signal.size}]" for r in program.outputs]
    return inputs + outputs


def _propagate_parameters(program: Program, real: Real, name: str) -> str:
    """Return the parameters of the loop over runs and steps."""
    pieces = [
        *PROPAGATE,
        f"{name}_orthonormalizer orthonormalize",
        f"const {real.name} *initial",
        f"const {real.name} *{program.inputs[-1].name}",
        f"{real.name} *history",
    ]
    return ", ".join(pieces)


def _arrays(program: Program, real: Real) -> str:
    """Return the parameters of a function on arrays of samples."""
    inputs = [f"const {real.name} *{s.name}" for s in program.inputs]
    return ", ".join(inputs + [f"{real.name} *{r.signal.name}" for r in program.outputs])


def _calls(program: Program) -> str:
    """Return the arguments of sample `k` for a function on one sample."""
    inputs = [f"{s.name} + {s.size} * k" if s.shape else f"{s.name}[k]" for s in program.inputs]
    return ", ".join(inputs + [f"{r.signal.name} + {r.signal.size} * k" for r in program.outputs])
