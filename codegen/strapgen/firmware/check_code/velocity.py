"""Runs a user's velocity and position beside true ones, and looks at what they make of a single push while it turns.

A push is the velocity increment of a sample. To second order the velocity change of a call in body axes is the sum of
the pushes and of cross products d_i x v_j of increments and pushes. Their mean is the rotation of the increment, 1/2;
what is odd under exchange of the two samples is sculling, and has the coefficients of coning. All motions have a run
without motion beside them, whose velocity and position are subtracted: what is left is due to the force.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from strapgen import catalogue
from strapgen.analysis.vibration import assessment
from strapgen.catalogue.methods.coning_coefficients import Design
from strapgen.firmware.check_code import ladder
from strapgen.firmware.check_code.foreign import ForeignStep, Segment, SegmentRun, rotations
from strapgen.firmware.check_code.foreign_arguments import POSITION, VELOCITY
from strapgen.firmware.check_code.probes import (
    AXES,
    BEFORE,
    LATE,
    Products,
    Table,
    about_axes,
    pairs,
    small_turn,
)
from strapgen.lab.convergence import MOST_ERROR, Convergence, fitted
from strapgen.lab.motions.motions import Motion, motion
from strapgen.lab.motions.specific_forces import SpecificForce, force
from strapgen.navigation.translations import Translation, translate
from strapgen.run.backends import backend, evaluator

Array = NDArray[np.float64]
#: Specific force of a push in m/s^2, over the samples of a call.
_FORCE = 50.0
#: Rotation in rad that leads to another attitude, and fewest calls of it.
_APPROACH, _APPROACH_CALLS = (0.5, -1.1, 0.6), 10
#: Angle in rad of a call whose terms of third order are seen.
_LARGE = 0.2
#: Calls that push, and calls after them in which a velocity turns with the frame.
_PUSHES, _COASTS = 20, 1000
_NO_TURN = np.eye(3)
#: The sculling motion: amplitude of the angle in rad and of the specific force in m/s^2, in phase.
SWING, SHAKE = ladder.HALF_ANGLE, 10.0


@dataclass(frozen=True)
class Pushed:
    """What a function makes of a push."""

    #: (3, 3): velocity of pushes along x, y, z in the axes before the segment, after the call and two calls later, in
    #: units of the push, a column for each; and the true one
    at_once: Array
    later: Array
    true: Array
    #: Part of the call over which the velocity has gained the push, as the position shows; 1/2 is right. None without
    position_weight: float | None = None
    #: Advance of the position in a later call, in units of the velocity times the duration of the call
    advance: float | None = None


@dataclass(frozen=True)
class TurnedPush:
    """Coefficients of cross products of increments and pushes."""

    #: The part that is odd under exchange: the sculling correction beside half of all products
    sculling: Products
    #: Of an older sample i and a newer j the coefficients of d_i x v_j and of v_i x d_j, as those of sculling
    sides: tuple[Table, Table]
    #: Mean of the even part over all products, and over those of one sample; 1/2 is right
    mean: float
    of_one_sample: float
    #: Coefficient of d x (d x v) in a call at a constant rate, 1/6 if it is exact
    third: float


class Velocity:
    """The velocity and the position of a function along all segments."""

    def __init__(self, step: ForeignStep) -> None:
        self.step = step
        self.count = step.samples
        self.segments = dict(self._segments())
        self._runs: Mapping[str, Sequence[SegmentRun]] = {}
        #: (3,): rotation vector of the frame in a call, reference axes, and how often the velocity turns with it
        self._frame, self.turns = np.zeros(3), 0.0

    @property
    def duration(self) -> float:
        """Duration of a call in s."""
        return float(self.step.interval * self.count)

    @property
    def push(self) -> float:
        """Velocity increment of a push in m/s."""
        return _FORCE * float(self.step.interval)

    @cached_property
    def free(self) -> SegmentRun:
        """The run without rotation and force."""
        return self._runs["free"][0]

    # Segments

    def _segments(self) -> Iterator[tuple[str, list[Segment]]]:
        """Yield the segments of all measurements under their names."""
        step, count = self.step, self.count
        several = {
            "pushes": self._pushes(),
            "turned pushes": self._products(),
            "third": self._third(),
            "coasts": self._coasts() if VELOCITY in step.source.arguments.meanings else [],
            "velocity order": [
                self._along(self._general, _general_force(), length, calls)
                for length, calls in ladder.rungs(step)
            ],
            "sculling": [
                Segment(one.increments @ turn.T, velocities=one.velocities @ turn.T)
                for one in [self._along(_swing(), _shake(), ladder.SAMPLING * count, ladder.SAMPLES // count)]
                for turn in ladder.CONES.values()
            ],
        }
        longest = max(len(one.increments) for part in several.values() for one in part)
        yield "free", [Segment(np.zeros((longest, count, 3)))]
        yield from several.items()

    @property
    def _general(self) -> Motion:
        return ladder.general_motion()

    def _pushes(self) -> list[Segment]:
        """Return pushes about three axes at another attitude, with two calls after them."""
        turning = self.step.calls_for(float(np.linalg.norm(_APPROACH)), _APPROACH_CALLS)
        calls = turning + self.step.settling + 1 + LATE
        increments = np.zeros((calls, self.count, 3))
        increments[:turning] = np.array(_APPROACH) / (turning * self.count)
        velocities = np.zeros((3, calls, self.count, 3))
        velocities[:, -1 - LATE] = self.push / self.count * np.eye(3)[:, None]
        return [Segment(increments, velocities=each) for each in velocities]

    def _products(self) -> list[Segment]:
        """Return probes with one increment, of either sign, and one push."""
        count, small = self.count, small_turn(self.step)
        before = -(-BEFORE // count)
        segments = []
        for (turned, pushed), axes, sign in product(_both_ways(count), AXES, (1, -1)):
            increments, velocities = np.zeros((2, (before + 1 + LATE) * count, 3))
            increments[before * count + turned, axes[0]] = sign * small
            velocities[before * count + pushed, axes[1]] = self.push
            segments.append(
                Segment(increments.reshape(-1, count, 3), velocities=velocities.reshape(-1, count, 3))
            )
        return segments

    def _third(self) -> list[Segment]:
        """Return calls with a large rotation about x, of either sign, and a push along y."""
        increments, velocities = np.zeros((2, 1, self.count, 3))
        increments[..., 0] = self._large / self.count
        velocities[..., 1] = self.push / self.count
        return [Segment(sign * increments, velocities=velocities) for sign in (1, -1)]

    @property
    def _large(self) -> float:
        return min(_LARGE, self.count * self.step.most)

    def _coasts(self) -> list[Segment]:
        """Return pushes about three axes, and many calls after them."""
        velocities = np.zeros((3, _PUSHES + _COASTS, self.count, 3))
        velocities[:, :_PUSHES] = self.push / self.count * np.eye(3)[:, None, None]
        return [Segment(np.zeros(velocities.shape[1:]), velocities=each) for each in velocities]

    def _along(self, profile: Motion, pushes: SpecificForce, length: Fraction, calls: int) -> Segment:
        """Return the samples of a motion with a specific force, those of calls before it included."""
        count = self.step.settling + calls
        row = pushes.velocity_increments(profile, length / self.count, 0, count * self.count)
        increments = ladder.along(self.step, profile, length, calls).increments
        return Segment(increments, velocities=row.reshape(count, self.count, 3))

    # Readings

    def read(self, runs: Mapping[str, Sequence[SegmentRun]], frame: Array) -> None:
        """Take the runs of all segments, whose attitudes are those in a resting frame."""
        self._runs, self._frame = runs, frame
        if coasts := runs["coasts"]:
            self.turns = self._turns(coasts)

    def _velocity(self, run: SegmentRun, attitudes: Array) -> Array:
        """Return the velocity due to the force, (1 + N, 3), in the body axes before the segment.

        `attitudes` (1 + N, 3, 3): true ones relative to the first, for a function that computes none of its own.
        """
        if VELOCITY not in run.translations:
            changes = run.translations[self.step.source.arguments.meanings[0]][1:]
            gained = np.einsum("nij,nj->ni", attitudes[:-1], changes)
            return np.concatenate([np.zeros((1, 3)), gained.cumsum(axis=0)])
        turned: Array = self._in_resting_axes(run) @ run.start
        return turned

    def _position(self, run: SegmentRun) -> Array:
        """Return the position due to the force, (1 + N, 3), in the body axes before the segment."""
        place = self._due_to_force(run, POSITION)
        if self._frame.any():
            more = (self._in_resting_axes(run) - self._due_to_force(run, VELOCITY)) * self.duration
            place[1:] += np.cumsum((more[1:] + more[:-1]) / 2, axis=0)
        turned: Array = place @ run.start
        return turned

    def _in_resting_axes(self, run: SegmentRun) -> Array:
        """Return the velocity due to the force, (1 + N, 3), against inertial space, in axes that rest."""
        velocity = self._due_to_force(run, VELOCITY)
        if not self._frame.any():
            return velocity
        back = rotations(-np.arange(len(velocity))[:, None] * self._frame)
        places = np.cumsum((velocity[1:] + velocity[:-1]) / 2, axis=0)
        velocity[1:] += (round(self.turns) - 1) * np.cross(-self._frame, places)
        turned: Array = np.einsum("nij,nj->ni", back, velocity)
        return turned

    def _due_to_force(self, run: SegmentRun, what: str) -> Array:
        whole = run.translations[what]
        moved: Array = whole - self.free.translations[what][: len(whole)]
        moved -= moved[0]
        return moved

    def rounding_of_drift(self) -> float:
        """Return what rounding may add to the drift on the sculling motion, in m/s^2."""
        run = self._runs["sculling"][0]
        largest = max(
            float(np.abs(vectors).max()) for name, vectors in run.translations.items() if name != POSITION
        )
        return 4 * self.step.unit * largest * len(run.states) / float(ladder.seconds(self.count))

    def acceleration(self) -> Array:
        """Return the acceleration without force in m/s^2, (3,), reference axes."""
        if VELOCITY not in self.free.translations:
            return np.zeros(3)
        gained: Array = self.free.translations[VELOCITY][_PUSHES] - self.free.translations[VELOCITY][0]
        return gained / (_PUSHES * self.duration)

    def acceleration_strays(self) -> float:
        """Return by how much the velocity before a push depends on the attitude, in units of its change at rest."""
        if VELOCITY not in self.free.translations:
            return 0.0
        run = self._runs["pushes"][0]
        moved = self._due_to_force(run, VELOCITY)[-2 - LATE]
        whole = self.free.translations[VELOCITY]
        size = float(np.linalg.norm(whole[len(run.states) - 1 - LATE] - whole[0]))
        return float(np.linalg.norm(moved)) / size if size else 0.0

    def pushed(self) -> Pushed:
        """Return what a function makes of a push at another attitude."""
        runs, segments = self._runs["pushes"], self.segments["pushes"]
        attitudes = _turned(segments[0].increments)
        several = [self._velocity(run, attitudes) for run in runs]
        own = attitudes if VELOCITY not in runs[0].translations else runs[0].relative
        first = len(attitudes) - 2 - LATE
        at_once, later = (
            np.array([v[first + late] - v[first] for v in several]).T / self.push for late in (1, 1 + LATE)
        )
        if POSITION not in runs[0].translations:
            return Pushed(at_once, later, own[first])
        moved = [np.diff(self._position(run), axis=0)[first:] / (self.push * self.duration) for run in runs]
        gain = float((at_once**2).sum()) or 1.0
        weight, advance = (
            float(sum(each[k] @ at_once[:, axis] for axis, each in enumerate(moved))) / gain for k in (0, 1)
        )
        return Pushed(at_once, later, own[first], weight, advance)

    def turned_push(self) -> TurnedPush:
        """Return the coefficients of the products of increments and pushes."""
        count, small = self.count, small_turn(self.step)
        known, segments = _both_ways(count), self.segments["turned pushes"]
        attitudes = _turned(np.array([each.increments for each in segments]))
        changes = np.array(
            [
                self._velocity(run, each)
                for run, each in zip(self._runs["turned pushes"], attitudes, strict=True)
            ]
        ).reshape(len(known), len(AXES), 2, -1, 3)
        odd = (changes[:, :, 0] - changes[:, :, 1]) / (2 * small * self.push)
        tables = [
            dict(zip(known, about_axes(odd[:, :, call]), strict=True))
            for call in (-(-BEFORE // count) + 1, -1)
        ]
        sides: tuple[Table, Table] = ({}, {})
        for older, newer in pairs(count):
            even = 1.0 if older < 0 else 0.5  # of an earlier call, its attitude turns the push
            sides[0][older, newer] = float(tables[1][older, newer].mean()) - even
            sides[1][older, newer] = even - (older < 0) - float(tables[1][newer, older].mean())
        now, end = (
            {
                (older, newer): (table[older, newer] - (older < 0) - table[newer, older]) / 2
                for older, newer in pairs(count)
            }
            for table in tables
        )
        sums = sum(c.mean() - (turned < 0) for (turned, _), c in tables[1].items())
        single = np.mean([tables[1][k, k].mean() for k in range(count)])
        noise = 4 * self.step.unit * (1 + self._speed / self.push) / small + small**2
        sculling = Products(
            count,
            {pair: float(c.mean()) for pair, c in now.items()},
            {pair: float(c.mean()) for pair, c in end.items()},
            by_axis=tuple({pair: float(c[axis]) for pair, c in end.items()} for axis in range(3)),
            noise=noise,
        )
        return TurnedPush(sculling, sides, float(sums) / count**2, float(single), self._third_order())

    @property
    def _speed(self) -> float:
        """Largest velocity in m/s at rest in as many calls as a probe has, which sets the rounding."""
        calls = -(-BEFORE // self.count) + 1 + LATE
        return float(np.linalg.norm(self.acceleration())) * self.duration * (calls + self.step.settling)

    def _third_order(self) -> float:
        angle = self._large
        along = [
            self._velocity(run, _turned(segment.increments))[1, 1] / self.push
            for run, segment in zip(self._runs["third"], self.segments["third"], strict=True)
        ]
        return float(1 - np.mean(along)) / angle**2

    def _turns(self, coasts: Sequence[SegmentRun]) -> float:
        """Return how often a velocity turns with the frame: 1 against inertial space, 2 against the frame."""
        size, seen = 0.0, 0.0
        rate = self.step.frame if self.step.frame.any() else -self._frame / self.duration
        for run in coasts:
            velocity = self._due_to_force(run, VELOCITY)[_PUSHES:]
            across = -np.cross(rate, velocity[0]) * self.duration * (len(velocity) - 1)
            size += float(across @ across)
            seen += float(across @ (velocity[-1] - velocity[0]))
        return seen / size if size else 0.0

    # Motions

    def _errors(
        self,
        run: SegmentRun,
        profile: Motion,
        pushes: SpecificForce,
        length: Fraction,
        turn: Array = _NO_TURN,
    ) -> tuple[Array, Array | None]:
        """Return the errors of velocity in m/s and of position in m after every call, in the axes of the motion.

        `turn`: what turns vectors of the motion to those that the function has got.
        """
        first, calls = self.step.settling, len(run.states)
        true = profile.attitude(np.arange(calls + 1) * float(length))
        relative = true[0].T @ true
        own = turn.T @ run.relative @ turn if VELOCITY in run.translations else relative
        back = true[first] @ own[first].T
        velocities, places = pushes.translation(profile, length / self.count, calls * self.count)
        velocities, places = velocities[:: self.count], places[:: self.count]
        velocity = self._velocity(run, turn @ relative @ turn.T) @ turn
        errors = (velocity[first:] - velocity[first]) @ back.T - (velocities[first:] - velocities[first])
        if POSITION not in run.translations:
            return errors, None
        place, after = self._position(run) @ turn, np.arange(calls + 1 - first)[:, None]
        told = (place[first:] - place[first]) / self.duration - velocity[first] * after
        wanted = places[first:] - places[first] - velocities[first] * after * float(length)
        return errors, told @ back.T * float(length) - wanted

    def orders(self) -> tuple[Convergence, Convergence | None, tuple[float, ...]]:
        """Return the errors of velocity and position on the ladder, and the largest ones at the longest step."""
        several = [
            [
                None if part is None else float(np.linalg.norm(part, axis=1).max())
                for part in self._errors(run, self._general, _general_force(), length)
            ]
            for run, (length, _) in zip(self._runs["velocity order"], ladder.rungs(self.step), strict=True)
        ]
        fits = [self._fitted(number, [each[number] for each in several]) for number in range(2)]
        assert fits[0] is not None
        return fits[0], fits[1], tuple(error for error in several[0] if error is not None)

    def _fitted(self, number: int, errors: Sequence[float | None]) -> Convergence | None:
        """Return the fit to errors of velocity (0) or of position (1)."""
        name, rungs = self.step.source.function, []
        for run, error, (length, calls) in zip(
            self._runs["velocity order"], errors, ladder.rungs(self.step), strict=True
        ):
            if error is None:
                return None
            total = float(length * calls) ** number
            whole = np.abs(run.translations.get(VELOCITY, np.ones(1)))
            floor = 8 * self.step.unit * (calls + self.step.settling) * (1 + float(whole.max())) * total
            size = _FORCE * float(length * calls) * total
            rungs.append((float(length), error, floor < error < MOST_ERROR * size))
        return fitted(name, self.step.source.precision, None, rungs)

    def generated(self, standard: Design) -> Translation:
        """Return the run of a generated step on the samples of the ladder's longest step."""
        length, calls = ladder.rungs(self.step)[0]
        between = length / self.count * standard.increments
        return _generated(
            standard, self._general, _general_force(), between, length * calls // between * between
        )

    def drifts(self) -> dict[str, Array]:
        """Return the mean errors of the acceleration in m/s^2 on the sculling motion, by the axis of each run."""
        length, seconds = ladder.SAMPLING * self.count, float(ladder.seconds(self.count))
        return {
            axis: turn @ self._errors(run, _swing(), _shake(), length, turn)[0][-1] / seconds
            for (axis, turn), run in zip(ladder.CONES.items(), self._runs["sculling"], strict=True)
        }


