"""python -m generators MODULE CASE FOLDER: one generator in a process of its own; prints what it took as JSON."""

from __future__ import annotations

import json
import sys
import time
from importlib import import_module
from pathlib import Path

from generators import Case

module, name, folder = sys.argv[1:]
generator = import_module(f"generators.{module}")
start = time.perf_counter()
generator.write(Case(*name.split("-")), Path(folder))
seconds = time.perf_counter() - start
print(json.dumps({"seconds": seconds, "version": generator.version(), "language": generator.LANGUAGE}))
