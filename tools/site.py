"""Check the built site: `python -m tools.site docs/_build/html`.

Internal links and anchors must resolve. Pages load no external resources. The first page loads less than 3 MB, including its
hero film. Films are under 1 MB. Searches find their pages, if playwright and Chromium are there; else a line says that none was
tried.

`--browser` opens every page from the disk in Chromium, light at desktop width and dark at phone width. It reports console
errors, exceptions, images and films that do not load or play, low contrast, and pages wider than the window. `--shots FOLDER`
saves screenshots of each page, light and dark, wide and narrow. This needs `pip install playwright` and Chromium: the one on
the path, or `playwright install chromium`.
"""

from __future__ import annotations

import argparse
import itertools
import shutil
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

MOST, FIRST = 1_000_000, 3_000_000  # [B]
LOADING = {
    *(("script", "src"), ("img", "src"), ("link", "href"), ("video", "src"), ("video", "poster")),
    *(("source", "src"), ("iframe", "src")),
}
WIDE, NARROW, HIGH = 1280, 390, 900  # [px]
CONTRAST = 3.0  # least contrast of text and background; WCAG requires 4.5 for small and 3 for large text
#: Searches, each with the page of the first result.
ASKED = {
    "replan": "how-to/",
    "certificate": "explanation/certificate",
    "footprint": "reference/robots",
    "custom planner": "tutorials/your-own-planner",
    "docker": "how-to/install",
    "campaign": "how-to/campaigns",
    "pure pursuit": "explanation/following",
    "lidar": "explanation/unknown-worlds-sensing",
}
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
#: Flags of Chromium with which the processor draws the whole page, whatever graphics card there is.
SOFTWARE = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
CHECKED = (("light", WIDE), ("dark", NARROW))
KEPT = tuple(itertools.product(("light", "dark"), (WIDE, NARROW)))

#: What is wrong with a page, found by itself.
PROBE = """async () => {
  const wrong = [], at = (e) => `${e.tagName.toLowerCase()} "${(e.textContent || e.src || "").trim().slice(0, 40)}"`;
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  for (const image of document.images) {
    image.loading = "eager";
    try { await image.decode(); } catch { wrong.push(`${image.getAttribute("src")}: does not load`); }
  }
  for (const film of document.querySelectorAll("video")) {
    const name = film.getAttribute("src");
    film.muted = true;
    try { await film.play(); } catch (error) { wrong.push(`${name}: does not play: ${error.message}`); continue; }
    const runs = () => film.readyState >= 3 && film.currentTime > 0.1;
    for (let k = 0; k < 200 && !runs(); k++) await wait(50);
    if (!runs()) wrong.push(`${name}: stands still at ${film.currentTime} s`);
    film.pause();
  }
  const wide = document.documentElement.scrollWidth;
  if (wide > innerWidth) wrong.push(`is ${wide} px wide in a window of ${innerWidth} px`);
  const canvas = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
  const rgba = (text) => {
    canvas.clearRect(0, 0, 1, 1); canvas.fillStyle = text; canvas.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = canvas.getImageData(0, 0, 1, 1).data; return [r, g, b, a / 255];
  };
  const over = (top, low) => [0, 1, 2].map((k) => top[k] * top[3] + low[k] * (1 - top[3]));
  const light = (colour) => {
    const [r, g, b] = colour.map((c) => (c /= 255) <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const behind = (element) => {
    const layers = [];
    for (let e = element; e; e = e.parentElement) {
      const style = getComputedStyle(e);
      if (style.backgroundImage.includes("url(")) return null;
      const colour = rgba(style.backgroundColor);
      if (colour[3] > 0) layers.push(colour);
      if (colour[3] === 1) break;
    }
    const dark = document.documentElement.dataset.theme === "dark";
    return layers.reverse().reduce((low, top) => over(top, low), dark ? [0, 0, 0] : [255, 255, 255]);
  };
  const shown = { opacityProperty: true, visibilityProperty: true };
  const apart = "script, style, noscript, .visually-hidden, .skip-link, dialog, video";
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), seen = new Set();
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const e = node.parentElement;
    if (!node.textContent.trim() || seen.has(e) || !e.checkVisibility(shown)) continue;
    const box = e.getBoundingClientRect();
    if (box.width < 2 || box.height < 2 || e.closest(apart)) continue;
    seen.add(e);
    const low = behind(e);
    if (!low) continue;
    const a = light(over(rgba(getComputedStyle(e).color), low)), b = light(low);
    const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (contrast < CONTRAST) wrong.push(`contrast ${contrast.toFixed(1)}: ${at(e)}`);
  }
  return wrong;
}""".replace("CONTRAST", str(CONTRAST))


