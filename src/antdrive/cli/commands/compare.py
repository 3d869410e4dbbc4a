"""`antdrive compare`."""

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from antdrive.base.errors import InputError
from antdrive.base.files import file_name, write_json
from antdrive.base.tables import file_lines
from antdrive.base.version import require_physics
from antdrive.cli import options
from antdrive.cli.campaign_tables import CampaignQuery, campaign_folders, compare_campaigns
from antdrive.cli.console import planning, print_error, print_traceback, show
from antdrive.cli.entrants import check_worlds, entrants_of
from antdrive.cli.exits import FAILED, SUCCEEDED
from antdrive.cli.options import argument, option
from antdrive.cli.output import film_drives, print_faults, print_idle_settings, results_folder
from antdrive.cli.scenario_options import Ends
from antdrive.runs.comparing import FAULTS, compare_scenarios
from antdrive.runs.results_folder import mark_of
from antdrive.sim.settings import COMPARED_SMOOTHING
from antdrive.views.run_folder import check_folder, formats_of, write_run

if TYPE_CHECKING:
    from antdrive.base.components import ComponentError
    from antdrive.sim.log.rollout import Rollout
    from antdrive.sim.pipeline import Run
    from antdrive.sim.scenario import Scenario

MARKER = "comparison.json"


@options.with_settings(("smoothing", "noise", "margin", "cell", "seed"), smoothing=COMPARED_SMOOTHING)
def compare(
    *,
    context: typer.Context,
    worlds: Annotated[list[str], argument("WORLD", "World names or files, or campaign folders.")],
    planner: Annotated[
        list[str] | None,
        option("NAME", "Planner; give two to six. LABEL=NAME labels one, to compare it under different options."),
    ] = None,
    settings: Annotated[
        list[str] | None,
        option(
            "GROUP.KEY=VALUE",
            "Option of a planner or label (aco-han.ants=50), of all planners (planner.ants=50) or of the controller "
            "(controller.braking=0.5). Repeatable.",
            "--set",
            "-s",
        ),
    ] = None,
    controller: Annotated[
        list[str] | None,
        option("NAME", "Controller; several are compared with one planner, or LABEL=NAME.  [default: pure-pursuit]"),
    ] = None,
    robot: options.Robot = "turtlebot",
    seeds: Annotated[int, option("NUMBER", "Seeds per world, starting at --seed.", min=1, max=10_000)] = 1,
    ends: Ends,
    out: options.Out = None,
    figures: options.Figures = None,
    no_figures: options.NoFigures = False,
    no_view: options.NoView = False,
    film: Annotated[Path | None, option("FILE", "Film the first pair in one picture: .mp4, .gif or .webp.")] = None,
    filming: options.Filming,
    query: CampaignQuery,
    json: options.Json = False,
    **given: Any,
) -> int:
    """Compare planners or controllers, in worlds or from campaigns.

    Worlds: pairs the planners by world and seed; planners drive their own plans, unless --smoothing is given. Figures and film
    show the first pair. Exit code 0: every run succeeded.
    Campaign folders of `antdrive sweep`: prints success rates with intervals, outcomes, and a test of every pair.
    """
    from antdrive.base.components import ComponentError
    from antdrive.sim.pipeline import run

    if campaigns := campaign_folders(worlds, context, query):
        compare_campaigns(campaigns, planner or (), query, json)
        return SUCCEEDED
    require_physics()
    check_worlds(worlds)
    places = [ends.of(world) for world in worlds]
    entrants = entrants_of(planner, settings, robot, controller)
    scenarios = {label: [one.scenario(place, given) for place in places] for label, one in entrants.items()}
    every = [scenario for several in scenarios.values() for scenario in several]
    names = list(dict.fromkeys(scenario.task.world.name for scenario in every))
    if len(names) < len(worlds):
        raise InputError(f"{' '.join(worlds)}: world names must be unique")
    drawn = formats_of(figures, no_figures)
    film_options = filming.checked(film, every, several=True)
    print_idle_settings(every, {"seed"} if seeds > 1 else ())
    numbers = range(given["seed"], given["seed"] + seeds)
    cases = [(name, number) for name in names for number in numbers]
    mark = mark_of([*entrants], worlds, [scenario.key for scenario in every], cases)
    usual = Path("out") / file_name(f"compare-{'-'.join(names)}"[:100])
    with results_folder(out, usual, MARKER, mark, write_manifest=False) as (folder, facts):

        def attempt(label: str, scenario: "Scenario") -> "tuple[Run | ComponentError, str | None]":
            """Drive with a progress bar, and write the run."""
            case = scenario.task.world.name, scenario.seed
            part = (folder if len(cases) == 1 else folder / file_name("{}-{}".format(*case))) / label
            check_folder(part)
            result: Run | ComponentError
            with planning(f"{case[0]}, seed {case[1]}: {label}"):
                try:
                    result = run(scenario)
                except ComponentError as error:
                    result = error
            write_json(folder / MARKER, facts)  # early, so that an interrupted comparison owns its results
            if isinstance(result, ComponentError):
                print_traceback(result)
                return result, None
            command = scenario.written.command() or ""
            write_run(result, part, command, drawn if case == cases[0] else None)
            return result, str(part)

        compared = compare_scenarios(scenarios, numbers, attempt)
        first = compared.runs[: len(entrants)]
        folders = {run.label: run.facts["folder"] for run in first if run.facts["folder"]}
        files = folders if len(cases) == 1 else {"folder": str(folder)}
        write_json(folder / MARKER, {**facts, **compared.as_dict()})
        files |= _views(compared.logs, folder, film, drawn, film_options, view=not no_view)
    results = {"runs": {run.label: run.facts for run in first}, **compared.as_dict(), "files": files}
    show(json, results, [*compared.lines(), *file_lines(files)])
    errors = Counter(run.facts["reason"] for run in compared.runs if run.facts["outcome"] in FAULTS)
    code = print_faults(dict(errors.most_common()))
    if len(compared.logs) < 2:
        planned = "only one planner" if compared.logs else "no planner"
        print_error(f"{planned} found a path: no comparison figure, page or film")
    return code or (SUCCEEDED if all(run.facts["succeeded"] for run in compared.runs) else FAILED)


def _views(
    logs: "Mapping[str, Rollout]",
    folder: Path,
    film: Path | None,
    formats: Sequence[str] | None,
    options: dict[str, Any],
    *,
    view: bool,
) -> dict[str, str]:
    """Write page, figure and film of the first world and seed. Return their paths. The page holds the first four drives."""
    files: dict[str, str] = {}
    if len(logs) < 2:
        return files
    if view:
        from antdrive.sim.facts import LoggedRun
        from antdrive.views.viewer.drive_page import MOST_DRIVES, write_page

        shown = [*logs][:MOST_DRIVES]
        if len(shown) < len(logs):
            print_error(f"drives.html shows the first {MOST_DRIVES} of {len(logs)} drives; for others: antdrive view")
        files["page"] = str(write_page([LoggedRun.of(logs[name]) for name in shown], folder / "drives.html", shown))
    if formats is not None:
        from antdrive.views.figures.canvas import written
        from antdrive.views.figures.run_figures import comparison_figure

        files |= written("figure", folder / "comparison", (".png", *formats), partial(comparison_figure, logs))
    if film is not None:
        files["film"] = film_drives(logs, film, **options)["file"]
    return files
