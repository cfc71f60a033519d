"""The version is written once; what is read elsewhere follows it."""

import re
from pathlib import Path

from strapgen.ir.version import VERSION

ROOT = Path(__file__).parents[2]


def test_the_citation_is_of_this_version():
    text = (ROOT / "CITATION.cff").read_text()
    assert re.findall(r"^version: (\S+)$", text, flags=re.MULTILINE) == [VERSION]


def test_the_changelog_has_a_section_on_this_version():
    text = (ROOT / "CHANGELOG.md").read_text()
    assert VERSION in re.findall(r"^## (\S+)", text, flags=re.MULTILINE)
