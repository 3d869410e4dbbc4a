"""Mapless drives: mapping, replanning, scan turns and recovery."""

import math
from dataclasses import replace
from types import SimpleNamespace

import hypothesis
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.planners import PlanResult, PlanStatus
from antdrive.robots import PursuitState, Twist
from antdrive.robots.control.observation import Briefing, FirstSight, Observation
from antdrive.robots.default_margin import SQUEEZED, TURNABLE
from antdrive.sim import Outcome, Rollout, Scenario, certify, run
from antdrive.sim.compose import compose, mapless_task
from antdrive.sim.driving._kernels_hits import beside, check, near_polyline, point_at, surrounding
from antdrive.sim.driving.driver import Driver
from antdrive.sim.driving.exploring import INTERVAL
from antdrive.sim.driving.guide import Follow
from antdrive.sim.driving.mover_tracking import MoverTracking
from antdrive.sim.driving.parts import Step
from antdrive.sim.driving.recovery import IDLE_TIME, Recovery, ScanTurn
from antdrive.sim.driving.route_planner import RoutePlanner, bounds_of
from antdrive.sim.driving.stopping_constraint import StoppingConstraint
from antdrive.sim.driving.survey import Survey, reset_ticks
from antdrive.sim.log.record import ReplanRecord
from antdrive.sim.policy import Perception, Trigger
from antdrive.sim.recorded import rebuilt
from antdrive.sim.sensing import Scanner
from antdrive.views.map_reconstruction import MapReconstruction
from antdrive.worlds import Cruising, Disc, Route, Task, World, generate, load_task, rasterise
from tests.records import changed
from tests.sim.driving.ground_truth import moment
from tests.worlds.oracles import segment_distances

POSTS = tuple(Disc(3.0, 0.15 * k, 0.075) for k in range(14))  # a row that leaves a gap at the top
ROOM = World("room", (0.0, 0.0, 6.0, 4.0), POSTS)
TASK = Task(ROOM, (0.8, 0.8, 0.0), (5.2, 0.8), goal_tolerance=0.25, cell=0.1)


def scenario(robot, task=TASK, planner="astar", **settings):
    given = {"map": "none", "localisation": "matching", "noise": 1.0, **settings}
    return Scenario.of(task, planner, robot, **given)


@pytest.fixture(scope="module")
def drive(jackal):
    return run(scenario(jackal))


@pytest.fixture(scope="module")
def log(drive):
    return drive.rollout


def test_the_robot_finds_the_gap_and_touches_nothing(drive, log):
    assert drive.succeeded, (drive.outcome, drive.reason, drive.certificate)
    assert log.pose[:, 1].max() > 2.3  # where the gap is
    assert log.record.sensing.map == "none"


@pytest.mark.parametrize("planner", ["astar", "dstar-lite"])
def test_replans_see_the_grid_of_the_whole_map(jackal, planner, monkeypatch):
    """Updated grids equal rasterised ones."""
    compared = []

    def observed(routes, world, margin):
        grid = inner(routes, world, margin)
        whole = rasterise(world, routes.cell, routes.robot.radius + margin)
        compared.append(np.array_equal(grid.free, whole.free) and np.array_equal(grid.moves, whole.moves))
        return grid

    inner = RoutePlanner.observed
    monkeypatch.setattr(RoutePlanner, "observed", observed)
    seen = run(scenario(jackal, planner=planner, noise=0.0, localisation="true"))
    assert seen.succeeded
    assert len(compared) >= 2
    assert all(compared)


def test_the_first_grid_does_not_follow_the_map(jackal):
    guide = compose(scenario(jackal))[1]
    grid, _ = guide.first()
    free, moves = grid.free.copy(), grid.moves.copy()
    guide._routes.observed(World("more", bounds_of(grid), (Disc(2.0, 2.0, 0.5),)), grid.inflate - jackal.radius)
    guide.plan(TASK.start)
    np.testing.assert_array_equal(grid.free, free)
    np.testing.assert_array_equal(grid.moves, moves)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 200), st.floats(0.0, 1.0))
def test_discs_near_a_polyline_are_those_by_force(seed, points, distance):
    rng = np.random.default_rng(seed)
    line = np.cumsum(rng.normal(0, 0.5, (points, 2)), axis=0)
    discs = np.column_stack([rng.uniform(line.min() - 2, line.max() + 2, (60, 2)), rng.uniform(0.01, 0.5, 60)])
    apart = segment_distances(discs[:, :2], line[:-1], line[1:]).min(axis=0) - discs[:, 2] - distance
    found = near_polyline(line, discs, distance)
    kept = (discs[:, None] == found[None]).all(axis=2).any(axis=1)
    sure = np.abs(apart) > 1e-9
    np.testing.assert_array_equal(kept[sure], apart[sure] < 0)
    np.testing.assert_array_equal(discs[kept], found)


