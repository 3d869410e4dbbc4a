"""Forms of scenario settings: values in files, command options, and table columns."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, get_args

from pydantic import BaseModel, Field, PlainValidator, TypeAdapter, ValidationError, WithJsonSchema

from antdrive.base.checks import show, suggest
from antdrive.base.errors import FieldError
from antdrive.base.user_code import record_name
from antdrive.sim.log.record import changes, plain_value, settings_of
from antdrive.sim.policy import Perception, PerceptionKind, ReplanPolicy
from antdrive.sim.settings import SETTINGS, DeclaredSetting
from antdrive.worlds import Disc

MAX_SEEDS = 100_000  # in one range
USUAL_CONTROLLER = "pure-pursuit"  # its options alone name it, as in older files
_SEEDS = re.compile(r"(\d{1,18})-(\d{1,18})")


def _text_or_mapping(value: Any) -> Any:
    if not isinstance(value, str | dict) or not value:
        raise ValueError(f"must be a name or a mapping, got {show(value)}")
    return value


def _name_or_options(value: Any) -> Any:
    if not isinstance(value, str | dict) or value == "":
        raise ValueError(f"must be a name or a mapping of options, got {show(value)}")
    return value


def _margin(value: Any) -> Any:
    if value not in (None, "auto") and (isinstance(value, bool) or not isinstance(value, int | float)):
        raise ValueError(f"must be a number of metres, auto, or null for the default, got {show(value)}")
    return value


def _switch(value: Any) -> Any:
    if not isinstance(value, bool | dict) and value != "none":
        raise ValueError(f"must be true, false, none or a mapping of settings, got {show(value)}")
    return value


def seed_list(value: Any) -> list[int]:
    """Return the seeds written as [0, 1, 2] or 0-9."""
    if isinstance(value, str) and (match := _SEEDS.fullmatch(value)):
        first, last = int(match[1]), int(match[2])
        if first <= last < first + MAX_SEEDS:
            return list(range(first, last + 1))
    seeds = value if isinstance(value, list) else []
    if not seeds or not all(type(seed) is int and 0 <= seed < 2**63 for seed in seeds):
        raise ValueError(
            f"must be whole numbers of at least 0, such as [0, 1, 2], or a range such as 0-9, got {show(value)}"
        )
    if len(set(seeds)) < len(seeds):
        raise ValueError(f"must be different numbers, got {show(value)}")
    return seeds


_SWITCH_SCHEMA: dict[str, Any] = {"anyOf": [{"type": "boolean"}, {"const": "none"}, {"type": "object"}]}
_MARGIN_SCHEMA: dict[str, Any] = {"anyOf": [{"type": "number", "minimum": 0}, {"const": "auto"}, {"type": "null"}]}
_NAME_OR_MAPPING: dict[str, Any] = {"anyOf": [{"type": "string"}, {"type": "object"}]}
SEEDS_SCHEMA: dict[str, Any] = {
    "anyOf": [
        {"type": "array", "items": {"type": "integer", "minimum": 0}, "minItems": 1, "uniqueItems": True},
        {"type": "string", "pattern": f"^{_SEEDS.pattern}$"},
    ]
}
TextOrMapping = Annotated[Any, PlainValidator(_text_or_mapping), WithJsonSchema(_NAME_OR_MAPPING)]
SeedList = Annotated[Any, PlainValidator(seed_list), WithJsonSchema(SEEDS_SCHEMA)]
Switch = Annotated[Any, PlainValidator(_switch), WithJsonSchema(_SWITCH_SCHEMA)]
ControllerValue = Annotated[Any, PlainValidator(_name_or_options), WithJsonSchema(_NAME_OR_MAPPING)]
MarginValue = Annotated[Any, PlainValidator(_margin), WithJsonSchema(_MARGIN_SCHEMA)]


@dataclasses.dataclass(frozen=True)
class Form:
    """Form of numbers and words, written unchanged."""

    written: Any = None  # pydantic type of a file's value; None: the field's own type and bounds
    usual: Any = None  # the file's value for the default; None: the default itself

    def read(self, key: str, value: Any, home: Path | None = None) -> Any:
        """Return the field's value for a file's value; `home` is the folder of user code."""
        return value

    def write(self, value: Any) -> Any:
        """Return the file's value for the field's value."""
        return plain_value(value)

    def column(self, value: Any) -> Any:
        """Return the table's value."""
        return value

    def words(self, flag: str, value: Any) -> list[str] | None:
        """Return the options of `antdrive run` for a file's value; None if it has none."""
        return [] if value is None else [flag, word_text(value)] if flag else None


class _Margin(Form):
    def column(self, value: Any) -> Any:
        return "default" if value is None else value if value == "auto" else str(float(value))


