"""Objects in notebooks: formulas, tables, plots, and the objects of pandas, xarray and SciPy."""

from __future__ import annotations

import json
import re
import shlex
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import strapgen
from strapgen.catalogue.methods import coning_coefficients
from strapgen.cli import main
from strapgen.lab import scipy_rotations
from strapgen.results.display import objects
from strapgen.results.display.latex import PAGE, broken, equations, width

ALGORITHM = strapgen.algorithm("euler", "rk4", increments=2)
TURN = np.full((8, 2, 3), 0.01)


@pytest.fixture(scope="module")
def run() -> strapgen.Run:
    return ALGORITHM.simulate("coning", "0.125", 10, a_deg_s=10, b_deg_s=10, g_deg_s=10)


@pytest.fixture(scope="module")
def history() -> strapgen.History:
    recording = strapgen.Recording(0.0, 0.01, np.full((20, 3), 1e-3))
    return strapgen.propagate(ALGORITHM.backend(), recording)


# Formulas


def test_a_step_shows_its_vectors_and_a_tableau_its_array():
    text = ALGORITHM.derive()._repr_latex_()
    assert text == ALGORITHM._repr_latex_() == strapgen.formulas.as_latex(ALGORITHM.derive())
    assert len(text.splitlines()) <= 6
    tableau = strapgen.TABLEAUX["rk4"]._repr_latex_()
    assert r"\begin{array}{c|cccc}" in tableau and r"\hline  & \frac{1}{6} & \frac{1}{3}" in tableau


def test_a_kernel_that_would_fill_half_a_page_shows_its_repr_alone():
    assert strapgen.derive("cayley-klein", "butcher6", 3)._repr_latex_() is None


def test_a_series_shows_its_leading_terms_in_vectors():
    text = ALGORITHM.series(terms=1)._repr_latex_()
    assert r"h^{5}\!:\ \mathbf{d} &= \frac{1}{720}" in text and r"\boldsymbol\omega_{0}" in text
    constant = ALGORITHM.series("constant", terms=1).step._repr_latex_()
    assert r"\mathrm{drift}_x &=" in constant and "h^{5}" in constant


def test_coning_coefficients_show_the_rotation_vector():
    design = coning_coefficients.design(2, 0, "compressed")
    text = design._repr_latex_()
    assert r"\mathbf{d}_{1} + \mathbf{d}_{2} + \tfrac{2}{3} \mathbf{d}_{1} \times \mathbf{d}_{2}" in text
    assert repr(design) == "<Design compressed, 2 samples, 0 before them, 1 coefficients>"


def test_a_wide_tableau_is_written_stage_by_stage():
    text = objects.tableau_latex(strapgen.TABLEAUX["dormand-prince8"])
    assert "array" not in text
    assert text.count("&= ") == 13 + 2
    assert "a_{13,12}" not in text  # it is zero


def test_lines_break_before_signs_where_the_page_ends():
    long = " + ".join(["a b"] * 30)
    lines = equations([("y", long)]).splitlines()[1:-1]
    assert all(width(line.rstrip("\\")) <= PAGE + 3 for line in lines)
    assert (
        " ".join(line.strip(" \\").removeprefix("y &= ").removeprefix("&\\quad {} ") for line in lines)
        == long
    )
    assert broken("a + b", 1.0) == "a \\\\\n    &\\quad {} + b"
    assert broken(r"\frac{a + b}{c}", 99) == r"\frac{a + b}{c}"


# Tables and plots


def test_programs_show_code_and_counts():
    text = ALGORITHM.program()._repr_html_()
    assert "<pre>" in text and "31 add, 37 multiply; 15 temporaries</summary>" in text
    assert "sigma_dot_sigma" in text
    fixed = strapgen.quantize(ALGORITHM.program())._repr_html_()
    assert "Q1.30" in fixed and "<td" in fixed
    sources = ALGORITHM.generate()._repr_html_()
    assert sources.count("<summary>") == 2 and "#include &lt;" in sources


def test_a_run_shows_a_table_and_a_plot(run, monkeypatch):
    pytest.importorskip("matplotlib")
    text = run._repr_html_()
    assert "mean drift" in text and "drift, deg x" in text and "data:image/png;base64," in text
    figure = run.plot(title="coning")
    assert len(figure.axes) == 9
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert run._repr_html_() == text.split("\n<img")[0]


def test_plots_are_figures_or_files(history, tmp_path):
    pytest.importorskip("matplotlib")
    panels = [
        "roll, deg",
        "pitch, deg",
        "heading, deg",
        "length of the state less 1",
        "magnitude of the rate, deg/s",
    ]
    assert [axes.get_title(loc="left") for axes in history.plot().axes] == panels
    path = tmp_path / "history.svg"
    assert history.plot(path, "a title") == path
    assert "a title" in path.read_text()
    with pytest.raises(strapgen.InputError, match=r"file type 'doc' is not known"):
        history.plot(tmp_path / "history.doc")


