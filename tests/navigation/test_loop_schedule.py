"""The schedule of the loops: modes, conditions, cut-out and hysteresis, and files that are refused."""

from fractions import Fraction

import pytest

from strapgen.ir.exceptions import InputError
from strapgen.navigation.loops.loop_schedule import BUILT_IN, read

SCHEDULE = read()


def test_the_schedule_of_1984():
    taus = [[float(loop.time_constant_s) for loop in mode.loops] for mode in SCHEDULE.sequence]
    assert taus == [[5, 40, 30], [30, 40, 30], [240, 200, 50]]
    assert [mode.duration_s for mode in SCHEDULE.sequence] == [30, 150, None]
    assert sum(mode.duration_s for mode in SCHEDULE.timed(Fraction(0))) == 180
    assert [float(mode.duration_s) for mode in SCHEDULE.timed(Fraction(7))][-1] == 7


def test_modes_follow_time_air_data_and_the_crew():
    def name(*arguments, **options):
        return SCHEDULE.mode(*map(Fraction, arguments), **options).name

    assert [name(t) for t in (0, 29, 30, 179, 180, 9999)] == [
        "fast",
        "fast",
        "fine",
        "fine",
        "normal",
        "normal",
    ]
    assert [name(1000, lost) for lost in (300, 301)] == ["normal", "basic"]
    assert name(10, 301) == "fast"
    assert name(1000, selected="attitude") == "attitude"
    with pytest.raises(InputError, match="selected mode 'basic'"):
        name(0, selected="basic")


def test_cut_out_and_hysteresis_are_arguments():
    normal, gyro = SCHEDULE.sequence[-1], SCHEDULE.mode(Fraction(0), selected="directional-gyro")
    assert [SCHEDULE.heading_is_open(normal, rate) for rate in (0.4, -0.6)] == [False, True]
    assert SCHEDULE.heading_is_open(gyro, 0.0)
    engaged, course = False, []
    for knots in (90, 105, 111, 105, 101, 99, 105):
        engaged = SCHEDULE.air_data_engaged(engaged, knots * 1852 / 3600)
        course.append(engaged)
    assert course == [False, False, True, True, True, False, False]


CHANGES = {
    "missing cycle": (
        "cycle_s = 0.01\n",
        "",
        "cycle_s is missing; a number from 1e-05 to 1000 in s is needed",
    ),
    "unknown key": ("cycle_s", "cycle_ms", "key 'cycle_ms'"),
    "zero": ("cycle_s = 0.01", "cycle_s = 0", "cycle_s is 0"),
    "reference": ('reference = "zero"', 'reference = "gps"', "mode[fast].level.reference 'gps'"),
    "open": (
        "heading = { tau_s = 40 }",
        'heading = { tau_s = 40, reference = "open" }',
        "the heading loop is open",
    ),
    "no loop": ("heading = { tau_s = 40 }\n", "", "mode[fast].heading is missing; a table with tau_s"),
    "two levels": (
        "duration_s = 30\n",
        "duration_s = 30\nerection = { tau_s = 3 }\n",
        "either level or erection",
    ),
    "endless": ("duration_s = 30\n", "", "mode fast has no duration_s; only the last"),
    "twice": ('"fine"', '"fast"', "two modes of the schedule have the same name"),
    "order": ("tau_s = 5,", "tau_s = 5, order = 4,", "mode[fast].level.order is 4; 2 or 3 is needed"),
    "hysteresis": ('off_m_s = "463/9"', "off_m_s = 60", "air_data_off_m_s is 60; at most"),
    "slow": (
        "tau_s = 5,",
        "tau_s = 1e7,",
        "level.tau_s is 1e+7; a number from 0.001 to 1000000 in s is needed",
    ),
    "text": (
        "duration_s = 30",
        "duration_s = true",
        "mode[fast].duration_s is true; a number above 0 in s is needed",
    ),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_file_is_refused_in_one_line(name, tmp_path):
    old, new, reason = CHANGES[name]
    text = BUILT_IN.read_text("utf-8")
    assert old in text
    (tmp_path / "s.toml").write_text(text.replace(old, new, 1), "utf-8")
    with pytest.raises(InputError) as error:
        read(tmp_path / "s.toml")
    assert reason in str(error.value)
    assert "\n" not in str(error.value)
