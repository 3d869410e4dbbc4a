"""Whether a logged drive touched anything: three readings that must agree. Needs numpy alone.

1. PyBullet's contacts of the chassis, at every physics step.
2. The closed-form distance between footprint and obstacles at every logged pose, computed here once more.
3. A bound on what can happen between two logged poses: no point of the footprint moves farther than the axle's centre
   travels plus the footprint's radius times the turn, so the clearance in between is at least
   (c_i + c_{i+1} - travel) / 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from sim.rollout import Outcome, Rollout

Floats = npt.NDArray[np.float64]

SAME = 1e-9  # closed-form clearances repeat to this [m]
AGREE = 0.012  # contact points describe the pose before a step, and a robot pushes some mm into what it hits [m]
SLIP = 0.003  # the most a pose may differ from where its measured speed leads in one step [m]
STANDING = 0.02  # [m/s]


@dataclass(frozen=True)
class Certificate:
    """What the log proves."""

    certified: bool  # nothing was touched, and every reading agrees
    contacts: int  # PyBullet's contact points with obstacles and walls
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


def certify(rollout: Rollout) -> Certificate:
    """Check a drive from its log alone."""
    problems = _shape_problems(rollout)
    if problems:
        return Certificate(False, len(rollout.contacts), math.nan, math.nan, tuple(problems))
    clearance = closed_form_clearance(rollout)
    bound = float(_between_steps(rollout, clearance).min())
    least = float(clearance.min())
    touched = len(rollout.contacts)
    if touched:
        step = int(rollout.contacts[0, 0])
        problems.append(f"physics reports {touched} contact points, the first at t = {rollout.t[step]:.3f} s")
        if float(clearance[max(0, step - 1) : step + 2].min()) > AGREE:
            problems.append(
                f"readings disagree: physics touches at step {step}, closed form says {clearance[step]:.4f} m apart"
            )
    if least <= 0:
        at = int(clearance.argmin())
        problems.append(f"closed form: the robot overlaps an obstacle by {-least:.4f} m at t = {rollout.t[at]:.3f} s")
        if not touched:
            problems.append("readings disagree: closed form overlaps, physics reports no contact")
    elif bound <= 0:
        problems.append(f"between two logged poses a contact cannot be ruled out (bound {bound:.4f} m)")
    problems += _tampering(rollout, clearance)
    return Certificate(not problems, touched, least, bound, tuple(problems))


def closed_form_clearance(rollout: Rollout) -> Floats:
    """Distance from footprint to the nearest disc surface or wall at each logged pose, shape (T,) [m].

    Written independently of the compiled geometry that the drive uses, so that one checks the other.
    """
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
    for rows in np.array_split(np.arange(len(x)), 1 + len(x) * len(discs) // 1_000_000):
        if not len(discs):
            break
        offset = (discs[None, :, 0] - x[rows, None]) + 1j * (discs[None, :, 1] - y[rows, None])
        body = offset * np.exp(-1j * yaw[rows, None])  # the discs' centres in the robot's frame
        over = np.stack([np.abs(body.real) - half[0], np.abs(body.imag) - half[1]])
        outside = np.linalg.norm(np.maximum(over, 0.0), axis=0)
        distance = outside + np.minimum(over.max(axis=0), 0.0) - rounding - discs[:, 2]
        best[rows] = np.minimum(best[rows], distance.min(axis=1))
    return np.asarray(best)


def _between_steps(rollout: Rollout, clearance: Floats) -> Floats:
    """A lower bound of the clearance in each interval between two rows (one interval of no length for one row)."""
    if len(clearance) < 2:
        return clearance
    foot = rollout.meta["robot"]["footprint"]
    radius = math.hypot(foot["half_length"], foot["half_width"]) + foot["rounding"]
    dt = np.diff(rollout.t)
    moved = np.hypot(*np.diff(rollout.pose[:, :2], axis=0).T)
    turned = np.abs(_wrapped(np.diff(rollout.pose[:, 2])))
    speed = np.maximum(*np.abs([rollout.twist[:-1], rollout.twist[1:]]))
    travel = np.maximum(moved, speed[:, 0] * dt) + radius * np.maximum(turned, speed[:, 1] * dt)
    return np.asarray((clearance[:-1] + clearance[1:] - travel) / 2)


def _wrapped(angle: Floats) -> Floats:
    return np.asarray((angle + math.pi) % (2 * math.pi) - math.pi)


def _shape_problems(rollout: Rollout) -> list[str]:
    rows = len(rollout.t)
    shapes = {
        "pose": (rows, 3),
        "twist": (rows, 2),
        "command": (rows, 2),
        "clearance": (rows,),
        "limiter": (rows,),
    }
    problems = [
        f"{name}: shape {getattr(rollout, name).shape} where {shape} is due"
        for name, shape in shapes.items()
        if getattr(rollout, name).shape != shape
    ]
    if rows == 0:
        problems.append("t: the log is empty")
    if rollout.contacts.ndim != 2 or rollout.contacts.shape[1] != 4:
        problems.append(f"contacts: shape {rollout.contacts.shape} where (K, 4) is due")
    elif len(rollout.contacts) and not (0 <= rollout.contacts[:, 0].min() <= rollout.contacts[:, 0].max() < rows):
        problems.append("contacts: a step outside the log")
    problems += [
        f"{name}: holds numbers that are not finite"
        for name in ("t", *shapes)
        if not np.isfinite(getattr(rollout, name)).all()
    ]
    problems += [
        f"meta.{key}: missing" for key in ("task", "robot", "outcome", "physics_hz") if key not in rollout.meta
    ]
    return problems


def _tampering(rollout: Rollout, clearance: Floats) -> list[str]:
    """Signs that a log does not tell of one drive: rows that do not follow from each other or from the task."""
    meta, pose, problems = rollout.meta, rollout.pose, []
    if meta.get("digest") not in (None, rollout.digest):
        problems.append("digest: the log was changed after it was written")
    if not np.allclose(rollout.t, np.arange(len(rollout.t)) / meta["physics_hz"], rtol=0, atol=1e-9):
        problems.append(f"t: rows are not {meta['physics_hz']} a second")
    if np.abs(rollout.clearance - clearance).max() > SAME:
        at = int(np.abs(rollout.clearance - clearance).argmax())
        problems.append(
            f"clearance: logged {rollout.clearance[at]:.4f} m at t = {rollout.t[at]:.3f} s, "
            f"closed form says {clearance[at]:.4f} m"
        )
    start = meta["task"]["start"]
    if np.hypot(*(pose[0, :2] - start[:2])) > 0.005 or abs(_wrapped(pose[0, 2] - start[2])) > 0.01:
        problems.append(f"pose: the first row is not the task's start {start}")
    if len(pose) > 1:
        yaw, dt = pose[:-1, 2], np.diff(rollout.t)
        heading = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
        mean_speed = (rollout.twist[:-1, 0] + rollout.twist[1:, 0]) / 2
        off = np.hypot(*(np.diff(pose[:, :2], axis=0) - heading * (mean_speed * dt)[:, None]).T)
        turn_off = np.abs(_wrapped(np.diff(pose[:, 2]) - (rollout.twist[:-1, 1] + rollout.twist[1:, 1]) / 2 * dt))
        free = np.ones(len(off), dtype=np.bool_)  # a collision may throw the robot
        if len(rollout.contacts):
            free[int(rollout.contacts[0, 0]) - 1 :] = False
        if (off[free] > SLIP).any() or (turn_off[free] > 0.02).any():
            at = int(np.argmax(np.where(free, off / SLIP + turn_off / 0.02, 0)))
            problems.append(f"pose: the step at t = {rollout.t[at]:.3f} s does not follow from the measured speed")
    outcome = rollout.outcome
    if (outcome is Outcome.COLLIDED) != bool(len(rollout.contacts)):
        problems.append(f"outcome: {outcome.name.lower()}, with {len(rollout.contacts)} contacts")
    if outcome is Outcome.SUCCEEDED:
        goal, tolerance = meta["task"]["goal"], meta["task"]["goal_tolerance"]
        left = float(np.hypot(*(pose[-1, :2] - goal)))
        if left > tolerance:
            problems.append(f"outcome: succeeded, but it ends {left:.3f} m from the goal (tolerance {tolerance:g} m)")
        if abs(rollout.twist[-1, 0]) > STANDING:
            problems.append(f"outcome: succeeded, but it still moves at {rollout.twist[-1, 0]:.3f} m/s at the end")
    return problems
