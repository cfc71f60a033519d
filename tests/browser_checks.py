"""Pages as readers see them: opened in headless Chromium, at the width of a telephone and of a desk.

A page of documentation works where it stands: it loads nothing from elsewhere, raises nothing, fits its window, and
shows all of its text. `looked_at` returns what one window shows, and `faults` names all that is wrong in all windows;
the fixture `browser` of conftest.py is the `Browser` that both take.

Chromium is Debian's, which `CHROMIUM` may replace by another; Playwright drives it and downloads none. Where one of the
two is missing, tests skip and say which.
"""

from __future__ import annotations

import os
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

#: A telephone that is held upright, and a window on a desk, in pixels.
WIDTHS = (400, 1400)
HEIGHT = 900
#: The names under which distributions install Chromium.
PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
#: Everything but the machine itself has no address: what a page asks of others is seen, and does not leave.
OFFLINE = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"
#: Where a page may come from. What begins with data: and blob: is in the page itself.
LOCAL_SCHEMES = ("file", "data", "blob", "about")

#: Texts that the reader cannot see in full, walking from each text outwards to the window. Text may be reached in a box
#: that scrolls; a quarter of a line may stand out above and below, where fonts have room for accents.
CLIPPED = """() => {
  const clipped = new Set();
  const label = (text, where) => `${JSON.stringify(text.trim().slice(0, 40))} ${where}`;
  const isHiddenOnPurpose = element => {
    const style = getComputedStyle(element), box = element.getBoundingClientRect();
    return style.clip !== 'auto' || (style.overflowX !== 'visible' && box.width <= 1)
      || (element.matches('a[href^="#"]') && ['absolute', 'fixed'].includes(style.position));
  };
  const verdict = (node, box) => {
    const rise = box.height / 4 + 1;
    let inViewport = true;
    for (let element = node.parentElement; element; element = element.parentElement) {
      if (isHiddenOnPurpose(element)) return null;
      const root = element === document.documentElement || element === document.body;
      if (root) continue;
      const style = getComputedStyle(element), outer = element.getBoundingClientRect();
      const name = element.tagName.toLowerCase() + (element.id ? '#' + element.id : '');
      if (/hidden|clip/.test(style.overflowX) && (box.right > outer.right + 1 || box.left < outer.left - 1))
        return `is cut off by ${name}`;
      if (/hidden|clip/.test(style.overflowY) && (box.bottom > outer.bottom + rise || box.top < outer.top - rise))
        return `is cut off by ${name}`;
      if (/auto|scroll/.test(style.overflowX)) inViewport = false;
    }
    const width = document.documentElement.clientWidth;
    return inViewport && (box.left < -1 || box.right > width + 1) ? 'is outside of the window' : null;
  };
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    if (!node.data.trim() || !node.parentElement.checkVisibility({visibilityProperty: true})) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const box of range.getClientRects()) {
      const reason = box.width && verdict(node, box);
      if (reason) { clipped.add(label(node.data, reason)); break; }
    }
  }
  return [...clipped];
}"""
#: Waits until the page has been drawn at its new size.
NEXT_FRAME = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
SCROLLS = "() => document.scrollingElement.scrollWidth > document.scrollingElement.clientWidth"


@dataclass(frozen=True)
class View:
    """What one window shows of a page.

    Attributes
    ----------
    errors : tuple of str
        Errors on the console and exceptions, those of workers too.
    foreign_requests : tuple of str
        Addresses other than files, data and 127.0.0.1 of which the page asked something.
    is_scrolled : bool
        Whether the page is wider than its window.
    clipped_texts : tuple of str
        The beginnings of texts that nobody can read to their ends, and by what they are cut off.
    """

    errors: tuple[str, ...]
    foreign_requests: tuple[str, ...]
    is_scrolled: bool
    clipped_texts: tuple[str, ...]

    def faults(self) -> list[str]:
        """Return a line for everything that is wrong."""
        return [
            *(f"error: {error}" for error in self.errors),
            *(f"asks elsewhere: {address}" for address in self.foreign_requests),
            *(["scrolls sideways"] if self.is_scrolled else []),
            *(f"text {text}" for text in self.clipped_texts),
        ]


class Window:
    """A page in one window, and what it has said since it was opened."""

    def __init__(self, page: Page):
        self.page = page
        self._errors: list[str] = []
        self._addresses: list[str] = []
        page.on("console", lambda message: message.type == "error" and self._errors.append(message.text))
        page.on("pageerror", lambda error: self._errors.append(str(error)))
        page.on("request", lambda request: self._addresses.append(request.url))

    def view(self) -> View:
        """Return what the window shows now."""
        return View(
            tuple(self._errors),
            tuple(dict.fromkeys(filter(_is_foreign, self._addresses))),
            self.page.evaluate(SCROLLS),
            tuple(self.page.evaluate(CLIPPED)),
        )


def _is_foreign(address: str) -> bool:
    parts = urlsplit(address)
    return parts.scheme not in LOCAL_SCHEMES and parts.hostname != "127.0.0.1"


@contextmanager
def chromium() -> Iterator[Browser]:
    """Start headless Chromium; skip the test by name where it or Playwright is missing."""
    program = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        pytest.skip("chromium is not on this machine")
    if find_spec("playwright") is None:
        pytest.skip("playwright is not in this environment")
    from playwright.sync_api import sync_playwright

    # Root, as in containers, cannot have Chromium's sandbox; all pages are ours.
    sandbox = ["--no-sandbox"] if os.geteuid() == 0 else []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=[OFFLINE, *sandbox])
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def opened(browser: Browser, address: str | Path, width: int, dark: bool = False) -> Iterator[Window]:
    """Open a file or an address in a window of its own, and wait until it is loaded."""
    if isinstance(address, Path):
        address = address.resolve().as_uri()
    scheme = "dark" if dark else "light"
    context = browser.new_context(viewport={"width": width, "height": HEIGHT}, color_scheme=scheme)
    try:
        window = Window(context.new_page())
        window.page.goto(address, wait_until="load")
        yield window
    finally:
        context.close()


def looked_at(browser: Browser, address: str | Path, width: int, dark: bool = False) -> View:
    """Return what a window of a width in pixels shows of a page, once nothing more is loaded.

    Parameters
    ----------
    browser : Browser
    address : str or Path
        A file, or an address that starts with ``file://`` or ``http://127.0.0.1``.
    width : int
        Width of the window in pixels.
    dark : bool
        Whether the reader prefers dark pages.
    """
    with opened(browser, address, width, dark) as window:
        window.page.wait_for_load_state("networkidle")
        return window.view()


def faults(browser: Browser, address: str | Path, widths: tuple[int, ...] = WIDTHS) -> list[str]:
    """Return a line for everything that is wrong with a page in a window of any width; none for a good page.

    The page is loaded once, at the first width; then its window is drawn wider or narrower.
    """
    lines = []
    with opened(browser, address, widths[0]) as window:
        window.page.wait_for_load_state("networkidle")
        for width in widths:
            window.page.set_viewport_size({"width": width, "height": HEIGHT})
            window.page.evaluate(NEXT_FRAME)
            lines += [f"{address} at {width} px: {fault}" for fault in window.view().faults()]
    return lines


class _Handler(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: object) -> None:
        """Say nothing of requests."""


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """Serve a folder as any static file server does, and yield its address, without a slash at the end."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Handler, directory=str(folder)))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
