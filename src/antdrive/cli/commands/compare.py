"""`antdrive compare`."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from antdrive.base.errors import InputError
from antdrive.base.files import file_name, write_json
from antdrive.cli import options
from antdrive.cli.campaign_tables import CampaignQuery, campaign_folders, compare_campaigns
from antdrive.cli.console import file_lines, planning, print_error, show, table
from antdrive.cli.entrants import Entrant, check_worlds, entrants_of, repeat_command
from antdrive.cli.exits import FAILED, INTERNAL_ERROR, SUCCEEDED
from antdrive.cli.options import argument, option
from antdrive.cli.output import film_drives, print_idle_settings, results_folder
from antdrive.cli.scenario_options import Ends, Setup
from antdrive.runs.comparing import (
    COMPARED,
    PLANNER_FAULT,
    Compared,
    difference_cells,
    differences,
    mark_of,
    same_drives,
)
from antdrive.views.run_folder import check_film, check_folder, write_run

if TYPE_CHECKING:
    from antdrive.planners import PlannerError
    from antdrive.sim.log.rollout import Rollout
    from antdrive.sim.pipeline import Run
    from antdrive.sim.scenario import Scenario

MARKER = "comparison.json"


@options.with_settings(("smoothing", "noise", "margin", "cell", "seed"))
def compare(
    *,
    context: typer.Context,
    worlds: Annotated[list[str], argument("WORLD", "World names or files, or campaign folders.")],
    planner: Annotated[
        list[str] | None,
        option(
            "NAME",
            "Planner; give two to six. LABEL=NAME labels one, to compare it under different options.",
        ),
    ] = None,
    settings: Annotated[
        list[str] | None,
        option(
            "GROUP.KEY=VALUE",
            "Option of a planner or label (aco-han.ants=50), of all planners (planner.ants=50) or of the controller "
            "(controller.lookahead_time=0.5). Repeatable.",
            "--set",
            "-s",
        ),
    ] = None,
    robot: options.Robot = "turtlebot",
    seeds: Annotated[int, option("NUMBER", "Seeds per world, starting at --seed.", min=1, max=10_000)] = 1,
    ends: Ends,
    out: options.Out = None,
    figures: options.Figures = True,
    film: Annotated[Path | None, option("FILE", "Film the first world side by side: .mp4, .gif or .webp.")] = None,
    speed: options.Speed = 1.0,
    query: CampaignQuery,
    json: options.Json = False,
    **given: Any,
) -> int:
    """Compare planners on worlds or from campaign results.

    Worlds: pairs the planners by world and seed; figures and film show the first pair. Exit code 0: every run succeeded.
    Campaign folders of `antdrive sweep`: prints success rates with intervals, outcomes, and a test of every pair.
    """
    from antdrive.cli.groups import print_exception
    from antdrive.planners import PlannerError

    if campaigns := campaign_folders(worlds, context, query):
        compare_campaigns(campaigns, planner or (), query, json)
        return SUCCEEDED
    check_worlds(worlds)
    entrants = entrants_of(planner, settings)
    tasks = {world: ends.of(world) for world in worlds}
    scenarios = {
        (world, entrant): Setup(entrant.name, list(entrant.settings), robot).scenario(tasks[world], given)
        for world in worlds
        for entrant in entrants
    }
    names = {world: scenario.task.world.name for (world, _), scenario in scenarios.items()}
    if len(set(names.values())) < len(worlds):
        raise InputError(f"{' '.join(worlds)}: world names must be unique")
    cases = [(world, number) for world in worlds for number in range(given["seed"], given["seed"] + seeds)]
    if film is not None:
        check_film(film)
    print_idle_settings(list(scenarios.values()), {"seed"} if seeds > 1 else ())
    marks = {f"{entrant.label} {world}": scenario for (world, entrant), scenario in scenarios.items()}
    mark = mark_of(marks, [(names[world], number) for world, number in cases])
    usual = Path("out") / file_name(f"compare-{'-'.join(names.values())}"[:100])
    with results_folder(out, usual, MARKER, mark, write_manifest=False) as (folder, facts):
        runs: list[Compared] = []
        logs: dict[str, Rollout] = {}
        for world, seed in cases:
            part = folder if len(cases) == 1 else folder / file_name(f"{names[world]}-{seed}")
            is_first = (world, seed) == cases[0]
            for entrant in entrants:
                scenario = dataclasses.replace(scenarios[world, entrant], seed=seed)
                result = _drive(scenario, entrant, part / entrant.label)
                if not runs:  # mark the folder early, so that an interrupted comparison owns its results
                    write_json(folder / MARKER, facts)
                if isinstance(result, PlannerError):
                    print_exception(result)
                    runs.append(Compared.failed(entrant.label, scenario, result))
                    continue
                command = repeat_command(scenario, entrant, world, robot, ends.words)
                write_run(result, part / entrant.label, command, figures=figures and is_first)
                runs.append(Compared.of(entrant.label, result, folder=str(part / entrant.label)))
                if is_first and result.rollout is not None:
                    logs[entrant.label] = result.rollout
        files = (
            {run.label: run.facts["folder"] for run in runs if run.facts["folder"]}
            if len(cases) == 1
            else {"folder": str(folder)}
        )
        comparison = {"differences": differences(runs), "same": same_drives(runs, given["smoothing"])}
        comparison["drives"] = [{"label": run.label, **run.facts} for run in runs]
        write_json(folder / MARKER, {**facts, **comparison})
        files |= _views(logs, folder, film, speed, figures)
    results = {"runs": {run.label: run.facts for run in runs[: len(entrants)]}, **comparison, "files": files}
    show(json, results, _lines(runs, len(cases) > 1, comparison, files))
    if len(logs) < 2:
        planned = "only one planner" if logs else "no planner"
        print_error(f"{planned} found a path: no comparison figure or film")
    if any(run.facts["outcome"] == PLANNER_FAULT for run in runs):
        return INTERNAL_ERROR
    return SUCCEEDED if all(run.facts["succeeded"] for run in runs) else FAILED


def _drive(scenario: "Scenario", entrant: Entrant, folder: Path) -> "Run | PlannerError":
    """Drive with a progress bar, after checking that the results can be written. Return the run, or the planner's error."""
    from antdrive.planners import PlannerError
    from antdrive.sim.pipeline import run

    check_folder(folder)
    with planning(f"{scenario.task.world.name}, seed {scenario.seed}: {entrant.label}"):
        try:
            return run(scenario)
        except PlannerError as error:
            return error