def test_the_log_holds_scans_and_what_was_seen(log, tmp_path):
    per_second = len(log.scans) / log.t[-1]
    assert per_second == pytest.approx(50, rel=0.02)
    assert log.scans.shape[1] == 720
    # A box of walls is never out of range; row 0 looks at the row of posts 2.2 m ahead.
    assert log.scans.min() > 1
    assert log.scans[0, 360] == pytest.approx(1000 * (3.0 - 0.075 - 0.8 - 0.055), abs=30)
    x, y, radius = log.seen[log.seen[:, 0] == 0][:, 1:].T  # each disc of the first plan lies on a post or a wall
    walls = np.minimum(np.minimum(x, 6 - x), np.minimum(y, 4 - y))
    posts = np.min([np.hypot(x - d.x, y - d.y) - d.radius for d in POSTS], axis=0)
    assert np.abs(np.minimum(walls, posts)).max() < 0.02
    assert radius.max() < 0.02
    path = log.save(tmp_path / "log.npz")
    assert path.stat().st_size / log.t[-1] < 0.3e6  # bytes a second: 3 MB in ten seconds
    again = Rollout.load(path)
    assert again.digest == log.digest
    assert np.array_equal(again.scans, log.scans)
    broken = replace(log, scans=log.scans[:, :-1])
    assert any("beams" in problem for problem in broken.problems())


def test_scans_keep_the_estimate_near_the_truth(log):
    off = np.hypot(*(log.estimate - log.pose)[:, :2].T)
    assert 0 < off.max() < 0.06


def turning_room(robot, side):
    """A robot at rest on a route with a turn by 90 degrees; a post almost closes the turn."""
    corner = math.radians(45) + math.atan2(robot.footprint.half_width, robot.footprint.half_length)
    away = robot.radius + side + 0.05
    post = Disc(3.0 + away * math.cos(corner), 2.0 + away * math.sin(corner), 0.05)
    world = World("room", (0.0, 0.0, 6.0, 6.0), (post,))
    guide = compose(scenario(robot, Task(world, (3.0, 2.0, 0.0), (3.0, 5.0)), footprint="exact"))[1]
    route = Route(np.array([(3.0, 2.0), (3.0, 5.0)]), kind="taut", turns=np.array([math.pi / 2, 0.0]))
    tracked = guide._prepare(route, world, side)
    command, state = Twist(0.0, 0.0), PursuitState()
    for _ in range(5):
        command, state = guide._routes.controller.pursue(tracked, (3.0, 2.0, 0.0), command, state)
    return command.yaw_rate


def test_the_controller_makes_the_turns_of_plans_for_the_footprint(jackal):
    assert turning_room(jackal, TURNABLE - 0.003) > 0  # some of it is for the position at which the robot stops
    assert turning_room(jackal, TURNABLE - 0.012) == 0  # it refuses turns of plans closer to hits


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_plans_for_the_footprint_keep_less_margin_only_without_a_path(jackal, noise, monkeypatch):
    """Room for the controller's turns comes before none at all, and that before plans closer to scattered hits."""
    guide, margins = compose(scenario(jackal, footprint="exact", noise=noise))[1], []

    def around(task, grid, avoided):
        margins.append(grid.turns.outline.reach - jackal.footprint.rounding)
        return PlanResult(status=PlanStatus.NO_PATH)

    monkeypatch.setattr(guide._routes, "around", around)
    guide.plan(TASK.start)
    assert margins == pytest.approx([*guide._routes.outline_margins, TURNABLE, 0.0, SQUEEZED])


def test_scattered_hits_do_not_close_a_passage_and_the_record_keeps_no_margin(jackal):
    """Two posts leave 1 cm less than the robot is wide."""
    half = jackal.footprint.half_width - 0.005
    posts = tuple(Disc(3.0, 2.025 + side * (half + 0.2 + 0.4 * k), 0.2) for side in (-1, 1) for k in range(6))
    world = World("passage", (0.0, 0.0, 6.0, 4.0), posts)
    guide = compose(scenario(jackal, Task(world, (1.0, 2.025, 0.0), (5.0, 2.025)), footprint="exact"))[1]
    guide._known = lambda pose, bounds: replace(guide._task, world=world, start=pose)
    grid, plan = guide.plan((1.0, 2.025, 0.0))
    assert plan.solved
    assert grid.turns.outline.reach == pytest.approx(jackal.footprint.rounding + SQUEEZED)
    assert guide.footprint_margin == 0.0


@pytest.mark.parametrize(("yaw", "margin"), [(math.pi / 2, 0.03), (0.0, 0.0)])
def test_a_rotation_at_the_beginning_of_a_route_counts_as_length(jackal, yaw, margin, monkeypatch):
    """The way without margin leads to the right, and the other one up."""
    guide = compose(scenario(jackal, margin=0.03))[1]

    def around(task, grid, avoided):
        tight = grid.inflate < jackal.radius + 0.01
        ends = np.array([[0.0, 0.0], [0.0, 30.0] if tight else [30.0, 0.0]])
        return PlanResult(status=PlanStatus.SOLVED, cells=ends.astype(int), cost=10.0 if tight else 11.0)

    monkeypatch.setattr(guide._routes, "around", around)
    pose = (*guide._grid(guide._known(TASK.start, guide._bounds(4.0, TASK.start)), 0.03).xy(np.zeros((1, 2)))[0], yaw)
    monkeypatch.setattr(guide, "_known", lambda pose, bounds, known=guide._known: known(TASK.start, bounds))
    grid, _ = guide.plan(pose)
    assert grid.inflate == pytest.approx(jackal.radius + margin)


