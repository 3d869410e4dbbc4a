"""Campaigns in words, as on a command line: forest:20, as.ants=10..50..20, seeds 0-9, tasks 30:5."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from antdrive.base.checks import grouped
from antdrive.base.errors import InputError
from antdrive.base.user_code import file_and_rest, record_name
from antdrive.robots import list_robots
from antdrive.runs.campaigns.campaign import Campaign, load_campaign, make_campaign
from antdrive.sim.forms import USUAL_CONTROLLER
from antdrive.sim.settings import SETTINGS
from antdrive.worlds import list_worlds

#: Option of each campaign key, for error messages.
OPTIONS = {one.key: one.flag for one in SETTINGS.values() if one.flag} | {
    "planners": "--planner",
    "robots": "--robot",
    "seeds": "--seeds",
}
CONTROLLER = "controller"  # its key, and group of `--set`
SOURCE = "the options"  # name of a campaign without a file in error messages


def campaign_from(path: Path | None, settings: Mapping[str, Any], **words: Any) -> Campaign:
    """Load a campaign from a file, from words, or from a file with words that override its keys.

    Args:
        path: the campaign file; None: the words name worlds and planners
        settings: settings by key, as in files
        words: `worlds`, `generate`, `planners`, `options` (theirs), `robots`, `seeds`, `tasks` and `run_limit`

    Raises:
        InputError: a word or the file is invalid; the message names the option.
    """
    given = _keys(words, settings)
    if path is not None and not given:
        return load_campaign(path)
    if path is None:
        for key, option in (("worlds", "--world"), ("planners", "--planner")):
            if key not in given:
                raise InputError(f"{option}: missing; name a campaign file, or a world and a planner")
        return make_campaign(given, ".", SOURCE, OPTIONS)
    file = load_campaign(path)
    # Paths in options are relative to the working directory, those in the file to the file.
    if "planners" in given:
        given["planners"] = [_absolute_code(one) for one in given["planners"]]
    for key in ("worlds", "robots"):
        given[key] = _absolute(given[key]) if key in given else file.document.data.get(key)
    if "settings" in given:
        if CONTROLLER in given["settings"]:
            given["settings"][CONTROLLER] = [*map(_absolute_code, given["settings"][CONTROLLER])]
        own, others = file.document.data.get("settings", {}), given["settings"]
        given["settings"] = [{**one, **others} for one in own] if isinstance(own, list) else {**own, **others}
    merged = {**file.document.data, **{key: value for key, value in given.items() if value is not None}}
    return make_campaign(merged, file.folder, str(path))


def _keys(words: dict[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the campaign keys given by options."""
    axes = {one.key for one in SETTINGS.values() if one.setting.axis}
    options = words["options"] or ()
    of_planners = [text for text in options if not text.startswith(f"{CONTROLLER}.")]
    if len(of_planners) < len(options):
        names = settings.get(CONTROLLER, [USUAL_CONTROLLER])
        settings = {**settings, CONTROLLER: _controllers(names, [text for text in options if text not in of_planners])}
    keys = {key: value for key, value in settings.items() if key in axes}
    keys |= {
        "robots": words["robots"],
        "worlds": [*(words["worlds"] or ()), *(_generated(text) for text in words["generate"] or ())],
        "planners": _planners(words["planners"] or (), of_planners),
        "settings": {key: value for key, value in settings.items() if key not in axes},
        "seeds": None if words["seeds"] is None else _seeds(words["seeds"]),
        "run_limit": words["run_limit"],
        "tasks": None if words["tasks"] is None else _tasks(words["tasks"]),
    }
    return {key: value for key, value in keys.items() if value not in (None, [], {})}


def _tasks(text: str) -> Any:
    """Parse the campaign key `tasks` from NUMBER, NUMBER:METRES, own or named."""
    if text in ("own", "named"):
        return text
    number, mark, metres = text.partition(":")
    if not (number.isascii() and number.isdigit() and int(number) and bool(mark) == bool(metres)):
        raise InputError(f"--tasks {text}: must be NUMBER or NUMBER:METRES, such as 30:5, or own or named")
    return {"random": int(number), **({"min_distance": _number(f"--tasks {text}", metres)} if mark else {})}


def _absolute(worlds: list[Any]) -> list[Any]:
    known = {*list_worlds(), *list_robots()}
    return [str(Path(one).absolute()) if isinstance(one, str) and one not in known else one for one in worlds]


def _absolute_code(entry: Any) -> Any:
    """Return a planner or controller with its file's path, if any, made absolute."""
    if isinstance(entry, dict):
        return {**entry, "name": _absolute_code(entry["name"])}
    file, rest = file_and_rest(entry)
    return f"{Path(file).absolute()}{rest}" if file else entry


def _seeds(text: str) -> Any:
    """Parse the campaign key `seeds`."""
    if text.isascii() and text.isdigit():
        return int(text)
    if "-" in text:
        return text
    return [_number("--seeds", word, whole=True) for word in text.split(",")]


def _generated(text: str) -> dict[str, Any]:
    """Parse KIND:SEEDS into {generate: KIND, seeds: SEEDS}."""
    kind, _, seeds = text.partition(":")
    return {"generate": kind, "seeds": _seeds(seeds) if seeds else 1}


def _planners(names: Sequence[str], settings: Sequence[str]) -> list[Any]:
    """Parse the campaign key `planners` from names and `--set NAME.KEY=VALUES`, where VALUES are 10,50 or 10..50..20."""
    if settings and not names:
        raise InputError(f"--set {settings[0]}: needs --planner")
    for name in names:
        if "=" in name:
            planner = name.partition(":")[0]
            raise InputError(
                f"--planner {name}: must be a planner's name; write its options as --set {planner}.KEY=VALUES"
            )
    options: dict[str, dict[str, Any]] = {name: {} for name in names}
    for text in settings:
        group, key, values = grouped(text, (*map(record_name, names), "planner", CONTROLLER))
        ends = values.split("..")
        given: Any = values.split(",") if "," in values else values
        if len(ends) == 3:
            given = dict(zip(("from", "to", "step"), (_number(f"--set {text}", end) for end in ends), strict=True))
        for name in names:
            if group in ("planner", record_name(name)):
                options[name][key] = given
    return [{"name": name, **given} if given else name for name, given in options.items()]


def _controllers(names: Sequence[str], settings: Sequence[str]) -> list[dict[str, Any]]:
    """Parse the setting `controller` from names and `--set controller.KEY=VALUES`: every combination."""
    pairs = [grouped(text, (CONTROLLER,))[1:] for text in settings]
    values = itertools.product(names, *(text.split(",") for _, text in pairs))
    return [{"name": name, **dict(zip((key for key, _ in pairs), given, strict=True))} for name, *given in values]


def _number(option: str, text: str, *, whole: bool = False) -> float | int:
    try:
        return int(text) if whole or text.lstrip("+-").isdigit() else float(text)
    except ValueError:
        raise InputError(f"{option} {text}: must be a {'whole ' if whole else ''}number") from None
