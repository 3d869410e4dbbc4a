"""The command line: reads words, calls the library, prints. Heavy modules are imported when a command needs them."""

from __future__ import annotations

import math
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from antdrive.sim.cli.console import as_json, bar, complain, planning, say, say_json, table
from antdrive.worlds.errors import InputError

if TYPE_CHECKING:
    from antdrive.sim.driving.perception import Perception
    from antdrive.sim.pipeline import Run
    from antdrive.sim.scenario import Scenario
    from antdrive.worlds import Disc, Task

SUCCEEDED, FAILED, WRONG_INPUT, INTERRUPTED, TERMINATED = 0, 1, 2, 130, 143
MANY = 5000  # cylinders of an imported map

app = typer.Typer(
    name="antdrive",
    help="Drive planned paths in physics: plan, drive, certify, film.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
worlds_app = typer.Typer(
    help="List, show, generate, import and export worlds.", no_args_is_help=True, rich_markup_mode=None
)
app.add_typer(worlds_app, name="worlds")

World = Annotated[str, typer.Argument(metavar="WORLD", help="A name of the catalogue or a world file.")]
Planner = Annotated[str, typer.Option("--planner", "-p", help="See `antdrive planners`.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", "-s", metavar="GROUP.KEY=VALUE", help="planner.ants=50, controller.lookahead_time=0.5"),
]
Robot = Annotated[str, typer.Option("--robot", "-r", help="A name of the catalogue or a robot file.")]
Seed = Annotated[int, typer.Option(min=0, max=2**63 - 1, help="All chance comes from it.")]
Margin = Annotated[float, typer.Option(min=0.0, max=100.0, help="Kept free around the robot by planners [m].")]
CellSize = Annotated[
    float | None, typer.Option(min=1e-6, max=1e6, help="Grid resolution [m]; the world's own by default.")
]
Smoothing = Annotated[str, typer.Option(help="What becomes of the plan's line: grid (as it is), taut or wide.")]
Noise = Annotated[
    float, typer.Option(min=0.0, max=100.0, help="How much of the robot's own noise; 0 is a perfect robot.")
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else.")]
Prelude = Annotated[
    float, typer.Option("--prelude", min=0.0, max=60.0, help="The film begins with so many seconds of planning.")
]
Vector = Annotated[bool, typer.Option("--vector", help="Write figures as PDF, too.")]
Figures = Annotated[bool, typer.Option(help="Draw them.")]
Out = Annotated[Path | None, typer.Option("--out", "-o", help="Folder for the results.")]


@app.command()
def run(
    world: World,
    planner: Planner = "ants",
    settings: Settings = None,
    robot: Robot = "turtlebot",
    seed: Seed = 0,
    margin: Margin = 0.03,
    cell: CellSize = None,
    smoothing: Smoothing = "clearance",
    noise: Noise = 0.0,
    unseen: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y,RADIUS", help="A cylinder that neither planner nor controller know of."),
    ] = None,
    time_limit: Annotated[float | None, typer.Option(min=1e-3, max=1e6, help="Simulated time allowed [s].")] = None,
    yields: Annotated[bool, typer.Option("--yield/--no-yield", help="Give way to movers.")] = True,
    replan: Annotated[
        bool,
        typer.Option(
            "--replan/--no-replan",
            help="Go round movers by new routes; else only back to a route left.",
        ),
    ] = True,
    sees: Annotated[
        str, typer.Option(metavar="WHAT[:METRES]", help="Of movers: positions, velocities or motions, within a reach.")
    ] = "velocities",
    out: Out = None,
    video: Annotated[Path | None, typer.Option(help="Also film it: .mp4, .gif or .webp.")] = None,
    prelude: Prelude = 0.0,
    vector: Vector = False,
    figures: Figures = True,
    gui: Annotated[bool, typer.Option("--gui", help="Then replay it in a window; needs a screen.")] = False,
    json: Json = False,
) -> int:
    """Plan, drive in physics, certify; exit 0 when the robot stopped at the goal and touched nothing."""
    from antdrive.planners import keep_best
    from antdrive.sim.driving.replanning import ReplanPolicy
    from antdrive.sim.pipeline import plan as make_plan
    from antdrive.sim.pipeline import run as drive_it

    scenario = _scenario(
        world, planner, settings, robot, seed=seed, margin=margin, cell=cell, smoothing=smoothing, noise=noise,
        time_limit=time_limit,
        unseen=tuple(_disc(text) for text in unseen or ()), perception=_knowledge(sees),
        **({} if yields else {"avoidance": None}), replanning=ReplanPolicy(around_movers=replan),
    )  # fmt: skip
    folder = out or Path("out") / _slug(scenario)
    if gui:
        from antdrive.sim.view.window import check_display

        check_display()
    if prelude > 0:
        from antdrive.planners import IterativePlanner

        if video is None:
            raise InputError("--prelude: belongs to a film; give --video, too")
        if not isinstance(scenario.planner, IterativePlanner):
            raise InputError(f"--prelude: {planner} does not plan in iterations; there is no field to show")
    if video is not None:
        _check_film(video)
    _make_folder(folder)
    with planning(f"planning with {planner}"), keep_best():
        grid, answer = make_plan(scenario)
    with bar("driving") as progress:
        result = drive_it(scenario, planned=(grid, answer), progress=progress)
    files = _write(result, folder, vector=vector, figures=figures)
    report = {**result.as_dict(), "files": files, "command": _command()}
    _write_json(folder / "result.json", report)
    if video is not None and result.rollout is not None:
        files["film"] = _film(result.rollout, video, prelude=prelude)["file"]
        _write_json(folder / "result.json", report)
    if json:
        say_json(report)
    else:
        _tell(result, files)
    if gui and result.rollout is not None:
        from antdrive.sim.view.window import show

        show(result.rollout)
    return SUCCEEDED if result.succeeded else FAILED


@app.command()
def plan(
    world: World,
    planner: Planner = "ants",
    settings: Settings = None,
    robot: Robot = "turtlebot",
    seed: Seed = 0,
    margin: Margin = 0.03,
    cell: CellSize = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Also draw the plan into this folder.")] = None,
    vector: Vector = False,
    json: Json = False,
) -> int:
    """Plan without driving; exit 0 when there is a path."""
    from antdrive.planners import keep_best
    from antdrive.sim.pipeline import plan as make_plan

    scenario = _scenario(world, planner, settings, robot, seed=seed, margin=margin, cell=cell)
    with planning(f"planning with {planner}"), keep_best():
        grid, answer = make_plan(scenario)
    files = {}
    if out is not None:
        from antdrive.sim.view.figures.plan_figures import plan_figures

        made = plan_figures(scenario.task, grid, answer, scenario.robot, out, name=planner, suffixes=_suffixes(vector))
        files = {name: str(path) for name, path in made.items()}
    facts = {
        "world": scenario.task.world.name, "planner": planner, "robot": scenario.robot.name, "seed": seed,
        "status": answer.status.name.lower(), "sentence": answer.status.value, "reason": answer.reason,
        "cost_m": answer.cost, "length_m": answer.line_length,
        "work": answer.work, "work_unit": answer.work_unit, "plan_s": answer.wall_s,
        "grid": {"rows": grid.shape[0], "cols": grid.shape[1], "cell": grid.cell, "inflate": grid.inflate},
        "options": {key: value if isinstance(value, bool | int | float | str | None) else str(value)
                    for key, value in answer.options.items()},
        "cells": answer.cells.tolist(), "files": files,
    }  # fmt: skip
    if json:
        say_json(facts)
    else:
        say(f"{scenario.task.world.name}: {planner} {answer.status.value}" + _because(answer.reason))
        if len(answer.cells):
            say(f"  length {answer.line_length:.3f} m over {len(answer.cells)} cells, {answer.work} {answer.work_unit}")
        say(f"  planned in {answer.wall_s * 1000:.1f} ms on {grid.shape[0]} x {grid.shape[1]} cells of {grid.cell:g} m")
        _tell_files(files)
    return SUCCEEDED if answer.solved else FAILED


@app.command()
def render(
    rollouts: Annotated[list[Path], typer.Argument(metavar="ROLLOUT.npz...", help="Several are shown side by side.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The film: .mp4, .gif or .webp; .png gives one frame.")],
    camera: Annotated[str, typer.Option(help="oblique, top or follow.")] = "oblique",
    size: Annotated[str, typer.Option(help="Width x height in pixels.")] = "1280x720",
    fps: Annotated[int, typer.Option(min=1, max=240)] = 30,
    speed: Annotated[float, typer.Option(min=0.01, max=100, help="2 is twice as fast as life.")] = 1.0,
    prelude: Prelude = 0.0,
    json: Json = False,
) -> int:
    """Film rollouts, from any camera, without simulating again; two to six side by side."""
    from antdrive.sim.log.rollout import Rollout

    logs = [Rollout.load(path) for path in rollouts]
    log, shape = logs[0], _size(size)
    if len(logs) > 1:
        if prelude or out.suffix.lower() == ".png":
            raise InputError(f"--out {out}: several rollouts give a film, without a prelude")
        facts: dict[str, Any] = _compare_film(logs, out, camera=camera, size=shape, fps=fps, speed=speed)
    elif out.suffix.lower() == ".png":
        from antdrive.sim.view.film.video import still

        still(log, out, camera=camera, size=shape, note=_note(log))
        facts = {"file": str(out), "frames": 1}
    else:
        facts = _film(log, out, camera=camera, size=shape, fps=fps, speed=speed, prelude=prelude)
    if json:
        say_json(facts)
    else:
        _tell_files({"film": facts["file"]})
    return SUCCEEDED


@app.command()
def compare(
    world: World,
    planner: Annotated[list[str], typer.Option("--planner", "-p", help="Once for each planner.")],
    robot: Robot = "turtlebot",
    seed: Seed = 0,
    margin: Margin = 0.03,
    cell: CellSize = None,
    smoothing: Smoothing = "clearance",
    noise: Noise = 0.0,
    out: Out = None,
    figures: Figures = True,
    video: Annotated[Path | None, typer.Option(help="Film them side by side: .mp4, .gif or .webp.")] = None,
    speed: Annotated[float, typer.Option(min=0.01, max=100, help="Of the film; 2 is twice as fast as life.")] = 1.0,
    json: Json = False,
) -> int:
    """Drive the same task with several planners; exit 0 when every run succeeded."""
    from antdrive.sim.pipeline import run as drive_it

    scenarios = [
        _scenario(world, name, None, robot, seed=seed, margin=margin, cell=cell, smoothing=smoothing, noise=noise)
        for name in planner
    ]
    folder = out or Path("out") / f"compare-{scenarios[0].task.world.name}"
    if len(set(planner)) < len(planner) or not 2 <= len(planner) <= 6:
        raise InputError(f"--planner {' '.join(planner)}: name two to six different planners")
    if video is not None:
        _check_film(video)
    results, files = {}, {}
    for name, scenario in zip(planner, scenarios, strict=True):
        _make_folder(folder / name)
        with planning(f"planning and driving with {name}"):
            results[name] = result = drive_it(scenario)
        written = _write(result, folder / name, figures=figures)
        _write_json(
            folder / name / "result.json",
            {**result.as_dict(), "files": written, "command": _alone(scenario, world, name)},
        )
        files[name] = str(folder / name)
    logs = [result.rollout for result in results.values() if result.rollout is not None]
    if len(logs) > 1 and figures:
        from antdrive.sim.view.figures.run_figures import comparison_figure

        named = {name: result.rollout for name, result in results.items() if result.rollout is not None}
        files["figure"] = str(comparison_figure(named, folder / "comparison.png"))
    if video is not None and len(logs) > 1:
        files["film"] = _compare_film(logs, video, speed=speed)["file"]
    if json:
        say_json({"runs": {name: result.as_dict() for name, result in results.items()}, "files": files})
    else:
        table(
            ("planner", "plan m", "driven m", "s", "least m", "outcome"),
            ((name, *_numbers_of(result), result.outcome.value) for name, result in results.items()),
        )
        _tell_files(files)
    if len(logs) < 2:
        complain(
            f"{'only one planner' if logs else 'no planner'} found a path: there is nothing to compare in a figure or film"
        )
    return SUCCEEDED if all(result.succeeded for result in results.values()) else FAILED


@app.command()
def verify(
    rollouts: Annotated[list[Path], typer.Argument(metavar="ROLLOUT.npz...")],
    json: Json = False,
) -> int:
    """Check drives again from their logs alone; exit 0 when each is certified to have touched nothing."""
    from antdrive.sim.log.certificate import certify, in_metres
    from antdrive.sim.log.rollout import Rollout

    checked = {str(path): certify(Rollout.load(path)) for path in rollouts}
    if json:
        say_json({"certified": all(c.certified for c in checked.values()),
                  "rollouts": {path: c.as_dict() for path, c in checked.items()}})  # fmt: skip
    else:
        for path, c in checked.items():
            verdict = c.verdict
            say(
                f"{path}: {verdict}: least clearance {in_metres(c.min_clearance)}, between steps at least {in_metres(c.bound)}"
            )
            for problem in c.problems:
                say(f"  {problem}")
    return SUCCEEDED if all(c.certified for c in checked.values()) else FAILED


@app.command()
def margin(
    context: typer.Context,
    target: Annotated[
        str | None, typer.Argument(metavar="[ROLLOUT.npz|WORLD]", help="A drive's log, or a world.")
    ] = None,
    kind: Annotated[str | None, typer.Option("--generate", help="Instead: a class of worlds, forest or barn.")] = None,
    planner: Planner = "astar",
    settings: Settings = None,
    robot: Robot = "turtlebot",
    seed: Seed = 0,
    seeds: Annotated[int, typer.Option(min=1, max=10_000, help="How many drives, with seeds from --seed on.")] = 10,
    cell: CellSize = None,
    smoothing: Smoothing = "clearance",
    noise: Noise = 0.0,
    speed: Annotated[float | None, typer.Option(min=1e-3, help="Drive no faster than this [m/s].")] = None,
    reserve: Annotated[float, typer.Option(min=0.0, max=1.0, help="What must be left of the margin [m].")] = 0.005,
    json: Json = False,
) -> int:
    """Split a drive's margin by what ate of it, or find the smallest margin that is safe; exit 0 when there is one."""
    if target is not None and target.endswith(".npz"):
        for name in context.params.keys() - {"target", "json"}:
            source = context.get_parameter_source(name)
            if source is not None and source.name == "COMMANDLINE":
                word = {"kind": "generate", "settings": "set"}.get(name, name)
                raise InputError(f"--{word}: {target} has been driven already; this is for a world, or for --generate")
        return _tell_budget(target, json)
    if (target is None) == (kind is None):
        raise InputError("margin: name a rollout, a world, or a class of worlds with --generate forest|barn")
    from dataclasses import asdict, replace

    from antdrive.sim.log.margin import find_margin
    from antdrive.sim.pipeline import run as drive_it

    base = _scenario(target or "empty", planner, settings, robot, cell=cell, smoothing=smoothing, noise=noise)
    if speed is not None:
        base = replace(base, robot=replace(base.robot, max_speed=min(speed, base.robot.max_speed)))
    tasks = {n: base.task if kind is None else _generated(kind, n) for n in range(seed, seed + seeds)}

    def drive(wide: float, n: int) -> Any:
        return drive_it(replace(base, task=tasks[n], margin=wide, seed=n))

    trials = []
    with planning("looking for the smallest safe margin"):
        for trial in find_margin(drive, list(tasks), reserve=reserve):
            trials.append(trial)
    safe = [trial.margin for trial in trials if trial.safe]
    facts: dict[str, Any] = {
        "margin_m": min(safe) if safe else None, "reserve_m": reserve, "world": target or kind, "robot": base.robot.name,
        "max_speed": base.robot.max_speed, "noise": noise, "planner": planner, "smoothing": smoothing,
        "seeds": [seed, seed + seeds - 1],
        "trials": [asdict(trial) for trial in trials],
    }  # fmt: skip
    if json:
        say_json(facts)
    else:
        table(
            ("margin m", "driven", "closed", "least room left m", "failed"),
            ((f"{t.margin:.3f}", str(t.drives), str(t.impassable), f"{t.left:.4f}" if t.drives else "-",
              "" if t.failed is None else f"seed {t.failed}") for t in sorted(trials, key=lambda t: t.margin)),
        )  # fmt: skip
        found = f"{facts['margin_m']:.3f} m" if safe else "none up to 0.2 m"
        say(f"smallest safe margin for {base.robot.name} at up to {base.robot.max_speed:g} m/s: {found}")
    return SUCCEEDED if safe else FAILED


@app.command()
def reproduce(
    paper: Annotated[
        str, typer.Argument(metavar="PAPER", help="han2007, suganthi2019, ibraheem2016, lee2008, hasan or all.")
    ],
    out: Out = None,
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Trials of each experiment.")] = 10,
    jobs: Annotated[int, typer.Option(min=1, max=256, help="Processes.")] = 1,
    vector: Vector = False,
    json: Json = False,
) -> int:
    """Measure a paper's experiments again: printed beside measured, and the paper's figures."""
    from antdrive.sim.papers.experiments import PAPERS
    from antdrive.sim.papers.reproduce import HEADS, check_papers, row_cells
    from antdrive.sim.papers.reproduce import reproduce as measure_again

    folder = out or Path("out") / f"reproduce-{paper}"
    chosen = list(PAPERS) if paper == "all" else [paper]
    check_papers(chosen)
    _make_folder(folder)
    with bar("planning") as progress:
        rows, files = measure_again(
            chosen, folder, seeds=seeds, suffixes=_suffixes(vector), jobs=jobs, progress=progress
        )
    if json:
        say_json({"rows": [vars(row) for row in rows], "files": files})
    else:
        table(HEADS, map(row_cells, rows))
        _tell_files(files)
    return SUCCEEDED


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Holds folders that `run --out` wrote.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The page: .html, or .md for a pull request.")],
    title: Annotated[str | None, typer.Option(help="The folder's name by default.")] = None,
    embed_films: Annotated[bool, typer.Option("--embed-films", help="Put films into the page.")] = False,
    json: Json = False,
) -> int:
    """Write one page about many runs: a table to sort and filter, films, figures, and the commands that repeat them."""
    from antdrive.sim.view.report.report import write_report

    count = write_report(folder, out, title=title, embed_films=embed_films)
    if json:
        say_json({"file": str(out), "runs": count, "bytes": out.stat().st_size})
    else:
        say(f"{count} runs, {out.stat().st_size / 1e6:.2f} MB")
        _tell_files({"report": str(out)})
    return SUCCEEDED


