"""Plots: nine axes with the errors of the run, an image file of the kind that is asked for, clear refusals."""

from __future__ import annotations

import os
import subprocess
import sys
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

import strapgen
from strapgen.analysis.analysis_plots import vibration_image
from strapgen.analysis.vibration.mean_rates import Curve
from strapgen.analysis.vibration.vibration_report import VibrationResult
from strapgen.design.design_plots import frontier_image
from strapgen.design.frontier import MOTIONS, DriftAndCost, FrontierResult
from strapgen.ir.exceptions import InputError, MissingExtraError
from strapgen.ir.kernel_info import Order
from strapgen.lab.comparison import AngleHistory, Comparison
from strapgen.lab.comparison_report import ComparedKernel, ComparisonResult, comparison_image
from strapgen.lab.convergence import Convergence, StepError
from strapgen.lab.convergence_report import ConvergenceResult, convergence_image
from strapgen.lab.recordings.recording import History
from strapgen.lab.runs import Run, simulate
from strapgen.lab.runs_report import HistoryResult, RunResult, history_image, run_image
from strapgen.navigation.rate_table import RateTableResult, Row, rate_table_image
from strapgen.results import figures as drawing
from strapgen.thesis.predicted_tables import PredictedEntry, PredictedTablesResult
from strapgen.thesis.tables_report import ThesisTablesResult, predicted_tables_image, thesis_tables_image
from strapgen.thesis.thesis_tables import ALGORITHMS, ORDERS, TABLES, TableEntry

pyplot = pytest.importorskip("matplotlib.pyplot")
# A layout that does not fit is a warning.
pytestmark = pytest.mark.filterwarnings("error")


@pytest.fixture(scope="module")
def run() -> Run:
    motion = strapgen.motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)
    return simulate(strapgen.backend("euler", "rk1", 2, "numpy"), motion, "0.125", 20)


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list:
    """Return the figures as they are saved, without drawing them."""
    saved: list = []

    def keep(figure, path):
        pyplot.close(figure)
        saved.append(figure)
        return b""

    monkeypatch.setattr(drawing, "image", keep)
    return saved


@pytest.fixture(autouse=True)
def all_figures_are_closed():
    yield
    assert pyplot.get_fignums() == []


def test_nine_axes_show_the_nine_errors(run, figures):
    run_image(RunResult({}, run, "A title"), "run.png")
    (figure,) = figures
    assert figure.get_suptitle() == "A title"
    assert len(figure.axes) == 9
    parts = [
        ("{} scale", "xyz", run.scale),
        ("{} skew, deg", ("y-z", "z-x", "x-y"), np.degrees(run.skew)),
        ("{} drift, deg", "xyz", np.degrees(run.drift)),
    ]
    for row, (title, names, values) in enumerate(parts):
        for column, name in enumerate(names):
            axes = figure.axes[3 * row + column]
            assert axes.get_title(loc="left") == title.format(name)
            curve = axes.get_lines()[0]
            np.testing.assert_array_equal(curve.get_xdata(), run.time)
            np.testing.assert_array_equal(curve.get_ydata(), values[:, column])
    assert [axes.get_xlabel() for axes in figure.axes] == [""] * 6 + ["time, s"] * 3


@pytest.mark.parametrize(("shape", "grid"), [((3, 3), (3, 3)), ((4,), (4, 1))])
def test_history_has_an_axis_for_each_element(shape, grid, figures, rng):
    states = rng.normal(size=(10, *shape))
    elements = tuple(f"element {k}" for k in range(states[0].size))
    history = History(np.arange(10.0), states, 1.0, 0, elements)
    history_image(HistoryResult({}, history, "A title"), "history.png")
    (figure,) = figures
    assert figure.axes[0].get_gridspec().get_geometry() == grid
    for k, axes in enumerate(figure.axes):
        assert axes.get_title(loc="left") == f"element {k}"
        np.testing.assert_array_equal(axes.get_lines()[0].get_ydata(), states.reshape(10, -1)[:, k])


