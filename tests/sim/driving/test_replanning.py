"""New routes while driving."""

import math
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.planners import (
    PLANNERS,
    AgentStats,
    Capabilities,
    PlannerError,
    PlanStatus,
    TimedPlan,
    capabilities_of,
    load_planner,
    replanner_for,
)
from antdrive.robots import Footprint, Twist
from antdrive.sim import Outcome, Perception, ReplanPolicy, Rollout, Scenario, certify, run
from antdrive.sim.compose import compose, route_planner
from antdrive.sim.driving.guide import MAX_LAG, Schedule
from antdrive.sim.driving.replanning import CellByCell
from antdrive.sim.driving.route_planner import outlined_grid_of
from antdrive.sim.driving.rules import KeepToSchedule, slow_down
from antdrive.sim.log.metrics import tracking_error_max_m
from antdrive.worlds import Disc, Keyframed, Route, Task, World, polyline_clearance
from antdrive.worlds.world import by_geometry
from tests.records import COARSE, changed
from tests.sim.driving.ground_truth import GroundTruth, moment

# A wall with two gates; the path through the nearer gate is shorter.
POSTS = tuple(Disc(4.0, y, 0.25) for y in np.arange(0.25, 6.0, 0.5) if not (2.2 < y < 3.8 or y > 5.0))
HALL = World("hall", (0.0, 0.0, 8.0, 6.5), POSTS)
TASK = Task(HALL, (1.0, 3.0, 0.0), (7.0, 3.0), cell=0.25)
PLUG = Keyframed(radius=0.45, keyframes=((0.0, 4.0, 3.0), (100.0, 4.0, 3.01)), loop="once")


def among(*movers, robot, planner="dstar-lite", **settings):
    task = changed(TASK, "world", movers=movers)
    return run(Scenario.of(task, planner, robot, **COARSE, **settings))


def test_only_replanning_gets_around_a_closed_gate(turtlebot):
    waiting = among(PLUG, robot=turtlebot, replanning=None, time_limit=15.0)
    assert waiting.outcome is Outcome.TIMED_OUT
    done = among(PLUG, robot=turtlebot)
    assert done.succeeded, (done.outcome, done.reason)
    replans = done.rollout.record.replans
    assert replans[0].trigger == "obstructed"
    assert 0 <= replans[0].t < done.rollout.t[-1]
    assert (replans[0].cost_m or 0.0) > 4.0
    assert len(done.rollout.record.times.replans_s) == len(replans)
    assert tracking_error_max_m(done.rollout) < 0.25, "measured to the route in force, while the robot avoids the mover"
    through = done.rollout.pose[np.abs(done.rollout.pose[:, 0] - 4.0).argmin()]
    assert through[1] > 4.5, "through the other gate"


def test_replans_are_repeatable_and_saved_with_the_log(turtlebot, tmp_path):
    first, again = (among(PLUG, robot=turtlebot, planner="ants", seed=2, time_limit=3.0).rollout for _ in range(2))
    assert first.digest == again.digest
    loaded = Rollout.load(first.save(f"{tmp_path}/run.npz"))
    assert loaded.record.replans == first.record.replans != ()
    assert certify(loaded).certified == certify(first).certified


@pytest.mark.parametrize(
    "planner", [name for name in PLANNERS if name not in ("ga-han", "hybrid", "pfaco", "as", "sipp")]
)
def test_every_planner_replans(planner, turtlebot):
    """All but the slowest planners, and but `sipp`, which plans around the mover at once."""
    done = among(PLUG, robot=turtlebot, planner=planner, time_limit=2.0)
    if done.rollout is None:  # a planner that is not complete found no path
        assert not capabilities_of(load_planner(planner)).complete
        return
    assert done.rollout.record.replans
    assert not len(done.rollout.contacts)


