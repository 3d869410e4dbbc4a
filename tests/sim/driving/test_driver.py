"""The parts of a control period, without physics; and the ends of a drive."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base import FieldError
from antdrive.planners import Query, load_planner, smooth
from antdrive.robots import LIMITERS, Avoidance, AvoidanceState, Noise, PurePursuit, PursuitState, Twist, load_robot
from antdrive.robots.control.observation import NOBODY, Briefing, Observation
from antdrive.robots.noise import moved_by
from antdrive.sim import Outcome, Perception, Scenario
from antdrive.sim.compose import BLIND_SHARE, compose
from antdrive.sim.driving.blockage import blocked_cells, covered_discs
from antdrive.sim.driving.body import Body
from antdrive.sim.driving.drive import drive, follow
from antdrive.sim.driving.driver import Driver, full_turn
from antdrive.sim.driving.guide import Follow, Guide, Moment, Schedule, Wait
from antdrive.sim.driving.localising import Exact
from antdrive.sim.driving.parts import SIGHT_LIMIT, SILENT, Ending, Note, Step, StuckClock
from antdrive.sim.driving.plants import Bullet, Kinematic
from antdrive.sim.driving.rules import (
    AVOIDING,
    WAITING_SPEED,
    Avoid,
    KeepToSchedule,
    Pursuit,
    TurnToScan,
    braked,
    slow_down,
    stopping_time,
)
from antdrive.sim.driving.senses import NoisySenses, Senses
from antdrive.sim.driving.stopping_constraint import StoppingConstraint
from antdrive.sim.log.ending import STUCK_PROGRESS, STUCK_TIME
from antdrive.sim.physics.engine import Engine
from antdrive.worlds import Cruising, Disc, Keyframed, Task, Trajectories, World, rasterise
from tests.records import changed
from tests.sim.driving.ground_truth import GroundTruth

HALL = World("hall", (0.0, 0.0, 9.0, 6.0), (Disc(4.5, 4.5, 0.5),))
CRUISING = Cruising(radius=0.3, position=(7.0, 1.0), velocity=(0.0, 0.1))
TASK = Task(HALL, (1.0, 3.0, 0.0), (8.0, 3.0), cell=0.25)


def hall_grid(world=HALL):
    return rasterise(world, 0.25, 0.21)


def driver(robot, guide=None, *rules):
    grid = hall_grid()
    plan = load_planner("astar").plan(Query.between(grid, TASK), np.random.default_rng(0))
    controller = PurePursuit()
    tracked = controller.prepare(smooth(plan, grid, TASK), HALL, robot, 0.03, 1 / 60)
    pursuit = Pursuit(controller, full_turn(robot, 60))
    known = Briefing(robot, TASK.start, TASK.goal, TASK.goal_tolerance, 60, HALL)
    made = Driver(known, guide or Guide(), (pursuit, *rules))
    made.way = Follow(tracked)
    return made


def seen(tick=0, pose=TASK.start, speed=0.0):
    """What a robot without errors observes."""
    return Observation(tick, tick / 60, pose, Twist(speed, 0.0), standing=abs(speed) < 0.01)


class Off(Senses):
    """Senses that are off, and noted."""

    def __init__(self, true, believed):
        self.off, self.states = np.subtract(believed, true), []

    def read(self, state):
        self.states.append(state)
        x, y = (state.pose[:2] + self.off).tolist()
        return Twist(0.0, 0.0), (x, y, state.yaw)


def standing(true, believed=None, periods=9):
    """The body of a robot that stands at a true position and believes to be elsewhere."""
    plant = Kinematic((*true, 0.0), 0.0, load_robot("turtlebot"))
    return Body(plant, Off(true, believed or true), Exact(TASK.start, 1 / 60), hz=60, limit=periods / 60, task=TASK)


def at(driving, arc):
    """The same, so far along its route [m]."""
    driving.step = Step(pursuit=PursuitState(arc=arc))
    return driving


@pytest.mark.parametrize(
    ("state", "waiting", "after"),
    [
        ({"arc": 1.0 + 2 * STUCK_PROGRESS}, False, (1.0 + 2 * STUCK_PROGRESS, 0, 0, 0)), ({"arc": 3.0}, False, (3.0, 0, 0, 0)),
        ({"arc": 1.0 + STUCK_PROGRESS / 2}, False, (1.0, 10, 4, 0)), ({"arc": 1.0, "turning": True}, False, (1.0, 9, 5, 0)),
        ({"arc": 1.0}, True, (1.0, 9, 4, 0)), ({"arc": 1.0, "turning": True}, True, (1.0, 9, 4, 0)),
    ],
)  # fmt: skip
def test_the_stuck_clock_counts_driving_and_turning_without_progress_and_no_waiting(state, waiting, after):
    assert StuckClock() == (0.0, 0, 0, 0)
    assert StuckClock(farthest=1.0, driving=9, turning=4).after(PursuitState(**state), waiting=waiting) == after


def test_the_reason_names_the_stopping_constraint_where_it_held_the_robot_for_most_of_the_time():
    """Progress restarts the count; waiting does not count."""
    held, free = PursuitState(limiter=SIGHT_LIMIT), PursuitState()
    for states, said in (
        ([held] * 6 + [free] * 5, True),
        ([held] * 5 + [free] * 5, False),
        ([held] * 5 + [held._replace(turning=True)] * 2 + [free] * 6, True),
        ([held] * 9 + [free._replace(arc=1.0)] + [free._replace(arc=1.0)] * 3, False),
    ):
        clock = StuckClock()
        for state in states:
            clock = clock.after(state, waiting=False)
        assert ("its sight held it" in clock.reason) is said, states
        assert clock.reason.startswith("no progress along the route for 8 s")
        assert clock.after(held, waiting=True) == clock


def test_a_robot_that_does_not_move_is_stuck_after_the_stuck_time(turtlebot):
    still = driver(turtlebot)
    ticks = 0
    while still.act(seen(ticks))[1].ending is None:
        ticks += 1
    assert ticks == pytest.approx(STUCK_TIME * 60, abs=2)


def test_a_schedule_limits_the_speed_to_what_is_due_soon(turtlebot):
    """At 0.5 m/s for 10 s, looking 0.4 s ahead."""
    schedule = Schedule(np.array([0.0, 10.0]), np.array([0.0, 5.0]))
    assert schedule.speed_limit(2.0, 1.0) == pytest.approx(0.5)
    assert schedule.speed_limit(2.0, 0.9) == pytest.approx(0.75)
    assert schedule.speed_limit(2.0, 1.3) == 0.0
    assert [schedule.speed_limit(t, 4.7) < math.inf for t in (9.5, 9.61)] == [True, False]
    assert [schedule.late(4.0, arc) for arc in (1.49, 1.51)] == [True, False]
    slower = slow_down(Twist(0.6, 0.3), Twist(0.6, 0.3), 0.0, 0.12)
    assert slower == pytest.approx((0.48, 0.24))
    rule = KeepToSchedule(replace(turtlebot, max_acceleration=1.2), 60)
    now = SimpleNamespace(tick=120, way=Follow(None, schedule), before=Step(Twist(0.6, 0.0)))
    kept = rule.apply(now, Step(Twist(0.6, 0.3), PursuitState(arc=1.0)))
    assert kept.command == pytest.approx((0.58, 0.29))
    assert (kept.speed_limit, kept.waits) == (pytest.approx(0.5), False)
    assert rule.apply(now, Step(Twist(0.6, 0.3), PursuitState(arc=1.17))).waits


def test_a_robot_brakes_for_a_scan_turn_and_where_it_is_lost(turtlebot):
    goes = Step(Twist(0.5, 0.1), PursuitState())
    braking = braked(goes.command, turtlebot, 60)
    for way, command in (
        (Wait(None, scan_turn=object()), braking),
        (Wait(None), braking),
        (Follow(None), goes.command),
    ):
        now = SimpleNamespace(pose=TASK.start, before=goes, way=way)
        assert TurnToScan(turtlebot, 60).apply(now, goes).command == command


def test_progress_is_a_fraction_of_the_route(turtlebot):
    half, told = driver(turtlebot), []
    half.rules, half.progress = (), told.append
    at(half, half.way.path.length / 2).act(seen())
    assert told == [0.5]


def test_turns_on_the_spot_add_the_time_of_a_full_turn_to_the_stuck_time(turtlebot):
    turning = driver(turtlebot)
    whole = full_turn(turtlebot, 60)
    assert whole == round(2 * math.pi / 3.14 * 60)
    for turned, gives_up in ((STUCK_TIME * 60 + whole - 1, False), (STUCK_TIME * 60 + whole, True)):
        turning._clock = StuckClock(turning=int(turned))
        assert (turning._gives_up() is not None) == gives_up


def test_only_a_robot_that_did_not_get_there_reports_what_its_guide_noted(turtlebot):
    noting = Guide()
    noting.failure_note = "no route at t = {} s".format
    noted = driver(turtlebot, noting)
    for outcome in Outcome:
        note = "; no route at t = 7 s" if outcome in (Outcome.STUCK, Outcome.TIMED_OUT) else ""
        assert noted.with_reason(Ending(outcome, "why"), 7) == Ending(outcome, f"why{note}")


def test_a_mover_beside_the_goal_closes_no_cell_within_the_inflation_of_it():
    """The goal's cell and those around it stay free, wherever in its cell the goal is."""
    for x in (7.9, 8.0, 8.1):
        for y in (3.5, 3.6):
            goal = (x, y - 0.6)
            mover = Keyframed(radius=0.5, keyframes=((0.0, x, y), (9.0, x, y)))
            still = GroundTruth(Trajectories.of(World("w", HALL.bounds, movers=(mover,)), (1.0, 3.0)), Perception(), 60)
            grid = hall_grid()
            discs = covered_discs(still, np.array([(1.0, 3.0), goal]), 0.0, grid)
            assert discs
            assert discs[0].radius == pytest.approx(0.6 - grid.inflate - grid.cell)
            assert not blocked_cells(grid, discs)[grid.cell_at(*goal)]


