"""The arguments and options that several commands share, and an option for each setting of a scenario.

Each help text states the unit, and the default where typer cannot show it.
"""

import dataclasses
import functools
import inspect
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from antdrive.base.errors import FieldError, InputError
from antdrive.cli.parse import disc
from antdrive.sim.settings import SETTINGS, DeclaredSetting

Command = Callable[..., Any]


def argument(metavar: str, text: str) -> Any:
    """A command's argument: what `--help` calls it and says of it."""
    return typer.Argument(metavar=metavar, help=text)


def option(metavar: str, text: str, *flags: str, panel: str | None = None, **rest: Any) -> Any:
    """A command's option: what `--help` calls its value, says of it and where; its flags, where its name gives others."""
    return typer.Option(*flags, metavar=metavar or None, help=text, rich_help_panel=panel, **rest)


def flag(text: str, *flags: str, panel: str | None = None) -> Any:
    """An option without a value."""
    return option("", text, *flags, panel=panel)


def with_settings(names: Iterable[str] = (), *, many: bool = False, **defaults: Any) -> Callable[[Command], Command]:
    """Give a command an option for each of these settings, whose values it takes by key, as files write them.

    A parameter whose type is a record stands for an option for each of its fields.

    Args:
        names: fields of a scenario
        many: whether the options may be repeated; the command takes lists, and none of what is not given
        defaults: by name, where they are not those of a scenario
    """
    chosen = {SETTINGS[name].key: SETTINGS[name] for name in names}

    def decorated(command: Command) -> Command:
        own = inspect.signature(command)
        parameters = [one for one in own.parameters.values() if one.kind is not inspect.Parameter.VAR_KEYWORD]
        records = {one.name: _fields(one) for one in parameters if dataclasses.is_dataclass(one.annotation)}

        @functools.wraps(command)
        def called(**values: Any) -> Any:
            given = {key: _value(one, values.pop(key), many) for key, one in chosen.items()}
            for name, fields in records.items():
                record = own.parameters[name].annotation
                values[name] = record(**{one.name: values.pop(one.name) for one in fields})
            return command(**values, **{key: value for key, value in given.items() if not many or value})

        flat = [one for each in parameters for one in records.get(each.name, [each])]
        flat += [_parameter(one, many, defaults) for one in chosen.values()]
        called.__signature__ = own.replace(  # type: ignore[attr-defined]
            parameters=[one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in flat]
        )
        called.__annotations__ = {one.name: one.annotation for one in flat}
        return called

    return decorated


def _fields(record: inspect.Parameter) -> list[inspect.Parameter]:
    """A parameter for each field of a record; what the record is by default gives their defaults."""
    usual = record.annotation() if record.default is record.empty else record.default
    return [
        record.replace(name=one.name, annotation=one.type, default=getattr(usual, one.name))
        for one in dataclasses.fields(usual)
    ]


def _parameter(one: DeclaredSetting, many: bool, defaults: dict[str, Any]) -> inspect.Parameter:
    """The parameter of a command that typer makes a setting's option of."""
    setting = one.setting
    text = setting.help[0].upper() + setting.help[1:]
    kind: Any = one.kind
    flags = one.flag
    default: Any = None
    if setting.form in ("avoidance", "replanning"):
        kind, default, flags, text = bool, True, f"{flags}/--no-{flags[2:]}", text.partition(": ")[0]
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
    made = option(setting.metavar, f"{text}.{repeated}{usual}", flags, panel=setting.group)
    annotation: Any = Annotated[kind | None if default is None else kind, made]
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


World = Annotated[str, argument("WORLD", "Name of a world in the catalogue, or a world file.")]
Log = Annotated[Path, argument("ROLLOUT", "Log of a drive, or the folder of a run.")]
Robot = Annotated[str, option("NAME", "Name of a robot in the catalogue, or a robot file.", panel="Robot")]
Planner = Annotated[str, option("NAME", "Planner, or FILE.py:CLASS; `antdrive planners` lists names.", panel="Planner")]
Out = Annotated[
    Path | None, option("FOLDER", "Folder for the results.  [default: a folder below out/]", panel="Output")
]
Prelude = Annotated[
    float,
    option(
        "SECONDS",
        "Begin the film with this many seconds of planning [s]; needs a planner with iterations.",
        panel="Output",
        min=0.0,
        max=60.0,
    ),
]
Speed = Annotated[
    float, option("FACTOR", "Speed of the film; 2 is twice as fast as real time.", panel="Output", min=0.01, max=100)
]
Vector = Annotated[bool, flag("Write figures as PDF too.", "--vector", panel="Output")]
Figures = Annotated[bool, flag("Write figures.", "--figures/--no-figures", panel="Output")]
Jobs = Annotated[int | None, option("NUMBER", "Processes.  [default: one per core]", min=1, max=256)]
Json = Annotated[bool, flag("Print one JSON object on stdout and nothing else.", "--json", panel="Output")]
