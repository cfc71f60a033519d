"""The names as plain data: listing them imports no computer algebra."""

from strapgen.catalogue import Integrator, Recipe
from strapgen.lab.motions.motion_names import MotionEntry
from strapgen.run.backend_names import Entry

KERNELS = {"twist-z": Recipe("rotation about z in Euler parameters", "toy_application.kernel", "twist_z")}
METHODS = {"middle-rate": Integrator("rotation by the rate in the middle", "toy_application.method", 2)}
MOTIONS = {"swing": MotionEntry({"angle": "rad", "frequency": "Hz"}, "toy_application.motion:swing")}
_NUMPY = "strapgen.run.numpy_evaluator:NumpyEvaluator"
BACKENDS = {"numpy-licensed": Entry("generated numpy code with its licence", "numpy-licensed", _NUMPY)}
