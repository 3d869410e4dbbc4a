"""Drives among movers: `python -m benchmarks.dynamic [--most N] [--jobs N] [--dynabarn FILE] [--only TEXT] [TABLE ...]`.

Tables:

- dynabarn: ten DynaBARN worlds, each started at ten times, by policy
- generated: worlds by the rules of DynaBARN, ten of each class, by policy
- random: worlds with 1 to 10 movers as fast as the robot; every failure is listed with its seed
- hasan: drives of the cases in hasan's paper
- people: the catalogue's four worlds with people, with and without a map, beside the same drives without people
"""

from __future__ import annotations

import collections
import dataclasses
import itertools
import math
import statistics
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from antdrive.base.plane import polyline_length
from antdrive.planners import Query, plan_in_time
from antdrive.robots import load_robot
from antdrive.sim import Outcome, Perception, ReplanPolicy, Rollout, Scenario, run
from antdrive.sim.log.sights import tracked_rows
from antdrive.sim.policy import Trigger
from antdrive.worlds import (
    Cruising,
    Disc,
    Keyframed,
    Mover,
    Task,
    Trajectories,
    World,
    import_dynabarn,
    list_worlds,
    load_task,
    rasterise,
)
from benchmarks.drives import with_lidar
from benchmarks.markdown import call_all, command_line, missing, print_tables, table
from tools.shared_data import DYNABARN

SMALLEST = ("--most 1 --jobs 1 --only given",)
CLASSES = {"easy": range(20), "medium": range(20, 40), "hard": range(40, 60)}
#: Rules of the generated worlds by class: numbers of movers, their speeds [m/s], and orders of their polynomials.
RULES = {
    "easy": ((8, 11), (0.5, 0.95), (1, 3)),
    "medium": ((16, 18), (1.0, 1.45), (3, 6)),
    "hard": ((21, 23), (1.5, 1.95), (4, 8)),
}
HALF, SAMPLES = 10.0, 10  # half the side of the box that movers cross [m]; evenly spaced keyframes of each
LATELY = 1.0  # time before a contact in which the mover's motion is reported [s]
JUMP, TURN = 0.3, 0.7  # mover displacement between two rows that counts as a jump [m]; smallest reported turn [rad]
START_INTERVAL = 7.3  # between start times of drives in one world [s]
KNOWN, BY_LIDAR = Perception(kind="motions"), Perception(kind="lidar")
POLICIES: dict[str, dict[str, Any]] = {
    "neither": {"avoidance": None, "replanning": None},
    "avoid": {"replanning": ReplanPolicy(around_movers=False)},
    "replan": {"avoidance": None},
    "avoid and replan": {},
    "the same, motions known": {"perception": KNOWN},
    "by lidar: the map is given, movers are not": {"perception": BY_LIDAR},
    "everything by lidar": {"perception": BY_LIDAR, "map": "none", "localisation": "matching"},
    "keep to a plan in space and time": {"planner": "sipp", "options": {"speed": "1.5"}, "margin": 0.15},
}
LISTED = [policy for policy in POLICIES if policy == "avoid and replan" or "by lidar" in policy]  # failures by name


class Result(NamedTuple):
    """The result of one drive.

    Attributes:
        name: the world and the moment, or the seed
        outcome: how the drive ended
        duration: simulated time [s]
        replans: attempts to find a new route
        certified: whether the robot reached the goal and its log proves that nothing was touched
        reason: what the outcome leaves open
        proved: whether the space-time planner found a path
    """

    name: str
    outcome: Outcome
    duration: float
    replans: int
    certified: bool
    reason: str
    proved: bool = True


def drive(name: str, task: Task, planner: str, robot: str, **settings: Any) -> Result:
    """Drive once, discarding the rollout."""
    done = run(Scenario.of(task, planner, robot, **settings))
    log = done.rollout
    if log is None:
        return Result(name, done.outcome, math.nan, 0, False, done.reason)
    replans, reason = len(log.record.replans), "; ".join(filter(None, (done.reason, warning(log))))
    return Result(name, done.outcome, float(log.t[-1]), replans, done.succeeded, reason)


