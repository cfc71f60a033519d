"""`check` runs the conformance tests of an attitude step, one `Finding` for each property."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, ClassVar, overload

import mpmath
import numpy as np
from numpy.typing import NDArray

from strapgen import fixedpoint, pipeline
from strapgen.catalogue import AnyAlgorithm, Choice, choose_step, named
from strapgen.ir.exceptions import CompilerError, InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.kernel_info import AttitudeStep
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.program import Program
from strapgen.ir.renamed import renamed_parameters
from strapgen.ir.sources import Sources
from strapgen.lab.comparison import certified_angle
from strapgen.lab.convergence import converge
from strapgen.lab.motions.motions import motion
from strapgen.lab.runs import attitude, drift_between, simulate, step_of_increments
from strapgen.results.records import INTERNAL, Properties, Record, entry, properties
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.run import exact
from strapgen.run.backends import Backend, sources_to_build
from strapgen.run.backends import backend as attitude_backend
from strapgen.run.compiler import compile_together
from strapgen.run.exact import interpreter
from strapgen.run.increments import windows

#: Largest allowed difference of an observed order from the one of theory.
ORDER_WITHIN = 0.15
#: Largest departure from an identity that holds exactly, in arithmetic of many digits.
_EXACTLY = 1e-25
#: Units in the last place that rounding adds to an attitude in a step; a bound for short formulas.
_UNITS_A_STEP = 64
_STEPS = 200


@dataclass(frozen=True)
class Finding(Record):
    """The outcome of one check.

    Parameters
    ----------
    name : str
        Name of the check.
    holds : bool or None
        Whether the step passes; None where nothing is required, or nothing could be measured.
    text : str
        The measurement in words.
    measured, allowed : float or None
        The measured figure, and the largest that passes.

    Examples
    --------
    >>> Finding.within("norm", "the length is off by 1e-9", 1e-9, 1e-6).holds
    True
    """

    name: str
    holds: bool | None
    text: str
    measured: float | None = None
    allowed: float | None = None

    __repr__ = short_repr

    @classmethod
    def within(cls, name: str, text: str, measured: float, allowed: float) -> Finding:
        """Return the finding on a figure that may be as large as another."""
        return cls(name, measured <= allowed, text, measured, allowed)


_FINDING_COLUMNS = (Column(align="<", least=5), Column(align="<", least=18, gap=1), Column(align="<"))


def finding_text(finding: Finding) -> str:
    """Return a finding as a line of a report."""
    words = {True: "holds", False: "FAILS", None: "-"}
    return TextTable(_FINDING_COLUMNS, [(words[finding.holds], finding.name, finding.text)]).as_text("  ")


@dataclass(frozen=True)
class FindingsResult(Result):
    """What was found of an attitude step; as a sequence, the findings.

    Parameters
    ----------
    kernel, title : str
        Name of the kernel, and what it is in words.
    findings : tuple of Finding
        In the order in which they were made.
    """

    rows_in = "findings"
    computed: ClassVar[Properties] = properties(holds=entry())

    kernel: str
    title: str = field(metadata=INTERNAL)
    findings: Sequence[Finding]

    __repr__ = short_repr

    def _in_words(self) -> str:
        held = [finding.holds for finding in self.findings]
        return f"of {self.kernel}: {held.count(True)} hold, {held.count(False)} fail, {held.count(None)} are open"

    def __iter__(self) -> Iterator[Finding]:
        return iter(self.findings)

    def __len__(self) -> int:
        return len(self.findings)

    @overload
    def __getitem__(self, place: int) -> Finding: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[Finding]: ...
    def __getitem__(self, place: int | slice) -> Finding | Sequence[Finding]:
        return self.findings[place]

    @property
    def holds(self) -> bool:
        """Whether the step does all that is required."""
        return all(finding.holds is not False for finding in self.findings)

    def text(self) -> str:
        """Return the findings, a line each."""
        return "\n".join([f"{self.kernel}: {self.title}", "", *map(finding_text, self.findings)])


@renamed_parameters(choice="algorithm")
def check(algorithm: AnyAlgorithm) -> FindingsResult:
    """Check the behaviour of an attitude step as its user sees it.

    Parameters
    ----------
    algorithm : str, path, Choice or AttitudeAlgorithm
        An attitude step that takes increments.

    Returns
    -------
    FindingsResult
        A sequence of `Finding`; `holds` says whether all that is required holds, and it prints as the command does.

    Raises
    ------
    InputError
        If the step takes no increments.

    Examples
    --------
    >>> found = check("euler")
    >>> found.holds, found[0].name
    (True, 'no rotation')
    """
    choice = choose_step(named("check", algorithm))
    kernel = step_of_increments(choice)
    return FindingsResult(kernel.name, kernel.title, tuple(findings(choice)))


def findings(choice: Choice) -> Iterator[Finding]:
    """Yield what is found of an attitude step that takes increments, each finding as soon as it is there."""
    step_of_increments(choice)  # refuses what is no such step
    step = _Precise(pipeline.program(choice))
    checks: dict[str, Callable[[], Iterable[Finding]]] = {
        "no rotation": lambda: [_no_rotation(step)],
        "at rest": lambda: [_at_rest(step)],
        "direction": lambda: [_direction(step)],
        "no preferred axis": lambda: [_turning_frame(step)],
        "order": lambda: [_order(choice)],
        "drift": lambda: _long_run(choice),
        "back ends": lambda: _back_ends(choice, step.program),
        "orthonormalization": lambda: [_restoring(choice, step)],
    }
    for name, measure in checks.items():
        try:
            yield from measure()
        # Errors of the algorithm: a division by zero, a number out of range.
        except (ArithmeticError, ValueError) as error:
            yield Finding(name, False, f"it stops with {type(error).__name__}: {error or 'division by zero'}")


class _Precise:
    """A step and its attitude in many digits."""

    def __init__(self, program: Program) -> None:
        self.program = program
        kernels = _step_kernels(program)
        self.identity = kernels.identity
        self.restoring = kernels.orthonormalize
        self._attitude = None if kernels.attitude is None else interpreter(kernels.attitude, program)

    def attitude(self, state: list[Any]) -> Any:
        """Return the direction cosine matrix of a state."""
        elements = self._attitude(state) if self._attitude else state
        return mpmath.matrix([elements[3 * row : 3 * row + 3] for row in range(3)])

    def run(self, increments: NDArray[np.float64], turn: Any = None) -> list[list[Any]]:
        """Return the states of a run from zero rotation; the matrix `turn` rotates all increments first."""
        rows = []
        for vectors in increments:
            row: list[Any] = []
            for vector in vectors:
                v = mpmath.matrix([mpmath.mpf(float(x)) for x in vector])
                row += list(v if turn is None else turn * v)
            rows.append(row)
        return exact.states(self.program, rows, [exact.number(x) for x in self.identity])


def _step_kernels(program: Program) -> AttitudeStep:
    """Return the kernels of an attitude step."""
    if program.attitude_step is None:
        raise InputError(f"kernel {program.kernel} is no attitude step")
    return program.attitude_step


def _samples(program: Program) -> int:
    """Return the number of increments that a step takes in all."""
    return program.inputs[1].shape[0]


def _random(program: Program, steps: int, size: float = 0.02) -> NDArray[np.float64]:
    """Return random increments; a step that takes increments from beside it sees those of its neighbours."""
    beside = _step_kernels(program).extra_increments
    count = _samples(program) - beside
    row = np.random.default_rng(1969).uniform(-size, size, (beside + steps * count, 3))
    return windows(row, count, beside)


def _exact_finding(name: str, off: Any, holds: str, fails: str) -> Finding:
    """Return the finding on an identity that holds but for the rounding of many digits."""
    off = float(off)
    fine = off <= _EXACTLY
    return Finding(name, fine, holds if fine else f"{fails}, off by {off:.3g}", off, _EXACTLY)


def _no_rotation(step: _Precise) -> Finding:
    with mpmath.workdps(exact.DIGITS):
        start = step.attitude([exact.number(x) for x in step.identity])
        off = mpmath.mnorm(start - mpmath.eye(3), "f")
    return _exact_finding(
        "no rotation",
        off,
        "the identity state is the unit matrix",
        "the attitude of the identity state is not the unit matrix",
    )


def _at_rest(step: _Precise) -> Finding:
    zero = np.zeros((3, _samples(step.program), 3))
    with mpmath.workdps(exact.DIGITS):
        run = step.run(zero)
        off = max(abs(a - b) for a, b in zip(run[0], run[-1], strict=True))
    return _exact_finding(
        "at rest",
        off,
        "without rotation the state stays as it is",
        "without rotation the state moves",
    )


def _direction(step: _Precise) -> Finding:
    """Compare a small rotation with the true one and with its opposite, which tells a wrong sign."""
    samples = _samples(step.program)
    count = samples - _step_kernels(step.program).extra_increments
    worst, mirrored = 0.0, math.inf
    size = 0.01
    with mpmath.workdps(exact.DIGITS):
        for axis in range(3):
            increments = np.zeros((1, samples, 3))
            increments[..., axis] = size / count
            matrix = step.attitude(step.run(increments)[-1])
            i, j = (axis + 1) % 3, (axis + 2) % 3
            turned = float(matrix[j, i] - matrix[i, j]) / 2
            worst = max(worst, abs(turned - size))
            mirrored = min(mirrored, abs(turned + size))
    fine = worst < size / 10
    text = "a rotation about each axis is that of the body in the reference frame"
    if not fine:
        text = "a small rotation about an axis is wrong in size or axis"
        if mirrored < size / 10:
            text = "rotations are those of the reference in the body: a sign, or a transposed matrix"
    return Finding("direction", fine, text, worst, size / 10)


def _turning_frame(step: _Precise) -> Finding:
    """Rotate all increments: every attitude must rotate with them."""
    increments = _random(step.program, 5)
    with mpmath.workdps(exact.DIGITS):
        u = [mpmath.mpf(x) for x in ("0.48", "-0.6", "0.64")]  # of length 1
        cosine, sine = mpmath.mpf(3) / 5, mpmath.mpf(4) / 5
        cross = mpmath.matrix([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
        turn = mpmath.eye(3) + sine * cross + (1 - cosine) * cross * cross
        plain = step.attitude(step.run(increments)[-1])
        turned = step.attitude(step.run(increments, turn)[-1])
        off = mpmath.mnorm(turned - turn * plain * turn.T, "f")
    return _exact_finding(
        "no preferred axis",
        off,
        "with all increments turned the attitude turns with them",
        "with all increments turned the attitude does not turn with them",
    )


def _order(choice: Choice) -> Finding:
    ladder = converge(choice)
    if ladder.observed is None:
        return Finding("order", False, f"no order is seen: {ladder.hidden}")
    if ladder.predicted is None:
        text = f"observed {ladder.observed:.3f}; the kernel states none to compare with"
        return Finding("order", None, text, ladder.observed)
    off = abs(ladder.observed - ladder.predicted)
    text = f"observed {ladder.observed:.3f}, stated {ladder.predicted}"
    text += "; the claim is too low" if ladder.observed - ladder.predicted > ORDER_WITHIN else ""
    return Finding("order", off <= ORDER_WITHIN, text, ladder.observed, ORDER_WITHIN)


def _long_run(choice: Choice) -> Iterator[Finding]:
    """Run the thesis's coning of 10 deg/s, 180 s in steps of 1/8 s."""
    backend = attitude_backend(choice)
    profile = motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)
    try:
        with np.errstate(all="ignore"):
            run = simulate(backend, profile, "0.125", 180)
    except InputError as error:
        yield Finding("drift", False, f"coning at 10 deg/s for 180 s: {error}")
        return
    drift = math.degrees(run.mean_drift)
    yield Finding("drift", None, f"coning at 10 deg/s for 180 s in steps of 1/8 s: {drift:.4g} deg", drift)
    products = run.computed @ np.swapaxes(run.computed, -1, -2) - np.eye(3)
    norm = float(np.abs(products).max())
    yield Finding(
        "norm", None, f"the same run: C C' departs from the unit matrix by at most {norm:.4g}", norm
    )


