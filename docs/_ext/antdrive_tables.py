"""What the code knows, as lines of reST: keys of files, commands, planners, worlds, exit codes, logs, metrics.

Nothing here needs Sphinx; `antdrive_site` shows it where a page says `.. known:: NAME`.
"""

from __future__ import annotations

import dataclasses
import inspect
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

Row = tuple[str, ...]
TYPES = {"integer": "whole number", "string": "text", "boolean": "true or false", "object": "mapping"}
SIGNS = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}


def told(text: str) -> str:
    """A description as reST: its line breaks are spaces, its asterisks no emphasis, and "K. Han" begins no list."""
    words = " ".join(text.split()).replace("*", "\\*").replace("|", "\\|")
    return re.sub(r"^(\w+)([.)]) ", r"\1\\\2 ", words)


def table(heads: str, rows: Iterable[Row], widths: str = "") -> list[str]:
    """A table with the heads that a text lists; no lines if there are no rows."""
    lines = [".. list-table::", "   :header-rows: 1", *([f"   :widths: {widths}"] if widths else []), ""]
    cells = [tuple(heads.split(", ")), *rows]
    for row in cells:
        lines += [f"   {'*' if i == 0 else ' '} - {cell}" for i, cell in enumerate(row)]
    return [*lines, ""] if len(cells) > 1 else []


def kind_of(schema: Mapping[str, Any]) -> str:
    """What a value may be, in words."""
    if "$ref" in schema:
        return str(schema["$ref"]).rpartition("/")[2].removesuffix("Entry").lower()
    if "const" in schema:
        return f"``{json.dumps(schema['const'])}``"
    if "enum" in schema:
        return " or ".join(f"``{value}``" for value in schema["enum"])
    if "anyOf" in schema:
        return ", or ".join(dict.fromkeys(kind_of(one) for one in schema["anyOf"] if one.get("type") != "null"))
    kind = schema.get("type", "anything")
    if kind == "array":
        few = schema.get("minItems")
        count = f"{few} × " if few and few == schema.get("maxItems") else ""
        return f"list of {count}{kind_of(schema.get('items', {}))}"
    limits = [f"{sign} {schema[key]:g}" for key, sign in SIGNS.items() if abs(schema.get(key, 1e6)) < 1e6]
    limits += [f"like ``{schema['pattern']}``"] if "pattern" in schema else []
    return TYPES.get(kind, kind) + (f" ({', '.join(limits)})" if limits else "")


def keys_of(schema: Mapping[str, Any]) -> list[str]:
    """A table of the keys of an object in a schema."""

    def row(key: str, value: Mapping[str, Any]) -> Row:
        default = "" if value.get("default") is None else f"``{json.dumps(value['default'])}``"
        required = key in schema.get("required", [])
        return f"``{key}``", kind_of(value), "required" if required else default, told(value.get("description", ""))

    rows = [row(key, value) for key, value in schema["properties"].items()]
    return [told(schema.get("description", "")), "", *table("key, value, default, meaning", rows)]


def keys(kind: str) -> list[str]:
    """The keys of a kind of file, and those of each part that has keys of its own, named or written in place."""
    from antdrive.robots import robot_schema
    from antdrive.runs.campaigns import campaign_schema
    from antdrive.runs.suites import suite_schema
    from antdrive.worlds import task_schema

    known = {"world": task_schema, "robot": robot_schema, "suite": suite_schema, "campaign": campaign_schema}
    schema: dict[str, Any] = known[kind]()
    lines = keys_of(schema)
    parts = [(name.removesuffix("Entry"), part) for name, part in schema.get("$defs", {}).items()]
    for key, value in schema["properties"].items():
        parts += [(key, part) for part in (value, value.get("items", {}), *value.get("anyOf", []))]
    for name, part in parts:
        if part.get("type") == "object" and part.get("properties"):
            lines += [f".. rubric:: {name.lower()}", "", *keys_of(part)]
    return lines