def test_convergence_has_a_line_and_a_theory_for_each_algorithm(figures):
    rungs = tuple(StepError(2.0**-k, 2.0 ** (-4 * k), None if k == 1 else 4.0, k > 2) for k in range(1, 6))
    found = [
        Convergence("euler-rk4-2", "exact", Order(4, 4, 2, 4), rungs, 4.0),
        Convergence("mine", "exact", None, (StepError(0.5, None), *rungs[1:]), None),
    ]
    convergence_image(ConvergenceResult(found, "A title"), "orders.png")
    (figure,) = figures
    (axes,) = figure.axes
    curve, theory = axes.get_lines()[0], axes.get_lines()[3]
    np.testing.assert_array_equal(curve.get_xdata(), [rung.step_s for rung in rungs])
    # The dashed line goes through the finest fitted point with the slope of theory: here it is the curve.
    np.testing.assert_allclose(theory.get_ydata(), theory.get_xdata() ** 4, rtol=1e-12)
    words = {text.get_text() for text in axes.texts}
    assert words == {"euler-rk4-2: 4.00, theory 4", "mine: order hidden"}
    assert next(label.get_text() for label in axes.get_xticklabels()) == "1/32"


def test_vibration_has_a_panel_for_drift_and_one_for_acceleration(figures):
    hertz = np.geomspace(1, 100, 30)
    curves = [
        (label, Curve(label, unit, hertz, true * hertz, part * hertz**3))
        for label, part in (("one", 1e-9), ("two", -1e-8))
        for unit, true in (("rad/s", 1e-6), ("m/s^2", 1e-3))
    ]
    vibration_image(VibrationResult([], [], "", curves, "A title", 10.0), "vibration.png")
    (figure,) = figures
    drift, acceleration = figure.axes
    assert (drift.get_ylabel(), acceleration.get_ylabel()) == (
        "mean drift, deg/h",
        "mean acceleration, micro-g",
    )
    for axes, factor, true in ((drift, np.degrees(3600), 1e-6), (acceleration, 1e6 / 9.80665, 1e-3)):
        lines = axes.get_lines()
        assert [line.get_label() for line in lines[:3]] == ["true rate", "error of one", "error of two"]
        np.testing.assert_allclose(lines[0].get_ydata(), true * hertz * factor)
        np.testing.assert_allclose(lines[2].get_ydata(), 1e-8 * hertz**3 * factor)
    assert len(figure.legends[0].get_texts()) == 3
    still = [("still", Curve("still", "rad/s", hertz, 0 * hertz, 0 * hertz))]
    vibration_image(VibrationResult([], [], "", still, "Nothing moves"), "vibration.png")


def test_comparison_has_a_line_and_a_bound_for_each_back_end(figures):
    def row(backend, angles, bounds=()):
        history = AngleHistory(np.array(angles), bounds)
        return Comparison(backend, max(angles), 0.0, 0.0, None, 0.0, 1.0, None, {}, history)

    long = np.zeros(5001)
    long[777] = 1e-5
    kernels = [
        ComparedKernel(
            "euler-rk4-2",
            "euler-rk4-2: a run",
            [
                row("numpy", [0.0, 0.0, 0.0]),
                row("c-float", [0.0, 1e-7, 2e-7]),
                row("c-fixed16", [0.0, 1e-4, 2e-4], ((1, 2e-4), (2, 4e-4))),
                row("c-fixed32", [0.0, 1e-8, 2e-8], ((1, 1.0), (2, 100.0))),
            ],
            0.125,
        ),
        ComparedKernel("mine", "mine: a run", [row("c", list(long))], 0.5),
        ComparedKernel("still", "still: a run", [row("c", [0.0])]),
    ]
    comparison_image(ComparisonResult(kernels, "exact", "drift"), "compare.png")
    (figure,) = figures
    first, second, _, unused = figure.axes
    assert first.get_title(loc="left") == "euler-rk4-2\na run" and not unused.get_visible()
    assert (first.get_ylabel(), second.get_xlabel()) == ("angle from exact, rad", "time, s")
    _, single, short, bound, *_ = first.get_lines()
    for line, values in ((single, [1e-7, 2e-7]), (short, [1e-4, 2e-4]), (bound, [2e-4, 4e-4])):
        np.testing.assert_array_equal(line.get_ydata(), values)
        np.testing.assert_allclose(line.get_xdata(), [0.125, 0.25])
    assert bound.get_color() == short.get_color() != single.get_color() and bound.get_linestyle() == ":"
    labels = {text.get_text(): text.get_position()[1] for text in first.texts}
    assert list(labels) == ["numpy: equal", "c-fixed32", "c-float", "c-fixed16", "c-fixed16, certified"]
    assert all(other - one > 0.02 for one, other in pairwise(labels.values()))
    assert first.get_ylim()[1] <= 4  # half a turn
    (line,) = second.get_lines()
    assert len(line.get_xdata()) < 1000 and np.nanmax(line.get_ydata()) == 1e-5
    assert first.get_xlim() == second.get_xlim() == (0, 2500)