@app.command()
def planners(json: Json = False) -> int:
    """List the planners with their options."""
    from antdrive.planners import describe, list_planners

    known = list_planners()
    if json:
        say_json({
            name: {"about": describe(p), "options": {f.name: _plain(getattr(p, f.name)) for f in _fields(p)}}
            for name, p in known.items()
        })  # fmt: skip
        return SUCCEEDED
    for name, p in known.items():
        say(f"{name:14} {describe(p)}")
        options = [f"{f.name}={getattr(p, f.name)}" for f in _fields(p)]
        if options:
            say(f"{'':14}   {', '.join(options)}")
    return SUCCEEDED


@app.command()
def robots(json: Json = False) -> int:
    """List the robots of the catalogue."""
    from antdrive.robots import list_robots, load_robot, robot_to_dict

    specs = [load_robot(name) for name in list_robots()]
    if json:
        say_json({spec.name: robot_to_dict(spec) for spec in specs})
    else:
        table(
            ("robot", "radius m", "m/s", "m/s2", "about"),
            ((s.name, f"{s.radius:.3f}", f"{s.max_speed:g}", f"{s.max_acceleration:g}", s.source or "") for s in specs),
        )
    return SUCCEEDED


@app.command()
def schema(kind: Annotated[str, typer.Argument(help="world or robot.")] = "world") -> int:
    """Print the JSON Schema of a file, for editors."""
    from antdrive.robots import robot_schema
    from antdrive.worlds import task_schema

    schemas = {"world": task_schema, "robot": robot_schema}
    if kind not in schemas:
        raise InputError(f"schema: there is none for {kind!r}; choose from {', '.join(schemas)}")
    say_json(schemas[kind]())
    return SUCCEEDED


