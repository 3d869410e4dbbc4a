"""Random worlds: the same generator state gives the same world."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from antdrive.worlds.files.document import input_error
from antdrive.worlds.formats.importers import BARN_BOUNDS, BARN_CELL, BARN_GOAL, BARN_START, BARN_TOLERANCE
from antdrive.worlds.generators.automaton import crossable, cylinders, grow_field
from antdrive.worlds.geometry import point_clearance
from antdrive.worlds.grid import DIRECTIONS, Grid, rasterise
from antdrive.worlds.world import Disc, Point, Task, World

#: The BARN set's fill ratios and smoothing rounds; every pair of them was used for 25 of its 300 worlds.
BARN_FILLS = (0.15, 0.20, 0.25, 0.30)
BARN_ROUNDS = (2, 3, 4)


def forest(
    rng: np.random.Generator,
    *,
    size: float = 10.0,
    count: int = 6,
    radius: tuple[float, float] = (0.5, 2.5),
    clearance: float = 2.5,
    spacing: float = 0.5,
    gap: float | None = None,
    robot_radius: float = 0.4,
    cell: float = 0.25,
    tries: int = 300,
    name: str = "forest",
) -> Task:
    """A square of `size` metres with `count` cylinders, crossed from corner to corner.

    The rule is that of K. Han, *Collision free path planning algorithms for robot navigation problem*, MSc
    thesis, Missouri 2007, section 3: cylinders of random size, 1 to 5 grid units, centred on random grid
    points (`spacing`), none near the start or the goal; the defaults are his with 0.5 m to a unit. Here
    "near" means that no surface lies within `clearance` of either. Cylinders may overlap unless `gap` asks
    for a distance between their surfaces. A world that a disc of `robot_radius` cannot cross on a grid of
    `cell` is thrown away, up to `tries` times.

    Raises:
        ValueError: an argument makes no sense, or no world could be made with them.
    """
    low, high = radius
    if not 0.001 <= low <= high:
        raise ValueError(f"radius: must be (smallest, largest) of at least a millimetre, got {radius}")
    for key, value in (("spacing", spacing), ("robot_radius", robot_radius), ("cell", cell)):
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{key}: must be greater than 0, got {value:g}")
    for key, value in (("clearance", clearance), ("gap", gap or 0.0)):
        if not (math.isfinite(value) and value >= 0):
            raise ValueError(f"{key}: must be at least 0, got {value:g}")
    if not 0 <= count <= 10_000:
        raise ValueError(f"count: must be from 0 to 10000, got {count}")
    if tries < 1:
        raise ValueError(f"tries: must be at least 1, got {tries}")
    inset = robot_radius + cell  # the ends stand one cell clear of where the walls stop the robot
    if not (math.isfinite(size) and size > 2 * inset):
        raise ValueError(f"size: must be greater than {2 * inset:g} m for this robot, got {size:g}")
    start, goal = (inset, inset), (size - inset, size - inset)

    def draw() -> Disc:
        x, y = rng.integers(0, math.floor(size / spacing) + 1, size=2) * spacing
        return Disc(float(x), float(y), round(float(rng.uniform(low, high)), 3))  # files tell millimetres

    def fits(disc: Disc, others: list[Disc]) -> bool:
        if min(_distance(disc, start), _distance(disc, goal)) < clearance:
            return False
        return gap is None or all(_distance(disc, (o.x, o.y)) - o.radius >= gap for o in others)

    source = f"the random worlds of han2007, section 3, with {count} cylinders"
    for _ in range(
        min(tries, max(20, 60_000 // max(count, 1)))
    ):  # where so many hardly fit, more tries would only take long
        discs = _scatter(count, tries, draw, fits)
        if discs is None:
            continue
        world = World(name, (0.0, 0.0, size, size), discs, source)
        task = Task(world, (*start, math.pi / 4), goal, cell=cell)
        if _connected(rasterise(world, cell, robot_radius), task):
            return task
    raise ValueError(
        f"forest: no world with {count} cylinders of radius {low:g} to {high:g} m that a disc of radius "
        f"{robot_radius:g} m can cross was found in {tries} tries; use fewer or smaller cylinders"
    )


def _scatter(
    count: int, tries: int, draw: Callable[[], Disc], fits: Callable[[Disc, list[Disc]], bool]
) -> tuple[Disc, ...] | None:
    """Cylinders placed one by one, each within `tries` draws; None when one found no place."""
    discs: list[Disc] = []
    for _ in range(count):
        found = next((d for d in (draw() for _ in range(tries)) if fits(d, discs)), None)
        if found is None:
            return None
        discs.append(found)
    return tuple(discs)


def _distance(disc: Disc, point: Point) -> float:
    """From a disc's surface to a point [m]."""
    return math.dist((disc.x, disc.y), point) - disc.radius


