"""Back ends side by side: what is measured, and that the certified bound holds."""

from __future__ import annotations

import csv
import io
import json
import math
from itertools import pairwise

import numpy as np
import pytest

import strapgen
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.fixed_settings import Settings
from strapgen.lab import comparison
from strapgen.lab.comparison_report import ComparedKernel, ComparisonResult
from strapgen.run.backends import BACKENDS, DEFAULT_BACKENDS
from strapgen.targets.registry import BUILT_IN


@pytest.fixture
def increments(rng):
    return rng.uniform(-1, 1, (1, 1, 3)) / 100 + rng.normal(scale=2e-3, size=(60, 2, 3))


@pytest.mark.long
@pytest.mark.needs("c++", "rustc", "octave")
@pytest.mark.parametrize(
    "reference", ["exact", *(pytest.param(r, marks=pytest.mark.long) for r in ("numpy", "c-float"))]
)
@pytest.mark.parametrize("algorithm", ["euler", pytest.param("dcm", marks=pytest.mark.long)])
def test_every_back_end_against_every_kind_of_reference(algorithm, reference, increments):
    rows = comparison.compare(algorithm, "rk4", 2, list(BACKENDS), increments, reference=reference)
    assert [row.backend for row in rows] == list(BACKENDS)
    for row in rows:
        assert 0 <= row.rms_rad <= row.max_abs_rad
        assert row.ns_per_step > 0
        entry = BACKENDS[row.backend]
        assert (row.bytes is not None) == (entry.target in BUILT_IN and BUILT_IN[entry.target].compiled)
        assert (row.bound_rad is None) == (not BACKENDS[row.backend].fixed)
        angles, bounds = row.history.angles_rad, row.history.bounds_rad
        assert angles.shape == (1 + len(increments),) and angles.max() == row.max_abs_rad
        assert bounds[-1:] == (() if row.bound_rad is None else ((len(increments), row.bound_rad),))
        assert all(one < other for one, other in pairwise(bound for _, bound in bounds))
        if reference == "exact":
            assert all(angles[step] <= bound for step, bound in bounds)
        assert row.drift_deg <= math.degrees(row.max_abs_rad) * math.sqrt(3) * (1 + 1e-9)
        if row.backend == reference:
            assert row.max_abs_rad <= 1e-15 and row.max_ulp == 0
        if BACKENDS[row.backend].fixed and reference != "c-float":
            assert 0 < row.max_abs_rad <= row.bound_rad
    by_name = {row.backend: row for row in rows}
    model, in_c = by_name["fixed-model"], by_name["c-fixed32"]
    assert (model.max_abs_rad, model.bound_rad) == (in_c.max_abs_rad, in_c.bound_rad)
    if reference == "exact":
        # Doubles round at 2**-53, singles at 2**-24.
        assert by_name["c"].max_abs_rad < 1e-13 < by_name["c-float"].max_abs_rad
    if reference == "numpy":
        assert 0 < by_name["exact"].max_abs_rad < 1e-13


@pytest.mark.long
@pytest.mark.parametrize("carry", ["none", "state", "full"])
def test_the_bound_counts_the_rounding_of_increments_only_where_there_is_one(increments, carry):
    settings = Settings(largest_angle=strapgen.ir.fixed_settings.Fraction(1, 60), carry=carry)
    made = strapgen.backend("euler", backend="c-fixed32", settings=settings)

    def bound(given):
        (row,) = comparison.compare(
            "euler", "rk4", 2, ["c-fixed32"], given, reference="exact", settings=settings
        )
        assert row.max_abs_rad <= row.bound_rad
        return row.bound_rad

    assert bound(made.representable(increments)) < bound(increments)


def test_drift_is_that_from_the_truth_where_it_is_known():
    motion = strapgen.motion("constant", y_deg_s=10)
    given = motion.increments(strapgen.ir.fixed_settings.Fraction(1, 8), 80, 2)
    truth = motion.attitude(np.arange(81) / 8)
    (row,) = comparison.compare("dcm", "rk2", 2, ["numpy"], given, truth=truth)
    run = strapgen.simulate(strapgen.backend("dcm", "rk2"), motion, "0.125", 10)
    assert row.drift_deg == pytest.approx(math.degrees(run.mean_drift), rel=1e-9)
    assert row.max_abs_rad == 0


def test_increments_beyond_a_format_are_refused():
    with pytest.raises(InputError, match="dcm-rk1-2 refuses its input in step"):
        comparison.compare("dcm", "rk1", 2, ["c-fixed32"], np.full((200, 2, 3), 0.05))


