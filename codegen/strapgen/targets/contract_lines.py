"""The contract of a generated function in lines that programs read: requirements of a call, and its results.

All arithmetic in them is exact. An argument stands for the numbers in memory, which are integers in fixed point.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import zip_longest
from typing import ClassVar

from strapgen.ir.formats import above
from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.interfaces import Argument, RoundingBounds
from strapgen.ir.program import Program
from strapgen.ir.signals import Signal
from strapgen.ir.version import VERSION
from strapgen.targets.printer import ExactPrinter

#: The sentence that begins the block in a header.
HEAD = "Machine-readable contract, in exact arithmetic; an indented line continues the one before."
_KINDS = ("strapgen", "digest", "function", "requires", "otherwise", "let", "ensures")


@dataclass(frozen=True)
class Contract:
    """The contract of a generated function."""

    version: str  # of strapgen
    digest: str  # hash of the command, of the requirements and of the formulas
    function: str
    #: Kind and text of the lines "requires", "otherwise", "let" and "ensures", in order.
    items: tuple[tuple[str, str], ...]

    #: The sentence that begins it in a header.
    head: ClassVar[str] = HEAD

    def lines(self) -> list[str]:
        """Return the contract as lines of text."""
        head = (("strapgen", self.version), ("digest", self.digest), ("function", self.function))
        return [f"{kind}: {text}" for kind, text in (*head, *self.items)]

    def of_kind(self, kind: str) -> list[str]:
        """Return the texts of all lines of a kind."""
        return [text for other, text in self.items if other == kind]

    @classmethod
    def read(cls, header: str) -> Contract | None:
        """Return the contract that a header holds; None if there is none."""
        _, _, block = header.partition(HEAD)
        joined = re.sub(r"\n \*   +", " ", block.partition("*/")[0])
        pairs = [line.removeprefix(" * ").partition(": ") for line in joined.splitlines() if ": " in line]
        items = [(kind, text.strip()) for kind, _, text in pairs if kind in _KINDS]
        if [kind for kind, _ in items[:3]] != ["strapgen", "digest", "function"]:
            return None
        version, digest, function = (text for _, text in items[:3])
        return cls(version, digest, function, tuple(items[3:]))


def of_fixed(fixed: FixedProgram, function: str, command: str, memory: Mapping[str, str]) -> Contract:
    """Return the contract of fixed-point code, whose arguments hold integers under the names of `memory`."""
    interface = fixed.interface

    def name(argument: Argument) -> str:
        return memory[argument.signal.name]

    def between(argument: Argument) -> str:
        return f"{argument.low} <= {name(argument)}[0..{argument.signal.size - 1}] <= {argument.high}"

    requires = [("requires", between(argument)) for argument in interface.inputs]
    requires.append(("otherwise", "the call returns 1 and writes nothing"))
    if any(value.range_checked for value in fixed.body):
        requires.append(
            ("otherwise", "the call returns 2 and writes nothing where a value leaves its limits")
        )
    lets = _loads((a.signal, name(a), _unit(a)) for a in interface.inputs)
    lets += _body(fixed.program)
    ensures = [
        (
            f"|{name(argument)}[{k}]{_unit(argument)} - {text}|",
            f" <= {above(argument.errors[k])}" + (f" where -1 <= {text} <= 1" if argument.saturates else ""),
        )
        for argument, texts in zip(interface.outputs, _results(fixed.program), strict=True)
        for k, text in enumerate(texts)
    ]
    ranges = [("ensures", between(argument)) for argument in interface.outputs]
    return _contract(function, command, [*requires, *lets], ensures, ranges)


def of_program(program: Program, function: str, command: str, rounding: RoundingBounds) -> Contract:
    """Return the contract of floating-point code: the exact values of its outputs, and their largest errors.

    Where no bound is known, or it depends on values on the way, an output is the exact value, rounded.
    """
    proved = rounding.errors and not rounding.conditions
    limits = {condition.value: condition.high for condition in rounding.inputs}
    requires = []
    if proved and any(rounding.worst.values()):
        for signal in program.inputs:
            largest, place = limits[signal.name], f"[0..{signal.size - 1}]" if signal.shape else ""
            requires.append(("requires", f"-{largest} <= {signal.name}{place} <= {largest}"))
        requires.append(("otherwise", "the outputs have no bound"))
    lets = _loads((signal, signal.name, "") for signal in program.inputs if signal.shape)
    lets += _body(program)
    ensures = []
    errors = rounding.errors.values() if proved else [()] * len(program.outputs)
    for result, texts, bounds in zip(program.outputs, _results(program), errors, strict=True):
        for element, text, error in zip_longest(range(len(texts)), texts, bounds):
            name = f"{result.signal.name}[{element}]"
            if error:
                ensures.append((f"|{name} - {_summand(text)}|", f" <= {above(error)}"))
            else:
                ensures.append((f"{name} = {text}", ", rounded" if error is None else ""))
    return _contract(function, command, [*requires, *lets], ensures, [])


def _summand(text: str) -> str:
    """Return an expression for the place behind a minus sign."""
    return text if re.fullmatch(r"\w+", text) else f"({text})"


def _contract(
    function: str,
    command: str,
    lines: list[tuple[str, str]],
    ensures: list[tuple[str, str]],
    ranges: list[tuple[str, str]],
) -> Contract:
    """Return a contract; neither the bounds that were computed nor the version enter the digest."""
    hashed = [command, *(f"{kind}: {text}" for kind, text in lines), *(formula for formula, _ in ensures)]
    digest = hashlib.sha256("\n".join(hashed).encode()).hexdigest()[:16]
    bounds = [("ensures", formula + bound) for formula, bound in ensures]
    return Contract(VERSION, digest, function, (*lines, *bounds, *ranges))


def _loads(arguments: Iterable[tuple[Signal, str, str]]) -> list[tuple[str, str]]:
    """Return a line for every input: its elements, and the numbers in memory that stand for them, in order."""
    return [
        ("let", f"{', '.join(signal.elements)} = {memory}[0..{signal.size - 1}]{unit}")
        for signal, memory, unit in arguments
    ]


class _LinePrinter(ExactPrinter):
    """Prints a long fraction so that its line can be broken."""

    def constant(self, value: Fraction) -> str:
        text = super().constant(value)
        return text if len(text) < 40 else text.replace("/", " / ")


def _body(program: Program) -> list[tuple[str, str]]:
    """Return a line for every value that the outputs need."""
    used, printer = program.used(program.outputs), _LinePrinter()
    return [("let", f"{a.name} = {printer.text(a.value)}") for a in program.body if a.name in used]


def _results(program: Program) -> list[list[str]]:
    """Return the exact value of every element of the outputs."""
    printer = _LinePrinter()
    return [[printer.text(node) for node in result.nodes] for result in program.outputs]


def _unit(argument: Argument) -> str:
    """Return the factor from an integer to the number that it stands for."""
    fraction = argument.format.fraction
    if argument.sensor is not None:
        return f" * {_LinePrinter().constant(argument.sensor.count)}"
    if not fraction:
        return ""
    return f" / 2^{fraction}" if fraction > 0 else f" * 2^{-fraction}"
