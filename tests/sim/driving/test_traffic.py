"""Routes around zones of movers, by ground truth or by lidar."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.planners import load_planner
from antdrive.sim import Outcome, Perception, ReplanPolicy, Scenario, run
from antdrive.sim.compose import compose
from antdrive.sim.driving.movers_ahead import (
    FADING,
    FAST,
    MIXING,
    SLACK,
    MoversAhead,
    MoversSeenAhead,
    TrackedTraffic,
    Traffic,
    Zone,
)
from antdrive.sim.driving.perceived_movers import PerceivedMovers, Tracked
from antdrive.sim.policy import Trigger
from antdrive.sim.sensing import TrackedMovers
from antdrive.worlds import Cruising, Disc, Keyframed, Task, Trajectories, World, import_dynabarn, rasterise
from tests.records import COARSE, changed
from tests.sim.driving.ground_truth import GroundTruth, observed
from tools.shared_data import DYNABARN

HALL = World("hall", (0.0, 0.0, 16.0, 12.0))
TASK = Task(HALL, (1.0, 6.0, 0.0), (15.0, 6.0), cell=0.25)
GRID = rasterise(HALL, 0.25, 0.25)
coordinate = st.floats(-1, 17)


def shuttle(x, speed=1.0, phase=0.0):
    """A mover that goes to and fro across the middle of the hall."""
    frames = ((0.0, x, 2.5), (7.0 / speed, x, 9.5))
    return Keyframed(radius=0.4, keyframes=frames, loop="pingpong", phase=phase)


SHUTTLES = tuple(shuttle(3.0 + 0.9 * k, 1.2, phase=4.7 * k) for k in range(11))
SLOW = tuple(shuttle(3.0 + 0.9 * k, speed=0.2, phase=4.7 * k) for k in range(3))


def traffic_of(*movers, kind="velocities", reach=math.inf):
    motions = Trajectories.of(replace(HALL, movers=movers), (1.0, 6.0))
    return Traffic(GroundTruth(motions, Perception(kind=kind, range=reach)), 0.2, HALL.bounds, 60)


def note(traffic, tick, robot=(1.0, 6.0)):
    traffic._movers.at(tick, robot)
    traffic.observe()


def among(*movers, robot, **settings):
    task = changed(TASK, "world", movers=movers)
    scenario = Scenario.of(task, "dstar-lite", robot, **COARSE, **settings)
    return run(scenario)


def test_the_box_holds_every_place_that_was_seen_and_no_more():
    traffic = traffic_of(*SHUTTLES, reach=5.0)
    seen = []
    motions = Trajectories.of(replace(HALL, movers=SHUTTLES), (1.0, 6.0))
    for tick in range(0, 300, 7):
        robot = (1.0 + 0.02 * tick, 6.0)
        note(traffic, tick, robot)
        places = motions.positions(tick / 60)[0]
        seen += [p for p, r in zip(places, motions.radii, strict=True) if math.dist(p, robot) - r <= 5.0]
    expected = np.concatenate((np.min(seen, axis=0), np.max(seen, axis=0)))
    np.testing.assert_allclose(traffic.box, expected)


def test_a_box_has_grown_only_when_a_mover_was_seen_farther_out():
    traffic = traffic_of(shuttle(5.0), shuttle(8.0))
    assert not traffic.grown(0.1), "nothing was seen yet"
    note(traffic, 0)
    assert traffic.grown(0.1)
    traffic.zones((15.0, 6.0), GRID)
    assert not traffic.grown(0.1)
    note(traffic, 30)
    assert traffic.grown(0.4)
    assert not traffic.grown(0.6)


def test_the_rate_is_that_of_movers_meeting_robots_put_down_at_random():
    """Brute force: on a fine lattice, how many standing robots each mover meets in a second."""
    movers = (shuttle(4.0, 1.3), Cruising(radius=0.25, position=(9.0, 5.0), velocity=(0.6, -0.7)))
    side = 0.02
    x, y = np.meshgrid(np.arange(0, 16, side), np.arange(0, 12, side))
    motions = Trajectories.of(replace(HALL, movers=movers), (1.0, 6.0))
    begin, end = motions.positions(1.0)[0], motions.positions(2.0)[0]
    met = 0
    for a, b, r in zip(begin, end, motions.radii, strict=True):
        share = np.clip(((x - a[0]) * (b - a)[0] + (y - a[1]) * (b - a)[1]) / ((b - a) @ (b - a)), 0, 1)
        swept = np.hypot(x - a[0] - share * (b - a)[0], y - a[1] - share * (b - a)[1]) < r + 0.2
        met += int((swept & (np.hypot(x - a[0], y - a[1]) >= r + 0.2)).sum())
    rates = []
    for kind in ("velocities", "positions"):
        traffic = traffic_of(*movers, kind=kind)
        note(traffic, 60)
        rates.append(traffic.rate)
    assert rates == [pytest.approx(met * side**2 / (16 * 12), rel=0.02), 0.0]


def test_few_places_make_a_box_that_is_grown_and_many_one_as_seen():
    """For n places drawn evenly from an interval, the highest lies 1 / (n + 1) of it below its end on average."""
    rng = np.random.default_rng(0)
    draws = rng.uniform(0.0, 1.0, (20_000, 11))
    spread = np.ptp(draws, axis=1)
    grown = draws.max(axis=1) + spread / 12
    assert grown.mean() == pytest.approx(1.0, abs=0.02)
    traffic = traffic_of(*SHUTTLES)
    boxes = []
    for tick in range(1200):
        note(traffic, tick)
        if tick in (0, 1199):
            boxes.append([zone._box for zone in traffic.zones((15.0, 6.0), GRID)])
    assert traffic.samples == pytest.approx(11 + 11 * 1199 / (60 * MIXING))
    for (larger, seen), n in zip(boxes, (11, traffic.samples), strict=True):
        np.testing.assert_allclose(larger[2:] - seen[2:], (seen[2:] - seen[:2]) / (n + 1))
        np.testing.assert_allclose(seen[:2] - larger[:2], (seen[2:] - seen[:2]) / (n + 1))


@given(robot=st.tuples(coordinate, coordinate), goal=st.tuples(coordinate, coordinate), radius=st.floats(0.1, 0.6))
def test_a_zone_blocks_what_lies_in_its_box_off_the_ways_of_the_ends(robot, goal, radius):
    box, half = np.array([4.0, 3.0, 12.0, 9.0]), 2 * GRID.cell
    zone = Zone(box, radius, robot, goal, GRID)
    reach = radius + GRID.inflate

    def inside(p):
        return float(min(p[0] - box[0], box[2] - p[0], p[1] - box[1], box[3] - p[1])) + reach

    for cell in np.argwhere(GRID.free)[::17]:
        centre = GRID.xy(cell[None])[0]
        expected = inside(centre) > 0
        if inside(np.array(robot)) > 0:
            expected &= math.dist(centre, robot) > inside(np.array(robot)) + half
        depth = inside(np.array(goal))
        if depth > 0:  # straight out, on the nearest side
            sides = [(-1, 0), (0, -1), (1, 0), (0, 1)]
            gaps = [goal[0] - box[0], goal[1] - box[1], box[2] - goal[0], box[3] - goal[1]]
            out = np.array(goal) + np.array(sides[int(np.argmin(gaps))]) * depth
            way = np.array(goal) + np.linspace(0, 1, 400)[:, None] * (out - goal)
            off = float(np.hypot(*(way - centre).T).min())
            if abs(off - half) < 0.02:
                continue  # the sampled way is not exact enough here
            expected &= off > half
        assert zone.blocked[tuple(cell)] == expected
    for disc in zone.discs:
        assert inside(np.array([disc.x, disc.y])) >= reach - 1e-9
        assert (
            math.dist((disc.x, disc.y), goal) >= disc.radius + GRID.inflate + half - 1e-9 or inside(np.array(goal)) <= 0
        )


def test_a_prediction_beyond_the_box_is_not_believed():
    zone = Zone(np.array([4.0, 3.0, 12.0, 9.0]), 0.4, (1.0, 6.0), (15.0, 6.0), GRID)
    assert zone.holds(Disc(11.9, 5.0, 0.4))
    assert not zone.holds(Disc(12.3, 5.0, 0.4))


@pytest.fixture(scope="module")
def quiet(turtlebot):
    """A drive among slow movers, of which few cross the hall."""
    return among(*SLOW, robot=turtlebot)


def test_the_robot_goes_round_busy_ground_and_through_quiet_ground(turtlebot, quiet):
    """The shuttles stay 2 m off the long walls."""
    for done, goes_round in ((among(*SHUTTLES, robot=turtlebot), True), (quiet, False)):
        assert done.succeeded, (done.outcome, done.reason)
        middle = np.abs(done.rollout.pose[:, 0] - 8) < 2
        assert (np.abs(done.rollout.pose[middle, 1] - 6).min() > 3.5) == goes_round
        assert ("traffic" in {replan.trigger for replan in done.rollout.record.replans}) == goes_round


def test_without_traffic_above_the_limit_nothing_changes(turtlebot, quiet):
    one, other = quiet.rollout, among(*SLOW, robot=turtlebot, replanning=ReplanPolicy(max_traffic=1e9)).rollout
    assert (one.pose.tobytes(), one.command.tobytes()) == (other.pose.tobytes(), other.command.tobytes())


@pytest.mark.parametrize(
    "settings", [{"perception": Perception(kind="motions")}, {"replanning": ReplanPolicy(max_detour=1.0)}]
)
def test_a_robot_that_knows_the_motions_or_may_not_go_far_round_goes_through(turtlebot, settings):
    done = among(*SHUTTLES, robot=turtlebot, time_limit=14.0, **settings)
    assert np.abs(done.rollout.pose[:, 1] - 6).max() < 3.5


@pytest.mark.slow
@pytest.mark.skipif(not DYNABARN.exists(), reason="needs DynaBARN's worlds (docs/how-to/data.md)")
def test_nearly_all_drives_in_the_hard_worlds_of_dynabarn_arrive(jackal):
    """Moments that benchmarks.dynamic does not use. Movers jump onto a robot, or past it closer than a certificate allows."""
    hard = [task for task in import_dynabarn(DYNABARN) if int(task.world.name.split("-")[1]) >= 40]
    moments = [replace(task, world=task.world.later(t)) for task in hard for t in (7.4, 16.0)]
    planner = load_planner("dstar-lite")
    done = [run(Scenario(task=task, planner=planner, planner_name="dstar-lite", robot=jackal)) for task in moments]
    outcomes = [each.outcome for each in done]
    assert len(done) == 6
    assert sum(each.succeeded for each in done) >= 5, outcomes
    assert Outcome.COLLIDED not in outcomes


LIDAR = Perception(kind="lidar")
ACROSS = Task(HALL, (1.0, 6.0, 0.0), (15.0, 6.0), goal_tolerance=0.5, cell=0.25)
POSE = ACROSS.start
anywhere = st.floats(-20, 20)


class Seen:
    """Stub of mover tracking with given tracks."""

    def __init__(self):
        self.tick, self.sight, self.reach, self.hz = 0, 50.0, 7.5, 60
        self.tracker = SimpleNamespace(movers=lambda: self.now, found=99)
        self.see([])

    def see(self, rows, hidden=0, tick=None):
        """Movers at x, y with velocities vx, vy; the last `hidden` ones were not met by the scan."""
        table = np.array(rows, dtype=np.float64).reshape(-1, 4)
        met = np.arange(len(table)) < len(table) - hidden
        self.now = TrackedMovers(
            table[:, :2], table[:, 2:], np.full(len(table), 0.4), np.arange(len(table), dtype=np.int64), met
        )
        self.tick = self.tick + 1 if tick is None else tick


def traffic_seen(robot):
    tracking = Seen()
    return TrackedTraffic(Tracked(tracking, LIDAR), robot, 60), tracking


def look(watching, tick, pose=POSE, *waiting):
    """Let traffic, or movers ahead, observe a control period."""
    watching._movers.read(observed(tick, pose))
    watching.observe(*waiting)


def seen_from(exploration, pose):
    """The exploration of a robot that has just observed where it is."""
    tick = exploration.survey.tracking.tick
    exploration._movers._movers.read(observed(tick, pose))
    return exploration


def ahead(robot, hits=None, **policy):
    tracking = Seen()
    found = np.empty((0, 3)) if hits is None else hits
    survey = SimpleNamespace(map=SimpleNamespace(trust=7.5, discs=lambda: found))
    predictor, settings = Tracked(tracking, LIDAR), ReplanPolicy(**policy)
    return MoversSeenAhead(predictor, survey, settings, robot, ACROSS.goal, robot.radius + 0.03), tracking


def busy(movers, tracking, speed):
    """Show it ten movers between the long walls, each on another place and going north."""
    for tick in range(1, 61):
        tracking.see([(3.0 + k, 3.0 + 6.0 * ((k + 0.1 * tick) % 1.0), 0.0, speed) for k in range(10)], tick=tick)
        look(movers, tick, POSE, False)


def straight(robot, y=6.0):
    """A path through the hall, as the parts that are tested here know it."""
    xy = np.array([[1.0, y], [15.0, y]])
    route = SimpleNamespace(xy=xy, arc=np.array([0.0, 14.0]))
    return SimpleNamespace(route=route, length=14.0)


def test_only_movers_that_the_last_scan_met_make_the_box(jackal):
    traffic, tracking = traffic_seen(jackal)
    tracking.see([(2.0, 3.0, 0.0, 1.0), (5.0, 4.0, 1.0, 0.0), (30.0, -9.0, 1.0, 0.0)], hidden=1)
    look(traffic, tracking.tick)
    assert traffic.box.tolist() == [2.0, 3.0, 5.0, 4.0]
    assert traffic.samples == 2
    tracking.see([(7.0, 3.5, 1.0, 0.0)], tick=tracking.tick)  # no new scan
    look(traffic, tracking.tick)
    assert traffic.box.tolist() == [2.0, 3.0, 5.0, 4.0]


def test_the_rate_counts_fast_movers_in_reach_on_the_ground_in_sight(jackal):
    """Two movers of 1.8 m/s: each would meet robots on 2 (0.4 + R) 1.8 square metres a second."""
    traffic, tracking = traffic_seen(jackal)
    slow = FAST * jackal.max_speed - 0.01
    rows = [(3.0, 5.0, 0.0, 1.8), (4.0, 7.0, -1.8, 0.0), (5.0, 5.0, slow, 0.0), (1.0 + 7.5 + 0.41, 6.0, 0.0, 1.9)]
    expected = 2 * 2 * (0.4 + jackal.radius) * 1.8 / 50.0
    for tick in range(1, 60 * 30):
        tracking.see(rows, tick=tick)
        look(traffic, tick)
        if tick == 6:  # a velocity that is wrong for a moment is no traffic
            assert 0 < traffic.rate < 0.1 * expected
    assert traffic.rate == pytest.approx(expected)
    for tick in range(tracking.tick + 1, tracking.tick + 1 + round(60 * FADING)):
        tracking.see([], tick=tick)
        look(traffic, tick)
    assert traffic.rate == pytest.approx(expected * math.exp(-1), rel=1e-3)


@settings(max_examples=25)
@given(hits=st.lists(st.tuples(anywhere, anywhere), max_size=9), x=anywhere, y=anywhere, yaw=st.floats(-3, 3))
def test_without_tracks_nothing_changes(jackal, hits, x, y, yaw):
    discs = np.array([(*hit, 0.03) for hit in hits]).reshape(-1, 3)
    movers, tracking = ahead(jackal, discs)
    for tick in range(1, 200, 40):
        tracking.see([], tick=tick)
        look(movers, tick, (x, y, yaw), False)
        assert movers.trigger(straight(jackal), 0.0) == ""
    assert not movers.heavy
    assert movers.discs() == []
    assert movers.without_trails(discs, (x, y, yaw)) is discs


def test_a_mover_on_its_way_onto_the_route_makes_a_new_one_due(jackal):
    movers, tracking = ahead(jackal)
    for start, trigger in (
        ((3.0, 7.5), Trigger.OBSTRUCTED),
        ((3.0, 9.0), ""),
        ((8.0, 7.5), ""),
    ):  # here, too late, too far
        tracking.see([(*start, 0.0, -1.0)])
        look(movers, tracking.tick, POSE, False)
        assert movers.trigger(straight(jackal), 0.0) == trigger, start


def test_a_long_wait_triggers_a_replan(jackal):
    movers, _ = ahead(jackal, max_wait=2.0)
    due = []
    for tick in range(200):
        look(movers, tick, POSE, tick >= 10)
        due.append(movers.trigger(straight(jackal), 0.0))
    assert due.index(Trigger.WAITED) == pytest.approx(10 + 2 * 60, abs=1)
    assert due.count(Trigger.WAITED) == 1


def test_a_route_through_busy_ground_is_due_for_a_new_one_and_one_along_the_wall_is_not(jackal):
    for speed, y, trigger in ((1.8, 6.0, Trigger.TRAFFIC), (1.8, 0.6, ""), (1.2, 6.0, "")):
        movers, tracking = ahead(jackal, max_traffic=0.07)
        busy(movers, tracking, speed)
        tracking.see([])  # where they are is no matter, but where they have been
        assert movers.trigger(straight(jackal, y), 0.0) == trigger, (speed, y)


def test_the_largest_zone_leaves_a_lane_along_the_walls(jackal):
    corners = np.array([(0.0, 0.0, 0.02), (16.0, 0.0, 0.02), (0.0, 12.0, 0.02), (16.0, 12.0, 0.02)])
    movers, tracking = ahead(jackal, corners)
    busy(movers, tracking, 1.8)
    assert movers.bounds((0.0, 0.0, 16.0, 12.0)) == (0.0, 0.0, 16.0, 12.0)
    grid = rasterise(HALL, 0.05, jackal.radius + 0.03)
    zones = movers.zones(grid)
    assert len(zones) == 3
    free = grid.free & ~zones[0].blocked
    lane = free[grid.cell_at(8.0, 0.0)[0] :, grid.cell_at(8.0, 0.0)[1]]
    below = int(np.argmin(lane[np.argmax(lane) :]))  # cells from the first free one on
    assert below * 0.05 == pytest.approx(SLACK, abs=0.06)
    assert zones[0].blocked.sum() > zones[1].blocked.sum() > zones[2].blocked.sum() > 0


@given(st.lists(st.tuples(st.floats(0, 16), st.floats(0, 12)), min_size=1, max_size=30))
def test_only_far_hits_where_movers_roam_are_left_out(jackal, hits):
    movers, tracking = ahead(jackal)
    tracking.see([(4.0, 3.0, 0.0, 1.0), (12.0, 9.0, 0.0, 1.0)])
    look(movers, tracking.tick, POSE, False)
    discs = np.array([(*hit, 0.02) for hit in hits])
    kept = [hit for hit in hits if not (4 < hit[0] < 12 and 3 < hit[1] < 9 and math.dist(hit, POSE[:2]) > 7.5)]
    assert movers.without_trails(discs, POSE)[:, :2].tolist() == [list(hit) for hit in kept]


def unknown(robot, planner="dstar-lite", **settings):
    given = {"map": "none", "localisation": "matching", "perception": LIDAR, "noise": 1.0, **settings}
    return Scenario.of(ACROSS, planner, robot, **given)


@pytest.mark.parametrize("planner", ["dstar-lite", "astar", "tangent"])
def test_plans_lead_round_busy_ground_and_off_movers(jackal, planner):
    """The first scan sees the hall; tracks that are told it then stand for movers."""
    exploration = compose(unknown(jackal, planner))[1]
    movers = exploration._movers
    tracking = exploration.survey.tracking = Seen()
    movers._movers.tracking = tracking
    _, plan, avoided = seen_from(exploration, POSE)._plan_around(POSE, "obstructed")
    assert (avoided, plan.cost) == ([], pytest.approx(14.0, abs=0.1))
    tracking.see([(3.0, 6.0, 0.0, 0.0)])
    _, plan, avoided = seen_from(exploration, POSE)._plan_around(POSE, "obstructed")
    assert len(avoided) > 0
    assert 14.1 < plan.cost < 16.0
    busy(movers, tracking, 1.8)
    _, plan, _ = seen_from(exploration, POSE)._plan_around(POSE, "obstructed")
    assert plan.cost > 18.0
    for pose in (POSE, (5.0, 9.0, 0.0)):  # beside it, and in it: straight out
        grid, plan, avoided = seen_from(exploration, pose)._plan_around(pose, "obstructed")
        if planner != "tangent":  # which knows no cells, and what bounds the ground alone
            assert any(not zone.blocked[tuple(plan.cells.T)].any() for zone in movers.zones(grid))
        route, _ = exploration._route(pose, grid, plan, avoided)
        arcs = np.arange(0.0, route.length, 0.05)
        points = np.stack([np.interp(arcs, route.arc, route.xy[:, k]) for k in (0, 1)], axis=1)
        gaps = [np.hypot(*(points - (disc.x, disc.y)).T).min() - disc.radius for disc in avoided]
        assert min(gaps) > grid.inflate - 0.01


def test_a_policy_may_leave_movers_to_local_avoidance(jackal):
    assert compose(unknown(jackal, replanning=ReplanPolicy(around_movers=False)))[1]._movers is None
    assert compose(unknown(jackal, localisation="fixes", perception=Perception()))[1]._movers is None


@pytest.mark.slow
def test_a_robot_without_a_map_drives_round_busy_ground(jackal):
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
    done = run(replace(unknown(jackal), task=task))
    assert done.succeeded, (done.outcome, done.reason)
    middle = done.rollout.pose[np.abs(done.rollout.pose[:, 0] - 8.0) < 2.0]
    assert np.abs(middle[:, 1] - 9.0).min() > 4.0


class AlwaysObstructed(MoversAhead):
    """Movers that obstruct every route."""

    def _obstructed(self, *_):
        return True


@given(way=st.lists(st.floats(1.0, 15.0), min_size=1, max_size=60))
def test_movers_make_at_most_three_replans_for_a_metre_of_progress(way):
    """The robot jumps to and fro on a line; only ground nearer to its goal than ever is progress."""
    movers = AlwaysObstructed(PerceivedMovers(Perception()), ReplanPolicy(), (15.0, 6.0), GRID, None)
    reached, replanned = 0.0, []
    for tick, x in enumerate(way):
        pose = (x, 6.0, 0.0)
        reached = max(reached, x)
        look(movers, tick, pose, False)
        if movers.trigger(None, 0.0):
            replanned.append(reached)
    assert all(after - before >= 1.0 - 1e-9 for before, after in zip(replanned, replanned[3:], strict=False))
    assert len(replanned) >= min(3, len(way))


def test_a_robot_that_has_waited_replans_again():
    movers = AlwaysObstructed(PerceivedMovers(Perception()), ReplanPolicy(), (15.0, 6.0), GRID, None)
    due = []
    for tick in range(360):
        look(movers, tick, POSE, True)
        due.append(movers.trigger(None, 0.0))
    assert [each for each in due if each] == [Trigger.OBSTRUCTED] * 3 + [Trigger.WAITED] * 2
