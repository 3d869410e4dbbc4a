"""From the words of `antdrive sweep` to a campaign, and what it prints of one."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from antdrive.base.errors import InputError
from antdrive.cli.console import print_line, print_table

if TYPE_CHECKING:
    from antdrive.runs.campaigns.campaign import Campaign
    from antdrive.runs.campaigns.expanding import Expansion
    from antdrive.runs.campaigns.results import SweepResults

MEDIANS = {
    "driven_length_m": "length m",
    "duration_s": "duration s",
    "min_clearance_m": "least clearance m",
    "plan_s": "planning ms",
}
#: The options that a campaign's keys come from, in errors.
OPTIONS = {
    "robots": "--robot",
    "routes": "--smoothing",
    "noise": "--noise",
    "margin": "--margin",
    "seeds": "--seeds",
    "map": "--map",
    "localisation": "--localisation",
    "odometry": "--odometry",
}
SOURCE = "the options"  # what errors call a campaign that no file describes


def campaign_from(path: Path | None, **words: Any) -> Campaign:
    """The campaign in a file, with the keys that options give in place of the file's.

    Raises:
        InputError: something is wrong; the message names the file and the key, or the option.
    """
    from antdrive.runs.campaigns.campaign import load_campaign, make_campaign

    given = _keys(words)
    if path is not None and not given:
        return load_campaign(path)
    if path is None:
        for key, option in (("worlds", "--world"), ("planners", "--planner")):
            if key not in given:
                raise InputError(f"{option}: missing; name a campaign file, or at least one world and one planner")
        return make_campaign(given, ".", SOURCE, OPTIONS)
    file = load_campaign(path)
    # Paths in options begin where the command runs, those in the file beside the file.
    if "planners" in given:
        given["planners"] = [_absolute_planner(one) for one in given["planners"]]
    for key in ("worlds", "robots"):
        given[key] = _absolute(given[key]) if key in given else file.document.data.get(key)
    if "settings" in given:
        given["settings"] = _with_settings(file.document.data.get("settings", {}), given["settings"])
    merged = {**file.document.data, **{key: value for key, value in given.items() if value is not None}}
    return make_campaign(merged, file.folder, str(path))


def _keys(words: dict[str, Any]) -> dict[str, Any]:
    """The campaign's keys that options give."""
    found = {key: words[key] for key in ("robots", "routes", "noise") if words[key]}
    worlds = [*(words["worlds"] or ()), *(_generated(text) for text in words["generate"] or ())]
    if worlds:
        found["worlds"] = worlds
    if words["planners"]:
        found["planners"] = [_planner(text) for text in words["planners"]]
    if words["margin"]:
        found["margin"] = [text if text == "auto" else _number("--margin", text) for text in words["margin"]]
    settings = {key: value for key, value in words["settings"].items() if value}
    if settings:
        found["settings"] = settings
    if words["seeds"] is not None:
        found["seeds"] = _seeds(words["seeds"])
    if words["run_limit"] is not None:
        found["run_limit"] = words["run_limit"]
    if words["tasks"] is not None:
        found["tasks"] = _tasks(words["tasks"])
    return found


def _with_settings(of_file: Any, given: dict[str, Any]) -> Any:
    """A file's settings with those that options give in the place of the file's."""
    if isinstance(of_file, list):
        return [{**one, **given} for one in of_file]
    return {**of_file, **given}


def size_lines(expansion: Expansion, missing: int) -> Iterator[str]:
    """How large a campaign is, in words."""
    counts = expansion.counts.items()
    yield " x ".join(f"{count} {name if count != 1 else _one(name)}" for name, count in counts)
    left_out = f"; {expansion.duplicates} combinations that mean the same as others are left out"
    yield f"{len(expansion.jobs)} runs, {missing} of them missing{left_out if expansion.duplicates else ''}"


def _one(name: str) -> str:
    """The singular of what is counted."""
    return name if " " in name or name == "settings" else name.removesuffix("s")


def _tasks(text: str) -> Any:
    """The value of a campaign's key `tasks` from NUMBER, NUMBER:METRES, own or named."""
    if text in ("own", "named"):
        return text
    number, mark, metres = text.partition(":")
    if not (number.isascii() and number.isdigit() and int(number) and bool(mark) == bool(metres)):
        raise InputError(f"--tasks {text}: write NUMBER or NUMBER:METRES, such as 30:5, or own or named")
    return {"random": int(number), **({"min_distance": _number(f"--tasks {text}", metres)} if mark else {})}


