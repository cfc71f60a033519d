"""Algorithms of users: loaded from files and entry points, refused in one line, run like those of the catalogue."""

from __future__ import annotations

import shlex
import subprocess
import sys
from fractions import Fraction
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from peano_baker import evaluated, generic_rate, increments, local_error, true_rotation

import strapgen
from strapgen import catalogue
from strapgen.catalogue.methods import tableaux
from strapgen.catalogue.methods.tableaux import TABLEAUX
from strapgen.catalogue.user import loading
from strapgen.cli import main
from strapgen.ir.exceptions import InputError, InputTypeError

FOLDER = Path(__file__).resolve().parents[2] / "data" / "algorithms"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with the algorithms of this test, in which the commands run."""
    for path in FOLDER.glob("*.py"):
        (tmp_path / path.name).write_text(path.read_text())
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the commands run in the folder of the algorithms itself: their kernels are derived once for all tests."""
    monkeypatch.chdir(FOLDER)


@pytest.fixture
def strapgen_says(capsys: pytest.CaptureFixture[str]):
    """Run a command line and return what it prints; it must succeed and be quiet."""

    def run(command: str) -> str:
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(command))
        said = capsys.readouterr()
        assert (stop.value.code, said.err) == (0, "")
        return said.out

    return run


# Loading


def test_a_file_is_an_algorithm(folder):
    kernel = strapgen.derive("mrp.py")
    assert kernel.name == "mrp-rk4-2"
    assert [made.name for made in kernel.bundled_kernels] == ["dcm-from-mrp"]
    assert kernel.arguments == "mrp.py"


@pytest.mark.long
@pytest.mark.parametrize(
    ("chosen", "name", "arguments"),
    [
        ({"method": "rk2"}, "mrp-rk2-2", "mrp.py --method rk2"),
        ({"increments": 3}, "mrp-rk4-3", "mrp.py --increments 3"),
        ({"increments": 1, "previous": 2}, "mrp-rk4-1-previous2", "mrp.py --increments 1 --previous 2"),
        pytest.param(
            {"method": "butcher6", "increments": 4, "previous": 1},
            "mrp-butcher6-4-previous1",
            "mrp.py --method butcher6 --increments 4 --previous 1",
            marks=pytest.mark.long,
        ),
        ({"method": TABLEAUX["rk3"]}, "mrp-rk3-2", "mrp.py --method rk3"),
    ],
)
def test_options_reach_the_algorithm_and_the_command_in_its_code(here, chosen, name, arguments):
    kernel = strapgen.derive("mrp.py", **chosen)
    assert (kernel.name, kernel.arguments) == (name, arguments)
    choice = catalogue.choose("mrp.py", **chosen)
    assert choice.increments == chosen.get("increments", 2)
    assert choice.previous == chosen.get("previous", 0)
    backend = strapgen.backend("mrp.py", **chosen)
    assert (backend.increments, backend.previous) == (
        choice.increments,
        choice.previous,
    )


def test_a_path_with_blanks_is_quoted_in_the_command(folder):
    (folder / "my files").mkdir()
    (folder / "mrp.py").rename(folder / "my files" / "mrp.py")
    assert strapgen.derive("my files/mrp.py", increments=1).arguments == "'my files/mrp.py' --increments 1"


def test_a_tableau_of_a_file_reaches_the_algorithm(folder):
    text = (Path(catalogue.__file__).parent / "methods" / "butcher_tableaux" / "ralston3.toml").read_text()
    (folder / "mine.toml").write_text(text.replace('name = "', 'name = "My '))
    tableau = tableaux.read("mine.toml")
    kernel = strapgen.derive("mrp.py", tableau)
    assert kernel.name == f"mrp-{tableau.name}-2"
    assert kernel.arguments == "mrp.py --tableau mine.toml"


