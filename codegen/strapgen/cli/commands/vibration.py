"""strapgen vibration."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapgen.cli.options import Previous, Rates, TableauFile, check_format, chosen, print_json, whole
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.reports.vibration import AssessedCase
    from strapgen.vibration import Assessment

_Text = str | None


FrequencyHz = Annotated[
    _Text, typer.Option("--frequency-hz", metavar="F", help="Frequency f in Hz.", show_default=False)
]
Step = Annotated[
    _Text,
    typer.Option(
        "--step",
        metavar="S",
        help="Step T in s; of algorithms in two speeds the slow cycle.",
        show_default=False,
    ),
]
ThetaX = Annotated[
    _Text,
    typer.Option(
        "--theta-x-rad", metavar="X", help="Amplitude of the angle about x in rad.", show_default=False
    ),
]
ThetaY = Annotated[
    _Text,
    typer.Option(
        "--theta-y-rad", metavar="Y", help="Amplitude of the angle about y in rad.", show_default=False
    ),
]
Phase = Annotated[
    _Text, typer.Option("--phase-rad", metavar="P", help="Phase of y before x in rad.", show_default=False)
]
AccelerationY = Annotated[
    _Text,
    typer.Option(
        "--acceleration-y",
        metavar="M_S2",
        help="Amplitude of the acceleration along y in m/s^2: the sculling rates too.",
        show_default=False,
    ),
]


def vibration(
    algorithm: Annotated[
        str,
        typer.Argument(
            help="dcm, euler, cayley-klein, rotation-vector, sculling, a fast loop (coning-fast, sculling-fast-1, "
            "sculling-fast-2, two-speed-fast-1, two-speed-fast-2), two-speed (both loops), or your own Python file."
        ),
    ],
    methods: Annotated[
        _Text,
        typer.Option("--method", metavar="NAME,...", help="Methods.  [default: rk4]", show_default=False),
    ] = None,
    tableau: TableauFile = None,
    increments: Annotated[
        _Text,
        typer.Option(
            "--increments",
            metavar="N,...",
            help="Angle increments a step; in two speeds the fast cycles in a step.  [default: 2]",
            show_default=False,
        ),
    ] = None,
    previous: Previous = None,
    rates: Rates = False,
    frequency: FrequencyHz = None,
    step: Step = None,
    theta_x: ThetaX = None,
    theta_y: ThetaY = None,
    phase: Phase = None,
    acceleration: AccelerationY = None,
    spectrum: Annotated[
        Path | None,
        typer.Option(
            "--spectrum",
            metavar="FILE",
            help="Random vibration in place of one frequency: a CSV of frequency_hz, density, angle_x_rad, "
            "angle_x_phase_rad, ...",
            show_default=False,
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", help="Image file for the errors against frequency.", show_default=False),
    ] = None,
    span: Annotated[
        _Text,
        typer.Option(
            "--plot-hz",
            metavar="LOW,HIGH",
            help="Frequencies of the plot.  [default: up to half the sampling frequency]",
            show_default=False,
        ),
    ] = None,
    format: Annotated[str, typer.Option("--format", help="text, json or latex.")] = "text",
) -> None:
    """Assess an algorithm under vibration: the mean drift about z that it computes, the true one, and its error.

    The angles are X sin(2 pi f t) about x and Y sin(2 pi f t + P) about y; an acceleration along y has the phase P too.
    Closed forms to second order in the amplitudes are derived from the algorithm itself. Several methods, or numbers of
    increments, stand side by side.

    Of a fast loop, continuous and computed are its part within a slow cycle T_m, without the term in T_m: the slow loop
    adds that to both, so that the error is that of both loops.

    Example:

    \b
      strapgen vibration euler --method coning-compressed --increments 4 --frequency-hz 10 \\
        --step 0.04 --theta-x-rad 0.01 --theta-y-rad 0.01 --phase-rad 1.5 --acceleration-y 5
    """  # noqa: D301
    check_format(format, "latex")
    _check_vibration(
        {
            "--frequency-hz": frequency,
            "--theta-x-rad": theta_x,
            "--theta-y-rad": theta_y,
            "--phase-rad": phase,
            "--acceleration-y": acceleration,
        },
        step,
        spectrum,
        plot,
        span,
        format,
    )
    from strapgen import vibration as assessing
    from strapgen.reports import vibration as reports
    from strapgen.support.files import write_files

    cases = [
        case
        for name in _listed("--method", methods)
        for count in _listed("--increments", increments)
        for case in _assessed(
            algorithm,
            (name, tableau, count, previous, rates),
            drift=theta_y is not None,
            sculling=acceleration is not None,
            random=spectrum is not None,
        )
    ]
    outcomes: list[reports.CaseRates] = []
    amplitudes: dict[str, Any] = {}
    if spectrum is None:
        amplitudes = {
            "theta_x": theta_x,
            "theta_y": "0" if theta_y is None else theta_y,
            "phase": phase,
            "acceleration_y": "0" if acceleration is None else acceleration,
        }
        words = f"{frequency} Hz, amplitudes {theta_x} rad about x"
        words += "" if theta_y is None else f", {theta_y} rad about y"
        words += "" if acceleration is None else f", {acceleration} m/s^2 along y"
        words += f", phase {phase} rad"
        outcomes = [
            reports.CaseRates(
                case, case.assessment.rates(frequency or "", step or "", cycles=case.cycles, **amplitudes)
            )
            for case in cases
        ]
    else:
        shaken = assessing.read_spectrum(spectrum)
        words = f"spectrum {spectrum.name}, {shaken.edges[0]:g} to {shaken.edges[-1]:g} Hz"
        for case in cases:
            if case.moved(set(shaken.transfers)):
                random = assessing.random_rates(case.assessment, shaken, step or "", cycles=case.cycles)
                outcomes.append(reports.CaseRates(case, random.rates, random.quadrature))
        if not outcomes:
            raise InputError(
                f"{spectrum} moves {', '.join(shaken.transfers)}; angles about x and y, or an angle and "
                f"an acceleration across it, are needed for {cases[0].assessment.kernel}"
            )
    if plot is not None:
        write_files(Path(), {str(plot): _image(cases, amplitudes, step, frequency, span, words, plot)})
    title = f"{words}; step {step} s"
    if format == "json":
        data = reports.vibration_data(outcomes)
        print_json(data[0] if len(data) == 1 else data)
    elif format == "latex":
        typer.echo(reports.vibration_latex(cases))
    else:
        typer.echo(reports.vibration_text(outcomes, title))


def _check_vibration(
    numbers: dict[str, _Text],
    step: _Text,
    spectrum: Path | None,
    plot: Path | None,
    span: _Text,
    format: str,
) -> None:
    """Check that one frequency or a spectrum is given, with all that goes with it."""
    if step is None:
        raise InputError("--step in s is needed")
    if spectrum is not None:
        for name, value in {**numbers, "--plot": plot, "--plot-hz": span}.items():
            if value is not None:
                raise InputError(f"{name} goes with one frequency, not with --spectrum")
        if format == "latex":
            raise InputError(
                "--format latex writes closed forms of one frequency; with --spectrum text or json is allowed"
            )
        return
    for name in ("--frequency-hz", "--theta-x-rad", "--phase-rad"):
        if numbers[name] is None:
            raise InputError(f"{name} is needed, or a --spectrum")
    if numbers["--theta-y-rad"] is None and numbers["--acceleration-y"] is None:
        raise InputError("--theta-y-rad is needed for the drift, or --acceleration-y for sculling")
    if span is not None and plot is None:
        raise InputError("--plot-hz goes with --plot")


def _listed(option: str, text: _Text) -> list[_Text]:
    """Return the parts of a list, each once; nothing is given where there is none."""
    if text is None:
        return [None]
    parts: list[_Text] = list(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    if not parts:
        raise InputError(f"{option} is {text!r}; a list with commas between is needed")
    return parts


def _check_known(algorithm: str, names: tuple[str, ...], own: tuple[str, ...]) -> None:
    """Check that an algorithm is one that can be assessed: a name, or a user's."""
    from strapgen import catalogue

    if algorithm in (*names, *own) or algorithm.endswith(".py"):
        return
    why = "has no rate under vibration" if algorithm in catalogue.RESERVED else "is not known"
    raise InputError(f"algorithm {algorithm!r} {why}; allowed: {', '.join(names)}, or your own Python file")


