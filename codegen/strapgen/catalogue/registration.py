"""Registration of this folder."""

from __future__ import annotations

from strapgen.registration import Registration

REGISTRATION = Registration(
    "the algorithms: steps, methods and kernels",
    kernels=(f"{__package__}.kernels.kernel_names:KERNELS",),
    methods=(f"{__package__}.methods.method_spec:INTEGRATORS",),
    tableaux=(f"{__package__}.methods:butcher_tableaux",),
    windows=(f"{__package__}.methods:window_filters",),
    coning_shapes=(f"{__package__}.methods:coning_shapes",),
    files={
        "tableau": f"{__package__}.methods.tableaux:TABLEAU",
        "window": f"{__package__}.methods.windows:WINDOW",
        "coning": f"{__package__}.methods.shaped_coning:SHAPE",
    },
)
