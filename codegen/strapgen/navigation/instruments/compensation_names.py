"""The names of the kernels of errors of sensors, and of their compensation, as plain data."""

from __future__ import annotations

from strapgen.ir.kernel_info import Recipe

#: Kernels that correct the increments of sensors, and those that make their errors; they take no method.
COMPENSATION = {
    name: Recipe(
        title, f"strapgen.navigation.instruments.{module}", function, tuple(arguments), standard=False
    )
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

_LAYOUTS = "strapgen.navigation.instruments.layouts"
_READER = "strapgen.navigation.instruments.layout:read"

#: Kernels of a layout that a file describes.
LAYOUTS = {
    "separate": Recipe(
        "rate and acceleration from torques, of a layout file",
        _LAYOUTS,
        "separate",
        standard=False,
        reader=_READER,
    ),
    "torques": Recipe(
        "torques of mass-unbalanced gyros, of a layout file",
        _LAYOUTS,
        "measure",
        standard=False,
        reader=_READER,
    ),
}
