"""Admission of users' kernels: each is checked before any stage works on it, and refused in one line."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterator
from fractions import Fraction

import sympy as sp

from strapgen.catalogue.derivation import companion as derived_companion
from strapgen.catalogue.methods.method import beside
from strapgen.catalogue.names import reserved
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import NODE_ROTATIONS, ROTATION_INPUTS
from strapgen.ir.kernel_info import AttitudeStep, Order
from strapgen.ir.program import RESOLUTION
from strapgen.ir.renamed import warn
from strapgen.kernel import reading
from strapgen.kernel.algebra import Direction, Wrapped
from strapgen.kernel.kernel import Kernel

_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
#: Endings of the names of a kernel's functions in all targets.
_FUNCTION_OF = re.compile(
    r"(-float|-q\d+)?(-array|-batch|-propagate|-orthonormalizer|-transition)$|(-float|-q\d+)$"
)
#: Functions that can be generated.
_FUNCTIONS = (sp.sin, sp.cos, sp.sinc, sp.atan2, sp.asin, sp.acos, Direction, Wrapped, sp.Max, sp.Piecewise)
#: The step, the time, what an expression in JSON may hold, and what SymPy reads as numbers.
_SYMBOLS_OF_SERIES = {"h", "t", "S", "E", "I", "cosine", "sine", *reading.FUNCTIONS, *reading.CONSTANTS}
_COMPARISONS = (sp.Gt, sp.Ge, sp.Lt, sp.Le)
#: Outputs of a step of velocity and position.
CHANGES = ("velocity_change", "position_change")
ALLOWED = (
    "exact numbers, + - * /, whole powers, square roots, sin, cos, sinc, atan2, asin, acos, Max, "
    "and Piecewise on < <= > >= with a last case that is always true"
)


def require(kernel: Kernel) -> None:
    """Check the kernel of a user's step and the kernels that come with it; raise InputError that names the fault."""
    names = [each.name for each in (kernel, *kernel.bundled_kernels)]
    _require_unknowns(kernel)
    for each in (kernel, *kernel.bundled_kernels):
        _require_names(each)
        _require_functions(each, {*reserved(), *names})
        _require_texts(each)
        _require_formulas(each)
    if repeated := next((name for name in names if names.count(name) > 1), None):
        raise InputError(
            f"kernel {kernel.name}: two of its kernels are called {repeated}; every one needs another name"
        )
    _require_step(kernel)
    for role, name in _companions(kernel):
        if name not in names[1:] and name not in reserved():
            _refuse(kernel, f"its {role} {name!r} is neither in the catalogue nor its own")
        _require_shapes(kernel, role, derived_companion(kernel, name))


def _refuse(kernel: Kernel, reason: str) -> None:
    raise InputError(f"kernel {kernel.name}: {reason}")


def _require_names(kernel: Kernel) -> None:
    name = kernel.name
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise InputError(
            f"kernel {name!r} has no name for generated code; a-z, 0-9 and hyphens between them are allowed"
        )
    if name in reserved() or re.match(
        r"(dcm|euler|cayley-klein)-.*-(\d+|rates)(-previous\d+)?(-ahead\d+)?$", name
    ):
        raise InputError(
            f"kernel {name} is in the catalogue, or looks like one of its steps; another name is needed"
        )
    arguments = [*kernel.inputs, *(stage.signal for stage in kernel.outputs)]
    for number, signal in enumerate(arguments):
        if signal.name in (other.name for other in arguments[:number]):
            _refuse(kernel, f"two of its arguments are called {signal.name}; each needs a name of its own")
    seen: set[str] = set()
    for signal in kernel.signals:
        for part in (signal.name, *signal.elements):
            if not (part.isascii() and part.isidentifier()):
                _refuse(kernel, f"{part!r} is no name for generated code")
        for element in signal.elements:
            if element == RESOLUTION:
                _refuse(kernel, f"{element} stands for the resolution of a target; another name is needed")
            if element in seen:
                _refuse(
                    kernel,
                    f"{element} of {signal.name} is defined twice; every element needs a name of its own",
                )
            seen.add(element)


def _require_unknowns(kernel: Kernel) -> None:
    """Check the names of the unknowns: text that holds them must be read again as it was meant."""
    elements = {element for signal in kernel.signals for element in signal.elements} | {RESOLUTION}
    if any(each.unknowns for each in kernel.bundled_kernels):
        _refuse(kernel, "a kernel that comes with it holds unknowns; the step alone may")
    for name in kernel.unknowns:
        if not (name.isascii() and name.isidentifier()) or keyword.iskeyword(name):
            _refuse(
                kernel, f"{name!r} is no name for an unknown; letters, digits and underscores are allowed"
            )
        if name in elements:
            _refuse(kernel, f"the unknown {name} is an element of a signal too; another name is needed")
        if name in _SYMBOLS_OF_SERIES or re.fullmatch(r"[fw]\d+(_[xyz])?|r\d+|u\d+_[xyz]", name):
            _refuse(
                kernel, f"the unknown {name} has a name that series use themselves; another one is needed"
            )


