"""Options that several commands share, and readers of option values; each option has one name, metavar and sentence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import typer

from strapgen.cli.progress import waiting
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.catalogue.choice import AnyMethod

_Text = str | None


def option(*names: str, metavar: str | None = None, help: str, panel: str | None = None) -> Any:
    """Return an option of a command; the names after the first one are aliases, which the help does not show.

    A default of the parameter is shown if it is not None; one that the command finds stands in the help.
    """
    check = _require_folder if metavar == "FOLDER" else None
    return typer.Option(*names, metavar=metavar, help=help, rich_help_panel=panel, callback=check)


def _require_folder(parameter: typer.CallbackParam, value: Path | None) -> Path | None:
    """Refuse the terminal where a folder is needed; elsewhere - stands for it."""
    if value == Path("-"):
        raise InputError(f"{parameter.opts[0]} - is no folder; files are not written to the terminal")
    return value


def _argument(help: str) -> Any:
    return typer.Argument(metavar="ALGORITHM", help=help, show_default=False)


Algorithm = Annotated[
    str,
    _argument(
        "dcm, euler, cayley-klein, any other kernel that strapgen list kernels shows, or a Python file of your own."
    ),
]
OptionalAlgorithm = Annotated[
    _Text,
    _argument(
        "dcm, euler, cayley-klein, any other kernel that strapgen list kernels shows, or a Python file of your own."
    ),
]
StepAlgorithm = Annotated[str, _argument("dcm, euler or cayley-klein, or a Python file of your own.")]
RunAlgorithm = Annotated[
    str, _argument("dcm, euler or cayley-klein, a Python file of your own, or a described system.")
]
CheckedAlgorithm = Annotated[
    str, _argument("dcm, euler or cayley-klein, or a Python file of your own, or one in C or C++.")
]
OptionalStepAlgorithm = Annotated[
    _Text, _argument("dcm, euler or cayley-klein, or a Python file of your own.")
]
TwoSpeedAlgorithm = Annotated[str, _argument("dcm or euler.")]
StrapdownAlgorithm = Annotated[str, _argument("dcm or euler in two speeds, or a described system.")]

_SHOWN_BACKENDS = "strapgen list backends shows all."
#: One back end.
OneBackend = Annotated[
    str, option("--backend", metavar="NAME", help=f"Back end; {_SHOWN_BACKENDS}", panel="Algorithm")
]
#: Several back ends side by side.
SeveralBackends = Annotated[
    str,
    option(
        "--backend",
        "--backends",
        metavar="NAME,...",
        help=f"Back ends, with commas between; {_SHOWN_BACKENDS}",
        panel="Algorithm",
    ),
]
#: Several back ends; by default those that are fast.
FastBackends = Annotated[
    _Text,
    option(
        "--backend",
        "--backends",
        metavar="NAME,...",
        help=f"Back ends, with commas between; {_SHOWN_BACKENDS}  "
        "[default: all but fixed-model and exact, which are slow]",
        panel="Algorithm",
    ),
]
Sculling = Annotated[
    str,
    option(
        "--sculling",
        metavar="N",
        help="Form of the sculling integral: 1 with the rotation compensation, 2 without.",
        panel="Algorithm",
    ),
]
Duration = Annotated[str, option("--duration", metavar="S", help="Duration of each run in s.", panel="Input")]
Increments = Annotated[
    _Text,
    option("--increments", metavar="N", help="Number of angle increments in a step, 1 to 8.  [default: 2]"),
]


@dataclass(frozen=True)
class MethodOptions:
    """Options that choose a kernel: the method and the samples of a step, constants, the layout of another kernel."""

    panel: ClassVar[str] = "Algorithm"

    method: Annotated[
        _Text,
        option(
            "--method",
            metavar="NAME",
            help="Integration method; strapgen list methods shows all.  [default: rk4]",
        ),
    ] = None
    tableau: Annotated[
        Path | None,
        option(
            "--tableau",
            metavar="FILE",
            help="TOML file with the Butcher tableau of your own method, in place of --method.",
        ),
    ] = None
    window: Annotated[
        Path | None,
        option(
            "--window",
            metavar="FILE",
            help="TOML file with the filters of your own window, in place of --method; window design writes one.",
        ),
    ] = None
    coning: Annotated[
        Path | None,
        option(
            "--coning",
            metavar="FILE",
            help="TOML file with coning coefficients for a band or spectrum, in place of --method; coning writes one.",
        ),
    ] = None
    increments: Increments = None
    previous: Annotated[
        _Text,
        option(
            "--previous",
            metavar="N",
            help="Number of increments from before the step that it uses as well, 0 to 32.  [default: 0]",
        ),
    ] = None
    ahead: Annotated[
        _Text,
        option(
            "--ahead",
            metavar="N",
            help="Number of increments from after the step that it uses as well, 0 to 32.  [default: 0]",
        ),
    ] = None
    rates: Annotated[
        bool,
        option(
            "--rates",
            help="Let the step take, in place of increments, body rates at the method's nodes, times the step length.",
        ),
    ] = False

    constant: Annotated[
        list[str] | None,
        option(
            "--constant",
            metavar="NAME=VALUE,...",
            help="Value of the input NAME in its unit, row by row, which the code then has as a constant; or of an "
            "unknown of your own algorithm.",
        ),
    ] = None

    layout: Annotated[
        Path | None,
        option(
            "--layout",
            metavar="FILE",
            help="TOML file with the gyros whose rate and acceleration separate separates.",
        ),
    ] = None

    @property
    def files(self) -> tuple[Path | None, ...]:
        """The files that the options name."""
        return self.tableau, self.window, self.coning, self.layout

    @property
    def stated(self) -> list[str]:
        """The options that the command line has."""
        return [
            f"--{part.name}" for part in fields(self) if getattr(self, part.name) not in (None, False, [])
        ]

    def choose(self, algorithm: str, *, step: bool = True) -> Choice:
        """Return the kernel that the options choose of an algorithm; with `step` it must be an attitude step."""
        from strapgen import catalogue
        from strapgen.catalogue.methods import shaped_coning, tableaux, windows

        readers: dict[str, tuple[Path | None, Callable[[Path], AnyMethod]]] = {
            "--tableau": (self.tableau, tableaux.read),
            "--window": (self.window, windows.read),
            "--coning": (self.coning, shaped_coning.read),
        }
        stated = {"--method": self.method, **{name: path for name, (path, _) in readers.items()}}
        both = [f"{name} {value}" for name, value in stated.items() if value is not None]
        if len(both) > 1:
            raise InputError(f"{both[0]} and {both[1]} are both given; one is needed")
        method: AnyMethod | None = self.method
        for path, read in readers.values():
            if path is not None:
                method = read(path)
        one("--method", self.method)
        count = whole("increments", self.increments)
        before, after = whole("previous", self.previous), whole("ahead", self.ahead)
        with waiting(f"deriving {algorithm}"):  # a user's code may take its time
            rest = method, count, self.rates, before, after, self._constants()
            if step:
                return catalogue.choose_step(algorithm, *rest)
            return catalogue.choose(algorithm, *rest, layout=self.layout)

    def _constants(self) -> dict[str, list[str]] | None:
        """Return the numbers of each constant as they are written; None if none is stated."""
        if not self.constant:
            return None
        constants: dict[str, list[str]] = {}
        for text in self.constant:
            name, numbers = pair("--constant", text)
            if name in constants:
                raise InputError(f"--constant {name} is given twice; one is needed")
            constants[name] = [number.strip() for number in numbers.split(",")]
        return constants


#: The options of an attitude step, which takes increments.
STEP_OPTIONS = ("method", "tableau", "window", "coning", "increments", "previous", "ahead", "constant")
#: The options of any step, which may take rates too.
ANY_STEP_OPTIONS = tuple(part.name for part in fields(MethodOptions) if part.name != "layout")


@dataclass(frozen=True)
class SeveralMethods(MethodOptions):
    """Options that choose the methods to show side by side, and the numbers of increments of each."""

    method: Annotated[
        _Text,
        option(
            "--method",
            metavar="NAME,...",
            help="Integration methods, with commas between; strapgen list methods shows all.  [default: rk4]",
        ),
    ] = None
    increments: Annotated[
        _Text,
        option(
            "--increments",
            metavar="N,...",
            help="Numbers of angle increments in a step, 1 to 8; enough: as many as each method needs.  [default: 2]",
        ),
    ] = None

    def each(self) -> list[SeveralMethods]:
        """Return the options with one method and one number of increments each."""
        return [
            replace(self, method=name, increments=count)
            for name in _parts("--method", self.method)
            for count in _parts("--increments", self.increments)
        ]

    def choices(self, algorithm: str, *, step: bool = True) -> list[Choice]:
        """Return the choices of the algorithm with every method and every number of increments."""
        return [options.choose(algorithm, step=step) for options in self.each()]

    def choose(self, algorithm: str, *, step: bool = True) -> Choice:
        """Return the algorithm with one method; see `MethodOptions.choose`."""
        if self.increments != "enough":
            return super().choose(algorithm, step=step)
        from strapgen import catalogue

        choice = replace(self, increments=None).choose(algorithm, step=step)
        if choice.method is None or choice.increments is None:
            raise InputError(f"--increments enough does not go with {algorithm}; a number does")
        return replace(choice, increments=catalogue.enough(choice.method))


def whole(what: str, value: str | None) -> int | None:
    """Read an option that takes a whole number."""
    return None if value is None else checks.whole(what, value)


def limit(what: str, value: str | None) -> float | None:
    """Read an option that takes a number from 0 on."""
    if value is None:
        return None
    number = float(checks.number(what, value))
    if number < 0:
        raise InputError(f"{what} is {value}; a number that is not below 0 is needed")
    return number


def one(option: str, value: str | None) -> None:
    """Refuse a list where one name is needed."""
    if value is not None and "," in value:
        raise InputError(f"{option} {value} is a list; one name is needed here")


def listed(option: str, text: str) -> list[str]:
    """Return the values of a comma-separated list, each once, at least one."""
    values = list(dict.fromkeys(value.strip() for value in text.split(",") if value.strip()))
    if not values:
        raise InputError(f"{option} is {text!r}; at least one value is needed")
    return values


def backends(option: str, text: str | None, default: Sequence[str]) -> list[str]:
    """Return the back ends of a list, checked; the default without one."""
    from strapgen.run.backends import BACKENDS

    if text is None:
        return list(default)
    return [checks.choice("backend", name, BACKENDS) for name in listed(option, text)]


def pair(option: str, text: str) -> tuple[str, str]:
    """Return the name and the value of NAME=VALUE."""
    name, equals, value = text.partition("=")
    if not equals or not name or not value:
        raise InputError(f"{option} {text!r} is no setting; NAME=VALUE is needed")
    return name, value


def _parts(option: str, text: str | None) -> list[str | None]:
    """Return the values of a list; None stands for the default."""
    return [None] if text is None else [*listed(option, text)]
