"""`check_foreign` tests a user's function in C or C++ as an attitude step, and names the cause of a failure."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from strapgen.firmware.check_code import coning_causes, ladder, probes
from strapgen.firmware.check_code.bridge import ForeignSource
from strapgen.firmware.check_code.conformance import Finding, finding_text
from strapgen.firmware.check_code.coning_causes import MeasuredCoefficient
from strapgen.firmware.check_code.foreign import (
    ENDS,
    RATE_INPUTS,
    Convention,
    ForeignRun,
    ForeignStep,
    Segment,
    SegmentRun,
    departure,
    lengths,
)
from strapgen.firmware.check_code.foreign_arguments import RATES
from strapgen.firmware.check_code.probes import DIRECTION_WITHIN, SIZE_WITHIN, Directions, Products, Rest, off
from strapgen.firmware.check_code.remedy import remedy
from strapgen.firmware.check_code.rotation import placement, rotation, rotation_segments
from strapgen.firmware.check_code.upsets import upsets
from strapgen.firmware.check_code.velocity import Velocity
from strapgen.firmware.check_code.velocity_findings import MeasuredTranslation, VelocityFindings
from strapgen.ir.renamed import renamed
from strapgen.lab.motions.motions import motion
from strapgen.results.records import INTERNAL, Properties, entry, properties
from strapgen.results.result import Result

Array = NDArray[np.float64]

#: Largest departure of C C' from the unit matrix that is no fault in itself.
_NORM_WITHIN = 1e-4
#: Largest error of the rate of a frame, by its size: a day of the sun or of the stars is 0.3 % apart.
_FRAME_WITHIN = 0.005
#: Units in the last place that rounding adds in a call.
_UNITS_A_CALL = 64
#: Exceptions of Python at arrays of another shape than a function takes.
_OF_SHAPES = ("it raises ValueError", "it raises IndexError", "it raises TypeError")
#: Largest component in rad of random increments.
_RANDOM = 0.02


_FRAME_AT = "the rotation of the frame is turned to the body axes of the {} of the call, not of its middle"


@dataclass(frozen=True)
class MeasuredCheck:
    """A check with its measurement."""

    name: str
    #: Whether the function passes; None where nothing is required, or nothing could be measured
    holds: bool | None
    value: float | None


def without_words(findings: Sequence[Finding]) -> list[MeasuredCheck]:
    """Return the measurements of findings, without their texts."""
    return [MeasuredCheck(finding.name, finding.holds, finding.measured) for finding in findings]


@renamed(drift_by_axis_deg_h="drift_axes_deg_h")
@dataclass(frozen=True)
class ForeignResult(Result):
    """The findings on a user's function."""

    computed: ClassVar[Properties] = properties(holds=entry(), of_old_name=entry(key="drift_by_axis_deg_h"))

    file: str
    function: str = field(metadata=INTERNAL)
    findings: tuple[Finding, ...] = field(
        metadata=entry(key="checks", write=without_words, kind=list[MeasuredCheck])
    )
    #: Observed order
    order: float | None
    #: Magnitude of the drift on the cone in deg/h
    drift_deg_h: float | None
    #: The one that a published coning correction on the same samples leaves, in closed form
    closed_form_deg_h: float | None
    #: The likely cause of what fails; None if nothing does, or the cause is not known
    cause: str | None
    #: The drift about x, y and z of the reference axes in deg/h; its length is the magnitude
    drift_axes_deg_h: tuple[float, ...] | None = None
    #: Those of cross products that are seen or wanted; none where samples are rates at instants
    coefficients: tuple[MeasuredCoefficient, ...] = ()
    #: What they correct of the drift on coning to leading order, 1 if they are right
    coefficient_ratio: float | None = None
    #: How sure the cause of wrong coefficients is, from 0 to 1; None where it was found otherwise
    cause_confidence: float | None = None
    #: What explains them next best
    next_cause: str | None = None
    #: Lines of generated C that correct coning on the same samples; None where the coefficients hold
    replacement: str | None = None
    #: The command that generates them
    replacement_command: str | None = None
    #: What its parameters are taken for
    reading: str = field(default="", metadata=INTERNAL)
    #: Of a function that computes a velocity
    translation: MeasuredTranslation | None = field(
        default=None, metadata=entry(spread=True, optional=True, kind=MeasuredTranslation)
    )

    @property
    def of_old_name(self) -> tuple[float, ...] | None:
        """The same as drift_axes_deg_h, under the name that it had before."""
        return self.drift_axes_deg_h

    @property
    def holds(self) -> bool:
        """Whether the function does all that is required."""
        return all(finding.holds is not False for finding in self.findings)

    def rows(self) -> Sequence[MeasuredCheck]:
        """Return the checks."""
        return without_words(self.findings)

    def text(self) -> str:
        """Return the findings, a line each, and the likely cause of a failure."""
        reading = [self.reading] if self.reading else []
        lines = [f"{self.file}: {self.function}", *reading, "", *map(finding_text, self.findings)]
        if self.cause:
            sure = ""
            if self.cause_confidence is not None:
                sure = f" (confidence {self.cause_confidence:.2f}; next best: {self.next_cause})"
            lines += ["", f"likely cause: {self.cause}{sure}"]
        if self.replacement:
            code = [f"    {line}" for line in self.replacement.splitlines()]
            lines += ["", f"generated code that corrects coning, of {self.replacement_command}:", *code]
        return "\n".join(lines)


