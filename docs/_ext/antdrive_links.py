"""Markdown pages as the site reads them: links to files outside docs/ stay in the site, comments on blocks are visible."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DRIVES = "_drives"  # where pages of drives are in the site
#: Pictures of drives that have a page in the site.
SHOWN = [name for name, one in json.loads((ROOT / "docs/pictures/drives.json").read_text()).items() if "page" in one]
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
    """A page's text with links to files outside docs/ and to classes leading to the site's pages, and visible comments on blocks.

    Pictures of drives lead to the drives' own pages.

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

    def described(match: re.Match[str]) -> str:
        page = f"{match[2]}/{match[1]}.rst"
        return f"[`{match[1]}`]({page})" if (docs / page).exists() else match[0]

    def opens(match: re.Match[str]) -> str:
        name = match[3] if match[3] in SHOWN else "drive"
        about = f":alt: {match[1]}\n:class: {match[4] or 'antdrive-drive'}\n:target: {pages}/{name}.html"
        return f"```{{image}} {match[2]}\n{about}\n```"

    pages = f"{os.path.relpath(ROOT / 'docs', docs)}/{DRIVES}"
    picture = rf"^!\[(.+?)\]\((\S*pictures/({'|'.join((*SHOWN, 'hero', 'view'))})\.webp)\)(?:{{\.(\S+)}})?$"
    text = re.sub(picture, opens, text, flags=re.MULTILINE)
    text = re.sub(r"\[([^][]+)\]\(\S*pictures/drive\.html\)", rf'<a href="{pages}/drive.html">\1</a>', text)
    text = re.sub(r"\]\(([^)#\s:]+)(#[^)\s]*)?\)", link, text)
    text = re.sub(r"\[`(\w+)`\]\(([^)#\s:]*reference/api/[\w-]+)\.md\)", described, text)
    text = re.sub(
        r"^<!-- file: (.+?) -->\n(```+)(\w+)\n", r"\2{code-block} \3\n:caption: \1\n\n", text, flags=re.MULTILINE
    )
    said = r"{.antdrive-not-run}\nThe build of this site does not run these lines: \1.\n\n"
    return re.sub(r"^<!-- not run: (.+?) -->\n", said, text, flags=re.MULTILINE)
