"""Certified bounds of fixed point beside measured errors: of one call, of a run, and of orthonormalizations."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

import strapgen


def call(algorithm: str, word: int, rounding: str) -> tuple[float, float]:
    """Return bound and worst error of 20,000 calls, half of them at the ends of the ranges, in the last place."""
    settings = strapgen.Settings.of(
        word=word, max_rate_deg_s=400, step="0.01", increments=2, rounding=rounding
    )
    fixed = strapgen.quantize(strapgen.lower(strapgen.derive(algorithm, "rk4", 2)), settings)
    model = strapgen.build(strapgen.generate(fixed, "fixed-model")).evaluator
    rng, inputs = np.random.default_rng(1), []
    numbers: dict[str, np.ndarray] = {}
    for argument in fixed.interface.inputs:
        ends = rng.choice([argument.low, argument.high], (10_000, argument.signal.size))
        others = rng.integers(argument.low, argument.high, (10_000, argument.signal.size), endpoint=True)
        inputs.append(np.concatenate([ends, others]))
        numbers |= zip(argument.signal.elements, inputs[-1].T * float(argument.format.unit), strict=True)
    ((computed,), _), (result,) = model.run(inputs, model.fresh(20_000)), fixed.interface.outputs
    (exact,) = fixed.program.run(numbers, float).values()
    apart = np.abs(computed.T - np.array(exact) / float(result.format.unit))
    return float(max(result.errors) / result.format.unit), float(apart.max())


def coning_run(name: str, carry: str) -> tuple[float | None, float, float | None]:
    """Return bound and measured distance of the states of table 5 of the thesis, and the bound of the angle in rad."""
    motion = strapgen.motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)
    increments = motion.increments(Fraction(1, 8), 1440, 2)
    settings = strapgen.Settings(carry=carry).fitted(np.abs(increments).max())
    fixed_point = strapgen.backend("euler", "rk4", 2, name, settings=settings)
    rounded = fixed_point.representable(increments)  # to the format of the increments
    double = strapgen.backend("euler", "rk4", 2, "numpy")
    apart = np.linalg.norm(fixed_point.propagate(rounded) - double.propagate(rounded), axis=-1).max()
    angle = fixed_point.angle_bound(1440, shortest=0.99)  # the length of these states is near 1
    return fixed_point.rounding_bound(1440), float(apart), angle


def orthonormalizations() -> dict[str, tuple[float, float]]:
    """Return bound and largest error for 20,000 rotations whose elements are off by up to 0.01, by kernel."""
    rng = np.random.default_rng(1)
    e = rng.normal(size=(20_000, 4))
    matrices = strapgen.evaluator("dcm-from-euler")(e / np.linalg.norm(e, axis=-1, keepdims=True))
    matrices += rng.uniform(-0.01, 0.01, matrices.shape)
    found = {}
    for scheme in ("", "-first-order", "-second-order", "-optimal"):
        kernel = f"dcm-orthonormalize{scheme}"
        in_c, double = strapgen.evaluator(kernel, "c-fixed32"), strapgen.evaluator(kernel)
        (argument,), (result,) = in_c.interface.inputs, in_c.interface.outputs
        rounded = in_c.numbers(argument, in_c.integers(argument, matrices))
        found[kernel] = float(max(result.errors)), float(np.abs(in_c(rounded) - double(rounded)).max())
    return found


def main() -> None:
    """Print three tables."""
    print("one call, last place            nearest       truncation")
    for algorithm in ("euler", "dcm"):
        for word in (16, 32):
            pairs = ["{:.2f} {:.2f}".format(*call(algorithm, word, way)) for way in ("nearest", "truncation")]
            print(f"{algorithm:6} {word} bits certified, worst {'     '.join(pairs)}")
    print("1440 steps of coning  certified  measured  certified angle, rad")
    for name in ("c-fixed16", "c-fixed32"):
        for carry in ("none", "state", "full"):
            bound, apart, angle = coning_run(name, carry)
            print(f"{name} carry {carry:5}   {bound:.1e}   {apart:.1e}   {angle:.1e}")
    print("32 bits                         certified  worst")
    for kernel, (bound, worst) in orthonormalizations().items():
        print(f"{kernel:31} {bound:.1e}    {worst:.0e}")


if __name__ == "__main__":
    main()
