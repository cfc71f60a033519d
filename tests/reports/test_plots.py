"""Plots: nine axes with the errors of the run, an image file of the kind that is asked for, clear refusals."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from gathering import each

import strapgen
from strapgen.experiments.convergence import Convergence, Rung
from strapgen.ir.attitude_step import Order
from strapgen.reports import plots
from strapgen.reports.plots import figures as drawing
from strapgen.simulation.recording import History
from strapgen.simulation.runs import Run, simulate
from strapgen.support.exceptions import InputError, MissingExtraError
from strapgen.vibration.curves import Curve

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
    plots.run_image(run, "A title", "run.png")
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
    elements = [f"element {k}" for k in range(states[0].size)]
    plots.history_image(History(np.arange(10.0), states, 1.0, 0), elements, "A title", "history.png")
    (figure,) = figures
    assert figure.axes[0].get_gridspec().get_geometry() == grid
    for k, axes in enumerate(figure.axes):
        assert axes.get_title(loc="left") == f"element {k}"
        np.testing.assert_array_equal(axes.get_lines()[0].get_ydata(), states.reshape(10, -1)[:, k])


def test_convergence_has_a_line_and_a_theory_for_each_algorithm(figures):
    rungs = tuple(Rung(2.0**-k, 2.0 ** (-4 * k), None if k == 1 else 4.0, k > 2) for k in range(1, 6))
    found = [
        Convergence("euler-rk4-2", "exact", Order(4, 4, 2, 4), rungs, 4.0),
        Convergence("mine", "exact", None, (Rung(0.5, None), *rungs[1:]), None),
    ]
    plots.convergence_image(found, "A title", "orders.png")
    (figure,) = figures
    (axes,) = figure.axes
    curve, theory = axes.get_lines()[0], axes.get_lines()[3]
    np.testing.assert_array_equal(curve.get_xdata(), [rung.step_s for rung in rungs])
    # The dashed line goes through the finest fitted point with the slope of theory: here it is the curve.
    np.testing.assert_allclose(theory.get_ydata(), theory.get_xdata() ** 4, rtol=1e-12)
    words = [text.get_text() for text in axes.get_legend().get_texts()]
    assert words == ["euler-rk4-2: 4.00, theory 4", "mine: order hidden"]
    assert next(label.get_text() for label in axes.get_xticklabels()) == "1/32"


def test_vibration_has_a_panel_for_drift_and_one_for_acceleration(figures):
    hertz = np.geomspace(1, 100, 30)
    curves = [
        (label, Curve(label, unit, hertz, true * hertz, part * hertz**3))
        for label, part in (("one", 1e-9), ("two", -1e-8))
        for unit, true in (("rad/s", 1e-6), ("m/s^2", 1e-3))
    ]
    plots.vibration_image(curves, "A title", "vibration.png", 10.0)
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
    plots.vibration_image(still, "Nothing moves", "vibration.png")


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


def test_a_run_is_drawn_into_a_file_in_a_new_folder(run, tmp_path):
    path = plots.plot_run(run, "A title", tmp_path / "new" / "run.png")
    assert path == tmp_path / "new" / "run.png"
    assert path.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    assert [p.name for p in path.parent.iterdir()] == ["run.png"]


@each("name", ["run.docx", "run", "png"])
def test_unknown_ending(name):
    with pytest.raises(InputError, match=r"^plot .*: file type '(docx)?' is not known; allowed: .*png.*svg"):
        drawing.require_kind(name)


def test_nothing_is_written_for_an_unknown_ending(run, tmp_path):
    with pytest.raises(InputError, match=r"^plot .*: file type 'docx' is not known"):
        plots.plot_run(run, "A title", tmp_path / "run.docx")
    assert list(tmp_path.iterdir()) == []


def test_folder_that_cannot_be_written(run, figures, tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match=r"cannot be written"):
        plots.plot_run(run, "A title", tmp_path / "file" / "run.png")


def test_without_matplotlib(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r"^plots need matplotlib: pip install 'strapgen\[plot\]'$"):
        plots.plot_run(run, "A title", tmp_path / "run.png")
    assert issubclass(MissingExtraError, ImportError)


def test_no_screen_is_needed(run, figures, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setenv("MPLBACKEND", "tkagg")
    plots.run_image(run, "A title", "run.png")
    assert pyplot.get_backend().lower() == "agg"


def test_a_screen_of_the_user_s_that_is_not_there_changes_nothing(tmp_path):
    code = "from strapgen.reports.plots import figures; figures.pyplot(); import os; print(os.environ['MPLBACKEND'])"
    environment = {**os.environ, "MPLBACKEND": "module://of_no_package"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout == "module://of_no_package\n"


def test_kinds_of_files_that_take_a_typesetting_system_are_refused():
    with pytest.raises(InputError, match=r"file type 'pgf' is not known; allowed: .*svg"):
        drawing.require_kind("run.pgf")
