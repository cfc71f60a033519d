"""Options for the word, the rounding and the ranges of fixed-point code, shared by several commands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Annotated, ClassVar

from strapgen.cli.option_groups import Needs, OneOf, Rule, stated
from strapgen.cli.options import option
from strapgen.cli.values import Positive, names
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.ir.fixed_settings import Settings
    from strapgen.ir.sources import Sources

_Text = str | None

#: The options of a run: its formats are chosen for its own increments, or for a largest rate that is stated.
RUN_OPTIONS = (
    *("word", "max_rate_deg_s", "lsb", "lsb_rad", "input_bits"),
    *("state", "rounding", "carry", "allowance"),
)


#: The options that state the largest numbers, which code in floating point takes too.
_RANGE_OPTIONS = {"--max-rate-deg-s", "--step", "--sample-hz", "--max-angle-rad", "--range"}


def _rate_of_a_count(option: str, text: str) -> str:
    """Read a rate with its unit."""
    from strapgen.ir.units import Sensor

    if text.strip().endswith("rad"):
        raise InputError(f"{option} is {text}, an angle a count; --lsb-rad takes it, without its unit")
    Sensor.of(text, Fraction(1))
    return text


@dataclass(frozen=True)
class FixedOptions:
    """Word and rounding of fixed-point code, and the largest numbers that it must hold."""

    panel: ClassVar[str] = "Fixed point"
    rules: ClassVar[tuple[Rule, ...]] = (
        OneOf("--step --sample-hz"),
        OneOf("--lsb --lsb-rad"),
        Needs("--max-rate-deg-s", "--step --sample-hz"),
        Needs("--lsb", "--sample-hz --step"),
        Needs("--step --sample-hz", "--max-rate-deg-s --lsb"),
    )

    word: Annotated[
        int | None,
        option(
            "--word",
            metavar="BITS",
            help="Word length in bits: 16, 32 or 64 in C, 8 to 64 in the integer model.  [default: 32]",
        ),
    ] = None
    max_rate_deg_s: Annotated[
        Positive | None,
        option(
            "--max-rate-deg-s",
            metavar="DEG_S",
            help="Largest body rate about any axis in deg/s; the formats then hold the increments at this rate.",
        ),
    ] = None
    step: Annotated[
        Positive | None,
        option("--step", metavar="S", help="Step length in s; it goes with --max-rate-deg-s."),
    ] = None
    sample_hz: Annotated[
        Positive | None,
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
            read=_rate_of_a_count,
        ),
    ] = None
    lsb_rad: Annotated[
        Positive | None,
        option("--lsb-rad", metavar="RAD", help="Angle that a count stands for in rad, in place of a rate."),
    ] = None
    input_bits: Annotated[
        int | None,
        option(
            "--input-bits",
            metavar="BITS",
            help="Bits of an increment; up to 16 they are int16_t.  [default: those of a word; 16 with --lsb]",
        ),
    ] = None
    largest_angle: Annotated[
        Positive | None,
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
            read=names("strapgen.ir.formats:ROUNDINGS"),
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
            read=names("strapgen.ir.fixed_settings:CARRIES"),
        ),
    ] = None
    multiply: Annotated[
        _Text,
        option(
            "--multiply",
            metavar="NAME",
            help="How products are computed: product; shift-add for sums of shifted terms in place of those with a "
            "constant; high for the high words of all products alone; half for those from half words.  "
            "[default: product]",
            read=names("strapgen.ir.formats:MULTIPLICATIONS"),
        ),
    ] = None
    digits: Annotated[
        int | None,
        option(
            "--digits",
            metavar="N",
            help="Signed digits of a constant with --multiply shift-add; fewer cost less and are less accurate.  "
            "[default: all]",
        ),
    ] = None
    sums: Annotated[
        _Text,
        option(
            "--sums",
            metavar="NAME",
            help="Order of the sums of targets in floating point: canonical, or tree for balanced trees.  "
            "[default: canonical]",
            read=names("strapgen.ir.fixed_settings:SUMS"),
        ),
    ] = None
    state: Annotated[
        _Text,
        option(
            "--state",
            metavar="NAME",
            help="State in the format of CMSIS: q31 for words of 32 bits, q15 for 16, q63 for 64. It saturates at "
            "-1 and below 1.",
            read=names("strapgen.ir.fixed_settings:STATES"),
        ),
    ] = None
    allowance: Annotated[
        Fraction | None,
        option(
            "--drift-allowance",
            metavar="A",
            help="Amount by which the magnitude of a state element may exceed 1.  [default: 1/16]",
        ),
    ] = None
    ranges: Annotated[
        dict[str, Positive] | None,
        option(
            "--range",
            metavar="NAME=MAX",
            help="Largest magnitude of the input NAME in its unit, for an input whose range strapgen does not know.",
        ),
    ] = None
    formats: Annotated[
        dict[str, str] | None,
        option(
            "--fix",
            metavar="NAME=Qm.n",
            help="Format of the argument or value NAME, if you choose it yourself.",
        ),
    ] = None

    def settings(self, increments: int) -> Settings | None:
        """Return the settings of fixed point for so many increments a step; None if no option is stated."""
        given = {part.name: value for part in fields(self) if (value := getattr(self, part.name)) is not None}
        if given.get("sums") == "canonical":  # no target takes anything else unless it is told
            del given["sums"]
        if not given:
            return None
        from strapgen.ir.fixed_settings import Settings

        if "lsb_rad" in given:
            given["lsb"] = f"{given.pop('lsb_rad')}rad"
        return Settings.of(increments=increments, **given)

    def check_target(self, target: str) -> None:
        """Refuse options that a target does not take: in floating point all but the largest numbers and --sums."""
        from strapgen.targets import TARGETS, fixed_targets

        if not TARGETS[target].fixed and not {*stated(self)} <= {*_RANGE_OPTIONS, "--sums"}:
            takers = " or ".join(fixed_targets())
            raise InputError(f"the options of fixed point go with --target {takers}, not with {target}")

    def at_step(self, seconds: float) -> FixedOptions:
        """Return the options at the step of a run in s, by which a largest rate becomes a largest increment."""
        is_needed = self.max_rate_deg_s is not None or self.lsb is not None
        return replace(self, step=Positive(repr(seconds)) if is_needed else None)

    def check_increments(self, choice: Choice) -> None:
        """Refuse a largest rate or angle for a kernel that takes neither."""
        options = {*stated(self)}
        of_gyro = options & {"--sample-hz", "--lsb", "--lsb-rad", "--input-bits"}
        of_angle = options & {"--max-rate-deg-s", "--step", "--max-angle-rad"}
        if not of_gyro and not of_angle:
            return
        from strapgen import pipeline
        from strapgen.fixedpoint.sensor_scale import counted
        from strapgen.ir.fixed_settings import ROTATION_INPUTS

        program = pipeline.program(choice)
        if of_gyro and not counted(program):
            raise InputError(
                f"kernel {choice.kernel} takes no increments; {min(of_gyro)} does not go with it"
            )
        if of_angle and not {signal.name for signal in program.inputs} & {*ROTATION_INPUTS}:
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
        from strapgen.run.backends import BACKENDS

        if not BACKENDS[backend].fixed:
            for name in stated(self):
                raise InputError(f"{name} is for fixed-point back ends, not for {backend}")

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
