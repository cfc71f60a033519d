"""What is fuzzed in Python: any bytes are a file or a command line, which is used or refused in a line."""

from __future__ import annotations

import contextlib
import os
import signal
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import typer.main

from strapgen import cli
from strapgen.analysis.vibration.spectrum import read_spectrum
from strapgen.catalogue.methods import tableaux, windows
from strapgen.firmware.check_code.foreign_arguments import read_arguments
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.formats import Format
from strapgen.ir.units import Sensor
from strapgen.lab.recordings import recording
from strapgen.targets.contract_lines import Contract

#: Longest time in s of a case: what takes longer was accepted, and computes.
PATIENCE = 2.0
#: Commands that start compilers, or compute for long whatever they are told.
_LEFT_OUT = {
    "cost",
    "evidence",
    "check",
    "tables",
    "rate-table",
    "stress",
    "study",
    "verify",
    "converge",
    "series",
}
#: Options that write pictures or take other programs' time.
_SILENT = ("--plot", "--all", "--project", "--backends", "--reference")
_DATA = Path(__file__).parent / "data"
_WORDS = [
    "euler", "dcm", "cayley-klein", "euler-product", "rk1", "rk4", "magnus4", "taylor2", "numpy",
    "fixed-model", "c-fixed", "fixed", "constant", "coning", "polynomial", "x_deg_s=1", "a_deg_s=1",
    "b_rad_s=-2", "g_deg_s=1e9", "nearest", "truncation", "full", "state", "none", "json", "csv",
    "text", "markdown", "latex", "q31", "rad/s", "deg/s", "sequential", "0", "1", "2", "3", "8", "16",
    "32", "-1", "1/8", "0.01", "1e-30", "1e400", "nan", "inf", "1_0", "0x1", "-", "--",
    "increments.csv", "rates_even.csv", "rates_uneven.csv", "missing.csv", "euler=2", "state=Q1.30",
    "arm=1e3", "17.5mdps",
    "", " ",
]  # fmt: skip


#: Command lines that compute, and from which others come by a few changes.
_LINES = [
    line.split()
    for line in (
        "list methods --format json",
        "tableau rk4 --format csv",
        "coning --samples 3 --form combined",
        "derive euler --method rk1 --increments 2 --show program",
        "derive dcm --method rk2 --show latex --out text",
        "generate euler --method rk1 --target numpy --out firmware",
        "generate euler --method rk1 --target c-fixed --word 16 --max-rate-deg-s 100 --step 0.01 --out firmware",
        "generate euler --method rk1 --target c-fixed --sample-hz 100 --lsb 0.0175dps --state q31 --out firmware",
        "generate euler-product --target c-float --prefix slow_ --with-runs",
        "vectors euler-product --target c-fixed --word 32 --count 5 --seed 7 --out firmware",
        "simulate euler --method rk1 --motion coning --set a_deg_s=1 b_rad_s=2 g_deg_s=3 --step 0.1 --duration 1",
        "simulate euler --method rk1 --motion constant --set x_deg_s=1 --step 1 --duration 9 --record 3 --format csv",
        "simulate dcm --method rk2 --recording increments.csv --orthonormalize 1",
        "simulate euler --input instants --recording rates_uneven.csv --every 10 --pulse-arcsec 3",
        "strapdown dcm --recording increments.csv --fast-cycles 2 --slow-cycles 2 --initial-deg 1,2,3",
        "compare euler --method rk1 --backend numpy --motion constant --set z_deg_s=10 --step 0.125 --duration 1",
        "vibration euler --method rk1 --increments 2 --frequency-hz 10 --step 0.02 --theta-x-rad 1 --phase-rad 1",
        "stability euler --method rk1,rk2",
    )
]


class TooLong(BaseException):
    """A case takes longer than it may."""


class FindingError(AssertionError):
    """What neither computes nor is refused in one line."""


@contextlib.contextmanager
def patience() -> Iterator[None]:
    """End what takes too long."""

    def stop(*_: Any) -> None:
        raise TooLong

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE)
    try:
        yield
    except TooLong:
        pass
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def _refused_or_read(read: Callable[[Any], Any], value: Any) -> None:
    with patience(), warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            read(value)
        except (InputError, InputTypeError) as error:
            if not str(error).strip():
                raise FindingError(f"{value!r} is refused without a reason") from error


def _of_file(read: Callable[[Path], Any], suffix: str = ".csv") -> Callable[[bytes], None]:
    def target(data: bytes) -> None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"file{suffix}"
            path.write_bytes(data)
            _refused_or_read(read, path)

    return target


def _of_text(read: Callable[[str], Any]) -> Callable[[bytes], None]:
    return lambda data: _refused_or_read(read, data.decode("utf-8", "replace"))


class Choices:
    """Choices that bytes make; zeros follow the last of them."""

    def __init__(self, data: bytes) -> None:
        self._rest = iter(data)

    def number(self, most: int) -> int:
        """Return a number from 0 to below `most`, at most 256."""
        return next(self._rest, 0) % most

    def pick(self, values: Sequence[str]) -> str:
        """Return one of at most 65536 values."""
        return values[(self.number(256) * 256 + self.number(256)) % len(values)]

    def text(self) -> str:
        """Return a short text; it names no other folder."""
        characters = bytes(self.number(256) for _ in range(self.number(12))).decode("latin-1")
        return characters.replace("/", "|").replace("\0", "")


@cache
def _commands() -> dict[str, list[str]]:
    """Return the options of each command."""
    group: Any = typer.main.get_command(cli.app)
    return {
        name: [o for p in command.params for o in p.opts if o.startswith("--") and not o.startswith(_SILENT)]
        for name, command in group.commands.items()
        if name not in _LEFT_OUT
    }