def _assessed(
    algorithm: str,
    options: tuple[_Text, Path | None, _Text, _Text, bool],
    *,
    drift: bool,
    sculling: bool,
    random: bool,
) -> list[AssessedCase]:
    """Return a case for each quantity of an algorithm that the options ask for."""
    from strapgen.catalogue.user import loading
    from strapgen.reports.vibration import AssessedCase
    from strapgen.support import checks
    from strapgen.vibration import assessment, systems

    _check_known(algorithm, (*systems.NAMES, _TWO_SPEED), tuple(loading.installed()))
    method, tableau, count, previous, rates = options
    cycles = None
    whole_algorithm = algorithm == _TWO_SPEED
    if whole_algorithm or algorithm in systems.RECURSIONS:
        if count is None:
            loop = "is in two speeds" if whole_algorithm else "is a recursion"
            raise InputError(f"{algorithm} {loop}: --increments must say how many of its cycles make a step")
        cycles = checks.count("increments", whole("increments", count), largest=checks.MOST)
        count = None
    of: Callable[[str], Assessment]
    if whole_algorithm:
        assert cycles is not None
        for option, value in (
            ("--method", method),
            ("--tableau", tableau),
            ("--previous", previous),
            ("--rates", rates or None),
        ):
            if value is not None:
                raise InputError(f"{algorithm} takes no {option}")
        can: tuple[str, ...] = ("drift", "sculling")
        of, samples = assessment.two_speed, cycles
    else:
        choice = chosen(algorithm, method, tableau, count, previous, rates, step=False)
        can = assessment.quantities(choice)
        of, samples = partial(assessment.of, choice), cycles or choice.increments_per_step
    if random:
        wanted = list(can)
    else:
        wanted = [name for name, asked in (("drift", drift), ("sculling", sculling)) if asked and name in can]
        if not wanted:
            needed = {"drift": "--theta-y-rad", "sculling": "--acceleration-y"}[can[0]]
            raise InputError(f"{algorithm} has {' and '.join(can)} rates alone; {needed} is needed")
    return [AssessedCase(of(quantity), cycles, samples) for quantity in wanted]


