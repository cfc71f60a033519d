"""The name that a user chooses for a function, in a module that imports no program: every command imports it."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.ir.integer_program import FixedProgram
    from strapgen.ir.program import Program

_P = TypeVar("_P", "Program", "FixedProgram")


@dataclass(frozen=True)
class Naming:
    """The name that the user chooses for a function in C and for its files."""

    name: str | None = None  # the whole name
    prefix: str | None = None  # in front of the target's name
    variant: str | None = None  # of strapgen.toml, which the header names

    def __post_init__(self) -> None:
        if self.name is not None and self.prefix is not None:
            raise InputError("--name and --prefix are both given; one is needed")
        if self.option and not re.fullmatch(r"[A-Za-z]\w*", self._text, re.ASCII):
            raise InputError(
                f"{self.option} is {self._text!r}; letters, digits and underscores are needed, a letter first"
            )
        if self.variant is not None and not re.fullmatch(r"[A-Za-z][\w-]*", self.variant, re.ASCII):
            raise InputError(
                f"--variant is {self.variant!r}; letters, digits, - and _ are needed, a letter first"
            )

    @property
    def option(self) -> str:
        """The option of the command line that chooses it; "" if nothing is chosen."""
        return "--name" if self.name is not None else "--prefix" if self.prefix is not None else ""

    @property
    def _text(self) -> str:
        return self.name or self.prefix or ""

    def of(self, program: _P) -> _P:
        """Return a program with the name."""
        from strapgen.ir.integer_program import FixedProgram
        from strapgen.targets import names

        if isinstance(program, FixedProgram):
            return program if self == UNNAMED else replace(program, program=self.of(program.program))
        if self.variant is not None:
            arguments = f"{program.arguments} --variant {self.variant}"
            program = replace(program, info=replace(program.info, arguments=arguments))
        if not self.option:
            return program
        chosen = replace(
            program,
            chosen_name=self._text if self.prefix is None else f"{self._text}{{}}",
            info=replace(program.info, arguments=f"{program.arguments} {self.option} {self._text}"),
        )
        for ending in ("",) if self.prefix is None else ("", "_float", "_w32"):
            final = names.function_name(chosen, ending)
            if not names.can_be_chosen(final):
                raise InputError(
                    f"{self.option} {self._text} makes a function {final}; a name of at most {names.MOST_CHOSEN} "
                    "characters is needed, that neither C, C++ nor the C library has"
                )
        return chosen


#: Nothing is chosen.
UNNAMED = Naming()