def check_foreign(step: ForeignStep) -> ForeignResult:
    """Check a user's function."""
    return _Check(step).outcome()


class _Check:
    """The checks of one function with their measurements."""

    def __init__(self, step: ForeignStep) -> None:
        self.step = step
        self.count = step.samples
        self.causes: list[str] = []
        #: What is measured by now, as the result has it
        self.known: dict[str, Any] = dict.fromkeys(("order", "drift_deg_h", "closed_form_deg_h"))
        #: That of the function, once it is known
        self.convention: Convention | None = None
        size = min(_RANDOM, step.most / 2)  # of a component, half as large as a vector may be
        self.random: Array = np.random.default_rng(1969).uniform(-size, size, (20, self.count, 3))
        self.velocity = VelocityFindings(Velocity(step)) if step.source.arguments.translations else None

    def outcome(self) -> ForeignResult:
        """Run all checks."""
        findings = tuple(self.findings())
        findings += tuple(self.upsets(findings))
        failed = any(finding.holds is False for finding in findings)
        return ForeignResult(
            str(self.step.source.file),
            self.step.source.function,
            findings,
            cause="; ".join(dict.fromkeys(self.causes)) or None if failed else None,
            reading=self.step.reading,
            translation=None if self.velocity is None else self.velocity.measured,
            **self.known,
        )

    def findings(self) -> Iterator[Finding]:
        """Yield the findings, up to a fault that hides all others."""
        convention, response = self.step.convention, None
        if self.step.source.arguments.elements:
            first = self.step.run(probes.direction_segments(self.step))
            calls = self.calls(first)
            if calls.holds is False:
                yield calls
                return
            if not any(run.states.any() for run in first.segments):
                yield calls
                text = "the attitude stays zero: --init names what makes it no rotation before the first call"
                yield self.failed("axes", text)
                return
            known, response = probes.convention_of(self.step, probes.directions(self.step, first.segments))
            if known is None:
                yield calls
                yield self.failed("axes", probes.in_words(self.step, response.steady), off(response))
                return
            convention = known
        everything = self.segments()
        done = self.step.run([segment for _, part in everything for segment in part], convention)
        calls = self.calls(done)
        yield calls
        if calls.holds is False:
            return
        if response is not None:
            axes = [*self.axes(convention, response)]
            yield from axes
            if axes[-1].holds is False and off(response) <= SIZE_WITHIN:  # about reference axes
                return
        segments = iter(done.segments)
        runs = {name: tuple(islice(segments, len(part))) for name, part in everything}
        if response is not None:
            runs = yield from self.measured(convention, runs)
        if self.velocity is not None:
            yield from self.velocity.findings(runs)
            self.causes.extend(self.velocity.causes)
            self.known |= {} if "replacement" in self.known else self.velocity.sure
        yield self.repeated(*runs["runs"])
        yield from self.used(convention)

    def upsets(self, found: Sequence[Finding]) -> Iterator[Finding]:
        """Yield the findings on input that fails and on long runs, once the function is known to work otherwise."""
        if self.convention is not None:
            lasts, rotates = (
                all(finding.holds for finding in found if finding.name == name)
                for name in ("norm", "rotation")
            )
            for finding, cause in upsets(self.step, self.convention, long=lasts, rotates=rotates):
                self.causes += filter(None, [cause])
                yield finding

    def failed(self, name: str, text: str, measured: float | None = None) -> Finding:
        """Return a finding whose text is its own cause."""
        self.causes.append(text)
        return Finding(name, False, text, measured)

    def calls(self, done: ForeignRun) -> Finding:
        """Return the finding on crashes of calls, and on writes outside of their memory."""
        if done.stopped:
            also = "; if it takes arrays of other shapes, --arguments says so, as increments[2][3]"
            of_shapes = done.stopped.startswith(_OF_SHAPES)
            return self.failed("calls", f"{done.stopped}{also * of_shapes}")
        if done.writes_beyond:
            return self.failed("calls", "it writes beyond the ends of its arrays")
        if done.changes_inputs:
            return self.failed("calls", "it changes an argument that is no result")
        return Finding("calls", True, "all calls return, and write nothing but the result")

    # Conventions

    def axes(self, known: Convention, response: Directions) -> Iterator[Finding]:
        """Yield the findings on scalar part, sense and axes of a function that follows a known convention."""
        declared = self.step.convention
        if self.step.source.arguments.elements == 4:
            yield self.fits("scalar", declared.scalar, known.scalar, "the scalar part stands")
        about_reference = response.order_of_turns >= response.other_order
        if about_reference and declared.sense != known.sense and off(response) <= SIZE_WITHIN:
            text = "the rotation has the wrong sign"
            also = f"or the attitude is {known.sense}, with a product in the wrong order"
            self.causes.append(f"{text}, {also}")
            yield Finding(
                "axes", False, f"{text}: minus the samples turn it, {also}", response.order_of_turns
            )
            return
        yield self.fits("sense", declared.sense, known.sense, "the attitude is")
        text = "a rotation turns about reference axes, not about body axes: a product in the wrong order"
        if off(response) > SIZE_WITHIN:
            yield self.failed("axes", probes.sizes_in_words(response.steady), off(response))
        elif about_reference:
            yield self.failed("axes", text, response.order_of_turns)
        else:
            text = "rotations about x, y and z are those of the body"
            yield Finding("axes", True, text, off(response), SIZE_WITHIN)

    def fits(self, name: str, ours: str, known: str, what: str) -> Finding:
        """Return the finding on a declared part of the convention."""
        if ours == known:
            return Finding(name, True, f"{what} {ours}")
        option = "--scalar" if name == "scalar" else "--sense"
        return self.failed(name, f"{what} {known}, not {ours}: {option} {known} fits")

    # Measurements

    def segments(self) -> list[tuple[str, list[Segment]]]:
        """Return all segments of the measurements under their names."""
        return [
            ("runs", [Segment(self.random, settled=False, velocities=self.random)] * 2),
            *([] if self.velocity is None else self.velocity.segments()),
            *(self.of_attitude(self.random) if self.step.source.arguments.elements else ()),
        ]

    def of_attitude(self, increments: Array) -> list[tuple[str, list[Segment]]]:
        """Return the segments of the measurements of the attitude."""
        return [
            ("at rest", probes.rest_segments(self.step)),
            ("directions", probes.direction_segments(self.step)),
            ("rotation", rotation_segments(self.step)),
            ("products", [] if self.step.takes == ENDS else probes.product_segments(self.step)),
            ("symmetry", [Segment(increments), Segment(increments @ _frame().T)]),
            ("order", ladder.ladder_segments(self.step)),
            ("drift", ladder.drift_segments(self.step)),
        ]

    def measured(
        self, convention: Convention, runs: dict[str, tuple[SegmentRun, ...]]
    ) -> Generator[Finding, None, dict[str, tuple[SegmentRun, ...]]]:
        """Yield the findings on the attitude; return all runs as they would be in a resting frame."""
        self.convention = convention
        still = probes.rest(self.step, runs["at rest"])
        resting = self.at_rest(still)
        yield resting
        runs = {name: tuple(run.in_resting_frame(still.frame) for run in part) for name, part in runs.items()}
        response = probes.directions(self.step, runs["directions"])
        delay = self.delay(response)
        coefficients = None
        turned = rotation(self.step, convention, runs["rotation"])
        if still.frame.any() and self.step.source.precision == "double":
            yield self.frame_placement(still.frame, runs["rotation"])
        if self.step.takes != ENDS and delay.holds and off(response) <= SIZE_WITHIN:
            coefficients = probes.products(self.step, runs["products"], exact=turned.order >= 3)
            if coning_causes.comes_late(coefficients):
                delay = Finding("delay", False, "a later call corrects the samples of a call", delay.measured)
        yield delay
        self.causes.extend([turned.cause] if turned.cause else [])
        yield Finding("rotation", turned.order >= 3, turned.text, turned.square)
        distorted = still.strays or off(response) > SIZE_WITHIN
        proved = 0 if distorted else turned.order if delay.holds else min(turned.order, 1)
        yield from self.corrected(coefficients, proved, runs)
        yield self.symmetry(*runs["symmetry"])
        yield self.norm(convention, runs["drift"][0])
        if self.velocity is not None:
            self.velocity.frame = still.frame
            self.velocity.frame_strays = bool(still.frame.any()) and resting.holds is False
        return runs

    def at_rest(self, still: Rest) -> Finding:
        """Return the finding on a run without rotation."""
        allowed, seconds = _UNITS_A_CALL * self.step.unit, float(self.step.interval * self.count)
        causes = still.causes(seconds)
        if self.step.frame.any() and not still.strays:
            return self.in_frame(still, -self.step.frame * seconds, causes)
        self.causes.extend(causes)
        text = f"without rotation the state {'stays as it is' if still.moved <= allowed else 'moves'}"
        return Finding.within("at rest", text, still.moved, allowed)

    def in_frame(self, still: Rest, wanted: Array, causes: list[str]) -> Finding:
        """Return the finding on a run without rotation in a frame that moves, by a rotation vector in a call."""
        size = float(np.linalg.norm(wanted))
        allowed = _FRAME_WITHIN * size + 2 * self.step.unit
        off = float(np.linalg.norm(still.frame - wanted))
        if off <= allowed:
            text = "without rotation the state turns as its frame does"
            return Finding("at rest", True, text, off / size, allowed / size)
        known = {"has the wrong sign": still.frame + wanted, "is absent": still.frame}
        said = [words for words, left in known.items() if np.linalg.norm(left) <= allowed]
        text = f"the rate of the frame {[*said, 'is another'][0]}"
        return self.failed("at rest", ": ".join([text, *causes[:1]]), off / size)

    def frame_placement(self, frame: Array, runs: Sequence[SegmentRun]) -> Finding:
        """Return the finding on where in a call the attitude turns with the frame."""
        place = placement(self.step, frame, runs)
        text = f"of the rotation of the frame {0.5 + place:.3g} is in the body axes of the end of the call; wanted 0.5"
        holds = abs(place) <= DIRECTION_WITHIN
        if not holds:
            where = {-0.5: "start", 0.5: "end"}.get(round(2 * place, 1) / 2)
            self.causes.append(_FRAME_AT.format(where) if where else text)
        return Finding("frame placement", holds, text, place, DIRECTION_WITHIN)

    def delay(self, response: Directions) -> Finding:
        """Return the finding on the delay between samples and rotation."""
        lag, takes = response.lag, self.step.takes
        if abs(lag) <= DIRECTION_WITHIN if takes == ENDS else probes.fits(response.at_once):
            return Finding("delay", True, "a call turns by its own samples", lag)
        half = 0.5 if self.step.takes == RATES else -0.5
        is_half = takes in RATE_INPUTS and abs(lag - half) < DIRECTION_WITHIN
        if is_half and (said := self.other_rates()):
            return self.failed("delay", said, lag)
        size = "one sample" if abs(abs(lag) - 1) < DIRECTION_WITHIN else f"{abs(lag):.2g} samples"
        return self.failed("delay", f"rotation {size} {'late' if lag > 0 else 'early'}", lag)

    def other_rates(self) -> str | None:
        """Return the cause if the function is right for the other kind of rates, where it has no delay."""
        other = ENDS if self.step.takes == RATES else RATES
        checked = _Check(replace(self.step, takes=other))
        holds = {finding.name: finding.holds for finding in checked.findings()}
        if not holds.get("delay") or holds.get("order") is False:
            return None
        seen = checked.known["order"]
        order = "" if seen is None else f", order {seen:.2f}"
        said = (
            "rates at instants are taken for means: its rates are those at the ends of the intervals"
            if other == ENDS
            else "means are taken for rates at instants: its rates are means over the intervals"
        )
        return f"{said}; --input {other} fits{order}"

    def corrected(
        self,
        coefficients: Products | None,
        proved: int,
        runs: dict[str, tuple[SegmentRun, ...]],
    ) -> Iterator[Finding]:
        """Yield the findings on the coning correction: its coefficients, the order, and the drift.

        Without coefficients the order that is proved counts, as far as rounding hides the one that is measured.
        """
        if coefficients is None:
            standard = coning_causes.plain_design(self.count)
        else:
            standard = coning_causes.standard_design(coefficients)
            shown = self.shown(coefficients)
            yield shown
            proved = proved if shown.holds else min(proved, 2)
        seen = ladder.ladder(self.step, runs["order"], standard)
        if self.step.source.precision != "double":
            order, self.known["order"] = ladder.order_in_float(self.step, seen, standard, proved)
        else:
            order, self.known["order"] = ladder.order_on_ladder(self.step, seen)
        yield order
        measured_design = None if coefficients is None else coning_causes.measured_design(coefficients)
        finding, drift, closed = ladder.drift_on_cones(self.step, runs["drift"], standard, measured_design)
        self.known |= {"drift_axes_deg_h": tuple(map(float, drift)), "closed_form_deg_h": closed}
        self.known["drift_deg_h"] = float(np.linalg.norm(drift))
        yield finding

    def shown(self, known: Products) -> Finding:
        """Return the finding on the coefficients, and keep them beside those that are wanted."""
        ratio = coning_causes.ratio(known)
        self.known |= {"coefficients": coning_causes.measured(known), "coefficient_ratio": ratio}
        holds = coning_causes.corrects_coning(known) and not coning_causes.weights_off(known)
        if (said := coning_causes.cause(known)) is not None:
            self.causes.append(said)
            self.known |= coning_causes.sureness(known, said)
        if not holds:
            self.known |= remedy(coning_causes.nearest(known)[1])
        text, allowed = coning_causes.in_words(known), coning_causes.tolerance(known)
        return Finding("coefficients", holds, text, ratio, allowed)

    def symmetry(self, plain: SegmentRun, turned: SegmentRun) -> Finding:
        """Rotate all increments: the attitude must rotate with them."""
        frame = _frame()
        off = float(np.abs(turned.relative - frame @ plain.relative @ frame.T).max())
        allowed = _UNITS_A_CALL * self.step.unit * len(plain.relative)
        says = "turns" if off <= allowed else "does not turn"
        text = f"with all increments turned the attitude {says} with them"
        return Finding.within("symmetry", text, off, allowed)

    def norm(self, convention: Convention, run: SegmentRun) -> Finding:
        """Check the length of the state along the cone."""
        off = departure(run.states)
        allowed = max(_NORM_WITHIN, 4 * self.step.unit * len(run.matrices))
        text = f"on the cone C C' departs from the unit matrix by at most {off:.3g}"
        if off > allowed:
            size = lengths(run.states)
            self.causes.append(
                f"the state's length is off: {size[0]:.6g} at first, {size[-1]:.6g} in the end"
            )
        return Finding.within("norm", text, off, allowed)

    def repeated(self, first: SegmentRun, second: SegmentRun) -> Finding:
        """Compare a run with the same run again, after a reset."""
        off = max(
            float(np.abs(one - other).max())
            for one, other in zip(_numbers(first), _numbers(second), strict=True)
            if one.size
        )
        if off == 0:
            return Finding("runs", True, "a second run gives the same numbers", off, 0.0)
        self.causes.append(coning_causes.STATE_KEPT)
        init = self.step.source.init
        after = f"after {init}" if init else "no --init is named, and"
        return Finding("runs", False, f"{after} a second run differs from the first by {off:.3g}", off, 0.0)

    def used(self, convention: Convention) -> Iterator[Finding]:
        """Yield what --init leaves of an earlier run in used memory; it is no fault, as a caller may zero it."""
        source = self.step.source
        if not isinstance(source, ForeignSource) or not (source.begins and source.arguments.memories):
            return
        segment = Segment(self.random, settled=False, velocities=self.random)
        done, parts = self.step.outputs([segment, replace(segment, used=True)], convention)
        if done.stopped:
            yield Finding(
                "used memory", None, f"after {source.init} in the memory of an earlier run {done.stopped}"
            )
        elif (off := float(np.abs(parts[0] - parts[1]).max())) > 0:
            text = f"{source.init} leaves something of an earlier run, by which the next one differs by {off:.3g}"
            yield Finding("used memory", None, f"{text}, unless its caller zeroes the memory", off)


def _numbers(run: SegmentRun) -> list[Array]:
    """Return all results of a run."""
    return [run.states, *run.translations.values()]


def _frame() -> Array:
    """Return a rotation that takes no axis to an axis."""
    return motion("constant", x_rad_s=0.48, y_rad_s=-0.6, z_rad_s=0.64).attitude(1.0)
