"""The appendix of a paper: what the commands write as LaTeX compiles, and no line is wider than the page."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
from shared_results import shared_results  # noqa: F401

from strapgen.cli import main

SHORT = (
    "derive euler --method rk4 --show latex",
    "derive dcm --method rk4 --format latex",
    "tableau rk4 --format latex",
    "coning --samples 4 --format latex",
    "stability dcm --method rk3,rk4 --format latex",
)
LONG = (
    *SHORT,
    "derive euler --method rk4 --increments 4 --format latex",
    "derive dcm --method rk3 --increments 3 --format latex",
    "derive euler --method rk4 --rates --format latex",
    "derive euler --method butcher6 --increments 3 --format latex",
    "derive dcm --method magnus4 --format latex",
    "derive dcm-orthonormalize --format latex",
    "derive coning-fast --format latex",
    "derive dcm-from-euler --format latex",
    "derive dcm-orthonormalize-optimal --format latex",
    "derive euler-angles-from-dcm --format latex",
    "derive geographic-angles --format latex",
    "derive euler --method crouch-grossman3 --format latex",
    "derive euler --show operations --format latex",
    "derive euler --show program --format latex",
    "tableau dormand-prince8 --format latex",
    "tableau cooper-verner8 --format latex",
    "tableau examples/heun3.toml --format latex",
    "tableau examples/kutta4.toml --format latex",
    "tableau examples/fifth_order.toml --format latex",
    "coning --samples 3 --previous 2 --form uncompressed --format latex",
    "series euler --method rk4 --format latex",
    "series dcm --method rk4 --format latex",
    "series euler --method rk4 --motion coning --terms 1 --format latex",
    "series dcm --method rk1 --motion constant --format latex",
    "series velocity-position --format latex",
    "series dcm --versus euler --format latex",
    "series dcm --method rk3 --motion coning --versus euler --format latex",
    "statements --format latex",
    "series euler --all --method rk1,rk4 --format latex",
    "vibration dcm --method rk4 --step 0.02 --frequency-hz 10 --theta-x-rad 0.01 --theta-y-rad 0.02 --phase-rad 1.1"
    " --format latex",
    "derive examples/three_samples.py --format latex",
    "derive examples/two_velocity_samples.py --format latex",
    "series examples/two_velocity_samples.py --format latex",
    "solve examples/three_samples.py --order 4 --format latex",
    "solve examples/rates_at_nodes.py --order 4 --format latex",
    "list backends --format latex",
    "list methods --format latex",
    "window show window-3-3 --format latex",
    "simulate euler --motion constant --set y_deg_s=10 --step 0.5 --duration 1 --format latex",
    "compare euler --method rk1,rk2 --backend numpy,exact --motion constant --set y_deg_s=10 --step 0.5 --duration 1"
    " --format latex",
    "converge euler --method rk1 --step 1/2,1/4 --duration 1 --backend numpy --format latex",
)


def overfull(log: str) -> list[str]:
    """Return what a log of pdflatex says of boxes larger than the page, and of errors."""
    return re.findall(r"^(?:Overfull .[hv]box|!).*$", log, flags=re.MULTILINE)


def compiled(text: str, folder: Path) -> str:
    """Compile text in the class article, and return the log."""
    if shutil.which("pdflatex") is None:
        pytest.skip("pdflatex is not installed (Debian: texlive-latex-base)")
    source = "\\documentclass{article}\n\\usepackage{amsmath}\n\\allowdisplaybreaks\n\\begin{document}\n"
    (folder / "appendix.tex").write_text(f"{source}{text}\n\\end{{document}}\n")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "appendix.tex"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="replace")
    log = (folder / "appendix.log").read_text(errors="replace")
    assert done.returncode == 0, f"{overfull(log)}\n{log[-2000:]}"
    return log


@pytest.mark.parametrize(
    "commands", [SHORT, pytest.param(LONG, marks=pytest.mark.long)], ids=["short", "long"]
)
def test_an_appendix_compiles_without_overfull_boxes(commands, capsys, tmp_path):
    parts = []
    for command in commands:
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(command))
        printed = capsys.readouterr()
        assert stop.value.code == 0, f"{command}: {printed.err}"
        words = command.replace("_", r"\_").replace("--", "-{}-")
        parts.append(f"\\subsection*{{{words}}}\n\\raggedright\n\\noindent\n{printed.out}")
    assert overfull(compiled("\n".join(parts), tmp_path)) == []


def test_a_line_that_is_too_wide_is_seen(tmp_path):
    assert overfull(compiled(f"\\noindent\\mbox{{{'word ' * 40}}}", tmp_path))
