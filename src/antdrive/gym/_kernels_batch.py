"""Compiled control periods of many kinematic robots: arrays in, arrays out, no validation.

Each robot has a stream of random numbers of its own, so its episode is the same in a batch of any size.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from antdrive.planners.colonies._kernels_colony import next_random
from antdrive.robots._kernels_footprint import disc_gap, footprint_gap, outer_radius
from antdrive.sim.sensing._kernels_rays import scan
from antdrive.worlds._kernels import Array, inline, kernel, leaf

PER_BIT = 1.0 / 9007199254740992.0  # 2^-53
STOPPED_SPEED = 0.01  # [m/s], [rad/s]; log/ending.py has the same
STANDING_SPEED = 0.02  # [m/s]; log/contacts.py has the same
TOUCHING = 1e-4  # [m]; robots/clearance.py has the same
SLIP_TIME = 0.5  # [s]; robots/noise.py has the same
FARTHEST = 20.0  # distance of a goal that is observed as 1 [m]
LEAP = 20.0  # a mover that is faster has jumped [m/s]; worlds/limits.py has the same
DRIVING, SUCCEEDED, STUCK, COLLIDED, HIT_WHILE_STANDING, HIT_BY_TELEPORT = 0, 1, 2, 3, 4, 5
# Columns of `Robots.state`: true pose and twist, command in force, estimated pose, slip of both wheels, and a lower bound
# of the distance to anything static.
X, Y, YAW, SPEED, TURN, TO_SPEED, TO_TURN, BELIEVED, SLIP, FREE, MEASURED, COLUMNS = (
    0,
    1,
    2,
    3,
    4,
    5,
    6,
    7,
    10,
    12,
    13,
    15,
)
# Columns of `Robots.facts`.
CLEARANCE, DISTANCE, PROGRESS = 0, 1, 2


class Maps(NamedTuple):
    """Worlds, one after the other in flat arrays."""

    rows: Array  # (W, 7): first value and number of discs, of visible discs, of movers (radii) and of their tracks
    bounds: Array  # inner faces of the walls (W, 4)
    discs: Array  # of each world (N, 3), flat
    visible: Array  # of each world (3, V), flat
    radii: Array  # of each world's movers (M,), flat; those that the lidar sees are positive
    tracks: Array  # positions of each world's movers in each control period (T, M, 2), flat


class SharedSpec(NamedTuple):
    """The robots' common specification."""

    limits: Array  # speed, yaw rate, acceleration, yaw acceleration, lateral acceleration, rim speed, half the track
    shape: Array  # half length, half width and rounding
    corners: Array  # (K, 2)
    lidar: Array  # its x, y and yaw on the robot, first angle and spacing of the beams
    beams: Array  # directions (2, B)
    ranges: Array  # shortest and longest range, resolution and standard deviation
    rates: Array  # control periods in an action, physics steps in a control period, control periods in a second


class Robots(NamedTuple):
    """The robots' state, a row for each."""

    state: Array  # (N, COLUMNS)
    bits: Array  # the same memory as whole numbers
    random: Array  # state of the random numbers (N,)
    digest: Array  # hash of all states so far (N,)
    tick: Array  # control periods driven (N,)
    pending: Array  # commands on their way to the motors (N, D, 2)
    world: Array  # index of the world (N,)
    goal: Array  # x, y, tolerance (N, 3)
    noise: Array  # fix x and y, fix yaw, encoder, slip, gain xy, gain yaw, lidar's factor (N, 7)
    timing: Array  # delay and time between fixes in control periods (N, 2)
    ending: Array  # how the episode ended (N,)
    facts: Array  # (N, 3)
    seen: Array  # observations (N, B + 5)


@kernel
def place(i: int, shared: SharedSpec, robots: Robots, maps: Maps) -> None:
    """Observe with robot i, which stands at its start."""
    measure(i, shared, robots)
    look(i, shared, robots, maps)


@kernel
def drive(chosen: Array, actions: Array, shared: SharedSpec, robots: Robots, maps: Maps) -> None:
    """Drive the chosen robots for one action each, in parts of their highest speed and yaw rate (N, 2)."""
    for i in range(len(chosen)):
        if not chosen[i]:
            continue
        before = robots.facts[i, DISTANCE]
        for _ in range(shared.rates[0]):
            decide(i, actions[i, 0], actions[i, 1], shared, robots)
            robots.ending[i] = move(i, shared, robots, maps)
            if robots.ending[i] == DRIVING:
                robots.tick[i] += 1
                measure(i, shared, robots)
                robots.ending[i] = arrived(i, robots)
            if robots.ending[i] != DRIVING:
                break
        look(i, shared, robots, maps)
        robots.facts[i, PROGRESS] = before - robots.facts[i, DISTANCE]
        if robots.ending[i] >= COLLIDED:
            robots.facts[i, CLEARANCE] = min(robots.facts[i, CLEARANCE], 0.0)


