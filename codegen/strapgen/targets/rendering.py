"""Renders the templates of targets, with the filters that they share."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen.storage import resources
from strapgen.targets import contract
from strapgen.targets.contract import elements_text, operations_text, range_text
from strapgen.targets.lines import fill, fill_arguments, fill_definition, fill_lines
from strapgen.targets.run_text import run_paragraphs

if TYPE_CHECKING:
    import jinja2

#: First parameters of the loop over runs and steps, in every type of number.
PROPAGATE = ("size_t runs", "size_t steps", "size_t record_every", "size_t orthonormalize_every")


@cache
def environment(folder: Path | None = None) -> jinja2.Environment:
    """Return the environment of the templates in a folder, by default `templates/`."""
    import jinja2  # what only reads sources from the cache does without it

    shared = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder or resources.folder("templates")),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    shared.filters.update(
        fill=fill,
        arguments=fill_arguments,
        lines=fill_lines,
        range=range_text,
        elements=elements_text,
        operations=operations_text,
        argument_text=contract.argument_text,
        fixed_command=contract.command,
        defined=lambda definition: fill_definition(definition.name, definition.value, definition.meaning),
        run_paragraphs=run_paragraphs,
        residuals_text=contract.residuals_text,
        guards_text=contract.guards_text,
    )
    return shared


def render(template: str, **values: Any) -> str:
    """Return a template of `templates/` filled with values."""
    return environment().get_template(template).render(**values)


def render_c(folder: str, name: str, **values: Any) -> dict[str, str]:
    """Return the files of a function in C: the function alone, then its loops over samples and runs."""
    files = {f"{name}.h": "header.h", f"{name}.c": "source.c"} | dict(
        zip(runs_of(name), ("runs.h", "runs.c"), strict=True)
    )
    return {file: render(f"{folder}/{template}.j2", name=name, **values) for file, template in files.items()}


def own_call(parameters: Iterable[str], function: str) -> dict[str, str]:
    """Return parameters under names that no kernel has, and a call with them, as C text.

    Loops call a function so, since one of their variables may have the function's name.
    """
    kinds = [parameter.rpartition(" ")[0] + " *" * parameter.endswith("]") for parameter in parameters]
    names = [f"a{number}_" for number in range(len(kinds))]
    declared = [
        f"{kind}{name}" if kind.endswith("*") else f"{kind} {name}"
        for kind, name in zip(kinds, names, strict=True)
    ]
    return {"parameters": ", ".join(declared), "call": f"{function}({', '.join(names)})"}


def runs_of(name: str) -> tuple[str, str]:
    """Return the names of the files with the loops of a function in C."""
    return f"{name}_runs.h", f"{name}_runs.c"
