"""Drives without a map: what the robot knows comes from its lidar, its odometry and the goal alone."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from antdrive.base.errors import FieldError
from antdrive.planners import load_planner
from antdrive.robots import RobotSpec, Twist
from antdrive.runs.failures.rebuild import rebuilt
from antdrive.sim import Outcome, Rollout, Run, Scenario, run
from antdrive.sim.compose import told
from antdrive.sim.driving.own_map import forgetting_ticks
from antdrive.sim.driving.replay import map_of, replay
from antdrive.sim.driving.stopping_constraint import Caution
from antdrive.sim.driving.survey import Senses, Survey
from antdrive.sim.driving.watching import Watch
from antdrive.sim.log.record import ReplanRecord
from antdrive.sim.sensing import OccupancyMap, Scanner
from antdrive.views.recollection import Recollection
from antdrive.worlds import Disc, Task, World, generate, load_task
from tests.sim.driving.guides import exploration_of

POSTS = tuple(Disc(3.0, 0.15 * k, 0.075) for k in range(14))  # a row that leaves a gap at the top
ROOM = World("room", (0.0, 0.0, 6.0, 4.0), POSTS)
TASK = Task(ROOM, (0.8, 0.8, 0.0), (5.2, 0.8), goal_tolerance=0.25, cell=0.1)


def scenario(robot: RobotSpec, task: Task = TASK, planner: str = "astar", **settings: object) -> Scenario:
    given = {"map": "none", "localisation": "matching", "noise": 1.0, **settings}
    return Scenario(task=task, planner=load_planner(planner), planner_name=planner, robot=robot, **given)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def drive(jackal: RobotSpec) -> Run:
    return run(scenario(jackal))


@pytest.fixture(scope="module")
def log(drive: Run) -> Rollout:
    assert drive.rollout is not None
    return drive.rollout


def test_the_robot_finds_the_gap_and_touches_nothing(drive: Run, log: Rollout) -> None:
    assert drive.succeeded, (drive.outcome, drive.reason, drive.certificate)
    assert log.pose[:, 1].max() > 2.3  # where the gap is
    assert log.record.sensing is not None
    assert log.record.sensing.map == "none"


def test_the_log_holds_scans_and_what_was_seen(log: Rollout, tmp_path: Path) -> None:
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
    broken = dataclasses.replace(log, scans=log.scans[:, :-1])
    assert any("beams" in problem for problem in broken.problems())


def test_scans_draw_the_world_around_the_estimated_poses(log: Rollout, jackal: RobotSpec) -> None:
    assert jackal.lidar is not None
    row, ranges = int(log.scan_rows[-1]), log.scans[-1] / 1000.0
    x, y, yaw = jackal.lidar.pose_on(tuple(log.pose[row]))
    ends = np.stack(
        [x + ranges * np.cos(yaw + jackal.lidar.angles), y + ranges * np.sin(yaw + jackal.lidar.angles)], axis=1
    )
    walls = np.minimum(np.minimum(ends[:, 0], 6 - ends[:, 0]), np.minimum(ends[:, 1], 4 - ends[:, 1]))
    posts = np.min([np.abs(np.hypot(ends[:, 0] - d.x, ends[:, 1] - d.y) - d.radius) for d in POSTS], axis=0)
    assert np.minimum(np.abs(walls), posts).max() < 0.02


def test_scans_keep_the_estimate_near_the_truth(log: Rollout) -> None:
    off = np.hypot(*(log.estimate - log.pose)[:, :2].T)
    assert 0 < off.max() < 0.06


def test_the_drive_can_be_replayed_and_rebuilt(drive: Run, log: Rollout) -> None:
    found = replay(log)
    assert found.exact
    assert found.problems == ()
    assert rebuilt(log.record).sensing == drive.scenario.sensing
    assert run(rebuilt(log.record)).rollout.digest == log.digest  # type: ignore[union-attr]


def test_an_estimate_that_a_scan_moved_before_the_robot_drove_is_certified(jackal: RobotSpec) -> None:
    """Among few posts the first scans are laid on the map with an error that no drift explains."""
    posts = Disc(3.0, 3.0, 0.3), Disc(2.4, 3.9, 0.25)
    done = run(scenario(jackal, load_task("empty"), unseen=posts))
    assert done.succeeded, (done.outcome, done.reason, done.certificate)


def test_odometry_alone_drifts_and_is_caught_when_it_is_edited(jackal: RobotSpec) -> None:
    done = run(scenario(jackal, localisation="odometry", seed=3))
    assert done.rollout is not None
    off = np.hypot(*(done.rollout.estimate - done.rollout.pose)[:, :2].T)
    assert done.succeeded, (done.outcome, done.reason)
    assert off[-1] > 0.02
    assert replay(done.rollout).problems == ()
    shifted = done.rollout.estimate + (0.1, 0.0, 0.0)
    assert any(
        "estimate" in problem for problem in replay(dataclasses.replace(done.rollout, estimate=shifted)).problems
    )


def test_a_forged_estimate_that_scans_corrected_is_refused(log: Rollout) -> None:
    """2 mm from one control period on: no scan on this map gives it."""
    row = int(log.scan_rows[100])
    shifted = log.estimate.copy()
    shifted[row:, 1] += 0.002
    (problem,) = replay(dataclasses.replace(log, estimate=shifted)).problems
    assert problem.startswith("replay: estimate is not what")
    assert f"t = {log.t[row]:.3f} s" in problem


def test_a_forged_scan_is_refused(log: Rollout) -> None:
    scans = log.scans.copy()
    scans[50, 300] += 10
    (problem,) = replay(dataclasses.replace(log, scans=scans)).problems
    assert problem.startswith("replay: scans are not what")
    assert f"t = {log.t[log.scan_rows[50]]:.3f} s" in problem
    scans, last = log.scans.copy(), int(log.scan_rows[-1])
    assert last == len(log.t) - 1, "the robot took a scan when it saw that it had arrived"
    scans[-1, 300] += 10
    (ending,) = replay(dataclasses.replace(log, scans=scans)).problems
    assert f"t = {log.t[last]:.3f} s" in ending
    assert replay(dataclasses.replace(log, scans=log.scans[:-1], scan_rows=log.scan_rows[:-1])).problems == (ending,)
    fewer = dataclasses.replace(log, scans=np.delete(log.scans, 50, axis=0), scan_rows=np.delete(log.scan_rows, 50))
    assert replay(fewer).problems == (problem,)
    none = dataclasses.replace(log, scans=log.scans[:0], scan_rows=log.scan_rows[:0])
    assert "no scans" in replay(none).problems[0]


def test_the_map_is_forgotten_where_plans_failed(log: Rollout) -> None:
    """Three plans in a row that fail, then the fourth forgets; a path in between begins the count anew."""
    lost = ReplanRecord(t=0.0, trigger="no way", solved=False, cost_m=None, work=1, route=())
    found = dataclasses.replace(lost, solved=True, cost_m=1.0, route=((0.0, 0.0), (1.0, 0.0)))
    replans = [lost, lost, found, lost, lost, lost, lost, found]
    timed = tuple(dataclasses.replace(replan, t=(k + 1) / 60) for k, replan in enumerate(replans))
    assert list(forgetting_ticks(dataclasses.replace(log.record, replans=timed))) == [7]
    assert list(forgetting_ticks(dataclasses.replace(log.record, replans=timed[:6]))) == []


def own_map(log: Rollout) -> OccupancyMap:
    """The map that the robot of a log had at last."""
    survey, forgets = map_of(log)
    assert isinstance(survey, Survey)
    for row in range(0, len(log.t), log.record.physics_hz // log.record.control_hz):
        tick = row * log.record.control_hz // log.record.physics_hz
        estimate = tuple(log.estimate[row].tolist()) if len(log.estimate) else tuple(log.pose[row].tolist())
        survey.scan(tick, tuple(log.pose[row].tolist()), estimate)
        forgets.get(tick, lambda pose: None)(estimate)
    return survey.map


def cells_of(known: OccupancyMap) -> set[tuple[int, int]]:
    """The cells that hold hits, by their places."""
    rows, cols = np.nonzero(known.occupied)
    x, y = known.origin
    return set(zip(np.round(x / known.cell + cols).tolist(), np.round(y / known.cell + rows).tolist(), strict=True))


def test_a_drive_that_forgot_its_map_can_be_replayed(jackal: RobotSpec, monkeypatch: pytest.MonkeyPatch) -> None:
    """A corridor that a row of posts closes, 1 m out of sight from the start."""
    assert jackal.lidar is not None
    short = dataclasses.replace(jackal.lidar, field_of_view=2 * math.pi, max_range=3.0)
    row = tuple(Disc(5.0, 0.15 * k, 0.075) for k in range(12))
    task = Task(World("corridor", (0.0, 0.0, 7.0, 1.6), row), (1.0, 0.8, 0.0), (6.4, 0.8), cell=0.1)
    done = run(scenario(dataclasses.replace(jackal, lidar=short), task, time_limit=4.0))
    assert done.rollout is not None
    assert done.outcome is Outcome.TIMED_OUT, (done.outcome, done.reason)
    assert len(list(forgetting_ticks(done.rollout.record))) > 1
    assert done.reason.startswith("no way through what was seen, last at t = ")
    assert replay(done.rollout).problems == ()
    kept, forgot = Recollection(done.rollout), Recollection(done.rollout, forgetting=True)
    for recollection in (kept, forgot):
        recollection.advance(4.0)
    own = cells_of(own_map(done.rollout))
    rounded = len(own) // 50  # a log has millimetres
    assert len(cells_of(forgot.map) ^ own) <= rounded < len(cells_of(kept.map) ^ own)
    monkeypatch.setattr("antdrive.sim.driving.own_map.PATIENCE", 10**6)  # as if it had forgotten nothing
    (problem,) = replay(done.rollout).problems
    assert "estimate" in problem


def test_the_true_pose_is_known_without_error(jackal: RobotSpec) -> None:
    done = run(scenario(jackal, localisation="true"))
    assert done.succeeded
    assert done.rollout is not None
    rows = done.rollout.scan_rows
    assert np.array_equal(done.rollout.estimate[rows], done.rollout.pose[rows])


def test_a_robot_that_looks_the_other_way_turns_round(jackal: RobotSpec) -> None:
    backwards = dataclasses.replace(TASK, start=(1.2, 0.8, math.pi), goal=(2.2, 2.0))
    done = run(scenario(jackal, backwards, noise=0.0))
    assert done.succeeded, (done.outcome, done.reason)
    assert done.rollout is not None
    assert done.scenario.as_dict()["cell_m"] == done.rollout.record.cell == 0.05


@pytest.mark.parametrize(("cell", "short"), [(None, True), (0.3, False)])
def test_colonies_plan_on_cells_that_leave_gaps_open(jackal: RobotSpec, cell: float | None, short: bool) -> None:
    """The gap leaves 0.12 m for the robot's middle: no row of cells of 0.3 m lies there, and the way round is long."""
    posts = tuple(Disc(3.0, y, 0.075) for y in (*np.linspace(0.05, 2.0, 14), *np.linspace(3.0, 3.9, 7)))
    task = dataclasses.replace(TASK, world=dataclasses.replace(ROOM, obstacles=posts), cell=0.3)
    _, answer = exploration_of(scenario(jackal, task, "mmas", cell=cell, noise=0.0)).plan(task.start)
    assert (answer.solved and answer.cost < 1.5 * 4.4) == short, answer.cost


