"""Drives by planner, smoothing and noise: `python -m benchmarks.drives [--worlds N] [--jobs N] [TABLE ...]`.

Tables:

- barn: the BARN Challenge worlds, by planner, smoothing and noise; needs their folder or archive (`--barn`)
- forests: random worlds; every failure is listed with its seed
- smooth: excess length of taut routes over the exact optimum
- straight: heavy robots on an open straight, by yaw acceleration and top speed
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import statistics
import tarfile
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from antdrive.planners import Query, load_planner, pull_taut
from antdrive.planners.anyangle.tangent import shortest
from antdrive.planners.smoothing._kernels_smooth import encloses
from antdrive.robots import Footprint, Noise, RobotSpec, load_robot
from antdrive.sim import Scenario, run
from antdrive.sim.log.metrics import measure, tracking_error
from antdrive.worlds import Task, World, generate, import_barn, rasterise
from benchmarks.markdown import call_all, command_line, missing, print_tables, table
from tools.shared_data import BARN

SMALLEST = ("--worlds 2 --jobs 1",)
CROSSED = 0.005  # a crossing leads from this far on one side of a line to this far on the other [m]


class Result(NamedTuple):
    """The result of one drive.

    Attributes:
        name: the world
        outcome: how the drive ended
        succeeded: whether the robot reached the goal and its log proves that nothing was touched
        contacts: how many contacts the log holds
        shape: the shape that plans kept clear, disc or footprint; empty without a rollout
        metrics: every metric by name; empty without a rollout
        optimum: length of the exact shortest path among the inflated discs [m]
        errors: distances from the route near a speed [m], by speed [m/s]
    """

    name: str
    outcome: str
    succeeded: bool
    contacts: int
    shape: str
    metrics: dict[str, float]
    optimum: float
    errors: dict[float, list[float]]


def with_lidar(name: str) -> RobotSpec:
    """Load a robot of the catalogue; one without a lidar gets the jackal's."""
    spec = load_robot(name)
    return spec if spec.lidar is not None else dataclasses.replace(spec, lidar=load_robot("jackal").lidar)


def drive(name: str, task: Any, planner: str, robot: str | RobotSpec, **settings: Any) -> Result:
    """Drive once, discarding the rollout."""
    done = run(Scenario.of(task, planner, robot, **settings))
    log = done.rollout
    if log is None:
        return Result(name, done.outcome.name, False, 0, "", {}, math.nan, {})
    error, speed = tracking_error(log), log.twist[:, 0]
    near = {v: error[np.abs(speed - v) < 0.1 * v][::8].tolist() for v in (0.5, 1.0, 2.0)}
    optimum = log.record.plan.euclidean_optimum_m or math.inf
    shape = log.record.shape
    return Result(name, done.outcome.name, done.succeeded, len(log.contacts), shape, measure(log), optimum, near)


def percentile(values: Sequence[float], share: float) -> str:
    return f"{100 * float(np.percentile(values, share)):.2f} cm" if values else "–"


def failures(results: Sequence[Result]) -> str:
    wrong = [f"{r.name} ({r.outcome.lower()})" for r in results if not r.succeeded]
    return ", ".join(wrong) or "none"


@cache
def barn_tasks(source: Path, most: int = 0) -> Mapping[str, Task]:
    """Load BARN's worlds by name, in the order of their numbers; at most so many, 0: all."""
    if not source.exists():
        missing(f"no worlds at {source}; docs/how-to/data.md says where BARN's are")
    with tempfile.TemporaryDirectory() as folder:
        if source.is_file():
            with tarfile.open(source) as archive:
                archive.extractall(folder, filter="data")
            source = Path(folder)
        files = sorted(source.rglob("world_*.world"), key=lambda p: int(p.stem.split("_")[1]))
        return {path.stem: import_barn(path) for path in files[: most or None]}


def barn(jobs: int | None, source: Path, worlds: int) -> Iterator[str]:
    """Drive BARN's worlds with the jackal."""
    tasks, rows = barn_tasks(source, worlds), []
    for planner, smoothing, noise in (
        ("astar", "clearance", 0.0), ("astar", "taut", 0.0), ("astar", "none", 0.0), ("ants", "clearance", 0.0),
        ("aco-han", "clearance", 0.0),
        ("astar", "clearance", 1.0),
    ):  # fmt: skip
        given = {"smoothing": smoothing, "noise": noise, "margin": 0.03}
        got = call_all((partial(drive, name, task, planner, "jackal", **given) for name, task in tasks.items()), jobs)
        driven = [r for r in got if r.metrics]
        ratios = [r.metrics["arrival_s"] / (r.optimum / 2.0) for r in driven if r.succeeded]
        rows.append(
            [
                f"`{planner}`",
                smoothing,
                f"{noise:g}",
                f"{sum(r.succeeded for r in got)} of {len(got)}",
                str(sum(r.contacts for r in got)),
                f"{statistics.mean(r.metrics.get('barn', 0.0) for r in got):.4f}",
                f"{statistics.mean(ratios):.3f} / {max(ratios):.2f}",
                f"{100 * min(r.metrics['min_clearance_m'] for r in driven):.1f} cm",
                percentile([e for r in driven for e in r.errors[1.0]], 95),
                percentile([e for r in driven for e in r.errors[2.0]], 95),
                failures(got),
            ]
        )
    heads = [
        "planner", "smoothing", "noise", "certified", "contacts", "mean score", "duration / OT: mean / max", "min. clearance",
        "tracking error at 1 m/s, p95", "at 2 m/s", "failures",
    ]  # fmt: skip
    yield from table(heads, rows)


