"""Seeks a run whose rounding turns the attitude as far as it can, beside the bound that the generated header states.

At each step, out of 64 random increments, those are taken whose rounding adds most to the error so far. A million steps
without error feedback take about two minutes:

    python adversarial_run.py euler --steps 1000000
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np

import strapgen

#: What restores a state.
NORMALIZATIONS = {
    "euler": "euler-normalize",
    "cayley-klein": "cayley-klein-normalize",
    "dcm": "dcm-orthonormalize-first-order",
}


def _quaternion_products() -> np.ndarray:
    """Return the coefficients of a product, (16, 4): of first times second element of the factors, by rows."""
    table = np.zeros((4, 4, 4))
    signed = [
        [(3, -1), (2, 1), (1, -1), (0, 1)],
        [(2, -1), (3, -1), (0, 1), (1, 1)],
        [(1, 1), (0, -1), (3, -1), (2, 1)],
    ]
    for a, row in enumerate([*signed, [(0, 1), (1, 1), (2, 1), (3, 1)]]):
        for b, (c, sign) in enumerate(row):
            table[a, b, c] = sign
    return table.reshape(16, 4)


_PRODUCTS = _quaternion_products()
#: Twice the vector of the product with the conjugate of the second.
_TURNS = 2 * (_PRODUCTS.reshape(4, 4, 4) * np.array([-1, -1, -1, 1])[:, None])[..., :3].reshape(16, 3)


@dataclass(frozen=True)
class Result:
    """The error of a run against its bound, both in rad.

    Parameters
    ----------
    steps : array of int
        Numbers of steps along the run.
    errors : array
        Angle between the computed attitude and the exact one after as many.
    bounds : array
    lengths : tuple of float
        Least and largest length of the state, or of a row of the matrix.
    final : array
        Computed state at the end.
    increments : array, (N, K, 3)
    """

    steps: np.ndarray
    errors: np.ndarray
    bounds: np.ndarray
    lengths: tuple[float, float]
    final: np.ndarray
    increments: np.ndarray


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return products of quaternions, scalar last."""
    return (a[..., :, None] * b[..., None, :]).reshape(*b.shape[:-1], 16) @ _PRODUCTS


def turn(states: np.ndarray, added: np.ndarray) -> np.ndarray:
    """Return the rotation vectors by which small additions turn states, (..., 3), in the reference frame."""
    if states.shape[-1] == 4:
        pairs = (added[..., :, None] * states[..., None, :]).reshape(*states.shape[:-1], 16)
        return (pairs @ _TURNS) / (states * states).sum(axis=-1, keepdims=True)
    left = added.reshape(-1, 3, 3) @ np.linalg.inv(states.reshape(-1, 3, 3))
    skew = (left - left.swapaxes(-1, -2)) / 2
    return np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=-1)