@worlds_app.command("list")
def list_worlds(json: Json = False) -> int:
    """List the catalogue."""
    from antdrive.worlds import list_worlds, load_task

    tasks = {name: load_task(name) for name in list_worlds()}
    if json:
        say_json({name: _task_facts(task) for name, task in tasks.items()})
    else:
        table(
            ("world", "size m", "obstacles", "movers", "cell m", "about"),
            (
                (name, "{:g} x {:g}".format(*task.world.size), str(len(task.world.obstacles)),
                 str(len(task.world.movers)), f"{task.cell:g}", task.world.source or "")
                for name, task in tasks.items()
            ),
        )  # fmt: skip
    return SUCCEEDED


@worlds_app.command("show")
def show_world(
    world: World,
    robot: Robot = "turtlebot",
    margin: Margin = 0.03,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Draw it into this file (.png, .svg, .pdf).")] = None,
    json: Json = False,
) -> int:
    """Tell what a world holds and whether a robot can pass it, and draw it."""
    from antdrive.planners import Query, load_planner, reachable
    from antdrive.robots import load_robot
    from antdrive.worlds import load_task, rasterise, task_to_dict

    task, spec = load_task(world), load_robot(robot)
    grid = rasterise(task.world, task.cell, spec.radius + margin)
    query = Query.between(grid, task)
    passable = query.blocked_end is None and reachable(query)
    if out is not None:
        import numpy as np

        from antdrive.sim.view.figures.plan_figures import plan_figure

        plan_figure(task, grid, load_planner("astar").plan(query, np.random.default_rng(0)), spec, out)
    if json:
        say_json({**task_to_dict(task), "passable": passable, "robot": spec.name, "margin": margin})
        return SUCCEEDED
    for key, value in _task_facts(task).items():
        say(f"{key:14} {value}")
    say(f"{'passable':14} {'yes' if passable else 'no'}, for {spec.name} with a margin of {margin:g} m")
    _tell_files({"figure": str(out)} if out else {})
    return SUCCEEDED


