"""Routes of a robot without a map among the movers that it follows: round where they will be, and where they roam."""

import dataclasses
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.base import Floats
from antdrive.planners import load_planner
from antdrive.robots import RobotSpec
from antdrive.sim import Perception, ReplanPolicy, Scenario, run
from antdrive.sim.driving.movers_ahead import SLACK, MoversSeenAhead
from antdrive.sim.driving.replan_causes import OBSTRUCTED, TRAFFIC, WAITED
from antdrive.sim.driving.traffic import FADING, FAST, TrackedTraffic
from antdrive.sim.driving.watching import Tracked
from antdrive.sim.sensing import TrackedMovers
from antdrive.worlds import Keyframed, Task, World, rasterise
from tests.sim.driving.guides import exploration_of

LIDAR = Perception(kind="lidar")
HALL = World("hall", (0.0, 0.0, 16.0, 12.0))
TASK = Task(HALL, (1.0, 6.0, 0.0), (15.0, 6.0), goal_tolerance=0.5, cell=0.25)
POSE = TASK.start
coordinate = st.floats(-20, 20)


class Seen:
    """A watch that has seen what it is told."""

    def __init__(self) -> None:
        self.tick, self.sight, self.reach = 0, 50.0, 7.5
        self.tracker = SimpleNamespace(movers=lambda: self.now, found=99)
        self.see([])

    def see(self, rows: list[tuple[float, float, float, float]], hidden: int = 0, tick: int | None = None) -> None:
        """Movers at x, y with velocities vx, vy; the last `hidden` ones were not met by the scan."""
        table = np.array(rows, dtype=np.float64).reshape(-1, 4)
        met = np.arange(len(table)) < len(table) - hidden
        self.now = TrackedMovers(
            table[:, :2], table[:, 2:], np.full(len(table), 0.4), np.arange(len(table), dtype=np.int64), met
        )
        self.tick = self.tick + 1 if tick is None else tick


def traffic_seen(robot: RobotSpec) -> tuple[TrackedTraffic, Seen]:
    watch: Any = Seen()
    return TrackedTraffic(Tracked(watch, LIDAR, 60), robot, 60), watch


def ahead(robot: RobotSpec, hits: Floats | None = None, **policy: float) -> tuple[MoversSeenAhead, Seen]:
    watch: Any = Seen()
    found = np.empty((0, 3)) if hits is None else hits
    survey: Any = SimpleNamespace(map=SimpleNamespace(trust=7.5, discs=lambda: found))
    predictor, settings = Tracked(watch, LIDAR, 60), ReplanPolicy(**policy)
    return MoversSeenAhead(predictor, survey, settings, robot, TASK.goal, robot.radius + 0.03, 60), watch


def busy(movers: MoversSeenAhead, watch: Seen, speed: float) -> None:
    """Show it ten movers between the long walls, each on another place and going north."""
    for tick in range(1, 61):
        watch.see([(3.0 + k, 3.0 + 6.0 * ((k + 0.1 * tick) % 1.0), 0.0, speed) for k in range(10)], tick=tick)
        movers.look(tick, POSE, False)


def straight(robot: RobotSpec, y: float = 6.0) -> Any:
    """A path through the hall, as the parts that are tested here know it."""
    xy = np.array([[1.0, y], [15.0, y]])
    route = SimpleNamespace(xy=xy, arc=np.array([0.0, 14.0]))
    return SimpleNamespace(route=route, length=14.0)


def test_only_movers_that_the_last_scan_met_make_the_box(jackal: RobotSpec) -> None:
    traffic, watch = traffic_seen(jackal)
    watch.see([(2.0, 3.0, 0.0, 1.0), (5.0, 4.0, 1.0, 0.0), (30.0, -9.0, 1.0, 0.0)], hidden=1)
    traffic.look(watch.tick, POSE[:2])
    assert traffic.box.tolist() == [2.0, 3.0, 5.0, 4.0]
    assert traffic.samples == 2
    watch.see([(7.0, 3.5, 1.0, 0.0)], tick=watch.tick)  # no new scan
    traffic.look(watch.tick, POSE[:2])
    assert traffic.box.tolist() == [2.0, 3.0, 5.0, 4.0]


