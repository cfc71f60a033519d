"""The pulse torquing loop: its figures as printed and as derived, its poles, and sets that miss what is printed."""

import math
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

from strapgen import derive
from strapgen.ir.exceptions import InputError
from strapgen.kernel.kernel import evaluate_stages
from strapgen.navigation.torquing import TorqueLoop, modulation_rows, torquing_rows

#: Linear and quantised figures of the set that fits, to the digits of the derivation.
EXPECTED = {
    "rise_ms": (3.5177, 11 / 3.2),
    "overshoot_percent": (18.5094, 18.36),
    "offset_quanta": (43.68867, 43.38),
    "offset_arcsec": (349.509, 43.38 * 8),
    "bandwidth_hz": (80.13, None),
    "angle_at_0.05_s_arcsec": (54.68, 53.3),
    "angle_at_0.1_s_arcsec": (88.05, 88.9),
}


@pytest.fixture(scope="module")
def rows():
    return {row.quantity: row for row in torquing_rows(TorqueLoop())}


def test_figures_are_those_of_the_derivation_and_near_the_printed_ones(rows):
    for name, (linear, quantised) in EXPECTED.items():
        assert rows[name].linear == pytest.approx(linear, rel=1e-4)
        if quantised is not None:
            assert rows[name].quantised == pytest.approx(quantised, rel=0.01)
        printed = rows[name].printed
        if name == "overshoot_percent":
            assert rows[name].linear < printed
        elif printed is not None:
            assert rows[name].linear == pytest.approx(printed, rel=0.11)  # 88.05 is 10.06 % above 80


def test_poles_and_gains_of_the_linear_loop():
    loop = TorqueLoop()
    assert abs(loop.poles[0]) == pytest.approx(0.9436194, abs=1e-7)
    expected = [1.0730296, 1.1455064, 0.7081526, 0.4769058]
    assert loop.response([10, 40, 80, 120]) == pytest.approx(expected, abs=1e-7)
    assert loop.response(np.linspace(1, 60, 600)).max() == pytest.approx(1.229, abs=1e-3)
    # A sine in time, after the transient of 400 cycles, has the same gain.
    hertz, cycles = 40.0, 4000
    _, commands = loop.run(lambda t: 10 * np.sin(2 * np.pi * hertz * t), cycles)
    wave = np.exp(-2j * np.pi * hertz * np.arange(cycles) * loop.cycle)
    rate = commands * loop.pulse_arcsec * loop.cycle_hz / 3600
    tail = slice(cycles - 3200, cycles)  # 40 whole periods
    assert 2 * abs((rate * wave)[tail].mean()) / 10 == pytest.approx(1.1455064, rel=1e-6)


def test_the_steady_state_of_the_kernel_is_in_closed_form():
    kernel = derive("pulse-torque")
    names = [name for signal in kernel.inputs for name in signal.elements]
    symbols = {name: sp.Symbol(name) for name in names}
    values = evaluate_stages([*kernel.stages, *kernel.outputs], symbols)
    f, i = (symbols[name] for name in ("filtered", "integrated"))
    (steady,) = sp.solve([values["next_filtered"] - f, values["next_integrated"] - i], [f, i], dict=True)
    ratio = sp.simplify(values["command"].subs(symbols).subs(steady) / symbols["angle"])
    gain, c1, c2, c3, leak = (
        symbols[name] for name in ("gain", "lag_gain", "lag_pole", "integral_gain", "leak")
    )
    expected = gain * (1 / (1 + c1 / (1 - c2)) + c3 * (1 - leak) / leak)
    assert sp.simplify(ratio - expected) == 0


@pytest.mark.parametrize(
    ("changes", "missed", "value"),
    [
        (  # K_s = 1/4, 6 arcsec, tau0 = 1 ms, Ki = 100/s
            {"gain": 1 / 4, "quantum_arcsec": 6.0, "lag_s": 1e-3, "integral_gain": 100 / 3200},
            "offset_quanta",
            51,
        ),
        (  # K_s = 3/8, C3 = 2^-6, K_L = 2^-8, tau0 = 0.5 ms
            {"gain": 3 / 8, "integral_gain": 2**-6, "leak": 2**-8, "lag_s": 5e-4},
            "offset_quanta",
            33.3,
        ),
    ],
)
def test_other_constants_miss_the_printed_figures(changes, missed, value):
    loop = replace(TorqueLoop(), **changes)
    ratio = loop.lag_s * loop.cycle_hz
    feedback = loop.gain * loop.pulse_arcsec / loop.quantum_arcsec * ratio  # Kf of the derivation
    loop = replace(loop, lag_gain=feedback / (1 + ratio), lag_pole=ratio / (1 + ratio))
    rows = {row.quantity: row for row in torquing_rows(loop)}
    assert rows[missed].linear == pytest.approx(value, rel=0.02)
    assert abs(rows[missed].linear / 44 - 1) > 0.1


def test_a_constant_that_cannot_be_is_refused():
    with pytest.raises(InputError, match="gain is 2; at most 1 is allowed"):
        TorqueLoop(gain=2)
    with pytest.raises(InputError, match=r"asymmetry_ppm is 2e\+06; at most 1e6 is allowed"):
        TorqueLoop(asymmetry_ppm=2e6)
    with pytest.raises(InputError, match="lag_s is 0; a number above 0 is needed"):
        TorqueLoop(lag_s=0)
    with pytest.raises(InputError, match="the loop is unstable: a pole of its linear form has the magnitude"):
        TorqueLoop(delay_cycles=20).require_stable()
    assert math.isclose(TorqueLoop().pulse_arcsec, 2.8125)


def test_binary_torquing_has_one_power_and_one_bias_and_ternary_a_scale_factor_by_sign():
    """Printed: constant power and an equivalent bias by the asymmetry, or a power that depends on the rate."""
    loop = replace(TorqueLoop(), asymmetry_ppm=200.0)
    rows = {(row.modulation, row.rate_deg_s): row for row in modulation_rows(loop)}
    assert len(rows) == 6
    for row in rows.values():
        assert row.run_drift_deg_h == pytest.approx(row.drift_deg_h, rel=1e-6, abs=1e-6)
    for rate in (0.0, 75.0, -75.0):
        binary, ternary = rows["binary", rate], rows["ternary", rate]
        assert binary.power == 1
        assert binary.drift_deg_h == pytest.approx(-150 * 3600 * 1e-4)  # half of 200 ppm of the largest rate
        assert ternary.power == pytest.approx(abs(rate) / 150, rel=1e-3)
        assert ternary.drift_deg_h == pytest.approx(-abs(rate) * 3600 * 1e-4, rel=1e-3)


def test_without_an_asymmetry_the_modulations_measure_alike():
    loop = replace(TorqueLoop(), asymmetry_ppm=1e-9)
    (none, _), *others = [
        loop.run(lambda t: 30 + 0 * t, 400, 0.0, True, name) for name in ("", "ternary", "binary")
    ]
    for angle, _ in others:
        np.testing.assert_allclose(angle, none, atol=1e-6)
