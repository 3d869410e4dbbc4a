"""Random worlds: forests of cylinders, and BARN-like worlds from a cellular automaton."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.base.caches import cached
from antdrive.base.errors import FieldError, input_error, require
from antdrive.base.types import Point
from antdrive.worlds import _kernels_turns
from antdrive.worlds.formats.barn import BARN_BOUNDS, BARN_CELL, BARN_GOAL, BARN_START, BARN_TOLERANCE
from antdrive.worlds.geometry import point_clearance
from antdrive.worlds.grid import DIRECTIONS, Grid, rasterise
from antdrive.worlds.world import Disc, Task, World

#: The BARN set's fill ratios and smoothing rounds; each pair has 25 of its 300 worlds.
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
    """Generate a square with random cylinders, to be crossed from corner to corner.

    The rule is from K. Han, *Collision free path planning algorithms for robot navigation problem*, MSc
    thesis, Missouri 2007, section 3: cylinders of random size, 1 to 5 grid units, are centred on random grid
    points, none near the start or the goal. The defaults are Han's, with 0.5 m a unit. Here "near" means a
    surface within `clearance`. Worlds that the robot cannot cross are discarded.

    Args:
        rng: the source of randomness
        size: side of the square [m]
        count: number of cylinders
        radius: smallest and largest radius of a cylinder [m]
        clearance: minimum distance from the start and the goal to any surface [m]
        spacing: distance between the grid points for the cylinders' centres [m]
        gap: minimum distance between the surfaces of two cylinders [m]; None: cylinders may overlap
        robot_radius: radius of the robot that must be able to cross the world [m]
        cell: the task's grid resolution, used to test crossing [m]
        tries: attempts for the world, and for each cylinder
        name: the world's name

    Raises:
        FieldError: an argument is out of its range, or no attempt succeeded (key "forest").
    """
    for key, value in (("spacing", spacing), ("robot_radius", robot_radius), ("cell", cell)):
        require(key, value, above=0)
    inset = robot_radius + cell  # start and goal are one cell away from contact with the walls
    rule = _Rule(size, radius, spacing, clearance, gap, tries, inset)
    if not 0 <= count <= 10_000:
        raise FieldError("count", f"must be from 0 to 10000, got {count}")
    start, goal = rule.ends
    source = f"the random worlds of han2007, section 3, with {count} cylinders"
    # Fewer attempts with many cylinders: all would take minutes.
    for _ in range(min(tries, max(20, 60_000 // max(count, 1)))):
        discs = rule.scatter(rng, count)
        if discs is None:
            continue
        world = World(name, (0.0, 0.0, size, size), discs, source)
        task = Task(world, (*start, math.pi / 4), goal, cell=cell)
        if _connected(rasterise(world, cell, robot_radius), task):
            return task
    raise FieldError(
        "forest",
        f"no world with {count} cylinders of radius {radius[0]:g} to {radius[1]:g} m that a disc of radius "
        f"{robot_radius:g} m can cross in {tries} tries; use fewer or smaller cylinders",
    )


@dataclass(frozen=True)
class _Rule:
    """The placement rule of `forest`."""

    size: float
    radius: tuple[float, float]
    spacing: float
    clearance: float
    gap: float | None
    tries: int
    inset: float  # from a corner to the start or the goal, in x and in y [m]

    def __post_init__(self) -> None:
        low, high = self.radius
        if not 0.001 <= low <= high:
            raise FieldError("radius", f"must be (smallest, largest) of at least a millimetre, got {self.radius}")
        for key, value in (("clearance", self.clearance), ("gap", self.gap or 0.0)):
            require(key, value, at_least=0)
        require("tries", self.tries, at_least=1)
        if not (math.isfinite(self.size) and self.size > 2 * self.inset):
            raise FieldError("size", f"must be greater than {2 * self.inset:g} m for this robot, got {self.size:g}")

    @property
    def ends(self) -> tuple[Point, Point]:
        """Start and goal [m]."""
        far = self.size - self.inset
        return (self.inset, self.inset), (far, far)

    def scatter(self, rng: np.random.Generator, count: int) -> tuple[Disc, ...] | None:
        """Place cylinders one by one; None if one does not fit in `tries` draws."""
        discs: list[Disc] = []
        for _ in range(count):
            disc = next((d for d in (self.draw(rng) for _ in range(self.tries)) if self.fits(d, discs)), None)
            if disc is None:
                return None
            discs.append(disc)
        return tuple(discs)

    def draw(self, rng: np.random.Generator) -> Disc:
        """Draw a random cylinder, with a radius in whole millimetres."""
        x, y = rng.integers(0, math.floor(self.size / self.spacing) + 1, size=2) * self.spacing
        return Disc(float(x), float(y), round(float(rng.uniform(*self.radius)), 3))

    def fits(self, disc: Disc, others: list[Disc]) -> bool:
        """Return whether a cylinder keeps its distances from start, goal and the other cylinders."""
        if min(_distance(disc, end) for end in self.ends) < self.clearance:
            return False
        return self.gap is None or all(_distance(disc, (o.x, o.y)) - o.radius >= self.gap for o in others)


def _distance(disc: Disc, point: Point) -> float:
    """Return the distance from a disc's surface to a point [m]."""
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
    """Generate a BARN-like world: a field of cylinders between two walls, grown by a cellular automaton.

    After D. Perille, A. Truong, X. Xiao, P. Stone, *Benchmarking metric ground navigation*, SSRR 2020: 30 x 30 cells
    of 0.15 m are filled at random and smoothed in rounds. In each round, cells with five or more of eight neighbours
    filled are filled, and cells with at most one are cleared. The walls at the field's sides stay filled, and all cells
    beyond them count as filled. Each filled cell becomes a cylinder of radius 0.075 m. Layout, start and goal are those
    of the BARN set. Worlds that the robot cannot cross are discarded (BARN carved a passage instead). At fill 0.30 a
    Jackal can cross only one in several hundred, so generation takes up to a few seconds.

    Args:
        rng: the source of randomness
        fill: initial probability of a filled cell; BARN's are `BARN_FILLS`
        rounds: rounds of smoothing; BARN's are `BARN_ROUNDS`
        robot_radius: radius of the robot that must be able to cross the world [m]
        tries: attempts
        name: the world's name

    Raises:
        FieldError: an argument is out of its range, or no attempt succeeded (key "barn").
    """
    require("fill", fill, at_least=0, below=1)
    require("rounds", rounds, at_least=0)
    require("robot_radius", robot_radius, above=0, at_most=2)
    require("tries", tries, at_least=1)
    source = f"the cellular automaton of BARN (Perille et al. 2020), fill {fill:g}, {rounds} rounds"
    for _ in range(tries):
        field = grow_field(rng, fill, rounds)
        if not crossable(field, robot_radius):
            continue
        world = World(name, BARN_BOUNDS, cylinders(field), source)
        task = Task(world, BARN_START, BARN_GOAL, BARN_TOLERANCE, BARN_CELL)
        if _connected(rasterise(task.world, BARN_CELL, robot_radius), task):
            return task
    raise FieldError(
        "barn",
        f"no world of fill {fill:g} that a disc of radius {robot_radius:g} m can cross in "
        f"{tries} tries; use a smaller fill or a smaller robot_radius",
    )


