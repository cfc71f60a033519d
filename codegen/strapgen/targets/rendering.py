"""Renders the templates of all targets, with the filters that they share."""

from __future__ import annotations

from functools import cache
from typing import Any

import jinja2

from strapgen.support import resources
from strapgen.targets import contract
from strapgen.targets.contract import elements_text, operations_text, range_text
from strapgen.targets.lines import fill, fill_arguments


@cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(resources.folder("templates")),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters.update(
        fill=fill,
        arguments=fill_arguments,
        range=range_text,
        elements=elements_text,
        operations=operations_text,
        argument_text=contract.argument_text,
        fixed_command=contract.command,
        accumulation_text=contract.accumulation_text,
        residuals_text=contract.residuals_text,
        guards_text=contract.guards_text,
    )
    return environment


def render(template: str, **values: Any) -> str:
    """Return a template of `templates/` filled with values."""
    return _environment().get_template(template).render(**values)