def warning(log: Rollout) -> str:
    """Describe a contact of a mapless drive with a mover: how long it was tracked, and its motion."""
    if not len(log.contacts) or not len(log.scans):
        return ""
    row, mover = int(log.contacts[0, 0]), int(log.contacts[0, 1]) - len(log.record.world.obstacles)
    if not 0 <= mover < log.movers.shape[1]:
        return ""
    scans = log.scan_rows[log.scan_rows < row]
    lost = np.flatnonzero(~np.isin(scans, tracked_rows(log)[mover]))
    words = [f"followed for {log.t[row] - log.t[scans[lost[-1]]] if len(lost) else log.t[row]:.1f} s"]
    way = np.diff(log.movers[max(0, row - round(LATELY * log.record.physics_hz)) : row + 1, mover], axis=0)
    jumped = np.hypot(*way.T) > JUMP
    headings = np.unwrap(np.arctan2(way[:, 1], way[:, 0]))
    if jumped.any():
        words.append("it had just jumped")
    elif abs(headings[-1] - headings[0]) > TURN:
        words.append(f"it had just turned by {math.degrees(abs(headings[-1] - headings[0])):.0f} degrees")
    return ", ".join(words)


def columns(results: Sequence[Result]) -> list[str]:
    """Return the columns common to all tables, see `HEADS`."""
    ends = collections.Counter(r.outcome for r in results)
    touches = [
        str(ends.pop(kind, 0)) for kind in (Outcome.COLLIDED, Outcome.HIT_WHILE_STANDING, Outcome.HIT_BY_TELEPORT)
    ]
    good = [r.duration for r in results if r.certified]
    unsure = ends.pop(Outcome.SUCCEEDED, 0) - len(good)
    named = {end.key: n for end, n in ends.items()} | ({"not certified": unsure} if unsure else {})
    others = ", ".join(f"{n} {name}" for name, n in sorted(named.items())) or "–"
    share = f"{len(good)} of {len(results)} ({100 * len(good) / max(1, len(results)):.1f} %)"
    return [share, *touches, others, f"{statistics.mean(good):.1f} s" if good else "–",
            f"{statistics.mean(r.replans for r in results):.1f}" if results else "–"]  # fmt: skip


HEADS = "certified successes | collided | hit while standing | hit by a teleport | other endings | mean time | replans"


def dynabarn(jobs: int, source: Path, most: int, only: str) -> Iterator[str]:
    """Drive DynaBARN's worlds with the jackal."""
    if not source.exists():
        missing(f"no worlds at {source}; docs/how-to/data.md says where DynaBARN's are")
    tasks = import_dynabarn(source)[: most or None]
    offsets = [START_INTERVAL * k for k in range(min(most or 10, 10))]
    cases = {
        kind: {
            f"{task.world.name}+{off:g}s": dataclasses.replace(task, world=task.world.later(off))
            for task, off in itertools.product(tasks, offsets)
            if int(task.world.name.split("-")[1]) in numbers
        }
        for kind, numbers in CLASSES.items()
    }
    yield from by_policy(cases, jobs, only, tuple(POLICIES))


def by_policy(cases: Mapping[str, Mapping[str, Task]], jobs: int, only: str, policies: Sequence[str]) -> Iterator[str]:
    """Drive tasks by class and name with the jackal, and list the failures of `LISTED` policies."""
    rows, wrong = [], []
    for policy in policies:
        if only not in policy:
            continue
        for kind, tasks in cases.items():
            calls = (
                partial(drive, name, task, **{"planner": "dstar-lite", "robot": "jackal", **POLICIES[policy]})
                for name, task in tasks.items()
            )
            got = call_all(calls, jobs)
            rows.append([policy if kind == "easy" else "", kind, *columns(got)])
            if policy in LISTED:
                wrong += [f"- {policy}: {r.name}: {r.outcome.key} ({r.reason})" for r in got if not r.certified]
    yield from table(f"the robot may | worlds | {HEADS}", rows)
    yield "\nDrives that failed with avoidance and replanning, or by lidar:\n"
    yield from wrong


def generated_task(kind: str, seed: int) -> Task:
    """Generate a world by the rules of DynaBARN: cylinders follow polynomials through random points, over and over.

    A polynomial y(x) leads through order + 1 points with different whole x; its keyframes are these points and evenly spaced
    ones, up to the edge of the box. Half of the movers run the other way, half swap x and y. Keyframes outside the box are
    omitted.
    """
    rng = np.random.default_rng([seed, *kind.encode()])
    counts, speeds, orders = RULES[kind]
    start, goal = (11.0, 0.0, math.pi), (-9.0, 0.0)
    movers: list[Mover] = []
    count = int(rng.integers(counts[0], counts[1] + 1))
    while len(movers) < count:
        order, speed = int(rng.integers(orders[0], orders[1] + 1)), rng.uniform(*speeds)
        through = np.sort(rng.choice(np.arange(-9.0, 10.0), order + 1, replace=False))
        curve = np.polynomial.Polynomial.fit(through, rng.integers(-9, 10, order + 1).astype(float), order)
        x = np.union1d(through, np.linspace(-HALF, HALF, SAMPLES))
        places = np.stack([x, curve(x)], axis=1)[np.abs(curve(x)) <= HALF]
        flipped, swapped = rng.integers(2, size=2)
        places = places[:: 1 - 2 * int(flipped), :: 1 - 2 * int(swapped)]
        if len(places) < 5 or math.dist(places[0], start[:2]) < 2.0:
            continue
        times = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T) / speed)))
        frames = tuple((float(t), float(px), float(py)) for t, (px, py) in zip(times, places, strict=True))
        movers.append(Keyframed(radius=0.5, keyframes=frames, loop="teleport"))
    world = World(f"{kind}-{seed}", (-12.0, -12.0, 12.0, 12.0), movers=tuple(movers))
    return Task(world, start, goal, goal_tolerance=1.0, time_limit=100.0)


