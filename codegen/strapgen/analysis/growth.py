"""The growth of a state in a step, as the change of its length or, for a matrix, of its determinant.

`growth` derives its series, and `stability` the steps at a constant rate for which no state grows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import sympy as sp

from strapgen.analysis.series import motion_rates
from strapgen.analysis.series.constant_rate import ANGLE, ConstantRate, constant_rate
from strapgen.analysis.series.invariants import (
    intervals_text,
    scalar_invariants,
    scalar_text,
    scalar_value,
    sum_text,
)
from strapgen.analysis.series.motion_rates import in_powers_of_the_step
from strapgen.analysis.series.series import MOST_TERMS, STEP
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import notebook_latex, short_repr
from strapgen.ir.read_only import ReadOnly
from strapgen.kernel.algebra import cross_elements, dot
from strapgen.kernel.polynomials import Polynomial
from strapgen.lab import one_step
from strapgen.lab.motions.motion_names import is_file
from strapgen.lab.one_step import Step
from strapgen.results.display.expressions import expression_latex
from strapgen.results.display.latex import equations
from strapgen.results.records import INTERNAL, Record, entry, reader_table
from strapgen.results.result import Result
from strapgen.results.table import TextTable

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


#: Decimal digits of an irrational coefficient.
_DIGITS = 60


def _sum(terms: Mapping[int, sp.Expr]) -> str:
    return sum_text(terms, STEP)


def _invariant(parts: Mapping[str, Mapping[int, Polynomial]]) -> Any:
    """Return the terms as text; None without any."""
    return {
        name: {power: scalar_text(one) for power, one in rows.items()} for name, rows in parts.items()
    } or None


@dataclass(frozen=True)
class Growth(ReadOnly, Record):
    """The change in one step of a length and of a determinant that should both stay 1."""

    kernel: str = field(metadata=INTERNAL)
    motion: str = field(metadata=INTERNAL)
    #: The first terms that are not zero, by power of the step length, of the length of a state of four
    #: parameters; None for other states
    length: Mapping[int, sp.Expr] | None = field(metadata=entry(optional=True, write=_sum, kind=str))
    #: The same of the determinant of the direction cosine matrix
    determinant: Mapping[int, sp.Expr] = field(metadata=entry(write=_sum, kind=str))
    #: For a general rate the terms of "length" and "determinant" in scalar products
    invariant: Mapping[str, Mapping[int, Polynomial]] = field(
        metadata=entry(optional=True, write=_invariant, kind=dict[str, dict[str, str]])
    )

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"of {self.kernel}, {self.motion} motion"


def growth(choice: Choice, motion: str = "constant", terms: int = 2) -> Growth:
    """Derive the change of the length of the state and of the determinant of the matrix in one step.

    >>> from strapgen import catalogue
    >>> found = growth(catalogue.choose("dcm", "rk4"), "constant", terms=1)
    >>> sp.factor(found.determinant[6])
    -(w_x**2 + w_y**2 + w_z**2)**3/72
    """
    motion_rates.require(motion)
    terms = checks.count("terms", terms, largest=MOST_TERMS)
    attitude_step = one_step.step(choice)
    order = attitude_step.kernel.order
    top = 2 + (order.step if order else 1) + terms
    most = top + one_step.PATIENCE
    with in_powers_of_the_step(attitude_step.kernel.name):
        while True:
            candidate = _growth(attitude_step, motion, terms, top)
            known = [x for x in (candidate.length, candidate.determinant) if x is not None]
            if top >= most or all(len(x) >= terms for x in known):
                return candidate
            top += 1


def _growth(attitude_step: Step, motion: str, terms: int, top: int) -> Growth:
    if is_file(motion):
        return _of_file(_growth(attitude_step, "general", top, top), motion, terms, top)
    frame = None
    if motion == "general":
        frame, ring, rate = one_step.general_rate(attitude_step, top)
    else:
        motion_rate = motion_rates.at_time(motion, top, attitude_step.domain)
        ring, rate = motion_rate.ring, motion_rate.derivatives
    matrix = one_step.computed_matrix(attitude_step, ring, rate, top)
    sizes = {"determinant": dot(matrix[:3], cross_elements(matrix[3:6], matrix[6:]))}
    state = attitude_step.kernel.inputs[0]
    if state.shape == (4,):
        elements = one_step.computed_state(attitude_step, ring, rate, top)
        sizes["length"] = dot(elements, elements).root()
    expressions: dict[str, dict[int, sp.Expr]] = {}
    invariant: dict[str, dict[int, Polynomial]] = {}
    for name, size in sizes.items():
        parts = {
            power: one_step.shown(attitude_step, part)
            for power, part in size.parts.items()
            if power and power >= attitude_step.lowest
        }
        if frame is None:
            rows = {power: motion_rate.expression(part) for power, part in parts.items()}
            expressions[name] = dict([(power, x) for power, x in rows.items() if x][:terms])
        else:
            leading = dict([(power, part) for power, part in parts.items() if part][:terms])
            invariant[name] = {power: scalar_invariants(frame, part) for power, part in leading.items()}
            vectors = [[sp.Symbol(f"w{j}_{axis}") for axis in "xyz"] for j in range(top)]
            expressions[name] = {
                power: sp.expand(scalar_value(one, vectors)) for power, one in invariant[name].items()
            }
    return Growth(
        attitude_step.kernel.name, motion, expressions.get("length"), expressions["determinant"], invariant
    )


def _of_file(general: Growth, motion: str, terms: int, top: int) -> Growth:
    """Return the growth on a user's rate, whose derivatives take the place of those of a general one."""
    inserted = motion_rates.of_file(motion, top)

    def rows(known: Mapping[int, sp.Expr] | None) -> dict[int, sp.Expr]:
        parts = {power: inserted(x) for power, x in (known or {}).items()}
        return dict([(power, x) for power, x in parts.items() if x != 0][:terms])

    length = None if general.length is None else rows(general.length)
    return Growth(general.kernel, motion, length, rows(general.determinant), {})


