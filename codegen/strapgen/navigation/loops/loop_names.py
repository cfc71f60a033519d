"""The names of the kernels of loops: those of an attitude and heading reference, and a gyro's, as plain data."""

from __future__ import annotations

from strapgen.ir.kernel_info import Recipe

#: Kernels of the loops of an attitude and heading reference, and of a gyro's torquer; they take no method.
LOOPS = {
    name: Recipe(title, f"strapgen.navigation.{module}", function, (), False)
    for name, title, module, function in (
        ("level-loop", "levelling loop of third order", "loops.level", "level_loop"),
        ("erection", "erection loop of the attitude mode", "loops.level", "erection"),
        ("heading-loop", "heading loop of second order", "loops.heading", "heading_loop"),
        ("heading-from-dcm", "heading of an attitude", "loops.heading", "heading_of_attitude"),
        ("vertical-loop", "vertical loop of third order", "loops.vertical", "vertical_loop"),
        ("pulse-torque", "control law of a pulse torquing loop", "torquing.torquing_law", "pulse_torque"),
        ("body-feedback", "feedback of the loops in body axes", "loops.feedback", "body_feedback"),
    )
}
