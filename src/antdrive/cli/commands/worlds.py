"""`antdrive worlds`: list, show, generate, import and export."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from antdrive.base.errors import FieldError, InputError
from antdrive.base.files import file_name, summary_of
from antdrive.cli import options
from antdrive.cli.console import bar, file_lines, show, stage, table
from antdrive.cli.listings import Row, world_lines
from antdrive.cli.options import argument, flag, option
from antdrive.cli.parse import import_target, numbers, pair
from antdrive.cli.scenario_options import Ends, random_world

if TYPE_CHECKING:
    from antdrive.worlds import Task
    from antdrive.worlds.coverage import Coverage

MOST_DOORS = 12  # listed at most
NAMES = {"disc": "coverage", "footprint": "coverage_by_footprint"}  # keys in JSON, by the shape of plans
MANY = 5000  # cylinders; planning takes seconds beyond this
UNITS = {
    "frame": " m, m, rad",
    "bounds": " m",
    "start": " m, m, rad",
    "goal": " m",
    "goal_tolerance": " m",
    "cell": " m",
}


def list_worlds(json: options.Json = False) -> None:
    """List the worlds in the catalogue."""
    show(json, _catalogue(), world_lines(world_rows()))


def world_rows() -> Iterator[Row]:
    """Yield the rows of the list of worlds."""
    for name, facts in _catalogue().items():
        xmin, ymin, xmax, ymax = facts["bounds"]
        counts = (str(facts["obstacles"]), str(facts["movers"]))
        yield name, f"{xmax - xmin:g} x {ymax - ymin:g}", *counts, facts["about"]


def _catalogue() -> dict[str, Any]:
    """Summarise the worlds of the catalogue."""
    from antdrive.worlds import list_worlds, load_task

    return {name: {**_facts(load_task(name)), "about": summary_of(path)} for name, path in list_worlds().items()}


def _facts(task: "Task") -> dict[str, Any]:
    """Summarise a task as plain values."""
    return {
        "name": task.world.name,
        "source": task.world.source,
        "bounds": list(task.world.bounds),
        "start": list(task.start),
        "goal": list(task.goal),
        "goal_tolerance": task.goal_tolerance,
        "cell": task.cell,
        **({"frame": list(task.frame)} if any(task.frame) else {}),
        "obstacles": len(task.world.obstacles),
        "movers": len(task.world.movers),
    }


@options.with_settings(("margin",))
def show_world(
    *,
    world: options.World,
    robot: options.Robot = "turtlebot",
    ends: Ends,
    out: Annotated[Path | None, option("FILE", "Drawing: .png, .svg or .pdf.")] = None,
    json: options.Json = False,
    **settings: Any,
) -> None:
    """Describe a world and check whether a robot can cross it."""
    from antdrive.base.plane import format_numbers, world_to_map
    from antdrive.planners import Query
    from antdrive.robots import list_robots, load_robot, outline_of, overlap_at
    from antdrive.robots.default_margin import LEAST
    from antdrive.sim import Scenario, plan
    from antdrive.sim.driving.routes import FINE
    from antdrive.worlds import load_tasks, rasterise, task_to_dict
    from antdrive.worlds.coverage import coverage

    margin = LEAST if settings["margin"] is None else settings["margin"]
    if margin == "auto":
        raise InputError("--margin auto: applies to drives only; give a number of metres")
    shown, spec = ends.task_of(world), load_robot(robot)
    known = {name: load_robot(name) for name in list_robots()}
    starts = {each.name: overlap_at(shown.world, each, shown.start) for each in (*known.values(), spec)}
    grids = {"disc": rasterise(shown.world, shown.cell, spec.radius + margin)}
    if not spec.footprint.is_disc:
        outline = outline_of(spec.footprint, margin)
        grids["footprint"] = rasterise(shown.world, min(shown.cell, FINE), spec.radius + margin, outline)
    overlap = starts[spec.name]
    with stage("planning with astar"):
        planned, answer = (grids["disc"], None) if overlap else plan(Scenario.of(shown, "astar", spec, margin=margin))
    passable, why = answer is not None and answer.solved, overlap if answer is None else answer.reason
    entries = [tuple(grid.xy([Query.between(grid, shown).start])[0].tolist()) for grid in grids.values()]
    covered = dict(zip(grids, coverage(shown.world, [*grids.values()], shown.start[:2], entries), strict=True))
    if out is not None:
        from antdrive.planners import PlanResult, PlanStatus
        from antdrive.views.figures.plan_figures import plan_figure

        drawn = answer or PlanResult(status=PlanStatus.NO_PATH, reason=f"start: {spec.name} {overlap}")
        plan_figure(shown, planned, drawn, spec, out, covered=list(covered.values()))
    named = list(load_tasks(world))
    facts = {
        "passable": passable,
        "reason": why,
        "robot": spec.name,
        "margin": margin,
        "starts": starts,
        "tasks": named,
    }
    facts |= {NAMES[shape]: _coverage_facts(each) for shape, each in covered.items()}
    said = {key + UNITS.get(key, ""): _said(value) for key, value in _facts(shown).items()}
    if any(shown.frame):
        for key, pose in {"start": shown.start, "goal": shown.goal}.items():
            said[f"{key} in its map"] = format_numbers(world_to_map(shown.frame, [pose])[0].round(4).tolist())
    by = " by its footprint" if passable and planned.turns else ""
    said["passable"] = f"{'yes' if passable else 'no'}, for {spec.name}{by} with a margin of {margin:g} m"
    said |= {"reason": why} if why and not overlap else {}
    said["start is free for"] = ", ".join(name for name, overlap in starts.items() if not overlap) or "-"
    rows = [*said.items(), *_coverage_rows(covered, spec.footprint.inner_radius + margin)]
    rows += [(f"start for {name}", overlap) for name, overlap in starts.items() if overlap]
    rows += [("tasks", ", ".join(named))] if named else []
    lines = [*table(rows[0], rows[1:]), *([] if out is None else file_lines({"figure": out}))]
    show(json, {**task_to_dict(shown), **facts}, lines)


def _said(value: Any) -> str:
    """Format a fact for people."""
    from antdrive.base.plane import format_number, format_numbers

    if isinstance(value, list):
        return format_numbers(value)
    return "-" if value is None else format_number(value) if isinstance(value, float) else str(value)


def _coverage_facts(covered: "Coverage") -> dict[str, Any]:
    """Return a robot's share of the floor, rooms and doors as plain values."""
    doors = [{"width": door.width, "at": list(door.at), "passed": door.passed} for door in covered.doors]
    rooms = {"rooms": covered.room_count, "rooms_reached": len(covered.rooms_reached)}
    return {"share": covered.share, **rooms, "doors": doors}


