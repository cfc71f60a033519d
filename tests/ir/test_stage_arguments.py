"""The stages in the wrong order: one line that names the stage that is missing, or the one that takes the argument."""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pytest

import strapgen
from strapgen.ir import checks
from strapgen.ir.checks import some
from strapgen.ir.exceptions import InputTypeError
from strapgen.lab.recordings import recording
from strapgen.run import exact


@cache
def arguments() -> dict[str, object]:
    """Return one argument of every stage, in what order they come, and what is none."""
    kernel = strapgen.derive("euler", method="rk1", increments=1)
    program = strapgen.lower(kernel)
    sources = strapgen.generate(program, "numpy")
    return {
        "name": "euler",
        "choice": strapgen.choose("euler", "rk1", 1),
        "kernel": kernel,
        "program": program,
        "fixed": strapgen.quantize(program),
        "sources": sources,
        "backend": strapgen.build(sources),
        "motion": strapgen.motion("constant", x_deg_s=1),
        "settings": strapgen.Settings(),
        "none": None,
        "number": 3,
        "array": np.zeros((2, 2)),
    }


STAGES = {
    "derive": lambda value: strapgen.derive(value),
    "lower": lambda value: strapgen.lower(value),
    "quantize": lambda value: strapgen.quantize(value),
    "generate": lambda value: strapgen.generate(value, "c"),
    "generate in fixed point": lambda value: strapgen.generate(value, "c-fixed"),
    "build": lambda value: strapgen.build(value),
    "backend": lambda value: strapgen.backend(value),
    "evaluator": lambda value: strapgen.evaluator(value),
    "simulate": lambda value: strapgen.simulate(value, arguments()["motion"], 1, 1),
    "simulate along": lambda value: strapgen.simulate(arguments()["backend"], value, 1, 1),
    "recording": lambda value: recording.propagate(value, None),
    "exact": lambda value: exact.propagate(value, np.zeros((1, 1, 3))),
    "compare": lambda value: strapgen.compare(value, backends=["numpy"], increments=np.zeros((1, 1, 3))),
    "converge": lambda value: strapgen.converge(strapgen.choose("euler"), value, ["1/2", "1/4"], 1),
    "recording of": lambda value: recording.propagate(arguments()["backend"], value),
    "settings of compare": lambda value: strapgen.compare(
        "euler", backends=["numpy"], increments=np.zeros((1, 2, 3)), settings=value
    ),
    "settings": lambda value: strapgen.quantize(arguments()["program"], value),
    "settings of generate": lambda value: strapgen.generate(arguments()["program"], "c-fixed", value),
    "target": lambda value: strapgen.generate(arguments()["program"], value),
}

#: What each stage takes; everything else is a wrong pairing.
TAKEN = {
    "derive": {"name", "choice"},
    "lower": {"kernel"},
    "quantize": {"program"},
    "generate": {"program", "fixed"},
    "generate in fixed point": {"program", "fixed"},
    "build": {"sources"},
    "backend": {"name", "choice"},
    "evaluator": {"name", "choice"},
    "simulate": {"backend"},
    "simulate along": {"motion"},
    "recording": {"backend"},
    "exact": {"program"},
    "compare": {"name", "choice"},
    "converge": {"motion"},
    "recording of": set(),
    "settings of compare": {"settings", "none"},
    "settings": {"settings", "none"},
    "settings of generate": {"settings", "none"},
    "target": {"name"},
}

