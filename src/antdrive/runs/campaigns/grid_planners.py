"""The planners of a campaign: every combination of the options that it lists."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from antdrive.base.checks import show
from antdrive.base.document import Location
from antdrive.base.errors import InputError
from antdrive.planners import load_planner, planner_version
from antdrive.runs.campaigns.campaign import Campaign
from antdrive.sim.forms import option_text
from antdrive.sim.log.record import settings_of

MOST_VALUES = 10_000  # of one range
PLANNER_FILES = "planners"  # the folder in a campaign's folder with the files that its commands name


@dataclass(frozen=True, eq=False)
class PlannerVariant:
    """A planner with options."""

    label: str  # what tables call it, such as "aco-han ants=50"
    name: str  # its registered name; for people's own code the file's or module's name and that of the class
    source: str  # what `load_planner` takes for it
    word: str  # what commands within the campaign's folder call it
    file: Path | None  # its file; None: it is registered or in a module
    version: str  # what its code is
    given: Mapping[str, Any]  # the options that the campaign sets
    options: Mapping[str, Any]  # all its options as plain values


def planner_variants(campaign: Campaign) -> list[PlannerVariant]:
    """The planners of a campaign, in its order; the last of several options with lists varies fastest.

    Raises:
        InputError: there is no such planner or option, or an option does not take a value.
    """
    found: dict[str, PlannerVariant] = {}
    for i, entry in enumerate(campaign.entry.planners):
        for variant in _variants(campaign, ("planners", i), {"name": entry} if isinstance(entry, str) else dict(entry)):
            taken = found.setdefault(variant.label, variant)
            if taken.source != variant.source:  # the same class name in another file of the same name
                written = entry if isinstance(entry, str) else entry["name"]
                label = variant.label.replace(variant.name, written, 1)
                found[label] = dataclasses.replace(variant, label=label, name=written)
    return list(found.values())


def _variants(campaign: Campaign, place: Location, options: dict[str, Any]) -> Iterator[PlannerVariant]:
    given_name = options.pop("name", None)
    if not isinstance(given_name, str):
        raise campaign.error((*place, "name"), "missing; write the planner's name, such as {name: aco-han, ants: 50}")
    file, _, inner = given_name.rpartition(":")
    path = (campaign.folder / file).absolute() if file.endswith(".py") else None
    source = given_name if path is None else f"{path}:{inner}"
    name = given_name if path is None else f"{path.name}:{inner}"
    try:
        version = planner_version(source)
    except InputError as error:
        raise _at_option(campaign, place, str(error)) from None
    word = name if path is None else f"{PLANNER_FILES}/{version.rpartition(' ')[2]}/{name}"
    lists = [values_of(campaign, (*place, key), value) for key, value in options.items()]
    for values in itertools.product(*lists):
        given = dict(zip(options, values, strict=True))
        try:
            planner = load_planner(source, **given)
        except InputError as error:
            raise _at_option(campaign, place, str(error)) from None
        resolved = settings_of(planner) if dataclasses.is_dataclass(planner) else settings_of(given)
        label = " ".join([name, *(f"{key}={option_text(value)}" for key, value in given.items())])
        yield PlannerVariant(label, name, source, word, path, version, given, resolved)


def _at_option(campaign: Campaign, place: Location, text: str) -> InputError:
    """The error of `load_planner` at the option that it names."""
    key, mark, problem = text.partition(": ")
    if mark and key.startswith("planner."):
        return campaign.error((*place, key.removeprefix("planner.")), problem)
    return campaign.error(place, text.removeprefix("planner: "))


def values_of(campaign: Campaign, place: Location, value: Any) -> list[Any]:
    """The values that an option takes: those of a list or of a range {from, to, step}, or one.

    Raises:
        InputError: it is no list, range or plain value.
    """
    if isinstance(value, list):
        if not value or any(isinstance(one, list | dict) for one in value):
            raise campaign.error(place, f"must be a list of values, got {show(value)}")
        return value
    if not isinstance(value, dict):
        return [value]
    numbers = [value.get(key, "") for key in ("from", "to", "step")]
    if len(value) != 3 or any(isinstance(number, bool) or not isinstance(number, int | float) for number in numbers):
        raise campaign.error(place, "a range is written {from: 10, to: 50, step: 10}")
    first, last, step = numbers
    if not (all(map(math.isfinite, numbers)) and step > 0 and last >= first and (last - first) / step < MOST_VALUES):
        raise campaign.error(place, f"must go up from a number in at most {MOST_VALUES} steps above 0")
    count = int((last - first) / step + 1e-9) + 1
    whole = all(isinstance(n, int) for n in numbers)
    return [first + k * step if whole else round(first + k * step, 12) for k in range(count)]
