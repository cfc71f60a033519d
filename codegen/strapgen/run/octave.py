"""The Octave back end runs generated MATLAB functions in GNU Octave; the loop of a run is in MATLAB too."""

from __future__ import annotations

import numpy as np

from strapgen.ir.sources import Sources
from strapgen.run import octave_process
from strapgen.run.evaluators import Array, Evaluator
from strapgen.run.protocol import Backend
from strapgen.run.step_sources import StepSources


class OctaveEvaluator(Evaluator):
    """A generated MATLAB function, which takes all samples in one call."""

    def __init__(self, sources: Sources) -> None:
        super().__init__(sources, np.float64)

    def evaluate(self, arrays: list[Array], batch: tuple[int, ...]) -> tuple[Array, ...]:
        """Evaluate on checked arrays, whose samples stand last in MATLAB."""
        count = int(np.prod(batch, dtype=int))
        samples = [
            np.moveaxis(np.broadcast_to(array, batch + signal.shape).reshape(count, *signal.shape), 0, -1)
            for array, signal in zip(arrays, self.function.inputs, strict=True)
        ]
        shapes = [(*signal.shape, count) for signal in self.function.outputs]
        results = octave_process.call([self.sources], self.function.name, samples, shapes)
        return tuple(
            np.ascontiguousarray(np.moveaxis(result, -1, 0)).reshape(batch + signal.shape)
            for result, signal in zip(results, self.function.outputs, strict=True)
        )


class OctaveBackend(Backend):
    """Runs generated MATLAB in Octave, many runs side by side."""

    def __init__(self, parts: StepSources) -> None:
        super().__init__(parts, OctaveEvaluator(parts.step))
        self.name = "octave"

    def beside(self, kernel: str) -> OctaveEvaluator:
        """Return another kernel in Octave, see `Backend.beside`."""
        return OctaveEvaluator(self._sources(kernel))

    def _propagate(
        self, increments: Array, record_every: int, orthonormalize_every: int, initial: Array
    ) -> Array:
        runs, steps = increments.shape[:2]
        sources, rest = [self.sources], [str(record_every)]
        if orthonormalize_every:
            sources.append(self._sources(self._need_orthonormalization()))
            rest += [str(orthonormalize_every), f"@{sources[-1].function.name}"]
        (history,) = octave_process.call(
            sources,
            f"{self.sources.function.name}_propagate",
            [np.moveaxis(initial, 0, -1), increments.transpose(2, 3, 1, 0)],
            [(*self.state_shape, 1 + steps // record_every, runs)],
            *rest,
        )
        return np.ascontiguousarray(np.moveaxis(history, (-1, -2), (0, 1)))