def test_standing_at_the_routes_end_ends_the_drive_by_the_distance_to_the_goal(turtlebot):
    x, y = TASK.goal
    for distance, outcome in ((0.0, Outcome.SUCCEEDED), (0.3, Outcome.STUCK)):
        at_end = driver(turtlebot)
        at(at_end, at_end.way.path.length)
        ending = drive(standing((x, y - distance), (x, y)), at_end)  # the command comes to rest first
        assert ending.outcome is outcome
        lost = (
            "the robot believed that it was at the goal, 0.00 m from it, but was 0.300 m from it "
            "(the tolerance is 0.25 m): its estimate was wrong by 0.30 m"
        )
        assert ending.reason == ("" if outcome is Outcome.SUCCEEDED else lost)


def test_a_robot_that_knows_where_it_is_is_told_how_far_from_the_goal_its_route_ends(turtlebot):
    x, y = TASK.goal
    for off in (-0.3, 0.4):  # what it believes lies outside the tolerance, too
        body = standing((x, y - 0.3), (x, y + off))
        body.step(None)
        assert body.ended.reason == "the route ends here, 0.300 m from the goal; the tolerance is 0.25 m"


def test_a_robot_that_avoids_a_mover_at_the_goal_stops_there_even_where_sight_holds_its_speed(turtlebot):
    """Local avoidance goes on for ever, and slowly, because the robot sees too little there."""
    calm = SimpleNamespace(
        prediction_times=np.arange(3.0), step=1.0, avoid=lambda *_, **__: (Twist(0.5, 0.0), True, AvoidanceState())
    )
    nobody = GroundTruth(Trajectories.of(HALL, TASK.start[:2]), Perception(), 60)
    sight = StoppingConstraint(None, turtlebot, 60, 0.1, lambda *_: None)
    sight.limit = lambda *_: (Twist(0.005, 0.0), True)
    robot = driver(turtlebot, None, Avoid(calm, nobody, TASK, turtlebot, 60), sight)
    body = standing(TASK.goal)
    assert drive(body, at(robot, robot.way.path.length - 0.5)).outcome is Outcome.SUCCEEDED
    assert robot.step.pursuit.limiter != LIMITERS.index("avoid")
    assert body.tick == 1