class Adversary:
    """A run in fixed point beside exact steps in double, whose rounding is a millionth of that of 32 bits.

    Parameters
    ----------
    algorithm : str
    settings : strapgen.Settings
    name : str
        Name of the back end.
    greedy : bool
        Whether the increments are chosen; otherwise the first of every 64 are taken, as in a typical run.
    """

    def __init__(
        self, algorithm: str, settings: strapgen.Settings, name: str, greedy: bool = True, seed: int = 1
    ) -> None:
        self.backend = strapgen.backend(algorithm, "rk4", 2, name, settings=settings)
        self.exact = strapgen.evaluator(strapgen.choose(algorithm, "rk4", 2), "c")
        self.interface, self.greedy = self.backend.interface, greedy
        self.rng, self.sum = np.random.default_rng(seed), np.zeros(3)
        self.state = self.backend.evaluator.integers(
            self.interface.inputs[0], self.backend.identity.reshape(1, -1)
        )
        self.feedback = self.backend.evaluator.fresh(1)
        feedbacks = self.interface.residuals
        self.middle = 2.0 ** (
            settings.word - 1
        )  # whatever the rounding: a constant cancels from step to step
        self.units = np.array([2.0**-word.fraction for word in feedbacks])
        self.normalization = self.backend.companion(NORMALIZATIONS[algorithm])
        self.exact_normalization = strapgen.evaluator(NORMALIZATIONS[algorithm])

    def numbers(self, integers: np.ndarray) -> np.ndarray:
        """Return states as numbers, (count, elements)."""
        return self.backend.evaluator.numbers(self.interface.inputs[0], integers)

    def step(self, candidates: int) -> np.ndarray:
        """Make one step, and return its increments."""
        limit = self.interface.inputs[1].high
        integers = self.rng.integers(-limit, limit, (candidates, 6), endpoint=True)
        state = np.repeat(self.state, candidates, axis=0)
        feedback = np.repeat(self.feedback, candidates, axis=0)
        (after,), feedback = self.backend.evaluator.run([state, integers], feedback)
        numbers, before = self.numbers(after), self.numbers(state)
        increments = self.backend.evaluator.numbers(self.interface.inputs[1], integers).reshape(-1, 2, 3)
        ((exact,), _) = self.exact.run([before, increments], np.empty((candidates, 0)))
        sums = self.sum + turn(numbers, numbers - exact)
        best = 0
        if self.greedy:
            scores = sums + self.turn_of_feedback(before, numbers, feedback)
            best = int(np.argmax(np.sum(scores**2, axis=-1)))
        self.sum, self.state, self.feedback = sums[best], after[best : best + 1], feedback[best : best + 1]
        return increments[best]

    def turn_of_feedback(self, before: np.ndarray, after: np.ndarray, feedback: np.ndarray) -> np.ndarray:
        """Return by how much what will be fed back will turn the states."""
        if not feedback.size:
            return np.zeros(3)
        left = (feedback.astype(float) - self.middle) * self.units
        size = after.shape[-1]
        added = left[:, :size][:, self.order]
        transition = left[:, size:]
        if transition.size and size == 4:
            names = [word.name[-1] for word in self.interface.residuals[size:]]
            added = added + product(before, transition[:, [names.index(axis) for axis in "xyzs"]])
        elif transition.size:
            matrices = (array.reshape(-1, 3, 3) for array in (before, transition))
            added = added + np.matmul(*matrices).reshape(-1, size)
        return turn(after, added)

    @property
    def order(self) -> list[int]:
        """Places of the words that are fed back into the state's elements, in order."""
        elements = self.interface.outputs[0].signal.elements
        names = [word.name.removeprefix("residual_") for word in self.interface.residuals]
        return [names.index(element) for element in elements]

    def normalize(self) -> None:
        """Normalize the state, in fixed point and exactly."""
        before = self.numbers(self.state)
        count = len(self.normalization.interface.residuals)
        (self.state,), first = self.normalization.run([self.state], self.feedback[:, :count])
        self.feedback = np.concatenate([first, self.feedback[:, count:]], axis=1)
        exact = self.exact_normalization(before.reshape(self.backend.state_shape)).reshape(1, -1)
        after = self.numbers(self.state)
        self.sum = self.sum + turn(after, after - exact)[0]

    def run(self, steps: int, normalize_every: int = 0, candidates: int = 64, records: int = 100) -> Result:
        """Run a number of steps.

        Parameters
        ----------
        steps : int
        normalize_every : int, optional
            Steps from one normalization to the next; 0 for none.
        candidates : int, optional
            Number of increments to choose from.
        records : int, optional
            Number of places along the run where errors are recorded.
        """
        every = max(1, steps // records)
        counts, errors, bounds, lengths, rows = [], [], [], [], []
        adds_up, (result,) = self.interface.angle_accumulation, self.normalization.interface.outputs
        for number in range(1, steps + 1):
            rows.append(self.step(candidates))
            normalizations = number // normalize_every if normalize_every else 0
            if normalize_every and number % normalize_every == 0:
                self.normalize()
            if number % every == 0:
                counts.append(number)
                errors.append(float(np.linalg.norm(self.sum)))
                bounds.append(adds_up.bound(number, normalizations, max(result.errors)))
                state = self.numbers(self.state).reshape(self.backend.state_shape)
                lengths.append(np.linalg.norm(state, axis=-1))
        final = self.numbers(self.state).reshape(self.backend.state_shape)
        ends = float(np.min(lengths)), float(np.max(lengths))
        return Result(*map(np.array, (counts, errors, bounds)), ends, final, np.array(rows))


def main() -> None:
    """Print the error of an adversarial run beside the bound."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("algorithm", choices=["euler", "cayley-klein", "dcm"])
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--carry", default="none", choices=["none", "state", "full"])
    parser.add_argument("--word", type=int, default=32, choices=[16, 32])
    parser.add_argument("--candidates", type=int, default=64)
    parser.add_argument("--normalize-every", type=int, default=0)
    parser.add_argument("--max-rate-deg-s", default="400")
    parser.add_argument("--step", default="0.01")
    parser.add_argument("--typical", action="store_true", help="take the increments as they come")
    options = parser.parse_args()
    settings = strapgen.Settings.of(
        word=options.word,
        max_rate_deg_s=options.max_rate_deg_s,
        step=options.step,
        increments=2,
        carry=options.carry,
    )
    name = {32: "c-q31", 16: "c-q15"}[options.word]
    adversary = Adversary(options.algorithm, settings, name, not options.typical)
    candidates = 1 if options.typical else options.candidates
    result = adversary.run(options.steps, options.normalize_every, candidates)
    print("     steps  error, rad  bound, rad  ratio")
    for place in sorted({round(len(result.steps) * share) - 1 for share in (0.01, 0.1, 0.5, 1)} - {-1}):
        error, bound = result.errors[place], result.bounds[place]
        print(f"{result.steps[place]:10}  {error:10.4g}  {bound:10.4g}  {bound / error:5.2f}")
    low, high = result.lengths
    print(
        f"length {low:.6f} to {high:.6f}; proved: {adversary.interface.angle_accumulation.proved_steps} steps"
    )


if __name__ == "__main__":
    main()
