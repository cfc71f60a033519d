"""The mean drift and sculling rates that an algorithm computes under vibration, derived from its kernel.

Source: P. G. Savage, Strapdown System Algorithms, AGARD Lecture Series 133 (1984), paper 3, equations (65) to (83).

>>> from strapgen import vibration
>>> print(vibration.of("euler", "drift").unit)
rad/s
"""

from importlib import import_module as _import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from strapgen.analysis.vibration.assessment import drift as drift
    from strapgen.analysis.vibration.assessment import of as of
    from strapgen.analysis.vibration.assessment import sculling as sculling
    from strapgen.analysis.vibration.assessment import through_gyro as through_gyro
    from strapgen.analysis.vibration.assessment import through_gyros as through_gyros
    from strapgen.analysis.vibration.assessment import two_speed as two_speed
    from strapgen.analysis.vibration.mean_rates import Assessment as Assessment
    from strapgen.analysis.vibration.mean_rates import Rates as Rates
    from strapgen.analysis.vibration.rectification import Rectification as Rectification
    from strapgen.analysis.vibration.rectification import Tone as Tone
    from strapgen.analysis.vibration.rectification import rectified as rectified
    from strapgen.analysis.vibration.spectrum import RandomRates as RandomRates
    from strapgen.analysis.vibration.spectrum import Spectrum as Spectrum
    from strapgen.analysis.vibration.spectrum import random_rates as random_rates
    from strapgen.analysis.vibration.spectrum import read_spectrum as read_spectrum

#: The modules of the names above, imported when one is first used.
_MODULES = {
    name: module
    for module, names in {
        "assessment": ("drift", "of", "sculling", "through_gyro", "through_gyros", "two_speed"),
        "mean_rates": ("Assessment", "Rates"),
        "rectification": ("Rectification", "Tone", "rectified"),
        "spectrum": ("RandomRates", "Spectrum", "random_rates", "read_spectrum"),
    }.items()
    for name in names
}

__all__ = [*_MODULES]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        if name in _MODULES:
            return getattr(_import_module(f"{__name__}.{_MODULES[name]}"), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
