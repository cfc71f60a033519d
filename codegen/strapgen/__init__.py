"""strapgen: attitude algorithms derived symbolically, generated as numpy and C code, and compared with truth.

The stages in order: `derive` a kernel, `lower` it to straight-line code, `generate` source text, `build` a back
end, `simulate` it against a closed-form motion. `backend` does the first four at once, from the cache.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from strapgen.backends import backend as backend
    from strapgen.backends import evaluator as evaluator
    from strapgen.fixedpoint import Settings as Settings
    from strapgen.motions import motion as motion
    from strapgen.pipeline import build as build
    from strapgen.pipeline import derive as derive
    from strapgen.pipeline import generate as generate
    from strapgen.pipeline import lower as lower
    from strapgen.pipeline import quantize as quantize
    from strapgen.simulation import simulate as simulate

_EXPORTS = {
    "derive": "pipeline",
    "lower": "pipeline",
    "quantize": "pipeline",
    "generate": "pipeline",
    "build": "pipeline",
    "simulate": "simulation",
    "motion": "motions",
    "Settings": "fixedpoint",
    "backend": "backends",
    "evaluator": "backends",
}

__all__ = ["__version__", *_EXPORTS]


def __getattr__(name: str) -> Any:
    # Loaded when first used: the command line answers before SymPy or numpy are imported.
    if name in _EXPORTS:
        return getattr(import_module(f"{__name__}.{_EXPORTS[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