def forests(jobs: int | None, source: Path, worlds: int) -> Iterator[str]:
    """Drive random worlds, half from each generator."""
    rows, wrong = [], []
    kinds = {
        kind: [generate(kind, np.random.default_rng(n), {}, name=f"{kind} {n}", note="") for n in range(worlds // 2)]
        for kind in ("forest", "barn")
    }
    for noise, (kind, tasks), robot in itertools.product((0.0, 1.0), kinds.items(), ("turtlebot", "jackal")):
        given = {"planner": "astar", "robot": robot, "noise": noise, "margin": 0.03}
        got = call_all((partial(drive, t.world.name, t, seed=n, **given) for n, t in enumerate(tasks)), jobs)
        paths = [r for r in got if r.outcome != "NO_PATH"]
        good = sum(r.succeeded for r in paths)
        wrong += [f"{r.name}, {robot}, noise {noise:g}: {r.outcome.lower()}" for r in paths if not r.succeeded]
        rows.append(
            [
                kind,
                robot,
                f"{noise:g}",
                str(len(paths)),
                str(len(got) - len(paths)),
                f"{good} ({100 * good / max(1, len(paths)):.2f} %)",
                str(sum(r.contacts > 0 for r in got)),
                str(sum(r.contacts > 0 for r in got if r.succeeded)),
                f"{100 * min((r.metrics['min_clearance_m'] for r in paths if r.metrics), default=math.nan):.1f} cm",
            ]
        )
    heads = "worlds | robot | noise | with a path | without | certified | with contacts | certified with contacts"
    yield from table(f"{heads} | min. clearance", rows)
    yield "Failures: " + ("; ".join(wrong) or "none.")
    yield ""


def smooth(jobs: int | None, source: Path, worlds: int) -> Iterator[str]:
    """Compare taut routes with the exact shortest paths between the same ends."""
    gaps: dict[str, list[float]] = {"as by the optimum": [], "on other sides": []}
    for kind, n in itertools.product(("forest", "barn"), range(worlds // 2)):
        task = generate(kind, np.random.default_rng(n), {}, name="", note="")
        world = task.world
        grid = rasterise(world, task.cell, load_robot("turtlebot").radius + 0.03)
        plan = load_planner("astar").plan(Query.between(grid, task), np.random.default_rng(0))
        if not plan.solved:
            continue
        line = grid.xy(plan.cells)
        taut = pull_taut(line, world.discs, world.bounds, grid.inflate)
        best = shortest(world.discs, world.bounds, grid.inflate, tuple(line[0]), tuple(line[-1]))
        assert taut is not None
        assert best is not None
        same = not encloses(line, best.polyline(1e-4, world.discs, world.bounds, grid.inflate), world.discs)
        gaps["as by the optimum" if same else "on other sides"].append(taut.length / best.length - 1)
    yield from table(
        ["obstacles are passed", "worlds", "gap to the optimum: median", "max"],
        [
            [k, str(len(v)), f"{100 * statistics.median(v):.4f} %", f"{100 * max(v):.4f} %"]
            for k, v in gaps.items()
            if v
        ],
    )


def straight(jobs: int | None, source: Path, worlds: int) -> Iterator[str]:
    """Drive heavy robots along 19 m of open ground at noise 1, with three seeds each."""
    lane = Task(World("lane", (0.0, 0.0, 22.0, 3.0)), (1.5, 1.5, 0.0), (20.8, 1.5), cell=0.25, goal_tolerance=0.05)
    levels = Noise(pose_xy=0.01, pose_yaw=0.01, encoder=0.02, slip=0.02, delay=0.1)
    rows = []
    for yaw_acceleration, speed in itertools.product((0.25, 0.5, 1.0, 2.0, 4.0), (1.0, 2.0)):
        robot = RobotSpec(
            name="heavy", footprint=Footprint.rectangle(0.8, 0.6), height=0.5, mass=150.0, wheel_radius=0.1, track=0.5,
            max_speed=speed, max_yaw_rate=1.5, max_acceleration=0.5, max_yaw_acceleration=yaw_acceleration,
            max_lateral_acceleration=0.6, max_wheel_speed=40.0, wheel_torque=40.0, noise=levels,
        )  # fmt: skip
        seeds = range(min(worlds, 3))
        calls = (partial(along, Scenario.of(lane, "astar", robot, noise=1.0, seed=k)) for k in seeds)
        off, crossings, duration, certified = zip(*call_all(calls, jobs), strict=True)
        rows.append(
            [f"{yaw_acceleration:g}", f"{speed:g}", f"{sum(certified)} of {len(seeds)}"]
            + [f"{1000 * max(off):.0f} mm", str(max(crossings)), f"{statistics.mean(duration):.1f} s"]
        )
    heads = "yaw acceleration rad/s², top speed m/s, certified, largest distance, crossings, mean time"
    yield from table(heads.split(", "), rows)


def along(scenario: Scenario) -> tuple[float, int, float, bool]:
    """Return the largest distance from a line along x [m], how often it is crossed, the duration [s], whether certified."""
    done = run(scenario)
    log = done.rollout
    assert log is not None
    off = log.pose[:, 1] - scenario.task.goal[1]
    sides = np.sign(off[np.abs(off) > CROSSED])
    return float(np.abs(off).max()), int((np.diff(sides) != 0).sum()), float(log.t[-1]), done.succeeded


def main() -> None:
    given = command_line(
        __doc__,
        tables=([], "tables to print; default: all"),
        worlds=(1000, "number of random worlds, and of BARN's at most"),
        jobs=(int, "processes; by default one per core"),
        barn=(BARN, "folder or archive of BARN's world_*.world files"),
    )
    print_tables(
        given.tables, {f.__name__: f for f in (barn, forests, smooth, straight)}, given.jobs, given.barn, given.worlds
    )


if __name__ == "__main__":
    main()