def test_an_entry_point_is_an_algorithm(folder, monkeypatch):
    monkeypatch.syspath_prepend(folder)
    point = EntryPoint("rodrigues", "mrp:algorithm", loading.GROUP)
    monkeypatch.setattr(loading, "entry_points", lambda group: [point] if group == loading.GROUP else [])
    kernel = strapgen.derive("rodrigues", "rk3", 1)
    assert (kernel.name, kernel.arguments) == ("mrp-rk3-1", "rodrigues --method rk3 --increments 1")
    with pytest.raises(InputError, match="allowed: dcm, euler, cayley-klein, rodrigues, "):
        strapgen.derive("rodriguez")


def test_an_entry_point_that_cannot_be_loaded(monkeypatch):
    point = EntryPoint("lost", "no_such_module:algorithm", loading.GROUP)
    monkeypatch.setattr(loading, "entry_points", lambda group: [point])
    with pytest.raises(InputError, match=r"^lost(, line \d+)?: ModuleNotFoundError: No module named"):
        strapgen.derive("lost")


def test_names_of_the_catalogue_are_not_hidden_by_entry_points(monkeypatch):
    point = EntryPoint("euler", "no_such_module:algorithm", loading.GROUP)
    monkeypatch.setattr(loading, "entry_points", lambda group: [point])
    assert strapgen.derive("euler").name == "euler-rk4-2"


@pytest.mark.long
def test_changed_file_is_derived_anew(folder):
    assert strapgen.backend("picard.py").propagate(np.full((1, 2, 3), 0.1))[-1][3] < 1
    text = (folder / "picard.py").read_text()
    (folder / "picard.py").write_text(text.replace("1 - square / 2]", "1]"))
    # The same name with other formulas: neither the memory nor the cache gives the old code.
    assert strapgen.backend("picard.py").propagate(np.full((1, 2, 3), 0.1))[-1][3] == 1


# Refusals

#: A step that is right; the entries of `WRONG` change one thing.
STEP = """
from fractions import Fraction
import sympy as sp
from strapgen.ir.kernel_info import AttitudeStep
from strapgen.kernel.kernel import Kernel, KernelBuilder, Stage
from strapgen.ir.signals import Signal

def algorithm():
    build = KernelBuilder()
    state = build.input(Signal.matrix("state", "C"))
    d = build.input(Signal("increments", (1, 3), ("d_x", "d_y", "d_z"), unit="rad"))
    twice = build.stage(Signal.vector("twice", "v", meaning="twice the increment"), 2 * d)
    build.output(Signal.matrix("next", "next"), state * (1 + twice[0]))
    return build.kernel("mine", "Mine", "this test", attitude_step=AttitudeStep(None, None, None, (Fraction(0),) * 9))
"""
FROM_INCREMENTS = STEP[STEP.index('Signal("increments"') :]