def _coverage_rows(covered: "Mapping[str, Coverage]", least: float) -> "Iterator[tuple[str, str]]":
    """Yield what a robot reaches by each shape, and the doors that its disc does not pass, those that just fail first.

    Gaps narrower than `least` [m], such as those among chairs, are counted but are no doors.
    """
    from antdrive.base.plane import format_point

    for shape, each in covered.items():
        rooms = f"{len(each.rooms_reached)} of {each.room_count} rooms"
        wide = [door.passed for door in each.doors if door.width >= least]
        doors = f", {sum(wide)} of {len(wide)} doors" if wide else ""
        reached = f"by its {shape}" if len(covered) > 1 else "reached"
        yield reached, f"{each.share:.0%} of the connected floor, {rooms}{doors}"
    last = list(covered.values())[-1].doors
    shut = [door for first, door in zip(covered["disc"].doors, last, strict=True) if not first.passed]
    listed = sorted((door for door in shut if door.width >= least), key=lambda door: (door.passed, -door.width))
    for door in listed[:MOST_DOORS]:
        place = f"{door.width:.2f} m wide at {format_point(door.at, 2)}"
        yield "door by footprint" if door.passed else "door not passed", place
    if len(listed) > MOST_DOORS:
        yield "", f"and {len(listed) - MOST_DOORS} more"
    if len(shut) > len(listed):
        yield "no doors", f"{len(shut) - len(listed)} gaps narrower than {least:.2f} m, half of what the robot needs"


