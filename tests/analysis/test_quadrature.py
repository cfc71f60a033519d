"""Integrals whose values are known, and what cannot be integrated."""

from __future__ import annotations

import numpy as np
import pytest

from strapgen.analysis.vibration.spectrum import integrate
from strapgen.ir.exceptions import InputError


@pytest.mark.parametrize(
    ("function", "edges", "value"),
    [
        (lambda x: x**7, [0, 2], 32.0),
        (
            lambda x: np.exp(-x) * np.sin(40 * x),
            [0, 3],
            (40 - np.exp(-3) * (np.sin(120) + 40 * np.cos(120))) / 1601,
        ),
        (lambda x: np.abs(x - 0.3), [0, 0.3, 1], (0.09 + 0.49) / 2),
        (lambda x: 1 / (1e-6 + (x - 0.5) ** 2), [0, 1], 2000 * np.arctan(500)),
        (np.sqrt, [0, 1], 2 / 3),
        (lambda x: 0 * x, [0, 1], 0.0),
    ],
)
def test_integrals(function, edges, value):
    found = integrate(lambda x: np.array([function(x), 3 * function(x)]), edges, 0.5)
    for number, wanted in zip(found.values, (value, 3 * value), strict=True):
        assert abs(number - wanted) <= 2e-10 * abs(wanted)
    assert np.all(np.abs(found.values - [value, 3 * value]) <= found.errors + 1e-13 * abs(value))


def test_what_cannot_be_integrated_is_refused():
    with pytest.raises(InputError, match=r"not finite at 0\.5 Hz"):
        integrate(lambda x: np.where(np.abs(x - 0.5) < 1e-3, np.nan, 1.0)[None], [0, 1], 1.0)
    with pytest.raises(InputError, match="panels to integrate"):
        integrate(lambda x: 1 / (x - 0.3)[None], [0, 1], 1.0)
    with pytest.raises(InputError, match="panels to integrate"):
        integrate(lambda x: x[None], [0, 1], 1e-7)
    with pytest.raises(InputError, match="panels to integrate"):
        integrate(lambda x: x[None], [0, 1e308], 1e-7)
    with pytest.raises(InputError, match="the integral of the spectrum is beyond the range of double"):
        integrate(lambda x: 1e308 + 0 * x[None], [0, 100], 1.0)
