"""Attitude algorithms derived symbolically, generated as numpy, C, C++, Rust and MATLAB, and compared with truth.

Begin with one object: ``alg = strapgen.algorithm("euler", "rk4", increments=2)``.

  formulas   alg.formulas, which prints, with .latex, .program and .operations; alg.series()
  runs       alg.simulate("coning", ...), alg.compare(), alg.converge(), alg.check()
  code       alg.generate("c"), alg.generate("c-fixed", word=32, max_rate_deg_s=400, step="0.01"),
             alg.quantize(...), alg.cost("cortex-m3")

What there is, each a table of names: ALGORITHMS, METHODS, KERNELS, MOTIONS, TARGETS, BACKENDS, TABLEAUX, WINDOWS.
Functions take the object, a name or a Choice alike:

  stages      derive, lower, quantize, generate, build; backend and evaluator do all at once, from the cache
  numbers     Settings, Format, gyro, exact: fixed point, pulses of a gyro, 40 digits
  motions     motion, read_motion, simulate; sensors with errors
  recordings  read, Recording, StampedGrid, propagate; rests, TrueAttitude, time_offset, attitude_error
  judgement   compare, converge, certify, certify_system, check, rounding_bounds; unknowns, vibration, study
  your own    KernelBuilder, Signal, Stage, algebra, tableaux, windows, window_design; Target, Language
  navigation  read_system, system_runner, course, kalman, TwoSpeed, CommitLate, recording_attitudes, Preintegrator
  notebooks   formulas; to_rotation and from_rotation; plot, to_pandas and to_xarray of what runs return

SI units and rad, unless a name says otherwise; matrices lead from body to reference axes. Wrong input raises a
StrapgenError with one line. ``help(strapgen.NAME)`` has shapes, units, errors and an example of each.
"""

import importlib as _importlib
import typing as _typing

from strapgen.ir.version import VERSION as __version__  # noqa: N811

