"""The findings on the velocity and the position of a user's function, and the likely causes of those that fail."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.catalogue.methods.coning_coefficients import Design
from strapgen.firmware.check_code import coning_causes, ladder
from strapgen.firmware.check_code.conformance import ORDER_WITHIN, Finding
from strapgen.firmware.check_code.coning_causes import MeasuredCoefficient
from strapgen.firmware.check_code.foreign import Segment, SegmentRun
from strapgen.firmware.check_code.foreign_arguments import VELOCITY
from strapgen.firmware.check_code.probes import DIRECTION_WITHIN, SIZE_WITHIN
from strapgen.firmware.check_code.velocity import (
    Pushed,
    TurnedPush,
    Velocity,
    closed_form_m_s2,
    generated_drift_m_s2,
)
from strapgen.lab.convergence import Convergence

Array = NDArray[np.float64]
#: Order of velocity and position to second order in the samples, which the published forms have at least.
_LEAST_ORDER = 2
#: Largest difference of a mean coefficient from 1/2, and of one of third order that tells causes apart.
_MEAN_WITHIN, _THIRD_WITHIN = 0.005, 0.02
#: Largest difference of how often a velocity turns with the frame from a whole number.
_TURNS_WITHIN = 0.1

END = "the force is turned by the attitude of the end of the step"
START = "rotation of the increment absent: the force is turned by the attitude of the start of the step"
TWICE = "rotation of the increment counted twice"
OPPOSITE = "rotation of the increment of the wrong sign"
NO_FAULT = "the coefficients of d_i x v_j are those of no single fault that is known"
AT_THE_END = "the position advances by the velocity of the end of the step, not by the mean"
AT_THE_START = "the position advances by the velocity of the start of the step, not by the mean"
GRAVITY_SIGN = "gravity of the wrong sign"
GRAVITY_ABSENT = "gravity is not added"
GRAVITY_TIME = "gravity is not multiplied by the duration of a call"
TURNS_BACK = "the velocity turns against the frame: the Coriolis acceleration has the wrong sign"
TURNS_NOT = "the velocity does not turn with the frame: the Coriolis acceleration is absent"


@dataclass(frozen=True)
class MeasuredTranslation:
    """What is measured of velocity and position; None where nothing is computed or could be measured."""

    #: Those of the products d_i x v_j less v_i x d_j of increments and velocity increments, as `coefficients`
    sculling_coefficients: tuple[MeasuredCoefficient, ...] | None = None
    #: What they correct of sculling to leading order, 1 if they are right
    sculling_ratio: float | None = None
    #: The coefficient of d x v in a call, by that of the rotation of the increment, 1/2
    increment_rotation: float | None = None
    #: Error of the acceleration on the sculling motion
    velocity_drift_m_s2: float | None = None
    #: The one that a published correction on the same samples leaves, in closed form
    velocity_closed_form_m_s2: float | None = None
    #: Observed orders
    velocity_order: float | None = None
    position_order: float | None = None
    #: Largest errors on the ladder's longest step, and those of a generated step on the same samples
    velocity_error_m_s: float | None = None
    generated_velocity_error_m_s: float | None = None
    position_error_m: float | None = None
    generated_position_error_m: float | None = None
    #: Acceleration without force along x, y and z of the reference axes
    gravity_m_s2: tuple[float, ...] | None = None


class VelocityFindings:
    """The findings on the velocity of a function, their causes, and what is measured."""

    def __init__(self, velocity: Velocity) -> None:
        self.velocity = velocity
        self.step = velocity.step
        self.causes: list[str] = []
        #: How sure the cause of wrong coefficients is, and what explains them next best
        self.sure: dict[str, float | str] = {}
        self._known: dict[str, Any] = {}
        #: (3,): rotation vector by which a call turns the attitude of a resting body, reference axes
        self.frame: Array = np.zeros(3)
        #: Whether it is another than what is declared: then no motion is compared
        self.frame_strays = False

    @property
    def measured(self) -> MeasuredTranslation:
        """What is measured by now."""
        return MeasuredTranslation(**self._known)

    def segments(self) -> list[tuple[str, list[Segment]]]:
        """Return all segments of the measurements under their names."""
        return [*self.velocity.segments.items()]

    def findings(self, runs: Mapping[str, Sequence[SegmentRun]]) -> Iterator[Finding]:
        """Yield the findings, up to a fault that hides the others; attitudes are those in a resting frame."""
        self.velocity.read(runs, self.frame)
        if VELOCITY in self.step.source.arguments.meanings:
            yield self._gravity()
            if self.velocity.acceleration_strays() > SIZE_WITHIN:
                return
        pushed = self.velocity.pushed()
        force = self._force(pushed)
        yield force
        strays = self.frame_strays
        if (self.step.frame.any() or self.frame.any()) and VELOCITY in self.step.source.arguments.meanings:
            coriolis = self._coriolis()
            yield coriolis
            strays |= coriolis.holds is False
        if force.holds:
            if pushed.position_weight is not None and pushed.advance is not None:
                yield self._position(pushed.position_weight, pushed.advance)
            turned = self.velocity.turned_push()
            yield self._increment_rotation(turned)
            yield self._sculling(turned)
            if not strays:
                yield from self._motions(coning_causes.standard_design(turned.sculling))

    def _failed(self, name: str, text: str, measured: float | None = None) -> Finding:
        """Return a finding whose text is its own cause."""
        self.causes.append(text)
        return Finding(name, False, text, measured)

    def _gravity(self) -> Finding:
        """Return the finding on the acceleration without force."""
        seen, wanted = self.velocity.acceleration(), self.step.acceleration
        self._known["gravity_m_s2"] = tuple(map(float, seen))
        size, off = float(np.linalg.norm(wanted)), float(np.linalg.norm(seen - wanted))
        allowed = SIZE_WITHIN * size / 10 + self.step.unit * 1e3
        text = f"without force the velocity changes by {_vector(seen)} m/s^2"
        if (strays := self.velocity.acceleration_strays()) > SIZE_WITHIN:
            return self._failed("gravity", f"{text}, and by another vector when the body has turned", strays)
        if off <= allowed:
            return Finding("gravity", True, text, off, allowed)
        if not size:
            return self._failed("gravity", f"{text}: --gravity-m-s2 {_option(seen)} fits", off)
        known = {-1.0: GRAVITY_SIGN, 0.0: GRAVITY_ABSENT, 1 / self.velocity.duration: GRAVITY_TIME}
        said = [
            words
            for factor, words in known.items()
            if np.linalg.norm(seen - factor * wanted) <= allowed * max(factor, 1)
        ]
        self.causes.append(said[0] if said else f"{text}, not by {_vector(wanted)}")
        return Finding("gravity", False, f"{text}; wanted {_vector(wanted)}", off, allowed)

    def _force(self, pushed: Pushed) -> Finding:
        """Return the finding on a push without rotation, at an attitude that is none of the axes."""
        off = float(np.abs(pushed.at_once - pushed.true).max())
        factor, interval = float((pushed.at_once * pushed.true).sum()) / 3, float(self.step.interval)
        known = {
            "the force acts a call late": pushed.later - pushed.true,
            "the force is turned by the transposed attitude": pushed.at_once - pushed.true.T,
            "the force is turned by no attitude": pushed.at_once - np.eye(3),
        }
        sizes = {
            "the force has the wrong sign": -1.0,
            "velocity increments are multiplied by the sampling interval": interval,
            "forces are not multiplied by the sampling interval": 1 / interval,
        }
        if off < SIZE_WITHIN:
            return Finding("force", True, "a push is added to the velocity, turned to reference axes", off)
        said = [words for words, left in known.items() if np.abs(left).max() < SIZE_WITHIN]
        if np.abs(pushed.at_once - factor * pushed.true).max() > DIRECTION_WITHIN * abs(factor):
            said.append("a push changes the velocity along other axes")
        said += [words for words, value in sizes.items() if abs(factor / value - 1) < SIZE_WITHIN]
        text = f"a push comes out {factor:.4g} times as large as it is fed"
        return self._failed("force", [*said, text][0], off)

    def _coriolis(self) -> Finding:
        """Return the finding on a velocity in a frame that moves."""
        turns = self.velocity.turns
        text = f"the velocity turns {turns:.3g} times with the frame; 1 if it is inertial, 2 if relative to the frame"
        holds = min(abs(turns - 1), abs(turns - 2)) <= _TURNS_WITHIN
        if not holds:
            self.causes.append(
                TURNS_NOT if abs(turns) <= _TURNS_WITHIN else TURNS_BACK if turns < 0 else text
            )
        return Finding("coriolis", holds, text, turns)

    def _position(self, weight: float, advance: float) -> Finding:
        """Return the finding on the velocity by which the position advances."""
        if abs(advance - 1) > SIZE_WITHIN:
            text = f"the position advances by {advance:.4g} times the velocity and the duration of a call"
            return self._failed("position", text, advance)
        text = f"the position advances by the velocity with {weight:.4g} of the change in a call; wanted 0.5"
        holds = abs(weight - 0.5) <= SIZE_WITHIN
        if not holds:
            self.causes.append({1.0: AT_THE_END, 0.0: AT_THE_START}.get(round(weight, 2), text))
        return Finding("position", holds, text, weight, 0.5)

    def _increment_rotation(self, turned: TurnedPush) -> Finding:
        """Return the finding on the part of the velocity that a rotation in the call makes."""
        allowed = _MEAN_WITHIN + turned.sculling.noise
        holds = abs(turned.mean - 0.5) < allowed
        self._known["increment_rotation"] = 2 * turned.mean
        text = f"d x v has the coefficient {turned.mean:.4g} (0.5), d x (d x v) {turned.third:.3g} (0.1667)"
        if not holds and self._one_sided(turned) is None:
            self.causes.append(_cause_of_rotation(turned, self.step.samples))
        return Finding("turned push", holds, text, 2 * turned.mean, allowed)

    def _sculling(self, turned: TurnedPush) -> Finding:
        """Return the finding on the coefficients of sculling."""
        known = turned.sculling
        shown = coning_causes.measured(known)
        self._known["sculling_coefficients"] = shown
        self._known["sculling_ratio"] = ratio = coning_causes.ratio(known)
        one_sided = self._one_sided(turned)
        is_open = any(cause.startswith(NO_FAULT) for cause in self.causes)  # then the odd part says nothing
        said = one_sided or (None if is_open else coning_causes.cause(known))
        if said:
            self.causes.append(
                f"sculling{' ' if said.startswith('correction') else ': '}{said}".replace(
                    "coning", "sculling"
                )
            )
            self.sure = {} if one_sided else coning_causes.sureness(known, said)
        holds = coning_causes.corrects_coning(known)
        text = coning_causes.in_words(known, "sculling")
        return Finding("sculling", holds, text, ratio, coning_causes.tolerance(known))

    def _one_sided(self, turned: TurnedPush) -> str | None:
        """Return the cause where of the products d_i x v_j and v_i x d_j one alone is wrong."""
        known = turned.sculling
        if abs(turned.of_one_sample - 0.5) > _MEAN_WITHIN + known.noise:
            return None
        return coning_causes.one_sided(turned.sides, 2 * known.noise, known.samples)

    def _motions(self, standard: Design) -> Iterator[Finding]:
        """Yield the findings on the orders, and on the drift of the velocity."""
        velocity, position, errors = self.velocity.orders()
        generated = self.velocity.generated(standard)
        beside = generated.velocity_error, generated.position_error
        self._known |= {
            "velocity_order": velocity.observed,
            "velocity_error_m_s": errors[0],
            "generated_velocity_error_m_s": beside[0],
        }
        yield _order("velocity order", velocity, f"{errors[0]:.3g} m/s", f"{beside[0]:.3g}")
        yield self._drift(standard)
        if position is not None:
            self._known |= {
                "position_order": position.observed,
                "position_error_m": errors[1],
                "generated_position_error_m": beside[1],
            }
            yield _order("position order", position, f"{errors[1]:.3g} m", f"{beside[1]:.3g}")

    def _drift(self, standard: Design) -> Finding:
        """Return the finding on the drift of the velocity on the sculling motion."""
        drifts = self.velocity.drifts()
        size = max(float(np.linalg.norm(each)) for each in drifts.values())
        closed, generated = abs(closed_form_m_s2(standard)), generated_drift_m_s2(standard)
        self._known |= {"velocity_drift_m_s2": size, "velocity_closed_form_m_s2": closed}
        least = ladder.DRIFT_WITHIN * max(closed, generated)
        hidden = self.velocity.rounding_of_drift()
        samples = ladder.samples_in_words(standard)
        text = f"{size:.4g} m/s^2; closed form on {samples} {closed:.4g}, generated {generated:.4g}"
        text += f"; limit {least + hidden:.4g}"
        if hidden > least / 100:
            text += f", of which {self.step.rounding} hides {hidden:.2g}"
        return Finding.within("velocity drift", text, size, least + hidden)


def _order(name: str, seen: Convergence, error: str, generated: str) -> Finding:
    """Return the finding on an order."""
    beside = f"at the longest step {error}, generated {generated}"
    if seen.observed is None:
        return Finding(name, None, f"{seen.hidden}; {beside}")
    needed = _LEAST_ORDER - ORDER_WITHIN
    text = f"observed {seen.observed:.3f}; needed {_LEAST_ORDER}; {beside}"
    return Finding(name, seen.observed > needed, text, seen.observed, needed)


def _cause_of_rotation(turned: TurnedPush, samples: int) -> str:
    """Return the cause of a wrong mean of the coefficients of d x v.

    Each sample may be turned on its own: then the products of one sample alone are wrong.
    """
    one_by_one = (
        samples > 1 and abs((turned.mean - 0.5) * samples - (turned.of_one_sample - 0.5)) < _MEAN_WITHIN
    )
    mean = turned.of_one_sample if one_by_one else turned.mean
    third = (samples + 1) * (2 * samples + 1) / (12 * samples**2) if one_by_one else 0.5
    if not one_by_one and abs(turned.of_one_sample - 0.5) < _MEAN_WITHIN:
        return f"{NO_FAULT}: their mean is {turned.mean:.4g}, that of a sample with itself is right"
    if abs(mean - 1) < SIZE_WITHIN:
        return END if abs(turned.third - third) < _THIRD_WITHIN else TWICE
    if abs(mean) < SIZE_WITHIN:
        return START
    if abs(mean + 0.5) < SIZE_WITHIN:
        return OPPOSITE
    return f"rotation of the increment {2 * mean:.3g} times as large as needed"


def _vector(vector: Array) -> str:
    return f"({', '.join(f'{part:.4g}' for part in vector + 0.0)})"


def _option(vector: Array) -> str:
    return ",".join(f"{part:.6g}" for part in np.round(vector, 9) + 0.0)
