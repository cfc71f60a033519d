"""Every public object shows itself in a few short lines."""

from __future__ import annotations

import inspect
import json
import pickle
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sympy import MutableDenseMatrix

import strapgen
from strapgen.analysis import growth
from strapgen.analysis.series import velocity_series
from strapgen.analysis.unknowns.solving import SolvedStep
from strapgen.analysis.unknowns.unknown_tableau import UnknownTableau
from strapgen.catalogue.methods import coning_coefficients
from strapgen.catalogue.methods.shaped_coning import SHAPES
from strapgen.ir.notebook_display import LINES, WIDTH, full_text, short_repr
from strapgen.ir.program import once
from strapgen.ir.read_only import ReadOnlyDict
from strapgen.navigation.systems.system_runner import SystemMemory

ROOT = Path(__file__).resolve().parents[1]
TURN = np.full((8, 2, 3), 0.01)


def kernel() -> strapgen.Kernel:
    return strapgen.derive("euler", "rk4", 2)


def program() -> strapgen.Program:
    return strapgen.lower(kernel())


def stepper(name: str = "numpy") -> strapgen.Backend:
    return strapgen.backend("euler", "rk4", 2, name)


def recording() -> strapgen.Recording:
    return strapgen.Recording(0.0, 0.01, np.full((20, 3), 1e-3))


def inertial() -> strapgen.InertialRecording:
    return strapgen.InertialRecording(0.0, 0.01, np.full((20, 3), 1e-3), np.full((20, 3), 0.1))


def builder() -> strapgen.KernelBuilder:
    build = strapgen.KernelBuilder()
    build.input(strapgen.Signal.vector("rate", "w"))
    return build


def run() -> strapgen.Run:
    motion = strapgen.motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)
    return strapgen.simulate(stepper(), motion, "0.125", 10)


def convergence() -> strapgen.Convergence:
    coning = strapgen.motion("coning", a_rad_s=1, b_rad_s=1.5, g_rad_s=0.6)
    return strapgen.converge(strapgen.choose("euler", "rk4", 2), coning, ["1/8", "1/16"], 1, "numpy")


