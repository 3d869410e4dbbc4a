"""`antdrive barn`."""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any

from antdrive.base.errors import InputError
from antdrive.base.tables import table
from antdrive.base.version import require_physics
from antdrive.cli import options
from antdrive.cli.campaign_options import OPTIONS
from antdrive.cli.console import bar, campaign_bar, print_error, show
from antdrive.cli.options import argument, flag, option
from antdrive.cli.output import print_faults
from antdrive.sim.settings import SETTINGS

if TYPE_CHECKING:
    from antdrive.runs.barn_challenge import BarnLine
    from antdrive.runs.barn_log import LogScore
    from antdrive.runs.campaigns.results import SweepResults
    from antdrive.runs.statistics.price import Price


@options.with_settings(
    ("noise", *(name for name, one in SETTINGS.items() if one.setting.group == "Sensing")),
    noise=1.0,
    map="none",
    localisation="matching",
)
def barn(
    source: Annotated[
        Path, argument("FOLDER", "Folder or archive of the challenge's world_N.world and path_N.npy files.")
    ],
    with_map: Annotated[bool, flag("Also drive with the map and compare.", "--with-map")] = False,
    planner: options.Planner = "astar",
    robot: options.Robot = "jackal",
    trials: Annotated[int, option("NUMBER", "Runs per world.", min=1, max=10_000)] = 10,
    jobs: options.Jobs = None,
    out: Annotated[Path, option("FOLDER", "Output folder; resumable.")] = Path("out/barn"),
    films: Annotated[bool, flag("Film failed runs, with the cause, into OUT/films.", "--film")] = False,
    score: Annotated[
        Path | None, option("LOG", "Score a log of the challenge instead of driving; needs only the path_N.npy files.")
    ] = None,
    json: options.Json = False,
    **given: Any,
) -> bool | int:
    """Drive the BARN Challenge worlds, or score a log.

    Prints the results table beside published scores.

    Repeat the command to resume it. Exit code 0: all runs are done, or the log has 10 trials of each of the 50 public worlds,
    whatever their outcomes; 3: as `sweep`.
    """
    if score:
        if with_map or films:
            raise InputError("--score: drives nothing; leave out --with-map and --film")
        return _score(source, score, json)
    require_physics()
    from antdrive.base.optional import parquet_library
    from antdrive.planners import load_planner
    from antdrive.robots import load_robot
    from antdrive.runs import barn_challenge as challenge
    from antdrive.runs.campaigns.campaign import make_campaign
    from antdrive.runs.campaigns.sweeping import sweep
    from antdrive.runs.statistics.price import prices
    from antdrive.runs.statistics.run_table import RunTable

    map = given["map"]
    if with_map and map != "none":
        raise InputError("--with-map: needs --map none")
    parquet_library()
    load_planner(planner)  # an invalid one leaves no folder
    load_robot(robot)
    folder = challenge.unpacked(source, out / "worlds")
    if map == "given" and given["localisation"] == "matching":
        given["localisation"] = "fixes"
        print_error("localisation: fixes, because matching needs --map none")
    data = challenge.campaign_data(folder, trials, planner, robot, given, with_map=with_map)
    campaign = make_campaign(data, source="barn", options={**OPTIONS, "seeds": "--trials", "planners": "--planner"})
    fastest = challenge.reference_times(folder)
    with campaign_bar("driving") as progress:
        results = sweep(campaign, out / "runs", jobs=jobs, keep="failed", progress=progress, notify=print_error)
    runs = challenge.by_map(results.table)
    rows = list(challenge.lines(runs[map], fastest))
    known = list(challenge.lines(runs["given"], fastest))[-1] if with_map else None
    (price,) = prices(RunTable(results.table.to_pydict())) if with_map else (None,)
    if not json:
        show(json, None, _lines(rows, known, price))  # before filming, which is slow and may fail
    filmed = _films(results, out / "films") if films else {}
    facts = {
        "folder": str(results.folder),
        "note": challenge.OURS,
        "worlds": [vars(line) for line in rows[:-1]],
        "all": vars(rows[-1]),
        "published": [vars(entry) for entry in challenge.PUBLISHED],
        "films": [str(path) for path in filmed.values()],
        **({"with_map": vars(known), "price_of_not_knowing": price.as_dict()} if known and price else {}),
    }
    failed = (row for row in runs[map].to_pylist() if not row["succeeded"])
    show(json, facts, (_failure_line(row, filmed) for row in failed))
    return print_faults(results.faults) or results.complete


