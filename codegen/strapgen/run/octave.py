"""The Octave back end runs generated MATLAB functions in GNU Octave; the loop of a run is in MATLAB too."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from strapgen.ir.sources import Sources
from strapgen.run import octave_process
from strapgen.run.evaluators import Array, Evaluator, Loop


class OctaveEvaluator(Evaluator):
    """A generated MATLAB function, which takes all samples in one call; they stand last in MATLAB."""

    def __init__(self, sources: Sources) -> None:
        super().__init__(sources, np.float64)

    @property
    def name(self) -> str:
        """Name of the back end."""
        return "octave"

    def call(self, inputs: Sequence[Any], feedback: Any, where: str = "") -> tuple[Sequence[Any], Any]:
        """Call the function on rows, see `Evaluator.call`."""
        count = len(feedback)
        arrays = [
            np.moveaxis(rows.reshape(count, *signal.shape), 0, -1)
            for rows, signal in zip(inputs, self.function.inputs, strict=True)
        ]
        shapes = [(*signal.shape, count) for signal in self.function.outputs]
        results = octave_process.call([self.sources], self.function.name, arrays, shapes)
        return [
            np.moveaxis(result, -1, 0).reshape(count, signal.size)
            for result, signal in zip(results, self.function.outputs, strict=True)
        ], feedback

    def loop(self, samples: Array, loop: Loop) -> tuple[Array, Array]:
        """Run the loop in MATLAB, many runs side by side, see `Evaluator.loop`."""
        runs, steps = samples.shape[:2]
        state, rows = self.function.inputs
        sources, rest = [self.sources], [str(loop.record_every)]
        if loop.restore is not None:
            sources.append(loop.restore.sources)
            rest += [str(loop.restore_every), f"@{sources[-1].function.name}"]
        records = 1 + steps // loop.record_every
        (history,) = octave_process.call(
            sources,
            f"{self.function.name}_propagate",
            [
                np.moveaxis(loop.state.reshape(runs, *state.shape), 0, -1),
                samples.reshape(runs, steps, *rows.shape).transpose(2, 3, 1, 0),
            ],
            [(*state.shape, records, runs)],
            *rest,
        )
        by_run = np.ascontiguousarray(np.moveaxis(history, (-1, -2), (0, 1)))
        return by_run.reshape(runs, records, state.size), loop.feedback
