"""The hand-off in four commands, and the gate of a firmware's build in examples/firmware, run outside the checkout."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from c_programs import needed

ROOT = Path(__file__).resolve().parents[1]
EXAMPLE = ROOT / "examples" / "firmware"
#: The pages that show the hand-off; the first that does is read.
PAGES = (ROOT / "README.md", ROOT / "docs" / "command-line.md")
#: Steps of the workflow that set the machine up.
SETTING_UP = ("Install strapgen", "Install the cross compiler and the emulator")


def without_the_checkout(folder: Path) -> dict[str, str]:
    """Return an environment in which `strapgen` is this project's program; nothing else of the checkout is in reach."""
    program = folder / "bin" / "strapgen"
    program.parent.mkdir()
    package = shlex.quote(str(ROOT / "codegen"))
    program.write_text(
        f'#!/bin/sh\nPYTHONPATH={package} exec {shlex.quote(sys.executable)} -m strapgen "$@"\n'
    )
    program.chmod(0o755)
    return os.environ | {"PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}"}


def run(script: str, folder: Path, environment: dict[str, str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["sh", "-e", "-c", script],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )


def hand_off() -> list[str]:
    """Return the commands of the hand-off as a page shows them."""
    for page in PAGES:
        text = re.sub(r"\\\n\s*", "", page.read_text())
        shown = re.search(
            r"(?:^    .*\n)*^    strapgen generate .*--project.*\n(?:^    .*\n)+", text, re.MULTILINE
        )
        if shown is not None:
            return [line.strip() for line in shown[0].splitlines()]
    raise AssertionError("no page shows the hand-off")


@pytest.mark.long
def test_the_hand_off_takes_four_commands(tmp_path):
    needed("cmake", "ctest")
    commands = hand_off()
    assert [command.split()[0] for command in commands] == ["strapgen", "cmake", "cmake", "ctest"]
    environment, folder = without_the_checkout(tmp_path), tmp_path / "elsewhere"
    folder.mkdir()
    for command in commands:
        done = run(command, folder, environment)
        assert done.returncode == 0, done.stdout
    assert "100% tests passed" in done.stdout


def steps() -> dict[str, str]:
    """Return the commands of the workflow's steps by name."""
    text = (EXAMPLE / "firmware.yml").read_text()
    found = re.findall(
        r"^      - name: (.*)\n        run: (?:\|\n((?: {10}.*\n)+)|(.*)\n)", text, re.MULTILINE
    )
    assert len(found) == text.count("- name:")
    return {
        name: "\n".join(line.strip() for line in (several or one).splitlines())
        for name, several, one in found
    }


def test_the_workflow_uses_the_targets_of_the_makefile_alone():
    targets = {
        name for line in re.findall(r"^\.PHONY: (.*)$", makefile(), re.MULTILINE) for name in line.split()
    }
    used = [command for name, command in steps().items() if name not in SETTING_UP]
    assert {f"make -f strapgen.mk {target}" for target in targets} - {*used} == {
        "make -f strapgen.mk attitude-generate"
    }
    assert len(used) == len(targets) - 1


def makefile() -> str:
    return (EXAMPLE / "strapgen.mk").read_text()


@pytest.fixture(scope="module")
def firmware(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """Return the folder of a firmware that has just generated its step, and the environment of its build."""
    needed("make", "cmake")
    folder = tmp_path_factory.mktemp("firmware")
    environment = without_the_checkout(folder)
    shutil.copy(EXAMPLE / "strapgen.mk", folder)
    done = run("make -f strapgen.mk attitude-generate", folder, environment)
    assert done.returncode == 0, done.stdout
    return folder, environment


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    [name for name in steps() if name not in SETTING_UP],
)
def test_a_step_of_the_workflow_passes(name, firmware):
    if "M3" in name:
        needed("arm-none-eabi-gcc", "qemu-system-arm")
    folder, environment = firmware
    done = run(steps()[name], folder, environment)
    assert done.returncode == 0, done.stdout


@pytest.mark.long
@pytest.mark.parametrize(
    ("target", "said"),
    [
        ("attitude-check", r"-        return 3;"),
        ("attitude-verify", r"\.c:\d+: edited: return 3;"),
        ("attitude-vectors", r"\b[1-9]\d* failed"),
        ("attitude-vectors-m3", r"\b[1-9]\d* failed"),
    ],
)
def test_the_gate_stops_a_build_whose_step_was_edited(target, said, firmware, tmp_path):
    if target.endswith("m3"):
        needed("arm-none-eabi-gcc", "qemu-system-arm")
    folder, environment = firmware
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy, ignore=shutil.ignore_patterns("build"))
    (source,) = (
        path for path in (copy / "firmware").glob("*.c") if path.name != "main.c" and path.name[:5] != "test_"
    )
    text = source.read_text()
    assert text.count("return 1;") == 1
    source.write_text(text.replace("return 1;", "return 3;"))
    done = run(f"make -f strapgen.mk {target}", copy, environment)
    assert done.returncode != 0 and re.search(said, done.stdout)


