"""The parts of a control period, without physics."""

import dataclasses
import itertools
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.planners import Query, load_planner, smooth
from antdrive.robots import LIMITERS, AvoidanceState, PurePursuit, PursuitState, RobotSpec, Twist, load_robot
from antdrive.sim import Outcome, Perception, Scenario
from antdrive.sim.compose import BLIND_SHARE, compose
from antdrive.sim.driving.blocking import blocked_cells, covered_discs
from antdrive.sim.driving.driver import STUCK_PROGRESS, STUCK_TIME, Driver, StuckClock, full_turn
from antdrive.sim.driving.following import OnePath
from antdrive.sim.driving.parts import Guide, Moment, Rule, Step
from antdrive.sim.driving.perception import Told
from antdrive.sim.driving.rules import OUT_OF_SIGHT, Avoid, Pursuit, StayInSight, braked
from antdrive.sim.physics.engine import State
from antdrive.worlds import Cruising, Disc, Grid, Keyframed, Task, Trajectories, World, rasterise

HALL = World("hall", (0.0, 0.0, 9.0, 6.0), (Disc(4.5, 4.5, 0.5),))
CRUISING = Cruising(radius=0.3, position=(7.0, 1.0), velocity=(0.0, 0.1))
TASK = Task(HALL, (1.0, 3.0, 0.0), (8.0, 3.0), cell=0.25)


def hall_grid(world: World = HALL) -> Grid:
    return rasterise(world, 0.25, 0.21)


def driver(robot: RobotSpec, guide: Guide | None = None, *rules: Rule) -> Driver:
    grid = hall_grid()
    plan = load_planner("astar").plan(Query.between(grid, TASK), np.random.default_rng(0))
    controller = PurePursuit()
    tracked = controller.prepare(smooth(plan, grid, TASK), HALL, robot, 0.03, 1 / 60)
    pursuit = Pursuit(controller, full_turn(robot, 60))
    return Driver(guide or OnePath(), (pursuit, *rules), tracked, TASK, robot, 60)


def at(driving: Driver, arc: float) -> Driver:
    """The same, so far along its route [m]."""
    driving.step = Step(pursuit=PursuitState(arc=arc))
    return driving


def test_progress_restarts_the_stuck_clock() -> None:
    clock = StuckClock(farthest=1.0, driving=9, turning=4)
    assert clock.after(PursuitState(arc=1.0 + 2 * STUCK_PROGRESS), waiting=False) == StuckClock(
        1.0 + 2 * STUCK_PROGRESS
    )
    assert clock.after(PursuitState(arc=1.0 + STUCK_PROGRESS / 2), waiting=False).driving == 10


def test_waiting_for_a_mover_does_not_count_as_being_stuck() -> None:
    clock = StuckClock(farthest=1.0, driving=9, turning=4)
    assert clock.after(PursuitState(arc=1.0), waiting=True) == clock
    assert clock.after(PursuitState(arc=1.0, turning=True), waiting=True) == clock


def test_turning_on_the_spot_has_a_count_of_its_own() -> None:
    clock = StuckClock(farthest=1.0, driving=9, turning=4)
    assert clock.after(PursuitState(arc=1.0, turning=True), waiting=False) == StuckClock(1.0, 9, 5)


def test_that_sight_held_the_robot_is_said_where_it_did_so_for_most_of_the_time() -> None:
    """Progress begins the count anew; a robot that waits counts as nothing."""
    held, free = PursuitState(limiter=OUT_OF_SIGHT), PursuitState()
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


def test_a_robot_that_does_not_move_is_stuck_after_the_stuck_time(turtlebot: RobotSpec) -> None:
    still = driver(turtlebot)
    ticks = 0
    rest = State(*TASK.start, 0.0, 0.0)
    while still.gives_up(rest) is None:
        assert still.decide(ticks, TASK.start, rest) is None
        ticks += 1
    assert ticks == pytest.approx(STUCK_TIME * 60, abs=2)


@pytest.mark.parametrize(("outside", "outcome"), [(-0.002, Outcome.SUCCEEDED), (0.002, Outcome.STUCK)])
def test_a_robot_that_stops_just_outside_the_tolerance_has_not_arrived(
    turtlebot: RobotSpec, outside: float, outcome: Outcome
) -> None:
    x, y = TASK.goal
    away = TASK.goal_tolerance + outside
    at_end = driver(turtlebot)
    at(at_end, at_end.path.length)
    endings = [at_end.decide(tick, (x, y, 0.0), State(x - away, y, 0.0, 0.0, 0.0)) for tick in range(9)]
    assert {ending.outcome for ending in endings if ending is not None} == {outcome}


