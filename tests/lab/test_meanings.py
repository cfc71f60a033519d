"""What columns mean by the names that known loggers give them."""

from __future__ import annotations

import pytest

from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings import meanings
from strapgen.lab.recordings.log_topic import LogColumn, LogTopic
from strapgen.lab.recordings.meanings import Stated

#: Names of columns as loggers and logs write them; the time, three rates or increments, and three forces.
LAYOUTS = {
    "PX4 sensor_combined": (
        "timestamp gyro_rad[0] gyro_rad[1] gyro_rad[2] gyro_integral_dt accelerometer_timestamp_relative "
        "accelerometer_m_s2[0] accelerometer_m_s2[1] accelerometer_m_s2[2] accelerometer_integral_dt",
        "timestamp gyro_rad[0] gyro_rad[1] gyro_rad[2]",
        "accelerometer_m_s2[0] accelerometer_m_s2[1] accelerometer_m_s2[2]",
    ),
    "PX4 vehicle_imu": (
        "timestamp timestamp_sample accel_device_id gyro_device_id delta_angle[0] delta_angle[1] delta_angle[2] "
        "delta_velocity[0] delta_velocity[1] delta_velocity[2] delta_angle_dt",
        "timestamp_sample delta_angle[0] delta_angle[1] delta_angle[2]",
        "delta_velocity[0] delta_velocity[1] delta_velocity[2]",
    ),
    "PX4 sensor_gyro": (
        "timestamp timestamp_sample device_id x y z temperature",
        "timestamp_sample x y z",
        "",
    ),
    "ArduPilot IMU": (
        "TimeUS I GyrX GyrY GyrZ AccX AccY AccZ EG EA T GH AH GHz AHz",
        "TimeUS GyrX GyrY GyrZ",
        "AccX AccY AccZ",
    ),
    "ArduPilot GYR": ("TimeUS I SampleUS GyrX GyrY GyrZ", "SampleUS GyrX GyrY GyrZ", ""),
    "MAVLink HIGHRES_IMU": (
        "time_usec xacc yacc zacc xgyro ygyro zgyro xmag ymag zmag abs_pressure",
        "time_usec xgyro ygyro zgyro",
        "xacc yacc zacc",
    ),
    "MAVLink SCALED_IMU": (
        "time_boot_ms xacc yacc zacc xgyro ygyro zgyro xmag ymag zmag",
        "time_boot_ms xgyro ygyro zgyro",
        "xacc yacc zacc",
    ),
    "sensor_msgs/Imu": (
        "received header.stamp orientation.x orientation.y orientation.z orientation.w orientation_covariance[0] "
        "angular_velocity.x angular_velocity.y angular_velocity.z angular_velocity_covariance[0] "
        "angular_velocity_covariance[1] angular_velocity_covariance[2] linear_acceleration.x linear_acceleration.y "
        "linear_acceleration.z",
        "header.stamp angular_velocity.x angular_velocity.y angular_velocity.z",
        "linear_acceleration.x linear_acceleration.y linear_acceleration.z",
    ),
    "increments": ("t dx dy dz dvx dvy dvz", "t dx dy dz", "dvx dvy dvz"),
    "a phone": (
        "seconds_elapsed gyroscope_x gyroscope_y gyroscope_z accelerometer_x accelerometer_y accelerometer_z",
        "seconds_elapsed gyroscope_x gyroscope_y gyroscope_z",
        "accelerometer_x accelerometer_y accelerometer_z",
    ),
}


def topic(names: str, name: str = "", message: str = "", unit: str | None = None) -> LogTopic:
    return LogTopic(name, tuple(LogColumn(one, unit) for one in names.split()), None, message)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_layouts_are_understood(layout):
    names, wanted, forces = LAYOUTS[layout]
    found = meanings.of_topic(topic(names), Stated())
    assert (found.time, *found.samples) == tuple(wanted.split()) and not found.forces
    assert found.input == ("increments" if "d" in wanted.split()[1][:2] else "rates")
    if forces:
        found = meanings.of_topic(topic(names), Stated(with_force=True))
        assert found.forces == tuple(forces.split())
    else:
        with pytest.raises(InputError, match="no specific forces along three axes"):
            meanings.of_topic(topic(names), Stated(with_force=True))


