"""`check_foreign` holds a user's function in C or C++ to the behaviour of an attitude step, and names what is wrong."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

import numpy as np
from numpy.typing import NDArray

from strapgen import pipeline
from strapgen.catalogue.methods.coning_coefficients import Design
from strapgen.experiments.conformance import ORDER_WITHIN, Finding
from strapgen.experiments.convergence import MOST_ERROR, Convergence, fitted
from strapgen.experiments.foreign import causes
from strapgen.experiments.foreign.cone import (
    SAMPLES,
    SAMPLING,
    closed_form_deg_h,
    cone,
    drift_deg_h,
    generated_drifts,
    published_step,
    seconds,
)
from strapgen.experiments.foreign.probes import (
    Directions,
    Products,
    direction_segments,
    directions,
    product_segments,
    products,
)
from strapgen.experiments.foreign.runs import (
    SCALARS,
    SENSES,
    Convention,
    ForeignSegments,
    ForeignStep,
    Segment,
    SegmentRun,
)
from strapgen.simulation.motions import GENERAL, Motion, motion
from strapgen.simulation.runs import drift_between

Array = NDArray[np.float64]

#: Steps in s of the ladder, by precision: rounding of single precision hides the errors of short ones.
_LADDER = {"double": (8, 16, 32, 64, 128), "float": (1, 2, 4, 8, 16)}
#: Largest difference from the order of theory in single precision, where few steps are left to measure it on.
_ORDER_WITHIN_FLOAT = 0.5
#: How much more than the worse of closed form and published steps a drift may be.
_DRIFT_WITHIN = 1.2
#: Largest difference of an answer to a rotation about an axis, in units of the rotation.
_DIRECTION_WITHIN = 0.1
#: Largest departure of C C' from the unit matrix that is no fault in itself.
_NORM_WITHIN = 1e-4
#: Units in the last place that rounding adds in a call.
_UNITS_A_CALL = 64


@dataclass(frozen=True)
class ForeignOutcome:
    """What the check of a user's function has shown.

    Parameters
    ----------
    file : str
    findings : tuple of Finding
    order : float or None
        Observed order.
    drift_deg_h : float or None
        Magnitude of the drift on the cone in deg/h.
    closed_form_deg_h : float or None
        The one that a published coning correction on the same samples leaves, in closed form.
    cause : str or None
        The likely cause of what fails; None if nothing does, or the cause is not known.
    """

    file: str
    findings: tuple[Finding, ...]
    order: float | None
    drift_deg_h: float | None
    closed_form_deg_h: float | None
    cause: str | None

    @property
    def holds(self) -> bool:
        """Whether the function does all that is required."""
        return all(finding.holds is not False for finding in self.findings)


def check_foreign(step: ForeignStep) -> ForeignOutcome:
    """Check a user's function.

    Parameters
    ----------
    step : ForeignStep

    Returns
    -------
    ForeignOutcome

    Raises
    ------
    InputError
        If a choice does not fit the function.
    """
    return _Check(step).outcome()


class _Check:
    """The checks of one function, and what they measure."""

    def __init__(self, step: ForeignStep) -> None:
        self.step = step
        self.count = step.samples
        self.causes: list[str] = []
        self.order: float | None = None
        self.drift: float | None = None
        self.closed: float | None = None

    def outcome(self) -> ForeignOutcome:
        """Run all checks."""
        findings = tuple(self.findings())
        failed = any(finding.holds is False for finding in findings)
        cause = "; ".join(dict.fromkeys(self.causes)) if failed and self.causes else None
        return ForeignOutcome(
            str(self.step.source.file), findings, self.order, self.drift, self.closed, cause
        )

    def findings(self) -> Iterator[Finding]:
        """Yield what is seen; after a fault that hides all others there is no more."""
        first = self.step.run(direction_segments(self.count))
        calls = self.calls(first)
        if calls.holds is False:
            yield calls
            return
        convention, response = self.convention(directions(first.runs))
        if convention is None:
            yield calls
            yield self.failed("axes", _axes(response.finally_), _off(response))
            return
        everything = self.segments()
        done = self.step.run([segment for _, part in everything for segment in part], convention)
        calls = self.calls(done)
        yield calls
        if calls.holds is False:
            return
        yield from self.axes(convention, response)
        runs, place = {}, 0
        for name, part in everything:
            runs[name] = done.runs[place : place + len(part)]
            place += len(part)
        yield from self.measured(runs)

    def failed(self, name: str, text: str, measured: float | None = None) -> Finding:
        """Return a finding whose text is its own cause."""
        self.causes.append(text)
        return Finding(name, False, text, measured)

    def calls(self, done: ForeignSegments) -> Finding:
        """Return the finding on how calls end, and on what they do to memory."""
        if done.stopped:
            return self.failed("calls", done.stopped)
        if done.writes_beyond:
            return self.failed("calls", "it writes beyond the ends of its arrays")
        if done.changes_inputs:
            return self.failed("calls", "it changes an argument that is no result")
        return Finding("calls", True, "all calls return, and write nothing but the result")

    # Conventions

    def convention(self, declared: Directions) -> tuple[Convention | None, Directions]:
        """Return the convention that fits the function, the declared one first; None if none does."""
        if _fits(declared.finally_):
            return self.step.convention, declared
        scalars = SCALARS if self.step.source.arguments.elements == 4 else SCALARS[:1]
        others = [Convention(scalar, sense) for scalar, sense in product(scalars, SENSES)]
        ours = self.step.convention
        others.sort(key=lambda other: (other.scalar != ours.scalar) + (other.sense != ours.sense))
        for other in others:
            done = self.step.run(direction_segments(self.count), other)
            if not done.stopped:
                response = directions(done.runs)
                if _fits(response.finally_):
                    return other, response
        return None, declared

    def axes(self, known: Convention, response: Directions) -> Iterator[Finding]:
        """Yield the findings on scalar part, sense and axes of a function that follows a known convention."""
        declared = self.step.convention
        if self.step.source.arguments.elements == 4:
            yield self.fits("scalar", declared.scalar, known.scalar, "the scalar part stands")
        yield self.fits("sense", declared.sense, known.sense, "the attitude is")
        if response.order_of_turns < response.other_order:
            text = "rotations about x, y and z are those of the body"
            yield Finding("axes", True, text, _off(response), _DIRECTION_WITHIN)
        else:
            text = "a rotation turns about reference axes, not about body axes: a product in the wrong order"
            yield self.failed("axes", text, response.order_of_turns)

    def fits(self, name: str, ours: str, known: str, what: str) -> Finding:
        """Return the finding on a declared part of the convention."""
        if ours == known:
            return Finding(name, True, f"{what} {ours}")
        option = "--scalar" if name == "scalar" else "--sense"
        return self.failed(name, f"{what} {known}, not {ours}: {option} {known} fits")

    # Measurements

    def segments(self) -> list[tuple[str, list[Segment]]]:
        """Return all segments of the measurements under their names."""
        generator = np.random.default_rng(1969)
        increments = generator.uniform(-0.02, 0.02, (20, self.count, 3))
        return [
            ("runs", [Segment(increments, settled=False), Segment(increments, settled=False)]),
            ("at rest", [Segment(np.zeros((10, self.count, 3)))]),
            ("directions", direction_segments(self.count)),
            ("products", product_segments(self.count)),
            ("symmetry", [Segment(increments), Segment(increments @ _frame().T)]),
            ("order", [self.along(_general(), length, calls) for length, calls in self.ladder()]),
            ("drift", [self.along(cone(), SAMPLING * self.count, SAMPLES // self.count)]),
        ]

    def ladder(self) -> list[tuple[Fraction, int]]:
        """Return step lengths in s, and the number of steps of each."""
        lengths = [Fraction(1, n) for n in _LADDER[self.step.source.precision]]
        return [(length, int(self.duration / length)) for length in lengths]

    @property
    def duration(self) -> int:
        """Duration in s of the runs of the ladder."""
        return 4 if self.step.source.precision == "float" else 1

    def along(self, profile: Motion, length: Fraction, calls: int) -> Segment:
        """Return the increments of a motion, those of calls before it included."""
        increments = profile.increments(length, self.step.settling + calls, self.count)
        return Segment(increments, float(length / self.count))

    def aligned(self, run: SegmentRun, profile: Motion, length: Fraction) -> tuple[Array, Array]:
        """Return computed and true matrices, equal at the end of the calls before the run."""
        first = self.step.settling
        true = profile.attitude(np.arange(first, len(run.relative)) * float(length))
        relative = run.relative[first:]
        return true[0] @ relative[0].T @ relative, true

    def measured(self, runs: dict[str, tuple[SegmentRun, ...]]) -> Iterator[Finding]:
        """Yield what is measured on all segments."""
        states = runs["at rest"][0].states
        moved = float(np.abs(states - states[0]).max())
        allowed = _UNITS_A_CALL * self.step.unit
        text = f"without rotation the state {'stays as it is' if moved <= allowed else 'moves'}"
        yield Finding("at rest", moved <= allowed, text, moved, allowed)
        coefficients = products(runs["products"], self.count)
        standard = causes.standard_design(coefficients)
        yield self.delay(directions(runs["directions"]), coefficients)
        holds = []
        for finding in (self.ordered(runs["order"], standard), self.drifts(runs["drift"][0], standard)):
            holds.append(finding.holds)
            yield finding
        if not all(holds) and (said := causes.cause(coefficients)) is not None:
            self.causes.append(said)
        yield self.symmetry(*runs["symmetry"])
        yield self.norm(runs["drift"][0])
        yield self.repeated(*runs["runs"])

    def delay(self, response: Directions, coefficients: Products) -> Finding:
        """Return the finding on rotations and corrections that a later call adds."""
        if not _fits(response.at_once):
            return self.failed(
                "delay", "rotation one sample late: a later call turns by the samples of a call"
            )
        if causes.comes_late(coefficients):
            self.causes.append(causes.LATE)
            return Finding("delay", False, "a later call corrects the samples of a call")
        return Finding("delay", True, "a call turns by its own samples")

    def ordered(self, runs: tuple[SegmentRun, ...], standard: Design) -> Finding:
        """Measure the order on a ladder of steps."""
        profile, rungs = _general(), []
        for (length, calls), run in zip(self.ladder(), runs, strict=True):
            computed, true = self.aligned(run, profile, length)
            error = float((np.linalg.norm(computed - true, axis=(-2, -1)) / math.sqrt(2)).max())
            floor = 8 * self.step.unit * (calls + self.step.settling)
            rungs.append((float(length), error, floor < error < MOST_ERROR))
        theory = pipeline.derive(published_step("coning-compressed", standard)).order
        ladder: Convergence = fitted(self.step.source.function, self.step.source.precision, theory, rungs)
        self.order, needed = ladder.observed, ladder.predicted
        assert needed is not None
        words = f"a published correction has {needed}"
        if self.order is None:
            too_large = min(error for _, error, _ in rungs) > MOST_ERROR
            return Finding("order", False if too_large else None, f"{ladder.hidden}; {words}")
        within = _ORDER_WITHIN_FLOAT if self.step.source.precision == "float" else ORDER_WITHIN
        return Finding(
            "order",
            self.order > needed - within,
            f"observed {self.order:.3f}; {words}",
            self.order,
            needed - within,
        )

    def drifts(self, run: SegmentRun, standard: Design) -> Finding:
        """Measure the drift on a cone, beside the closed form and generated steps."""
        length, duration = SAMPLING * self.count, seconds(self.count)
        computed, true = self.aligned(run, cone(), length)
        self.drift = drift_deg_h(drift_between(computed, true), duration)
        self.closed = abs(closed_form_deg_h(standard))
        generated = generated_drifts(standard)
        best = min(generated, key=lambda name: generated[name])
        rounding = math.degrees(4 * self.step.unit * float(duration / length)) / float(duration) * 3600
        allowed = _DRIFT_WITHIN * max(self.closed, *generated.values()) + rounding
        text = (
            f"{self.drift:.4g} deg/h; closed form on {_samples(standard)} {self.closed:.4g}, "
            f"{best} {generated[best]:.4g}"
        )
        return Finding("drift", self.drift <= allowed, text, self.drift, allowed)

    def symmetry(self, plain: SegmentRun, turned: SegmentRun) -> Finding:
        """Turn all increments: the attitude must turn with them."""
        frame = _frame()
        off = float(np.abs(turned.relative - frame @ plain.relative @ frame.T).max())
        allowed = _UNITS_A_CALL * self.step.unit * len(plain.relative)
        says = "turns" if off <= allowed else "does not turn"
        text = f"with all increments turned the attitude {says} with them"
        return Finding("symmetry", off <= allowed, text, off, allowed)

    def norm(self, run: SegmentRun) -> Finding:
        """Look at the length of the state along the cone."""
        off = float(np.abs(run.matrices @ np.swapaxes(run.matrices, -1, -2) - np.eye(3)).max())
        allowed = max(_NORM_WITHIN, 4 * self.step.unit * len(run.matrices))
        text = f"on the cone C C' departs from the unit matrix by at most {off:.3g}"
        if off > allowed:
            self.causes.append("norm of the state not kept")
        return Finding("norm", off <= allowed, text, off, allowed)

    def repeated(self, first: SegmentRun, second: SegmentRun) -> Finding:
        """Compare a run with the same run again, after a reset."""
        off = float(np.abs(first.states - second.states).max())
        if off == 0:
            return Finding("runs", True, "a second run gives the same numbers", off, 0.0)
        self.causes.append(causes.STATE_KEPT)
        init = self.step.source.init
        after = f"after {init}" if init else "no --init is named, and"
        return Finding("runs", False, f"{after} a second run differs from the first by {off:.3g}", off, 0.0)


def _general() -> Motion:
    return motion("coning", **GENERAL)


def _samples(standard: Design) -> str:
    before = f" and {standard.previous} before" if standard.previous else ""
    return f"{standard.samples} sample{'s' if standard.samples > 1 else ''}{before}"


def _frame() -> Array:
    """Return a rotation that takes no axis to an axis."""
    return motion("constant", x_rad_s=0.48, y_rad_s=-0.6, z_rad_s=0.64).attitude(1.0)


def _fits(response: Array) -> bool:
    return bool(np.abs(response - np.eye(3)).max() < _DIRECTION_WITHIN)


def _off(response: Directions) -> float:
    """Return the largest difference of an answer to a rotation about an axis, in units of the rotation."""
    return float(np.abs(response.finally_ - np.eye(3)).max())


def _axes(response: Array) -> str:
    """Return in words how rotations about the axes come out."""
    if not np.isfinite(response).all():
        return "a small rotation gives no attitude near the one before it"
    sizes = np.abs(response).max(axis=0)
    if np.all(sizes < _DIRECTION_WITHIN):
        return "a small rotation about an axis does not turn the attitude"
    signs = np.where(np.abs(response) > sizes / 2, np.sign(response), 0)
    one_each = np.array_equal(np.abs(signs).sum(axis=0), np.ones(3)) and np.array_equal(
        np.abs(signs).sum(axis=1), np.ones(3)
    )
    factor = float(np.median(sizes))
    if one_each and np.allclose(response, factor * signs, atol=_DIRECTION_WITHIN * factor):
        names = [
            ("-" if signs[:, k].sum() < 0 else "") + "xyz"[int(np.abs(signs[:, k]).argmax())]
            for k in range(3)
        ]
        size = "" if abs(factor - 1) < _DIRECTION_WITHIN else f", {factor:.4g} times as large"
        return f"rotations about x, y, z turn about {', '.join(names)}{size}"
    return "a small rotation about an axis is wrong in size or axis"
