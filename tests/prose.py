"""Has proselint read the prose of every page: what is neither code nor formula nor table.

``make check`` runs it. It prints each remark with file, line and column, and exits with 1 if there are any.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = ("*.md", "docs/**/*.md", "examples/**/*.md")
#: Quotes and dots of the pages are those of a keyboard; "word" is a word of a processor; "multiply" is no adverb.
SETTINGS = json.dumps(
    {
        "checks": dict.fromkeys(
            ("typography.symbols", "cliches.misc.write_good", "misc.phrasal_adjectives"), False
        )
    }
)
#: What is not prose, each replaced by blanks so that lines and columns stay.
CODE = re.compile(
    r"^```.*?^```[^\n]*$"  # a block
    r"|^( {4}|\t)[^\n]*$"  # an indented block
    r"|^\|[^\n]*$"  # a table
    r"|^<[^\n]*$"  # HTML
    r"|\$\$.*?\$\$|\$[^$\n]+\$"  # formulas
    r"|``.+?``|`[^`]+`"  # code in a line
    r"|\]\([^)\s]+\)",  # the address of a link
    re.MULTILINE | re.DOTALL,
)


def prose(text: str) -> str:
    """Return the text with blanks in place of code, so that places stay the same.

    >>> prose("Run `make`\\nnow.")
    'Run CCCCCC\\nnow.'
    """
    text = re.sub(r"^#.*$", r"\g<0>.", text, flags=re.MULTILINE)  # a heading is a sentence for itself
    return CODE.sub(lambda match: re.sub(r"[^\n]", _filling(match[0]), match[0]), text)


def _filling(code: str) -> str:
    """Return what stands for code within a sentence, or in place of a block."""
    return "C" if code.startswith("`") and not code.startswith("```") else " "


def main() -> int:
    """Check all pages; return the exit status."""
    pages = sorted({page for pattern in PAGES for page in ROOT.glob(pattern) if "_build" not in page.parts})
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / ".proselintrc.json").write_text(SETTINGS)
        for page in pages:
            copy = folder / "pages" / page.relative_to(ROOT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_text(prose(page.read_text()))
        outcome = subprocess.run(
            [Path(sys.executable).with_name("proselint"), "check", "pages"],
            cwd=folder,
            capture_output=True,
            text=True,
        )
        remarks = (outcome.stdout + outcome.stderr).replace(f"{folder}/pages/", "")
    print(remarks, end="")
    return outcome.returncode


if __name__ == "__main__":
    sys.exit(main())