@options.with_settings(("seed",))
def generate_world(
    kind: Annotated[str, argument("KIND", "forest (Han's rule), barn (cellular automaton) or office.")],
    out: Annotated[Path, option("FILE", "World file to write.")],
    settings: Annotated[
        list[str] | None,
        option(
            "KEY=VALUE",
            "Generator option, such as radius=0.2,0.5 (forest) or fill=0.25 (barn). Repeatable.",
            "--set",
            "-s",
        ),
    ] = None,
    **given: Any,
) -> None:
    """Generate a random world."""
    from antdrive.worlds import save_task

    values = dict(pair(text) for text in settings or ())
    save_task(random_world(f"generate: unknown kind {kind!r}", kind, given["seed"], values, out.stem), out)
    show(False, None, file_lines({"world": out}))


@options.with_settings(("cell",))
def import_world(
    path: Annotated[
        Path, argument("FILE", "Gazebo SDF (.sdf, .world), map_server (.yaml), MovingAI (.map) or DynaBARN (.json).")
    ],
    out: Annotated[
        Path | None, option("FILE", "World file to write (DynaBARN: folder).  [default: FILE's name]")
    ] = None,
    barn: Annotated[bool, flag("SDF: start and goal of the BARN Challenge.", "--barn")] = False,
    start: Annotated[str | None, option("X,Y,YAW", "Start pose [m, m, rad]; maps contain none.")] = None,
    goal: Annotated[str | None, option("X,Y", "Goal [m]; maps contain none.")] = None,
    bounds: Annotated[
        str | None, option("BOUNDS", "SDF: walls at XMIN,YMIN,XMAX,YMAX [m].  [default: 1 m around the obstacles]")
    ] = None,
    skip_unsupported: Annotated[
        bool, flag("SDF: skip missing models and unsupported parts.", "--skip-unsupported")
    ] = False,
    band: Annotated[
        str | None, option("LOW,HIGH", "SDF: heights between which shapes are obstacles [m].  [default: 0.01,2]")
    ] = None,
    unknown: Annotated[
        str | None,
        option("KIND", "map_server: unknown cells and those of shade 205 are blocked or free.  [default: blocked]"),
    ] = None,
    overhang: Annotated[
        float | None,
        option(
            "METRES",
            "Maps, SDF: overhang of cylinders beyond blocked cells [m].  [default: 0.207 cells; SDF: 1 cell]",
            min=0,
            max=1e6,
        ),
    ] = None,
    resolution: Annotated[
        float | None, option("METRES", "MovingAI, SDF: cell size [m].  [default: 1; SDF: 0.02]", min=1e-6, max=1e6)
    ] = None,
    problem: Annotated[
        int | None, option("NUMBER", "MovingAI: start and goal of this problem in the .scen file, from 0.", min=0)
    ] = None,
    scen: Annotated[
        Path | None, option("FILE", "MovingAI: the .scen file.  [default: FILE.scen, or the only one of FILE's name]")
    ] = None,
    json: options.Json = False,
    **given: Any,
) -> None:
    """Convert another program's world or map to a world file.

    World files consist of upright cylinders. SDF cylinders are kept as they are. Cylinders cover all other shapes in SDF,
    and in a map every blocked cell next to free ground reachable from start or goal, so no passage becomes wider. The key
    `source` of the world file states how far they reach beyond, and what was ignored.
    """
    from antdrive.base.plane import format_point
    from antdrive.worlds import import_file, save_task
    from antdrive.worlds.formats.cellmap import conversion_progress
    from antdrive.worlds.formats.importing import IMPORTS, import_format
    from antdrive.worlds.formats.map_server import OF_SHADE, kept_tasks

    skipped: list[str] = []
    try:
        file_format = import_format(path, barn=barn)
        with bar("converting") as progress, conversion_progress(progress):
            tasks = import_file(
                path,
                start=numbers("--start", start, 3, "X,Y,YAW"),
                goal=numbers("--goal", goal, 2, "X,Y"),
                bounds=numbers("--bounds", bounds, 4),
                cell=given["cell"],
                barn=barn,
                band=numbers("--band", band, 2, "LOW,HIGH"),
                skip_unsupported=skip_unsupported or None,
                on_skipped=skipped.extend if skip_unsupported else None,
                unknown=unknown,
                overhang=overhang,
                resolution=resolution,
                problem=problem,
                scen=scen,
            )
    except FieldError as error:
        raise InputError(f"--{error.key.replace('_', '-')}: {error.problem}") from None
    is_set = file_format is IMPORTS["dynabarn"]
    usual = Path(f"{path.stem}.yaml")
    files = _targets(path, out or Path(path.stem), tasks) if is_set else [import_target(path, out, usual, "world")]
    for task, file in zip(tasks, files, strict=True):
        # A map written by antdrive holds the other tasks in its file.
        save_task(task, file, kept_tasks(path, task) if file_format is IMPORTS["map_server"] else {})
    imported = [{**_facts(task), "files": {"world": str(file)}} for task, file in zip(tasks, files, strict=True)]
    lines = []
    if len(tasks) == 1:
        world = tasks[0].world
        first, *more = str(world.source).split("; ")
        lines += [f"{world.name}: {len(world.obstacles)} obstacles, {first}", *(f"  {part}" for part in more)]
        if unknown is None and OF_SHADE in str(world.source):
            lines.append("  --unknown free or --unknown blocked decides on these cells")
        if "bounds" in file_format.options and not (start and goal):
            ends = f"start {format_point(tasks[0].start[:2], 2)}, goal {format_point(tasks[0].goal, 2)}"
            lines.append(f"  {ends}; choose others with --start and --goal")
        if "overhang" in file_format.options and len(world.obstacles) > MANY:
            lines.append(f"  planning takes seconds beyond {MANY} obstacles; a larger --overhang needs fewer")
    if skip_unsupported:
        imported[0]["skipped"] = skipped
        lines.append(f"  skipped {len(skipped)} parts")
        lines += [f"  skipped  {part}" for part in skipped]
    lines += [line for file in files for line in file_lines({"world": file})]
    show(json, {"worlds": imported} if is_set else imported[0], lines)