def generated(jobs: int, source: Path, most: int, only: str) -> Iterator[str]:
    """Drive generated worlds with the jackal."""
    cases = {kind: {f"{kind}-{k}": generated_task(kind, k) for k in range(most or 10)} for kind in RULES}
    yield from by_policy(cases, jobs, only, LISTED)


def random_task(seed: int) -> tuple[Task, int]:
    """Generate a hall of 10 m with 8 columns and 1 to 10 movers up to the turtlebot's speed. Return it with their number."""
    rng = np.random.default_rng([seed, 77])
    start, goal = (1.0, 1.0, 0.785), (9.0, 9.0)
    count, fastest = int(rng.integers(1, 11)), load_robot("turtlebot").max_speed
    discs: list[Disc] = []
    while len(discs) < 8:
        x, y = rng.uniform(1.0, 9.0, 2)
        radius = rng.uniform(0.15, 0.4)
        if min(math.dist((x, y), start[:2]), math.dist((x, y), goal)) > radius + 0.8:
            discs.append(Disc(float(x), float(y), float(radius)))
    movers: list[Mover] = []
    while len(movers) < count:
        radius, speed = float(rng.uniform(0.15, 0.4)), float(rng.uniform(0.1, fastest))
        places = rng.uniform(0.5, 9.5, (int(rng.integers(2, 6)), 2))
        angle = rng.uniform(0, 2 * math.pi)
        if math.dist(places[0], start[:2]) < 2.0:
            continue
        if len(movers) % 2:
            velocity = (speed * math.cos(angle), speed * math.sin(angle))
            movers.append(
                Cruising(radius=radius, position=(float(places[0, 0]), float(places[0, 1])), velocity=velocity)
            )
        else:
            times = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T) / speed)))
            frames = tuple((float(t), float(x), float(y)) for t, (x, y) in zip(times, places, strict=True))
            movers.append(Keyframed(radius=radius, keyframes=frames, loop="pingpong"))
    world = World(f"random-{seed}", (0.0, 0.0, 10.0, 10.0), tuple(discs), movers=tuple(movers))
    return Task(world, start, goal, cell=0.25), count


def random_drive(seed: int, settings: dict[str, Any]) -> Result:
    """Drive through a random hall, and prove whether a path exists at the robot's top speed."""
    task, _ = random_task(seed)
    robot = load_robot("turtlebot")
    grid = rasterise(task.world, task.cell, robot.radius + 0.03)
    query = Query.between(grid, task)
    motions = Trajectories.of(task.world, task.start[:2], seed).motions
    proof = plan_in_time(query, motions, speed=robot.max_speed, horizon=60.0)
    result = drive(f"seed {seed}", task, "dstar-lite", "turtlebot", seed=seed, **settings)
    return result._replace(proved=proof.solved)


def random(jobs: int, source: Path, most: int, only: str) -> Iterator[str]:
    """Drive random worlds with the turtlebot."""
    seeds, rows, wrong = range(most or 500), [], []
    for policy in ("neither", "avoid and replan"):
        got = call_all((partial(random_drive, seed, POLICIES[policy]) for seed in seeds), jobs)
        proved = [r for r in got if r.proved]
        rows.append([policy, f"{len(proved)} with a proved path", *columns(proved)])
        rows.append(["", f"{len(got) - len(proved)} without", *columns([r for r in got if not r.proved])])
        wrong = [
            f"- {r.name}: {r.outcome.key} ({r.reason}){'' if r.proved else ', no path proved'}"
            for r in got
            if not r.certified
        ]
    yield from table(f"the robot may | worlds | {HEADS}", rows)
    yield "\nDrives that failed with avoidance and replanning:\n"
    yield from wrong


def hasan(jobs: int, source: Path, most: int, only: str) -> Iterator[str]:
    """Drive hasan's cases with the turtlebot."""
    names = [name for name in list_worlds() if name.startswith("hasan") and load_task(name).world.movers]
    names, rows = names[: most or None], []
    for planner in ("mmas-dstar", "dstar"):
        for name in names:
            calls = (
                partial(drive, name, load_task(name), planner, "turtlebot", seed=k) for k in range(min(most or 5, 5))
            )
            rows.append([f"`{planner}`", name, *columns(call_all(calls, jobs))])
    yield from table(f"planner | case | {HEADS}", rows)


