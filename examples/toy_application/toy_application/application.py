"""What the application brings: strapgen reads this when a name is not one of its own."""

from strapgen.applications import Application, Command

APPLICATION = Application(
    "the part of a rotation that is about an axis",
    commands={"study twist": Command("toy_application.twist:study_twist")},
    kernels=("toy_application.names:KERNELS",),
)
