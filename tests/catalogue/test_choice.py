"""A choice carries what was chosen: two kernels of one name are two kernels, wherever they are used."""

from __future__ import annotations

import json
import pickle
import shlex
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import strapgen
from strapgen import catalogue, pipeline
from strapgen.analysis import vibration
from strapgen.analysis.series.constant_rate import constant_rate
from strapgen.analysis.series.prediction import predict
from strapgen.analysis.series.series import series
from strapgen.catalogue.methods import tableaux
from strapgen.cli import main
from strapgen.firmware.check_code import conformance
from strapgen.ir.exceptions import InputError
from strapgen.kernel.kernel import Kernel
from strapgen.lab.comparison import compare
from strapgen.lab.convergence import converge
from strapgen.lab.motions.motions import GENERAL
from strapgen.run.backends import backend

#: A file whose kernel has one name, whatever its options are: Euler parameters by a tableau.
FILE = str(Path(__file__).resolve().parents[1] / "data" / "algorithms" / "one_name.py")
METHODS = ("rk1", "rk2")
#: A file whose step puts a number, or an element of the state, in the first place of its matrix.
NAMED_PI = """
import sympy as sp
from strapgen import AttitudeStep, KernelBuilder, Signal, increments_signal

def algorithm():
    build = KernelBuilder()
    state = build.input(Signal("state", (3, 3), ("pi", *(f"C_{{k}}" for k in range(2, 10)))))
    build.input(increments_signal(2))
    build.output(Signal.matrix("next", "next"), [{number}, *list(state)[1:]])
    step = AttitudeStep(None, None, None, (1, 0, 0, 0, 1, 0, 0, 0, 1))
    return build.kernel("named-pi", "A matrix", "none", attitude_step=step)
"""


@pytest.fixture
def chosen() -> dict[str, catalogue.Choice]:
    """Return choices of one file by two methods, both made before either is used."""
    choices = {method: catalogue.choose(FILE, method) for method in METHODS}
    assert {choice.kernel for choice in choices.values()} == {"mine"}
    return choices


@pytest.fixture
def says(capsys: pytest.CaptureFixture[str]):
    """Run a command line and return what it prints as data."""

    def run(command: str):
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(command))
        said = capsys.readouterr()
        assert (stop.value.code, said.err) == (0, "")
        return json.loads(said.out)

    return run


def test_choices_of_two_kernels_of_one_name_differ(chosen):
    first, second = chosen.values()
    assert first != second and first.identity != second.identity
    assert first == catalogue.choose(FILE, "rk1") and hash(first) == hash(catalogue.choose(FILE, "rk1"))
    assert len({first, second, catalogue.choose(FILE, "rk2")}) == 2
    assert pickle.loads(pickle.dumps(first)) == first
    assert catalogue.derive(first) != catalogue.derive(second)
    assert (first.increments_per_step, first.previous) == (2, 0)


def test_choices_differ_in_the_kernels_that_a_step_brings(chosen):
    kernel = catalogue.derive(chosen["rk1"])
    for place, own in enumerate(kernel.bundled_kernels):
        (output,) = own.outputs
        doubled = replace(output, expressions=tuple(2 * x for x in output.expressions))
        others = [*kernel.bundled_kernels]
        others[place] = replace(own, outputs=(doubled,))
        other = catalogue.Choice.of_user(replace(kernel, bundled_kernels=tuple(others)))
        assert other.identity != chosen["rk1"].identity
    assert len(kernel.bundled_kernels) > 1


@pytest.mark.long
def test_each_has_the_companions_that_it_brings(chosen, rng):
    state = np.array([0.1, 0.2, 0.3, 1.0])
    d = rng.normal(scale=0.02, size=(30, 2, 3))
    for method, scheme in (("rk1", "euler-normalize-first-order"), ("rk2", "euler-normalize")):
        mend = strapgen.evaluator(chosen[method].companion("mend"))
        np.testing.assert_array_equal(mend(state), strapgen.evaluator(scheme)(state))
        for name in ("numpy", "c", "c-fixed32"):
            wanted = strapgen.backend("euler", method, backend=name, orthonormalization=scheme)
            mended = backend(chosen[method], backend=name, orthonormalization="mend")
            np.testing.assert_array_equal(mended.propagate(d, 1, 5), wanted.propagate(d, 1, 5))
    with pytest.raises(
        InputError, match=r"orthonormalization 'euler-normalize' is not known; allowed: mend$"
    ):
        backend(chosen["rk1"], orthonormalization="euler-normalize")


def test_an_evaluator_takes_a_choice_of_a_user_s_kernel(chosen, rng):
    state, d = np.array([0.0, 0.6, 0.0, 0.8]), rng.normal(scale=0.1, size=(2, 3))
    for method, choice in chosen.items():
        wanted = strapgen.evaluator(catalogue.choose("euler", method))(state, d)
        np.testing.assert_array_equal(strapgen.evaluator(choice)(state, d), wanted)
    with pytest.raises(InputError, match="kernel 'mend' is not known"):
        strapgen.evaluator("mend")