#: An object of each public class that a user may hold.
OBJECTS: dict[str, Callable[[], Any]] = {
    "AttitudeAlgorithm": lambda: strapgen.algorithm("euler", "rk4", increments=2),
    "Backend": stepper,
    "Evaluator": lambda: strapgen.evaluator("euler-from-dcm"),
    "CommitLate": lambda: strapgen.CommitLate("window-3-3"),
    "KalmanFilter": lambda: strapgen.kalman(
        Path(__file__).parents[1] / "examples" / "kalman" / "gyrocompass.toml"
    ),
    "GapError": lambda: strapgen.GapError("a sample is lost"),
    "SampleKind": lambda: next(iter(strapgen.SampleKind)),
    "SystemRunner": lambda: strapgen.system_runner(strapgen.read_system("two-speed-euler")),
    "TwoSpeed": lambda: strapgen.TwoSpeed("euler"),
    "Choice": lambda: strapgen.choose("euler", strapgen.TABLEAUX["butcher6"], 3, previous=1),
    "Kinematics": lambda: strapgen.DCM,
    "Samples": lambda: strapgen.Samples(strapgen.KernelBuilder(), 2),
    "Tableau": lambda: strapgen.TABLEAUX["dormand-prince8"],
    "Window": lambda: strapgen.WINDOWS["window-7-7"],
    "Comparisons": lambda: strapgen.compare("euler", "rk4", 2, ["numpy"], TURN),
    "Comparison": lambda: strapgen.compare("euler", "rk4", 2, ["numpy"], TURN)[0],
    "Finding": lambda: next(iter(strapgen.check(strapgen.choose("euler", "rk4", 2)))),
    "Convergence": convergence,
    "AttitudeStep": lambda: kernel().attitude_step,
    "Order": lambda: kernel().order,
    "Settings": lambda: strapgen.Settings.of(word=16, max_rate_deg_s=400, step="0.01", increments=2),
    "RoundingBounds": lambda: strapgen.rounding_bounds(program()),
    "Format": lambda: strapgen.Format(32, 30),
    "FixedProgram": lambda: strapgen.quantize(program()),
    "KernelInfo": lambda: program().info,
    "Program": program,
    "Recursion": lambda: strapgen.derive("coning-fast").recursion,
    "Signal": lambda: kernel().inputs[1],
    "Sources": lambda: strapgen.generate(program(), "c"),
    "Course": lambda: strapgen.course("euler", inertial(), fast_cycles=2),
    "Motion": lambda: strapgen.motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10),
    "AttitudeError": lambda: strapgen.attitude_error(OBJECTS["History"](), OBJECTS["TrueAttitude"]()),
    "TrueAttitude": lambda: strapgen.TrueAttitude.of([0, 1e-2, 1], [[0, 0, 0, 1]] * 3),
    "History": lambda: strapgen.propagate(stepper(), recording()),
    "InertialRecording": inertial,
    "Recording": recording,
    "Run": run,
    "CompilerError": lambda: strapgen.CompilerError("no C compiler"),
    "InputError": lambda: strapgen.InputError("step is 0"),
    "InputTypeError": lambda: strapgen.InputTypeError("step is None"),
    "MissingExtraError": lambda: strapgen.MissingExtraError("plots need matplotlib"),
    "StrapgenError": lambda: strapgen.StrapgenError("step is 0"),
    "Kernel": kernel,
    "KernelBuilder": builder,
    "Stage": lambda: kernel().stages[0],
    "StampedGrid": lambda: strapgen.StampedGrid(sample_hz=200, tick_hz=1_000_000),
    "GridSamples": lambda: strapgen.GridSamples(np.zeros((4, 3)), 0.005, (200.0, 200.0)),
    "StampError": lambda: strapgen.StampError(strapgen.StampStatus.GAP, "a sample is lost"),
    "StampStatus": lambda: next(iter(strapgen.StampStatus)),
    "Preintegrator": lambda: strapgen.Preintegrator("pair-1-5", sample_hz=200),
    "Preintegrated": lambda: strapgen.Preintegrated(
        np.eye(3), *np.zeros((2, 3)), np.zeros((9, 9)), np.ones((9, 6)), np.array(0.5), *np.zeros((2, 3))
    ),
    "PreintegrationError": lambda: strapgen.PreintegrationError(
        strapgen.PreintegrationStatus.GAP, "a sample is lost"
    ),
    "PreintegrationStatus": lambda: next(iter(strapgen.PreintegrationStatus)),
    "Target": lambda: strapgen.TARGETS["c"],
    "Language": lambda: strapgen.Language(str.isidentifier, lambda texts: [{*" ".join(texts).split()}]),
}


def unknown_steps() -> SolvedStep:
    return strapgen.unknowns.solve(strapgen.choose(f"{ROOT}/examples/three_samples.py"), 4)


def heun() -> UnknownTableau:
    return strapgen.unknowns.read_tableau(f"{ROOT}/examples/heun3.toml")