def test_comparisons_and_ladders_are_tables():
    rows = ALGORITHM.compare(TURN, ["numpy", "exact"])
    text = rows._repr_html_()
    assert "largest, rad" in text and text.count("<tr>") == 3
    assert isinstance(rows, tuple)
    coning = strapgen.motion("coning", a_rad_s=1, b_rad_s=1.5, g_rad_s=0.6)
    ladder = strapgen.converge(ALGORITHM.choice, coning, ["1/8", "1/16"], 1, "numpy")
    assert "error_rad" in ladder._repr_html_()


# Other libraries


def test_records_become_data_frames_with_units_in_the_names(run, history):
    pytest.importorskip("pandas")
    frame = run.to_pandas()
    assert frame.index.name == "time_s" and len(frame) == 81
    assert np.array_equal(frame["drift_x_deg"], np.degrees(run.drift[:, 0]))
    assert np.array_equal(frame.index, run.time)
    assert list(history.to_pandas().columns) == ["e_x", "e_y", "e_z", "e_s"]
    assert list(ALGORITHM.compare(TURN, ["numpy"]).to_pandas()["backend"]) == ["numpy"]


def test_records_become_datasets_with_units(run, history):
    pytest.importorskip("xarray")
    data = run.to_xarray()
    assert data["drift_deg"].dims == ("time_s", "axis") and data["drift_deg"].units == "deg"
    assert np.array_equal(data["drift_deg"].sel(axis="x"), np.degrees(run.drift[:, 0]))
    assert data["computed"].shape == (81, 3, 3)
    assert history.to_xarray()["attitude"].sel(element="e_s").shape == (11,)


def test_a_library_that_is_missing_is_one_line(run, history, monkeypatch):
    for name in ("pandas", "xarray", "scipy.spatial.transform"):
        monkeypatch.setitem(sys.modules, name, None)
    needed = r"^{} need {}: pip install 'strapgen\[notebook\]'$"
    with pytest.raises(strapgen.MissingExtraError, match=needed.format("data frames", "pandas")):
        run.to_pandas()
    with pytest.raises(strapgen.MissingExtraError, match=needed.format("datasets", "xarray")):
        history.to_xarray()
    with pytest.raises(strapgen.MissingExtraError, match=needed.format("rotations", "SciPy")):
        strapgen.to_rotation(run)


@pytest.mark.parametrize("algorithm", ["dcm", "euler", "cayley-klein"])
def test_rotations_of_scipy_go_in_and_come_out(algorithm):
    transform = pytest.importorskip("scipy.spatial.transform")
    backend = strapgen.backend(algorithm)
    begin = transform.Rotation.from_euler("ZYX", [30, 20, 10], degrees=True)
    motion = strapgen.motion("constant", z_deg_s=90)
    run = strapgen.simulate(backend, motion, "0.1", 1, initial=begin)
    turned = begin * transform.Rotation.from_euler("z", 90, degrees=True)
    # A step turns by x = 0.157 rad; direction cosines lose x^5/120 of it, 8e-6 rad in ten steps.
    assert (strapgen.to_rotation(run)[-1].inv() * turned).magnitude() < 1e-5
    state = strapgen.from_rotation(begin, backend)
    assert (strapgen.to_rotation(state, backend).inv() * begin).magnitude() < 1e-15


def test_scipy_gets_an_array_that_it_may_write(run, history, monkeypatch):
    """Arrays of results are read-only, which SciPy 1.15 refuses to read."""
    matrices = np.eye(3)[None]
    matrices.flags.writeable = False
    taken = []
    rotation = SimpleNamespace(from_matrix=taken.append)
    monkeypatch.setattr(scipy_rotations, "_scipy", lambda: rotation)
    for attitudes in (run, history, matrices):
        strapgen.to_rotation(attitudes)
    assert not run.computed.flags.writeable
    assert [array.flags.writeable for array in taken] == [True, True, True]
    assert np.array_equal(taken[0], run.computed)


def test_rotations_that_do_not_fit_are_refused(history):
    transform = pytest.importorskip("scipy.spatial.transform")
    backend = ALGORITHM.backend()
    with pytest.raises(strapgen.InputTypeError, match=r"^rotation is a list; a Rotation of SciPy is needed$"):
        strapgen.from_rotation([0, 0, 0, 1], backend)
    with pytest.raises(strapgen.InputError, match=r"^rotation holds 2 attitudes; a single one is needed$"):
        strapgen.from_rotation(transform.Rotation.from_quat(np.eye(4)[2:]), backend)
    with pytest.raises(
        strapgen.InputTypeError,
        match=r"^the states of this History are not known as attitudes of a back end$",
    ):
        strapgen.to_rotation(replace(history, backend=None))
    assert len(strapgen.to_rotation(history, backend)) == len(history.time)
    assert (
        strapgen.to_rotation(history).inv() * strapgen.to_rotation(history, backend)
    ).magnitude().max() < 1e-15


