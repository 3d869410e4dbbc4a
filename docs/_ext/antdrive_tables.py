"""Tables that the code knows: keys of files from their schemas, exit codes, planners and worlds."""

from __future__ import annotations

import ast
import inspect
import json
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar

from antdrive_sources import note_sources
from docutils import nodes
from docutils.parsers.rst import Directive
from docutils.statemachine import StringList
from sphinx.application import Sphinx

Row = tuple[str, ...]


def kind_of(schema: Mapping[str, Any]) -> str:
    """What a value may be, in words."""
    if "$ref" in schema:
        return schema["$ref"].rpartition("/")[2].removesuffix("Entry").lower()
    if "const" in schema:
        return f"``{json.dumps(schema['const'])}``"
    if "enum" in schema:
        return " or ".join(f"``{value}``" for value in schema["enum"])
    if "anyOf" in schema:
        kinds = [kind_of(one) for one in schema["anyOf"] if one.get("type") != "null"]
        return ", or ".join(dict.fromkeys(kinds))
    kind = schema.get("type", "anything")
    if kind == "array":
        few, most = schema.get("minItems"), schema.get("maxItems")
        count = f"{few} × " if few == most and few else ""
        return f"list of {count}{kind_of(schema.get('items', {}))}"
    if kind == "object":
        return "mapping"
    words = {"integer": "whole number", "string": "text", "boolean": "true or false"}
    return words.get(kind, kind) + limits_of(schema)


def limits_of(schema: Mapping[str, Any]) -> str:
    """The limits of a number or the form of a text, in brackets; empty without any."""
    signs = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
    found = [f"{sign} {schema[key]:g}" for key, sign in signs.items() if key in schema and abs(schema[key]) < 1e6]
    if "pattern" in schema:
        found.append(f"like ``{schema['pattern']}``")
    return f" ({', '.join(found)})" if found else ""


def rows_of(schema: Mapping[str, Any]) -> Iterable[Row]:
    """Key, kind, default and meaning of each key of an object in a schema."""
    required = schema.get("required", [])
    for key, value in schema["properties"].items():
        default = (
            "required"
            if key in required
            else ""
            if value.get("default") is None
            else f"``{json.dumps(value['default'])}``"
        )
        if "default" not in value and key not in required:
            default = ""
        yield f"``{key}``", kind_of(value), default, told(value.get("description", ""))


def told(text: str) -> str:
    """A description as reST: its line breaks are spaces, its asterisks no emphasis, and "K. Han" begins no list."""
    words = " ".join(text.split()).replace("*", "\\*").replace("|", "\\|")
    return re.sub(r"^(\w+)([.)]) ", r"\1\\\2 ", words)


def schema_of(kind: str) -> dict[str, Any]:
    """The JSON Schema that `antdrive schema KIND` prints."""
    from antdrive.robots import robot_schema
    from antdrive.runs.campaigns import campaign_schema
    from antdrive.runs.suites import suite_schema
    from antdrive.worlds import task_schema

    known: dict[str, Callable[[], dict[str, Any]]] = {
        "world": task_schema, "robot": robot_schema, "suite": suite_schema, "campaign": campaign_schema,
    }  # fmt: skip
    return known[kind]()


def parts_of(schema: Mapping[str, Any]) -> Iterable[tuple[str, Mapping[str, Any]]]:
    """The objects within a schema that have keys of their own: those under `$defs`, and those written in place."""
    for name, part in schema.get("$defs", {}).items():
        yield name.removesuffix("Entry"), part
    for key, value in schema["properties"].items():
        for part in [value, value.get("items", {}), *value.get("anyOf", [])]:
            if part.get("type") == "object" and part.get("properties"):
                yield key, part


def table(heads: Row, rows: Iterable[Row], widths: tuple[int, ...] = ()) -> list[str]:
    """A table as reST."""
    widened = [f"   :widths: {' '.join(map(str, widths))}"] if widths else []
    lines = [".. list-table::", "   :header-rows: 1", *widened, ""]
    for row in (heads, *rows):
        lines += [f"   {'*' if i == 0 else ' '} - {cell}" for i, cell in enumerate(row)]
    return [*lines, ""]


class Schema(Directive):
    """`.. file-keys:: world`: the keys of a kind of file."""

    required_arguments = 1
    option_spec: ClassVar[dict[str, Any]] = {}

    def run(self) -> list[nodes.Node]:
        """A table of the file's own keys, and one for each part with keys of its own."""
        schema = schema_of(self.arguments[0])
        heads = ("key", "value", "default", "meaning")
        lines = [told(schema.get("description", "")), "", *table(heads, rows_of(schema))]
        for name, part in parts_of(schema):
            lines += [
                f".. rubric:: {name.lower()}",
                "",
                told(part.get("description", "")),
                "",
                *table(heads, rows_of(part)),
            ]
        return parsed(self, lines)


def exit_codes() -> list[str]:
    """Each exit code with the comment that stands beside it in the code."""
    from antdrive.cli import exits

    rows = []
    for line in inspect.getsource(exits).splitlines():
        code, _, meaning = line.partition("  # ")
        parsed = ast.parse(code).body
        if meaning and isinstance(parsed[0], ast.Assign):
            rows.append((f"``{ast.literal_eval(parsed[0].value)}``", meaning))
    return table(("exit code", "meaning"), rows)


def planners() -> list[str]:
    """Each planner with its options and their defaults, from the registry."""
    from antdrive.planners import PLANNERS
    from antdrive.sim.log.record import settings_of

    lines: list[str] = []
    for name, planner in PLANNERS.items():
        first = inspect.cleandoc(type(planner).__doc__ or "").partition("\n\n")[0]
        options = ", ".join(f"``{key}={value}``" for key, value in settings_of(planner).items())
        lines += [
            f"``{name}`` (:py:obj:`{type(planner).__name__}`)",
            f"   {' '.join(first.split())}",
            "",
            f"   {options or 'No options.'}",
            "",
        ]
    return lines


def worlds() -> list[str]:
    """Each world of the catalogue with its size and what is in it."""
    from antdrive.worlds import list_worlds, load_task

    rows = []
    for name in list_worlds():
        world = load_task(name).world
        wide, high = world.size
        rows.append(
            (
                f"``{name}``",
                f"{wide:g}\u00a0×\u00a0{high:g}\u00a0m",
                str(len(world.obstacles)),
                str(len(world.movers)),
                told(world.source or ""),
            )
        )
    return table(("world", "size", "cylinders", "movers", "source"), rows)


TABLES: dict[str, Callable[[], list[str]]] = {
    "exit-codes": exit_codes, "planners": planners, "worlds": worlds,
}  # fmt: skip


class Table(Directive):
    """`.. known:: planners`: a table of what the code knows."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The table."""
        return parsed(self, TABLES[self.arguments[0]]())


def parsed(directive: Directive, lines: list[str]) -> list[nodes.Node]:
    """What lines of reST make. They say what the packages know, so the page is read again when these change."""
    note_sources(directive.state.document.settings.env)
    container = nodes.container()
    directive.state.nested_parse(StringList(lines, source="<table>"), directive.content_offset, container)
    return list(container.children)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directives."""
    app.add_directive("file-keys", Schema)
    app.add_directive("known", Table)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
