"""Errors of gyros and accelerometers, from a file or as numbers: they turn true increments into measured ones.

`read` reads a file or a class by name, `measured` and `measured_recording` make a motion and a recording those of
sensors with errors.

>>> from strapgen import sensors
>>> list(sensors.read("ahrs").causes)
['bias', 'scale', 'misalignment', 'noise']
"""

from importlib import import_module as _import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from strapgen.lab.sensor_errors.error_file import CLASSES as CLASSES
    from strapgen.lab.sensor_errors.error_file import read as read
    from strapgen.lab.sensor_errors.instruments import CAUSES as CAUSES
    from strapgen.lab.sensor_errors.instruments import Heating as Heating
    from strapgen.lab.sensor_errors.instruments import InstrumentErrors as InstrumentErrors
    from strapgen.lab.sensor_errors.instruments import OutputNoise as OutputNoise
    from strapgen.lab.sensor_errors.instruments import Sampling as Sampling
    from strapgen.lab.sensor_errors.instruments import TriadErrors as TriadErrors
    from strapgen.lab.sensor_errors.instruments import WarmUp as WarmUp
    from strapgen.lab.sensor_errors.instruments import dither_amplitude as dither_amplitude
    from strapgen.lab.sensor_errors.instruments import dithered_laser_noise as dithered_laser_noise
    from strapgen.lab.sensor_errors.measured_motions import measured as measured
    from strapgen.lab.sensor_errors.measured_motions import measured_recording as measured_recording
    from strapgen.lab.sensor_errors.sensors import MeasurementUnit as MeasurementUnit

__all__ = [
    "CAUSES",
    "CLASSES",
    "Heating",
    "InstrumentErrors",
    "MeasurementUnit",
    "OutputNoise",
    "Sampling",
    "TriadErrors",
    "WarmUp",
    "dither_amplitude",
    "dithered_laser_noise",
    "measured",
    "measured_recording",
    "read",
]

#: The modules of the names above, imported when one is first used.
_MODULES = {
    "dither_amplitude": "instruments",
    "dithered_laser_noise": "instruments",
    "CLASSES": "error_file",
    "read": "error_file",
    "CAUSES": "instruments",
    "Heating": "instruments",
    "InstrumentErrors": "instruments",
    "OutputNoise": "instruments",
    "Sampling": "instruments",
    "TriadErrors": "instruments",
    "WarmUp": "instruments",
    "measured": "measured_motions",
    "measured_recording": "measured_motions",
    "MeasurementUnit": "sensors",
}

if not TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        if name in _MODULES:
            return getattr(_import_module(f"{__name__}.{_MODULES[name]}"), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
