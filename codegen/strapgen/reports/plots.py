"""Plots; they need the extra `plot`."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from strapgen.experiments.word_length import Outcome
from strapgen.reports.runs import AXES, SKEW_PLANES
from strapgen.simulation.recording import History
from strapgen.simulation.runs import Run
from strapgen.support.exceptions import InputError, MissingExtraError
from strapgen.support.files import write_file

if TYPE_CHECKING:
    from strapgen.analysis.agreement import Agreement
    from strapgen.analysis.growth import Stability
    from strapgen.experiments.convergence import Convergence
    from strapgen.vibration.curves import Curve

_COLOURS = ("#1f5f8b", "#b5562b", "#3d7a4f")


def _pyplot() -> Any:
    try:
        import matplotlib
    except ImportError:
        raise MissingExtraError("plots need matplotlib: pip install 'strapgen[plot]'") from None
    matplotlib.use("Agg")
    import matplotlib.pyplot as pyplot

    return pyplot


def require_kind(path: str | Path) -> str:
    """Return the kind of image that a file's ending says.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    InputError
        If the kind is unknown.
    """
    _pyplot()
    from matplotlib.backend_bases import FigureCanvasBase

    kind = Path(path).suffix.lstrip(".").lower()
    allowed = sorted(FigureCanvasBase.get_supported_filetypes())
    if kind not in allowed:
        raise InputError(f"plot {path}: file type {kind!r} is not known; allowed: {', '.join(allowed)}")
    return kind


def _image(figure: Any, path: str | Path) -> bytes:
    _pyplot().close(figure)  # pyplot lets go of it, it can still be drawn
    kind = require_kind(path)
    image = io.BytesIO()
    figure.savefig(image, format=kind, dpi=150)
    return image.getvalue()


def _style(axes: Any) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25, linewidth=0.6)
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3), useMathText=True)
    axes.margins(x=0)
    axes.axhline(0, color="0.6", linewidth=0.8, zorder=0)


def plot_run(run: Run, title: str, path: str | Path) -> Path:
    """Plot the nine errors of a run to a file; see `run_image`."""
    return write_file(path, run_image(run, title, path))


def plot_history(history: History, elements: Sequence[str], title: str, path: str | Path) -> Path:
    """Plot an attitude history to a file; see `history_image`."""
    return write_file(path, history_image(history, elements, title, path))


def run_image(run: Run, title: str, path: str | Path) -> bytes:
    """Return the nine errors of a run against time: scale, skew and drift, three axes each.

    Parameters
    ----------
    run : Run
    title : str
    path : path
        File for the image; its ending says which kind.

    Returns
    -------
    bytes
        The content of the file.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    InputError
        If the kind of image is unknown.
    """
    pyplot = _pyplot()
    figure, grid = pyplot.subplots(3, 3, figsize=(12, 8), sharex=True, layout="constrained")
    parts = (
        ("scale", "", run.scale, AXES),
        ("skew", ", deg", np.degrees(run.skew), SKEW_PLANES),
        ("drift", ", deg", np.degrees(run.drift), AXES),
    )
    for row, (kind, unit, values, names) in enumerate(parts):
        for column, name in enumerate(names):
            axes = grid[row, column]
            axes.plot(run.time, values[:, column], color=_COLOURS[row], linewidth=1.4)
            axes.set_title(f"{name} {kind}{unit}", loc="left", fontsize=10)
            _style(axes)
            if row == 2:
                axes.set_xlabel("time, s")
    figure.suptitle(title.encode(errors="replace").decode(), fontsize=12)
    return _image(figure, path)


def history_image(history: History, elements: Sequence[str], title: str, path: str | Path) -> bytes:
    """Return the elements of an attitude history against time; parameters and errors are those of `run_image`."""
    pyplot = _pyplot()
    states = history.states.reshape(len(history.time), -1)
    columns = 3 if len(elements) == 9 else 1
    rows = -(-len(elements) // columns)
    figure, grid = pyplot.subplots(
        rows,
        columns,
        figsize=(10, 1.9 * rows + 0.6),
        sharex=True,
        sharey=True,
        layout="constrained",
        squeeze=False,
    )
    for axes, name, values in zip(grid.flat, elements, states.T, strict=True):
        axes.plot(history.time, values, color=_COLOURS[0], linewidth=1.2)
        axes.set_title(name, loc="left", fontsize=10)
        _style(axes)
        axes.ticklabel_format(axis="y", style="plain")
        axes.set_ylim(-1.05, 1.05)
    for axes in grid[-1]:
        axes.set_xlabel("time, s")
    figure.suptitle(title.encode(errors="replace").decode(), fontsize=12)
    return _image(figure, path)


def study_image(outcomes: Sequence[Outcome], path: str | Path) -> bytes:
    """Return drift against word length: a panel for each method, step and pulse, a line for each rounding and carry.

    Dotted, in the colour of its line, the certified bound of the rounding, on top of what else moves the drift; dashed
    the floor of the method, and where gyro pulses set a higher one, that.

    Parameters
    ----------
    outcomes : sequence of Outcome
    path : path
        File for the image; its ending says which kind.

    Returns
    -------
    bytes
        The content of the file.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    InputError
        If the kind of image is unknown.
    """
    pyplot = _pyplot()
    panels: dict[tuple[str, str, str], list[Outcome]] = {}
    for outcome in outcomes:
        case = outcome.case
        panels.setdefault((case.method, case.step, case.pulse_arcsec), []).append(outcome)
    columns = min(3, len(panels))
    rows = -(-len(panels) // columns)
    figure, grid = pyplot.subplots(
        rows,
        columns,
        figsize=(2.6 + 4.6 * columns, 0.9 + 3.9 * rows),
        sharex=True,
        sharey=True,
        layout="constrained",
        squeeze=False,
    )
    for axes, ((method, step, pulse), group) in zip(grid.flat, panels.items(), strict=False):
        _study_panel(axes, group)
        pulses = "" if float(pulse) == 0 else f", pulses of {pulse}\u2033"
        axes.set_title(f"{method}, step {step} s{pulses}", loc="left", fontsize=10)
    for axes in list(grid.flat)[len(panels) :]:
        axes.set_visible(False)
    for axes in grid[-1]:
        axes.set_xlabel("word, bits")
    for axes in grid[:, 0]:
        axes.set_ylabel("largest drift of the run, deg")
    found: dict[str, Any] = {}
    for axes in list(grid.flat)[: len(panels)]:
        handles, labels = axes.get_legend_handles_labels()
        found |= dict(zip(labels, handles, strict=True))
    figure.legend(found.values(), found.keys(), loc="outside right center", frameon=False, fontsize=9)
    case = outcomes[0].case
    words = ", ".join(f"{key}={value}" for key, value in case.settings)
    title = f"{case.algorithm}: drift against word length\n{case.duration} s of {case.motion} motion, {words}"
    figure.suptitle(title, fontsize=11, x=0.01, ha="left")
    return _image(figure, path)


def convergence_image(found: Sequence[Convergence], title: str, path: str | Path) -> bytes:
    """Return error against step, a line an algorithm, beside a line of the slope that theory says.

    Parameters
    ----------
    found : sequence of Convergence
    title : str
    path : path
        File for the image; its ending says which kind.

    Returns
    -------
    bytes
        The content of the file.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    InputError
        If the kind of image is unknown.
    """
    pyplot = _pyplot()
    figure, axes = pyplot.subplots(figsize=(8.0, 6.0), layout="constrained")
    colours = pyplot.get_cmap("viridis")(np.linspace(0.0, 0.85, len(found)))
    for number, (one, colour) in enumerate(zip(found, colours, strict=True)):
        rungs = [rung for rung in one.rungs if rung.error_rad]
        steps = [rung.step_s for rung in rungs]
        errors = [rung.error_rad for rung in rungs]
        slope = "order hidden" if one.observed is None else f"{one.observed:.2f}"
        theory = "" if one.predicted is None else f", theory {one.predicted}"
        marker = "osD^v<>p"[number % 8]
        axes.plot(steps, errors, color=colour, linewidth=1.2, alpha=0.6)
        for used in (True, False):  # filled where the slope is fitted
            chosen = [k for k, rung in enumerate(rungs) if rung.used is used]
            axes.plot(
                [steps[k] for k in chosen],
                [errors[k] for k in chosen],
                linestyle="none",
                marker=marker,
                markersize=5.5,
                color=colour,
                markerfacecolor=colour if used else "white",
                label=f"{one.kernel}: {slope}{theory}" if used else None,
            )
        fitted = [rung for rung in rungs if rung.used and rung.error_rad]
        if one.predicted is not None and fitted:
            anchor = fitted[-1]
            wide = np.array([anchor.step_s, max(steps)])
            line = (anchor.error_rad or 0.0) * (wide / anchor.step_s) ** one.predicted
            axes.plot(wide, line, color=colour, linewidth=0.9, linestyle="--")
    axes.set_xscale("log", base=2)
    if any(rung.error_rad for one in found for rung in one.rungs):  # else all are exact: nothing to draw
        axes.set_yscale("log")
        axes.set_ylim(top=10)
    ticks = sorted({rung.step_s for one in found for rung in one.rungs})
    axes.set_xticks(ticks, [_fraction(step) for step in ticks])
    axes.minorticks_off()
    axes.set_xlabel("step, s")
    axes.set_ylabel("largest error, rad")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25, linewidth=0.6)
    axes.legend(
        alignment="left",
        title="order: slope of filled points; theory is dashed",
        title_fontsize=9,
        frameon=True,
        framealpha=0.85,
        edgecolor="none",
        fontsize=9,
        loc="lower right",
    )
    axes.set_title(title.encode(errors="replace").decode(), loc="left", fontsize=11)
    return _image(figure, path)


def agreement_image(found: Sequence[Agreement], title: str, path: str | Path) -> bytes:
    """Return predicted against simulated drift: over time at the longest step, and their difference against the step.

    Parameters
    ----------
    found : sequence of Agreement
        Of one run, predicted by one term, two, and so on.
    title : str
    path : path
        File for the image; its ending says which kind.

    Returns
    -------
    bytes
        The content of the file.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    InputError
        If the kind of image is unknown.
    """
    pyplot = _pyplot()
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(11.5, 4.8), layout="constrained")
    first = found[-1].rungs[0]
    for axis, (name, colour) in enumerate(zip("xyz", _COLOURS, strict=True)):
        left.plot(
            first.times, [row[axis] for row in first.predicted], color=colour, label=f"{name}, predicted"
        )
        left.plot(
            first.times,
            [row[axis] for row in first.simulated],
            linestyle="none",
            marker="o",
            markersize=4.5,
            markerfacecolor="white",
            color=colour,
            label=f"{name}, simulated",
        )
    _style(left)
    left.set_xlabel("time, s")
    left.set_ylabel("drift, rad")
    left.set_title(f"step {_fraction(first.step_s)} s", loc="left", fontsize=10)
    left.legend(frameon=False, fontsize=9, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.14))
    steps = [rung.step_s for rung in found[0].rungs]
    drifts = [rung.drift or math.nan for rung in found[0].rungs]
    right.plot(steps, drifts, color="0.35", marker="o", markersize=4.5, label="simulated drift")
    for one, colour in zip(found, _COLOURS, strict=False):
        differences = [rung.difference or math.nan for rung in one.rungs]
        terms = "the leading term" if one.terms == 1 else f"{one.terms} powers of h"
        slope = f": slope {one.slopes[-1]:.2f}" if one.slopes else ""
        right.plot(steps, differences, color=colour, marker="s", markersize=4.5, label=f"less {terms}{slope}")
    right.set_xscale("log", base=2)
    if any(value > 0 for value in drifts):
        right.set_yscale("log")
    right.set_xticks(steps, [_fraction(step) for step in steps])
    right.minorticks_off()
    right.set_xlabel("step, s")
    right.set_ylabel("largest over the run, rad")
    right.spines[["top", "right"]].set_visible(False)
    right.grid(alpha=0.25, linewidth=0.6)
    right.set_title("what the prediction leaves", loc="left", fontsize=10)
    right.legend(frameon=False, fontsize=9)
    figure.suptitle(title.encode(errors="replace").decode(), fontsize=11, x=0.01, ha="left")
    return _image(figure, path)


def stability_image(found: Sequence[Stability], title: str, path: str | Path) -> bytes:
    """Return the growth of a state at a constant rate against the angle of a step; below, where the step contracts.

    Parameters
    ----------
    found : sequence of Stability
    title : str
    path : path
        File for the image; its ending says which kind.

    Returns
    -------
    bytes
        The content of the file.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    InputError
        If the kind of image is unknown.
    """
    pyplot = _pyplot()
    ends = [end for one in found for pair in one.contractive or () for end in pair if end is not None]
    reach = 1.15 * max([*ends, 2.0])
    figure, (curves, bars) = pyplot.subplots(
        2,
        1,
        figsize=(9.5, 4.6 + 0.28 * len(found)),
        height_ratios=(4.0, 0.4 + 0.28 * len(found)),
        sharex=True,
        layout="constrained",
    )
    colours = pyplot.get_cmap("viridis")(np.linspace(0.0, 0.88, len(found)))
    angles = np.linspace(0.0, reach, 600)
    for number, (one, colour) in enumerate(zip(found, colours, strict=True)):
        curves.plot(angles, one.stretch(angles), color=colour, linewidth=1.5, label=one.kernel)
        place = len(found) - 1 - number
        whole = one.contractive is None
        for low, high in [(0.0, None)] if whole else one.contractive or ():
            wide = (reach if high is None else high) - low
            bars.barh(place, wide, left=low, height=0.55, color=colour, alpha=0.35 if whole else 0.9)
        if not whole and not one.contractive:
            bars.text(0.01 * reach, place, "nowhere", va="center", fontsize=8, color="0.35")
        if whole:
            bars.text(0.01 * reach, place, "length kept", va="center", fontsize=8, color="0.2")
    curves.axhline(1.0, color="0.35", linewidth=0.9)
    curves.axhspan(0.0, 1.0, color="0.5", alpha=0.08, linewidth=0)
    curves.set_ylim(0.0, 2.0)
    curves.set_ylabel("length of the state after a step")
    curves.legend(frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(1.0, 1.02))
    bars.set_yticks(range(len(found)), [one.kernel for one in reversed(found)], fontsize=9)
    bars.set_ylim(-0.6, len(found) - 0.4)
    bars.set_title("where no state grows", loc="left", fontsize=10)
    bars.set_xlabel("angle of a step |w| h, rad")
    bars.set_xlim(0.0, reach)
    for axes in (curves, bars):
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(alpha=0.25, linewidth=0.6, axis="both" if axes is curves else "x")
    figure.suptitle(title.encode(errors="replace").decode(), fontsize=11, x=0.01, ha="left")
    return _image(figure, path)


def vibration_image(
    curves: Sequence[tuple[str, Curve]], title: str, path: str | Path, mark_hz: float | None = None
) -> bytes:
    """Return the errors of algorithms under vibration against frequency: drift in deg/h, acceleration in micro-g.

    Parameters
    ----------
    curves : sequence of (str, Curve)
        Labels and curves; those in rad/s and those in m/s^2 have a panel each.
    title : str
    path : path
        File for the image; its ending says which kind.
    mark_hz : float, optional
        A frequency to mark.

    Returns
    -------
    bytes
        The content of the file.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    InputError
        If the kind of image is unknown.
    """
    pyplot = _pyplot()
    panels = {unit: [(label, curve) for label, curve in curves if curve.unit == unit] for unit in _VIBRATION}
    panels = {unit: group for unit, group in panels.items() if group}
    figure, grid = pyplot.subplots(
        len(panels),
        1,
        figsize=(8.5, 1.0 + 3.4 * len(panels) + 0.11 * len(curves)),
        sharex=True,
        layout="constrained",
        squeeze=False,
    )
    labels = list(dict.fromkeys(label for label, _ in curves))
    for axes, (unit, group) in zip(grid[:, 0], panels.items(), strict=True):
        words, factor = _VIBRATION[unit]
        hertz, true = group[0][1].frequencies_hz, np.abs(group[0][1].continuous) * factor
        axes.plot(hertz, true, color="0.45", linewidth=1.3, linestyle="--", label="true rate")
        for label, curve in group:
            place = labels.index(label)
            axes.plot(
                curve.frequencies_hz,
                np.abs(curve.error) * factor,
                color=_MANY_COLOURS[place % len(_MANY_COLOURS)],
                linestyle=_LINES[place // len(_MANY_COLOURS) % len(_LINES)],
                linewidth=3.0
                - 1.8 * place / max(1, len(labels) - 1),  # equal errors: one line inside the other
                label=f"error of {label}",
            )
        if mark_hz and hertz[0] <= mark_hz <= hertz[-1]:
            axes.axvline(mark_hz, color="0.6", linewidth=0.9, zorder=0)
            axes.annotate(
                f"{mark_hz:g} Hz",
                (mark_hz, 0.0),
                xycoords=("data", "axes fraction"),
                xytext=(4, 5),
                textcoords="offset points",
                fontsize=8.5,
                color="0.4",
            )
        axes.set_xscale("log")
        if np.any(true):
            axes.set_yscale("log")
            highest = float(true.max())
            lowest = min(
                float(np.min(np.abs(curve.error[curve.error != 0]), initial=1.0)) for _, curve in group
            )
            axes.set_ylim(max(lowest * factor / 3, highest * _LOWEST), highest * 8)
        axes.set_ylabel(words)
        axes.set_xlim(hertz[0], hertz[-1])
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(alpha=0.25, linewidth=0.6)
    grid[-1, 0].set_xlabel("frequency, Hz")
    found: dict[str, Any] = {}
    for axes in grid[:, 0]:
        handles, texts = axes.get_legend_handles_labels()
        found |= dict(zip(texts, handles, strict=True))
    figure.legend(
        found.values(), found.keys(), loc="outside lower center", ncols=2, frameon=False, fontsize=9
    )
    figure.suptitle(title.encode(errors="replace").decode(), fontsize=11, x=0.01, ha="left")
    return _image(figure, path)


#: What is drawn of rates under vibration, and the factor to it.
_VIBRATION = {
    "rad/s": ("mean drift, deg/h", math.degrees(3600)),
    "m/s^2": ("mean acceleration, micro-g", 1e6 / 9.80665),
}
#: The lowest error that is drawn, as a part of the highest true rate.
_LOWEST = 1e-9
_MANY_COLOURS = (*_COLOURS, "#8a4f9e", "#c79a1b", "#2a9d9d", "#a83250", "#6b6b6b")
_LINES = ("-", (0, (5, 2)), (0, (1, 1.5)))


def _fraction(number: float) -> str:
    """Return a number as one part of a whole where it is one."""
    parts = round(1 / number)
    return f"1/{parts}" if parts > 1 and abs(parts * number - 1) < 1e-9 else f"{number:g}"


def _study_panel(axes: Any, group: Sequence[Outcome]) -> None:
    """Draw the outcomes of one method, step and pulse."""
    lines: dict[tuple[str, str], list[Outcome]] = {}
    for outcome in group:
        lines.setdefault((outcome.case.rounding, outcome.case.carry), []).append(outcome)
    for number, ((rounding, carry), line) in enumerate(lines.items()):
        ordered = sorted(line, key=lambda outcome: outcome.case.word)
        words = [outcome.case.word for outcome in ordered]
        drifts = [math.nan if outcome.drift_deg is None else outcome.drift_deg for outcome in ordered]
        certified = [
            math.nan if o.bound_deg is None else o.bound_deg + o.truncation_deg + o.quantization_deg
            for o in ordered
        ]
        colour = _COLOURS[number % len(_COLOURS)]
        kept = {"none": "no residuals", "state": "residuals of the state", "full": "all residuals"}[carry]
        label = kept if rounding == "nearest" else f"{kept}, {rounding}"
        # Lines that fall together stay apart by their markers.
        style = {"marker": "osD^v<>"[number % 7], "markersize": 7 - 1.5 * (number % 3), "fillstyle": "none"}
        axes.plot(words, drifts, color=colour, linewidth=1.4, label=label, **style)
        axes.plot(
            words,
            certified,
            color=colour,
            linewidth=1.0,
            linestyle=":",
            alpha=0.9,
            label=f"{label}: certified",
        )
    first = group[0]
    axes.axhline(
        first.truncation_deg, color="0.35", linewidth=1.0, linestyle="--", label="floor of the method"
    )
    longest = max(group, key=lambda outcome: outcome.case.word)
    if float(longest.case.pulse_arcsec) and longest.quantization_deg > first.truncation_deg:
        axes.axhline(
            longest.quantization_deg, color="0.35", linewidth=1.0, linestyle="-.", label="floor of the pulses"
        )
    axes.set_xticks(sorted({outcome.case.word for outcome in group}))
    axes.set_yscale("log")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25, linewidth=0.6)
    # More than half a turn is as wrong as can be.
    low = min((o.truncation_deg for o in group if o.truncation_deg), default=1e-12)
    axes.set_ylim(low / 10, 360)