class _Sees(Form):
    def read(self, key: str, value: Any, home: Path | None = None) -> Perception | None:
        if value is None:
            return None
        kind, mark, metres = value.partition(":")
        if kind not in get_args(PerceptionKind):
            raise FieldError(key, f"unknown kind {kind!r}; choose from {', '.join(get_args(PerceptionKind))}")
        try:
            reach = float(metres) if mark else math.inf
        except ValueError:
            reach = math.nan
        if not reach > 0:
            raise FieldError(key, "write KIND or KIND:METRES with a range greater than 0, such as positions:3")
        return Perception(kind=kind, range=reach)

    def write(self, value: Any) -> Any:
        return None if value is None else value.kind + ("" if math.isinf(value.range) else f":{value.range!r}")

    def column(self, value: Any) -> Any:
        return None if value is None else value.kind + ("" if math.isinf(value.range) else f":{value.range:g}")


class _Discs(Form):
    def read(self, key: str, value: Any, home: Path | None = None) -> tuple[Disc, ...]:
        return tuple(Disc(**disc) if isinstance(disc, dict) else disc for disc in value)

    def write(self, value: Any) -> Any:
        return [{name: float(number) for name, number in dataclasses.asdict(disc).items()} for disc in value]

    def column(self, value: Any) -> Any:
        return " ".join(f"{disc.x:g},{disc.y:g},{disc.radius:g}" for disc in value) or "none"

    def words(self, flag: str, value: Any) -> list[str] | None:
        discs = [disc if isinstance(disc, dict) else vars(disc) for disc in value]
        if any(disc.get("height", 1.0) != 1.0 for disc in discs):
            return None
        return [word for disc in discs for word in (flag, f"{disc['x']},{disc['y']},{disc['radius']}")]


@dataclasses.dataclass(frozen=True)
class _Record(Form):
    """Form of a settings record: the differences from its defaults."""

    name: str = ""

    @property
    def default(self) -> Any:
        """The default record, created on request because it may load a compiler."""
        return SETTINGS[self.name].default

    def read(self, key: str, value: Any, home: Path | None = None) -> Any:
        if not isinstance(value, dict):
            return self.default
        known = [field.name for field in dataclasses.fields(self.default)]
        for name in value:
            if name not in known:
                raise FieldError(f"{key}.{name}", f"unknown setting; {suggest(name, known)}")
        try:
            return dataclasses.replace(self.default, **value)
        except FieldError as error:
            raise error.under(key) from None
        except TypeError:
            wrong = next((name for name, one in value.items() if not isinstance(one, int | float)), "")
            raise FieldError(f"{key}.{wrong}" if wrong else key, "must be a number") from None

    def write(self, value: Any) -> Any:
        return changes(value, self.default)

    def column(self, value: Any) -> Any:
        if value is None:
            return "none"
        return (
            " ".join(f"{name}={option_text(one)}" for name, one in settings_of(changes(value, self.default)).items())
            or "default"
        )


class _Controller(Form):
    """Form of a controller: its name, a mapping {name: NAME} with options, or the options of pure pursuit alone."""

    def read(self, key: str, value: Any, home: Path | None = None) -> Any:
        from antdrive.robots import load_controller

        name, options = name_and_options(value)
        if not isinstance(name, str):
            raise FieldError(f"{key}.name", f"must be a name, or FILE.py:CLASS or MODULE:CLASS, got {show(name)}")
        return load_controller(name, home, **options)

    def write(self, value: Any) -> Any:
        name, changed = controller_words(value)
        if name == USUAL_CONTROLLER:
            return changed
        return {"name": name, **changed} if changed else name

    def column(self, value: Any) -> Any:
        name, changed = controller_words(value)
        options = [f"{key}={option_text(one)}" for key, one in settings_of(changed).items()]
        return " ".join([*([] if name == USUAL_CONTROLLER else [record_name(name)]), *options]) or "default"

    def words(self, flag: str, value: Any) -> list[str] | None:
        name, options = name_and_options(value)
        given = [word for key, one in options.items() for word in ("--set", f"controller.{key}={option_text(one)}")]
        return [*([] if name == USUAL_CONTROLLER else [flag, name]), *given]


def name_and_options(value: Any) -> tuple[Any, dict[str, Any]]:
    """Return the name and the options of a controller.

    Args:
        value: the controller as files write it; None: the default
    """
    if isinstance(value, str):
        return value, {}
    options = dict(value or {})
    return options.pop("name", USUAL_CONTROLLER), options


