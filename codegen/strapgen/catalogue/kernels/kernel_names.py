"""The kernels of the catalogue by name, as plain data: listing them imports no computer algebra."""

from __future__ import annotations

from strapgen.catalogue.method_names import ALGORITHMS
from strapgen.catalogue.methods.windows import EXACT_TERMS
from strapgen.ir.kernel_info import Recipe

#: Motions with a closed-form attitude, and the unit of each of their parameters.
MOTIONS = {
    "constant": dict.fromkeys("xyz", "rad/s"),
    "sinusoidal": dict.fromkeys("ab", "rad/s"),
    "coning": dict.fromkeys("abg", "rad/s"),
    "polynomial": {"a0": "rad/s", **{f"a{k}": f"rad/s^{k + 1}" for k in range(1, 5)}},
}

#: Degrees of the rate for which there are steps from its Legendre coefficients: to fourth order, and exact.
LEGENDRE_DEGREES, EXACT_DEGREES = range(1, 5), range(1, 9)

#: Orders at which the series of an update can be cut off.
UPDATE_ORDERS = range(1, 21)

#: Kernels of algorithms in two speeds that are in the standard catalogue; their variants are not.
_STANDARD_TWO_SPEED = (
    *("dcm-update", "coning-fast", "sculling-fast-2", "dcm-velocity-2"),
    *("euler-from-dcm-sheppard", "dcm-from-euler-angles", "euler-angles-from-dcm"),
)

#: Kernels of algorithms in two speeds.
_TWO_SPEED = {
    **{
        f"{algorithm}-update": Recipe(
            f"{title}: update by a rotation vector", "updates", "update", (algorithm,)
        )
        for algorithm, title in ALGORITHMS.items()
    },
    **{
        f"{algorithm}-update-{order}": Recipe(
            f"{title}: update by a rotation vector, order {order}",
            "updates",
            "update",
            (algorithm, order),
        )
        for algorithm, title in ALGORITHMS.items()
        for order in UPDATE_ORDERS
    },
    **{
        f"{algorithm}-navigation-update{suffix}": Recipe(
            f"{title}: update by the rotation of the navigation frame{words}",
            "updates",
            "navigation_update",
            (algorithm, order),
        )
        for algorithm, title in ALGORITHMS.items()
        for order, suffix, words in ((1, "-1", ", order 1"), (2, "-2", ", order 2"), (None, "", ""))
    },
    "navigation-rotation": Recipe(
        "rotation of the navigation frame, trapezoidal", "updates", "navigation_rotation"
    ),
    "coning-fast": Recipe("rotation vector by recursion: fast loop", "coning_sculling", "coning"),
    "coning-slow": Recipe("rotation vector by recursion: slow loop", "coning_sculling", "rotation_vector"),
    **{
        f"sculling-fast-{form}": Recipe(
            f"sculling integral S{form} by recursion: fast loop", "coning_sculling", "sculling", (form,)
        )
        for form in (1, 2)
    },
    **{
        f"{name}-{what}": Recipe(title, "acceleration", function, (name, *more))
        for name in ("dcm", "euler")
        for what, title, function, *more in (
            ("acceleration", "acceleration transformation", "transformation"),
            ("velocity-1", "velocity increment in navigation axes with S1", "velocity", 1),
            ("velocity-2", "velocity increment in navigation axes with S2", "velocity", 2),
        )
    },
    "navigation-velocity": Recipe(
        "velocity correction for the rotation of the navigation frame", "acceleration", "navigation_velocity"
    ),
    "dcm-rows-orthogonalize": Recipe(
        "rows made orthogonal, to first order", "orthonormal", "rows_orthogonalized"
    ),
    "dcm-rows-normalize": Recipe("rows made of length 1, to first order", "orthonormal", "rows_normalized"),
    "dcm-third-row": Recipe("third row from the first two", "orthonormal", "third_row"),
    **{
        f"{name}-normalize-first-order": Recipe(
            "normalization to first order", "orthonormal", "normalized_first_order", (name,)
        )
        for name in ("euler", "cayley-klein")
    },
    "euler-from-dcm-sheppard": Recipe(
        "conversion: the largest parameter keeps its sign",
        "conversions",
        "euler_from_dcm_followed",
        ("element",),
    ),
    "euler-from-dcm-continuous": Recipe(
        "conversion: the nearer sign to the call before",
        "conversions",
        "euler_from_dcm_followed",
        ("product",),
    ),
    "dcm-from-euler-angles": Recipe(
        "conversion: direction cosine matrix from Euler angles", "euler_angles", "dcm_from_euler_angles"
    ),
    "euler-angles-from-dcm": Recipe(
        "conversion: Euler angles from direction cosine matrix", "euler_angles", "euler_angles_from_dcm"
    ),
}

TWO_SPEED = {
    name: recipe._replace(standard=name in _STANDARD_TWO_SPEED) for name, recipe in _TWO_SPEED.items()
}

#: The others, each with the module of this folder and the function that derive it.
_KERNELS = {
    **{
        f"{algorithm}-product": Recipe(
            f"{title}: state after a transition", "attitude_step", "product", (algorithm,)
        )
        for algorithm, title in ALGORITHMS.items()
    },
    **{
        f"{name}-legendre-{exact}{degree}": Recipe(
            f"{ALGORITHMS[name]}: step from the Legendre coefficients of the rate to degree {degree}"
            + (", exact rotation" if exact else ""),
            "legendre_step",
            "step",
            (name, degree, EXACT_TERMS) if exact else (name, degree),
            False,
        )
        for name in ("dcm", "euler")
        for exact, degrees in (("", LEGENDRE_DEGREES), ("exact-", EXACT_DEGREES))
        for degree in degrees
    },
    "dcm-orthonormalize": Recipe(
        "orthonormalization by dual rows, the thesis's scheme", "orthonormal", "dcm"
    ),
    "dcm-orthonormalize-optimal": Recipe("the nearest rotation", "orthonormal", "dcm_optimal"),
    "dcm-orthonormalize-first-order": Recipe(
        "the nearest rotation to first order", "orthonormal", "dcm_first_order"
    ),
    "dcm-orthonormalize-second-order": Recipe(
        "the nearest rotation to second order", "orthonormal", "dcm_second_order"
    ),
    "euler-normalize": Recipe("exact normalization", "orthonormal", "euler"),
    "cayley-klein-normalize": Recipe("exact normalization", "orthonormal", "cayley_klein"),
    **{
        f"{to}-from-{source}": Recipe(
            f"conversion: {ALGORITHMS[to]} from {ALGORITHMS[source]}",
            "conversions",
            f"{to}_from_{source}".replace("-", "_"),
        )
        for to in ALGORITHMS
        for source in ALGORITHMS
        if to != source
    },
    "error-matrix": Recipe("scale, skew and drift of a computed attitude", "error_matrix", "error_matrix"),
    **{
        f"{motion}-truth": Recipe(
            f"rate and true attitude of the {motion} motion", "motion_models", "truth", (motion,)
        )
        for motion in MOTIONS
    },
    **{
        f"{motion}-increments": Recipe(
            f"exact increments of the {motion} motion", "motion_models", "increments", (motion,)
        )
        for motion in MOTIONS
    },
    **TWO_SPEED,
}

#: Kernels that take no method.
KERNELS = {
    name: recipe._replace(module=f"{__package__}.{recipe.module}") for name, recipe in _KERNELS.items()
}