#: Widths of an office's doors [m].
OFFICE_DOORS = (0.85, 0.85, 0.85, 0.85, 0.95, 0.95, 0.95, 0.95, 1.2, 2.0)


def office(
    rng: np.random.Generator,
    doors: tuple[float, ...] = OFFICE_DOORS,
    *,
    corridor: float = 3.0,
    radius: float = 0.1,
    name: str = "office",
) -> Task:
    """Generate an office of 40 x 25 m: ten rooms along a corridor, each with one door at a random place.

    The walls are cylinders that overlap. The task leads from the corridor into the room with the widest door.

    Args:
        rng: the source of randomness
        doors: the doors' widths [m], in random order
        corridor: the corridor's width [m]
        radius: the cylinders' radius [m]
        name: the world's name

    Raises:
        FieldError: an argument is out of its range.
    """
    if not all(0 < width <= 5 for width in doors):
        raise FieldError("doors", f"must be greater than 0 and at most 5, got {min(doors):g} to {max(doors):g}")
    require("corridor", corridor, at_least=1, at_most=10)
    require("radius", radius, at_least=0.02, at_most=0.2)
    (width, height), side = (40.0, 25.0), 40.0 / (len(doors) / 2)
    low, high = (height - corridor) / 2, (height + corridor) / 2
    widths = rng.permutation(doors)
    points: list[tuple[float, float]] = []
    goal = (0.0, 0.0)
    for number, door in enumerate(widths.tolist()):
        left, upper = number // 2 * side, number % 2 == 1
        wall = high + radius if upper else low - radius
        first = left + rng.uniform(1.0, side - 1.0 - door)
        for begin, end in ((left, first - radius), (first + door + radius, left + side)):
            points += [(x, wall) for x in _row(begin, end, radius)]
        if left:
            span = (high + 3 * radius, height) if upper else (0.0, low - 3 * radius)
            points += [(left, y) for y in _row(*span, radius)]
        if door == max(doors):
            goal = (left + side / 2, (height + high) / 2 if upper else low / 2)
    discs = tuple(Disc(round(x, 4), round(y, 4), radius) for x, y in dict.fromkeys(points))
    world = World(name, (0.0, 0.0, width, height), discs, f"{len(doors)} rooms along a corridor of {corridor:g} m")
    return Task(world, (1.5, height / 2, 0.0), (round(goal[0], 4), goal[1]), 0.25, 0.05)


