"""`antdrive barn`."""

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

from antdrive.base.errors import InputError
from antdrive.base.progress import bar
from antdrive.base.version import require_physics
from antdrive.cli import options
from antdrive.cli.console import print_error, show
from antdrive.cli.options import argument, flag, option
from antdrive.cli.output import print_faults
from antdrive.sim.settings import SETTINGS


@options.with_settings(
    ("noise", "controller", *(name for name, one in SETTINGS.items() if one.setting.group == "Sensing")),
    noise=1.0,
    map="none",
    usual={"localisation": "matching; fixes with --map given"},
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
        if with_map:
            raise InputError("--score: drives nothing; leave out --with-map")
        return _score(source, score, json)
    require_physics()
    from antdrive.base.optional import parquet_library
    from antdrive.planners import load_planner
    from antdrive.robots import load_robot
    from antdrive.runs import barn_challenge as challenge
    from antdrive.runs.campaigns.campaign import make_campaign
    from antdrive.runs.campaigns.notation import OPTIONS
    from antdrive.runs.campaigns.sweeping import sweep

    kind = given["map"]
    if with_map and kind != "none":
        raise InputError("--with-map: needs --map none")
    parquet_library()
    load_planner(planner)  # an invalid one leaves no folder
    load_robot(robot)
    folder = challenge.unpacked(source, out / "worlds")
    given["localisation"] = given["localisation"] or ("fixes" if kind == "given" else "matching")
    data = challenge.campaign_data(folder, trials, planner, robot, given, with_map=with_map)
    campaign = make_campaign(data, source="barn", options={**OPTIONS, "seeds": "--trials", "planners": "--planner"})
    fastest = challenge.reference_times(folder)
    with bar("driving") as progress:
        results = sweep(campaign, out / "runs", jobs=jobs, keep="failed", progress=progress, notify=print_error)
    found = challenge.BarnTable.of(results.table, fastest, kind, with_map=with_map)
    facts = {"folder": str(results.folder), **found.as_dict()}
    failed = (row for row in challenge.by_map(results.table)[kind].to_pylist() if not row["succeeded"])
    show(json, facts, [*found.lines(), *map(_failure_line, failed)])
    return print_faults(results.faults) or results.complete


def _score(source: Path, log: Path, json: bool) -> bool:
    """Print the score of a log. Return whether the log is complete."""
    from antdrive.runs import barn_challenge as challenge
    from antdrive.runs.barn_log import read_log, score_log

    trials = read_log(log)
    with TemporaryDirectory() as temporary:
        folder = challenge.unpacked(source, Path(temporary), challenge.PATHS)
        result = score_log(trials, {one: challenge.reference_times(folder, one) for one in challenge.FORMULAS})
    show(json, result.as_dict(), result.lines(log))
    return not result.gaps


def _failure_line(row: Mapping[str, Any]) -> str:
    return f"  {row['world']}, seed {row['seed']}: {row['outcome']}  {row['reason'] or ''}  {row['rollout'] or ''}"
