"""A choice carries what was chosen: two kernels of one name are two kernels, wherever they are used."""

from __future__ import annotations

import json
import pickle
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from derived import kernel as derived
from hypothesis import given
from hypothesis import strategies as st

import strapgen
from strapgen import catalogue, pipeline
from strapgen.analysis import vibration
from strapgen.analysis.series.constant_rate import constant_rate
from strapgen.analysis.series.prediction import predict
from strapgen.analysis.series.series import series
from strapgen.catalogue import ALGORITHMS, KERNELS, MOST_INCREMENTS, STANDARD_METHODS, Choice, choose
from strapgen.catalogue.choice import constant_options, number_text, read_constants
from strapgen.catalogue.methods import tableaux
from strapgen.cli import main
from strapgen.firmware.check_code import conformance
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.program import RESOLUTION
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
        (row,) = compare(choice, backends=["numpy"], samples=d, reference="exact")
        (wanted,) = compare("euler", method, None, ["numpy"], d, reference="exact")
        assert (row.max_abs_rad, row.drift_deg) == (wanted.max_abs_rad, wanted.drift_deg)
    findings = {finding.name: finding for finding in conformance.findings(chosen["rk2"])}
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


STANDARD = catalogue.standard()
EVERY = pytest.mark.parametrize("choice", STANDARD, ids=lambda choice: choice.kernel)


def test_the_default_is_fourth_order_on_two_increments():
    assert choose("euler") == Choice("euler", "rk4", 2)
    assert choose("dcm", "rk1", 8).kernel == "dcm-rk1-8"
    assert choose("dcm-from-euler") == Choice("dcm-from-euler")
    assert choose("dcm-from-euler").kernel == "dcm-from-euler"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("quaternion",), ["algorithm 'quaternion'", "euler", "strapgen list kernels shows all"]),
        (("dcm", "rk5"), ["method 'rk5'", "rk4", "strapgen list methods shows all"]),
        (("dcm", "rk4", 0), ["increments", "0", "1 to 8"]),
        (("dcm", "rk4", MOST_INCREMENTS + 1), ["increments", "9", "1 to 8"]),
        (("dcm", "rk4", 2.5), ["increments", "2.5", "1 to 8"]),
        (("dcm", "rk4", True), ["increments", "True", "1 to 8"]),
        (("error-matrix", "rk4"), ["error-matrix", "method", "rk4", *ALGORITHMS]),
        (("error-matrix", None, 2), ["error-matrix", "increments", "2", *ALGORITHMS]),
    ],
)
def test_wrong_choice_names_allowed_values(arguments, named):
    with pytest.raises(InputError) as caught:
        choose(*arguments)
    message = str(caught.value)
    assert "\n" not in message
    assert [word for word in named if word not in message] == []


def test_orthonormalizations_of_each_algorithm():
    assert catalogue.orthonormalizations("dcm") == [
        "dcm-orthonormalize",
        "dcm-orthonormalize-optimal",
        "dcm-orthonormalize-first-order",
        "dcm-orthonormalize-second-order",
    ]
    for algorithm in ("euler", "cayley-klein"):
        normalize = f"{algorithm}-normalize"
        assert catalogue.orthonormalizations(algorithm) == [normalize, f"{normalize}-first-order"]


def test_the_standard_catalogue_holds_everything_once():
    names = [choice.kernel for choice in STANDARD]
    assert (
        len(set(names))
        == len(names)
        == len(ALGORITHMS) * len(STANDARD_METHODS) + sum(recipe.standard for recipe in KERNELS.values())
    )
    identifiers = {name.replace("-", "_") for name in names}
    assert len(identifiers) == len(names)


@pytest.mark.long
@EVERY
def test_derived_kernel_matches_the_choice(choice):
    kernel = derived(choice)
    assert kernel.name == choice.kernel
    assert kernel.identifier.isidentifier()
    assert kernel.title and kernel.source
    # What stands in a generated header must lead back to the kernel.
    name, *options = (kernel.arguments or kernel.name).split()
    given = dict(zip(options[::2], options[1::2], strict=True))
    increments = given.get("--increments")
    assert choose(name, given.get("--method"), increments and int(increments)) == choice