#: An object of each class of a public module, and of some that functions of one return.
MODULE_OBJECTS: dict[str, Callable[[], Any]] = {
    "formulas.Formulas": lambda: strapgen.algorithm("euler", "rk4", increments=2).formulas,
    "unknowns.Equation": lambda: heun().conditions()[0],
    "unknowns.ErrorSeries": lambda: strapgen.algorithm("euler", "rk4", increments=2).series(terms=1).step,
    "unknowns.Family": lambda: heun().solve().families[0],
    "unknowns.LeadingError": lambda: unknown_steps().leading[0][0],
    "unknowns.PolynomialSolution": lambda: heun().solve(),
    "unknowns.SolvedStep": unknown_steps,
    "unknowns.UnknownTableau": heun,
    "exact.Interpreter": lambda: strapgen.exact.Interpreter(program()),
    "exact.ExactEvaluator": lambda: strapgen.evaluator("euler-from-dcm", "exact"),
    "gyro.StepWindows": lambda: strapgen.gyro.StepWindows(lambda first, stop: TURN, 2),
    "study.Case": lambda: strapgen.study.Study().cases()[0],
    "study.Study": lambda: strapgen.study.Study(words=(8,) * 200),
    "study.Outcome": lambda: strapgen.study.Outcome(
        strapgen.study.Study().cases()[0], 1.0, 1.0, 1.0, 1.0, None
    ),
    "window_design.FamilyBrief": lambda: strapgen.window_design.FamilyBrief(7, 7, Fraction(13, 10)),
    "sensors.InstrumentErrors": lambda: strapgen.sensors.read("ahrs"),
    "sensors.TriadErrors": lambda: strapgen.sensors.read("ahrs").gyro,
    "sensors.Sampling": strapgen.sensors.Sampling,
    "sensors.WarmUp": lambda: strapgen.sensors.WarmUp(rate=np.ones(3)),
    "sensors.Heating": strapgen.sensors.Heating,
    "sensors.OutputNoise": strapgen.sensors.OutputNoise,
    "sensors.MeasurementUnit": lambda: strapgen.sensors.MeasurementUnit(strapgen.sensors.read("ahrs"), 0.01),
    "vibration.Spectrum": lambda: strapgen.vibration.Spectrum(
        np.ones_like, {"angle_x": np.ones_like}, (1.0, 2.0)
    ),
    "shape": lambda: SHAPES["coning-shaped-8"],
    "design": lambda: coning_coefficients.design(3, 0, "combined"),
    "unknowns.VelocitySeries": lambda: velocity_series.series(
        strapgen.choose("velocity-position", "magnus2", 1)
    ),
    "growth": lambda: growth.growth(strapgen.choose("dcm", "rk1")),
    "stability": lambda: growth.stability(strapgen.choose("dcm", "rk1")),
    "vibration.Assessment": lambda: strapgen.vibration.of(strapgen.choose("euler", "rk1", 1)),
    "vibration.Rates": lambda: strapgen.vibration.Rates(1.0, 1.0, 0.0),
    "vibration.RandomRates": lambda: strapgen.vibration.RandomRates(
        *2 * [strapgen.vibration.Rates(1.0, 1.0, 0.0)]
    ),
    "vibration.Tone": lambda: strapgen.vibration.Tone("10", (-1e-3j, 1e-3, 0)),
    "vibration.Rectification": lambda: strapgen.vibration.rectified(
        strapgen.choose("euler", "rk1", 1), "0.01", [strapgen.vibration.Tone("10", (-1e-3j, 1e-3, 0))]
    ),
}
#: Formulas in a notebook: kernels, series, tableaux, order conditions, coefficients, windows.
FORMULAS = (
    *(name for name in MODULE_OBJECTS if name.startswith("unknowns.")),
    *("shape", "design", "stability"),
)


def too_long(text: str) -> bool:
    lines = text.split("\n")
    return not 1 <= len(lines) <= LINES or max(map(len, lines)) > WIDTH


def test_every_public_object_shows_itself_in_five_lines():
    """Values of the package itself, and one of each class; functions and modules show themselves as Python does."""
    objects = {name: getattr(strapgen, name) for name in strapgen.__all__}
    classes = {name for name, value in objects.items() if inspect.isclass(value)}
    assert classes == {*OBJECTS}
    values = {
        name: value
        for name, value in objects.items()
        if not isinstance(value, type | types.FunctionType | types.ModuleType)
    }
    texts = {name: repr(value) for name, value in values.items()}
    texts |= {name: repr(build()) for name, build in OBJECTS.items()}
    assert {name: text for name, text in texts.items() if too_long(text)} == {}
    unspoken = {name: text for name, text in texts.items() if " object at 0x" in text}
    assert unspoken == {}


def test_objects_of_public_modules_show_themselves_too():
    modules = [(name, getattr(strapgen, name)) for name in strapgen.__all__]
    classes = {
        f"{name}.{each}"
        for name, module in modules
        if isinstance(module, types.ModuleType) and name != "algebra"  # whose classes are SymPy's functions
        for each in getattr(module, "__all__", vars(module))
        if inspect.isclass(value := getattr(module, each)) and not each.startswith("_")
        if value.__module__.startswith(module.__name__) or hasattr(module, "__all__")
        if not each.endswith(("File", "Result", "Data"))  # records of users' files and of JSON
        and each not in strapgen.__all__
    }
    assert classes == {name for name in MODULE_OBJECTS if "." in name}
    objects = {name: build() for name, build in MODULE_OBJECTS.items()}
    assert {name: repr(value) for name, value in objects.items() if too_long(repr(value))} == {}
    assert [name for name, value in objects.items() if " object at 0x" in repr(value)] == []
    shown = {name: objects[name]._repr_latex_() for name in FORMULAS}
    shown |= {name: OBJECTS[name]()._repr_latex_() for name in ("AttitudeAlgorithm", "Kernel", "Window")}
    shown["unknowns"] = strapgen.derive(strapgen.choose(f"{ROOT}/examples/three_samples.py"))._repr_latex_()
    assert (
        r"+ a \mathbf{d}_{1} \times \mathbf{d}_{2} + b \mathbf{d}_{1} \times \mathbf{d}_{3}"
        in shown["unknowns"]
    )
    shown["Tableau"] = strapgen.TABLEAUX["rk4"]._repr_latex_()
    begins = ("\\begin{align*}", "\\[")
    assert [
        name for name, text in shown.items() if not text.startswith(begins) or len(text.splitlines()) > 40
    ] == []


