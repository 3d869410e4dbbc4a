"""Look at the site that was built in a browser: `python -m tools.browser docs/_build/html`.

Every page is opened from the disk, light at the width of a desktop and dark at the width of a phone. Counted is what is
wrong with it:

- errors on its console, and exceptions
- pictures that do not load
- films that do not load, or do not go on when they are played
- text that differs too little from what lies behind it
- a page that is wider than its window
- a first page that loads more than 1 MB

The search is asked for some words, and must find pages. `--shots FOLDER` keeps a picture of each page, light and dark,
wide and narrow. Needs `pip install playwright` and a Chromium: the one on the path, or `playwright install chromium`.
"""

from __future__ import annotations

import argparse
import dataclasses
import shutil
import sys
from pathlib import Path
from typing import Any

WIDE, NARROW, HIGH = 1280, 390, 900  # [px]
MOST = 1_000_000  # what the first page may load [B]
CONTRAST = 3.0  # the least between a text and what lies behind it; WCAG asks 4.5 of small text, 3 of large
ASKED = {"pure pursuit": "following", "certificate": "certificate", "limiter": "why-slow"}  # and where it is explained
BROWSERS = ("chromium", "chromium-browser", "google-chrome")

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
      if (style.backgroundImage !== "none") return null;
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


@dataclasses.dataclass(frozen=True)
class View:
    """How a page is looked at.

    Attributes:
        theme: `light` or `dark`
        width: of the window [px]
    """

    theme: str
    width: int

    def __str__(self) -> str:
        return f"{self.theme}-{self.width}"


CHECKED = (View("light", WIDE), View("dark", NARROW))
KEPT = tuple(View(theme, width) for theme in ("light", "dark") for width in (WIDE, NARROW))


class Looking:
    """A browser with a window for each view.

    Args:
        browser: playwright's
        site: the folder with `index.html`
        shots: where pictures of pages go; None: nowhere
    """

    def __init__(self, browser: Any, site: Path, shots: Path | None) -> None:
        self.site, self.shots = site, shots
        self.faults: list[str] = []
        self.loaded: list[str] = []
        views = KEPT if shots else CHECKED
        self.windows = {view: self._window(browser, view) for view in views}

    def _window(self, browser: Any, view: View) -> Any:
        size = {"width": view.width, "height": HIGH}
        window = browser.new_context(viewport=size, color_scheme=view.theme).new_page()
        window.on(
            "console", lambda said: said.type in ("error", "warning") and self.faults.append(f"console: {said.text}")
        )
        window.on("pageerror", lambda error: self.faults.append(f"exception: {error}"))
        window.on("requestfailed", lambda asked: self._failed(asked))
        window.on("request", lambda asked: self.loaded.append(asked.url))
        return window

    def _failed(self, asked: Any) -> None:
        if asked.failure != "net::ERR_ABORTED":  # a film that is not loaded to its end
            self.faults.append(f"{asked.url}: {asked.failure}")

    def page(self, path: Path) -> list[str]:
        """What is wrong with a page, a line each."""
        found: dict[str, str] = {}
        for view, window in self.windows.items():
            self.faults.clear()
            self.loaded.clear()
            window.goto(path.as_uri(), wait_until="load")
            wrong = window.evaluate(PROBE)
            window.wait_for_timeout(20)
            for fault in [*self.faults, *wrong, *self._too_heavy(path, view)]:
                found.setdefault(fault, str(view))
            if self.shots:
                name = path.relative_to(self.site).with_suffix("").as_posix().replace("/", "-")
                window.screenshot(path=str(self.shots / f"{name}-{view}.png"), full_page=True)
        return [f"{path.relative_to(self.site)}: {view}: {fault}" for fault, view in found.items()]

    def _too_heavy(self, path: Path, view: View) -> list[str]:
        """Whether the first page loads too much."""
        if path != self.site / "index.html":
            return []
        files = {Path(url.partition("?")[0].partition("#")[0].removeprefix("file://")) for url in self.loaded}
        size = sum(file.stat().st_size for file in files if file.is_file())
        return [f"loads {size} bytes, more than {MOST}"] if size > MOST else []

    def search(self, wait: float = 10_000) -> list[str]:
        """What the search does not find.

        Args:
            wait: for so long [ms]
        """
        window, found = next(iter(self.windows.values())), []
        for words, page in ASKED.items():
            window.goto(f"{(self.site / 'search.html').as_uri()}?q={words.replace(' ', '+')}")
            try:
                window.wait_for_function(
                    "page => [...document.querySelectorAll('#search-results a')].some(a => a.href.includes(page))",
                    arg=page,
                    timeout=wait,
                )
            except Exception as error:
                found.append(f"search.html: {words!r} does not find {page}: {type(error).__name__}")
        return found


def opened(playwright: Any) -> Any:
    """A browser: the Chromium on the path, or playwright's own."""
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    return playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])


def look(site: Path, pages: list[Path], shots: Path | None) -> list[str]:
    """What is wrong with pages of a site, a line each.

    Args:
        site: the folder with `index.html`
        pages: the pages to open
        shots: where pictures of them go; None: nowhere
    """
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = opened(playwright)
        looking = Looking(browser, site, shots)
        found = looking.search()
        for page in pages:
            found += looking.page(page)
        browser.close()
    return found


def main(words: list[str]) -> int:
    """Print what is wrong; 1 if something is, 2 without a browser."""
    asked = argparse.ArgumentParser(prog="python -m tools.browser", description="Look at the built site in a browser.")
    asked.add_argument("site", type=Path, help="the folder with index.html")
    asked.add_argument("pages", nargs="*", help="pages, relative to it; all of them by default")
    asked.add_argument("--shots", type=Path, help="folder for pictures of the pages")
    given = asked.parse_args(words)
    site = given.site.resolve()
    every = [path for path in sorted(site.rglob("*.html")) if "_static" not in path.parts]
    pages = [site / name for name in given.pages] or every
    missing = [str(page) for page in pages if not page.exists()] or ([] if pages else [f"{site}/index.html"])
    if missing:
        sys.stderr.write(f"{missing[0]}: there is no such page; `make docs` builds the site\n")
        return 2
    if given.shots:
        given.shots.mkdir(parents=True, exist_ok=True)
    try:
        found = look(site, pages, given.shots)
    except ImportError:
        sys.stderr.write("playwright is missing: pip install playwright\n")
        return 2
    sys.stdout.write("\n".join([*found, f"{len(pages)} pages looked at, {len(found)} faults"]) + "\n")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
