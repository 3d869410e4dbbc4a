"""Passes that simplify a failing scenario. Each proposes candidates, the simplest first."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from antdrive.base import Bounds, Floats
from antdrive.base.errors import FieldError
from antdrive.base.plane import arc_lengths
from antdrive.runs.failures.candidates import CandidateRunner
from antdrive.runs.failures.ddmin import one_minimal
from antdrive.sim.idle_settings import idle_settings
from antdrive.sim.log.metrics import nearest_on_route, nearest_segments
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.scenario import Scenario
from antdrive.worlds import Disc, Mover

Item = TypeVar("Item")

NOISES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)  # fractions of the scenario's noise
SEEDS = 10  # the simplest seeds are below this
BEFORE = (1.0, 2.0, 4.0, 8.0, 16.0)  # time from a nearer start to the failure [s]
BEYOND = (0.5, 1.0, 2.0, 4.0, 8.0)  # distance along the route from the failure to a nearer goal [m]
INWARDS = (1.0, 0.75, 0.5, 0.25)  # fractions of the possible inward shift of a wall
FEW, MANY = 2, 8  # with at most MANY obstacles, try each single one and each pair
DIGITS = (0, 1, 2, 3)  # decimal places; radii and angles keep at least one


def nearest(scenario: Scenario, runner: CandidateRunner) -> Scenario:
    """Keep the 1, 2, 4, ... obstacles nearest to the drive, as many as needed."""
    discs, order = scenario.task.world.obstacles, _by_distance(scenario, runner)
    counts = itertools.takewhile(lambda count: count < len(discs), (2**k for k in itertools.count()))
    fewer = (with_obstacles(scenario, _at(discs, order[:count])) for count in counts)
    return runner.first(_with_seeds(fewer)) or scenario


def obstacles(scenario: Scenario, runner: CandidateRunner) -> Scenario:
    """Keep the obstacles that the failure needs."""
    discs, order = scenario.task.world.obstacles, _by_distance(scenario, runner)
    scenario = _needed(scenario, order, lambda s, kept: with_obstacles(s, _at(discs, kept)), runner)
    discs = scenario.task.world.obstacles
    if not FEW < len(discs) <= MANY:
        return scenario
    fewer = (some for count in range(1, FEW + 1) for some in itertools.combinations(discs, count))
    return runner.first(with_obstacles(scenario, some) for some in fewer) or scenario


def movers(scenario: Scenario, runner: CandidateRunner) -> Scenario:
    """Keep the movers that the failure needs."""
    return _needed(scenario, scenario.task.world.movers, with_movers, runner)


def unseen(scenario: Scenario, runner: CandidateRunner) -> Scenario:
    """Keep the unseen obstacles that the failure needs."""
    return _needed(scenario, scenario.unseen, with_unseen, runner)


def start(scenario: Scenario, runner: CandidateRunner) -> Scenario:
    """Move the start along the drive, towards the failure."""
    return runner.first(_with_seeds(_nearer_starts(scenario, runner.rollout(scenario)))) or scenario


def goal(scenario: Scenario, runner: CandidateRunner) -> Scenario:
    """Move the goal along the route, towards the failure."""
    return runner.first(_nearer_goals(scenario, runner.rollout(scenario))) or scenario


def bounds(scenario: Scenario, runner: CandidateRunner) -> Scenario:
    """Move walls inwards by whole cells, so that the grid stays in place.

    Cylinders that a moved wall would cut or leave outside are removed.
    """
    for side in range(4):
        scenario = runner.first(_walled(scenario, side, b) for b in _tighter(scenario, side)) or scenario
    return scenario


def noise(scenario: Scenario, runner: CandidateRunner) -> Scenario:
    """Use the least noise: none, or a tenth to nine tenths of the scenario's."""
    levels = [float(f"{scenario.noise * share:.2g}") for share in NOISES]
    return runner.first(_varied(scenario, noise=level) for level in levels if level < scenario.noise) or scenario


def seed(scenario: Scenario, runner: CandidateRunner) -> Scenario:
    """Use the simplest seed."""
    most = SEEDS if _is_random(scenario) else 1
    return runner.first(_varied(scenario, seed=n) for n in range(min(most, scenario.seed))) or scenario


def time_limit(scenario: Scenario, runner: CandidateRunner) -> Scenario:
    """Drop the scenario's own time limit."""
    free = _varied(scenario, time_limit=None, task={"time_limit": None})
    return scenario if free == scenario else runner.first([free]) or scenario


