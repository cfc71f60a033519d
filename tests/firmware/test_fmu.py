"""Units for co-simulation: valid by the standard, equal to the twins of their code, and strict about their inputs."""

from __future__ import annotations

import io
import re
import shutil
import zipfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from c_programs import complaints, needed

from strapgen import TwoSpeed, pipeline, read_system
from strapgen.catalogue import Choice, choose
from strapgen.cli import main
from strapgen.firmware.fmu import archive, units
from strapgen.firmware.fmu.units import Unit
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.navigation.systems import system_generation
from strapgen.navigation.systems.fitting import fitted
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.run import compiler

fmpy = pytest.importorskip("fmpy")
from fmpy.fmi1 import FMICallException  # noqa: E402
from fmpy.fmi2 import FMU2Slave  # noqa: E402
from fmpy.fmi3 import FMU3Slave  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
STEPS = 40
FULL = Settings(carry="full")
GYRO = Settings.of(sample_hz=100, lsb="0.0175dps", carry="full", increments=2)
FAST, SLOW = units.CYCLES


@cache
def kernel(name: str, target: str, settings: Settings | None = None, **options: Any) -> Unit:
    choice = choose(name, **options)
    return units.of_kernel(
        choice, pipeline.compile(choice, target, settings), settings, f"strapgen generate {name}"
    )


@cache
def two_speed(algorithm: str, target: str, settings: Settings | None = None) -> Unit:
    return units.of_two_speeds(algorithm, 2, target, settings, f"strapgen two-speed {algorithm}")


@cache
def system(name: str, target: str) -> Unit:
    fit = fitted(read_system(name), target, Settings() if target == "c-fixed" else None)
    command = f"strapgen system {name}"
    return units.of_system(fit, system_generation.unit(fit, command), command)


@cache
def content(unit: Unit, kind: str) -> bytes:
    (file,) = archive.project_files(unit, kind).values()
    return file


@pytest.fixture
def written(tmp_path):
    def write(unit: Unit, kind: str) -> str:
        needed("cc")
        path = tmp_path / f"{unit.name}.{kind}.fmu"
        path.write_bytes(content(unit, kind))
        return str(path)

    return write


def run(
    path: str, inputs: Mapping[str, np.ndarray], outputs: list[str], **start: Any
) -> dict[str, np.ndarray]:
    """Simulate a unit with one row of each input in every step; return the outputs at the start and after each."""
    description = fmpy.read_model_description(path)
    width, steps = float(description.defaultExperiment.stepSize), len(next(iter(inputs.values())))
    kinds = {v.name: (v.valueReference, v.type) for v in description.modelVariables}
    given = {one: rows for name, values in inputs.items() for one, rows in scalars(description, name, values)}
    begun = {
        one: rows
        for name, values in start.items()
        for one, rows in scalars(description, name, np.asarray(values)[None])
    }
    recorded = {name: [one for one, _ in scalars(description, name)] for name in outputs}

    def step_finished(time: float, recorder: Any) -> bool:
        place = round(time / width)
        for name, rows in given.items() if place < steps else ():
            reference, kind = kinds[name]
            getattr(recorder.fmu, f"set{kind}")([reference], rows[place].tolist())
        return True

    result = fmpy.simulate_fmu(
        path,
        stop_time=steps * width,
        output_interval=width,
        start_values={
            name: rows[0].tolist() if len(rows[0]) > 1 else rows[0][0]
            for name, rows in {**given, **begun}.items()
        },
        output=[one for names in recorded.values() for one in names],
        step_finished=step_finished,
    )
    assert len(result) == steps + 1
    return {
        name: np.concatenate([result[one].reshape(steps + 1, -1) for one in names], axis=1)
        for name, names in recorded.items()
    }


def scalars(description: Any, name: str, values: np.ndarray | None = None) -> list[tuple[str, Any]]:
    """Return the variables that an array is in FMI 2, or itself in FMI 3, with their values by row."""
    own = [v.name for v in description.modelVariables if v.name == name or v.name.startswith(f"{name}[")]
    assert own, name
    rows = None if values is None else values.reshape(len(values), -1)
    if rows is None or own == [name]:
        return [(one, rows) for one in own]
    return [(one, rows[:, place : place + 1]) for place, one in enumerate(own)]