class Parsed(HTMLParser):
    """Parser of a page's anchors, links and loaded resources."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: set[str] = {"", "top"}
        self.links: list[str] = []
        self.loads: list[tuple[str, str]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Record an element's anchor, link or resource."""
        for key, value in attrs:
            if value is None:
                continue
            if key == "id" or (tag == "a" and key == "name"):
                self.ids.add(value)
            elif tag == "a" and key == "href":
                self.links.append(value)
            elif (tag, key) in LOADING and not (tag == "link" and value.endswith(".html")):
                self.loads.append((tag, value))


def problems_of(site: Path) -> list[str]:
    """Return the problems of a site's files, one line each."""
    pages = {
        path: Parsed(path.read_text(encoding="utf-8"))
        for path in sorted(site.rglob("*.html"))
        if "_static" not in path.parts
    }
    if site / "index.html" not in pages:
        return [f"{site}: has no index.html"]
    found = []
    for path, page in pages.items():
        where = path.relative_to(site)
        for target in dict.fromkeys([*page.links, *(one for _, one in page.loads)]):
            wrong = broken(path, target, pages)
            found += [f"{where}: {target}: {wrong}"] if wrong else []
        found += [
            f"{where}: loads {one} from elsewhere" for _, one in page.loads if urlsplit(one).scheme in ("http", "https")
        ]
    found += [
        f"{path.relative_to(site)}: more than {MOST} bytes"
        for path in site.rglob("*.mp4")
        if path.stat().st_size > MOST
    ]
    size = weight(site / "index.html", pages[site / "index.html"])
    return found + ([f"index.html: {size} bytes with all that it loads, more than {FIRST}"] if size > FIRST else [])


def broken(path: Path, target: str, pages: dict[Path, Parsed]) -> str:
    """Return why a link is broken; empty for valid and external links."""
    parts = urlsplit(target)
    if parts.scheme or parts.netloc:
        return ""
    file = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    if file.is_dir():
        file = file / "index.html"
    if not file.exists():
        return "there is no such file"
    if file in pages and unquote(parts.fragment) not in pages[file].ids:
        return "there is no such place in it"
    return ""


def weight(path: Path, page: Parsed) -> int:
    """Return the size of a page with scripts, styles and images; films load when played [B]."""
    files = {(path.parent / unquote(urlsplit(one).path)).resolve() for tag, one in page.loads if tag != "video"}
    return path.stat().st_size + sum(file.stat().st_size for file in files if file.is_file())


