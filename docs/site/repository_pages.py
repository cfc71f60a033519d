"""Pages that show files and folders of the repository to which other pages link."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

#: Folders whose many files are plain copies in place of pages.
COPIED = ("codegen", "generated", "tests")
#: Lines of a notebook's output that stand open on its page; longer ones are folded.
OPEN_LINES = 8
_LEXERS = {
    **{
        ".py": "python",
        ".c": "c",
        ".h": "c",
        ".toml": "toml",
        ".yml": "yaml",
        ".md": "markdown",
        ".mk": "make",
    },
    ".j2": "jinja",
}
_ASIDE = "---\norphan: true\nnosearch: true\n---\n"


def tracked(root: Path) -> list[str]:
    """Return the files of the repository: those of git, or outside a checkout all but caches and hidden ones.

    Parameters
    ----------
    root : Path
        The root of the repository.
    """
    try:
        command = ["git", "-C", str(root), "ls-files", "--cached", "--others", "--exclude-standard"]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        return sorted(line for line in done.stdout.splitlines() if (root / line).is_file())
    except (OSError, subprocess.CalledProcessError):
        names = (path.relative_to(root) for path in root.rglob("*") if path.is_file())
        return sorted(
            name.as_posix()
            for name in names
            if not any(part.startswith(".") or part in ("__pycache__", "_build") for part in name.parts)
        )


def file_page(path: str, text: str) -> str:
    """Return the page of a text file.

    Parameters
    ----------
    path : str
        Path of the file in the repository.
    text : str
        Its content.
    """
    if path.endswith(".ipynb"):
        return f"{_ASIDE}{notebook(text)}"
    lexer = _LEXERS.get(Path(path).suffix, "text")
    fence = "`" * (3 + text.count("````"))
    return f"{_ASIDE}# {Path(path).name}\n\n`{path}` of the repository:\n\n{fence}{lexer}\n{text.rstrip()}\n{fence}\n"


def folder_page(path: str, files: list[str], orphan: bool) -> str:
    """Return the page of a folder, which lists what is in it.

    Parameters
    ----------
    path : str
        Path of the folder in the repository.
    files : list of str
        The files of the repository.
    orphan : bool
        Whether no navigation leads to the page.
    """
    depth = path.count("/") + 1
    inside = [name for name in files if name.startswith(f"{path}/")]
    folders = sorted({"/".join(name.split("/")[: depth + 1]) for name in inside if name.count("/") > depth})
    here = [name for name in inside if name.count("/") == depth]
    lines = [
        _ASIDE if orphan else "",
        f"# {Path(path).name}/",
        "",
        f"The folder `{path}` of the repository holds:",
        "",
    ]
    lines += [f"- [{Path(name).name}/]({Path(name).name})" for name in folders]
    lines += [f"- [{Path(name).name}]({Path(name).name})" for name in here]
    return "\n".join(lines) + "\n"


def notebook(text: str) -> str:
    """Return a notebook with its outputs as Markdown.

    Parameters
    ----------
    text : str
        The notebook in JSON.
    """
    return "\n\n".join(_cell(cell) for cell in json.loads(text)["cells"]) + "\n"


def _output(plain: str) -> str:
    """Return an output in a fixed font, folded where it is long."""
    block, count = f"```text\n{plain}\n```", plain.count("\n") + 1
    if count <= OPEN_LINES:
        return block
    summary = f"<details>\n<summary>{count} lines of output</summary>\n"
    return f"{summary}\n{block}\n\n</details>"


def _cell(cell: dict[str, Any]) -> str:
    source = "".join(cell["source"])
    if cell["cell_type"] == "markdown":
        return source
    parts = [f"```python\n{source}\n```"]
    for output in cell.get("outputs", []):
        data = output.get("data", {})
        plain = "".join(output.get("text", data.get("text/plain", "")))
        if "text/latex" in data:
            parts.append(f"```{{math}}\n:no-wrap:\n\n{''.join(data['text/latex'])}\n```")
        elif plain:
            parts.append(_output(plain.rstrip()))
    return "\n\n".join(parts)
