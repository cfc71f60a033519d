"""The change of every stage is its derivative along the change of the inputs."""

from __future__ import annotations

import sympy as sp

from strapgen.ir.signals import Signal
from strapgen.kernel.derivatives import add_tangents
from strapgen.kernel.kernel import KernelBuilder, evaluate_stages


def test_changes_are_derivatives_along_the_change_of_the_inputs():
    build = KernelBuilder()
    x, y, dx, dy, t = (build.scalar(Signal.scalar(name)) for name in ("x", "y", "dx", "dy", "t"))
    product = build.value("product", x * y)
    square = build.value("square", product**2 + x + 2)
    root = build.value("root", 1 / sp.sqrt(square))
    kept = build.value("kept", 3 * t)
    before = list(build.stages)
    changes = add_tangents(build, before, {x: dx, y: dy}, "change", "m/s")
    assert kept not in changes
    along = {s: sp.Symbol(s.name, real=True) for s in (x, y, dx, dy, t)}
    computed = evaluate_stages(build.stages, {s.name: s for s in along})
    for name in (product, square, root):
        value = computed[name.name]
        expected = sp.diff(value, x) * dx + sp.diff(value, y) * dy
        assert sp.simplify(computed[changes[name].name] - expected) == 0
    assert not any(stage.expressions[0].has(sp.sqrt(square)) for stage in build.stages[len(before) :])


def test_changes_that_are_symbols_have_no_stage_of_their_own():
    build = KernelBuilder()
    x, dx = build.scalar(Signal.scalar("x")), build.scalar(Signal.scalar("dx"))
    same = build.value("same", x)
    changes = add_tangents(build, list(build.stages), {x: dx}, "change", "m/s")
    assert changes[same] == dx
    assert len(build.stages) == 1


def test_units_of_changes():
    build = KernelBuilder()
    x = build.input(Signal.vector("x", "x", unit="rad"))
    dx = build.input(Signal.vector("dx", "dx", unit="m/s"))
    build.stage(Signal.vector("angle", "angle", unit="rad"), 2 * x)
    build.stage(Signal.scalar("square"), [x[0] ** 2])
    add_tangents(build, list(build.stages), dict(zip(x, dx, strict=True)), "v", "m/s")
    assert [stage.signal.unit for stage in build.stages] == ["rad", "1", "m/s", "1"]
    assert build.stages[2].signal.elements == ("angle_v_x", "angle_v_y", "angle_v_z")
