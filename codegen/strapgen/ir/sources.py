"""Sources: what a target emits, with all that a back end must know to call it."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from strapgen.ir.attitude_step import Companions
from strapgen.ir.fixed_interface import Interface
from strapgen.ir.program import Program
from strapgen.ir.recursion import Recursion
from strapgen.ir.signals import Signal


@dataclass(frozen=True)
class Function:
    """A generated function: its name and what goes in and out."""

    name: str
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]


@dataclass(frozen=True)
class Sources:
    """Generated source text and its interface.

    Parameters
    ----------
    kernel, target : str
        What was generated, and for which target.
    files : dict of str to str
        Text by file name.
    function : Function
        The generated function.
    operations : dict of str to int
        Operations of one call, see `Program.operations`.
    temporaries : int
        Intermediate values of one call.
    companions : Companions or None
        What belongs to an attitude step; None for every other kernel.
    fixed : Interface or None
        Formats, ranges and error bounds of fixed-point code; None for every other target.
    recursion : Recursion or None
        Which outputs are inputs of the next call.
    own : tuple of Program
        Kernels that a user's step brings; empty where they are found through its choice.
    """

    kernel: str
    target: str
    files: dict[str, str]
    function: Function
    operations: dict[str, int]
    temporaries: int
    companions: Companions | None
    fixed: Interface | None = None
    recursion: Recursion | None = None
    own: tuple[Program, ...] = ()

    def interface(self) -> dict[str, Any]:
        """Return everything but the text as plain JSON data."""
        companions = self.companions
        return {
            "kernel": self.kernel,
            "target": self.target,
            "files": list(self.files),
            "function": {
                "name": self.function.name,
                "inputs": [signal.as_dict() for signal in self.function.inputs],
                "outputs": [signal.as_dict() for signal in self.function.outputs],
            },
            "operations": self.operations,
            "temporaries": self.temporaries,
            "companions": companions
            and {
                "product": companions.product,
                "orthonormalize": companions.orthonormalize,
                "attitude": companions.attitude,
                "identity": [str(element) for element in companions.identity],
                "previous": companions.previous,
                "isometry": companions.isometry,
            },
            "fixed": self.fixed and self.fixed.as_dict(),
            "recursion": self.recursion and self.recursion.as_dict(),
        }

    @classmethod
    def restore(cls, interface: dict[str, Any], files: dict[str, str]) -> Sources:
        """Rebuild sources from `interface` and the text of the files."""
        function, companions = interface["function"], interface["companions"]
        if companions is not None:
            identity = tuple(Fraction(element) for element in companions["identity"])
            companions = Companions(**companions | {"identity": identity})
        return cls(
            interface["kernel"],
            interface["target"],
            files,
            Function(
                function["name"],
                tuple(map(Signal.from_dict, function["inputs"])),
                tuple(map(Signal.from_dict, function["outputs"])),
            ),
            interface["operations"],
            interface["temporaries"],
            companions,
            interface["fixed"] and Interface.from_dict(interface["fixed"]),
            interface["recursion"] and Recursion.from_dict(interface["recursion"]),
        )