WRONG = {
    "algorithm 1": (
        "def algorithm():",
        "def other():",
        "defines no function algorithm; one that returns a Kernel",
    ),
    "a name that is taken": (
        '("d_x", "d_y", "d_z")',
        '("resolution", "d_y", "d_z")',
        "resolution stands for the resolution of a target; another name is needed",
    ),
    "no function": ("def algorithm():", "algorithm = 3\n\ndef other():", "algorithm is no function"),
    "raises": (
        "    build = K",
        "    1 / 0\n    build = K",
        "mine.py, line 9: ZeroDivisionError: division by zero",
    ),
    "raises long": (
        "    build = K",
        "    raise ValueError('one' + chr(10) + 'two')\n    build = K",
        "mine.py, line 9: ValueError: one two",
    ),
    "import": (
        "import sympy",
        "import no_such_thing, sympy",
        "mine.py, line 3: ModuleNotFoundError: No module named",
    ),
    "syntax": ("def algorithm():", "def algorithm(:", "mine.py, line 8: SyntaxError: "),
    "needs more": ("def algorithm():", "def algorithm(speed):", "TypeError: algorithm() missing 1 required"),
    "returns": (
        "return build.kernel(",
        "return 3, build.kernel(",
        "algorithm() returned tuple; a Kernel is needed",
    ),
    "no attitude step": (
        ", attitude_step=AttitudeStep",
        "); (AttitudeStep",
        "kernel mine: it has no attitude_step",
    ),
    "name": ('kernel("mine"', 'kernel("My step"', "kernel 'My step' has no name for generated code"),
    "empty name": ('kernel("mine"', 'kernel(""', "kernel '' has no name for generated code"),
    "taken name": ('kernel("mine"', 'kernel("euler-product"', "kernel euler-product is in the catalogue"),
    "title": ('"Mine"', '"Mine */"', "its title holds */, which has a meaning in generated code"),
    "source": ('"this test"', '\'"""\'', 'its source holds """'),
    "meaning": ("twice the increment", "twice\\nthe", "its meaning of twice is no text of one line"),
    "element": ('"d_x"', '"d x"', "'d x' is no name for generated code"),
    "signal": ('"twice"', '"2"', "'2' is no name for generated code"),
    "unknown": ("(1 + twice[0])", "(1 + sp.Symbol('w'))", "next_11 uses w, not defined before it"),
    "float": (
        "(1 + twice[0])",
        "(1 + 0.45 * twice[0])",
        "next_11 holds the inexact number 0.45, which cannot",
    ),
    "function": ("(1 + twice[0])", "(1 + sp.tan(twice[0]))", "next_11 holds tan, which cannot be generated"),
    "power": ("(1 + twice[0])", "(1 + twice[0]) ** sp.Rational(1, 3)", "next_11 holds a power 1/3"),
    "imaginary": ("(1 + twice[0])", "(1 + sp.sqrt(-2))", "holds 1 + sqrt(2)*I"),
    "huge": ("(1 + twice[0])", "10**400", "which cannot be generated; allowed: exact numbers"),
    "no default": (
        "(1 + twice[0])",
        "sp.Piecewise((1, twice[0] > 0), evaluate=False)",
        "a Piecewise without a last case that is always true",
    ),
    "condition": (
        "(1 + twice[0])",
        "sp.Piecewise((1, sp.Eq(twice[0], 0)), (2, True))",
        "holds the condition Eq(v_x, 0)",
    ),
    "twice": ('"twice", "v"', '"twice", "d"', "d_x of twice is defined twice"),
    "two arguments of one name": (
        'Signal.matrix("next", "next")',
        'Signal.matrix("state", "next")',
        "two of its arguments are called state; each needs a name of its own",
    ),
    "a function of another": (
        'kernel("mine"',
        'kernel("euler-product-float-array"',
        "kernel euler-product-float-array: euler-product has a function of this name; another name is needed",
    ),
    "of ours": (
        'kernel("mine"',
        'kernel("euler-rk4-2"',
        "kernel euler-rk4-2 is in the catalogue, or looks like",
    ),
    "letters": ('kernel("mine"', 'kernel("naïve"', "kernel 'naïve' has no name for generated code"),
    "identity of text": (
        "(Fraction(0),) * 9",
        "('a',) * 9",
        "identity holds 'a'; whole numbers or fractions",
    ),
    "wrong attitude": (
        "(None, None, None,",
        '(None, None, "euler-normalize",',
        "its attitude euler-normalize must",
    ),
    "wrong scheme": (
        "(None, None, None,",
        '(None, "euler-normalize", None,',
        "its orthonormalize euler-normalize",
    ),
    "exit": ("    build = K", "    raise SystemExit(0)\n    build = K", "ends the program with sys.exit"),
    "too few": (
        "return build.kernel",
        "build.outputs[0] = Stage(build.outputs[0].signal, (sp.S.One,)); return build.kernel",
        "next has 1 expressions for 9 elements",
    ),
    "inputs": (
        'Signal("increments"',
        'Signal("samples"',
        "takes state, samples; state and increments (K, 3)",
    ),
    "no increments": (
        '(1, 3), ("d_x"',
        '(3,), ("d_x"',
        "takes state, increments; state and increments (K, 3)",
    ),
    "nodes of increments": (
        ",) * 9)",
        ",) * 9, nodes=(0,))",
        "takes increments and has nodes; nodes go with node_rotations",
    ),
    "no nodes": (
        'Signal("increments"',
        'Signal("node_rotations"',
        "its attitude_step needs as many different nodes",
    ),
    "a decimal node": (
        FROM_INCREMENTS,
        FROM_INCREMENTS.replace('"increments"', '"node_rotations"').replace(
            ",) * 9)", ",) * 9, nodes=(0.5,))"
        ),
        "its nodes are (0.5,); whole numbers and fractions.Fraction are needed",
    ),
    "output": (
        'Signal.matrix("next", "next"), state * (1 + twice[0])',
        'Signal.vector("next", "next"), twice',
        "one output of the shape of the state, (3, 3), is needed",
    ),
    "identity": ("(Fraction(0),) * 9", "(Fraction(0),) * 4", "identity has 4 elements, the state 9"),
    "previous": (",) * 9)", ",) * 9, 1)", "1 of its 1 increments are previous ones"),
    "a number for an order": (",) * 9))", ",) * 9), order=4)", "its order is 4; strapgen.Order is needed"),
    "a text for a truth value": (
        ",) * 9)",
        ",) * 9, 0, 'x')",
        "isometry 'x' is no truth value",
    ),
    "no companions": (
        "attitude_step=AttitudeStep(",
        "attitude_step=dict(x=1) or AttitudeStep(",
        "strapgen.AttitudeStep is needed",
    ),
    "product": (
        "AttitudeStep(None,",
        'AttitudeStep("dcm-product",',
        "a product and a transition go together",
    ),
    "companion": (
        "(None, None, None,",
        '(None, "mend", None,',
        "its orthonormalize 'mend' is neither in the catalogue",
    ),
    "attitude": (
        "(None, None, None,",
        '(None, None, "dcm-from-mine",',
        "its attitude 'dcm-from-mine' is neither",
    ),
    "no attitude": (
        'state = build.input(Signal.matrix("state", "C"))',
        'state = sp.Matrix(3, 3, [*build.input(Signal("state", (9,), tuple("abcdefghi")))])',
        "one output of the shape of the state, (9,), is needed",
    ),
}