def test_ipython_uses_the_display_of_objects(run):
    formatters = pytest.importorskip("IPython.core.formatters")
    pytest.importorskip("matplotlib")
    shown, _ = formatters.DisplayFormatter().format(ALGORITHM.derive())
    assert {"text/plain", "text/latex"} <= {*shown} and shown["text/plain"].startswith("<Kernel")
    shown, _ = formatters.DisplayFormatter().format(run)
    assert {"text/plain", "text/html"} <= {*shown} and "text/latex" not in shown
    shown, _ = formatters.DisplayFormatter().format(strapgen.derive("cayley-klein", "butcher6", 3))
    assert {*shown} == {"text/plain"}  # half a page of scalars


def generate_into(command: str, folder: Path) -> None:
    with pytest.raises(SystemExit) as stop:
        main([*shlex.split(command), "--out", str(folder)])
    assert stop.value.code == 0


def generated_by(path: Path) -> str:
    """Return the command in a file's first comment, which may be wrapped."""
    (line,) = re.findall(
        r"Generated by: strapgen (.*?)\n(?: \* )?Do not edit", path.read_text(), flags=re.DOTALL
    )
    return " ".join(line.replace("\n *", " ").split())


LOOSE = "--rounding truncation --drift-allowance 1/100 --range angle_sum=0.25 --fix state=Q2.29"

CONSTANTS = (
    "--constant cycle=0.02 --constant cycle_rate=50 --constant 'rate_scale=1/3, -2e-9,0,0,0,0,0,0, 0.333333'"
)


@pytest.mark.long
@pytest.mark.parametrize(
    "command",
    [
        "two-speed dcm",
        "two-speed euler --sculling 1 --target c-float",
        "two-speed euler --target c-fixed",
        "two-speed dcm --target c-fixed --carry full",
        f"two-speed euler --target c-fixed --carry state {LOOSE}",
        "two-speed dcm --sculling 1 --target c-fixed --word 16 --carry full --drift-allowance 0.05",
        "generate euler --target c-fixed --carry full --max-rate-deg-s 400 --step 0.01",
        "generate euler --target c-fixed --max-rate-deg-s 400 --sample-hz 100 --lsb 0.0175dps --state q31",
        "generate dcm --method rk1 --target fixed-model --sample-hz 100 --lsb 17.5mdps --max-angle-rad 1/20",
        "generate euler --method rk2 --target c-fixed --lsb-rad 1/100000000 --input-bits 24 --carry full",
        "generate euler --method rk2 --target c-fixed --max-rate-deg-s 400 --step 0.01 --input-bits 16",
        "generate dcm-two-speed-slow-2 --target fixed-model --word 24 --carry state --drift-allowance 0.1",
        f"generate imu-compensate --target c-fixed {CONSTANTS} --range increment=0.1",
        f"generate imu-compensate --target numpy {CONSTANTS}",
    ],
)
def test_the_command_of_every_file_makes_it_again(command, tmp_path):
    generate_into(command, tmp_path / "first")
    files = sorted((tmp_path / "first").iterdir())
    commands = list(dict.fromkeys(map(generated_by, files)))
    for number, again in enumerate(commands):
        generate_into(again, tmp_path / str(number))
    for path in files:
        copy = tmp_path / str(commands.index(generated_by(path))) / path.name
        assert copy.read_bytes() == path.read_bytes()


def test_kernels_are_listed_in_groups_with_the_same_names_in_json(capsys):
    with pytest.raises(SystemExit):
        main(["list", "kernels"])
    groups, heading = {}, ""
    for line in capsys.readouterr().out.splitlines():
        if line.startswith("  "):
            groups[heading].append(line.split()[0])
        else:
            heading = line
            groups[heading] = []
    with pytest.raises(SystemExit):
        main(["list", "kernels", "--format", "json"])
    data = json.loads(capsys.readouterr().out)
    assert data["groups"] == groups
    assert sorted(name for names in groups.values() for name in names) == sorted(data["kernels"])
    assert "dcm-orthonormalize" in groups["orthonormal"] and "erection" in groups["loop"]
    with pytest.raises(SystemExit):
        main(["list", "methods", "--format", "json"])
    assert "groups" not in json.loads(capsys.readouterr().out)