def _back_ends(choice: Choice, program: Program) -> Iterator[Finding]:
    increments = _random(program, _STEPS)
    exact_states = exact.propagate(program, increments)
    exact_matrices = attitude(attitude_backend(choice), exact_states)

    def angle(states: Any, backend: Backend) -> float:
        drift = drift_between(attitude(backend, states), exact_matrices)
        return float(np.linalg.norm(drift, axis=-1).max())

    settings = Settings().fitted(float(np.abs(increments).max())) if fixedpoint.can_lower(program) else None
    _compile(choice, settings)
    for name in ("numpy", "c", "c-float"):
        try:
            backend = attitude_backend(choice, backend=name)
        except CompilerError as error:
            yield Finding(f"back end {name}", None, f"not looked at: {error}")
            continue
        states = backend.propagate(increments)
        off, allowed = angle(states, backend), _UNITS_A_STEP * _STEPS * backend.unit
        text = f"{_STEPS} steps: {off:.3g} rad from exact arithmetic"
        yield Finding.within(f"back end {name}", text, off, allowed)
        yield _loop(backend, increments, states)
    yield _fixed(choice, settings, increments, exact_states, angle)


def _compile(choice: Choice, settings: Settings | None) -> None:
    """Compile the C of all back ends in one call of the compiler; each reports its own failure."""
    every: list[Sources] = []
    for name, stated in (("c", None), ("c-float", None), *([("c-fixed32", settings)] if settings else [])):
        with suppress(InputError):
            every += sources_to_build(choice, name, stated)
    with suppress(CompilerError):
        compile_together(every)