def test_nothing_is_replanned_if_nothing_is_in_the_way(turtlebot):
    far = Keyframed(radius=0.2, keyframes=((0.0, 0.5, 0.5), (9.0, 1.5, 0.5)))
    done = among(far, robot=turtlebot)
    assert done.succeeded
    assert done.rollout.record.replans == ()


GATEKEEPER = Keyframed(radius=0.45, keyframes=((0.0, 4.0, 3.0), (9.0, 4.0, 3.0001), (12.0, 1.5, 5.5)), loop="once")


def test_the_robot_keeps_to_a_plan_in_space_and_time(turtlebot):
    """It waits for the gate to open and arrives on schedule."""
    done = among(GATEKEEPER, robot=turtlebot, planner="sipp", margin=0.1)
    assert isinstance(done.plan, TimedPlan)
    assert done.succeeded, (done.outcome, done.reason)
    assert done.rollout.t[-1] == pytest.approx(done.plan.arrive[-1], abs=3.0)
    record = done.rollout.record
    assert record.perception.kind == "motions"
    assert record.avoidance["horizon"] == 1.0, "the horizon that was in force"


def test_mmas_dstar_decides_cell_by_cell_and_waits_if_there_is_no_path(turtlebot):
    done = among(GATEKEEPER, robot=turtlebot, planner="mmas-dstar")
    assert done.succeeded, (done.outcome, done.reason)
    decisions = done.rollout.record.replans
    assert {d.trigger for d in decisions} == {"decision"}
    assert len(decisions) > 20
    steps = [math.dist(d.route[-2], d.route[-1]) for d in decisions[1:-1]]
    assert max(steps) < 0.25 * 2**0.5 + 0.25
    again = among(GATEKEEPER, robot=turtlebot, planner="mmas-dstar").rollout
    assert again.digest == done.rollout.digest


def test_a_robot_that_left_its_cell_returns_around_obstacles(turtlebot):
    """Avoiding movers has taken the robot to the other side of the wall; its own cell lies behind a post."""
    task = changed(TASK, "world", movers=(GATEKEEPER,))
    scenario = Scenario.of(task, "mmas-dstar", turtlebot, **COARSE)
    monitor = compose(scenario)[1]
    assert isinstance(monitor, CellByCell)
    grid, answer = monitor.first()
    monitor.route(grid, answer)
    centre = grid.xy(np.array([grid.cell_at(3.4, 1.5)]))[0]
    for x, straight in ((4.7, False), (2.6, True), (3.2, True)):
        way = monitor._way_back((x, 1.5, 0.0), centre)
        assert way[0] == pytest.approx((x, 1.5))
        assert way[-1] == pytest.approx(centre)
        assert (len(way) == 2) == straight
        assert float(polyline_clearance(HALL, way)) >= scenario.inflate - 0.012


def test_mmas_dstar_stays_at_the_start_while_there_is_no_path(turtlebot):
    """A lane that is one cell wide; a mover blocks it for the first 4 s."""
    lane = World("lane", (0.0, 0.0, 4.0, 0.6))
    task = Task(lane, (0.36, 0.375, 0.0), (3.0, 0.375), cell=0.25, time_limit=30.0)
    lid = Keyframed(radius=0.2, keyframes=((0.0, 0.985, 0.3), (4.0, 0.985, 0.3001), (6.0, 3.7, 0.3)), loop="once")
    task = changed(task, "world", movers=(lid,))
    # Without avoidance, nothing but its decisions can stop the robot.
    planner = load_planner("mmas-dstar")
    log = run(Scenario(task=task, planner=planner, robot=turtlebot, avoidance=None, **COARSE)).rollout
    assert np.ptp(log.pose[log.t < 4.0, 0]) < 0.01
    decisions = log.record.replans
    assert {d.trigger for d in decisions} == {"decision"}
    assert decisions[0].t > 4.0
    assert max(math.dist(d.route[0], d.route[-1]) for d in decisions[:-1]) < 0.5