def test_old_name_of_node_rotations_warns(tmp_path):
    text = (Path(__file__).parents[3] / "examples" / "rates_at_nodes.py").read_text()
    (tmp_path / "mine.py").write_text(
        text.replace(
            "node_rotations_signal(NODES)", 'replace(node_rotations_signal(NODES), name="turns")'
        ).replace("from fractions", "from dataclasses import replace\nfrom fractions")
    )
    with pytest.warns(DeprecationWarning, match="input turns of kernel .* is now node_rotations"):
        kernel = strapgen.derive(str(tmp_path / "mine.py"))
    assert kernel.inputs[1].name == "turns" and kernel.attitude_step.nodes


def test_the_step_of_the_refusals_is_right(tmp_path):
    (tmp_path / "mine.py").write_text(STEP)
    assert strapgen.derive(str(tmp_path / "mine.py")).name == "mine"


@pytest.mark.long
@pytest.mark.parametrize("case", WRONG)
def test_invalid_input_is_refused_in_one_line(case, tmp_path, monkeypatch, capsys):
    old, new, said = WRONG[case]
    assert STEP.count(old) == 1
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(STEP.replace(old, new))
    with pytest.raises(SystemExit) as stop:
        main(["generate", "mine.py"])
    found = capsys.readouterr()
    assert (stop.value.code, found.out) == (2, "")
    assert found.err.startswith("strapgen: mine.py") and found.err.count("\n") == 1
    assert said in found.err
    assert {path.name for path in tmp_path.iterdir()} - {"__pycache__"} == {"mine.py"}


def test_an_attitude_kernel_must_turn_the_state_into_a_matrix(folder):
    text = (folder / "mrp.py").read_text()
    assert text.count("Signal.matrix(") == 1
    (folder / "mrp.py").write_text(
        text.replace('Signal.matrix("attitude", "C"', 'Signal.labelled("attitude", "C", "123456789"')
    )
    with pytest.raises(InputError, match=r"its attitude dcm-from-mrp must turn \(3,\) into \(3, 3\)$"):
        strapgen.derive("mrp.py")
    (folder / "mrp.py").write_text(text.replace('None, None, "dcm-from-mrp"', "None, None, None"))
    with pytest.raises(InputError, match=r"attitude is None, but the state is no matrix \(3, 3\)$"):
        strapgen.derive("mrp.py")