@pytest.mark.long
def test_the_gate_stops_a_build_whose_arithmetic_is_too_coarse(firmware):
    folder, environment = firmware
    done = run("make -f strapgen.mk attitude-compare ATTITUDE_FAIL_ABOVE=1e-12", folder, environment)
    assert done.returncode != 0 and "1e-12" in done.stdout


def test_git_ignores_no_file_of_the_examples():
    files = [
        str(path.relative_to(ROOT))
        for path in (ROOT / "examples").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    ]
    assert any("firmware" in name for name in files)
    try:
        done = subprocess.run(
            ["git", "-C", ROOT, "check-ignore", "--no-index", "--stdin"],
            input="\n".join(files),
            capture_output=True,
            text=True,
            check=False,
        )
    except FileNotFoundError:
        pytest.skip("no git")
    if done.returncode not in (0, 1):
        pytest.skip("no checkout")
    assert done.stdout.splitlines() == []


def test_nothing_is_installed_by_a_name_that_no_index_has():
    """Whoever registers it would run code in the user's build."""
    install = steps()["Install strapgen"]
    source = re.search(r"STRAPGEN_SOURCE: (\S+)", (EXAMPLE / "firmware.yml").read_text())[1]
    assert source.startswith("./") and 'test -e "$STRAPGEN_SOURCE"' in install
    names = re.compile(r"pip install (?:--?\S+ )*strapgen\b(?!\[)")
    pages = [path for folder in ("docs", "examples", "templates") for path in (ROOT / folder).rglob("*.*")]
    for path in [ROOT / "README.md", *pages]:
        if path.suffix in (".md", ".yml", ".mk", ".j2", ".txt") and "_build" not in path.parts:
            assert not names.search(path.read_text()), path


@pytest.mark.parametrize(
    ("options", "step"),
    [
        ("--max-rate-deg-s 400 --step 0.02", "0.02"),
        ("--max-rate-deg-s 400 --sample-hz 200 --lsb 0.0175dps", "2/200"),
        ("--sample-hz 100 --increments 4", "4/100"),
    ],
)
def test_compared_run_has_the_step_of_the_options(options, step):
    assert f"--step {step} --duration" in make("attitude-compare", f"ATTITUDE_OPTIONS='{options}'")


def make(target: str, variables: str) -> str:
    """Return the commands of a target of the Makefile, with single spaces."""
    needed("make")
    command = f"make --no-print-directory -n -f {EXAMPLE / 'strapgen.mk'} {target} {variables}"
    said = subprocess.run(shlex.split(command), capture_output=True, text=True, check=True).stdout
    return " ".join(said.replace("\\\n", " ").split())


GYRO = "--target c-fixed --sample-hz 400 --lsb 0.0175dps"


@pytest.mark.parametrize(
    ("command", "name", "options", "compared"),
    [
        ("two-speed", "dcm", GYRO, "two-speed-dcm --source firmware"),
        ("two-speed", "dcm", f"{GYRO} --sculling 1", "two-speed-dcm-1 --source firmware"),
        ("system", "a.toml", GYRO, "a.toml --source firmware"),
    ],
)
def test_gate_takes_two_speeds_and_systems(command, name, options, compared):
    variables = f"ATTITUDE_COMMAND={command} ATTITUDE={name} ATTITUDE_OPTIONS='{options}'"
    said = make("attitude-compare", variables)
    assert f"strapgen compare {compared} --reference exact --motion" in said
    assert "--step 1/400 --duration" in said and "--fail-above" not in said
    project = "" if command == "system" else "--project "
    assert (
        make("attitude-generate", variables) == f"strapgen {command} {name} {options} {project}--out firmware"
    )
    assert make("attitude-check", variables) == f"strapgen {command} {name} {options} --check --out firmware"
    alone = f"ATTITUDE_COMMAND={command} ATTITUDE={name} ATTITUDE_OPTIONS='--target c-fixed'"
    assert "--step" not in make("attitude-compare", alone), "the rate of the system's file"


@pytest.mark.long
@pytest.mark.parametrize(("command", "name"), [("two-speed", "dcm"), ("system", "two-speed-dcm")])
def test_gate_of_counts_passes_and_stops_an_edited_loop(command, name, tmp_path):
    needed("make", "cmake")
    environment = without_the_checkout(tmp_path)
    shutil.copy(EXAMPLE / "strapgen.mk", tmp_path)
    line = f"make -f strapgen.mk ATTITUDE_COMMAND={command} ATTITUDE={name} ATTITUDE_OPTIONS='{GYRO}'"
    targets = ["generate", "check", "verify", "compare", *(["vectors"] if command == "two-speed" else [])]
    for target in targets:
        done = run(f"{line} attitude-{target}", tmp_path, environment)
        assert done.returncode == 0, done.stdout
    (source,) = (path for path in (tmp_path / "firmware").glob("*slow*_w32.c") if path.name[:5] != "test_")
    source.write_text(source.read_text().replace("return 1;", "return 3;"))
    for target in ("check", "verify", "compare"):
        done = run(f"{line} attitude-{target}", tmp_path, environment)
        assert done.returncode != 0 and "return 3;" in done.stdout