def test_the_rate_counts_fast_movers_in_reach_on_the_ground_in_sight(jackal: RobotSpec) -> None:
    """Two movers of 1.8 m/s: each would meet robots on 2 (0.4 + R) 1.8 square metres a second."""
    traffic, watch = traffic_seen(jackal)
    slow = FAST * jackal.max_speed - 0.01
    rows = [(3.0, 5.0, 0.0, 1.8), (4.0, 7.0, -1.8, 0.0), (5.0, 5.0, slow, 0.0), (1.0 + 7.5 + 0.41, 6.0, 0.0, 1.9)]
    expected = 2 * 2 * (0.4 + jackal.radius) * 1.8 / 50.0
    for tick in range(1, 60 * 30):
        watch.see(rows, tick=tick)
        traffic.look(tick, POSE[:2])
        if tick == 6:  # a velocity that is wrong for a moment is no traffic
            assert 0 < traffic.rate(0, POSE[:2]) < 0.1 * expected
    assert traffic.rate(0, POSE[:2]) == pytest.approx(expected)
    for tick in range(watch.tick + 1, watch.tick + 1 + round(60 * FADING)):
        watch.see([], tick=tick)
        traffic.look(tick, POSE[:2])
    assert traffic.rate(0, POSE[:2]) == pytest.approx(expected * math.exp(-1), rel=1e-3)


@settings(max_examples=25)
@given(hits=st.lists(st.tuples(coordinate, coordinate), max_size=9), x=coordinate, y=coordinate, yaw=st.floats(-3, 3))
def test_without_tracks_nothing_changes(
    jackal: RobotSpec, hits: list[tuple[float, float]], x: float, y: float, yaw: float
) -> None:
    discs = np.array([(*hit, 0.03) for hit in hits]).reshape(-1, 3)
    movers, watch = ahead(jackal, discs)
    for tick in range(1, 200, 40):
        watch.see([], tick=tick)
        movers.look(tick, (x, y, yaw), False)
        assert movers.trigger(tick, (x, y, yaw), straight(jackal), 0.0) == ""
    assert not movers.heavy(200, (x, y, yaw))
    assert movers.discs(200, (x, y, yaw)) == []
    assert movers.without_trails(discs, (x, y, yaw)) is discs


def test_a_mover_on_its_way_onto_the_route_makes_a_new_one_due(jackal: RobotSpec) -> None:
    movers, watch = ahead(jackal)
    for start, trigger in (((3.0, 7.5), OBSTRUCTED), ((3.0, 9.0), ""), ((8.0, 7.5), "")):  # here, too late, too far
        watch.see([(*start, 0.0, -1.0)])
        assert movers.trigger(watch.tick, POSE, straight(jackal), 0.0) == trigger, start


def test_a_robot_that_waits_for_long_looks_for_another_way(jackal: RobotSpec) -> None:
    movers, _ = ahead(jackal, max_wait=2.0)
    due = []
    for tick in range(200):
        movers.look(tick, POSE, tick >= 10)
        due.append(movers.trigger(tick, POSE, straight(jackal), 0.0))
    assert due.index(WAITED) == pytest.approx(10 + 2 * 60, abs=1)
    assert due.count(WAITED) == 1


def test_a_route_through_busy_ground_is_due_for_a_new_one_and_one_along_the_wall_is_not(jackal: RobotSpec) -> None:
    for speed, y, trigger in ((1.8, 6.0, TRAFFIC), (1.8, 0.6, ""), (1.2, 6.0, "")):
        movers, watch = ahead(jackal, max_traffic=0.07)
        busy(movers, watch, speed)
        watch.see([])  # where they are is no matter, but where they have been
        assert movers.trigger(61, POSE, straight(jackal, y), 0.0) == trigger, (speed, y)


def test_the_largest_zone_leaves_a_lane_along_the_walls(jackal: RobotSpec) -> None:
    corners = np.array([(0.0, 0.0, 0.02), (16.0, 0.0, 0.02), (0.0, 12.0, 0.02), (16.0, 12.0, 0.02)])
    movers, watch = ahead(jackal, corners)
    busy(movers, watch, 1.8)
    assert movers.bounds((0.0, 0.0, 16.0, 12.0)) == (0.0, 0.0, 16.0, 12.0)
    grid = rasterise(HALL, 0.05, jackal.radius + 0.03)
    zones = movers.zones(60, POSE, grid)
    assert len(zones) == 3
    free = grid.free & ~zones[0].blocked
    lane = free[grid.cell_at(8.0, 0.0)[0] :, grid.cell_at(8.0, 0.0)[1]]
    below = int(np.argmin(lane[np.argmax(lane) :]))  # cells from the first free one on
    assert below * 0.05 == pytest.approx(SLACK, abs=0.06)
    assert zones[0].blocked.sum() > zones[1].blocked.sum() > zones[2].blocked.sum() > 0