def test_what_no_beam_has_met_changes_nothing(jackal: RobotSpec, log: Rollout) -> None:
    hidden = dataclasses.replace(ROOM, obstacles=(*POSTS, Disc(4.2, 1.2, 0.2)))  # behind the row
    other = run(scenario(jackal, dataclasses.replace(TASK, world=hidden))).rollout
    assert other is not None
    differ = (log.scans[: len(other.scans)] != other.scans[: len(log.scans)]).any(axis=1)
    assert differ.any()
    first = int(log.scan_rows[int(differ.argmax())])
    assert first > 240  # the cylinder comes into sight, but not soon
    for name in ("pose", "twist", "command", "estimate", "actuated"):
        assert np.array_equal(getattr(log, name)[: first + 1], getattr(other, name)[: first + 1]), name


def test_an_unseen_cylinder_is_discovered_and_passed(turtlebot: RobotSpec) -> None:
    task = Task(World("hall", (0.0, 0.0, 6.0, 4.0)), (0.8, 2.0, 0.0), (5.2, 2.0), cell=0.1)
    hidden = (Disc(3.0, 2.0, 0.2),)
    blind = run(scenario(turtlebot, task, map="given", localisation="fixes", noise=0.0, unseen=hidden))
    seeing = run(scenario(turtlebot, task, noise=0.0, unseen=hidden))
    assert blind.outcome is Outcome.COLLIDED
    assert seeing.succeeded, (seeing.outcome, seeing.reason)