def contraction(found: ConstantRate) -> list[tuple[float, float | None]] | None:
    """Return the intervals of the angle x = |w| h in rad for which a step at a constant rate lets no state grow.

    >>> from strapgen import catalogue
    >>> from strapgen.analysis.series.constant_rate import constant_rate
    >>> contraction(constant_rate(catalogue.choose("dcm", "rk4")))
    [(0.0, 2.8284271247461903)]
    """
    excess = found.stretch_squared - 1
    if excess == 0:
        return None
    if not excess.is_polynomial(ANGLE):
        raise InputError(
            f"kernel {found.kernel}: its growth at a constant rate is no polynomial of the angle"
        )
    # Irrational coefficients are rounded, since the roots have 16 digits. Terms below the order of the method come from
    # the rounding of published coefficients and are no growth.
    polynomial = sp.Poly.from_dict(
        {
            (power,): number if number.is_Rational else sp.Rational(sp.N(number, _DIGITS))
            for (power,), number in sp.Poly(excess, ANGLE).terms()
            if power >= found.lowest
        },
        ANGLE,
    )
    crossings = [0.0]
    crossings += sorted({float(root.evalf(20)) for root in sp.real_roots(polynomial) if root.evalf() > 0})
    intervals: list[tuple[float, float | None]] = []
    for k, begin in enumerate(crossings):
        end = crossings[k + 1] if k + 1 < len(crossings) else None
        middle = (begin + end) / 2 if end is not None else begin + 1
        if polynomial.eval(sp.Rational(middle)) <= 0:
            if intervals and intervals[-1][1] == begin:
                begin = intervals.pop()[0]
            intervals.append((begin, end))
    return intervals


@dataclass(frozen=True)
class Stability(ReadOnly, Record):
    """The change of the length of a state in a step at a constant rate."""

    kernel: str = field(metadata=entry("step", align="<"))
    #: Square of the factor by which the state grows across the axis, a function of the angle x of the step
    stretch_squared: sp.Expr = field(metadata=entry("square of the stretch, x = |w| h", align="<", cell=str))
    #: The intervals from `contraction`
    contractive: Sequence[tuple[float, float | None]] | None = field(
        metadata=entry("x at which no state grows", align="<", least=26, cell=intervals_text)
    )

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        return f"of {self.kernel}, a step of the angle x: no state grows where x is {intervals_text(self.contractive)}"

    def stretch(self, angles: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the factor for angles in rad, an array of any shape.

        `angles`: angles of the step in rad.
        """
        import numpy as np

        squares = sp.lambdify(ANGLE, self.stretch_squared, "numpy")(angles)
        factors: NDArray[np.float64] = np.sqrt(np.broadcast_to(np.asarray(squares, np.float64), angles.shape))
        return factors


def stability(choice: Choice) -> Stability:
    """Derive the change of the length of a state in a step at a constant rate.

    >>> from strapgen import catalogue
    >>> stability(catalogue.choose("euler", "rk3")).as_dict()["contractive"]
    [[0.0, 3.4641016151377544]]
    """
    closed_form = constant_rate(choice)
    return Stability(closed_form.kernel, closed_form.stretch_squared, contraction(closed_form))


@dataclass(frozen=True)
class StabilityResult(Result):
    """The growth of states in steps at a constant rate: a row for each step."""

    rows_in = "steps"
    row: ClassVar[type | None] = Stability
    drawn_by: ClassVar[str] = "strapgen.analysis.analysis_plots:stability_image"

    steps: Sequence[Stability]

    def table(self) -> TextTable:
        """Return the steps as a table."""
        return reader_table(self.steps, Stability, "kernel", "contractive", "stretch_squared")

    def latex(self) -> str:
        """Return the squares of the stretches."""
        return stability_latex(self.steps)


def stability_latex(stabilities: Sequence[Stability]) -> str:
    r"""Return the squares of the stretches \rho of steps as functions of the angle x of a step in rad."""
    return equations(
        (rf"\rho_{{\mathrm{{{one.kernel}}}}}^{{2}}", expression_latex(one.stretch_squared))
        for one in stabilities
    )
