"""The fixed-point C target: a header with the contract of every function, and a C99 source on integers alone.

The code has no undefined or implementation-defined behaviour, and returns an error code for input out of range.
"""

from __future__ import annotations

from collections.abc import Callable

from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.sources import Sources
from strapgen.targets import contract, contract_lines, definitions
from strapgen.targets.c_fixed.statements import StatementPrinter
from strapgen.targets.c_fixed.words import WORDS, memory_type
from strapgen.targets.names import C, Language, function_name, printed
from strapgen.targets.rendering import PROPAGATE, own_call, render_c, runs_of


def emit(fixed: FixedProgram, target: str) -> Sources:
    """Print a function on one sample (<name>.h and .c), and loops over samples and, of a step, over runs beside it."""
    name = function_name(fixed.program, f"_w{fixed.word}")
    return sources_of(fixed, target, name, _files, C, runs_of(name))


def sources_of(
    fixed: FixedProgram,
    target: str,
    name: str,
    files: Callable[[FixedProgram, str, str], dict[str, str]],
    language: Language,
    runs: tuple[str, str],
) -> Sources:
    """Print a program in a language whose function on arrays has the interface of C.

    `files` returns the text of the files of a program with its printed names.
    """
    interface = fixed.interface
    arguments = (*interface.inputs, *interface.outputs)
    scalars = [argument.signal.name for argument in arguments if not argument.signal.shape]
    _, texts = printed(fixed, lambda named, _: files(named, name, target), language, scalars)
    return Sources.of(fixed, target, name, texts, runs=runs)


def _files(fixed: FixedProgram, name: str, target: str) -> dict[str, str]:
    """Return the header and the source of a program with its printed names."""
    printer = StatementPrinter(fixed, WORDS[fixed.word].within(name), name)
    values = values_of(fixed, name, target, printer) | {
        "guard": f"{name}_h".upper(),
        "definitions": definitions.of_fixed(fixed, name),
    }
    return render_c("c_fixed", name, **values)


def values_of(fixed: FixedProgram, name: str, target: str, printer: StatementPrinter) -> dict[str, object]:
    """Return the values for the templates of fixed point in every language, those of the C interface among them."""
    interface, word = fixed.interface, WORDS[fixed.word].within(name)
    signals = [(a.signal, f"const {memory_type(a)}") for a in interface.inputs]
    signals += [(a.signal, memory_type(a)) for a in interface.outputs]
    feedback_words = len(interface.residuals)
    pieces = [f"{kind} {printer.memory(s.name)}[{s.size}]" for s, kind in signals]
    arrays = [f"{kind} *{s.name}" for s, kind in signals]
    calls = [f"{s.name} + {s.size} * k" for s, _ in signals]
    if feedback_words:
        place = len(interface.inputs)
        pieces.insert(place, f"{word.residual} residuals[{feedback_words}]")
        arrays.insert(place, f"{word.residual} *residuals")
        calls.insert(place, f"residuals + {feedback_words} * k")
    command = contract.command(fixed, target)
    memory = {signal.name: printer.memory(signal.name) for signal, _ in signals}
    return {
        "fixed": fixed,
        "target": target,
        "program": fixed.program,
        "interface": interface,
        "word": word,
        "cast": printer.cast,
        "state": interface.inputs[0].signal,
        "samples": interface.inputs[-1].signal,
        "residuals": feedback_words,
        "parameters": ", ".join(pieces),
        "own": own_call(pieces, name),
        "propagate_parameters": ", ".join(
            [
                *PROPAGATE,
                f"{name}_orthonormalizer orthonormalize",
                f"const {word.type} *initial",
                f"const {memory_type(interface.inputs[-1])} *{interface.inputs[-1].signal.name}",
                *([f"{word.residual} *residuals"] if feedback_words else []),
                f"{word.type} *history",
                "size_t *stopped",
            ]
        ),
        "arrays": ", ".join(arrays),
        "calls": ", ".join(calls),
        "code": printer.code(),
        "counts": ", ".join(f"{number} {kind}" for kind, number in fixed.operations.items() if number),
        "nearest": interface.settings.rounding == "nearest",
        "fresh": dict.fromkeys(f"UINT{fixed.word}_C({r.fresh})" for r in interface.residuals),
        "uses": printer.uses,
        "memory": memory,
        "command": command,
        "contract": contract_lines.of_fixed(fixed, name, command, memory),
        "normalizing": contract.upkeep_text(fixed.program, interface, target),
        "range_checked": tuple(value for value in fixed.body if value.range_checked),
    }
