"""The names of the kernels of whole loops in two speeds, as plain data."""

from __future__ import annotations

from strapgen.ir.kernel_info import Recipe

_MODULE = "strapgen.navigation.two_speed.two_speed_loops"

#: Kernels of whole loops in two speeds.
TWO_SPEED_LOOPS = {
    **{
        f"two-speed-fast-{form}": Recipe(
            f"two speeds: fast loop with S{form}", _MODULE, "fast", (form,), False
        )
        for form in (1, 2)
    },
    **{
        f"{name}-two-speed-slow-{form}": Recipe(
            f"two speeds: slow loop with S{form}", _MODULE, "slow", (name, form), False
        )
        for name in ("dcm", "euler")
        for form in (1, 2)
    },
    **{
        f"{name}-two-speed-navigation": Recipe(
            "two speeds: navigation loop", _MODULE, "navigation", (name,), False
        )
        for name in ("dcm", "euler")
    },
}