def test_each_has_its_own_errors_in_many_digits(chosen):
    profile = strapgen.motion("coning", **GENERAL)
    for method, choice in chosen.items():
        measured = converge(choice, profile, ["1/8", "1/16"], 1)
        wanted = converge(catalogue.choose("euler", method), profile, ["1/8", "1/16"], 1)
        assert measured.rungs == wanted.rungs


def test_each_has_its_own_analysis(chosen):
    turn = strapgen.motion("constant", y_deg_s=10)
    for method, choice in chosen.items():
        ours = catalogue.choose("euler", method)
        assert constant_rate(choice).angle_lost == constant_rate(ours).angle_lost
        assert series(choice, "coning", 1).drift == series(ours, "coning", 1).drift
        assert vibration.of(choice).computed == vibration.of(ours).computed
        found, wanted = (predict(one, turn, "1/8", 18, 5) for one in (choice, ours))
        assert list(found.drift[-1]) == list(wanted.drift[-1])


def test_each_is_compared_and_checked_for_itself(chosen, rng):
    d = rng.normal(scale=0.02, size=(20, 2, 3))
    for method, choice in chosen.items():
        (row,) = compare(choice, backends=["numpy"], increments=d, reference="exact")
        (wanted,) = compare("euler", method, None, ["numpy"], d, reference="exact")
        assert (row.max_abs_rad, row.drift_deg) == (wanted.max_abs_rad, wanted.drift_deg)
    findings = {finding.name: finding for finding in conformance.check(chosen["rk2"])}
    assert findings["order"].measured == pytest.approx(2, abs=0.15)


def test_an_algorithm_is_held_against_itself_by_another_method(says):
    command = "series {0} --method rk1 --motion constant --versus {0} --versus-method rk2 --format json"
    users, ours = (says(command.format(name)) for name in (shlex.quote(FILE), "euler"))
    for part in ("first_terms", "second_terms", "ratio"):
        assert users[part] == ours[part]
    assert users["first_terms"] != users["second_terms"]


def test_a_number_and_an_input_of_its_name_are_two_formulas(tmp_path):
    """Both print as ``pi``: the number, and an element of the state of this name."""
    identities, values = set(), set()
    for number in ("sp.pi", "sp.Symbol('pi', real=True)"):
        (tmp_path / "pi.py").write_text(NAMED_PI.format(number=number))
        choice = catalogue.choose(str(tmp_path / "pi.py"))
        identities.add(choice.identity)
        values.add(float(backend(choice).propagate(np.full((1, 2, 3), 0.5))[-1][0, 0]))
    assert len(identities) == len(values) == 2


def test_the_same_tableau_in_two_files_is_generated_by_two_commands(tmp_path):
    head = 'name = "Heun 2"\nsource = "test"\norder = 2\n'
    text = f'{head}nodes = ["0", "1"]\nmatrix = [[], ["1"]]\nweights = ["1/2", "1/2"]\n'
    files = [tmp_path / "a" / "heun.toml", tmp_path / "b" / "heun.toml"]
    for file in files:
        file.parent.mkdir()
        file.write_text(text)
        choice = catalogue.choose("euler", tableaux.read(file), 1)
        (code,) = pipeline.compile(choice, "numpy").files.values()
        assert f"--tableau {file} " in " ".join(code.split())


def test_two_kernels_of_one_step_need_two_names(tmp_path):
    text = Path(FILE).read_text()
    (tmp_path / "twice.py").write_text(text.replace('name="matrix-from-mine"),', 'name="mend"),'))
    with pytest.raises(InputError, match="kernel mine: two of its kernels are called mend; every one needs"):
        catalogue.choose(str(tmp_path / "twice.py"))


def held(value: object, depth: int = 3) -> Iterator[str]:
    """Yield the names of users' kernels that a container holds, at any of a few depths."""
    if isinstance(value, Kernel):
        yield value.name
    elif depth and isinstance(value, dict):
        for entry in value.values():
            yield from held(entry, depth - 1)
    elif depth and isinstance(value, list | set | tuple):
        for entry in value:
            yield from held(entry, depth - 1)


def test_no_module_of_the_package_holds_a_user_s_kernel(chosen):
    for choice in chosen.values():
        strapgen.simulate(backend(choice), strapgen.motion("constant", x_rad_s=1), "0.01", "0.02")
    holding = [
        f"{name}.{attribute}"
        for name, module in list(sys.modules.items())
        if name.partition(".")[0] == "strapgen"
        for attribute, value in vars(module).items()
        if "mine" in held(value)
    ]
    assert holding == []
    assert list(held({"a": [catalogue.derive(chosen["rk1"])]})) == ["mine"], "the check would see one"
