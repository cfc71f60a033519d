"""Solves the conditions on the unknown coefficients of a step, and derives the leading errors of the solutions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeAlias

import sympy as sp

from strapgen import pipeline
from strapgen.analysis.unknowns import conditions, elimination
from strapgen.analysis.unknowns.conditions import Demand, attitude_conditions
from strapgen.analysis.unknowns.elimination import Equation, Family, PolynomialSolution
from strapgen.catalogue import AnyAlgorithm, choose
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import notebook_latex, short_repr
from strapgen.ir.read_only import ReadOnly
from strapgen.kernel.kernel import Kernel
from strapgen.lab import one_step
from strapgen.results.records import entry

#: States the conditions of a demand, and of some orders beyond it.
State: TypeAlias = Callable[[Demand, int], list[Equation]]
#: Number of powers of the step beyond an order at which a leading error is looked for.
_PATIENCE = 3
#: Most terms of a sum of squares that is minimised.
_MOST_TERMS = 400


def _terms(terms: Sequence[Equation]) -> dict[str, sp.Expr]:
    return {each.label: each.value for each in terms}


@dataclass(frozen=True)
class LeadingError(ReadOnly):
    """The leading error of a family on a motion.

    Parameters
    ----------
    motion : str
    power : int
        The power of the step at which it stands.
    terms : tuple of Equation
        Its coefficients, as functions of the free parameters.
    square : Expr
        The sum of their squares.
    least : dict of Symbol to Expr
        The free parameters at which that sum is smallest; empty where it does not depend on them, or not as a
        polynomial of second degree.

    Examples
    --------
    >>> from strapgen import unknowns
    >>> a = sp.Symbol("a")
    >>> LeadingError("coning", 5, (unknowns.Equation("drift", 4, a - 1),), (a - 1) ** 2, {a: sp.Integer(1)}).least
    {a: 1}
    """

    motion: str
    power: int
    terms: tuple[Equation, ...] = field(metadata=entry(write=_terms, kind=dict[str, str]))
    square: sp.Expr = field(metadata=entry(key="sum_of_squares", kind=str))
    least: Mapping[sp.Symbol, sp.Expr] = field(metadata=entry(kind=dict[str, str]))

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        return f"h^{self.power} on {self.motion} motion: {len(self.terms)} terms"


@dataclass(frozen=True)
class SolvedStep:
    """The conditions on the unknowns of a step, and their solution.

    Parameters
    ----------
    kernel : Kernel
        The step of attitude, or of velocity and position, with its unknowns.
    demands : tuple of Demand
        The motions, and the order on each.
    conditions : tuple of Equation
        What has to vanish.
    solution : PolynomialSolution
    leading : tuple of tuple of LeadingError
        For each family its leading error on every motion, where there is one within a few powers.

    Examples
    --------
    >>> from strapgen import unknowns
    >>> unknowns.solve("examples/three_samples.py", 4).families[0].free
    (a,)
    """

    kernel: Kernel
    demands: tuple[Demand, ...]
    conditions: tuple[Equation, ...]
    solution: PolynomialSolution
    leading: tuple[tuple[LeadingError, ...], ...]

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        demands = ", ".join(f"order {demand.order} on {demand.motion} motion" for demand in self.demands)
        return f"of {self.kernel.name}: {demands}\n{len(self.conditions)} conditions; {self.solution!r}"

    @property
    def families(self) -> tuple[Family, ...]:
        """The families of solutions, those with most parameters first."""
        return self.solution.families

    def values(self, parameters: Mapping[str, Any] | None = None, family: int = 0) -> dict[str, sp.Expr]:
        """Return the values of all unknowns of a member of a family.

        Parameters
        ----------
        parameters : mapping of str to number or str, optional
            Free parameters by name; those without a value stay.
        family : int, optional
            Number of the family, from 0 on.

        Raises
        ------
        InputError
            If there is no such family or parameter, or the family excludes the value.
        """
        if not 0 <= family < len(self.families):
            raise InputError(
                f"kernel {self.kernel.name} has {len(self.families)} families of solutions; there is no number {family}"
            )
        return elimination.member(self.families[family], f"kernel {self.kernel.name}", parameters or {})

    def substitute(self, parameters: Mapping[str, Any] | None = None, family: int = 0) -> Kernel:
        """Return the kernel with the values of a family; parameters and errors are those of `values`.

        Examples
        --------
        >>> from strapgen import choose
        >>> solved = solve(choose("examples/three_samples.py"), {"coning": 6})
        >>> solved.values(), solved.substitute().unknowns
        ({'a': 27/40, 'b': 9/20}, ())
        """
        return self.kernel.substitute(self.values(parameters, family))


def solve(choice: AnyAlgorithm, order: int | Mapping[str, int]) -> SolvedStep:
    """State the conditions on the unknowns of a step, and solve them exactly.

    Parameters
    ----------
    choice : Choice, AttitudeAlgorithm or str
        A step with unknowns: of attitude, on increments or on rates at nodes, or of velocity and position.
    order : int or mapping of str to int
        Order on a general motion, or orders by motion: "general" (any smooth rate), "polynomial", of the degree that
        the samples determine, and "coning", the last two to products of two rates. For velocity and position "general"
        stands for both changes and "velocity" or "position" for one; "polynomial" and "sculling" hold to products of a
        rate and a force. All conditions have to hold.

    Returns
    -------
    SolvedStep

    Raises
    ------
    InputError
        If a motion or an order is not allowed, the step has no unknowns, a condition cannot be stated, or they are
        beyond the limits of `elimination`.

    Examples
    --------
    >>> from strapgen import choose
    >>> solved = solve(choose("examples/three_samples.py"), {"polynomial": 5})
    >>> solved.values()
    {'a': 57/80, 'b': 33/80}
    """
    orders = order if isinstance(order, Mapping) else {"general": order}
    demands = [Demand(motion, each) for motion, each in orders.items()]
    kernel, state = _statement(choice)
    for demand in demands:
        demand.require(kernel.takes_velocity)
    if not kernel.unknowns:
        raise InputError(f"kernel {kernel.name} has no unknowns; KernelBuilder.parameter declares one")
    unknowns = [sp.Symbol(name, real=True) for name in kernel.unknowns]
    equations = [
        replace(equation, label=f"{demand.motion}, {equation.label}") if len(demands) > 1 else equation
        for demand in demands
        for equation in state(demand, 0)
    ]
    solution = elimination.solve(equations, unknowns)
    leading = tuple(
        tuple(one for demand in demands if (one := _leading(state, demand, family)))
        for family in solution.families
    )
    return SolvedStep(kernel, tuple(demands), tuple(equations), solution, leading)


def _statement(algorithm: AnyAlgorithm) -> tuple[Kernel, State]:
    """Return the kernel of an algorithm, and the function that states its conditions."""
    choice = choose(algorithm)
    if choice.takes_velocity:
        kernel = pipeline.derive(choice)
        return kernel, partial(conditions.velocity_conditions, kernel)
    attitude_step = one_step.step(choice)
    return attitude_step.kernel, partial(attitude_conditions, attitude_step)


def _leading(state: State, demand: Demand, family: Family) -> LeadingError | None:
    """Return the first error of a family beyond an order; None if there is none within a few powers."""
    for more in range(1, _PATIENCE + 1):
        power = demand.order + more
        terms = [
            Equation(each.label, each.order, elimination.simple(each.value.xreplace(family.values)))
            for each in state(demand, more)
            if each.order == power
        ]
        terms = [each for each in terms if each.value != 0]
        if terms:
            square = sp.Add(*(each.value**2 for each in terms))
            return LeadingError(demand.motion, power, tuple(terms), square, _least(square, terms, family))
    return None


def _least(square: sp.Expr, terms: Sequence[Equation], family: Family) -> Mapping[sp.Symbol, sp.Expr]:
    """Return the parameters at which a sum of squares is smallest, if its terms are linear in them."""
    free = [symbol for symbol in family.free if symbol in square.free_symbols]
    if not free or family.equations or len(terms) > _MOST_TERMS:
        return {}
    if not all(each.value.is_polynomial(*free) for each in terms):
        return {}
    if any(sp.Poly(each.value, *free).total_degree() > 1 for each in terms):
        return {}
    slopes = [Equation("slope", 1, sp.expand(sp.diff(square, symbol))) for symbol in free]
    (best,) = elimination.solve(slopes, free).families
    return best.values