def commands() -> list[str]:
    """Each command with what it does, its arguments and its options, as `--help` has them."""
    from antdrive.cli.groups import application

    command = application()
    return list(_commands(command, command.make_context("antdrive", [], resilient_parsing=True), "="))


def _commands(command: Any, context: Any, line: str) -> Iterator[str]:
    yield from (context.command_path, line * len(context.command_path), "")
    yield from (f"``{' '.join([context.command_path, *command.collect_usage_pieces(context)])}``", "")
    for paragraph in (command.help or "").split("\f")[0].split("\n\n"):
        yield from (told(paragraph), "")
    for kind in ("argument", "option"):
        records = (one.get_help_record(context) for one in command.params if one.param_type_name == kind)
        rows = [(f"``{' '.join(record[0].split())}``", told(record[1])) for record in records if record]
        yield from table(f"{kind}, meaning", rows, "35 65")
    for name in command.list_commands(context) if hasattr(command, "list_commands") else ():
        inner = command.get_command(context, name)
        yield from _commands(inner, type(context)(inner, info_name=name, parent=context), "-" if line == "=" else "~")


def exit_codes() -> list[str]:
    """Each exit code with the comment that stands beside it in the code."""
    from antdrive.cli import exits

    lines = [line.split("  # ") for line in inspect.getsource(exits).splitlines() if "  # " in line]
    return table("exit code, meaning", [(f"``{code.split(' = ')[1]}``", meaning) for code, meaning in lines])


def described(kind: type) -> dict[str, str]:
    """What the docstrings of a class and its bases say of each attribute; the class's own word counts most."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        section = inspect.cleandoc(vars(base).get("__doc__") or "").partition("\nAttributes:\n")[2]
        entries = re.split(r"^    (\w+): ", re.split(r"^\S", section, flags=re.MULTILINE)[0], flags=re.MULTILINE)[1:]
        found |= {name: " ".join(text.split()) for name, text in zip(entries[::2], entries[1::2], strict=True)}
    return found


def planners() -> list[str]:
    """Each planner with its options and their defaults, from the registry."""
    from antdrive.planners import PLANNERS
    from antdrive.sim.log.record import settings_of

    lines: list[str] = []
    for name, planner in PLANNERS.items():
        first = inspect.cleandoc(type(planner).__doc__ or "").partition("\n\n")[0]
        options = ", ".join(f"``{key}={value}``" for key, value in settings_of(planner).items())
        lines += [f"``{name}`` (:py:obj:`{type(planner).__name__}`)", f"   {' '.join(first.split())}", ""]
        lines += [f"   {options or 'No options.'}", ""]
    return lines


def planner(*names: str) -> list[str]:
    """The weaknesses that a planner's docstring knows, its options, and what other planners of its class change.

    Raises:
        KeyError: an option is not described.
    """
    from antdrive.planners import PLANNERS
    from antdrive.sim.log.record import settings_of

    first, kind = PLANNERS[names[0]], type(PLANNERS[names[0]])
    lines: list[str] = []
    for weakness in weaknesses_of(kind):
        text = re.sub(r"^Known weakness(es)?(, measured)?( \(([^)]*)\))?[:.]\s*", _source, weakness)
        text = re.sub(r"`?docs/([\w/.-]+)\.md`?", r":doc:`/\1`", text)
        lines += [".. admonition:: Known weaknesses", "", f"   {text}", ""]
    meanings = described(kind)
    rows = [(f"``{key}``", f"``{value}``", told(meanings[key])) for key, value in settings_of(first).items()]
    lines += table("option, default, meaning", rows, "18 14 68")
    for name in names[1:]:
        values = {field.name: getattr(PLANNERS[name], field.name) for field in dataclasses.fields(PLANNERS[name])}
        changed = [f"``{key}={value}``" for key, value in values.items() if value != getattr(first, key)]
        lines += [f"``{name}`` is the same planner with {', '.join(changed)}.", ""]
    return [*lines, f":py:obj:`{kind.__name__}` is the class in Python." + ("" if rows else " It has no options."), ""]


def weaknesses_of(kind: type) -> list[str]:
    """The paragraphs of a class's docstring that begin with "Known weakness"; "the same page" is named."""
    text = inspect.cleandoc(kind.__doc__ or "")
    page = next(iter(re.findall(r"docs/papers/\w+\.md", text)), "")
    found = [" ".join(one.split()) for one in text.split("\n\n") if one.startswith("Known weakness")]
    return [re.sub("measured on the same page[.:]", f"measured ({page}):", one) for one in found]


