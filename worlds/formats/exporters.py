"""Worlds for other simulators, planners and benchmarks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from antdrive.worlds.errors import InputError
from antdrive.worlds.files.atomic import written_whole
from antdrive.worlds.files.checks import yaml_number
from antdrive.worlds.files.document import input_error
from antdrive.worlds.formats.cellmap import CellMap, cell_map
from antdrive.worlds.formats.movingai import MapProblem
from antdrive.worlds.formats.sdf import NAMESPACE, TASK, WALLS
from antdrive.worlds.world import Disc, Task, World

FREE, OCCUPIED = 254, 0  # the shades that map_saver writes
WALL_THICKNESS, WALL_HEIGHT = 0.2, 1.0  # [m]


def export_sdf(task: Task, path: str | Path) -> None:
    """Write a world for Gazebo (SDF 1.6): static cylinders, the bounds as four walls, a floor and a sun.

    Name, bounds, start and goal stand in an element `antdrive:task`, which Gazebo passes over; with it
    `import_sdf` brings back the same task, every number to the last bit.

    Raises:
        InputError: the file cannot be written, or the world moves.
    """
    world = _standing_still(task, path)
    facts = {
        "name": world.name, "bounds": _numbers(world.bounds), "start": _numbers(task.start), "goal": _numbers(task.goal),
        "goal_tolerance": repr(float(task.goal_tolerance)), "cell": repr(float(task.cell)),
        **({} if task.time_limit is None else {"time_limit": repr(float(task.time_limit))}),
        **({} if world.source is None else {"source": world.source}),
    }  # fmt: skip
    attributes = " ".join(f"{key}={quoteattr(_xml_text(value))}" for key, value in facts.items())
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<sdf version="1.6">',
        f"<world name={quoteattr(_xml_text(world.name))}>",
        f"<{TASK} xmlns:antdrive={quoteattr(NAMESPACE)} {attributes}/>",
        '<light name="sun" type="directional"><cast_shadows>true</cast_shadows><pose>0 0 10 0 0 0</pose>'
        "<direction>-0.5 0.1 -0.9</direction></light>",
        _model("ground_plane", "0 0 0", ["<plane><normal>0 0 1</normal><size>1000 1000</size></plane>"]),
        _model(WALLS, "0 0 0", *_walls(task)),
        *(_cylinder(i, disc) for i, disc in enumerate(world.obstacles)),
        "</world>",
        "</sdf>",
    ]
    with written_whole(path) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def export_map_server(task: Task, path: str | Path, *, resolution: float | None = None) -> Path:
    """Write a world as a map of ROS's map_server, a YAML file and a PGM image of the same name beside it; the image's path.

    A cell, of the task's own size unless a `resolution` [m] is given, is occupied when a disc or a wall reaches into it by more
    than a nanometre; none is unknown. Heights are lost. Start, goal and tolerance are kept under the key `antdrive`,
    which map_server passes over and `import_map_server` reads.

    Raises:
        InputError: a file cannot be written, the world moves, or a resolution that makes no sense.
    """
    target = Path(path)
    cells = cell_map(_standing_still(task, path), task.cell if resolution is None else resolution)
    rows, cols = cells.free.shape
    picture = np.where(cells.free[::-1], FREE, OCCUPIED).astype(np.uint8)
    image = target.with_suffix(".pgm")
    name = image.name.replace("'", "''")
    if not name.isprintable():
        raise input_error(str(target), "a map's name must be printable")
    text = (
        f"image: '{name}'\n"
        f"resolution: {yaml_number(cells.resolution)}\n"
        f"origin: {_yaml_list((*cells.origin, 0.0))}\n"
        "negate: 0\n"
        "occupied_thresh: 0.65\n"
        "free_thresh: 0.196\n"
        "antdrive:\n"
        f"  start: {_yaml_list(task.start)}\n"
        f"  goal: {_yaml_list(task.goal)}\n"
        f"  goal_tolerance: {yaml_number(task.goal_tolerance)}\n"
    )
    with written_whole(image) as part:
        part.write_bytes(b"P5\n%d %d\n255\n" % (cols, rows) + picture.tobytes())
    with written_whole(target) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
    return image


def export_movingai_map(task: Task, path: str | Path, *, resolution: float | None = None) -> CellMap:
    """Write a world as a `.map` of the MovingAI benchmarks; the cells as written.

    Cells are free as for `export_map_server`. The format knows neither their size nor where they lie.

    Raises:
        InputError: the file cannot be written, the world moves, or a resolution that makes no sense.
    """
    cells = cell_map(_standing_still(task, path), task.cell if resolution is None else resolution)
    rows, cols = cells.free.shape
    lines = [bytes(row).decode("ascii") for row in np.where(cells.free[::-1], ord("."), ord("@")).astype(np.uint8)]
    with written_whole(path) as part:
        part.write_text(
            "\n".join([f"type octile\nheight {rows}\nwidth {cols}\nmap", *lines]) + "\n", encoding="ascii", newline="\n"
        )
    return cells


def export_movingai_problems(problems: Iterable[MapProblem], shape: tuple[int, int], path: str | Path) -> None:
    """Write the problems of a map of `shape` (rows, columns) as a `.scen` file.

    Raises:
        InputError: the file cannot be written.
    """
    rows, cols = shape
    lines = ["version 1"]
    for p in problems:
        (r0, c0), (r1, c1) = p.start, p.goal
        values = (p.bucket, p.map_name, cols, rows, c0, rows - 1 - r0, c1, rows - 1 - r1, p.printed)
        lines.append("\t".join(map(str, values)))
    with written_whole(path) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def _model(name: str, pose: str, *parts: Sequence[str]) -> str:
    """A static model; each part is a shape and, where it is not the model's own, its pose."""
    bodies = []
    for n, (shape, *place) in enumerate(parts):
        inside = "".join(f"<pose>{p}</pose>" for p in place) + f"<geometry>{shape}</geometry>"
        bodies.append(f'<collision name="c{n}">{inside}</collision><visual name="v{n}">{inside}</visual>')
    return (
        f'<model name="{name}"><static>true</static><pose>{pose} 0 0 0</pose>'
        f'<link name="link">{"".join(bodies)}</link></model>'
    )