def test_labels_at_the_right_do_not_overlap():
    figure, grid = drawing.grid_of_axes(1, 1, (5, 3))
    drawing.labels_at_the_right(
        grid[0, 0], [(1.0, "a", "k"), (0.0, "b", "k"), (1.0, "c", "k"), (9.0, "d", "k")]
    )
    places = {text.get_text(): text.get_position()[1] for text in grid[0, 0].texts}
    pyplot.close(figure)
    heights = [places[name] for name in "bacd"]
    assert heights[0] == 0 and heights[-1] == 1
    assert all(other - one > 0.04 for one, other in pairwise(heights))


def test_labels_beside_points_do_not_overlap():
    figure, axes = pyplot.subplots()
    points = {f"algorithm {k}": (0.5 + 0.01 * k, 0.5 - 0.01 * k) for k in range(5)} | {
        "at the left": (0.0, 0.2)
    }
    axes.set(xlim=(0, 1), ylim=(0, 1))
    figure.draw_without_rendering()
    drawing.labels_beside_points(axes, points, dict.fromkeys(points, "black"))
    assert [text.get_text() for text in axes.texts] == list(points)  # one for each
    boxes = [text.get_window_extent() for text in axes.texts]
    assert not [1 for k, one in enumerate(boxes) for other in boxes[:k] if one.overlaps(other)]
    frame = axes.get_window_extent()
    assert all(frame.x0 <= box.x0 and box.x1 <= frame.x1 for box in boxes)
    pyplot.close(figure)


def drift_and_cost(name: str, multiply: int, drift: float | None) -> DriftAndCost:
    return DriftAndCost(name, name, "source", 1, multiply, 0, 0, dict.fromkeys(MOTIONS, drift))


@pytest.mark.long
def test_the_frontier_has_a_panel_a_motion_and_labels_for_the_best(figures):
    drifts_and_costs = [
        drift_and_cost("cheap", 10, 5.0),
        drift_and_cost("worse", 20, 6.0),
        drift_and_cost("little better", 30, 4.9),
        drift_and_cost("good", 40, 1e-3),
        drift_and_cost("lost", 50, None),
    ]
    frontier_image(FrontierResult(drifts_and_costs, 100.0, 2.0), "a.png")
    (figure,) = figures
    assert [axes.get_title("left") for axes in figure.axes][:2] == [
        "cone of 1 deg at 10 Hz",
        "cone of 1 deg at 20 Hz",
    ]
    for axes in figure.axes:
        assert [text.get_text() for text in axes.texts] == ["cheap", "good"]
        (front,) = axes.get_lines()
        every = np.concatenate(
            [points.get_offsets() for points in axes.collections if len(points.get_offsets())]
        )
        np.testing.assert_array_equal(every[:, 0], [1000, 2000, 3000, 4000])
        np.testing.assert_array_equal(front.get_ydata(), [5.0, 1e-3])
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")


def test_thesis_tables_have_a_panel_each_with_printed_and_computed_figures(figures):
    entries = [
        TableEntry(
            table.number,
            backend,
            algorithm,
            order,
            0.5,
            factor * float(Fraction(printed)),
            printed,
            factor < 2,
        )
        for table in TABLES
        for backend, factor in (("numpy", 1.0), ("c-fixed16", 3.0))
        for algorithm in ALGORITHMS
        for order, printed in zip(ORDERS, table.printed[algorithm], strict=True)
    ]
    thesis_tables_image(ThesisTablesResult(entries), "tables.png")
    predicted = [
        PredictedEntry(4, e.algorithm, e.order, 0.5, e.normalised, 0.5, 1.0, e.thesis, True)
        for e in entries
        if (e.table, e.backend) == (4, "numpy")
    ]
    predicted_tables_image(PredictedTablesResult(predicted, []), "predicted.png")
    whole, single = figures
    assert [axes.get_visible() for axes in whole.axes] == [True] * 5 + [False]
    for axes, table in zip(whole.axes, TABLES, strict=False):
        assert " ".join(axes.get_title(loc="left").split()).startswith(f"Table {table.number}: {table.title}")
        bars = [bar.get_segments()[0][0][1] for bar in axes.collections]
        printed = [float(Fraction(figure)) for name in ALGORITHMS for figure in table.printed[name]]
        assert bars == printed
        brackets = [line for text in axes.texts for line in text.get_text().splitlines()[1:]]
        assert brackets == [f"[{each.scan}]" for each in table.repairs if each.algorithm]
        marks = [
            (float(line.get_ydata()[0]), line.get_markerfacecolor() == "white") for line in axes.get_lines()
        ]
        assert marks == [(figure * 1.0, False) for figure in printed] + [
            (figure * 3.0, True) for figure in printed
        ]
        middles = [bar.get_segments()[0].mean(axis=0)[0] for bar in axes.collections]
        assert [round(middle) for middle in middles] == [0, 1, 2] * 2
        for line, middle in zip(axes.get_lines(), middles * 2, strict=True):
            assert abs(line.get_xdata()[0] - middle) < 0.2
    words = [text.get_text() for text in single.legends[0].get_texts()]
    assert {"figure of the thesis", "direction cosines", "Euler parameters", "predicted", "simulated"} < {
        *words
    }
    assert (
        sum(line.get_markerfacecolor() == "white" for line in single.axes[0].get_lines()) == 4
    )  # 1.0 is "1"


