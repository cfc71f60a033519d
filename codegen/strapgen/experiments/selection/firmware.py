"""Writes what a selected algorithm needs in firmware: its fixed-point C, a test of vectors, and a report."""

from __future__ import annotations

from dataclasses import replace

from strapgen.catalogue import Choice
from strapgen.catalogue.methods.shaped_coning import ShapedConing
from strapgen.design import coning_file
from strapgen.experiments import project
from strapgen.experiments.selection import causes
from strapgen.experiments.selection.brief import DesignBrief
from strapgen.experiments.selection.candidates import TUNED
from strapgen.experiments.selection.judgement import Judgement
from strapgen.library import generated_sources

#: The report, and the coefficients that a design has made.
REPORT, COEFFICIENTS = "design.txt", "coefficients.toml"


def firmware_files(
    brief: DesignBrief, judgement: Judgement, choice: Choice, report: str, command: str
) -> dict[str, str]:
    """Return the files of a selected algorithm by their names.

    Parameters
    ----------
    brief : DesignBrief
    judgement : Judgement
        Of an algorithm that meets the brief.
    choice : Choice
        Its step.
    report : str
        What the answer says.
    command : str
        The command line, for coefficients that it has designed.

    Returns
    -------
    dict of str to str
        The C and its header, CMakeLists.txt, main.c, a test of vectors, the report, and coefficients that were
        designed for the brief.
    """
    settings = causes.settings(choice, brief, judgement.carry)
    if judgement.method.startswith(TUNED) and isinstance(choice.method, ShapedConing):
        choice = replace(choice, method=replace(choice.method, file=COEFFICIENTS))
    files = dict(generated_sources.sources(choice, "c-fixed", settings).step_files)
    files |= project.project_files(choice, "c-fixed", settings)
    if judgement.method.startswith(TUNED) and isinstance(choice.method, ShapedConing):
        files[COEFFICIENTS] = coning_file.written(choice.method, command)
    return files | {REPORT: report}
