"""The names of the kernels as plain data: listing them imports no computer algebra."""

from strapgen.ir.recipe import Recipe

KERNELS = {"twist-z": Recipe("rotation about z in Euler parameters", "toy_application.kernel", "twist_z")}
