"""A gyro whose float a pulse torquing loop holds: the plant, exactly from cycle to cycle, and runs of the loop.

The float obeys tau0 th'' + th' = w - k Q_T/dt, with the rate w and the pulses k of a cycle held over it. The command of
a cycle acts in the next one, and is limited. The control law is that of the kernel ``pulse-torque``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.exceptions import InputError
from strapgen.results import figures
from strapgen.results.records import Properties, entry, properties
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.run.backends import evaluator

Array = NDArray[np.float64]
#: Arc seconds in a degree.
_ARCSEC = 3600.0


@dataclass(frozen=True)
class TorqueLoop:
    """Constants of the control law, and of the gyro.

    The numbers are those of a fit to the printed responses; gain, quantum, lag and delay are not printed.
    """

    #: K_s, C1, C2, C3 and K_L, see the kernel
    gain: float = 9 / 32
    lag_gain: float = 3 / 64
    lag_pole: float = 1 / 2
    integral_gain: float = 1 / 32
    leak: float = 1 / 128
    #: Q_AD, a quantum of the float angle
    quantum_arcsec: float = 8.0
    #: tau0, time constant of the float
    lag_s: float = 1 / 3200
    #: Cycles in a second
    cycle_hz: float = 3200.0
    #: Largest rate, that of the largest command in every cycle
    largest_deg_s: float = 150.0
    #: The largest command
    largest_pulses: int = 60
    #: Cycles from a command to its pulses
    delay_cycles: int = 1
    #: Scale factor of pulses of sign + less that of sign -, for the comparison of `MODULATIONS`; not printed
    asymmetry_ppm: float = 100.0

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            if not 0 < value < math.inf:
                raise InputError(f"{one.name} is {value:g}; a number above 0 is needed")
        if self.asymmetry_ppm > 1e6:
            raise InputError(f"asymmetry_ppm is {self.asymmetry_ppm:g}; at most 1e6 is allowed")
        for name in ("gain", "lag_gain", "lag_pole", "integral_gain", "leak"):
            if getattr(self, name) > 1:
                raise InputError(f"{name} is {getattr(self, name):g}; at most 1 is allowed")

    @property
    def cycle(self) -> float:
        """Length of a cycle in s."""
        return 1 / self.cycle_hz

    @property
    def pulse_arcsec(self) -> float:
        """Q_T, the angle of a torquer pulse."""
        return self.largest_deg_s * _ARCSEC * self.cycle / self.largest_pulses

    @property
    def constants(self) -> tuple[float, ...]:
        """The constants of the control law, in the order of the kernel."""
        return self.gain, self.lag_gain, self.lag_pole, self.integral_gain, self.leak

    @property
    def steady_gain(self) -> float:
        """K_s (1/(1 + Kf) + C3 (1 - K_L)/K_L): pulses a cycle for a quantum, long after a rate began."""
        feedback = self.lag_gain / (1 - self.lag_pole)
        return self.gain * (1 / (1 + feedback) + self.integral_gain * (1 - self.leak) / self.leak)

    @cached_property
    def law(self) -> list[list[float]]:
        """The rows of the states after a cycle and of the command, in filtered, integrated and angle: it is linear."""
        filtered, integrated, angle = np.eye(3)
        rows = evaluator("pulse-torque")(filtered, integrated, angle, *self.constants)
        return [[float(value) for value in row] for row in rows]

    def _control(self, filtered: float, integrated: float, angle: float) -> list[float]:
        """Return the states after a cycle, and the command."""
        return [a * filtered + b * integrated + c * angle for a, b, c in self.law]

    def plant(self, angle: Any, rate: Any, input_rate: Any) -> tuple[Any, Any]:
        """Return angle in arcsec and rate in arcsec/s of the float after a cycle of a constant input in arcsec/s."""
        left = math.exp(-self.cycle / self.lag_s)
        return (
            angle + input_rate * self.cycle + (rate - input_rate) * self.lag_s * (1 - left),
            input_rate + (rate - input_rate) * left,
        )

    def matrices(self) -> tuple[Array, Array, Array]:
        """Return A, B, C of the loop without limit and quanta.

        The state is the float's angle in quanta, its rate in quanta a cycle, the states of the control law, and the
        commands under way; the input is a rate, and the output the commanded rate, both in quanta a cycle.
        """
        size = 4 + self.delay_cycles
        columns = [self._linear(vector, 0.0) for vector in np.eye(size)]
        outputs = [self._command(vector) for vector in np.eye(size)]
        return np.array(columns).T, self._linear(np.zeros(size), 1.0), np.array(outputs)

    def _command(self, state: Array) -> float:
        """Return the rate that the torquer makes up for in a cycle, in quanta a cycle."""
        return float(state[-1] * self.pulse_arcsec / self.quantum_arcsec)

    def _linear(self, state: Array, rate: float) -> Array:
        """Return the state after a cycle."""
        scale = self.quantum_arcsec
        net = (rate - self._command(state)) * scale * self.cycle_hz
        angle, speed = self.plant(state[0] * scale, state[1] * scale * self.cycle_hz, net)
        filtered, integrated, command = self._control(state[2], state[3], state[0])
        moved = [angle / scale, speed / scale * self.cycle, filtered, integrated, command, *state[4:-1]]
        return np.array(moved, float)

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Poles of the linear loop in z, the largest first."""
        poles = np.linalg.eigvals(self.matrices()[0]).astype(complex)
        return poles[np.argsort(-np.abs(poles))]

    def require_stable(self) -> None:
        """Refuse a loop whose oscillations grow."""
        largest = float(abs(self.poles[0]))
        if largest >= 1:
            raise InputError(
                f"the loop is unstable: a pole of its linear form has the magnitude {largest:.4g}; below 1 is needed, "
                "so a smaller gain or delay"
            )

    def response(self, hertz: Any) -> Array:
        """Return the gain from the input rate to the commanded rate at frequencies in Hz."""
        a, b, c = self.matrices()
        z = np.exp(2j * np.pi * np.atleast_1d(np.asarray(hertz, float)) * self.cycle)
        gains = [abs(c @ np.linalg.solve(x * np.eye(len(a)) - a, b)) for x in z]
        return np.array(gains)

    def pulses_on(self, command: float, modulation: str) -> float:
        """Return how many pulses of either sign drive the torquer in a cycle: all of them in binary torquing."""
        return self.largest_pulses if modulation == "binary" else abs(command)

    def run(
        self,
        rate_deg_s: Callable[[Any], Any],
        cycles: int,
        angle_arcsec: float = 0.0,
        quantised: bool = False,
        modulation: str = "",
    ) -> tuple[Array, Array]:
        """Run the loop.

        `rate_deg_s`: the rate of the gyro's case in deg/s, from times in s. With a modulation pulses have their
        asymmetry. Returns (cycles,): of the float in arcsec at the beginning of each cycle. Returns (cycles,): in
        pulses.
        """
        times = np.arange(cycles) * self.cycle
        rates = rate_deg_s(times) * _ARCSEC + 0 * times
        angles, commands = np.empty(cycles), np.empty(cycles)
        angle, speed, filtered, integrated = angle_arcsec, 0.0, 0.0, 0.0
        under_way = [0.0] * self.delay_cycles
        for k in range(cycles):
            seen = angle / self.quantum_arcsec
            read = float(round(seen)) if quantised else seen
            filtered, integrated, command = self._control(filtered, integrated, read)
            if quantised:
                command = float(max(-self.largest_pulses, min(self.largest_pulses, round(command))))
            angles[k], commands[k] = angle, command
            net = rates[k] - under_way.pop(0) * self.pulse_arcsec * self.cycle_hz
            uneven = self.asymmetry_ppm / 2e6 * self.pulses_on(command, modulation) if modulation else 0.0
            under_way.append(command + uneven)
            angle, speed = self.plant(angle, speed, net)
        return angles, commands


