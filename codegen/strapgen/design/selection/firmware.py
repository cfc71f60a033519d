"""Writes what a selected algorithm needs in firmware: its fixed-point C, a test of vectors, and a report."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

from strapgen import pipeline, registration
from strapgen.catalogue.methods.shaped_coning import ShapedConing
from strapgen.design.brief import DesignBrief
from strapgen.design.coning import coning_file
from strapgen.design.selection import causes
from strapgen.design.selection.algorithm import Algorithm, AttitudeStep, DescribedAlgorithm
from strapgen.design.selection.candidates import TUNED
from strapgen.design.selection.judgement import Judgement

#: The report, the coefficients that a design has computed, and the description of two speeds.
REPORT, COEFFICIENTS, SYSTEM = "design.txt", "coefficients.toml", "system.toml"


def firmware_files(
    brief: DesignBrief, judgement: Judgement, algorithm: Algorithm, report: str, command: str
) -> dict[str, str]:
    """Return the files of a selected algorithm by their names."""
    if not isinstance(algorithm, AttitudeStep):
        described = cast(DescribedAlgorithm, algorithm)  # nothing else is selected
        options = f"--target c-fixed --word {brief.processor.word}"
        files = dict(described.sources(f"strapgen system {SYSTEM} {options}").step_files)
        return files | {SYSTEM: described.file(), REPORT: report}
    choice = algorithm.choice
    settings = causes.settings(choice, brief, judgement.carry)
    if judgement.method.startswith(TUNED) and isinstance(choice.method, ShapedConing):
        choice = replace(choice, method=replace(choice.method, file=COEFFICIENTS))
    files = dict(pipeline.compile(choice, "c-fixed", settings).step_files)
    files |= registration.extension("generate.project", "--out").project_files(choice, "c-fixed", settings)
    if judgement.method.startswith(TUNED) and isinstance(choice.method, ShapedConing):
        files[COEFFICIENTS] = coning_file.written(choice.method, command)
    return files | {REPORT: report}
