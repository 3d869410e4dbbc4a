"""The BARN challenge: its worlds, score and published results (docs/explanation/unknown-worlds.md)."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import math
import shutil
import statistics
import tarfile
import tempfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from types import MappingProxyType
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from antdrive.base.errors import InputError, input_error
from antdrive.base.files import format_size, open_regular
from antdrive.base.plane import polyline_length
from antdrive.base.tables import table
from antdrive.base.types import Point
from antdrive.sim.log.metrics import BARN_SPEED
from antdrive.worlds.formats.barn import BARN_CELL, BARN_GOAL, BARN_START

if TYPE_CHECKING:
    import pyarrow

    from antdrive.runs.statistics.price import Price

WORLDS, PATHS = "world_*.world", "path_*.npy"
FIELD = (-4.575, 5.075)  # cell (0, 0) of a reference path by the scripts [m]; its cylinders: 0.15 and 0.1 m farther
MAX_MEMBERS, MAX_BYTES = 2000, 300_000_000  # of an archive of worlds; the set's 300 worlds have 210 MB
MAX_PATH_BYTES = 1_000_000
#: Decompressors by the first bytes of a file.
DECOMPRESS: Mapping[bytes, Any] = MappingProxyType(
    {b"\x1f\x8b": gzip.open, b"BZh": bz2.open, b"\xfd7zXZ\x00": lzma.open}
)
HEADS = ("world", "runs", "certified", "mean time [s]", "score", "exact score")
PUBLISHED_HEADS = ("published", "success [%]", "mean time [s]", "mean score", "where")
#: Disclaimer of the table.
OURS = "Results of this simulator on the challenge's public worlds; not an official score."


@dataclass(frozen=True)
class Published:
    """A published result."""

    who: str  # name of the entry
    where: str  # worlds, repetitions, and origin of the figure
    source: str  # where to look it up
    score: float  # mean score
    success: float = math.nan  # fraction of runs that arrived; NaN if unknown
    seconds: float = math.nan  # mean time of a run that arrived [s]; NaN if unknown

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of the table, under `PUBLISHED_HEADS`."""
        return self.who, _cell(100 * self.success, 0), _cell(self.seconds, 2), _cell(self.score, 4), self.where


def _cell(value: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}f}"


@dataclass(frozen=True)
class Formula:
    """A variant of the challenge's score: 0 without success, else OT / clip(time, `least` OT, `most` OT).

    OT is the length of the polyline from `start` along the challenge's path file to the goal, divided by 2 m/s.
    """

    name: str  # its bounds
    least: float  # [OT]
    most: float  # [OT]
    start: Point  # [m]
    source: str  # who uses it

    def score(self, succeeded: bool, seconds: float, fastest: float) -> float:
        """Return the score of one run.

        Args:
            succeeded: whether the robot reached the goal without a collision
            seconds: its time by the challenge's clock [s]
            fastest: OT [s]
        """
        return fastest / min(max(seconds, self.least * fastest), self.most * fastest) if succeeded else 0.0


#: The score of the leaderboards since 2024.
OFFICIAL = Formula("2 to 8 OT", 2, 8, BARN_START[:2], "run.py, barn_runner.py (ROS 2), leaderboards since 2024")
#: The same organisers' report script, and their older run.py.
REPORT_TEST = Formula("4 to 8 OT", 4, 8, (-2.0, 3.0), "report_test.py, leaderboard of 2022")
FORMULAS = (OFFICIAL, REPORT_TEST)
FORMULA = "success * OT / clip(time, 2 OT, 8 OT), OT = length of the challenge's path file / 2 m/s"
FORMULA_SOURCE = "github.com/Daffan/the-barn-challenge; github.com/Saadmaghani/The-Barn-Challenge-Ros2"

REPORT = "Lessons Learned from the Fifth BARN Challenge, https://people.cs.gmu.edu/~xiao/papers/barn26_report.pdf"
LEADERBOARD = "https://people.cs.gmu.edu/~xiao/Research/BARN_Challenge/BARN_Challenge24.html"
LICS = "github.com/damanikjosh/the-barn-challenge, out.txt (first 500 lines); Damanik et al. 2024, arXiv 2406.14947"
DWA = "github.com/Daffan/the-barn-challenge, res/dwa_out.txt"