def increments(steps: int, samples: int, largest: float) -> np.ndarray:
    """Return increments of a motion about all axes, (steps, samples, 3)."""
    place = np.arange(steps * samples).reshape(steps, samples, 1)
    return largest * np.sin(0.3 * place + np.array([0.0, 1.0, 2.5])) * np.array([1.0, 0.5, -0.8])


UNITS = [
    pytest.param(lambda: kernel("euler", "c"), id="euler"),
    pytest.param(lambda: kernel("dcm", "c-float"), id="dcm-float", marks=pytest.mark.long),
    pytest.param(lambda: kernel("dcm", "c-fixed", GYRO), id="dcm-counts"),
    pytest.param(lambda: kernel("euler", "c-fixed", Settings(16)), id="euler-w16", marks=pytest.mark.long),
    pytest.param(lambda: kernel("euler-angles-from-dcm", "c"), id="angles", marks=pytest.mark.long),
    pytest.param(lambda: kernel("euler", "c", previous=2, ahead=1), id="window", marks=pytest.mark.long),
    pytest.param(lambda: two_speed("euler", "c"), id="two-speed"),
    pytest.param(lambda: two_speed("dcm", "c-fixed", FULL), id="two-speed-fixed", marks=pytest.mark.long),
    pytest.param(lambda: system("two-speed-euler", "c"), id="system", marks=pytest.mark.long),
    pytest.param(
        lambda: system("examples/strapdown.toml", "c-fixed"), id="system-fixed", marks=pytest.mark.long
    ),
]


@pytest.mark.parametrize("kind", archive.VERSIONS)
@pytest.mark.parametrize("unit", UNITS)
def test_it_is_valid_by_the_standard(unit, kind, written):
    assert validate_fmu(written(unit(), kind)) == []


@pytest.mark.parametrize("kind", archive.VERSIONS)
@pytest.mark.parametrize("unit", UNITS)
def test_strict_compilers_are_silent(unit, kind, tmp_path):
    files = archive.source_files(unit(), archive.VERSIONS[kind])
    sources = {name.removeprefix("sources/"): text for name, text in files.items() if "sources/" in name}
    for name, text in sources.items():
        (tmp_path / name).write_text(text)
    (own,) = (name for name in sources if name.endswith(f"_fmi{archive.VERSIONS[kind]}.c"))
    assert [line for line in sources[own].splitlines() if len(line) > 99] == []
    needed("gcc")
    assert complaints("gcc", tmp_path, [own]) == ""


@pytest.mark.long
@pytest.mark.parametrize("kind", archive.VERSIONS)
def test_the_sources_build_as_the_description_says(kind, written):
    build = pytest.importorskip("fmpy.build")
    unit, samples = kernel("dcm", "c-fixed", GYRO), counts(20)
    folder = Path(fmpy.extract(written(unit, kind)))
    shutil.rmtree(folder / "binaries")
    build.build_platform_binary(folder)
    found = run(str(folder), {"increments": samples}, ["state"])
    assert found["state"].tolist() == [list(state) for state in model_states(samples)]


# Runs against the twins


def module_of(sources: Sources) -> Any:
    return getattr(compiler.load(sources), sources.function.name)


@pytest.mark.parametrize("kind", archive.VERSIONS)
@pytest.mark.parametrize(("target", "bound"), [("c", 1e-14), ("c-float", 1e-5)])
def test_a_step_equals_its_twin(kind, target, bound, written):
    samples = increments(STEPS, 2, 0.02)
    if target == "c-float":
        samples = samples.astype(np.float32)
    start = np.array([0.5, -0.5, 0.5, 0.5])
    found = run(
        written(kernel("euler", target), kind),
        {"increments": samples},
        ["state", "attitude"],
        initial_state=start,
    )
    step = module_of(pipeline.compile(choose("euler"), "numpy"))
    matrix = module_of(pipeline.compile(Choice("dcm-from-euler"), "numpy"))
    states = [start]
    for row in samples.astype(float):
        states.append(step(states[-1], row))
    assert np.abs(found["state"] - states).max() < bound
    assert np.abs(found["attitude"] - [matrix(state).reshape(-1) for state in states]).max() < 2 * bound
    assert np.abs(np.array(states) - start).max() > 0.03


def counts(steps: int) -> np.ndarray:
    return np.rint(increments(steps, 2, 20000)).astype(np.int16)


