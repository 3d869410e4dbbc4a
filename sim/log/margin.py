"""Where the margin goes: what a drive used up of the room that planning kept, and how much room is enough."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from antdrive.sim.log.metrics import nearest_on_route
from antdrive.sim.log.rollout import Outcome, Rollout
from antdrive.worlds import World, point_clearance, task_from_dict
from antdrive.worlds.errors import FieldError
from antdrive.worlds.plane import wrap_angle

if TYPE_CHECKING:
    from antdrive.sim.pipeline import Run

Floats = npt.NDArray[np.float64]

#: What eats margin.
EATERS: tuple[str, ...] = (
    "rounding",  # the route itself comes closer than planned, where start and goal are no cell centres
    "cutting",  # off the route to the inside of a corner
    "tracking",  # off the route elsewhere
    "slip",  # off the route because the wheels did not do what they were told over the last quarter of a second
    "localisation",  # the robot is not where it believes to be
)
CORNER = 0.3  # a bend of the route from this angle on is a corner [rad]
NEAR_CORNER = 0.6  # and its cutting shows within this distance [m]
REACTION = 0.25  # slip that is older has been answered by the controller [s]


@dataclass(frozen=True)
class Share:
    """What one cause ate, at the place where it ate most."""

    cause: str
    metres: float  # at most [m]; 0 if it never did any harm
    t: float  # when [s]
    x: float  # where [m]
    y: float  # [m]
    at_tightest: float  # what it ate, or gave back, where the robot had least room [m]


@dataclass(frozen=True)
class Budget:
    """The margin of one drive, and who ate of it. Rooms are of the disc around the robot, which planning keeps free."""

    margin: float  # planned [m]
    left: float  # the least room that was left [m]
    t: float  # when [s]
    x: float  # where [m]
    y: float  # [m]
    shares: tuple[Share, ...]  # one a cause, in the order of EATERS; `at_tightest` adds up to margin - left

    @property
    def largest(self) -> Share:
        """The cause that ate most."""
        return max(self.shares, key=lambda share: share.metres)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {**dataclasses.asdict(self), "largest": self.largest.cause}


def budget(rollout: Rollout) -> Budget:
    """Split what a drive used of its margin by cause.

    At each row margin - room is the sum of: what the route lacks at its point nearest to where the robot believed to be; the
    room lost from there to that belief, which is cutting near corners and tracking elsewhere, but slip as far as the robot is
    closer than its last commands would have brought it; and the room lost from belief to truth. Obstacles that the planner
    was not told of are left out.
    """
    world, radius, margin = _known(rollout), _radius(rollout), float(rollout.meta["margin"])
    true = np.ascontiguousarray(rollout.pose[:, :2])
    believed = np.ascontiguousarray(rollout.estimate[:, :2]) if len(rollout.estimate) else true
    foot, cutting = np.empty_like(true), np.empty(len(true), dtype=np.bool_)
    for rows, line in rollout.legs():
        foot[rows] = nearest_on_route(believed[rows], line)
        cutting[rows] = _near_corner(foot[rows], line)

    def room(points: Floats) -> Floats:
        return point_clearance(world, points) - radius

    left, by_belief, on_route = room(true), room(believed), room(foot)
    off = on_route - by_belief
    slip = np.clip(room(_commanded(rollout)) - left, 0.0, np.maximum(off, 0.0))
    eaten = {
        "rounding": margin - on_route,
        "cutting": np.where(cutting, off - slip, 0.0),
        "tracking": np.where(cutting, 0.0, off - slip),
        "slip": slip,
        "localisation": by_belief - left,
    }
    tightest = int(left.argmin())
    shares = []
    for cause in EATERS:
        # Only where the robot has less room than planned has anything been eaten of it.
        harm = np.where(left < margin, np.minimum(eaten[cause], margin - left), 0.0)
        at = int(harm.argmax())
        x, y = true[at].tolist()
        most = max(0.0, float(harm[at]))
        shares.append(Share(cause, most, float(rollout.t[at]), x, y, float(eaten[cause][tightest])))
    x, y = true[tightest].tolist()
    return Budget(margin, float(left[tightest]), float(rollout.t[tightest]), x, y, tuple(shares))


@dataclass(frozen=True)
class Trial:
    """All drives with one margin, up to the first that failed."""

    margin: float  # [m]
    drives: int
    impassable: int  # worlds that this margin closes: nothing is learnt from them
    failed: int | None  # the seed of the drive that did not succeed, certified, with the reserve left
    left: float  # the least room of all [m]

    @property
    def safe(self) -> bool:
        """Whether there were drives and all went well."""
        return self.failed is None and self.drives > 0


def find_margin(
    drive: Callable[[float, int], Run],
    seeds: Sequence[int],
    *,
    reserve: float = 0.005,
    most: float = 0.2,
    resolution: float = 0.005,
) -> Iterator[Trial]:
    """Look for the smallest margin [m] with which every seed's drive ends well, with `reserve` of room left, by bisection.

    `drive(margin, seed)` runs one. Trials come as they are made; the smallest margin of those that are safe is the answer.

    Raises:
        ValueError: a setting outside its range.
    """
    if not 0 < resolution < most:
        raise FieldError("resolution", f"must be greater than 0 and less than {most:g}, got {resolution:g}")
    hardest_first = list(seeds)

    def tried(margin: float) -> Trial:
        left, drives, impassable = math.inf, 0, 0
        for seed in hardest_first:
            run = drive(margin, seed)
            if run.outcome is Outcome.NO_PATH:
                impassable += 1
                continue
            drives += 1
            if run.rollout is not None:
                left = min(left, budget(run.rollout).left)
            if not run.succeeded or left < reserve:
                hardest_first.remove(seed)
                hardest_first.insert(0, seed)
                return Trial(margin, drives, impassable, seed, left)
        return Trial(margin, drives, impassable, None, left)

    low, high = (
        0,
        math.ceil(most / resolution),
    )  # the answer, in steps, is at least low; high is safe or closes everything
    trial = tried(high * resolution)
    yield trial
    if trial.failed is not None:
        return
    while low < high:
        middle = (low + high) // 2
        trial = tried(middle * resolution)
        yield trial
        if trial.failed is None:
            high = middle
        else:
            low = middle + 1


def _known(rollout: Rollout) -> World:
    task = task_from_dict(dict(rollout.meta["task"]))
    unseen = set(rollout.meta.get("unseen", ()))
    kept = tuple(disc for i, disc in enumerate(task.world.obstacles) if i not in unseen)
    return dataclasses.replace(task.world, obstacles=kept)


def _radius(rollout: Rollout) -> float:
    foot = rollout.meta["robot"]["footprint"]
    return math.hypot(foot["half_length"], foot["half_width"]) + float(foot["rounding"])


def _commanded(rollout: Rollout) -> Floats:
    """Where each row's robot would be, (T, 2), had it done as commanded over the last `REACTION` seconds."""
    dt = 1.0 / float(rollout.meta["physics_hz"])
    back = min(round(REACTION / dt), len(rollout.t) - 1)
    turned = np.concatenate(([0.0], np.cumsum(rollout.command[1:, 1] * dt)))
    begin = np.maximum(np.arange(len(rollout.t)) - back, 0)
    xy = rollout.pose[begin, :2].copy()
    for step in range(1, back + 1):
        row = begin + step
        live = row <= np.arange(len(row))
        row = np.minimum(row, len(row) - 1)
        yaw = rollout.pose[begin, 2] + (turned[row] + turned[row - 1]) / 2 - turned[begin]
        way = np.where(live, rollout.command[row, 0] * dt, 0.0)
        xy[:, 0] += way * np.cos(yaw)
        xy[:, 1] += way * np.sin(yaw)
    return xy


def _near_corner(points: Floats, route: Floats) -> npt.NDArray[np.bool_]:
    steps = np.diff(route, axis=0)
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    turn = np.abs(wrap_angle(np.diff(heading)))
    near = np.zeros(len(points), dtype=np.bool_)
    for corner in route[1:-1][turn >= CORNER]:
        near |= np.hypot(*(points - corner).T) <= NEAR_CORNER
    return near
