"""The command line: help with examples, JSON as promised, output where it is asked for, quick answers."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import derived
import numpy as np
import pytest
import sympy as sp

import strapgen
from strapgen import catalogue, pipeline
from strapgen.catalogue import Choice
from strapgen.catalogue.methods.tableaux import TABLEAUX
from strapgen.cli import main
from strapgen.lab.recordings.recording import read_inertial
from strapgen.navigation.courses import NavigationFrame, course
from strapgen.results.display import formulas
from strapgen.run import standard_tree
from strapgen.run.backends import BACKENDS
from strapgen.targets import TARGETS
from strapgen.thesis.thesis_tables import TABLES

pytestmark = pytest.mark.filterwarnings("error")

COMMANDS = (
    *(
        "list",
        "tableau",
        "coning",
        "derive",
        "generate",
        "simulate",
        "compare",
        "converge",
        "check",
        "tables",
        "two-speed",
        "strapdown",
        "vibration",
    ),
    *("study word-length", "series", "stability", "rate-table", "frontier"),
    *("window design", "window show"),
)
DATA = Path(__file__).resolve().parents[1] / "data"
CONING = "--motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 --step 0.125 --duration 5"


@pytest.fixture
def strapgen_says(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Run a command line in a folder of its own and return what it prints.

    It must succeed and name its files alone, beside remarks on how a recording is read.
    """
    monkeypatch.chdir(tmp_path)

    def run(command: str, *more: str) -> str:
        with pytest.raises(SystemExit) as stop:
            main([*shlex.split(command), *more])
        said = capsys.readouterr()
        assert stop.value.code == 0, said.err
        assert re.fullmatch(r"(strapgen: \S+\.csv: [^\n]+\n)*(wrote [^\n]+\n)?", said.err)
        return said.out

    return run


# Help and versions