def _source(match: re.Match[str]) -> str:
    return f"Measured in {match[4]}: " if match[4] else "Measured: " if match[2] else ""


def worlds() -> list[str]:
    """Each world of the catalogue with its size and what is in it."""
    from antdrive.worlds import list_worlds, load_task

    def row(name: str) -> Row:
        world = load_task(name).world
        size = "\u00a0×\u00a0".join(f"{side:g}" for side in world.size) + "\u00a0m"
        return f"``{name}``", size, str(len(world.obstacles)), str(len(world.movers)), told(world.source or "")

    return table("world, size, cylinders, movers, source", map(row, list_worlds()))


def arrays() -> list[str]:
    """Name, shape, dtype and content of each array of a log, from the docstring of `Rollout`."""
    import numpy as np

    from antdrive.sim.log.rollout import FORMS, Rollout

    rows, contents = [], described(Rollout)
    for name, (_, dtype) in FORMS.items():
        shape = re.search(r"\((T|N|K|P|S)[\w, ]*\)", contents[name])
        if shape:
            rows.append((f"``{name}``", shape[0], np.dtype(dtype).name, told(contents[name])))
    return table("array, shape, dtype, content", rows)


def record() -> list[str]:
    """Every key of a log's record with its type; keys of nested records are dotted."""
    from antdrive.sim.log import record as records

    def rows(kind: type, prefix: str = "") -> Iterator[Row]:
        for field in dataclasses.fields(kind):
            name, of = f"{prefix}{field.name}", str(field.type)
            yield f"``{name}``", json_type(of), told(described(kind)[field.name])
            inner = re.search(r"\b(\w+Record)\b", of)
            if inner:
                yield from rows(getattr(records, inner[1]), f"{name}[]." if of.startswith("tuple") else f"{name}.")

    return table("key, JSON, content", rows(records.DriveRecord))


def json_type(annotation: str) -> str:
    """What JSON calls the type of a field."""
    kind = annotation.removesuffix(" | None")
    words = {"str": "text", "float": "number", "int": "whole number", "bool": "true or false"}
    plain = "list" if kind.startswith("tuple") else "text" if "Outcome" in kind else "object"
    return words.get(kind, plain) + (" or null" if annotation.endswith(" | None") else "")


def outcomes() -> list[str]:
    """Every outcome of a drive."""
    from antdrive.sim.log.outcome import Outcome

    codes = {Outcome.SUCCEEDED: "0 if the log proves it, else 1"}
    rows = [(f"``{one.key}``", one.value, codes.get(one, "1")) for one in Outcome]
    return table("outcome, sentence, exit code", rows)


def metrics() -> list[str]:
    """Every metric."""
    from antdrive.sim.log.metrics import METRICS

    rows = [(f"``{one.name}``", one.unit, one.better, told(one.definition)) for one in METRICS.values()]
    return table("metric, unit, better, definition", rows)


KNOWN: dict[str, Callable[..., list[str]]] = {
    "arrays": arrays, "commands": commands, "exit-codes": exit_codes, "keys": keys, "metrics": metrics, "outcomes": outcomes,
    "planner": planner, "planners": planners, "record": record, "worlds": worlds,
}  # fmt: skip
