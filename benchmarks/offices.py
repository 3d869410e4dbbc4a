"""Drives past people in generated offices: `python -m benchmarks.offices [--offices N] [--seed S] [--only TEXT] [--out FILE]`.

An office is drawn as an occupancy map: rooms along a corridor, most with a second corridor across, doors of 0.9 to 1.4 m, desks,
shelves, chairs and columns. The map becomes at least 3,000 cylinders. 2 to 8 people of radius 0.25 m walk back and forth between
places at 0.4 to 1.2 m/s and never yield; their ways keep clear of what stands. Robots alternate.

`sipp`, with the motions known and without noise, is the reference. The others are `astar` with ground-truth positions and
velocities, by lidar on the map, and without a map (scan matching), each with noise 0 and 1. Results are lines of a JSONL file,
from which an interrupted run resumes; `--only` keeps the kinds whose name contains a text. Each contact is listed.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import json
import math
import statistics
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.base.plane import arc_lengths
from antdrive.planners import PLANNERS, Query, smooth
from antdrive.robots import RobotSpec
from antdrive.sim import Outcome, Perception, Rollout, Scenario, run
from antdrive.sim.log.contacts import touches_of
from antdrive.worlds import CellMap, Keyframed, Task, Trajectories, World, map_task, point_clearance, rasterise
from antdrive.worlds.formats.cellmap import largest_ground
from benchmarks.drives import with_lidar
from benchmarks.markdown import command_line, table

SMALLEST = ("--offices 1 --only astar/velocities/0",)
STREAM = 0x4F464643  # keeps these offices apart from those of all other seeds
CELL, WALL = 0.05, 3  # side of the cells [m]; thickness of walls [cells]
DOORS, CORRIDOR, ROOM = (0.9, 1.4), (1.6, 3.0), 5.5  # widths of doors and corridors, mean of rooms [m]
LEAST = 3000  # cylinders
RADIUS, ROOMY = 0.25, 0.1  # of a person; what their way keeps clear of obstacles beyond it [m]
SPEEDS, WAYS = (0.4, 1.2), (6.0, 30.0)  # of people [m/s]; lengths of their ways [m]
APART = 1.5  # people begin at least this far from the robot's start, and turn round as far from its goal [m]
CLEAR, FAR = 0.75, 10.0  # least room around starts and goals; least distance between them [m]
ROBOTS = ("jackal", "warehouse", "turtlebot4", "husky")
REFERENCE = "sipp/motions/0"
LIMIT = 400.0  # time limit of all drives [s]
KINDS: dict[str, dict[str, Any]] = {
    REFERENCE: {"noise": 0.0},
    **{
        f"astar/{name}/{noise}": {"noise": float(noise), **settings}
        for (name, settings), noise in itertools.product(
            {
                "velocities": {},
                "lidar": {"perception": Perception(kind="lidar")},
                "mapless": {"map": "none", "localisation": "matching"},
            }.items(),
            (0, 1),
        )
    },
}

Cells = npt.NDArray[np.bool_]


def drawn(rng: np.random.Generator) -> Cells:
    """Draw the free cells (R, C) of an office."""
    rows, cols = (round(rng.uniform(*span) / CELL) for span in ((18.0, 25.0), (30.0, 40.0)))
    free = np.zeros((rows, cols), dtype=np.bool_)
    free[WALL:-WALL, WALL:-WALL] = True
    wide = round(rng.uniform(*CORRIDOR) / CELL)
    low = (rows - wide) // 2 + int(rng.integers(-30, 31))
    high = low + wide
    free[low - WALL : low] = free[high : high + WALL] = False
    across = None
    if rng.random() < 0.7:
        left = int(rng.integers(cols // 4, 3 * cols // 4))
        across = left, left + round(rng.uniform(*CORRIDOR) / CELL)
    for below in (True, False):
        band = slice(WALL, low - WALL) if below else slice(high + WALL, rows - WALL)
        wall = slice(low - WALL, low) if below else slice(high, high + WALL)
        for begin, end in rooms(cols, across, rng):
            if end < cols - WALL:
                free[band, end : end + WALL] = False
            if begin > WALL:
                free[band, begin - WALL : begin] = False
            for _ in range(1 + int(rng.random() < 0.3)):
                free[wall, door(begin, end, rng)] = True
            if begin > WALL and rng.random() < 0.3:
                free[door(band.start, band.stop, rng), begin - WALL : begin] = True
            furnish(free, (band.start, band.stop), (begin, end), rng)
        if across:
            free[wall, slice(*across)] = True
    for col in range(round(5 / CELL), cols - round(5 / CELL), round(10 / CELL)):
        if rng.random() < 0.5:  # a column beside the corridor's wall
            free[high - round(0.3 / CELL) : high, col : col + round(0.3 / CELL)] = False
    return free


def rooms(cols: int, across: tuple[int, int] | None, rng: np.random.Generator) -> Iterator[tuple[int, int]]:
    """Yield the first and the end column of the rooms beside the corridor across."""
    for begin, end in ((WALL, across[0] - WALL), (across[1] + WALL, cols - WALL)) if across else ((WALL, cols - WALL),):
        count = max(1, round((end - begin) * CELL / ROOM))
        walls = np.linspace(begin, end, count + 1)
        walls[1:-1] += rng.uniform(-0.7, 0.7, count - 1) / CELL
        for left, right in itertools.pairwise(walls.astype(int).tolist()):
            yield left + (WALL if left > begin else 0), right


def door(begin: int, end: int, rng: np.random.Generator) -> slice:
    """Return the cells of a door in a wall."""
    width = round(rng.uniform(*DOORS) / CELL)
    first = begin + int(rng.integers(4, max(5, end - begin - width - 4)))
    return slice(first, first + width)


def furnish(free: Cells, rows: tuple[int, int], cols: tuple[int, int], rng: np.random.Generator) -> None:
    """Put shelves along walls, desks with chairs and columns into a room, a metre from its own doors' walls."""
    (r0, r1), (c0, c1), metre = rows, cols, round(1.2 / CELL)
    area = (r1 - r0) * (c1 - c0) * CELL**2
    sizes = {"shelf": (1.6, 0.4), "desk": (1.5, 0.75), "chair": (0.45, 0.45), "column": (0.35, 0.35)}
    for _ in range(int(area / 6.0)):
        kind = str(rng.choice(("shelf", "desk", "desk", "chair", "column"), p=(0.2, 0.25, 0.2, 0.25, 0.1)))
        height, width = (round(side / CELL) for side in rng.permutation(sizes[kind]))
        if r1 - r0 - height <= 2 * metre or c1 - c0 - width <= 2 * metre:
            continue
        row = int(rng.integers(r0 + metre, r1 - metre - height))
        col = int(rng.integers(c0 + metre, c1 - metre - width))
        away = 0 if rng.random() < 0.4 else metre  # some pieces stand together
        if free[row - away : row + height + away, col - away : col + width + away].all():
            free[row : row + height, col : col + width] = False


