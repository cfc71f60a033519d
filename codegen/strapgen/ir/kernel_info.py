"""The names, source, orders and recursion of a kernel; every stage passes them on unchanged."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass

from strapgen.ir.attitude_step import AttitudeStep, Order
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.recursion import Recursion


@dataclass(frozen=True)
class KernelInfo:
    """The names, source, orders and recursion of a kernel: the `info` of the kernel, its programs and its sources.

    Parameters
    ----------
    name : str
        Name on the command line, lower case with hyphens.
    title : str
        One line that says what it computes.
    source : str
        Where the algorithm comes from, with the equation's number.
    arguments : str
        Name and options on the command line; by default the name alone. A whole command, such as
        ``strapgen redundancy FILE``, where another than ``strapgen generate`` generates it.
    notes : tuple of str
        Remarks for the reader of generated code: domain, conventions.
    attitude_step : AttitudeStep or None
        The kernels of an attitude step; None for every other kernel.
    order : Order or None
        Order of an attitude step.
    recursion : Recursion or None
        The pairs of an output and the input that it becomes in the next call.
    """

    name: str
    title: str
    source: str
    _: KW_ONLY
    arguments: str = ""
    notes: tuple[str, ...] = ()
    attitude_step: AttitudeStep | None = None
    order: Order | None = None
    recursion: Recursion | None = None

    __repr__ = short_repr

    @property
    def identifier(self) -> str:
        """The name in generated code."""
        return self.name.replace("-", "_")
