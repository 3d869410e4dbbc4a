"""Where the robot believes it is: by pose fixes, by odometry alone, or without error.

The same wheels slip and the same commands are late whichever way the robot localises itself.
"""

from __future__ import annotations

from antdrive.base import Pose
from antdrive.robots import NoiseModel, RobotSpec, Twist
from antdrive.robots.odometry import Odometry
from antdrive.sim.log.streams import random_stream
from antdrive.sim.sensing.dead_reckoning import DeadReckoning


class OdometryModel(NoiseModel):
    """The noise of a drive without pose fixes: encoders tell the speed, a gyro the yaw rate, and errors add up."""

    def __init__(self, robot: RobotSpec, noise: float, period: float, start: Pose, seed: int, errors: Odometry) -> None:
        super().__init__(robot.noise.scaled(noise), robot.track, period, start, random_stream(seed, "noise"))
        self._reckoning = DeadReckoning(errors, random_stream(seed, "odometry"), start)

    def estimate_pose(self, pose: Pose, twist: Twist) -> Pose:
        """The pose that odometry gives for a robot whose true velocity is `twist`."""
        noise = self._noise
        rolled = self._wheels(twist) / (1 + self._slip) * (1 + noise.encoder * self._rng.standard_normal(2))
        if self._tick:
            self.estimate = self._reckoning.advance(self._twist(*rolled).speed, twist.yaw_rate, self._period)
        self._tick += 1
        return self.estimate

    def correct(self, estimate: Pose) -> None:
        """Go on from another pose."""
        self.estimate = self._reckoning.pose = estimate


class TruePoseModel(NoiseModel):
    """The noise of a drive in which the robot knows its pose without error."""

    def estimate_pose(self, pose: Pose, twist: Twist) -> Pose:
        """The true pose."""
        self.estimate = pose
        return pose


def noise_model_of(
    kind: str, robot: RobotSpec, noise: float, odometry: float, period: float, start: Pose, seed: int
) -> NoiseModel | None:
    """The noise of one drive; None where the robot senses and acts perfectly."""
    if kind in ("odometry", "matching"):
        return OdometryModel(robot, noise, period, start, seed, Odometry().scaled(odometry))
    levels = robot.noise.scaled(noise)
    if not levels.nonzero:
        return None
    model = TruePoseModel if kind == "true" else NoiseModel
    return model(levels, robot.track, period, start, random_stream(seed, "noise"))
