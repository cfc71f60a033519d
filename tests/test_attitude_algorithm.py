"""The object of an algorithm: every job in one line, with defaults that never refuse, and what it says of itself."""

from __future__ import annotations

import inspect
import os
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from public_names import public
from without_applications import APPLICATIONS, LEFT_OUT, gone_with

import strapgen
from strapgen.ir.fixed_settings import StatedSettings

ROOT = Path(__file__).resolve().parents[1]
SLOW_RATE = {"max_rate_deg_s": 400, "step": "0.01"}


@pytest.fixture(scope="module")
def alg() -> strapgen.AttitudeAlgorithm:
    return strapgen.algorithm("euler", "rk4", increments=2)


def test_formulas_print_as_text_and_show_as_latex(alg):
    formulas = alg.formulas
    assert str(formulas) == strapgen.formulas.as_text(alg.derive(), alg.program().notes)
    assert formulas.latex == strapgen.formulas.as_latex(alg.derive())
    assert formulas._repr_latex_() == alg._repr_latex_() == alg.derive()._repr_latex_()
    assert formulas.program == strapgen.formulas.program_as_text(alg.program())
    program = alg.program()
    assert formulas.operations == {**program.operations, "temporaries": program.temporaries}


def test_formulas_with_unknowns_have_no_program():
    alg = strapgen.algorithm(f"{ROOT}/examples/three_samples.py")
    assert "unknown" in str(alg.formulas)
    with pytest.raises(strapgen.InputError, match="unknown"):
        alg.formulas.operations  # noqa: B018


def test_generated_code_is_that_of_the_stages(alg):
    settings = strapgen.Settings.of(word=16, increments=2, **SLOW_RATE)
    fixed = strapgen.quantize(alg.program(), settings)
    assert alg.quantize(word=16, **SLOW_RATE) == alg.quantize(settings) == fixed
    wanted = strapgen.generate(fixed, "c-fixed").files
    assert alg.generate("c-fixed", word=16, **SLOW_RATE).files == wanted
    assert alg.generate("c-fixed", settings).files == wanted
    assert alg.generate().files == strapgen.generate(alg.program(), "c").files
    assert list(alg.generate("rust", prefix="nav_").step_files) == ["nav_euler_rk4_2.rs"]


def test_generation_refuses_conflicting_arguments(alg):
    with pytest.raises(strapgen.InputError, match=r"^settings and word are both given; one is needed$"):
        alg.generate("c-fixed", strapgen.Settings(), word=16)
    with pytest.raises(
        strapgen.InputTypeError, match=r"^setting 'max_rate' is not known \(did you mean max_rate_deg_s\?\)"
    ):
        alg.generate("c-fixed", max_rate=16)
    with pytest.raises(
        strapgen.InputError, match=r"^target c takes no fixed-point settings; these do: c-fixed"
    ):
        alg.generate("c", word=16)
    with pytest.raises(
        strapgen.InputError, match="increments is 3, but euler-rk4-2 takes 2 increments a step"
    ):
        alg.quantize(increments=3, **SLOW_RATE)


@pytest.mark.parametrize("method", ["generate", "quantize", "cost"])
def test_keywords_of_fixed_point_are_in_the_signature(alg, method):
    assert {*StatedSettings.__annotations__} <= {*inspect.signature(getattr(alg, method)).parameters}


def test_the_old_name_of_generate_warns(alg):
    with pytest.warns(DeprecationWarning, match=r"^AttitudeAlgorithm\.c is now generate$"):
        assert alg.c().files == alg.generate("c").files


@pytest.mark.parametrize("options", [{}, {"rates": True}, {"previous": 1}])
def test_defaults_of_runs_never_refuse(options):
    alg = strapgen.algorithm("euler", "rk4", **options)
    assert alg.simulate().drift.shape == (1001, 3)
    rows = alg.compare(backends=["numpy", "c-fixed32"])
    assert [row.backend for row in rows] == ["numpy", "c-fixed32"]
    assert rows[0].max_abs_rad < 1e-12 < rows[1].max_abs_rad <= rows[1].bound_rad


def test_a_check_is_a_sequence_of_findings(alg):
    found = alg.check()
    assert found.holds is True
    assert [finding.name for finding in found] == [finding.name for finding in found.findings]
    assert len(found) == len(found.findings) > 10 and found[0].name == "no rotation"
    assert str(found).splitlines()[0].startswith("euler-rk4-2: Euler parameters")
    assert repr(found).startswith("<FindingsResult of euler-rk4-2: ")


def test_costs_are_measured_as_by_the_command(alg):
    if shutil.which("arm-none-eabi-gcc") is None:
        pytest.skip("no cross compiler")
    (row,) = alg.cost("cortex-m3", **SLOW_RATE).costs
    sources = alg.generate("c-fixed", **SLOW_RATE)
    from strapgen.lab import cost

    assert row == cost.cost(sources, "cortex-m3")


def test_the_object_is_taken_by_its_own_maker(alg):
    assert strapgen.algorithm(alg) == alg
    with pytest.raises(
        strapgen.InputError, match="method is 'rk2', but the choice of euler-rk4-2 has its own"
    ):
        strapgen.algorithm(alg, "rk2")


