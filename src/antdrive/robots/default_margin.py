"""Default margin: the clearance of plans that noise, route and robot require, in closed form.

Calibration (`antdrive.runs.margins.choice`) measures the same loss by drives. The constants below are fitted to it, see
`docs/notebook/margins.md`.

In all functions `noise` is a factor on the robot's documented noise, and `smoothing` says how plans become routes. `margin` is
the clearance of plans on top of the robot's radius [m].
"""

from __future__ import annotations

import math

from antdrive.robots.control._kernels_lines import NEAREST, PASSED, RESPONSE
from antdrive.robots.control.pursuit import PurePursuit
from antdrive.robots.noise import SLIP_TIME, steady_errors
from antdrive.robots.spec import RobotSpec

LEAST = 0.03  # of perfect robots, and the least of all [m]
RESERVE = 0.01  # part of the margin beyond the predicted loss, of calibrated margins, too [m]
#: Loss by noise that one drive in a thousand exceeds, in standard deviations: on routes with corners, and on smooth routes,
#: whose curvature the controller knows.
DEVIATIONS = {"none": 2.5, "taut": 1.0, "clearance": 1.0}
#: The same for routes of lines, by the loss of the outline: none of 1,250 drives of five robots lost more.
LINE_DEVIATIONS = 2.2
LINE_ROUNDING = 0.005  # loss of lines without noise, apart from corners passed without a stop [m]
STEP = 0.001  # margins are multiples of this [m]
#: Plans for the footprint keep this margin if possible: the controller refuses turns closer to hits [m].
TURNABLE = 0.025
#: Scattered hits narrow a passage that is hardly wider than the robot: a last plan for the footprint comes this much closer to
#: them, so that the robot goes there and sees better. The controller and the stopping constraint still keep it from hits [m].
SQUEEZED = -0.02


def default_margin(robot: RobotSpec, controller: PurePursuit, noise: float, smoothing: str) -> float:
    """Return the margin of plans that a scenario has unless it gives one [m].

    The controller spends up to a fraction `1 - lookahead_margin` of the margin on cutting corners, as far as the robot's
    width reaches its circumscribed circle. The rest must hold the loss by noise and a reserve. On smooth routes the robot
    passes obstacles sideways, so its width also reduces the loss by noise.
    """
    if not (noise and robot.noise.nonzero):
        return LEAST
    raw = smoothing == "none"
    loss = noise_loss(robot, controller, noise, smoothing)
    _, right, _, left = robot.footprint.bounds
    width = min(1.0, max(left, -right) / robot.radius)
    cut = (1 - controller.lookahead_margin) * width
    if not raw:
        loss *= width
    steps = math.ceil((RESERVE + loss) / (1 - cut) / STEP - 1e-9)
    return max(LEAST, round(steps * STEP, 3))


def noise_loss(robot: RobotSpec, controller: PurePursuit, noise: float, smoothing: str) -> float:
    """Return the loss of clearance by noise that one drive in a thousand exceeds [m]."""
    return DEVIATIONS[smoothing] * deviation(robot, controller, noise, raw=smoothing == "none")


def clearances_off_route(robot: RobotSpec, controller: PurePursuit, noise: float) -> tuple[float, float]:
    """Return the clearances of the circle and the outline that motions off the route keep from obstacles [m].

    They hold the same losses as margins, and the reserve. Such motions are chosen again in each control period, so no long turn
    adds its slip.
    """
    if not (noise and robot.noise.nonzero):
        return RESERVE, RESERVE + LINE_ROUNDING
    outline = LINE_ROUNDING + LINE_DEVIATIONS * line_deviation(robot, controller, noise, turn=0.0)
    return RESERVE + noise_loss(robot, controller, noise, "none"), RESERVE + outline


def deviation(robot: RobotSpec, controller: PurePursuit, noise: float, *, raw: bool) -> float:
    """Return the standard deviation of a robot from its route beside an obstacle, by noise [m]; a `raw` route has corners.

    Three independent parts add up: the estimated position; the estimated heading, over the lookahead; and wheel slip, whose
    yaw rate moves the robot off the route until the slip's correlation time has passed, or the lookahead of a route with corners.
    """
    levels, c = robot.noise.scaled(noise), controller
    speed = min(robot.max_speed, c.min_speed_near_obstacles + LEAST / c.clearance_time)
    time = c.corner_lookahead_time if raw else c.lookahead_time
    lookahead = min(c.lookahead_max, max(time * speed, c.preferred_lookahead_min))
    position, heading = steady_errors(levels, robot.track)
    slipping = min(lookahead, SLIP_TIME * speed) if raw else SLIP_TIME * speed
    slip = math.sqrt(2) * levels.slip / robot.track * slipping**2 / 2
    return math.hypot(position, heading * lookahead, slip)


def line_margin(robot: RobotSpec, controller: PurePursuit, noise: float) -> float:
    """Return the margin of the outline on routes of lines, unless a scenario gives one [m].

    Without noise, the outline leaves its planned sweep where the robot passes a small corner without a stop.
    """
    loss = LINE_ROUNDING + PASSED * robot.radius
    if noise and robot.noise.nonzero:
        loss += LINE_DEVIATIONS * line_deviation(robot, controller, noise)
    return max(LEAST, round(math.ceil((RESERVE + loss) / STEP - 1e-9) * STEP, 3))


def outline_margins(
    robot: RobotSpec, controller: PurePursuit, noise: float, margin: float, *, of_lines: bool
) -> tuple[float, ...]:
    """Return the clearances of plans for the footprint, in turn until there is a path, that of lines first if asked for [m]."""
    return tuple(dict.fromkeys((max(margin, line_margin(robot, controller, noise)), margin) if of_lines else (margin,)))


def mapless_margins(margins: tuple[float, ...], margin: float) -> tuple[float, ...]:
    """Return the clearances of a mapless robot's plans for its footprint, in turn, after those of `outline_margins` [m]."""
    return tuple(dict.fromkeys((*margins, min(TURNABLE, margin), 0.0, SQUEEZED)))


def line_deviation(robot: RobotSpec, controller: PurePursuit, noise: float, turn: float = math.pi) -> float:
    """Return the standard deviation of the outline's farthest corner from its planned sweep, by noise [m].

    Independent parts add up: the estimated position; the heading, over the circumscribed radius and the distance over which
    errors decay; wheel slip on straights, which bends the path over that distance; and slip during a `turn` on the spot [rad].
    """
    levels = robot.noise.scaled(noise)
    speed = min(robot.max_speed, controller.min_speed_near_obstacles + LEAST / controller.clearance_time)
    decay = max(NEAREST, RESPONSE * speed)
    position, heading = steady_errors(levels, robot.track)
    bend = math.sqrt(2) * levels.slip / robot.track
    turning = levels.slip / math.sqrt(2) * turn * robot.track / 2
    return math.hypot(position, heading * (robot.radius + decay), bend * decay * (robot.radius + decay), turning)
