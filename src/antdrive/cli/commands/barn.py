"""`antdrive barn`."""

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from antdrive.base.errors import InputError
from antdrive.cli import knowing, options
from antdrive.cli.campaigns import OPTIONS
from antdrive.cli.compiling import compile_once
from antdrive.cli.console import bar, campaign_bar, print_error, print_json, print_line, print_table
from antdrive.cli.exits import FAILED, SUCCEEDED

if TYPE_CHECKING:
    import pyarrow

    from antdrive.runs.barn import BarnLine
    from antdrive.runs.campaigns.results import SweepResults
    from antdrive.runs.statistics.price import Price

Source = Annotated[
    Path, typer.Argument(metavar="FOLDER", help="Folder with the challenge's world_N.world files, or their archive.")
]
WithMap = Annotated[
    bool,
    typer.Option("--with-map", help="Drive each run with the map, too, and print what not knowing it costs."),
]
Trials = Annotated[int, typer.Option(min=1, max=10_000, metavar="NUMBER", help="How often each world is driven.")]
Films = Annotated[
    bool,
    typer.Option("--films", help="Film each run that did not arrive, into OUT/films; its cause is in the picture."),
]
Jobs = Annotated[
    int | None,
    typer.Option("--jobs", "-j", min=1, max=256, metavar="NUMBER", help="Processes.  [default: one per core]"),
]
Out = Annotated[
    Path,
    typer.Option("--out", "-o", metavar="FOLDER", help="Folder for the results; what is there is not driven again."),
]


def barn(
    source: Source,
    map: knowing.Map = "none",
    with_map: WithMap = False,
    localisation: knowing.Localisation = "matching",
    odometry: knowing.Odometry = 1.0,
    planner: options.Planner = "astar",
    robot: options.Robot = "jackal",
    noise: options.Noise = 1.0,
    trials: Trials = 10,
    jobs: Jobs = None,
    out: Out = Path("out/barn"),
    films: Films = False,
    json: options.Json = False,
) -> int:
    """Drive the BARN challenge's worlds and print its table.

    Exit code 0: all runs are done, whatever came out of them. The same command goes on after an interruption.
    """
    from antdrive.runs import barn as challenge
    from antdrive.runs.campaigns.campaign import make_campaign
    from antdrive.runs.campaigns.extras import parquet_library
    from antdrive.runs.campaigns.sweeping import sweep
    from antdrive.runs.statistics.price import prices
    from antdrive.runs.statistics.runs import RunTable

    if with_map and map != "none":
        raise InputError("--with-map: is for --map none; with the map there is nothing to compare")
    parquet_library()
    folder = challenge.unpacked(source, out / "worlds")
    given = map == "given"
    settings = {
        "noise": noise,
        "map": map,
        "localisation": "fixes" if given and localisation == "matching" else localisation,
        "odometry": odometry,
    }
    data = challenge.campaign_data(folder, trials, planner, robot, settings, with_map=with_map)
    campaign = make_campaign(data, source="barn", options={**OPTIONS, "seeds": "--trials", "planners": "--planner"})
    compile_once()
    try:
        with campaign_bar("driving") as progress:
            results = sweep(campaign, out / "runs", jobs=jobs, keep="failed", progress=progress)
    except KeyboardInterrupt:
        print_error(f"{out}: what is done is kept; go on with: antdrive {' '.join(sys.argv[1:])}")
        raise
    runs, fastest = challenge.by_map(results.table), challenge.reference_times(folder)
    found = list(challenge.lines(runs[map], fastest))
    known = list(challenge.lines(runs["given"], fastest))[-1] if with_map else None
    (price,) = prices(RunTable(results.table.to_pydict())) if with_map else (None,)
    if not json:
        _print(found, known, price)  # before the films, which take long and may fail
    filmed = _films(results, out / "films") if films else {}
    if json:
        print_json(_facts(results, found, known, price, filmed))
    else:
        _print_failures(runs[map], filmed)
    return SUCCEEDED if results.complete else FAILED


def _films(results: "SweepResults", folder: Path) -> dict[str, Path]:
    """Film what did not arrive; the films by the keys of the runs."""
    from antdrive.views.film.failures import film_failures

    with bar("filming failures") as progress:
        return film_failures(results.table.to_pylist(), results.folder, folder, progress=progress)


def _facts(
    results: "SweepResults",
    found: "list[BarnLine]",
    known: "BarnLine | None",
    price: "Price | None",
    films: "dict[str, Path]",
) -> dict[str, object]:
    from antdrive.runs.barn import OURS, PUBLISHED

    return {
        "folder": str(results.folder),
        "note": OURS,
        "worlds": [vars(line) for line in found[:-1]],
        "all": vars(found[-1]),
        "published": [vars(entry) for entry in PUBLISHED],
        "films": [str(path) for path in films.values()],
        **({"with_map": vars(known), "price_of_not_knowing": price.as_dict()} if known and price else {}),
    }


def _print(found: "list[BarnLine]", known: "BarnLine | None", price: "Price | None") -> None:
    from antdrive.runs.barn import OURS, PUBLISHED

    heads = ("world", "runs", "certified", "mean time [s]", "mean score")
    listed = [*((line.world, line) for line in found), *([("all, with the map", known)] if known else [])]
    print_table(
        heads,
        (
            (name, str(line.runs), str(line.arrived), _number(line.seconds, 2), _number(line.score, 4))
            for name, line in listed
        ),
    )
    print_line("")
    if price:
        print_line(price.sentence)
        print_line("")
    rows = (
        (entry.who, _number(100 * entry.success, 0), _number(entry.seconds, 2), _number(entry.score, 4), entry.where)
        for entry in PUBLISHED
    )
    print_table(("published", "success [%]", "mean time [s]", "mean score", "where"), rows)
    for source in dict.fromkeys(entry.source for entry in PUBLISHED):
        print_line(f"  {', '.join(entry.who for entry in PUBLISHED if entry.source == source)}: {source}")
    print_line("")
    print_line(OURS)


def _print_failures(runs: "pyarrow.Table", films: "dict[str, Path]") -> None:
    for row in runs.select(["key", "world", "seed", "succeeded", "outcome", "reason", "rollout"]).to_pylist():
        if not row["succeeded"]:
            print_line(
                f"  {row['world']}, seed {row['seed']}: {row['outcome']}  {row['reason'] or ''}  "
                f"{films.get(row['key'], row['rollout'] or '')}"
            )


def _number(value: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}f}"