@pytest.mark.parametrize(
    "name", [name if name == "lab" else pytest.param(name, marks=pytest.mark.long) for name in APPLICATIONS]
)
def test_without_an_application_the_rest_of_the_object_works(name, tmp_path):
    """In a copy of the package without the folder, and those that need it, in a process of its own.

    What needs the folder says in one line which it is.
    """
    package = tmp_path / "codegen" / "strapgen"
    shutil.copytree(ROOT / "codegen" / "strapgen", package, ignore=LEFT_OUT)
    shutil.copytree(ROOT / "templates", tmp_path / "templates")
    gone = gone_with(name)
    for one in gone:
        shutil.rmtree(package / one)
    jobs = {
        "alg.series(terms=1)": "analysis",
        "alg.simulate(duration='0.1')": "lab",
        "alg.compare(backends=['numpy'])": "lab",
        "alg.converge(steps=['1/8', '1/16', '1/32'])": "lab",
        "alg.cost()": "lab",
        "strapgen.compare": "lab",
        "strapgen.study": "lab",
        "alg.check()": "firmware",
        "strapgen.CommitLate": "design",
        "strapgen.TwoSpeed": "navigation",
    }
    always = ("alg.formulas.latex", "alg.generate('c')", "alg.quantize(word=16)")
    kept = [job for job, place in jobs.items() if place not in gone and job != "alg.cost()"]
    lines = ["import strapgen", "alg = strapgen.algorithm('euler', 'rk4', 2)", *always, *kept]
    for job, place in jobs.items():
        if place in gone:
            what = job.partition("(")[0].replace("alg.", "")
            said = f"{what} needs the application {place} of strapgen, which is not installed"
            lines += ["try:", f"    {job}", "except strapgen.MissingExtraError as error:"]
            lines += [
                f"    assert str(error) == {said!r}, error",
                "else:",
                f"    raise AssertionError({job!r})",
            ]
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "codegen")}
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent("\n".join(lines))],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


def test_samples_of_a_comparison_may_be_given(alg):
    (row,) = alg.compare(np.full((5, 2, 3), 0.01), ["numpy"])
    assert row.max_abs_rad < 1e-15


def inertial() -> strapgen.InertialRecording:
    turn, force = np.full((20, 3), 1e-3), np.full((20, 3), 0.1)
    return strapgen.InertialRecording(0.0, 0.01, turn, force)


#: What takes an algorithm beside the functions of the object: from a name, an object or a choice comes an array.
TAKERS = {
    "course": lambda one: strapgen.course(one, inertial(), fast_cycles=2).states,
    "TwoSpeed": lambda one: strapgen.TwoSpeed(one).identity,
    "CommitLate": lambda one: strapgen.CommitLate("window-7-7", one).identity,
    "recording_attitudes": lambda one: strapgen.recording_attitudes(
        "window-7-7", np.full((20, 3), 1e-3), algorithm=one
    ),
    "study.cases": lambda one: np.array([str(case) for case in strapgen.study.cases(algorithm=one)]),
    "study.noise_of": lambda one: strapgen.study.noise_of(one).across(),
    "compare": lambda one: np.array([row.kernel for row in strapgen.compare(one, backends=["numpy"])]),
    "converge": lambda one: np.array(strapgen.converge(one, backend="numpy").kernel),
    "check": lambda one: np.array([finding.name for finding in strapgen.check(one)]),
    "backend": lambda one: strapgen.backend(one).identity,
    "unknowns.series": lambda one: np.array(str(strapgen.unknowns.series(one, terms=1))),
    "vibration.of": lambda one: np.array(strapgen.vibration.of(one).text("error")),
}


def test_every_public_parameter_for_an_algorithm_takes_the_object():
    found = {}
    for name, value in public().items():
        if inspect.isfunction(value) or (inspect.isclass(value) and not issubclass(value, Exception)):
            parameter = inspect.signature(value).parameters.get("algorithm")
            found |= {} if parameter is None else {name: parameter.annotation}
    assert {name for name, kind in found.items() if kind != "AnyAlgorithm"} == {"study.Case"}  # plain data
    assert {name for name in found if name not in TAKERS} <= {"derive", "study.Case", "study.Study"}


@pytest.mark.parametrize("taker", TAKERS)
@pytest.mark.parametrize("state", ["euler", "dcm"])
def test_a_name_the_object_and_a_choice_are_taken_alike(taker, state):
    named = TAKERS[taker](state)
    alg = strapgen.algorithm(state, "rk4", increments=2)
    assert np.array_equal(TAKERS[taker](alg), named)
    assert np.array_equal(TAKERS[taker](alg.choice), named)


@pytest.mark.parametrize("taker", ["course", "TwoSpeed", "CommitLate", "recording_attitudes"])
def test_an_algorithm_with_another_state_is_refused(taker):
    with pytest.raises(strapgen.InputError, match=r"^algorithm 'cayley-klein' is not known"):
        TAKERS[taker](strapgen.algorithm("cayley-klein"))
    with pytest.raises(strapgen.InputTypeError, match=f"^{taker} takes .*, not 3; "):
        TAKERS[taker](3)


@pytest.mark.parametrize("taker", ["CommitLate", "recording_attitudes"])
def test_another_window_as_the_method_is_refused(taker):
    TAKERS[taker](strapgen.algorithm("dcm", "window-7-7"))
    message = r"^window is window-7-7, but the choice of dcm-window-5-5 has its own$"
    with pytest.raises(strapgen.InputError, match=message):
        TAKERS[taker](strapgen.algorithm("dcm", "window-5-5"))


def test_a_study_takes_the_method_and_the_increments_of_the_object():
    (case, *_) = strapgen.study.cases(algorithm=strapgen.algorithm("dcm", "rk2", increments=3))
    assert (case.algorithm, case.method, case.increments) == ("dcm", "rk2", 3)
    with pytest.raises(
        strapgen.InputError, match=r"^increments is 4, but the choice of dcm-rk2-3 has its own$"
    ):
        strapgen.study.cases(algorithm=strapgen.algorithm("dcm", "rk2", increments=3), increments=4)
    with pytest.raises(strapgen.InputError, match=r"^a study takes .*; euler-rk4-rates has more$"):
        strapgen.study.cases(algorithm=strapgen.algorithm("euler", "rk4", rates=True))
