"""`antdrive worlds`: list, show, generate, import and export."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from antdrive.base.checks import pair
from antdrive.base.errors import InputError
from antdrive.base.files import summary_of
from antdrive.base.progress import bar, shown_progress
from antdrive.base.tables import file_lines
from antdrive.cli import options
from antdrive.cli.console import show
from antdrive.cli.listings import Row, world_lines
from antdrive.cli.options import argument, flag, option
from antdrive.cli.parse import import_target, numbers, pose
from antdrive.cli.scenario_options import Ends

MANY = 5000  # cylinders; planning takes seconds beyond this


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

    return {name: {**load_task(name).as_dict(), "about": summary_of(path)} for name, path in list_worlds().items()}


@options.with_settings(("noise", "margin"))
def show_world(
    *,
    world: options.World,
    robot: options.Robot = "turtlebot",
    ends: Ends,
    out: Annotated[Path | None, option("FILE", "Drawing: .png, .svg or .pdf.")] = None,
    json: options.Json = False,
    **given: Any,
) -> None:
    """Describe a world and check whether a robot can cross it."""
    from antdrive.sim import fit
    from antdrive.worlds import load_tasks, task_to_dict

    if given["margin"] == "auto":
        raise InputError("--margin auto: applies to drives only; give a number of metres")
    with shown_progress("planning with astar"):
        found = fit(ends.task_of(world), robot, **given)
    if out is not None:
        from antdrive.views.figures.plan_figures import plan_figure

        plan_figure(found.task, found.grid, found.plan, found.robot, out, covered=list(found.covered.values()))
    tasks = load_tasks(world)
    facts = {**task_to_dict(found.task), **found.as_dict(), "tasks": list(tasks)}
    show(json, facts, [*found.lines(tasks), *([] if out is None else file_lines({"figure": out}))])


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
    from antdrive.worlds import generate, save_task

    values = dict(pair(text) for text in settings or ())
    save_task(generate(kind, given["seed"], values, name=out.stem, note=f"seed {given['seed']}"), out)
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
    start: Annotated[str | None, option("X,Y,YAW", "Start pose [m, m, rad or 90deg]; maps contain none.")] = None,
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
    from antdrive.worlds import import_file
    from antdrive.worlds.formats.cellmap import conversion_progress
    from antdrive.worlds.formats.importing import IMPORTS, import_format, save_imported
    from antdrive.worlds.formats.map_server import OF_SHADE

    skipped: list[str] = []
    file_format = import_format(path, barn=barn)
    with bar("converting") as progress, conversion_progress(progress):
        tasks = import_file(
            path,
            start=pose("--start", start),
            goal=numbers("--goal", goal, 2, "X,Y"),
            bounds=numbers("--bounds", bounds, 4),
            barn=barn,
            band=numbers("--band", band, 2, "LOW,HIGH"),
            skip_unsupported=skip_unsupported or None,
            on_skipped=skipped.extend if skip_unsupported else None,
            unknown=unknown,
            overhang=overhang,
            resolution=resolution,
            problem=problem,
            scen=scen,
            **given,
        )
    is_set = file_format is IMPORTS["dynabarn"]
    usual = Path(f"{path.stem}.yaml")
    target = (out or Path(path.stem)) if is_set else import_target(path, out, usual, "world")
    files = save_imported(path, tasks, target)
    imported = [{**task.as_dict(), "files": {"world": str(file)}} for task, file in zip(tasks, files, strict=True)]
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
