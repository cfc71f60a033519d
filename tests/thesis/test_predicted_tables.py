"""The thesis's tables from the series alone."""

from __future__ import annotations

import pytest

from strapgen.thesis.predicted_tables import predicted, predicted_text
from strapgen.thesis.thesis_tables import TABLES


@pytest.mark.long
@pytest.mark.parametrize("table", TABLES, ids=lambda table: str(table.number))
def test_every_figure_is_predicted(table):
    """Within 0.3 % of the simulation, where 1 % and 3 % are asked for; the thesis's digits too."""
    found = list(predicted([table]))
    for entry in found:
        assert abs(entry.deviation) < 3e-3, entry
        assert abs(entry.drift_deg / entry.simulated_deg - 1) < 3e-3, entry
        assert entry.agrees, entry
    assert f"Table {table.number}" in predicted_text(found)