def _targets(path: Path, folder: Path, tasks: "Sequence[Task]") -> list[Path]:
    """Return one file per world of a set."""
    files = [folder / f"{file_name(task.world.name)}.yaml" for task in tasks]
    twice = next((file for i, file in enumerate(files) if file in files[:i]), None)
    if twice is not None:
        raise InputError(f"{path}: two worlds map to {twice}; give them different names")
    return files


def export_world(
    world: options.World,
    out: Annotated[Path, option("FILE", "Gazebo: .sdf, .world; map_server: .yaml; MovingAI: .map.")],
    resolution: Annotated[
        float | None, option("METRES", "Maps: cell size [m].  [default: the world's]", min=1e-6, max=1e6)
    ] = None,
    force: Annotated[bool, flag("Replace existing files, including .pgm and .scen.", "--force")] = False,
    json: options.Json = False,
) -> None:
    """Export a world to another program.

    FILE's suffix selects the format. SDF keeps the world, its start and its goal. Maps block every cell that a cylinder
    touches, so re-importing gives a similar world. A .yaml comes with a .pgm and also keeps other tasks. A .map comes with
    a .scen of the path from start to goal, if one exists on its cells. Worlds imported from a map keep its coordinates,
    except as .map, which has none.
    """
    from antdrive.base.files import require_new
    from antdrive.views.export.world_export import SDF, SUFFIXES, file_beside, write_world
    from antdrive.worlds import load_task, load_tasks

    suffix = out.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"--out {out}: unknown suffix; use .sdf, .world, .yaml (map_server) or .map (MovingAI)")
    task, tasks = load_task(world), load_tasks(world)
    if out.exists() and Path(world).exists() and out.samefile(world):
        raise InputError(f"--out {out}: would overwrite the world; choose another name")
    if suffix in SDF and resolution is not None:
        raise InputError("--resolution: applies to maps only; SDF worlds have no cells")
    beside = file_beside(out)
    require_new((out, *([] if beside is None else [beside])), replace=force)
    facts, lost = write_world(task, tasks, out, resolution)
    lines = [*file_lines(facts["files"]), *(f"  without {what}" for what in lost)]
    show(json, {"world": task.world.name, **facts}, lines)