def digits(scenario: Scenario, runner: CandidateRunner) -> Scenario:
    """Round positions and radii to fewer digits: all at once, then one by one."""
    for count in DIGITS:
        whole = _all_rounded(scenario, count)
        if whole == scenario or runner.first([whole]) is not None:
            return whole or scenario
    for rounded in _roundings(scenario):
        for count in DIGITS:
            candidate = rounded(scenario, count)
            if candidate == scenario:
                break
            if runner.first([candidate]) is not None:
                scenario = candidate or scenario
                break
    return scenario


#: The passes in their order. Nearer starts and goals come first, as they shorten every later run.
PASSES: tuple[tuple[str, Callable[[Scenario, CandidateRunner], Scenario]], ...] = (
    ("start", start),
    ("goal", goal),
    ("obstacles", nearest),
    ("start", start),
    ("goal", goal),
    ("obstacles", obstacles),
    ("movers", movers),
    ("unseen", unseen),
    ("bounds", bounds),
    ("noise", noise),
    ("seed", seed),
    ("time limit", time_limit),
    ("digits", digits),
)


def with_obstacles(scenario: Scenario, discs: Sequence[Disc]) -> Scenario | None:
    """Return the scenario with other obstacles; None if it is invalid."""
    return _varied(scenario, world={"obstacles": tuple(discs)})


def with_movers(scenario: Scenario, kept: Sequence[Mover]) -> Scenario | None:
    """Return the scenario with other movers; None if it is invalid."""
    return _varied(scenario, world={"movers": tuple(kept)})


def with_unseen(scenario: Scenario, discs: Sequence[Disc], **world: Any) -> Scenario | None:
    """Return the scenario with other unseen obstacles and changed fields of its world; None if it is invalid."""
    return _varied(scenario, unseen=tuple(discs), world=world)


def _needed(
    scenario: Scenario,
    items: Sequence[Item],
    make: Callable[[Scenario, Sequence[Item]], Scenario | None],
    runner: CandidateRunner,
) -> Scenario:
    """Return the scenario with the items that the failure needs, by delta debugging."""

    def first(lists: Iterable[Sequence[Item]]) -> Sequence[Item] | None:
        tried: list[tuple[Scenario | None, Sequence[Item]]] = []

        def candidates() -> Iterator[Scenario | None]:
            for some in lists:
                tried.append((make(scenario, some), some))
                yield tried[-1][0]

        match = runner.first(candidates())
        return None if match is None else next(some for candidate, some in tried if candidate is match)

    kept = one_minimal(items, first)
    return scenario if len(kept) == len(items) else make(scenario, kept) or scenario


def _is_random(scenario: Scenario) -> bool:
    """Return whether a run depends on its seed."""
    return "seed" not in idle_settings(scenario, {"seed"})


def _with_seeds(candidates: Iterable[Scenario | None]) -> Iterator[Scenario | None]:
    """Yield each candidate with its own seed and, if the run is random, with the simplest seeds.

    Any change redraws the random numbers, so a random failure vanishes; another seed may bring it back.
    """
    for candidate in candidates:
        yield candidate
        if candidate is not None and _is_random(candidate):
            yield from (_varied(candidate, seed=n) for n in range(SEEDS) if n != candidate.seed)


def _at(discs: Sequence[Disc], indices: Iterable[int]) -> list[Disc]:
    """Return the obstacles at some indices, in the order of the world."""
    return [discs[i] for i in sorted(indices)]


def _by_distance(scenario: Scenario, runner: CandidateRunner) -> list[int]:
    """Return the indices of the obstacles, sorted by distance to the drive and the rest of its route."""
    discs, rollout = scenario.task.world.obstacles, runner.rollout(scenario)
    if rollout is None or not discs:
        return list(range(len(discs)))
    line = np.vstack([rollout.pose[::12, :2], _rest_of_route(rollout, len(rollout.t) - 1)])
    xy = np.array([(disc.x, disc.y) for disc in discs])
    away = np.hypot(*(nearest_on_route(xy, line) - xy).T) - [disc.radius for disc in discs]
    return [int(i) for i in np.argsort(away, kind="stable")]


def _rest_of_route(rollout: Rollout, row: int) -> Floats:
    """Return the rest of the last route (N, 2) [m] from the point nearest to the robot at a row."""
    _, route = rollout.legs()[-1]
    feet, segment = nearest_segments(rollout.pose[row : row + 1, :2], route)
    return np.vstack([feet, route[segment[0] + 1 :]])


def _failing_row(rollout: Rollout) -> int:
    """Return the row of the first contact, else of the minimum clearance, else the last."""
    if len(rollout.contacts):
        return rollout.first_contact
    return int(rollout.clearance.argmin()) if rollout.outcome.key == "succeeded" else len(rollout.t) - 1