@functools.cache
def office(number: int, seed: int) -> Task:
    """Return office `number` of a seed with its people."""
    for attempt in itertools.count():
        rng = np.random.default_rng([STREAM, seed, number, attempt])
        free = drawn(rng)
        cells = CellMap(free, CELL, (0.0, 0.0))
        world = map_task(cells, *largest_ground(cells), name=f"office-{seed}-{number}").world
        if len(world.obstacles) < LEAST:
            continue
        ends = two_places(world, rng)
        task = Task(world, (*ends[0], float(rng.uniform(-math.pi, math.pi))), ends[1], cell=0.1)
        people = tuple(itertools.islice(walkers(task, rng), int(rng.integers(2, 9))))
        return dataclasses.replace(task, world=dataclasses.replace(world, movers=people))
    raise AssertionError


def two_places(world: World, rng: np.random.Generator) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return two roomy places far from each other."""
    while True:
        a, b = places(world, CLEAR, 2, rng)
        if math.dist(a, b) >= FAR:
            return a, b


def places(world: World, room: float, count: int, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Return random places with room around them [m]."""
    found: list[tuple[float, float]] = []
    while len(found) < count:
        xy = rng.uniform(world.bounds[:2], world.bounds[2:])
        if point_clearance(world, [xy])[0] >= room:
            found.append((round(float(xy[0]), 3), round(float(xy[1]), 3)))
    return found


def walkers(task: Task, rng: np.random.Generator) -> Iterator[Keyframed]:
    """Yield people who walk back and forth, by ways that keep clear of what stands."""
    grid = rasterise(task.world, task.cell, RADIUS + ROOMY)
    while True:
        a, b = places(task.world, RADIUS + 2 * ROOMY, 2, rng)
        way = dataclasses.replace(task, start=(*a, 0.0), goal=b)
        answer = PLANNERS["astar"].plan(Query.between(grid, way), rng)
        if not answer.solved or not WAYS[0] <= answer.cost <= WAYS[1]:
            continue
        xy = np.asarray(smooth(answer, grid, way, kind="taut").xy)
        times, (start, goal) = arc_lengths(xy) / rng.uniform(*SPEEDS), (task.start[:2], task.goal)
        frames = tuple((float(t), float(x), float(y)) for t, (x, y) in zip(times, xy, strict=True))
        one = Keyframed(
            radius=RADIUS, height=1.75, keyframes=frames, loop="pingpong", phase=float(rng.uniform(0, 2 * times[-1]))
        )
        now = Trajectories.of(dataclasses.replace(task.world, movers=(one,)), start, 0).positions(0.0)[0, 0]
        if math.dist(now, start) >= APART and min(math.dist(end, goal) for end in (a, b)) >= APART:
            yield one


def robot(number: int) -> RobotSpec:
    """Return the robot of an office; all have a lidar."""
    return with_lidar(ROBOTS[number % len(ROBOTS)])