@EVERY
def test_a_kernel_is_exact_and_closed(choice):
    kernel = derived(choice)
    known = [name for signal in kernel.inputs for name in signal.elements]
    for stage in (*kernel.stages, *kernel.outputs):
        assert len(stage.expressions) == stage.signal.size
        for expression in stage.expressions:
            assert not expression.has(sp.Float)
            assert {symbol.name for symbol in expression.free_symbols} <= {*known, RESOLUTION}
            assert all(symbol.is_real for symbol in expression.free_symbols)
        known += stage.signal.elements
    assert len(set(known)) == len(known)  # names serve as variables in generated code


@EVERY
def test_signals_are_explained(choice):
    kernel = derived(choice)
    for signal in (*kernel.inputs, *(stage.signal for stage in kernel.outputs)):
        assert signal.meaning
        if signal.shape == (3, 3) and "direction cosine" in signal.meaning:
            assert "body to reference" in signal.meaning
        if signal.shape == (4,) and signal.name != "transition":
            assert ("scalar last" in signal.meaning) != ("scalar first" in signal.meaning)
            assert ("scalar last" in signal.meaning) == signal.elements[3].endswith("_s")


@pytest.mark.parametrize("choice", STANDARD[:12], ids=lambda choice: choice.kernel)
def test_companions_are_in_the_catalogue_and_fit(choice):
    kernel = derived(choice)
    state = kernel.inputs[0]
    attitude_step = kernel.attitude_step
    product = derived(choose(attitude_step.product))
    assert [signal.shape for signal in product.inputs] == [state.shape, state.shape]
    assert attitude_step.orthonormalize in catalogue.orthonormalizations(choice.name)
    assert len(attitude_step.identity) == state.size
    if attitude_step.attitude is not None:
        attitude = derived(choose(attitude_step.attitude))
        assert attitude.inputs[0] == state
        assert attitude.outputs[0].signal.shape == (3, 3)


def test_names_are_listed_without_computer_algebra():
    code = (
        "import sys; from strapgen import catalogue; catalogue.standard(); catalogue.choose('euler');"
        "print('sympy' in sys.modules)"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "False"


@pytest.mark.parametrize(
    "value", [0.02, "0.02", "1/50", Fraction(1, 50), Decimal("0.02"), np.float64(0.02), "2e-2"]
)
def test_a_number_is_exact_in_every_spelling(value):
    assert read_constants({"cycle": value}) == (("cycle", (Fraction(1, 50),)),)


def test_rows_follow_each_other_and_names_are_sorted():
    rows = (("a", (Fraction(7),)), ("b", tuple(map(Fraction, range(4)))))
    assert read_constants({"b": [[0, 1], [2, 3]], "a": 7}) == rows
    assert read_constants({"a": [7], "b": np.arange(4.0).reshape(2, 2)}) == rows


@pytest.mark.parametrize(
    ("constants", "error", "words"),
    [
        ({"cycle": "fast"}, InputError, "constant cycle is 'fast'; a finite number is needed"),
        ({"cycle": float("nan")}, InputError, "constant cycle is 'nan'"),
        ({"cycle": True}, InputError, "constant cycle is 'True'"),
        ({"cycle": [1, [2, None]]}, InputError, "constant cycle is 'None'"),
        ({3: 1}, InputTypeError, "constants holds 3; the name of an input is needed"),
        ([("cycle", 1)], InputTypeError, "a mapping from names of inputs is needed"),
    ],
)
def test_non_numbers_are_refused(constants, error, words):
    with pytest.raises(error) as caught:
        read_constants(constants)
    assert words in str(caught.value) and "\n" not in str(caught.value)


@given(st.fractions(max_denominator=10**9) | st.floats(-1e30, 1e30).map(lambda x: checks.number("x", x)))
def test_the_text_of_a_number_is_read_as_that_number(number):
    assert checks.number("x", number_text(number)) == number
    assert len(number_text(number)) <= max(8, len(str(number)))


def test_a_long_option_has_spaces_inside_quotes_for_lines_to_break():
    constants = read_constants({"cycle": 0.02, "rate_scale": [Fraction(10**16 // 3, 10**25)] * 9})
    short, long = shlex.split(constant_options(constants))[1::2]
    assert short == "cycle=0.02"
    assert long.startswith("rate_scale=3.333333333333333e-10, 3.3") and long.count(", ") == 8
