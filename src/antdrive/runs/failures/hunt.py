"""Search for worlds of a few cylinders in which a configuration fails, within a budget of runs.

The next world is random or, for the guided search, the one of many random worlds whose rehearsal without physics
comes closest to a contact.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from antdrive.base import Floats
from antdrive.base.components import ComponentError
from antdrive.base.errors import FieldError
from antdrive.base.plane import arc_lengths
from antdrive.robots import PursuitState, footprint_clearance
from antdrive.robots.control.observation import REST
from antdrive.robots.noise import moved_by
from antdrive.runs.failures.failure import Attempt, Failure
from antdrive.sim.compose import route_planner
from antdrive.sim.driving.body import Body
from antdrive.sim.driving.plants import Kinematic
from antdrive.sim.driving.routes import OneRoute
from antdrive.sim.driving.senses import positioning
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.pipeline import plan
from antdrive.sim.scenario import Scenario
from antdrive.worlds import Disc, Task, World
from antdrive.worlds.passage import feasible

# The arena, in radii of the robot. Cylinders lie between start and goal, at any distance from the side walls.
LENGTH, WIDTH = 24.0, 12.0
END = 2.5  # from start and goal to the walls behind them
FREE = 5.5  # from the end walls to the centre of any cylinder
RADII = (0.3, 1.5)
CELL = 0.75
MOST = 50  # cylinders


def world_of(point: Floats, radius: float, name: str) -> Task:
    """Return a world of a few cylinders in a rectangle scaled by the robot's radius, which the robot crosses in the middle.

    Lengths are rounded to millimetres, or to 0.01 mm for small robots.

    Args:
        point: x, y and radius of each cylinder (N, 3), each from 0 to 1
        radius: of the robot, the unit of all lengths [m]
        name: of the world
    """

    def metres(value: float) -> float:
        return round(value, 3 if radius >= 0.1 else 5)

    length, width = metres(LENGTH * radius), metres(WIDTH * radius)
    low = np.array([FREE * radius, 0.0, RADII[0] * radius])
    high = np.array([(LENGTH - FREE) * radius, WIDTH * radius, RADII[1] * radius])
    discs = tuple(Disc(*map(metres, values)) for values in (low + point * (high - low)).tolist())
    middle = metres(width / 2)
    return Task(
        World(name, (0.0, 0.0, length, width), discs, "found by antdrive falsify"),
        (metres(END * radius), middle, 0.0),
        (metres(length - END * radius), middle),
        goal_tolerance=metres(0.75 * radius),
        cell=float(f"{CELL * radius:.2g}"),
    )


REHEARSED = 24  # rehearsed worlds for each run of the guided search
PATIENCE = 3.0  # a rehearsal's time limit, in multiples of the route's time at full speed, plus SETTLING
SETTLING = 5.0  # [s]
STANDING = 1e-3  # below this speed the robot stands [m/s]

#: Draws a scenario; None if the world is unusable.
Draw: TypeAlias = Callable[[], Scenario | None]


def random_world(draw: Draw) -> Scenario | None:
    """Draw the next world at random."""
    return draw()


def guided_world(draw: Draw) -> Scenario | None:
    """Draw `REHEARSED` random worlds and return the one whose rehearsed drive comes closest to a contact.

    The winner of the UAV testing competition 2025 selects tests this way, with a low-fidelity simulator before each real run
    (*Pseudo-random UAV test generation using low-fidelity path simulator*, 2025).
    """
    drawn = [scenario for scenario in (draw() for _ in range(REHEARSED)) if scenario is not None]
    return min(drawn, key=rehearsed_clearance, default=None)


#: Search methods by name.
METHODS: Mapping[str, Callable[[Draw], Scenario | None]] = MappingProxyType(
    {"guided": guided_world, "random": random_world}
)


def validate_method(name: str) -> None:
    """Raise FieldError unless a search method has this name."""
    if name not in METHODS:
        raise FieldError("method", f"unknown {name!r:.40}; choose from {', '.join(METHODS)}")


def rehearsed_clearance(s: Scenario) -> float:
    """Return the minimum clearance of a drive whose wheels execute commands exactly, without movers [m].

    The noise is that of the real run. Infinite if no path is planned; minus infinity if the planner raises an error, as
    that is a failure.
    """
    try:
        grid, answer = plan(s)
    except ComponentError:
        return -math.inf
    if not answer.solved:
        return math.inf
    known = dataclasses.replace(route_planner(s), task=s.task, smoothing=s.smoothing)
    route, path = OneRoute(known).route(grid, answer)
    period = 1 / s.control_hz
    measured = positioning("fixes", s.robot, s.noise, 1.0, period, s.task.start, s.seed)
    plant = Kinematic(s.task.start, period, s.robot)
    limit = SETTLING + PATIENCE * route.length / s.robot.max_speed
    body = Body(plant, *measured, hz=s.control_hz, limit=limit)
    command, state = REST, PursuitState()
    while body.ended is None and not (
        state.arc > path.length - path.goal_distance and abs(plant.state.speed) < STANDING
    ):
        now = body.observe()
        command, state = s.pursuit.pursue(path, moved_by(now.pose, now.pending, period), command, state)
        body.step(command)
    return float(footprint_clearance(s.driven_world, s.robot.footprint, plant.poses).min())


POINTS = 60  # of a line, equally spaced


def driven_line(rollout: Rollout) -> Floats:
    """Return the driven line up to the first contact, as `POINTS` equally spaced points (N, 2) [m]."""
    xy = rollout.pose[: rollout.first_contact + 1, :2]
    along = arc_lengths(xy)
    at = np.linspace(0.0, along[-1], POINTS)
    return np.column_stack([np.interp(at, along, xy[:, k]) for k in (0, 1)])


def line_distance(one: Floats, other: Floats) -> float:
    """Return the mean distance between points of two lines (N, 2), (M, 2) paired by dynamic time warping [m]."""
    apart = np.hypot(one[:, None, 0] - other[None, :, 0], one[:, None, 1] - other[None, :, 1])
    rows, columns = apart.shape
    cost = np.full((rows + 1, columns + 1), np.inf)
    pairs = np.zeros((rows + 1, columns + 1))
    cost[0, 0] = 0.0
    for i in range(1, rows + 1):
        for j in range(1, columns + 1):
            before = min((i - 1, j - 1), (i - 1, j), (i, j - 1), key=lambda cell: cost[cell])
            cost[i, j] = cost[before] + apart[i - 1, j - 1]
            pairs[i, j] = pairs[before] + 1
    return float(cost[-1, -1] / pairs[-1, -1])


def is_new(line: Floats, others: Sequence[Floats], least: float) -> bool:
    """Return whether a line is farther than `least` from all others."""
    return all(line_distance(line, other) > least for other in others)


TRIES = 1000  # worlds drawn for one run; those without a path are not driven


@dataclass(frozen=True, eq=False)
class Finding:
    """A world in which the configuration fails.

    Attributes:
        scenario: the configuration in that world
        failure: how it fails
        line: the driven line (N, 2) [m]; (0, 2) if nothing was driven
        number: number of the run in the search, from 1
        is_new: whether it differs from all earlier findings; see `antdrive.runs.failures.hunt.is_new`
        fingerprint: the run as one string, see `antdrive.runs.failures.failure.Attempt`
    """

    scenario: Scenario
    failure: Failure
    line: Floats
    number: int
    is_new: bool
    fingerprint: str


@dataclass(frozen=True, eq=False)
class Hunt:
    """The result of a search for failures.

    Attributes:
        findings: the failures in the order of discovery
        runs: number of runs
        driven: number of runs in which the robot drove; in the others the planner found no path or raised an error
        interrupted: whether Ctrl-C ended the search
    """

    findings: tuple[Finding, ...]
    runs: int
    driven: int = 0
    interrupted: bool = False

    @property
    def distinct(self) -> tuple[Finding, ...]:
        """The failures that differ from all earlier ones."""
        return tuple(finding for finding in self.findings if finding.is_new)

    def as_dict(self) -> dict[str, Any]:
        """Return the numbers of runs and failures as plain values."""
        counts = {"failures": len(self.findings), "distinct": len(self.distinct)}
        return {"runs": self.runs, "driven": self.driven, "interrupted": self.interrupted, **counts}


def find_failures(
    setup: Scenario,
    *,
    budget: int = 100,
    seed: int = 0,
    method: str = "guided",
    obstacles: int = 10,
    progress: Callable[[int, int], None] | None = None,
) -> Hunt:
    """Search for worlds of a few cylinders in which a configuration fails although a path exists.

    In every world tried, the exact shortest path keeps the claimed clearance: the robot's radius and the margin. A run that
    finds no path on its grid is a failure only if a path exists with one extra cell of clearance. A planner that raises an error
    has failed.

    Args:
        setup: planner, robot and settings; its world is ignored
        budget: number of runs
        seed: seed of the search; the seed of each run is its number
        method: guided or random
        obstacles: number of cylinders in each world
        progress: called after each run with the numbers of runs and of distinct failures so far

    Raises:
        FieldError: the method is unknown, or a number of cylinders or runs out of range.
    """
    validate_method(method)
    if budget < 1:
        raise FieldError("budget", f"must be at least 1, got {budget}")
    if not 1 <= obstacles <= MOST:
        raise FieldError("obstacles", f"must be from 1 to {MOST}, got {obstacles}")
    rng = np.random.default_rng([seed, obstacles])
    setup = dataclasses.replace(setup, margin_choice=None)  # suites have the margin alone
    findings: list[Finding] = []
    number = driven = 0
    try:
        for number in range(1, budget + 1):
            numbered = dataclasses.replace(setup, seed=number)
            tried = _next_world(obstacles, rng, method, numbered, f"falsify-{seed}-{number}")
            done = Attempt.of(tried)
            driven += done.rollout is not None
            failure = _failure(done)
            if failure is not None:
                findings.append(_finding(done, failure, number, findings))
            if progress is not None:
                progress(number, sum(finding.is_new for finding in findings))
    except KeyboardInterrupt:
        return Hunt(tuple(findings), number - 1, driven, interrupted=True)
    return Hunt(tuple(findings), number, driven)


def _next_world(count: int, rng: np.random.Generator, method: str, setup: Scenario, name: str) -> Scenario:
    """Return the configuration in the next world that has a path with the claimed clearance."""

    def draw() -> Scenario | None:
        task = world_of(rng.random((count, 3)), setup.robot.radius, name)
        if not feasible(task, setup.inflate):
            return None
        try:
            return dataclasses.replace(setup, task=task)
        except FieldError:  # the footprint does not fit at the start
            return None

    for _ in range(TRIES):
        scenario = METHODS[method](draw)
        if scenario is not None:
            return scenario
    raise FieldError("obstacles", f"no world of {count} cylinders with a path in {TRIES} draws; use fewer")


def _failure(done: Attempt) -> Failure | None:
    """Return how a run failed; None if it did not, or if the world leaves it no room."""
    failure = done.failure()
    if failure is None or failure.outcome != Outcome.NO_PATH.key:
        return failure
    scenario = done.scenario
    cell = scenario.cell or scenario.task.cell
    return failure if feasible(scenario.task, scenario.inflate + cell) else None


def _finding(done: Attempt, failure: Failure, number: int, known: list[Finding]) -> Finding:
    line = np.empty((0, 2)) if done.rollout is None else driven_line(done.rollout)
    alike = [finding.line for finding in known if finding.failure == failure]
    new = is_new(line, alike, done.scenario.robot.radius) if len(line) else not alike
    return Finding(done.scenario, failure, line, number, new, done.fingerprint)