def scenario(number: int, seed: int, kind: str) -> Scenario:
    """Return the scenario of one drive."""
    spec, planner = robot(number), kind.partition("/")[0]
    options = {"speed": min(0.5, 0.8 * spec.max_speed), "horizon": LIMIT} if planner == "sipp" else {}
    return Scenario.of(
        office(number, seed), planner, spec, options=options, seed=number, time_limit=LIMIT, **KINDS[kind]
    )


def drive(number: int, seed: int, kind: str) -> dict[str, Any]:
    """Drive once: how it ended, and each contact."""
    started = time.process_time()
    found: dict[str, Any] = {"n": number, "seed": seed, "kind": kind, "robot": ROBOTS[number % len(ROBOTS)]}
    try:
        done = run(scenario(number, seed, kind))
        log = done.rollout
        found |= {"outcome": done.outcome.key, "reason": done.reason, "certified": done.succeeded}
        if log is not None:
            found |= {"time": float(log.t[-1]), "digest": log.digest, "contacts": list(contacts(log))}
    except Exception as error:  # a fault of the program is a result, too
        found |= {"outcome": "error", "reason": f"{type(error).__name__}: {error}", "certified": False}
    return found | {"cpu": round(time.process_time() - started, 1)}


def contacts(log: Rollout) -> Iterator[dict[str, Any]]:
    """Describe each touch of a drive: what was touched, when, and how fast both were."""
    discs = len(log.record.world.obstacles)
    for touch in touches_of(log):
        mover, before = touch.obstacle - discs, max(touch.step - 1, 0)
        people = 0 <= mover < log.movers.shape[1]
        speed = math.dist(*log.movers[[before, touch.step], mover]) * log.record.physics_hz if people else 0.0
        yield {
            "with": f"movers[{mover}]" if people else "static", "t": float(log.t[touch.step]), "speed": speed,
            "robot": float(log.twist[before, 0]), "turning": float(log.twist[before, 1]),
            "standing": touch.outcome is Outcome.HIT_WHILE_STANDING,
        }  # fmt: skip


def results(offices: int, seed: int, kinds: Sequence[str], out: Path) -> list[dict[str, Any]]:
    """Drive what the file does not hold yet, and return all results."""
    wanted = list(itertools.product(range(offices), kinds))
    done = [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []
    known = {(one["n"], one["kind"]): one for one in done if one["seed"] == seed}
    for key in wanted:
        if key not in known:
            known[key] = drive(key[0], seed, key[1])
            with out.open("a") as file:
                file.write(json.dumps(known[key]) + "\n")
    return [known[key] for key in wanted]


def rows(got: Sequence[Mapping[str, Any]], kinds: Sequence[str]) -> Iterator[list[str]]:
    """Yield the table's row of each kind."""
    reference = {one["n"]: one for one in got if one["kind"] == REFERENCE and one["certified"]}
    for kind in kinds:
        mine = [one for one in got if one["kind"] == kind]
        touched = [contact for one in mine for contact in one.get("contacts", ())]
        static = sum(contact["with"] == "static" for contact in touched)
        standing = sum(contact["standing"] for contact in touched)
        asked = [one for one in mine if one["n"] in reference]
        good = [one for one in asked if one["certified"]]
        ratios = [one["time"] / reference[one["n"]]["time"] for one in good]
        share = f"{len(good)} of {len(asked)} ({100 * len(good) / max(1, len(asked)):.1f} %)"
        yield [
            kind, str(len(mine)), str(sum(one["certified"] for one in mine)),
            str(sum(one["outcome"] == "error" for one in mine)), str(static), str(len(touched) - static - standing),
            str(standing), share, f"{statistics.median(ratios):.2f}" if ratios else "–",
        ]  # fmt: skip


HEADS = (
    "planner / perception / noise | drives | certified | internal errors | contacts with what stands | with people, driving | "
    "standing | certified of sipp's | median time / sipp's"
)


def failures(got: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield a line for each drive that was not certified."""
    for one in got:
        if one["certified"]:
            continue
        told = [
            f"{c['with']} at {c['speed']:.2f} m/s, the robot at {c['robot']:.2f} m/s and {c['turning']:.2f} rad/s"
            f"{', standing' if c['standing'] else ''}, t = {c['t']:.1f} s"
            for c in one.get("contacts", ())
        ]
        yield f"- office {one['n']} {one['robot']} {one['kind']}: {one['outcome']} ({'; '.join(told) or one['reason']})"


def main() -> None:
    given = command_line(
        __doc__,
        offices=(50, "number of offices"),
        seed=(0, "the seed of all offices"),
        only=("", "only the kinds whose name holds this text; sipp is always driven"),
        out=(Path("offices.jsonl"), "the file of results"),
    )
    kinds = [kind for kind in KINDS if given.only in kind or kind == REFERENCE]
    got = results(given.offices, given.seed, kinds, given.out)
    print("\n".join([*table(HEADS, rows(got, kinds)), *failures(got)]))


if __name__ == "__main__":
    main()
