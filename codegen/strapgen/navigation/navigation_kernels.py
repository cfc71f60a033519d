"""The names of the kernels of navigation, as plain data: none takes a method, and none is of the standard catalogue."""

from __future__ import annotations

from typing import Any

from strapgen.ir.kernel_info import Recipe

_SHAPES = {"sphere": "a sphere", "ellipsoid": "an ellipsoid"}
_AZIMUTHS = {"wander": "wander azimuth", "free": "free azimuth", "north": "north-slaved"}
#: How a unit can be mounted, by the direction that its x axis points to.
MOUNTINGS = {"fore": "ahead", "right": "right", "aft": "aft", "left": "left"}
#: Triads of the hexad, those with the least noise first.
HEXAD_TRIADS = (
    *("012", "345", "014", "015", "023", "024", "034", "045", "123", "125"),
    *("135", "145", "234", "235", "013", "025", "035", "124", "134", "245"),
)


def _recipe(title: str, module: str, function: str, *arguments: Any, reader: str = "") -> Recipe:
    """Return the recipe of a kernel from a module of navigation."""
    return Recipe(title, f"strapgen.navigation.{module}", function, arguments, standard=False, reader=reader)


#: Kernels between stages of different rates, and from counts.
SAMPLING = {
    "sum-3": _recipe("sum of increments for a slower cycle", "systems.sampling", "increment_sum"),
    "hold-3": _recipe("increments shared out to faster cycles", "systems.sampling", "held_increment"),
    "angle-counts": _recipe("angle increments from counts", "systems.sampling", "scaled_counts", "angle"),
    "velocity-counts": _recipe(
        "velocity increments from counts", "systems.sampling", "scaled_counts", "velocity"
    ),
    "interpolated-integral": _recipe(
        "integral from a sample to a time, by a polynomial", "preintegration.interpolation", "integral"
    ),
    "interpolated-mean": _recipe(
        "mean over an interval from samples, by a polynomial", "preintegration.interpolation", "mean"
    ),
}

_TWO_SPEED = "two_speed.two_speed_loops"
#: Kernels of whole loops in two speeds.
TWO_SPEED_LOOPS = {
    **{
        f"two-speed-fast-{form}": _recipe(f"two speeds: fast loop with S{form}", _TWO_SPEED, "fast", form)
        for form in (1, 2)
    },
    **{
        f"{name}-two-speed-slow-{form}": _recipe(
            f"two speeds: slow loop with S{form}", _TWO_SPEED, "slow", name, form
        )
        for name in ("dcm", "euler")
        for form in (1, 2)
    },
    **{
        f"{name}-two-speed-navigation": _recipe("two speeds: navigation loop", _TWO_SPEED, "navigation", name)
        for name in ("dcm", "euler")
    },
}

_IMU, _PULSES, _SEPARATION = "instruments.imu_errors", "instruments.pulses", "instruments.separation"
_OPTICAL = "instruments.optical_gyros"
#: Kernels that correct the increments of sensors, and those that make their errors.
COMPENSATION = {
    "imu-compensate": _recipe("compensation of a measurement unit", _IMU, "imu_compensate"),
    "imu-compensate-2": _recipe("compensation in two passes", _IMU, "imu_compensate", 2),
    "imu-errors": _recipe("errors of a measurement unit", _IMU, "imu_errors"),
    "pulse-compensate": _recipe("compensation of pulses by polarity", _PULSES, "pulse_compensate"),
    "pulse-compensate-exact": _recipe(
        "compensation of pulses, exact inverse", _PULSES, "pulse_compensate", True
    ),
    "pulse-errors": _recipe("pulses of a sensor with its errors", _PULSES, "pulse_errors"),
    "gyro-pulse-compensate": _recipe(
        "compensation of the pulses of a gyro", _PULSES, "pulse_compensate", False, "gyro"
    ),
    "gyro-pulse-errors": _recipe("pulses of a gyro with its errors", _PULSES, "pulse_errors", "gyro"),
    "temperature-coefficient": _recipe("coefficient by two slopes", _PULSES, "temperature_coefficient"),
    "scale-factor-heating": _recipe("scale factor by torquer heat", _PULSES, "scale_factor_heating"),
    "torquer-heating-errors": _recipe("errors by torquer heat", _PULSES, "scale_factor_heating", True),
    "lock-in-errors": _recipe("increments of ring lasers that lock in", _OPTICAL, "lock_in_errors"),
    "fibre-signal": _recipe("signals of fibre gyros without a loop", _OPTICAL, "fibre_signal"),
    "fibre-rate": _recipe("rates of fibre gyros without a loop", _OPTICAL, "fibre_rate"),
    "separate-canonical": _recipe("rate and acceleration from torques", _SEPARATION, "separate", "canonical"),
    "separate-45": _recipe("separation, torquers at 45 degrees", _SEPARATION, "separate", "45"),
    "torques-canonical": _recipe("torques of mass-unbalanced gyros", _SEPARATION, "measure", "canonical"),
    "torques-45": _recipe("torques, torquers at 45 degrees", _SEPARATION, "measure", "45"),
}