#: The step of the float angle in arcsec, the rate in deg/s below the limit, and the angular acceleration in rad/s^2.
STEP, RATE_PART, ACCELERATION = 240.0, 0.99, 5.0
#: Times in s at which the angle under that acceleration is read, and how long the others are run.
TIMES = (0.05, 0.1)
_STEP_S, _RATE_S = 0.25, 3.0
#: Half of the power.
_HALF = 2**-0.5
_HIGHEST_HZ = 400.0
PRINTED = {
    "rise_ms": 3.75,
    "overshoot_percent": 20.0,
    "offset_quanta": 44.0,
    "offset_arcsec": 350.0,
    "bandwidth_hz": 80.0,
    "angle_at_0.05_s_arcsec": None,
    "angle_at_0.1_s_arcsec": 80.0,
}
#: What a quantity is, for a reader.
MEANINGS = {
    "rise_ms": f"rise from 10 to 90 % of a step of {STEP:g} arcsec, ms",
    "overshoot_percent": "overshoot, %; printed: below",
    "offset_quanta": "offset at the largest rate, quanta",
    "offset_arcsec": "offset at the largest rate, arcsec",
    "bandwidth_hz": "bandwidth, Hz",
    "angle_at_0.05_s_arcsec": f"angle under {ACCELERATION:g} rad/s^2 after 0.05 s, arcsec",
    "angle_at_0.1_s_arcsec": f"angle under {ACCELERATION:g} rad/s^2 after 0.1 s, arcsec",
}