def _absolute(worlds: list[Any]) -> list[Any]:
    from antdrive.robots import list_robots
    from antdrive.worlds import list_worlds

    known = {*list_worlds(), *list_robots()}
    return [str(Path(one).absolute()) if isinstance(one, str) and one not in known else one for one in worlds]


def _absolute_planner(entry: Any) -> Any:
    """A planner whose file, if it is in one, is found from any folder."""
    if isinstance(entry, dict):
        return {**entry, "name": _absolute_planner(entry["name"])}
    file, mark, word = entry.rpartition(":")
    return f"{Path(file).absolute()}{mark}{word}" if file.endswith(".py") else entry


def _seeds(text: str) -> Any:
    """The value of a campaign's key `seeds`."""
    if text.isascii() and text.isdigit():
        return int(text)
    if "-" in text:
        return text
    return [_whole("--seeds", word) for word in text.split(",")]


def _generated(text: str) -> dict[str, Any]:
    """{generate: KIND, seeds: SEEDS} from KIND:SEEDS."""
    kind, _, seeds = text.partition(":")
    return {"generate": kind, "seeds": _seeds(seeds) if seeds else 1}


def _planner(text: str) -> Any:
    """A planner from NAME or NAME:KEY=VALUES:KEY=VALUES, where VALUES are 10,50 or 10..50..20.

    NAME may be FILE.py:CLASS or MODULE:CLASS.
    """
    name, *options = text.split(":")
    if options and "=" not in options[0] and (name.endswith(".py") or "." in name):
        name += f":{options.pop(0)}"
    entry: dict[str, Any] = {"name": name}
    for option in options:
        key, mark, values = option.partition("=")
        if not mark or not key:
            raise InputError(f"--planner {text}: write NAME:KEY=VALUE, such as aco-han:ants=10,50")
        ends = values.split("..")
        if len(ends) == 3:
            entry[key] = dict(zip(("from", "to", "step"), (_number("--planner", end) for end in ends), strict=True))
        else:
            entry[key] = values.split(",") if "," in values else values
    return entry if options else name


def _whole(option: str, text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise InputError(f"{option} {text}: must be a whole number") from None


def _number(option: str, text: str) -> float | int:
    try:
        return int(text) if text.lstrip("+-").isdigit() else float(text)
    except ValueError:
        raise InputError(f"{option} {text}: must be a number") from None


def print_sweep(results: SweepResults, reports: Sequence[str] = ()) -> None:
    """Print how the runs of a campaign ended, what was measured in those that succeeded, and where more is said."""
    print_line(f"{results.size} runs, {results.made} of them made now; {results.succeeded} succeeded, certified")
    print_table(("outcome", "runs"), ((name, str(count)) for name, count in results.outcomes.items()))
    print_line()
    print_line("medians of the runs that succeeded (least to most)")
    print_table(("planner", "runs", *MEDIANS.values()), _medians(results))
    print_line(f"  table    {results.path}")
    for file in reports:
        print_line(f"  report   {file}")
    if reports:
        return
    report = shlex.join(["antdrive", "report", str(results.folder), "-o", str(results.folder / "report.html")])
    print_line(f"  charts, intervals and all runs: {report}")


def _medians(results: SweepResults) -> Iterator[tuple[str, ...]]:
    """For each planner the number of runs that succeeded, and median and extremes of what was measured in them."""
    import numpy as np

    rows = [row for row in results.table.select(["planner", "succeeded", *MEDIANS]).to_pylist() if row["succeeded"]]
    for planner in dict.fromkeys(row["planner"] for row in rows):
        own = [row for row in rows if row["planner"] == planner]
        factors = [1000.0 if unit.endswith(" ms") else 1.0 for unit in MEDIANS.values()]
        columns = [
            factor * np.array([row[name] for row in own], dtype=float)
            for name, factor in zip(MEDIANS, factors, strict=True)
        ]
        told = (f"{np.median(found):.3g} ({found.min():.3g} to {found.max():.3g})" for found in columns)
        yield planner, str(len(own)), *told