@pytest.mark.parametrize(
    ("file", "chosen", "said"),
    [
        ("none.py", {}, "algorithm none.py is no file; a Python file with a function algorithm is needed"),
        (
            "picard.py",
            {"increments": 2},
            r"picard.py: its algorithm\(\) takes no increments; it takes no options",
        ),
        ("picard.py", {"method": "rk2"}, r"picard.py: its algorithm\(\) takes no method"),
        ("picard.py", {"previous": 1}, r"picard.py: its algorithm\(\) takes no previous"),
        ("mrp.py", {"method": "magnus4"}, "method 'magnus4' has no tableau; these have: rk1, "),
        ("mrp.py", {"increments": 9}, "increments is 9; a whole number from 1 to 8"),
        ("mrp.py", {"previous": 33}, "previous is 33; a whole number from 0 to 32"),
        ("mrp.py", {"rates": True}, "mrp.py: rates at nodes go with methods of the catalogue"),
    ],
)
def test_options_that_an_algorithm_does_not_take(here, file, chosen, said):
    with pytest.raises(InputError, match=said):
        strapgen.derive(file, **chosen)


def test_some_options_are_listed_where_one_is_refused(folder):
    text = (folder / "mrp.py").read_text().replace(", previous=0):", "):\n    previous = 0")
    (folder / "mrp.py").write_text(text)
    with pytest.raises(InputError, match=r"takes no previous; it takes method, increments$"):
        strapgen.derive("mrp.py", previous=1)


# Running


def test_a_step_with_the_companions_of_the_catalogue_has_its_order(here):
    # The rotation vector is right to fourth order and its cosine and sine to third.
    assert local_error(strapgen.derive("picard.py"), generic_rate(3), 5) == 4


@pytest.mark.long
@pytest.mark.parametrize("method", ["rk2", "rk4"])
def test_a_step_with_a_state_of_its_own_has_the_order_of_its_tableau(here, method):
    kernel = strapgen.derive("mrp.py", method, 3)
    top = int(method[2:]) + 1
    state, samples = kernel.inputs
    rate = generic_rate(2)
    values = dict(zip(samples.elements, increments(rate, 3, 0, top), strict=True))
    zero = next(iter(values.values())) * 0
    found = evaluated(kernel, values | dict.fromkeys(state.elements, zero), "next")
    # With s = e/(1 + e_s): s (1 + e_s) = e, e the true Euler parameters.
    *vector, scalar = true_rotation("euler", rate, top)
    errors = [s * (scalar + 1) - e for s, e in zip(found, vector, strict=True)]
    assert min(e.lowest for e in errors if e.lowest is not None) == top


def test_back_ends_agree_on_a_step_that_is_not_linear_in_its_state(here, rng):
    d = rng.normal(scale=0.01, size=(2, 60, 2, 3))
    by = {name: strapgen.backend("mrp.py", backend=name) for name in ("numpy", "c")}
    histories = {name: backend.propagate(d, record_every=3) for name, backend in by.items()}
    # 60 steps, each off by less than 16 units of round-off of a state below 1.
    np.testing.assert_allclose(histories["c"], histories["numpy"], rtol=0, atol=60 * 16 * 2.0**-53)
    state = by["c"].identity
    for step in d[0]:
        state = by["c"].step(state, step)
    np.testing.assert_array_equal(by["c"].propagate(d[0])[-1], state)
    with pytest.raises(InputError, match="has nothing to orthonormalize its state with"):
        by["c"].propagate(d[0], orthonormalize_every=5)


def test_attitudes_of_a_state_of_its_own_are_those_of_euler_parameters(here):
    run = strapgen.simulate(
        strapgen.backend("mrp.py", increments=1, previous=2),
        strapgen.motion("coning", a_deg_s=5, b_deg_s=20, g_deg_s=7),
        Fraction(1, 50),
        4,
    )
    assert np.abs(run.drift).max() < 1e-6
    assert np.abs(run.error).max() < 1e-7


