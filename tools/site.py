"""Check the site that was built: `python -m tools.site docs/_build/html`.

Every link within the site leads to a file and, with an anchor, to a place in it. No page loads anything from elsewhere.
The first page, with all that it loads, is under 1 MB. Films are, too.
"""

from __future__ import annotations

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

MOST = 1_000_000  # [B]
LOADING = {
    ("script", "src"),
    ("img", "src"),
    ("link", "href"),
    ("video", "src"),
    ("video", "poster"),
    ("source", "src"),
    ("iframe", "src"),
}


class Parsed(HTMLParser):
    """What a page names.

    Attributes:
        ids: the places that anchors can lead to
        links: the targets of `a`
        loads: what the browser fetches with the page, each with its tag
    """

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: set[str] = {"", "top"}
        self.links: list[str] = []
        self.loads: list[tuple[str, str]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what an element names."""
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
    """What is wrong with a site, a line each.

    Args:
        site: the folder with `index.html`
    """
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
    return found + ([f"index.html: {size} bytes with all that it loads, more than {MOST}"] if size > MOST else [])


def broken(path: Path, target: str, pages: dict[Path, Parsed]) -> str:
    """Why a link leads nowhere; empty where it leads somewhere or out of the site."""
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
    """What a page weighs with its scripts, styles and pictures; films load when they are played [B]."""
    files = {(path.parent / unquote(urlsplit(one).path)).resolve() for tag, one in page.loads if tag != "video"}
    return path.stat().st_size + sum(file.stat().st_size for file in files if file.is_file())


def main(words: list[str]) -> int:
    """Print what is wrong; 1 if something is."""
    found = problems_of(Path(words[0]).resolve())
    sys.stdout.write(("\n".join(found) or f"{words[0]}: every link and every anchor leads somewhere") + "\n")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
