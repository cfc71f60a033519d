"""Assessment of a kernel: its mean rates under vibration are derived and set beside the true ones.

`drift` and `sculling` take a kernel, `of` takes a choice of the catalogue, and `two_speed` a whole algorithm in two
speeds. `through_gyro` and `through_gyros` assess an algorithm whose angles come from gyros of limited bandwidth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from typing import Any

import mpmath
import sympy as sp
from sympy.utilities.lambdify import implemented_function

from strapgen import catalogue, pipeline
from strapgen.analysis.vibration import response, systems
from strapgen.analysis.vibration.mean_rates import Assessment
from strapgen.analysis.vibration.response import Form, Pair
from strapgen.analysis.vibration.systems import ANGLES, T_M, VELOCITIES, F, T
from strapgen.catalogue import AnyAlgorithm, Choice
from strapgen.catalogue.methods.sensor_response import Response, parse
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.renamed import renamed_parameters, warn
from strapgen.kernel.kernel import Kernel


def drift(
    kernel: Kernel, *, nodes: Sequence[Fraction | sp.Expr] = (), previous: int = 0, ahead: int = 0
) -> Assessment:
    """Assess the mean drift rate of a kernel about z, in rad/s.

    Parameters
    ----------
    kernel : Kernel
        An attitude step of the catalogue or of a user, the rotation vector of a step, or a recursion that sums coning.
    nodes : sequence of Fraction or Expr, optional
        Nodes of a step that takes rates, as fractions of the step.
    previous, ahead : int, optional
        Numbers of samples from before the step and from after it, for the rotation vector of a step; an attitude step
        has these numbers.

    Returns
    -------
    Assessment

    Raises
    ------
    InputError
        If the kernel is none of these, or has no expansion to second order.

    Examples
    --------
    >>> from strapgen import derive
    >>> drift(derive("euler", "rk1", 1)).text("computed")
    '-pi*f*theta_x*theta_y*sin(phi)*(sin(2*pi*T*f)/(2*pi*T*f))'
    """
    system = systems.of(kernel, "rad", nodes, previous, ahead)
    if system.unit != "rad":
        raise InputError(f"kernel {kernel.name} computes a velocity; it has a sculling rate, not a drift")
    endless = system.slow_cycle is None
    return Assessment(
        kernel.name, "rad/s", not endless, response.forms(system), response.true_forms("coning", endless)
    )


def sculling(
    kernel: Kernel, *, nodes: Sequence[Fraction | sp.Expr] = (), previous: int = 0, ahead: int = 0
) -> Assessment:
    """Assess the mean sculling rate of a kernel about z, in m/s^2.

    A kernel without velocity increments is assessed by duality, in which the cross product of two angle increments
    becomes that of an angle and a velocity increment.

    Parameters
    ----------
    kernel, nodes, previous, ahead
        As for `drift`. The kernel may also be the sculling term of a step or a recursion that sums sculling.

    Returns
    -------
    Assessment

    Raises
    ------
    InputError
        If the kernel is none of these, or has neither an expansion to second order nor a dual.

    Examples
    --------
    >>> from strapgen import derive
    >>> sculling(derive("sculling-fast-2")).expression("continuous").has(systems.T_M)
    True
    """
    if not _takes_velocities(systems.require_kernel(kernel)):
        if kernel.recursion is not None and kernel.attitude_step is None:
            raise InputError(f"kernel {kernel.name} takes no velocity increments; sculling-fast-1 or -2 does")
        return _dual(drift(kernel, nodes=nodes, previous=previous, ahead=ahead))
    system = systems.of(kernel, "m/s", nodes, previous, ahead)
    computed = response.forms(system)
    if not all(set(pair) & set(ANGLES) and set(pair) & set(VELOCITIES) for pair in computed):
        raise InputError(f"kernel {kernel.name} gives a velocity that is no product of angles and velocities")
    endless = system.slow_cycle is None
    compensated = any(form.real != 0 for form in computed.values())
    true = response.true_forms("S1" if compensated and not endless else "S2", endless)
    return Assessment(kernel.name, "m/s^2", not endless, computed, true)


def _takes_velocities(kernel: Kernel) -> bool:
    return any(signal.name in systems.SAMPLES and signal.unit == "m/s" for signal in kernel.inputs)


def _dual(assessment: Assessment) -> Assessment:
    """Return the assessment of the sculling term that is dual to a coning term."""
    pair = ANGLES
    form = assessment.computed.get(pair, Form(sp.S.Zero, sp.S.Zero))
    if set(assessment.computed) - {pair} or form.real != 0:
        raise InputError(
            f"kernel {assessment.kernel} has other terms of second order than cross products of samples; "
            "sculling has no dual of it"
        )
    turned = Form(sp.S.Zero, -form.imaginary)
    computed = {("angle_x", "velocity_y"): form, ("angle_y", "velocity_x"): turned}
    return Assessment(assessment.kernel, "m/s^2", False, computed, response.true_forms("S2", endless=True))


#: For each quantity the fast loop, and the vector of a slow cycle with one sample, of an algorithm in two speeds.
_LOOPS = {
    "drift": ("coning-fast", ("rotation-vector", "coning-compressed", 1)),
    "sculling": ("sculling-fast-2", ("sculling", "coning-compressed", 1)),
}


def two_speed(quantity: str = "drift") -> Assessment:
    """Assess a whole algorithm in two speeds, the fast loop together with the slow loop.

    The slow loop treats the sum of the increments as the one sample of its cycle, and adds the second-order sums of the
    fast loop to the result. The navigation frame does not rotate.

    >>> two_speed().text("computed")
    '-pi*f*theta_x*theta_y*sin(phi)*(2*sin(2*pi*T_l*f)/(3*pi*T_l*f) - sin(4*pi*T_l*f)/(12*pi*T_l*f))'
    """
    return _two_speed(checks.choice("quantity", quantity, tuple(_LOOPS)))


@lru_cache
def _two_speed(quantity: str) -> Assessment:
    fast, slow = _LOOPS[quantity]
    parts = [of(catalogue.choose(fast), quantity), of(catalogue.choose(*slow), quantity)]
    none = Form(sp.S.Zero, sp.S.Zero)
    computed = {}
    for pair in {**parts[0].computed, **parts[1].computed}:
        forms = [part.computed.get(pair, none) for part in parts]
        real, imaginary = (sp.Add(*(form[k].subs(T, T_M) for form in forms)) for k in range(2))
        computed[pair] = Form(real, imaginary)
    return Assessment("two-speed", parts[0].unit, True, computed, parts[1].continuous)


def quantities(choice: Choice) -> tuple[str, ...]:
    """Return which of "drift" and "sculling" can be assessed for a kernel of the catalogue; at least one can.

    >>> [quantities(catalogue.choose(name)) for name in ("euler", "sculling", "two-speed-fast-2")]
    [('drift', 'sculling'), ('sculling',), ('drift', 'sculling')]
    """
    assessable = []
    reason = None
    for quantity in ("drift", "sculling"):
        try:
            of(choice, quantity)
        except InputError as error:
            reason = reason or error
        else:
            assessable.append(quantity)
    if not assessable and reason is not None:
        raise reason
    return tuple(assessable)


def of(choice: AnyAlgorithm, quantity: str = "drift") -> Assessment:
    """Assess a kernel of the catalogue.

    Parameters
    ----------
    choice : Choice, AttitudeAlgorithm or str
        A kernel, as `strapgen.choose` or `strapgen.algorithm` returns one, or its name.
    quantity : str, optional
        "drift" or "sculling".

    Returns
    -------
    Assessment

    Raises
    ------
    InputTypeError
        If `choice` is none of these.
    InputError
        As for `drift` and `sculling`.

    Examples
    --------
    >>> assessment = of(catalogue.choose("dcm", "rk4", 2))
    >>> rates = assessment.rates(10, 0.02, theta_x=0.01, theta_y=0.01, phase=1)
    >>> [float(f"{rate:.6g}") for rate in rates]
    [-0.00264356, -0.00263046, 1.31029e-05]
    """
    choice = catalogue.choose(choice)
    checks.choice("quantity", quantity, ("drift", "sculling"))
    if choice.user_kernel is not None:  # whose file may change: not to be held for good
        return _of(choice, quantity)
    return _of_catalogue(choice, quantity)


def _of(choice: Choice, quantity: str) -> Assessment:
    kernel = pipeline.derive(choice)
    if quantity == "sculling" and kernel.attitude_step is not None:
        return _dual(of(choice))
    assess = {"drift": drift, "sculling": sculling}[quantity]
    return assess(kernel, nodes=catalogue.nodes(choice), previous=choice.previous, ahead=choice.ahead)


_of_catalogue = lru_cache(maxsize=64)(_of)


#: A response: itself or in words; a gyro of second order of before as its natural frequency in Hz and damping.
AnyResponse = Response | str | tuple[float | str | Fraction, float | str | Fraction]


@renamed_parameters(bandwidth_hz="response")
def through_gyro(
    assessment: Assessment,
    response: AnyResponse | float | Fraction,
    damping: float | str | Fraction | None = None,
) -> Assessment:
    """Return the assessment of an algorithm that sees angles through a gyro.

    With the gyro's response G a product of two angles has the factor ``|G|^2``, one of an angle and a velocity the
    factor G; the true rate stays what it is.

    Parameters
    ----------
    assessment : Assessment
        Of a step, of the vector of one, or of an algorithm in two speeds.
    response : Response or str
        A response, or its words: "second-order:80:0.7" has the natural frequency w/(2 pi) in Hz and the damping. One
        of taps, decimation or instants has its sampling frequency.
    damping : number, optional
        Old: of a gyro of second order, whose natural frequency in Hz is in place of its response.

    Returns
    -------
    Assessment

    Raises
    ------
    InputError
        If a number is not above 0, or the kernel is a fast loop alone, whose rates leave out a term of the slow loop.

    Examples
    --------
    >>> from strapgen import choose
    >>> from strapgen.analysis.vibration import of
    >>> seen = through_gyro(of(choose("euler", "coning-compressed", 4)), "second-order:40:0.7071")
    >>> [float(f"{rate:.4g}") for rate in seen.rates(10, 0.04, theta_x=0.01, theta_y=0.01, phase=1)]
    [-0.002644, -0.002633, 1.037e-05]
    """
    gyro: Any = response if damping is None else (response, damping)
    return through_gyros(assessment, gyro, gyro)


def through_gyros(assessment: Assessment, x: AnyResponse, y: AnyResponse) -> Assessment:
    """Return the assessment of an algorithm that sees the angles about x and y through gyros of their own.

    Gyros of unequal phase show a coning that is not there: pseudo-coning.

    Parameters
    ----------
    assessment : Assessment
        As for `through_gyro`.
    x, y : Response or str
        The response of the gyro of each axis.

    Returns
    -------
    Assessment

    Raises
    ------
    InputError
        As `through_gyro` does.

    Examples
    --------
    Angles in phase are no coning, and equal gyros leave them in phase:

    >>> from strapgen import choose
    >>> from strapgen.analysis.vibration import of
    >>> plain, wave = of(choose("euler", "coning-compressed", 4)), {"theta_x": 0.01, "theta_y": 0.01}
    >>> slow, fast = "second-order:60:0.7", "second-order:80:0.7"
    >>> through_gyros(plain, fast, fast).rates(20, 0.004, **wave).computed
    0.0
    >>> round(through_gyros(plain, fast, slow).rates(20, 0.004, **wave).computed, 8)
    0.00078679
    """
    if assessment.recursion and assessment.kernel != "two-speed":
        raise InputError(
            f"{assessment.kernel} is a fast loop; its rates through a gyro are those of two-speed, both loops together"
        )
    responses = dict(zip(ANGLES, map(_response, (x, y)), strict=True))

    def seen(pair: Pair, form: Form) -> Form:
        # The factor is G of the first channel times the conjugate of that of the second; velocities stay as they are.
        first, second = (responses.get(channel) for channel in pair)
        if first is None:  # of an angle and a velocity, the angle is the first
            return form
        real, imaginary = _factor(first, second)
        return Form(
            _times(form.real, real) - _times(form.imaginary, imaginary),
            _times(form.real, imaginary) + _times(form.imaginary, real),
        )

    return replace(
        assessment, computed={pair: seen(pair, form) for pair, form in assessment.computed.items()}
    )


def _response(gyro: AnyResponse) -> Response:
    """Return the response of what stands for one."""
    if isinstance(gyro, tuple):
        warn("bandwidth_hz and damping", "a response, as second-order:HZ:DAMPING")
        frequency, damping = (
            checks.number(what, value, positive=True)
            for what, value in zip(("gyro-bandwidth-hz", "gyro-damping"), gyro, strict=True)
        )
        return Response(frequency_hz=frequency, damping=damping)
    return gyro if isinstance(gyro, Response) else parse("response", gyro)


@lru_cache
def _factor(first: Response, second: Response | None) -> tuple[sp.Expr, sp.Expr]:
    """Return the real and imaginary part of G of an angle, or of it times the conjugate of that of another one.

    They are functions of the frequency with a value, which a response of a table has as well, but no formula.
    """

    def gain(hertz: Any) -> Any:
        context = mpmath.mp if isinstance(hertz, mpmath.mpf) else None
        own = first.gain(hertz, context)
        other = own if second == first else 1 if second is None else second.gain(hertz, context)
        return own * other.conjugate()

    def part(name: str, real: bool) -> sp.Expr:
        function = sp.Function(name, real=True)
        return implemented_function(function, lambda f: gain(f).real if real else gain(f).imag)(F)

    if second == first:
        return part("G_squared", True), sp.S.Zero
    return part("G_real", True), part("G_imaginary", False)


def _times(total: sp.Expr, factor: sp.Expr) -> sp.Expr:
    return sp.Add(*(factor * term for term in sp.Add.make_args(total)))