def test_a_repr_that_is_too_long_is_seen():
    assert too_long("\n".join("abcdef")) and too_long("a" * (WIDTH + 1)) and not too_long("a\nb")


def test_repr_has_few_lines():
    assert repr(kernel()) == (
        "<Kernel euler-rk4-2: Euler parameters: step by classical fourth-order Runge-Kutta method from 2\n"
        "  angle increments\n"
        "  state (4), increments (2 x 3) -> next (4); order 4>"
    )
    assert repr(program()).endswith("\n  31 add, 37 multiply; 15 temporaries>")
    assert repr(strapgen.choose("euler", "rk4", 2)) == "Choice(name='euler', method='rk4', increments=2)"
    assert repr(strapgen.Settings()) == "Settings()"
    assert repr(strapgen.Settings(word=16)) == "Settings(word=16)"


@dataclass(frozen=True)
class Held:
    """A dataclass with a value that is long in full."""

    numbers: tuple[int, ...]
    factor: Fraction = Fraction(1)

    __repr__ = short_repr


def test_full_text_has_all_fields():
    """Keys of the cache consist of it, so two values that differ must never share it."""
    one, other = Held((*range(100),)), Held((*range(99), 0))
    assert repr(one) == repr(other) == "Held(numbers=<100 entries>)"
    assert full_text(one) != full_text(other)
    assert full_text(Held((1,))) == "Held(numbers=(1,), factor=Fraction(1, 1))"
    method = strapgen.TABLEAUX["rk4"]
    changed = strapgen.Tableau(**{**vars(method), "weights": (Fraction(1), *method.weights[1:])})
    assert repr(method) == repr(changed)
    assert strapgen.choose("euler", method, 2) != strapgen.choose("euler", "rk4", 2)
    assert full_text(method) != full_text(changed)
    assert strapgen.Choice("euler", method, 2).identity != strapgen.Choice("euler", changed, 2).identity


@pytest.mark.parametrize("word", [8, 16, 32])
def test_a_field_that_differs_from_its_default_is_shown(word):
    assert (f"word={word}" in repr(strapgen.Settings(word=word))) is (word != 32)


def test_the_noun_and_the_functions_agree():
    algorithm = strapgen.algorithm("euler", "rk4", increments=2)
    assert algorithm.derive() == kernel()
    assert algorithm.program() == program()
    assert algorithm.generate().files == strapgen.generate(program(), "c").files
    assert algorithm.name == kernel().name
    motion = strapgen.motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)
    runs = [
        algorithm.simulate("coning", "0.125", 10, a_deg_s=10, b_deg_s=10, g_deg_s=10),
        algorithm.simulate(motion, "0.125", 10),
    ]
    assert all(np.array_equal(one.computed, run().computed) for one in runs)
    (row,) = algorithm.compare(TURN, ["numpy"], reference="numpy")
    assert row.max_abs_rad == 0 and row.operations == program().operations
    series = algorithm.series("constant", terms=1)
    assert series.step.order == 4 and not too_long(repr(series))


def test_value_refuses_conflicting_fields():
    algorithm = strapgen.algorithm("euler", "rk4", increments=2)
    motion = strapgen.motion("constant", z_deg_s=1)
    with pytest.raises(
        strapgen.InputError, match=r"^z_deg_s belong to the name of a motion, not to a Motion$"
    ):
        algorithm.simulate(motion, "0.1", 1, z_deg_s=1)
    with pytest.raises(strapgen.InputError, match=r"^algorithm 'dcm-product' is no attitude step"):
        strapgen.algorithm("dcm-product")


