"""Every kernel of the catalogue as a system of one stage, against the kernel called by hand."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.catalogue.names import KERNELS
from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import ANY, Signal
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.navigation.systems.wiring import read_system
from strapgen.run import backends

CYCLES = 3
#: One kernel for each kind of state and of signals that others have too.
QUICK = (
    *("cayley-klein-update", "cayley-klein-navigation-update", "cayley-klein-from-dcm", "euler-update"),
    *("dcm-update", "euler-from-dcm-sheppard", "dcm-two-rows-update", "position-step", "coning-fast"),
    *("euler-normalize", "dcm-from-cayley-klein"),
)


def begin(signal: Signal) -> list[float]:
    """Return the state for no rotation, from the labels of its elements alone."""
    labels = [element[-1] for element in signal.elements]
    if signal.constraint == "rotation":
        return [float(k in (0, 4, 8)) for k in range(9)]
    if signal.constraint == "unit" and len(labels) == 4:
        return [float(label == "s") for label in labels]
    if signal.constraint == "unit" and signal.name.startswith("row"):
        return [float(k == int(signal.name[-1]) - 1) for k in range(3)]
    return [0.0] * signal.size


def described(choice: str, folder: Path) -> tuple[Path, dict[str, str]]:
    """Write the file of a system with one stage; return it and the states with the outputs that they become."""
    program = pipeline.program(Choice(choice))
    states = dict(program.recursion.states) if program.recursion is not None else {}
    lines = ['title = "one stage"', "sample_hz = 1"]
    lines.append(f"outputs = {[f'stage.{result.signal.name}' for result in program.outputs]}")
    wires, initial, ranges = [], [], []
    for signal in program.inputs:
        if signal.name in states:
            if signal.constraint == "unit" and signal.size == 3:
                initial.append(f"{signal.name} = {[int(x) for x in begin(signal)]}")
            elif signal.bound is None and not signal.constraint:
                ranges.append(f"{signal.name} = 1")
            continue
        unit, frame = (
            ("1" if signal.unit == ANY else signal.unit),
            ("b" if signal.frame == ANY else signal.frame),
        )
        lines += [f"[inputs.in_{signal.name}]", f'unit = "{unit}"', f'frame = "{frame}"', "range = 2"]
        wires.append(f'{signal.name} = "in_{signal.name}"')
    lines += ["[[stage]]", 'name = "stage"', f'kernel = "{choice}"', "every = 1"]
    lines += [f"wires = {{ {', '.join(wires)} }}"]
    lines += [f"initial = {{ {', '.join(initial)} }}"] * bool(initial)
    lines += [f"ranges = {{ {', '.join(ranges)} }}"] * bool(ranges)
    path = folder / "one.toml"
    path.write_text("\n".join(lines).replace("'", '"') + "\n")
    return path, states


@pytest.mark.parametrize(
    ("kernel", "target"),
    [
        pytest.param(kernel, target, marks=[] if quick and target == "numpy" else [pytest.mark.long])
        for kernel in KERNELS
        for quick in [kernel in QUICK]
        for target in (("numpy", "c", "c-float") if quick else ("numpy",))
    ],
)
def test_stage_agrees_with_its_kernel(kernel, target, tmp_path):
    path, states = described(kernel, tmp_path)
    program = pipeline.program(Choice(kernel))
    if program.recursion is not None and program.recursion.reset:
        with pytest.raises(InputError, match="is a sum that no stage takes"):
            read_system(path)
        return
    runner = system_runner(read_system(path), target)
    by_hand = backends.evaluator(kernel)
    rng = np.random.default_rng(7)
    inputs = {}
    for signal in program.inputs:
        if signal.name not in states:
            drawn = rng.uniform(-0.3, 0.3, (CYCLES, *signal.shape))
            if signal.constraint:
                drawn += np.array(begin(signal)).reshape(signal.shape)
            inputs[signal.name] = np.abs(drawn) + 0.5 if signal.name in ("latitude", "height") else drawn
    run = runner.run({f"in_{name}": values for name, values in inputs.items()})
    held = {s.name: np.array(begin(s)).reshape(s.shape) for s in program.inputs if s.name in states}
    tolerance = 2e-5 if target == "c-float" else 1e-12
    for k in range(CYCLES):
        now = {**held, **{name: values[k] for name, values in inputs.items()}}
        values = by_hand(*(now[signal.name] for signal in program.inputs))
        results = values if isinstance(values, tuple) else (values,)
        for result, value in zip(program.outputs, results, strict=True):
            name = result.signal.name
            state = next((state for state, output in states.items() if output == name), name)
            got = run.values.get(f"stage_{state}", run.values.get(f"stage_{name}"))
            np.testing.assert_allclose(
                np.asarray(got[k]).reshape(-1), np.ravel(value), rtol=tolerance, atol=tolerance
            )
            if name in states.values():
                held[state] = np.asarray(value)


def test_states_of_all_kernels_begin_without_rotation():
    """Those that the rule of `begin` covers; a state of length 1 that it does not is refused."""
    seen = set()
    for kernel in KERNELS:
        program = pipeline.program(Choice(kernel))
        states = dict(program.recursion.states) if program.recursion is not None else {}
        for signal in program.inputs:
            if signal.name in states and signal.constraint:
                known = signal.identity
                seen.add((signal.constraint, signal.size, signal.elements[0][-1], known is None))
                assert known is None or list(map(Fraction, begin(signal))) == list(known)
    assert ("unit", 4, "s", False) in seen
    assert ("unit", 4, "x", False) in seen
    assert ("rotation", 9, "1", False) in seen
    assert ("unit", 3, "x", True) in seen