@leaf
def arrived(i: int, robots: Robots) -> int:
    """Return the ending of a robot that stands at the goal by its estimate; `DRIVING` for another one."""
    state, goal = robots.state[i], robots.goal[i]
    fastest = max(max(abs(state[SPEED]), abs(state[TURN])), max(abs(state[TO_SPEED]), abs(state[TO_TURN])))
    if fastest >= STOPPED_SPEED or not at_goal(state[BELIEVED], state[BELIEVED + 1], goal):
        return DRIVING
    return SUCCEEDED if at_goal(state[X], state[Y], goal) else STUCK


@inline
def at_goal(x: float, y: float, goal: Array) -> bool:
    """Return whether a point is within the goal's tolerance."""
    return bool(math.hypot(x - goal[0], y - goal[1]) <= goal[2])


@leaf
def decide(i: int, speed: float, turn: float, shared: SharedSpec, robots: Robots) -> None:
    """Command a robot to an action within its limits; at the goal it brakes."""
    state, limits, period = robots.state[i], shared.limits, 1.0 / shared.rates[2]
    if at_goal(state[BELIEVED], state[BELIEVED + 1], robots.goal[i]):
        speed, turn = 0.0, 0.0
    state[TO_SPEED], state[TO_TURN] = limited(state[TO_SPEED], state[TO_TURN], speed, turn, period, limits)


@leaf
def limited(
    speed: float, turn: float, to_speed: float, to_turn: float, period: float, limits: Array
) -> tuple[float, float]:
    """Return the command after another one, towards a part of the highest speed and yaw rate, within all limits.

    The speed changes by at most the acceleration, the yaw rate by at most the yaw acceleration, with which it falls to what
    the lateral acceleration and the wheels' speed allow; until then the speed gives way. Wheels that would be too fast slow both.
    """
    last, most, most_turn = speed, limits[2] * period, limits[3] * period
    speed += min(max(to_speed * limits[0] - speed, -most), most)
    bound = max(limits[5] - abs(speed), 0.0) / limits[6]
    if abs(speed) * bound > limits[4]:
        bound = limits[4] / abs(speed)
    turn += min(max(min(max(to_turn * limits[1], -bound), bound) - turn, -most_turn), most_turn)
    slow = limits[4] / max(abs(turn), 1e-9)  # the yaw rate falls too slowly for a higher speed
    speed = min(max(min(max(speed, -slow), slow), last - most), last + most)
    share = min(limits[5] / max(abs(speed) + abs(turn) * limits[6], 1e-9), 1.0)
    return speed * share, turn * share


@kernel
def move(i: int, shared: SharedSpec, robots: Robots, maps: Maps) -> int:
    """Move a robot for one control period, and return its ending: the first contact."""
    state, limits, noise = robots.state[i], shared.limits, robots.noise[i]
    period, half_track = 1.0 / shared.rates[2], limits[6]
    speed, turn = state[TO_SPEED], state[TO_TURN]
    if robots.timing[i, 0] > 0:
        slot = robots.tick[i] % robots.timing[i, 0]
        late_speed, late_turn = robots.pending[i, slot, 0], robots.pending[i, slot, 1]
        robots.pending[i, slot, 0], robots.pending[i, slot, 1] = speed, turn
        speed, turn = late_speed, late_turn
    if noise[3] > 0.0:
        keep = math.exp(-period / SLIP_TIME)
        fresh = noise[3] * math.sqrt(1.0 - keep * keep)
        state[SLIP] = keep * state[SLIP] + fresh * normal(i, robots.random)
        state[SLIP + 1] = keep * state[SLIP + 1] + fresh * normal(i, robots.random)
        left = (speed - turn * half_track) * (1.0 + state[SLIP])
        right = (speed + turn * half_track) * (1.0 + state[SLIP + 1])
        speed, turn = (left + right) / 2.0, (right - left) / (2.0 * half_track)
    radius, parts = outer_radius(shared.shape[0], shared.shape[1], shared.shape[2], shared.corners), shared.rates[1]
    step = period / parts
    before, fastest = abs(state[SPEED]) + radius * abs(state[TURN]), abs(speed) + radius * abs(turn)
    state[SPEED], state[TURN] = speed, turn
    for k in range(parts):
        middle = state[YAW] + turn * step / 2.0
        state[X] += speed * math.cos(middle) * step
        state[Y] += speed * math.sin(middle) * step
        state[YAW] += turn * step
        state[FREE] -= fastest * step
        if state[FREE] <= TOUCHING:
            state[FREE] = static_gap(i, shared, robots, maps)
            if state[FREE] <= TOUCHING:
                return COLLIDED
        ending = hit(i, (k + 1.0) / parts, before if k == 0 else fastest, shared, robots, maps)
        if ending != DRIVING:
            return ending
    return DRIVING