def test_rotations_count_as_length_and_are_begun_on_the_way_only_without_movers(jackal):
    guide = compose(scenario(jackal, margin=0.03))[1]
    grid, plan = guide.first()
    _, tracked = guide.route(grid, plan)
    away = (*TASK.start[:2], TASK.start[2] + math.pi)
    assert guide._turn_cost(TASK.start, grid, plan) == 0.0
    assert guide._turn_cost(away, grid, plan) > 1.0
    assert tracked.tuning.turn_in_clearance < 1.0
    guide._movers = NoMovers()
    assert guide._turn_cost(away, grid, plan) == 0.0
    assert guide.route(grid, plan)[1].tuning.turn_in_clearance == math.inf


class NoMovers:
    def without_trails(self, discs, pose):
        return discs


@pytest.mark.parametrize(
    ("pose", "led", "outlined"),
    [
        ((0.8, 0.8, 0.0), True, [False, True]),  # room for the disc
        ((2.62, 0.8, 0.0), False, [False, True]),  # closer to a post than the disc's radius
        ((2.62, 0.8, 0.0), True, [True, False]),
    ],
)
def test_where_the_disc_does_not_fit_the_footprint_leads_on(jackal, pose, led, outlined, monkeypatch):
    guide, found = compose(scenario(jackal))[1], []

    def around(task, grid, avoided):
        found.append(bool(grid.turns))
        return PlanResult(status=PlanStatus.NO_PATH)

    monkeypatch.setattr(guide._routes, "around", around)
    guide._routes.footprint_margin = 0.03 if led else None
    guide.plan(pose)
    assert list(dict.fromkeys(found)) == outlined


@pytest.mark.parametrize(("turns", "stalled"), [(True, False), (False, True)])
def test_a_turn_on_the_spot_is_no_stall_on_a_route_with_turns(jackal, turns, stalled):
    recovery = Recovery(None, jackal, (0.0, 0.0, 0.0), 60)
    for second in range(5):
        recovery.note_progress(second, (0.0, 0.0, 1.0 * second), waiting=False, backwards=False, turns=turns)
    assert recovery.stalled(4.0) is stalled


def test_an_estimate_that_a_scan_moved_before_the_robot_drove_is_certified(jackal):
    """Among few posts the first scans are laid on the map with an error that no drift explains."""
    posts = Disc(3.0, 3.0, 0.3), Disc(2.4, 3.9, 0.25)
    done = run(scenario(jackal, load_task("empty"), unseen=posts))
    assert done.succeeded, (done.outcome, done.reason, done.certificate)


def test_odometry_alone_drifts(jackal):
    done = run(scenario(jackal, localisation="odometry", seed=3))
    off = np.hypot(*(done.rollout.estimate - done.rollout.pose)[:, :2].T)
    assert done.succeeded, (done.outcome, done.reason)
    assert off[-1] > 0.02


def test_the_optima_of_a_mapless_drive_are_no_shorter_than_the_straight_line(log):
    for key in ("euclidean_optimum_m", "grid_optimum_m"):
        forged = changed(log, "record.plan", **{key: 0.3 * getattr(log.record.plan, key)})
        assert any(f"record.plan.{key}: " in problem for problem in certify(forged).problems)


def test_the_map_is_reset_after_failed_plans(log):
    """The fourth plan resets the map after three failures in a row; a path restarts the count, and a scan turn comes first."""
    lost = ReplanRecord(t=0.0, trigger="no way", solved=False, cost_m=None, work=1, route=())
    found = replace(lost, solved=True, cost_m=1.0, route=((0.0, 0.0), (1.0, 0.0)))
    replans = [lost, lost, found, lost, lost, lost, lost, found]
    timed = tuple(replace(replan, t=(k + 1) / 60) for k, replan in enumerate(replans))
    assert list(reset_ticks(replace(log.record, replans=timed))) == [7]
    assert list(reset_ticks(replace(log.record, replans=timed[:6]))) == []
    turned = replace(timed[6], trigger=Trigger.SCAN_TURN)  # its plan uses the whole map
    assert list(reset_ticks(replace(log.record, replans=(*timed[:6], turned, timed[7])))) == [8]


