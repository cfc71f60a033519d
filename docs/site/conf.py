"""How Sphinx builds the site; build.py stages the pages and calls it."""

from __future__ import annotations

import re
import sys
from functools import cache
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes

from strapgen import __version__

sys.path.insert(0, str(Path(__file__).parent))

from signatures import with_plain_defaults

project = "strapgen"
author = "The strapgen authors"
copyright = "The strapgen authors"
release = version = __version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
]
root_doc = "index"
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
nitpicky = True
#: Types that stand in signatures and have no page here.
nitpick_ignore_regex = [("py:.*", r".*")]
# A page whose headings begin at the third level, as the glossary, is well-formed.
suppress_warnings = ["config.cache", "myst.header"]

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "html_image"]
myst_heading_anchors = 6
highlight_language = "text"

# In docstrings a name in single backquotes is a link if it is a public name.
default_role = "autolink"
autosummary_generate = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
toc_object_entries_show_parents = "hide"
add_module_names = False
python_display_short_literal_types = True

pygments_style = "a11y-high-contrast-light"
pygments_dark_style = "github-dark"
html_theme = "furo"
html_title = "strapgen"
html_static_path = ["static"]  # build.py adds what npm brings
html_css_files = ["site.css"]
html_favicon = "static/icon.svg"
html_copy_source = False
html_show_sourcelink = False
# A summary in a search result would be fetched, which browsers refuse on pages from disk.
html_show_search_summary = False
html_theme_options = {
    "light_css_variables": {
        "color-brand-primary": "#0b5c8e",
        "color-brand-content": "#0b5c8e",
        "font-stack": "system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', 'DejaVu Sans', sans-serif",
    },
    "dark_css_variables": {"color-brand-primary": "#6cb8e6", "color-brand-content": "#6cb8e6"},
    "top_of_page_buttons": [],
}
mathjax_path = "mathjax/tex-svg-full.js"
mathjax3_config = {"options": {"enableMenu": False}}
copybutton_exclude = ".linenos, .gp, .go"

_COMMAND = re.compile(r"(?:strapgen|cmake|ctest|make|pip|python3?|apt-get|git|source) ")


def plain_signatures(
    app: Any, what: str, name: str, obj: Any, options: Any, signature: str | None, returned: str | None
) -> tuple[str, str | None] | None:
    """Have the defaults of a signature written as a user would write them."""
    return (with_plain_defaults(signature, obj), returned) if signature else None


def colour_commands(app: Any, document: nodes.document) -> None:
    """Mark literal blocks that begin with a command as those of a shell."""
    for block in document.findall(nodes.literal_block):
        if "language" not in block and _COMMAND.match(block.astext()):
            block["language"] = "bash"


def mark_pictures(app: Any, document: nodes.document) -> None:
    """Give the paragraph of a picture a class of its own: on a telephone it scrolls in it."""
    for image in document.findall(nodes.image):
        if isinstance(image.parent, nodes.paragraph) and len(image.parent) == 1:
            image.parent["classes"].append("scrolls")


@cache
def titles_of_pages(environment: Any) -> dict[str, nodes.bullet_list]:
    """Return what pages contain without their sections, which a navigation of titles leaves out in the end."""
    titles = {page: contents.deepcopy() for page, contents in environment.tocs.items()}
    for contents in titles.values():
        for entry in contents.children:
            pages = list(entry.findall(addnodes.toctree))
            entry[1:] = [nodes.bullet_list("", *pages)] if pages else []
    return titles


def navigate_by_titles(app: Any, page: str, template: str, context: dict[str, Any], document: Any) -> None:
    """Have the navigation of a page made of titles: Sphinx would copy every section of the site for every page."""

    def navigation(**options: Any) -> Any:
        contents = app.env.tocs
        app.env.tocs = titles_of_pages(app.env) if options.get("titles_only") else contents
        try:
            return toctree(**options)
        finally:
            app.env.tocs = contents

    toctree = context["toctree"]
    context["toctree"] = navigation


def setup(app: Any) -> dict[str, bool]:
    """Register what this file adds to Sphinx."""
    app.connect("autodoc-process-signature", plain_signatures)
    app.connect("doctree-read", colour_commands)
    app.connect("doctree-read", mark_pictures)
    app.connect("html-page-context", navigate_by_titles, priority=400)  # before the theme calls it
    return {"parallel_read_safe": True, "parallel_write_safe": True}