def _require_functions(kernel: Kernel, others: set[str]) -> None:
    """Check that no function of a kernel has the name of another's: both may be linked into one program."""
    other = _FUNCTION_OF.sub("", kernel.name)
    if other != kernel.name and other in others:
        _refuse(kernel, f"{other} has a function of this name; another name is needed")


def _require_texts(kernel: Kernel) -> None:
    texts = {"title": kernel.title, "source": kernel.source}
    texts |= {f"note {number}": note for number, note in enumerate(kernel.notes, 1)}
    for signal in kernel.signals:
        texts |= {f"meaning of {signal.name}": signal.meaning, f"unit of {signal.name}": signal.unit}
    for what, text in texts.items():
        checks.text(f"kernel {kernel.name}: its {what}", text)


def _require_formulas(kernel: Kernel) -> None:
    known = {
        RESOLUTION,
        *kernel.unknowns,
        *(element for signal in kernel.inputs for element in signal.elements),
    }
    for stage in (*kernel.stages, *kernel.outputs):
        name = stage.signal.name
        if len(stage.expressions) != stage.signal.size:
            _refuse(
                kernel, f"{name} has {len(stage.expressions)} expressions for {stage.signal.size} elements"
            )
        for element, expression in zip(stage.signal.elements, stage.expressions, strict=True):
            if not isinstance(expression, sp.Expr):
                _refuse(kernel, f"{element} is {expression!r}; an expression of SymPy is needed")
            if unknown := sorted(
                symbol.name for symbol in expression.free_symbols if symbol.name not in known
            ):
                _refuse(kernel, f"{element} uses {', '.join(unknown)}, not defined before it")
            if fault := next(_faults(expression), ""):
                _refuse(kernel, f"{element} holds {fault}, which cannot be generated; allowed: {ALLOWED}")
        known.update(stage.signal.elements)


def _faults(expression: sp.Basic) -> Iterator[str]:
    """Yield the parts of an expression that cannot be generated."""
    if expression.has(sp.Float):
        yield f"the inexact number {min(map(float, expression.atoms(sp.Float)))}"
    elif expression.is_number:
        # What is irrational is rounded once; it has to be a number of a size that a double holds.
        if expression.is_real is not True or not expression.is_finite or abs(sp.N(expression)) > 10**300:
            yield str(expression)[:60]
    elif expression.is_Symbol:
        if expression.is_real is not True:
            yield f"the symbol {expression}, which is not real"
    elif isinstance(expression, sp.Pow):
        exponent = expression.exp
        if not (exponent.is_Integer or abs(exponent) == sp.Rational(1, 2)):
            yield f"a power {str(exponent)[:40]}"
        yield from _faults(expression.base)
    elif isinstance(expression, sp.Piecewise):
        for value, condition in expression.args:
            yield from _faults(value)
            if condition not in (sp.true, sp.false):
                if not isinstance(condition, _COMPARISONS):
                    yield f"the condition {str(condition)[:60]}"
                else:
                    yield from _faults(condition.lhs)
                    yield from _faults(condition.rhs)
        if expression.args[-1][1] != sp.true:
            yield "a Piecewise without a last case that is always true"
    elif expression.is_Add or expression.is_Mul or isinstance(expression, _FUNCTIONS):
        for argument in expression.args:
            yield from _faults(argument)
    else:
        yield type(expression).__name__


def _require_changes(kernel: Kernel) -> None:
    shapes = [signal.shape for signal in kernel.inputs]
    if shapes[0] != shapes[1] or len(shapes[0]) != 2 or shapes[0][1] != 3:
        _refuse(kernel, "increments and velocity_increments of one shape (K, 3) are needed")
    outputs = [stage.signal for stage in kernel.outputs]
    if not outputs or any(signal.name not in CHANGES or signal.shape != (3,) for signal in outputs):
        names = ", ".join(signal.name for signal in outputs) or "nothing"
        _refuse(kernel, f"it returns {names}; {' and '.join(CHANGES)}, (3,) each, or one of them, are needed")
    _require_beside(kernel, kernel.previous, kernel.ahead, shapes[0][0])
    if kernel.attitude_step is not None:
        _refuse(kernel, "a step of velocity and position has no attitude_step")


def _require_beside(kernel: Kernel, previous: int, ahead: int, samples: int) -> None:
    for name, number in (("previous", previous), ("ahead", ahead)):
        if type(number) is not int:
            _refuse(kernel, f"{name} {number!r} is no number")
    if min(previous, ahead) < 0 or previous + ahead >= samples:
        _refuse(kernel, f"{previous} of its {samples} increments are previous ones and {ahead} are ahead")


#: The words of `increments_signal` on samples from beside the step.
_BESIDE = re.compile(r"; the (?:first|last) \d+ are those (?:before|after) the step")


