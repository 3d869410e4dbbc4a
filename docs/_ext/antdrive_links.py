"""Markdown pages as the site reads them: links to files outside docs/ stay in the site, comments on blocks are visible."""

from __future__ import annotations

import os
import re
from pathlib import Path

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


def adapted(text: str, here: Path, docs: Path) -> str:
    """A page's text with links to files outside docs/ made links within the site, and with its comments on blocks visible.

    Args:
        text: the page, in Markdown
        here: the file that the text is from
        docs: the folder that the page is in, to which its new links are relative
    """

    def link(match: re.Match[str]) -> str:
        target = Path(os.path.normpath(here.parent / match[1]))
        if not target.exists():
            return match[0]
        page = PAGES.get(os.path.relpath(target, ROOT))
        target = ROOT / "docs" / f"{page}.md" if page else target / "README.md" if target.is_dir() else target
        return f"]({os.path.relpath(target, docs)}{match[2] or ''})"

    text = re.sub(r"\]\(([^)#\s:]+)(#[^)\s]*)?\)", link, text)
    text = re.sub(
        r"^<!-- file: (.+?) -->\n(```+)(\w+)\n", r"\2{code-block} \3\n:caption: \1\n\n", text, flags=re.MULTILINE
    )
    said = r"{.antdrive-not-run}\nThe build of this site does not run these lines: \1.\n\n"
    return re.sub(r"^<!-- not run: (.+?) -->\n", said, text, flags=re.MULTILINE)
