"""Shared arguments and options of commands, and options generated from scenario settings.

Help texts state units, and defaults that typer cannot show.
"""

import dataclasses
import functools
import inspect
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from antdrive.base import guarded
from antdrive.base.errors import FieldError, InputError
from antdrive.cli import parse
from antdrive.sim.settings import SETTINGS, DeclaredSetting

if TYPE_CHECKING:
    from antdrive.sim.scenario import Scenario

Command = Callable[..., Any]
NONE: Mapping[str, str] = MappingProxyType({})


def argument(metavar: str, text: str) -> Any:
    """Declare a command's argument with its name and text in `--help`."""
    return typer.Argument(metavar=metavar, help=text)


def option(metavar: str, text: str, *flags: str, panel: str | None = None, **rest: Any) -> Any:
    """Declare a command's option: name of its value, text and panel in `--help`, and flags unless its name implies them."""
    return typer.Option(*flags, metavar=metavar or None, help=text, rich_help_panel=panel, **rest)


def flag(text: str, *flags: str, panel: str | None = None) -> Any:
    """Declare an option without a value."""
    return option("", text, *flags, panel=panel)


def with_settings(
    names: Iterable[str] = (), *, many: bool = False, usual: Mapping[str, str] = NONE, **defaults: Any
) -> Callable[[Command], Command]:
    """Return a decorator that adds scenario settings to a command as options.

    The command receives the settings by key, in the form of files. A parameter whose type is a record becomes one option per
    field.

    Args:
        names: scenario fields
        many: whether options may be repeated; the command then receives lists, and only options that were given
        usual: texts of defaults that other options decide, by field name; the command receives None
        defaults: by field name, where they differ from the scenario's
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
        flat += [_parameter(one, many, usual, defaults) for one in chosen.values()]
        called.__signature__ = own.replace(  # type: ignore[attr-defined]
            parameters=[one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in flat]
        )
        called.__annotations__ = {one.name: one.annotation for one in flat}
        return called

    return decorated


def with_plan_limit(command: Command) -> Command:
    """Add `--plan-limit` to a command. The limit holds for this process and the workers that it starts."""

    @functools.wraps(command)
    def called(*, plan_limit: str, **values: Any) -> Any:
        os.environ[guarded.LIMIT] = plan_limit
        guarded.plan_limit("--plan-limit")
        return command(**values)

    text = "Limit on the time of each plan and replan [s], or off."
    made = option("SECONDS", text, "--plan-limit", panel="Planner", envvar=guarded.LIMIT, show_envvar=False)
    own = [one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in inspect.signature(command).parameters.values()]
    own.append(
        inspect.Parameter(
            "plan_limit", inspect.Parameter.KEYWORD_ONLY, default=guarded.USUAL_LIMIT, annotation=Annotated[str, made]
        )
    )
    called.__signature__ = inspect.Signature(own)  # type: ignore[attr-defined]
    called.__annotations__ = {one.name: one.annotation for one in own}
    return called


def _fields(record: inspect.Parameter) -> list[inspect.Parameter]:
    """Return one parameter per field of a record, with the record's default values."""
    usual = record.annotation() if record.default is record.empty else record.default
    return [
        record.replace(name=one.name, annotation=one.type, default=getattr(usual, one.name))
        for one in dataclasses.fields(usual)
    ]


