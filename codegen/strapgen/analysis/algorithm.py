"""`algorithm` returns one object for an attitude algorithm, whose methods are the functions of the package."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from strapgen import pipeline
from strapgen.catalogue import Choice, choose_step
from strapgen.catalogue.choice import AnyMethod
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.notebook_display import notebook_latex, short_repr
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.lab.comparison import Array, Comparisons, compare
from strapgen.lab.motions import motions
from strapgen.lab.motions.motions import Motion
from strapgen.lab.runs import Run, simulate
from strapgen.run.backends import DEFAULT_BACKENDS, Backend
from strapgen.run.backends import backend as attitude_backend

if TYPE_CHECKING:
    from strapgen.analysis.error_analysis import ErrorAnalysis
    from strapgen.kernel.kernel import Kernel


@dataclass(frozen=True)
class AttitudeAlgorithm:
    """An attitude algorithm; what you can do with it are methods, each of which calls a function of the package.

    `algorithm` returns one. It is a value: it holds the choice alone, and no method changes it.

    Parameters
    ----------
    choice : Choice
        An attitude step, as `strapgen.choose_step` returns one.

    Examples
    --------
    >>> alg = algorithm("euler", "rk4", increments=2)
    >>> alg.derive().order.step, alg.program().operations["multiply"]
    (4, 38)
    """

    choice: Choice

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        choice = self.choice
        samples = "rates" if choice.increments is None else f"{choice.increments} increments"
        method = "" if choice.method is None else f", method {choice.method_name}"
        return f"{choice.name}{method}, {samples} a step: {choice.kernel}"

    @property
    def name(self) -> str:
        """Name of the kernel."""
        return self.choice.kernel

    def derive(self) -> Kernel:
        """Return the exact kernel, see `strapgen.derive`."""
        return pipeline.derive(self.choice)

    def program(self) -> Program:
        """Return the straight-line code with its counts, see `strapgen.lower`; the cache holds it."""
        return pipeline.program(self.choice)

    def series(self, motion: str = "general", terms: int = 2) -> ErrorAnalysis:
        """Return the truncation error of a step, and of a run, as exact power series of the step length in s.

        Parameters
        ----------
        motion : str, optional
            "general" for any smooth rate, or a motion of the catalogue in the symbols of its parameters.
        terms : int, optional
            Number of terms, 1 to 6, of drift and skew in rad and of scale.

        Returns
        -------
        ErrorAnalysis

        Raises
        ------
        InputError
            If a name or number is not allowed, or the step has no series.

        Examples
        --------
        >>> algorithm("euler", "rk4", 2).series("constant", terms=1).step.order
        4
        """
        from strapgen.analysis.error_analysis import analyse  # loads SymPy

        return analyse(self.choice, motion, terms)

    def backend(self, name: str = "numpy", settings: Settings | None = None) -> Backend:
        """Return the algorithm on a back end, a key of `strapgen.BACKENDS`; see `strapgen.backend`."""
        return attitude_backend(self.choice, backend=name, settings=settings)

    def simulate(
        self,
        motion: str | Motion = "coning",
        step: float | str | Fraction = "0.01",
        duration: float | str | Fraction = 10,
        *,
        backend: str = "numpy",
        settings: Settings | None = None,
        orthonormalize: float | str | Fraction | None = None,
        record: float | str | Fraction | None = None,
        **parameters: float,
    ) -> Run:
        """Run the algorithm on a motion with a known attitude.

        Parameters
        ----------
        motion : str or Motion, optional
            A motion, or the name of one whose parameters follow as keywords, such as ``a_deg_s=10``; by default coning
            with all three parameters at 10 deg/s.
        step, duration : number, optional
            In s; the step divides the duration. Decimals are exact.
        backend : str, optional
            A key of `strapgen.BACKENDS`.
        settings : Settings, optional
            Settings of fixed point.
        orthonormalize, record : number, optional
            Intervals of orthonormalization and of records in s; by default there is none, and every step is recorded.
        **parameters : float
            Parameters of a motion that is named.

        Returns
        -------
        Run

        Raises
        ------
        InputError
            If a name, a time or a parameter is not allowed.

        Examples
        --------
        >>> run = algorithm("euler", "rk4", 2).simulate("constant", "0.1", 1, z_deg_s=90)
        >>> run.drift.shape
        (11, 3)
        """
        if isinstance(motion, Motion) and parameters:
            raise InputError(f"{', '.join(parameters)} belong to the name of a motion, not to a Motion")
        if motion == "coning" and not parameters:
            parameters = dict.fromkeys(("a_deg_s", "b_deg_s", "g_deg_s"), 10)
        profile = motion if isinstance(motion, Motion) else motions.motion(motion, **parameters)
        return simulate(self.backend(backend, settings), profile, step, duration, orthonormalize, record)

    def c(self, target: str = "c", settings: Settings | None = None) -> Sources:
        """Return the generated C, text by file name.

        Parameters
        ----------
        target : str, optional
            "c", "c-float", or "c-fixed" with its settings; another key of `strapgen.TARGETS` too.
        settings : Settings, optional
            Word, largest increment in rad and rounding of fixed point.

        Returns
        -------
        Sources

        Raises
        ------
        InputError
            If the target is unknown, or the settings do not go with it.

        Examples
        --------
        >>> list(algorithm("euler", "rk4", 2).c().step_files)
        ['euler_rk4_2.h', 'euler_rk4_2.c']
        """
        return pipeline.compile(self.choice, target, settings)

    def compare(
        self,
        increments: Any,
        backends: Sequence[str | Backend] = DEFAULT_BACKENDS,
        *,
        reference: str = "exact",
        truth: Array | None = None,
        settings: Settings | None = None,
    ) -> Comparisons:
        """Run the algorithm on several back ends over the same increments, (N, K, 3) in rad; see `strapgen.compare`.

        Examples
        --------
        >>> import numpy as np
        >>> alg = algorithm("euler", "rk4", 2)
        >>> [row.max_abs_rad < 1e-15 for row in alg.compare(np.full((5, 2, 3), 0.01), ["numpy"])]
        [True]
        """
        return compare(
            self.choice,
            backends=backends,
            increments=increments,
            reference=reference,
            truth=truth,
            settings=settings,
        )


def algorithm(
    name: str,
    method: AnyMethod | None = None,
    increments: int | None = None,
    *,
    rates: bool = False,
    previous: int | None = None,
    ahead: int | None = None,
) -> AttitudeAlgorithm:
    """Return an attitude algorithm as one object, from which everything else follows.

    Parameters
    ----------
    name : str
        "dcm", "euler" or "cayley-klein"; a Python file, or the entry point of an algorithm of your own.
    method : str, Tableau, Window or ShapedConing, optional
        By default "rk4".
    increments : int, optional
        Angle increments a step, 1 to 8; by default 2.
    rates : bool, optional
        Whether the step takes the body rate at every node of its method, times the step length, in place of increments.
    previous, ahead : int, optional
        Increments from before the step and from after it that it takes too, together at most 32; by default 0.

    Returns
    -------
    AttitudeAlgorithm

    Raises
    ------
    InputError
        If a name or number is not allowed.

    Examples
    --------
    >>> algorithm("euler", "rk4", increments=2)
    <AttitudeAlgorithm euler, method rk4, 2 increments a step: euler-rk4-2>
    """
    return AttitudeAlgorithm(choose_step(name, method, increments, rates, previous, ahead))
