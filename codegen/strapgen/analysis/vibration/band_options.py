"""Options of the band and the gyro for which coefficients are designed."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Annotated, ClassVar

from strapgen.cli.option_groups import Needs, OneOf, Rule
from strapgen.cli.options import option
from strapgen.cli.values import Positive
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.catalogue.methods.window import GyroResponse

#: The damping of a gyro of second order, beside its natural frequency.
GYRO_DAMPING = option("--gyro-damping", metavar="RATIO", help="Damping of that gyro, as 0.7071.")
#: Either option of that gyro needs the other
GYRO_RULES = (Needs("--gyro-bandwidth-hz", "--gyro-damping"), Needs("--gyro-damping", "--gyro-bandwidth-hz"))


@dataclass(frozen=True)
class BandOptions:
    """Options of the band of the motion, and of the gyro."""

    panel: ClassVar[str] = "Band"
    rules: ClassVar[tuple[Rule, ...]] = (
        OneOf("--band --band-hz"),
        *GYRO_RULES,
        Needs("--band-hz --gyro-bandwidth-hz --spectrum", "--sample-hz"),
        Needs("--sample-hz", "--band-hz --gyro-bandwidth-hz --spectrum"),
    )

    band: Annotated[
        Positive | None,
        option("--band", metavar="RAD", help="Highest angular frequency of the rate in rad a sample."),
    ] = None
    band_hz: Annotated[
        Positive | None,
        option(
            "--band-hz",
            metavar="HZ",
            help="Highest frequency of the rate in Hz, in place of --band; it goes with --sample-hz.",
        ),
    ] = None
    sample_hz: Annotated[
        Positive | None, option("--sample-hz", metavar="HZ", help="Samples of the gyro in a second.")
    ] = None
    gyro_bandwidth_hz: Annotated[
        Positive | None,
        option(
            "--gyro-bandwidth-hz",
            metavar="HZ",
            help="Natural frequency of a gyro of second order, whose response the design takes out.",
        ),
    ] = None
    gyro_damping: Annotated[Positive | None, GYRO_DAMPING] = None

    def radians(self) -> Fraction:
        """Return the band in rad a sample."""
        from strapgen.catalogue.methods.window_conditions import PI

        if self.band is not None:
            band = Fraction(self.band)
        elif self.band_hz is None or self.sample_hz is None:
            raise InputError("a band is needed, as --band in rad a sample, or as --band-hz with --sample-hz")
        else:
            band = Fraction(round(2 * PI * self.band_hz / self.sample_hz * 10**6), 10**6)
        if band >= 3:
            raise InputError(
                f"the band is {float(band):g} rad a sample; a number below 3 is needed, pi is half the sampling rate"
            )
        return band

    def gyro(self) -> GyroResponse | None:
        """Return the gyro; None if it is ideal."""
        from strapgen.catalogue.methods.window import GyroResponse

        if self.gyro_bandwidth_hz is None or self.gyro_damping is None or self.sample_hz is None:
            return None
        return GyroResponse(self.gyro_bandwidth_hz, self.gyro_damping, self.sample_hz)
