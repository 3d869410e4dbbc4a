"""Odometry of a logged drive, rebuilt from the seed's noise, with the covariances of the simulated errors.

A log holds the estimates, which pose fixes or scans may have corrected. Odometry is what wheels and gyro alone measured.
The covariances follow from the error models of `Wheels` and `Odometer`, see `PoseFilter`.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from antdrive.base.types import Floats
from antdrive.sim.log.consistency import wheel_speeds
from antdrive.sim.log.rollout import Rollout

if TYPE_CHECKING:
    from antdrive.sim.sensing.pose_filter import PoseFilter


@dataclass(frozen=True, eq=False)
class LoggedOdometry:
    """Odometry in each of a log's T rows. Covariances are 0 where no noise was simulated.

    The covariance of estimates is that of the filter for pose fixes, otherwise that of dead reckoning; for scan matching
    it is an upper bound.
    """

    pose: Floats  # x, y [m] and yaw [rad] in the frame odom, which begins as the world's frame (T, 3)
    twist: Floats  # measured speed [m/s] and yaw rate [rad/s], constant in a control period (T, 2)
    wheels: Floats  # rim speeds of the left and right wheel by their encoders [m/s] (T, 2)
    pose_covariance: Floats  # (T, 3, 3)
    twist_covariance: Floats  # (T, 2, 2)
    estimate_covariance: Floats  # (T, 3, 3)


def odometry_of(rollout: Rollout) -> LoggedOdometry:
    """Return the odometry of a logged drive: its true motion where the drive simulated no odometry."""
    if rollout.record.localisation != "true" and len(rollout.actuated):
        return _rebuilt(rollout)
    return _true(rollout)


def _true(rollout: Rollout) -> LoggedOdometry:
    """Return the true motion as odometry."""
    none, wheels = np.zeros((len(rollout.t), 3, 3)), wheel_speeds(rollout.twist, rollout.record.robot.track)
    return LoggedOdometry(rollout.pose, rollout.twist, wheels, none, none[:, :2, :2], none)


def _rebuilt(rollout: Rollout) -> LoggedOdometry:
    """Return the odometry that the seed's noise makes of the logged motion.

    The imports load compiled code, which tables of exact drives do not need.
    """
    from antdrive.robots.control.observation import Twist
    from antdrive.robots.noise import moved
    from antdrive.sim.driving.senses import logged_positioning
    from antdrive.sim.physics.engine import State
    from antdrive.sim.sensing.pose_filter import PoseFilter

    record, rows, track = rollout.record, len(rollout.t), rollout.record.robot.track
    period, per_tick = 1 / record.control_hz, record.rows_per_period
    senses, localiser = logged_positioning(record)
    if not senses.noisy:
        return _true(rollout)
    encoders, measured, corrected = [], [], []
    for row in range(0, rows - 1 + per_tick, per_tick):
        at = min(row, rows - 1)
        odometry, fix = senses.read(State(*rollout.pose[at].tolist(), *rollout.twist[at].tolist()))
        localiser.update(odometry, fix)
        encoders.append(senses.encoders)
        measured.append(odometry)
        corrected.append(localiser.covariance)
        senses.actuate(Twist(*rollout.command[min(row + 1, rows - 1)].tolist()))
    twists = np.array([Twist(0.0, 0.0), *measured[1:]])
    ways = (Twist(*way) for way in (twists * period).tolist())
    ticks = np.array(list(itertools.accumulate(ways, moved, initial=record.task.start))[1:])
    of_row = (np.arange(rows) + per_tick - 1) // per_tick  # the control period that ends at the row or after it
    before = np.maximum(of_row - 1, 0)
    elapsed = (np.arange(rows) - before * per_tick) / record.physics_hz
    parts = zip(ticks[before].tolist(), twists[of_row].tolist(), elapsed.tolist(), strict=True)
    pose = np.array([moved(at, Twist(speed * time, turn * time)) for at, (speed, turn), time in parts])
    noise = record.robot.noise.scaled(record.noise)
    poses, samples = _covariances(ticks, twists, PoseFilter(noise, senses.gyro, track, period))
    believed = np.array(corrected)[np.arange(rows) // per_tick] if record.localisation == "fixes" else poses[of_row]
    wheels = wheel_speeds(np.array(encoders), track)[of_row]
    return LoggedOdometry(pose, twists[of_row], wheels, poses[of_row], samples[of_row], believed)


def _covariances(ticks: Floats, twists: Floats, model: PoseFilter) -> tuple[Floats, Floats]:
    """Return the covariances of pose (K, 3, 3) and twist (K, 2, 2) after each control period, by predictions alone."""
    poses, samples = [], []
    for before, twist in zip([ticks[0], *ticks[:-1]], twists, strict=True):
        model.predict(before.tolist(), twist.tolist())
        poses.append(model.covariance[:3, :3])
        samples.append(model.twist_covariance)
    poses[0] = np.zeros((3, 3))  # the start is exact
    return np.array(poses), np.array(samples)
