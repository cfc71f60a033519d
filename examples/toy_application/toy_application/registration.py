"""What the package brings: strapgen reads this when a name is not one of its own."""

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "the part of a rotation that is about an axis",
    commands={"study twist": Command("toy_application.twist:study_twist")},
    kernels=("toy_application.names:KERNELS",),
    methods=("toy_application.names:METHODS",),
    tableaux=("toy_application:tableaux",),
    motions=("toy_application.names:MOTIONS",),
    targets=("toy_application.target:TARGETS",),
    backends=("toy_application.names:BACKENDS",),
    results={"twist": "toy_application.twist:TwistResult"},
)
