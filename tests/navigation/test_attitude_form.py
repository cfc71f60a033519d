"""What the forms of the attitude cost, and what the first-order attitude in a slow cycle loses."""

import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from commands import run

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.lab.processors import PROCESSORS
from strapgen.navigation import attitude_form


def test_the_series_are_those_of_the_integral_of_the_exact_attitude():
    w, t, T = sp.symbols("w t T", positive=True)
    phi = sp.Symbol("phi", positive=True)
    # A rate about z, an acceleration along x: C a = (cos, sin, 0), and (47) has (1, w t, 0).
    lost = [sp.integrate(part, (t, 0, T)) / T for part in (1 - sp.cos(w * t), w * t - sp.sin(w * t))]
    along, across = (sp.simplify(part.subs(w, phi / T)) for part in lost)
    assert sp.simplify(along - (1 - sp.sin(phi) / phi)) == 0
    assert sp.simplify(across - (phi / 2 - (1 - sp.cos(phi)) / phi)) == 0
    for exact, series in (
        (along, attitude_form.along_series),
        (across, attitude_form.across_series),
    ):
        terms = sum(sp.Rational(c.numerator, c.denominator) * phi**power for power, c in series(5).items())
        assert sp.expand(sp.series(exact, phi, 0, 12).removeO() - terms) == 0
    # What (47) leaves out, to leading order, for any rate and acceleration: (T^3/6) w x (w x a).
    rate, a = (sp.Matrix(sp.symbols(f"{name}_x {name}_y {name}_z")) for name in "wa")
    skew = sp.Matrix(3, 3, [0, -rate[2], rate[1], rate[2], 0, -rate[0], -rate[1], rate[0], 0])
    exact = sum((skew**k * t**k / sp.factorial(k) for k in range(4)), sp.zeros(3))
    left = ((exact - sp.eye(3) - skew * t) * a).applyfunc(lambda part: sp.integrate(part, (t, 0, T)))
    leading = left.applyfunc(lambda part: sp.expand(part).coeff(T, 3))
    assert (leading - rate.cross(rate.cross(a)) / 6).expand() == sp.zeros(3, 1)


def test_numbers_of_the_error_and_a_quadrature():
    digits = [("1.665833532e-03", "4.165278e-05"), ("4.166145864e-04", "5.2079e-06")]
    for phi, (along, across) in zip((0.1, 0.05), digits, strict=True):
        one, other = attitude_form.velocity_errors(phi)
        assert f"{one:.9e}" == along
        assert f"{other:.{len(across) - 6}e}" == across
    nodes, weights = np.polynomial.legendre.leggauss(20)
    for phi in (0.05, 0.1, 0.4999, 0.5001, 2.0):
        angles = phi * (nodes + 1) / 2
        along = weights @ (1 - np.cos(angles)) / 2
        across = weights @ (angles - np.sin(angles)) / 2
        assert np.allclose(attitude_form.velocity_errors(phi), (along, across), rtol=1e-11, atol=0)
    for error in (1e-6, 1e-3):
        hz = attitude_form.slowest_rate(math.radians(70), error)
        assert math.isclose(
            math.hypot(*attitude_form.velocity_errors(math.radians(70) / hz)), error, rel_tol=1e-9
        )


def test_the_page_shows_the_operations_of_the_kernels():
    page = (Path(__file__).parents[2] / "docs" / "two-speed.md").read_text()
    page = page.partition("\n## Direction cosines or a quaternion?\n")[2]
    rows = [line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith("| ")][1:]
    assert len(rows) == len(attitude_form.PARTS)
    for part, (_, *shown) in zip(attitude_form.PARTS, rows, strict=True):
        kernels = [kernels[part] for _, kernels in attitude_form.FORMS.values()]
        counts = [
            sum(pipeline.program(Choice(kernel)).operations.values()) if kernel else 0 for kernel in kernels
        ]
        assert list(map(int, shown)) == counts, part


def study(*words: str, capsys):
    run(["study", "attitude-form", *words, "--format", "json"])
    said = capsys.readouterr()
    return json.loads(said.out)


@pytest.mark.long
def test_totals_are_those_of_the_kernels_and_close_together(tmp_path, capsys):
    image = tmp_path / "forms.png"
    answer = study(
        "--update-hz", "100", "--without", "orthonormalization", "--plot", str(image), capsys=capsys
    )
    assert image.stat().st_size > 10_000
    totals = {total["form"]: total["operations_per_s"] for total in answer["totals"]}
    rates = {"navigation": 10}
    for form, (_, kernels) in attitude_form.FORMS.items():
        counts = [
            rates.get(part, 100) * sum(pipeline.program(Choice(kernel)).operations.values())
            for part, kernel in kernels.items()
            if kernel and part != "orthonormalization"
        ]
        assert totals[form] == sum(counts)
    # What runs in every slow cycle lies within 10 %; the rare parts make direction cosines a little dearer.
    assert study("--without", "orthonormalization,navigation", capsys=capsys)["spread"] < 0.1
    assert answer["spread"] < 0.15
    alone = study("--without", "matrix,velocity,orthonormalization,navigation", capsys=capsys)["totals"]
    operations = [total["operations_per_s"] for total in alone]
    assert operations == sorted(operations, reverse=True)  # printed: the update of the quaternion is simpler
    rows = study("--without", "update,matrix,velocity,navigation", capsys=capsys)["totals"]
    dcm, two, euler, _ = (total["operations_per_s"] for total in rows)
    assert (
        euler < two < 0.55 * dcm
    )  # printed: half of the direction cosines', and still more than the quaternion's


@pytest.mark.long
def test_instructions_are_counted_on_a_processor(capsys):
    processor = PROCESSORS["cortex-m3"]
    for program in (processor.compiler, *processor.emulator[:1]):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not on this machine")
    answer = study("--cpu", "cortex-m3", "--word", "16", capsys=capsys)
    for part in answer["parts"]:
        assert (part["instructions"] > part["operations"]) == bool(part["kernel"]), part
    assert all(total["instructions_per_s"] for total in answer["totals"])


def test_invalid_input_is_refused(capsys):
    for words, reason in (
        ("--without third-row", "without"),
        ("--velocity-error 2", "velocity-error is 2"),
        ("--navigation-hz -1", "navigation-hz is -1"),
        ("--without update,matrix,velocity,orthonormalization,navigation", "at least one has to be left"),
    ):
        run(["study", "attitude-form", *words.split()], 2)
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert reason in said