def test_a_robot_without_a_map_backs_off_slowly_into_its_blind_sector(jackal, turtlebot, monkeypatch):
    """`jackal` sees 270 degrees, `turtlebot` all round. A robot that is told of movers knows what is behind it."""
    for robot, perception in itertools.product((jackal, turtlebot), (Perception(kind="lidar"), Perception())):
        unknown = Scenario.of(
            changed(TASK, "world", movers=(CRUISING,)), "astar", robot, map="none", perception=perception
        )
        asked = []

        def avoid(*_, backwards, asked=asked, **__):
            asked.append(backwards)
            return Twist(0.0, 0.0), False, AvoidanceState()

        noted = SimpleNamespace(prediction_times=np.arange(3.0), step=1.0, avoid=avoid, min_clearance=0.1)
        monkeypatch.setattr("antdrive.sim.compose.avoidance_of", lambda _, noted=noted: noted)
        rule = next(rule for rule in compose(unknown)[2].rules if type(rule) is Avoid)
        rule._movers.read(seen())
        rule.apply(Moment(seen(), driver(robot).way, Step(), StuckClock()), Step())
        slow = robot is jackal and perception.kind == "lidar"
        assert asked == [BLIND_SHARE * robot.max_speed if slow else math.inf]


class OneReplan(Guide):
    """A guide that replans once, back along the path that it is given."""

    way = None

    def path(self, now, *, at_end=False):
        return self.way if now.tick == 1 else now.way


