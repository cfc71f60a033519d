"""Gives the package links to the repository that it is built from.

`STRAPGEN_REPOSITORY` is that repository's address, as the release workflow sets it. The README's links then lead to its
files at the tag of this version; without it they stay as they are, and the package states no address.
"""

import os
import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

#: The target of a link or an image of Markdown that is a path.
_PATH = re.compile(r"(?<=\]\()(?!\w+:|#)([^()\s#]+)(#[^()\s]*)?(?=\))")


def with_addresses(text: str, root: Path, repository: str, version: str) -> str:
    """Return Markdown whose paths below a folder are addresses in a repository."""

    def address(found: re.Match[str]) -> str:
        path, place = found[1], found[2] or ""
        is_image = path.endswith((".svg", ".png"))
        view = "raw" if is_image else "tree" if (root / path).is_dir() else "blob"
        return f"{repository}/{view}/v{version}/{path}{place}"

    return _PATH.sub(address, text)


class Links(MetadataHookInterface):
    """The fields readme and urls."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set the fields."""
        root = Path(self.root)
        text = (root / "README.md").read_text(encoding="utf-8")
        repository = os.environ.get("STRAPGEN_REPOSITORY", "").rstrip("/")
        if repository:
            text = with_addresses(text, root, repository, metadata["version"])
            metadata["urls"] = {
                "Source": repository,
                "Documentation": f"{repository}/blob/v{metadata['version']}/docs/README.md",
                "Changelog": f"{repository}/blob/v{metadata['version']}/CHANGELOG.md",
                "Issues": f"{repository}/issues",
            }
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