def words_of(data: bytes) -> list[str]:
    """Return the command line that bytes stand for."""
    choices = Choices(data)
    words = [*_LINES[choices.number(len(_LINES))]]
    options = [*_commands()[words[0]], "--help", "--version", "--nothing"]
    for _ in range(choices.number(5)):
        place, kind = choices.number(len(words) + 1), choices.number(8)
        if kind == 0:
            words[place:place] = [choices.pick(options), choices.pick(_WORDS)]
        elif kind == 1:
            del words[place : place + 1]
        elif kind == 2:
            words[place : place + 1] = [choices.text()]
        elif kind == 3:
            word = "".join(words[place : place + 1])
            cut = choices.number(len(word) + 1)
            words[place : place + 1] = [word[:cut] + choices.text() + word[cut + choices.number(2) :]]
        else:
            words[place : place + 1] = [choices.pick(_WORDS)]
    # Below the folder of the case, and without a file that the shell would know.
    return [word.replace("..", "").lstrip("/") for word in words] or ["--help"]


def command_line(data: bytes) -> None:
    """Run a command line; what it cannot use it says in one line, with exit status 2."""
    _run(words_of(data), {path.name: path.read_bytes() for path in _DATA.glob("*.csv")})


def generated_header(data: bytes) -> None:
    """Let `verify` read a header, with a source beside it."""
    _run(["verify", "step.c"], {"step.h": data, "step.c": b"int x;\n"})


def _run(words: list[str], files: dict[str, bytes]) -> None:
    """Run a command line in a folder of its own."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        for name, content in files.items():
            (Path(folder) / name).write_bytes(content)
        out, said = (stack.enter_context(tempfile.TemporaryFile("w+", errors="replace")) for _ in range(2))
        os.chdir(folder)
        status: object = None
        try:
            with patience(), warnings.catch_warnings(), contextlib.redirect_stdout(out):
                warnings.simplefilter("error")
                with contextlib.redirect_stderr(said):
                    try:
                        cli.main(words)
                    except SystemExit as end:
                        status = end.code
        finally:
            os.chdir(before)
        said.seek(0)
        lines = said.read().splitlines()
    refused = status == 2 and len(lines) == 1 and lines[0].startswith("strapgen: ")
    if status not in (None, 0, 1) and not refused:
        raise FindingError(f"{words!r} ends with {status!r} and says {lines!r}")


@cache
def seeds(name: str) -> list[bytes]:
    """Return what a target reads without complaint, to start from."""
    root = Path(__file__).parents[1]
    spectrum = (
        b"frequency_hz,density,angle_x_rad,angle_x_phase_rad\n5,0,1e-5,0\n10,1e-2,2e-5,0.1\n500,1e-2,0,3\n"
    )
    rows = b"t,dx,dy,dz,dvx,dvy,dvz\n0.1,0,0,1e-3,0,0,0.98\n0.2,0,0,2e-3,0,0,0.98\n0.3,1e-3,0,2e-3,0,0,0.98\n"
    rates = b"t [s],x,y,z\n0,0,0,1\n1,0,0,3\n2,0,0,3\n"
    header = (root / "generated" / "c_fixed" / "euler_product_w32.h").read_bytes()
    tableau = (Path(tableaux.__file__).parent / "butcher_tableaux" / "rk3.toml").read_bytes()
    window = (
        b'name = "W"\nsource = "s"\nprevious = 1\nahead = 1\nconditions = 2\nband = "1.3"\nobjective = "minimax"\n'
        b'filters = [[0, 1, 0], ["-1/4", 0, "1/4"]]\n'
        b'[[one_sided]]\nprevious = 2\nahead = 0\nobjective = "mean square"\nnoise = "3e-4"\n'
        b'filters = [[0, 0, 1], [0, "-1/2", "1/2"]]\n'
    )
    return {
        "increments": [b"0.1,0,0,1e-3\n0.2,0,0,2e-3\n0.3,0,0,0\n", rows],
        "inertial": [rows],
        "rates": [rates],
        "repaired": [rates, rates.replace(b"1,0,0,3", b"1.1,0,0,3")],
        "spectrum": [spectrum],
        "tableau": [tableau, tableau.replace(b"name = ", b"name = 'My '+").replace(b"'My '+\"", b'"My ')],
        "window": [window],
        "arguments": [b"state[4], increments[2][3] -> next[4]", b"struct filter *f, rates[3], dt -> f.q[4]"],
        "format": [b"Q1.30", b"Q-5.36"],
        "sensor": [b"0.0175dps", b"3e-6rad", b"1/1000rad"],
        "contract": [header],
        "header": [header],
    }.get(name, [])


#: Functions of any bytes, by name; what they raise is a finding.
TARGETS: dict[str, Callable[[bytes], None]] = {
    "increments": _of_file(recording.read_increments),
    "inertial": _of_file(recording.read_inertial),
    "rates": _of_file(lambda path: recording.read_rates(path, "rad/s")),
    "repaired": _of_file(
        lambda path: recording.read(path, rate_unit="deg/s", repair="all", gaps="bridge", every=2)
    ),
    "spectrum": _of_file(read_spectrum),
    "tableau": _of_file(tableaux.read, ".toml"),
    "window": _of_file(windows.read, ".toml"),
    "arguments": _of_text(read_arguments),
    "format": _of_text(lambda text: Format.parse(text, 32)),
    "sensor": _of_text(lambda text: Sensor.of(text, Fraction(1, 100))),
    "contract": _of_text(Contract.read),
    "header": generated_header,
    "command-line": command_line,
}