def test_rate_table_plot_has_panels_and_marks_values_out_of_range(figures):
    names = ("dcm-rk4-2", "euler-rk4-2", "euler two-speed")
    drifts = {"numpy": (1e-6, 1e-8, 1e-13), "c-fixed16": (0.3, None, 0.1)}
    rows = [
        Row(motion, name, backend, drift, None if drift is None else 88.25)
        for motion in ("linear", "oscillating")
        for backend, column in drifts.items()
        for name, drift in zip(names, column, strict=True)
    ]
    rate_table_image(RateTableResult(rows, "20", "0.01"), "rate.png")
    (figure,) = figures
    for axes, motion in zip(figure.axes, ("linear", "oscillating"), strict=True):
        assert axes.get_title(loc="left").startswith(motion)
        assert axes.get_xlabel() == "largest drift of the run, deg"
        for line, column in zip(axes.get_lines(), drifts.values(), strict=False):
            np.testing.assert_array_equal(line.get_xdata(), np.array(column, float))
        assert "out of range: c-fixed16" in [text.get_text() for text in axes.texts]
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == list(names)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == list(drifts)
    assert "70 deg/s" in figure.get_suptitle()


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "head"),
    [
        ("run.png", b"\x89PNG\r\n\x1a\n"),
        ("run.PDF", b"%PDF-"),
        ("run.svg", b"<?xml"),
    ],
)
def test_image_is_of_the_kind_that_the_ending_says(name, head):
    figure, grid = drawing.grid_of_axes(1, 1, (2, 2))
    grid[0, 0].plot([0, 1], [1, 2])
    assert drawing.image(figure, name).startswith(head)


@pytest.mark.long
def test_a_run_is_drawn_into_a_file_in_a_new_folder(run, tmp_path):
    path = run.plot(tmp_path / "new" / "run.png", "A title")
    assert path == tmp_path / "new" / "run.png"
    assert path.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    assert [p.name for p in path.parent.iterdir()] == ["run.png"]


@pytest.mark.parametrize("name", ["run.docx", "run", "png", "run.pgf"])
def test_unknown_ending(name):
    with pytest.raises(
        InputError, match=r"^plot .*: file type '(docx|pgf)?' is not known; allowed: .*png.*svg"
    ):
        drawing.require_kind(name)


def test_folder_that_cannot_be_written(run, figures, tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match=r"cannot be written"):
        run.plot(tmp_path / "file" / "run.png", "A title")


def test_without_matplotlib(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r"^plots need matplotlib: pip install 'strapgen\[plot\]'$"):
        run.plot(tmp_path / "run.png", "A title")
    assert issubclass(MissingExtraError, ImportError)


def test_no_screen_is_needed(run, figures, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setenv("MPLBACKEND", "tkagg")
    run_image(RunResult({}, run, "A title"), "run.png")
    assert pyplot.get_backend().lower() == "agg"


@pytest.mark.long
def test_the_users_plotting_backend_is_kept(tmp_path):
    code = (
        "from strapgen.results import figures; figures.pyplot(); import os; print(os.environ['MPLBACKEND'])"
    )
    environment = {**os.environ, "MPLBACKEND": "module://of_no_package"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout == "module://of_no_package\n"


@pytest.mark.parametrize("width", [4, 7, 15])
def test_title_lies_inside_its_figure(width):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, 5), layout="constrained")
    figure.subplots()
    drawing.title(figure, "ratios of drifts, beside the figures of the thesis; " * 3)
    figure.canvas.draw()
    box = figure.get_window_extent()
    words = figure._suptitle.get_window_extent()
    assert box.x0 <= words.x0 and words.x1 <= box.x1