@worlds_app.command("generate")
def generate_world(
    kind: Annotated[str, typer.Argument(help="forest (han2007's rule) or barn (the BARN cellular automaton).")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The world file to write.")],
    seed: Seed = 0,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", "-s", metavar="KEY=VALUE", help="forest: count=20; barn: fill=0.25"),
    ] = None,
) -> int:
    """Write a random world."""
    import numpy as np

    from antdrive.worlds import GENERATORS, generate, save_task

    options = dict(_pair(text) for text in settings or ())
    if kind not in GENERATORS:
        raise InputError(f"generate: unknown kind {kind!r}; choose from {', '.join(GENERATORS)}")
    task = generate(kind, np.random.default_rng(seed), options, name=out.stem, note=f"seed {seed}")
    save_task(task, out)
    _tell_files({"world": str(out)})
    return SUCCEEDED


@worlds_app.command("import")
def import_world(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="Gazebo SDF (.sdf, .world), a map_server .yaml, a MovingAI .map, or DynaBARN's .json."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="The world file to write, by default FILE's name, here; for .json a folder."),
    ] = None,
    barn: Annotated[bool, typer.Option("--barn", help="SDF: with the start and goal of the BARN challenge.")] = False,
    start: Annotated[str | None, typer.Option(metavar="X,Y,YAW", help="Maps have none [m, m, rad].")] = None,
    goal: Annotated[str | None, typer.Option(metavar="X,Y", help="Maps have none [m].")] = None,
    bounds: Annotated[str | None, typer.Option(metavar="XMIN,YMIN,XMAX,YMAX", help="SDF: the walls [m].")] = None,
    cell: CellSize = None,
    skip_unsupported: Annotated[bool, typer.Option(help="SDF: leave out what is no cylinder.")] = False,
    unknown: Annotated[
        str | None, typer.Option(help="map_server: unknown cells are blocked (default) or free.")
    ] = None,
    overhang: Annotated[
        float | None,
        typer.Option(
            min=0, max=1e6, help="Maps: how far discs may reach beyond blocked cells [m]; default 0.207 cells."
        ),
    ] = None,
    resolution: Annotated[
        float | None, typer.Option(min=1e-6, max=1e6, help="MovingAI: the side of a cell [m], default 1.")
    ] = None,
    problem: Annotated[
        int | None, typer.Option(min=0, help="MovingAI: start and goal of this problem of FILE.scen, from 0.")
    ] = None,
    json: Json = False,
) -> int:
    """Turn a world or map of another program into a world file.

    Worlds consist of upright cylinders. Those of an SDF file stay what they are. The blocked cells of a map are covered by
    cylinders: wholly wherever free ground joined to the start or the goal touches them, with as little beyond them as
    the disc around a single cell needs, so that what is driven here is never wider than the map. The world's source tells
    how far they reach.
    """
    from antdrive.worlds import import_barn, import_map_server, import_movingai_task, import_sdf, save_task

    ends = {"start": _numbers("start", start, 3), "goal": _numbers("goal", goal, 2)}
    given: dict[str, Any] = {
        **ends, "bounds": _numbers("bounds", bounds, 4), "cell": cell, "unknown": unknown, "overhang": overhang,
        "resolution": resolution, "problem": problem, "barn": barn or None, "skip_unsupported": skip_unsupported or None,
    }  # fmt: skip
    kinds: dict[str, tuple[str, tuple[str, ...]]] = {
        "barn": ("--barn", ("barn", "cell")),
        "sdf": ("an SDF world", ("start", "goal", "bounds", "cell", "skip_unsupported")),
        "map_server": ("a map_server map", ("start", "goal", "cell", "unknown", "overhang")),
        "dynabarn": ("DynaBARN", ("cell",)),
        "movingai": ("a MovingAI map", ("start", "goal", "cell", "overhang", "resolution", "problem")),
    }
    kind = _kind_of(path)
    about, known = kinds["barn" if barn and kind == "sdf" else kind]
    options = {key: value for key, value in given.items() if value is not None}
    for key in options:
        if key not in known:
            raise InputError(
                f"--{key.replace('_', '-')}: {about} "
                + ("brings its own" if key in ("start", "goal", "bounds") else f"takes {_flags(known)} only")
            )
    if kind == "dynabarn":
        return _import_dynabarn(path, out or Path(path.stem), cell)
    target = _target(path, out)
    options.pop("barn", None)
    if kind == "map_server":
        word = options.pop("unknown", "blocked")
        if word not in ("blocked", "free"):
            raise InputError(f"--unknown {word}: write blocked or free")
        task = import_map_server(path, unknown_is_free=word == "free", **options)
    else:
        task = {"sdf": import_barn if barn else import_sdf, "movingai": import_movingai_task}[kind](path, **options)
    save_task(task, target)
    if json:
        say_json({**_task_facts(task), "files": {"world": str(target)}})
    else:
        say(f"{task.world.name}: {len(task.world.obstacles)} obstacles, {task.world.source}")
        if "overhang" in known and len(task.world.obstacles) > MANY:
            say("  so many make runs slow to start; a larger --overhang needs fewer")
        _tell_files({"world": str(target)})
    return SUCCEEDED