@pytest.mark.parametrize(
    ("post", "start", "goal"),
    [(Disc(8.0, 2.6, 0.25), (1.0, 3.0), (8.0, 3.0)), (Disc(1.4, 2.7, 0.2), (1.05, 3.0), (3.0, 3.0))],
    ids=["little room at the goal", "little room on the straight line to the second cell"],
)
def test_mmas_dstar_keeps_the_inflation_from_obstacles(post, start, goal, turtlebot):
    far = Keyframed(radius=0.2, keyframes=((0.0, 0.5, 0.5), (9.0, 1.5, 0.5)))
    task = Task(World("hall", (0.0, 0.0, 9.0, 6.0), (post,), movers=(far,)), (*start, 0.0), goal, cell=0.25)
    done = run(Scenario.of(task, "mmas-dstar", turtlebot, **COARSE))
    assert done.succeeded, (done.outcome, done.reason)
    for decision in done.rollout.record.replans[:-1]:
        assert polyline_clearance(task.world, np.array(decision.route)) > 0.21 - 2e-4, decision


def test_a_robot_that_does_not_know_that_it_missed_the_goal_stays(turtlebot):
    """The tolerance is below the error of the estimate: the drive ends among movers as it does without."""
    far = Keyframed(radius=0.2, keyframes=((0.0, 0.5, 0.5), (9.0, 1.5, 0.5)))
    tight = Scenario.of(
        Task(World("hall", (0.0, 0.0, 8.0, 6.0)), (1.0, 3.0, 0.0), (3.0, 3.0), cell=0.25, goal_tolerance=0.004),
        "dstar-lite",
        turtlebot,
        noise=1.0,
    )
    moving = changed(tight.task, "world", movers=(far,))
    ends = []
    for seed in (2, 5, 6):
        alone = run(replace(tight, seed=seed))
        among_them = run(replace(tight, seed=seed, task=moving))
        believed = math.dist(alone.rollout.estimate[-1, :2], tight.task.goal)
        if believed <= 0.003:
            assert among_them.outcome is alone.outcome
            assert among_them.rollout.record.replans == ()
            ends.append(alone.outcome)
    assert {Outcome.STUCK, Outcome.SUCCEEDED} <= set(ends), ends


# Monitors without physics: 60 control periods per second, from (1, 3) to (7, 3) through the nearer gate

PASSING = Keyframed(radius=0.45, keyframes=((0.0, 4.0, 3.0), (4.0, 4.0, 3.01), (5.0, 1.0, 6.0)), loop="once")
ASIDE = Keyframed(radius=0.3, keyframes=((0.0, 7.0, 0.5), (100.0, 7.0, 0.51)), loop="once")


def monitor_of(*movers, robot, planner="dstar-lite", **settings):
    task = changed(TASK, "world", movers=movers)
    policy = ReplanPolicy(**settings)
    s = Scenario.of(task, planner, robot, avoidance=None, replanning=policy)
    truth = GroundTruth(s.trajectories, s.known_perception, s.control_hz)
    with mock.patch("antdrive.sim.compose.PerceivedMovers", return_value=truth):
        made = compose(s)[1]
    return made, made.route(*made.first())[1]


def now(made, tick, pose, tracked=None, arc=0.0, waiting=False):
    made._movers.at(tick, pose[:2])
    return moment(tick, pose, tracked, arc, waiting)


def test_a_robot_too_far_off_its_route_has_strayed(turtlebot):
    made, tracked = monitor_of(ASIDE, robot=turtlebot)
    assert made.trigger(now(made, 0, (1.5, 3.7, 0.0), tracked, 0.5)) == ""
    assert made.trigger(now(made, 0, (1.5, 3.8, 0.0), tracked, 0.5)) == "strayed"
    assert made.trigger(now(made, 0, (7.0, 3.3, 0.0), tracked, tracked.length - 0.1)) == "", (
        "the end is 0.3 m away where 0.1 m of the route remain"
    )
    assert made.trigger(now(made, 0, (7.0, 3.4, 0.0), tracked, tracked.length - 0.1)) == "strayed"