def model_states(samples: np.ndarray) -> list[tuple[int, ...]]:
    """Return the states of the integer model of the step that takes counts."""
    sources = pipeline.compile(choose("dcm"), "fixed-model", GYRO)
    step, state = module_of(sources), [(1 << 30) * (place % 4 == 0) for place in range(9)]
    assert sources.fixed is not None
    feedback, states = tuple(word.fresh for word in sources.fixed.residuals), [tuple(state)]
    for row in samples.reshape(len(samples), -1).tolist():
        following, feedback = step(states[-1], row, feedback)
        states.append(following)
    return states


@pytest.mark.parametrize("kind", archive.VERSIONS)
def test_counts_give_the_integers_of_the_model(kind, written):
    samples = counts(20)
    found = run(written(kernel("dcm", "c-fixed", GYRO), kind), {"increments": samples}, ["state"])
    assert found["state"].tolist() == [list(state) for state in model_states(samples)]


@pytest.mark.parametrize("kind", archive.VERSIONS)
def test_samples_beside_the_step_are_kept(kind, written):
    before, after, own = 2, 1, 2
    unit = kernel("euler", "c", previous=before, ahead=after)
    everything = increments(1, before + own * STEPS, 0.02)[0]
    found = run(
        written(unit, kind),
        {"increments": everything[before:].reshape(STEPS, own, 3)},
        ["state"],
        previous_increments=everything[:before],
    )
    step = module_of(pipeline.compile(choose("euler", previous=before, ahead=after), "numpy"))
    states = [
        np.array([0.0, 0.0, 0.0, 1.0])
    ] * 2  # one step late: the sample after the first comes with the second
    for place in range(STEPS - 1):
        states.append(step(states[-1], everything[place * own : place * own + before + own + after]))
    assert unit.values["window"]["late"] == 1
    assert np.abs(found["state"] - states).max() < 1e-14


@pytest.mark.parametrize("kind", archive.VERSIONS)
def test_two_speeds_equal_their_twin(kind, written):
    steps = FAST * SLOW * 5
    angles, velocities = increments(steps, 1, 0.01)[:, 0], increments(steps, 1, 0.1)[:, 0]
    turns = np.tile([1e-6, 2e-6, -3e-6], (steps, 1))
    found = run(
        written(two_speed("euler", "c"), kind),
        {"increment": angles, "velocity_increment": velocities, "turn": turns},
        ["state", "velocity_change"],
        previous_increment=angles[-1],
        previous_turn=turns[0],
    )
    twin = TwoSpeed("euler", backend="numpy").run(
        angles,
        velocities,
        fast_cycles=FAST,
        slow_cycles=SLOW,
        turns=[*turns[::FAST].tolist(), turns[0].tolist()],
        previous=angles[-1],
    )
    assert np.abs(found["state"][FAST::FAST] - twin.attitudes).max() < 1e-14
    changes = found["velocity_change"][FAST * SLOW :: FAST * SLOW]
    assert np.abs(changes - twin.velocity_changes).max() < 1e-13
    assert np.abs(changes).max() > 0.01


@pytest.mark.parametrize("kind", archive.VERSIONS)
def test_two_speeds_give_the_integers_of_the_model(kind, written):
    steps = FAST * SLOW * 2
    unit = two_speed("dcm", "c-fixed", FULL)
    angles = np.rint(increments(steps, 1, 1 << 24)[:, 0]).astype(np.int32)
    velocities = np.rint(increments(steps, 1, 1 << 26)[:, 0]).astype(np.int32)
    found = run(
        written(unit, kind),
        {"increment": angles, "velocity_increment": velocities, "turn": np.zeros((steps, 3), np.int32)},
        ["state", "velocity_change"],
    )
    twin = TwoSpeed("dcm", backend="fixed-model", settings=FULL).run(
        angles * 2.0**-30, velocities * 2.0**-27, fast_cycles=FAST, slow_cycles=SLOW
    )
    assert (found["state"][FAST::FAST] == twin.attitudes.reshape(-1, 9) * 2.0**30).all()
    changes = found["velocity_change"][FAST * SLOW :: FAST * SLOW]
    assert (changes == twin.velocity_changes * 2.0**24).all() and changes.any()


