"""Links of Markdown pages to files of the repository that are outside docs/.

Where a repository is shown on the web, such a link shows the file. Here it leads to the page that includes the file, or
else to a copy of it.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[2]
#: Files of the repository that a page includes.
PAGES = {
    "README.md": "index",
    "CONTRIBUTING.md": "explanation/contributing",
    "CHANGELOG.md": "reference/changelog",
    "examples/bridges/README.md": "how-to/bridges-example",
    "examples/campaigns/README.md": "how-to/campaign-files",
    "examples/plugin_planner/README.md": "how-to/ship-a-planner",
    "examples/regression_suite/README.md": "how-to/regression-example",
}
LINK = re.compile(r"(\]\()([^)#\s:]+)(#[^)\s]*)?(\))")


def adapt(text: str, here: Path, docs: Path) -> str:
    """A page's text with its links to files outside `docs` made links within the site.

    Args:
        text: the page, in Markdown
        here: the file that the text is from
        docs: the folder that the page is in, to which its new links are relative
    """

    def changed(match: re.Match[str]) -> str:
        target = Path(os.path.normpath(here.parent / match[2]))
        anchor = match[3] or ""
        if not target.exists():
            return match[0]
        inside = target.relative_to(ROOT).as_posix()
        if inside in PAGES:
            return f"{match[1]}{os.path.relpath(ROOT / 'docs' / PAGES[inside], docs)}.md{anchor}{match[4]}"
        if target.is_dir():
            target = target / "README.md"
        return f"{match[1]}{os.path.relpath(target, docs)}{anchor}{match[4]}"

    return LINK.sub(changed, text)


def page_read(app: Sphinx, docname: str, source: list[str]) -> None:
    """Adapt a page."""
    path = Path(app.env.doc2path(docname))
    if path.suffix == ".md":
        source[0] = adapt(source[0], path, path.parent)


def include_read(app: Sphinx, path: Path, stem: str, source: list[str]) -> None:
    """Adapt a file that a page includes. MyST gives only the last part of the page's name."""
    file = (Path(app.srcdir) / path).resolve()
    if file.suffix == ".md":
        source[0] = adapt(source[0], file, Path(app.env.doc2path(app.env.docname)).parent)


def setup(app: Sphinx) -> dict[str, Any]:
    """Adapt pages when they are read."""
    app.connect("source-read", page_read)
    app.connect("include-read", include_read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
