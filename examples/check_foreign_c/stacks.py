"""Checks the sources that a file lists, which a user has fetched, and writes a table of them.

    python examples/check_foreign_c/stacks.py examples/check_foreign_c/stacks.toml > table.md

An entry has `name`, `version`, `source` (the file that is read, beside the list), `lines` (which of it, optional),
`shim` (a file of at most 10 lines that includes it, optional), and `options` of ``strapgen check``. What did not run
stands in no table.
"""

from __future__ import annotations

import hashlib
import json
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

MOST_LINES = 10
NEEDED, OPTIONAL = {"name", "version", "source", "options"}, {"lines", "shim"}
HEAD = (
    "stack",
    "version",
    "verdict",
    "likely cause",
    "drift, deg/h",
    "text that was read",
    "shim",
    "command",
)


def stacks(file: Path) -> list[dict[str, str]]:
    """Return the entries of a list."""
    entries = tomllib.loads(file.read_text(encoding="utf-8")).get("stack", [])
    for number, entry in enumerate(entries, 1):
        if wrong := sorted((NEEDED - entry.keys()) | (entry.keys() - NEEDED - OPTIONAL)):
            allowed = f"{', '.join(sorted(NEEDED))} are needed, {', '.join(sorted(OPTIONAL))} allowed"
            raise SystemExit(f"{file}: stack {number}: {', '.join(wrong)}: {allowed}")
    return entries


def row(folder: Path, entry: dict[str, str]) -> list[str] | None:
    """Run a check and return its row; None, with a line on stderr, if it did not run."""
    source, shim = folder / entry["source"], folder / entry.get("shim", entry["source"])
    lines = 0
    for path in (source, shim):
        if not path.is_file():
            print(f"{entry['name']}: {path} is not there; not run", file=sys.stderr)
            return None
    if "shim" in entry:
        lines = sum(bool(line.strip()) for line in shim.read_text(encoding="utf-8").splitlines())
        if lines > MOST_LINES:
            print(
                f"{entry['name']}: {shim} has {lines} lines; {MOST_LINES} are allowed; not run",
                file=sys.stderr,
            )
            return None
    options = shlex.split(entry["options"])
    words = [sys.executable, "-m", "strapgen", "check", str(shim), *options, "--format", "json"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        print(f"{entry['name']}: {done.stderr.strip()}; not run", file=sys.stderr)
        return None
    result = json.loads(done.stdout)
    text = source.read_bytes()
    part = f" lines {entry['lines']}" if "lines" in entry else ""
    read = f"`{entry['source']}`{part}, SHA-256 {hashlib.sha256(text).hexdigest()[:16]}"
    drift = result["drift_deg_h"]
    return [
        *(entry["name"], entry["version"], "holds" if result["holds"] else "fails", result["cause"] or "-"),
        "-" if drift is None else f"{drift:.4g}",
        *(read, f"{lines} lines" if lines else "-"),
        f"`{shlex.join(['strapgen', 'check', entry.get('shim', entry['source']), *options])}`",
    ]


def main(file: Path) -> None:
    """Write the table of a list."""
    rows = [one for entry in stacks(file) if (one := row(file.parent, entry)) is not None]
    for cells in (HEAD, ["---"] * len(HEAD), *rows):
        print(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")


if __name__ == "__main__":
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_file():
        raise SystemExit("usage: stacks.py FILE.toml; a list of sources is needed")
    main(Path(sys.argv[1]))