_READER = "strapgen.navigation.instruments.layout:read"
#: Kernels of what a file describes: a layout of gyros, or a magnetic field.
LAYOUTS = {
    "separate": _recipe(
        "rate and acceleration from torques, of a layout file",
        "instruments.layouts",
        "separate",
        reader=_READER,
    ),
    "torques": _recipe(
        "torques of mass-unbalanced gyros, of a layout file", "instruments.layouts", "measure", reader=_READER
    ),
    "magnetic-field": _recipe(
        "magnetic field of the earth by spherical harmonics",
        "frame.magnetic_field",
        "magnetic_field",
        reader="strapgen.navigation.frame.magnetic_file:read",
    ),
}

#: The kernel of a filter that a file describes.
FILTERS = {
    "filter": _recipe(
        "lag, lead-lag, notch, low pass or cascade, of a filter file",
        "filters.filter_kernels",
        "cascade",
        reader="strapgen.navigation.filters.filter_file:read",
    ),
}

_RATES, _STEPS, _GEOGRAPHIC = "frame.frame_rates", "frame.navigation_steps", "frame.geographic"
#: Kernels of the navigation frame: its rate, gravity, velocity and position, and its alignment.
NAVIGATION = {
    "earth-rate": _recipe("earth rate in navigation axes", _RATES, "earth_rate"),
    **{
        f"{azimuth}-rate-{shape}": _recipe(
            f"transport rate over {body}, {words}", _RATES, "transport_rate", shape, azimuth
        )
        for shape, body in _SHAPES.items()
        for azimuth, words in _AZIMUTHS.items()
    },
    "navigation-turn": _recipe("rate of the navigation frame times the cycle", _RATES, "navigation_turn"),
    "navigation-turn-ahead": _recipe(
        "rate of the navigation frame, extrapolated", _RATES, "navigation_turn", True
    ),
    "gravity-sphere": _recipe("gravity of a turning sphere", _RATES, "gravity_sphere"),
    "gravity-ellipsoid": _recipe("normal gravity of an ellipsoid", _RATES, "gravity_ellipsoid"),
    "coriolis-gravity": _recipe("gravity and Coriolis acceleration", _STEPS, "coriolis_gravity"),
    "velocity-step": _recipe("velocity after a cycle", _STEPS, "velocity_step"),
    "velocity-step-level": _recipe("velocity after a cycle, vertical held", _STEPS, "velocity_step", True),
    "position-step": _recipe("position after a cycle", _STEPS, "position_step"),
    "height-step": _recipe("height after a cycle", _STEPS, "height_step"),
    **{
        f"{name}-translation": _recipe("velocity and position after a step", _STEPS, "translation", name)
        for name in ("dcm", "euler")
    },
    "geographic-angles": _recipe("latitude, longitude and wander angle", _GEOGRAPHIC, "geographic_angles"),
    "position-from-angles": _recipe(
        "position of latitude, longitude, wander angle", _GEOGRAPHIC, "position_from_angles"
    ),
    "dcm-north-east-down": _recipe("attitude against north, east, down", _GEOGRAPHIC, "north_east_down"),
    "dcm-navigation-axes": _recipe("attitude against navigation axes", _GEOGRAPHIC, "north_east_down", True),
    "ground-velocity": _recipe("velocity to north, east and down", _GEOGRAPHIC, "ground_velocity"),
    "coarse-leveling": _recipe("coarse alignment: roll and pitch", _GEOGRAPHIC, "coarse_leveling"),
    "coarse-azimuth": _recipe("coarse alignment: analytic gyrocompass", _GEOGRAPHIC, "coarse_azimuth"),
    "late-latitude": _recipe("attitude for a latitude entered late", _GEOGRAPHIC, "late_latitude"),
}

