"""Draws the pictures of the pages: python docs/figures/draw.py writes those that are out of step.

The scenes stand in ``scenes.py``; the pipeline is drawn from the stages themselves.
"""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE))

from pipeline_scene import pipeline  # noqa: E402
from scenes import SCENES  # noqa: E402


def pictures() -> dict[Path, str]:
    """Return the text of every picture by its path."""
    texts = {HERE / f"{name}.svg": scene().svg() for name, scene in SCENES.items()}
    return texts | {ROOT / "docs" / "pipeline.svg": pipeline(ROOT).svg()}


def main() -> int:
    """Write the pictures that differ from their files, and name them."""
    for path, text in pictures().items():
        if not path.is_file() or path.read_text() != text:
            path.write_text(text)
            print(path.relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main())