def test_a_replan_starts_its_route_from_the_beginning(turtlebot):
    monitor = OneReplan()
    robot = driver(turtlebot, monitor)
    monitor.way = driver(turtlebot).way
    robot.act(seen(0, (3.0, 3.0, 0.0), 0.5))
    old = robot.way
    assert robot.step.pursuit.arc > 0
    robot.act(seen(1, speed=0.5))
    assert robot.way is monitor.way is not old
    assert robot.step.pursuit.arc == pytest.approx(0.0, abs=0.02)


def test_the_first_command_accelerates_within_the_robots_limit(turtlebot):
    first = driver(turtlebot)
    command, _ = first.act(seen())
    assert 0 < command.speed <= turtlebot.max_acceleration / 60 + 1e-12


@given(st.lists(st.tuples(st.floats(0.5, 8.5), st.floats(0.5, 5.5), st.floats(0.05, 1.0)), max_size=5))
def test_discs_block_the_cells_that_the_same_obstacles_would(discs):
    """The oracle rasterises a world with the discs as obstacles; cells on a disc's very edge may differ."""
    found = [Disc(*disc) for disc in discs]
    grid = hall_grid()
    blocked = blocked_cells(grid, found)
    oracle = grid.free & ~hall_grid(World("hall", HALL.bounds, (*HALL.obstacles, *found))).free
    rows, cols = np.nonzero(blocked != oracle)
    for x, y in grid.xy(np.stack([rows, cols], axis=1)):
        assert min(abs(math.dist((x, y), (d.x, d.y)) - d.radius - grid.inflate) for d in found) < 1e-9


