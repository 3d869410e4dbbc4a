"""The BARN challenge's table: its worlds, its score, and what others have published (docs/explanation/unknown-worlds.md)."""

from __future__ import annotations

import math
import statistics
import tarfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from antdrive.base.errors import InputError, input_error
from antdrive.base.plane import polyline_length
from antdrive.sim.log.metrics import BARN_SPEED
from antdrive.worlds.formats.barn import BARN_CELL, BARN_GOAL, BARN_START

if TYPE_CHECKING:
    import pyarrow

WORLDS = "world_*.world"
FIELD = (-4.425, 5.175)  # cell (0, 0) of a reference path [m]
MAX_MEMBERS, MAX_BYTES = 2000, 500_000_000  # of an archive of worlds
HEADS = ("world", "runs", "certified", "mean time [s]", "mean score")
PUBLISHED_HEADS = ("published", "success [%]", "mean time [s]", "mean score", "where")
#: What our figures are not.
OURS = "This is our simulator on the challenge's public worlds, no official score."


@dataclass(frozen=True)
class Published:
    """A result that somebody else has published."""

    who: str  # the entry
    where: str  # which worlds, how often, and how the figure came about
    source: str  # where it can be looked up
    score: float  # mean score
    success: float = math.nan  # share of runs that arrived; not a number where it is not known
    seconds: float = math.nan  # mean time of a run that arrived [s]; not a number where it is not known

    @property
    def cells(self) -> tuple[str, ...]:
        """A row of a table, under `PUBLISHED_HEADS`."""
        return self.who, _cell(100 * self.success, 0), _cell(self.seconds, 2), _cell(self.score, 4), self.where


def _cell(value: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}f}"


COPIED = "the organisers' report on the BARN challenge at ICRA 2026, which we have not read"
LICS = "the team's published log, whose address we did not keep; the method: Damanik et al. 2024, arXiv 2406.14947"
DWA = "github.com/Daffan/the-barn-challenge, res/dwa_out.txt"

#: The results that the table is shown beside.
PUBLISHED = (
    Published("IN2 BOT, 2026", "hidden worlds, 50 x 10, copied by others, not checked", COPIED, 0.4975),
    Published("EW-Glab, 2026", "hidden worlds, copied by others, not checked", COPIED, 0.4880),
    Published("LiCS-KI, 1.5 m/s", "the 50 public worlds x 10, its own log, rescored", LICS, 0.4889, 0.98, 7.69),
    Published("DWA, 0.5 m/s", "the 50 public worlds x 10, the organisers' log, rescored", DWA, 0.1586, 0.85),
)


@dataclass(frozen=True)
class BarnLine:
    """A world's results, or those of all worlds."""

    world: str  # its name
    runs: int  # number of runs
    arrived: int  # how many of them stopped at the goal, certified
    seconds: float  # mean time of those [s], by the challenge's clock; not a number where there are none
    score: float  # mean score of all runs

    @property
    def cells(self) -> tuple[str, ...]:
        """A row of a table, under `HEADS`."""
        return self.world, str(self.runs), str(self.arrived), _cell(self.seconds, 2), _cell(self.score, 4)


def unpacked(source: Path, folder: Path) -> Path:
    """The folder with the worlds of a folder, or of an archive, which is unpacked."""
    archives = [source] if source.is_file() else sorted(source.glob("*.tar.*")) if source.is_dir() else []
    if not archives or (source.is_dir() and any(source.rglob(WORLDS))):
        found = source
    else:
        found = folder
        try:
            with tarfile.open(archives[0]) as archive:
                members = archive.getmembers()
                if len(members) > MAX_MEMBERS or sum(member.size for member in members) > MAX_BYTES:
                    raise input_error(str(archives[0]), "holds more than the challenge's worlds")
                archive.extractall(folder, members, filter="data")
        except (tarfile.TarError, OSError, EOFError) as error:
            raise input_error(
                str(archives[0]), f"no archive that can be read ({' '.join(str(error).split())})"
            ) from None
    if not any(found.rglob(WORLDS)):
        raise input_error(str(source), f"no {WORLDS} here; name the folder of the challenge's worlds, or their archive")
    return found


def campaign_data(
    folder: Path, trials: int, planner: str, robot: str, settings: Mapping[str, Any], *, with_map: bool = False
) -> dict[str, Any]:
    """The campaign that drives every world a number of times, as plain data."""
    files = sorted(folder.rglob(WORLDS), key=lambda path: (len(path.stem), path.stem))
    noise = settings["noise"]
    driven = [{key: value for key, value in settings.items() if key != "noise"}]
    if with_map:
        driven.append({**driven[0], "map": "given", "localisation": localisation_with_map(settings["localisation"])})
    return {
        "worlds": [{"import": str(path.resolve()), "barn": True} for path in files],
        "planners": [planner],
        "robots": [robot],
        "noise": [noise],
        "seeds": list(range(trials)),
        "settings": driven,
    }


def localisation_with_map(kind: str) -> str:
    """How a robot with the map localises itself, beside one without it: it has pose fixes, unless it knows the true pose."""
    return "true" if kind == "true" else "fixes"


def reference_times(folder: Path) -> dict[str, float]:
    """The time of the challenge's own reference path at 2 m/s, by the name of the world [s].

    The path leads from the start through the field of cylinders, along the file's cells, and on to the goal.
    """
    times = {}
    for path in folder.rglob("path_*.npy"):
        try:
            cells = np.load(path, allow_pickle=False)
            way = np.vstack([BARN_START[:2], BARN_CELL * cells + FIELD, BARN_GOAL])
        except (ValueError, OSError, EOFError, TypeError) as error:
            raise InputError(f"{path}: no reference path of a BARN world ({error})") from None
        length = polyline_length(way)
        times[path.stem.replace("path_", "world_")] = length / BARN_SPEED
    return times


def score(succeeded: bool, seconds: float, fastest: float) -> float:
    """The challenge's score of one run."""
    return fastest / min(max(seconds, 2 * fastest), 8 * fastest) if succeeded else 0.0


def by_map(table: pyarrow.Table) -> dict[str, pyarrow.Table]:
    """The runs of robots without a map, `none`, and with it, `given`."""
    maps = table["map"].to_pylist()
    return {kind: table.filter([one == kind for one in maps]) for kind in ("none", "given")}


def lines(table: pyarrow.Table, fastest: Mapping[str, float]) -> Iterator[BarnLine]:
    """The results, world by world, then those of all."""
    rows = table.select(["world", "succeeded", "arrival_s", "barn"]).to_pylist()
    worlds = {row["world"]: [other for other in rows if other["world"] == row["world"]] for row in rows}
    for world in sorted(worlds, key=lambda name: (len(name), name)):
        yield _line(world, worlds[world], fastest)
    yield _line("all", rows, fastest)


def _line(world: str, rows: Sequence[Mapping[str, Any]], fastest: Mapping[str, float]) -> BarnLine:
    scores = []
    for row in rows:
        reference = fastest.get(row["world"])
        own = (row["barn"] or 0.0) if row["succeeded"] else 0.0
        scores.append(own if reference is None else score(row["succeeded"], row["arrival_s"], reference))
    times = [row["arrival_s"] for row in rows if row["succeeded"]]
    seconds = statistics.fmean(times) if times else math.nan
    return BarnLine(world, len(rows), len(times), seconds, statistics.fmean(scores))
