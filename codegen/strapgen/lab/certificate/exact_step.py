"""The exact step of an algorithm in balls, and the error of computed states beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from strapgen import pipeline
from strapgen.catalogue import Choice, choose
from strapgen.ir.exceptions import InputError
from strapgen.lab.certificate.balls import column_of, evaluate_single, product_in_pairs, scalar_function

Array = NDArray[np.float64]


#: Bits by which an orthonormalization widens balls, at most.
_WIDER = 8


class Restoring(NamedTuple):
    """The kernel that orthonormalizes, and the steps of the run from one time to the next."""

    kernel: str
    every: int


class ExactStep:
    """A step that multiplies the state by a transition: its transition, its product and its attitude, in balls."""

    def __init__(self, choice: Choice) -> None:
        program = pipeline.program(choice)
        kernels = program.attitude_step
        if kernels is None or kernels.product is None or program.inputs[1].name != "increments":
            raise InputError(
                f"a certificate needs a step that multiplies the attitude by a transition; {choice.kernel} does not"
            )
        self.choice = choice
        self._transition = program.transition_program()
        self._product = pipeline.program(choose(kernels.product))
        self._attitude = None if kernels.attitude is None else pipeline.program(choose(kernels.attitude))

    def transitions(self, samples: Array) -> list[Any]:
        """Return the product of the transitions of blocks of steps.

        `samples` (K, n, samples, 3): increments in rad, exact. Returns the elements, (K,) each.
        """
        return product_in_pairs(self._product, self.turns(samples))

    def turns(self, samples: Array) -> list[Any]:
        """Return the transitions of blocks of steps, (K, n) for each element; parameters are those of `transitions`."""
        blocks, steps = samples.shape[:2]
        flat = samples.reshape(blocks * steps, -1)
        values = [column_of(column.tolist()) for column in flat.T]
        turns = evaluate_single(self._transition, values)
        return [np.broadcast_to(turn, blocks * steps).reshape(blocks, steps) for turn in turns]

    def restored(self, state: Sequence[Any], samples: Array, first: int, restoring: Restoring) -> list[Any]:
        """Return a state after steps, with exact orthonormalizations between them.

        `samples` (n, samples, 3): increments in rad. `first`: steps of the run before them.
        """
        from flint import ctx

        # One after the other, each step widens balls by the sum of a row of its transition, and what restores by more.
        times = (first + len(samples)) // restoring.every - first // restoring.every
        with ctx.extraprec(int(4 * np.abs(samples).sum()) + _WIDER * times):
            product = scalar_function(self._product)
            restore = scalar_function(pipeline.program(choose(restoring.kernel)))
            after = [*state]
            for step, turn in enumerate(zip(*(row[0] for row in self.turns(samples[None])), strict=True), 1):
                (after,) = product(*after, *turn)
                if (first + step) % restoring.every == 0:
                    (after,) = restore(*after)
        return after

    def state(self, numbers: NDArray[Any]) -> list[Any]:
        """Return a state of numbers in double as balls."""
        return [*column_of(numbers.ravel().tolist())]

    def after(self, state: Sequence[Any], turn: Sequence[Any]) -> list[Any]:
        """Return a state after a transition."""
        return evaluate_single(self._product, [*state, *turn])

    def matrix(self, state: Sequence[Any]) -> Any:
        """Return the direction cosines of a state, times its length squared where it has one."""
        from flint import arb_mat

        elements = state if self._attitude is None else evaluate_single(self._attitude, state)
        return arb_mat(3, 3, [*elements])
