"""Files about the package agree with the package: versions, requirements, links, workflows, hooks."""

from __future__ import annotations

import re
import tomllib
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from strapgen import __version__

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
CHANGES = (ROOT / "CHANGELOG.md").read_text()


@pytest.mark.parametrize("file", ["CITATION.cff", "recipe/recipe.yaml"])
def test_version_is_that_of_the_package(file):
    assert re.search(r'^ *version: "?(.+?)"?$', (ROOT / file).read_text(), re.MULTILINE)[1] == __version__
    assert f"## {__version__}\n" in CHANGES


def test_recipe_has_the_requirements_of_pyproject():
    run = (ROOT / "recipe/recipe.yaml").read_text().partition("  run:\n")[2].partition("\n\n")[0]
    stated = {line.strip(" -").replace(" ", "") for line in run.splitlines()}
    assert stated == {*PROJECT["dependencies"], f"python{PROJECT['requires-python']}"}


@pytest.mark.parametrize("workflow", sorted((ROOT / ".github/workflows").glob("*.yml")), ids=lambda p: p.stem)
def test_workflow_pins_its_actions_by_commit(workflow):
    used = re.findall(r"uses: *(.*)", workflow.read_text())
    assert used
    for action in used:
        assert re.fullmatch(r"[\w./-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", action), action


def test_the_action_installs_itself_and_pins_what_it_uses():
    steps = (ROOT / "action.yml").read_text().partition("  steps:\n")[2]
    (used,) = re.findall(r"uses: *(.*)", steps)
    assert f"uses: {used}\n" in (ROOT / ".github/workflows/tests.yml").read_text()
    assert 'run: python -m pip install "$ACTION"' in steps and "ACTION: ${{ github.action_path }}" in steps


def test_tested_versions_of_python_are_those_of_the_classifiers():
    tested = re.search(r"python: \[(.*)\]", (ROOT / ".github/workflows/tests.yml").read_text())[1]
    stated = [c.rpartition(" ")[2] for c in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", c)]
    assert tested.replace('"', "").split(", ") == stated
    assert PROJECT["requires-python"] == f">={stated[0]}"


@pytest.fixture(scope="module")
def with_addresses():
    spec = spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.with_addresses


def test_readme_of_the_package_links_to_files_of_the_repository(with_addresses):
    text = with_addresses((ROOT / "README.md").read_text(), ROOT, "https://example.org/a/b", "1.0")
    targets = re.findall(r"\]\(([^()]+)\)", text)
    assert targets
    for target in targets:
        assert re.match(r"https://|#", target), target
        here = re.fullmatch(r"https://example.org/a/b/(raw|blob|tree)/v1\.0/([^#]+)(#.*)?", target)
        if here:
            assert (ROOT / here[2]).is_dir() if here[1] == "tree" else (ROOT / here[2]).is_file(), target


def test_links_inside_links_and_addresses_are_distinguished(with_addresses):
    text = "[![a](b.svg)](docs) [c](https://d.org) [e](#f) [g](LICENSE#h)"
    assert with_addresses(text, ROOT, "https://r", "1") == (
        "[![a](https://r/raw/v1/b.svg)](https://r/tree/v1/docs) [c](https://d.org) [e](#f) [g](https://r/blob/v1/LICENSE#h)"
    )