@dataclass(frozen=True)
class TorquingRow:
    """A quantity of the loop."""

    #: A key of `PRINTED`
    quantity: str
    #: What the source prints, the loop without quanta and limit, and with them; None where there is none
    printed: float | None
    linear: float
    quantised: float | None


def rise(angle: Array, loop: TorqueLoop) -> float:
    """Return the time in s from 10 to 90 % of a step, between cycles by straight lines."""
    start = angle[0]
    times = []
    for part in (0.9, 0.1):
        k = int(np.argmax(angle < part * start))
        before, after = angle[k - 1], angle[k]
        times.append((k - 1 + (before - part * start) / (before - after)) * loop.cycle)
    return float(times[1] - times[0])


def bandwidth(loop: TorqueLoop) -> float:
    """Return the frequency in Hz above the peak at which the commanded rate has half of the power."""
    low, high = 1.0, min(_HIGHEST_HZ, loop.cycle_hz / 2)
    hertz = np.linspace(low, high, 2000)
    gains = loop.response(hertz)
    peak = int(np.argmax(gains))
    below = np.flatnonzero(gains[peak:] < _HALF)
    if not len(below):
        return float("nan")
    k = peak + int(below[0])
    return float(np.interp(-_HALF, -gains[k - 1 : k + 1], hertz[k - 1 : k + 1]))