def _parameter(
    one: DeclaredSetting, many: bool, usual: Mapping[str, str], defaults: dict[str, Any]
) -> inspect.Parameter:
    """Return the typer parameter of a setting's option."""
    setting = one.setting
    text = setting.help[0].upper() + setting.help[1:]
    kind: Any = one.kind
    flags = one.flag
    default: Any = None
    if setting.form in ("avoidance", "replanning"):
        kind, default, flags, text = bool, True, f"{flags}/--no-{flags[2:]}", text.partition(": ")[0]
    elif setting.form == "margin":
        kind = str
    elif setting.form == "plain":
        default = None if one.name in usual else defaults.get(one.name, one.default)
    else:
        kind = list[str] if setting.form == "discs" else str
    if many:
        kind, default = list[kind], None
    repeated = " Repeatable." if many or setting.form == "discs" else ""
    text_of_default = usual.get(one.name, setting.usual)
    shown = f"  [default: {text_of_default}]" if text_of_default and not many else ""
    made = option(setting.metavar, f"{text}.{repeated}{shown}", flags, panel=setting.group)
    annotation: Any = Annotated[kind | None if default is None else kind, made]
    return inspect.Parameter(one.key, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def _value(one: DeclaredSetting, value: Any, many: bool) -> Any:
    """Convert an option's value to a setting's value as in files."""
    if one.setting.form == "discs":
        return [parse.disc(text) for text in value or ()]
    values = value if many else [value]
    if one.setting.form == "margin":
        values = [None if text is None else _margin(text) for text in values or ()]
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
        raise InputError(f"--margin {text}: must be a number of metres or auto") from None


World = Annotated[str, argument("WORLD", "World name or file.")]
Log = Annotated[Path, argument("ROLLOUT", "Log of a drive, or folder of a run.")]
Robot = Annotated[str, option("NAME", "Robot name or file.", panel="Robot")]
Planner = Annotated[str, option("NAME", "Planner name, FILE.py:CLASS or a plan's file.", panel="Planner")]
LogPlanner = Annotated[
    str | None, option("FILE.py:CLASS", "Class of the log's planner, if not registered, or its plan's file.")
]
LogController = Annotated[str | None, option("FILE.py:CLASS", "Class of the log's controller, if not registered.")]
Out = Annotated[Path | None, option("FOLDER", "Output folder.  [default: a folder in out/]", panel="Output")]
Figures = Annotated[
    str | None, option("FORMATS", "Figures for papers: png, pdf, svg, or several with commas.", panel="Output")
]
NoFigures = Annotated[bool, flag("Write no figures.", "--no-figures", panel="Output")]
NoView = Annotated[bool, flag("Do not write the page drive.html.", "--no-view", panel="Output")]
Jobs = Annotated[int | None, option("NUMBER", "Processes.  [default: one per core]", min=1, max=256)]
XacroArguments = Annotated[list[str] | None, option("NAME=VALUE", "Argument of a .xacro file. Repeatable.", "--arg")]
RosPackages = Annotated[
    list[str] | None,
    option(
        "NAME=FOLDER",
        "Folder of a ROS package. Repeatable.  [default: NAME beside or above FILE, or of ROS]",
        "--package",
    ),
]
Json = Annotated[bool, flag("Print a single JSON object on stdout.", "--json", panel="Output")]


@dataclasses.dataclass(frozen=True)
class Filming:
    """Options of a film."""

    prelude: Annotated[
        float,
        option("SECONDS", "Planning shown first [s]; needs an iterative planner.", panel="Output", min=0.0, max=60.0),
    ] = 0.0
    camera: Annotated[
        str | None,
        option("NAME", "View: oblique, top or follow.  [default: follow; oblique for several drives]", panel="Output"),
    ] = None
    size: Annotated[
        str | None, option("WIDTHxHEIGHT", "Picture size [px].", panel="Output", show_default="1280x720")
    ] = None
    speed: Annotated[float, option("FACTOR", "Playback speed.", panel="Output", min=0.01, max=100)] = 1.0

    def shape(self) -> dict[str, Any]:
        """Return camera and size, if given, as `film` takes them."""
        shape: dict[str, Any] = {} if self.size is None else {"size": parse.size(self.size)}
        return shape if self.camera is None else {**shape, "camera": self.camera}

    def checked(self, path: Path | None, scenarios: "Sequence[Scenario]", *, several: bool = False) -> dict[str, Any]:
        """Return the options as `film` takes them; raise `InputError` if they cannot hold for `--film PATH`."""
        from antdrive.views.film.film_options import FilmOptions
        from antdrive.views.run_folder import check_film

        for one in dataclasses.fields(self):
            if path is None and getattr(self, one.name) != one.default:
                raise InputError(f"--{one.name}: needs --film")
        FilmOptions(**self.shape()).checked(several=several)
        check_film(path, self.prelude, scenarios)
        return {**self.shape(), "speed": self.speed, "prelude": self.prelude}
