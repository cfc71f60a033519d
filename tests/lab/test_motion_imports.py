"""A motion's file imports what lies beside it, as an algorithm's does."""

from __future__ import annotations

import sys
from fractions import Fraction

import pytest

from strapgen.lab.motions.users_motions import any_motion


@pytest.mark.parametrize("rate", [1, 2])
def test_motion_imports_the_module_beside_it(rate, tmp_path):
    (tmp_path / "turning.py").write_text(f"RATE = {rate}\n")
    path = tmp_path / "own.py"
    path.write_text("from turning import RATE\n\n\ndef rate_expression(t):\n    return (0, 0, RATE)\n")
    increments = any_motion(str(path), "1", {}).samples(Fraction(1, 10), 0, 1)
    assert increments[0].tolist() == pytest.approx([0, 0, 0.1 * rate])
    assert "turning" not in sys.modules and str(tmp_path) not in sys.path