def torquing_rows(loop: TorqueLoop) -> Iterator[TorquingRow]:
    """Run a loop, and yield every quantity."""
    cycles = round(_STEP_S * loop.cycle_hz)
    steps = [loop.run(np.zeros_like, cycles, STEP, quantised)[0] for quantised in (False, True)]
    rises = [rise(angle, loop) * 1e3 for angle in steps]
    rises[1] = round(rises[1] / 1e3 / loop.cycle) * loop.cycle * 1e3  # whole cycles
    yield TorquingRow("rise_ms", PRINTED["rise_ms"], *rises)
    overshoots = [float(-angle.min() / STEP * 100) for angle in steps]
    yield TorquingRow("overshoot_percent", PRINTED["overshoot_percent"], *overshoots)
    linear = loop.largest_pulses / loop.steady_gain
    rate = RATE_PART * loop.largest_deg_s
    angle, _ = loop.run(lambda t: rate + 0 * t, round(_RATE_S * loop.cycle_hz), 0.0, True)
    offset = float(angle[len(angle) // 2 :].mean() / loop.quantum_arcsec)
    yield TorquingRow("offset_quanta", PRINTED["offset_quanta"], linear, offset)
    unit = loop.quantum_arcsec
    yield TorquingRow("offset_arcsec", PRINTED["offset_arcsec"], linear * unit, offset * unit)
    yield TorquingRow("bandwidth_hz", PRINTED["bandwidth_hz"], bandwidth(loop), None)
    cycles = round((TIMES[-1] + 0.02) * loop.cycle_hz)
    turning = [
        loop.run(lambda t: np.degrees(ACCELERATION) * t, cycles, 0.0, quantised)[0]
        for quantised in (False, True)
    ]
    for time in TIMES:
        k = round(time * loop.cycle_hz)
        name = f"angle_at_{time:g}_s_arcsec"
        yield TorquingRow(name, PRINTED[name], *(float(angle[k]) for angle in turning))


#: How a command becomes pulses: those of its sign, or all, of both signs, whose difference it is.
MODULATIONS = ("ternary", "binary")
#: Rates of their comparison in parts of the largest.
_PARTS = (0.0, 0.5, -0.5)


@dataclass(frozen=True)
class ModulationRow:
    """What a modulation of the torquer costs at a rate."""

    #: A name of `MODULATIONS`
    modulation: str
    rate_deg_s: float
    #: Part of the largest power that heats the torquer
    power: float
    #: Error of the measured rate by the asymmetry: in closed form, and of a run of the loop without quanta
    drift_deg_h: float
    run_drift_deg_h: float


def modulation_rows(loop: TorqueLoop) -> Iterator[ModulationRow]:
    """Compare the modulations: pulses p of both signs turn the float by p a/2 more than their sum, a the asymmetry."""
    cycles = round(_RATE_S * loop.cycle_hz)
    per_pulse = loop.pulse_arcsec * loop.cycle_hz  # deg/h is arcsec/s
    half = loop.asymmetry_ppm / 2e6
    for modulation in MODULATIONS:
        for part in _PARTS:
            rate = part * loop.largest_deg_s
            _, commands = loop.run(lambda t, rate=rate: rate + 0 * t, cycles, modulation=modulation)  # type: ignore[misc]
            measured = float(commands[cycles // 2 :].mean())
            true = rate * _ARCSEC / per_pulse
            on = loop.pulses_on(measured, modulation)
            exact = -half * on if modulation == "binary" else true / (1 + math.copysign(half, true)) - true
            yield ModulationRow(
                modulation, rate, on / loop.largest_pulses, exact * per_pulse, (measured - true) * per_pulse
            )


_FIGURES = ("printed", "linear", "quantised")
_MODULATION_COLUMNS = (
    Column("torquing", "<"),
    Column("rate, deg/s", spec="g"),
    Column("power", spec=".3g"),
    Column("drift, deg/h", spec=".4f"),
    Column("drift of a run", spec=".4f"),
)
#: Frequencies of the printed gains and of a picture in Hz.
HERTZ = (10, 40, 80, 120)


@dataclass(frozen=True)
class TorquingResult(Result):
    """The responses of a pulse torquing loop."""

    rows_in = "figures"
    computed: ClassVar[Properties] = properties(largest_pole=entry(), gains=entry(), modulations=entry())
    drawn_by: ClassVar[str] = f"{__name__}:torquing_image"

    loop: TorqueLoop
    figures: Sequence[TorquingRow] = field(metadata=entry(key="rows"))

    @property
    def largest_pole(self) -> float:
        """Magnitude of the largest pole of the linear loop."""
        return float(abs(self.loop.poles[0]))

    @property
    def gains(self) -> dict[str, float]:
        """Gain from rate to commanded rate by frequency, linear."""
        gains = zip(HERTZ, self.loop.response(HERTZ), strict=True)
        return {f"{hertz} Hz": float(gain) for hertz, gain in gains}

    @cached_property
    def modulations(self) -> list[ModulationRow]:
        """Binary torquing beside ternary."""
        return list(modulation_rows(self.loop))

    def text(self) -> str:
        """Return the figures beside the printed ones, the gains, and both modulations."""
        table = TextTable(
            [Column("", "<"), *(Column(name, spec=".5g") for name in _FIGURES)],
            [[MEANINGS[row.quantity], *(getattr(row, name) for name in _FIGURES)] for row in self.figures],
        )
        shown = ", ".join(f"{gain:.4f} at {hertz}" for hertz, gain in self.gains.items())
        return "\n".join(
            [
                *table.lines(),
                "",
                f"gain from rate to commanded rate, linear: {shown}",
                f"largest pole of the linear loop: {self.largest_pole:.7f}; pulse {self.loop.pulse_arcsec:g} arcsec, "
                f"{self.loop.steady_gain:.6g} pulses a cycle for a quantum",
                "quantised: angle in whole quanta, command in whole pulses up to the largest; its offset is that at "
                "99 % of the largest rate",
                "",
                f"modulation, scale factors of the signs {self.loop.asymmetry_ppm:g} ppm apart:",
                *TextTable(_MODULATION_COLUMNS, [[*vars(row).values()] for row in self.modulations]).lines(),
            ]
        )


def torquing_image(result: TorquingResult, path: str | Path) -> bytes:
    """Return the step of the float angle and the gain over frequency."""
    loop = result.loop
    figure, (step, response) = figures.pyplot().subplots(1, 2, figsize=(10.4, 4.2), layout="constrained")
    cycles = round(0.05 * loop.cycle_hz)
    time = np.arange(cycles) * loop.cycle * 1e3
    for label, quantised, colour in zip(_FIGURES[1:], (False, True), figures.COLOURS, strict=False):
        angle, _ = loop.run(np.zeros_like, cycles, STEP, quantised)
        step.plot(time, angle, color=colour, linewidth=1.6, label=label)
    step.set_xlabel("time, ms")
    step.set_ylabel("float angle, arcsec")
    step.set_title(f"step of {STEP:g} arcsec", loc="left", fontsize=10)
    hertz = np.geomspace(1, min(400.0, loop.cycle_hz / 2), 300)
    response.semilogx(hertz, loop.response(hertz), color=figures.COLOURS[0], linewidth=1.6)
    response.axhline(2**-0.5, color="0.5", linewidth=1, linestyle="--")
    response.text(1.1, 2**-0.5 + 0.02, "half of the power", fontsize=8, color="0.3")
    response.set_xlabel("frequency, Hz")
    response.set_title("commanded rate for a rate of 1", loc="left", fontsize=10)
    response.set_ylim(bottom=0)
    for axes in (step, response):
        figures.style(axes)
    figures.common_legend(figure, [step], loc="outside lower center", ncols=2)
    figures.title(figure, "pulse torquing loop")
    return figures.image(figure, path)
