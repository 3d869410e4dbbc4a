"""The arguments and options that several commands share, and an option for each setting of a scenario.

Each help text states the unit, and the default where typer cannot show it.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from antdrive.base.errors import FieldError, InputError
from antdrive.cli.parse import disc
from antdrive.sim.settings import SETTINGS, DeclaredSetting

Command = Callable[..., int]


def with_settings(names: Iterable[str], *, many: bool = False, **defaults: Any) -> Callable[[Command], Command]:
    """Give a command an option for each of these settings, whose values it takes by key, as files write them.

    Args:
        names: fields of a scenario
        many: whether the options may be repeated; the command takes lists, and none of what is not given
        defaults: by name, where they are not those of a scenario
    """
    chosen = {SETTINGS[name].key: SETTINGS[name] for name in names}

    def decorated(command: Command) -> Command:
        @functools.wraps(command)
        def called(**values: Any) -> int:
            given = {key: _value(one, values.pop(key), many) for key, one in chosen.items()}
            return command(**values, **{key: value for key, value in given.items() if not many or value})

        own = inspect.signature(command)
        parameters = [one for one in own.parameters.values() if one.kind is not inspect.Parameter.VAR_KEYWORD]
        parameters += [_parameter(one, many, defaults) for one in chosen.values()]
        called.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
        called.__annotations__ = {one.name: one.annotation for one in parameters}
        return called

    return decorated


def _parameter(one: DeclaredSetting, many: bool, defaults: dict[str, Any]) -> inspect.Parameter:
    """The parameter of a command that typer makes a setting's option of."""
    setting = one.setting
    text = setting.help[0].upper() + setting.help[1:]
    kind: Any = one.kind
    flag = one.flag
    default: Any = None
    if setting.form in ("avoidance", "replanning"):
        kind, default, flag, text = bool, True, f"{flag}/--no-{flag[2:]}", text.partition(": ")[0]
    elif setting.form == "margin":
        kind, default = str, str(one.default)
    elif setting.form == "plain":
        default = defaults.get(one.name, one.default)
    else:
        kind = list[str] if setting.form == "discs" else str
    if many:
        kind, default = list[kind], None
    repeated = " May be repeated." if many or setting.form == "discs" else ""
    usual = f"  [default: {setting.usual}]" if setting.usual and not many else ""
    option = typer.Option(
        flag, metavar=setting.metavar or None, help=f"{text}.{repeated}{usual}", rich_help_panel=setting.group
    )
    annotation: Any = Annotated[kind | None if default is None else kind, option]
    return inspect.Parameter(one.key, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def _value(one: DeclaredSetting, value: Any, many: bool) -> Any:
    """A setting as files write it, from what an option gives."""
    if one.setting.form == "discs":
        return [disc(text) for text in value or ()]
    values = value if many else [value]
    if one.setting.form == "margin":
        values = [_margin(text) for text in values or ()]
    for each in values or ():
        try:
            if each not in (None, "auto"):
                one.check(each)
        except FieldError as error:
            raise InputError(f"{one.flag}: {error.problem}") from None
    return values if many else values[0]


def _margin(text: str) -> float | str:
    try:
        return text if text == "auto" else float(text)
    except ValueError:
        raise InputError(f"--margin: write a number of metres, or auto; got {text}") from None


World = Annotated[str, typer.Argument(metavar="WORLD", help="Name of a world in the catalogue, or a world file.")]
TaskName = Annotated[
    str | None,
    typer.Option(
        "--task",
        metavar="NAME",
        help="One of the world file's tasks.  [default: its own start and goal]",
        rich_help_panel="World",
    ),
]
Start = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y,YAW",
        help="Another start, in the frame of the world file [m, m, rad].  [default: the task's]",
        rich_help_panel="World",
    ),
]
Goal = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y",
        help="Another goal, in the frame of the world file [m].  [default: the task's]",
        rich_help_panel="World",
    ),
]
Frame = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="world, or map: --start and --goal are places in the map that the world was made from, as exports have them.",
        rich_help_panel="World",
    ),
]
Planner = Annotated[
    str,
    typer.Option(
        "--planner",
        "-p",
        metavar="NAME",
        help="Planner, or FILE.py:CLASS; `antdrive planners` lists names.",
        rich_help_panel="Planner",
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        "-s",
        metavar="GROUP.KEY=VALUE",
        help="Set an option of the planner or the controller, such as planner.ants=50 or "
        "controller.lookahead_time=0.5. May be repeated.",
        rich_help_panel="Planner",
    ),
]
Robot = Annotated[
    str,
    typer.Option(
        "--robot",
        "-r",
        metavar="NAME",
        help="Name of a robot in the catalogue, or a robot file.",
        rich_help_panel="Robot",
    ),
]
Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        "-o",
        metavar="FOLDER",
        help="Folder for the results.  [default: a folder below out/]",
        rich_help_panel="Output",
    ),
]
Prelude = Annotated[
    float,
    typer.Option(
        "--prelude",
        min=0.0,
        max=60.0,
        metavar="SECONDS",
        help="Begin the film with this many seconds of planning [s]; needs a planner with iterations.",
        rich_help_panel="Output",
    ),
]
Speed = Annotated[
    float,
    typer.Option(
        min=0.01,
        max=100,
        metavar="FACTOR",
        help="Speed of the film; 2 is twice as fast as real time.",
        rich_help_panel="Output",
    ),
]
Vector = Annotated[bool, typer.Option("--vector", help="Write figures as PDF too.", rich_help_panel="Output")]
Figures = Annotated[bool, typer.Option("--figures/--no-figures", help="Write figures.", rich_help_panel="Output")]
Jobs = Annotated[
    int | None,
    typer.Option("--jobs", "-j", min=1, max=256, metavar="NUMBER", help="Processes.  [default: one per core]"),
]
Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else.", rich_help_panel="Output")
]