def _require_samples(kernel: Kernel, step: AttitudeStep) -> None:
    names = [signal.name for signal in kernel.inputs]
    shape: tuple[int, ...] = kernel.inputs[1].shape if len(kernel.inputs) == 2 else ()
    known = len(names) == 2 and names[0] == "state" and names[1] in ROTATION_INPUTS
    if not known or len(shape) != 2 or shape[1] != 3:
        _refuse(
            kernel,
            f"it takes {', '.join(names)}; state and increments (K, 3), state and node_rotations (K, 3), or increments "
            "and velocity_increments are needed",
        )
    if names[1] == NODE_ROTATIONS[1]:
        warn(f"input {names[1]} of kernel {kernel.name}", NODE_ROTATIONS[0])
    _require_beside(kernel, step.previous, step.ahead, shape[0])
    said = _BESIDE.findall(kernel.inputs[1].meaning)
    if said and "".join(said) != beside(step.previous, step.ahead):
        _refuse(
            kernel,
            f"its increments say{''.join(said).replace(';', ',')}, and it declares previous={step.previous}, "
            f"ahead={step.ahead}; build.kernel(..., previous=..., ahead=...) must say the same",
        )
    if names[1] == "increments":
        if step.nodes:
            _refuse(kernel, "it takes increments and has nodes; nodes go with node_rotations")
        return
    if not all(isinstance(node, (int, Fraction)) for node in step.nodes):
        _refuse(kernel, f"its nodes are {step.nodes!r}; whole numbers and fractions.Fraction are needed")
    if len(step.nodes) != shape[0] or len(set(step.nodes)) != shape[0]:
        _refuse(
            kernel, f"it takes rates at {shape[0]} nodes; its attitude_step needs as many different nodes"
        )
    if step.extra_increments:
        _refuse(kernel, "it takes rates; previous and ahead go with increments")


def _require_step(kernel: Kernel) -> None:
    if kernel.takes_velocity:
        _require_changes(kernel)
        return
    step = kernel.attitude_step
    if step is None:
        _refuse(kernel, "it has no attitude_step; an attitude step needs one")
        return
    if not isinstance(step, AttitudeStep):
        _refuse(kernel, f"its attitude_step is {step!r}; strapgen.AttitudeStep is needed")
    if not isinstance(step.isometry, bool):
        _refuse(kernel, f"isometry {step.isometry!r} is no truth value")
    if kernel.order is not None and not isinstance(kernel.order, Order):
        _refuse(kernel, f"its order is {kernel.order!r}; strapgen.Order is needed")
    _require_samples(kernel, step)
    state = kernel.inputs[0]
    if len(kernel.outputs) != 1 or kernel.outputs[0].signal.shape != state.shape:
        _refuse(kernel, f"one output of the shape of the state, {state.shape}, is needed")
    if len(step.identity) != state.size:
        _refuse(kernel, f"identity has {len(step.identity)} elements, the state {state.size}")
    for number in step.identity:
        if not hasattr(number, "numerator") or isinstance(number, bool):
            _refuse(kernel, f"identity holds {number!r}; whole numbers or fractions are needed")
    if (step.product is None) != (kernel.transition is None):
        _refuse(kernel, "a product and a transition go together")
    stages = {stage.signal.name: stage.signal for stage in kernel.stages}
    if kernel.transition is not None and kernel.transition not in stages:
        _refuse(
            kernel,
            f"its transition {kernel.transition!r} is none of its stages: {', '.join(stages) or 'none'}",
        )
    if sum(stage.signal.name == kernel.transition for stage in kernel.stages) > 1:
        _refuse(kernel, f"two of its stages are called {kernel.transition}, as its transition is")
    if step.attitude is None and state.shape != (3, 3):
        _refuse(kernel, "attitude is None, but the state is no matrix (3, 3)")


def _companions(kernel: Kernel) -> list[tuple[str, str]]:
    step = kernel.attitude_step
    if step is None:  # a step of velocity and position
        return []
    roles = ("product", "orthonormalize", "attitude")
    return [(role, name) for role in roles if (name := getattr(step, role)) is not None]


def _require_shapes(kernel: Kernel, role: str, companion: Kernel) -> None:
    """Check that a companion has the inputs and outputs of its role."""
    state = kernel.inputs[0].shape
    transitions = [stage.signal.shape for stage in kernel.stages if stage.signal.name == kernel.transition]
    takes, gives = {
        "product": ([state, *transitions], state),
        "orthonormalize": ([state], state),
        "attitude": ([state], (3, 3)),
    }[role]
    has = [signal.shape for signal in companion.inputs]
    if has != takes or [stage.signal.shape for stage in companion.outputs] != [gives]:
        shapes = ", ".join(map(str, takes))
        _refuse(kernel, f"its {role} {companion.name} must turn {shapes} into {gives}")
