"""The file of sensor errors: units, classes, and one line for what is wrong with it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from strapgen.ir.exceptions import InputError
from strapgen.ir.units import STANDARD_GRAVITY
from strapgen.lab.sensor_errors.error_file import CLASSES, read
from strapgen.lab.sensor_errors.instruments import dither_amplitude, dithered_laser_noise

ROOT = Path(__file__).resolve().parents[2]
DEG_H = np.radians(1 / 3600)

WHOLE = """
title = "all keys"
seed = 7

[gyro]
bias_deg_h = [1, 2.5, -3]
scale_plus_ppm = 100
scale_minus_ppm = [1, 2, 3]
misalignment_arcsec = [1, 2, 3, 4, 5, 6]
g_deg_h_g = { xx = 1, zx = 2 }
g2_deg_h_g2 = 0.1
anisoinertia_s = { yz = 1e-4 }
noise_deg_sqrt_h = 0.6
random_walk_deg_h_sqrt_h = 6
pulse_arcsec = 3
response = ["second-order:80:0.6", "second-order:80:0.6", "second-order:60:0.6"]
delay_s = 0.001

[accelerometer]
bias_ug = 100
scale_ppm = -50
noise_ug_sqrt_hz = 20
random_walk_ug_sqrt_h = 60
pulse_mm_s = 10
g2_ug_g2 = { zz = 9.81 }
rate_m_s_rad = { xy = 1e-3 }
rate_products_m = { xy = 0.01 }

[sampling]
jitter_s = 1e-6
lost = 0.01
lost_as = "repeat"

[warm_up]
rate_deg_h = [15, 60, 0]
tau_s = [180, 210, 1]

[heating]
unbalance_deg_s_g = 5