# For type checkers; a test holds it against the table below, from which Python loads a name when it is first used.
if _typing.TYPE_CHECKING:
    from strapgen.analysis import vibration as vibration
    from strapgen.analysis.unknowns import unknowns as unknowns
    from strapgen.attitude_algorithm import AttitudeAlgorithm as AttitudeAlgorithm
    from strapgen.attitude_algorithm import algorithm as algorithm
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
    from strapgen.catalogue.methods.method import Samples as Samples
    from strapgen.catalogue.methods.method import increments_signal as increments_signal
    from strapgen.catalogue.methods.method import node_rotations_signal as node_rotations_signal
    from strapgen.catalogue.methods.method import velocities_signal as velocities_signal
    from strapgen.catalogue.methods.tableaux import TABLEAUX as TABLEAUX
    from strapgen.catalogue.methods.tableaux import Tableau as Tableau
    from strapgen.catalogue.methods.window import Window as Window
    from strapgen.catalogue.methods.windows import WINDOWS as WINDOWS
    from strapgen.catalogue.names import ALGORITHMS as ALGORITHMS
    from strapgen.catalogue.names import KERNELS as KERNELS
    from strapgen.catalogue.names import METHODS as METHODS
    from strapgen.design import family as _family
    from strapgen.design.commit_late.commit_late import CommitLate as CommitLate
    from strapgen.design.commit_late.late_recording import recording_attitudes as recording_attitudes
    from strapgen.design.commit_late.late_unit import GapError as GapError
    from strapgen.design.commit_late.late_unit import SampleKind as SampleKind
    from strapgen.firmware.check_code.conformance import Finding as Finding
    from strapgen.firmware.check_code.conformance import check as check
    from strapgen.fixedpoint.floating.bounds import rounding_bounds as rounding_bounds
    from strapgen.ir.exceptions import CompilerError as CompilerError
    from strapgen.ir.exceptions import InputError as InputError
    from strapgen.ir.exceptions import InputTypeError as InputTypeError
    from strapgen.ir.exceptions import MissingExtraError as MissingExtraError
    from strapgen.ir.exceptions import StrapgenError as StrapgenError
    from strapgen.ir.fixed_settings import Settings as Settings
    from strapgen.ir.formats import Format as Format
    from strapgen.ir.integer_program import FixedProgram as FixedProgram
    from strapgen.ir.interfaces import RoundingBounds as RoundingBounds
    from strapgen.ir.kernel_info import AttitudeStep as AttitudeStep
    from strapgen.ir.kernel_info import KernelInfo as KernelInfo
    from strapgen.ir.kernel_info import Order as Order
    from strapgen.ir.kernel_info import Recursion as Recursion
    from strapgen.ir.program import Program as Program
    from strapgen.ir.signals import Signal as Signal
    from strapgen.ir.sources import Sources as Sources
    from strapgen.kernel import algebra as algebra
    from strapgen.kernel.kernel import EPSILON as EPSILON
    from strapgen.kernel.kernel import Kernel as Kernel
    from strapgen.kernel.kernel import KernelBuilder as KernelBuilder
    from strapgen.kernel.kernel import Stage as Stage
    from strapgen.lab import sensor_errors as _sensor_errors
    from strapgen.lab import word_length as _word_length
    from strapgen.lab.certificate.certificate import certify as certify
    from strapgen.lab.comparison import Comparison as Comparison
    from strapgen.lab.comparison import Comparisons as Comparisons
    from strapgen.lab.comparison import compare as compare
    from strapgen.lab.convergence import Convergence as Convergence
    from strapgen.lab.convergence import converge as converge
    from strapgen.lab.motions.motion_names import MOTIONS as MOTIONS
    from strapgen.lab.motions.motions import Motion as Motion
    from strapgen.lab.motions.motions import motion as motion
    from strapgen.lab.motions.users_motions import read_motion as read_motion
    from strapgen.lab.recordings.recording import History as History
    from strapgen.lab.recordings.recording import InertialRecording as InertialRecording
    from strapgen.lab.recordings.recording import Recording as Recording
    from strapgen.lab.recordings.recording import propagate as propagate
    from strapgen.lab.recordings.recording import read as read
    from strapgen.lab.recordings.recording import read_increments as read_increments
    from strapgen.lab.recordings.recording import read_inertial as read_inertial
    from strapgen.lab.recordings.recording import read_rates as read_rates
    from strapgen.lab.recordings.rest import rests as rests
    from strapgen.lab.recordings.true_attitude import AttitudeError as AttitudeError
    from strapgen.lab.recordings.true_attitude import TrueAttitude as TrueAttitude
    from strapgen.lab.recordings.true_attitude import attitude_error as attitude_error
    from strapgen.lab.recordings.true_attitude import time_offset as time_offset
    from strapgen.lab.runs import Run as Run
    from strapgen.lab.runs import simulate as simulate
    from strapgen.lab.scipy_rotations import from_rotation as from_rotation
    from strapgen.lab.scipy_rotations import to_rotation as to_rotation
    from strapgen.navigation.courses import Course as Course
    from strapgen.navigation.courses import course as course
    from strapgen.navigation.kalman.kalman_filter import KalmanFilter as KalmanFilter
    from strapgen.navigation.kalman.kalman_filter import kalman as kalman
    from strapgen.navigation.preintegration.preintegrator import Preintegrated as Preintegrated
    from strapgen.navigation.preintegration.preintegrator import PreintegrationError as PreintegrationError
    from strapgen.navigation.preintegration.preintegrator import PreintegrationStatus as PreintegrationStatus
    from strapgen.navigation.preintegration.preintegrator import Preintegrator as Preintegrator
    from strapgen.navigation.systems.system_certificate import certify_system as certify_system
    from strapgen.navigation.systems.system_runner import SystemRunner as SystemRunner
    from strapgen.navigation.systems.system_runner import system_runner as system_runner
    from strapgen.navigation.systems.wiring import read_system as read_system
    from strapgen.navigation.two_speed.two_speed_runner import TwoSpeed as TwoSpeed
    from strapgen.pipeline import derive as derive
    from strapgen.pipeline import generate as generate
    from strapgen.pipeline import lower as lower
    from strapgen.pipeline import quantize as quantize
    from strapgen.results.display import formulas as formulas
    from strapgen.run import exact as exact
    from strapgen.run import increments as _increments
    from strapgen.run.backend_names import BACKENDS as BACKENDS
    from strapgen.run.backends import Backend as Backend
    from strapgen.run.backends import Evaluator as Evaluator
    from strapgen.run.backends import backend as backend
    from strapgen.run.backends import build as build
    from strapgen.run.backends import evaluator as evaluator
    from strapgen.run.compiler import compile_together as compile_together
    from strapgen.stamped.grid_clock import StampError as StampError
    from strapgen.stamped.grid_clock import StampStatus as StampStatus
    from strapgen.stamped.stamped_grid import GridSamples as GridSamples
    from strapgen.stamped.stamped_grid import StampedGrid as StampedGrid
    from strapgen.targets.names import Language as Language
    from strapgen.targets.registry import TARGETS as TARGETS
    from strapgen.targets.registry import Target as Target

    gyro = _increments
    sensors = _sensor_errors
    study = _word_length
    window_design = _family

