"""The names of the kernels of loops: those of an attitude and heading reference, and a gyro's, as plain data."""

from __future__ import annotations

from strapgen.catalogue.recipe import Recipe

#: Kernels of the loops of an attitude and heading reference, and of a gyro's torquer; they take no method.
LOOPS = {
    name: Recipe(title, f"loops.{module}", function, (), False)
    for name, title, module, function in (
        ("level-loop", "levelling loop of third order", "level", "level_loop"),
        ("erection", "erection loop of the attitude mode", "level", "erection"),
        ("heading-loop", "heading loop of second order", "heading", "heading_loop"),
        ("heading-from-dcm", "heading of an attitude", "heading", "heading_of_attitude"),
        ("vertical-loop", "vertical loop of third order", "vertical", "vertical_loop"),
        ("pulse-torque", "control law of a pulse torquing loop", "torquing", "pulse_torque"),
        ("body-feedback", "feedback of the loops in body axes", "feedback", "body_feedback"),
    )
}