@kernel
def static_gap(i: int, shared: SharedSpec, robots: Robots, maps: Maps) -> float:
    """Return the exact distance from a robot's footprint to the nearest cylinder or wall."""
    state, world = robots.state[i], robots.world[i]
    row = maps.rows[world]
    discs = maps.discs[row[0] : row[0] + 3 * row[1]].reshape((row[1], 3))
    shape = shared.shape
    return footprint_gap(
        state[X], state[Y], state[YAW], shape[0], shape[1], shape[2], shared.corners, discs, maps.bounds[world]
    )


@leaf
def hit(i: int, share: float, fastest: float, shared: SharedSpec, robots: Robots, maps: Maps) -> int:
    """Return the ending of a robot that touches a mover at a part of the control period, by the rule of log/contacts.py."""
    row, state = maps.rows[robots.world[i]], robots.state[i]
    for m in range(row[5]):
        x, y, pace, jumped = mover_at(i, m, share, robots, maps, shared.rates[2])
        if mover_gap(x, y, abs(maps.radii[row[4] + m]), state, shared) <= TOUCHING:
            if jumped:
                return HIT_BY_TELEPORT
            return HIT_WHILE_STANDING if fastest <= min(STANDING_SPEED, pace) else COLLIDED
    return DRIVING


@leaf
def mover_at(i: int, m: int, share: float, robots: Robots, maps: Maps, hz: int) -> tuple[float, float, float, bool]:
    """Return a mover's position at a part of the control period, its speed, and whether it jumps in the period."""
    row = maps.rows[robots.world[i]]
    at = row[6] + 2 * (row[5] * robots.tick[i] + m)
    after = at + 2 * row[5]
    x, y = maps.tracks[at], maps.tracks[at + 1]
    dx, dy = maps.tracks[after] - x, maps.tracks[after + 1] - y
    pace = math.hypot(dx, dy) * hz
    if pace > LEAP:
        return x + dx, y + dy, 0.0, True
    return x + share * dx, y + share * dy, pace, False


@leaf
def mover_gap(x: float, y: float, radius: float, state: Array, shared: SharedSpec) -> float:
    """Return the distance from a robot's footprint to a mover."""
    dx, dy = x - state[X], y - state[Y]
    cos, sin = math.cos(state[YAW]), math.sin(state[YAW])
    return disc_gap(dx, dy, radius, cos, sin, shared.shape[0], shared.shape[1], shared.shape[2], shared.corners)


@leaf
def measure(i: int, shared: SharedSpec, robots: Robots) -> None:
    """Estimate a robot's pose by odometry and fixes, as `antdrive.robots.noise` does; without noise it is exact."""
    state, noise, period, half_track = robots.state[i], robots.noise[i], 1.0 / shared.rates[2], shared.limits[6]
    if not (noise[0] > 0.0 or noise[1] > 0.0 or noise[2] > 0.0 or noise[3] > 0.0):
        for k in range(3):
            state[BELIEVED + k] = state[X + k]
        state[MEASURED], state[MEASURED + 1] = state[SPEED], state[TURN]
        return
    rim = state[TURN] * half_track
    left = (state[SPEED] - rim) / (1.0 + state[SLIP]) * (1.0 + noise[2] * normal(i, robots.random))
    right = (state[SPEED] + rim) / (1.0 + state[SLIP + 1]) * (1.0 + noise[2] * normal(i, robots.random))
    speed, turn = (left + right) / 2.0, (right - left) / (2.0 * half_track)
    state[MEASURED], state[MEASURED + 1] = speed, turn
    fix_x = state[X] + noise[0] * normal(i, robots.random)
    fix_y = state[Y] + noise[0] * normal(i, robots.random)
    fix_yaw = state[YAW] + noise[1] * normal(i, robots.random)
    x, y, yaw = state[BELIEVED], state[BELIEVED + 1], state[BELIEVED + 2]
    if robots.tick[i] > 0:
        x, y, yaw = moved(x, y, yaw, speed, turn, period)
    if robots.tick[i] % robots.timing[i, 1] == 0:
        x, y = x + noise[4] * (fix_x - x), y + noise[4] * (fix_y - y)
        turned = fix_yaw - yaw
        yaw += noise[5] * (turned - 2.0 * math.pi * math.floor(turned / (2.0 * math.pi) + 0.5))
    state[BELIEVED], state[BELIEVED + 1], state[BELIEVED + 2] = x, y, yaw