@given(st.lists(st.tuples(st.floats(0, 16), st.floats(0, 12)), min_size=1, max_size=30))
def test_only_far_hits_where_movers_roam_are_left_out(jackal: RobotSpec, hits: list[tuple[float, float]]) -> None:
    movers, watch = ahead(jackal)
    watch.see([(4.0, 3.0, 0.0, 1.0), (12.0, 9.0, 0.0, 1.0)])
    movers.look(watch.tick, POSE, False)
    discs = np.array([(*hit, 0.02) for hit in hits])
    kept = [hit for hit in hits if not (4 < hit[0] < 12 and 3 < hit[1] < 9 and math.dist(hit, POSE[:2]) > 7.5)]
    assert movers.without_trails(discs, POSE)[:, :2].tolist() == [list(hit) for hit in kept]


def unknown(robot: RobotSpec, planner: str = "dstar-lite", **settings: Any) -> Scenario:
    given = {"map": "none", "localisation": "matching", "perception": LIDAR, "noise": 1.0, **settings}
    return Scenario(task=TASK, planner=load_planner(planner), planner_name=planner, robot=robot, **given)


@pytest.mark.parametrize("planner", ["dstar-lite", "astar", "tangent"])
def test_plans_lead_round_busy_ground_and_off_movers(jackal: RobotSpec, planner: str) -> None:
    """The first scan sees the hall; tracks that are told it then stand for movers."""
    exploration = exploration_of(unknown(jackal, planner))
    movers = exploration._movers
    assert movers is not None
    watch = exploration.survey.watch = Seen()  # type: ignore[assignment]
    movers._predictor.watch = watch  # type: ignore[assignment]
    _, plan, avoided = exploration._plan_around(0, POSE)
    assert (avoided, plan.cost) == ([], pytest.approx(14.0, abs=0.1))
    watch.see([(3.0, 6.0, 0.0, 0.0)])
    _, plan, avoided = exploration._plan_around(watch.tick, POSE)
    assert len(avoided) > 0
    assert 14.1 < plan.cost < 16.0
    busy(movers, watch, 1.8)  # type: ignore[arg-type]
    _, plan, _ = exploration._plan_around(60, POSE)
    assert plan.cost > 18.0
    for pose in (POSE, (5.0, 9.0, 0.0)):  # beside it, and in it: straight out
        grid, plan, avoided = exploration._plan_around(60, pose)
        if planner != "tangent":  # which knows no cells, and what bounds the ground alone
            assert any(not zone.blocked[tuple(plan.cells.T)].any() for zone in movers.zones(60, pose, grid))
        route, _ = exploration._route(pose, grid, plan, avoided)
        arcs = np.arange(0.0, route.length, 0.05)
        points = np.stack([np.interp(arcs, route.arc, route.xy[:, k]) for k in (0, 1)], axis=1)
        gaps = [np.hypot(*(points - (disc.x, disc.y)).T).min() - disc.radius for disc in avoided]
        assert min(gaps) > grid.inflate - 0.01


def test_a_policy_may_leave_movers_to_local_avoidance(jackal: RobotSpec) -> None:
    for policy in (None, ReplanPolicy(around_movers=False)):
        assert exploration_of(unknown(jackal, replanning=policy))._movers is None
    assert exploration_of(unknown(jackal, localisation="fixes", perception=Perception()))._movers is None


@pytest.mark.slow
def test_a_robot_without_a_map_drives_round_busy_ground(jackal: RobotSpec) -> None:
    """Ten shuttles, as fast as the robot nearly, which stay 3.5 m off the long walls; the robot sees them from 4 m off."""
    shuttles = tuple(
        Keyframed(
            radius=0.4,
            keyframes=((0.0, 5.0 + 0.9 * k, 5.5), (4.0, 5.0 + 0.9 * k, 12.5)),
            loop="pingpong",
            phase=2.3 * k,
        )
        for k in range(10)
    )
    hall = World("hall", (0.0, 0.0, 16.0, 18.0), movers=shuttles)
    task = Task(hall, (1.0, 9.0, 0.0), (15.0, 9.0), goal_tolerance=0.5, cell=0.25)
    done = run(dataclasses.replace(unknown(jackal), task=task))
    assert done.rollout is not None
    assert done.succeeded, (done.outcome, done.reason)
    middle = done.rollout.pose[np.abs(done.rollout.pose[:, 0] - 8.0) < 2.0]
    assert np.abs(middle[:, 1] - 9.0).min() > 4.0
