"""The names of the kernels of redundant sensors, as plain data."""

from __future__ import annotations

from typing import Any

from strapgen.ir.kernel_info import Recipe


def _recipe(title: str, module: str, function: str, *arguments: Any) -> Recipe:
    """Return the recipe of a kernel of this folder."""
    return Recipe(title, f"strapgen.navigation.redundancy.{module}", function, arguments, standard=False)


#: Triads of the hexad, those with the least noise first.
HEXAD_TRIADS = (
    *("012", "345", "014", "015", "023", "024", "034", "045", "123", "125"),
    *("135", "145", "234", "235", "013", "025", "035", "124", "134", "245"),
)

#: Kernels of six sensors on a cone, of a moment arm and of a boresight; they take no method.
REDUNDANCY = {
    "parity-hexad": _recipe("parity equations of six sensors", "parity_equations", "parity"),
    "parity-rest-hexad": _recipe("parity of six sensors without bias", "parity_equations", "parity_rest"),
    "select-hexad": _recipe("failed sensor and triad of six sensors", "failure_selection", "select"),
    "all-hexad": _recipe("vector of six sensors, least squares", "parity_equations", "all_sensors"),
    **{
        f"triad-hexad-{name}": _recipe(
            f"vector of sensors {', '.join(name)}", "parity_equations", "triad", number
        )
        for number, name in enumerate(HEXAD_TRIADS)
    },
    "moment-arm": _recipe("velocity increment at a moment arm", "lever_arm", "moment_arm"),
    "boresight": _recipe("mean relative attitude of two units", "lever_arm", "boresight"),
}