@inline
def moved(x: float, y: float, yaw: float, speed: float, turn: float, time: float) -> tuple[float, float, float]:
    """Return a pose after driving with a twist for a time."""
    middle = yaw + turn * time / 2.0
    return x + speed * math.cos(middle) * time, y + speed * math.sin(middle) * time, yaw + turn * time


@leaf
def note(i: int, shared: SharedSpec, robots: Robots, maps: Maps) -> None:
    """Write a robot's true distances from all surfaces and from its goal."""
    state, row = robots.state[i], maps.rows[robots.world[i]]
    state[FREE] = clearance = static_gap(i, shared, robots, maps)
    for m in range(row[5]):
        x, y, _, _ = mover_at(i, m, 0.0, robots, maps, shared.rates[2])
        clearance = min(clearance, mover_gap(x, y, abs(maps.radii[row[4] + m]), state, shared))
    robots.facts[i, CLEARANCE] = clearance
    robots.facts[i, DISTANCE] = math.hypot(robots.goal[i, 0] - state[X], robots.goal[i, 1] - state[Y])


@kernel
def look(i: int, shared: SharedSpec, robots: Robots, maps: Maps) -> None:
    """Write what a robot observes, and what is true."""
    note(i, shared, robots, maps)
    state, world, seen = robots.state[i], robots.world[i], robots.seen[i]
    row, count = maps.rows[world], shared.beams.shape[1]
    movers = np.empty((3, row[5]))
    shown = 0
    for m in range(row[5]):
        if maps.radii[row[4] + m] > 0.0:
            x, y, _, _ = mover_at(i, m, 0.0, robots, maps, shared.rates[2])
            movers[0, shown], movers[1, shown], movers[2, shown] = x, y, maps.radii[row[4] + m]
            shown += 1
    noise, out = np.zeros(count), np.empty(count)
    if robots.noise[i, 6] > 0.0 and shared.ranges[3] > 0.0:
        for k in range(count):
            noise[k] = robots.noise[i, 6] * normal(i, robots.random)
    cos, sin, lidar = math.cos(state[YAW]), math.sin(state[YAW]), shared.lidar
    eye_x, eye_y = state[X] + cos * lidar[0] - sin * lidar[1], state[Y] + sin * lidar[0] + cos * lidar[1]
    visible = maps.visible[row[2] : row[2] + 3 * row[3]].reshape((3, row[3]))
    scan(
        eye_x, eye_y, state[YAW] + lidar[2], shared.beams, lidar[4], lidar[3], shared.ranges, visible,
        np.ascontiguousarray(movers[:, :shown]), maps.bounds[world], noise, out,
    )  # fmt: skip
    for k in range(count):
        seen[k] = min(max(out[k] / shared.ranges[1], 0.0), 1.0)
    see(i, shared, robots)
    for k in range(COLUMNS - 1):
        robots.digest[i] = next_random(robots.digest[i] ^ robots.bits[i, k])


@leaf
def see(i: int, shared: SharedSpec, robots: Robots) -> None:
    """Write a robot's observation beside the scan: the goal from where its next command takes effect, and its twist."""
    state, seen, count, limits = robots.state[i], robots.seen[i], shared.beams.shape[1], shared.limits
    x, y, yaw = state[BELIEVED], state[BELIEVED + 1], state[BELIEVED + 2]
    delay = robots.timing[i, 0]
    for k in range(delay):
        slot = (robots.tick[i] + k) % delay
        x, y, yaw = moved(x, y, yaw, robots.pending[i, slot, 0], robots.pending[i, slot, 1], 1.0 / shared.rates[2])
    away_x, away_y = robots.goal[i, 0] - x, robots.goal[i, 1] - y
    bearing = math.atan2(away_y, away_x) - yaw
    seen[count] = min(math.hypot(away_x, away_y) / FARTHEST, 1.0)
    seen[count + 1], seen[count + 2] = math.cos(bearing), math.sin(bearing)
    seen[count + 3] = min(max(state[MEASURED] / limits[0], -1.0), 1.0)
    seen[count + 4] = min(max(state[MEASURED + 1] / limits[1], -1.0), 1.0)


@leaf
def normal(i: int, random: Array) -> float:
    """Return a standard normal number of a robot's stream, by the rule of Box and Muller."""
    first = next_random(random[i])
    second = next_random(first)
    random[i] = second
    radius = math.sqrt(-2.0 * math.log(((first >> np.uint64(11)) + 0.5) * PER_BIT))
    return float(radius * math.cos(2.0 * math.pi * ((second >> np.uint64(11)) * PER_BIT)))