#: Public names by the modules that define them.
_NAMES = {
    "run.backends": (
        "Backend",
        "Evaluator",
        "backend",
        "build",
        "evaluator",
    ),
    "design.commit_late.commit_late": ("CommitLate",),
    "design.commit_late.late_recording": ("recording_attitudes",),
    "design.commit_late.late_unit": (
        "GapError",
        "SampleKind",
    ),
    "run.backend_names": ("BACKENDS",),
    "stamped.grid_clock": (
        "StampError",
        "StampStatus",
    ),
    "stamped.stamped_grid": (
        "GridSamples",
        "StampedGrid",
    ),
    "navigation.preintegration.preintegrator": (
        "Preintegrated",
        "PreintegrationError",
        "PreintegrationStatus",
        "Preintegrator",
    ),
    "navigation.kalman.kalman_filter": (
        "KalmanFilter",
        "kalman",
    ),
    "navigation.systems.system_certificate": ("certify_system",),
    "navigation.systems.system_runner": (
        "SystemRunner",
        "system_runner",
    ),
    "navigation.two_speed.two_speed_runner": ("TwoSpeed",),
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
    "catalogue.names": (
        "ALGORITHMS",
        "KERNELS",
        "METHODS",
    ),
    "catalogue.methods.method": (
        "Samples",
        "increments_signal",
        "node_rotations_signal",
        "velocities_signal",
    ),
    "catalogue.methods.tableaux": (
        "Tableau",
        "TABLEAUX",
    ),
    "catalogue.methods.window": ("Window",),
    "catalogue.methods.windows": ("WINDOWS",),
    "attitude_algorithm": (
        "AttitudeAlgorithm",
        "algorithm",
    ),
    "lab.certificate.certificate": ("certify",),
    "lab.comparison": (
        "Comparison",
        "Comparisons",
        "compare",
    ),
    "firmware.check_code.conformance": (
        "Finding",
        "check",
    ),
    "lab.convergence": (
        "Convergence",
        "converge",
    ),
    "ir.kernel_info": (
        "AttitudeStep",
        "Order",
        "KernelInfo",
        "Recursion",
    ),
    "ir.fixed_settings": ("Settings",),
    "ir.interfaces": ("RoundingBounds",),
    "ir.formats": ("Format",),
    "ir.integer_program": ("FixedProgram",),
    "ir.program": ("Program",),
    "ir.signals": ("Signal",),
    "ir.sources": ("Sources",),
    "pipeline": (
        "derive",
        "generate",
        "lower",
        "quantize",
    ),
    "fixedpoint.floating.bounds": ("rounding_bounds",),
    "navigation.courses": (
        "Course",
        "course",
    ),
    "lab.motions.motion_names": ("MOTIONS",),
    "lab.motions.motions": (
        "Motion",
        "motion",
    ),
    "lab.recordings.recording": (
        "History",
        "InertialRecording",
        "Recording",
        "propagate",
        "read",
        "read_increments",
        "read_inertial",
        "read_rates",
    ),
    "lab.recordings.rest": ("rests",),
    "lab.recordings.true_attitude": (
        "AttitudeError",
        "TrueAttitude",
        "attitude_error",
        "time_offset",
    ),
    "lab.runs": (
        "Run",
        "simulate",
    ),
    "lab.scipy_rotations": (
        "from_rotation",
        "to_rotation",
    ),
    "lab.motions.users_motions": ("read_motion",),
    "ir.exceptions": (
        "CompilerError",
        "InputError",
        "InputTypeError",
        "MissingExtraError",
        "StrapgenError",
    ),
    "kernel.kernel": (
        "Kernel",
        "KernelBuilder",
        "Stage",
        "EPSILON",
    ),
    "navigation.systems.wiring": ("read_system",),
    "targets.names": ("Language",),
    "targets.registry": (
        "TARGETS",
        "Target",
    ),
    "run.compiler": ("compile_together",),
}
#: Modules whose functions belong together, by the names that they have here.
_NAMESPACES = {
    "algebra": "kernel.algebra",
    "exact": "run.exact",
    "formulas": "results.display.formulas",
    "gyro": "run.increments",
    "runge_kutta": "catalogue.methods.runge_kutta",
    "sensors": "lab.sensor_errors",
    "study": "lab.word_length",
    "tableaux": "catalogue.methods.tableaux",
    "unknowns": "analysis.unknowns.unknowns",
    "vibration": "analysis.vibration",
    "window_design": "design.family",
    "windows": "catalogue.methods.windows",
}
#: Present names by those of the version before, which give a warning.
_RENAMED = {
    "Companions": "AttitudeStep",
    "resolution": "EPSILON",
    "turns_signal": "node_rotations_signal",
}
_EXPORTS = {name: module for module, names in _NAMES.items() for name in names}

__all__ = ["__version__", *_EXPORTS, *_NAMESPACES]

if not _typing.TYPE_CHECKING:  # a type checker would take any name for one that is here

    def __getattr__(name: str) -> object:
        # Loaded when first used: the command line answers before SymPy or numpy are imported.
        if place := _EXPORTS.get(name) or _NAMESPACES.get(name):
            from strapgen.ir.applications import needing

            with needing(f"strapgen.{name}"):
                module = _importlib.import_module(f"{__name__}.{place}")
            return getattr(module, name) if name in _EXPORTS else module
        if name in _RENAMED:
            from strapgen.ir.renamed import warn

            warn(f"strapgen.{name}", f"strapgen.{_RENAMED[name]}")
            return __getattr__(_RENAMED[name])
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
