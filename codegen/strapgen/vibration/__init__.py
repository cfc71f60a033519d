"""The mean drift and sculling rates that an algorithm computes under vibration, derived from its kernel.

Source: P. G. Savage, Strapdown System Algorithms, AGARD Lecture Series 133 (1984), paper 3, equations (65) to (83).
"""

from importlib import import_module as _import_module
from typing import TYPE_CHECKING

from strapgen.vibration.assessment import drift as drift
from strapgen.vibration.assessment import of as of
from strapgen.vibration.assessment import sculling as sculling
from strapgen.vibration.assessment import two_speed as two_speed
from strapgen.vibration.gyro import through_gyro as through_gyro
from strapgen.vibration.gyro import through_gyros as through_gyros
from strapgen.vibration.mean_rates import Assessment as Assessment
from strapgen.vibration.mean_rates import Rates as Rates

#: Names of the integrals over a spectrum, which take numpy; rates at a frequency do without it.
_OF_SPECTRA = ("RandomRates", "Spectrum", "random_rates", "read_spectrum")

if TYPE_CHECKING:
    from strapgen.vibration.spectrum import RandomRates as RandomRates
    from strapgen.vibration.spectrum import Spectrum as Spectrum
    from strapgen.vibration.spectrum import random_rates as random_rates
    from strapgen.vibration.spectrum import read_spectrum as read_spectrum
else:

    def __getattr__(name: str) -> object:
        if name in _OF_SPECTRA:
            return getattr(_import_module(f"{__name__}.spectrum"), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