def test_movers_close_neither_the_robots_position_nor_the_goal():
    over_goal = Keyframed(radius=0.6, keyframes=((0.0, 8.0, 3.2), (9.0, 8.0, 3.2001)))
    crossing = Cruising(radius=0.3, position=(4.0, 1.0), velocity=(0.0, 0.5))
    world = World("hall", HALL.bounds, HALL.obstacles, movers=(over_goal, crossing))
    predictor = GroundTruth(Trajectories.of(world, TASK.start[:2]), Perception(), 60)
    grid = hall_grid()
    ends = np.array([TASK.start[:2], TASK.goal])
    discs = covered_discs(predictor, ends, 1.0, grid)
    blocked = blocked_cells(grid, discs)
    for end in ends:
        assert not blocked[grid.cell_at(*end)]
    assert [disc.y for disc in discs if disc.radius == 0.3] == pytest.approx([1.0, 1.125, 1.25, 1.375, 1.5])


@given(speed=st.floats(-2.0, 2.0), yaw_rate=st.floats(-4.0, 4.0))
def test_a_robot_that_brakes_for_the_goal_slows_its_turn_no_faster_than_it_can(speed, yaw_rate):
    jackal, last = load_robot("jackal"), Twist(speed, yaw_rate)
    slower = braked(last, jackal, 60)
    assert abs(last.speed - slower.speed) <= jackal.max_acceleration / 60 + 1e-12
    assert abs(last.yaw_rate - slower.yaw_rate) <= jackal.max_yaw_acceleration / 60 + 1e-12
    assert abs(slower.yaw_rate) <= abs(last.yaw_rate)
    gentle = abs(yaw_rate) * jackal.max_acceleration <= abs(speed) * jackal.max_yaw_acceleration
    if gentle and speed:
        assert slower.yaw_rate * last.speed == pytest.approx(last.yaw_rate * slower.speed, abs=1e-9), "the same curve"


@pytest.mark.parametrize(
    ("before", "speed", "stops"),
    [
        (0.237, 0.0, True), (0.238, 0.0, False), (-0.238, 0.0, False), (0.23, 0.6, True), (0.05, 0.7, True), (0.0, 0.7, False),
        (0.3, 0.6, False), (-0.1, -0.5, True), (0.12, -0.5, False),
    ],
)  # fmt: skip
def test_a_robot_that_brakes_stops_at_the_goal_if_both_ends_of_its_way_are_there(turtlebot, before, speed, stops):
    """It counts as there within 95 % of 0.25 m, and goes on by 0.18 m at 0.6 m/s, 0.245 m at 0.7 m/s, 0.125 m at 0.5 m/s."""
    x, y = TASK.goal
    assert TASK.goal_tolerance == 0.25
    for yaw, pose in ((0.0, (x - before, y, 0.0)), (np.pi / 2, (x, y - before, np.pi / 2))):
        nobody = GroundTruth(Trajectories.of(HALL, TASK.start[:2]), Perception(), 60)
        rule = Avoid(Avoidance(), nobody, TASK, turtlebot, 60)
        assert rule._stops_at_goal(pose, Twist(speed, 0.0)) is stops, yaw


def test_braking_keeps_the_curve_as_far_as_the_turn_can_be_slowed(turtlebot):
    assert braked(Twist(0.5, 1.0), turtlebot, 60) == pytest.approx((0.5 - 1 / 60, (0.5 - 1 / 60) / 0.5))
    assert braked(Twist(-0.5, 1.0), turtlebot, 60) == pytest.approx((-0.5 + 1 / 60, (0.5 - 1 / 60) / 0.5))
    slower = 1.0 - turtlebot.max_yaw_acceleration / 60  # the wheels cannot stop the turn at once
    assert braked(Twist(0.01, 1.0), turtlebot, 60) == pytest.approx((0.0, slower))
    assert braked(Twist(0.0, -1.0), turtlebot, 60) == pytest.approx((0.0, -slower))
    assert braked(Twist(0.0, 0.01), turtlebot, 60) == (0.0, 0.0)


