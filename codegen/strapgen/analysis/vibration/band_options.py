"""Options of the band and the gyro for which coefficients are designed."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from strapgen.cli.options import option
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.catalogue.methods.window import GyroResponse

_Text = str | None

#: The damping of a gyro of second order, beside its natural frequency.
GyroDamping = Annotated[
    str | None, option("--gyro-damping", metavar="RATIO", help="Damping of that gyro, as 0.7071.")
]


@dataclass(frozen=True)
class BandOptions:
    """Options of the band of the motion, and of the gyro."""

    panel: ClassVar[str] = "Band"

    band: Annotated[
        _Text,
        option("--band", metavar="RAD", help="Highest angular frequency of the rate in rad a sample."),
    ] = None
    band_hz: Annotated[
        _Text,
        option(
            "--band-hz",
            metavar="HZ",
            help="Highest frequency of the rate in Hz, in place of --band; it goes with --sample-hz.",
        ),
    ] = None
    sample_hz: Annotated[
        _Text, option("--sample-hz", metavar="HZ", help="Samples of the gyro in a second.")
    ] = None
    gyro_bandwidth_hz: Annotated[
        _Text,
        option(
            "--gyro-bandwidth-hz",
            metavar="HZ",
            help="Natural frequency of a gyro of second order, whose response the design takes out.",
        ),
    ] = None
    gyro_damping: GyroDamping = None

    def radians(self) -> Fraction:
        """Return the band in rad a sample."""
        from strapgen.catalogue.methods.window_conditions import PI

        if self.band is not None and self.band_hz is not None:
            raise InputError(f"--band {self.band} and --band-hz {self.band_hz} are both given; one is needed")
        if self.band is not None:
            band = checks.number("--band", self.band, positive=True)
        elif self.band_hz is None:
            raise InputError("a band is needed, as --band in rad a sample, or as --band-hz with --sample-hz")
        else:
            turns = checks.number("--band-hz", self.band_hz, positive=True) / self.sampling("--band-hz")
            band = Fraction(round(2 * PI * turns * 10**6), 10**6)
        if band >= 3:
            raise InputError(
                f"the band is {float(band):g} rad a sample; a number below 3 is needed, pi is half the sampling rate"
            )
        return band

    def gyro(self) -> GyroResponse | None:
        """Return the gyro; None if it is ideal."""
        from strapgen.catalogue.methods.window import GyroResponse

        if (self.gyro_bandwidth_hz is None) != (self.gyro_damping is None):
            missing = "--gyro-damping" if self.gyro_damping is None else "--gyro-bandwidth-hz"
            raise InputError(f"--gyro-bandwidth-hz and --gyro-damping go together; {missing} is missing")
        if self.gyro_bandwidth_hz is None or self.gyro_damping is None:
            return None
        return GyroResponse(
            checks.number("--gyro-bandwidth-hz", self.gyro_bandwidth_hz, positive=True),
            checks.number("--gyro-damping", self.gyro_damping, positive=True),
            self.sampling("--gyro-bandwidth-hz"),
        )

    def sampling(self, option: str) -> Fraction:
        """Return the sampling frequency in Hz, which an option needs."""
        if self.sample_hz is None:
            raise InputError(f"{option} needs --sample-hz, the samples of the gyro in a second")
        return checks.number("--sample-hz", self.sample_hz, positive=True)


def command_line(words: Sequence[str], groups: Sequence[Any], **others: str | None) -> str:
    """Return a command with the options that differ from their defaults, and with the names of files alone.

    >>> command_line(["strapgen", "window", "design"], [BandOptions(band_hz="20", sample_hz="100")], out="a b.toml")
    "strapgen window design --band-hz 20 --sample-hz 100 --out 'a b.toml'"
    """
    options: dict[str, Any] = {
        part.name: getattr(group, part.name)
        for group in groups
        for part in fields(group)
        if getattr(group, part.name) != part.default
    }
    options |= {name: value for name, value in others.items() if value is not None}
    line = list(words)
    for name, value in options.items():
        line += [f"--{name.replace('_', '-')}", value.name if isinstance(value, Path) else str(value)]
    return shlex.join(line)


def not_negative(what: str, value: str) -> Fraction:
    """Read an option that takes a number from 0 on, exactly."""
    number = checks.number(what, value)
    if number < 0:
        raise InputError(f"{what} is {value}; a number that is not below 0 is needed")
    return number
