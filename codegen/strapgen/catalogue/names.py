"""The catalogue's names as plain data: listing and checking them needs no computer algebra."""

from __future__ import annotations

from strapgen.catalogue.loop_names import LOOPS
from strapgen.catalogue.method_names import ALGORITHMS, VECTORS
from strapgen.catalogue.methods.windows import EXACT_TERMS
from strapgen.catalogue.navigation_names import NAVIGATION
from strapgen.catalogue.output_names import OUTPUTS, TWO_ROWS
from strapgen.catalogue.recipe import Recipe
from strapgen.catalogue.redundancy_names import REDUNDANCY
from strapgen.catalogue.sampling_names import SAMPLING

#: Largest number of angle increments in a step, and of increments beside them, from before the step and from after it.
MOST_INCREMENTS = 8
MOST_BESIDE = 32

#: From so many samples on a Taylor series has to keep every power of time of the polynomial through them.
LEAST_WHOLE = 4

#: Motions with a closed-form attitude, and the unit of each of their parameters.
MOTIONS = {
    "constant": dict.fromkeys("xyz", "rad/s"),
    "sinusoidal": dict.fromkeys("ab", "rad/s"),
    "coning": dict.fromkeys("abg", "rad/s"),
    "polynomial": {"a0": "rad/s", **{f"a{k}": f"rad/s^{k + 1}" for k in range(1, 5)}},
}

#: Motions without kernels, which only runs know, and the unit of each of their parameters.
RUN_MOTIONS = {
    "cone": {"half_angle": "rad", "frequency": "Hz", "spin": "rad/s"},
    "random": {"rate": "rad/s"},
    "slew": {"onset": "s", "rate": "rad/s"},
    "ramps": {"onset": "s", "rate": "rad/s"},
    "vibration": {"angle": "rad", "gyro": "Hz"},
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

#: Kernels of algorithms in two speeds: they take no method.
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
    **{
        f"two-speed-fast-{form}": Recipe(
            f"two speeds: fast loop with S{form}", "two_speed_loops", "fast", (form,)
        )
        for form in (1, 2)
    },
    **{
        f"{name}-two-speed-slow-{form}": Recipe(
            f"two speeds: slow loop with S{form}", "two_speed_loops", "slow", (name, form)
        )
        for name in ("dcm", "euler")
        for form in (1, 2)
    },
    **{
        f"{name}-two-speed-navigation": Recipe(
            "two speeds: navigation loop", "two_speed_loops", "navigation", (name,)
        )
        for name in ("dcm", "euler")
    },
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

#: Kernels that correct the increments of sensors, and those that make their errors; they take no method.
COMPENSATION = {
    name: Recipe(title, module, function, tuple(arguments), standard=False)
    for name, title, module, function, *arguments in (
        ("imu-compensate", "compensation of a measurement unit", "imu_errors", "imu_compensate"),
        ("imu-compensate-2", "compensation in two passes", "imu_errors", "imu_compensate", 2),
        ("imu-errors", "errors of a measurement unit", "imu_errors", "imu_errors"),
        ("pulse-compensate", "compensation of pulses by polarity", "pulses", "pulse_compensate"),
        (
            "pulse-compensate-exact",
            "compensation of pulses, exact inverse",
            "pulses",
            "pulse_compensate",
            True,
        ),
        ("pulse-errors", "pulses of a sensor with its errors", "pulses", "pulse_errors"),
        (
            "gyro-pulse-compensate",
            "compensation of the pulses of a gyro",
            "pulses",
            "pulse_compensate",
            False,
            "gyro",
        ),
        ("gyro-pulse-errors", "pulses of a gyro with its errors", "pulses", "pulse_errors", "gyro"),
        ("temperature-coefficient", "coefficient by two slopes", "pulses", "temperature_coefficient"),
        ("scale-factor-heating", "scale factor by torquer heat", "torquer_heating", "scale_factor_heating"),
        ("torquer-heating-errors", "errors by torquer heat", "torquer_heating", "scale_factor_heating", True),
        ("separate-canonical", "rate and acceleration from torques", "separation", "separate", "canonical"),
        ("separate-45", "separation, torquers at 45 degrees", "separation", "separate", "45"),
        ("torques-canonical", "torques of mass-unbalanced gyros", "separation", "measure", "canonical"),
        ("torques-45", "torques, torquers at 45 degrees", "separation", "measure", "45"),
    )
}

#: Kernels that take no method.
KERNELS = {
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
    **SAMPLING,
    **TWO_SPEED,
    **COMPENSATION,
    **NAVIGATION,
    **REDUNDANCY,
    **OUTPUTS,
    **TWO_ROWS,
    **LOOPS,
}


#: Kernels of a layout that a file describes.
LAYOUT_KERNELS = {
    "separate": Recipe(
        "rate and acceleration from torques, of a layout file", "layouts", "separate", standard=False
    ),
    "torques": Recipe(
        "torques of mass-unbalanced gyros, of a layout file", "layouts", "measure", standard=False
    ),
}

#: Names that a user's algorithm cannot have.
RESERVED = (*ALGORITHMS, *VECTORS, *KERNELS, *LAYOUT_KERNELS)