def own_map(log):
    """The map that the robot of a log had at last."""
    sensors, _, mind = compose(rebuilt(log.record))
    survey, resets = mind.scans, dict.fromkeys(reset_ticks(log.record), mind.scans.reset)
    for row in range(0, len(log.t), log.record.physics_hz // log.record.control_hz):
        tick = row * log.record.control_hz // log.record.physics_hz
        estimate = tuple(log.estimate[row].tolist()) if len(log.estimate) else tuple(log.pose[row].tolist())
        ranges = sensors[0].lidar.scan(tick, tuple(log.pose[row].tolist()))
        if ranges is not None:
            survey.read(tick, estimate, ranges)
        resets.get(tick, lambda pose: None)(estimate)
    return survey.map


def cells_of(known):
    """The cells that hold hits, by their places."""
    rows, cols = np.nonzero(known.occupied)
    x, y = known.origin
    return set(zip(np.round(x / known.cell + cols).tolist(), np.round(y / known.cell + rows).tolist(), strict=True))


def test_pose_fixes_leave_the_map_sharp(jackal):
    """With fixes and wheels alone, a twentieth of the hits lies 4 cm and more off all surfaces."""
    log = run(scenario(jackal, localisation="fixes", seed=3)).rollout
    x, y, _ = own_map(log).discs().T
    west, south, east, north = ROOM.bounds
    off = [np.abs(np.hypot(x - post.x, y - post.y) - post.radius) for post in POSTS]
    off += [np.abs(x - west), np.abs(x - east), np.abs(y - south), np.abs(y - north)]
    assert np.percentile(np.min(off, axis=0), 95) < 0.015


def test_without_noise_pose_fixes_are_true_poses(jackal):
    by_fixes, true = (run(scenario(jackal, localisation=kind, noise=0.0)).rollout for kind in ("fixes", "true"))
    np.testing.assert_array_equal(by_fixes.pose, true.pose)
    assert not len(by_fixes.estimate)


@pytest.mark.parametrize(("kind", "matches"), [("positions", False), ("lidar", True)])
def test_scans_are_matched_among_movers_only_if_they_are_tracked(kind, matches, jackal):
    made = scenario(jackal, "people-crossing", localisation="fixes", perception=Perception(kind=kind))
    survey = compose(made)[2].scans
    assert (survey._matcher is not None) is matches


@pytest.mark.slow
def test_pose_fixes_drive_no_slower_than_scan_matching_alone(jackal):
    """In dense fields, the geometric mean over eight pairs."""
    ratios = []
    for seed in range(8):
        field = generate("barn", np.random.default_rng([7, seed]), {"fill": "0.25"})
        times = [run(scenario(jackal, field, seed=seed, localisation=kind)) for kind in ("fixes", "matching")]
        assert all(drive.succeeded for drive in times)
        ratios.append(times[0].rollout.t[-1] / times[1].rollout.t[-1])
    assert np.exp(np.log(ratios).mean()) < 1.03


def test_the_resets_of_a_map_are_reconstructed(jackal):
    """A row of posts closes a corridor, 1 m beyond the view from the start."""
    short = replace(jackal.lidar, field_of_view=2 * math.pi, max_range=3.0, rate=20.0)
    row = tuple(Disc(5.0, 0.15 * k, 0.075) for k in range(12))
    task = Task(World("corridor", (0.0, 0.0, 7.0, 1.6), row), (1.0, 0.8, 0.0), (6.4, 0.8), cell=0.1)
    done = run(scenario(replace(jackal, lidar=short), task, time_limit=4.0))
    assert done.outcome is Outcome.TIMED_OUT, (done.outcome, done.reason)
    assert len(list(reset_ticks(done.rollout.record))) > 1
    assert done.reason.startswith("no way through what was seen, last at t = ")
    kept, forgot = MapReconstruction(done.rollout), MapReconstruction(done.rollout, resets=True)
    for reconstruction in (kept, forgot):
        reconstruction.advance(4.0)
    own = cells_of(own_map(done.rollout))
    rounded = len(own) // 50  # a log has millimetres
    assert len(cells_of(forgot.map) ^ own) <= rounded < len(cells_of(kept.map) ^ own)


def test_the_true_pose_is_known_without_error(jackal):
    done = run(scenario(jackal, localisation="true"))
    assert done.succeeded
    rows = done.rollout.scan_rows
    assert np.array_equal(done.rollout.estimate[rows], done.rollout.pose[rows])


def test_a_robot_that_faces_away_turns_round(jackal):
    backwards = replace(TASK, start=(1.2, 0.8, math.pi), goal=(2.2, 2.0))
    done = run(scenario(jackal, backwards, noise=0.0))
    assert done.succeeded, (done.outcome, done.reason)
    assert done.scenario.as_dict()["cell_m"] == done.rollout.record.cell == 0.05


@pytest.mark.parametrize(("cell", "short"), [(None, True), (0.3, False)])
def test_colonies_plan_on_cells_that_leave_gaps_open(jackal, cell, short):
    """The gap leaves 0.12 m for the robot's middle: no row of cells of 0.3 m lies there, and the way round is long."""
    posts = tuple(Disc(3.0, y, 0.075) for y in (*np.linspace(0.05, 2.0, 14), *np.linspace(3.0, 3.9, 7)))
    task = replace(TASK, world=replace(ROOM, obstacles=posts), cell=0.3)
    _, answer = compose(scenario(jackal, task, "mmas", cell=cell, noise=0.0))[1].plan(task.start)
    assert (answer.solved and answer.cost < 1.5 * 4.4) == short, answer.cost


def test_what_no_beam_has_met_changes_nothing(jackal, log):
    hidden = replace(ROOM, obstacles=(*POSTS, Disc(4.2, 1.2, 0.2)))  # behind the row
    other = run(scenario(jackal, replace(TASK, world=hidden))).rollout
    differ = (log.scans[: len(other.scans)] != other.scans[: len(log.scans)]).any(axis=1)
    assert differ.any()
    first = int(log.scan_rows[int(differ.argmax())])
    assert first > 240  # the cylinder comes into sight, but not soon
    for name in ("pose", "twist", "command", "estimate", "actuated"):
        assert np.array_equal(getattr(log, name)[: first + 1], getattr(other, name)[: first + 1]), name


def test_an_unseen_cylinder_is_discovered_and_passed(turtlebot):
    task = Task(World("hall", (0.0, 0.0, 6.0, 4.0)), (0.8, 2.0, 0.0), (5.2, 2.0), cell=0.1)
    hidden = (Disc(3.0, 2.0, 0.2),)
    blind = run(scenario(turtlebot, task, map="given", localisation="fixes", noise=0.0, unseen=hidden))
    seeing = run(scenario(turtlebot, task, noise=0.0, unseen=hidden))
    assert blind.outcome is Outcome.COLLIDED
    assert seeing.succeeded, (seeing.outcome, seeing.reason)


@pytest.mark.parametrize(("robot", "seed"), [("turtlebot", 1), ("jackal", 2)])
def test_nothing_that_stands_is_touched_in_random_forests(robot, seed, request):
    task = generate("forest", np.random.default_rng(seed), {"size": "7", "count": "12"}, name="small")
    done = run(scenario(request.getfixturevalue(robot), task, "dstar-lite", seed=seed))
    assert not len(done.rollout.contacts), done.reason
    assert done.succeeded, (done.outcome, done.reason)


def test_plans_that_failed_long_ago_are_no_reason(jackal):
    """The note is empty before the third failure in a row, and half a minute after it."""
    exploration = compose(scenario(jackal, noise=0.0))[1]
    walls = tuple(Disc(0.8 + 0.5 * math.cos(a), 0.8 + 0.5 * math.sin(a), 0.1) for a in np.arange(0, 6.3, 0.2))
    closed = np.array([(disc.x, disc.y, disc.radius) for disc in walls])
    exploration.survey.map.discs = lambda bounds: closed
    said = []
    for tick in (60, 90, 120):
        assert exploration.replan(moment(tick, TASK.start), "no way") is None
        said.append(exploration.failure_note(tick))
    assert said == ["", "", "no way through what was seen, last at t = 2.0 s"]
    assert exploration.failure_note(120 + 30 * 60)
    assert not exploration.failure_note(121 + 30 * 60)


@pytest.mark.parametrize(("rate", "share"), [(1000.0, 5), (60.0, 5), (50.0, 4), (10.0, 1)])
def test_a_map_counts_the_scans_that_are_taken(jackal, rate, share):
    """At 60 control periods a second a lidar of 1000 Hz takes 60 scans, of which 12 are entered as a whole."""
    robot = changed(jackal, "lidar", rate=rate)
    sensors, _, mind = compose(scenario(robot))
    survey = mind.scans
    assert survey.map.share == share
    for tick in range(61):
        ranges = sensors[0].lidar.scan(tick, TASK.start)
        if ranges is not None:
            survey.read(tick, TASK.start, ranges)
    assert len(survey.scans) == pytest.approx(min(rate, 60), abs=1)
    assert survey.whole == pytest.approx(min(rate, 60) / share, abs=1)
    assert survey._recent == min(rate, 60)
    assert MoverTracking(robot.lidar, 60)._settle == 2 * min(rate, 60)


def test_the_robot_can_stop_on_ground_that_it_has_seen(jackal):
    sight = FirstSight(ROOM, Scanner.of(jackal.lidar, ROOM).scan(TASK.start))
    survey = Survey(jackal, TASK.start, TASK.goal, 60, sight)
    caution = StoppingConstraint(survey, jackal, 60, 0.1, lambda tick, held: None)
    free = caution.limit(TASK.start, Twist(1.0, 0.0), Twist(1.0, 0.0))
    assert free == (Twist(1.0, 0.0), False)  # stops within 0.35 m, sees 2 m
    back, slowed = caution.limit(TASK.start, Twist(0.0, 0.0), Twist(-0.5, 0.0))
    assert slowed  # nobody has looked behind the robot, and a wall is 0.8 m from its centre
    assert back.speed > -0.4
    near = (2.4, 0.8, 0.0)
    stop, slowed = caution.limit(near, Twist(1.0, 0.0), Twist(1.0, 0.0))
    assert slowed
    assert stop.speed == pytest.approx(1.0 - jackal.max_acceleration / 60)  # brakes as hard as it can


@pytest.mark.parametrize("place", [(-9.0, 0.8), (0.8, 9.0), (12.0, -8.0)])
def test_routes_begin_where_the_robot_believes_it_is_however_far_it_drifted(jackal, place):
    grid, plan = compose(scenario(jackal))[1].plan((*place, 0.0))
    assert plan.solved
    assert math.dist(grid.xy(plan.line)[0], place) <= grid.cell


def test_a_mapless_task_has_no_obstacle_and_no_wall():
    moved = replace(TASK, world=World("other", (-9.0, -9.0, 9.0, 9.0)))
    assert mapless_task(TASK) == mapless_task(moved)
    assert mapless_task(TASK).world.obstacles == ()


OPEN = (0.0, 0.0, 8.0, 8.0)
HERE = (4.0, 4.0, 0.0)
FORWARD = Twist(0.5, 0.0)


def searching(robot, task, **settings):
    return run(scenario(robot, task, localisation="true", **settings))


def triggers(done):
    return [replan.trigger for replan in done.rollout.record.replans]


def test_a_robot_with_a_narrow_lidar_makes_a_scan_turn_first(spec):
    """It sees 57 degrees, and has to go round a post to a goal behind it."""
    task = Task(World("hall", OPEN, (Disc(2.6, 4.2, 0.3),)), HERE, (1.2, 4.6), goal_tolerance=0.25, cell=0.1)
    done = searching(changed(spec, "lidar", field_of_view=1.0, rate=10.0), task)
    assert done.succeeded, (done.outcome, done.reason, triggers(done))
    assert triggers(done)[0] == Trigger.SCAN_TURN
    first = done.rollout.pose[done.rollout.t < done.rollout.record.replans[0].t - 0.1]
    assert np.ptp(np.unwrap(first[:, 2])) > 2 * math.pi - 1.0  # with what it sees at once this is all around
    assert np.hypot(*(first[:, :2] - HERE[:2]).T).max() < 0.02


def test_a_robot_that_cannot_turn_where_it_stands_makes_room_ahead(jackal):
    """Two posts in the blind sector stop turns either way; the goal is behind them."""
    posts = Disc(3.71, 4.12, 0.02), Disc(3.71, 3.88, 0.02)
    done = searching(jackal, Task(World("hall", OPEN, posts), HERE, (2.0, 4.0), goal_tolerance=0.25, cell=0.1))
    assert done.succeeded, (done.outcome, done.reason, triggers(done))
    assert done.rollout.pose[:, 0].max() > 4.2
    assert "stalled" in triggers(done)
    assert Trigger.SCAN_TURN in triggers(done)  # after it has made room: it had not seen what is behind it


def test_a_mover_in_the_circle_of_the_first_turn_is_given(jackal):
    """It stands in the blind sector, on the shorter turn to the goal."""
    creeping = Cruising(radius=0.1, position=(3.61, 4.0), velocity=(0.0, 0.001))
    task = Task(World("hall", OPEN, movers=(creeping,)), HERE, (1.0, 4.0), goal_tolerance=0.25, cell=0.1)
    done = searching(jackal, task, noise=0.0, time_limit=4.0)
    assert not len(done.rollout.contacts), done.reason
    assert np.ptp(done.rollout.pose[:, 2]) > 0.1  # it began to turn


def test_a_boxed_in_robot_makes_a_scan_turn_before_it_gives_up(jackal):
    ring = tuple(Disc(4 + math.cos(a), 4 + math.sin(a), 0.12) for a in np.arange(0.0, 2 * math.pi, 0.18))
    task = Task(World("pen", OPEN, ring), HERE, (7.0, 4.0), goal_tolerance=0.25, cell=0.1)
    done = searching(changed(jackal, "lidar", rate=15.0), task, time_limit=5.0)
    assert not len(done.rollout.contacts)
    assert done.outcome is Outcome.TIMED_OUT
    assert done.reason.startswith("no way through what was seen")
    assert Trigger.SCAN_TURN in triggers(done)


@pytest.mark.parametrize("lost", [True, False])
def test_a_robot_without_a_path_at_the_end_of_its_route_keeps_searching_for_a_while(jackal, lost):
    """It has backed off, stands 3 m from the goal, and its plans failed."""
    task = Task(World("hall", OPEN), HERE, (7.0, 4.0), goal_tolerance=0.25, cell=0.1)
    s = Scenario.of(task, "astar", jackal, map="none")
    exploration = compose(s)[1]
    _, tracked = exploration.route(*exploration.first())
    robot = Driver(Briefing(jackal, task.start, task.goal, task.goal_tolerance, 60), exploration, ())
    robot.way = Follow(tracked)
    asked = []
    exploration.replan = lambda now, trigger: asked.append(trigger)
    exploration.lost = lost
    robot.step = Step(pursuit=PursuitState(arc=tracked.length))
    exploration.trigger = lambda *_: ""
    command, _ = robot.act(Observation(0, 0.0, HERE, Twist(0.0, 0.0)))
    assert (command is not None) == lost
    assert asked == ([] if lost else ["missed the goal"])


@hypothesis.settings(max_examples=60)
@hypothesis.given(
    st.lists(st.floats(0.4, 6.0).flatmap(lambda a: st.sampled_from([a, -a])), min_size=1, max_size=2),
    st.floats(-3.0, 3.0),
    st.floats(0.2, 3.0),
    st.sampled_from([10, 60, 240]),
)
def test_a_scan_turn_reaches_its_angle_and_stops(turtlebot, turns, yaw, rate, hz):
    scan_turn, last, turned, reached = ScanTurn(turns, yaw, rate, turtlebot, hz), Twist(0.0, 0.0), 0.0, []
    hardest = turtlebot.max_yaw_acceleration / hz
    for _ in range(60 * hz):
        twist = scan_turn.command((1.0, 2.0, math.remainder(yaw + turned, 2 * math.pi)), last)
        if scan_turn.done:
            break
        assert twist.speed == 0.0
        assert abs(twist.yaw_rate) <= rate + 1e-9
        assert abs(twist.yaw_rate - last.yaw_rate) <= hardest + 1e-9
        last, turned = twist, turned + twist.yaw_rate / hz
        reached.append(turned)
    assert scan_turn.done
    assert last.yaw_rate == pytest.approx(0.0, abs=0.01)
    assert turned == pytest.approx(sum(turns), abs=0.05 * len(turns) + hardest / hz)
    farthest = max(reached, key=lambda angle: angle * math.copysign(1.0, turns[0]))
    assert farthest == pytest.approx(
        max([turns[0], sum(turns)], key=lambda a: a * math.copysign(1.0, turns[0])), abs=0.15
    )


def test_a_blocked_scan_turn_ends(turtlebot):
    scan_turn = ScanTurn([2.0, -3.0], 0.0, 1.0, turtlebot, 60)
    periods = 0
    while not scan_turn.done:
        scan_turn.command((0.0, 0.0, 0.0), Twist(0.0, 0.0))
        periods += 1
        assert periods < 200
    moving = ScanTurn([2.0], 0.0, 1.0, turtlebot, 60)
    hardest = turtlebot.max_yaw_acceleration / 60
    for _ in range(60 * 10):  # movers turn the robot to and fro
        assert abs(moving.command((0.0, 0.0, 0.0), Twist(0.0, 1.0)).yaw_rate - 1.0) <= hardest + 1e-12
    assert moving.done


def survey_of(robot, left, right, open_=1.0):
    """A survey that sees so much free ground for turns, and none ahead, where nothing was hit for so far."""
    turns = {1.0: left, -1.0: right}

    def clear_way(pose, speed, rate, farthest, freespace=False):
        if speed:
            return open_ if freespace else 0.0
        return min(turns[rate], farthest)

    return SimpleNamespace(lidar=robot.lidar, map=SimpleNamespace(share=1, stride=1), clear_way=clear_way)


@pytest.mark.parametrize(
    ("left", "right", "turns"),
    [
        (9.0, 9.0, [math.pi / 2 + 0.2]),  # all that a lidar of 270 degrees does not see, and a little more
        (1.0, 0.8, [0.9, -1.6]),
        (0.8, 1.0, [-0.9, 1.6]),
        (1.0, 0.2, [0.9]),
        (0.2, 0.2, []),
    ],
)
def test_a_scan_turn_goes_both_ways_where_one_is_not_free(jackal, left, right, turns):
    recovery = Recovery(survey_of(jackal, left, right), jackal, HERE, 60)
    assert recovery.begin_scan_turn(HERE) == bool(turns)
    assert (recovery.scan_turn is not None) == bool(turns)
    if recovery.scan_turn is not None:
        assert [recovery.scan_turn._left, *recovery.scan_turn._turns] == pytest.approx(turns, abs=1e-4)


def test_a_robot_makes_one_scan_turn_per_place(jackal, turtlebot):
    recovery = Recovery(survey_of(jackal, 9.0, 9.0), jackal, HERE, 60)
    assert not recovery.held(0.0, HERE)  # it sees enough to begin with
    recovery.note_command(1.0, FORWARD)
    recovery.note_command(1.4, FORWARD)
    assert [recovery.held(now, HERE) for now in (1.4, 1.6)] == [False, True]
    assert recovery.begin_scan_turn(HERE)
    recovery.end_scan_turn(3.0, HERE)
    recovery.note_command(3.0, FORWARD)
    assert not recovery.held(9.0, HERE)
    assert not recovery.begin_scan_turn((4.2, 4.0, 1.0))
    assert recovery.held(9.0, (4.4, 4.0, 1.0))
    recovery.note_command(9.1, None)
    assert not recovery.held(9.2, (4.4, 4.0, 1.0))
    around = Recovery(survey_of(turtlebot, 9.0, 9.0), turtlebot, HERE, 60)
    around.note_command(1.0, FORWARD)
    assert not around.held(9.0, HERE)  # its lidar sees all around
    assert not around.begin_scan_turn(HERE)
    before_a_post = Recovery(survey_of(jackal, 9.0, 9.0, 0.05), jackal, HERE, 60)
    before_a_post.note_command(1.0, FORWARD)
    assert not before_a_post.held(9.0, HERE)  # there is nothing to see


def test_a_robot_stalls_at_once_where_its_controller_stops_it(jackal):
    recovery = Recovery(survey_of(jackal, 9.0, 9.0), jackal, HERE, 60)
    recovery.note_command(0.0, None)
    assert [recovery.stalled(now) for now in (2.4, 2.6)] == [False, True]  # it may be moving back and forth
    recovery.note_command(1.0, None, idle=True)
    recovery.note_command(1.4, None, idle=True)
    assert [recovery.stalled(now) for now in (1.4, 1.6)] == [False, True]
    recovery.note_rest(1.5, HERE)  # a new route
    assert [recovery.stalled(now) for now in (1.9, 2.1)] == [False, True]
    recovery.note_command(2.0, None)
    assert not recovery.stalled(2.1)


def between_walls(gap):
    """Two walls of posts with a gap each [m], so that a robot turns between them."""
    posts = []
    for y, x in ((3.0, 0.5), (4.2, 0.3)):
        for k in range(18):
            away = gap / 2 + 0.1 + 0.196 * k
            posts += [Disc(x + side * away, y, 0.1) for side in (-1, 1) if abs(x + side * away) < 3.2]
    return Task(World("gaps", (-3.3, -0.7, 3.3, 8.0), tuple(posts)), (0.0, 0.0, 1.57), (0.0, 7.2), cell=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("gap", [0.54, 0.58])
def test_a_robot_stands_briefly_between_gaps_hardly_wider_than_itself(gap):
    s = Scenario.of(between_walls(gap), "astar", "jackal", noise=1.0, map="none", localisation="matching", seed=1)
    done = run(s)
    assert done.succeeded
    log = done.rollout
    still = (np.abs(log.command) < 0.02).all(axis=1)
    rows = np.flatnonzero(np.diff(np.concatenate(([0], still, [0]))))
    stalls = [r.t for r in log.record.replans if r.trigger == Trigger.STALLED]
    longest = (rows[1::2] - rows[::2]).max() / log.record.physics_hz
    assert stalls
    assert longest < IDLE_TIME + INTERVAL + 0.05


def test_unknown_ground_is_distinguished_from_hits(jackal):
    """A post ahead was hit, and the ground behind it is unknown."""
    task = Task(World("hall", OPEN, (Disc(4.8, 4.0, 0.2),)), HERE, (7.0, 4.0), goal_tolerance=0.25, cell=0.1)
    s = Scenario.of(task, "astar", jackal, map="none")
    exploration = compose(s)[1]
    survey, recovery = exploration.survey, exploration.recovery
    for twist, unseen in ((FORWARD, False), (Twist(-0.5, 0.0), True), (Twist(0.001, 1.0), False)):
        recovery.note_command(0.0, twist)
        seen, open_ = (survey.clear_way(HERE, *twist, 1.0, freespace=open_) for open_ in (False, True))
        assert seen <= open_
        assert recovery.held_by_unknown(HERE) == unseen, (twist, seen, open_)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000))