def controller_words(controller: Any) -> tuple[str, dict[str, Any]]:
    """Return the name that loads a controller, and its options that differ from the defaults.

    Args:
        controller: the controller
    """
    from antdrive.robots.controllers.registry import REGISTRY

    name, record = REGISTRY.word_of(controller), dataclasses.is_dataclass(controller)
    return name, changes(controller, REGISTRY.all().get(name) or type(controller)()) if record else {}


@dataclasses.dataclass(frozen=True)
class _Switched(_Record):
    """Form of a settings record that can be switched off: by none or false, or by a record `off` for false."""

    off: Any = None

    def read(self, key: str, value: Any, home: Path | None = None) -> Any:
        return None if value == "none" else self.off if value is False else super().read(key, value)

    def write(self, value: Any) -> Any:
        return "none" if value is None else False if value == self.off else super().write(value) or True

    def words(self, flag: str, value: Any) -> list[str] | None:
        if isinstance(value, dict) or (value == "none" and self.off is not None):
            return None
        return [] if value is True else [f"--no-{flag.removeprefix('--')}"]


#: Forms by name.
FORMS: Mapping[str, Form] = {
    "plain": Form(),
    "margin": _Margin(MarginValue),
    "perception": _Sees(str | None),
    "discs": _Discs(list[Disc], []),
    "controller": _Controller(ControllerValue, {}),
    "avoidance": _Switched(Switch, True, "avoidance"),
    "replanning": _Switched(Switch, True, "replanning", ReplanPolicy(around_movers=False)),
}


def form_of(one: DeclaredSetting) -> Form:
    """Return the form of a setting."""
    return FORMS[one.setting.form]


def option_text(value: Any) -> str:
    """Format a value for the command line."""
    if isinstance(value, list):
        return ",".join(map(option_text, value))
    return str(value).lower() if isinstance(value, bool) else str(value)


def word_text(value: Any) -> str:
    """Format a value as the shortest word of a command."""
    if isinstance(value, list):
        return ",".join(map(word_text, value))
    return str(int(value)) if isinstance(value, float) and value.is_integer() else option_text(value)


def file_fields(settings: Iterable[DeclaredSetting]) -> dict[str, Any]:
    """Return the fields of a pydantic model for a file with settings, by key."""
    return {one.key: (written_kind(one), written_default(one)) for one in settings}


def written_kind(one: DeclaredSetting) -> Any:
    """Return the pydantic type of a setting in a file."""
    form = form_of(one)
    if form.written is not None:
        return form.written
    kind = Annotated[(one.kind, *one.bounds)] if one.bounds else one.kind
    return kind | None if one.optional else kind


def written_default(one: DeclaredSetting) -> Any:
    """Return the default of a setting in a file, with its description."""
    usual = form_of(one).usual
    default = one.default if usual is None else usual
    text = one.setting.help + (f"; by default {one.setting.usual}" if one.setting.usual else "")
    return Field(default, description=text)


def scenario_fields(given: Mapping[str, Any], home: Path | None = None) -> dict[str, Any]:
    """Return a scenario's fields for the values of a file, by name; defaults for the rest.

    Args:
        given: the values by key
        home: folder of user code; None: the working directory
    """
    return {
        one.name: form_of(one).read(one.key, given[one.key], home) if one.key in given else one.default
        for one in SETTINGS.values()
    }


def given_settings(entry: BaseModel) -> dict[str, Any]:
    """Return the settings that a file gives, by key."""
    keys = {one.key for one in SETTINGS.values()} & entry.model_fields_set
    return {one.key: getattr(entry, one.key) for one in SETTINGS.values() if one.key in keys}


def require_settings(given: Mapping[str, Any]) -> None:
    """Raise FieldError for a value, by key, that no file may hold."""
    for one in SETTINGS.values():
        if one.key in given:
            try:
                TypeAdapter(written_kind(one)).validate_json(json.dumps(given[one.key]), strict=True)
            except ValidationError as error:
                raise FieldError(one.key, error.errors(include_url=False)[0]["msg"]) from None


def setting_words(given: Mapping[str, Any]) -> list[str] | None:
    """Return the options of `antdrive run` for values of files; None if a value has no option."""
    words: list[str] = []
    for one in SETTINGS.values():
        if one.key not in given or (not one.flag and given[one.key] == one.default):
            continue
        more = form_of(one).words(one.flag, given[one.key])
        if more is None:
            return None
        words += more
    return words


def written(values: Callable[[str], Any]) -> dict[str, Any]:
    """Return the settings that differ from their defaults, as files write them, by key; `values` maps fields to values."""
    differing = (one for one in SETTINGS.values() if values(one.name) != one.default)
    return {one.key: form_of(one).write(values(one.name)) for one in differing}


def columns_of(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table's values of a scenario's fields, by column."""
    return {one.column: form_of(one).column(fields[one.name]) for one in SETTINGS.values() if one.name in fields}