def test_stopping_takes_as_long_as_the_slower_of_speed_and_turn(turtlebot):
    assert stopping_time(Twist(-0.5, 1.0), turtlebot) == 0.5
    assert stopping_time(Twist(0.1, -2.0), turtlebot) == 0.25


def test_a_robot_that_gives_way_is_not_stuck(turtlebot):
    none = np.empty((0, 2))
    nobody = SimpleNamespace(predict=lambda *_: np.stack([none, none]), near=NOBODY)
    cautious = SimpleNamespace(
        prediction_times=np.array([0.0, 0.1]),
        step=0.1,
        avoid=lambda *_, **__: (Twist(0.0, 0.0), True, AvoidanceState()),
    )
    waits = driver(turtlebot, None, Avoid(cautious, nobody, TASK, turtlebot, 60))
    for tick in range(round(STUCK_TIME * 60) + 20):
        assert waits.act(seen(tick)) == ((0.0, 0.0), Note(TASK.start, AVOIDING))


class Watcher(Guide):
    """Guide that notes waiting, and waits after a missed goal."""

    def __init__(self):
        self.waiting, self.misses = [], []

    def path(self, now, *, at_end=False):
        (self.misses if at_end else self.waiting).append(now.waiting)
        return now.way


@pytest.mark.parametrize(
    ("avoids", "speed", "waits"),
    [
        (True, 0.0, True), (True, 0.9 * WAITING_SPEED, True), (True, -0.9 * WAITING_SPEED, True),
        (True, WAITING_SPEED, False), (True, -1.1 * WAITING_SPEED, False), (False, 0.0, False),
    ],
)  # fmt: skip
def test_a_robot_waits_if_it_stands_to_give_way(turtlebot, avoids, speed, waits):
    monitor = Watcher()
    robot = driver(turtlebot, monitor)
    robot.step = Step(avoids=avoids)
    robot.act(seen(speed=speed))
    assert monitor.waiting == [waits]


class EndsAt:
    """Gives up in one control period, and notes for which period the reason is asked."""

    def __init__(self, tick, command):
        self._tick, self._command, self.asked = tick, command, []

    def act(self, now):
        ends = now.tick == self._tick
        return (self._command, Note(ending=Ending(Outcome.STUCK))) if ends else (Twist(0.0, 0.0), SILENT)

    def with_reason(self, ending, tick):
        self.asked.append((ending.outcome, tick))
        return ending


def test_the_reason_is_that_of_the_period_in_which_the_drive_ends():
    for last, outcome, asked in ((3, Outcome.STUCK, 3), (0, Outcome.STUCK, 0), (99, Outcome.TIMED_OUT, 30)):
        for command, steps in ((None, asked), (Twist(0.0, 0.0), min(asked + 1, 30))):
            plant = Kinematic(TASK.start, 0.0, load_robot("turtlebot"))
            mind = EndsAt(last, command)
            body = Body(plant, Senses(), Exact(TASK.start, 1 / 60), hz=60, limit=0.5)
            assert drive(body, mind).outcome is outcome
            assert mind.asked == [(outcome, asked)]
            assert len(plant.poses) == 1 + steps


@pytest.mark.parametrize(("true", "outcome"), [(0.4, Outcome.STUCK), (0.1, Outcome.SUCCEEDED)])
@pytest.mark.parametrize(("off", "knows"), [(0.0, False), (0.25, False), (0.26, True), (0.4, True)])
def test_a_goal_missed_by_the_estimate_triggers_a_replan(turtlebot, off, knows, true, outcome):
    """It stands `true` from the goal, and estimates that it is `off` from it. What is true ends no drive for it."""
    monitor, (x, y) = Watcher(), TASK.goal
    robot, body = driver(turtlebot, monitor), standing((x - true, y), (x - off, y))
    while body.ended is None:  # the command comes to rest first
        robot.step = robot.step._replace(pursuit=PursuitState(arc=robot.way.path.length))
        body.step(*robot.act(body.observe()))
    assert bool(monitor.misses) is knows
    assert body.ended.outcome is (Outcome.TIMED_OUT if knows else outcome)


