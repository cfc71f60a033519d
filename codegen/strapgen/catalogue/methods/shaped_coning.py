"""Coning coefficients that are designed for a band or a spectrum of vibration; files hold them as exact rationals.

`SHAPES` are those of the folder `coning_shapes`; a user's file is read by `read`. A step by them has the compressed
form, the newest sample times a weighted sum of older ones. It suits coning, and no other motion.
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field, replace
from decimal import Decimal, InvalidOperation
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, ClassVar

from strapgen.catalogue.methods import coefficient_files
from strapgen.catalogue.methods.coefficient_files import Band, CoefficientFiles, Gyro, Source, Title
from strapgen.catalogue.methods.method_spec import RequestedSamples, StepSamples
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.catalogue.toml_models import Key, UserFile
from strapgen.ir import checks
from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import notebook_latex, short_repr
from strapgen.ir.renamed import renamed
from strapgen.registry import Merged, Registry, Titles

#: Objective of the design: the largest drift over a band, or the drift under a spectrum whose phases are
#: unknown, or random.
OBJECTIVES = ("band", "worst", "random")

#: Most samples of a step, and most from before it.
MOST_SAMPLES, MOST_KEPT = 8, 32
#: Most digits of a level.
MOST_DIGITS = 12
#: How far the largest drift may be missed, by itself, by the parabola through three of many points.
_MISSED = Decimal("1e-6")


@renamed(samples="increments")
@dataclass(frozen=True)
class ShapedConing:
    """Coning coefficients for a band or a spectrum.

    With the newest sample d_0 of a step, and d_(-s) the sample s before it, in rad, the rotation vector of the step is
    the sum of its samples plus (sum_s K_s d_(-s)) x d_0.

    Parameters
    ----------
    name, title, source : str
        Name on the command line, name for a reader, and where the coefficients come from.
    increments, previous : int
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
    gyro : Response or None
        The gyro through which the motion is seen; None for increments that are integrals of the rate.
    level : Decimal or None
        Largest drift over the band in rad a step, for each squared radian of the half-angle.
    file : str
        Path of the file; empty for one of the catalogue.

    Examples
    --------
    >>> shape = SHAPES["coning-shaped-8"]
    >>> shape.increments, shape.previous, float(shape.band), str(shape.level)
    (1, 8, 1.3, '7.00799E-10')
    """

    name: str
    title: str
    source: str
    increments: int
    previous: int
    objective: str
    coefficients: tuple[Fraction, ...]
    powers: int = 0
    products: int = 0
    band: Fraction | None = None
    gyro: Response | None = None
    level: Decimal | None = None
    file: str = field(default="", compare=False, repr=False)

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        return f"{self.name}: {self.title}\n{counted(self.increments, 'sample')}, {self.previous} before"

    @property
    def option(self) -> str:
        """The option that chooses it on the command line."""
        return f"--coning {shlex.quote(self.file)}" if self.file else f"--method {self.name}"

    kind: ClassVar[str] = "set of coning coefficients"

    @property
    def own_samples(self) -> int:
        """Increments in a step."""
        return self.increments

    @property
    def recipe(self) -> tuple[str, str, tuple[Any, ...]]:
        """Module, function and arguments that make a `Method` of it."""
        return f"{__package__}.coning", "shaped", (self,)

    def select(self, asked: RequestedSamples) -> tuple[ShapedConing, StepSamples]:
        """Return the coefficients and their samples; no other numbers of samples are allowed."""
        if asked.rates:
            raise InputError(f"{self.name} takes increments; rates at nodes do not go with it")
        stated = {"increments": asked.increments, "previous": asked.previous, "ahead": asked.ahead}
        for (what, value), needed in zip(stated.items(), (self.increments, self.previous, 0), strict=True):
            if value is not None and checks.count(what, value, smallest=0) != needed:
                raise InputError(f"{what} is {value}; a step of {self.name} has {needed}")
        return self, (self.increments, self.previous, 0)

    @property
    def pairs(self) -> dict[tuple[int, int], Fraction]:
        """The coefficient of each cross product older x newest, by the numbers of the samples; the oldest is 0."""
        newest = self.increments + self.previous - 1
        return {(newest - s, newest): c for s, c in reversed([*enumerate(self.coefficients, 1)])}


@dataclass(frozen=True)
class ShapeFile:
    """Coning coefficients for a band or a spectrum of vibration; strapgen verifies their stated properties."""

    name: Title
    source: Source
    samples: Annotated[int, Key("Samples of the step", "1", least=1, most=MOST_SAMPLES)]
    previous: Annotated[int, Key("Samples from before it", "1", least=0, most=MOST_KEPT)]
    objective: Annotated[str, Key("Objective of the design", choices=OBJECTIVES)]
    coefficients: Annotated[
        tuple[Fraction, ...], Key("K_1, K_2, ... of the samples before the newest one", least=1)
    ]
    powers: Annotated[
        int, Key("Powers of the frequency, from the third on, that are annulled in the drift", "1", least=0)
    ] = 0
    products: Annotated[
        int,
        Key(
            "Highest degree of products of powers of time for which a step is exact; 0 for none", "1", least=0
        ),
    ] = 0
    band: Band | None = None
    level: Annotated[
        str | None,
        Key(
            f"Largest drift over the band, in at most {MOST_DIGITS} digits, as a text",
            "rad a step, for each squared radian of the half-angle",
            pattern=r"[0-9]*\.?[0-9]*([eE][-+]?[0-9]{1,3})?",
            form="a text of a decimal number",
        ),
    ] = None
    gyro: Gyro | None = None

    def __post_init__(self) -> None:
        coefficient_files.check_gyro(self.gyro)
        count = self.samples + self.previous - 1
        if len(self.coefficients) != count:
            raise InputError(
                f"coefficients has {counted(len(self.coefficients), 'number')}; {count} are needed for {self.samples} "
                f"samples and {self.previous} from before them"
            )
        for key in ("powers", "products"):
            checks.count(key, getattr(self, key), smallest=0, largest=count)
        for key in ("band", "level"):
            if (getattr(self, key) is not None) != (self.objective == "band"):
                raise InputError(f"key {key} goes with the objective band, and that needs it")

    def shape(self, name: str) -> ShapedConing:
        """Return the coefficients under a name, not verified."""
        level = None if self.level is None else _level(self.level)
        return ShapedConing(
            *(name, self.name, self.source, self.samples, self.previous, self.objective, self.coefficients),
            *(self.powers, self.products, self.band, self.gyro, level),
        )


SHAPE = UserFile("a file of coning coefficients", ShapeFile, 100_000)


def _shipped(path: Path, name: str) -> ShapedConing:
    """Read coefficients of strapgen, whose file the tests verify."""
    return SHAPE.read(path).shape(name)


def _installed(path: Path, name: str) -> ShapedConing:
    """Read the coefficients of an installed package, which have the name of their file."""
    return replace(read(path), name=name, file="")


_FILES = Registry("coning_shapes", Path)
_BUILT_IN = CoefficientFiles(_FILES.own, _shipped)
_INSTALLED = CoefficientFiles(_FILES, _installed, without=_FILES.own)

#: The coefficients of strapgen and of installed packages, by name, and their titles.
SHAPES: Merged[ShapedConing] = Merged(_BUILT_IN, _INSTALLED)
SHAPE_TITLES: Merged[str] = Merged(
    {name: str(SHAPE.content(path)["name"]) for name, path in _FILES.own.items()},
    Titles(_INSTALLED),
)


def read(path: str | Path) -> ShapedConing:
    """Read coefficients from a TOML file with the keys of `ShapeFile`, and verify their stated properties."""

    def shape(stated: ShapeFile) -> ShapedConing:
        name = coefficient_files.slug(stated.name)
        if name in _BUILT_IN or name in WINDOWS:
            raise InputError(f"name {stated.name!r} is that of the method {name}; another one is needed")
        verify(one := stated.shape(name))
        return replace(one, file=checks.text("the name of the file", str(path)))

    return SHAPE.convert(path, shape)


def verify(shape: ShapedConing) -> None:
    """Check that the conditions hold exactly, and that the level is right to its digits."""
    from strapgen.catalogue.methods import coning_drift

    of = coning_drift.ConingShape(shape.increments, shape.previous, shape.gyro)
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


def _level(value: str) -> Decimal:
    try:
        level = Decimal(value)
    except InvalidOperation:
        level = Decimal("nan")
    if not (level.is_finite() and level > 0 and len(level.as_tuple().digits) <= MOST_DIGITS):
        raise InputError(
            f"level is {value!r}; a decimal number above 0 of at most {MOST_DIGITS} digits is needed"
        )
    return level