_REDUNDANCY = "redundancy.redundancy_kernels"
#: Kernels of six sensors on a cone, of a moment arm and of a boresight.
REDUNDANCY = {
    "parity-hexad": _recipe("parity equations of six sensors", _REDUNDANCY, "parity"),
    "parity-rest-hexad": _recipe("parity of six sensors without bias", _REDUNDANCY, "parity_rest"),
    "select-hexad": _recipe("failed sensor and triad of six sensors", _REDUNDANCY, "select"),
    "all-hexad": _recipe("vector of six sensors, least squares", _REDUNDANCY, "all_sensors"),
    **{
        f"triad-hexad-{name}": _recipe(f"vector of sensors {', '.join(name)}", _REDUNDANCY, "triad", number)
        for number, name in enumerate(HEXAD_TRIADS)
    },
    "median-3": _recipe("median of three units", _REDUNDANCY, "median_of_three"),
    "moment-arm": _recipe("velocity increment at a moment arm", _REDUNDANCY, "moment_arm"),
    "boresight": _recipe("mean relative attitude of two units", _REDUNDANCY, "boresight"),
}

#: Kernels of what a navigator shows: filtered rates, magnetic heading, track angle, axes.
OUTPUTS = {
    "butterworth-2": _recipe("low-pass filter of second order", "filters.filter_kernels", "butterworth"),
    "variation": _recipe("magnetic variation between four points", "outputs", "variation"),
    "magnetic-heading": _recipe("heading by the magnetic variation", "outputs", "magnetic_heading"),
    "track-angle": _recipe("direction of the ground velocity", "outputs", "track_angle"),
    "drift-angle": _recipe("track angle less heading", "track_outputs", "drift_angle"),
    "flight-path-angle": _recipe("angle of the velocity above level", "track_outputs", "flight_path_angle"),
    "track-accelerations": _recipe(
        "accelerations along and across the track", "track_outputs", "track_accelerations"
    ),
    "track-angle-rate": _recipe("rate of the track angle", "track_outputs", "track_angle_rate"),
    "wind": _recipe("wind of ground velocity and airspeed", "track_outputs", "wind"),
    **{
        f"axes-{mounting}": _recipe(f"body axes of a unit that points {words}", "outputs", "axes", mounting)
        for mounting, words in MOUNTINGS.items()
    },
}

#: Kernels of the modes of a reference.
MODES = {
    "hysteresis": _recipe("switch with two thresholds", "modes", "hysteresis"),
    "mode-sequence": _recipe("sequence of off, align, navigate, attitude", "modes", "mode_sequence"),
}

#: Kernels of an attitude held as two rows of its direction cosine matrix.
TWO_ROWS = {
    "dcm-two-rows-update": _recipe("two rows: update by a rotation vector", _STEPS, "update"),
    "dcm-two-rows-update-5": _recipe("two rows: update by a rotation vector, order 5", _STEPS, "update", 5),
    "dcm-two-rows-orthonormalize": _recipe(
        "two rows made orthonormal, to first order", _STEPS, "orthonormalized"
    ),
    "dcm-two-rows-navigation-2": _recipe(
        "two rows: rotation of the navigation frame, order 2", _STEPS, "navigation", 2
    ),
    "dcm-from-two-rows": _recipe("conversion: direction cosine matrix from two rows", _STEPS, "matrix"),
}

_LOOPS = "loops.loop_kernels"
#: Kernels of the loops of an attitude and heading reference, and of a gyro's torquer.
LOOPS = {
    "level-loop": _recipe("levelling loop of third order", _LOOPS, "level_loop"),
    "erection": _recipe("erection loop of the attitude mode", _LOOPS, "erection"),
    "heading-loop": _recipe("heading loop of second order", _LOOPS, "heading_loop"),
    "heading-from-dcm": _recipe("heading of an attitude", _LOOPS, "heading_of_attitude"),
    "vertical-loop": _recipe("vertical loop of third order", _LOOPS, "vertical_loop"),
    "height-hysteresis": _recipe("hysteresis of the feedback of a height", _LOOPS, "height_hysteresis"),
    "tuned-rotor-loop": _recipe(
        "loop of a tuned-rotor gyro with rate observer", "instruments.tuned_rotor", "tuned_rotor_loop"
    ),
    "pulse-torque": _recipe("control law of a pulse torquing loop", _PULSES, "pulse_torque"),
    "body-feedback": _recipe("feedback of the loops in body axes", _LOOPS, "body_feedback"),
}

#: All of them.
KERNELS = {
    **SAMPLING,
    **TWO_SPEED_LOOPS,
    **COMPENSATION,
    **LAYOUTS,
    **FILTERS,
    **NAVIGATION,
    **REDUNDANCY,
    **OUTPUTS,
    **MODES,
    **TWO_ROWS,
    **LOOPS,
}
