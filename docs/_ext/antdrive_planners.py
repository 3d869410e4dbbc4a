"""The pages on planners: options and known weaknesses from docstrings, and pictures drawn by the lines beside them.

`.. planner:: ants` writes a table of a planner's options with their defaults and meanings, and what its docstring says
of its weaknesses. `.. drawn:: TEXT` runs its content, which leaves a matplotlib figure in `figure`, and shows that
figure, described by TEXT, above the lines that made it.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import io
import os
import re
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar

from antdrive_docstrings import described, weaknesses_of
from antdrive_sources import note_sources
from antdrive_tables import parsed, table, told
from docutils import nodes
from docutils.parsers.rst import Directive, directives
from sphinx.application import Sphinx

PICTURES = "_build/drawn"  # within the folder of the pages
DPI = 100
PAGE = re.compile(r"`?docs/([\w/.-]+)\.md`?")


def options_of(planner: Any) -> Iterator[tuple[str, str, str]]:
    """Name, value and meaning of each option of a planner.

    Raises:
        KeyError: an option is not described.
    """
    from antdrive.sim.log.record import settings_of

    meanings = described(type(planner))
    for name, value in settings_of(planner).items():
        yield f"``{name}``", f"``{value}``", told(meanings[name])


class Options(Directive):
    """`.. planner:: NAME ...`: the options of planners that share a class, and the weaknesses that it knows."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        """A table for the first planner, what the others change, and the weaknesses."""
        from antdrive.planners import PLANNERS

        env = self.state.document.settings.env
        first, *others = (PLANNERS[name] for name in self.arguments[0].split())
        kind = type(first)
        note_sources(env)  # options stand in the classes above it, too
        lines = []
        for weakness in weaknesses_of(kind):
            lines += [".. admonition:: Known weaknesses", "", f"   {linked(weakness, env.docname)}", ""]
        rows = list(options_of(first))
        if rows:
            lines += table(("option", "default", "meaning"), rows, widths=(18, 14, 68))
        for name, other in zip(self.arguments[0].split()[1:], others, strict=True):
            changed = [f"``{f.name}={getattr(other, f.name)}``" for f in dataclasses.fields(other)
                       if getattr(other, f.name) != getattr(first, f.name)]  # fmt: skip
            lines += [f"``{name}`` is the same planner with {', '.join(changed)}.", ""]
        lines += [f":py:obj:`{kind.__name__}` is the class in Python." + ("" if rows else " It has no options."), ""]
        return parsed(self, lines)


def linked(text: str, page: str) -> str:
    """A docstring's sentence with the pages that it names made links from `page`."""
    text = re.sub(r"^Known weakness(es)?(, measured)?( \(([^)]*)\))?[:.]\s*", _source, text)
    return PAGE.sub(lambda match: f":doc:`/{match[1]}`", text)


def _source(match: re.Match[str]) -> str:
    return f"Measured in {match[4]}: " if match[4] else "Measured: " if match[2] else ""


class Drawn(Directive):
    """`.. drawn:: TEXT`: the figure that the content leaves in `figure`, and the content."""

    required_arguments = 1
    final_argument_whitespace = True
    has_content = True
    option_spec: ClassVar[dict[str, Any]] = {"width": directives.length_or_percentage_or_unitless}

    def run(self) -> list[nodes.Node]:
        """Run the content in an empty folder, and show its figure."""
        env = self.state.document.settings.env
        note_sources(env)
        code = "\n".join(self.content)
        name = f"{PICTURES}/{hashlib.sha256(f'{env.docname} {code}'.encode()).hexdigest()[:16]}.png"
        figure = drawn_by(code, env.docname)
        path = Path(env.srcdir) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=DPI, facecolor="white", bbox_inches="tight")
        text = self.arguments[0]
        shown = nodes.figure("", nodes.image(uri=f"/{name}", alt=text, width=self.options.get("width", "")))
        if not shown[0]["width"]:
            del shown[0]["width"]
        shown[0]["uri"] = os.path.relpath(path, (Path(env.srcdir) / env.docname).parent)
        shown += nodes.caption("", text)
        lines = nodes.literal_block(code, code, language="python")
        return [shown, details("The lines that draw it", lines)]


def drawn_by(code: str, where: str) -> Any:
    """The figure that lines of Python leave in `figure`.

    Args:
        code: the lines
        where: what messages call them
    """
    space: dict[str, Any] = {"__name__": "__main__"}
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()):
        exec(compile(code, where, "exec"), space)
    return space["figure"]


class details_node(nodes.General, nodes.Element):
    """A part of a page that opens with a click."""


def details(summary: str, *children: nodes.Node) -> details_node:
    """A part of a page that opens with a click on its summary."""
    return details_node("", *children, summary=summary)


def open_details(self: Any, node: Mapping[str, Any]) -> None:
    """Write the beginning."""
    self.body.append(f'<details class="antdrive-lines"><summary>{self.encode(node["summary"])}</summary>\n')


def close_details(self: Any, node: Mapping[str, Any]) -> None:
    """Write the end."""
    self.body.append("</details>\n")


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directives."""
    app.add_node(details_node, html=(open_details, close_details))
    app.add_directive("planner", Options)
    app.add_directive("drawn", Drawn)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
