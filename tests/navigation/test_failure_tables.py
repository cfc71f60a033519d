"""The tables of detection and selection: what a scan of parity space tells, beside the rule of the kernel."""

from __future__ import annotations

import numpy as np
import pytest

import strapgen
from strapgen.ir.exceptions import InputError
from strapgen.navigation.redundancy.geometry import HEXAD
from strapgen.navigation.redundancy.geometry_report import (
    _different,
    failure_table,
    failure_tables,
)


@pytest.mark.long
def test_the_kernel_and_the_table_agree_wherever_the_kernel_isolates():
    """A status becomes a parity of twice the trip level in the equations that fail, and none in the others."""
    select = strapgen.evaluator("select-hexad")
    for removed in ((), (4,)):
        table = failure_table(HEXAD, removed)
        statuses = np.zeros((len(table.verdicts), 15))
        statuses[:, list(table.equations)] = list(table.verdicts)
        excluded = np.zeros_like(statuses[:, :6])
        excluded[:, list(removed)] = 1
        detected, failed, _ = select(0.002 * statuses, np.full_like(statuses, 0.001), excluded)
        np.testing.assert_array_equal(detected, statuses.any(axis=1))
        isolated = failed.any(axis=1)
        assert {*failed[isolated].argmax(axis=1)} == {*range(6)} - {*removed}
        verdicts = list(table.verdicts.values())
        assert [verdicts[k].failed for k in np.flatnonzero(isolated)] == [*failed[isolated].argmax(axis=1)]


@pytest.mark.long
def test_every_failure_along_its_direction_is_declared_and_not_selected():
    vectors = np.array(HEXAD.equations, float)
    lengths = np.linalg.norm(vectors, axis=1)
    for table in failure_tables(HEXAD):
        valid = {*range(6)} - {*table.removed}
        for sensor in valid:
            status = tuple(
                bool(x)
                for x in np.abs(vectors[list(table.equations), sensor]) * 6 >= lengths[list(table.equations)]
            )
            verdict = table.verdicts[status]
            members = {*HEXAD.triads[verdict.triad].sensors}
            assert members <= valid
            if len(table.removed) < 2:
                assert verdict.failed == sensor and sensor not in members
            else:
                assert verdict.failed is None and any(status)
        still = table.verdicts[(False,) * len(table.equations)]
        assert still.failed is None


def test_without_equations_there_is_no_table():
    with pytest.raises(InputError, match="no parity equation is left"):
        failure_table(HEXAD, (0, 1, 2))


def test_statuses_are_told_apart_in_their_order(rng):
    """As rows of booleans are, of any number of equations."""
    for equations in (1, 8, 15, 20):
        fails = rng.random((equations, 3000)) < 0.2
        fails[-2:] = rng.random((min(equations, 2), 3000)) < 0.9
        statuses, place = _different(fails)
        expected, inverse = np.unique(fails.T, axis=0, return_inverse=True)
        np.testing.assert_array_equal(statuses, expected)
        np.testing.assert_array_equal(place, inverse.reshape(-1))
