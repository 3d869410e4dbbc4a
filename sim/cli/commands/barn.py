"""`antdrive barn`."""

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from antdrive.sim.cli import options
from antdrive.sim.cli.compiling import compile_once
from antdrive.sim.cli.console import campaign_bar, print_error, print_json, print_line, print_table
from antdrive.sim.cli.exits import FAILED, SUCCEEDED

if TYPE_CHECKING:
    from antdrive.sim.campaigns.challenge import BarnLine
    from antdrive.sim.campaigns.results import SweepResults

Source = Annotated[
    Path, typer.Argument(metavar="FOLDER", help="Folder with the challenge's world_N.world files, or their archive.")
]
Map = Annotated[
    str, typer.Option(metavar="given|none", help="What the robot knows of the world before it drives: all, or nothing.")
]
Localisation = Annotated[
    str, typer.Option(metavar="KIND", help="How the robot knows its pose: matching, odometry, fixes or true.")
]
Odometry = Annotated[
    float, typer.Option(min=0.0, max=100.0, metavar="FACTOR", help="Multiple of the documented errors of odometry.")
]
Trials = Annotated[int, typer.Option(min=1, max=10_000, metavar="NUMBER", help="How often each world is driven.")]
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
    map: Map = "none",
    localisation: Localisation = "matching",
    odometry: Odometry = 1.0,
    planner: options.Planner = "astar",
    robot: options.Robot = "jackal",
    noise: options.Noise = 1.0,
    trials: Trials = 10,
    jobs: Jobs = None,
    out: Out = Path("out/barn"),
    json: options.Json = False,
) -> int:
    """Drive the BARN challenge's worlds and print its table.

    Exit code 0: all runs are done, whatever came out of them. The same command goes on after an interruption.
    """
    from antdrive.sim.campaigns import challenge
    from antdrive.sim.campaigns.campaign import make_campaign
    from antdrive.sim.campaigns.extras import parquet_library
    from antdrive.sim.campaigns.sweeping import sweep

    parquet_library()
    out.mkdir(parents=True, exist_ok=True)
    folder = challenge.unpacked(source, out / "worlds")
    given = map == "given"
    settings = {
        "noise": noise,
        "map": map,
        "localisation": "fixes" if given and localisation == "matching" else localisation,
        "odometry": odometry,
    }
    campaign = make_campaign(challenge.campaign_data(folder, trials, planner, robot, settings), source="barn")
    compile_once()
    try:
        with campaign_bar("driving") as progress:
            results = sweep(campaign, out / "runs", jobs=jobs, keep="failed", progress=progress)
    except KeyboardInterrupt:
        print_error(f"{out}: what is done is kept; go on with: antdrive {' '.join(sys.argv[1:])}")
        raise
    found = list(challenge.lines(results.table, challenge.reference_times(folder)))
    if json:
        print_json(_facts(results, found))
    else:
        _print(results, found)
    return SUCCEEDED if results.complete else FAILED


def _facts(results: "SweepResults", found: "list[BarnLine]") -> dict[str, object]:
    from antdrive.sim.campaigns.challenge import OURS, PUBLISHED

    return {
        "folder": str(results.folder),
        "note": OURS,
        "worlds": [vars(line) for line in found[:-1]],
        "all": vars(found[-1]),
        "published": [vars(entry) for entry in PUBLISHED],
    }


def _print(results: "SweepResults", found: "list[BarnLine]") -> None:
    from antdrive.sim.campaigns.challenge import OURS, PUBLISHED

    heads = ("world", "runs", "certified", "mean time [s]", "mean score")
    print_table(
        heads,
        (
            (line.world, str(line.runs), str(line.arrived), _number(line.seconds, 2), _number(line.score, 4))
            for line in found
        ),
    )
    print_line("")
    rows = (
        (entry.who, _number(100 * entry.success, 0), _number(entry.seconds, 2), _number(entry.score, 4), entry.where)
        for entry in PUBLISHED
    )
    print_table(("published", "success [%]", "mean time [s]", "mean score", "where"), rows)
    print_line("")
    print_line(OURS)
    for row in results.table.select(["world", "seed", "succeeded", "outcome", "reason", "rollout"]).to_pylist():
        if not row["succeeded"]:
            print_line(
                f"  {row['world']}, seed {row['seed']}: {row['outcome']}  {row['reason'] or ''}  {row['rollout'] or ''}"
            )


def _number(value: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}f}"
