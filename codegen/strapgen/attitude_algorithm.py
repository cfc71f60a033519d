"""`algorithm` returns one object for an attitude algorithm, whose methods call the functions of the package.

What an application computes is imported when it is asked for, so that an application can be left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Unpack

from strapgen import pipeline
from strapgen.catalogue import AnyAlgorithm, Choice, choose_step
from strapgen.catalogue.choice import AnyMethod
from strapgen.ir.applications import needing
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings, StatedSettings, with_settings
from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.program import Program
from strapgen.ir.renamed import warn
from strapgen.ir.sources import Sources
from strapgen.targets.naming import Naming

if TYPE_CHECKING:
    from strapgen.analysis.error_analysis import ErrorAnalysis
    from strapgen.firmware.check_code.conformance import FindingsResult
    from strapgen.kernel.kernel import Kernel
    from strapgen.lab.comparison import Array, Comparisons
    from strapgen.lab.convergence import Convergence
    from strapgen.lab.cost import CostResult
    from strapgen.lab.motions.motions import Motion
    from strapgen.lab.runs import Run
    from strapgen.results.display.formulas import Formulas
    from strapgen.run.backends import Backend


@dataclass(frozen=True)
class AttitudeAlgorithm:
    """An attitude algorithm; what you can do with it are its methods.

    `algorithm` returns one. It is a value: it holds the choice alone, and no method changes it. Every function of the
    package that takes the name of an algorithm takes the object too.

    Parameters
    ----------
    choice : Choice
        An attitude step, as `strapgen.choose_step` returns one.

    Examples
    --------
    >>> alg = algorithm("euler", "rk4", increments=2)
    >>> alg.formulas.operations["multiply"], alg.derive().order.step
    (37, 4)
    """

    choice: Choice

    __repr__ = short_repr

    def _in_words(self) -> str:
        choice = self.choice
        samples = "rates" if choice.increments is None else f"{choice.increments} increments"
        method = "" if choice.method is None else f", method {choice.method_name}"
        return f"{choice.name}{method}, {samples} a step: {choice.kernel}"

    def _repr_latex_(self) -> str | None:
        return self.formulas._repr_latex_()

    @property
    def name(self) -> str:
        """Name of the kernel.

        Examples
        --------
        >>> algorithm("dcm", "magnus4", increments=3).name
        'dcm-magnus4-3'
        """
        return self.choice.kernel

    @property
    def formulas(self) -> Formulas:
        r"""The formulas: they print as text and are LaTeX in a notebook; `latex`, `program` and `operations` are parts.

        Examples
        --------
        >>> formulas = algorithm("euler", "rk4", increments=2).formulas
        >>> print(str(formulas).splitlines()[0])
        Euler parameters: step by classical fourth-order Runge-Kutta method from 2 angle increments
        >>> formulas.operations["multiply"], formulas.latex.splitlines()[0]
        (37, '\\begin{align*}')
        """
        from strapgen.results.display.formulas import Formulas  # loads SymPy

        kernel = self.derive()
        return Formulas(kernel, None if kernel.unknowns else self.program())

    def derive(self) -> Kernel:
        """Return the exact kernel, see `strapgen.derive`.

        Examples
        --------
        >>> algorithm("euler", "rk4", increments=2).derive().order.step
        4
        """
        return pipeline.derive(self.choice)

    def program(self) -> Program:
        """Return the straight-line code with its counts, see `strapgen.lower`; the cache holds it.

        Examples
        --------
        >>> algorithm("euler", "rk4", increments=2).program().operations["multiply"]
        37
        """
        return pipeline.program(self.choice)

    @needing("series")
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
        """Return the algorithm on a back end, a key of `strapgen.BACKENDS`; see `strapgen.backend`.

        Examples
        --------
        >>> import numpy as np
        >>> runner = algorithm("euler", "rk4", increments=2).backend("numpy")
        >>> runner.step(runner.identity, np.full((2, 3), [0.0, 0.0, 0.1])).round(6)
        array([0.      , 0.      , 0.099833, 0.995004])
        """
        from strapgen.run.backends import backend

        return backend(self.choice, backend=name, settings=settings)

    @needing("simulate")
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
        **parameters: float | str | Fraction,
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
        **parameters : number
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
        from strapgen.lab.motions import motions
        from strapgen.lab.runs import simulate

        if not isinstance(motion, str) and parameters:
            raise InputError(f"{', '.join(parameters)} belong to the name of a motion, not to a Motion")
        if motion == "coning" and not parameters:
            parameters = dict.fromkeys(("a_deg_s", "b_deg_s", "g_deg_s"), 10)
        profile = motions.motion(motion, **parameters) if isinstance(motion, str) else motion
        return simulate(self.backend(backend, settings), profile, step, duration, orthonormalize, record)

    @needing("compare")
    def compare(
        self,
        samples: Any = None,
        backends: Sequence[str | Backend] | None = None,
        *,
        reference: str = "exact",
        truth: Array | None = None,
        settings: Settings | None = None,
    ) -> Comparisons:
        """Run the algorithm on several back ends over the same samples; see `strapgen.compare`.

        Parameters
        ----------
        samples : array_like, (N, K, 3), optional
            Angle increments of N steps in rad, body axes; by default those of 10 s of coning.
        backends : sequence of str or Backend, optional
            Keys of `strapgen.BACKENDS`; by default those that run here, but the slow ones.
        reference : str, optional
            A key of `strapgen.BACKENDS`.
        truth : array, (1 + N, 3, 3), optional
            True direction cosine matrices, body to reference.
        settings : Settings, optional
            Settings of fixed point; by default for increments of the size of these.

        Returns
        -------
        Comparisons

        Raises
        ------
        InputError
            If a name is not allowed, or the samples do not fit.

        Examples
        --------
        >>> import numpy as np
        >>> alg = algorithm("euler", "rk4", 2)
        >>> [row.max_abs_rad < 1e-15 for row in alg.compare(np.full((5, 2, 3), 0.01), ["numpy"])]
        [True]
        """
        from strapgen.lab.comparison import compare

        return compare(
            self.choice,
            backends=backends,
            samples=samples,
            reference=reference,
            truth=truth,
            settings=settings,
        )

    @with_settings
    def generate(
        self,
        target: str = "c",
        settings: Settings | None = None,
        *,
        name: str | None = None,
        prefix: str | None = None,
        **stated: Unpack[StatedSettings],
    ) -> Sources:
        """Return the generated code, text by file name.

        Parameters
        ----------
        target : str, optional
            A key of `strapgen.TARGETS`.
        settings : Settings, optional
            Settings of fixed point, if they are not stated as keywords.
        name, prefix : str, optional
            Name of the function and of its files, or what it begins with.
        **stated
            Settings of fixed point as for `strapgen.Settings.of`, such as ``word=32, max_rate_deg_s=400, step="0.01"``.

        Returns
        -------
        Sources

        Raises
        ------
        InputError
            If the target is unknown, or a setting or a name does not go with it.

        Examples
        --------
        >>> alg = algorithm("euler", "rk4", 2)
        >>> list(alg.generate("c").step_files)
        ['euler_rk4_2.h', 'euler_rk4_2.c']
        >>> list(alg.generate("c-fixed", word=16, max_rate_deg_s=400, step="0.01", name="attitude").step_files)
        ['attitude.h', 'attitude.c']
        """
        return pipeline.compile(
            self.choice, target, Settings.stated_or(settings, stated), Naming(name, prefix)
        )

    @with_settings
    def quantize(self, settings: Settings | None = None, **stated: Unpack[StatedSettings]) -> FixedProgram:
        """Return the program in integers, with formats, proved ranges and certified error bounds.

        Parameters
        ----------
        settings : Settings, optional
            Settings of fixed point, if they are not stated as keywords; by default 32 bits and 1/8 rad.
        **stated
            Settings of fixed point as for `strapgen.Settings.of`.

        Returns
        -------
        FixedProgram

        Raises
        ------
        InputError
            If a setting is not allowed, an input has no known range, or the word is too short.

        Examples
        --------
        >>> fixed = algorithm("euler", "rk4", 2).quantize(word=16, max_rate_deg_s=400, step="0.01")
        >>> str(fixed.formats["state"]), str(fixed.formats["increments"])
        ('Q1.14', 'Q-3.18')
        """
        return pipeline.fixed_program(self.choice, Settings.stated_or(settings, stated) or Settings())

    @needing("check")
    def check(self) -> FindingsResult:
        """Check the behaviour of the step as its user sees it, see `strapgen.check`.

        Examples
        --------
        >>> algorithm("euler", "rk4", 2).check().holds
        True
        """
        from strapgen.firmware.check_code.conformance import check

        return check(self.choice)

    @needing("converge")
    def converge(
        self,
        motion: Motion | None = None,
        steps: Sequence[float | str | Fraction] | None = None,
        duration: float | str | Fraction = 1,
        backend: str = "exact",
        settings: Settings | None = None,
    ) -> Convergence:
        """Run the algorithm with a ladder of steps in s, and fit its order; see `strapgen.converge`.

        Examples
        --------
        >>> ladder = algorithm("euler", "rk2", 2).converge(steps=["1/8", "1/16", "1/32"])
        >>> ladder.predicted, round(ladder.observed, 1)
        (2, 2.0)
        """
        from strapgen.lab.convergence import LADDER, converge

        return converge(self.choice, motion, LADDER if steps is None else steps, duration, backend, settings)

    @needing("cost")
    @with_settings
    def cost(
        self,
        *cpus: str,
        target: str = "c-fixed",
        settings: Settings | None = None,
        **stated: Unpack[StatedSettings],
    ) -> CostResult:
        """Measure what the C of the step costs on microcontrollers, as ``strapgen cost`` does.

        Parameters
        ----------
        *cpus : str
            Processors, such as "cortex-m3"; by default all whose compiler is installed.
        target : str, optional
            Kind of code: "c-fixed", "c" or "c-float".
        settings : Settings, optional
            Settings of fixed point, if they are not stated as keywords.
        **stated
            Settings of fixed point as for `strapgen.Settings.of`.

        Returns
        -------
        CostResult
            A row for each processor: instructions, bytes of code, constants and stack.

        Raises
        ------
        InputError
            If a name is not allowed, or no cross compiler is installed.

        Examples
        --------
        >>> algorithm("euler", "rk4", 2).cost("cortex-m1")
        Traceback (most recent call last):
            ...
        strapgen.InputError: cpu 'cortex-m1' is not known...
        """
        from strapgen.lab.cost import costs_of

        return costs_of([self.choice], target, Settings.stated_or(settings, stated), cpus)

    if not TYPE_CHECKING:  # no name that completes

        def __getattr__(self, name: str) -> Any:
            if name == "c":
                warn("AttitudeAlgorithm.c", "generate")
                return self.generate
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")


def algorithm(
    name: AnyAlgorithm,
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
    name : str, path, Choice or AttitudeAlgorithm
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
