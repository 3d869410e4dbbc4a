"""Rebuild a driven scenario from the record of its log."""

from __future__ import annotations

import dataclasses
import math
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

from antdrive.base.errors import FieldError, InputError
from antdrive.planners import Planner, list_planners, load_planner
from antdrive.planners.user_code import is_user_code, record_name, user_object
from antdrive.robots import Avoidance, PurePursuit
from antdrive.sim.log.record import DriveRecord
from antdrive.sim.policy import Perception, ReplanPolicy
from antdrive.sim.scenario import Scenario
from antdrive.sim.settings import SETTINGS

Settings = TypeVar("Settings", PurePursuit, Avoidance, ReplanPolicy)


def rebuilt(record: DriveRecord, planner: Planner | str | None = None) -> Scenario:
    """Return the scenario of a log's record. With the same versions it gives the same drive, bit for bit.

    Args:
        record: the record of a log
        planner: the planner; FILE.py:CLASS or MODULE:CLASS: custom code with the record's settings; None: the registered
            planner of the record's name, with the record's settings

    Raises:
        InputError: the planner or controller cannot be found by its name, or has custom settings.
    """
    name = record.planner.name
    if isinstance(planner, str):
        planner = _own_planner(planner, name, record.planner.settings)
    elif planner is None:
        name, planner = _planner(name, record.planner.settings)
    if record.controller.name != PurePursuit.__name__:
        raise InputError(
            f"record.controller.name: {record.controller.name!r:.60} cannot be rebuilt; only PurePursuit can"
        )
    try:
        return Scenario(
            task=record.task, planner=planner, planner_name=name, robot=record.robot, **scenario_values(record)
        )
    except FieldError as error:
        raise InputError(str(error.under("record"))) from None


def scenario_values(record: DriveRecord) -> dict[str, Any]:
    """Return the settings of a record's scenario, by field.

    Args:
        record: the record of a log

    Raises:
        FieldError: a setting is unknown or invalid.
    """
    fields = {name: getattr(record, name) for name in SETTINGS if hasattr(record, name)}
    fields |= record.settings or {}
    if record.sensing is not None:
        fields |= dataclasses.asdict(record.sensing)
    fields["cell"] = record.asked_cell or record.cell
    fields["smoothing"] = record.smoothing.asked
    fields["controller"] = _settings(PurePursuit, record.controller.settings, "controller.settings")
    perception = record.perception
    if perception is None:
        del fields["perception"], fields["avoidance"]
    else:
        distance = math.inf if perception.range_m is None else perception.range_m
        fields["perception"] = Perception(kind=perception.kind, range=distance)  # type: ignore[arg-type]
        fields["avoidance"] = _settings(Avoidance, record.avoidance, "avoidance")
    if perception is None and record.sensing is None:
        del fields["replanning"]
    else:
        fields["replanning"] = _settings(ReplanPolicy, record.replanning, "replanning")
    return fields


def _planner(name: str, settings: Mapping[str, Any]) -> tuple[str, Planner]:
    """Return the registered name and the planner of a record's name, which may be that of its class."""
    known = list_planners()
    if name not in known:
        of_class = [key for key, planner in known.items() if type(planner).__name__ == name]
        if not of_class:
            raise InputError(
                f"record.planner.name: {name!r:.60} is not registered, so the run cannot be rebuilt; name its class "
                f"(--planner FILE.py:CLASS), or register it under the entry point antdrive.planners"
            )
        name = of_class[0]
    return name, load_planner(name, **_options(type(known[name]), settings))


def _own_planner(words: str, name: str, settings: Mapping[str, Any]) -> Planner:
    """Return the custom planner that a record names by its class."""
    if record_name(words) not in (words, name):
        raise InputError(f"planner: the log's planner is {name!r:.60}, not {record_name(words)!r:.60}")
    if not is_user_code(words):
        raise InputError(
            f"planner: write FILE.py:CLASS or MODULE:CLASS, got {words!r:.60}; omit it for registered planners"
        )
    return load_planner(words, **_options(user_object(words), settings))


def _options(kind: Any, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return a planner's recorded options."""
    hints = typing.get_type_hints(kind)
    return {key: _restored(hints.get(key), value) for key, value in settings.items()}


def _settings(kind: type[Settings], values: Mapping[str, Any] | None, key: str) -> Settings | None:
    """Return a record of settings, with infinite numbers restored from null."""
    if values is None:
        return None
    fields = {field.name: field for field in dataclasses.fields(kind)}
    for name in values:
        if name not in fields:
            raise FieldError(f"{key}.{name}", f"unknown; choose from {', '.join(fields)}")
    hints = typing.get_type_hints(kind)
    return kind(**{name: _restored(hints[name], value) for name, value in values.items()})


def _restored(hint: Any, value: Any) -> Any:
    """Restore a setting: null means infinity if the field is a number."""
    return math.inf if value is None and hint is float else value
