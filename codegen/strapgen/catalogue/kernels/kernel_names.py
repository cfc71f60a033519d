"""The kernels of the catalogue by name, as plain data: listing them imports no computer algebra."""

from __future__ import annotations

from collections.abc import Callable

from strapgen.catalogue.methods.windows import EXACT_TERMS
from strapgen.catalogue.names import ALGORITHMS
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


def _recipes(module: str) -> Callable[..., Recipe]:
    """Return a function that makes recipes from a title, a function of a module in this folder, and its arguments."""
    return lambda title, function, *arguments: Recipe(title, f"{__package__}.{module}", function, arguments)


_step, _loop, _conversion, _orthonormalization, _motion = map(
    _recipes, ("attitude_step", "two_speed_kernels", "conversions", "orthonormal", "motion_models")
)

#: Kernels of algorithms in two speeds.
_TWO_SPEED = {
    **{
        f"{algorithm}-update": _loop(f"{title}: update by a rotation vector", "update", algorithm)
        for algorithm, title in ALGORITHMS.items()
    },
    **{
        f"{algorithm}-update-{order}": _loop(
            f"{title}: update by a rotation vector, order {order}", "update", algorithm, order
        )
        for algorithm, title in ALGORITHMS.items()
        for order in UPDATE_ORDERS
    },
    **{
        f"{algorithm}-navigation-update{suffix}": _loop(
            f"{title}: update by the rotation of the navigation frame{words}",
            "navigation_update",
            algorithm,
            order,
        )
        for algorithm, title in ALGORITHMS.items()
        for order, suffix, words in ((1, "-1", ", order 1"), (2, "-2", ", order 2"), (None, "", ""))
    },
    "navigation-rotation": _loop("rotation of the navigation frame, trapezoidal", "navigation_rotation"),
    "coning-fast": _loop("rotation vector by recursion: fast loop", "coning"),
    "coning-slow": _loop("rotation vector by recursion: slow loop", "rotation_vector"),
    **{
        f"sculling-fast-{form}": _loop(f"sculling integral S{form} by recursion: fast loop", "sculling", form)
        for form in (1, 2)
    },
    **{
        f"{name}-{what}": _loop(title, function, name, *more)
        for name in ("dcm", "euler")
        for what, title, function, *more in (
            ("acceleration", "acceleration transformation", "transformation"),
            ("velocity-1", "velocity increment in navigation axes with S1", "velocity", 1),
            ("velocity-2", "velocity increment in navigation axes with S2", "velocity", 2),
        )
    },
    "navigation-velocity": _loop(
        "velocity correction for the rotation of the navigation frame", "navigation_velocity"
    ),
    "dcm-rows-orthogonalize": _orthonormalization(
        "rows made orthogonal, to first order", "rows_orthogonalized"
    ),
    "dcm-rows-normalize": _orthonormalization("rows made of length 1, to first order", "rows_normalized"),
    "dcm-third-row": _orthonormalization("third row from the first two", "third_row"),
    **{
        f"{name}-normalize-first-order": _orthonormalization(
            "normalization to first order", "normalized_first_order", name
        )
        for name in ("euler", "cayley-klein")
    },
    "euler-from-dcm-sheppard": _conversion(
        "conversion: the largest parameter keeps its sign", "euler_from_dcm_followed", "element"
    ),
    "euler-from-dcm-continuous": _conversion(
        "conversion: the nearer sign to the call before", "euler_from_dcm_followed", "product"
    ),
    "dcm-from-euler-angles": _conversion(
        "conversion: direction cosine matrix from Euler angles", "dcm_from_euler_angles"
    ),
    "euler-angles-from-dcm": _conversion(
        "conversion: Euler angles from direction cosine matrix", "euler_angles_from_dcm"
    ),
}

TWO_SPEED = {
    name: recipe._replace(standard=name in _STANDARD_TWO_SPEED) for name, recipe in _TWO_SPEED.items()
}

#: Kernels that take no method.
KERNELS = {
    **{
        f"{algorithm}-product": _step(f"{title}: state after a transition", "product", algorithm)
        for algorithm, title in ALGORITHMS.items()
    },
    **{
        f"{name}-legendre-{exact}{degree}": _step(
            f"{ALGORITHMS[name]}: step from the Legendre coefficients of the rate to degree {degree}"
            + (", exact rotation" if exact else ""),
            "legendre_step",
            *((name, degree, EXACT_TERMS) if exact else (name, degree)),
        )._replace(standard=False)
        for name in ("dcm", "euler")
        for exact, degrees in (("", LEGENDRE_DEGREES), ("exact-", EXACT_DEGREES))
        for degree in degrees
    },
    "dcm-orthonormalize": _orthonormalization("orthonormalization by dual rows, the thesis's scheme", "dcm"),
    "dcm-orthonormalize-optimal": _orthonormalization("the nearest rotation", "dcm_optimal"),
    "dcm-orthonormalize-first-order": _orthonormalization(
        "the nearest rotation to first order", "dcm_expansion", 1
    ),
    "dcm-orthonormalize-second-order": _orthonormalization(
        "the nearest rotation to second order", "dcm_expansion", 2
    ),
    "euler-normalize": _orthonormalization("exact normalization", "normalized", "euler"),
    "cayley-klein-normalize": _orthonormalization("exact normalization", "normalized", "cayley-klein"),
    **{
        f"{to}-from-{source}": _conversion(
            f"conversion: {ALGORITHMS[to]} from {ALGORITHMS[source]}", "converted", to, source
        )
        for to in ALGORITHMS
        for source in ALGORITHMS
        if to != source
    },
    "error-matrix": _conversion("scale, skew and drift of a computed attitude", "error_matrix"),
    **{
        f"{motion}-truth": _motion(f"rate and true attitude of the {motion} motion", "truth", motion)
        for motion in MOTIONS
    },
    **{
        f"{motion}-increments": _motion(f"exact increments of the {motion} motion", "increments", motion)
        for motion in MOTIONS
    },
    **TWO_SPEED,
}