@pytest.mark.parametrize("kind", archive.VERSIONS)
def test_a_system_equals_its_twin(kind, written):
    description = read_system("two-speed-euler")
    steps = description.system.cycle
    inputs = {
        signal.name: increments(steps, 1, 1e-3)[:, 0] * (1.0 if signal.over else 1e-3)
        for signal in description.system.inputs
    }
    found = run(written(system("two-speed-euler", "c"), kind), inputs, [*description.system.outputs])
    twin = system_runner(description, "numpy").run(inputs).values
    for name in description.system.outputs:
        every = description.system.every(name)
        there = np.asarray(twin[name]).reshape(steps // every, -1)
        assert np.abs(found[name][every::every] - there).max() < 1e-13
        assert there.any()


@pytest.mark.long
@pytest.mark.parametrize("kind", archive.VERSIONS)
def test_a_system_gives_the_integers_of_its_model(kind, written):
    description = read_system("examples/strapdown.toml")
    steps = description.system.cycle
    inputs = {
        signal.name: np.rint(increments(steps, 1, float(signal.bound or 3) / 2)[:, 0]).astype(np.int32)
        for signal in description.system.inputs
    }
    found = run(
        written(system("examples/strapdown.toml", "c-fixed"), kind), inputs, [*description.system.outputs]
    )
    twin = system_runner(description, "fixed-model", Settings())
    ran = twin.run({name: values.astype(float) for name, values in inputs.items()}).values
    for name in description.system.outputs:
        every = description.system.every(name)
        unit = float(twin.fit.arguments[name].unit)
        there = np.asarray(ran[name]).reshape(steps // every, -1) / unit
        assert (found[name][every::every] == there).all()


# Faults, and what an importer may do


class Instance:
    """A unit of either version, by the calls of the standard."""

    def __init__(self, path: str, name: str = "one", token: str | None = None) -> None:
        self.description = fmpy.read_model_description(path)
        self.is_two = self.description.fmiVersion == "2.0"
        folder = fmpy.extract(path)
        of = FMU2Slave if self.is_two else FMU3Slave
        self.fmu = of(
            guid=token or self.description.guid,
            unzipDirectory=folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.said: list[str] = []
        self._instantiate()

    def _instantiate(self) -> None:
        if self.is_two:
            from fmpy.fmi2 import fmi2CallbackFunctions, fmi2CallbackLoggerTYPE

            def log(_: Any, name: bytes, status: int, category: bytes, message: bytes) -> None:
                self.said.append(message.decode())
                print(self.said[-1])

            self.callbacks = fmi2CallbackFunctions()
            self.callbacks.logger = fmi2CallbackLoggerTYPE(log)
            self.fmu.instantiate(callbacks=self.callbacks)
        else:
            self.fmu.instantiate(logMessage=self._log3())

    def _log3(self) -> Any:
        from fmpy.fmi3 import fmi3LogMessageCallback

        def log(_: Any, status: int, category: bytes, message: bytes) -> None:
            self.said.append(message.decode())
            print(self.said[-1])

        return fmi3LogMessageCallback(log)

    def begin(self, time: float = 0.0) -> None:
        if self.is_two:
            self.fmu.setupExperiment(startTime=time)
        self.fmu.enterInitializationMode(**({} if self.is_two else {"startTime": time}))
        self.fmu.exitInitializationMode()

    def _variables(self, name: str) -> tuple[list[int], str]:
        own = [v for v in self.description.modelVariables if v.name == name or v.name.startswith(f"{name}[")]
        return [v.valueReference for v in own], own[0].type

    def put(self, name: str, values: Any) -> None:
        references, kind = self._variables(name)
        getattr(self.fmu, f"set{kind}")(references, [*np.asarray(values).reshape(-1).tolist()])

    def get(self, name: str) -> list[Any]:
        references, kind = self._variables(name)
        if self.is_two:
            return list(getattr(self.fmu, f"get{kind}")(references))
        (variable,) = (v for v in self.description.modelVariables if v.name == name)
        size = int(np.prod([dimension.start for dimension in variable.dimensions]))
        return list(getattr(self.fmu, f"get{kind}")(references, size))

    def step(self, values: Any, time: float = 0.0, width: float = 0.01) -> None:
        self.put("increments", values)
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=width)

    def close(self) -> None:
        self.fmu.freeInstance()


@pytest.fixture(params=archive.VERSIONS)
def instance(request, written):
    made = []

    def make(unit: Unit | None = None, name: str = "one") -> Instance:
        made.append(Instance(written(unit or kernel("euler", "c"), request.param), name))
        return made[-1]

    yield make
    for one in made:
        one.close()


def refused(one: Instance, call: Any) -> str:
    """Return the message with which a call is refused."""
    with pytest.raises(FMICallException):
        call()
    return one.said[-1]


def test_instances_do_not_interfere(instance):
    one, other, alone = instance(name="one"), instance(name="other"), instance(name="alone")
    samples = increments(10, 2, 0.05)
    for each in (one, other, alone):
        each.begin()
    for place, row in enumerate(samples):
        one.step(row, place * 0.01)
        other.step(-row, place * 0.01)
    for place, row in enumerate(samples):
        alone.step(row, place * 0.01)
    assert one.get("state") == alone.get("state") != other.get("state")


def test_another_step_size_is_an_error(instance):
    one = instance()
    one.begin()
    before = one.get("state")
    said = refused(one, lambda: one.step(np.full((2, 3), 0.1), width=0.02))
    assert "communication step is 0.02" in said and "0.01" in said
    assert one.get("state") == before
    one.step(np.full((2, 3), 0.1), width=0.01 * (1 + 1e-9))
    assert one.get("state") != before


def test_the_step_size_is_a_parameter_until_the_first_step(instance):
    one = instance()
    one.put("step_size", [0.5])
    one.begin()
    one.step(np.full((2, 3), 0.1), width=0.5)
    assert "step_size" in refused(one, lambda: one.put("step_size", [0.25]))
    fixed = instance(kernel("dcm", "c-fixed", GYRO))
    assert "step_size" not in {v.name for v in fixed.description.modelVariables}
    fixed.begin()
    fixed.step(np.full((2, 3), 100), width=0.02)
    assert "0.02" in refused(fixed, lambda: fixed.step(np.full((2, 3), 100), width=0.01))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_number_that_is_not_finite_is_an_error(instance, value):
    one = instance()
    one.begin()
    before = one.get("state")
    assert refused(one, lambda: one.step(np.full((2, 3), value))).startswith("increments")
    assert one.get("state") == before
    other = instance()
    other.put("initial_state", [0, 0, value, 1])
    assert refused(other, other.begin).startswith("initial_state")


def test_a_jump_in_time_is_an_error(instance):
    one = instance()
    one.begin()
    one.step(np.full((2, 3), 0.1), 0.0)
    before = one.get("state")
    for time in (0.0, 0.02, 0.01 * (1 + 1e-5), -0.01, np.nan, np.inf):
        said = refused(one, lambda at=time: one.step(np.full((2, 3), 0.1), at))
        assert "the step begins at" in said and "the time of the unit, 0.01" in said
        assert one.get("state") == before
    one.step(np.full((2, 3), 0.1), 0.01 * (1 - 1e-9))
    kept = one.fmu.getFMUState()
    one.step(np.full((2, 3), 0.1), 0.02)
    one.fmu.setFMUState(kept)  # and the time with it
    assert "the time of the unit, 0.0199" in refused(one, lambda: one.step(np.zeros((2, 3)), 0.03))
    one.step(np.full((2, 3), 0.1), 0.02)
    one.fmu.freeFMUState(kept)


def test_sums_of_steps_may_be_rounded(instance):
    one = instance()
    one.begin()
    time = 0.0
    for place in range(1000):
        one.step(np.zeros((2, 3)), time if place % 2 else place * 0.01)
        time += 0.01


def test_a_run_begins_at_the_time_that_it_is_told(instance):
    one = instance()
    one.begin(time=3.0)
    assert "the time of the unit, 3 s" in refused(one, lambda: one.step(np.zeros((2, 3)), 0.0))
    one.step(np.zeros((2, 3)), 3.0)
    other = instance()
    assert refused(other, lambda: other.begin(time=np.inf)) == "time is not finite"


TURNED = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])


