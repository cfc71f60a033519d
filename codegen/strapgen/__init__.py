"""strapgen: attitude algorithms derived symbolically, generated as numpy and C code, and compared with truth.

The stages in order: `derive` a kernel, `lower` it to straight-line code, `generate` source text, `build` a back
end, `simulate` it against a closed-form motion. `backend` does the first four at once, from the cache.
"""

import importlib as _importlib
import typing as _typing

from strapgen.support.version import VERSION as __version__  # noqa: N811

# For type checkers; a test holds it against the table below, from which Python loads a name when it is first used.
if _typing.TYPE_CHECKING:
    from strapgen import vibration as vibration
    from strapgen.analysis import unknowns as unknowns
    from strapgen.backends import Backend as Backend
    from strapgen.backends import Evaluator as Evaluator
    from strapgen.backends import backend as backend
    from strapgen.backends import build as build
    from strapgen.backends import evaluator as evaluator
    from strapgen.backends import exact as exact
    from strapgen.backends import increments as _increments
    from strapgen.backends.commit_late import CommitLate as CommitLate
    from strapgen.backends.late.recording import recording_attitudes as recording_attitudes
    from strapgen.backends.late.unit import GapError as GapError
    from strapgen.backends.late.unit import SampleKind as SampleKind
    from strapgen.backends.registry import BACKENDS as BACKENDS
    from strapgen.backends.systems import SystemRunner as SystemRunner
    from strapgen.backends.systems import system_runner as system_runner
    from strapgen.backends.two_speed import TwoSpeed as TwoSpeed
    from strapgen.catalogue import Choice as Choice
    from strapgen.catalogue import choose as choose
    from strapgen.catalogue import choose_step as choose_step
    from strapgen.catalogue.kinematics import CAYLEY_KLEIN as CAYLEY_KLEIN
    from strapgen.catalogue.kinematics import DCM as DCM
    from strapgen.catalogue.kinematics import EULER as EULER
    from strapgen.catalogue.kinematics import Kinematics as Kinematics
    from strapgen.catalogue.methods import runge_kutta as runge_kutta
    from strapgen.catalogue.methods import tableaux as tableaux
    from strapgen.catalogue.methods import windows as windows
    from strapgen.catalogue.methods.samples import Samples as Samples
    from strapgen.catalogue.methods.samples import increments_signal as increments_signal
    from strapgen.catalogue.methods.samples import turns_signal as turns_signal
    from strapgen.catalogue.methods.samples import velocities_signal as velocities_signal
    from strapgen.catalogue.methods.tableau import Tableau as Tableau
    from strapgen.catalogue.methods.tableaux import TABLEAUX as TABLEAUX
    from strapgen.catalogue.methods.window import Window as Window
    from strapgen.catalogue.methods.windows import WINDOWS as WINDOWS
    from strapgen.design import family as _family
    from strapgen.experiments import word_length as _word_length
    from strapgen.experiments.algorithm import AttitudeAlgorithm as AttitudeAlgorithm
    from strapgen.experiments.algorithm import algorithm as algorithm
    from strapgen.experiments.comparison import Comparison as Comparison
    from strapgen.experiments.comparison import Comparisons as Comparisons
    from strapgen.experiments.comparison import compare as compare
    from strapgen.experiments.conformance import Finding as Finding
    from strapgen.experiments.conformance import check as check
    from strapgen.experiments.convergence import Convergence as Convergence
    from strapgen.experiments.convergence import converge as converge
    from strapgen.ir.attitude_step import Companions as Companions
    from strapgen.ir.attitude_step import Order as Order
    from strapgen.ir.fixed_settings import Settings as Settings
    from strapgen.ir.float_interface import RoundingBounds as RoundingBounds
    from strapgen.ir.formats import Format as Format
    from strapgen.ir.integer_program import FixedProgram as FixedProgram
    from strapgen.ir.program import Program as Program
    from strapgen.ir.recursion import Recursion as Recursion
    from strapgen.ir.signals import Signal as Signal
    from strapgen.ir.sources import Sources as Sources
    from strapgen.pipeline import derive as derive
    from strapgen.pipeline import generate as generate
    from strapgen.pipeline import lower as lower
    from strapgen.pipeline import quantize as quantize
    from strapgen.reports import formulas as formulas
    from strapgen.rounding.bounds import rounding_bounds as rounding_bounds
    from strapgen.simulation import sensor_errors as _sensor_errors
    from strapgen.simulation.courses import Course as Course
    from strapgen.simulation.courses import course as course
    from strapgen.simulation.motions import Motion as Motion
    from strapgen.simulation.motions import motion as motion
    from strapgen.simulation.recording import History as History
    from strapgen.simulation.recording import InertialRecording as InertialRecording
    from strapgen.simulation.recording import Recording as Recording
    from strapgen.simulation.recording import propagate as propagate
    from strapgen.simulation.recording import read_increments as read_increments
    from strapgen.simulation.recording import read_inertial as read_inertial
    from strapgen.simulation.recording import read_rates as read_rates
    from strapgen.simulation.runs import Run as Run
    from strapgen.simulation.runs import simulate as simulate
    from strapgen.simulation.scipy_rotations import from_rotation as from_rotation
    from strapgen.simulation.scipy_rotations import to_rotation as to_rotation
    from strapgen.simulation.users_motions import read_motion as read_motion
    from strapgen.support.exceptions import CompilerError as CompilerError
    from strapgen.support.exceptions import InputError as InputError
    from strapgen.support.exceptions import InputTypeError as InputTypeError
    from strapgen.support.exceptions import MissingExtraError as MissingExtraError
    from strapgen.support.exceptions import StrapgenError as StrapgenError
    from strapgen.symbolic import algebra as algebra
    from strapgen.symbolic.kernel import Kernel as Kernel
    from strapgen.symbolic.kernel import KernelBuilder as KernelBuilder
    from strapgen.symbolic.kernel import Stage as Stage
    from strapgen.symbolic.kernel import resolution as resolution
    from strapgen.systems.wiring import read_system as read_system
    from strapgen.targets.registry import TARGETS as TARGETS
    from strapgen.targets.registry import Target as Target
    from strapgen.toolchain.compiler import compile_together as compile_together

    gyro = _increments
    sensors = _sensor_errors
    study = _word_length
    window_design = _family

