"""Speed profiles of routes with named rows."""

from typing import NamedTuple

import numpy as np

from antdrive.robots.control.speed_limits import speed_profile


class Profile(NamedTuple):
    """The rows of a speed profile."""

    arc: np.ndarray
    speed: np.ndarray
    time: np.ndarray
    curvature: np.ndarray
    heading: np.ndarray
    limit: np.ndarray

    @property
    def duration(self):
        """Duration of the route [s]."""
        return self.time[-1]

    @property
    def yaw_rate(self):
        """Yaw rate (S,) [rad/s]."""
        return self.speed * self.curvature


def profile(route, spec, blend=0.2, rotate_in_place_above=1.0, braking=1.0, step=0.02):
    """The fastest speeds along a route."""
    return Profile(*speed_profile(route, spec, blend, rotate_in_place_above, braking, step))