def test_a_robot_that_stands_at_the_goal_has_arrived_whatever_it_commands():
    """It is observed once in a period. Before its first command it has not arrived."""
    body = standing(TASK.goal)
    for _ in range(2):
        assert body.ended is None
        assert body.observe() is body.observe()
        body.step(Twist(0.0, 0.0))
    assert body.ended == (Outcome.SUCCEEDED, "")
    assert (body.tick, len(body._senses.states), len(body._plant.poses)) == (1, 2, 2)


def test_a_path_is_followed_by_the_estimates_of_the_localiser(turtlebot):
    """At an estimate 0.5 m to the left of the robot, it turns right."""
    with Engine(TASK.world, turtlebot) as engine:
        log = follow(engine, PurePursuit(), driver(turtlebot).way.path, TASK, limit=1.0, senses=Off((0, 0), (0, 0.5)))
    assert log.pose[-1, 2] < -0.1


def test_a_robot_steers_from_where_it_will_be_when_its_next_command_takes_effect(turtlebot):
    """Three commands have not reached its motors yet: 0.1, 0.2 and 0.3 m/s."""
    plant = Kinematic(TASK.start, 0.0, load_robot("turtlebot"))
    delayed = NoisySenses(Noise(delay=0.05), turtlebot.track, 1 / 60, 0)
    body = Body(plant, delayed, Exact(TASK.start, 1 / 60), hz=60, limit=1.0)
    for speed in (0.1, 0.2, 0.3):
        body.step(Twist(speed, 0.0))
    now = body.observe()
    assert now.pose == TASK.start
    assert moved_by(now.pose, now.pending, 1 / 60) == pytest.approx((TASK.start[0] + 0.6 / 60, *TASK.start[1:]))
    seen_by = []
    robot = driver(turtlebot, None, SimpleNamespace(apply=lambda at, step: seen_by.append(at.pose) or step))
    robot.act(now)
    assert seen_by == [moved_by(now.pose, now.pending, 1 / 60)]


def test_progress_is_reported_ten_times_a_second(turtlebot):
    told, robot = [], driver(turtlebot)
    robot.progress = told.append
    plant = Kinematic(TASK.start, 1 / 60, turtlebot)
    drive(Body(plant, Senses(), Exact(TASK.start, 1 / 60), hz=60, limit=1.0), robot)
    assert len(told) == 10
    assert told == sorted(told)


def test_the_first_row_is_at_rest_and_estimates_keep_their_error(turtlebot):
    with Engine(TASK.world, turtlebot) as engine:
        plant = Bullet(engine, TASK.start, 80)
        senses = Off((0, 0), (0.1, -0.2))
        senses.noisy, senses.actuate = True, lambda command: Twist(0.3, 0.4)
        body = Body(plant, senses, Exact(TASK.start, 1 / 80), hz=80, limit=1 / 80)
        x, y, yaw = body.observe().pose
        body.step(Twist(0.2, 0.1), Note((x, y, yaw + 0.3 + 2 * np.pi), 2))
        found = plant.finish(body.ended)
        logged = body.logged(found, plant.per_tick)
    np.testing.assert_array_equal(found.command, [(0.0, 0.0), *[(0.2, 0.1)] * 3])
    np.testing.assert_array_equal(logged["actuated"], [(0.0, 0.0), *[(0.3, 0.4)] * 3])
    np.testing.assert_array_equal(found.limiter, [0, 2, 2, 2])
    np.testing.assert_allclose(logged["estimate"] - found.pose, [(0.1, -0.2, 0.3)] * 4)


@pytest.mark.parametrize("control_hz", [7, 50, 480])
def test_control_periods_are_whole_numbers_of_steps(turtlebot, control_hz):
    with Engine(TASK.world, turtlebot) as engine, pytest.raises(FieldError, match="must divide the physics rate 240"):
        Bullet(engine, TASK.start, control_hz)
