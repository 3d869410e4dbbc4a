"""What comments before code blocks say, where readers see it: the file that a block is, and why a block was not run.

`python -m tools.pages` runs the blocks and describes the comments.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

FILE = re.compile(r"^<!-- file: (?P<name>.+?) -->\n(?P<fence>```+)(?P<language>\w+)\n", re.MULTILINE)
NOT_RUN = re.compile(r"^<!-- not run: (?P<reason>.+?) -->\n", re.MULTILINE)


def marked(text: str) -> str:
    """A page's text with its comments on blocks made visible."""
    text = FILE.sub(r"\g<fence>{code-block} \g<language>\n:caption: \g<name>\n\n", text)
    return NOT_RUN.sub(r"{.antdrive-not-run}\nThe build of this site does not run these lines: \g<reason>.\n\n", text)


def page_read(app: Sphinx, docname: str, source: list[str]) -> None:
    """Mark the blocks of a page."""
    if app.env.doc2path(docname).suffix == ".md":
        source[0] = marked(source[0])


def include_read(app: Sphinx, path: Path, stem: str, source: list[str]) -> None:
    """Mark the blocks of a file that a page includes."""
    if Path(path).suffix == ".md":
        source[0] = marked(source[0])


def setup(app: Sphinx) -> dict[str, Any]:
    """Mark blocks when pages are read."""
    app.connect("source-read", page_read)
    app.connect("include-read", include_read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
