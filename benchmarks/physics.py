"""Accuracy of commands and contacts in physics: `python -m benchmarks.physics`.

Steady turns, straight stops and passes beside a cylinder, at several rates and with both robots of the README. The same
drive without the cylinder gives, in closed form, whether the robot should touch it, and by how much.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from antdrive import Disc, RobotSpec, World, load_robot
from antdrive.base.types import Pose
from antdrive.robots.clearance import footprint_clearance
from antdrive.sim import Engine
from benchmarks.markdown import command_line

ROBOTS = ("turtlebot", "jackal")
RATES = (60, 120, 240, 1000)  # physics steps per second
SMALLEST = ("--rates 1",)
DEPTHS = (-20.0, -10.0, -5.0, -2.0, -1.0, 1.0, 2.0, 5.0, 10.0, 20.0)  # clearance of a pass [mm]
OPEN = World("open", (-50, -50, 50, 50))


class Turn(NamedTuple):
    """How far a steady turn is from its command: forward [mm/s], yaw rate [mrad/s], both as shares, and sideways [mm/s]."""

    speed: float
    yaw_rate: float
    speed_share: float
    yaw_share: float
    sideways: float


def speed_up(engine: Engine, robot: RobotSpec, speed: float, yaw_rate: float) -> None:
    """Bring a robot at rest to a twist within its limits."""
    seconds = max(speed / robot.max_acceleration, abs(yaw_rate) / robot.max_yaw_acceleration)
    steps = math.ceil(1.2 * seconds * engine.physics_hz)
    for k in range(1, steps + 1):
        engine.command(speed * k / steps, yaw_rate * k / steps)
        engine.step()


def worst_turn(robot: RobotSpec, hz: int) -> Turn:
    """Return the worst of nine turns within the robot's limits, each held for two seconds; means over the second one."""
    worst = Turn(0, 0, 0, 0, 0)
    for forward, share in itertools.product((0.25, 0.5, 1.0), (0.0, 0.5, 1.0)):
        speed = forward * robot.max_speed
        yaw_rate = share * min(robot.max_yaw_rate, robot.max_lateral_acceleration / speed)
        with Engine(OPEN, robot, physics_hz=hz) as engine:
            engine.place((0.0, 0.0, 0.0))
            speed_up(engine, robot, speed, yaw_rate)
            rows = []
            for k in range(2 * hz):
                before = engine.state()
                engine.step()
                after = engine.state()
                if k >= hz:
                    across = -(after.x - before.x) * math.sin(before.yaw) + (after.y - before.y) * math.cos(before.yaw)
                    rows.append((after.speed, after.yaw_rate, across * hz))
        v, w, aside = np.mean(rows, axis=0)
        off, turn = abs(v - speed), abs(w - yaw_rate)
        found = Turn(1e3 * off, 1e3 * turn, off / speed, turn / yaw_rate if yaw_rate else 0.0, 1e3 * abs(aside))
        worst = Turn(*map(max, worst, found))
    return worst


def stop(robot: RobotSpec, hz: int, *, at_once: bool) -> tuple[float, float]:
    """Return the stopping distance from top speed, and that of the deceleration in the robot's file [m].

    Args:
        robot: the robot
        hz: physics steps per second
        at_once: whether zero is commanded at once, or as the file's deceleration allows
    """
    with Engine(OPEN, robot, physics_hz=hz) as engine:
        engine.place((0.0, 0.0, 0.0))
        speed_up(engine, robot, robot.max_speed, 0.0)
        begin, v = engine.state().x, engine.state().speed
        first = v
        while engine.state().speed > 1e-3:
            v = 0.0 if at_once else max(0.0, v - robot.max_acceleration / hz)
            engine.command(v, 0.0)
            engine.step()
        return engine.state().x - begin, first**2 / (2 * robot.max_acceleration)


def drive_on(robot: RobotSpec, hz: int, speed: float) -> list[Pose]:
    """Return the poses of a straight, free drive."""
    poses = []
    with Engine(OPEN, robot, physics_hz=hz) as engine:
        engine.place((0.0, 0.0, 0.0))
        speed_up(engine, robot, speed, 0.0)
        for _ in range(math.ceil(5.0 / speed * hz)):
            engine.step()
            poses.append(engine.state().pose)
    return poses


