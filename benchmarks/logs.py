"""Processor time and memory of reading a long log, beside polars and pyarrow in the same run.

Each reading is a process of its own; readings alternate, and the least time of each counts, since others on the
machine only ever add to it. A file is a header and rows of a time and three rates with nine digits.

    python benchmarks/logs.py [--rows N] [--rounds N] [--folder FOLDER]
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

#: Rows that are written together.
PART = 100_000
#: What each reading imports, and runs on a path.
READINGS = {
    "polars, CSV": ("import polars", "polars.read_csv(path)"),
    "strapgen, CSV": ("import strapgen", "strapgen.read(path)"),
    "strapgen without pyarrow, CSV": (
        "import sys; sys.modules['pyarrow'] = None; import strapgen",
        "strapgen.read(path)",
    ),
    "numpy.loadtxt, CSV": ("import numpy", "numpy.loadtxt(path, delimiter=',', skiprows=1)"),
    "pyarrow, Parquet": ("import pyarrow.parquet", "pyarrow.parquet.read_table(path)"),
    "strapgen, Parquet": ("import strapgen", "strapgen.read(path)"),
}
#: Most times the reference that a reading may take.
LIMITS = {"strapgen, CSV": ("polars, CSV", 2.5)}
#: Most memory of a command that streams, MB.
MOST_MB = 450
#: A reading of a short log comes first, which imports what is needed. Linux keeps the largest memory of the process.
_MEASURED = """
import json, sys, time
from pathlib import Path
{imports}
path = sys.argv[2]
{run}
path = sys.argv[1]
start = time.process_time()
{run}
used = time.process_time() - start
lines = [line.split() for line in Path("/proc/self/status").read_text().splitlines()]
print(json.dumps([used, next(int(line[1]) for line in lines if line[0] == "VmHWM:") / 1000]))
"""


def write(folder: Path, rows: int) -> dict[str, Path]:
    """Write the log in every format that can be written; return the files by format."""
    folder.mkdir()
    random = np.random.default_rng(1)
    paths = {"CSV": folder / "log.csv"}
    with paths["CSV"].open("w") as file:
        file.write("t [s],x [rad/s],y [rad/s],z [rad/s]\n")
        for first in range(0, rows, PART):
            count = min(PART, rows - first)
            times = (first + np.arange(count)) / 1000
            rates = random.normal(size=(count, 3)).tolist()
            for time, (x, y, z) in zip(times.tolist(), rates, strict=True):
                file.write(f"{time:.3f},{x:.9g},{y:.9g},{z:.9g}\n")
    try:
        from pyarrow import csv, parquet
    except ImportError:
        return paths
    paths["Parquet"] = folder / "log.parquet"
    parquet.write_table(csv.read_csv(paths["CSV"]), paths["Parquet"])
    return paths


def measured(code: str, path: Path, short: Path) -> tuple[float, float] | str:
    """Return the processor time in s and the largest memory in MB of a process, or why it could not run."""
    done = subprocess.run([sys.executable, "-c", code, str(path), str(short)], capture_output=True, text=True)
    if done.returncode:
        return (done.stderr.strip().splitlines() or ["it ended without a word"])[-1]
    seconds, megabytes = json.loads(done.stdout.splitlines()[-1])
    return seconds, megabytes


def main() -> int:
    """Print the table; return 1 if a limit is passed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rows", type=int, default=10_000_000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--folder", type=Path, help="where the files are written; 1 GB for ten million rows")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        paths = write(Path(folder, "long"), options.rows)
        short = write(Path(folder, "short"), 1000)
        least: dict[str, tuple[float, float] | str] = {}
        for _ in range(options.rounds):
            for name, (imports, run) in READINGS.items():
                kind = name.rpartition(", ")[2]
                code = _MEASURED.format(imports=imports, run=run)
                got: tuple[float, float] | str = "pyarrow is not installed"
                if kind in paths:
                    got = measured(code, paths[kind], short[kind])
                least[name] = min(least.get(name, got), got) if isinstance(got, tuple) else got
        code = _MEASURED.format(
            imports="import contextlib, io; from strapgen.cli import main",
            run="with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):\n"
            "    main(['simulate', 'euler', '--recording', path, '--record', '0.5'])",
        )
        streamed = measured(code, paths["CSV"], short["CSV"])
    print(f"{options.rows} rows; least of {options.rounds} rounds")
    for name, got in least.items():
        if isinstance(got, str):
            print(f"  {name}: not run ({got})")
        else:
            print(f"  {name}: {got[0]:.2f} s of processor time, {got[1]:.0f} MB")
    failed = False
    for name, (other, limit) in LIMITS.items():
        mine, theirs = least[name], least[other]
        if isinstance(mine, tuple) and isinstance(theirs, tuple):
            ratio = mine[0] / theirs[0]
            failed |= ratio > limit
            print(f"{name}: {ratio:.2f} times {other}; at most {limit}")
    if isinstance(streamed, str):
        print(f"strapgen simulate: not run ({streamed})")
        return 1
    print(
        f"strapgen simulate: {streamed[0]:.2f} s of processor time, {streamed[1]:.0f} MB; at most {MOST_MB} MB"
    )
    return int(failed or streamed[1] > MOST_MB)


if __name__ == "__main__":
    sys.exit(main())