def test_a_replan_from_an_impossible_pose_is_logged_as_failed(turtlebot):
    made, _ = monitor_of(ASIDE, robot=turtlebot)
    assert made.replan(now(made, 0, (-1.0, 3.0, 0.0)), "strayed") is None
    assert [(replan.trigger, replan.solved, replan.cost_m) for replan in made.log] == [("strayed", False, None)]


def test_two_replans_are_at_least_the_minimum_interval_apart(turtlebot):
    made, tracked = monitor_of(PASSING, robot=turtlebot, min_interval=1.0, obstruction_range=0.0)
    astray = (1.5, 3.8, 0.0)
    assert made.replan(now(made, 0, astray), "strayed") is not None
    assert [made.trigger(now(made, tick, astray, tracked, 0.5)) for tick in (1, 59, 60)] == ["", "", "strayed"]


def test_only_waiting_without_interruption_triggers_a_replan(turtlebot):
    made, tracked = monitor_of(ASIDE, robot=turtlebot, max_wait=2.0)
    causes = [made.trigger(now(made, tick, TASK.start, tracked, 0.0, waiting=tick != 60)) for tick in range(240)]
    assert causes.index("waited") == 61 + 120
    never, tracked = monitor_of(ASIDE, robot=turtlebot, around_movers=False)
    assert not any(never.trigger(now(never, tick, TASK.start, tracked, 0.0, waiting=True)) for tick in range(240))


@pytest.mark.parametrize("planner", ["dstar-lite", "ants", "tangent"])
def test_cells_that_a_mover_has_left_are_free_again(planner, turtlebot):
    made, _ = monitor_of(PASSING, robot=turtlebot, planner=planner)
    first, again = (
        made.replan(now(made, 0, TASK.start), "obstructed"),
        made.replan(now(made, 360, TASK.start), "obstructed"),
    )
    beside = World("mover", HALL.bounds, (Disc(4.0, 3.0, 0.45),))
    assert polyline_clearance(beside, first.route.xy) > 0.2
    assert again.length < 6.05
    assert [replan.solved for replan in made.log] == [True, True]


WALKING = Keyframed(radius=0.3, keyframes=((0.0, 4.0, 1.0), (8.0, 4.0, 5.0)), loop="pingpong")


@pytest.mark.parametrize(
    ("mover", "trigger", "around", "quicker"),
    [
        (WALKING, "obstructed", 7.5, True),
        (WALKING, "obstructed", 7.3, False),
        (WALKING, "waited", 7.5, False),
        (PASSING, "obstructed", 7.5, False),
    ],
)
def test_waiting_for_a_walking_mover_is_quicker_than_a_long_route(mover, trigger, around, quicker, turtlebot):
    """The robot waits for 2 s at most, in which it drives 1.4 m."""
    made, _ = monitor_of(mover, robot=turtlebot)
    assert made._ahead.waiting_is_quicker(trigger, 0.7, around, 6.0) is quicker


def test_a_policy_can_ignore_movers(turtlebot):
    made, _ = monitor_of(PASSING, robot=turtlebot, around_movers=False)
    straight = made.replan(now(made, 0, TASK.start), "strayed")
    assert straight.length < 6.05


@pytest.mark.parametrize("planner", ["dstar-lite", "tangent"])
def test_a_mover_at_the_goal_does_not_block_the_plan(planner, turtlebot):
    """It may have left by the time the robot arrives; otherwise the robot avoids it."""
    mover = Keyframed(radius=0.3, keyframes=((0.0, 7.1, 3.0), (100.0, 7.1, 3.01)), loop="once")
    made, _ = monitor_of(mover, robot=turtlebot, planner=planner)
    tracked = made.replan(now(made, 0, TASK.start), "strayed")
    assert tracked.route.xy[-1] == pytest.approx(TASK.goal)


