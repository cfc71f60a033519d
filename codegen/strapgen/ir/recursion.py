"""A recursion lists the outputs of a kernel that are inputs of its next call."""

from __future__ import annotations

from dataclasses import dataclass

from strapgen.ir.notebook_display import short_repr
from strapgen.ir.renamed import renamed


@renamed(kept="retained", begun_anew="reset")
@dataclass(frozen=True)
class Recursion:
    """The feedback pairs of a kernel: the values that it carries from call to call.

    Parameters
    ----------
    states : tuple of (str, str)
        Pairs of names: an input, and the output that takes its place in the next call.
    retained : tuple of str
        Inputs of these pairs that continue over the end of a cycle of the slower loop; the others are reset to zero.

    Examples
    --------
    >>> Recursion((("sum", "next_sum"), ("previous", "next_previous")), retained=("previous",)).begun_anew
    ('sum',)
    """

    states: tuple[tuple[str, str], ...]
    retained: tuple[str, ...] = ()

    __repr__ = short_repr

    @property
    def reset(self) -> tuple[str, ...]:
        """The inputs that are reset to zero at the start of each cycle of the slower loop."""
        return tuple(name for name, _ in self.states if name not in self.retained)

    @property
    def inputs(self) -> dict[str, str]:
        """The input that each output becomes in the next call, by the name of the output."""
        return {output: name for name, output in self.states}