def test_a_mover_beside_the_goal_closes_no_cell_within_the_inflation_of_it() -> None:
    """The goal's cell and those around it stay free, wherever in its cell the goal is."""
    for x in (7.9, 8.0, 8.1):
        for y in (3.5, 3.6):
            goal = (x, y - 0.6)
            mover = Keyframed(radius=0.5, keyframes=((0.0, x, y), (9.0, x, y)))
            still = Told(Trajectories.of(World("w", HALL.bounds, movers=(mover,)), (1.0, 3.0)), Perception(), 60)
            grid = hall_grid()
            discs = covered_discs(still, 0, np.array([(1.0, 3.0), goal]), 0.0, grid)
            assert discs
            assert discs[0].radius == pytest.approx(0.6 - grid.inflate - grid.cell)
            assert not blocked_cells(grid, discs)[grid.cell_at(*goal)]


def test_standing_at_the_routes_end_ends_the_drive_by_the_distance_to_the_goal(turtlebot: RobotSpec) -> None:
    x, y = TASK.goal
    for distance, outcome in ((0.0, Outcome.SUCCEEDED), (0.3, Outcome.STUCK)):
        at_end = driver(turtlebot)
        at(at_end, at_end.path.length)
        ending = None
        for tick in range(9):  # the command comes to rest first
            ending = ending or at_end.decide(tick, (x, y, 0.0), State(x, y - distance, 0.0, 0.0, 0.0))
        assert ending is not None
        assert ending.outcome is outcome
        assert ending.reason == (
            ""
            if outcome is Outcome.SUCCEEDED
            else "the robot believed that it was at the goal, 0.00 m from it, but was 0.300 m from it "
            "(the tolerance is 0.25 m): its estimate was wrong by 0.30 m"
        )


def test_a_robot_that_knows_where_it_is_is_told_how_far_from_the_goal_its_route_ends(turtlebot: RobotSpec) -> None:
    x, y = TASK.goal
    for off in (-0.3, 0.4):  # what it believes lies outside the tolerance, too
        ending = driver(turtlebot)._arrival((x, y + off, 0.0), State(x, y - 0.3, 0.0, 0.0, 0.0))
        assert ending.reason == "the route ends here, 0.300 m from the goal; the tolerance is 0.25 m"


def test_a_robot_that_avoids_a_mover_at_the_goal_stops_there_even_where_sight_holds_its_speed(
    turtlebot: RobotSpec,
) -> None:
    """Local avoidance goes on for ever, and slowly, because the robot sees too little there."""
    calm: Any = SimpleNamespace(
        prediction_times=np.arange(3.0), step=1.0, avoid=lambda *_, **__: (Twist(0.5, 0.0), True, AvoidanceState())
    )
    caution: Any = SimpleNamespace(limit=lambda *_: (Twist(0.005, 0.0), True))
    nobody = Told(Trajectories.of(HALL, TASK.start[:2]), Perception(), 60)
    sight: Any = SimpleNamespace(note_sight=lambda *_: None)
    robot = driver(turtlebot, None, Avoid(calm, nobody, OnePath(), TASK, turtlebot, 60), StayInSight(caution, sight))
    at_goal = (*TASK.goal, 0.0)
    at(robot, robot.path.length - 0.5)
    endings = [robot.decide(tick, at_goal, State(*at_goal, 0.0, 0.0)) for tick in range(2)]
    assert robot.step.pursuit.limiter != LIMITERS.index("avoid")
    assert [ending and ending.outcome for ending in endings] == [None, Outcome.SUCCEEDED]


