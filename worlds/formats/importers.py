"""Worlds of other simulators and benchmarks."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from antdrive.worlds.errors import InputError
from antdrive.worlds.files.checks import show
from antdrive.worlds.files.document import Document, Location, input_error, read_json
from antdrive.worlds.files.world_file import task_from_dict
from antdrive.worlds.formats.cellmap import CellMap, map_task
from antdrive.worlds.formats.map_server import read_map
from antdrive.worlds.formats.movingai import import_movingai_problems, read_movingai_cells
from antdrive.worlds.formats.sdf import TASK, parse_xml, read_models, read_task_element
from antdrive.worlds.world import Bounds, Disc, Point, Pose, Task, World

MARGIN = 1.0  # room left around the cylinders when no bounds are given [m]

#: The protocol of the BARN challenge (D. Perille et al., *Benchmarking metric ground navigation*, SSRR 2020).
BARN_START: Pose = (-2.25, 3.0, math.pi / 2)
BARN_GOAL: Point = (-2.25, 13.0)
BARN_TOLERANCE = 1.0  # [m]
#: Cylinders wall three sides of every BARN world and touch these bounds; the goal's side is open.
BARN_BOUNDS: Bounds = (-4.5, 0.0, 0.0, 14.4)
#: The lattice on which BARN's cylinders stand [m]; cells that lie on it lose no passage to rounding.
BARN_CELL = 0.15

DYNABARN_LIMIT = 100.0  # what the challenge allows [s]
DYNABARN_CELL = 0.25


def import_sdf(
    path: str | os.PathLike[str],
    *,
    start: Pose | None = None,
    goal: Point | None = None,
    bounds: Bounds | None = None,
    cell: float | None = None,
    goal_tolerance: float | None = None,
    skip_unsupported: bool = False,
) -> Task:
    """The upright cylinders of a Gazebo world (SDF, `.world`) as a task.

    Poses of models, links and collisions are composed; those in <state> win over the models' own, as in
    Gazebo. A cylinder's height is that of its top above z = 0. ColonyGraph planes, models without collision
    geometry and what lies below the floor are passed over. Without `bounds` the cylinders get 1 m of
    room on all sides; without `start` and `goal` the robot crosses that from the lower left to the upper
    right corner, on a grid of 0.25 m. A world that `export_sdf` wrote brings all of that itself.

    Raises:
        InputError: the file cannot be read, or holds what a world cannot: moving or included models, or
            collision shapes other than upright cylinders. `skip_unsupported` leaves such models out instead.
    """
    file = Path(path)
    root = parse_xml(file)
    world = root.find("world") if root.tag == "sdf" else None
    if world is None:
        raise input_error(str(file), f"must be an <sdf> with a <world> in it, got <{root.tag}>")
    kept = read_task_element(world) or {}
    found = read_models(world)
    if found.unsupported and not skip_unsupported:
        more = len(found.unsupported) - 5
        names = ", ".join(found.unsupported[:5]) + (f" and {more} more" if more > 0 else "")
        raise input_error(
            str(file), f"only static models of upright cylinders can be imported; leave out or skip {names}"
        )
    start = start or _kept(file, kept, "start", 3)
    goal = goal or _kept(file, kept, "goal", 2)
    bounds = bounds or _kept(file, kept, "bounds", 4)
    if bounds is None and not found.discs:
        raise input_error(str(file), "holds no upright cylinder; give the bounds")
    box = bounds if bounds is not None else _around(found.discs, start, goal)
    xmin, ymin, xmax, ymax = box
    end = goal if goal is not None else (xmax - MARGIN / 2, ymax - MARGIN / 2)
    if start is None:
        x, y = xmin + MARGIN / 2, ymin + MARGIN / 2
        start = (x, y, math.atan2(end[1] - y, end[0] - x))
    (tolerance,) = _kept(file, kept, "goal_tolerance", 1) or (0.25,)
    (size,) = _kept(file, kept, "cell", 1) or (0.25,)
    (limit,) = _kept(file, kept, "time_limit", 1) or (None,)
    source = kept.get("source") if kept else f"imported from {file.name}"
    try:
        made = World(kept.get("name", file.stem), box, tuple(found.discs), source)
        return Task(
            made,
            start,
            end,
            tolerance if goal_tolerance is None else goal_tolerance,
            size if cell is None else cell,
            limit,
        )
    except ValueError as error:
        raise input_error(str(file), str(error)) from None


def _kept(file: Path, kept: Mapping[str, str], key: str, count: int) -> Any:
    """The numbers that an exported world keeps under a key, if it is one and has them."""
    if key not in kept:
        return None
    try:
        values = tuple(float(word) for word in kept[key].split())
    except ValueError:
        values = ()
    if len(values) != count:
        raise input_error(str(file), TASK, key, f"must be {count} numbers, got {kept[key][:40]!r}")
    return values


def import_map_server(
    path: str | os.PathLike[str],
    *,
    start: Pose | None = None,
    goal: Point | None = None,
    unknown_is_free: bool = False,
    overhang: float | None = None,
    cell: float | None = None,
    goal_tolerance: float | None = None,
) -> Task:
    """A map of ROS's map_server, a YAML file and its image, as a world of discs; see `map_task` for what they stand for.

    Cells that the map does not know block the way unless `unknown_is_free`. The start and the goal are needed, as maps have
    none but those that `export_map_server` wrote.

    Raises:
        InputError: a file is wrong, or `map_task` has no use for the map.
    """
    file = Path(path)
    served = read_map(file, unknown_is_free=unknown_is_free)
    ends = served.ends
    if ends is not None:
        start = start or (ends.start[0], ends.start[1], ends.start[2])
        goal = goal or (ends.goal[0], ends.goal[1])
        goal_tolerance = goal_tolerance or ends.goal_tolerance
    about = f"the map_server map {file.name}"
    if served.unknown:
        about += f" with {served.unknown} unknown cells taken for {'free' if unknown_is_free else 'blocked'}"
    return _from_map(file, served.cells, start, goal, about, overhang, cell, goal_tolerance)


def import_movingai_task(
    path: str | os.PathLike[str],
    *,
    start: Pose | None = None,
    goal: Point | None = None,
    problem: int | None = None,
    resolution: float = 1.0,
    overhang: float | None = None,
    cell: float | None = None,
    goal_tolerance: float | None = None,
) -> Task:
    """A `.map` of the MovingAI benchmarks as a world of discs; see `map_task` for what they stand for.

    Its cells get a side of `resolution` [m], the lower left one a corner at (0, 0). Start and goal are given, or are those
    of a `problem` of the `.scen` file beside it, counted from 0. To plan on the very cells, use `import_movingai_map`.

    Raises:
        InputError: a file is wrong, there is no such problem, or `map_task` has no use for the map.
    """
    file = Path(path)
    if not (math.isfinite(resolution) and resolution > 0):
        raise input_error("resolution", f"must be greater than 0, got {resolution:g}")
    cells = CellMap(read_movingai_cells(file), resolution)
    about = f"the MovingAI map {file.name}"
    if problem is not None:
        if start is not None or goal is not None:
            raise input_error("problem", "brings its own start and goal")
        beside = file.with_name(f"{file.name}.scen")
        known = import_movingai_problems(beside)
        if not 0 <= problem < len(known):
            raise input_error(str(beside), f"has the problems 0 to {len(known) - 1}, got {problem}")
        (r0, c0), (r1, c1) = known[problem].start, known[problem].goal
        start = ((c0 + 0.5) * resolution, (r0 + 0.5) * resolution, math.atan2(r1 - r0, c1 - c0))
        goal = ((c1 + 0.5) * resolution, (r1 + 0.5) * resolution)
        about += f", problem {problem} of optimal length {known[problem].printed} on its cells"
    return _from_map(file, cells, start, goal, about, overhang, cell, goal_tolerance)


def _from_map(
    file: Path, cells: CellMap, start: Pose | None, goal: Point | None, about: str,
    overhang: float | None, cell: float | None, goal_tolerance: float | None,
) -> Task:  # fmt: skip
    name = "".join(filter(str.isprintable, file.stem))[:200] or "map"
    tolerance = 0.25 if goal_tolerance is None else goal_tolerance
    try:
        return map_task(
            cells, start, goal, name=name, source=about, overhang=overhang, cell=cell, goal_tolerance=tolerance
        )
    except InputError as error:
        raise input_error(str(file), str(error)) from None


def import_barn(path: str | os.PathLike[str], *, cell: float = BARN_CELL) -> Task:
    """A world of the BARN set with the challenge's start, goal and tolerance.

    Raises:
        InputError: the file cannot be read or is no such world.
    """
    return import_sdf(
        path, start=BARN_START, goal=BARN_GOAL, bounds=BARN_BOUNDS, cell=cell, goal_tolerance=BARN_TOLERANCE
    )


def import_dynabarn(path: str | os.PathLike[str], *, cell: float = DYNABARN_CELL) -> list[Task]:
    """The worlds of a DynaBARN set whose trajectories are decoded into keyframes, one task for each world.

    The file is JSON: a list of mappings with name, bounds, start, goal, goal_tolerance and movers; each mover has radius,
    length, period, loop and keyframes_t_x_y. The challenge allows 100 s (Nair et al., *DynaBARN*, SSRR 2022).

    Raises:
        InputError: the file cannot be read or is no such set.
    """
    document = read_json(path)
    if not isinstance(document.data, list) or not document.data:
        raise document.error((), f"must be a list of worlds, got {show(document.data)}")
    return [_dynabarn(document, i, world, cell) for i, world in enumerate(document.data)]


def _dynabarn(document: Document, index: int, world: Any, cell: float) -> Task:
    if not isinstance(world, dict) or not isinstance(world.get("movers"), list):
        raise document.error(
            (index,), f"must be a mapping with name, bounds, start, goal and movers, got {show(world)}"
        )
    movers = []
    for i, mover in enumerate(world["movers"]):
        at = (index, "movers", i)
        if not isinstance(mover, dict):
            raise document.error(
                at, f"must be a mapping with radius, length, loop and keyframes_t_x_y, got {show(mover)}"
            )
        frames = mover.get("keyframes_t_x_y")
        if not isinstance(frames, list):
            raise document.error((*at, "keyframes_t_x_y"), "missing; write a list of [t, x, y]")
        _check_period(document, at, frames, mover.get("period"))
        kept = {"radius": mover.get("radius"), "height": mover.get("length", 1.0), "loop": mover.get("loop")}
        movers.append({**kept, "keyframes": frames})
    name = str(world.get("name", f"world {index}"))
    kept = {key: world[key] for key in ("name", "bounds", "start", "goal", "goal_tolerance") if key in world}
    source = f"DynaBARN, imported from {Path(document.source).name}; keyframes played back in straight lines"
    task = {"schema": 1, **kept, "source": source, "cell": cell, "time_limit": DYNABARN_LIMIT, "movers": movers}
    return task_from_dict(task, f"{document.source}: {name}")


def _check_period(document: Document, at: Location, frames: list[Any], period: Any) -> None:
    """The period must be the time from the first keyframe to the last, which is what a world file knows."""
    try:
        lasts = float(frames[-1][0]) - float(frames[0][0])
    except (TypeError, ValueError, LookupError):
        return  # told with the other faults of keyframes
    if period is not None and not (isinstance(period, int | float) and abs(period - lasts) <= 0.01):
        raise document.error((*at, "period"), f"must be {lasts:g}, which its keyframes last, got {show(period)}")


def _around(discs: list[Disc], start: Pose | None, goal: Point | None) -> Bounds:
    """Bounds with `MARGIN` around the cylinders and the given ends."""
    spots = [(d.x, d.y, d.radius) for d in discs]
    spots += [(end[0], end[1], 0.0) for end in (start, goal) if end is not None]
    return (
        min(x - r for x, _, r in spots) - MARGIN,
        min(y - r for _, y, r in spots) - MARGIN,
        max(x + r for x, _, r in spots) + MARGIN,
        max(y + r for _, y, r in spots) + MARGIN,
    )