#: Published results for comparison.
PUBLISHED = (
    Published("IN2 BOT, 2026", "hidden worlds, 50 x 10, official, from a quote", REPORT, 0.4975),
    Published("EW-Glab, 2026", "hidden worlds, 50 x 10, official, from a quote", REPORT, 0.4880),
    Published("LiCS-KI, 1.5 m/s", "the 50 public worlds x 10, team's log, rescored", LICS, 0.4889, 0.98, 7.69),
    Published("LiCS-KI, 2024", "hidden worlds, official, from a quote", LEADERBOARD, 0.4762),
    Published("DWA, 0.5 m/s", "the 50 public worlds x 10, organisers' log, rescored", DWA, 0.1586, 0.85),
)


@dataclass(frozen=True)
class BarnLine:
    """The results in one world, or in all worlds."""

    world: str  # name of the world
    runs: int  # number of runs
    arrived: int  # number of runs certified at the goal
    seconds: float  # their mean time by the challenge's clock [s]; NaN if there are none
    score: float  # mean score of all runs, OT from the challenge's path files; NaN if a world has none
    exact: float  # mean score of all runs, OT from the exact shortest path

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of the table, under `HEADS`."""
        return (
            self.world,
            str(self.runs),
            str(self.arrived),
            _cell(self.seconds, 2),
            _cell(self.score, 4),
            _cell(self.exact, 4),
        )


@dataclass(frozen=True)
class BarnTable:
    """The results in the challenge's worlds, beside published ones."""

    rows: Sequence[BarnLine]  # one for each world, and one for all
    known: BarnLine | None  # all worlds with the map; None if it was not driven with
    price: Price | None  # the cost of driving without the map; None likewise

    @classmethod
    def of(cls, runs: pyarrow.Table, fastest: Mapping[str, float], map: str, *, with_map: bool) -> BarnTable:
        """Return the results of a campaign's runs.

        Args:
            runs: the runs
            fastest: OT [s] by the world's name
            map: the robot's map, `none` or `given`
            with_map: whether the runs with the map are partners of those without it
        """
        from antdrive.runs.statistics.price import prices
        from antdrive.runs.statistics.run_table import RunTable

        rows = list(by_world(by_map(runs)[map], fastest))
        if not with_map:
            return cls(rows, None, None)
        (price,) = prices(RunTable(runs.to_pydict()))
        return cls(rows, list(by_world(by_map(runs)["given"], fastest))[-1], price)

    def as_dict(self) -> dict[str, Any]:
        """Return the results as plain values."""
        facts = {"note": OURS, "worlds": [vars(row) for row in self.rows[:-1]], "all": vars(self.rows[-1])}
        facts["published"] = [vars(entry) for entry in PUBLISHED]
        if self.known and self.price:
            facts |= {"with_map": vars(self.known), "price_of_not_knowing": self.price.as_dict()}
        return facts

    def lines(self) -> Iterator[str]:
        """Yield the results as a table for people."""
        known = [replace(self.known, world="all, with the map")] if self.known else []
        yield from table(HEADS, (row.cells for row in (*self.rows, *known)))
        yield f"score: {FORMULA}"
        yield "exact score: T = length of the exact shortest path / 2 m/s in place of OT"
        yield ""
        if self.price:
            yield self.price.sentence
            yield ""
        yield from published_lines()
        yield ""
        yield OURS


def published_lines() -> Iterator[str]:
    """Yield the published results and their sources as lines."""
    yield from table(PUBLISHED_HEADS, (entry.cells for entry in PUBLISHED))
    for source in dict.fromkeys(entry.source for entry in PUBLISHED):
        yield f"  {', '.join(entry.who for entry in PUBLISHED if entry.source == source)}: {source}"


def unpacked(source: Path, folder: Path, wanted: str = WORLDS) -> Path:
    """Return the folder with the worlds (or the wanted files) of a folder or archive; unpack an archive."""
    archives = sorted(source.glob("*.tar.*")) if source.is_dir() else [source]
    worlds = source
    if archives and not (source.is_dir() and any(source.rglob(wanted))):
        worlds = folder
        with tempfile.TemporaryDirectory() as temporary:  # nothing of a damaged archive stays
            _unpack(archives[0], Path(temporary))
            shutil.copytree(temporary, folder, dirs_exist_ok=True)
    if not any(worlds.rglob(wanted)):
        raise input_error(str(source), f"no {wanted} here; name the folder of the challenge's worlds, or their archive")
    return worlds