[output_noise]
decay = 0.9
rms_arcsec = 1
"""


def file_of(text: str, folder: Path) -> Path:
    path = folder / "errors.toml"
    path.write_text(text)
    return path


def test_every_key_is_read_in_its_unit(tmp_path):
    errors = read(file_of(WHOLE, tmp_path))
    gyro, force = errors.gyro, errors.accelerometer
    assert (errors.title, errors.seed, errors.drawn) == ("all keys", 7, False)
    np.testing.assert_allclose(gyro.bias, DEG_H * np.array([1, 2.5, -3]))
    np.testing.assert_allclose(gyro.scale_plus, [1e-4] * 3)
    np.testing.assert_allclose(gyro.scale_minus, [1e-6, 2e-6, 3e-6])
    np.testing.assert_allclose(gyro.misalignment, DEG_H * np.array([[0, 1, 2], [3, 0, 4], [5, 6, 0]]))
    assert gyro.terms["B_zx"] == pytest.approx(2 * DEG_H / STANDARD_GRAVITY)
    assert gyro.terms["E_yz"] == pytest.approx(0.1 * DEG_H / STANDARD_GRAVITY**2)
    assert gyro.terms["J_yz"] == 1e-4
    # A noise N in deg/sqrt(h) leaves N sqrt(t/h) deg, a walk K in deg/h/sqrt(h) a bias of K sqrt(t/h) deg/h.
    assert gyro.noise[0] * np.sqrt(3600) == pytest.approx(np.radians(0.6))
    assert gyro.random_walk[0] * np.sqrt(3600) == pytest.approx(6 * DEG_H)
    assert force.random_walk[0] * np.sqrt(3600) == pytest.approx(60 * STANDARD_GRAVITY * 1e-6)
    np.testing.assert_allclose(gyro.pulse, 3 * DEG_H)
    assert [one.frequency_hz for one in gyro.response] == [80, 80, 60]
    np.testing.assert_allclose(force.bias, 100e-6 * STANDARD_GRAVITY)
    np.testing.assert_allclose(force.noise, 20e-6 * STANDARD_GRAVITY)
    np.testing.assert_allclose(force.pulse, 0.01)
    # 9.81 micro-g at one g squared is N g^2 = 9.81e-6 g.
    assert force.terms["N_zz"] * STANDARD_GRAVITY**2 == pytest.approx(9.81e-6 * STANDARD_GRAVITY)
    assert errors.heating.tau == 150 and errors.heating.gain[0] == -2.6e-4
    assert errors.heating.unbalance == pytest.approx(np.radians(5) / STANDARD_GRAVITY)
    assert errors.output_noise.rms[0] == pytest.approx(DEG_H)
    assert len([*errors.causes]) == 14 and errors.needs_acceleration


#: Table 1 of the sensor paper: gyro bias in deg/h, noise in deg/sqrt(h), scale factor in ppm and alignment in arcsec,
#: accelerometer bias in micro-g, scale factor in ppm, alignment in arcsec.
TABLE = {
    "ins-0.1": (0.001, 0.0005, 1, 1, 10, 50, 2),
    "ins-1": (0.01, 0.002, 5, 2, 40, 200, 7),
    "ahrs": (1, 0.01, 200, 200, 1000, 1000, 200),
    "midcourse": (5, 0.1, 1000, 300, 1000, 1000, 300),
}


@pytest.mark.parametrize("name", CLASSES)
def test_the_classes_are_those_of_the_table(name):
    bias, noise, scale, alignment, force_bias, force_scale, force_alignment = TABLE[name]
    errors = read(name)
    assert errors.drawn
    np.testing.assert_allclose(errors.gyro.bias, bias * DEG_H)
    np.testing.assert_allclose(errors.gyro.noise, np.radians(noise) / 60)
    np.testing.assert_allclose(errors.gyro.scale_plus, scale * 1e-6)
    assert errors.gyro.misalignment[0, 1] == pytest.approx(alignment * DEG_H)
    np.testing.assert_allclose(errors.accelerometer.bias, force_bias * STANDARD_GRAVITY * 1e-6)
    np.testing.assert_allclose(errors.accelerometer.scale_minus, force_scale * 1e-6)
    assert errors.accelerometer.misalignment[2, 1] == pytest.approx(force_alignment * DEG_H)


def test_a_file_changes_a_class(tmp_path):
    errors = read(file_of('class = "ins-1"\nconstants = "stated"\n[gyro]\npulse_arcsec = 1\n', tmp_path))
    assert not errors.drawn
    assert errors.gyro.pulse[0] == pytest.approx(DEG_H)
    np.testing.assert_array_equal(errors.gyro.bias, read("ins-1").gyro.bias)


def test_an_empty_file_has_no_errors(tmp_path):
    assert [*read(file_of("", tmp_path)).causes] == []


def test_a_dithered_laser_gyro_has_the_printed_noise(tmp_path):
    noise = np.degrees(dithered_laser_noise(0.03, 72, 648_000)) * 60
    assert noise == pytest.approx(0.00199471, abs=5e-9)
    assert noise == pytest.approx(0.002, abs=5e-4)  # as printed
    assert np.degrees(dither_amplitude(72, 400)) * 3600 == pytest.approx(103.1324, abs=5e-5)
    assert dither_amplitude(72, 400, 0.01) == pytest.approx(dither_amplitude(72, 400) / 100)
    text = "[gyro]\ndither = { lock_in_deg_s = 0.03, dither_deg_s = 72, fringes = 648000 }\n"
    np.testing.assert_allclose(np.degrees(read(file_of(text, tmp_path)).gyro.noise) * 60, noise)


BAD = [
    ("gyro = 1", "gyro is 1; a table with bandwidth_hz"),
    ("colour = 1", "key 'colour'"),
    ('class = "car"', "class 'car'"),
    ("class = 3", "class is 3"),
    ("title = 3", "title is 3; a text is needed"),
    ("seed = -1", "seed is -1"),
    ("seed = 1.5", "seed is 1.5"),
    ("seed = true", "seed is true"),
    ('constants = "random"', "constants 'random'"),
    ("[gyro]\nbias = 1", "gyro: key 'bias' is not known (did you mean bias_deg_h"),
    ('[gyro]\nbias_deg_h = "one"', "gyro.bias_deg_h is 'one': numbers"),
    ("[gyro]\nbias_deg_h = true", "gyro.bias_deg_h is true; a number from"),
    ("[gyro]\nbias_deg_h = nan", "bias_deg_h is nan"),
    ("[gyro]\nbias_deg_h = inf", "bias_deg_h is inf"),
    ("[gyro]\nbias_deg_h = [1, 2]", "gyro.bias_deg_h has 2 entries; 3 are needed"),
    ("[gyro]\nbias_deg_h = [1, 2, [3]]", "gyro.bias_deg_h[3] is [3]; a number from"),
    ("[gyro]\nnoise_deg_sqrt_h = -1", "noise_deg_sqrt_h is -1"),
    ("[gyro]\nbandwidth_hz = 0", "gyro.bandwidth_hz is 0; a number from 0.001 to 1000000 in Hz"),
    ("[gyro]\ndelay_s = -1", "delay_s is -1; a number from 0 to 10 in s"),
    ("[gyro]\nscale_ppm = 1\nscale_plus_ppm = 2", "scale_ppm and scale_plus_ppm are both there"),
    ("[gyro]\nmisalignment_arcsec = [1, 2, 3]", "misalignment_arcsec has 3 entries; 6 are needed"),
    ("[gyro]\ng_deg_h_g = { zz = 1 }", "key of gyro.g_deg_h_g 'zz' is not known; allowed: xx, xy"),
    ("[gyro]\ng_deg_h_g = { xx = [] }", "gyro.g_deg_h_g.xx is []; a number"),
    ("[gyro]\nbias_ug = 1", "key 'bias_ug'"),
    ("[gyro]\ndither = 1", "gyro.dither is 1; a table with lock_in_deg_s"),
    ("[gyro]\ndither = { lock_in_deg_s = 1 }", "gyro.dither.dither_deg_s is missing"),
    ("[gyro]\ndither = { lock_in_deg_s = 0, dither_deg_s = 1, fringes = 1 }", "lock_in_deg_s is 0"),
    (
        "[gyro]\nnoise_deg_sqrt_h = 1\ndither = { lock_in_deg_s = 1, dither_deg_s = 1, fringes = 1 }",
        "noise_deg_sqrt_h and dither are both there",
    ),
    ("[accelerometer]\nbias_deg_h = 1", "accelerometer: key 'bias_deg_h' is not"),
    ("[sampling]\nlost = 1", "sampling.lost is 1; a number from 0 to 0.99"),
    ("[sampling]\njitter_s = -1e-6", "jitter_s is -0.000001; a number"),
    ('[sampling]\nlost_as = "never"', "lost_as 'never'"),
    ("[warm_up]\nrate_deg_h = 1", "warm_up.tau_s is missing; a number"),
    ("[warm_up]\nrate_deg_h = 1\ntau_s = 0", "tau_s is 0"),
    ("[heating]\ngain_s2_rad2 = 2", "heating.gain_s2_rad2 is 2; a number from -1 to 1 in"),
    ("[heating]\nunbalance_deg_s_g = -1", "unbalance_deg_s_g is -1"),
    ("[output_noise]\ndecay = 1\nrms_arcsec = 1", "output_noise.decay is 1; a number from 0 to 0.999999"),
    ("[gyro", "is not TOML"),
    ("x = '" + 70_000 * "a" + "'", "over 65536 bytes"),
]


@pytest.mark.parametrize("text, words", BAD)
def test_mistakes_are_refused_in_one_line(text, words, tmp_path):
    with pytest.raises(InputError, match=re.escape(words)) as refused:
        read(file_of(text, tmp_path))
    assert "errors.toml" in str(refused.value) and "\n" not in str(refused.value)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"none\.toml cannot be read"):
        read(tmp_path / "none.toml")
