"""A kernel: the rotation about z that is nearest to an attitude, not yet of length 1."""

from strapgen import EULER, Kernel, KernelBuilder, Signal


def twist_z() -> Kernel:
    """Return the kernel: what Euler parameters have about z, and their scalar part."""
    build = KernelBuilder()
    *_, z, scalar = build.input(EULER.state)
    twist = Signal.labelled("twist", "t", "zs", meaning="z and scalar part of the rotation about z", bound=1)
    build.output(twist, [z, scalar])
    return build.kernel("twist-z", "rotation about z in Euler parameters", "swing-twist decomposition")
