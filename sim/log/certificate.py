"""Whether a logged drive touched anything: three readings that must agree. Needs numpy alone.

1. PyBullet's contacts of the chassis, at every physics step.
2. The closed-form distance between footprint and obstacles at every logged pose, computed here once more.
3. A bound on what can happen between two logged poses: no point of the footprint moves farther than the axle's centre
   travels plus the footprint's radius times the turn, so the clearance in between is at least
   (c_i + c_{i+1} - travel) / 2. To a mover it is at least that with the mover's own travel added; while the mover
   jumps, min(c_i, c_{i+1}) - travel.

Movers are where the task's own definition and the run's seed put them, or the log is not certified.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.sim.log.contacts import STANDING, TOUCHED, touches_of
from antdrive.sim.log.rollout import Outcome, Rollout
from antdrive.worlds.plane import segment_lengths, wrap_angle
from antdrive.worlds.trajectories import Trajectories

Floats = npt.NDArray[np.float64]

SAME = 1e-9  # closed-form clearances repeat to this [m]
AGREE = 0.012  # contact points describe the pose before a step, and a robot pushes some mm into what it hits [m]
# How far a pose may differ from where the measured speed leads: in one step, and over a quarter of a second, where errors
# would add up but rounding does not. Genuine runs stay below 0.1 mm and 1.2 mm, on a slippery floor below 0.6 mm and 31 mm.
SLIP, SLIP_TURN = 0.001, 0.002  # [m], [rad]
DRIFT, DRIFT_SHARE, DRIFT_TURN = 0.01, 0.06, 0.05  # [m], of the distance covered, [rad]
WINDOW = 0.25  # [s]


@dataclass(frozen=True)
class Certificate:
    """What the log proves."""

    certified: bool  # robot and obstacles, moving or not, never touched, and every reading agrees
    contacts: int  # PyBullet's contact points with obstacles, movers and walls
    min_clearance: float  # closed form, over all logged poses [m]
    bound: float  # the clearance that is certain also between the logged poses [m]
    problems: tuple[str, ...]  # a sentence each: why it is not certified

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "certified": self.certified,
            "contacts": self.contacts,
            "min_clearance_m": self.min_clearance,
            "bound_m": self.bound,
            "problems": list(self.problems),
        }


def in_metres(value: float) -> str:
    """A distance to a tenth of a millimetre, finer where that would read as nothing."""
    return f"{value:.4f} m" if abs(value) >= 5e-5 or value == 0 else f"{value:.1e} m"


def certify(rollout: Rollout) -> Certificate:
    """Check a drive from its log alone."""
    problems = rollout.problems()
    if problems:
        return Certificate(False, len(rollout.contacts), math.nan, math.nan, tuple(problems))
    try:
        traffic = rollout.traffic()
    except ValueError as error:
        return Certificate(False, len(rollout.contacts), math.nan, math.nan, (f"meta.task.{error}",))
    still, moving = _clearances(rollout)
    clearance = np.minimum(still, moving.min(axis=1, initial=math.inf))
    bound = float(_between_steps(rollout, traffic, still, moving).min())
    least = float(clearance.min())
    touched = len(rollout.contacts)
    if touched:
        step = int(rollout.contacts[0, 0])
        problems.append(f"physics reports {touched} contact points, the first at t = {rollout.t[step]:.3f} s")
        if float(clearance[max(0, step - 1) : step + 2].min()) > AGREE:
            problems.append(
                f"readings disagree: physics touches at step {step}, closed form says {clearance[step]:.4f} m apart"
            )
    if not least > 0:
        at = int(clearance.argmin())
        problems.append(
            f"closed form: the robot overlaps an obstacle by {in_metres(-least)} at t = {rollout.t[at]:.3f} s"
        )
        if not touched:
            problems.append("readings disagree: closed form overlaps, physics reports no contact")
    elif not bound > 0:
        problems.append(f"between two logged poses a contact cannot be ruled out (bound {bound:.4f} m)")
    problems += _tampering(rollout, traffic, clearance)
    return Certificate(not problems, touched, least, bound, tuple(problems))


def closed_form_clearance(rollout: Rollout) -> Floats:
    """Distance from footprint to the nearest surface of disc, mover or wall at each logged pose, shape (T,) [m].

    Written independently of the compiled geometry that the drive uses, so that one checks the other.
    """
    still, moving = _clearances(rollout)
    return np.asarray(np.minimum(still, moving.min(axis=1, initial=math.inf)))


def _clearances(rollout: Rollout) -> tuple[Floats, Floats]:
    """Distances from the footprint to what stands still (T,) and to each mover (T, M) [m]."""
    foot = rollout.meta["robot"]["footprint"]
    half = np.array([foot["half_length"], foot["half_width"]])
    rounding = foot["rounding"]
    task = rollout.meta["task"]
    xmin, ymin, xmax, ymax = task["bounds"]
    discs = np.array([(d["x"], d["y"], d["radius"]) for d in task["obstacles"]]).reshape(-1, 3)
    x, y, yaw = rollout.pose.T
    rotation = np.abs(np.stack([np.cos(yaw), np.sin(yaw)]))
    reach_x = half @ rotation + rounding
    reach_y = half[::-1] @ rotation + rounding
    best = np.minimum.reduce([x - reach_x - xmin, xmax - x - reach_x, y - reach_y - ymin, ymax - y - reach_y])

    def distance(rows: npt.NDArray[np.int64], centres: npt.NDArray[np.complex128], radii: Floats) -> Floats:
        body = (centres - (x + 1j * y)[rows, None]) * np.exp(-1j * yaw[rows, None])  # in the robot's frame
        over = np.stack([np.abs(body.real) - half[0], np.abs(body.imag) - half[1]])
        outside = np.linalg.norm(np.maximum(over, 0.0), axis=0)
        return np.asarray(outside + np.minimum(over.max(axis=0), 0.0) - rounding - radii)

    for rows in np.array_split(np.arange(len(x)), 1 + len(x) * len(discs) // 1_000_000):
        if not len(discs):
            break
        nearest = distance(rows, (discs[:, 0] + 1j * discs[:, 1])[None], discs[:, 2]).min(axis=1)
        best[rows] = np.minimum(best[rows], nearest)
    radii = np.array([mover["radius"] for mover in task.get("movers") or []])
    moving = np.empty((len(x), len(radii)))
    for rows in np.array_split(np.arange(len(x)), 1 + moving.size // 1_000_000):
        if not len(radii):
            break
        places = rollout.movers[rows]
        moving[rows] = distance(rows, places[..., 0] + 1j * places[..., 1], radii)
    return np.asarray(best), moving


def _between_steps(rollout: Rollout, traffic: Trajectories, still: Floats, moving: Floats) -> Floats:
    """A lower bound of the clearance in each interval between two rows (one interval of no length for one row)."""
    if len(still) < 2:
        return np.asarray(np.minimum(still, moving.min(axis=1, initial=math.inf)))
    foot = rollout.meta["robot"]["footprint"]
    radius = math.hypot(foot["half_length"], foot["half_width"]) + foot["rounding"]
    dt = np.diff(rollout.t)
    moved = segment_lengths(rollout.pose[:, :2])
    turned = np.abs(_wrapped(np.diff(rollout.pose[:, 2])))
    speed = np.maximum(*np.abs([rollout.twist[:-1], rollout.twist[1:]]))
    travel = np.maximum(moved, speed[:, 0] * dt) + radius * np.maximum(turned, speed[:, 1] * dt)
    bound = (still[:-1] + still[1:] - travel) / 2
    if traffic:
        t = _clock(rollout)
        both = travel[:, None] + traffic.travel(t)
        steady = (moving[:-1] + moving[1:] - both) / 2
        jumping = np.minimum(moving[:-1], moving[1:]) - both
        bound = np.minimum(bound, np.where(traffic.jumps(t), jumping, steady).min(axis=1))
    return np.asarray(bound)


def _clock(rollout: Rollout) -> Floats:
    """What the times of the rows must be, shape (T,) [s]."""
    return np.asarray(np.arange(len(rollout.t)) / rollout.meta["physics_hz"])


def _wrapped(angle: Floats) -> Floats:
    return np.asarray(wrap_angle(angle))


def _tampering(rollout: Rollout, traffic: Trajectories, clearance: Floats) -> list[str]:
    """Signs that a log does not tell of one drive: rows that do not follow from each other or from the task."""
    meta, pose, problems = rollout.meta, rollout.pose, []
    if meta.get("digest") not in (None, rollout.digest):
        problems.append("digest: the log was changed after it was written")
    if not np.allclose(rollout.t, _clock(rollout), rtol=0, atol=1e-9):
        problems.append(f"t: rows are not {meta['physics_hz']} a second")
    if not np.abs(rollout.clearance - clearance).max() <= SAME:
        at = int(np.abs(rollout.clearance - clearance).argmax())
        problems.append(
            f"clearance: logged {rollout.clearance[at]:.4f} m at t = {rollout.t[at]:.3f} s, "
            f"closed form says {clearance[at]:.4f} m"
        )
    if traffic:
        astray = np.abs(rollout.movers - traffic.positions(_clock(rollout))).max(axis=2)
        if not astray.max() <= SAME:
            row, m = np.unravel_index(int(astray.argmax()), astray.shape)
            problems.append(
                f"movers: movers[{m}] is logged {astray[row, m]:.4f} m off its course at t = {rollout.t[row]:.3f} s"
            )
    start = meta["task"]["start"]
    if np.hypot(*(pose[0, :2] - start[:2])) > 0.005 or abs(_wrapped(pose[0, 2] - start[2])) > 0.01:
        problems.append(f"pose: the first row is not the task's start {start}")
    broken = _broken_step(rollout)
    if broken is not None:
        problems.append(f"pose: the steps at t = {rollout.t[broken]:.3f} s do not follow from the measured speed")
    outcome = rollout.outcome
    if (outcome in TOUCHED) != bool(len(rollout.contacts)):
        problems.append(f"outcome: {outcome.name.lower()}, with {len(rollout.contacts)} contacts")
    elif outcome in TOUCHED:
        first = touches_of(rollout)[0].outcome
        if outcome is not first:
            problems.append(f"outcome: {outcome.name.lower()}, but the first contact tells of {first.name.lower()}")
    if outcome is Outcome.SUCCEEDED:
        goal, tolerance = meta["task"]["goal"], meta["task"]["goal_tolerance"]
        left = float(np.hypot(*(pose[-1, :2] - goal)))
        if not left <= tolerance:
            problems.append(f"outcome: succeeded, but it ends {left:.3f} m from the goal (tolerance {tolerance:g} m)")
        if not abs(rollout.twist[-1, 0]) <= STANDING:
            problems.append(f"outcome: succeeded, but it still moves at {rollout.twist[-1, 0]:.3f} m/s at the end")
    return problems


def _broken_step(rollout: Rollout) -> int | None:
    """The row from which poses do not follow from measured speeds, if there is one."""
    end = len(rollout.t)
    if len(rollout.contacts):
        end = max(1, int(rollout.contacts[0, 0]))  # a collision may throw the robot
    if end < 3:
        return None
    pose, twist, dt = rollout.pose[:end], rollout.twist[:end], np.diff(rollout.t[:end])
    heading = np.exp(1j * (pose[:-1, 2] + _wrapped(np.diff(pose[:, 2])) / 2))
    covered = (twist[:-1, 0] + twist[1:, 0]) / 2 * dt
    slip = np.diff(pose[:, 0] + 1j * pose[:, 1]) - heading * covered
    slip_turn = _wrapped(np.diff(pose[:, 2])) - (twist[:-1, 1] + twist[1:, 1]) / 2 * dt
    broken = (np.abs(slip) > SLIP) | (np.abs(slip_turn) > SLIP_TURN)
    rows = max(1, round(WINDOW * rollout.meta["physics_hz"]))
    if len(slip) >= rows:
        drift, turn, distance = (_summed(values, rows) for values in (slip, slip_turn, np.abs(covered)))
        broken[: len(drift)] |= (np.abs(drift) > DRIFT + DRIFT_SHARE * distance.real) | (np.abs(turn) > DRIFT_TURN)
    return int(broken.argmax()) if broken.any() else None


def _summed(values: npt.NDArray[Any], rows: int) -> npt.NDArray[Any]:
    """The sum over each window of `rows` values."""
    total = np.concatenate(([0], np.cumsum(values)))
    return np.asarray(total[rows:] - total[:-rows])
