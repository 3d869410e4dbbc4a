"""The scenario of a log's record: in words, as a command, and built again."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from antdrive.base.errors import FieldError, InputError
from antdrive.base.user_code import is_user_code, record_name
from antdrive.planners import PLANNERS, Planner, load_planner
from antdrive.planners.registry import REGISTRY, registered_name
from antdrive.robots.robot_file import list_robots
from antdrive.sim.forms import USUAL_CONTROLLER, name_and_options, require_settings, scenario_fields, written
from antdrive.sim.log.record import FROM_OUTSIDE, DriveRecord, settings_of
from antdrive.sim.settings import SETTINGS
from antdrive.sim.written import Written, named_planner, named_robot, named_task
from antdrive.worlds import list_worlds

if TYPE_CHECKING:
    from antdrive.robots import Controller
    from antdrive.sim.scenario import Scenario


def built_in_controller(name: str) -> str | None:
    """Return the name of a record's built-in controller; None for others. Names besides `PurePursuit` load the compiler."""
    if name == "PurePursuit":
        return USUAL_CONTROLLER
    from antdrive.robots import CONTROLLERS

    return name if name in CONTROLLERS else None


def controller_name(settings: Mapping[str, Any]) -> str:
    """Return the name of the controller in settings as files write them."""
    return str(name_and_options(settings.get("controller"))[0])


def written_of(record: DriveRecord) -> Written:
    """Return the scenario of a log as written; settings of logs without it are those that were in force.

    Raises:
        FieldError: what the record holds as written is no scenario.
    """
    if record.written is not None:
        words = Written.read(record.written)
        require_settings(words.settings)
        return words
    name = record.planner.name
    parts = (
        named_task(record.task, name) | named_planner(record.planner.settings, name) | named_robot(record.robot, name)
    )
    return Written(**parts, settings=_settings_in_force(record), seed=record.seed)


def command_of(record: DriveRecord) -> str | None:
    """Return the `antdrive run` command of a log's scenario; None if a setting has no option, or a word is false."""
    try:
        return None if any(false_words(record, settings=True)) else written_of(record).command()
    except (FieldError, InputError):
        return None


def command_in(record: DriveRecord) -> str:
    """Return the `antdrive run` command that a log's written scenario means, unchecked; empty if there is none."""
    try:
        return written_of(record).command() or ""
    except (FieldError, InputError):
        return ""


def false_words(record: DriveRecord, *, settings: bool = False) -> Iterator[str]:
    """Yield a sentence for every word in a log's written scenario that its record contradicts.

    Neither files nor a user's code are read: what they hold is unknown.

    Args:
        record: the record of a log
        settings: whether to compare settings and options too, whose defaults load the compiler; else names, places and seed
    """
    if record.written is not None:
        try:
            words = written_of(record)
            keys = [*_contradicted_names(record, words), *(_contradicted_settings(record, words) if settings else ())]
        except (FieldError, InputError) as error:
            yield str(FieldError(error.key, error.problem).under("record.written"))
            return
        yield from (f"record.written.{key}: contradicts the rest of the record" for key in keys)


def _contradicted_names(record: DriveRecord, words: Written) -> Iterator[str]:
    task = record.task
    recorded: dict[str, Any] = {"world": task.world.name, "start": task.start, "goal": task.goal}
    recorded |= {"planner": record.planner.name, "robot": record.robot.name, "seed": record.seed}
    given: dict[str, Any] = {"planner": record_name(words.planner), "seed": words.seed}
    given |= {key: tuple(getattr(words, key)) for key in ("start", "goal") if getattr(words, key) is not None}
    if not isinstance(words.world, str):
        given["world"] = f"{words.world['generate']}-{words.world.get('seed', 0)}"
    elif words.world in list_worlds():
        known = words.load_task()
        given |= {"world": known.world.name, "start": known.start, "goal": known.goal}
    if words.robot in list_robots():
        given["robot"] = words.robot
    yield from (key for key, value in given.items() if value != recorded[key])