@pytest.mark.parametrize(
    ("unit", "good", "wrong"),
    [
        (
            lambda: kernel("euler", "c"),
            [0.5, -0.5, 0.501, 0.5],
            {
                (0, 0, 0, 0.9): "square of row 1 is 0.81; 1 is needed, within 0.01",
                (0,) * 4: "is 0;",
            },
        ),
        (
            lambda: kernel("dcm", "c-fixed", GYRO),
            TURNED * 2**30 + 1000,
            {
                tuple(TURNED.ravel() * 2**29): "square of row 1 is 0.25;",
                (2**30, 0, 0, 2**30, 0, 0, 0, 0, 2**30): "rows 1 and 2 have product 1; 0 is needed",
                tuple(-TURNED.ravel() * 2**30): "rows are left-handed",
            },
        ),
    ],
)
def test_a_start_that_is_no_attitude_is_an_error(instance, unit, good, wrong):
    for values, said in wrong.items():
        one = instance(unit())
        one.put("initial_state", [int(v) if v == int(v) and abs(v) > 1 else v for v in values])
        message = refused(one, one.begin)
        assert message.startswith("initial_state is no attitude: ") and said in message
    one = instance(unit())
    one.put("initial_state", good)
    one.begin()
    assert one.get("state") == pytest.approx(np.ravel(good).tolist())


