"""The names of the kernels behind the outputs of a navigator, and of those that update two rows, as plain data."""

from __future__ import annotations

from strapgen.ir.kernel_info import Recipe

#: How a unit can be mounted, by the direction that its x axis points to.
MOUNTINGS = {"fore": "ahead", "right": "right", "aft": "aft", "left": "left"}

_MODULE = "strapgen.navigation.outputs.outputs"

#: Kernels of what a navigator shows: filtered rates, magnetic heading, track angle, axes; they take no method.
OUTPUTS = {
    "butterworth-2": Recipe("low-pass filter of second order", _MODULE, "butterworth", (), False),
    "variation": Recipe(
        "magnetic variation between four points",
        _MODULE,
        "variation",
        (),
        False,
    ),
    "magnetic-heading": Recipe(
        "heading by the magnetic variation",
        _MODULE,
        "magnetic_heading",
        (),
        False,
    ),
    "track-angle": Recipe("direction of the ground velocity", _MODULE, "track_angle", (), False),
    **{
        f"axes-{mounting}": Recipe(
            f"body axes of a unit that points {words}",
            _MODULE,
            "axes",
            (mounting,),
            False,
        )
        for mounting, words in MOUNTINGS.items()
    },
}

#: Kernels of an attitude kept as two rows of its direction cosine matrix; they take no method.
TWO_ROWS = {
    name: Recipe(title, "strapgen.navigation.frame.two_rows", function, tuple(arguments), False)
    for name, title, function, *arguments in (
        ("dcm-two-rows-update", "two rows: update by a rotation vector", "update"),
        ("dcm-two-rows-update-5", "two rows: update by a rotation vector, order 5", "update", 5),
        ("dcm-two-rows-orthonormalize", "two rows made orthonormal, to first order", "orthonormalized"),
        ("dcm-two-rows-navigation-2", "two rows: rotation of the navigation frame, order 2", "navigation", 2),
        ("dcm-from-two-rows", "conversion: direction cosine matrix from two rows", "matrix"),
    )
}
