"""The names of the kernels of stamped samples, as plain data; none is of the standard catalogue."""

from __future__ import annotations

from strapgen.ir.kernel_info import Recipe

#: Pairs of samples around a boundary; without the slope of the rate, which a first round can do without.
WITH_SLOPE, WITHOUT_SLOPE = (1, 2, 5, 7), (3,)
#: Numbers of pairs of the first and of the second round, the default first.
ROUNDS = ((3, 5), (7, 7))


def kernel_name(pairs: int) -> str:
    """Return the name of the kernel of a number of pairs."""
    return f"boundary-correction-{pairs}"


KERNELS = {
    kernel_name(pairs): Recipe(
        f"integral of the rate from a boundary of an even grid to its instant, {pairs} pairs of samples",
        f"{__package__}.boundary_kernels",
        "correction",
        (pairs,),
        standard=False,
    )
    for pairs in sorted(WITH_SLOPE + WITHOUT_SLOPE)
}
