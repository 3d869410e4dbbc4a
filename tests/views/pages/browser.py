"""Probes of pages in a headless browser."""

import html
import json
import re
import subprocess

import pytest

from tools.site import browser_path

BROWSER = browser_path()
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no chromium on this machine")


def found_by(probe, page, *words):
    """Run a script that writes JSON into an element `#found`, and return the JSON."""
    probed = page.with_name("probed.html")
    probed.write_text(page.read_text().replace("<head>", "<head>" + probe, 1))
    return shown_in(probed, *words)


def shown_in(page, *words):
    """Return the JSON in the element `#found` of a page."""
    common = ("--headless", "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files", "--dump-dom")
    done = subprocess.run(
        [BROWSER, *common, "--window-size=1280,900", *words, page.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    text = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.S)
    assert text is not None, done.stdout[-500:]
    return json.loads(html.unescape(text[1]))


def overflow_on_a_phone(probe, page, *words, wait=0):
    """Return a page's excess width over a phone's screen [px]."""
    found_by(probe, page, *words)
    copy = "document.body.append(f.contentDocument.querySelector('#found').cloneNode(true))"
    phone = page.with_name("phone.html")
    phone.write_text(
        f"<script>onload = () => setTimeout(() => {{ {copy} }}, {wait})</script>"
        "<iframe id=f width=390 height=800 src=probed.html></iframe>"
    )
    return shown_in(phone, *words)["overflow"]
