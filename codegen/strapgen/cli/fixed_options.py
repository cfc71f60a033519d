"""Options that set the word, the rounding and the ranges of fixed-point code, shared by several commands."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from strapgen.cli.options import one, option, whole
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from fractions import Fraction

    from strapgen.catalogue import Choice
    from strapgen.ir.fixed_settings import Settings
    from strapgen.ir.sources import Sources

_Text = str | None

#: The options of a run: its formats are chosen for its own increments, or for a largest rate that is stated.
RUN_OPTIONS = ("word", "max_rate_deg_s", "rounding", "carry", "drift_allowance")


@dataclass(frozen=True)
class FixedOptions:
    """Options that set the word and the rounding of fixed-point code, and the largest numbers that it must hold."""

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
            "the state; full for those of the transition too.  [default: none]",
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
            "--max-angle-rad": self.max_angle_rad,
            "--rounding": self.rounding,
            "--carry": self.carry,
            "--drift-allowance": self.drift_allowance,
            "--range": self.ranges,
            "--fix": self.formats,
        }
        return {option: value for option, value in options.items() if value not in (None, [])}

    def settings(self, increments: int) -> Settings | None:
        """Return the settings of fixed point for so many increments in a step; None if no option is stated."""
        if not self.stated:
            return None
        from strapgen.ir.fixed_settings import Settings
        from strapgen.support import checks

        if (self.max_rate_deg_s is None) != (self.step is None):
            missing = "--step" if self.step is None else "--max-rate-deg-s"
            raise InputError(f"--max-rate-deg-s and --step go together; {missing} is missing")
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
            rounding="nearest" if self.rounding is None else self.rounding,
            carry="none" if self.carry is None else self.carry,
            **allowance,
            ranges=_numbers(self.ranges or ()),
            formats=dict(_pair("--fix", text) for text in self.formats or ()),
        )

    def at_step(self, seconds: float) -> FixedOptions:
        """Return the options with the step of a run, by which a largest rate becomes a largest increment."""
        return replace(self, step=None if self.max_rate_deg_s is None else repr(seconds))

    def check_increments(self, choice: Choice) -> None:
        """Refuse a largest rate or angle for a kernel that takes neither."""
        from strapgen.library import generated_sources

        if not {*self.stated} & {"--max-rate-deg-s", "--step", "--max-angle-rad"}:
            return
        names = {signal.name for signal in generated_sources.program(choice).inputs}
        if not names & {"increments", "turns"}:
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
        from strapgen.backends import BACKENDS
        from strapgen.support import checks

        one("--backend", backend)
        checks.choice("backend", backend, BACKENDS)
        if self.stated and not BACKENDS[backend].fixed:
            raise InputError(f"{next(iter(self.stated))} is for fixed-point back ends, not for {backend}")

    def settings_for_run(
        self, backend: str, increments: int | None, step: float, largest: Callable[[], float]
    ) -> Settings | None:
        """Return the settings of a run in fixed point: formats for the stated largest rate, or else for its increments.

        Parameters
        ----------
        backend : str
        increments : int or None
            Increments a step, None for the default.
        step : float
            Step of the run in s.
        largest : callable
            Returns the largest increment of the run in rad.

        Returns
        -------
        Settings or None
            None for a back end in floating point.

        Raises
        ------
        InputError
            If the back end's words have another length than the one stated.
        """
        from strapgen.backends import BACKENDS
        from strapgen.ir.fixed_settings import Settings

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
    from strapgen.support import checks

    pairs = (_pair("--range", text) for text in texts)
    return {name: checks.number(f"range of {name}", value, positive=True) for name, value in pairs}


def _pair(option: str, text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals or not name or not value:
        raise InputError(f"{option} {text!r} is no setting; NAME=VALUE is needed")
    return name, value
