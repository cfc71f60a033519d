"""The commands of ``strapgen study`` that navigation brings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, ClassVar

import typer

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Excludes, Needs, OneOf, Shown, grouped, rules
from strapgen.cli.options import Duration, FastBackends, OneBackend, Processor, a_backend, option
from strapgen.cli.output import Output
from strapgen.cli.progress import track
from strapgen.cli.values import NotNegative, Number, Positive, Vector, filled, names, whole
from strapgen.ir.exceptions import InputError
from strapgen.lab.run_options import (
    MOTION_SETTINGS,
    MotionSettings,
    SensorFile,
    in_words,
    motion_option,
    read_errors,
)

_SampleRate = Annotated[
    Positive | None,
    option(
        "--sample-hz",
        metavar="HZ",
        help="Samples of the sensors in a second, in place of those in the file.",
        panel="Input",
    ),
]
_Aligned = Annotated[
    bool,
    option(
        "--aligned",
        help="With --errors: begin with the vertical that the sensors measure, as after an alignment at rest.",
        panel="Input",
    ),
]
_Runs = Annotated[
    int,
    option(
        "--runs",
        metavar="N",
        help="Runs, each with numbers of its own.",
        panel="Run",
        read=whole(10, 10**5),
    ),
]


@grouped
@rules(Needs("--aligned", "--errors"))
def study_system(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="TOML file that describes the system.")],
    *,
    backend: Annotated[
        tuple[str, ...],
        option(
            "--backend",
            metavar="NAME,...",
            help="Back ends beside C in double, with commas between; strapgen list backends shows all.",
            panel="Run",
            read=a_backend,
        ),
    ] = ("c-float", "c-fixed32", "c-fixed16"),
    sample_hz: _SampleRate = None,
    duration: Duration = Positive("60"),
    motion: Annotated[str, motion_option("swinging")] = "swinging",
    settings: MotionSettings = None,
    turn_rate_deg_s: Annotated[
        Positive | None,
        option(
            "--turn-rate-deg-s",
            metavar="RATE",
            help="Largest rate of heading in deg/s of the motion swinging; --set turn_rate_deg_s.",
            panel="Input",
        ),
    ] = None,
    latitude_deg: Annotated[
        Number | None,
        option("--latitude-deg", metavar="DEG", help="Latitude in deg; --set latitude_deg.", panel="Input"),
    ] = None,
    spectrum: Annotated[
        Path | None,
        option(
            "--spectrum",
            metavar="FILE",
            help="CSV file with the spectrum of a vibration, as strapgen vibration takes it.",
            panel="Input",
        ),
    ] = None,
    errors: SensorFile = None,
    aligned: _Aligned = False,
    cpu: Processor = None,
    fixed: Annotated[FixedOptions, Shown(only=("rounding", "carry", "allowance"))],
    output: Output,
) -> None:
    """Run a described system on several back ends, and compare attitude, velocity and position.

    A vehicle moves over the earth, or stands on one spot, turns to and fro, rolls and pitches; it may vibrate. You see
    the errors of attitude, velocity and position by cause: those of the algorithm in double, what the word lengths of
    other back ends and the errors of the sensors add; and memory and load of all, beside those of 1984. Differences add
    up in a closed run, and no bound is known for them; strapgen compare holds each single pass to its bound.

    Example: strapgen study system examples/strapdown.toml --sample-hz 100 --duration 60

    Example: strapgen study system examples/strapdown.toml --sample-hz 100 --motion polar --duration 300
    """
    output.check(file, spectrum, errors)
    from strapgen.analysis.vibration.spectrum import read_spectrum
    from strapgen.navigation.systems.system_study import SystemStudyResult, study
    from strapgen.navigation.systems.wiring import described
    from strapgen.navigation.vehicle.vehicle_motions import named, shaken, vibration

    stated = {"turn_rate_deg_s": turn_rate_deg_s, "latitude_deg": latitude_deg}
    values = {**(settings or {}), **{key: str(value) for key, value in stated.items() if value is not None}}
    flown = named(motion, values)
    if spectrum is not None:
        flown = shaken(flown, vibration(read_spectrum(spectrum)))
    system = described(file, sample_hz)
    result = study(
        system, flown, duration, backend, fixed.settings(1), cpu or "", read_errors(errors), aligned
    )
    output.show(
        SystemStudyResult.of(result, (in_words(values) and f"{motion} ({in_words(values)})") or motion)
    )


@grouped
@rules(OneOf("--errors", needed="--errors is needed"))
def study_flight_errors(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="TOML file that describes the system.")],
    *,
    motion: Annotated[str, motion_option("great-circle")] = "great-circle",
    settings: MotionSettings = None,
    duration: Duration = Positive("3600"),
    sample_hz: _SampleRate = None,
    errors: SensorFile = None,
    aligned: _Aligned = False,
    runs: _Runs = 200,
    backend: OneBackend = "c",
    output: Output,
) -> None:
    """Measure velocity and position errors due to sensor errors over many runs, beside their covariance.

    You see the standard deviations of attitude, velocity and position at the end, in many runs of a described system
    and predicted along the motion in closed form, with the predicted ones by cause and in nautical miles an hour. The
    vertical channel is held.

    Example: strapgen study flight-errors examples/navigator.toml --errors ins-1 --motion great-circle --duration 600
    """
    output.check(file, errors)
    from strapgen.navigation.systems import flight_errors
    from strapgen.navigation.systems.system_flight import NavigationCells
    from strapgen.navigation.systems.system_runner import system_runner
    from strapgen.navigation.systems.wiring import described
    from strapgen.navigation.vehicle.vehicle_motions import named

    sensors = read_errors(errors)
    assert sensors is not None, "the command needs a file"
    runner = system_runner(described(file, sample_hz), backend)
    slowest = max(runner.system.every(name) for name in runner.system.outputs)
    NavigationCells.of(runner.system)
    flown, values = named(motion, settings or {}), in_words(settings or {})
    records = flight_errors.records_of(duration, slowest / runner.system.sample_hz)
    predicted = flight_errors.spread(flown, sensors, duration, records, aligned)
    measured = flight_errors.runs(runner, flown, sensors, duration, records, runs, aligned)
    facts = {
        "system": runner.system.name,
        "errors": str(errors),
        "motion": f"{motion} ({values})" if values else motion,
    }
    output.show(flight_errors.FlightErrorsResult.of(facts, duration, measured, predicted))


@grouped
def study_attitude_form(
    *,
    update_hz: Annotated[
        Positive, option("--update-hz", metavar="HZ", help="Slow cycles in a second.", panel="Rates")
    ] = Positive("50"),
    navigation_hz: Annotated[
        NotNegative,
        option(
            "--navigation-hz", metavar="HZ", help="Cycles of the navigation frame in a second.", panel="Rates"
        ),
    ] = NotNegative("10"),
    orthonormalize_hz: Annotated[
        NotNegative,
        option(
            "--orthonormalize-hz",
            metavar="HZ",
            help="Orthonormalizations in a second; 0: none.",
            panel="Rates",
        ),
    ] = NotNegative("1"),
    max_rate_deg_s: Annotated[
        Positive,
        option("--max-rate-deg-s", metavar="DEG_S", help="Largest body rate in deg/s.", panel="Rates"),
    ] = Positive("70"),
    velocity_error: Annotated[
        Number,
        option(
            "--velocity-error",
            metavar="PART",
            help="Error of (47) that is allowed, as a part of the velocity increment.",
            panel="Rates",
        ),
    ] = Number("1e-4"),
    without: Annotated[
        tuple[str, ...] | None,
        option(
            "--without",
            metavar="PART,...",
            help="Parts that are there already: update, matrix, velocity, orthonormalization, navigation.",
            panel="Run",
        ),
    ] = None,
    cpu: Processor = None,
    fixed: Annotated[FixedOptions, Shown(only=("word",))],
    output: Output,
) -> None:
    """Count the operations of a navigator with direction cosines, two rows of them, or a quaternion.

    You see the operations of each part, and those of each form in a second at your rates. Below them is the velocity
    error due to the attitude of first order inside a slow cycle, which the sculling integral takes.

    Example: strapgen study attitude-form --update-hz 100 --max-rate-deg-s 200
    """
    output.check()
    import math

    from strapgen.lab import cost
    from strapgen.navigation import attitude_form as forms

    rates = forms.PartRates(float(update_hz), float(navigation_hz), float(orthonormalize_hz))
    which = forms.pairs(without or ())
    loss = forms.truncation(rates, math.radians(max_rate_deg_s), float(velocity_error))
    if cpu is not None:
        cost.processors(cpus=[cpu])
    settings = fixed.settings(1) if cpu else None
    costs = forms.part_costs(which, rates, cpu or "", settings)
    parts = list(track(costs, "counting", len(which)))
    output.show(forms.FormResult.of(rates, parts, loss, cpu))


@grouped
@rules(Excludes("FILE", "--cutoff-hz --sample-hz --largest", reason="FILE states the filter"))
def study_output_filter(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            help="TOML file with a filter.  [default: a Butterworth filter of second order]",
            show_default=False,
        ),
    ] = None,
    *,
    cutoff_hz: Annotated[
        Positive, option("--cutoff-hz", metavar="HZ", help="Edge, which is damped by 3 dB.", panel="Filter")
    ] = Positive("3.2"),
    sample_hz: Annotated[
        Positive, option("--sample-hz", metavar="HZ", help="Samples in a second.", panel="Filter")
    ] = Positive("50"),
    largest: Annotated[
        Positive,
        option(
            "--largest", metavar="SAMPLE", help="Largest magnitude of a sample, in its unit.", panel="Filter"
        ),
    ] = Positive("128"),
    frequencies: Annotated[
        tuple[Number, ...] | None,
        option(
            "--frequency-hz",
            metavar="HZ,...",
            help="Frequencies that are measured, with sines.  [default: 0.32,1,3.2,8,10,20; of a file its corners, "
            "half and twice of each]",
            panel="Run",
        ),
    ] = None,
    backend: Annotated[
        tuple[str, ...],
        option(
            "--backend",
            metavar="NAME,...",
            help="Back ends, with commas between; strapgen list backends shows all.",
            panel="Run",
            read=a_backend,
        ),
    ] = ("c", "c-fixed32", "c-fixed16"),
    output: Output,
) -> None:
    """Measure a filter on several back ends, beside its analog and digital response.

    You also see the error after the filter has settled, for a constant input and for none, without and with error
    feedback in fixed point, and its bound in a run of any length, which no limit cycle exceeds. The filter is that of a
    file, or a Butterworth filter of second order.

    Example: strapgen study output-filter --cutoff-hz 8 --sample-hz 100

    Example: strapgen study output-filter --cutoff-hz 8 --sample-hz 100
    """
    output.check(file)
    from strapgen.navigation.filters import filter_study as experiment
    from strapgen.navigation.filters.filter_file import read
    from strapgen.navigation.filters.filter_study import AnyFilter, FilterResult, OutputFilter

    size = float(largest)
    if file is None:
        measured_filter: AnyFilter = OutputFilter(float(cutoff_hz), float(sample_hz))
    else:
        measured_filter = read(file)
        size = float(measured_filter.range)
    asked = experiment.usual_frequencies(measured_filter) if frequencies is None else frequencies
    tones = experiment.check_frequencies(measured_filter, [*map(float, asked)])
    which = experiment.runs([*backend])
    measured = track(experiment.measure(which, measured_filter, size, tones), "measuring", len(which))
    output.show(FilterResult.of(measured_filter, size, tones, list(measured)))


@grouped
def study_redundancy(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE", help="TOML file with axes.  [default: the hexad of 1984]", show_default=False
        ),
    ] = None,
    *,
    trials: Annotated[
        int,
        option(
            "--trials",
            metavar="N",
            help="Trials for every size of a failure.",
            panel="Run",
            read=whole(1, 1_000_000),
        ),
    ] = 2000,
    seed: Annotated[
        int, option("--seed", metavar="N", help="Seed of the random numbers.", panel="Run", read=whole(0))
    ] = 1,
    backend: Annotated[
        str,
        option(
            "--backend",
            metavar="NAME",
            help="Back end: numpy, c or c-float.",
            panel="Run",
            read=names(("numpy", "c", "c-float")),
        ),
    ] = "numpy",
    settings: Annotated[
        dict[str, Fraction] | None,
        option(
            "--set",
            metavar="KEY=VALUE...",
            help="Errors and trip levels: cycle_s, rate_deg_s, load_g, noise_arcsec, pulse_arcsec, bias_deg_h, "
            "scale_ppm, bending_arcmin_g, trip_sigmas, trip_rate.",
            panel="Input",
            words="strapgen.navigation.redundancy.redundancy_study:SensorErrors",
        ),
    ] = None,
    output: Output,
) -> None:
    """Count detected, isolated and missed failures of redundant gyros by Monte Carlo.

    Sensors have quantization, noise, bias, scale factor errors and bending, and fail one after the other, by steps of
    many sizes. You see how often an equation fails, which sensor is isolated, and whether the triad is sound: by the
    rule of the kernel and by the tables.

    Example: strapgen study redundancy --trials 500 --plot out/redundancy.png
    """
    output.check(file)
    from strapgen.navigation.redundancy.redundancy_kernels import HEXAD_SET, read
    from strapgen.navigation.redundancy.redundancy_study import (
        RedundancyResult,
        SensorErrors,
        redundancy_study,
        study_steps,
    )

    errors = filled(SensorErrors, settings)
    sensors = HEXAD_SET if file is None else read(file)
    steps = redundancy_study(sensors, errors, trials, seed, backend)
    rows = list(track(steps, "running", len(study_steps(sensors.geometry))))
    output.show(RedundancyResult(sensors, errors, rows))


@grouped
@rules(Needs("--errors-per-degree --runs", "--errors"))
def study_calibration(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="TOML file with positions and turns.", show_default=False),
    ],
    *,
    errors: SensorFile = None,
    errors_per_degree: Annotated[
        str | None,
        option(
            "--errors-per-degree",
            metavar="FILE",
            help="TOML file of sensor errors that come in by a degree of temperature.",
            panel="Input",
        ),
    ] = None,
    runs: _Runs = 200,
    rate_deg_s: Annotated[
        Vector | None,
        option(
            "--rate-deg-s",
            metavar="X,Y,Z",
            help="Rate in flight, body axes, to show what compensation leaves there.",
            panel="Input",
        ),
    ] = None,
    acceleration_g: Annotated[
        Vector | None,
        option(
            "--acceleration-g", metavar="X,Y,Z", help="Acceleration in flight in g, body axes.", panel="Input"
        ),
    ] = None,
    output: Output,
) -> None:
    """Show which error coefficients of an IMU a calibration determines, and how accurately.

    The errors of rate and acceleration are measured at rest in positions, on a table that turns, and at temperatures.
    You see the exact rank, combinations of coefficients that cannot be observed, and the standard deviation of every
    other coefficient by least squares; with measured errors in the file, the estimates as well. A table with headings
    finds north. With --errors all is run on simulated sensors, and the errors of the estimates stand beside.

    Example: strapgen study calibration examples/positions-20.toml --plot out/calibration.png

    Example: strapgen study calibration examples/turning.toml --errors ins-1 --runs 50
    """
    output.check(file, errors, errors_per_degree)
    from strapgen.navigation.calibration import QUANTITIES, CalibrationResult, calibrated, read
    from strapgen.navigation.turntable import Session, noise_rows

    content = read(file)
    if errors_per_degree is not None and not content.temperatures_c:
        raise InputError(f"{file}: --errors-per-degree needs temperatures_c")
    scheme = content.scheme
    quantities = [*QUANTITIES] if scheme.positions or scheme.turns else []
    solved = (calibrated(scheme, quantity) for quantity in quantities)
    several = list(track(solved, "solving", len(quantities)))
    estimates, remaining = {}, {}
    for one in several:
        if one.quantity in content.errors:
            try:
                estimates[one.quantity] = one.estimate(content.errors[one.quantity])
            except InputError as error:
                raise InputError(f"{file}: {error}") from None
        if rate_deg_s is not None or acceleration_g is not None:
            turning = [math.radians(value) for value in rate_deg_s or (0, 0, 0)]
            covariance = one.error_covariance(turning, [*map(float, acceleration_g or (0, 0, 0))])
            remaining[one.quantity] = covariance * content.sigma[one.quantity] ** 2
    headings, variances, simulated = noise_rows(content), None, []
    if sensors := read_errors(errors):
        session = Session(content, sensors, read_errors(errors_per_degree))
        simulated = list(track((session.run(several, number) for number in range(runs)), "running", runs))
        headings, variances = session.heading_rows(simulated), session.variances
    output.show(CalibrationResult.of(content, several, estimates, remaining, headings, variances, simulated))


@grouped
def study_pulse_torque(
    *,
    settings: Annotated[
        dict[str, Fraction] | None,
        option(
            "--set",
            metavar="KEY=VALUE...",
            help="Constants: gain, lag_gain, lag_pole, integral_gain, leak, quantum_arcsec, lag_s, cycle_hz, "
            "largest_deg_s, largest_pulses, delay_cycles, asymmetry_ppm.  [default: those of a fit to the printed "
            "responses]",
            panel="Input",
            words="strapgen.navigation.torquing:TorqueLoop",
        ),
    ] = None,
    output: Output,
) -> None:
    """Run a pulse torquing loop beside the figures of its source.

    You see rise, overshoot, offset, bandwidth and the angle under an angular acceleration, for the linear loop and for
    one with quanta and limits, beside what the source prints; and the power and drift of binary and ternary torquing.
    A loop that is unstable is refused.

    Example: strapgen study pulse-torque --plot out/pulse-torque.png
    """
    output.check()
    from strapgen.navigation.torquing import PRINTED, TorqueLoop, TorquingResult, torquing_rows

    loop = filled(TorqueLoop, settings)
    loop.require_stable()
    rows = list(track(torquing_rows(loop), "running", len(PRINTED)))
    output.show(TorquingResult(loop, rows))


@grouped
def study_loops(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="SCHEDULE",
            help="TOML file with modes and time constants.  [default: the schedule of 1984]",
            show_default=False,
        ),
    ] = None,
    *,
    last: Annotated[
        Number,
        option("--last", metavar="S", help="Time of a last mode without an end, in s.", panel="Run"),
    ] = Number("600"),
    backend: Annotated[
        str,
        option(
            "--backend",
            metavar="NAME",
            help="Back end: numpy or c.",
            panel="Run",
            read=names(("numpy", "c")),
        ),
    ] = "numpy",
    settings: Annotated[
        dict[str, Fraction] | None,
        option(
            "--set",
            metavar="KEY=VALUE...",
            help="Errors, each run by itself: rate_deg_h, tilt_deg, velocity_m_s, heading_deg, "
            "acceleration_mg, height_m.",
            panel="Input",
            words="strapgen.navigation.loops.loop_errors:LoopErrors",
        ),
    ] = None,
    output: Output,
) -> None:
    """Run levelling, heading and vertical loop of an attitude and heading reference.

    You see the gains of every mode by pole placement, and the states at its end after an error: by the generated
    kernels, cycle by cycle, and by the matrix exponential. Unstable gains are refused.

    Example: strapgen study loops --set tilt_deg=2 --plot out/loops.png
    """
    output.check(file)
    from strapgen.navigation.loops.loop_errors import LoopErrors
    from strapgen.navigation.loops.loop_schedule import BUILT_IN, read
    from strapgen.navigation.loops.loops_study import (
        LOOPS,
        LoopsResult,
        cycles_of_modes,
        run_loops,
        schedule_gains,
    )

    errors = filled(LoopErrors, settings)
    schedule = read(BUILT_IN if file is None else file)
    modes = schedule.timed(last)
    cycles_of_modes(schedule, modes)
    gains = schedule_gains(schedule)
    courses = tuple(track(run_loops(schedule, modes, errors, backend), "running", len(LOOPS)))
    output.show(LoopsResult.of(schedule, modes, errors, gains, courses))


def force_settings(values: Mapping[str, Any]) -> list[str]:
    """Return the settings of the specific force that a command line names."""
    from strapgen.lab.motions.specific_forces import keys

    return [f"{key}=" for choices in keys(str(values["force"])).values() for key in choices]


@dataclass(frozen=True)
class FlightOptions:
    """Options of the motion, the specific force and the sampling."""

    panel: ClassVar[str] = "Input"

    motion: Annotated[str, motion_option()] = "random"
    settings: Annotated[
        dict[str, str] | None,
        option(
            "--set",
            metavar="KEY=VALUE...",
            help="Parameters of the motion; strapgen list motions shows their names.  [default: rate_deg_s=60]",
            words=MOTION_SETTINGS,
        ),
    ] = None
    force: Annotated[
        str,
        option(
            "--force",
            metavar="NAME",
            help="Specific force in body axes: constant, random, oscillation, or lever for sensors on an arm.",
            words=("constant", "random", "oscillation", "lever"),
        ),
    ] = "random"
    force_settings: Annotated[
        dict[str, str] | None,
        option(
            "--force-set",
            metavar="KEY=VALUE...",
            help="Parameters of the force, such as rms_m_s2, swing_y_g, frequency_hz, x_m.  "
            "[default: rms_m_s2=10 z_g=1]",
            words=f"{__name__}:force_settings",
        ),
    ] = None
    sample_hz: Annotated[Positive, option("--sample-hz", metavar="HZ", help="Sampling rate in Hz.")] = (
        Positive("100")
    )
    duration: Duration = Positive("60")

    def described(self) -> str:
        """Return the motion and the force in words."""
        motion, force = map(in_words, self.stated())
        return f"{self.motion} motion ({motion}), {self.force} specific force ({force})"

    def stated(self) -> tuple[dict[str, str], dict[str, str]]:
        """Return the settings of the motion and of the force, with their defaults."""
        motion = {"rate_deg_s": "60"} if self.motion == "random" else {}
        force = {"rms_m_s2": "10", "z_g": "1"} if self.force == "random" else {}
        return self.settings or motion, self.force_settings or force


@grouped
def study_velocity_position(
    *,
    methods: Annotated[
        tuple[str, ...] | None,
        option(
            *("--method", "--methods"),
            metavar="NAME,...",
            help="Methods, each with all of its samples or one choice of them, as in coning-combined:3+3; "
            "two-speed:N is the recursion with N samples in a slow cycle.  [default: one of each kind]",
            panel="Algorithm",
        ),
    ] = None,
    backend: Annotated[
        str,
        option(
            "--backend",
            metavar="NAME",
            help="Back end; strapgen list backends shows all.",
            panel="Algorithm",
            read=a_backend,
        ),
    ] = "numpy",
    carry: Annotated[
        str,
        option(
            "--carry",
            metavar="NAME",
            help="Error feedback of the attitude in fixed point: none, state, full.",
            panel="Algorithm",
            read=names(("none", "state", "full")),
        ),
    ] = "none",
    flight: FlightOptions,
    output: Output,
) -> None:
    """Measure velocity and position along a motion with a specific force.

    Every method of the attitude has one for velocity and position, on the same samples. You see the largest errors of
    both beside the operations for each sample. Gravity acts along -z; its part is exact. A back end in fixed point adds
    its rounding.

    Example: strapgen study velocity-position --method rk4:2,coning-combined:3+3 --duration 6

    Example: strapgen study velocity-position --method window-7-7 --motion cone --set half_angle_deg=1 frequency_hz=10
    --force oscillation --force-set swing_y_g=1 frequency_hz=10 z_g=1 --backend c
    """
    output.check()
    from strapgen.lab.motions.specific_forces import force
    from strapgen.lab.motions.users_motions import any_motion
    from strapgen.navigation import translations as experiment
    from strapgen.navigation.translations import TranslationResult
    from strapgen.run.backends import BACKENDS

    if carry != "none" and not BACKENDS[backend].fixed:
        raise InputError(f"--carry goes with a back end of fixed point, not with {backend}")
    motion_settings, force_settings = flight.stated()
    several = experiment.candidates(methods or experiment.DEFAULT)
    course = experiment.TestProfile(
        any_motion(flight.motion, flight.duration, motion_settings),
        force(flight.force, **force_settings),
        flight.sample_hz,
        flight.duration,
        backend,
        carry,
    )
    rows = list(track(experiment.study(several, course), "running", len(several)))
    output.show(TranslationResult.of(rows, course, flight.described()))


@grouped
def rate_table(
    *,
    algorithm: Annotated[
        tuple[str, ...] | None,
        option(
            "--algorithm",
            "--algorithms",
            metavar="NAME,...",
            help="Algorithms, with commas between: dcm, euler, cayley-klein, two-speed.  [default: all]",
            panel="Algorithm",
            words=("dcm", "euler", "cayley-klein", "two-speed"),
        ),
    ] = None,
    method: Annotated[
        tuple[str, ...] | None,
        option(
            "--method",
            metavar="NAME,...",
            help="Methods of the attitude steps, with commas between; strapgen list methods shows all.  [default: six]",
            panel="Algorithm",
        ),
    ] = None,
    backend: FastBackends = None,
    duration: Duration = Positive("3600"),
    sample: Annotated[
        Positive, option("--sample", metavar="S", help="Time between gyro samples in s.", panel="Input")
    ] = Positive("0.01"),
    fixed: Annotated[FixedOptions, Shown(only=("rounding", "carry"))],
    output: Output,
) -> None:
    """Run the rate-table test of 1984 on every algorithm and back end.

    The table turns at 70 deg/s about all three axes, in one direction and oscillating, so that the pitch passes through
    90 deg again and again. You see the largest drift of every run. Attitude steps are orthonormalized every second;
    algorithms in two speeds are not.

    Example: strapgen rate-table --duration 20 --algorithm euler,two-speed --backend numpy,c
    """
    output.check()
    from strapgen.navigation import rate_table as experiment
    from strapgen.navigation.rate_table import RateTableResult

    names, places = algorithm or experiment.ALGORITHMS, backend or experiment.DEFAULT_BACKENDS
    count = len(list(experiment.cases(names, places, method)))
    runs = experiment.stress(duration, sample, 1, places, names, fixed.settings(1), method)
    output.show(RateTableResult(list(track(runs, "running", count)), str(duration), str(sample)))
