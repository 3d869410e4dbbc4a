"""A robot that avoids movers, by exact kinematics."""

import math

import numpy as np

from antdrive.robots import AvoidanceState, PurePursuit, PursuitState, Twist


def avoiding(tracked, robot, avoidance, movers, radius, *, start, speed=0.0, arc=0.0, hz=60, seconds):
    """Yield the poses of a robot that follows a path and avoids a mover.

    `movers` returns, for a control period, the predicted places (K + 1, 1, 2) and the observed velocity (1, 2) or None.
    """
    pose, pursuit, state = np.array(start, dtype=float), PursuitState(arc), AvoidanceState()
    last = Twist(speed, 0.0)
    for k in range(round(seconds * hz)):
        here, (places, velocity) = tuple(pose), movers(k)
        wanted, after = PurePursuit().pursue(tracked, here, last, pursuit)
        last, avoids, state = avoidance.avoid(
            tracked,
            robot,
            here,
            last,
            pursuit,
            wanted,
            state,
            np.ascontiguousarray(places),
            np.array([radius]),
            velocity,
        )
        pursuit = after._replace(turning=pursuit.turning) if avoids else after
        middle = pose[2] + 0.5 * last.yaw_rate / hz
        pose += np.array((last.speed * math.cos(middle), last.speed * math.sin(middle), last.yaw_rate)) / hz
        yield tuple(pose)
