"""Calibration: ranks and uncertainties as printed, the variance of what is compensated, and least squares of noise."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from strapgen.ir.exceptions import InputError
from strapgen.navigation.calibration import (
    ACCELERATION,
    RATE,
    at_rest,
    calibrated,
    eight_about_each,
    error_derivatives,
    read,
)

calibrated = cache(calibrated)
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
#: sqrt(diag((a'a)^-1)) of 20 and of 24 positions, to five digits: D0, B_xx = B_xy, ...; A0, rows of M, N.
RATES = {
    20: {"D0_x": 0.22361, "B_xx": 0.40825, "B_xy": 0.40825, "B_xz": 0.35355, "B_yx": 0.40825, "B_yy": 0.26726,
         "B_yz": 0.26726, "B_zx": 0.40825, "E_xx": 1, "E_xy": 1, "E_xz": None, "E_yy": 1, "E_yz": 1},
    24: {"D0_x": 0.20412, "B_xx": 0.35355, "B_xy": 0.35355, "B_xz": 0.35355, "B_yx": 0.35355, "B_yy": 0.25,
         "B_yz": 0.25, "B_zx": 0.35355, "E_xx": 1, "E_xy": 1, "E_xz": 1, "E_yy": 0.70711, "E_yz": 0.70711},
}  # fmt: skip
ACCELERATIONS = {
    20: {"A0_x": 0.22361, "M_xx": 0.40825, "M_yy": 0.40825, "M_zz": 0.35355, "N_xx": 1, "N_xy": 0.44721,
         "N_xz": 0.5, "N_yy": 1, "N_yz": 1, "N_zz": None},
    24: {"A0_x": 0.20412, "M_xx": 0.35355, "M_yy": 0.35355, "M_zz": 0.35355, "N_xx": 1, "N_xy": 0.44721,
         "N_xz": 0.44721, "N_yy": 1, "N_yz": 0.70711, "N_zz": 1},
}  # fmt: skip


@pytest.mark.parametrize("count", [20, 24])
def test_ranks_and_deviations_are_those_of_the_source(count):
    scheme = read(EXAMPLES / f"positions-{count}.toml").scheme
    assert set(scheme.positions) == set(eight_about_each(count == 20).positions)
    for quantity, expected in (("rate", RATES[count]), ("acceleration", ACCELERATIONS[count])):
        one = calibrated(scheme, quantity)
        assert (
            one.rank
            == len(one.names) - len(one.lost)
            == {"rate": 15, "acceleration": 18}[quantity] - (count == 20)
        )
        found = one.deviations
        assert {name: found[name] and round(found[name], 5) for name in expected} == expected
    assert [row for q in ("rate", "acceleration") for row in calibrated(scheme, q).unseen] == (
        [{"E_xz": 1}, {"N_zz": 1}] if count == 20 else []
    )


def test_uncertainties_are_those_of_figure_23():
    file = read(EXAMPLES / "positions-20.toml")
    printed = {
        "rate": {"D0_x": 0.80, "B_xx": 1.46, "B_yy": 0.96, "E_xx": 3.58},
        "acceleration": {"M_xx": 1.31, "M_zz": 1.14, "N_xy": 1.44, "N_xz": 1.61, "N_xx": 3.22},
    }
    for quantity, figures in printed.items():
        deviations = calibrated(file.scheme, quantity).deviations
        for name, figure in figures.items():
            assert deviations[name] * file.sigma[quantity] == pytest.approx(figure, rel=0.02)


def test_the_derivative_of_the_kernel_is_the_variance_that_is_printed():
    columns = error_derivatives("rate")
    variances = {name: sp.Symbol(f"Var_{name}") for name in columns}
    total = sum(columns[name][1] ** 2 * variance for name, variance in variances.items())
    (wx, wy, wz), (ax, ay, az) = RATE, ACCELERATION
    # As printed but for J_yz: by Fig. 20 its rates are x and y in row y, and z and x in row z.
    terms = {"K_yx": wx, "K_yy": wy, "K_yz": wz, "B_yx": ax, "B_yy": ay, "B_yz": az, "J_yz": wx * wy,
             "E_yy": az * ax, "E_yz": ax * ay, "D0_y": 1}  # fmt: skip
    assert sp.expand(total - sum(term**2 * variances[name] for name, term in terms.items())) == 0
    # Rows y and z share coefficients, so their errors are correlated.
    shared = {
        name: sp.expand(column[1] * column[2])
        for name, column in columns.items()
        if column[1] * column[2] != 0
    }
    assert shared == {
        "B_yy": ay * az, "B_yz": -ay * az, "E_yy": -az * ax**2 * ay, "E_yz": ax**2 * ay * az, "J_yz": wx**2 * wy * wz,
    }  # fmt: skip


def test_noisy_positions_scatter_as_the_covariance_says(rng):
    one = calibrated(eight_about_each(), "rate")
    a = np.array(one.design.evalf().tolist(), float)
    truth = dict(zip(one.names, rng.normal(size=len(one.names)), strict=True))
    exact = a @ np.array(list(truth.values()))
    assert one.estimate(exact) == pytest.approx(truth)
    runs = 20_000
    errors = np.linalg.lstsq(a, rng.normal(size=(len(a), runs)), rcond=None)[0]
    found = errors @ errors.T / runs
    scale = np.sqrt(np.outer(np.diag(one.covariance), np.diag(one.covariance)))
    assert np.abs((found - one.covariance) / scale).max() < 0.03  # 4 sqrt(2/20000)
    rate, acceleration = (0.3, -0.2, 0.5), (1.0, -2.0, 3.0)
    columns = error_derivatives("rate")
    at = dict(zip((*RATE, *ACCELERATION), (*rate, *acceleration), strict=True))
    jacobian = np.array([columns[name].subs(at).T.tolist()[0] for name in at_rest("rate")], float)
    assert one.error_covariance(rate, acceleration) == pytest.approx(jacobian.T @ one.covariance @ jacobian)


def test_combinations_that_leave_no_trace_are_exact(tmp_path):
    path = tmp_path / "few.toml"
    path.write_text(
        'positions = [[0, 0, 1], ["sqrt(2)/2", 0, "sqrt(2)/2"]]\nrate_errors_deg_h = [[1, 2, 3], [0, 0, 0]]\n'
    )
    file = read(path)
    one = calibrated(file.scheme, "rate")
    assert one.rank == 6 and len(one.unseen) == 9
    design = one.design
    for row in one.unseen:
        vector = sp.Matrix([row.get(name, 0) for name in one.names])
        assert (design * vector).applyfunc(sp.simplify) == sp.zeros(6, 1)
    with pytest.raises(InputError, match="the scheme cannot see D0_x"):
        one.estimate(file.errors["rate"])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "positions is missing; a list of"),
        ("positions = [[0, 1]]", r"positions\[1\] has 2 entries; 3 are needed"),
        ("positions = [[0, 0, 2]]", r"positions\[1\] has the length 2; 1 is needed"),
        ('positions = [[0, 0, "up"]]', r"positions\[1\]\[3\] is 'up'"),
        ("positions = [[0, 0, 1]]\nsigma = 3", "key 'sigma' is not known"),
        ("positions = [[0, 0, 1]]\nrate_sigma_deg_h = 0", "rate_sigma_deg_h is 0"),
        (
            "positions = [[0, 0, 1]]\nrate_errors_deg_h = [[1, 2, 3], [1, 2, 3]]",
            "has 2 rows; one for each of 1",
        ),
        ("positions = [[0, 0, 1]]\nrate_errors_deg_h = [[1, 2]]", r"rate_errors_deg_h\[1\] has 2 entries"),
    ],
)
def test_a_scheme_that_cannot_be_is_refused(tmp_path, text, said):
    path = tmp_path / "scheme.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        read(path)