@pytest.mark.parametrize(("robot", "seed"), [("turtlebot", 1), ("jackal", 2)])
def test_nothing_that_stands_is_touched_in_random_forests(
    robot: str, seed: int, request: pytest.FixtureRequest
) -> None:
    task = generate("forest", np.random.default_rng(seed), {"size": "7", "count": "12"}, name="small")
    done = run(scenario(request.getfixturevalue(robot), task, "dstar-lite", seed=seed))
    assert done.rollout is not None
    assert not len(done.rollout.contacts), done.reason
    assert done.succeeded, (done.outcome, done.reason)


def test_plans_that_failed_long_ago_are_no_reason(jackal: RobotSpec) -> None:
    """Before the third of them in a row, and half a minute after it, nothing is said."""
    exploration = exploration_of(scenario(jackal, noise=0.0))
    walls = tuple(Disc(0.8 + 0.5 * math.cos(a), 0.8 + 0.5 * math.sin(a), 0.1) for a in np.arange(0, 6.3, 0.2))
    closed = np.array([(disc.x, disc.y, disc.radius) for disc in walls])
    exploration.survey.discs = lambda bounds: closed  # type: ignore[method-assign]
    said = []
    for tick in (60, 90, 120):
        assert exploration.replan(tick, TASK.start, "no way") is None
        said.append(exploration.no_way(tick))
    assert said == ["", "", "no way through what was seen, last at t = 2.0 s"]
    assert exploration.no_way(120 + 30 * 60)
    assert not exploration.no_way(121 + 30 * 60)


