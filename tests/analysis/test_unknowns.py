"""Kernels with unknown coefficients: series and rates are polynomials in them, and values make ordinary kernels."""

from __future__ import annotations

import json
import shlex
from fractions import Fraction
from pathlib import Path

import pytest
import sympy as sp
from commands import run

import strapgen
from strapgen.analysis import vibration
from strapgen.analysis.series.series import ErrorSeries, series
from strapgen.cli import main
from strapgen.ir.exceptions import InputError

EXAMPLE = str(Path(__file__).resolve().parents[2] / "examples" / "three_samples.py")
A, B = sp.symbols("a b", real=True)
#: R. B. Miller's coefficients of three samples, for a polynomial rate.
MILLER = {"a": Fraction(57, 80), "b": Fraction(33, 80)}

STEP = """
import sympy as sp
from strapgen import EULER, AttitudeStep, KernelBuilder, algebra, increments_signal

def algorithm():
    build = KernelBuilder()
    {unknowns}
    state = build.input(EULER.state)
    d = build.input(increments_signal(2))
    first, second = d[0, :].T, d[1, :].T
    p = build.stage(EULER.transition, algebra.quaternion({vector}))
    build.output(EULER.next, algebra.quaternion_product(state, p))
    return build.kernel(
        "two", "a step", "this test", transition=EULER.transition.name,
        attitude_step=AttitudeStep("euler-product", "euler-normalize", "dcm-from-euler", (0, 0, 0, 1)),
    )
"""


def step(folder: Path, unknowns: str, vector: str) -> str:
    path = folder / "two.py"
    path.write_text(STEP.format(unknowns=unknowns, vector=vector))
    return str(path)


def refused(command: str, capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(command))
    said = capsys.readouterr()
    assert (stop.value.code, said.out, said.err.count("\n")) == (2, "", 1)
    return said.err


@pytest.fixture(scope="module")
def general() -> ErrorSeries:
    return series(strapgen.choose(EXAMPLE), terms=3)


def test_the_series_is_a_polynomial_in_the_unknowns(general):
    assert general.unknowns == ("a", "b")
    assert general.invariant[3].drift[0, 1][()].equals(sp.Rational(1, 12) - sp.Rational(2, 27) * (A + B))


def test_values_in_the_series_are_the_series_of_the_kernel_with_these_values(general):
    known = series(strapgen.choose(EXAMPLE, constants=MILLER), terms=1)
    values = {A: sp.Rational(57, 80), B: sp.Rational(33, 80)}
    substituted = [sp.expand(x.subs(values)) for x in general.expressions("drift")]
    assert known.order == 4
    known_terms = [sp.expand(x) for x in known.expressions("drift")]
    assert any(known_terms)
    assert [sp.expand(x.coeff("h", 5)) for x in substituted] == [x.coeff("h", 5) for x in known_terms]


@pytest.mark.parametrize("motion", ["general", pytest.param("coning", marks=pytest.mark.long)])
def test_series_come_back_from_json(motion):
    original = series(strapgen.choose(EXAMPLE), motion, 1)
    back = ErrorSeries.from_dict(json.loads(json.dumps(original.as_dict())))
    assert back.unknowns == ("a", "b")
    for part in ("drift", "scale", "skew"):
        rows = original.coefficients(part)
        assert back.coefficients(part).keys() == rows.keys()
        for power, row in rows.items():
            renamed = back.coefficients(part)[power]
            assert all(sp.expand(x - y) == 0 for x, y in zip(row, renamed, strict=True))
    assert any({A, B} <= x.free_symbols for row in back.drift.values() for x in row)


def test_parameters_of_a_motion_and_unknowns_of_one_name_are_told_apart():
    drift = series(strapgen.choose(EXAMPLE), "coning", 1).drift[3]
    names = {symbol.name for x in drift for symbol in x.free_symbols}
    assert {"a", "b", "coning_a", "coning_b"} <= names


def test_json_content_is_never_executed():
    data = series(strapgen.choose(EXAMPLE), "general", 1).as_dict()
    with pytest.raises(InputError, match="are allowed"):
        ErrorSeries.from_dict(data | {"drift": ["__import__('os').getcwd()", "0", "0"]})