def test_a_late_robot_plans_in_time_again_from_where_it_is(turtlebot):
    made, tracked = monitor_of(GATEKEEPER, robot=turtlebot, planner="sipp")
    on_time = made.schedule.due(20.0)
    place = (float(np.interp(on_time, tracked.route.arc, tracked.route.xy[:, 0])), 3.0, 0.0)
    assert made.trigger(now(made, 1200, place, tracked, on_time - MAX_LAG + 0.01)) == ""
    assert made.trigger(now(made, 1200, place, tracked, on_time - MAX_LAG - 0.01)) == "late"
    assert made.replan(now(made, 1200, TASK.start), "late") is not None
    assert made.schedule.t[0] == pytest.approx(20.0)


def test_a_plan_in_time_has_a_schedule_among_movers_alone_with_or_without_replanning(jackal):
    moving = changed(TASK, "world", movers=(GATEKEEPER,))
    for task, scheduled in ((moving, True), (TASK, False)):
        for settings in ({"replanning": None}, {}, {"perception": Perception(kind="lidar")}):
            _, guide, mind = compose(Scenario.of(task, "sipp", jackal, margin=0.1, **settings))
            guide.route(*guide.first())
            assert (guide.schedule is not None) is scheduled
            assert any(isinstance(rule, KeepToSchedule) for rule in mind.rules) is scheduled


@given(st.floats(0.0, 30.0), st.floats(0.0, 10.0))
def test_a_schedule_is_late_only_when_behind(t, arc):
    route = Route(np.array([[0.0, 0.0], [4.0, 0.0]]))
    xy = np.array([[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]])
    plan = TimedPlan(
        status=PlanStatus.SOLVED, arrive=np.array([0.0, 4.0, 12.0]), leave=np.array([0.0, 8.0, 12.0]), xy=xy
    )
    schedule = Schedule.of(plan, route)
    due = float(plan.at(t)[0])
    assert schedule.due(t) == pytest.approx(due)
    assert schedule.late(t, arc) == (due - arc > MAX_LAG)
    if 4.0 < t < 7.5 and arc >= 2.0:
        assert schedule.speed_limit(t, arc) == 0.0


def test_a_schedule_with_turns_begins_at_the_first_cell_and_leaves_stops_at_corners_to_the_controller():
    """A lead of 0.6 m, 2 m along x, a turn and 2 m along y; the plan turns from 5 to 8 s and waits until 12 s."""
    route = Route(
        np.array([[-0.6, 0.0], [0.0, 0.0], [2.0, 0.0], [2.0, 2.0]]), turns=np.array([0.0, 0.0, math.pi / 2, 0.0])
    )
    xy = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0]])
    times = np.array([[0.0, 1.2], [3.2, 3.2], [5.2, 12.0], [16.0, 16.0]])
    plan = TimedPlan(status=PlanStatus.SOLVED, arrive=times[:, 0], leave=times[:, 1], xy=xy)
    schedule = Schedule.of(plan, route)
    assert [schedule.due(t) for t in (0.0, 3.2, 7.0, 14.0)] == pytest.approx([0.6, 1.6, 2.6, 3.6])
    assert not schedule.late(0.5, 0.0)  # it is on its lead
    assert schedule.late(3.0, 0.0)
    assert schedule.speed_limit(4.9, 2.5) == math.inf
    assert schedule.speed_limit(8.0, 2.6) == 0.0
    assert 0 < schedule.speed_limit(11.9, 2.6) < 0.5


def test_a_command_is_slowed_down_no_faster_than_the_robot_brakes():
    fast = Twist(0.6, 0.3)
    assert slow_down(fast, fast, math.inf, 0.02) == fast
    assert slow_down(fast, fast, 0.0, 0.02) == pytest.approx(Twist(0.58, 0.29))
    assert slow_down(Twist(0.01, 0.3), Twist(0.01, 0.3), 0.0, 0.02).speed == 0.0


