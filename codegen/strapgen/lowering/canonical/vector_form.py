"""The vector form of a step: its transition as sums of vectors, for a reader."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from strapgen.kernel.covariants import Coefficients, Covariant, Decomposition, NotCovariantError, transform
from strapgen.kernel.kernel import Kernel
from strapgen.kernel.polynomials import Polynomial, atoms, scale
from strapgen.lowering.canonical import expansion, extract_core
from strapgen.lowering.canonical.core import Core, decompose
from strapgen.lowering.canonical.plan import Plan, plans, without_triples
from strapgen.lowering.canonical.vectors import Form, all_components, choose_products, independent

#: How many bases, those in which the code is shortest first, are compared for a reader.
_READ = 8
#: A vector by its name, or the cross product of two.
Vector = tuple[str, ...]
#: Weights of vectors: polynomials in products of vectors, (a, b) the scalar and (a, b, c) the triple product.
Sum = dict[Vector, Polynomial]


@dataclass(frozen=True)
class VectorForm:
    """The transition of a step in a few vectors, their scalar products and their cross products."""

    inputs: tuple[str, ...]  # names of the input vectors, increments or rates at nodes times the step, in rad
    vectors: dict[str, Form]  # the other vectors, each as coefficients of the inputs
    vector: Sum  # the vector part of a quaternion, or the vector of a matrix's skew part
    scalar: Polynomial  # the scalar part of a quaternion, or the multiple of the unit matrix
    #: For a matrix the partner y of each vector u, of which it has u y' + y u'; empty for a quaternion.
    outers: dict[str, Sum]
    matrix: bool  # whether the transition is a matrix

    @property
    def products(self) -> list[tuple[str, ...]]:
        """The scalar and triple products that the weights have, in a fixed order."""
        return sorted(atoms(list(_polynomials(self))))


def vector_form(kernel: Kernel) -> VectorForm | None:
    """Return the vector form of a step; None without a covariant transition, or if the form is longer than the stages.

    >>> from strapgen import derive
    >>> form = vector_form(derive("euler", "rk4", 2))
    >>> form.vectors, form.products
    ({'sigma': (Fraction(1, 1), Fraction(1, 1))}, [('d1', 'd2'), ('sigma', 'sigma')])
    """
    core = extract_core(kernel)
    if core is None or expansion(core):
        return None
    try:
        decomposition = decompose(core)
        ranked = plans(core, decomposition)
    except NotCovariantError:
        return None
    bases: dict[tuple[str, ...], Plan] = {}
    for plan in ranked:
        bases.setdefault(tuple(plan.basis), plan)
    forms = [_form(core, decomposition, plan) for plan in list(bases.values())[:_READ]]
    return min(forms, key=_length, default=None)


def _length(form: VectorForm) -> int:
    """Return the length for a reader: terms of the weights, products, and vectors that need a definition."""
    defined = sum(sum(map(bool, coefficients)) for coefficients in form.vectors.values())
    return sum(map(len, _polynomials(form))) + len(form.products) + defined


def _form(core: Core, decomposition: Decomposition, plan: Plan) -> VectorForm:
    """Return the transition in the basis of a plan."""
    moved = transform(decomposition, all_components(core.base(), plan.forms()))
    if core.transition.shape == (3, 3):
        moved = without_triples(moved)[0]
    names = plan.basis
    offered = {
        v.name: v.form
        for v in plan.pool.vectors.values()
        if len(independent([*core.base(), v.form])) == len(names)
    }
    outers = {names[i]: _named(partner, names) for i, partner in _partners(moved.symmetric).items()}
    diagonal = moved.symmetric.get((), {}) if moved.scalar is None else moved.scalar
    skew = _named(moved.vector, names)
    form = VectorForm(tuple(core.inputs), {}, skew, diagonal, outers, moved.scalar is None)
    form = _cross_inputs(form, offered)
    basis = [(name, offered[name]) for name in names]
    form = _with_weights(form, iter(choose_products(list(_polynomials(form)), basis, offered)))
    used = {name for product in form.products for name in product} | {
        name for terms in (form.vector, *form.outers.values()) for vector in terms for name in vector
    }
    used |= set(form.outers)
    return replace(form, vectors={n: offered[n] for n in offered if n in used and n not in form.inputs})


def _polynomials(form: VectorForm) -> list[Polynomial]:
    """Return all weights of a form."""
    sums = (form.vector, *form.outers.values())
    return [form.scalar, *(weight for terms in sums for weight in terms.values())]


def _named(coefficients: Coefficients, names: list[str]) -> Sum:
    return {tuple(names[k] for k in covariant): weight for covariant, weight in coefficients.items()}


def _partners(symmetric: Coefficients) -> dict[int, Coefficients]:
    """Return the symmetric part of a matrix as a partner for each of a few vectors: the sum of u y' + y u'."""
    partners: dict[int, Coefficients] = {}
    pairs = {covariant: weight for covariant, weight in symmetric.items() if covariant}
    for covariant in sorted(pairs, key=lambda c: (len(c) != 3, len(set(c)), c)):
        axis = _axis(covariant, partners)
        remaining = list(covariant)
        remaining.remove(axis)
        partners.setdefault(axis, {})[tuple(remaining)] = pairs[covariant]
    return partners


def _axis(covariant: Covariant, partners: dict[int, Coefficients]) -> int:
    """Return the vector of a symmetrized product that stands outside: one that has a partner, if there is one."""
    first = covariant[:1] if len(covariant) == 3 else covariant
    return next((k for k in first if k in partners), first[0])


def _cross_inputs(form: VectorForm, forms: dict[str, Form]) -> VectorForm:
    """Write cross products of two inputs as that of the inputs: of two vectors there is only one cross product."""
    if len(form.inputs) != 2 or not set(form.inputs) <= set(forms):
        return form

    def crossed(terms: Sum) -> Sum:
        total: Sum = {}
        for vector, weight in terms.items():
            if len(vector) == 2:
                (a, b), (c, d) = (forms[name] for name in vector)
                vector, weight = form.inputs, scale(weight, a * d - b * c)
            total[vector] = weight
        return total

    return replace(
        form,
        vector=crossed(form.vector),
        outers={name: crossed(terms) for name, terms in form.outers.items()},
    )


def _with_weights(form: VectorForm, weights: Iterator[Polynomial]) -> VectorForm:
    """Return a form with other weights, in the order of `_polynomials`."""
    scalar = next(weights)
    vector = {name: next(weights) for name in form.vector}
    outers = {name: {part: next(weights) for part in terms} for name, terms in form.outers.items()}
    return replace(form, scalar=scalar, vector=vector, outers=outers)