def _nearer_starts(scenario: Scenario, rollout: Rollout | None) -> Iterator[Scenario | None]:
    """Yield the scenario started from poses of its drive before the failure, the latest first."""
    if rollout is None:
        return
    for before in BEFORE:
        row = _failing_row(rollout) - round(before * rollout.record.physics_hz)
        if row > 0:
            x, y, yaw = rollout.pose[row].tolist()
            yield _varied(scenario, task={"start": (round(x, 2), round(y, 2), round(yaw, 2))})


def _nearer_goals(scenario: Scenario, rollout: Rollout | None) -> Iterator[Scenario | None]:
    """Yield the scenario with goals on its route beyond the failure, the nearest first."""
    if rollout is None:
        return
    rest = _rest_of_route(rollout, _failing_row(rollout))
    along = arc_lengths(rest)
    for distance in BEYOND:
        if distance < along[-1] - 0.1:
            x, y = (round(float(np.interp(distance, along, rest[:, k])), 2) for k in (0, 1))
            yield _varied(scenario, task={"goal": (x, y)})


def _tighter(scenario: Scenario, side: int) -> Iterator[Bounds]:
    """Yield bounds with one wall moved inwards by whole cells, the tightest first."""
    task, now = scenario.task, scenario.task.world.bounds
    cell = scenario.cell or task.cell
    axis, low = side % 2, side < 2
    ends = (task.start[axis], task.goal[axis])
    inner = min(ends) - scenario.inflate if low else max(ends) + scenario.inflate
    most = (inner - now[side] if low else now[side] - inner) / cell + 1e-9
    for count in sorted({math.floor(most * share) for share in INWARDS} - {0}, reverse=True):
        if count > 0:
            limits = list(now)
            limits[side] = round(now[side] + (count if low else -count) * cell, 9)
            yield limits[0], limits[1], limits[2], limits[3]


def _walled(scenario: Scenario, side: int, bounds: Bounds) -> Scenario | None:
    """Return the scenario with one wall moved, without the cylinders that it would newly cut or leave outside."""
    axis, low, before = side % 2, side < 2, scenario.task.world.bounds[side]

    def stands(disc: Disc) -> bool:
        """Return whether a cylinder stays whole, or the old wall cut it already."""
        centre = (disc.x, disc.y)[axis]
        from_old, from_new = ((centre - wall) * (1 if low else -1) for wall in (before, bounds[side]))
        return from_new >= (disc.radius if from_old >= disc.radius else -disc.radius)

    obstacles = tuple(disc for disc in scenario.task.world.obstacles if stands(disc))
    hidden = tuple(disc for disc in scenario.unseen if stands(disc))
    return with_unseen(scenario, hidden, bounds=bounds, obstacles=obstacles)


def _all_rounded(scenario: Scenario, count: int) -> Scenario | None:
    result: Scenario | None = scenario
    for rounded in _roundings(scenario):
        result = None if result is None else rounded(result, count)
    return result


def _ends_rounded(scenario: Scenario, count: int) -> Scenario | None:
    (x, y, yaw), (gx, gy) = scenario.task.start, scenario.task.goal
    start_pose = (round(x, count), round(y, count), round(yaw, max(count, 1)))
    return _varied(scenario, task={"start": start_pose, "goal": (round(gx, count), round(gy, count))})


def _disc_rounded(index: int) -> Callable[[Scenario, int], Scenario | None]:
    def rounded(scenario: Scenario, count: int) -> Scenario | None:
        discs = list(scenario.task.world.obstacles)
        disc = discs[index]
        radius = round(disc.radius, max(count, 1))
        if not radius > 0:
            return None
        discs[index] = Disc(round(disc.x, count), round(disc.y, count), radius, round(disc.height, 1) or disc.height)
        return with_obstacles(scenario, discs)

    return rounded


def _roundings(scenario: Scenario) -> list[Callable[[Scenario, int], Scenario | None]]:
    """Return the separate roundings: start and goal, and each obstacle."""
    return [_ends_rounded, *map(_disc_rounded, range(len(scenario.task.world.obstacles)))]


def _varied(
    scenario: Scenario, *, task: Mapping[str, Any] | None = None, world: Mapping[str, Any] | None = None, **changes: Any
) -> Scenario | None:
    """Return the scenario with changed fields of its own, of its task and of its world; None if it is invalid."""
    try:
        if world:
            task = {**(task or {}), "world": dataclasses.replace(scenario.task.world, **world)}
        if task:
            changes["task"] = dataclasses.replace(scenario.task, **task)
        return dataclasses.replace(scenario, **changes)
    except FieldError:
        return None
