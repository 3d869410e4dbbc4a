"""Plans and drives of rectangles between obstacles: `python -m benchmarks.footprints [TABLE ...]`.

Tables:

- lattice: BARN's worlds that the independent lattice (`benchmarks/lattice.py`) crosses, by the disc and by the outline
- drives: the same worlds driven with `astar` and default margins, with the map and without it, beside drives of the disc
- durations: worlds that both the disc and the footprint cross, driven with either
- repair: time to repair a plan for the `warehouse` robot after a small change, against planning from scratch; lengths must agree
- plans: times of `astar` in random worlds, median / worst, after a first world
- office: a campaign of random tasks in an office of ten doors
- ants: shortest paths of the colonies where `auto` takes the footprint, by the disc and by the footprint
- lines: margin that noise costs on courses of lines and turns [mm], beside its closed form
"""

from __future__ import annotations

import argparse
import itertools
import math
import statistics
import tempfile
import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from antdrive.planners import PLANNERS, Query, capabilities_of, load_planner, replanner_for
from antdrive.robots import PurePursuit, RobotSpec, load_robot
from antdrive.robots.clearance import outline_of
from antdrive.robots.default_margin import line_margin
from antdrive.runs.campaigns import make_campaign, sweep
from antdrive.runs.margins.loss import loss_on_course
from antdrive.sim.compose import route_planner
from antdrive.sim.driving.route_planner import grid_of
from antdrive.sim.scenario import LossFactors, Scenario
from antdrive.worlds import DIRECTIONS, Disc, Grid, Task, World, rasterise
from antdrive.worlds.headings import Outline, turn_clear
from antdrive.worlds.world import PointWorld, by_geometry
from benchmarks.drives import Result, barn_tasks, drive, with_lidar
from benchmarks.lattice import Flood, Point, Shape, flood
from benchmarks.markdown import call_all, command_line, print_tables, table
from tools.shared_data import BARN

SMALLEST = (
    "lattice drives durations --worlds 1 --jobs 1",
    "plans --random 1",
    "repair --rounds 1",
    "office --office_tasks 1 --jobs 1",
    "ants --seeds 1 --worlds 1",
    "lines --courses 1 --jobs 1",
)
ANTS = (
    ("jackal", "hasan-4d"),
    ("warehouse", "slalom"),
    ("warehouse", "u-trap"),
    ("warehouse", "gate"),
    ("warehouse", "han2007-aco"),
)
MARGIN = 0.03  # [m]
CELL = 0.05  # [m]
SIZES = {"husky": (0.99, 0.67, 0.0), "warehouse": (0.90, 0.60, 0.15)}  # length, width, middle ahead of the axle [m]
CHANGES = {
    "patch": "a patch of up to 3 × 3 cells on the path is blocked or cleared",
    "post": "a post of 2 to 5 cm appears beside the path: a new grid",
}
SEARCHES = {"disc": 8, "8 headings": 8, "16 headings": 16}
SEED = 1


def rectangle(length: float, width: float, ahead: float) -> list[Point]:
    """Return the corners of a rectangle whose middle is `ahead` of the axle [m]."""
    ends = ahead - length / 2, ahead + length / 2
    return [(x, y) for x in ends for y in (-width / 2, width / 2)]


def shape(robot: str, search: str) -> Shape:
    """Return the outline of a robot, or its disc, with the margin."""
    corners = rectangle(*SIZES[robot])
    if search == "disc":
        return Shape([(0.0, 0.0)], MARGIN + max(math.hypot(x, y) for x, y in corners))
    return Shape(corners, MARGIN)


def flooded(task: Any, robot: str, search: str) -> Flood:
    """Flood one world."""
    world = task.world
    args = (shape(robot, search), world.discs, world.bounds, task.start, task.goal, task.goal_tolerance)
    return flood(*args, cell=CELL, headings=SEARCHES[search])


