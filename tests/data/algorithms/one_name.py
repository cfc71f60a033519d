"""Euler parameters by any tableau under one name, with a normalization and an attitude under names of their own."""

from dataclasses import replace

from strapgen.catalogue import Choice, derive
from strapgen.catalogue.kernels.attitude_step import step
from strapgen.catalogue.kinematics import KINEMATICS
from strapgen.catalogue.methods import runge_kutta
from strapgen.catalogue.methods.tableaux import TABLEAUX


def algorithm(method=TABLEAUX["rk4"], increments=2, previous=0):
    """Return the step; by rk1 its normalization is that of first order."""
    kernel = step(KINEMATICS["euler"], runge_kutta.method(method), increments, previous)
    scheme = "euler-normalize-first-order" if method.name == "rk1" else "euler-normalize"
    return replace(
        kernel,
        name="mine",
        attitude_step=replace(kernel.attitude_step, orthonormalize="mend", attitude="matrix-from-mine"),
        bundled_kernels=(
            replace(derive(Choice(scheme)), name="mend"),
            replace(derive(Choice("dcm-from-euler")), name="matrix-from-mine"),
        ),
    )
