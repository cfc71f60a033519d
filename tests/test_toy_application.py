"""The example of a package: installed by its entry point, what it brings works like strapgen's own."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from fractions import Fraction
from pathlib import Path

import installed_packages
import numpy as np
import pytest

import strapgen
from strapgen import registration
from strapgen.cli import main

TOY = Path(__file__).resolve().parents[1] / "examples" / "toy_application"
#: What it brings, by the kind under which it is listed.
NAMES = {
    "kernels": {"twist-z"},
    "methods": {"heun3", "middle-rate"},
    "motions": {"swing"},
    "targets": {"numpy-licensed"},
    "backends": {"numpy-licensed"},
}


@pytest.fixture
def site(tmp_path):
    """A folder with the example as it is when pip has installed it."""
    site = tmp_path / "site"
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(TOY / "toy_application", site / "toy_application", ignore=ignored)
    project = tomllib.loads((TOY / "pyproject.toml").read_text())["project"]
    installed_packages.install(site, registration.GROUP, project["entry-points"][registration.GROUP])
    return site


@pytest.fixture
def strapgen_with(site, tmp_path):
    """Runs strapgen in a process of its own with the example among the installed packages."""

    def run(*words):
        return subprocess.run(
            [sys.executable, "-m", "strapgen", *words],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(site)},
            capture_output=True,
            text=True,
        )

    return run


@pytest.fixture
def strapgen_here(site, tmp_path, monkeypatch, capsys):
    """Runs a command of strapgen in this process with the example among the installed packages."""
    monkeypatch.chdir(tmp_path)
    with installed_packages.importable(site, monkeypatch):

        def run(*words):
            with pytest.raises(SystemExit) as stop:
                main(list(words))
            return stop.value.code, *capsys.readouterr()

        yield run


def test_it_has_less_than_150_lines():
    files = [path for path in TOY.rglob("*") if path.suffix in (".py", ".toml")]
    assert len(files) == 10 and sum(len(path.read_text().splitlines()) for path in files) < 150


def test_its_study_has_the_angle_of_the_closed_form(strapgen_with):
    done = strapgen_with("study", "twist", "--half-angle-deg", "10", "--format", "json")
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)
    schema = json.loads(strapgen_with("schema", "twist").stdout)
    assert {row["schema"] for row in rows} == {schema["$id"]} == {"strapgen/twist/1"}
    assert schema["items"]["properties"]["angle_rad"]["unit"] == "rad"
    angles = {row["backend"]: row["angle_rad"] for row in rows}
    # An attitude whose z and scalar parts are as 0.1 to sqrt(0.99): twice the arc sine of 0.1.
    assert angles["numpy"] == pytest.approx(0.20033484232311968, abs=1e-15)
    assert angles["c"] == angles["numpy"]
    assert angles["c-float"] == pytest.approx(angles["numpy"], abs=2e-7)


def test_command_is_in_the_help(strapgen_with):
    assert "twist " in strapgen_with("study", "--help").stdout


def test_its_names_stand_in_the_lists(strapgen_here, monkeypatch):
    code, said, told = strapgen_here("list", "--format", "json")
    assert code == 0 and told == ""
    listed = json.loads(said)
    monkeypatch.setattr(sys, "path", sys.path[1:])
    own = json.loads(strapgen_here("list", "--format", "json")[1])
    assert listed.pop("schema") == own.pop("schema") == "strapgen/names/1"
    assert {kind: {*names} - {*own[kind]} for kind, names in listed.items()} == {
        kind: NAMES.get(kind, set()) for kind in own
    }


@pytest.mark.parametrize(("method", "order"), [("middle-rate", 2), ("heun3", 3)])
def test_its_methods_run_on_its_motion_and_its_back_end(method, order, strapgen_here):
    """The body turns about x by the angle a sin(2 pi f t), which a step of order p meets to h^p."""
    motion = strapgen.motion("swing", angle_deg=20, frequency_hz="0.5")
    run = strapgen.backend(strapgen.choose("euler", method, 4), backend="numpy-licensed")
    assert run.name == "numpy-licensed" and run.sources.target == "numpy-licensed"
    assert all(entry.word is None or isinstance(entry.word, int) for entry in strapgen.BACKENDS.values())
    errors = []
    for step, steps in ((Fraction(1, 16), 52), (Fraction(1, 32), 104)):
        time = np.arange(steps + 1) * float(step)
        angle = np.radians(20) * np.sin(np.pi * time)
        matrices = run.matrices(run.propagate(motion.increments(step, steps, 4)))
        np.testing.assert_allclose(motion.attitude(time)[:, 2, 1], np.sin(angle), atol=1e-12)
        errors.append(np.abs(matrices[:, 2, 1] - np.sin(angle)).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.05)


def test_its_target_prints_its_line(strapgen_here, tmp_path):
    code, _, told = strapgen_here("generate", "twist-z", "--target", "numpy-licensed", "--out", "out")
    assert code == 0, told
    (path,) = (tmp_path / "out").glob("*.py")
    text = path.read_text()
    assert text.startswith("# SPDX-License-Identifier: MIT\n") and "def twist_z(" in text


def test_its_kernel_is_generated_in_fixed_point(strapgen_here, tmp_path):
    code, said, told = strapgen_here("generate", "twist-z", "--target", "c-fixed", "--out", "firmware")
    assert code == 0, told
    assert "twist_z_w32" in said and "twist_z_w32(" in (tmp_path / "firmware" / "twist_z_w32.c").read_text()


#: Registrations that cannot be used, and what is said of them.
BROKEN = {
    "toy_application.registration:TITLE": "has no attribute 'TITLE'",
    "toy_application.registration:Command": "is of type type; a Registration is needed",
    "toy_application": "is of type module; a Registration is needed",
    "lost.registration:REGISTRATION": "ModuleNotFoundError: No module named 'lost'",
}


@pytest.mark.parametrize("value", BROKEN)
def test_broken_registration_is_reported_in_one_line(value, site, strapgen_here):
    installed_packages.install(site, registration.GROUP, {"toy": value})
    installed_packages.as_in_a_new_process()
    code, said, told = strapgen_here("derive", "twist-z")
    assert (code, said, told.count("\n")) == (2, "", 1)
    assert told.startswith(f"strapgen: application toy ({value})") and BROKEN[value] in told
    # It disturbs no name of strapgen, and the list says so and goes on.
    assert strapgen_here("derive", "euler-product")[0] == 0
    code, said, told = strapgen_here("list", "kernels")
    assert code == 0 and "euler-product" in said
    assert told.startswith(f"strapgen: application toy ({value})") and told.count("\n") == 1


def test_broken_command_of_a_package_is_reported(site, strapgen_with):
    installed_packages.install(site, registration.GROUP, {"toy": "toy_application:REGISTRATION"})
    done = strapgen_with("study", "twist")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert done.stderr.startswith("strapgen: application toy (toy_application:REGISTRATION): AttributeError")
    assert strapgen_with("study", "--help").returncode == 0


#: Faults of a part of the package: the file, what it then has, a command that needs it, and what is said.
FAULTS = {
    "table": ("names.py", "import lost", "derive twist-z", "names.py, line 1: ModuleNotFoundError"),
    "record": (
        "names.py",
        "KERNELS = {'twist-z': 3}",
        "derive twist-z",
        "is of type int; a strapgen.ir.kernel_info.R",
    ),
    "target": (
        "target.py",
        "TARGETS = 3",
        "generate euler --target numpy-licensed",
        "is of type int; a mapping",
    ),
    "tableau": (
        "tableaux/heun3.toml",
        "order = 3",
        "derive euler --method heun3",
        "heun3.toml: name is missing",
    ),
    "command": ("twist.py", "1 / 0", "derive twist-y", "twist.py, line 1: ZeroDivisionError"),
    "motion": (
        "motion.py",
        "def swing(angle, frequency):\n    return 3",
        "simulate euler --motion swing --set angle_deg=1 frequency_hz=1 --step 1 --duration 2",
        "returned int; a Motion",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_broken_part_is_reported_and_the_rest_works(fault, site, strapgen_here):
    file, text, words, line = FAULTS[fault]
    (site / "toy_application" / file).write_text(f"{text}\n")
    code, said, told = strapgen_here(*words.split())
    assert (code, said, told.count("\n")) == (2, "", 1)
    assert line in told and "toy_application" in told
    code, said, told = strapgen_here("list")
    assert code == 0 and "\n  euler-product " in said
    assert line in said + told or fault == "motion"  # it is known only when it is run


def test_names_of_strapgen_are_not_hidden(site, strapgen_here):
    path = site / "toy_application" / "names.py"
    path.write_text(path.read_text().replace('"twist-z"', '"euler-product"'))
    assert "Euler parameters: state after a transition" in strapgen_here("derive", "euler-product")[1]
    code, said, _ = strapgen_here("list", "kernels")
    assert code == 0
    assert "cannot be used: strapgen has a kernel euler-product; another name is needed" in said


def test_changed_kernel_is_derived_anew_and_failure_reported(strapgen_with, site):
    path = site / "toy_application" / "kernel.py"
    program = ("derive", "twist-z", "--show", "program")
    assert "operations: none" in strapgen_with(*program).stdout
    path.write_text(path.read_text().replace("[z, scalar]", "[2 * z, scalar]"))
    doubled = strapgen_with(*program)
    assert doubled.returncode == 0 and "operations: none" not in doubled.stdout
    # Of another length: Python tells sources that were written in the same second apart by their size.
    path.write_text(path.read_text().replace("[2 * z, scalar]", "[z / 0, 1 / 0, scalar]"))
    done = strapgen_with("derive", "twist-z")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert done.stderr.startswith(
        "strapgen: kernel twist-z (toy_application.names:KERNELS), kernel.py, line "
    )


def test_the_code_of_a_package_tells_choices_apart(site, strapgen_here):
    def identities() -> list[str]:
        installed_packages.as_in_a_new_process()
        return [strapgen.choose(*words).identity for words in CHOICES]

    CHOICES = (("twist-z",), ("euler", "middle-rate"), ("euler", "heun3"), ("euler", "rk4"))
    before = identities()
    (site / "toy_application" / "beside.py").write_text("")
    after = identities()
    assert [one == other for one, other in zip(before, after, strict=True)] == [False, False, True, True]
    path = site / "toy_application" / "tableaux" / "heun3.toml"
    path.write_text(path.read_text().replace("Heun's", "Karl Heun's"))
    assert identities()[2] != after[2]