def _views(logs: "dict[str, Rollout]", folder: Path, film: Path | None, speed: float, figures: bool) -> dict[str, str]:
    """Write the figure and the film of the first world and seed. Return their paths."""
    files: dict[str, str] = {}
    if len(logs) > 1 and figures:
        from antdrive.views.figures.run_figures import comparison_figure

        comparison_figure(logs, folder / "comparison.png")
        files["figure"] = str(folder / "comparison.png")
    if len(logs) > 1 and film is not None:
        files["film"] = film_drives(list(logs.values()), film, speed=speed, titles=list(logs))["file"]
    return files


def _lines(runs: Sequence[Compared], many: bool, facts: Mapping[str, Any], files: Mapping[str, str]) -> Iterator[str]:
    yield from table(
        (*(("world", "seed") if many else ()), "planner", *COMPARED.values(), "outcome"),
        (
            (*((run.world, str(run.seed)) if many else ()), run.label, *run.cells, str(run.facts["sentence"]))
            for run in runs
        ),
    )
    if many:
        yield f"differences from {runs[0].label} where both succeeded: median (minimum to maximum)"
        heads = ("planner", "succeeded", "pairs", *COMPARED.values())
        yield from table(heads, map(difference_cells, facts["differences"]))
    yield from facts["same"]
    yield from file_lines(files)
