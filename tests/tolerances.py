"""Bounds of what rounding does to a run, from which tolerances come."""

from __future__ import annotations

import numpy as np

from strapgen.run.backends import Backend
from strapgen.run.evaluators import Evaluator

# In floating point one step multiplies the state by a transition near a rotation: a sum of at most four products of
# numbers up to 1, whose rounding is below 5 units of round-off for each of at most two terms that matter, and a
# transition that is itself off by a few units. 16 units a step bounds the sum.
UNITS_A_STEP = 16


def roundoff(backend: Backend, steps: int, orthonormalizations: int = 0) -> float:
    """Bound of the accumulated rounding of a run, in an element of the state, the rounding of increments included.

    In fixed point it is what is certified of a step, added up, and of every orthonormalization. Neither stretches a
    difference of states for long: what a step makes longer, an orthonormalization makes short again.
    """
    interface = getattr(backend, "interface", None)
    if interface is None:
        return UNITS_A_STEP * steps * backend.unit / 2
    total = interface.accumulation.bound(steps, rounded_inputs=True, stretch=1.0)
    if orthonormalizations:
        (result,) = backend.companion(backend._orthonormalization).interface.outputs
        width = result.signal.shape[-1]
        total += orthonormalizations * float(max(result.errors)) * np.sqrt(width)
    # The start and the state at the end are rounded to their format too.
    return total + backend.unit


def certified(backend: Backend, steps: int, orthonormalizations: int = 0) -> float:
    """Bound of the accumulated rounding of a run in fixed point; 0 in floating point, where nothing is certified."""
    return 0.0 if backend.rounding_bound(1) is None else roundoff(backend, steps, orthonormalizations)


def one_call(evaluator: Evaluator, units: float) -> float:
    """Bound of the rounding of one call: so many units of round-off; in fixed point what is certified.

    There the inputs are rounded to their format too: the callers' functions pass on less than four times as much.
    """
    interface = getattr(evaluator, "interface", None)
    if interface is None:
        return units * float(np.finfo(evaluator.dtype).eps)
    worst = max(float(max(argument.errors)) for argument in interface.outputs)
    return worst + 4 * max(float(argument.format.unit) / 2 for argument in interface.inputs)
