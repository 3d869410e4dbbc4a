"""The commands with their options, from the command line itself.

sphinxcontrib-typer walks the commands and shows what `--help` prints, in boxes of fixed width. Here each gets tables
instead, which fit a narrow screen.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from antdrive_sources import note_sources
from antdrive_tables import table, told
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinxcontrib.typer import TyperDirective
from typer.models import Context


def rows_of(command: Any, kind: str) -> Iterable[tuple[str, str]]:
    """The arguments or the options of a command with what each means, as `--help` has them."""
    context = Context(command)
    for one in command.params:
        record = one.get_help_record(context) if one.param_type_name == kind else None
        if record:
            yield f"``{' '.join(record[0].split())}``", told(record[1])


def described(name: str, command: Any, usage: str) -> list[str]:
    """What a command does, its arguments and its options, as reST."""
    text = (command.help or "").split("\f")[0]
    lines = [f"``{usage}``", "", *(part for one in text.split("\n\n") for part in (told(one), ""))]
    for kind in ("argument", "option"):
        rows = list(rows_of(command, kind))
        if rows:
            lines += table((kind, "meaning"), rows, widths=(35, 65))
    return lines


class Commands(TyperDirective):
    """The directive `typer`, with tables."""

    def get_text(self, **_: Any) -> str:
        """Nothing: tables take its place."""
        return ""

    def generate_nodes(self, name: str, command: Any, parent: Any) -> list[nodes.section]:
        """The sections of a command and its subcommands."""
        note_sources(self.state.document.settings.env)
        sections = super().generate_nodes(name, command, parent)
        context = Context(command, info_name=name, parent=parent)
        usage = " ".join([context.command_path, *command.collect_usage_pieces(context)])
        for section in sections:
            for block in [child for child in section.children if isinstance(child, nodes.literal_block)]:
                shown = nodes.container()
                lines = StringList(described(name, command, usage), source=f"<antdrive {name}>")
                self.state.nested_parse(lines, self.content_offset, shown)
                section.replace(block, shown.children)
        return sections


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("commands", Commands)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
