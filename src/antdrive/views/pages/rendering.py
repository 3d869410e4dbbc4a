"""The templates of pages and of their Markdown."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from types import MappingProxyType
from typing import Any

from antdrive.base.atomic import written_whole

#: Parts of a page or of its Markdown that not every one has.
NO_PARTS: Mapping[str, Any] = MappingProxyType(
    {
        **dict.fromkeys(("notes", "success", "pairs", "charts", "planners", "styles", "runs", "column_notes"), ()),
        **dict.fromkeys(("tables", "failures", "detailed"), ()),
        **dict.fromkeys(("allowances", "summary"), None),
        **dict.fromkeys(("failed", "undetailed", "uncounted"), 0),
    }
)


def write_text(out: Path, text: str) -> list[Path]:
    """Write a file whole or not at all."""
    with written_whole(out) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return [out]


def rendered(template: str, **content: Any) -> str:
    """Fill a template: `page.html.j2` or `page.md.j2`."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).with_name("templates")),
        undefined=jinja2.StrictUndefined,
        autoescape=jinja2.select_autoescape(["html.j2"]),
    )
    environment.filters |= {"md": markdown_text, "fence": fence_for}
    return environment.get_template(template).render(**{**NO_PARTS, **content}, version=metadata.version("antdrive"))


def markdown_text(value: object) -> str:
    """Escape a text for Markdown, its tables and HTML blocks."""
    return re.sub(r"[&<>|`*_~\[\]\\@#]", lambda found: f"&#{ord(found[0])};", str(value))


def fence_for(code: str) -> str:
    """Return a code fence longer than any run of backticks in the code."""
    return "`" * max(3, 1 + max(map(len, re.findall("`+", code)), default=0))
