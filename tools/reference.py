"""Generated parts of the documents, and the rows of the command line's lists: `python -m tools.reference` writes them.

A page marks such a part: the lines between `<!-- generated: NAME WORDS -->` and `<!-- end -->` are those of the
function NAME in `GENERATED`. `--check` writes nothing and lists the pages that differ.
"""

from __future__ import annotations

import argparse
import dataclasses
import inspect
import itertools
import json
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from antdrive.base.records import meanings_of
from antdrive.cli.listings import LISTED
from tools.formulas import HTML, typeset

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PART = re.compile(r"^(<!-- generated: (.+?) -->\n).*?^(<!-- end -->)$", re.MULTILINE | re.DOTALL)
Row = tuple[str, ...]
TYPES = {"integer": "whole number", "string": "text", "boolean": "true or false", "object": "mapping"}
SIGNS = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}


def cell(text: str) -> str:
    """Return a description as one cell of a Markdown table: one line, no pipe, no emphasis, no HTML outside code."""
    parts = re.split(r"(`[^`]*`)", " ".join(text.split()))
    plain = [one if one.startswith("`") else re.sub(r"([*<])", r"\\\1", one) for one in parts]
    return typeset("".join(plain).replace("|", "\\|"), HTML)


def code(text: object) -> str:
    """Return a text as code."""
    return f"`{text}`"


def table(heads: str, rows: Iterable[Row]) -> list[str]:
    """Return a table with comma-separated heads, or no lines without rows."""
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    head = heads.split(", ")
    return ["| " + " | ".join(head) + " |", "|" + "---|" * len(head), *lines, ""] if lines else []


def kind_of(schema: Mapping[str, Any]) -> str:
    """Return the values that a schema allows, in words."""
    if "$ref" in schema:
        return str(schema["$ref"]).rpartition("/")[2].removesuffix("Entry").lower()
    if "const" in schema:
        return code(json.dumps(schema["const"]))
    if "enum" in schema:
        return " or ".join(map(code, schema["enum"]))
    if "anyOf" in schema:
        return ", or ".join(dict.fromkeys(kind_of(one) for one in schema["anyOf"] if one.get("type") != "null"))
    kind = schema.get("type", "anything")
    if kind == "array":
        few = schema.get("minItems")
        count = f"{few} × " if few and few == schema.get("maxItems") else ""
        return f"list of {count}{kind_of(schema.get('items', {}))}"
    limits = [f"{sign} {schema[key]:g}" for key, sign in SIGNS.items() if abs(schema.get(key, 1e6)) < 1e6]
    limits += [f"like `{schema['pattern']}`"] if "pattern" in schema else []
    return cell(TYPES.get(kind, kind) + (f" ({', '.join(limits)})" if limits else ""))


def keys_of(schema: Mapping[str, Any]) -> list[str]:
    """Return a table of an object's keys."""

    def row(key: str, value: Mapping[str, Any]) -> Row:
        default = "" if value.get("default") is None else code(json.dumps(value["default"]))
        required = key in schema.get("required", [])
        return code(key), kind_of(value), "required" if required else default, cell(_summary(value))

    rows = [row(key, value) for key, value in schema["properties"].items()]
    return [" ".join(_summary(schema).split()), "", *table("key, value, default, meaning", rows)]


def _summary(schema: Mapping[str, Any]) -> str:
    return re.split(r"\n+\s*(?:Attributes|Raises):", str(schema.get("description", "")))[0]


def keys(kind: str) -> list[str]:
    """Return the keys of a kind of file, then those of its parts."""
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
            lines += [f"**{name.lower()}**", "", *keys_of(part)]
    return lines


def commands() -> list[str]:
    """Return each command with its arguments and options, as `--help` prints them."""
    from antdrive.cli.groups import application

    command = application()
    return list(_commands(command, command.make_context("antdrive", [], resilient_parsing=True), "##"))