@cache
def crossed(source: Path, worlds: int, jobs: int, robot: str, search: str) -> dict[str, bool]:
    """Return by world whether the lattice crosses it."""
    tasks = barn_tasks(source, worlds)
    floods = call_all((partial(flooded, task, robot, search) for task in tasks.values()), jobs)
    return {name: one.crossed for name, one in zip(tasks, floods, strict=True)}


def lattice(given: argparse.Namespace) -> Iterator[str]:
    """Yield the worlds crossed by each outline."""
    rows = []
    for robot, (length, width, ahead) in SIZES.items():
        found = [crossed(given.barn, given.worlds, given.jobs, robot, search) for search in SEARCHES]
        counts = [f"{sum(one.values())} of {len(one)}" for one in found]
        rows.append([f"`{robot}`, {length:.2f} × {width:.2f} m, middle {ahead:g} m ahead of the axle", *counts])
    yield from table(("robot", *SEARCHES), rows)


def hall(rng: np.random.Generator, posts: int = 90) -> list[Disc]:
    """Return posts in random places of a hall of 18 x 8 m, with room at both ends."""
    return [Disc(rng.uniform(2, 16), rng.uniform(0.5, 7.5), rng.uniform(0.05, 0.1)) for _ in range(posts)]


def hall_grid(posts: list[Disc]) -> Grid:
    """Rasterise the hall for the footprint."""
    size = SIZES["warehouse"]
    outline = Outline(np.array(rectangle(*size))[[2, 3, 1, 0]], MARGIN)
    return rasterise(World("hall", (0.0, 0.0, 18.0, 8.0), tuple(posts)), CELL, 1.0, outline)


def query_at(grid: Grid, start: tuple[int, int], heading: int) -> Query:
    """Return the query from a cell's label of a heading to the far end."""
    return Query(
        grid, start, (80, 330), start_label=int(grid.turns.label[start[0] * grid.shape[1] + start[1], heading])
    )


def processed(call: Callable[[], Any]) -> tuple[float, Any]:
    """Return the processor time of a call [s] and its answer."""
    began = time.process_time()
    answer = call()
    return time.process_time() - began, answer


def repairs(name: str, change: str, seed: int) -> Iterator[tuple[float, float, float]]:
    """Yield the processor times of a repair, of a plan from scratch and of one by A* for the changes of one drive [s]."""
    rng, planner, astar = np.random.default_rng(seed), load_planner(name), load_planner("astar")
    posts, blocked = hall(rng), list[Any]()
    replanner = replanner_for(planner, query_at(hall_grid(posts), (80, 20), 0), rng)
    replanner.block([])  # the first edit prepares the grid once
    for turn in range(12):
        path = replanner.result().cells
        if len(path) < 60:
            return
        step = int(rng.integers(1, 8))
        heading = DIRECTIONS.index(tuple((path[step] - path[step - 1]).tolist()))
        at, ahead = tuple(path[step].tolist()), path[step + int(rng.integers(24, 40))]
        if change == "post":
            (x, y), radius = replanner.query.grid.xy([ahead])[0], rng.uniform(0.02, 0.05)
            side = rng.choice([-1, 1]) * rng.uniform(0.3, 0.6)
            posts = [*posts, Disc(x, y + side, radius)]
            edit = partial(replanner.change, hall_grid(posts))
        elif turn % 3 == 2:
            edit = partial(replanner.clear, blocked.pop(0))
        else:
            blocked.append(np.unique(ahead + rng.integers(-1, 2, (5, 2)), axis=0))
            edit = partial(replanner.block, blocked[-1])

        def repair(edit: Any = edit, at: Any = at, heading: int = heading) -> Any:
            edit()
            replanner.move(at, heading)
            return replanner.result()

        took, repaired = processed(repair)
        now = replanner.query
        turns = replace(now.grid.turns, moves=now.grid.turns.moves.copy())
        query = replace(now, grid=replace(now.grid, turns=turns))
        anew, planned = processed(partial(planner.plan, query, rng))
        other, optimal = processed(partial(astar.plan, query, rng))
        if not optimal.solved:
            return
        assert abs(repaired.cost - optimal.cost) < 1e-9
        assert abs(planned.cost - optimal.cost) < 1e-9
        yield took, anew, other