def _turned(increments: Array) -> Array:
    """Return the attitudes before and after exact rotations by samples (..., N, K, 3), as (..., 1 + N, 3, 3)."""
    attitudes = [np.broadcast_to(np.eye(3), (*increments.shape[:-3], 3, 3))]
    for call in range(increments.shape[-3]):
        after = attitudes[-1]
        for sample in range(increments.shape[-2]):
            after = after @ rotations(increments[..., call, sample, :])
        attitudes.append(after)
    return np.stack(attitudes, axis=-3)


def _both_ways(samples: int) -> list[tuple[int, int]]:
    """Return the pairs of an increment and a push whose products are looked at."""
    known = pairs(samples)
    return [*((k, k) for k in range(samples)), *known, *((newer, older) for older, newer in known)]


def _general_force() -> SpecificForce:
    swings = {"swing_x_m_s2": 4, "swing_y_m_s2": -3, "swing_z_m_s2": 2}
    return force("oscillation", **swings, frequency_hz="0.4", phase_deg=40, x_m_s2=1, y_m_s2=2, z_m_s2=9)


def _swing() -> Motion:
    return motion("sinusoidal", a_rad_s=SWING * ladder.FREQUENCY, b_rad_s=ladder.FREQUENCY)


def _shake() -> SpecificForce:
    frequency = ladder.FREQUENCY / (2 * math.pi)
    return force("oscillation", swing_z_m_s2=SHAKE, frequency_hz=frequency, phase_deg=-90)