def barn(
    rng: np.random.Generator,
    fill: float = 0.20,
    rounds: int = 3,
    *,
    robot_radius: float = 0.363,
    tries: int = 20_000,
    name: str = "barn",
) -> Task:
    """A world in the manner of BARN: a field of cylinders grown by a cellular automaton between two walls.

    After D. Perille, A. Truong, X. Xiao, P. Stone, *Benchmarking metric ground navigation*, SSRR 2020: 30 x
    30 cells of 0.15 m are filled with probability `fill` and smoothed for `rounds` rounds; in each, a cell
    with five or more filled neighbours of eight is filled and one with one or none is cleared. The walls at
    the field's sides stay filled and, for counting, all beyond them is. Every filled cell holds a cylinder
    of radius 0.075 m. Layout, start and goal are those of the BARN data, whose `fill` and `rounds` are
    `BARN_FILLS` and `BARN_ROUNDS`. A world that a disc of `robot_radius` cannot cross is thrown away, up to
    `tries` times; of those with a fill of 0.30 a Jackal crosses one in some hundreds, so they take up to
    some seconds (BARN cut a way through instead).

    Raises:
        ValueError: an argument makes no sense, or no world could be made with them.
    """
    if not 0 <= fill < 1:
        raise ValueError(f"fill: must be at least 0 and less than 1, got {fill:g}")
    if rounds < 0:
        raise ValueError(f"rounds: must be at least 0, got {rounds}")
    if not 0 < robot_radius <= 2:
        raise ValueError(f"robot_radius: must be greater than 0 and at most 2, got {robot_radius:g}")
    if tries < 1:
        raise ValueError(f"tries: must be at least 1, got {tries}")
    source = f"the cellular automaton of BARN (Perille et al. 2020), fill {fill:g}, {rounds} rounds"
    for _ in range(tries):
        field = grow_field(rng, fill, rounds)
        if not crossable(field, robot_radius):
            continue
        world = World(name, BARN_BOUNDS, cylinders(field), source)
        task = Task(world, BARN_START, BARN_GOAL, BARN_TOLERANCE, BARN_CELL)
        if _connected(rasterise(task.world, BARN_CELL, robot_radius), task):
            return task
    raise ValueError(
        f"barn: no world of fill {fill:g} that a disc of radius {robot_radius:g} m can cross was found in "
        f"{tries} tries; use a smaller fill or a smaller robot_radius"
    )


#: The generators by name.
GENERATORS: Mapping[str, Callable[..., Task]] = MappingProxyType({"forest": forest, "barn": barn})


def generate(
    kind: str,
    rng: np.random.Generator,
    options: Mapping[str, str],
    *,
    name: str | None = None,
    note: str = "",
) -> Task:
    """A random world with options given as texts, such as {"count": "20", "radius": "0.2,0.5"}.

    The world is called `name`, and `note` is added to its source.

    Raises:
        InputError: an unknown kind or option, an option of the wrong kind, or no world to be had.
    """
    if kind not in GENERATORS:
        raise input_error("generate", f"unknown kind {kind!r}; choose from {', '.join(GENERATORS)}")
    defaults = {
        key: parameter.default
        for key, parameter in inspect.signature(GENERATORS[kind]).parameters.items()
        if key not in ("rng", "name")
    }
    values: dict[str, Any] = {}
    for key, text in options.items():
        if key not in defaults:
            raise input_error(kind, key, f"unknown option; choose from {', '.join(defaults)}")
        values[key] = _value(kind, key, text, defaults[key])
    try:
        task = GENERATORS[kind](rng, **values)
    except ValueError as error:
        raise input_error(kind, str(error).removeprefix(f"{kind}: ")) from None
    source = "; ".join(part for part in (task.world.source, note) if part)
    return replace(task, world=replace(task.world, name=name or kind, source=source))


def _value(kind: str, key: str, text: str, default: Any) -> Any:
    """The text as a value of the default's type."""
    words, convert = text.split(","), int if isinstance(default, int) else float
    count = len(default) if isinstance(default, tuple) else 1
    one = "a whole number" if convert is int else "a number"
    wanted = one if count == 1 else f"{count} numbers separated by commas"
    try:
        numbers = [convert(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise input_error(kind, key, f"must be {wanted}, got {text}")
    return tuple(numbers) if count > 1 else numbers[0]


def _connected(grid: Grid, task: Task) -> bool:
    """Whether allowed moves lead from the start's cell to the goal's, with room for the robot at both."""
    ends = [task.start[:2], task.goal]
    if not (point_clearance(task.world, ends) > grid.inflate).all():
        return False
    start, goal = (grid.cell_at(*end) for end in ends)
    todo, seen = [start], {start}
    while todo:
        cell = todo.pop()
        if cell == goal:
            return True
        for bit, (dr, dc) in enumerate(DIRECTIONS):
            there = cell[0] + dr, cell[1] + dc
            if grid.moves[cell] >> bit & 1 and there not in seen:
                seen.add(there)
                todo.append(there)
    return False