class Way(NamedTuple):
    """What a robot did on its way.

    Attributes:
        certified: whether it succeeded certified
        end: how the drive ended
        length: driven length [m]
        duration: simulated time [s]
        replans: replans that movers triggered
        reverse: longest way backwards that was not driven forwards again [m]
        backwards: highest speed backwards [m/s]
        near: highest speed with a mover ahead within 1 m [m/s]
    """

    certified: bool
    end: str
    length: float
    duration: float
    replans: int
    reverse: float
    backwards: float
    near: float


def way_of(task: Task, robot: str, **settings: Any) -> Way:
    """Drive once and return what the robot did."""
    spec = with_lidar(robot)
    done = run(Scenario.of(task, "dstar-lite", spec, **settings))
    log = done.rollout
    if log is None:
        return Way(False, done.outcome.key, math.nan, math.nan, 0, math.nan, math.nan, math.nan)
    speeds, reverse, furthest = log.twist[:, 0], 0.0, 0.0
    for speed in speeds.tolist():
        reverse = max(0.0, reverse - speed / log.record.physics_hz)
        furthest = max(furthest, reverse)
    to = log.movers - log.pose[:, None, :2]
    gaps = np.hypot(to[..., 0], to[..., 1]) - [mover.radius for mover in task.world.movers] - spec.radius
    ahead = to[..., 0] * np.cos(log.pose[:, 2:3]) + to[..., 1] * np.sin(log.pose[:, 2:3]) > 0
    near = speeds[((gaps < 1.0) & ahead).any(axis=1)].max(initial=0.0)
    replans = sum(
        replan.trigger in (Trigger.OBSTRUCTED, Trigger.WAITED, Trigger.TRAFFIC) for replan in log.record.replans
    )
    end = done.outcome.key if done.succeeded or done.outcome is not Outcome.SUCCEEDED else "not certified"
    return Way(done.succeeded, end, polyline_length(log.pose[:, :2]), float(log.t[-1]), replans, furthest,
               max(0.0, -float(speeds.min())), float(near))  # fmt: skip


def people(jobs: int, source: Path, most: int, only: str) -> Iterator[str]:
    """Drive the worlds with people, and the same worlds without. The warehouse robot carries the jackal's lidar."""
    names = [name for name in list_worlds() if name.startswith("people-")][: most or None]
    cases = [
        (name, robot, map, noise)
        for name in names
        for robot in ("jackal", "warehouse", "turtlebot4")[: most or None]
        for map in ("given", "none")[: most or None]
        for noise in (0.0, 1.0)[: most or None]
        if only in f"{name} {robot} {map}"
    ]
    calls = []
    for name, robot, map, noise in cases:
        settings: dict[str, Any] = {"noise": noise, "time_limit": 300.0}
        if map == "none":
            settings |= {"map": map, "localisation": "matching"}
        task = load_task(name)
        alone = dataclasses.replace(task, world=dataclasses.replace(task.world, movers=()))
        calls += [partial(way_of, each, robot, **settings) for each in (task, alone)]
    got = call_all(calls, jobs)
    rows = []
    for case, among, free in zip(cases, got[::2], got[1::2], strict=True):
        name, robot, map, noise = case
        figures = [
            f"{among.length / free.length:.2f}", f"{among.duration:.1f} s", f"{free.duration:.1f} s",
            str(among.replans), f"{among.reverse:.2f} m", f"{among.backwards:.2f} m/s", f"{among.near:.2f} m/s",
        ]  # fmt: skip
        rows.append(
            [f"`{name}`", f"`{robot}`", map, f"{noise:g}", "certified" if among.certified else among.end, *figures]
        )
    yield from table(
        "world | robot | map | noise | end | length / free | time | free time | replans | reverse | backwards | near ahead",
        rows,
    )


TABLES = {"dynabarn": dynabarn, "generated": generated, "random": random, "hasan": hasan, "people": people}


def main() -> None:
    given = command_line(
        __doc__,
        tables=([], ", ".join(TABLES)),
        jobs=(2, "processes"),
        most=(0, "at most so many worlds, moments or seeds of each kind; 0: all"),
        dynabarn=(DYNABARN, "the file of DynaBARN's worlds"),
        only=("", "only the rows whose name holds this text"),
    )
    print_tables(given.tables, TABLES, given.jobs, given.dynabarn, given.most, given.only)


if __name__ == "__main__":
    main()