def _commands(command: Any, context: Any, level: str) -> Iterator[str]:
    yield from (f"{level} {context.command_path}", "")
    yield from (code(" ".join([context.command_path, *command.collect_usage_pieces(context)])), "")
    for paragraph in (command.help or "").split("\f")[0].split("\n\n"):
        yield from (cell(paragraph), "")
    for kind in ("argument", "option"):
        records = (one.get_help_record(context) for one in command.params if one.param_type_name == kind)
        rows = [
            (code(" ".join(record[0].split()).replace("|", "\\|")), cell(record[1])) for record in records if record
        ]
        yield from table(f"{kind}, meaning", rows)
    for name in command.list_commands(context) if hasattr(command, "list_commands") else ():
        inner = command.get_command(context, name)
        deeper = "###" if len(context.command_path.split()) > 1 else "##"
        yield from _commands(inner, type(context)(inner, info_name=name, parent=context), deeper)


def exit_codes() -> list[str]:
    """Return each exit code with its comment in the source."""
    from antdrive.cli import exits

    lines = [line.split("  # ") for line in inspect.getsource(exits).splitlines() if "  # " in line]
    return table("exit code, meaning", [(code(value.split(" = ")[1]), meaning) for value, meaning in lines])


def planners() -> list[str]:
    """Return each planner with its summary, options and defaults."""
    from antdrive.planners import PLANNERS
    from antdrive.sim.log.record import settings_of

    def row(name: str) -> Row:
        planner = PLANNERS[name]
        first = " ".join(inspect.cleandoc(type(planner).__doc__ or "").partition("\n\n")[0].split())
        options = ", ".join(code(f"{key}={value}") for key, value in settings_of(planner).items())
        return code(name), code(type(planner).__name__), cell(first), options or "none"

    return table("planner, class, summary, options", map(row, PLANNERS))


def planner(*names: str) -> list[str]:
    """Return a planner's known weaknesses and options, and how its variants differ.

    Raises:
        KeyError: an option has no description.
    """
    from antdrive.planners import PLANNERS
    from antdrive.sim.log.record import settings_of

    first, kind = PLANNERS[names[0]], type(PLANNERS[names[0]])
    lines: list[str] = []
    for weakness in weaknesses_of(kind):
        text = re.sub(r"^Known weakness(es)?(, measured)?( \(([^)]*)\))?[:.]\s*", _source, weakness)
        text = re.sub(r"`?docs/([\w/.-]+)\.md`?", r"[\1](../../\1.md)", text)
        lines += [f"**Known weaknesses.** {text}", ""]
    meanings = meanings_of(kind)
    rows = [(code(key), code(value), cell(meanings[key])) for key, value in settings_of(first).items()]
    lines += table("option, default, meaning", rows)
    for name in names[1:]:
        values = {field.name: getattr(PLANNERS[name], field.name) for field in dataclasses.fields(PLANNERS[name])}
        changed = [code(f"{key}={value}") for key, value in values.items() if value != getattr(first, key)]
        lines += [f"`{name}` is the same planner with {', '.join(changed)}.", ""]
    end = "" if rows else " It has no options."
    return [*lines, f"Its class is [`{kind.__name__}`](../../reference/api/planners.md).{end}", ""]


def weaknesses_of(kind: type) -> list[str]:
    """Return the paragraphs of a class's docstring that begin with "Known weakness", "the same page" named."""
    text = inspect.cleandoc(kind.__doc__ or "")
    page = next(iter(re.findall(r"docs/papers/\w+\.md", text)), "")
    found = [" ".join(one.split()) for one in text.split("\n\n") if one.startswith("Known weakness")]
    return [re.sub("measured on the same page[.:]", f"measured ({page}):", one) for one in found]


def _source(match: re.Match[str]) -> str:
    return f"Measured in {match[4]}: " if match[4] else "Measured: " if match[2] else ""


def controllers() -> list[str]:
    """Return each controller with its source, idea, equations, weaknesses, options and defaults."""
    from antdrive.robots import CONTROLLERS, PurePursuit
    from antdrive.sim.log.record import settings_of

    lines: list[str] = []
    for name, one in CONTROLLERS.items():
        kind, about = type(one), inspect.cleandoc(type(one).__doc__ or "").split("\n\n")
        source = (inspect.getdoc(sys.modules[kind.__module__]) or "").partition("\n\n")[2]
        parts = [part for part in about if not part.startswith(("Attributes:", "Raises:"))]
        source = "" if kind is PurePursuit else " ".join(source.split())
        lines += [f"## `{name}`", ""]
        for text in filter(None, (*parts, source)):
            lines += [
                re.sub(
                    r"^Known weaknesses: (.)", lambda m: f"**Known weaknesses.** {m[1].upper()}", " ".join(text.split())
                ),
                "",
            ]
        if kind is not PurePursuit:  # whose options have units and routes
            meanings = meanings_of(kind)
            rows = [(code(key), code(value), cell(meanings[key])) for key, value in settings_of(one).items()]
            lines += table("option, default, meaning", rows)
        else:
            lines += controller()
    return lines


