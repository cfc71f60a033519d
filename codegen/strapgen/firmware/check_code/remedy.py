"""The lines of generated code that correct coning as a function ought to."""

from __future__ import annotations

import re

from strapgen import pipeline
from strapgen.catalogue.methods.coning_coefficients import Design
from strapgen.firmware.check_code.ladder import published_step


def remedy(wanted: Design) -> dict[str, str]:
    """Return the lines of the generated step with a published correction that compute its rotation vector.

    Beside them is the command that generates the whole step; both have the names that a result gives them.

    >>> from strapgen.catalogue.methods.coning_coefficients import design
    >>> print(remedy(design(2))["replacement"].splitlines()[0])
    /* integral of the rate over the step */
    """
    # The combined step corrects more than coning.
    form = "compressed" if wanted.form == "combined" else wanted.form
    choice = published_step(f"coning-{form}", wanted)
    (text,) = (text for name, text in pipeline.compile(choice, "c").step_files.items() if name.endswith(".c"))
    body = text[text.index("next[4])\n{") :]
    first = [*re.finditer(r"= increments\[\d+\];\n", body)][-1].end()
    last = body.index(";\n", body.index(" phi_z =")) + 1
    lines = [line.removeprefix("    ") for line in body[first:last].splitlines()]
    before = f" --previous {wanted.previous}" if wanted.previous else ""
    command = f"strapgen generate euler --method coning-{form} --increments {wanted.increments}{before}"
    return {"replacement": "\n".join(lines), "replacement_command": command}