@pytest.mark.parametrize(("rate", "share"), [(1000.0, 5), (60.0, 5), (50.0, 4), (10.0, 1)])
def test_a_map_counts_the_scans_that_are_taken(jackal: RobotSpec, rate: float, share: int) -> None:
    """At 60 control periods a second a lidar of 1000 Hz takes 60 scans, of which 12 are entered as a whole."""
    assert jackal.lidar is not None
    robot = dataclasses.replace(jackal, lidar=dataclasses.replace(jackal.lidar, rate=rate))
    survey = exploration_of(scenario(robot)).survey
    assert survey.map.share == share
    for tick in range(1, 61):
        survey.scan(tick, TASK.start, TASK.start)
    assert len(survey.scans) == pytest.approx(min(rate, 60), abs=1)
    assert survey.whole == pytest.approx(min(rate, 60) / share, abs=1)
    assert survey._recent == min(rate, 60)
    assert Watch(robot.lidar, 60)._settle == 2 * min(rate, 60)  # type: ignore[arg-type]


def test_the_robot_can_stop_on_ground_that_it_has_seen(jackal: RobotSpec) -> None:
    assert jackal.lidar is not None
    senses = Senses(Scanner.of(jackal.lidar, ROOM), ROOM, None, None, 60)
    survey = Survey(senses, jackal, TASK.start, TASK.goal)
    survey.scan(0, TASK.start, TASK.start)
    caution = Caution(survey, jackal, 60, 0.1)
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
def test_routes_begin_where_the_robot_believes_it_is_however_far_it_drifted(
    jackal: RobotSpec, place: tuple[float, float]
) -> None:
    grid, plan = exploration_of(scenario(jackal)).plan((*place, 0.0))
    assert plan.solved
    assert math.dist(grid.xy(plan.line)[0], place) <= grid.cell


def test_the_robot_is_told_no_obstacle_and_no_wall() -> None:
    moved = dataclasses.replace(TASK, world=World("other", (-9.0, -9.0, 9.0, 9.0)))
    assert told(TASK) == told(moved)
    assert told(TASK).world.obstacles == ()


def test_settings_that_make_no_sense_are_refused(jackal: RobotSpec) -> None:
    for settings, key in (
        ({"map": "some"}, "map"),
        ({"localisation": "gps"}, "localisation"),
        ({"odometry": -1.0}, "odometry"),
        ({"map": "given"}, "localisation"),
        ({"planner": "sipp"}, "map"),
    ):
        with pytest.raises(FieldError) as caught:
            scenario(jackal, **settings)  # type: ignore[arg-type]
        assert caught.value.key == key
    with pytest.raises(FieldError, match="no lidar"):
        scenario(dataclasses.replace(jackal, lidar=None))


def test_a_drive_with_a_map_is_recorded_as_before(jackal: RobotSpec) -> None:
    usual = scenario(jackal, map="given", localisation="fixes")
    assert usual.sensing is None
    assert "map" not in usual.as_dict()["settings"]
    assert scenario(jackal).as_dict()["settings"]["map"] == "none"
    assert math.isfinite(usual.odometry)