def controller() -> list[str]:
    """Return each option of the controller with its default, unit and routes."""
    from antdrive.robots.control.pursuit import controller_options

    options = controller_options().items()
    rows = [(code(key), code(one.default), one.unit or "–", one.routes, cell(one.meaning)) for key, one in options]
    return table("option, default, unit, acts on routes, meaning", rows)


def counterparts() -> list[str]:
    """Return the counterpart of each parameter of Nav2's controller."""
    from antdrive.robots.control.nav2 import NAV2

    return table("Nav2, antdrive", [(code(name), text) for name, text in NAV2.items()])


#: What each world of the catalogue is for. hasan's twelve say which figure of the paper they recreate.
PURPOSES = {
    "empty": "the controller alone; obstacles that you add with `--unseen`",
    "forest": "first drives, and planners side by side: many ways around scattered cylinders",
    "gate": "tight passages: the jackal fits the one gap of 0.8 m with 0.067 m to spare on each side",
    "han2007-aco": "repeating Han's ant colony: the 14 discs of its listing",
    "han2007-ga": "repeating Han's genetic algorithm: the 6 discs of its listing",
    "han2007-single": "the simplest detour: one disc of radius 2.5 m between start and goal",
    "no-path": "the answer *no path*: a closed ring around the goal",
    "office": "long routes through ten rooms along a corridor, with doors of 0.85 to 2 m",
    "people-aisle": "a crossing at the end of an aisle: a person walks to and fro between shelves, 10 m ahead",
    "people-corridor": "passing in a corridor of 2.4 m: a person comes towards the robot",
    "people-crossing": "crossing traffic: five people cross the robot's way",
    "people-doorway": "giving way: a person comes through the only door as the robot arrives",
    "plaza-moving": "avoidance and replanning: six movers of every kind among four columns",
    "slalom": "tracking: tight turns around four walls, open in turn",
    "u-trap": "local minima: the goal lies behind a U that opens towards the start",
}


def worlds() -> list[str]:
    """Return each world of the catalogue with its picture, purpose, size and content."""
    from antdrive.base.files import summary_of
    from antdrive.worlds import list_worlds, load_task

    def row(name: str, path: Path) -> Row:
        world = load_task(name).world
        size = "\u00a0×\u00a0".join(f"{side:g}" for side in world.size) + "\u00a0m"
        purpose = PURPOSES.get(name) or _of_hasan(name, world.source or "")
        picture = f"![Map of {name}: {summary_of(path)}](../pictures/worlds/{name}.webp)"
        return code(name), picture, purpose, size, str(len(world.obstacles)), str(len(world.movers))

    rows = table("world, picture, for, size, cylinders, movers", itertools.starmap(row, list_worlds().items()))
    han, hasan = (re.split(r";|, Fig\.", load_task(name).world.source or "")[0] for name in ("han2007-aco", "hasan-1a"))
    return [
        *rows,
        f"`han2007-*`: {han}. `hasan-*`: {hasan}. `forest` follows Han's rule; the others are antdrive's own.",
        "",
    ]


def _of_hasan(name: str, source: str) -> str:
    found = re.search(r"Fig\. (\w+): ([^;]+)", source)
    if not found:
        raise KeyError(f"{name}: add what it is for to PURPOSES")
    return (
        f"hasan, Fig. {found[1]}: {found[2]}"
        if "-moving" not in name
        else f"the same, with the paper's mover (Fig. {found[1]})"
    )