@worlds_app.command("export")
def export_world(
    world: World,
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Gazebo: .sdf or .world; map_server: .yaml (and .pgm); MovingAI: .map.")
    ],
    resolution: Annotated[
        float | None, typer.Option(min=1e-6, max=1e6, help="Maps: the side of a cell [m]; the world's own by default.")
    ] = None,
    json: Json = False,
) -> int:
    """Write a world for another program, told by the suffix.

    SDF keeps everything. In a map, a cell is blocked when a cylinder reaches into it; a world can be had back from that, but
    not the same. A .map gets a .scen beside it with the way from start to goal, if there is one on its cells.
    """
    from antdrive.worlds import export_map_server, export_sdf, load_task

    suffix = out.suffix.lower()
    if suffix not in (".sdf", ".world", ".yaml", ".yml", ".map"):
        raise InputError(f"--out {out}: worlds are written as .sdf, .world, .yaml (map_server) or .map (MovingAI)")
    task = load_task(world)
    if out.exists() and Path(world).exists() and out.samefile(world):
        raise InputError(f"--out {out}: is the world itself; choose another name")
    files = {"map" if suffix not in (".sdf", ".world") else "sdf": str(out)}
    if suffix in (".sdf", ".world"):
        if resolution is not None:
            raise InputError("--resolution: an SDF world has no cells")
        export_sdf(task, out)
    elif suffix == ".map":
        files |= _export_movingai(task, out, resolution)
    else:
        files["image"] = str(export_map_server(task, out, resolution=resolution))
    if json:
        say_json({"world": task.world.name, "files": files})
    else:
        _tell_files(files)
    return SUCCEEDED


