"""Take the scans of a logged drive again, and match them again: what its lidar saw, and where the robot believed it was.

Scans follow from the true poses, the world and the record's seed; estimates that scans correct follow from them and from the
odometry of the same seed. The map of a robot that was given none is made anew, and where the robot forgot it, it is forgotten
at the same time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from antdrive.base import Floats, Pose
from antdrive.robots import RobotSpec
from antdrive.sim.driving.lookout import Glances
from antdrive.sim.driving.own_map import forgetting_ticks
from antdrive.sim.driving.survey import Senses, Survey
from antdrive.sim.driving.watching import Watch
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.scans import millimetres
from antdrive.worlds import Task, Trajectories, World


def survey_of(
    robot: RobotSpec,
    task: Task,
    world: World,
    trajectories: Trajectories,
    *,
    seed: int,
    noisy: bool,
    matching: bool,
    watching: bool,
    hz: int,
) -> Survey:
    """The survey of a robot without a map, after the first look from the start."""
    assert robot.lidar is not None
    senses = Senses.of(robot.lidar, world, trajectories, seed=seed, noisy=noisy, hz=hz)
    watch = Watch(robot.lidar, hz) if watching else None
    survey = Survey(senses, robot, task.start, task.goal, matching=matching, watch=watch)
    survey.look(0, task.start, task.start)
    return survey


class Rescanning:
    """The survey of a logged drive, made again period by period."""

    def __init__(self, rollout: Rollout) -> None:
        record = rollout.record
        self._rollout = rollout
        self._survey = survey_of(
            record.robot,
            record.task,
            record.world,
            rollout.trajectories(),
            seed=record.seed,
            noisy=record.noise > 0,
            matching=record.localisation == "matching",
            watching=record.perception is not None and record.perception.kind == "lidar",
            hz=record.control_hz,
        )
        self._forgetting = set(forgetting_ticks(record))

    def look(self, tick: int, pose: Pose, estimate: Pose) -> Pose:
        """The estimated pose of a control period, corrected by the scan if one is due."""
        return self._survey.look(tick, pose, estimate)

    def plan(self, tick: int, pose: Pose) -> None:
        """Forget the map where the robot did so before it planned."""
        if tick in self._forgetting:
            self._survey.forget(pose)

    def problems(self) -> Iterator[str]:
        """The first scan of the log that is not as the lidar takes it, in a sentence; none if all are."""
        return _other_scans(self._rollout, ((scan.tick, scan.ranges) for scan in self._survey.scans))


class Relooking:
    """The scans of a logged drive with a map, taken again period by period."""

    def __init__(self, rollout: Rollout) -> None:
        record = rollout.record
        assert record.robot.lidar is not None
        senses = Senses.of(
            record.robot.lidar,
            record.world,
            rollout.trajectories(),
            seed=record.seed,
            noisy=record.noise > 0,
            hz=record.control_hz,
        )
        self._rollout, self._glances = rollout, Glances(senses)

    def look(self, tick: int, pose: Pose, estimate: Pose) -> Pose:
        """Take a scan if one is due in a control period; the estimated pose, which no scan corrects."""
        self._glances.scan(tick, pose)
        return estimate

    def problems(self) -> Iterator[str]:
        """The first scan of the log that is not as the lidar takes it, in a sentence; none if all are."""
        return _other_scans(self._rollout, self._glances.taken)


def rescanning_of(rollout: Rollout) -> Rescanning | Relooking | None:
    """What takes the scans of a log again; None where it has none."""
    if not len(rollout.scans):
        return None
    return Rescanning(rollout) if rollout.record.exploring else Relooking(rollout)


def _other_scans(rollout: Rollout, taken: Iterable[tuple[int, Floats]]) -> Iterator[str]:
    """The first scan of a log that is not one of those that were taken again in control periods, in a sentence."""
    rows, logged, per_tick = rollout.scan_rows, rollout.scans, rollout.record.physics_hz // rollout.record.control_hz
    again = {tick * per_tick: ranges for tick, ranges in taken}
    last = max(again, default=-1)
    for row in sorted({*again, *(row for row in rows.tolist() if row <= last)}):
        at = np.flatnonzero(rows == row)
        if row in again and len(at) == 1 and np.array_equal(millimetres(again[row]), logged[at[0]]):
            continue
        yield f"replay: scans are not what the lidar measures from the logged poses, from t = {rollout.t[row]:.3f} s"
        return