def robots() -> list[str]:
    """Return each robot of the catalogue with its footprint, limits, lidar and source."""
    from antdrive.robots import list_robots, load_robot
    from antdrive.robots.card import footprint_text

    def row(name: str) -> Row:
        robot = load_robot(name)
        lidar = robot.lidar
        sensor = f"{lidar.rate:g} Hz, {lidar.max_range:g} m" if lidar else "none"
        top = f"{robot.max_speed:g} m/s, {robot.max_yaw_rate:g} rad/s"
        after = re.split(r"[:;(]|\. |, (?=[a-z\d])", " ".join((robot.source or "").split()))[0]
        shape = footprint_text(robot.footprint)
        wheels = f"wheels {robot.track:g} m apart"
        picture = f"![Footprint of {name} from above: {shape}, {wheels}](../pictures/robots/{name}.svg)"
        texts = (re.sub(r"(?<=\d) (?=(?:m|Hz|rad)\b)", "\u00a0", cell(text)) for text in (shape, top, sensor))
        return code(name), picture, *texts, cell(after.strip().removeprefix("After "))

    return table("robot, footprint, shape, top speeds, lidar, source", map(row, list_robots()))


def arrays() -> list[str]:
    """Return name, shape, dtype and content of each array of a log."""
    import numpy as np

    from antdrive.sim.log.rollout import FORMS, Rollout

    rows, contents = [], meanings_of(Rollout)
    for name, form in FORMS.items():
        shape = re.search(r"\((T|N|K|P|S)[\w, ]*\)", contents[name])
        if shape:
            rows.append((code(name), shape[0], np.dtype(form.dtype).name, cell(contents[name])))
    return table("array, shape, dtype, content", rows)


def record() -> list[str]:
    """Return every key of a log's record with its type; keys of nested records are dotted."""
    from antdrive.sim.log import record as records

    def rows(kind: type, prefix: str = "") -> Iterator[Row]:
        for field in dataclasses.fields(kind):
            name, of = f"{prefix}{field.name}", str(field.type)
            yield code(name), json_type(of), cell(meanings_of(kind)[field.name])
            inner = re.search(r"\b(\w+Record)\b", of)
            if inner:
                yield from rows(getattr(records, inner[1]), f"{name}[]." if of.startswith("tuple") else f"{name}.")

    return table("key, JSON, content", rows(records.DriveRecord))


def proofs() -> list[str]:
    """Return which level of verification checks each array and each key of a log's record."""
    from antdrive.sim.log.record import PROOFS, Evidence
    from antdrive.sim.log.rollout import FORMS

    levels = {
        Evidence.LOG: "`verify` recomputes",
        Evidence.WORLD: "`--world` compares or recomputes",
        Evidence.ROBOT: "`--robot` compares",
        Evidence.REPLAY: "`--replay` recomputes",
        Evidence.INPUT: "inputs, with which `--replay` drives",
        Evidence.CLAIM: "nothing checks",
    }

    def row(proof: Evidence) -> Row:
        arrays = [code(name) for name, form in FORMS.items() if form.proof is proof]
        keys = [code(key) for key, one in PROOFS.items() if one is proof]
        return levels[proof], ", ".join(arrays), ", ".join(keys)

    return table("level, arrays, keys of the record", map(row, Evidence))


def json_type(annotation: str) -> str:
    """Return the JSON type of a field."""
    kind = annotation.removesuffix(" | None")
    words = {"str": "text", "float": "number", "int": "whole number", "bool": "true or false"}
    plain = "list" if kind.startswith("tuple") else "text" if "Outcome" in kind else "object"
    return words.get(kind, plain) + (" or null" if annotation.endswith(" | None") else "")


def outcomes() -> list[str]:
    """Return every outcome of a drive."""
    from antdrive.sim.log.outcome import Outcome

    codes = {Outcome.SUCCEEDED: "0 if the log proves it, else 1"}
    rows = [(code(one.key), one.value, codes.get(one, "1")) for one in Outcome]
    return table("outcome, sentence, exit code", rows)


def metrics() -> list[str]:
    """Return every metric."""
    from antdrive.sim.log.metrics import METRICS

    rows = [(code(one.name), one.unit, one.better, cell(one.definition)) for one in METRICS.values()]
    return table("metric, unit, better, definition", rows)


def tolerances() -> list[str]:
    """Return the default tolerance of every metric that regression tests compare."""
    from antdrive.sim.log.metrics import METRICS

    rows = []
    for one in METRICS.values():
        if one.tolerance is not None:
            unit = "" if one.unit == "1" else f" {one.unit}"
            fraction = f" + {100 * one.tolerance.relative:g} %" if one.tolerance.relative else ""
            rows.append((code(one.name), one.better, f"{one.tolerance.absolute:g}{unit}{fraction}"))
    return table("metric, better, tolerance", rows)