def _export_movingai(task: Task, out: Path, resolution: float | None) -> dict[str, str]:
    """Write the map and, where its cells have a way, the problem; the problem's file."""
    import numpy as np

    from antdrive.planners import Query, load_planner
    from antdrive.worlds import Grid, MapProblem, export_movingai_map, export_movingai_problems

    cells = export_movingai_map(task, out, resolution=resolution)
    start, goal = cells.cell_at(*task.start[:2]), cells.cell_at(*task.goal)
    beside = out.with_name(f"{out.name}.scen")
    beside.unlink(missing_ok=True)  # an earlier one would belong to another map
    if start is None or goal is None or not (cells.free[start] and cells.free[goal]):
        return {}
    answer = load_planner("dijkstra").plan(Query(Grid.from_free(cells.free), start, goal), np.random.default_rng(0))
    if not answer.solved:
        return {}
    found = MapProblem(start, goal, answer.cost, f"{answer.cost:.8f}", out.name, int(answer.cost // 4))
    export_movingai_problems([found], cells.free.shape, beside)
    return {"problem": str(beside)}


def _kind_of(path: Path) -> str:
    """What a file to import is, by its suffix and, for YAML, by its keys."""
    suffix = path.suffix.lower()
    if suffix in (".sdf", ".world"):
        return "sdf"
    if suffix == ".map":
        return "movingai"
    if suffix == ".json":
        return "dynabarn"
    if suffix in (".pgm", ".png", ".bmp"):
        raise InputError(f"{path}: is an image; give the map's .yaml file, which tells how to read it")
    if suffix not in (".yaml", ".yml"):
        raise InputError(
            f"{path}: cannot be imported; .sdf, .world, .yaml (map_server), .map (MovingAI) and .json (DynaBARN) can"
        )
    return "map_server"


def _target(path: Path, out: Path | None) -> Path:
    """Where an imported world goes: never over what it comes from, nor unasked over another file."""
    target = out or Path(f"{path.stem}.yaml")
    if target.exists():
        if path.exists() and target.samefile(path):
            raise InputError(f"{target}: is the file to import; give another with --out")
        if out is None:
            raise InputError(f"{target}: exists; give --out to say where the world goes")
    return target


def _flags(keys: tuple[str, ...]) -> str:
    return ", ".join(f"--{key.replace('_', '-')}" for key in keys)


def _import_dynabarn(path: Path, out: Path, cell: float | None) -> int:
    from antdrive.worlds import import_dynabarn, save_task

    tasks = import_dynabarn(path, **({} if cell is None else {"cell": cell}))
    files = [out / f"{_file_name(task.world.name)}.yaml" for task in tasks]
    twice = next((file for i, file in enumerate(files) if file in files[:i]), None)
    if twice is not None:
        raise InputError(f"{path}: two worlds would be written to {twice}; give them different names")
    for task, file in zip(tasks, files, strict=True):
        save_task(task, file)
        _tell_files({"world": str(file)})
    return SUCCEEDED


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        say(f"antdrive {version('antdrive')}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Say so.")] = False,
) -> None:
    pass


def _scenario(world: str, planner: str, settings: list[str] | None, robot: str, **rest: Any) -> Scenario:
    import dataclasses

    from antdrive.planners.registry import parse
    from antdrive.robots import PurePursuit
    from antdrive.sim.scenario import Scenario

    groups: dict[str, dict[str, str]] = {"planner": {}, "controller": {}}
    for text in settings or ():
        key, value = _pair(text)
        group, _, name = key.partition(".")
        if group not in groups or not name:
            raise InputError(f"--set {text}: write GROUP.KEY=VALUE with a group of {', '.join(groups)}")
        groups[group][name] = value
    known = [f.name for f in dataclasses.fields(PurePursuit)]
    for name in groups["controller"]:
        if name not in known:
            raise InputError(f"controller.{name}: unknown; choose from {', '.join(known)}")
    values = {name: parse(f"controller.{name}", float, value) for name, value in groups["controller"].items()}
    try:
        controller = PurePursuit(**values)
    except ValueError as error:
        raise InputError(f"controller.{error}") from None
    try:
        return Scenario.of(world, planner, robot, options=groups["planner"], controller=controller, **rest)
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"--{error}") from None