def _loop(backend: Backend, increments: NDArray[np.float64], states: Any) -> Finding:
    """Compare the loop over steps with single steps."""
    state = backend.identity
    off = 0.0
    for row, looped in zip(increments[:20], states[1:], strict=False):
        state = backend.step(state, row.astype(backend.dtype))
        off = max(off, float(np.abs(state - looped).max()))
    allowed = _UNITS_A_STEP * 20 * backend.unit if backend.name == "numpy" else 0.0
    text = f"20 steps at once and one by one differ by {off:.3g}"
    return Finding.within(f"loop {backend.name}", text, off, allowed)


def _fixed(
    choice: Choice,
    settings: Settings | None,
    increments: NDArray[np.float64],
    exact_states: NDArray[np.float64],
    angle: Callable[[Any, Backend], float],
) -> Finding:
    name = "back end c-fixed32"
    if settings is None:
        return Finding(name, None, "no fixed point: an input has no stated bound, or an operation is unknown")
    try:
        backend = attitude_backend(choice, backend="c-fixed32", settings=settings)
        off = angle(backend.propagate(increments), backend)
    except (InputError, CompilerError) as error:
        return Finding(name, None, f"no fixed point: {error}")
    allowed = certified_angle(backend, increments, exact_states)
    if allowed is None:
        return Finding(name, None, f"{_STEPS} steps: {off:.3g} rad, without a certified bound", off)
    text = f"{_STEPS} steps: {off:.3g} rad from exact arithmetic"
    return Finding.within(name, text, off, allowed)


def _restoring(choice: Choice, step: _Precise) -> Finding:
    """Restore a disturbed state: its attitude must be a rotation again, up to the square of the disturbance."""
    name = "orthonormalization"
    if step.restoring is None:
        return Finding(name, None, "there is none")
    backend = attitude_backend(choice)
    state = np.asarray(backend.propagate(_random(step.program, 20))[-1])
    state = state + 1e-4 * np.random.default_rng(1984).standard_normal(state.shape)

    def defect(state: Any) -> float:
        matrix = attitude(backend, state)
        return float(np.abs(matrix @ matrix.T - np.eye(3)).max())

    # A scheme may be of first order, which leaves a defect of the order of the square of the one before.
    before, after = defect(state), defect(backend.orthonormalize(state))
    allowed = 2 * before**2 + _UNITS_A_STEP * backend.unit
    text = f"C C' departs from the unit matrix by {before:.3g} before, {after:.3g} after"
    return Finding.within(name, text, after, allowed)