def test_a_route_is_met_where_a_hit_is_nearer_than_it_needs(seed):
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(-2, 2, 40))
    beams, ranges = np.column_stack((np.cos(angles), np.sin(angles))), rng.uniform(0.5, 6, 40)
    ranges[::7], ranges[::11] = np.inf, -np.inf
    points, needed, arcs = rng.uniform(-3, 3, (20, 2)), rng.uniform(0, 0.3, 20), np.sort(rng.uniform(0, 3, 20))
    first = int(rng.integers(20))
    x, y, yaw = rng.uniform(-1, 1, 3).tolist()
    turned = beams @ np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    ends = (np.array([x, y]) + ranges[:, None] * turned)[np.isfinite(ranges)]
    room = np.hypot(*(points[:, None] - ends).transpose(2, 0, 1)).min(axis=1)
    at = arcs[first]
    expected = bool((room < needed - (0.01 + 0.02 * (arcs - at)))[first:].any())
    route = points, np.arange(20.0), points, needed, arcs, surrounding(points, needed)
    assert check(*route, at, first, 0.01, 0.02, x, y, yaw, beams, ranges)[2] == expected


def test_a_point_of_a_route_is_interpolated():
    xy, arc = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]]), np.array([0.0, 2.0, 3.0])
    for at in (-1.0, 0.0, 0.5, 2.0, 2.25, 3.0, 9.0):
        assert point_at(xy, arc, at) == (np.interp(at, arc, xy[:, 0]), np.interp(at, arc, xy[:, 1]))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_what_covers_a_place_is_left_out(seed):
    rng = np.random.default_rng(seed)
    discs = np.column_stack((rng.uniform(-1, 1, (30, 2)), rng.uniform(0, 0.5, 30)))
    places = rng.uniform(-1, 1, (2, 2))
    clear = np.all([np.hypot(*(discs[:, :2] - place).T) > discs[:, 2] + 0.1 for place in places], axis=0)
    assert np.array_equal(beside(discs, places, 0.1), discs[clear])