def _knowledge(text: str) -> Perception:
    from antdrive.sim.driving.perception import Perception

    told, mark, metres = text.partition(":")
    try:
        reach = float(metres) if mark else math.inf
    except ValueError:
        raise InputError(f"--sees {text}: write WHAT or WHAT:METRES, such as positions:3") from None
    try:
        return Perception(kind=told, range=reach)  # type: ignore[arg-type]
    except ValueError as error:
        raise InputError(f"--sees {text}: {error}") from None


def _pair(text: str) -> tuple[str, str]:
    key, mark, value = text.partition("=")
    if not mark or not key:
        raise InputError(f"--set {text}: write KEY=VALUE")
    return key.strip(), value.strip()


def _generated(kind: str, seed: int) -> Task:
    import numpy as np

    from antdrive.worlds import GENERATORS, generate

    if kind not in GENERATORS:
        raise InputError(f"--generate {kind}: unknown kind; choose from {', '.join(GENERATORS)}")
    return generate(kind, np.random.default_rng(seed), {}, name=f"{kind}-{seed}", note=f"seed {seed}")


def _tell_budget(path: str, json: bool) -> int:
    from antdrive.sim.log.margin import budget
    from antdrive.sim.log.rollout import Rollout

    spent = budget(Rollout.load(Path(path)))
    if json:
        say_json(spent.as_dict())
        return SUCCEEDED
    where = f"({spent.x:.2f}, {spent.y:.2f}), t = {spent.t:.2f} s"
    say(f"{path}: margin {spent.margin:.3f} m, least room left around its disc {spent.left:.4f} m at {where}")
    table(
        ("cause", "at most m", "at", "at the tightest place m"),
        ((s.cause, f"{s.metres:.4f}", f"({s.x:.2f}, {s.y:.2f}), {s.t:.2f} s" if s.metres else "-", f"{s.at_tightest:+.4f}")
         for s in spent.contributions),
    )  # fmt: skip
    if spent.largest.metres:
        say(f"the largest loss is due to {spent.largest.cause}")
    return SUCCEEDED


def _numbers(key: str, text: str | None, count: int) -> tuple[float, ...] | None:
    if text is None:
        return None
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not all(abs(value) <= 1e6 for value in values):
        raise InputError(f"--{key} {text}: write {count} numbers separated by commas, none beyond a million")
    return values


def _disc(text: str) -> Disc:
    from antdrive.worlds import Disc

    values = _numbers("unseen", text, 3)
    assert values is not None
    try:
        return Disc(*values)
    except ValueError as error:
        raise InputError(f"--unseen {text}: {error}") from None


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (text.isascii() and width.isdigit() and height.isdigit()):
        raise InputError(f"--size {text}: write WIDTHxHEIGHT in pixels, such as 1280x720")
    return int(width), int(height)


def _slug(scenario: Scenario) -> str:
    parts = (scenario.task.world.name, scenario.planner_name, scenario.robot.name, str(scenario.seed))
    return "-".join(map(_file_name, parts))


def _file_name(name: str) -> str:
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in name)


FIGURES = ("overview", "certificate", "plan", "tour", "history", "field-bars", "field-contours")
OWN_FILES = ("result.json", "rollout.npz", *(name + suffix for name in FIGURES for suffix in (".png", ".pdf")))


def _write(result: Run, folder: Path, *, vector: bool = False, figures: bool = True) -> dict[str, str]:
    from antdrive.sim.view.figures.plan_figures import plan_figure, plan_figures
    from antdrive.sim.view.figures.run_figures import certificate_figure, overview

    s = result.scenario
    files = {"result": str(folder / "result.json")}
    suffixes = _suffixes(vector)
    for name in OWN_FILES:
        (folder / name).unlink(missing_ok=True)  # of an earlier run; it would belie this one's result
    if not figures:
        return files | ({} if result.rollout is None else {"rollout": str(result.rollout.save(folder / "rollout.npz"))})
    if result.rollout is None:
        files["figure"] = str(plan_figure(s.task, result.grid, result.plan, s.robot, folder / "overview.png"))
        return files
    files["rollout"] = str(result.rollout.save(folder / "rollout.npz"))
    for suffix in suffixes:
        end = "" if suffix == suffixes[0] else f" {suffix[1:]}"
        files["figure" + end] = str(overview(result.rollout, folder / f"overview{suffix}"))
        if result.certificate is not None:
            path = certificate_figure(result.rollout, result.certificate, folder / f"certificate{suffix}")
            files["certificate" + end] = str(path)
    made = plan_figures(s.task, result.grid, result.plan, s.robot, folder, name=s.planner_name, suffixes=suffixes)
    return files | {name: str(path) for name, path in made.items()}


def _suffixes(vector: bool) -> tuple[str, ...]:
    return (".png", ".pdf") if vector else (".png",)


def _make_folder(folder: Path) -> None:
    """Make sure, before the work, that its results can be written."""
    from antdrive.worlds.files.atomic import written_whole

    probe = folder / ".antdrive"
    try:
        with written_whole(probe) as temporary:
            temporary.touch()
    except InputError as error:
        raise InputError(str(error).replace(str(probe), str(folder), 1)) from None
    probe.unlink(missing_ok=True)


def _film(log: Any, path: Path, **options: Any) -> dict[str, Any]:
    from antdrive.sim.view.film.video import film

    with bar("filming") as progress:
        info = film(log, path, note=_note(log), progress=progress, **options)
    return {
        "file": str(path),
        "frames": info.frames,
        "size": list(info.size),
        "fps": info.fps,
        "renderer": info.renderer,
    }