class Pass(NamedTuple):
    """A straight pass beside a cylinder: whether physics felt a contact, and how deep the robot is in it if nothing stops it.

    Attributes:
        felt: whether physics reported a contact
        overlap: the deepest overlap in the closed form, of the poses without the cylinder [mm]; below 0: what stays between them
    """

    felt: bool
    overlap: float

    @property
    def missed(self) -> bool:
        """Whether the closed form has an overlap that physics did not feel."""
        return self.overlap > 0 and not self.felt

    @property
    def false(self) -> bool:
        """Whether physics felt a contact where the closed form has none."""
        return self.overlap <= 0 and self.felt


def drive_past(robot: RobotSpec, hz: int, speed: float, clearance: float, undisturbed: list[Pose]) -> Pass:
    """Drive past a cylinder that a robot on the x axis would pass at `clearance` [m].

    Args:
        robot: the robot
        hz: physics steps per second
        speed: of the pass [m/s]
        clearance: between the cylinder and a robot that is exactly on the x axis [m]
        undisturbed: poses of the same drive without the cylinder
    """
    half = robot.footprint.bounds[3]
    world = World("pass", (-5, -5, 10, 5), (Disc(3.0, half + clearance + 0.3, 0.3),))
    overlap = -1e3 * float(footprint_clearance(world, robot.footprint, undisturbed).min())
    with Engine(world, robot, physics_hz=hz) as engine:
        engine.place((0.0, 0.0, 0.0))
        speed_up(engine, robot, speed, 0.0)
        felt = any(engine.step() for _ in undisturbed)
    return Pass(felt, overlap)


def head_on(robot: RobotSpec, hz: int, speed: float) -> float:
    """How deep the robot is in a cylinder in its way at the first step at which physics reports a contact [mm]."""
    world = World("head-on", (-5, -5, 10, 5), (Disc(3.0, 0.0, 0.3),))
    with Engine(world, robot, physics_hz=hz) as engine:
        engine.place((0.0, 0.0, 0.0))
        speed_up(engine, robot, speed, 0.0)
        while not engine.step():
            pass
        return -1e3 * float(footprint_clearance(world, robot.footprint, [engine.state().pose])[0])


def print_turns(rates: Sequence[int]) -> None:
    """Print how well commands are followed."""
    print("| robot | physics [Hz] | speed | yaw rate | sideways [mm/s] | stop as in the file / v²/2a | zero at once |")
    print("|---|---|---|---|---|---|---|")
    for name, hz in itertools.product(ROBOTS, rates):
        robot = load_robot(name)
        turn, (way, ideal), (hard, _) = (
            worst_turn(robot, hz),
            stop(robot, hz, at_once=False),
            stop(robot, hz, at_once=True),
        )
        print(
            f"| `{name}` | {hz} | {turn.speed:.2f} mm/s, {turn.speed_share:.3%} | {turn.yaw_rate:.2f} mrad/s, "
            f"{turn.yaw_share:.3%} | {turn.sideways:.2f} | {way:.3f} / {ideal:.3f} m | {hard:.3f} m |"
        )


def print_passes(rates: Sequence[int]) -> None:
    """Print what physics feels of passes, beside what the closed form says of them."""
    print(
        "| robot | physics [Hz] | passes | overlap, not felt | felt without overlap | deepest overlap when felt [mm] |"
    )
    print("|---|---|---|---|---|---|")
    for name, hz in itertools.product(ROBOTS, rates):
        robot = load_robot(name)
        missed = false = count = 0
        for share in (0.25, 0.5, 1.0):
            speed = share * robot.max_speed
            undisturbed = drive_on(robot, hz, speed)
            for depth in DEPTHS:
                found = drive_past(robot, hz, speed, depth / 1e3, undisturbed)
                count += 1
                missed += found.missed
                false += found.false
        deepest = max(head_on(robot, hz, share * robot.max_speed) for share in (0.25, 0.5, 1.0))
        print(f"| `{name}` | {hz} | {count} | {missed} | {false} | {deepest:.1f} |")


def main() -> None:
    rates = RATES[: command_line(__doc__, rates=(len(RATES), "how many of the rates of physics, lowest first")).rates]
    print_turns(rates)
    print()
    print_passes(rates)


if __name__ == "__main__":
    main()