def _cylinder(number: int, disc: Disc) -> str:
    x, y, radius, height = (float(v) for v in (disc.x, disc.y, disc.radius, disc.height))
    shape = f"<cylinder><radius>{radius!r}</radius><length>{height!r}</length></cylinder>"
    return _model(f"obstacle_{number}", f"{x!r} {y!r} {height / 2!r}", [shape])


def _walls(task: Task) -> Iterable[tuple[str, str]]:
    xmin, ymin, xmax, ymax = (float(v) for v in task.world.bounds)
    thick, high = WALL_THICKNESS, WALL_HEIGHT
    x, y, wide, deep = (xmin + xmax) / 2, (ymin + ymax) / 2, xmax - xmin + 2 * thick, ymax - ymin
    for size, spot in (
        ((thick, deep, high), (xmin - thick / 2, y)),
        ((thick, deep, high), (xmax + thick / 2, y)),
        ((wide, thick, high), (x, ymin - thick / 2)),
        ((wide, thick, high), (x, ymax + thick / 2)),
    ):
        yield f"<box><size>{_numbers(size)}</size></box>", f"{_numbers((*spot, high / 2))} 0 0 0"


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _yaml_list(values: Iterable[float]) -> str:
    return f"[{', '.join(map(yaml_number, values))}]"


def _xml_text(text: str) -> str:
    """The text without the characters that XML has no way to write."""
    return "".join(
        c if c in "\t\r\n" or " " <= c < "\ud800" or "\ue000" <= c < "\ufffe" or c > "\uffff" else " " for c in text
    )


def _standing_still(task: Task, path: str | Path) -> World:
    """The task's world; movers would be lost."""
    if task.world.movers:
        raise InputError(f"{path}: cannot hold {task.world.name}'s movers; export a world in which nothing moves")
    return task.world
