"""End of a drive: the rule that the driving loop follows, and the check that a log follows it.

A drive ends in the first control period in which the robot, by its estimate, stands at the goal (`arrived`). Before that,
a contact, the time limit, the end of the route or `STUCK_TIME` without progress may end it. It is a success if the
robot then truly is at the goal, without contact. Each check is a function that yields a sentence per error.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.base.plane import arc_lengths
from antdrive.base.types import Floats, Point
from antdrive.sim.log.metrics import nearest_segments
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout, estimates_of
from antdrive.worlds.route import short_of_goal

Rows: TypeAlias = npt.NDArray[np.int64]

STOPPED_SPEED = 0.01  # a robot slower than this, measured and commanded, has stopped [m/s], [rad/s]
AFTER_CONTACT = 0.5  # logged time of braking after a collision [s]
STUCK_TIME = 8.0  # a robot without progress for this long is stuck [s]
STUCK_PROGRESS = 0.02  # least progress along the route that counts [m]

ROUNDING = 1e-9  # estimates are logged as errors of the poses [m]
AT_ROUTE_END = 0.05  # a robot with at most this much of its route left is at its end [m]
BESIDE_END = 1.0  # avoidance may take a robot at most this far off the end of its route [m]
STAYED = 0.1  # a stuck robot gets at most this much farther in `STUCK_TIME`, straight or along its route [m]
AVOID, ROTATE = "avoid", "rotate"  # names of rules in `record.limiters`
TURNS = (ROTATE, "braking", "done", "sight")  # those that may limit a robot that turns on the spot, or brakes for it
BLOCKER_MOVED = 0.1  # a mover that blocks the robot for good moves less [m]


def stopped(twist: Sequence[float], command: Sequence[float]) -> bool:
    """Return whether the robot stands: neither measured nor commanded to drive or turn."""
    (speed, turn), (to_speed, to_turn), limit = twist, command, STOPPED_SPEED
    return abs(speed) < limit and abs(turn) < limit and abs(to_speed) < limit and abs(to_turn) < limit


def arrived(
    estimate: Sequence[float], twist: Sequence[float], command: Sequence[float], goal: Point, tolerance: float
) -> bool:
    """Return whether a robot with its last command in force stands at the goal by its estimate, which ends its drive."""
    return math.dist(estimate[:2], goal) <= tolerance and stopped(twist, command)


def outcome_at(pose: Sequence[float], goal: Point, tolerance: float) -> Outcome:
    """Return the outcome of a robot that ends its drive by standing at a true pose."""
    return Outcome.SUCCEEDED if math.dist(pose[:2], goal) <= tolerance else Outcome.STUCK


def control_periods(limit: float, hz: int) -> int:
    """Return the number of control periods within a time limit [s]."""
    return round(limit * hz)


def rows_after_contact(physics_hz: int) -> int:
    """Return the number of rows that are logged after the control period of the first contact."""
    return round(AFTER_CONTACT * physics_hz)


def false_endings(rollout: Rollout) -> Iterator[str]:
    """Yield every contradiction of the outcome and the last row with the rule by which a drive ends."""
    yield from _check_last_row(rollout)
    yield from _check_arrival(rollout)
    check = {
        Outcome.SUCCEEDED: _check_success,
        Outcome.STUCK: _check_stuck,
        Outcome.BLOCKED: _check_blocked,
        Outcome.INVALID_PLAN: _check_searched,
    }.get(rollout.outcome)
    if check is not None:
        yield from check(rollout)
    if rollout.outcome is Outcome.NO_PATH:
        yield f"outcome: {rollout.outcome.key} ends a run before the robot drives, but the log has rows"


def _check_last_row(rollout: Rollout) -> Iterator[str]:
    """Check that the last row is that of a control period within the time limit, or as late as a contact makes it."""
    record, last = rollout.record, len(rollout.t) - 1
    period = record.rows_per_period
    limit = control_periods(record.time_limit, record.control_hz) * period
    control = min(rollout.first_contact, last)
    # The limit ends a drive after its last control period, in which only a decision could have ended it.
    decided = rollout.outcome in (Outcome.SUCCEEDED, Outcome.BLOCKED, Outcome.INVALID_PLAN)
    if control > limit - (period if decided else 0):
        yield f"record.time_limit: {record.time_limit:g} s, but the drive lasts {rollout.t[control]:.3f} s"
    if len(rollout.contacts):
        after, logged = -(-control // period) * period + rows_after_contact(record.physics_hz) - control, last - control
        if logged != after:
            yield (
                f"contacts: the first contact ends a drive after {after / record.physics_hz:.3f} s, "
                f"but the log ends after {logged / record.physics_hz:.3f} s"
            )
    elif rollout.outcome is Outcome.TIMED_OUT and last < limit:
        yield f"outcome: timed_out, but the drive ends after {rollout.t[-1]:.3f} s of {record.time_limit:g} s"
    elif last % period:
        yield f"outcome: {rollout.outcome.key}, but the drive ends within a control period, at row {last}"


def _check_arrival(rollout: Rollout) -> Iterator[str]:
    """Check that the robot did not stand at the goal in an earlier control period."""
    task, end = rollout.record.task, len(rollout.t) - 1
    stop = min(rollout.first_contact, end)
    estimate, tolerance = estimates_of(rollout), task.goal_tolerance - ROUNDING
    period = rollout.record.rows_per_period
    slow = np.flatnonzero(np.abs(rollout.twist[:stop]).max(axis=1) < STOPPED_SPEED)
    for row in slow[(slow > 0) & (slow % period == 0)].tolist():
        if arrived(estimate[row], rollout.twist[row], rollout.command[row], task.goal, tolerance):
            yield (
                f"outcome: {rollout.outcome.key}, but the robot stands at the goal at t = {rollout.t[row]:.3f} s, "
                "which ends a drive"
            )
            return


def _check_success(rollout: Rollout) -> Iterator[str]:
    """Check that the robot ends its drive at the goal."""
    task = rollout.record.task
    left, (speed, yaw_rate) = math.dist(rollout.pose[-1, :2], task.goal), rollout.twist[-1].tolist()
    if outcome_at(rollout.pose[-1], task.goal, task.goal_tolerance) is not Outcome.SUCCEEDED:
        yield (
            f"outcome: succeeded, but the drive ends {left:.3f} m from the goal (tolerance {task.goal_tolerance:g} m)"
        )
    if not stopped((speed, yaw_rate), rollout.command[-1]):
        yield (
            f"outcome: succeeded, but the robot still moves at {speed:.3f} m/s and {yaw_rate:.3f} rad/s at the end, "
            "or is commanded to"
        )
    elif not _ends_by_itself(rollout):
        yield "outcome: succeeded, but by its estimate the robot is neither at the goal nor at the end of its route"


def _check_stuck(rollout: Rollout) -> Iterator[str]:
    """Check that a stuck robot stands off the goal at the end of its route, or has made no progress for some time."""
    task = rollout.record.task
    off_goal = outcome_at(rollout.pose[-1], task.goal, task.goal_tolerance) is Outcome.STUCK
    if off_goal and stopped(rollout.twist[-1], rollout.command[-1]) and _ends_by_itself(rollout):
        return
    counted = _counted_rows(rollout)
    if not len(counted):
        yield (
            f"outcome: stuck, but the drive ends after {rollout.t[-1]:.3f} s; that takes {STUCK_TIME:g} s of driving "
            "without progress"
        )
        return
    farther = _progress(rollout, counted)
    if farther > STAYED:
        yield f"outcome: stuck, but the robot got {farther:.3g} m farther in the last {STUCK_TIME:g} s of driving"


def _check_blocked(rollout: Rollout) -> Iterator[str]:
    """Check that a blocked drive ends with a failed search, and that a mover stood still until the patience was over."""
    yield from _check_searched(rollout)
    patience = (rollout.record.replanning or {}).get("patience")
    if not isinstance(patience, int | float):
        yield "outcome: blocked, but the record has no patience"
        return
    places = rollout.movers[max(0, len(rollout.t) - 1 - round(patience * rollout.record.physics_hz)) :]
    moved = np.hypot(*np.moveaxis(places - places[-1], -1, 0)).max(axis=0)
    if rollout.t[-1] < patience or not (moved <= BLOCKER_MOVED).any():
        yield f"outcome: blocked, but no mover stood still for {patience:g} s"


def _check_searched(rollout: Rollout) -> Iterator[str]:
    """Check that the drive ends with a search for a route that failed."""
    record = rollout.record
    failed = record.replans[-1:] if record.replans and not record.replans[-1].solved else ()
    ends = [round(replan.t * record.control_hz) * record.rows_per_period for replan in failed]
    if ends != [len(rollout.t) - 1]:
        yield f"outcome: {rollout.outcome.key}, but the drive does not end with a search that found no route"


def _ends_by_itself(rollout: Rollout) -> bool:
    """Return whether, by its estimate, a robot that stands is at the goal or at the end of a route that leads there.

    Without a map, a robot at the end of its route waits or searches on. In row 0 it has had no command yet.
    """
    if len(rollout.t) == 1:
        return False
    record, here = rollout.record, estimates_of(rollout)[-1]
    if math.dist(here[:2], record.task.goal) <= record.task.goal_tolerance + ROUNDING:
        return True
    return not record.mapless and _at_route_end(rollout)


def _at_route_end(rollout: Rollout) -> bool:
    """Return whether the robot got to the end of its last route, which leads to the goal, and stands nearby."""
    task, cell, places = rollout.record.task, rollout.record.cell, estimates_of(rollout)[:, :2]
    rows, route = rollout.legs()[-1]
    near = places[rows][np.hypot(*(places[rows] - route[-1]).T) <= BESIDE_END]
    if math.dist(route[-1], task.goal) > short_of_goal(task.goal_tolerance, cell) or not len(near):
        return False
    got = float(_arcs(route, near).max())
    return math.dist(places[-1], route[-1]) <= BESIDE_END and got >= float(arc_lengths(route)[-1]) - AT_ROUTE_END


def _counted_rows(rollout: Rollout) -> Rows:
    """Return the ends of the last control periods that add up to `STUCK_TIME`, empty if too few.

    Avoidance does not count. If only turns on the spot add up, the time is that of a full turn more. A robot that brakes for
    its turn counts as turning, as in `StuckClock`.
    """
    record, period = rollout.record, rollout.record.rows_per_period
    ends = np.arange(period, len(rollout.t), period)

    def by(*rules: str) -> npt.NDArray[np.bool_]:
        return np.isin(rollout.limiter[ends], [i for i, name in enumerate(record.limiters) if name in rules])

    driving = round(STUCK_TIME * record.control_hz)
    turning = driving + round(2 * math.pi / record.robot.max_yaw_rate * record.control_hz)
    avoids = by(AVOID)
    enough = (_sums_to_end(~avoids & ~by(ROTATE)) >= driving) | (_sums_to_end(by(*TURNS)) >= turning)
    first = int(np.flatnonzero(enough)[-1]) if enough.any() else len(ends)
    return np.asarray(ends[first:][~avoids[first:]])


def _sums_to_end(values: npt.NDArray[np.bool_]) -> Rows:
    """Return the number of true values from each place to the end (N,)."""
    return np.asarray(np.cumsum(values[::-1])[::-1])


def _progress(rollout: Rollout, rows: Rows) -> float:
    """Return how far the robot got from the first of the rows, or along its routes if that is less [m].

    Along a route, only what is beyond the farthest earlier point counts: avoidance may have taken the robot back.
    """
    places = estimates_of(rollout)[:, :2]
    straight = float(np.hypot(*(places[rows] - places[rows[0]]).T).max())
    gains = [0.0]
    for leg, route in rollout.legs():
        some = rows[(rows >= leg.start) & (rows < leg.stop)]
        if len(some):
            got = _arcs(route, places[leg.start : some[0] + 1]).max()
            gains.append(float(_arcs(route, places[some]).max() - got))
    return min(straight, max(gains))


def _arcs(route: Floats, places: Floats) -> Floats:
    """Return the arc lengths of the nearest points of a route to places (N, 2), shape (N,) [m]."""
    feet, segment = nearest_segments(places, route)
    return np.asarray(arc_lengths(route)[segment] + np.hypot(*(feet - route[segment]).T))