def test_the_drift_under_vibration_is_linear_in_the_unknowns():
    kernel = strapgen.derive(EXAMPLE)
    rate = vibration.drift(kernel)
    assert rate.unknowns == ("a", "b")
    known = vibration.drift(kernel.substitute(MILLER))
    error = rate.expression("error").subs({A: MILLER["a"], B: MILLER["b"]})
    point = {"theta_x": 0.01, "theta_y": 0.02, "phi": 1.5, "f": 3.0, "T": 0.05}

    def value(expression: sp.Expr) -> float:
        return float(expression.subs({s: point[s.name] for s in expression.free_symbols}))

    # Sums of a dozen terms of one size in double precision.
    assert value(error) == pytest.approx(value(known.expression("error")), rel=1e-9)
    assert sp.diff(rate.expression("error"), A, 2).doit() == 0 != sp.diff(rate.expression("error"), A)


def test_values_make_an_ordinary_kernel():
    kernel = strapgen.derive(EXAMPLE).substitute(MILLER)
    assert kernel.unknowns == ()
    assert strapgen.lower(kernel).operations["multiply"] > 0
    partly = strapgen.derive(EXAMPLE).substitute({"a": "9/8 - b"})
    assert partly.unknowns == ("b",)
    swapped = strapgen.derive(EXAMPLE).substitute({"a": "b", "b": "a"})
    assert swapped.substitute({"b": MILLER["a"], "a": MILLER["b"]}).stages == kernel.stages


def test_code_needs_values(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for command in (
        "generate {} --target c",
        "compare {} --motion constant --set x_deg_s=1 --step 1 --duration 1",
        "stability {}",
    ):
        assert "holds the unknowns a, b" in refused(command.format(EXAMPLE), capsys)
    assert list(tmp_path.iterdir()) == []


def test_generated_code_says_which_values_it_has(capsys, tmp_path):
    line = f"generate {EXAMPLE} --constant a=57/80 --constant b=33/80 --target c --out {tmp_path}"
    run(shlex.split(line))
    words = (tmp_path / "three_sample.h").read_text().replace("*", " ").split()
    assert "--constant a=0.7125 --constant b=0.4125" in " ".join(words)


def test_runs_take_values(capsys):
    line = f"simulate {EXAMPLE} --constant a=9/8 --constant b=0 --motion constant --set x_deg_s=9 --step 1 --duration 2"
    with pytest.raises(SystemExit) as stop:
        main([*shlex.split(line), "--format", "json"])
    said = capsys.readouterr()
    assert (stop.value.code, json.loads(said.out)["mean_drift_deg"] < 1e-12) == (0, True), said.err
    assert "--all and --constant do not go together" in refused("series --all --constant a=1", capsys)


def test_values_that_are_none_are_refused():
    kernel = strapgen.derive(EXAMPLE)
    for values, reason in (
        ({"c": 1}, "unknown 'c' is not known; allowed: a, b"),
        ({"a": 0.5}, "an exact number such as 57/80 is needed"),
        ({"a": "1/0"}, "it divides by zero"),
        ({"a": "c"}, "c is not known"),
        ({"a": sp.Symbol("c")}, "which holds c"),
    ):
        with pytest.raises(InputError, match=reason):
            kernel.substitute(values)
    with pytest.raises(InputError, match="a has 2 numbers; 1 is needed"):
        strapgen.choose(EXAMPLE, constants={"a": [1, 2]})


@pytest.mark.parametrize(
    ("unknowns", "vector", "reason"),
    [
        ("a = build.parameter('h')", "first + second", "the unknown h has a name that series use themselves"),
        ("a = build.parameter('d1_x')", "first + second", "the unknown d1_x is an element of a signal too"),
        ("a = build.parameter('a b')", "first + second", "'a b' is no name for an unknown"),
        ("a = sp.Symbol('a', real=True)", "a * first + second", "uses a, not defined before it"),
    ],
)
def test_unknowns_are_checked_with_the_kernel(unknowns, vector, reason, tmp_path):
    with pytest.raises(InputError, match=reason):
        strapgen.choose(step(tmp_path, unknowns, vector))


@pytest.mark.long
def test_an_unknown_may_divide(tmp_path):
    path = step(tmp_path, "a = build.parameter('a')", "first + second + algebra.cross(first, second) / a")
    drift = series(strapgen.choose(path), terms=1).invariant[3]
    # d1 x d2 = h^3/8 w0 x w1; the true vector has h^3/12 w0 x w1.
    assert sp.cancel(drift.drift[0, 1][()] - (sp.Rational(1, 12) - 1 / (8 * A))) == 0


def test_a_branch_that_an_unknown_decides_has_no_series(tmp_path):
    path = step(tmp_path, "a = build.parameter('a')", "(first + second) * sp.Max(a, 1)")
    with pytest.raises(InputError, match="is decided by the unknown"):
        series(strapgen.choose(path))