def test_a_robot_without_a_map_backs_off_slowly_where_its_lidar_does_not_look(
    jackal: RobotSpec, turtlebot: RobotSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`jackal` sees 270 degrees, `turtlebot` all round. A robot that is told of movers knows what is behind it."""
    for robot, perception in itertools.product((jackal, turtlebot), (Perception(kind="lidar"), Perception())):
        planner = load_planner("astar")
        unknown = Scenario(
            task=dataclasses.replace(TASK, world=dataclasses.replace(HALL, movers=(CRUISING,))),
            planner=planner,
            robot=robot,
            map="none",
            perception=perception,
            planner_name="astar",
        )
        asked: list[float] = []

        def avoid(*_: Any, backwards: float, asked: list[float] = asked, **__: Any) -> Any:
            asked.append(backwards)
            return Twist(0.0, 0.0), False, AvoidanceState()

        noted: Any = SimpleNamespace(prediction_times=np.arange(3.0), step=1.0, avoid=avoid, min_clearance=0.1)
        monkeypatch.setattr("antdrive.sim.compose.avoidance_of", lambda _, noted=noted: noted)
        rule = next(rule for rule in compose(unknown).rules if type(rule) is Avoid)
        still = State(*TASK.start, 0.0, 0.0)
        rule.apply(Moment(0, TASK.start, still, driver(robot).path, Step(), StuckClock()), Step())
        slow = robot is jackal and perception.kind == "lidar"
        assert asked == [BLIND_SHARE * robot.max_speed if slow else math.inf]


class OneReplan(Guide):
    """A guide that replans once, back along the path that it is given."""

    def __init__(self) -> None:
        self.log, self.path = [], None

    def update(self, tick: int, *_: Any) -> Any:
        return self.path if tick == 1 else None


def test_a_replan_starts_its_route_from_the_beginning(turtlebot: RobotSpec) -> None:
    monitor = OneReplan()
    robot = driver(turtlebot, monitor)
    monitor.path = driver(turtlebot).path
    robot.decide(0, (3.0, 3.0, 0.0), State(3.0, 3.0, 0.0, 0.5, 0.0))
    old = robot.path
    assert robot.step.pursuit.arc > 0
    robot.decide(1, TASK.start, State(*TASK.start, 0.5, 0.0))
    assert robot.path is monitor.path is not old
    assert robot.step.pursuit.arc == pytest.approx(0.0, abs=0.02)


def test_the_first_command_accelerates_within_the_robots_limit(turtlebot: RobotSpec) -> None:
    first = driver(turtlebot)
    first.decide(0, TASK.start, State(*TASK.start, 0.0, 0.0))
    assert Twist(0.0, 0.0) != first.step.command
    assert 0 < first.step.command.speed <= turtlebot.max_acceleration / 60 + 1e-12


@given(
    st.lists(st.tuples(st.floats(0.5, 8.5), st.floats(0.5, 5.5), st.floats(0.05, 1.0)), max_size=5),
)
def test_discs_block_the_cells_that_the_same_obstacles_would(discs: list[tuple[float, float, float]]) -> None:
    """The oracle rasterises a world with the discs as obstacles; cells on a disc's very edge may differ."""
    found = [Disc(*disc) for disc in discs]
    grid = hall_grid()
    blocked = blocked_cells(grid, found)
    oracle = grid.free & ~hall_grid(World("hall", HALL.bounds, (*HALL.obstacles, *found))).free
    rows, cols = np.nonzero(blocked != oracle)
    for x, y in grid.xy(np.stack([rows, cols], axis=1)):
        assert min(abs(math.dist((x, y), (d.x, d.y)) - d.radius - grid.inflate) for d in found) < 1e-9


def test_movers_close_neither_the_robots_position_nor_the_goal() -> None:
    over_goal = Keyframed(radius=0.6, keyframes=((0.0, 8.0, 3.2), (9.0, 8.0, 3.2001)))
    crossing = Cruising(radius=0.3, position=(4.0, 1.0), velocity=(0.0, 0.5))
    world = World("hall", HALL.bounds, HALL.obstacles, movers=(over_goal, crossing))
    predictor = Told(Trajectories.of(world, TASK.start[:2]), Perception(), 60)
    grid = hall_grid()
    ends = np.array([TASK.start[:2], TASK.goal])
    discs = covered_discs(predictor, 0, ends, 1.0, grid)
    blocked = blocked_cells(grid, discs)
    for end in ends:
        assert not blocked[grid.cell_at(*end)]
    assert [disc.y for disc in discs if disc.radius == 0.3] == pytest.approx([1.0, 1.125, 1.25, 1.375, 1.5])


@given(speed=st.floats(-2.0, 2.0), yaw_rate=st.floats(-4.0, 4.0))
def test_a_robot_that_brakes_for_the_goal_slows_its_turn_no_faster_than_it_can(speed: float, yaw_rate: float) -> None:
    jackal, last = load_robot("jackal"), Twist(speed, yaw_rate)
    slower = braked(last, jackal, 60)
    assert abs(last.speed - slower.speed) <= jackal.max_acceleration / 60 + 1e-12
    assert abs(last.yaw_rate - slower.yaw_rate) <= jackal.max_yaw_acceleration / 60 + 1e-12
    assert abs(slower.yaw_rate) <= abs(last.yaw_rate)
    gentle = abs(yaw_rate) * jackal.max_acceleration <= abs(speed) * jackal.max_yaw_acceleration
    if gentle and speed:
        assert slower.yaw_rate * last.speed == pytest.approx(last.yaw_rate * slower.speed, abs=1e-9), "the same curve"
