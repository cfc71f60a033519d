"""The proof of one kernel: its statements as formulas, and its file's own functions by lemmas."""

from __future__ import annotations

from collections.abc import Mapping

from pycparser import c_ast
from pycparser.c_generator import CGenerator

from strapgen.evidence.overflow import bit_vectors, square_root
from strapgen.evidence.overflow.c_types import Model
from strapgen.evidence.overflow.expressions import Obligation
from strapgen.evidence.overflow.obligations import KernelStatements
from strapgen.evidence.overflow.parsed import ParsedSource
from strapgen.evidence.subjects import Subject

# What an attempt may take. A later one proves more ranges on the way, where the first does not do.
_EFFORTS = (100_000, 1_000_000, 4_000_000)


class Proof:
    """The proof that the C of a kernel computes its integers without overflow, and in their ranges."""

    def __init__(self, subject: Subject, files: Mapping[str, str], model: Model) -> None:
        self._subject, self._files, self._model = subject, files, model
        self._nearest = subject.fixed.interface.settings.rounding == "nearest"

    def opened(self) -> list[Obligation]:
        """Return what is not proved; nothing if the proof is complete."""
        functions = self._functions()
        for effort in _EFFORTS:
            kernel = KernelStatements(
                functions, self._subject.name, self._model, self._ranges(), self._nearest, effort
            )
            opened = kernel.obligations()
            if not opened:
                break
        # A tool may read a simpler form of what shifts down, which must do the same; the rest it reads as it is.
        texts = {name: _text(function) for name, function in functions.items()}
        simpler = {
            name: function
            for name, function in self._functions("__FRAMAC__").items()
            if _text(function) != texts.get(name)
        }
        return [
            *opened,
            *self._lemmas(functions, kernel.places),
            *self._lemmas(simpler, kernel.places),
        ]

    def _functions(self, *defined: str) -> dict[str, c_ast.FuncDef]:
        return ParsedSource(self._files, f"{self._subject.name}.c", defined).functions

    def _ranges(self) -> dict[str, tuple[int, int]]:
        """Return the ranges that the generator states, by value and by element of an output."""
        ranges = {value.name: (value.low, value.high) for value in self._subject.fixed.body}
        for output in self._subject.fixed.interface.outputs:
            for k in range(output.signal.size):
                ranges[f"{output.signal.name}[{k}]"] = output.low, output.high
        return ranges

    def _lemmas(self, functions: Mapping[str, c_ast.FuncDef], places: set[int]) -> list[Obligation]:
        """Return the functions of the file that are not proved to return what is taken for granted in the kernel."""
        name, opened = self._subject.name, []
        for part in ("fit", "shr"):
            function = functions.get(f"{name}_{part}")
            if function is not None and not bit_vectors.shifts_down(function, self._model, places):
                opened.append(Obligation(f"{name}_{part}", "it must return its argument shifted down"))
        root = functions.get(f"{name}_rt")
        if root is not None and not square_root.is_root(root, self._model, self._nearest):
            opened.append(Obligation(f"{name}_rt", "it must return the integer next to a square root"))
        return opened


def _text(function: c_ast.FuncDef) -> str:
    """Return the C of a function."""
    return str(CGenerator().visit(function))
