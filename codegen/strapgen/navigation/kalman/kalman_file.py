"""Reads the file of a Kalman filter: states, measurements, noise and schedule, in exact numbers and expressions."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, ClassVar

import sympy as sp

from strapgen.catalogue.toml_models import Key, UserFile, parse, rational, refused
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.kernel.kernel import DIGITS
from strapgen.kernel.reading import CONSTANTS, FUNCTIONS, expression
from strapgen.navigation.kalman import FORMS, KINDS
from strapgen.storage import streams
from strapgen.targets.names import PYTHON, C

#: Most states, measurements, inputs and steps of a filter.
MOST_STATES, MOST_STEPS = 32, 1_000_000
_NAME = Key(
    "Name; all names of the file are different",
    pattern="(?!.*__)[a-z][a-z0-9_]{0,30}(?<!_)",
    form="a name of at most 31 lower-case letters, digits and single underscores, which begins with a letter,",
)
_TAKEN = re.compile(r"state|covariance|measured|innovation(_variance)?|(next|gain)_.*")


class Term(str):
    """A number, or an expression in names, as text."""

    __slots__ = ()
    WORDS = 'a number, or a text such as "2*rate",'
    SCHEMA: ClassVar[Mapping[str, Any]] = {"type": ["number", "string"]}

    @classmethod
    def from_toml(cls, where: str, value: Any) -> Term:
        """Return the text of an entry."""
        if isinstance(value, str):
            return cls(checks.text(where, value))
        if isinstance(value, list | dict | bool):
            raise refused(where, value, cls.WORDS)
        rational(where, value)
        return cls(value)


_UNIT = Key('Unit, "1" for a pure number', pattern=r".*\S.*", form="a unit, '1' for a pure number,")


@dataclass(frozen=True)
class InputFile:
    """A signal that derivatives or measurements depend on, held over a step."""

    name: Annotated[str, _NAME]
    unit: Annotated[str, _UNIT]
    range: Annotated[Term, Key("Largest magnitude", "its unit")]
    meaning: Annotated[str, Key("Description in the header; by default its name")] = ""


@dataclass(frozen=True)
class StateFile:
    """A state and its differential equation."""

    name: Annotated[str, _NAME]
    unit: Annotated[str, _UNIT]
    derivative: Annotated[Term, Key("Its derivative, in states, inputs, parameters and noise", "its unit/s")]
    deviation: Annotated[Term, Key("Standard deviation before the first step, above 0", "its unit")]
    range: Annotated[Term | None, Key("Largest magnitude, which fixed point needs", "its unit")] = None
    initial: Annotated[Term, Key("Estimate before the first step", "its unit")] = field(default=Term("0"))
    meaning: Annotated[str, Key("Description in the header; by default its name")] = ""


@dataclass(frozen=True)
class MeasurementFile:
    """A scalar measurement."""

    name: Annotated[str, _NAME]
    unit: Annotated[str, _UNIT]
    expression: Annotated[Term, Key("What is measured, in states, inputs and parameters", "its unit")]
    deviation: Annotated[Term, Key("Standard deviation of the noise of a measurement", "its unit")]
    every: Annotated[int, Key("Steps from one measurement to the next", "1", least=1, most=MOST_STEPS)] = 1
    range: Annotated[Term | None, Key("Largest magnitude, which fixed point needs", "its unit")] = None
    meaning: Annotated[str, Key("Description in the header; by default its name")] = ""


@dataclass(frozen=True)
class NoiseFile:
    """White noise, which derivatives hold by its name: its density, or the deviation of its integral over a step."""

    density: Annotated[
        Term | None, Key("Root of the spectral density", "unit of the derivative times sqrt(s)")
    ] = None
    deviation: Annotated[
        Term | None, Key("Standard deviation of its integral over a step", "unit of the state")
    ] = None

    def __post_init__(self) -> None:
        if (self.density is None) == (self.deviation is None):
            raise InputError("one of density and deviation is needed")


@dataclass(frozen=True)
class ScheduleFile:
    """Steps and gains."""

    interval: Annotated[Term, Key("Length of a step", "s")]
    kind: Annotated[
        str, Key("Gains: steady, of a table of every step, or computed online", choices=tuple(KINDS))
    ]
    duration: Annotated[Term | None, Key("Time that a schedule, and a bound, is for", "s")] = None
    form: Annotated[str, Key("Form of the covariance of online gains", choices=tuple(FORMS))] = "joseph"
    order: Annotated[
        int,
        Key(
            "Highest power of the step in the series of a transition that is not constant",
            "1",
            least=1,
            most=8,
        ),
    ] = 4


@dataclass(frozen=True)
class KalmanFile:
    """A Kalman filter: states with their derivatives, measurements, noise and schedule."""

    state: Annotated[tuple[StateFile, ...], Key("States", least=1, most=MOST_STATES)]
    measurement: Annotated[
        tuple[MeasurementFile, ...],
        Key("Scalar measurements, in the order of their updates", least=1, most=MOST_STATES),
    ]
    schedule: Annotated[ScheduleFile, Key("Steps and gains")]
    noise: Annotated[Mapping[Annotated[str, _NAME], NoiseFile], Key("White noise, by name")] = field(
        default_factory=dict
    )
    input: Annotated[tuple[InputFile, ...], Key("Signals held over a step", most=4 * MOST_STATES)] = ()
    parameters: Annotated[
        Mapping[Annotated[str, _NAME], Term],
        Key("Numbers by name, each also as an expression in those above it"),
    ] = field(default_factory=dict)
    name: Annotated[str, replace(_NAME, text="Name in code; by default that of the file")] = ""
    title: Annotated[str, Key("One line for the head of the files")] = "A Kalman filter"


KALMAN = UserFile("a Kalman filter", KalmanFile, 1 << 20)


@dataclass(frozen=True)
class Quantity:
    """An input, a state or a measurement: its symbol, and its numbers in SI units."""

    name: str
    unit: str
    meaning: str
    symbol: sp.Symbol
    #: Largest magnitude; None where it is not stated
    range: Fraction | None
    #: Derivative of a state, or what a measurement depends on
    expression: sp.Expr = sp.S.Zero
    #: Initial standard deviation, or that of the noise of a measurement
    deviation: Fraction = Fraction(0)
    initial: Fraction = Fraction(0)
    every: int = 1


@dataclass(frozen=True)
class FilterText:
    """A filter as its file states it, in exact numbers and expressions."""

    name: str
    title: str
    command: str
    inputs: tuple[Quantity, ...]
    states: tuple[Quantity, ...]
    measurements: tuple[Quantity, ...]
    #: Symbols of the white noise, and the roots of their spectral densities
    noise: Mapping[sp.Symbol, Fraction]
    interval: Fraction
    #: Steps of the schedule; None where no duration is stated
    steps: int | None
    kind: str
    form: str
    order: int


def read(path: str | Path, form: str | None = None) -> FilterText:
    """Read the file of a Kalman filter; a form takes the place of that in the file."""
    place = checks.path("path", path)
    stem = "kalman" if place == streams.STANDARD else place.stem
    name = re.sub(r"[^a-z0-9]+", "_", stem.lower()).strip("_")
    return KALMAN.convert(path, lambda file: described(file, name, form, place))


def described(file: KalmanFile, name: str, form: str | None = None, place: Path | None = None) -> FilterText:
    """Return the filter that a file describes."""
    name = file.name or parse(Annotated[str, _NAME], name, "name")
    if not (C.allows(name) and PYTHON.allows(name)):
        raise InputError(f"the name {name!r} has a meaning in generated code; another name is needed")
    _check_names(file)
    numbers: dict[str, sp.Expr] = {}

    def number(where: str, text: str | None, least: int | None = None, positive: bool = False) -> Any:
        if text is None:
            return None
        value = expression(where, text, numbers)
        value = exact_number(where, value)
        if (positive and value <= 0) or (least is not None and value < least):
            raise InputError(
                f"{where} is {text}; a number {'above 0' if positive else f'of at least {least}'} is needed"
            )
        return Fraction(value.p, value.q)

    for key, text in file.parameters.items():
        numbers[key] = exact_number(f"parameters.{key}", expression(f"parameters.{key}", text, numbers))

    def quantity(kind: str, one: Any, known: Mapping[str, Any], term: str = "", **rest: Any) -> Quantity:
        where = f"{kind}[{one.name}]"
        formula = expression(f"{where}.{term}", getattr(one, term), known) if term else sp.S.Zero
        formula = formula.replace(
            lambda part: part.is_number, lambda part: exact_number(f"{where}.{term}", part)
        )
        largest = number(f"{where}.range", one.range, positive=True)
        meaning = checks.text(f"{where}.meaning", one.meaning) or one.name.replace("_", " ")
        return Quantity(one.name, one.unit, meaning, sp.Symbol(one.name, real=True), largest, formula, **rest)

    inputs = tuple(quantity("input", one, {}) for one in file.input)
    signals: tuple[Any, ...] = (*file.input, *file.state)
    named = {one.name: sp.Symbol(one.name, real=True) for one in signals}
    noises = {key: sp.Symbol(key, real=True) for key in file.noise}
    interval = number("schedule.interval", file.schedule.interval, positive=True)
    states = tuple(
        quantity(
            *("state", one, {**numbers, **named, **noises}, "derivative"),
            deviation=number(f"state[{one.name}].deviation", one.deviation, positive=True),
            initial=number(f"state[{one.name}].initial", one.initial),
        )
        for one in file.state
    )
    measurements = tuple(
        quantity(
            *("measurement", one, {**numbers, **named}, "expression"),
            deviation=number(f"measurement[{one.name}].deviation", one.deviation, least=0),
            every=one.every,
        )
        for one in file.measurement
    )
    return FilterText(
        name,
        file.title,
        f"strapgen kalman {place.as_posix()}" if place else "strapgen kalman",
        inputs,
        states,
        measurements,
        {noises[key]: _density(key, one, number, interval) for key, one in file.noise.items()},
        interval,
        _steps(file.schedule, number, interval),
        file.schedule.kind,
        checks.choice("form", form, FORMS) if form else file.schedule.form,
        file.schedule.order,
    )


def exact_number(where: str, value: sp.Expr) -> sp.Rational:
    """Return a number as a rational one; what is irrational is rounded to `DIGITS` digits."""
    if value.is_Rational:
        return value
    if not value.is_real or not value.is_finite:
        raise InputError(f"{where} is no real number")
    return sp.Rational(str(sp.N(value, DIGITS)))


def _check_names(file: KalmanFile) -> None:
    signals: tuple[Any, ...] = (*file.input, *file.state)
    names = [*file.parameters, *file.noise, *(one.name for one in signals)]
    measured = [one.name for one in file.measurement]
    for name in [*names, *measured]:
        if names.count(name) > 1 or measured.count(name) > 1:
            raise InputError(f"the name {name!r} stands twice; all names of a filter are different")
        known = name in FUNCTIONS or name in CONSTANTS or _TAKEN.fullmatch(name)
        if known or not (C.allows(name) and PYTHON.allows(name)):
            raise InputError(f"the name {name!r} has a meaning in formulas or code; another name is needed")


def _density(name: str, one: NoiseFile, number: Any, interval: Fraction) -> Fraction:
    """Return the spectral density of a noise, the square of its root."""
    if one.density is not None:
        return Fraction(number(f"noise.{name}.density", one.density, least=0) ** 2)
    return Fraction(number(f"noise.{name}.deviation", one.deviation, least=0) ** 2 / interval)


def _steps(schedule: ScheduleFile, number: Any, interval: Fraction) -> int | None:
    duration = number("schedule.duration", schedule.duration, positive=True)
    if duration is None:
        if schedule.kind == "scheduled":
            raise InputError(
                "schedule.duration is missing; a scheduled filter has gains for every step of it"
            )
        return None
    steps = duration / interval
    if steps.denominator != 1:
        raise InputError(f"schedule.duration is {schedule.duration}; a multiple of the interval is needed")
    return checks.count("schedule.duration in intervals", int(steps), largest=MOST_STEPS)