def _contradicted_settings(record: DriveRecord, words: Written) -> Iterator[str]:
    """Yield the key of every contradicted option and setting; those that act on movers alone may differ without any."""
    options, settings = words.options, words.settings
    if words.planner in PLANNERS:
        options = settings_of(load_planner(words.planner, **options))
    yield from (f"planner.{key}" for key, value in record.planner.settings.items() if options.get(key, value) != value)
    if record.controller.name == FROM_OUTSIDE:
        return
    if built_in_controller(record.controller.name) is None or is_user_code(controller_name(settings)):
        if record_name(controller_name(settings)) != record.controller.name:
            yield "controller"
        return
    chosen = settings.get("margin") == "auto" and record.margin_choice is not None
    fields = scenario_fields({key: value for key, value in settings.items() if key != "margin" or not chosen})
    given, in_force = written(fields.__getitem__), _settings_in_force(record)
    unknown = {"seed"} | {key for key in ("margin", "cell", "time_limit", "sees") if key not in given}  # resolved
    if record.perception is None or record.perception.kind == "motions":
        unknown |= {"sees", "avoid"}
    if record.perception is None and not record.mapless:
        unknown.add("replan")
    keys = (one.key for one in SETTINGS.values())
    yield from (key for key in keys if key not in unknown and given.get(key) != in_force.get(key))


def rebuilt(
    record: DriveRecord, planner: Planner | str | None = None, controller: Controller | str | None = None
) -> Scenario:
    """Return the scenario of a log's record. With the same versions it gives the same drive, bit for bit.

    Args:
        record: the record of a log
        planner: the planner; FILE.py:CLASS or MODULE:CLASS: custom code with the record's settings; None: the planner of
            the record's name, with the record's settings
        controller: the controller, likewise

    Raises:
        InputError: the planner or controller cannot be found by its name, or has custom settings.
    """
    from antdrive.robots.controllers.registry import REGISTRY as CONTROLLER_REGISTRY
    from antdrive.sim.scenario import Scenario

    if planner is None and record.planner.settings.keys() == {"digest"}:
        planner = written_of(record).planner  # the file of a plan
    name = record.planner.name if planner is not None else registered_name(record.planner.name)
    made: dict[str, Any] = {"task": record.task, "robot": record.robot, "planner_name": name}
    made["planner"] = REGISTRY.of_record(record.planner.name, record.planner.settings, planner)
    if record.controller.name == FROM_OUTSIDE:
        raise InputError("record.controller: a loop of its own commanded this drive, so only that loop can repeat it")
    try:
        known = record.controller
        made["controller"] = CONTROLLER_REGISTRY.of_record(known.name, known.settings, controller)
        settings = _settings_in_force(record)
    except (FieldError, InputError) as error:
        raise InputError(str(FieldError(error.key, error.problem).under("record"))) from None
    word = planner if isinstance(planner, str) else name if planner is None else ""
    words = Written(
        world="", planner=word, options=record.planner.settings, settings=settings, seed=record.seed,
    )  # fmt: skip

    def at(key: str, problem: str) -> InputError:
        return FieldError(key if key.startswith("planner") else f"record.{key}", problem).as_input()

    return Scenario.read(words, at=at, **made)


def _settings_in_force(record: DriveRecord) -> dict[str, Any]:
    """Return the settings of a log's record that differ from the defaults, by key.

    Raises:
        FieldError: a setting is unknown or invalid.
    """
    plain = ("noise", "margin", "time_limit", "physics_hz", "control_hz", "unseen")
    given: dict[str, Any] = {name: getattr(record, name) for name in plain}
    given |= {SETTINGS[name].key: value for name, value in (record.settings or {}).items()}
    given |= {"smoothing": record.smoothing.asked, "cell": record.asked_cell or record.cell}
    if (name := built_in_controller(record.controller.name)) is not None:
        given["controller"] = {"name": name, **record.controller.settings}
    if record.sensing is not None:
        given |= dataclasses.asdict(record.sensing)
    switched = {"avoid": record.avoidance} if record.perception is not None else {}
    if record.perception is not None:
        reach = record.perception.range_m
        given["sees"] = record.perception.kind + ("" if reach is None else f":{reach!r}")
    if record.perception is not None or record.sensing is not None:
        switched["replan"] = record.replanning
    given |= {key: "none" if value is None else dict(value) for key, value in switched.items()}
    fields = scenario_fields(given)
    return {key: value for key, value in written(fields.__getitem__).items() if key != "seed"}
