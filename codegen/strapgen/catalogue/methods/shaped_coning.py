"""Coning coefficients that are designed for a band or a spectrum of vibration; files hold them as exact rationals.

`SHAPES` are those of the folder `coning_shapes`; a user's file is read by `read`. A step by them has the compressed
form, the newest sample times a weighted sum of older ones. It suits coning, and no other motion.
"""

from __future__ import annotations

import shlex
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from decimal import Decimal, InvalidOperation
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

from strapgen.catalogue import toml_files
from strapgen.catalogue.methods import coefficient_files
from strapgen.catalogue.methods.coefficient_files import CoefficientFiles, band, entries, gyro, rational
from strapgen.catalogue.methods.method_spec import Asked, StepSamples
from strapgen.catalogue.methods.window import GyroResponse
from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import notebook_latex, short_repr
from strapgen.ir.suggestions import counted
from strapgen.registry import Merged, Registry, Titles

#: Keys of a file, and those of them that are optional.
KEYS = (
    *("name", "source", "samples", "previous", "objective", "powers", "products", "band", "level", "gyro"),
    "coefficients",
)
OPTIONAL = ("powers", "products", "band", "level", "gyro")

#: What the coefficients are best at: the largest drift over a band, or the drift under a spectrum whose phases are
#: unknown, or random.
OBJECTIVES = ("band", "worst", "random")

#: Most samples of a step, and most from before it.
MOST_SAMPLES, MOST_KEPT = 8, 32
#: Most bytes of a file, and most digits of a level.
MOST_BYTES, MOST_DIGITS = 100_000, 12
#: How far the largest drift may be missed, by itself, by the parabola through three of many points.
_MISSED = Decimal("1e-6")


@dataclass(frozen=True)
class ShapedConing:
    """Coning coefficients for a band or a spectrum.

    With the newest sample d_0 of a step, and d_(-s) the sample s before it, in rad, the rotation vector of the step is
    the sum of its samples plus (sum_s K_s d_(-s)) x d_0.

    Parameters
    ----------
    name, title, source : str
        Name on the command line, name for a reader, and where the coefficients come from.
    samples, previous : int
        Samples of the step (N), and samples from before it (p).
    objective : str
        One of `OBJECTIVES`.
    coefficients : tuple of Fraction, (N + p - 1,)
        K_1, K_2, ...
    powers : int
        Number of powers of the frequency, from the third on, that the drift on coning has not.
    products : int
        Highest total degree of products of two powers of time in the rate for which a step is exact; 0 for none.
    band : Fraction or None
        Highest angular frequency in rad a sample for which they are designed; None if that is a spectrum.
    gyro : GyroResponse or None
        The gyro through which the motion is seen; None for increments that are integrals of the rate.
    level : Decimal or None
        Largest drift over the band in rad a step, for each squared radian of the half-angle.
    file : str
        Path of the file; empty for one of the catalogue.

    Examples
    --------
    >>> shape = SHAPES["coning-shaped-8"]
    >>> shape.samples, shape.previous, float(shape.band), str(shape.level)
    (1, 8, 1.3, '7.00799E-10')
    """

    name: str
    title: str
    source: str
    samples: int
    previous: int
    objective: str
    coefficients: tuple[Fraction, ...]
    powers: int = 0
    products: int = 0
    band: Fraction | None = None
    gyro: GyroResponse | None = None
    level: Decimal | None = None
    file: str = field(default="", compare=False, repr=False)

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        return f"{self.name}: {self.title}\n{counted(self.samples, 'sample')}, {self.previous} before"

    @property
    def option(self) -> str:
        """The option that chooses it on the command line."""
        return f"--coning {shlex.quote(self.file)}" if self.file else f"--method {self.name}"

    kind: ClassVar = "set of coning coefficients"

    @property
    def own_samples(self) -> int:
        """Increments in a step."""
        return self.samples

    @property
    def recipe(self) -> tuple[str, str, tuple[Any, ...]]:
        """Module, function and arguments that make a `Method` of it."""
        return f"{__package__}.coning", "shaped", (self,)

    def select(self, asked: Asked) -> tuple[ShapedConing, StepSamples]:
        """Return the coefficients and their samples, which are the only ones that can be asked for."""
        if asked.rates:
            raise InputError(f"{self.name} takes increments; rates at nodes do not go with it")
        stated = {"increments": asked.increments, "previous": asked.previous, "ahead": asked.ahead}
        for (what, value), needed in zip(stated.items(), (self.samples, self.previous, 0), strict=True):
            if value is not None and checks.count(what, value, smallest=0) != needed:
                raise InputError(f"{what} is {value}; a step of {self.name} has {needed}")
        return self, (self.samples, self.previous, 0)

    @property
    def pairs(self) -> dict[tuple[int, int], Fraction]:
        """The coefficient of each cross product older x newest, by the numbers of the samples; the oldest is 0."""
        newest = self.samples + self.previous - 1
        return {(newest - s, newest): c for s, c in reversed([*enumerate(self.coefficients, 1)])}


