"""Under the stopping constraint a robot touches no static obstacle, whatever the command: exact kinematics and scans."""

import math
from dataclasses import replace
from types import SimpleNamespace

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

from antdrive.robots import Footprint, Lidar, PursuitState, Twist, footprint_clearance, load_robot
from antdrive.robots.control.observation import FirstSight
from antdrive.sim.driving.parts import SIGHT_LIMIT, Step
from antdrive.sim.driving.stopping_constraint import StoppingConstraint
from antdrive.sim.driving.survey import Survey
from antdrive.sim.sensing import Scanner
from antdrive.worlds import Disc, World
from tests.records import changed

EYE = Lidar(beams=360, field_of_view=2 * math.pi, min_range=0.05, max_range=3.0, rate=20.0)
SHAPES = {
    "a disc": Footprint.disc(0.2),
    "a rectangle": Footprint.rectangle(0.5, 0.4),
    "a rectangle off the axle": Footprint.rectangle(0.5, 0.4, (0.08, -0.03)),
    "a disc off the axle": Footprint.disc(0.2, (-0.05, 0.02)),
    "a polygon": Footprint.polygon([(0.35, 0.02), (0.1, 0.2), (-0.2, 0.15), (-0.25, -0.15), (0.1, -0.17)]),
}


def robot_of(shape, lidar=EYE):
    return replace(load_robot("turtlebot"), footprint=SHAPES[shape], lidar=lidar)


def after(pose, twist, period):
    """The pose at the end of a control period in which a twist was kept exactly."""
    x, y, yaw = pose
    turn = twist.yaw_rate * period
    chord = twist.speed * period * (math.sin(turn / 2) / (turn / 2) if abs(turn) > 1e-9 else 1.0)
    return x + chord * math.cos(yaw + turn / 2), y + chord * math.sin(yaw + turn / 2), yaw + turn