@pytest.mark.parametrize(
    ("backends", "reference", "said"),
    [
        (["fortran"], "numpy", "backend 'fortran'"),
        (["c"], "truth", "reference 'truth'"),
        ([], "numpy", "no back end"),
    ],
)
def test_unknown_names_are_refused(backends, reference, said):
    with pytest.raises(InputError, match=said):
        comparison.compare("euler", "rk4", 2, backends, np.zeros((2, 2, 3)), reference=reference)


def test_the_three_forms_say_the_same(increments):
    rows = comparison.compare("euler", "rk4", 2, ["numpy", "c-fixed16"], increments)
    report = ComparisonResult([ComparedKernel("euler-rk4-2", "title", rows)], "numpy", "drift")
    data = json.loads(report.written("json"))
    keys = ["backend", "max_abs_rad", "rms_rad", "max_ulp", "bound_rad", "drift_deg", "ns_per_step", "bytes"]
    assert [list(row)[:9] for row in data] == [["schema", *keys]] * 2
    table = list(csv.DictReader(io.StringIO(report.written("csv"))))
    for plain, cells in zip(data, table, strict=True):
        for key, value in plain.items():
            if key not in ("schema", "operations"):
                assert cells[key] == ("" if value is None else str(value))
        assert cells["multiply"] == str(plain["operations"]["multiply"])
    text = report.written("text")
    assert text.splitlines()[-1].startswith("c-fixed16") and f"{rows[1].bound_rad:.3g}" in text


def test_a_choice_is_compared_like_its_name(increments):
    by_name = comparison.compare("euler", "rk2", 2, ["numpy", "c-fixed32"], increments, reference="exact")
    choice = strapgen.choose("euler", "rk2", 2)
    by_choice = comparison.compare(
        choice, backends=["numpy", "c-fixed32"], samples=increments, reference="exact"
    )
    for one, other in zip(by_name, by_choice, strict=True):
        assert one.as_dict() | {"ns_per_step": 0} == other.as_dict() | {"ns_per_step": 0}


@pytest.mark.parametrize(
    ("options", "error", "said"),
    [
        ({"samples": "turn"}, InputTypeError, "samples is 'turn'; an array of numbers is needed"),
        ({"method": "rk4"}, InputError, "method is 'rk4', but the choice of euler-rk2-2 has its own"),
        ({"increments": 2}, InputError, "increments is 2, but the choice of euler-rk2-2 has its own"),
    ],
)
def test_arguments_that_contradict_a_choice_are_refused(options, error, said):
    with pytest.raises(error, match=said):
        comparison.compare(strapgen.choose("euler", "rk2", 2), **({"samples": np.zeros((2, 2, 3))} | options))


def test_samples_and_increments_keep_their_old_names_with_a_warning(increments):
    wanted = comparison.compare("euler", "rk2", 2, ["numpy"], increments, reference="exact")
    for old in ({"samples": 2, "increments": increments}, {"increments": increments}):
        with pytest.warns(DeprecationWarning, match=r"^compare\(samples=count, increments=array\) is now"):
            (row,) = comparison.compare("euler", "rk2", backends=["numpy"], reference="exact", **old)
        assert row.max_abs_rad == wanted[0].max_abs_rad


def test_a_comparison_without_samples_takes_those_of_coning():
    (row,) = comparison.compare("euler", "rk4", 2, ["numpy"])
    motion = strapgen.motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)
    run = strapgen.simulate(strapgen.backend("euler", "rk4", 2), motion, "0.01", 10)
    assert row.drift_deg == pytest.approx(math.degrees(run.mean_drift), rel=1e-9) and row.drift_deg > 0


def test_the_back_ends_of_a_comparison_that_names_none_run_here(monkeypatch):
    choice = strapgen.choose("euler")
    assert comparison.usable_backends(choice) == DEFAULT_BACKENDS
    monkeypatch.setattr(comparison.fixedpoint, "can_lower", lambda program: False)
    assert comparison.usable_backends(choice) == ("numpy", "c", "c-float")
    monkeypatch.setenv("CC", "/nowhere/cc")
    assert comparison.usable_backends(choice) == ("numpy",)
    (row,) = comparison.compare(choice)
    assert row.backend == "numpy" and row.max_abs_rad == 0


def test_all_back_ends_take_the_counts_of_a_gyro(increments):
    settings = Settings.of(lsb="3e-6rad", state="q31")
    rows = comparison.compare(
        "euler", "rk4", 2, ["c", "c-fixed32"], increments, reference="exact", settings=settings
    )
    double, fixed = rows
    assert double.max_abs_rad < 1e-13, "the reference has the same counts"
    assert 1e-10 < fixed.max_abs_rad <= fixed.bound_rad