def _shipped(path: Path, name: str) -> ShapedConing:
    """Read coefficients of strapgen, whose file the tests verify."""
    return _shape(tomllib.loads(path.read_text("utf-8")), name)


def _installed(path: Path, name: str) -> ShapedConing:
    """Read the coefficients of an installed package, which have the name of their file."""
    return replace(read(path), name=name, file="")


_FILES = Registry("coning_shapes", Path)
_BUILT_IN = CoefficientFiles(_FILES.own, _shipped)
_INSTALLED = CoefficientFiles(_FILES, _installed, without=_FILES.own)

#: The coefficients of strapgen and of installed packages, by name, and their titles.
SHAPES: Merged[ShapedConing] = Merged(_BUILT_IN, _INSTALLED)
SHAPE_TITLES: Merged[str] = Merged(
    {name: str(tomllib.loads(path.read_text("utf-8"))["name"]) for name, path in _FILES.own.items()},
    Titles(_INSTALLED),
)


def read(path: str | Path) -> ShapedConing:
    """Read coefficients from a TOML file with the keys of `KEYS`, and check what they are said to be."""
    data = toml_files.content(path, "a file of coning coefficients", MOST_BYTES)
    try:
        coefficient_files.check_keys(data, KEYS, OPTIONAL)
        name = coefficient_files.slug(data["name"])
        if name in _BUILT_IN or name in WINDOWS:
            raise InputError(f"name {data['name']!r} is that of the method {name}; another one is needed")
        shape = _shape(data, name)
        verify(shape)
        file = checks.text("the name of the file", str(path))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return replace(shape, file=file)


def verify(shape: ShapedConing) -> None:
    """Check that the conditions hold exactly, and that the level is right to its digits."""
    from strapgen.catalogue.methods import coning_drift

    of = coning_drift.ConingShape(shape.samples, shape.previous, shape.gyro)
    for q, (row, right) in enumerate(coning_drift.powers(of, shape.powers), 1):
        total = sum((a * c for a, c in zip(row, shape.coefficients, strict=True)), Fraction(0))
        if total != right:
            raise InputError(
                f"powers is {shape.powers}, but the drift has the power {2 * q + 1} of the frequency "
                f"(off by {float(total - right):.3g})"
            )
    for row, right in coning_drift.products(of, shape.products):
        total = sum((a * c for a, c in zip(row, shape.coefficients, strict=True)), Fraction(0))
        if total != right:
            raise InputError(
                f"products is {shape.products}, but a step is not exact for all products of powers of time to that "
                f"degree (off by {float(total - right):.3g})"
            )
    if shape.band is not None and shape.level is not None:
        largest = coning_drift.largest(of, shape.coefficients, shape.band)
        # Half a unit of the last digit, and what the search for the largest drift may miss.
        allowed = Decimal(1).scaleb(int(shape.level.as_tuple().exponent)) / 2 + Decimal(largest) * _MISSED
        if abs(Decimal(largest) - shape.level) > allowed:
            raise InputError(f"level is {shape.level}; the coefficients have {largest:.6g} over their band")


def _shape(data: Mapping[str, Any], name: str) -> ShapedConing:
    """Return coefficients from the content of a file with all keys, after a check of its numbers and its shape."""
    samples = checks.count("samples", data["samples"], largest=MOST_SAMPLES)
    previous = checks.count("previous", data["previous"], smallest=0, largest=MOST_KEPT)
    count = samples + previous - 1
    if not count:
        raise InputError("samples 1 and previous 0 have no coefficients; more samples are needed")
    numbers = entries("coefficients", data["coefficients"])
    if len(numbers) != count:
        raise InputError(
            f"coefficients has {counted(len(numbers), 'number')}; {count} are needed for {samples} samples "
            f"and {previous} from before them"
        )
    objective = checks.choice("objective", data["objective"], OBJECTIVES)
    for key in ("band", "level"):
        if (key in data) != (objective == "band"):
            raise InputError(f"key {key} goes with the objective band, and that needs it")
    return ShapedConing(
        name,
        data["name"],
        data["source"],
        samples,
        previous,
        objective,
        tuple(rational(f"coefficient {k}", number) for k, number in enumerate(numbers, 1)),
        checks.count("powers", data.get("powers", 0), smallest=0, largest=count),
        checks.count("products", data.get("products", 0), smallest=0, largest=count),
        band(data["band"]) if "band" in data else None,
        gyro(data.get("gyro")),
        _level(data["level"]) if "level" in data else None,
    )


def _level(value: Any) -> Decimal:
    try:
        level = Decimal(checks.text("level", value))
    except InvalidOperation:
        level = Decimal("nan")
    if not (level.is_finite() and level > 0 and len(level.as_tuple().digits) <= MOST_DIGITS):
        raise InputError(
            f"level is {value!r}; a decimal number above 0 of at most {MOST_DIGITS} digits is needed"
        )
    return level