def unwrapped(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.parametrize("words", ["help", "-h", "--help"])
def test_help_names_every_command(words, strapgen_says):
    said = strapgen_says(words)
    for command in COMMANDS:
        assert re.search(rf"^  {command.split()[0]} +\S", said, flags=re.MULTILINE)


def examples(text: str) -> list[str]:
    """Return the commands of the examples in a help text; a paragraph holds one, perhaps over several lines."""
    paragraphs = [unwrapped(paragraph).replace("\\ ", "") for paragraph in text.split("\n\n")]
    return [paragraph for paragraph in paragraphs if paragraph.startswith("strapgen ")]


#: Commands whose examples take a second or more; other tests run them with less to do.
COSTLY = (
    "compare",
    "converge",
    "check",
    "tables",
    "study word-length",
    "study sensor-errors",
    "series",
    "stability",
    "rate-table",
    "generate",
    "frontier",
    "window design",
)


#: Parts of examples that ask for much of the same, and what they run with.
LESS = {
    "frontier": ("--method coning-least-squares,", "--method coning-least-squares:3+3,"),
    "converge": ("--method rk1,rk2,rk4,butcher6", "--method rk1,rk4"),
    "study word-length": ("--word 12,16,20,24,32", "--word 12,32"),
}


@pytest.mark.long
@pytest.mark.parametrize(
    "command", [pytest.param(c, marks=pytest.mark.long if c in COSTLY else ()) for c in COMMANDS]
)
def test_examples_of_the_help_run(command, strapgen_says, tmp_path):
    said = strapgen_says(f"{command} --help")
    shown = examples(said)
    assert shown and re.search(r"^Examples?:$", said, flags=re.MULTILINE)
    (tmp_path / "gyro.csv").write_text((DATA.parents[1] / "examples/gyro_log.csv").read_text())
    (tmp_path / "examples").symlink_to(DATA.parents[1] / "examples")
    pages = "\n".join(path.read_text() for path in (DATA.parents[1] / "docs").glob("*.md"))
    on_pages = {" ".join(line.split()) for line in re.sub(r"\\\n\s*", "", pages).splitlines()}
    for example in shown:
        program, *words = shlex.split(example)
        assert (program, " ".join(words).startswith(command)) == ("strapgen", True)
        if example not in on_pages:  # tests/test_documents.py runs those
            strapgen_says(" ".join(map(shlex.quote, words)).replace(*LESS.get(command, ("", ""))))


def test_version_names_all_that_shapes_the_output(strapgen_says):
    lines = strapgen_says("--version").splitlines()
    assert lines[0] == f"strapgen {strapgen.__version__}"
    named = {line.split()[0] for line in lines}
    assert named >= {"strapgen", "python", "sympy", "numpy", "jinja2", "cffi"}
    for line in lines[1:]:
        assert re.search(r"\d+\.\d+", line) or "not installed" in line
    assert lines[-1].startswith("C compiler ")


# list


def test_list(strapgen_says):
    data = json.loads(strapgen_says("list --format json"))
    kinds = ["algorithms", "methods", "vectors", "kernels", "systems", "motions", "targets", "backends"]
    assert list(data) == ["schema", *kinds]
    assert list(data["algorithms"]) == ["dcm", "euler", "cayley-klein"]
    assert list(data["methods"].items()) == list(catalogue.METHODS.items())
    assert data["vectors"].keys() == catalogue.VECTORS.keys()
    assert data["kernels"].keys() == {**catalogue.KERNELS, **catalogue.LAYOUT_KERNELS}.keys()
    assert list(data["motions"]) == [
        *("constant", "sinusoidal", "coning", "polynomial"),
        *("cone", "random", "slew", "ramps", "vibration"),
        *("great-circle", "polar", "turn", "climb", "taxi", "s-turns", "swinging"),
    ]
    assert list(data["targets"]) == list(TARGETS)
    assert {*TARGETS} >= {"numpy", "c", "c-float", "c-fixed", "cpp", "cpp-float", "fixed-model"}
    assert list(data["backends"]) == list(BACKENDS)
    assert {*BACKENDS} >= {"numpy", "c", "c-float", "c-fixed32", "c-fixed16", "fixed-model", "exact", "cpp"}
    lines = strapgen_says("list").splitlines()
    for title, part in ((kind, data[kind]) for kind in kinds):
        assert title in lines
        for name, meaning in part.items():
            if (
                re.match(r"taylor|[a-z-]+-update-\d", name) and "navigation" not in name
            ):  # twenty take one line
                continue
            assert any(line.split() == [name, *meaning.split()] for line in lines)
    assert sum(line.startswith("  taylor1 to taylor20 ") for line in lines) == 1


# tableau


def test_tableau_text(strapgen_says):
    said = strapgen_says("tableau fehlberg4")
    assert said.startswith("fehlberg4: Fehlberg's fourth-order method, 4(5)\nsource: E. Fehlberg, ")
    assert "\nprincipal error norm           0.0018392\norder of the embedded weights  5\n" in said
    rows = [line.split() for line in said.split("\n\n")[-1].splitlines()]
    assert rows[2] == ["3/8", "|", "3/32", "9/32"]
    assert rows[-2:] == [
        ["|", *map(str, row)] for row in (TABLEAUX["fehlberg4"].weights, TABLEAUX["fehlberg5"].weights)
    ]


@pytest.mark.long
def test_tableau_too_wide_for_a_table(strapgen_says):
    said = strapgen_says("tableau dormand-prince8")
    assert "largest residual               1.04e-17, tolerance 1.1e-17\n" in said
    assert re.search(r"^c_11 +1201146811/1299019798$", said, flags=re.MULTILINE)
    assert re.search(r"^a_13,1 +403863854/491063109$", said, flags=re.MULTILINE)
    assert said.endswith("\ne: the embedded weights\n") and max(map(len, said.splitlines())) <= 120


def test_tableau_of_a_file(strapgen_says, tmp_path):
    text = (Path(catalogue.__file__).parent / "methods" / "butcher_tableaux" / "ralston3.toml").read_text()
    (tmp_path / "folder").mkdir()
    for name in ("mine.toml", "folder/mine"):
        (tmp_path / name).write_text(text)
        assert strapgen_says(f"tableau {name}").startswith(
            "ralston-s-third-order-method: Ralston's third-order method\n"
        )


# JSON

#: Commands, with the keys of their JSON in order; of rows where it is a list.
JSON_KEYS = {
    "tableau rk4": "schema name title source stages order attitude_order conditions principal_error_norm "
    "embedded_order tolerance largest_residual nodes matrix weights embedded_weights",
    f"simulate euler {CONING}": "schema algorithm method increments backend motion step_s duration_s "
    "time_s scale skew_deg drift_deg mean_drift_deg",
    f"simulate dcm {CONING} --matrices": "schema algorithm method increments backend motion step_s duration_s "
    "time_s scale skew_deg drift_deg mean_drift_deg computed true difference error",
    "tables --table 3 --backend numpy": "schema table backend algorithm order drift_deg normalised thesis agrees "
    "note roundoff_dominates scan repairs thesis_printed",
}


@pytest.mark.parametrize("command", JSON_KEYS)
def test_json_has_its_keys_in_order(command, strapgen_says):
    data = json.loads(strapgen_says(f"{command} --format json"))
    for row in data if isinstance(data, list) else [data]:
        assert list(row) == JSON_KEYS[command].split()


# vibration

ONE = "--frequency-hz 10 --step 0.02 --theta-x-rad 0.01 --theta-y-rad 0.02 --phase-rad 1.1"
HEADS = [*((part, "rad/s") for part in ("continuous", "computed", "error")), ("error", "deg/h")]
TRUE = -math.pi * 10 * 0.01 * 0.02 * math.sin(1.1)


@pytest.mark.long
@pytest.mark.parametrize(
    "algorithm",
    [
        "dcm",
        "euler --method rk1 --increments 1",
        pytest.param("cayley-klein --method rk4 --rates", marks=pytest.mark.long),
        pytest.param("euler --method coning-combined --increments 3 --previous 1", marks=pytest.mark.long),
        pytest.param("rotation-vector --method magnus4", marks=pytest.mark.long),
        "examples/modified_rodrigues.py --method rk2",
    ],
)
def test_vibration_json(algorithm, strapgen_says, tmp_path):
    (tmp_path / "examples").symlink_to(DATA.parents[1] / "examples")
    data = json.loads(strapgen_says(f"vibration {algorithm} {ONE} --format json"))
    facts = ("continuous_rad_s", "computed_rad_s", "error_rad_s")
    assert [key for key in data if key in facts] == [*facts]
    assert data["continuous_rad_s"] == pytest.approx(TRUE, rel=1e-14)
    assert data["computed_rad_s"] - data["continuous_rad_s"] == pytest.approx(data["error_rad_s"], rel=1e-9)
    assert 0 < abs(data["error_rad_s"]) < abs(TRUE)
    values = {"f": 10, "T": 0.02, "theta_x": 0.01, "theta_y": 0.02, "phi": 1.1}
    closed = sp.sympify(data["drift_closed_form"]["computed"]).subs(values)
    assert float(closed) == pytest.approx(data["computed_rad_s"], rel=1e-12)


def test_vibration_with_an_acceleration(strapgen_says):
    data = json.loads(strapgen_says(f"vibration euler {ONE} --acceleration-y 3 --format json"))
    assert data["continuous_m_s2"] == pytest.approx(0.01 * 3 * math.cos(1.1) / 2, rel=1e-14)
    # By duality the rates of drift and sculling are off by the same part.
    ratio = data["error_rad_s"] / data["continuous_rad_s"]
    assert data["error_m_s2"] / data["continuous_m_s2"] == pytest.approx(ratio, rel=1e-12)
    alone = "--frequency-hz 10 --step 0.02 --theta-x-rad 0.01 --phase-rad 1.1 --acceleration-y 3"
    for algorithm in ("euler", "sculling --method coning-compressed"):
        again = json.loads(strapgen_says(f"vibration {algorithm} {alone} --format json"))
        assert "computed_rad_s" not in again
        assert again["computed_m_s2"] == pytest.approx(data["computed_m_s2"], rel=1e-14)


def test_vibration_of_a_fast_loop_explains_its_rates(strapgen_says):
    given = (
        "--increments 10 --frequency-hz 7 --step 0.1 --theta-x-rad 0.01 --phase-rad 0.9 --theta-y-rad 0.013"
    )
    explained = (
        "the part of the fast loop within a slow cycle T_m; the slow loop adds the term in T_m to both"
    )
    assert explained in strapgen_says(f"vibration coning-fast {given}")
    assert "fast loop" not in strapgen_says(f"vibration dcm {given.partition(' ')[2].partition(' ')[2]}")
    assert "the slow loop adds that to both" in " ".join(strapgen_says("vibration --help").split())


@pytest.mark.long
def test_vibration_of_several(strapgen_says, tmp_path):
    several = f"vibration euler --method rk2,rk4 --increments 1,2 {ONE}"
    data = json.loads(strapgen_says(f"{several} --format json"))["results"]
    assert [(one["kernel"], one["increments"]) for one in data] == [
        (f"euler-{method}-{count}", count) for method in ("rk2", "rk4") for count in (1, 2)
    ]
    pytest.importorskip("matplotlib")
    said = strapgen_says(f"{several} --plot errors.svg --plot-hz 1,20")
    assert said.splitlines()[2].split()[1:] == " ".join(f"{part}, {unit}" for part, unit in HEADS).split()
    hour = math.degrees(data[0]["error_rad_s"]) * 3600
    assert float(said.splitlines()[3].split()[-1]) == pytest.approx(hour, rel=1e-5)
    assert "error of euler-rk4-2" in (tmp_path / "errors.svg").read_text()


def test_vibration_in_words_and_in_latex(strapgen_says):
    said = strapgen_says(f"vibration dcm {ONE}")
    assert "  continuous = -pi*f*theta_x*theta_y*sin(phi)\n" in said
    latex = strapgen_says(f"vibration dcm {ONE} --format latex")
    assert latex.startswith("\\begin{align*}\n") and latex.count("&=") == 3


def test_vibration_under_a_spectrum(strapgen_says, tmp_path):
    (tmp_path / "flat.csv").write_text(
        "frequency_hz,density,angle_x_rad,angle_y_rad,angle_y_phase_rad\n9.999,0.25,0.01,0.02,1.1\n10.001,0.25,0.01,0.02,1.1\n"
    )
    data = json.loads(strapgen_says("vibration dcm --step 0.02 --spectrum flat.csv --format json"))
    # A band 2 mHz wide: an oscillation of which half the square is 0.25 * 0.002.
    assert data["continuous_rad_s"] == pytest.approx(TRUE * 2 * 0.25 * 0.002, rel=1e-6)
    assert 0 <= data["error_quadrature_rad_s"] < 1e-9 * abs(data["error_rad_s"])
    assert "quadrature" in strapgen_says("vibration dcm --step 0.02 --spectrum flat.csv")


# coning


@pytest.mark.parametrize(
    ("options", "wanted"),
    [
        ("--samples 2", "2/3"),
        ("--samples 3", "9/20 27/20"),
        ("--samples 4 --form compressed", "18/35 92/105 214/105"),
        ("--samples 1 --previous 1", "1/12"),
        ("--samples 3 --form uncompressed", "57/80 33/80 57/80"),
        ("--samples 3 --form combined", "27/40 9/20 27/40"),
        ("--samples 1", ""),
    ],
)
def test_coning_json(options, wanted, strapgen_says):
    data = json.loads(strapgen_says(f"coning {options} --format json"))
    assert data["coefficients"] == wanted.split()
    residual, leading = (sp.sympify(data[key]) for key in ("residual", "leading"))
    assert {symbol.name for symbol in residual.free_symbols} == {"alpha", "omega", "T"}
    small = {"alpha": sp.Rational(1, 10), "omega": 1, "T": sp.Rational(1, 10**6)}
    assert abs((residual / leading).subs(small).evalf(80, maxn=400) - 1) < 1e-9
    assert len(data["pairs"]) == len(data["coefficients"])
    assert not data["pairs"] or data["pairs"][-1][1] == f"d{options.split()[1]}"  # the newest sample


def test_coning_text(strapgen_says):
    said = strapgen_says("coning --samples 2 --previous 1 --form combined --terms")
    for line in (
        "combined coning coefficients, 2 samples and 1 before them",
        "terms of fourth order: each vector",
    ):
        assert line in said
    assert re.search(r"^  past1 x d1 +-?\d+/\d+ ", said, flags=re.MULTILINE)
    assert "strapgen derive rotation-vector --method coning-combined --increments 2 --previous 1;" in said


def test_coning_terms(strapgen_says):
    data = json.loads(strapgen_says("coning --samples 2 --terms --format json"))
    assert data["third_order"]["d1"] == {"d1.d2": "2/15", "d2.d2": "-2/15"}
    assert data["fourth_order"] == {"d1 x d2": {"d1.d1": "-1/126", "d1.d2": "19/315", "d2.d2": "-1/126"}}


def test_fixed_point_of_a_vector_of_a_step(strapgen_says, tmp_path):
    limits = "--target c-fixed --max-rate-deg-s 400 --step 0.01"
    said = strapgen_says(f"generate rotation-vector --method coning-compressed --increments 4 {limits}")
    assert re.search(r"^  rotation_vector: Q\S+, error <= ", said, flags=re.MULTILINE)
    header = (tmp_path / "rotation_vector_coning_compressed_4_w32.h").read_text()
    assert "strapgen generate rotation-vector --method coning-compressed --increments 4" in header
    said = strapgen_says(
        f"generate sculling --method coning-compressed --increments 4 {limits} --range velocity_increments=0.5"
    )
    assert re.search(r"^  sculling: Q\S+, error <= ", said, flags=re.MULTILINE)


# derive


@pytest.mark.parametrize(
    ("show", "text"),
    [
        ("text", formulas.as_text),
        ("latex", formulas.as_latex),
        ("program", lambda kernel: formulas.program_as_text(pipeline.lower(kernel))),
        ("operations", lambda kernel: formulas.operations_as_text(kernel, pipeline.lower(kernel))),
    ],
)
def test_derive_prints_the_python_result(show, text, strapgen_says):
    kernel = pipeline.derive("dcm", "rk2", 2)
    assert strapgen_says(f"derive dcm --method rk2 --show {show}") == f"{text(kernel)}\n"


@pytest.mark.parametrize("show", ["text", "latex", "program", "operations"])
def test_derive_json(show, strapgen_says):
    data = json.loads(strapgen_says(f"derive euler --show {show} --format json"))
    wanted = [
        "schema",
        "kernel",
        "title",
        "source",
        "notes",
        "inputs",
        "stages",
        "outputs",
        "operations",
        "temporaries",
    ]
    assert list(data) == wanted + [show] * (show in ("latex", "program"))
    assert data["kernel"] == "euler-rk4-2"
    assert [signal["name"] for signal in data["inputs"]] == ["state", "increments"]


# generate


@pytest.mark.long
@pytest.mark.parametrize("target", TARGETS)
def test_generate_json(target, strapgen_says, tmp_path):
    command = f"generate cayley-klein --method rk3 --increments 2 --target {target} --out out --format json"
    with_runs = TARGETS[target].nameable and TARGETS[target].number != "float"
    data = json.loads(strapgen_says(command + " --with-runs" * with_runs))
    assert list(data)[:6] == ["schema", "kernel", "target", "files", "operations", "temporaries"]
    assert (data["kernel"], data["target"]) == ("cayley-klein-rk3-2", target)
    assert list(data["operations"]) == ["add", "multiply", "divide", "sqrt"]
    program = derived.program(Choice("cayley-klein", "rk3", 2))
    counted = pipeline.quantize(program) if TARGETS[target].fixed else program
    assert data["operations"].items() <= counted.operations.items()
    assert data["temporaries"] == counted.temporaries
    if TARGETS[target].fixed:
        assert set(data) >= {"formats", "ranges", "error_bound"}
    else:
        assert {*data} - {"results", *list(data)[:6]} == {"error_bounds"} & {*data}
        assert ("error_bounds" in data) == TARGETS[target].nameable
    sources = pipeline.generate(program, target)
    files = sources.files if with_runs else sources.step_files
    own = 2 if TARGETS[target].compiled else 1  # a header and a source, or one file
    loops = 1 if target == "matlab" else 2
    assert len(files) == own + (loops if with_runs else 0)
    assert data["files"] == [str(Path("out") / name) for name in files]
    assert {path.name: path.read_text() for path in (tmp_path / "out").iterdir()} == files


def test_generate_fixed_point_json(strapgen_says):
    data = json.loads(
        strapgen_says(
            "generate euler --method rk4 --increments 2 --target c-fixed --word 32 --max-rate-deg-s 400 "
            "--step 0.01 --out out --format json"
        )
    )
    assert data["formats"]["state"] == data["formats"]["next"] == "Q1.30"
    assert re.fullmatch(r"Q-\d\.\d\d", data["formats"]["increments"])
    largest = math.radians(400) * 0.01 / 2
    assert data["ranges"]["increments"] == pytest.approx([-largest, largest], rel=1e-8)
    assert data["ranges"]["next"][1] < 2
    # Half a unit is the rounding of the state; the transition adds the rest.
    assert list(data["error_bound"]) == ["next"]
    assert 2**-31 < data["error_bound"]["next"] < 0.6 * 2**-30
    assert max(data["error_bound_by_element"].values()) == data["error_bound"]["next"]


def test_generate_fixed_point_text(strapgen_says):
    said = strapgen_says("generate euler --target c-fixed --carry full --rounding truncation --out out")
    assert re.search(r"\n  next: Q1\.30, error <= \d\.\d+e-\d+ \(\d\.\d{4} ulp\)\n", said)


def test_generate_text(strapgen_says):
    said = strapgen_says("generate euler --target c --out out").splitlines()
    assert re.fullmatch(r"euler-rk4-2 for c: \d+ add, \d+ multiply.*, \d+ temporaries", said[0])
    assert said[1:3] == ["  out/euler_rk4_2.h", "  out/euler_rk4_2.c"]
    assert said[3:] == ["  next: error <= 6.889e-16 (3.1021 ulp of 1)"]


def test_generate_writes_numpy_here_by_default(strapgen_says, tmp_path):
    strapgen_says("generate euler")
    assert [path.name for path in tmp_path.iterdir()] == ["euler_rk4_2.py"]


def test_simulate_in_fixed_point(strapgen_says):
    run = (
        "simulate euler --backend c-fixed32 --motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 "
        "--step 0.125 --duration 20 --format json"
    )
    drifts = {}
    for options in ("", "--carry full", "--carry full --rounding truncation", "--max-rate-deg-s 200"):
        drifts[options] = json.loads(strapgen_says(f"{run} {options}"))["mean_drift_deg"]
    assert drifts["--carry full"] < drifts[""] < drifts["--max-rate-deg-s 200"]
    assert len(set(drifts.values())) == 4


def test_simulate_with_gyro_pulses(strapgen_says):
    run = (
        "simulate euler --motion constant --set y_deg_s=10 --step 0.125 --duration 4 --format json --matrices"
    )
    plain, coarse = (json.loads(strapgen_says(f"{run} {options}")) for options in ("", "--pulse-arcsec 3600"))
    # Half a pulse of 1 deg at most, and less than that off on the whole turn.
    apart = np.abs(np.array(coarse["drift_deg"]) - plain["drift_deg"])[:, 1]
    assert 0.1 < apart.max() <= 0.5 + 1e-6


@pytest.mark.long
def test_a_tableau_of_a_file_becomes_c_that_compiles(strapgen_says, tmp_path):
    (tmp_path / "my.toml").write_text(
        'name = "Heun of third order"\nsource = "K. Heun, 1900"\norder = 3\nnodes = [0, "1/3", "2/3"]\n'
        'matrix = [[], ["1/3"], [0, "2/3"]]\nweights = ["1/4", 0, "3/4"]\n'
    )
    said = strapgen_says("generate dcm --tableau my.toml --increments 4 --target c --out firmware")
    name = "dcm_heun_of_third_order_4"
    assert said.startswith("dcm-heun-of-third-order-4 for c: ")
    assert {path.name for path in (tmp_path / "firmware").iterdir()} == {f"{name}.c", f"{name}.h"}
    header = (tmp_path / "firmware" / f"{name}.h").read_text()
    assert "strapgen generate dcm --tableau my.toml --increments 4 --target c" in header
    assert "Heun of third order: K. Heun, 1900." in " ".join(header.replace("\n *", " ").split())
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-c"]
    done = subprocess.run(
        ["cc", *flags, f"firmware/{name}.c", "-o", "step.o"], cwd=tmp_path, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_generate_all_as_json(strapgen_says, tmp_path, monkeypatch):
    few = [derived.program(Choice(*choice)) for choice in (("euler", "rk4", 2), ("dcm-product",))]
    monkeypatch.setattr(standard_tree, "programs", lambda: iter(few))  # of all, in tests/library
    data = json.loads(strapgen_says("generate --all --out out --format json"))
    assert list(data) == ["schema", "files"]
    written = {str(path.relative_to(tmp_path)) for path in (tmp_path / "out").rglob("*") if path.is_file()}
    assert set(data["files"]) == written
    assert strapgen_says("generate --all --check --out out").endswith(f"{len(written)} files, in step\n")


# simulate on a motion


@pytest.mark.parametrize(
    ("motion", "settings"),
    [
        ("constant", "x_deg_s=1 y_deg_s=-2 z_deg_s=3.5"),
        ("sinusoidal", "a_deg_s=10 b_rad_s=0.2"),
        ("coning", "a_deg_s=10 b_rad_s=0.5 g_deg_s=1e1"),
        ("polynomial", "a0=1 a1=-0.5 a2=0.1 a3=0.01 a4=1e-4"),
    ],
)
def test_simulate_json(motion, settings, strapgen_says):
    said = strapgen_says(
        f"simulate euler --motion {motion} --set {settings} "
        "--step 0.125 --duration 4 --record 0.5 --orthonormalize 1 --format json"
    )
    data = json.loads(said, parse_constant=pytest.fail)
    named = {"algorithm": "euler", "method": "rk4", "increments": 2, "backend": "numpy", "motion": motion}
    assert data.items() >= (named | {"step_s": 0.125, "duration_s": 4.0}).items()
    assert data["time_s"] == [0.5 * k for k in range(9)]
    for part in ("scale", "skew_deg", "drift_deg"):
        assert np.shape(data[part]) == (9, 3)
        assert data[part][0] == [0, 0, 0]
    assert data["mean_drift_deg"] == pytest.approx(np.linalg.norm(np.abs(data["drift_deg"]).max(axis=0)))
    assert data["mean_drift_deg"] < 1e-3


@pytest.mark.parametrize("algorithm", catalogue.ALGORITHMS)
def test_simulate_has_defaults(algorithm, strapgen_says):
    data = json.loads(strapgen_says(f"simulate {algorithm} {CONING} --format json"))
    assert [data[key] for key in ("algorithm", "method", "increments", "backend")] == [
        algorithm,
        "rk4",
        2,
        "numpy",
    ]
    assert len(data["time_s"]) == 41


def test_settings_may_be_gathered_or_repeated(strapgen_says):
    rest = "--motion coning --step 0.125 --duration 1 --format json"
    a, b, g = "a_deg_s=10", "b_deg_s=-5", "g_deg_s=3"
    said = {
        strapgen_says(f"simulate euler {rest} --set {a} {b} {g}"),
        strapgen_says(f"simulate euler {rest} --set {a} --set {b} --set {g}"),
        strapgen_says(f"simulate euler {rest} --set {g} {a} --set {b}"),
        strapgen_says(f"simulate euler {rest} --set={a} {b} --set={g}"),
        strapgen_says(f"simulate --set {a} {b} {g} {rest} euler"),
        strapgen_says(f"simulate --set {a} {b} {g} euler {rest}"),
    }
    assert len(said) == 1


def test_simulate_prints_matrices_every_so_often_under_a_title(strapgen_says):
    command = f"simulate dcm --method rk1 {CONING} --record 1 --orthonormalize 5"
    lines = strapgen_says(f"{command} --print 2 --title 'A first try'").splitlines()
    assert lines[0] == "A first try"
    places = [k for k, line in enumerate(lines) if line.startswith("at ")]
    assert [lines[k] for k in places] == ["at 0 s", "at 2 s", "at 4 s", "at 5 s"], "the end is among them"
    data = json.loads(strapgen_says(f"{command} --format json --matrices --title 'A first try'"))
    assert data["title"] == "A first try"
    for k, record in zip(places, (0, 2, 4, 5), strict=True):
        printed = np.array([[float(x) for x in line.split()] for line in lines[k + 2 : k + 5]])
        wanted = np.hstack([data[name][record] for name in ("computed", "true", "difference", "error")])
        np.testing.assert_allclose(printed, wanted, rtol=1e-4, atol=6e-10)


def test_simulate_multiplies_the_steps_in_another_order(strapgen_says):
    words = "simulate euler --backend c --motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 --step 0.01"
    command = f"{words} --duration 10 --record 10 --format json"
    by_steps, by_scan = (json.loads(strapgen_says(command + order)) for order in ("", " --order scan"))
    assert "order" not in by_steps
    assert by_scan["order"] == "scan"
    assert by_steps["drift_deg"] != by_scan["drift_deg"]
    np.testing.assert_allclose(by_scan["drift_deg"], by_steps["drift_deg"], atol=1e-11)
    assert json.loads(strapgen_says(f"{command} --order sequential")) == by_steps


def test_simulate_begins_at_an_attitude(strapgen_says):
    command = f"simulate euler --method rk2 {CONING} --record 5 --format json --matrices"
    turned, plain = (json.loads(strapgen_says(command + more)) for more in (" --initial-deg 10,-20,30", ""))
    start = np.array(turned["true"][0])
    np.testing.assert_allclose(turned["computed"][0], start, atol=1e-15)
    np.testing.assert_allclose(start, np.array(turned["true"][1]) @ np.array(plain["true"][1]).T, atol=1e-14)
    np.testing.assert_allclose(start[:, 0], [0.813797681, 0.469846310 * 1.0, 0.342020143], atol=1e-8)


def test_simulate_on_rates_and_on_a_motion_of_ones_own(strapgen_says):
    swing = (
        "--motion "
        + str(Path(__file__).parents[2] / "examples/own_motion.py")
        + " --step 0.125 --duration 10"
    )
    command = f"simulate euler --method rk4 {swing} --record 10 --format json"
    extracted, known = (json.loads(strapgen_says(command + more)) for more in ("", " --rates"))
    assert known["rates_at"] == [0, 0.5, 1] and "increments" not in known
    assert 0 < known["mean_drift_deg"] < extracted["mean_drift_deg"] / 5, "what the extraction of rates costs"
    in_words = json.loads(strapgen_says(f"{command} --rates --backend c-fixed32 --carry full"))
    assert in_words["mean_drift_deg"] == pytest.approx(known["mean_drift_deg"], abs=1e-5)


def test_scheme_matters(strapgen_says):
    command = f"simulate dcm --method rk1 {CONING} --orthonormalize 1 --format json"
    drifts = {
        json.loads(strapgen_says(f"{command} --scheme {scheme}"))["mean_drift_deg"]
        for scheme in catalogue.orthonormalizations("dcm")
    }
    assert len(drifts) == len(catalogue.orthonormalizations("dcm")) > 1


def test_output_into_a_file(strapgen_says, tmp_path):
    wanted = strapgen_says(f"simulate dcm {CONING} --format csv")
    assert strapgen_says(f"simulate dcm {CONING} --format csv --out deep/er/run.csv") == ""
    assert (tmp_path / "deep" / "er" / "run.csv").read_text() == wanted


# simulate on recorded data


def test_recorded_rates(strapgen_says):
    options = f"--input instants --recording {DATA}/rates_uneven.csv --repair clock"
    data = json.loads(strapgen_says(f"simulate dcm {options} --record 0.5 --orthonormalize 1 --format json"))
    assert list(data) == [
        *("schema", "algorithm", "method", "increments", "backend", "source"),
        *("step_s", "duration_s", "unused_increments", "elements", "time_s", "attitude"),
    ]
    assert data["source"] == f"{DATA}/rates_uneven.csv"
    assert np.shape(data["attitude"]) == (9, 9)
    assert (data["step_s"], data["duration_s"]) == pytest.approx((0.02, 4.0), rel=1e-12)
    assert data["unused_increments"] == 0


def test_unit_of_rates_matters(strapgen_says, tmp_path):
    log, last = tmp_path / "log.csv", []
    log.write_text("".join(f"{k / 100},0.1,0.2,0.3\n" for k in range(51)))
    for unit in ("deg/s", "rad/s"):
        said = strapgen_says(
            f"simulate euler --input instants --recording {log} --rate-unit {unit} --format json"
        )
        last.append(json.loads(said)["attitude"][-1])
    assert not np.allclose(*last)


@pytest.mark.long
def test_unused_increments_are_reported(capsys):
    line = f"simulate euler --increments 3 --recording {DATA}/increments.csv --format"
    said = {}
    for form in ("json", "text", "csv"):
        with pytest.raises(SystemExit) as stop:
            main([*line.split(), form])
        assert stop.value.code == 0
        said[form] = capsys.readouterr()
        assert said[form].err.endswith("1 increment at the end fills no step of 3 and is left out\n")
    assert json.loads(said["json"].out)["unused_increments"] == 1
    assert said["text"].out.endswith("1 increments at the end make no whole step and were not used\n")


@pytest.mark.long
def test_recording_into_files(strapgen_says, tmp_path):
    pytest.importorskip("matplotlib")
    options = f"--input instants --recording {DATA}/rates_even.csv --rate-unit deg/s"
    wanted = strapgen_says(f"simulate euler {options}")
    assert strapgen_says(f"simulate euler {options} --out attitude.csv --plot attitude.png") == ""
    assert (tmp_path / "attitude.csv").read_text() == wanted
    assert (tmp_path / "attitude.png").read_bytes().startswith(b"\x89PNG")


# compare

COMPARE_KEYS = [
    *("backend", "max_abs_rad", "rms_rad", "max_ulp"),
    *("bound_rad", "drift_deg", "ns_per_step", "bytes"),
]


@pytest.mark.long
def test_compare_json(strapgen_says):
    said = strapgen_says(
        f"compare euler --backends numpy,c,c-float,c-fixed32,c-fixed16 {CONING} --format json"
    )
    rows = json.loads(said, parse_constant=pytest.fail)
    assert [row["backend"] for row in rows] == ["numpy", "c", "c-float", "c-fixed32", "c-fixed16"]
    assert all(list(row)[:9] == ["schema", *COMPARE_KEYS] for row in rows)
    assert [row["bound_rad"] is None for row in rows] == [True, True, True, False, False]
    assert all(row["max_abs_rad"] <= row["bound_rad"] for row in rows[3:])


def test_compare_recorded_increments(strapgen_says):
    said = strapgen_says(f"compare euler --backends c-fixed16 --recording {DATA}/increments.csv --carry full")
    assert "drift from numpy" in said and "c-fixed16" in said


def test_compare_as_a_gate(strapgen_says, capsys, monkeypatch, tmp_path):
    command = f"compare euler --backends c,c-fixed16 {CONING} --format json --fail-above"
    strapgen_says(f"{command} 0.1")
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(f"{command} 1e-9"))
    said = capsys.readouterr()
    assert stop.value.code == 1
    assert re.fullmatch(r"strapgen: further from numpy than 1e-9 rad: c-fixed16 \S+ rad\n", said.err)
    assert len(json.loads(said.out)) == 2


# study


def test_study_word_length(strapgen_says, tmp_path):
    pytest.importorskip("matplotlib")
    command = "study word-length --words 16,24 --carries none,full --duration 5 --jobs 1"
    rows = json.loads(strapgen_says(f"{command} --format json --plot study.png"), parse_constant=pytest.fail)
    assert [(row["word"], row["carry"]) for row in rows] == [
        (16, "none"),
        (24, "none"),
        (16, "full"),
        (24, "full"),
    ]
    assert all(row["rounding_deg"] <= row["bound_deg"] for row in rows)
    assert (tmp_path / "study.png").read_bytes().startswith(b"\x89PNG")
    assert strapgen_says(f"{command} --format csv").count("\n") == 5
    assert "the method itself drifts by" in strapgen_says(command)


@pytest.mark.long
def test_frontier(strapgen_says, tmp_path):
    pytest.importorskip("matplotlib")
    command = "frontier --method coning-compressed:1+1,rk4:2 --duration 1 --jobs 1 --results results.jsonl"
    data = json.loads(
        strapgen_says(f"{command} --format json --plot frontier.png"), parse_constant=pytest.fail
    )
    assert [row["algorithm"] for row in data["algorithms"]] == ["coning-compressed:1+1", "rk4:2"]
    assert (tmp_path / "frontier.png").read_bytes().startswith(b"\x89PNG")
    content = (tmp_path / "results.jsonl").read_bytes()
    text = strapgen_says(command)
    assert "every figure is measured here" in text
    assert (tmp_path / "results.jsonl").read_bytes() == content  # nothing was run again
    assert strapgen_says(f"{command} --format csv").count("\n") == 3


def at_work(process: int) -> int:
    """Return how many processes that a process has started used half a second of the processor, more than a start."""
    count = 0
    for child in Path(f"/proc/{process}/task/{process}/children").read_text().split():
        with contextlib.suppress(OSError):  # it has ended meanwhile
            times = Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()[11:13]
            count += sum(map(int, times)) >= os.sysconf("SC_CLK_TCK") / 2
    return count


@pytest.mark.posix
@pytest.mark.long
def test_an_interrupt_stops_a_study_at_once(tmp_path):
    # Cases that take minutes each, in two processes.
    words = [
        "study",
        "word-length",
        "--words",
        "17,21",
        "--duration",
        "3600",
        "--steps",
        "0.005",
        "--jobs",
        "2",
    ]
    environment = os.environ | {"STRAPGEN_CACHE_DIR": str(tmp_path / "cache")}
    with subprocess.Popen(
        [sys.executable, "-m", "strapgen", *words, "--out", str(tmp_path / "out.txt")],
        stderr=subprocess.PIPE,
        env=environment,
        text=True,
        # A suite that was started in the background ignores interrupts, and so would what it starts.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        for _ in range(2000):  # as long as the machine needs
            if process.poll() is not None or at_work(process.pid) == 2:
                break
            time.sleep(0.05)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        try:
            _, said = process.communicate(timeout=60)  # of a busy machine; the cases take minutes
        finally:
            process.kill()
    assert process.returncode == 130
    assert "Traceback" not in said
    assert not (tmp_path / "out.txt").exists()


# tables


@pytest.mark.long
def test_fixed_point_tables_mark_figures_dominated_by_round_off(strapgen_says):
    said = strapgen_says("tables --backend c-fixed32")
    assert "r round-off dominates" in said
    rows = re.findall(r"^    c-fixed32 .*$", said, flags=re.MULTILINE)
    assert len(rows) == 10 and sum(row.endswith("r") for row in rows) >= 5


@pytest.mark.long
def test_round_off_of_table_5(strapgen_says):
    def drift(backend, options=""):
        entries = json.loads(strapgen_says(f"tables --table 5 --backend {backend} {options} --format json"))
        (found,) = (e for e in entries if (e["table"], e["algorithm"], e["order"]) == (5, "euler", 4))
        return found["drift_deg"]

    double = drift("numpy")
    assert abs(drift("c-fixed32") - double) < 2e-6
    assert abs(drift("c-fixed32", "--carry full") - double) < 1e-7


@pytest.mark.long
def test_one_table_by_its_number(strapgen_says, tmp_path):
    pytest.importorskip("matplotlib")
    said = strapgen_says("tables --table 5 --backend numpy --plot table.svg")
    assert ">Table 5: coning on a constant" in (tmp_path / "table.svg").read_text()
    assert said.startswith("Table 5: ") and said.count("Table ") == 1
    assert said.strip() in strapgen_says("tables --backend numpy")


def test_tables_text(strapgen_says):
    said = strapgen_says("tables --backend numpy")
    for table in TABLES:
        assert f"Table {table.number}: {table.title}" in said
    assert "2.391" in said and "0.856" in said


# Speed, and life in a pipe


@pytest.mark.long
def test_quick_answers_load_no_heavy_library():
    code = """
import sys
from strapgen.cli import main
for words in (["--help"], ["simulate", "--help"], ["generate", "--check"]):
    try:
        main(words)
    except SystemExit:
        pass
    print("loaded", *sorted({"numpy", "sympy", "jinja2", "cffi", "matplotlib"} & sys.modules.keys()))
    if words == ["--help"]:
        assert not {"typer", "click", "rich"} & sys.modules.keys()
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = [line for line in done.stdout.splitlines() if line.split()[:1] == ["loaded"]]
    assert loaded == ["loaded"] * 3


@pytest.mark.long
def test_simulation_loads_no_computer_algebra(strapgen_says):
    """Once the sources are in the cache."""
    command = f"simulate euler {CONING} --backend numpy".split()
    strapgen_says("", *command)
    code = f"""
import sys
from strapgen.cli import main
try:
    main({command!r})
except SystemExit:
    pass
print("loaded", *sorted({{"sympy", "jinja2"}} & sys.modules.keys()))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "loaded"


@pytest.mark.posix
@pytest.mark.long
@pytest.mark.parametrize(
    "command",
    ["list", f"simulate dcm {CONING} --record 0.125 --format csv"],
)
def test_reader_that_leaves_is_no_error(command):
    program = shlex.join([sys.executable, "-m", "strapgen", *shlex.split(command)])
    done = subprocess.run(["sh", "-c", f"{program} | head -1"], capture_output=True, text=True)
    assert done.stderr == ""
    assert done.stdout.count("\n") == 1


def test_reader_that_is_gone_before_is_no_error():
    program = [sys.executable, "-m", "strapgen", "--version"]
    with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 1


@pytest.mark.long
@pytest.mark.parametrize(
    "command",
    ["list", f"simulate dcm {CONING}"],
)
def test_full_disk(command, full_device):
    with full_device.open("w") as full:
        program = [sys.executable, "-m", "strapgen", *shlex.split(command)]
        done = subprocess.run(program, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2
    assert done.stderr == "strapgen: the output cannot be written (No space left on device)\n"


def test_interruption(capsys, monkeypatch):
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(catalogue, "derive", interrupted)
    with pytest.raises(SystemExit) as stop:
        main(["derive", "euler"])
    assert stop.value.code == 130
    said = capsys.readouterr()
    assert said.out == ""
    assert "Traceback" not in said.err


def test_converge_prints_the_python_result(strapgen_says):
    said = strapgen_says(
        "converge dcm --method rk1,rk2 --increments 1 --steps 1/8,1/16,1/32 --duration 1 --format json"
    )
    for data, method in zip(json.loads(said), ("rk1", "rk2"), strict=True):
        assert data["kernel"] == f"dcm-{method}-1"
        assert data["predicted_order"] == int(method[-1])
        assert abs(data["observed_order"] - data["predicted_order"]) < 0.15
        assert [rung["step_s"] for rung in data["rungs"]] == [0.125, 0.0625, 0.03125]


@pytest.mark.long
def test_converge_takes_as_many_increments_as_the_method_needs(strapgen_says):
    said = strapgen_says(
        "converge euler --method rk2,butcher6 --increments enough --steps 1/8,1/16 --duration 1 --format csv"
    )
    assert {row["kernel"] for row in csv.DictReader(io.StringIO(said))} == {"euler-rk2-1", "euler-butcher6-4"}


@pytest.mark.parametrize(("limit", "status"), [("0.2", 0), ("0.0000001", 1)])
def test_converge_is_a_gate(limit, status, capsys):
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(f"converge euler --method rk2 --steps 1/8,1/16 --duration 1 --fail-beyond {limit}"))
    assert stop.value.code == status
    assert capsys.readouterr().err.count("\n") == status


@pytest.mark.long
def test_failing_check_names_the_failures(capsys, tmp_path):
    text = (DATA / "algorithms" / "picard.py").read_text()
    claimed = text.replace(
        '        transition="transition",', '        transition="transition", order=Order(7, 7, 2, 7),'
    )
    lines = claimed.splitlines()
    lines.insert(2, "from strapgen.ir.kernel_info import Order")
    (tmp_path / "wrong.py").write_text("\n".join(lines))
    with pytest.raises(SystemExit) as stop:
        main(["check", str(tmp_path / "wrong.py"), "--format", "json"])
    said = capsys.readouterr()
    assert stop.value.code == 1
    assert said.err.startswith("strapgen: ") and "fails: order" in said.err
    data = json.loads(said.out)
    assert data["holds"] is False
    assert {finding["name"] for finding in data["findings"] if finding["holds"] is False} == {"order"}


@pytest.mark.long
def test_series_prints_the_fixed_text(strapgen_says):
    said = strapgen_says("series euler --method rk4 --increments 2 --motion constant --terms 2 --format json")
    data = json.loads(said)
    assert data["order"] == 4
    h, x, y, z = sp.symbols("h w_x w_y w_z")
    square = x**2 + y**2 + z**2
    wanted = h**5 * y * square**2 / 1920 - h**7 * y * square**3 / 21504
    assert sp.expand(sp.sympify(data["drift"][1]) - wanted) == 0
    assert data["skew"] == ["0", "0", "0"]
    assert set(data) >= {"order", "drift", "scale", "skew", "run", "growth", "closed_form"}


@pytest.mark.long
def test_series_versus_and_all(strapgen_says):
    said = strapgen_says("series dcm --method rk1 --motion constant --versus euler --format json")
    assert json.loads(said)["ratio"] == "-9*x**2/5 + 4"
    said = strapgen_says("series dcm --method rk2 --motion constant --versus dcm --versus-method rk1")
    assert "ratio = -3*x**2/20 - 1/2" in said
    rows = json.loads(strapgen_says("series euler --all --method rk1,magnus2 --format json"))
    assert [row["kernel"] for row in rows] == ["euler-rk1-1", "euler-magnus2-1"]


@pytest.mark.long
def test_series_latex_and_files(strapgen_says, tmp_path):
    said = strapgen_says("series dcm --method rk1 --format latex")
    assert said.rstrip().endswith(r"\end{align*}")
    strapgen_says(
        "series dcm --method rk1 --motion sinusoidal --steps 1/4,1/8 --plot drift.svg --out drift.txt"
    )
    assert (tmp_path / "drift.svg").read_text().startswith("<?xml")
    assert "order 1" in (tmp_path / "drift.txt").read_text()


@pytest.mark.long
def test_tables_predicted(strapgen_says):
    data = json.loads(strapgen_says("tables --predict --format json --plot predicted.svg"))
    assert ">predicted<" in Path("predicted.svg").read_text()
    assert len(data["entries"]) == 6
    assert all(abs(entry["deviation"]) < 0.01 and entry["agrees"] for entry in data["entries"])
    assert data["ratios"][0]["ratio"] == "9*x**2/80 + 1/4"
    assert f"Table {TABLES[-1].number}" in strapgen_says("tables --predict")


@pytest.mark.long
def test_strapdown_is_the_course_of_python(strapgen_says, tmp_path):
    log = DATA.parents[1] / "examples" / "inertial_log.csv"
    command = f"strapdown euler --recording {log} --fast-cycles 4 --slow-cycles 50 --initial-deg 10,20,30"
    said = json.loads(strapgen_says(f"{command} --frame-rate-deg-h 0,0,15 --format json"))
    made = course(
        "euler",
        read_inertial(log),
        fast_cycles=4,
        slow_cycles=50,
        frame=NavigationFrame(np.radians([10, 20, 30]), np.radians([0, 0, 15]) / 3600),
    )
    assert said["attitude"] == made.states.tolist()
    assert said["velocity_changes_m_s"] == made.velocity_changes.tolist()
    assert strapgen_says(f"{command} --out course.csv") == ""
    assert (
        (tmp_path / "course.csv")
        .read_text()
        .startswith("time_s,e_x,e_y,e_z,e_s,roll_deg,pitch_deg,heading_deg,dvx_m_s")
    )
    assert "roll, deg" in strapgen_says(command)


def test_generate_prints_the_error_bounds_of_floating_point(strapgen_says):
    data = json.loads(strapgen_says("generate euler --target c-float --format json"))["error_bounds"]
    assert data["inputs"] == {"state": 1.0625, "increments": 0.125}
    assert len(data["errors"]["next"]) == 4 and 3e-7 < max(data["errors"]["next"]) < 4e-7
    assert 0 < data["run"]["per_step"] < 1e-6
    assert data["reason"] is None
    data = json.loads(strapgen_says("generate euler-from-dcm --target c --format json"))["error_bounds"]
    assert data["errors"] is None and "comparison" in data["reason"]
    assert "exact" in strapgen_says("generate euler-from-cayley-klein --target c")
    assert "no error bound: atan2 jumps" in strapgen_says("generate euler-angles-from-dcm --target c")


def test_generate_says_how_often_a_step_is_called(strapgen_says, tmp_path):
    options = f"--target c-fixed --max-rate-deg-s 400 --sample-hz 200 --out {tmp_path}"
    assert "a step takes 2 samples of the gyro: call it at 100 Hz" in strapgen_says(
        f"generate euler {options}"
    )
    said = strapgen_says(f"generate euler --method rk1 --increments 1 {options}")
    assert "call it at" not in said