def _row(begin: float, end: float, radius: float) -> list[float]:
    """Return the centres of overlapping cylinders from begin to end."""
    count = 2 + math.ceil((end - begin) / (1.5 * radius))
    return [begin + (end - begin) * k / (count - 1) for k in range(count)]


#: The generators by name.
GENERATORS: Mapping[str, Callable[..., Task]] = MappingProxyType({"forest": forest, "barn": barn, "office": office})


def generate(
    kind: str,
    seed: int | np.random.Generator = 0,
    options: Mapping[str, Any] = MappingProxyType({}),
    *,
    name: str | None = None,
    note: str = "",
) -> Task:
    """Generate a random world.

    Args:
        kind: a name of `GENERATORS`
        seed: the random seed, or a source of randomness
        options: the generator's arguments by name, as numbers or text, such as {"count": 20, "radius": "0.2,0.5"}
        name: the world's name; by default the kind
        note: text appended to the world's source

    Raises:
        InputError: an unknown kind or option, an invalid value, or no attempt succeeded.
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
        rng = np.random.default_rng(seed)
    except (TypeError, ValueError):
        raise input_error(kind, "seed", f"must be a whole number of at least 0, got {seed!r:.60}") from None
    try:
        task = GENERATORS[kind](rng, **values)
    except FieldError as error:
        raise input_error(kind, *([error.key] if error.key != kind else []), error.problem) from None
    source = "; ".join(part for part in (task.world.source, note) if part)
    return replace(task, world=replace(task.world, name=name or kind, source=source))


@cached(64)
def generated(kind: str, seed: int, options: tuple[tuple[str, str], ...]) -> Task:
    """Generate the world of {generate: KIND, seed: SEED} with options in a file."""
    return generate(kind, seed, dict(options), name=f"{kind}-{seed}", note=f"seed {seed}")


def _value(kind: str, key: str, given: Any, default: Any) -> Any:
    """Convert an option to the default's type."""
    text = ",".join(map(str, given)) if isinstance(given, tuple | list) else str(given)
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
    """Return whether start and goal are clear and allowed moves connect their cells."""
    ends = [task.start[:2], task.goal]
    if not (point_clearance(task.world, ends) > grid.inflate).all():
        return False
    start, goal = (row * grid.shape[1] + col for row, col in (grid.cell_at(*end) for end in ends))
    return bool(_kernels_turns.led_to(grid.graph, start)[goal])


