"""The example of an application: installed by its entry point, its kernel and its command work like strapgen's own."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from strapgen import applications

TOY = Path(__file__).resolve().parents[1] / "examples" / "toy_application"


@pytest.fixture
def strapgen_with(tmp_path):
    """Runs strapgen with the example among the installed packages; entry points by default those of the example."""
    site = tmp_path / "site"
    shutil.copytree(TOY / "toy_application", site / "toy_application")
    info = site / "toy_application-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toy-application\nVersion: 1.0\n")
    project = tomllib.loads((TOY / "pyproject.toml").read_text())["project"]

    def run(*words, entries=project["entry-points"][applications.GROUP]):
        lines = [f"[{applications.GROUP}]", *(f"{name} = {value}" for name, value in entries.items())]
        (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
        return subprocess.run(
            [sys.executable, "-m", "strapgen", *words],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(site)},
            capture_output=True,
            text=True,
        )

    return run


def test_it_has_less_than_150_lines():
    assert sum(len(path.read_text().splitlines()) for path in TOY.rglob("*.py")) < 150


def test_its_study_has_the_angle_of_the_closed_form(strapgen_with):
    done = strapgen_with("study", "twist", "--half-angle-deg", "10", "--format", "json")
    assert done.returncode == 0, done.stderr
    angles = {row["backend"]: row["angle_rad"] for row in json.loads(done.stdout)}
    # An attitude whose z and scalar parts are as 0.1 to sqrt(0.99): twice the arc sine of 0.1.
    assert angles["numpy"] == pytest.approx(0.20033484232311968, abs=1e-15)
    assert angles["c"] == angles["numpy"]
    assert angles["c-float"] == pytest.approx(angles["numpy"], abs=2e-7)


def test_its_names_stand_in_the_lists_and_in_the_help(strapgen_with):
    kernels = strapgen_with("list", "kernels")
    assert "twist-z" in kernels.stdout and kernels.returncode == 0
    assert "twist " in strapgen_with("study", "--help").stdout


def test_its_kernel_is_generated_in_fixed_point(strapgen_with, tmp_path):
    done = strapgen_with("generate", "twist-z", "--target", "c-fixed", "--out", "firmware")
    assert done.returncode == 0, done.stderr
    assert (
        "void twist_z" in (tmp_path / "firmware" / "twist_z_w32.c").read_text()
        or "twist_z_w32" in done.stdout
    )


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ({"toy": "toy_application.application:TITLE"}, "application toy (toy_application.application:TITLE)"),
        ({"toy": "toy_application.application:Command"}, "is of type type; an Application is needed"),
        ({"toy": "toy_application"}, "is of type module; an Application is needed"),
    ],
)
def test_an_application_that_cannot_be_used_is_told_in_one_line(entries, said, strapgen_with):
    done = strapgen_with("study", "twist", entries=entries)
    assert done.returncode == 2 and said in done.stderr and done.stderr.count("\n") == 1
    # It disturbs no command of strapgen.
    assert strapgen_with("--help", entries=entries).returncode == 0
    assert strapgen_with("derive", "euler", entries=entries).returncode == 0


def test_a_kernel_whose_code_changes_is_derived_anew_and_one_that_fails_is_told(strapgen_with, tmp_path):
    path = tmp_path / "site" / "toy_application" / "kernel.py"
    program = ("derive", "twist-z", "--show", "program")
    assert "operations: none" in strapgen_with(*program).stdout
    path.write_text(path.read_text().replace("[z, scalar]", "[2 * z, scalar]"))
    doubled = strapgen_with(*program)
    assert doubled.returncode == 0 and "operations: none" not in doubled.stdout
    path.write_text(path.read_text().replace("[2 * z, scalar]", "[1 / 0, scalar]"))
    done = strapgen_with("derive", "twist-z")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert done.stderr.startswith("strapgen: kernel twist-z, kernel.py, line ")
