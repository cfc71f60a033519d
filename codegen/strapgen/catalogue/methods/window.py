"""`Window` is the value type of a window: filters that estimate the rate over a step from samples on both sides."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, ClassVar

from strapgen.catalogue.methods.method_spec import RequestedSamples, StepSamples
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.ir import checks
from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import notebook_latex, short_repr
from strapgen.ir.renamed import renamed

#: A filter: a weight for each sample of the window, the oldest first.
Taps = tuple[Fraction, ...]


@renamed(samples="total_increments")
@dataclass(frozen=True)
class Window:
    """Filters that estimate the rate over a step from samples before it, in it and ahead of it.

    With tau from 0 to 1 over the step, its rate times its length is sum_m c_m P_m(2 tau - 1), P_m the Legendre
    polynomials. The filter m gives c_m in rad as a weighted sum of the increments d_j in rad, for each component.

    Parameters
    ----------
    name, title, source : str
        Name on the command line, name for a reader, and where the filters come from.
    increments, previous, ahead : int
        Samples of the step (N), before it (p) and after it (L).
    conditions : int
        The filters are exact for rates that are polynomials in time of a degree below this number (r).
    band : Fraction
        Highest angular frequency of the rate for which they are designed, in rad a sample.
    objective : str
        "minimax" or "mean square".
    filters : tuple of tuple of Fraction, (M + 1, p + N + L)
        Weights of the samples, the oldest first; for an ideal gyro row 0 is the sum of the samples of the step.
    gyro : Response or None
        The response that the filters take out, with its sampling frequency; None where increments are integrals of
        the rate.
    noise : Fraction
        Standard deviation of the noise of an increment, by that of the rate times the sampling interval; 0 for none.
    rotation : str
        How the rotation of the step follows from the c_m: "fourth", the rotation vector to fourth order, or "exact",
        a power series of the quaternion.
    terms : int
        Terms of that power series.
    one_sided : tuple of Window
        Filters for the same samples with fewer samples ahead, from L - 1 down to none, and after them those with
        fewer samples before the step, from none up to p - 1.
    start : tuple of Window
        Filters of the first intervals of a recording, from none up to p - 1 samples before the step: designed for less
        noise than those of `one_sided`, which take their place where there are none.
    file : str
        Path of the file; empty for a window of the catalogue.
    sibling : bool
        Whether it is one of the one-sided filters of another window.
    form : str
        "legendre" if each filter gives its coefficient, or "pair": u = F_1 times v = F_2/30 - F_0/6 gives the term of
        second order of the rotation vector where both factors are of one frequency, as in coning, and there are no
        other filters. One-sided filters are of the first form.

    Examples
    --------
    >>> from strapgen.catalogue.methods.windows import WINDOWS
    >>> window = WINDOWS["window-3-3"]
    >>> window.total_increments, window.degree, [float(round(tap, 4)) for tap in window.filters[1]]
    (7, 4, [-0.0134, 0.0996, -0.4089, 0.0, 0.4089, -0.0996, 0.0134])
    >>> [(one.name, one.previous, one.ahead) for one in window.one_sided][:2]
    [('window-4-2', 4, 2), ('window-5-1', 5, 1)]
    """

    name: str
    title: str
    source: str
    increments: int
    previous: int
    ahead: int
    conditions: int
    band: Fraction
    objective: str
    filters: tuple[Taps, ...]
    gyro: Response | None = None
    noise: Fraction = Fraction(0)
    rotation: str = "fourth"
    terms: int = 16
    one_sided: tuple[Window, ...] = ()
    start: tuple[Window, ...] = ()
    file: str = field(default="", compare=False, repr=False)
    sibling: bool = False
    form: str = "legendre"

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        samples = f"{self.previous} samples before a step of {self.increments}, {self.ahead} ahead"
        return (
            f"{self.name}: {self.title}\n{samples}; {self.objective} to {float(self.band):.4g} rad a sample"
        )

    @property
    def option(self) -> str:
        """The options that choose it on the command line."""
        if not self.file:
            return f"--method {self.name}"
        return f"--window {shlex.quote(self.file)}" + (f" --ahead {self.ahead}" if self.sibling else "")

    kind: ClassVar[str] = "window"

    @property
    def own_samples(self) -> int:
        """Increments in a step."""
        return self.increments

    @property
    def recipe(self) -> tuple[str, str, tuple[Any, ...]]:
        """Module, function and arguments that make a `Method` of it."""
        return f"{__package__}.windowed", "method", (self,)

    def select(self, asked: RequestedSamples) -> tuple[Window, StepSamples]:
        """Return the filters of the family for the requested samples, and the samples."""
        previous, ahead = asked.previous, asked.ahead
        if asked.rates:
            raise InputError(f"{self.name} takes increments; rates at nodes do not go with it")
        if asked.increments is not None and checks.count("increments", asked.increments) != self.increments:
            raise InputError(f"increments is {asked.increments}; a step of {self.name} has {self.increments}")
        beside = self.previous + self.ahead
        if ahead is None and previous is not None:
            ahead = beside - checks.count("previous", previous, smallest=0)
        chosen = self if ahead is None else self.one_sided_with(checks.count("ahead", ahead, smallest=0))
        if ahead is not None and previous not in (None, chosen.previous):
            raise InputError(
                f"previous {previous} and ahead {ahead} are no samples of {self.name}, which has {beside} "
                "beside the step"
            )
        return chosen, (chosen.increments, chosen.previous, chosen.ahead)

    def partner(self, m: int) -> Taps | None:
        """Return v for u of a pair, whose product counts; None for a filter that counts by itself."""
        if self.form != "pair" or m != 1:
            return None
        return tuple(b / 30 - a / 6 for a, b in zip(self.filters[0], self.filters[2], strict=True))

    @property
    def total_increments(self) -> int:
        """Number of increments that the filters take: p + N + L."""
        return self.previous + self.increments + self.ahead

    @property
    def degree(self) -> int:
        """Degree M of the polynomial of the rate over the step."""
        return len(self.filters) - 1

    @property
    def parity(self) -> bool:
        """Whether the filters of even m are symmetric in time and those of odd m antisymmetric."""
        return self.previous == self.ahead and all(
            row == _reversed(m, row) for m, row in enumerate(self.filters)
        )

    def mirrored(self) -> Window:
        """Return the filters of the motion that runs backwards in time, without one-sided ones.

        Raises
        ------
        InputError
            If there is a gyro, whose response has no mirror image.
        """
        if self.gyro is not None:
            raise InputError(f"{self.name} is designed for a gyro; it has no mirror image in time")
        return replace(
            self,
            name=sibling_name(self.name, self.previous, self.ahead, self.ahead, self.previous),
            title=self.title
            if self.previous == self.ahead
            else sibling_title(self.title, self.ahead, self.previous),
            previous=self.ahead,
            ahead=self.previous,
            filters=tuple(_reversed(m, row) for m, row in enumerate(self.filters)),
            one_sided=(),
            start=(),
        )

    def one_sided_with(self, ahead: int) -> Window:
        """Return the filters for the same samples with another number of them ahead of the step.

        Parameters
        ----------
        ahead : int
            From 0 to p + L; with that of this window, it is returned itself.

        Raises
        ------
        InputError
            If there are none.
        """
        if ahead == self.ahead:
            return self
        for window in self.one_sided:
            if window.ahead == ahead:
                return window
        raise InputError(f"{self.name} has no filters with {ahead} of its samples ahead")


def sibling_name(name: str, previous: int, ahead: int, new_previous: int, new_ahead: int) -> str:
    """Return the name of filters for the same samples, of which others lie before the step and ahead of it.

    Examples
    --------
    >>> sibling_name("window-7-7", 7, 7, 8, 6), sibling_name("imu", 7, 7, 14, 0)
    ('window-8-6', 'imu-14-0')
    """
    if (previous, ahead) == (new_previous, new_ahead):
        return name
    return f"{name.removesuffix(f'-{previous}-{ahead}')}-{new_previous}-{new_ahead}"


def sibling_title(title: str, previous: int, ahead: int) -> str:
    """Return the title of filters for the same samples with others before the step and ahead of it.

    Examples
    --------
    >>> sibling_title(sibling_title("Window to 1.3 rad", 8, 6), 6, 8)
    'Window to 1.3 rad; 6 samples before, 8 ahead'
    """
    return f"{title.partition('; ')[0]}; {counted(previous, 'sample')} before, {ahead} ahead"


def _reversed(m: int, row: Taps) -> Taps:
    """Return the filter of c_m for the reversed motion, whose odd coefficients have the other sign."""
    return tuple(-tap if m % 2 else tap for tap in reversed(row))