def _compare_film(logs: list[Any], path: Path, **options: Any) -> dict[str, Any]:
    from antdrive.sim.view.film.compare import compare_film

    with bar("filming") as progress:
        info = compare_film(logs, path, progress=progress, **options)
    return {
        "file": str(path), "frames": info.frames, "size": list(info.size), "fps": info.fps, "renderer": info.renderer,
    }  # fmt: skip


def _alone(scenario: Scenario, world: str, planner: str) -> str:
    """The command that makes one of several runs again."""
    import shlex

    given = {"--planner": planner, "--robot": scenario.robot.name, "--seed": scenario.seed, "--margin": scenario.margin,
             "--smoothing": scenario.smoothing, "--noise": scenario.noise}  # fmt: skip
    words = [str(word) for pair in given.items() for word in pair]
    cell = [] if scenario.cell is None else ["--cell", str(scenario.cell)]
    return shlex.join(["antdrive", "run", world, *words, *cell])


def _numbers_of(result: Run) -> tuple[str, ...]:
    if result.rollout is None:
        return ("-",) * 4
    facts = result.as_dict()["metrics"]
    names = ("path_length_m", "driven_length_m", "duration_s", "min_clearance_m")
    return tuple(f"{facts[name]:.3f}" for name in names)


def _check_film(path: Path) -> None:
    from antdrive.sim.view.film.encoder import ENCODERS

    if path.suffix.lower() not in ENCODERS:
        raise InputError(f"--video {path}: films are written as {', '.join(ENCODERS)}")
    if path.is_dir():
        raise InputError(f"--video {path}: is a directory; name a file")
    _make_folder(path.parent)


def _note(log: Any) -> str:
    from antdrive.sim.log.certificate import certify

    c = certify(log)
    return f"certified: never closer than {c.bound:.3f} m" if c.certified else "not certified collision-free"


def _write_json(path: Path, value: Any) -> None:
    from antdrive.worlds.files.atomic import written_whole

    with written_whole(path) as temporary:
        temporary.write_text(as_json(value) + "\n", encoding="utf-8")


def _tell(result: Run, files: dict[str, str]) -> None:
    from antdrive.sim.log.certificate import in_metres

    s = result.scenario
    say(f"{s.task.world.name}: {s.robot.name} with {s.planner_name}: {result.outcome.value}" + _because(result.reason))
    if result.rollout is not None and result.certificate is not None:
        facts = result.as_dict()["metrics"]
        say(
            f"  drove {facts['driven_length_m']:.2f} m in {facts['duration_s']:.1f} s "
            f"(route {facts['route_length_m']:.2f} m); tracking error at most {facts['tracking_error_max_m']:.3f} m"
        )
        if facts["replans"] or facts["avoiding_s"]:
            say(
                f"  replanned {facts['replans']:.0f} times, gave way to moving obstacles for {facts['avoiding_s']:.1f} s"
            )
        c = result.certificate
        verdict = c.verdict
        say(f"  {verdict}: least clearance {in_metres(c.min_clearance)}, between steps at least {in_metres(c.bound)}")
        for problem in c.problems:
            say(f"    {problem}")
    _tell_files(files)


def _tell_files(files: dict[str, str]) -> None:
    width = max([8, *map(len, files)])
    for name, path in files.items():
        say(f"  {name:{width}} {path}")


def _because(reason: str) -> str:
    return f" ({reason})" if reason else ""


def _task_facts(task: Task) -> dict[str, Any]:
    return {
        "name": task.world.name, "source": task.world.source, "bounds": list(task.world.bounds),
        "start": list(task.start), "goal": list(task.goal), "goal_tolerance": task.goal_tolerance,
        "cell": task.cell, "obstacles": len(task.world.obstacles), "movers": len(task.world.movers),
    }  # fmt: skip


def _fields(planner: Any) -> tuple[Any, ...]:
    import dataclasses

    return dataclasses.fields(planner) if dataclasses.is_dataclass(planner) else ()


def _plain(value: Any) -> Any:
    return value if isinstance(value, bool | int | float | str | None) else str(value)


def _command() -> str:
    import shlex

    return shlex.join(["antdrive", *sys.argv[1:]])


# What the command line raises for every wrong word; typer exports only this descendant of it.
_USAGE_ERROR: Any = typer.BadParameter.__mro__[2]


def _subcommand(context: Any) -> list[str]:
    """The words that name what was being called, below the program's own name."""
    if context is None or context.parent is None:
        return []
    return [*_subcommand(context.parent), context.info_name]


def main() -> None:
    """Run the command line; the exit code says how it went."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))  # so that half-written files are cleared away
    try:
        code = app(standalone_mode=False)
    except InputError as error:
        complain(str(error))
        code = WRONG_INPUT
    except (KeyboardInterrupt, typer.Abort):
        code = INTERRUPTED
    except OSError as error:  # such as a full disk
        complain(f"{error.filename or 'output'}: {error.strerror}")
        code = WRONG_INPUT
    except _USAGE_ERROR as error:
        if type(error).__name__ == "NoArgsIsHelpError":
            say(error.format_message())
            sys.exit(WRONG_INPUT)
        complain(f"{error.format_message()} (see {' '.join(['antdrive', *_subcommand(error.ctx)])} --help)")
        code = WRONG_INPUT
    if code == INTERRUPTED:
        complain("interrupted")
    sys.exit(code if isinstance(code, int) else SUCCEEDED)
