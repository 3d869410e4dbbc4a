"""The errors of a robot's odometry: wheels for the speed, a gyro for the yaw rate, and no fix of the pose.

The gyro's levels are those of the simulated Jackal of the BARN challenge (its description gives the IMU a rate noise and a rate
drift of 0.005 rad/s at 50 Hz). The challenge's wheels have no error of their own but skid; the scale stands for that: 1 % of
the way, and 0.5 % of every turn.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from antdrive.base.errors import FieldError

#: The rate at which the noise of a sample is given [Hz].
SAMPLE_RATE = 50.0
#: The lowest and highest value of each level.
ODOMETRY_RANGE = {
    "speed_scale": (0.0, 0.5),
    "yaw_scale": (0.0, 0.5),
    "gyro_bias": (0.0, 1.0),
    "speed_noise": (0.0, 0.5),
    "gyro_noise": (0.0, 1.0),
}


@dataclass(frozen=True, kw_only=True)
class Odometry:
    """How wrong odometry is. Levels are standard deviations.

    Scales and bias are drawn once for a drive and stay; noise is drawn anew for each sample. What is estimated does not
    depend on the rate of sampling but for the draws: at another rate than 50 Hz, noise is scaled so that poses drift as far.

    Attributes:
        speed_scale: constant error of the speed, as a fraction of it: wheels that are larger than thought, or slip
        yaw_scale: constant error of the yaw rate, as a fraction of it
        gyro_bias: constant error of the yaw rate [rad/s]
        speed_noise: noise of the speed in a sample at 50 Hz, as a fraction of the speed
        gyro_noise: noise of the yaw rate in a sample at 50 Hz [rad/s]

    Raises:
        FieldError: a value is outside its ODOMETRY_RANGE.
    """

    speed_scale: float = 0.01
    yaw_scale: float = 0.005
    gyro_bias: float = 0.005
    speed_noise: float = 0.02
    gyro_noise: float = 0.005

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            low, high = ODOMETRY_RANGE[field.name]
            if not low <= value <= high:
                raise FieldError(field.name, f"must be between {low:g} and {high:g}, got {value:g}")

    def scaled(self, factor: float) -> Odometry:
        """The errors multiplied by a factor; 0 is perfect odometry.

        Args:
            factor: what every level is multiplied by
        """
        return Odometry(**{field.name: getattr(self, field.name) * factor for field in dataclasses.fields(self)})
