"""Reads the file of a Kalman filter: states, measurements, noise and schedule, in exact numbers and expressions."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

import sympy as sp

from strapgen.catalogue.toml_models import Key, UserFile, parse, rational, refused
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.read_only import ReadOnly
from strapgen.kernel.algebra import exact
from strapgen.kernel.kernel import DIGITS
from strapgen.kernel.reading import CONSTANTS, FUNCTIONS, expression
from strapgen.navigation.kalman import FORMS, KINDS
from strapgen.storage import streams
from strapgen.targets.names import PYTHON, C

#: Most states, measurements, inputs and steps of a filter.
MOST_STATES, MOST_STEPS = 32, 100_000
#: Least magnitude of a number that is not 0, and the inverse of the largest.
_LEAST = sp.Rational(1, 10**60)
_NAME = Key(
    "Name; all names of the file are different",
    pattern="(?!.*__)[a-z][a-z0-9_]{0,30}(?<!_)",
    form="a name of at most 31 lower-case letters, digits and single underscores, which begins with a letter,",
)
#: Functions of formulas, which code in floating point and its derivatives have.
_IN_CODE = {name: FUNCTIONS[name] for name in ("sqrt", "sin", "cos", "atan2")}
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


_ZERO = Term("0")
_UNIT = Key('Unit, "1" for a pure number', pattern=r".*\S.*", form="a unit, '1' for a pure number,")


@dataclass(frozen=True, kw_only=True)
class InputFile:
    """A signal that derivatives or measurements depend on, held over a step."""

    name: Annotated[str, _NAME]
    unit: Annotated[str, _UNIT]
    range: Annotated[Term | None, Key("Largest magnitude, which fixed point needs", "its unit")] = None
    meaning: Annotated[str, Key("Description in the header; by default its name")] = ""


@dataclass(frozen=True, kw_only=True)
class StateFile(InputFile):
    """A state and its differential equation."""

    derivative: Annotated[Term, Key("Its derivative, in states, inputs, parameters and noise", "its unit/s")]
    deviation: Annotated[Term, Key("Standard deviation before the first step, above 0", "its unit")]
    initial: Annotated[Term, Key("Estimate before the first step", "its unit")] = _ZERO


@dataclass(frozen=True, kw_only=True)
class MeasurementFile(InputFile):
    """A scalar measurement."""

    expression: Annotated[Term, Key("What is measured, in states, inputs and parameters", "its unit")]
    deviation: Annotated[Term, Key("Standard deviation of the noise of a measurement", "its unit")]
    every: Annotated[int, Key("Steps from one to the next", "1", least=1, most=MOST_STEPS)] = 1


@dataclass(frozen=True)
class NoiseFile:
    """White noise, which derivatives hold by its name: its density, or the deviation of its integral over a step."""

    density: Annotated[
        Term | None, Key("Root of the spectral density", "unit of the derivative times sqrt(s)")
    ] = None
    deviation: Annotated[Term | None, Key("Deviation of its integral over a step", "unit of the state")] = (
        None
    )

    def __post_init__(self) -> None:
        if (self.density is None) == (self.deviation is None):
            raise InputError("one of density and deviation is needed")


@dataclass(frozen=True)
class ScheduleFile:
    """Steps and gains."""

    interval: Annotated[Term, Key("Length of a step", "s")]
    kind: Annotated[str, Key("Gains: steady, of a table of every step, or online", choices=tuple(KINDS))]
    duration: Annotated[Term | None, Key("Time that a schedule, and a bound, is for", "s")] = None
    form: Annotated[str, Key("Form of the covariance of online gains", choices=tuple(FORMS))] = "joseph"
    order: Annotated[
        int, Key("Highest power of the step in a transition that is not constant", "1", least=1, most=8)
    ] = 4


@dataclass(frozen=True)
class KalmanFile:
    """A Kalman filter: states with their derivatives, measurements, noise and schedule."""

    state: Annotated[tuple[StateFile, ...], Key("States", least=1, most=MOST_STATES)]
    measurement: Annotated[
        tuple[MeasurementFile, ...],
        Key("Measurements, in the order of their updates", least=1, most=MOST_STATES),
    ]
    schedule: Annotated[ScheduleFile, Key("Steps and gains")]
    noise: Annotated[Mapping[Annotated[str, _NAME], NoiseFile], Key("White noise")] = field(
        default_factory=dict
    )
    input: Annotated[tuple[InputFile, ...], Key("Signals held over a step", most=4 * MOST_STATES)] = ()
    parameters: Annotated[
        Mapping[Annotated[str, _NAME], Term], Key("Numbers, or expressions in those above")
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
class FilterText(ReadOnly):
    """A filter as its file states it, in exact numbers and expressions."""

    name: str
    title: str
    command: str
    inputs: tuple[Quantity, ...]
    states: tuple[Quantity, ...]
    measurements: tuple[Quantity, ...]
    #: Symbols of the white noise, and its spectral densities
    noise: Mapping[sp.Symbol, Fraction]
    interval: Fraction
    #: Steps of the schedule; None where no duration is stated
    steps: int | None
    kind: str
    form: str
    order: int


def read(path: str | Path) -> FilterText:
    """Read the file of a Kalman filter."""
    place = checks.path("path", path)
    stem = "kalman" if place == streams.STANDARD else place.stem
    name = re.sub(r"[^a-z0-9]+", "_", stem.lower()).strip("_")
    command = f"strapgen kalman {shlex.quote(place.as_posix())}"
    return KALMAN.convert(path, lambda file: described(file, name, command))


def described(file: KalmanFile, name: str, command: str = "strapgen kalman") -> FilterText:
    """Return the filter that a file describes."""
    name = file.name or parse(Annotated[str, _NAME], name, "name")
    measured = [one.name for one in file.measurement]
    signals = [one.name for rows in (file.input, file.state) for one in rows]
    _check_names([*file.parameters, *file.noise, *signals])
    _check_names(measured)
    if "time" in measured:
        raise InputError("the measurement name 'time' is that of the time update; another name is needed")
    _check_names([name])
    terms = _Terms({name: sp.Symbol(name, real=True) for name in signals})
    for key, text in file.parameters.items():
        terms.parameters[key] = exact(terms.number(f"parameters.{key}", text))
    noises = {key: sp.Symbol(key, real=True) for key in file.noise}
    schedule = file.schedule
    interval = terms.number("schedule.interval", schedule.interval, above=0)
    steps = None
    if schedule.duration is not None:
        ratio = terms.number("schedule.duration", schedule.duration, above=0) / interval
        if ratio.denominator != 1:
            raise InputError(
                f"schedule.duration is {schedule.duration}; a multiple of the interval is needed"
            )
        steps = checks.count("schedule.duration in intervals", int(ratio), largest=MOST_STEPS)
    elif schedule.kind == "scheduled":
        raise InputError("schedule.duration is missing; a scheduled filter has gains for every step of it")
    densities = {}
    for key, one in file.noise.items():
        part, over = ("deviation", interval) if one.density is None else ("density", Fraction(1))
        densities[noises[key]] = terms.number(f"noise.{key}.{part}", getattr(one, part), least=0) ** 2 / over
    return FilterText(
        name,
        file.title,
        command,
        tuple(terms.quantity("input", one) for one in file.input),
        tuple(terms.quantity("state", one, "derivative", noises, above=0) for one in file.state),
        tuple(terms.quantity("measurement", one, "expression", least=0) for one in file.measurement),
        densities,
        interval,
        steps,
        schedule.kind,
        schedule.form,
        schedule.order,
    )


@dataclass
class _Terms:
    """Reads the terms of a file: exact numbers, and expressions in its names."""

    symbols: Mapping[str, sp.Symbol]
    parameters: dict[str, sp.Expr] = field(default_factory=dict)

    def number(self, where: str, text: str, above: int | None = None, least: int | None = None) -> Fraction:
        """Return a number; one that is irrational is rounded to `DIGITS` digits."""
        value = _rational(where, expression(where, text, self.parameters))
        if (above is not None and value <= above) or (least is not None and value < least):
            limit = f"above {above}" if least is None else f"of at least {least}"
            raise InputError(f"{where} is {text}; a number {limit} is needed")
        return Fraction(value.p, value.q)

    def quantity(
        self,
        kind: str,
        one: Any,
        term: str = "",
        more: Mapping[str, Any] = MappingProxyType({}),
        **limit: int,
    ) -> Quantity:
        """Return an input, a state or a measurement, with the formula of its `term`."""
        where, known = f"{kind}[{one.name}]", {**self.parameters, **self.symbols, **more}
        rest: dict[str, Any] = {}
        if term:
            place = f"{where}.{term}"
            formula = expression(place, getattr(one, term), known, _IN_CODE)
            rest["expression"] = formula.replace(lambda x: x.is_number, lambda x: _rational(place, x))
            rest["deviation"] = self.number(f"{where}.deviation", one.deviation, **limit)
        if kind == "state":
            rest["initial"] = self.number(f"{where}.initial", one.initial)
        largest = None if one.range is None else self.number(f"{where}.range", one.range, above=0)
        meaning = checks.text(f"{where}.meaning", one.meaning) or one.name.replace("_", " ")
        rest["every"] = getattr(one, "every", 1)
        return Quantity(one.name, one.unit, meaning, sp.Symbol(one.name, real=True), largest, **rest)


def _rational(where: str, value: sp.Expr) -> sp.Rational:
    if value.is_Rational:
        _check_size(where, value)
        return value
    if not value.is_real or not value.is_finite:
        raise InputError(f"{where} is no real number")
    number = sp.N(value, DIGITS)
    _check_size(where, number)
    return sp.Rational(str(number))


def _check_size(where: str, number: sp.Expr) -> None:
    if number != 0 and not _LEAST <= abs(number) <= 1 / _LEAST:
        raise InputError(f"{where} has a magnitude outside 1e-60 to 1e60")


def _check_names(names: Sequence[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"the name {name!r} stands twice; all names of a filter are different")
        known = name in FUNCTIONS or name in CONSTANTS or _TAKEN.fullmatch(name)
        if known or not (C.allows(name) and PYTHON.allows(name)):
            raise InputError(f"the name {name!r} has a meaning in formulas or code; another name is needed")