@pytest.mark.parametrize(
    ("names", "wanted"),
    [
        ("timestamp q[0] q[1] q[2] q[3] delta_q_reset[0]", "timestamp q[0] q[1] q[2] q[3]"),
        ("TimeUS DesRoll Roll DesPitch Pitch DesYaw Yaw", "TimeUS Roll Pitch Yaw"),
        ("TimeUS Roll Pitch Yaw Alt Lat Lng Q1 Q2 Q3 Q4", "TimeUS Q1 Q2 Q3 Q4"),
        ("time_boot_ms q1 q2 q3 q4 rollspeed pitchspeed yawspeed", "time_boot_ms q1 q2 q3 q4"),
        ("time_boot_ms roll pitch yaw rollspeed pitchspeed yawspeed", "time_boot_ms roll pitch yaw"),
        (
            "header.stamp orientation.x orientation.y orientation.z orientation.w",
            "header.stamp orientation.w orientation.x orientation.y orientation.z",
        ),
    ],
)
def test_attitudes_are_found(names, wanted):
    found = meanings.attitude(topic(names))
    assert [found.time, *found.columns] == wanted.split()
    assert found.order == ("sxyz" if len(found.columns) == 4 else "")


@pytest.mark.parametrize(
    ("names", "unit"),
    [
        ("time_s roll_deg pitch_deg heading_deg", "deg"),
        ("time_s roll_rad pitch_rad yaw_rad", "rad"),
        ("time_s roll[deg] pitch[deg] yaw[deg]", "deg"),
        ("time_s roll pitch yaw", None),
    ],
)
def test_the_unit_of_angles_is_that_in_their_names(names, unit):
    assert meanings.attitude(topic(names)).unit == unit


def test_the_topic_with_rates_is_taken_and_said():
    gyro = "timestamp gyro_rad[0] gyro_rad[1] gyro_rad[2]"
    topics = [
        topic("timestamp q[0] q[1] q[2] q[3]", "vehicle_attitude", "vehicle_attitude"),
        topic("timestamp x y z", "sensor_gyro", "sensor_gyro"),
        topic(gyro, "sensor_combined", "sensor_combined"),
    ]
    found, remark = meanings.find(topics, "", Stated())
    assert found.topic == "sensor_combined" and remark.startswith(
        "the rates are those of topic sensor_combined"
    )
    assert meanings.find(topics, "sensor_gyro", Stated())[0].samples == ("x", "y", "z")
    with pytest.raises(InputError, match=r"^topic 'sensor_gyros' is not known"):
        meanings.find(topics, "sensor_gyros", Stated())
    with pytest.raises(InputError, match=r"^topic 'gyro' is not known; the log has none, and FILE alone"):
        meanings.find([topic("t x y z")], "gyro", Stated())
    with pytest.raises(
        InputError, match=r"^no topic has a time and rates about three axes; it has vehicle_attitude"
    ):
        meanings.find([topics[0], topic("t a", "other")], "", Stated())
    two = [topic("t gyro_x gyro_y gyro_z", name) for name in ("left", "right")]
    with pytest.raises(
        InputError, match=r"^2 topics have rates about three axes, left or right; FILE:TOPIC says"
    ):
        meanings.find(two, "", Stated())


def test_the_unit_of_the_log_counts_beside_that_of_the_name():
    stated = meanings.of_topic(topic("t gyro_x gyro_y gyro_z", unit="mrad/s"), Stated(has_time=False))
    assert stated.unit == "mrad/s"
    with pytest.raises(
        InputError, match=r"^--rate-unit deg/s contradicts the header: column 'gyro_z' is in mrad/s"
    ):
        meanings.of_topic(
            topic("gyro_x gyro_y gyro_z", unit="mrad/s"), Stated(has_time=False, rate_unit="deg/s")
        )


@pytest.mark.parametrize("columns", ["t=a,x=b,y=c,z=d", "z=d,t=a,y=c,x=b", "a,b,c,d", "1,2,3,4"])
def test_columns_are_stated_by_key_by_order_or_by_number(columns):
    found = meanings.of_topic(topic("a b c d e"), Stated(columns=columns))
    assert (found.time, *found.samples) == ("a", "b", "c", "d")