class WrongLater:
    """A planner whose first plan is right; later ones lack a cell, or it raises."""

    def __init__(self, raises):
        self.raises, self.calls = raises, 0

    def plan(self, query, rng):
        right = PLANNERS["astar"].plan(query, rng)
        self.calls += 1
        if self.calls == 1 or len(right.cells) < 4:
            return right
        if self.raises:
            raise KeyError("later")
        return replace(right, cells=np.delete(right.cells, 2, axis=0))


MOVING = changed(TASK, "world", movers=(PLUG,))


def ends_as_wrong(result, words):
    """Whether a drive ends with a wrong plan on the way, which its log tells and whose rows contradict nothing."""
    assert result.certificate.problems == ()
    last = result.rollout.record.replans[-1]
    assert not last.solved
    assert last.t == pytest.approx(result.rollout.t[-1], abs=1 / 60)
    return result.outcome is Outcome.INVALID_PLAN and words in result.reason


def test_a_wrong_plan_on_the_way_ends_the_drive():
    planner = WrongLater(raises=False)
    result = run(Scenario.of(MOVING, planner, time_limit=10.0, **COARSE))
    assert planner.calls == 2
    assert ends_as_wrong(result, "on the way, at t = ")
    assert "cells: step 1 from" in result.reason
    before = changed(result.rollout, "record", replans=())
    assert any("does not end with a search that found no route" in problem for problem in certify(before).problems)


class Deciding:
    """A planner that decides cell by cell, or replans by itself, and does it wrong."""

    def __init__(self, what, *, cell_by_cell):
        self.capabilities = Capabilities(cell_by_cell=cell_by_cell, own_replanner=not cell_by_cell)
        self.what, self.stats, self.cell, self.arrived, self.note = what, AgentStats(), (0, 0), False, ""

    def plan(self, query, rng):
        self.cell = query.start
        return PLANNERS["astar"].plan(query, rng)

    def agent(self, query, rng):
        return self

    replanner = agent
    query = None

    def step(self, blocked):
        if isinstance(self.what, BaseException):
            raise self.what
        return self.what

    result = block = clear = move = change = lambda self, cells=None: self.step(cells)


@pytest.mark.parametrize("step", [(0, 0), (3, 999), 5, ("a", 1)], ids=str)
def test_a_step_that_is_no_allowed_move_ends_the_drive(step):
    assert ends_as_wrong(run(Scenario.of(MOVING, Deciding(step, cell_by_cell=True), time_limit=10.0)), "step: ")


@pytest.mark.parametrize("cell_by_cell", [True, False], ids=["agent", "replanner"])
@pytest.mark.parametrize("error", [IndexError("mine"), SystemExit(0)], ids=["raises", "exits"])
def test_what_a_planners_own_replanner_raises_is_its_error(error, cell_by_cell):
    scenario = Scenario.of(MOVING, Deciding(error, cell_by_cell=cell_by_cell), time_limit=10.0)
    with pytest.raises(PlannerError, match=rf"planner Deciding raised {type(error).__name__}.*\(test_replanning.py:"):
        run(scenario)


def test_an_answer_of_its_own_replanner_that_is_none_is_its_error():
    with pytest.raises(PlannerError, match="planner Deciding returned 5 instead of a PlanResult"):
        run(Scenario.of(MOVING, Deciding(5, cell_by_cell=False), time_limit=10.0))


def test_an_error_of_antdrive_around_a_replanner_is_not_the_planners(monkeypatch):
    def broken(*_):
        raise KeyError("ours")

    monkeypatch.setattr("antdrive.sim.driving.route_planner.closed_cells", broken)
    with pytest.raises(KeyError, match="ours"):
        run(Scenario.of(MOVING, "dstar-lite", time_limit=10.0))


def test_capabilities_of_another_type_are_the_planners_error():
    planner = Deciding(None, cell_by_cell=True)
    planner.capabilities = "all"
    with pytest.raises(PlannerError, match="planner Deciding declares 'all' instead of Capabilities"):
        run(Scenario.of(MOVING, planner))


