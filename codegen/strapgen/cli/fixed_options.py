"""Options for the word, the rounding and the ranges of fixed-point code, shared by several commands."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from strapgen.cli.options import one, option, pair, whole
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from fractions import Fraction

    from strapgen.catalogue import Choice
    from strapgen.ir.fixed_settings import Settings
    from strapgen.ir.sources import Sources

_Text = str | None

#: The options of a run: its formats are chosen for its own increments, or for a largest rate that is stated.
RUN_OPTIONS = (
    *("word", "max_rate_deg_s", "lsb", "lsb_rad", "input_bits"),
    *("state", "rounding", "carry", "drift_allowance"),
)


@dataclass(frozen=True)
class FixedOptions:
    """Word and rounding of fixed-point code, and the largest numbers that it must hold."""

    panel: ClassVar[str] = "Fixed point"

    word: Annotated[
        _Text,
        option(
            "--word",
            metavar="BITS",
            help="Word length in bits: 16, 32 or 64 in C, 8 to 64 in the integer model.  [default: 32]",
        ),
    ] = None
    max_rate_deg_s: Annotated[
        _Text,
        option(
            "--max-rate-deg-s",
            metavar="DEG_S",
            help="Largest body rate about any axis in deg/s; the formats then hold the increments at this rate.",
        ),
    ] = None
    step: Annotated[
        _Text, option("--step", metavar="S", help="Step length in s; it goes with --max-rate-deg-s.")
    ] = None
    sample_hz: Annotated[
        _Text,
        option(
            "--sample-hz",
            metavar="HZ",
            help="Samples of the gyro in a second, in place of --step: a step takes as many as it has increments.",
        ),
    ] = None
    lsb: Annotated[
        _Text,
        option(
            "--lsb",
            metavar="RATE",
            help="Rate that a count of the gyro stands for, as 0.0175dps, 17.5mdps or 3e-4rad/s; the increments are "
            "then counts.",
        ),
    ] = None
    lsb_rad: Annotated[
        _Text,
        option("--lsb-rad", metavar="RAD", help="Angle that a count stands for in rad, in place of a rate."),
    ] = None
    input_bits: Annotated[
        _Text,
        option(
            "--input-bits",
            metavar="BITS",
            help="Bits of an increment; up to 16 they are int16_t.  [default: those of a word; 16 with --lsb]",
        ),
    ] = None
    max_angle_rad: Annotated[
        _Text,
        option(
            "--max-angle-rad",
            metavar="RAD",
            help="Largest angle increment about any axis in rad, in place of a rate and a step.  [default: 1/8]",
        ),
    ] = None
    rounding: Annotated[
        _Text,
        option(
            "--rounding",
            metavar="NAME",
            help="How results are rounded: nearest or truncation.  [default: nearest]",
        ),
    ] = None
    carry: Annotated[
        _Text,
        option(
            "--carry",
            metavar="NAME",
            help="Error feedback, which adds the rounding errors of a step to the next one: none; state for those of "
            "the state; full for those of the transition too; all for those of sums and outgoing increments too.  "
            "[default: none]",
        ),
    ] = None
    multiply: Annotated[
        _Text,
        option(
            "--multiply",
            metavar="NAME",
            help="How products with a constant are computed: product, or shift-add for sums of shifted terms.  "
            "[default: product]",
        ),
    ] = None
    digits: Annotated[
        _Text,
        option(
            "--digits",
            metavar="N",
            help="Signed digits of a constant with --multiply shift-add; fewer cost less and are less accurate.  "
            "[default: all]",
        ),
    ] = None
    state: Annotated[
        _Text,
        option(
            "--state",
            metavar="NAME",
            help="State in the format of CMSIS: q31 for words of 32 bits, q15 for 16, q63 for 64. It saturates at "
            "-1 and below 1.",
        ),
    ] = None
    drift_allowance: Annotated[
        _Text,
        option(
            "--drift-allowance",
            metavar="A",
            help="Amount by which the magnitude of a state element may exceed 1.  [default: 1/16]",
        ),
    ] = None
    ranges: Annotated[
        list[str] | None,
        option(
            "--range",
            metavar="NAME=MAX",
            help="Largest magnitude of the input NAME in its unit, for an input whose range strapgen does not know.",
        ),
    ] = None
    formats: Annotated[
        list[str] | None,
        option(
            "--fix",
            metavar="NAME=Qm.n",
            help="Format of the argument or value NAME, if you choose it yourself.",
        ),
    ] = None

    @property
    def stated(self) -> dict[str, Any]:
        """The options that the command line states, with their values."""
        options = {
            "--word": self.word,
            "--max-rate-deg-s": self.max_rate_deg_s,
            "--step": self.step,
            "--sample-hz": self.sample_hz,
            "--lsb": self.lsb,
            "--lsb-rad": self.lsb_rad,
            "--input-bits": self.input_bits,
            "--state": self.state,
            "--max-angle-rad": self.max_angle_rad,
            "--rounding": self.rounding,
            "--carry": self.carry,
            "--drift-allowance": self.drift_allowance,
            "--multiply": self.multiply,
            "--digits": self.digits,
            "--range": self.ranges,
            "--fix": self.formats,
        }
        return {option: value for option, value in options.items() if value not in (None, [])}

    def settings(self, increments: int) -> Settings | None:
        """Return the settings of fixed point for so many increments a step; None if no option is stated."""
        if not self.stated:
            return None
        from strapgen.ir import checks
        from strapgen.ir.fixed_settings import Settings

        self._check_pairs()
        bits = whole("word", self.word)
        allowance = {}
        if self.drift_allowance is not None:
            allowance["allowance"] = checks.number("drift allowance", self.drift_allowance)
        return Settings.of(
            word=32 if bits is None else bits,
            max_rate_deg_s=self.max_rate_deg_s,
            step=self.step,
            increments=increments,
            largest_angle=self.max_angle_rad,
            sample_hz=self.sample_hz,
            lsb=self.lsb if self.lsb_rad is None else f"{self.lsb_rad}rad",
            input_bits=whole("input bits", self.input_bits),
            state=self.state or "",
            rounding="nearest" if self.rounding is None else self.rounding,
            carry="none" if self.carry is None else self.carry,
            multiply="product" if self.multiply is None else self.multiply,
            digits=whole("digits", self.digits) or 0,
            **allowance,
            ranges=_numbers(self.ranges or ()),
            formats=dict(pair("--fix", text) for text in self.formats or ()),
        )

    def _check_pairs(self) -> None:
        """Refuse options that do not go together, or that another one is missing for."""
        for one_option, other in (("--step", "--sample-hz"), ("--lsb", "--lsb-rad")):
            if {one_option, other} <= {*self.stated}:
                raise InputError(f"{one_option} and {other} are both given; one is needed")
        timed = self.step is not None or self.sample_hz is not None
        if self.max_rate_deg_s is not None and not timed:
            raise InputError("--max-rate-deg-s and --step go together; --step is missing, or --sample-hz")
        if self.lsb is not None and not timed:
            raise InputError("--lsb is a rate a count; --sample-hz is missing, which makes it an angle")
        if timed and self.max_rate_deg_s is None and self.lsb is None:
            stated = "--step" if self.sample_hz is None else "--sample-hz"
            raise InputError(
                f"--max-rate-deg-s and {stated} go together; --max-rate-deg-s is missing, or --lsb"
            )
        if self.lsb is not None and self.lsb.strip().endswith("rad"):
            raise InputError(f"--lsb is {self.lsb}, an angle a count; --lsb-rad takes it, without its unit")

    def at_step(self, seconds: float) -> FixedOptions:
        """Return the options at the step of a run in s, by which a largest rate becomes a largest increment."""
        is_needed = self.max_rate_deg_s is not None or self.lsb is not None
        return replace(self, step=repr(seconds) if is_needed else None)

    def check_increments(self, choice: Choice) -> None:
        """Refuse a largest rate or angle for a kernel that takes neither."""
        from strapgen import pipeline
        from strapgen.fixedpoint.sensor_scale import counted
        from strapgen.ir.fixed_settings import TURNING

        of_gyro = {*self.stated} & {"--sample-hz", "--lsb", "--lsb-rad", "--input-bits"}
        of_angle = {*self.stated} & {"--max-rate-deg-s", "--step", "--max-angle-rad"}
        if not of_gyro and not of_angle:
            return
        program = pipeline.program(choice)
        if of_gyro and not counted(program):
            raise InputError(
                f"kernel {choice.kernel} takes no increments; {min(of_gyro)} does not go with it"
            )
        if of_angle and not {signal.name for signal in program.inputs} & {*TURNING}:
            raise InputError(
                f"kernel {choice.kernel} takes no increments; a largest rate or angle does not go with it"
            )

    def check_feedback(self, sources: Sources) -> None:
        """Refuse error feedback for a kernel that has none."""
        if self.carry not in (None, "none") and sources.fixed is not None and not sources.fixed.residuals:
            raise InputError(
                f"kernel {sources.kernel} rounds no state that goes on to the next step; --carry keeps nothing"
            )

    def check_backend(self, backend: str) -> None:
        """Refuse options of fixed point for a back end in floating point."""
        from strapgen.ir import checks
        from strapgen.run.backends import BACKENDS

        one("--backend", backend)
        checks.choice("backend", backend, BACKENDS)
        if self.stated and not BACKENDS[backend].fixed:
            raise InputError(f"{next(iter(self.stated))} is for fixed-point back ends, not for {backend}")

    def check_pulse(self, pulse: str | None) -> None:
        """Refuse a gyro pulse beside the scale of a gyro that counts, which is one."""
        scale = next((name for name in ("--lsb", "--lsb-rad") if name in self.stated), None)
        if pulse is not None and scale is not None:
            raise InputError(f"--pulse-arcsec and {scale} both state the angle of a count; one is needed")

    def settings_for_run(
        self, backend: str, increments: int | None, step: float, largest: Callable[[], float]
    ) -> Settings | None:
        """Return the settings of a run with a step in s: formats for the stated largest rate, else for `largest()` rad.

        None for a back end in floating point.
        """
        from strapgen.ir.fixed_settings import Settings
        from strapgen.run.backends import BACKENDS

        if not BACKENDS[backend].fixed:
            return None
        settings = self.at_step(step).settings(increments or 2) or Settings()
        bits = BACKENDS[backend].word
        if self.word is not None and bits not in (None, settings.word):
            raise InputError(
                f"--word {settings.word} does not go with {backend}, whose words have {bits} bits"
            )
        return settings if self.max_rate_deg_s is not None else settings.fitted(largest())


def _numbers(texts: Iterable[str]) -> dict[str, Fraction]:
    from strapgen.ir import checks

    pairs = (pair("--range", text) for text in texts)
    return {name: checks.number(f"range of {name}", value, positive=True) for name, value in pairs}