def driven(robot, world, start, wanted, hz, held, *, told=None):
    """Poses of a robot that is commanded each twist for some periods, within its acceleration and the stopping constraint.

    `told` is the world of which it is told what stands around its start, by default the true one.
    """
    scanner = Scanner.of(robot.lidar, world)
    survey = Survey(robot, start, (start[0] + 2.0, start[1]), hz, FirstSight(told or world, scanner.scan(start)))
    caution = StoppingConstraint(survey, robot, hz, 1 / hz + 1 / robot.lidar.rate, lambda *noted: None)
    most, sharpest = robot.max_acceleration / hz, robot.max_yaw_acceleration / hz
    pose, last, poses = start, Twist(0.0, 0.0), []
    for tick in range(len(wanted) * held):
        want = wanted[tick // held]
        if tick and robot.lidar.due(tick, hz):
            survey.read(tick, pose, scanner.scan(pose))
        speed = min(max(want.speed, last.speed - most), last.speed + most)
        rate = min(max(want.yaw_rate, last.yaw_rate - sharpest), last.yaw_rate + sharpest)
        last = caution.limit(pose, last, Twist(speed, rate))[0]
        pose = after(pose, last, 1 / hz)
        poses.append(pose)
    return np.array(poses)


def limited(last, command, free):
    """What becomes of a command where `free` metres or radians are observed as free, with 0.1 s to react."""
    survey = SimpleNamespace(clear_way=lambda *_: free)
    return StoppingConstraint(survey, ROBOT, 20, 0.1, lambda *noted: None).limit((0.0, 0.0, 0.0), last, command)


def stopping_distance(speed, braking):
    """The distance, or the angle, of a robot that reacts for 0.1 s and then brakes, with 1 cm or 0.01 rad to spare."""
    return 0.1 * speed + speed**2 / (2 * braking) + 0.01


ROBOT = replace(load_robot("turtlebot"), max_acceleration=1.0, max_yaw_acceleration=8.0)
ARCS = {
    "ahead": (Twist(0.6, 0.0), 0.6, 1.0), "back": (Twist(-0.6, 0.0), 0.6, 1.0), "arc": (Twist(0.6, 0.3), 0.6, 1.0),
    "turn": (Twist(0.0, 2.0), 2.0, 8.0), "turn right": (Twist(0.0, -2.0), 2.0, 8.0),
}  # fmt: skip


@pytest.mark.parametrize("arc", ARCS)
def test_a_command_passes_only_if_the_whole_stopping_distance_is_free(arc):
    command, speed, braking = ARCS[arc]
    whole, still = stopping_distance(speed, braking), Twist(0.0, 0.0)
    assert limited(still, command, whole) == (command, False)
    for share in (0.99, 0.91, 0.5, 0.1):
        slower, slowed = limited(still, command, share * (whole - 0.01) + 0.01)
        factor = max(map(abs, slower)) / max(map(abs, command))
        assert slowed
        assert slower == pytest.approx((command.speed * factor, command.yaw_rate * factor))
        assert stopping_distance(factor * speed, braking) == pytest.approx(share * (whole - 0.01) + 0.01)
    assert limited(still, command, 0.0) == (still, True)


@pytest.mark.parametrize(
    ("left", "slowed", "stands"),
    [
        ((0.0, 0.0), True, True), ((0.0199, -0.0199), True, True), ((0.02, 0.0), True, False), ((0.0, -0.02), True, False),
        ((0.3, 0.0), True, False), ((0.01, 0.0), False, False),
    ],
)  # fmt: skip
def test_a_command_that_the_constraint_stops_is_noted(left, slowed, stands):
    noted, wanted = [], Step(Twist(0.3, 0.1), PursuitState())
    caution = StoppingConstraint(None, ROBOT, 20, 0.1, lambda *note: noted.append(note))
    caution.limit = lambda pose, last, command: (Twist(*left), slowed)
    found = caution.apply(SimpleNamespace(observed=SimpleNamespace(t=0.7), pose=(0.0, 0.0, 0.0), before=wanted), wanted)
    assert [note[:2] for note in noted] == [(0.7, wanted.command if stands else None)]
    assert found == (Step(Twist(*left), PursuitState(limiter=SIGHT_LIMIT)) if slowed else wanted)


@pytest.mark.parametrize("marks", [{}, {"avoids": True}, {"waits": True}])
@pytest.mark.parametrize("command", [Twist(0.0, 0.0), Twist(0.3, 0.1)])
def test_only_a_robot_that_its_controller_stops_is_idle(command, marks):
    noted = []
    caution = StoppingConstraint(None, ROBOT, 20, 0.1, lambda *note: noted.append(note))
    caution.limit = lambda pose, last, command: (command, False)
    caution.apply(
        SimpleNamespace(observed=SimpleNamespace(t=0.7), pose=(0.0, 0.0, 0.0), before=Step()),
        Step(command, PursuitState(), **marks),
    )
    assert noted == [(0.7, None, command == Twist(0.0, 0.0) and not marks)]


@pytest.mark.parametrize("arc", ARCS)
def test_a_robot_brakes_as_hard_as_it_can_only_where_it_must(arc):
    """In a period of 0.05 s it can lose 0.05 m/s, or 0.4 rad/s; the yaw rate of an arc falls with its speed."""
    command, speed, braking = ARCS[arc]
    hardest = 1 - 0.05 * braking / speed
    kept = Twist(command.speed * hardest, command.yaw_rate * hardest)
    for share, gentle in ((0.99, True), (1.01 * hardest, True), (0.99 * hardest, False), (0.0, False)):
        found, slowed = limited(command, command, stopping_distance(share * speed, braking) if share else 0.0)
        assert slowed
        expected = (command.speed * share, command.yaw_rate * share) if gentle else kept
        assert found == pytest.approx(expected), share


@pytest.mark.parametrize("hz", [20, 240])
@pytest.mark.parametrize("speed", [0.015, 0.04, -0.015])
def test_a_robot_that_creeps_stops_before_what_it_has_seen(speed, hz):
    """At 240 Hz the robot gains less than 5 mm/s in a control period."""
    robot, away = robot_of("a disc"), math.copysign(0.2 + 0.2 + 0.08, speed)
    world = World("post", (0.0, 0.0, 4.0, 4.0), (Disc(2.0 + away, 2.0, 0.2),))
    poses = driven(robot, world, (2.0, 2.0, 0.0), [Twist(speed, 0.0)], hz, held=10 * hz)
    left = footprint_clearance(world, robot.footprint, poses)[-1]
    assert 0.01 < left < 0.04  # it came near, and stopped


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_every_footprint_stops_before_a_post(shape):
    robot = robot_of(shape)
    world = World("post", (0.0, 0.0, 6.0, 4.0), (Disc(3.5, 2.1, 0.05),))
    poses = driven(robot, world, (1.0, 2.0, 0.0), [Twist(0.6, 0.0)], hz=20, held=160)
    left = footprint_clearance(world, robot.footprint, poses)
    assert left.min() > 0.01
    assert left[-1] < 0.05
    assert 2.5 < poses[-1, 0] < 3.5


FORWARD = replace(EYE, field_of_view=4.2, beams=240, rate=10.0)
QUICK = replace(EYE, rate=60.0)  # every fifth of its scans is entered as a whole
speeds = st.one_of(st.sampled_from([0.0, 0.01, -0.01, 0.8, -0.8]), st.floats(-0.8, 0.8))
rates = st.one_of(st.sampled_from([0.0, 2.5, -2.5]), st.floats(-2.5, 2.5))
posts = st.lists(st.tuples(st.floats(0.0, 1.2), st.floats(-math.pi, math.pi), st.floats(0.03, 0.4)), max_size=5)
ROOM = 0.012  # the robot has so much around it at the start: what it keeps from what it has seen, and 2 mm [m]


def beside(robot, pose, away, angle, size):
    """A post in a direction from a robot, farther by `away` than where it would just leave ROOM."""
    for step in range(200):
        far = size + 0.01 * step + away
        disc = Disc(pose[0] + far * math.cos(angle), pose[1] + far * math.sin(angle), size)
        near = Disc(disc.x - away * math.cos(angle), disc.y - away * math.sin(angle), size)
        around = World("one", (-9.0, -9.0, 9.0, 9.0), (near,))
        if footprint_clearance(around, robot.footprint, [pose])[0] > ROOM:
            return disc
    raise AssertionError("no room within 2 m")


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_obstacles_in_the_circle_of_the_first_turn_are_given(turn):
    """A post behind a rectangle, in the blind sector."""
    robot, start = robot_of("a rectangle", FORWARD), (2.0, 2.0, 0.0)
    world = World("post", (0.0, 0.0, 4.0, 4.0), (Disc(1.7, 2.0, 0.02),))
    wanted = [Twist(0.0, turn)]
    poses = driven(robot, world, start, wanted, hz=20, held=80)
    assert footprint_clearance(world, robot.footprint, poses).min() > 0
    assert abs(poses[-1, 2]) > 0.1
    untold = driven(robot, world, start, wanted, hz=20, held=80, told=World("nothing", world.bounds))
    assert footprint_clearance(world, robot.footprint, untold).min() < 0


@hypothesis.settings(max_examples=60)
@hypothesis.given(
    st.sampled_from(sorted(SHAPES)),
    st.sampled_from([EYE, FORWARD, QUICK]),
    posts,
    st.floats(-math.pi, math.pi),
    st.lists(st.builds(Twist, speeds, rates), min_size=1, max_size=12),
    st.sampled_from([(10, 8), (20, 16), (60, 40), (240, 120)]),
)
def test_nothing_that_stands_is_touched_whatever_is_commanded(shape, lidar, posts, yaw, wanted, rate):
    """Posts stand anywhere, including the blind sector, in a narrow room."""
    robot, (hz, held), start = robot_of(shape, lidar), rate, (1.8, 1.8, yaw)
    discs = tuple(beside(robot, start, *post) for post in posts)
    world = World("any", (0.0, 0.0, 3.6, 3.6), discs)
    poses = driven(robot, world, start, wanted, hz, held)
    assert footprint_clearance(world, robot.footprint, poses).min() > 0


@pytest.mark.parametrize("beside", [0.275, None])
def test_a_robot_that_resets_its_map_turns_over_no_known_post(beside):
    """Posts within the circle of the turn, beside a rectangle whose lidar looks ahead only and last saw them long ago."""
    jackal = load_robot("jackal")
    robot = changed(jackal, "lidar", field_of_view=math.pi)
    posts = tuple(Disc(2.88, 2.0 + side * beside, 0.03) for side in (-1, 1)) if beside else ()
    world, start, here = World("gate", (0.0, 0.0, 8.0, 4.0), posts), (1.5, 2.0, 0.0), (3.0, 2.0, 0.0)
    scanner = Scanner.of(robot.lidar, world)
    survey = Survey(robot, start, (7.0, 2.0), 50, FirstSight(world, scanner.scan(start)))
    for tick in range(1, 210):
        x = min(3.0, 1.5 + 0.01 * tick)
        if robot.lidar.due(tick, 50):
            survey.read(tick, (x, 2.0, 0.0), scanner.scan((x, 2.0, 0.0)))
    known = survey.clear_way(here, 0.0, 1.0, math.pi)
    survey.reset(here)
    turn = survey.clear_way(here, 0.0, 1.0, math.pi)
    if beside is None:
        assert turn == known == math.pi
        return
    assert turn <= known
    angles = np.linspace(0.0, math.pi, 400)
    gaps = footprint_clearance(world, robot.footprint, [(3.0, 2.0, angle) for angle in angles])
    assert gaps[angles <= turn].min() > 0
    assert gaps.min() < 0  # a whole turn would touch a post