def repair(given: argparse.Namespace) -> Iterator[str]:
    """Yield the times of repairs and of plans from scratch."""
    rows = []
    for change, what in CHANGES.items():
        for name in ("dstar-lite", "dstar"):
            list(repairs(name, change, 0))  # warms up
            times = np.array([row for seed in range(given.rounds) for row in repairs(name, change, seed)]).T * 1e3
            took, anew, other = times
            spread = [f"{q:.2f}" for q in np.percentile(took, [50, 90, 99])]
            rows.append(
                [what, f"`{name}`", f"{len(took)}", *spread, f"{np.median(anew):.1f}", f"{np.median(other):.1f}"]
                + [f"{np.median(anew / took):.1f}"]
            )
    head = (
        "change",
        "planner",
        "changes",
        "repair: median [ms]",
        "90 %",
        "99 %",
        "anew [ms]",
        "`astar` [ms]",
        "anew / repair",
    )
    yield from table(head, rows)


def random_task(seed: int, outline: Outline) -> Task:
    """Return a task of 18 x 8 m among 40 to 160 discs; its ends are 10 m apart, and the outline is clear at the start."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(40, 160))
    discs = np.column_stack([rng.uniform(0, 18, count), rng.uniform(0, 8, count), rng.uniform(0.05, 0.25, count)])
    while True:
        start = float(rng.uniform(0, 18)), float(rng.uniform(0, 8)), float(rng.uniform(-math.pi, math.pi))
        goal = float(rng.uniform(0, 18)), float(rng.uniform(0, 8))
        world = PointWorld.of(f"random {seed}", (0.0, 0.0, 18.0, 8.0), discs)
        clear = turn_clear(*start, 0.0, outline, world.discs, world.bounds)
        if (
            clear
            and math.dist(start[:2], goal) >= 10
            and turn_clear(*goal, 0.0, 0.0, outline, world.discs, world.bounds)
        ):
            return Task(world, start, goal, goal_tolerance=0.2, cell=CELL)


class Times(NamedTuple):
    """Times of one plan [s]: processor time of its parts and of all, and the wall time."""

    labels: float  # from the world to the grid with turns
    ends: float
    search: float
    all: float
    wall: float


def timed(task: Task, outline: Outline) -> tuple[Times, bool]:
    """Return the times of a plan with `astar`, and whether there is a path."""
    astar, rng = load_planner("astar"), np.random.default_rng(0)
    radius = float(np.hypot(*outline.corners.T).max()) + outline.reach
    began, used = time.perf_counter(), [time.process_time()]
    grid = rasterise(task.world, CELL, radius, outline)
    used.append(time.process_time())
    query = Query.between(grid, task)
    used.append(time.process_time())
    plan = astar.plan(query, rng)
    used.append(time.process_time())
    return Times(*np.diff(used).tolist(), used[-1] - used[0], time.perf_counter() - began), plan.solved


def plans(given: argparse.Namespace) -> Iterator[str]:
    """Yield the median and the worst times in random worlds."""
    rows = []
    for robot in SIZES:
        outline = outline_of(load_robot(robot).footprint, MARGIN)
        timed(random_task(given.random, outline), outline)  # loads the kernels
        found = [timed(random_task(seed, outline), outline) for seed in range(given.random)]
        parts = zip(*(times for times, _ in found), strict=True)
        cells = [f"{1e3 * statistics.median(part):.1f} / {1e3 * max(part):.1f}" for part in parts]
        rows.append([f"`{robot}`", f"{sum(solved for _, solved in found)} of {len(found)}", *cells])
    yield from table(("robot", "with a path", *(f"{name} [ms]" for name in Times._fields)), rows)


def robot_of(name: str, *, mapped: bool = True) -> RobotSpec:
    """Return a robot, with a lidar where it has no map; its size is that of the lattice."""
    robot = load_robot(name)
    length, width, (ahead, aside) = robot.footprint.box or (math.nan, math.nan, (math.nan, math.nan))
    assert np.allclose((length, width, ahead, aside), (*SIZES[name], 0.0)), robot.footprint
    return robot if mapped else with_lidar(name)


def driven(given: argparse.Namespace, name: str, among: Collection[str] = (), **settings: Any) -> list[Result]:
    """Drive a robot through the worlds, or those among the given ones, in their order."""
    tasks = barn_tasks(given.barn, given.worlds)
    robot = robot_of(name, mapped=settings["map"] == "given")
    picked = {world: task for world, task in tasks.items() if not among or world in among}
    calls = (partial(drive, world, task, "astar", robot, seed=SEED, **settings) for world, task in picked.items())
    return call_all(calls, given.jobs)


def drives(given: argparse.Namespace) -> Iterator[str]:
    """Yield drives by robot, map, noise and the shape that plans keep clear; mapless only in worlds that it crosses."""
    heads = [
        "robot",
        "map",
        "noise",
        "footprint",
        "worlds",
        "solved",
        "by the footprint",
        "succeeded",
        "certified",
        "contacts",
    ]
    yield from table([*heads, "crossed by the lattice, not certified"], drive_rows(given))


def drive_rows(given: argparse.Namespace) -> Iterator[list[str]]:
    for name, known, noise, shape in itertools.product(SIZES, ("given", "none"), (0.0, 1.0), ("auto", "disc")):
        if not set(given.only.split()) <= {name, known, f"{noise:g}", shape}:
            continue
        found = crossed(given.barn, given.worlds, given.jobs, name, "disc" if shape == "disc" else "8 headings")
        among = [world for world in found if known == "given" or found[world]]
        got = driven(given, name, among, map=known, noise=noise, footprint=shape) if among else []
        there = [one for one in got if one.metrics]
        left = [f"{one.name} ({one.outcome.lower()})" for one in got if found[one.name] and not one.succeeded]
        counts = (
            len(got),
            len(there),
            sum(one.shape == "footprint" for one in there),
            sum(one.outcome == "SUCCEEDED" for one in there),
            sum(one.succeeded for one in there),
            sum(one.contacts for one in there),
        )
        yield [f"`{name}`", known, f"{noise:g}", shape, *map(str, counts), ", ".join(left) or "none"]


def durations(given: argparse.Namespace) -> Iterator[str]:
    """Yield the durations of drives of the footprint over those of the disc, in worlds that both cross."""
    rows = []
    for name, noise in itertools.product(SIZES, (0.0, 1.0)):
        disc = {
            one.name: one for one in driven(given, name, map="given", noise=noise, footprint="disc") if one.succeeded
        }
        exact = driven(given, name, disc, map="given", noise=noise, footprint="exact") if disc else []
        pairs = [(one.metrics, disc[one.name].metrics) for one in exact if one.succeeded]
        ratios = ([one[key] / two[key] for one, two in pairs] for key in ("duration_s", "driven_length_m"))
        shown = (f"{statistics.median(some):.3f} / {max(some):.3f}" if some else "–" for some in ratios)
        rows.append([f"`{name}`", f"{noise:g}", str(len(pairs)), *shown])
    yield from table(
        "robot | noise | worlds | duration over the disc's: median / max | driven length: median / max", rows
    )


def office(given: argparse.Namespace) -> Iterator[str]:
    """Yield the results of a campaign of random tasks in an office."""
    campaign = {
        "worlds": [{"generate": "office"}],
        "planners": ["astar"],
        "robots": ["warehouse"],
        "noise": [0.0, 1.0],
        "tasks": {"random": given.office_tasks, "seed": SEED, "min_distance": 5.0},
        "seeds": [SEED],
    }
    with tempfile.TemporaryDirectory() as folder:
        runs = sweep(make_campaign(campaign), folder, jobs=given.jobs).table.to_pylist()
    rows = []
    for noise, some in itertools.groupby(sorted(runs, key=lambda run: run["noise"]), key=lambda run: run["noise"]):
        got = list(some)
        outcomes = [run["outcome"] for run in got]
        certified = [run for run in got if run["succeeded"]]
        failed = [f"{run['task']} ({run['outcome']})" for run in got if not run["succeeded"]]
        least = min((run["min_clearance_m"] for run in got if run["certified"]), default=math.nan)
        counts = len(got), len(got) - outcomes.count("no_path"), outcomes.count("succeeded"), len(certified)
        shown = *map(str, counts), str(outcomes.count("collided")), f"{100 * least:.1f} cm", ", ".join(failed) or "none"
        rows.append([f"{noise:g}", *shown])
    yield from table("noise | tasks | solved | succeeded | certified | collided | min. clearance | not certified", rows)


def ants(given: argparse.Namespace) -> Iterator[str]:
    """Yield the shortest paths of the colonies by the disc and on the grid that footprint `auto` takes instead."""
    colonies = [
        name for name in PLANNERS if capabilities_of(PLANNERS[name]).iterative and capabilities_of(PLANNERS[name]).turns
    ]
    rows = []
    for robot, world in ANTS[: given.worlds or None]:
        routes = route_planner(Scenario.of(world, planner=colonies[0], robot=robot))
        disc = grid_of(by_geometry(routes.task.world), routes.cell, routes.inflate)
        for shape, grid in (("disc", disc), ("footprint", routes.chosen_grid())):
            query, lengths = Query.between(grid, routes.task), []
            for name in colonies:
                made = [load_planner(name).plan(query, np.random.default_rng(seed)) for seed in range(given.seeds)]
                lengths.append(min((plan.cost for plan in made if plan.solved), default=math.nan))
            shown = ("–" if math.isnan(length) else f"{length:.2f}" for length in lengths)
            rows.append([f"`{robot}`", f"`{world}`", f"{grid.cell:g}", shape, *shown])
    yield from table(("robot", "world", "cell [m]", "shape", *(f"`{name}`" for name in colonies)), rows)


def lines(given: argparse.Namespace) -> Iterator[str]:
    """Yield the margin that noise costs on courses of lines and turns, beside its closed form."""
    rows = []
    for name in ("jackal", *SIZES):
        robot, controller = load_robot(name), PurePursuit()
        margin = line_margin(robot, controller, 1.0)
        factors = LossFactors(robot=robot, controller=controller, noise=1.0, smoothing="clearance", outlined=True)
        calls = (partial(loss_on_course, factors, margin, seed) for seed in range(given.courses))
        losses = [loss.footprint for loss in call_all(calls, given.jobs)]
        figures = margin, statistics.median(losses), max(losses)
        rows.append([f"`{name}`", str(sum(map(math.isfinite, losses))), *(f"{1000 * one:.0f}" for one in figures)])
    yield from table(("robot", "arrived", "`line_margin`", "median loss", "largest loss"), rows)


def main() -> None:
    given = command_line(
        __doc__,
        tables=([], "tables to print; default: all"),
        barn=(BARN, "folder or archive of BARN's world_*.world files"),
        worlds=(0, "how many of BARN's worlds, or of those of `ants`; 0: all"),
        jobs=(2, "processes; 0: this one"),
        only=("", "rows of `drives` with these values, such as 'husky none 1 auto'; default: all"),
        rounds=(20, "repair: drives of each kind"),
        random=(60, "random worlds"),
        office_tasks=(100, "how many random tasks in the office"),
        seeds=(3, "ants: runs of each colony"),
        courses=(80, "lines: courses of each robot"),
    )
    shown = (lattice, drives, durations, plans, repair, office, ants, lines)
    print_tables(given.tables, {f.__name__: f for f in shown}, given)


if __name__ == "__main__":
    main()
