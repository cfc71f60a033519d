"""Options that several commands share; each option has one name, metavar and sentence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import typer

from strapgen.cli import completion
from strapgen.cli.completion import Words
from strapgen.cli.option_groups import OneOf, Rule
from strapgen.cli.progress import waiting
from strapgen.cli.values import Positive, Reader, folder, names, single
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.catalogue.choice import AnyMethod

_Text = str | None


def option(
    *names: str,
    metavar: str | None = None,
    help: str,
    panel: str | None = None,
    read: Reader | None = None,
    words: Words | None = None,
    hidden: bool = False,
) -> Any:
    """Return an option of a command; the names after the first one are aliases, which the help does not show.

    A default of the parameter is shown if it is not None; one that the command finds stands in the help. `read` reads
    one value, where the type of the parameter does not say how. `words` are names for a shell to complete, where
    neither `read` nor the option's name says which.
    """
    read = read or (folder if metavar == "FOLDER" else None)
    return typer.Option(
        *names,
        metavar=metavar,
        help=help,
        rich_help_panel=panel,
        hidden=hidden,
        parser=read,  # type: ignore[arg-type]
        autocompletion=None if words is None else completion.of(words),
    )


def argument(metavar: str, *, help: str, words: Words | None = None) -> Any:
    """Return an argument of a command, as `option` does an option."""
    complete = None if words is None else completion.of(words)
    return typer.Argument(metavar=metavar, help=help, show_default=False, autocompletion=complete)


def _argument(help: str, words: Words | None = None) -> Any:
    return argument("ALGORITHM", help=help, words=words)


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
#: The attitude algorithms
_STEPS = "strapgen.catalogue:ALGORITHMS"
StepAlgorithm = Annotated[str, _argument("dcm, euler or cayley-klein, or a Python file of your own.", _STEPS)]
RunAlgorithm = Annotated[
    str, _argument("dcm, euler or cayley-klein, a Python file of your own, or a described system.", _STEPS)
]
CheckedAlgorithm = Annotated[
    str,
    _argument(
        "dcm, euler or cayley-klein, or a Python file of your own, one in C, C++, Rust or MATLAB, "
        "or package.module:function.",
        _STEPS,
    ),
]
OptionalStepAlgorithm = Annotated[
    _Text, _argument("dcm, euler or cayley-klein, or a Python file of your own.", _STEPS)
]
_TWO_SPEED = ("dcm", "euler")
TwoSpeedAlgorithm = Annotated[str, _argument("dcm or euler.", _TWO_SPEED)]
StrapdownAlgorithm = Annotated[
    str, _argument("dcm or euler in two speeds, or a described system.", _TWO_SPEED)
]

_SHOWN_BACKENDS = "strapgen list backends shows all."
#: Reads the name of a back end.
a_backend = names("strapgen.run.backend_names:BACKENDS")


def default_backends() -> tuple[str, ...]:
    """Return the back ends of a run that names none."""
    from strapgen.run.backend_names import DEFAULT_BACKENDS

    return DEFAULT_BACKENDS


#: One back end.
OneBackend = Annotated[
    str,
    option(
        "--backend", metavar="NAME", help=f"Back end; {_SHOWN_BACKENDS}", panel="Algorithm", read=a_backend
    ),
]
#: Several back ends side by side.
SeveralBackends = Annotated[
    tuple[str, ...],
    option(
        "--backend",
        "--backends",
        metavar="NAME,...",
        help=f"Back ends, with commas between; {_SHOWN_BACKENDS}",
        panel="Algorithm",
        read=a_backend,
    ),
]
#: Several back ends; by default those that are fast.
FastBackends = Annotated[
    tuple[str, ...] | None,
    option(
        "--backend",
        "--backends",
        metavar="NAME,...",
        help=f"Back ends, with commas between; {_SHOWN_BACKENDS}  "
        "[default: all but fixed-model and exact, which are slow]",
        panel="Algorithm",
        read=a_backend,
    ),
]
Sculling = Annotated[
    int,
    option(
        "--sculling",
        metavar="N",
        help="Form of the sculling integral: 1 with the rotation compensation, 2 without.",
        panel="Algorithm",
    ),
]
Duration = Annotated[
    Positive, option("--duration", metavar="S", help="Duration of each run in s.", panel="Input")
]
GyroRate = Annotated[Positive, option("--sample-hz", metavar="HZ", help="Sampling rate of the gyro in Hz.")]
#: An attitude step of the catalogue
StepName = Annotated[
    str,
    option(
        "--algorithm",
        metavar="NAME",
        help="Algorithm: dcm, euler or cayley-klein.",
        panel="Algorithm",
        read=names(_STEPS),
    ),
]
#: A language of microcontrollers
CTarget = Annotated[
    str,
    option(
        "--target",
        metavar="NAME",
        help="Kind of code: c, c-float or c-fixed.",
        panel="Algorithm",
        words=("c", "c-float", "c-fixed"),
    ),
]
#: A processor whose instructions are counted
Processor = Annotated[
    str | None,
    option(
        "--cpu",
        metavar="NAME",
        help="Count the instructions of the C in fixed point on this processor, as strapgen cost does, for "
        "instance cortex-m3.",
        panel="Run",
    ),
]
#: A number of increments, or as many as a method needs.
Samples = int | Literal["enough"]


def samples(option: str, text: str) -> Samples:
    """Read a number of increments, or the word enough."""
    return "enough" if text == "enough" else checks.whole(option, text)


@dataclass(frozen=True)
class MethodOptions:
    """Options that choose a kernel: the method and the samples of a step, constants, the layout of another kernel."""

    panel: ClassVar[str] = "Algorithm"
    rules: ClassVar[tuple[Rule, ...]] = (OneOf("--method --tableau --window --coning"),)

    method: Annotated[
        _Text,
        option(
            "--method",
            metavar="NAME",
            help="Integration method; strapgen list methods shows all.  [default: rk4]",
            read=single,
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
            metavar="NAME|FILE",
            help="A window as pair-1-8, or a TOML file with your own, in place of --method; window design writes one.",
            words="strapgen.catalogue.methods.windows:WINDOWS",
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
    increments: Annotated[
        Samples | None,
        option(
            "--increments",
            metavar="N",
            help="Number of angle increments in a step, 1 to 8.  [default: 2]",
            read=checks.whole,
        ),
    ] = None
    previous: Annotated[
        int | None,
        option(
            "--previous",
            metavar="N",
            help="Number of increments before the step that it also uses, 0 to 32.  [default: 0]",
        ),
    ] = None
    ahead: Annotated[
        int | None,
        option(
            "--ahead",
            metavar="N",
            help="Number of increments after the step that it also uses, 0 to 32.  [default: 0]",
        ),
    ] = None
    rates: Annotated[
        bool,
        option(
            "--rates",
            help="Take body rates at the method's nodes, times the step length, in place of increments.",
        ),
    ] = False

    constant: Annotated[
        dict[str, str] | None,
        option(
            "--constant",
            metavar="NAME=VALUE,...",
            help="Value of the input NAME in its unit, row by row, as a constant in the code; or value of an unknown "
            "of your own algorithm.",
        ),
    ] = None

    layout: Annotated[
        Path | None,
        option(
            "--layout",
            "--field",
            "--filter",
            metavar="FILE",
            help="File of a kernel that is made from one: TOML with the layout of gyros for separate and torques, the "
            "coefficients of a World Magnetic Model (.COF) for magnetic-field, the sections of filter; --field and "
            "--filter are other names of it.",
        ),
    ] = None

    @property
    def files(self) -> tuple[Path | None, ...]:
        """The files that the options name."""
        return self.tableau, self.window, self.coning, self.layout

    def choose(self, algorithm: str, *, step: bool = True) -> Choice:
        """Return the kernel that the options choose of an algorithm; with `step` it must be an attitude step."""
        from strapgen import catalogue
        from strapgen.catalogue.methods import shaped_coning, tableaux, windows

        method: AnyMethod | None = self.method
        readers: dict[Callable[[Path], AnyMethod], Path | None] = {
            tableaux.read: self.tableau,
            windows.named_or_read: self.window,
            shaped_coning.read: self.coning,
        }
        for read, path in readers.items():
            if path is not None:
                method = read(path)
        count = None if self.increments == "enough" else self.increments
        constants = {
            name: [number.strip() for number in numbers.split(",")]
            for name, numbers in (self.constant or {}).items()
        }
        with waiting(f"deriving {algorithm}"):  # a user's code may take its time
            rest = method, count, self.rates, self.previous, self.ahead, constants or None
            if step:
                choice = catalogue.choose_step(algorithm, *rest)
            else:
                choice = catalogue.choose(algorithm, *rest, layout=self.layout)
        if self.increments != "enough":
            return choice
        if choice.method is None or choice.increments is None:
            raise InputError(f"--increments enough does not go with {algorithm}; a number does")
        return replace(choice, increments=catalogue.enough(choice.method))


#: The options of an attitude step, which takes increments.
STEP_OPTIONS = ("method", "tableau", "window", "coning", "increments", "previous", "ahead", "constant")
#: The options of any step, which may take rates too.
ANY_STEP_OPTIONS = tuple(part.name for part in fields(MethodOptions) if part.name != "layout")


@dataclass(frozen=True)
class SeveralMethods(MethodOptions):
    """Options that choose the methods to show side by side, and the numbers of increments of each."""

    method: Annotated[
        tuple[str, ...] | None,
        option(
            "--method",
            metavar="NAME,...",
            help="Integration methods, with commas between; strapgen list methods shows all.  [default: rk4]",
        ),
    ] = None  # type: ignore[assignment]
    increments: Annotated[
        tuple[Samples, ...] | None,
        option(
            "--increments",
            metavar="N,...",
            help="Numbers of angle increments in a step, 1 to 8; enough: as many as each method needs.  [default: 2]",
            read=samples,
        ),
    ] = None  # type: ignore[assignment]

    def each(self) -> list[MethodOptions]:
        """Return the options of one method with one number of increments each."""
        common = {part.name: getattr(self, part.name) for part in fields(self)}
        return [
            MethodOptions(**common | {"method": name, "increments": count})
            for name in self.method or (None,)
            for count in self.increments or (None,)
        ]

    def choices(self, algorithm: str, *, step: bool = True) -> list[Choice]:
        """Return the choices of the algorithm with every method and every number of increments."""
        return [options.choose(algorithm, step=step) for options in self.each()]