def _choice(standard: Design) -> catalogue.Choice:
    """Return velocity and position by a published correction."""
    return catalogue.choose(
        "velocity-position", "coning-compressed", standard.increments, previous=standard.previous
    )


def _generated(
    standard: Design, profile: Motion, pushes: SpecificForce, step: Fraction, duration: Fraction
) -> Translation:
    """Return the run of a generated step of a published correction, without gravity."""
    attitude = backend(ladder.published_step("coning-compressed", standard))
    return translate(attitude, evaluator(_choice(standard)), profile, pushes, step, duration, (0.0, 0.0, 0.0))


def generated_drift_m_s2(standard: Design) -> float:
    """Return the error of the acceleration of the generated step on the sculling motion, in m/s^2."""
    length, duration = ladder.SAMPLING * standard.increments, ladder.seconds(standard.increments)
    run = _generated(standard, _swing(), _shake(), length, duration)
    return float(np.linalg.norm(run.velocity[-1] - run.true_velocity[-1])) / float(duration)


def closed_form_m_s2(standard: Design) -> float:
    """Return the error of the acceleration that a published correction leaves on the sculling motion, in m/s^2.

    >>> from strapgen.catalogue.methods.coning_coefficients import design
    >>> round(closed_form_m_s2(design(2)) * 1e3, 4), round(closed_form_m_s2(design(1)) * 1e3, 4)
    (-0.4325, -5.6296)
    """
    rates = assessment.of(_choice(standard), "sculling").rates(
        ladder.FREQUENCY / (2 * math.pi),
        ladder.SAMPLING * standard.increments,
        theta_x=SWING,
        acceleration_y=SHAKE,
        phase=0,
    )
    return rates.error