def test_what_the_code_refuses_is_an_error_and_changes_nothing(instance):
    one = instance(two_speed("dcm", "c-fixed", FULL))
    one.begin()
    one.put("increment", [1 << 24, 0, 0])
    for place in range(FAST - 1):
        one.fmu.doStep(currentCommunicationPoint=place * 0.01, communicationStepSize=0.01)
    one.put("turn", [(1 << 30) + 1, 0, 0])
    said = refused(one, lambda: one.fmu.doStep(currentCommunicationPoint=0.03, communicationStepSize=0.01))
    assert "dcm_two_speed_2_w32_slow returns 1: an input lies outside its range" in said
    one.put("turn", [0, 0, 0])  # the fast cycle of the refused step has not been counted
    one.fmu.doStep(currentCommunicationPoint=0.03, communicationStepSize=0.01)
    angle = np.arcsin(one.get("state")[7] / 2**30)
    assert angle == pytest.approx(FAST / 64, rel=1e-6)


def test_reset_and_states_repeat_a_run(instance):
    one = instance(kernel("dcm", "c-fixed", GYRO))
    one.begin()
    samples = counts(6)
    for place in range(3):
        one.step(samples[place], place * 0.02, 0.02)
    there, kept = one.get("state"), one.fmu.getFMUState()
    for place in range(3, 6):
        one.step(samples[place], place * 0.02, 0.02)
    end = one.get("state")
    one.fmu.setFMUState(kept)
    assert one.get("state") == there
    for place in range(3, 6):
        one.step(samples[place], place * 0.02, 0.02)
    assert one.get("state") == end
    one.fmu.freeFMUState(kept)
    one.fmu.reset()
    one.begin()
    for place in range(6):
        one.step(samples[place], place * 0.02, 0.02)
    assert one.get("state") == end == list(model_states(samples)[-1])


@pytest.mark.parametrize("kind", archive.VERSIONS)
def test_a_model_description_of_another_unit_is_refused(kind, written, capsys):
    path = written(kernel("euler", "c"), kind)
    with pytest.raises(Exception, match="instantiate"):
        Instance(path, token="{another}")
    assert "its token is {another}" in capsys.readouterr().out


def test_calls_out_of_turn_and_unknown_variables_are_errors(instance):
    one = instance()
    assert "out of turn" in refused(one, lambda: one.step(np.zeros((2, 3))))
    one.begin()
    kind = "Real" if one.is_two else "Float64"
    assert "999" in refused(one, lambda: getattr(one.fmu, f"get{kind}")([999]))
    assert "neither an input nor a parameter" in refused(one, lambda: one.put("state", [0, 0, 0, 1]))
    wrong = "Integer" if one.is_two else "Int32"
    assert "another type" in refused(one, lambda: getattr(one.fmu, f"get{wrong}")([1]))


def test_integers_of_32_bits_are_too_few_for_longer_words():
    unit = kernel("euler", "c-fixed", Settings(64))
    with pytest.raises(InputError, match="--project fmu3"):
        archive.source_files(unit, 2)
    assert 'Int64 name="increments"' in archive.source_files(unit, 3)["modelDescription.xml"]


# The archive and the commands