def test_a_planner_that_raises_on_the_way_is_named():
    with pytest.raises(PlannerError, match=r"planner WrongLater raised KeyError: 'later' \(test_replanning.py:"):
        run(Scenario.of(MOVING, WrongLater(raises=True)))


def test_a_plan_for_a_footprint_keeps_away_from_movers_in_its_way(turtlebot):
    hall = changed(TASK, "world", movers=(PLUG,))
    routes = route_planner(
        Scenario.of(
            hall, "astar", replace(turtlebot, footprint=Footprint(half_length=0.3, half_width=0.15)), footprint="exact"
        )
    )
    grid = routes.chosen_grid()
    assert grid.turns
    mover = Disc(4.0, 3.0, 0.45)
    for discs, crosses in (((), 3.0), ((mover,), 5.0)):
        plan = routes.around(hall, grid, discs)
        assert plan.solved
        at = grid.xy(plan.cells)
        y = at[np.abs(at[:, 0] - 4.0).argmin(), 1]
        assert abs(y - crosses) < 1.0


@pytest.mark.parametrize(
    ("robot", "world", "planner", "cell"),
    [
        ("jackal", "forest", "ants", None),  # the disc's way is at most 10 % longer
        ("warehouse", "slalom", "astar", 0.05),
        ("warehouse", "slalom", "ants", 0.25),  # the disc has a way, over 10 % longer
        ("warehouse", "gate", "as", 0.2),  # the disc has none
        pytest.param("warehouse", "forest", "ants", 0.05, marks=pytest.mark.slow),  # on finer cells only
    ],
)
def test_auto_takes_the_footprint_on_cells_that_the_planner_can_search(robot, world, planner, cell):
    grid = route_planner(Scenario.of(world, planner, robot)).chosen_grid()
    assert (grid.cell if grid.turns else None) == cell


def test_a_footprint_is_planned_on_the_task_s_cells_where_finer_ones_are_too_many():
    large = Task(World("large", (0.0, 0.0, 300.0, 300.0), ()), (5.0, 5.0, 0.0), (9.0, 5.0), cell=0.5)
    assert route_planner(Scenario.of(large, "astar", "warehouse", footprint="exact")).chosen_grid().cell == 0.5


@pytest.mark.parametrize("planner", ["dstar-lite", "dstar"])
@pytest.mark.parametrize("mapped", [True, False])
def test_plans_for_a_footprint_are_repaired_and_as_short_as_those_from_scratch(planner, mapped, turtlebot, monkeypatch):
    """The robot passes the first gate and meets movers; without a map the posts come into view meanwhile."""
    long = replace(turtlebot, footprint=Footprint(half_length=0.3, half_width=0.15))
    scenario = Scenario.of(TASK, planner, long, footprint="exact")
    repaired, scratch = route_planner(scenario), route_planner(replace(scenario, planner=load_planner("astar")))
    made = []
    monkeypatch.setattr(
        "antdrive.sim.driving.route_planner.replanner_for", lambda *args: made.append(args) or replanner_for(*args)
    )
    repaired.mapless = not mapped
    for turn, discs in enumerate(((), (Disc(4.0, 3.0, 0.45),), (Disc(4.0, 3.0, 0.45), Disc(5.0, 4.0, 0.3)), ())):
        known = len(POSTS) if mapped else 4 * turn
        hall = replace(HALL, obstacles=POSTS[:known])
        task = replace(TASK, world=hall, start=(1.0 + 0.5 * turn, 3.0, 0.2 * turn))
        grid = outlined_grid_of(by_geometry(hall), 0.05, long.footprint, 0.03)
        seen = discs if mapped else ()
        plans = [one.around(task, grid, seen) for one in (repaired, scratch)]
        assert plans[0].solved
        assert plans[0].cost == pytest.approx(plans[1].cost)
    assert repaired.plan_error == ""
    assert [type(planner).__name__ for planner, *_ in made].count(type(scenario.planner).__name__) == 1
