"""The action of GitHub and the hook of pre-commit around strapgen verify: what they run is run."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from commands import run

ROOT = Path(__file__).parents[2]
yaml = pytest.importorskip("yaml")


def done(*words: str | Path, cwd: Path, **more: str) -> subprocess.CompletedProcess[str]:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, **more}
    return subprocess.run(
        [*map(str, words)], cwd=cwd, capture_output=True, text=True, check=False, env=environment
    )


@pytest.fixture
def firmware(tmp_path, capsys) -> Path:
    """A repository with generated C of several kinds, and C by hand."""
    folder = tmp_path / "repository"
    run(f"generate euler-product --target c --with-runs --out {folder / 'flat'}".split())
    run(f"generate euler-normalize --target c-fixed --project zephyr --out {folder / 'module'}".split())
    run(f"window generate window-3-3 --project --out {folder / 'late'}".split())
    (folder / "by_hand.c").write_text("int main(void) { return 0; }\n")
    (folder / "by_hand.h").write_text("int hand(void);\n")
    capsys.readouterr()
    return folder


def edited(folder: Path, name: str) -> None:
    (path,) = folder.rglob(name)
    path.write_text(f"{path.read_text()}/* mine */\n")


def steps() -> list[dict[str, object]]:
    return yaml.safe_load((ROOT / "action.yml").read_text())["runs"]["steps"]


def act(folder: Path, paths: str, options: str = "") -> subprocess.CompletedProcess[str]:
    """Run the last step of the action, as its runner does with inputs in place."""
    *_, verify = steps()
    values = {"${{ inputs.paths }}": paths, "${{ inputs.options }}": options}
    environment = {name: values[text] for name, text in verify["env"].items()}
    return done("bash", "-e", "-o", "pipefail", "-c", verify["run"], cwd=folder, **environment)


@pytest.mark.long
@pytest.mark.posix
@pytest.mark.needs("bash", "gcc")
def test_the_action_verifies_what_is_generated(firmware):
    said = act(firmware, ".")
    assert said.returncode == 0, said.stdout + said.stderr
    for name in ("euler_product", "euler_normalize_w32", "euler_late_3_3", "euler_window_3_3"):
        assert name in said.stdout
    assert "by_hand" not in said.stdout and "vectors" not in said.stdout
    edited(firmware, "euler_product.c")
    said = act(firmware, "flat module/src/euler_normalize_w32.c")
    assert said.returncode == 1 and "euler_product.c:" in said.stdout
    said = act(firmware, "flat", "--no-such-option")
    assert said.returncode != 0 and "no-such-option" in said.stdout + said.stderr


@pytest.fixture
def repository(firmware) -> Path:
    for words in (("init", "-q"), ("add", "-A")):
        assert done("git", *words, cwd=firmware).returncode == 0
    return firmware


@pytest.mark.long
@pytest.mark.needs("git", "gcc")
def test_the_hook_stops_an_edited_file(repository, tmp_path):
    """With the installed package in place of the copy that pre-commit would install."""
    pytest.importorskip("pre_commit")
    (hook,) = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())
    assert done("pre-commit", "validate-manifest", ROOT / ".pre-commit-hooks.yaml", cwd=ROOT).returncode == 0
    assert hook["language"] == "python"
    local = {"repos": [{"repo": "local", "hooks": [{**hook, "language": "system"}]}]}
    (repository / ".pre-commit-config.yaml").write_text(yaml.safe_dump(local))
    home = {"PRE_COMMIT_HOME": str(tmp_path / "home")}
    said = done("pre-commit", "run", "--all-files", cwd=repository, **home)
    assert said.returncode == 0 and "Passed" in said.stdout, said.stdout + said.stderr
    edited(repository, "euler_normalize_w32.c")
    assert done("git", "add", "-A", cwd=repository).returncode == 0
    said = done("pre-commit", "run", cwd=repository, **home)
    assert said.returncode == 1 and "euler_normalize_w32.c" in said.stdout


@pytest.mark.long
@pytest.mark.needs("git", "gcc")
def test_pre_commit_installs_the_hook_from_this_repository(repository, tmp_path):
    """As a user does; it brings what strapgen needs from the package index."""
    pytest.importorskip("pre_commit")
    if not (ROOT / ".git").exists():
        pytest.skip("the sources are in no repository")
    words = ("try-repo", ROOT, "strapgen-verify", "--all-files")
    said = done("pre-commit", *words, cwd=repository, PRE_COMMIT_HOME=str(tmp_path / "home"))
    assert said.returncode == 0 and "Passed" in said.stdout, said.stdout + said.stderr
