"""Builds the site: stages the pages, runs Sphinx on them, then adds what the page that runs strapgen needs.

    python docs/site/build.py [FOLDER]

The site is in FOLDER/html; FOLDER is docs/_build unless another one is named. What registries bring stays in
docs/_build/vendor and docs/_build/downloads for the next build. Where the registries cannot be reached, the site has
all pages but for the program in the page that runs strapgen.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILD = ROOT / "docs" / "_build"
sys.path[:0] = [str(HERE), str(HERE / "try")]

import mathjax  # noqa: E402
import reference_commands  # noqa: E402
import reference_python  # noqa: E402
import vendor  # noqa: E402
from repository_pages import COPIED, file_page, folder_page, tracked  # noqa: E402
from site_navigation import GENERATED, MAP, SECTIONS, site_file  # noqa: E402
from staging import IMAGES, Stage, home, landing, rewritten, with_program  # noqa: E402

#: The page that runs strapgen in the browser, and its part of the page that is not Markdown.
PROGRAM_PAGE = "docs/try.md"
PROGRAM = HERE / "try" / "page.html"
LEFT_OUT = "<p>This copy of the site was built without a network: strapgen does not run in it.</p>\n"


class Site:
    """The pages of the site and the files of the repository to which they link.

    Parameters
    ----------
    stage : Stage
        Where the pages are written.
    runs : bool, optional
        Whether strapgen runs on its page.
    """

    def __init__(self, stage: Stage, runs: bool = True) -> None:
        self.stage, self.runs = stage, runs
        self.files = tracked(ROOT)
        self.folders = {
            "/".join(name.split("/")[:n]) for name in self.files for n in range(1, name.count("/") + 1)
        }
        self.landings = {section.landing: section for section in SECTIONS}
        self.in_navigation = {"README.md", *self.landings, *(page for s in SECTIONS for page in s.pages)}
        self.waiting: list[str] = []
        self.reached: set[str] = set()

    def write_pages(self) -> None:
        """Write the pages of the navigation, and then every file and folder that a page links to."""
        pages = {page for page in self.in_navigation if page not in GENERATED}
        pages |= {name for name in self.files if self._is_page(name)}
        for page in sorted(pages):
            self.target(page, page)
        while self.waiting:
            self._write(self.waiting.pop())

    def target(self, path: str, page: str) -> str:
        """Return where a link to a file or a folder of the repository leads on the site.

        Parameters
        ----------
        path : str
            Path in the repository.
        page : str
            Path of the page that has the link.
        """
        path = path.rstrip("/")
        if path in GENERATED:
            return f"/{site_file(path)}"
        if path not in self.files and path not in self.folders and path not in self.landings:
            return ""
        if path not in self.reached:
            self.reached.add(path)
            self.waiting.append(path)
        if path.endswith(IMAGES):
            return f"/{_image(path)}"
        if self._is_copy(path):
            return f"/{_copy(path)}"
        return f"/{site_file(path)}"

    def _write(self, path: str) -> None:
        if path.endswith(IMAGES):
            self.stage.write(_image(path), (ROOT / path).read_bytes())
        elif self._is_copy(path):
            self.stage.write(_copy(path), (ROOT / path).read_bytes())
        else:
            self.stage.write(site_file(path), self._text(path))

    def _text(self, path: str) -> str:
        """Return the page that stands for a file or a folder."""
        if path in self.folders:
            text = folder_page(path, self.files, path not in self.in_navigation)
            return rewritten(text, f"{path}/", self.target)
        text = (ROOT / path).read_text() if path in self.files else ""
        if path not in self.landings and not path.endswith(".md"):
            return file_page(path, text)
        if path == "README.md":
            text = home(text)
        if path == PROGRAM_PAGE:
            program = PROGRAM.read_text() if self.runs else LEFT_OUT
            return with_program(rewritten(text, path, self.target), program)
        if path in self.landings:
            text = landing(ROOT, self.landings[path], text)
        return ("" if path in self.in_navigation else "---\norphan: true\n---\n") + rewritten(
            text, path, self.target
        )

    def _is_page(self, path: str) -> bool:
        return path.startswith("docs/") and path.endswith(".md") and not path.startswith("docs/site/")

    def _is_copy(self, path: str) -> bool:
        """Tell whether a file is handed out as it is, because there are many like it."""
        return path in self.files and path.split("/")[0] in COPIED and not path.endswith(".md")


def _image(path: str) -> str:
    return path.removeprefix("docs/") if path.startswith("docs/") else f"repository/{path}"


def _copy(path: str) -> str:
    return f"repository/{path}.txt"


def stage_pages(folder: Path, runs: bool = True) -> None:
    """Write what Sphinx reads: the pages, the references and the files to which they link.

    Parameters
    ----------
    folder : Path
        Folder for the pages.
    runs : bool, optional
        Whether strapgen runs on its page.
    """
    stage = Stage(folder)
    Site(stage, runs).write_pages()
    reference = next(section for section in SECTIONS if section.title == "Reference")
    site = Site(stage)
    stage.write(
        "reference/index.md", rewritten(landing(ROOT, reference, MAP), reference.landing, site.target)
    )
    for name, text in reference_commands.pages().items():
        stage.write(f"reference/commands/{name}.md", text)
    for name, text in reference_python.pages().items():
        stage.write(f"reference/python/{name}.rst", text)
    stage.drop_others()


def main(arguments: list[str]) -> int:
    """Build the site and return the exit status: that of the first step that fails.

    Parameters
    ----------
    arguments : list of str
        The folder for the site, or nothing.
    """
    if len(arguments) > 1:
        return _refuse(f"docs: one folder is allowed, not {len(arguments)}: {' '.join(arguments)}")
    out = Path(arguments[0]).resolve() if arguments else BUILD
    try:
        mathjax.vendor(BUILD / "vendor" / "mathjax")
    except RuntimeError as error:
        return _refuse(f"docs: {error}")
    runs = _brought(BUILD / "downloads")
    stage_pages(out / "source", runs)
    options = ["-c", str(HERE), "-d", str(out / "doctrees"), "-W", "--keep-going", "-q", "-j", "auto"]
    options += ["-D", f"html_static_path=static,{BUILD / 'vendor'}"]
    command = [sys.executable, "-m", "sphinx", "-b", "html", *options, str(out / "source"), str(out / "html")]
    status = subprocess.run(command).returncode
    if runs and not status:
        vendor.write(out / "html" / "try", BUILD / "downloads")
    return status


def _brought(folder: Path) -> bool:
    """Bring what the page that runs strapgen needs; say in one line that it is left out where that fails."""
    try:
        vendor.bring(folder)
    except RuntimeError as error:
        print(f"docs: strapgen does not run on its page, which is left out: {error}", file=sys.stderr)
        return False
    return True


def _refuse(line: str) -> int:
    print(line, file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