#: Lowest and highest frequency of a plot, by the sampling frequency.
_PLOTTED = 1e-6, 100.0
#: The fast loop and the slow loop together.
_TWO_SPEED = "two-speed"


def _image(
    cases: list[AssessedCase],
    amplitudes: dict[str, Any],
    step: _Text,
    frequency: _Text,
    span: _Text,
    words: str,
    path: Path,
) -> bytes:
    from strapgen.reports import plots
    from strapgen.support import checks
    from strapgen.vibration import curves

    length = float(checks.number("step", step or "", positive=True))
    sampling = max(case.samples for case in cases) / length
    low, high = sampling / 200, sampling / 2
    if span is not None:
        ends = span.split(",")
        if len(ends) != 2:
            raise InputError(f"plot-hz is {span!r}; two frequencies, LOW,HIGH, are needed")
        low, high = (float(checks.number("plot-hz", end, positive=True)) for end in ends)
    marked = float(checks.number("frequency-hz", frequency or ""))
    lowest, highest = (times * sampling for times in _PLOTTED)
    for option, end in (("plot-hz", low), ("plot-hz", high), ("frequency-hz", marked)):
        if not lowest <= end <= highest < math.inf:
            raise InputError(
                f"{option} is {end:g}; a plot takes {lowest:g} to {highest:g} Hz, "
                f"{_PLOTTED[0]:g} to {_PLOTTED[1]:g} times the sampling frequency"
            )
    hertz = curves.frequencies(low, high)
    drawn = [
        (case.label, curves.curve(case.assessment, hertz, step or "", cycles=case.cycles, **amplitudes))
        for case in cases
    ]
    return plots.vibration_image(
        drawn,
        f"Errors under vibration, step {step} s\n{words.partition(', ')[2]}",
        path,
        marked,
    )