#: What else public functions return, by the name of its class or of the function.
RESULTS: dict[str, Callable[[], Any]] = {
    "TwoSpeedRun": lambda: strapgen.TwoSpeed("euler").run(*2 * [np.zeros((4, 3))], fast_cycles=2),
    "SystemRun": lambda: system_run(),
    "Description": lambda: strapgen.read_system("two-speed-euler"),
    "ErrorAnalysis": lambda: strapgen.algorithm("euler").series(terms=1),
    "FindingsResult": lambda: strapgen.check("euler"),
    "Sources in fixed point": lambda: strapgen.algorithm("euler").generate("c-fixed", word=16),
    "study.run_case": lambda: strapgen.study.run_case(study_case()),
    "read_motion": lambda: strapgen.read_motion(ROOT / "examples" / "own_motion.py"),
    "sensors.measured": lambda: strapgen.sensors.measured(
        strapgen.motion("constant", z_deg_s=1), strapgen.sensors.read("ahrs")
    ),
    "windows.named_window": lambda: strapgen.windows.named_window("window-7-7"),
}


def system_run() -> Any:
    runner = strapgen.system_runner(strapgen.read_system("two-speed-euler"))
    return runner.run({signal.name: np.zeros((320, *signal.shape)) for signal in runner.system.inputs})


def study_case() -> strapgen.study.Case:
    (case,) = strapgen.study.cases(words=12, carries="full", duration="2")
    return case


def writeable(value: Any, place: str, seen: dict[int, Any]) -> Iterator[str]:
    """Yield the places of lists, sets, dicts, matrices and arrays that can be written, in a value and its parts."""
    if id(value) in seen or isinstance(value, type | types.FunctionType | types.ModuleType | SystemMemory):
        return
    seen[id(value)] = value  # held, so that no other object gets its number
    if isinstance(value, np.ndarray):
        yield from [place] if value.flags.writeable else []
    elif isinstance(value, list | set | bytearray | MutableDenseMatrix):
        yield place
    elif isinstance(value, Mapping):
        yield from [place] if hasattr(value, "clear") and not isinstance(value, ReadOnlyDict) else []
        for key in value if isinstance(value, dict) else ():
            yield from writeable(value[key], f"{place}[{key!r}]", seen)
    elif isinstance(value, tuple):
        for name, part in zip(getattr(value, "_fields", range(len(value))), value, strict=True):
            yield from writeable(part, f"{place}.{name}", seen)
    elif is_dataclass(value):
        for one in fields(value):
            if not one.name.startswith("_"):
                yield from writeable(getattr(value, one.name), f"{place}.{one.name}", seen)
        for name, kept in vars(type(value)).items():
            if isinstance(kept, cached_property | once) and not name.startswith("_"):
                yield from writeable(getattr(value, name), f"{place}.{name}", seen)


EVERYTHING = OBJECTS | MODULE_OBJECTS | RESULTS


@pytest.mark.parametrize("name", EVERYTHING)
def test_results_cannot_be_written(name):
    value = EVERYTHING[name]()
    assert [*writeable(value, name, {})] == []


@pytest.mark.parametrize("name", ["Run", "Course", "Recording", "Sources", "Settings", "sensors.TriadErrors"])
def test_results_from_a_pickle_cannot_be_written(name):
    value = EVERYTHING[name]()
    copy = pickle.loads(pickle.dumps(value))
    assert type(copy) is type(value) and repr(copy) == repr(value)
    assert [*writeable(copy, name, {})] == []


def test_what_can_be_written_is_found():
    run = OBJECTS["Run"]()
    for part in (np.zeros(3), [1], {"a": 1}, ({1},), ReadOnlyDict(a=[1])):
        object.__setattr__(run, "drift", part)
        assert len([*writeable(run, "run", {})]) == 1


def test_a_write_is_refused_in_one_line():
    sources = strapgen.algorithm("euler").generate()
    for write in (
        lambda: sources.files.update(a="b"),
        lambda: sources.files.pop("euler_rk4_2.c"),
        lambda: sources.operations.__setitem__("add", 0),
        lambda: sources.operations.__ior__({"add": 0}),
    ):
        with pytest.raises(
            TypeError, match=r"^a result cannot be written; dict\(result\) is a copy that can$"
        ):
            write()
    with pytest.raises(ValueError, match="read-only"):
        OBJECTS["Run"]().drift[...] = 0
    for runner in (stepper(), strapgen.TwoSpeed("dcm")):
        with pytest.raises(ValueError, match="read-only"):
            runner.identity[...] = 0
    assert sources.files == strapgen.algorithm("euler").generate().files
    assert json.loads(json.dumps(sources.operations)) == sources.operations


def test_the_array_of_a_user_stays_writeable():
    rows = np.zeros((4, 3))
    recording = strapgen.Recording(0.0, 0.01, rows)
    rows[0] = 1
    assert recording.samples[0, 0] == 1