class Looking:
    """Playwright browser with one window per view; screenshots go to `shots`."""

    def __init__(self, browser: Any, site: Path, shots: Path | None) -> None:
        self.site, self.shots = site, shots
        self.faults: list[str] = []
        views = KEPT if shots else CHECKED
        self.windows = {f"{theme}-{width}": self._window(browser, theme, width) for theme, width in views}

    def _window(self, browser: Any, theme: str, width: int) -> Any:
        window = browser.new_context(viewport={"width": width, "height": HIGH}, color_scheme=theme).new_page()
        window.on("console", self._said)
        window.on("pageerror", lambda error: self._note(f"exception: {error}"))
        aborted = "net::ERR_ABORTED"  # a film that is not loaded to its end
        window.on("requestfailed", lambda it: it.failure == aborted or self._note(f"{it.url}: {it.failure}"))
        return window

    def _said(self, message: Any) -> None:
        # Chromium itself says it where it draws without a GPU.
        if message.type in ("error", "warning") and "GPU stall due to ReadPixels" not in message.text:
            self._note(f"console: {message.text}")

    def _note(self, fault: str) -> None:
        self.faults.append(fault)

    def page(self, path: Path) -> list[str]:
        """Return the problems of a page, one line each."""
        found: dict[str, str] = {}
        for view, window in self.windows.items():
            self.faults.clear()
            window.goto(path.as_uri(), wait_until="load")
            wrong = window.evaluate(PROBE)
            window.wait_for_timeout(20)
            for fault in [*self.faults, *wrong]:
                found.setdefault(fault, view)
            if self.shots:
                name = path.relative_to(self.site).with_suffix("").as_posix().replace("/", "-")
                window.screenshot(path=str(self.shots / f"{name}-{view}.png"), full_page=True)
        return [f"{path.relative_to(self.site)}: {view}: {fault}" for fault, view in found.items()]

    def search(self, wait: float = 10_000) -> list[str]:
        """Return searches without the expected result within a time limit [ms]."""
        window, found = next(iter(self.windows.values())), []
        links = "page => document.querySelector('#search-results a')?.href.includes(page)"
        for words, page in ASKED.items():
            window.goto(f"{(self.site / 'search.html').as_uri()}?q={words.replace(' ', '+')}")
            try:
                window.wait_for_function(links, arg=page, timeout=wait)
            except Exception as error:
                first = window.evaluate("document.querySelector('#search-results a')?.href")
                found.append(f"search.html: {words!r} finds {first} before {page}: {type(error).__name__}")
        return found


def missing_browser() -> str:
    """Return what is missing to open pages, and how to get it; empty if nothing is."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        return "playwright is missing: pip install playwright"
    with sync_playwright() as playwright:
        found = browser_path() is not None or Path(playwright.chromium.executable_path).exists()
    return "" if found else "chromium is missing: playwright install chromium, or apt-get install chromium"


def browser_path() -> str | None:
    """Return the Chromium on the path; None if there is none."""
    return next(filter(None, map(shutil.which, BROWSERS)), None)


def opened(playwright: Any, *flags: str) -> Any:
    """Launch the Chromium on the path, or playwright's own."""
    return playwright.chromium.launch(executable_path=browser_path(), args=["--no-sandbox", *flags])


def look(site: Path, shots: Path | None, pages: bool = True) -> list[str]:
    """Return a site's problems in a browser, those of the search alone or of all pages, too, one line each."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = opened(playwright)
        looking = Looking(browser, site, shots)
        found = looking.search()
        for page in sorted(site.rglob("*.html")) if pages else ():
            found += looking.page(page) if "_static" not in page.parts else []
        browser.close()
    return found


def main(words: list[str]) -> int:
    """Print problems. Return 1 if there are any, 2 without a browser."""
    asked = argparse.ArgumentParser(prog="python -m tools.site", description="Check the built site.")
    asked.add_argument("site", type=Path, help="folder with index.html")
    asked.add_argument("--browser", action="store_true", help="also open every page in Chromium")
    asked.add_argument("--shots", type=Path, help="folder for screenshots; implies --browser")
    given = asked.parse_args(words)
    site = given.site.resolve()
    found = problems_of(site)
    if given.shots:
        given.shots.mkdir(parents=True, exist_ok=True)
    asked_for = given.browser or given.shots is not None
    missing = missing_browser()
    if missing:
        sys.stderr.write(f"{missing}\n" if asked_for else f"The site's search was not tried: {missing}\n")
        if asked_for:
            return 2
    else:
        found += look(site, given.shots, pages=asked_for)
    sys.stdout.write(("\n".join(found) or f"{given.site}: no problems") + "\n")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