def test_generated_code_says_how_to_make_it_again_and_compiles(strapgen_says, folder):
    command = "generate mrp.py --method rk3 --increments 3 --previous 1 --target c"
    strapgen_says(f"{command} --out out")
    header = (folder / "out" / "mrp_rk3_3_previous1.h").read_text()
    assert f"Generated by: strapgen {command}\n" in header
    made = {path.name: path.read_text() for path in (folder / "out").iterdir()}
    strapgen_says(f"{command} --out again")
    assert {path.name: path.read_text() for path in (folder / "again").iterdir()} == made
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-c"]
    done = subprocess.run(
        ["cc", *flags, "out/mrp_rk3_3_previous1.c", "-o", "mrp.o"], capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_a_program_is_the_same_polynomial_as_a_user_s_kernel(here):
    kernel = strapgen.derive("mrp.py", "rk2", 1)
    names = [name for signal in kernel.inputs for name in signal.elements]
    ring, *generators = sp.ring(names, sp.QQ)
    result = strapgen.lower(kernel).run(dict(zip(names, generators, strict=True)))
    assert [ring(element) for element in result["next"]] == kernel.polynomials()["next"]


def test_neighbour_modules_import_and_their_prints_are_no_output(tmp_path, capsys):
    (tmp_path / "coefficients.py").write_text("FACTOR = 2\n")
    text = STEP.replace(
        "import sympy as sp", "import sympy as sp\nfrom coefficients import FACTOR\nprint('hello')"
    )
    (tmp_path / "beside.py").write_text(text.replace("2 * d)", "FACTOR * d)"))
    before = list(sys.path)
    assert strapgen.derive(tmp_path / "beside.py").name == "mine"
    assert sys.path == before
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "hello\n")


def test_a_name_that_is_none():
    with pytest.raises(InputTypeError, match="derive takes a name or a path or a Choice, not None"):
        strapgen.derive(None)


TEMPLATE = """from strapgen import EULER, AttitudeStep, KernelBuilder, Order, Signal, algebra, increments_signal
import sympy as sp


def algorithm():
    build = KernelBuilder()
    state = build.input(EULER.state)
    increments = build.input(increments_signal(1, previous={said}))
    last, now = (increments[k, :].T for k in range(2)) if {said} else (increments[0, :].T, increments[0, :].T)
    phi = build.stage(
        Signal.vector("phi", "phi", unit="rad", meaning="rotation vector"),
        now + sp.Rational(1, 12) * algebra.cross(last, now),
    )
    p = build.stage(EULER.transition, algebra.quaternion(phi))
    build.output(EULER.next, algebra.quaternion_product(state, p))
    return build.kernel(
        "one-and-one", "Coning from the increment before", "none", transition=EULER.transition.name,
        attitude_step=AttitudeStep("euler-product", "euler-normalize", "dcm-from-euler", (0, 0, 0, 1){step}),
        order=Order(4, 4, 2, 4){declared},
    )
"""


def drift(tmp_path, **texts: object) -> float:
    path = tmp_path / "own.py"
    path.write_text(TEMPLATE.format(**({"said": 1, "step": "", "declared": ""} | texts)))
    run = strapgen.algorithm(str(path)).simulate(duration=2)
    return float(abs(run.drift).max())


def test_previous_increments_that_are_declared_are_taken(tmp_path):
    declared = drift(tmp_path, declared=", previous=1")
    assert declared == drift(tmp_path, step=", previous=1") < 1e-6


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        ({}, "its increments say, the first 1 are those before the step, and it declares previous=0"),
        (
            {"declared": ", previous=1", "step": ", previous=2"},
            "previous is 1, and 2 in its attitude_step",
        ),
    ],
)
def test_contradicting_declaration_is_refused(texts, said, tmp_path):
    with pytest.raises(InputError, match=said):
        drift(tmp_path, **texts)
