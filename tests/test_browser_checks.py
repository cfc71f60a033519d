"""The checks of pages see every fault that they are for, and nothing on a good page."""

from __future__ import annotations

import pytest
from browser_checks import WIDTHS, faults, looked_at, served

HEAD = "<!doctype html><html lang='en'><head><meta charset='utf-8'><title>t</title><link rel='icon' href='data:,'>"
GOOD = """<body><a href="#end" style="position:absolute;left:-9999px">Skip to the end</a>
<span style="position:absolute;width:1px;height:1px;overflow:hidden;white-space:nowrap">for screen readers</span>
<p>A paragraph that wraps at every width, with <code>code</code> and a box that scrolls.</p>
<pre style="overflow-x:auto">{long}</pre><details><summary>More</summary><pre>{long}</pre></details>
<svg width="200" height="50" viewBox="0 0 200 50"><text x="10" y="30">inside</text></svg>
<script>console.log("no error")</script><p id="end">End.</p>""".replace("{long}", "wide " * 400)
#: What may be wrong with a page, and what the checks say of it at 400 px.
FAULTY = {
    '<p style="width:2000px">wide</p>': "scrolls sideways",
    "<script>throw new Error('lost')</script>": "error: lost",
    "<script>console.error('broken')</script>": "error: broken",
    "<img src='missing.png' alt=''>": "ERR_FILE_NOT_FOUND",
    "<img src='https://example.org/a.png' alt=''>": "asks elsewhere: https://example.org/a.png",
    "<link rel='stylesheet' href='http://127.0.0.2/a.css'>": "asks elsewhere: http://127.0.0.2/a.css",
    "<script>new Worker(URL.createObjectURL(new Blob(["
    "'fetch(\"https://example.org/w\").catch(() => 0)'])))</script>": "asks elsewhere: https://example.org/w",
    '<p id="box" style="overflow:hidden;white-space:nowrap;width:50px">a long text</p>': (
        'text "a long text" is cut off by p#box'
    ),
    '<div style="overflow:hidden;height:20px"><p>first</p><p>second</p></div>': 'text "second" is cut off by div',
    '<p style="position:fixed;left:-30px">to the left</p>': 'text "to the left" is outside of the window',
    '<svg width="200" height="50"><text x="180" y="30">outside</text></svg>': (
        'text "outside" is cut off by svg'
    ),
}


@pytest.mark.long
def test_a_good_page_has_no_fault(browser, tmp_path):
    page = tmp_path / "page.html"
    page.write_text(HEAD + GOOD)
    assert not faults(browser, page)
    with served(tmp_path) as address:
        assert not faults(browser, f"{address}/page.html")


@pytest.mark.long
def test_every_fault_is_seen(browser, tmp_path):
    page = tmp_path / "page.html"
    page.write_text(f"{HEAD}<body>{''.join(FAULTY)}")
    lines = looked_at(browser, page, WIDTHS[0]).faults()
    unseen = [line for line in FAULTY.values() if not any(line in fault for fault in lines)]
    assert not unseen
    assert len(lines) >= len(FAULTY)


@pytest.mark.long
def test_a_fault_of_one_width_alone_is_reported_with_it(browser, tmp_path):
    page = tmp_path / "page.html"
    page.write_text(f"{HEAD}<body style='margin:0'><p style='width:900px'>as wide as a table")
    assert faults(browser, page) == [f"{page} at 400 px: scrolls sideways"]


@pytest.mark.parametrize("missing", ["chromium", "playwright"])
def test_a_missing_tool_is_named(missing, monkeypatch):
    import browser_checks

    monkeypatch.delenv("CHROMIUM", raising=False)
    if missing == "chromium":
        monkeypatch.setattr(browser_checks.shutil, "which", lambda name: None)
    else:
        monkeypatch.setenv("CHROMIUM", "/usr/bin/chromium")
        monkeypatch.setattr(browser_checks, "find_spec", lambda name: None)
    with pytest.raises(pytest.skip.Exception, match=missing), browser_checks.chromium():
        pass