def composition() -> list[str]:
    """Return the parts of drives of each kind, as `compose` chooses them."""
    from antdrive.sim.compose import compose
    from antdrive.sim.policy import Perception
    from antdrive.sim.scenario import Scenario

    kinds: dict[str, tuple[str, str, dict[str, Any]]] = {
        "mapped, no movers": ("forest", "astar", {}),
        "mapped, noise": ("forest", "astar", {"noise": 1.0}),
        "among movers": ("plaza-moving", "astar", {}),
        "movers by lidar": ("plaza-moving", "astar", {"perception": Perception(kind="lidar")}),
        "space-time planner": ("plaza-moving", "sipp", {}),
        "cell by cell": ("plaza-moving", "mmas-dstar", {}),
        "mapless": ("forest", "astar", {"robot": "jackal", "map": "none"}),
        "mapless, noise": ("forest", "astar", {"robot": "jackal", "map": "none", "noise": 1.0}),
        "mapless, odometry": ("forest", "astar", {"robot": "jackal", "map": "none", "localisation": "matching"}),
        "mapless among movers": ("plaza-moving", "astar", {"robot": "jackal", "map": "none"}),
    }

    def row(kind: str) -> Row:
        world, name, settings = kinds[kind]
        (_, localiser), guide, mind = compose(Scenario.of(world, name, **settings))
        rules = ", ".join(code(type(rule).__name__) for rule in mind.rules)
        return kind, *map(_class, (localiser, mind.scans, guide)), rules

    return table("drive, localiser, scans, guide, rules in order", map(row, kinds))


def _class(part: object) -> str:
    return "–" if part is None else code(type(part).__name__)


#: What writes each part, by its name.
GENERATED: dict[str, Callable[..., list[str]]] = {
    "arrays": arrays, "commands": commands, "composition": composition, "controllers": controllers,
    "counterparts": counterparts, "exit-codes": exit_codes, "keys": keys,
    "metrics": metrics, "outcomes": outcomes, "planner": planner, "planners": planners, "proofs": proofs, "record": record,
    "robots": robots, "tolerances": tolerances, "worlds": worlds,
}  # fmt: skip


def written(text: str) -> str:
    """Return a page with its generated parts as they should be."""

    def part(match: re.Match[str]) -> str:
        name, *words = match[2].split()
        lines = "\n".join(GENERATED[name](*words)).strip("\n")
        return f"{match[1]}\n{lines}\n\n{match[3]}"

    return PART.sub(part, text)


def pages() -> list[Path]:
    """Return the pages with generated parts."""
    found = [path for path in sorted(DOCS.rglob("*.md")) if not {"_build", "_gallery"} & set(path.parts)]
    return [path for path in found if PART.search(path.read_text(encoding="utf-8"))]


def listed() -> str:
    """Return the file with the rows of the command line's lists."""
    from antdrive.cli.commands.planners import planner_rows
    from antdrive.cli.commands.robots import robot_rows
    from antdrive.cli.commands.worlds import world_rows

    kinds = {"planners": planner_rows(), "worlds": world_rows(), "robots": robot_rows()}
    return "".join("\t".join((kind, *row)) + "\n" for kind, rows in kinds.items() for row in rows)


def stale() -> dict[Path, str]:
    """Return the files that differ from what this module generates, with their text as it should be."""
    wanted = {path: written(path.read_text(encoding="utf-8")) for path in pages()} | {LISTED: listed()}
    return {path: text for path, text in wanted.items() if path.read_text(encoding="utf-8") != text}


def main(words: list[str]) -> int:
    """Write or check the generated parts."""
    from antdrive.base.atomic import atomic_write

    parser = argparse.ArgumentParser(prog="python -m tools.reference", description="Generate parts of pages.")
    parser.add_argument("--check", action="store_true", help="write nothing, list pages that differ")
    check = parser.parse_args(words).check
    found = stale()
    for path, text in found.items():
        sys.stdout.write(f"{path.relative_to(ROOT)}{' differs' if check else ''}\n")
        if not check:
            with atomic_write(path) as temporary:
                temporary.write_text(text, encoding="utf-8")
    return 1 if check and found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