#: Public names by the modules that define them.
_NAMES = {
    "backends": (
        "Backend",
        "Evaluator",
        "backend",
        "build",
        "evaluator",
    ),
    "backends.commit_late": ("CommitLate",),
    "backends.late.recording": ("recording_attitudes",),
    "backends.late.unit": (
        "GapError",
        "SampleKind",
    ),
    "backends.registry": ("BACKENDS",),
    "backends.systems": (
        "SystemRunner",
        "system_runner",
    ),
    "backends.two_speed": ("TwoSpeed",),
    "catalogue": (
        "Choice",
        "choose",
        "choose_step",
    ),
    "catalogue.kinematics": (
        "CAYLEY_KLEIN",
        "DCM",
        "EULER",
        "Kinematics",
    ),
    "catalogue.methods.samples": (
        "Samples",
        "increments_signal",
        "turns_signal",
        "velocities_signal",
    ),
    "catalogue.methods.tableau": ("Tableau",),
    "catalogue.methods.tableaux": ("TABLEAUX",),
    "catalogue.methods.window": ("Window",),
    "catalogue.methods.windows": ("WINDOWS",),
    "experiments.algorithm": (
        "AttitudeAlgorithm",
        "algorithm",
    ),
    "experiments.comparison": (
        "Comparison",
        "Comparisons",
        "compare",
    ),
    "experiments.conformance": (
        "Finding",
        "check",
    ),
    "experiments.convergence": (
        "Convergence",
        "converge",
    ),
    "ir.attitude_step": (
        "Companions",
        "Order",
    ),
    "ir.fixed_settings": ("Settings",),
    "ir.float_interface": ("RoundingBounds",),
    "ir.formats": ("Format",),
    "ir.integer_program": ("FixedProgram",),
    "ir.program": ("Program",),
    "ir.recursion": ("Recursion",),
    "ir.signals": ("Signal",),
    "ir.sources": ("Sources",),
    "pipeline": (
        "derive",
        "generate",
        "lower",
        "quantize",
    ),
    "rounding.bounds": ("rounding_bounds",),
    "simulation.courses": (
        "Course",
        "course",
    ),
    "simulation.motions": (
        "Motion",
        "motion",
    ),
    "simulation.recording": (
        "History",
        "InertialRecording",
        "Recording",
        "propagate",
        "read_increments",
        "read_inertial",
        "read_rates",
    ),
    "simulation.runs": (
        "Run",
        "simulate",
    ),
    "simulation.scipy_rotations": (
        "from_rotation",
        "to_rotation",
    ),
    "simulation.users_motions": ("read_motion",),
    "support.exceptions": (
        "CompilerError",
        "InputError",
        "InputTypeError",
        "MissingExtraError",
        "StrapgenError",
    ),
    "symbolic.kernel": (
        "Kernel",
        "KernelBuilder",
        "Stage",
        "resolution",
    ),
    "systems.wiring": ("read_system",),
    "targets.registry": (
        "TARGETS",
        "Target",
    ),
    "toolchain.compiler": ("compile_together",),
}
#: Modules whose functions belong together, by the names that they have here.
_NAMESPACES = {
    "algebra": "symbolic.algebra",
    "exact": "backends.exact",
    "formulas": "reports.formulas",
    "gyro": "backends.increments",
    "runge_kutta": "catalogue.methods.runge_kutta",
    "sensors": "simulation.sensor_errors",
    "study": "experiments.word_length",
    "tableaux": "catalogue.methods.tableaux",
    "unknowns": "analysis.unknowns",
    "vibration": "vibration",
    "window_design": "design.family",
    "windows": "catalogue.methods.windows",
}
_EXPORTS = {name: module for module, names in _NAMES.items() for name in names}

__all__ = ["__version__", *_EXPORTS, *_NAMESPACES]

if not _typing.TYPE_CHECKING:  # a type checker would take any name for one that is here

    def __getattr__(name: str) -> object:
        # Loaded when first used: the command line answers before SymPy or numpy are imported.
        if name in _EXPORTS:
            return getattr(_importlib.import_module(f"{__name__}.{_EXPORTS[name]}"), name)
        if name in _NAMESPACES:
            return _importlib.import_module(f"{__name__}.{_NAMESPACES[name]}")
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