Picture: TypeAlias = npt.NDArray[np.bool_]  # (rows, columns), True where filled

SIDE = 30  # rows and columns of the automaton
RUNWAY = 34  # rows before the field; the first one is a wall
HEIGHT = 0.5  # of a cylinder [m]


def grow_field(rng: np.random.Generator, fill: float, rounds: int) -> Picture:
    """Generate a random field after smoothing, (30, 30), rows in the direction from start to goal."""
    field = rng.random((SIDE, SIDE)) < fill
    field[:, [0, -1]] = True
    for _ in range(rounds):
        count = _neighbours(field)
        field = (field & (count > 1)) | (count >= 5)
        field[:, [0, -1]] = True
    return field


def _neighbours(field: Picture) -> npt.NDArray[np.int64]:
    """Count the filled neighbours of each cell. Cells beyond the side walls count as filled, beyond the ends as empty."""
    rows, cols = field.shape
    padded = np.zeros((rows + 2, cols + 2), dtype=np.int64)
    padded[:, [0, -1]] = 1
    padded[1:-1, 1:-1] = field
    count = np.zeros(field.shape, dtype=np.int64)
    for dr, dc in DIRECTIONS:
        count += padded[1 + dr : 1 + dr + rows, 1 + dc : 1 + dc + cols]
    return count


def crossable(field: Picture, robot_radius: float) -> bool:
    """Return whether cells with room for the robot connect the field's ends: a cheap necessary condition."""
    reach = math.floor((robot_radius / BARN_CELL) + 0.5)
    free = np.ones(field.shape, dtype=np.bool_)
    rows, cols = field.shape
    for row, col in np.ndindex(2 * reach + 1, 2 * reach + 1):
        dr, dc = row - reach, col - reach
        if math.hypot(dr, dc) * BARN_CELL - BARN_CELL / 2 <= robot_radius:
            to_row, to_col = slice(max(0, dr), rows + min(0, dr)), slice(max(0, dc), cols + min(0, dc))
            from_row, from_col = slice(max(0, -dr), rows - max(0, dr)), slice(max(0, -dc), cols - max(0, dc))
            free[to_row, to_col] &= ~field[from_row, from_col]
    reached = np.zeros(field.shape, dtype=np.bool_)
    reached[0] = free[0]
    count: Any = -1
    while np.count_nonzero(reached) != count:
        count = np.count_nonzero(reached)
        reached[1:] |= reached[:-1]
        reached[:-1] |= reached[1:]
        reached[:, 1:] |= reached[:, :-1]
        reached[:, :-1] |= reached[:, 1:]
        reached &= free
    return bool(reached[-1].any())


def cylinders(field: Picture) -> tuple[Disc, ...]:
    """Return one cylinder for each filled cell of the field and of the walled runway before it."""
    runway = np.zeros((RUNWAY, SIDE), dtype=np.bool_)
    runway[0] = True
    runway[:, [0, -1]] = True
    x0, y0 = BARN_BOUNDS[0] + BARN_CELL / 2, BARN_BOUNDS[1] + BARN_CELL / 2
    return tuple(
        Disc(round(x0 + BARN_CELL * col, 3), round(y0 + BARN_CELL * row, 3), BARN_CELL / 2, HEIGHT)
        for row, col in np.argwhere(np.vstack([runway, field])).tolist()
    )