SAID = {
    ("lower", "name"): "lower takes a Kernel, not 'euler'; strapgen.derive('euler') makes one",
    ("lower", "program"): "lower takes a Kernel, not a Program; strapgen.generate takes it",
    ("lower", "none"): "lower takes a Kernel, not None; strapgen.derive makes one",
    ("lower", "array"): "lower takes a Kernel, not an ndarray; strapgen.derive makes one",
    ("derive", "kernel"): "derive takes a name or a path or a Choice, not a Kernel; strapgen.lower takes it",
    ("derive", "number"): "derive takes a name or a path or a Choice, not 3; strapgen list shows the names",
    ("quantize", "kernel"): "quantize takes a Program, not a Kernel; strapgen.lower(kernel) makes one",
    ("quantize", "fixed"): "quantize takes a Program, not a FixedProgram; strapgen.generate takes it",
    (
        "generate",
        "kernel",
    ): "generate takes a Program or a FixedProgram, not a Kernel; strapgen.lower(kernel) makes one",
    ("generate", "name"): "generate takes a Program or a FixedProgram, not 'euler'; "
    "strapgen.lower(strapgen.derive('euler')) makes one",
    (
        "generate",
        "sources",
    ): "generate takes a Program or a FixedProgram, not Sources; strapgen.build takes them",
    ("lower", "choice"): "lower takes a Kernel, not a Choice; strapgen.derive(choice) makes one",
    (
        "backend",
        "sources",
    ): "backend takes a name or a path or a Choice, not Sources; strapgen.build takes them",
    (
        "backend",
        "motion",
    ): "backend takes a name or a path or a Choice, not a Motion; strapgen.simulate takes it",
    ("evaluator", "program"): "evaluator takes a name or a Choice, not a Program; strapgen.generate takes it",
    ("build", "program"): "build takes Sources, not a Program; strapgen.generate(program, target) makes them",
    ("build", "kernel"): "build takes Sources, not a Kernel; "
    "strapgen.generate(strapgen.lower(kernel), target) makes them",
    ("build", "backend"): "build takes Sources, not a Backend; strapgen.simulate takes it",
    ("simulate", "name"): "simulate takes a Backend, not 'euler'; strapgen.backend('euler') makes one",
    ("simulate", "motion"): "simulate takes a Backend, not a Motion; strapgen.backend makes one",
    ("simulate", "sources"): "simulate takes a Backend, not Sources; strapgen.build(sources) makes one",
    (
        "simulate along",
        "name",
    ): "simulate takes a Motion, not 'euler'; strapgen.motion('euler', ...) makes one",
    ("settings", "number"): "settings is 3; strapgen.Settings is needed",
    ("target", "settings"): f"target is Settings; a name is needed: {some(strapgen.TARGETS)}",
}


def refusal(stage: str, argument: str) -> str:
    with pytest.raises(InputTypeError) as refused:
        STAGES[stage](arguments()[argument])
    return str(refused.value)


def test_every_wrong_pairing_of_stages_is_told_in_one_line():
    said = {
        (stage, argument): refusal(stage, argument)
        for stage in STAGES
        for argument in arguments()
        if argument not in TAKEN[stage] | ({"name"} if stage == "target" else set())
    }
    assert len(said) >= 120
    assert {pair: text for pair, text in said.items() if "\n" in text or len(text) > 140} == {}
    assert {pair: said[pair] for pair in SAID} == SAID


def test_messages_name_calls_that_exist():
    tables = (checks._NEXT, checks._NAMED, checks._MAKERS, checks._TAKERS)
    names = [
        found for pair in re.findall(r"strapgen\.(\w+)|'(\w+)\(", str(tables)) for found in pair if found
    ]
    assert {"derive", "lower", "generate", "build", "backend", "motion", "choose", "Settings"} <= set(names)
    assert not set(names) - set(dir(strapgen))
    classes = [
        *checks._NEXT,
        *checks._MAKERS,
        *checks._TAKERS,
        *(made for _, made in checks._NEXT.values()),
    ]
    assert not {name for name in classes if name != "str"} - set(dir(strapgen))


def test_what_is_taken_is_not_refused():
    for stage in (
        "derive",
        "lower",
        "quantize",
        "generate in fixed point",
        "build",
        "simulate",
        "exact",
        "settings",
    ):
        for argument in TAKEN[stage]:
            STAGES[stage](arguments()[argument])


def test_a_long_name_is_shortened():
    assert len(str(refusal("lower", "name"))) < 100
    with pytest.raises(InputTypeError, match=r"^lower takes a Kernel, not 'eu.*\.\.\.") as refused:
        strapgen.lower("euler\n" * 1000)
    assert "\n" not in str(refused.value)
