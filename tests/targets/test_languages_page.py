"""What the page on languages shows compiles, runs and prints what the page says."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from strapgen.cli import main
from strapgen.ir.exceptions import CompilerError
from strapgen.run import octave
from strapgen.run.compiler import COMPILERS

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "languages.md").read_text()
#: The section of each language on the page.
SECTIONS = {"C++": "C++", "Rust": "Rust"}


def commands(text: str) -> list[str]:
    """Return the commands of a text, each in a line of its own."""
    prose = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    return re.findall(r"^ {4}(\S.*)$", prose, flags=re.MULTILINE)


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder to work in, with the examples and what the first commands of the page generate."""
    # A copy: Rust finds modules beside the folder in which the file really lies.
    shutil.copytree(ROOT / "examples" / "languages", tmp_path / "examples" / "languages")
    monkeypatch.chdir(tmp_path)
    for command in commands(PAGE.partition("\nFiles that")[0]):
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(command)[1:])
        assert stop.value.code in (0, None)
    return tmp_path


@pytest.mark.parametrize("language", SECTIONS)
def test_program_of_a_language_prints_the_text_of_the_page(language, workplace):
    try:
        compiler = COMPILERS[language]
        compiler.path()
    except CompilerError as error:
        pytest.skip(str(error))
    section = PAGE.partition(f"\n## {SECTIONS[language]}\n")[2].partition("\n## ")[0]
    build, run = commands(section)
    assert shlex.split(build)[0] == compiler.default
    subprocess.run([compiler.path(), *shlex.split(build)[1:]], cwd=workplace, check=True)
    said = subprocess.run(shlex.split(run), cwd=workplace, capture_output=True, text=True, check=True)
    assert f"It prints `{said.stdout.strip()}`" in section


def test_matlab_script_prints_the_text_of_the_page(workplace):
    if reason := octave.missing():
        pytest.skip(reason)
    section = PAGE.partition("\n## MATLAB and GNU Octave\n")[2].partition("\n## ")[0]
    generate, normalize, run, _ = commands(section)
    for command in (generate, normalize):
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(command)[1:])
        assert stop.value.code in (0, None)
    script = Path("examples/languages/run_step.m")
    assert run == f"octave-cli {script}"
    said = subprocess.run([*octave.command(), script], capture_output=True, text=True, check=True)
    assert f"It prints `{said.stdout.strip()}` too" in section
    texts = [script.read_text(), Path("out/matlab/euler_rk4_2.m").read_text()]
    for excerpt in re.findall(r"^```matlab\n(.*?)^```", section, flags=re.MULTILINE | re.DOTALL):
        assert any(excerpt in text for text in texts), excerpt


@pytest.mark.parametrize("language", SECTIONS)
def test_the_excerpts_of_a_section_stand_in_the_generated_files_and_the_program(language, workplace):
    section = PAGE.partition(f"\n## {SECTIONS[language]}\n")[2].partition("\n## ")[0]
    kind = {"C++": "cpp", "Rust": "rust"}[language]
    texts = [p.read_text() for p in [*Path("out/languages").iterdir(), *Path("examples/languages").iterdir()]]
    excerpts = re.findall(rf"^```{kind}\n(.*?)^```", section, flags=re.MULTILINE | re.DOTALL)
    flat = [re.sub(r"\s+", " ", text) for text in texts]
    assert len(excerpts) >= 2
    for excerpt in excerpts:
        assert any(re.sub(r"\s+", " ", excerpt).strip() in text for text in flat), excerpt