def _score(source: Path, log: Path, json: bool) -> bool:
    """Print the score of a log. Return whether the log is complete."""
    from antdrive.runs import barn_challenge as challenge
    from antdrive.runs.barn_log import read_log, score_log

    trials = read_log(log)
    with TemporaryDirectory() as temporary:
        folder = challenge.unpacked(source, Path(temporary), challenge.PATHS)
        result = score_log(trials, {one: challenge.reference_times(folder, one) for one in challenge.FORMULAS})
    facts = {
        **vars(result),
        "formula": challenge.FORMULA,
        "formulas": [vars(one) for one in challenge.FORMULAS],
        "source": challenge.FORMULA_SOURCE,
        "published": [vars(entry) for entry in challenge.PUBLISHED],
    }
    show(json, facts, _score_lines(log, result))
    return not result.gaps


def _score_lines(log: Path, result: "LogScore") -> Iterator[str]:
    from antdrive.runs import barn_challenge as challenge

    yield f"score {result.scores[challenge.OFFICIAL.name]:.4f}  {log}: {result.trials} trials, worlds: {result.worlds}"
    time = "" if math.isnan(result.seconds) else f", mean time {result.seconds:.4f} s"
    ends = zip((result.success, result.collided, result.timed_out), ("succeeded", "collided", "timed out"), strict=True)
    yield f"  {', '.join(f'{100 * share:.1f} % {words}' for share, words in ends)}{time}"
    yield from (f"  incomplete: {gap}" for gap in result.gaps)
    yield from (f"  note: {note}" for note in result.notes)
    yield ""
    rows = (
        (one.name, f"{result.scores[one.name]:.4f}", f"{1 / one.least:.2f}", one.source) for one in challenge.FORMULAS
    )
    yield from table(("clip", "mean score", "at most", "used by"), rows)
    yield ""
    yield f"score: {challenge.FORMULA}"
    yield "means over worlds of the means over a world's trials"
    yield f"source: {challenge.FORMULA_SOURCE}"
    yield ""
    yield from _published()


def _published() -> Iterator[str]:
    from antdrive.runs.barn_challenge import PUBLISHED, PUBLISHED_HEADS

    yield from table(PUBLISHED_HEADS, (entry.cells for entry in PUBLISHED))
    for source in dict.fromkeys(entry.source for entry in PUBLISHED):
        yield f"  {', '.join(entry.who for entry in PUBLISHED if entry.source == source)}: {source}"


def _films(results: "SweepResults", folder: Path) -> dict[str, Path]:
    """Film the failed runs. Return the films by run key."""
    from antdrive.views.film.video import film_failures

    with bar("filming failures") as progress:
        return film_failures(results.table.to_pylist(), results.folder, folder, progress=progress)


def _lines(rows: "Sequence[BarnLine]", known: "BarnLine | None", price: "Price | None") -> Iterator[str]:
    from antdrive.runs.barn_challenge import FORMULA, HEADS, OURS

    listed = [*rows, *([dataclasses.replace(known, world="all, with the map")] if known else [])]
    yield from table(HEADS, (line.cells for line in listed))
    yield f"score: {FORMULA}"
    yield "exact score: T = length of the exact shortest path / 2 m/s in place of OT"
    yield ""
    if price:
        yield price.sentence
        yield ""
    yield from _published()
    yield ""
    yield OURS


def _failure_line(row: Mapping[str, Any], films: Mapping[str, Path]) -> str:
    where = f"  {row['world']}, seed {row['seed']}: {row['outcome']}  {row['reason'] or ''}"
    return f"{where}  {films.get(row['key'], row['rollout'] or '')}"
