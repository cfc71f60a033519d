"""Errors of gyros and accelerometers, from a file or as numbers: they turn true increments into measured ones.

`read` reads a file or a class by name, `measured` and `measured_recording` make a motion and a recording those of
sensors with errors.
"""

from strapgen.simulation.sensor_errors.dither import dither_amplitude as dither_amplitude
from strapgen.simulation.sensor_errors.dither import dithered_laser_noise as dithered_laser_noise
from strapgen.simulation.sensor_errors.error_file import CLASSES as CLASSES
from strapgen.simulation.sensor_errors.error_file import read as read
from strapgen.simulation.sensor_errors.instruments import CAUSES as CAUSES
from strapgen.simulation.sensor_errors.instruments import Heating as Heating
from strapgen.simulation.sensor_errors.instruments import InstrumentErrors as InstrumentErrors
from strapgen.simulation.sensor_errors.instruments import OutputNoise as OutputNoise
from strapgen.simulation.sensor_errors.instruments import Sampling as Sampling
from strapgen.simulation.sensor_errors.instruments import TriadErrors as TriadErrors
from strapgen.simulation.sensor_errors.instruments import WarmUp as WarmUp
from strapgen.simulation.sensor_errors.measured_motions import measured as measured
from strapgen.simulation.sensor_errors.measured_motions import measured_recording as measured_recording
from strapgen.simulation.sensor_errors.sensors import MeasurementUnit as MeasurementUnit