def test_the_page_runs_as_it_says(tmp_path, monkeypatch, capsys):
    needed("cc")
    page = (ROOT / "docs" / "fmu.md").read_text()
    monkeypatch.chdir(tmp_path)
    command, *_ = re.findall(r"^    (strapgen .*)$", page, re.MULTILINE)
    with pytest.raises(SystemExit) as stop:
        main(command.split()[1:])
    assert stop.value.code == 0
    assert "firmware/euler_rk4_2.fmu2.fmu" in capsys.readouterr().out
    (code,) = re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    exec(code, {})
    assert capsys.readouterr().out == f"{np.sin(0.5):.6f} {np.sin(1):.6f}\n"


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("generate euler --target c --project fmu", "fmu2 or fmu3|fmu2, fmu3"),
        ("generate euler --target numpy --project fmu2", "targets in C, not with numpy"),
        ("generate euler --target c-fixed --word 64 --project fmu2", "need --project fmu3"),
        (
            "generate euler --target c --with-runs --project fmu3",
            "--with-runs does not go with --project fmu3",
        ),
        (
            "window generate window-7-7 --target c --project fmu2",
            "--project fmu2 goes with generate, two-speed and system",
        ),
    ],
)
def test_bad_input_gets_one_line(command, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stop:
        main(command.split())
    printed = capsys.readouterr().err
    assert stop.value.code == 2 and printed.count("\n") == 1 and re.search(said, printed)
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("kind", archive.VERSIONS)
@pytest.mark.parametrize(
    "command", ["two-speed dcm --target c-float", "system two-speed-dcm --target c-float"]
)
def test_other_commands_write_units(command, kind, tmp_path):
    needed("cc")
    with pytest.raises(SystemExit) as stop:
        main([*command.split(), "--project", kind, "--out", str(tmp_path)])
    assert stop.value.code in (None, 0)
    (path,) = tmp_path.iterdir()
    assert validate_fmu(str(path)) == []
    made = re.sub(" --sculling 2", "", fmpy.read_model_description(str(path)).generationTool)
    assert made.endswith(f"strapgen {command} --project {kind}")


def test_a_unit_is_written_checked_and_not_written_over(tmp_path, monkeypatch, capsys):
    needed("cc")
    command = ["generate", "euler", "--target", "c", "--project", "fmu3", "--out", str(tmp_path)]

    def status(*words: str) -> int:
        with pytest.raises(SystemExit) as stop:
            main([*command, *words])
        return int(str(stop.value.code))

    assert status() == 0
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    assert status("--check") == 0
    path.write_bytes(whole[:-1])
    assert status("--check") == 1
    assert "Binary files" in capsys.readouterr().out
    assert status() == 2 and path.read_bytes() == whole[:-1]
    assert "differs from what --project writes" in capsys.readouterr().err
    assert status("--force") == 0 and path.read_bytes() == whole


@pytest.mark.parametrize("kind", archive.VERSIONS)
def test_the_archive_is_the_same_for_the_same_sources(kind):
    needed("cc")
    unit = kernel("euler", "c")
    assert content(unit, kind) == content.__wrapped__(unit, kind)
    with zipfile.ZipFile(io.BytesIO(content(unit, kind))) as file:
        names = file.namelist()
    assert names == sorted(names)
    assert {name.split("/")[0] for name in names} == {
        "binaries",
        "documentation",
        "modelDescription.xml",
        "sources",
    }


def test_the_token_changes_with_the_code():
    def token(unit: Unit) -> str:
        text = archive.source_files(unit, 3)["modelDescription.xml"]
        return text.split('instantiationToken="')[1].split('"')[0]

    assert token(kernel("euler", "c")) == token(kernel.__wrapped__("euler", "c"))
    assert token(kernel("euler", "c")) != token(kernel("euler", "c", increments=1))


@pytest.mark.parametrize("kind", archive.VERSIONS)
def test_a_fault_in_the_unit_is_seen(kind, tmp_path, monkeypatch, written):
    render = archive.render

    def faulty(template: str, **values: Any) -> str:
        text = render(template, **values)
        return text.replace("memcpy(data->residuals, fresh", "memset(data->residuals, 0")

    def zeroed(template: str, **values: Any) -> str:
        return faulty(template, **values).replace(
            "memset(data->residuals, 0, sizeof", "memset(data->residuals, (int)fresh[0] * 0, sizeof"
        )

    monkeypatch.setattr(archive, "render", zeroed)
    unit = kernel("dcm", "c-fixed", GYRO)
    (file,) = archive.project_files(unit, kind).values()
    path = tmp_path / "faulty.fmu"
    path.write_bytes(file)
    samples = counts(20)
    found = run(str(path), {"increments": samples}, ["state"])
    assert found["state"].tolist() != [list(state) for state in model_states(samples)]