def _unpack(source: Path, folder: Path) -> None:
    """Unpack the worlds and reference paths of an archive; its limits hold for each byte as it is decompressed."""
    with open_regular(source, MAX_BYTES, "an archive of worlds") as raw:
        start = raw.read(6)
        raw.seek(0)
        decompress = next((opened for magic, opened in DECOMPRESS.items() if start.startswith(magic)), None)
        stream: Any = _Bounded(raw if decompress is None else decompress(raw), source)
        try:
            with tarfile.open(fileobj=stream, mode="r|") as archive:
                for number, member in enumerate(archive):
                    if number >= MAX_MEMBERS or member.size > MAX_BYTES:
                        raise _too_large(source)
                    if member.isreg() and any(PurePath(member.name).match(kind) for kind in (WORLDS, PATHS)):
                        archive.extract(member, folder, filter="data")
                rest: Any = archive.fileobj  # tarfile takes a damaged header for the end, and never sees a checksum
                while block := rest.read(1 << 20):
                    if block.strip(b"\0"):
                        raise tarfile.ReadError("damaged header")
        except (tarfile.TarError, lzma.LZMAError, zlib.error, OSError, EOFError, MemoryError) as error:
            problem = " ".join(str(error).split()) or type(error).__name__
            raise input_error(str(source), f"not a readable .tar archive ({problem})") from None


class _Bounded:
    """A decompressed stream of an archive, refused beyond `MAX_BYTES`."""

    def __init__(self, stream: IO[bytes], source: Path) -> None:
        self._stream, self._source, self._left = stream, source, MAX_BYTES

    def read(self, size: int) -> bytes:
        """Return the next bytes."""
        content = self._stream.read(size)
        self._left -= len(content)
        if self._left < 0:
            raise _too_large(self._source)
        return content


def _too_large(source: Path) -> InputError:
    limits = f"{MAX_MEMBERS} files and {format_size(MAX_BYTES)} when unpacked"
    return input_error(str(source), f"larger than an archive of the challenge's worlds; the limits are {limits}")


def campaign_data(
    folder: Path, trials: int, planner: str, robot: str, settings: Mapping[str, Any], *, with_map: bool = False
) -> dict[str, Any]:
    """Return the campaign that drives every world `trials` times, as plain data."""
    files = sorted(folder.rglob(WORLDS), key=lambda path: (len(path.stem), path.stem))
    noise = settings["noise"]
    driven = [{key: value for key, value in settings.items() if key != "noise" and value is not None}]
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
    """Return the localisation of the run with the map: true pose if the mapless run has it, else pose fixes."""
    return "true" if kind == "true" else "fixes"


def reference_times(folder: Path, formula: Formula = OFFICIAL) -> dict[str, float]:
    """Return OT, the time of the challenge's reference path at 2 m/s, by the world's name [s].

    The path leads from the formula's start along the cells of the file to the point 10 m ahead.
    """
    times = {}
    for path in folder.rglob(PATHS):
        with open_regular(path, MAX_PATH_BYTES, "a reference path") as file:
            content = file.read()
        try:
            cells = np.load(io.BytesIO(content), allow_pickle=False)
            way = np.vstack([formula.start, BARN_CELL * cells + FIELD, (formula.start[0], BARN_GOAL[1])])
        except (ValueError, OSError, EOFError, TypeError, MemoryError) as error:
            raise InputError(f"{path}: not a reference path of a BARN world ({error})") from None
        length = polyline_length(way)
        times[path.stem.replace("path_", "world_")] = length / BARN_SPEED
    return times


def by_map(runs: pyarrow.Table) -> dict[str, pyarrow.Table]:
    """Split the runs by the robot's map: `none` and `given`."""
    maps = runs["map"].to_pylist()
    return {kind: runs.filter([one == kind for one in maps]) for kind in ("none", "given")}


def by_world(runs: pyarrow.Table, fastest: Mapping[str, float]) -> Iterator[BarnLine]:
    """Yield the results world by world, then those of all worlds."""
    rows = runs.select(["world", "succeeded", "arrival_s", "barn"]).to_pylist()
    worlds = {row["world"]: [other for other in rows if other["world"] == row["world"]] for row in rows}
    for world in sorted(worlds, key=lambda name: (len(name), name)):
        yield _line(world, worlds[world], fastest)
    yield _line("all", rows, fastest)


def _line(world: str, rows: Sequence[Mapping[str, Any]], fastest: Mapping[str, float]) -> BarnLine:
    scores = [OFFICIAL.score(one["succeeded"], one["arrival_s"], fastest.get(one["world"], math.nan)) for one in rows]
    exact = [(one["barn"] or 0.0) if one["succeeded"] else 0.0 for one in rows]
    times = [row["arrival_s"] for row in rows if row["succeeded"]]
    seconds = statistics.fmean(times) if times else math.nan
    return BarnLine(world, len(rows), len(times), seconds, statistics.fmean(scores), statistics.fmean(exact))
