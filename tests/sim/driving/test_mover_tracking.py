"""Drives among movers tracked by lidar, without ground truth."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base.errors import FieldError
from antdrive.robots import PurePursuit, load_robot
from antdrive.sim import Outcome, Perception, Rollout, Scenario, run
from antdrive.sim.compose import compose
from antdrive.sim.driving.mover_tracking import MoverTracking
from antdrive.sim.driving.perceived_movers import Tracked
from antdrive.sim.driving.rules import SlowAtCorners
from antdrive.sim.log.certificate import certify
from antdrive.sim.log.metrics import measure
from antdrive.sim.log.record import PerceptionRecord
from antdrive.sim.log.rollout import ranges_of
from antdrive.sim.log.sights import passed
from antdrive.sim.recorded import rebuilt
from antdrive.sim.sensing import KnownGround, Scanner
from antdrive.worlds import Disc, Keyframed, Route, Task, World
from tests.records import COARSE, changed
from tests.sim.driving.ground_truth import observed

pytestmark = pytest.mark.xdist_group("tracking by lidar")

# A closet of touching posts in the lower right corner, into which no beam gets.
CLOSET = tuple(Disc(5.0 + 0.14 * k, 1.2, 0.075) for k in range(22)) + tuple(
    Disc(5.0, 0.14 * k, 0.075) for k in range(9)
)
CROSSING = Keyframed(radius=0.3, keyframes=((0.0, 4.2, 3.5), (4.0, 4.2, 1.7)), loop="pingpong")
HIDDEN = Keyframed(radius=0.2, keyframes=((0.0, 6.0, 0.6), (4.0, 7.2, 0.6)), loop="pingpong")
HALL = World("hall", (0.0, 0.0, 8.0, 4.5), CLOSET, movers=(CROSSING,))
TASK = Task(HALL, (0.8, 2.2, 0.0), (7.0, 2.2), goal_tolerance=0.25, cell=0.1)
BOX = (Disc(2.3, 2.2, 0.15),)  # stands on the route, and is on no map
LIDAR = Perception(kind="lidar")


def scenario(robot, task=TASK, **settings):
    given = {"perception": LIDAR, "unseen": BOX, **settings}
    return Scenario.of(task, "astar", robot, **given)


@pytest.fixture(scope="module")
def drive(jackal):
    return run(scenario(jackal))


@pytest.fixture(scope="module")
def log(drive):
    return drive.rollout


def test_what_is_on_no_map_is_seen_and_avoided(drive, log, jackal):
    blind = run(scenario(jackal, avoidance=None, replanning=None))
    assert blind.outcome is Outcome.COLLIDED
    assert drive.succeeded, (drive.outcome, drive.reason, drive.certificate)
    assert (log.record.perception.kind, drive.scenario.as_dict()["settings"]["perception"]) == (
        "lidar",
        {"kind": "lidar"},
    )


def test_the_log_tells_where_the_robot_believed_movers_to_be(log, tmp_path):
    rows, x, y, vx, vy, radius = (log.tracks[:, k] for k in (0, 2, 3, 4, 5, 6))
    there = log.movers[rows.astype(int), 0]
    off = np.hypot(x - there[:, 0], y - there[:, 1])
    on_box = np.hypot(x - BOX[0].x, y - BOX[0].y) < 0.1
    assert (on_box | (off < 0.15)).all()  # nothing else is followed
    mine = ~on_box & (rows > 0.5 * 240)
    assert len(np.unique(log.tracks[mine, 1])) == 1  # one track all the time
    assert np.median(off[mine]) < 0.02
    assert np.abs(radius[mine] - 0.3).max() < 0.05
    assert np.median(np.hypot(vx[mine], np.abs(vy[mine]) - 0.45)) < 0.05
    assert np.hypot(vx[on_box], vy[on_box])[20:].max() < 0.08
    again = Rollout.load(log.save(tmp_path / "rollout.npz"))
    assert again.digest == log.digest
    assert np.array_equal(again.tracks, log.tracks)
    broken = replace(log, tracks=log.tracks[::-1].copy())
    assert any("tracks" in problem for problem in broken.problems())
    assert certify(log).certified
    told = replace(log.record, perception=PerceptionRecord(kind="velocities", range_m=None))
    flat = log.tracks * np.array([1, 1, 1, 1, 1, 1, 0], dtype=np.float32)
    for forged in (replace(log, record=told), replace(log, tracks=flat)):
        assert any("tracks" in problem for problem in certify(forged).problems)


def test_a_mover_that_no_beam_meets_changes_nothing(jackal, log):
    hidden = changed(TASK, "world", movers=(CROSSING, HIDDEN))
    other = run(scenario(jackal, hidden)).rollout
    assert other.movers.shape[1] == 2
    for name in ("pose", "twist", "command", "limiter", "scans", "tracks"):
        assert np.array_equal(getattr(other, name), getattr(log, name)), name
    seen = replace(HIDDEN, keyframes=tuple((t, x, y + 1.2) for t, x, y in HIDDEN.keyframes))
    outside = changed(TASK, "world", movers=(CROSSING, seen))
    differs = run(scenario(jackal, outside, time_limit=0.5)).rollout
    assert not np.array_equal(differs.tracks, log.tracks[log.tracks[:, 0] < len(differs.t)])


def test_a_robot_without_a_map_follows_movers_too(jackal):
    short = replace(TASK, start=(2.6, 2.2, 0.0), goal=(5.6, 2.2))
    done = run(scenario(jackal, short, map="none", localisation="matching", noise=1.0, unseen=()))
    assert done.succeeded, (done.outcome, done.reason, done.certificate)
    tracks = done.rollout.tracks
    there = done.rollout.movers[tracks[:, 0].astype(int), 0]
    off = np.hypot(*(tracks[:, 2:4] - there).T)
    assert np.median(off) < 0.1
    assert rebuilt(done.rollout.record).perception == LIDAR


def test_the_map_reaches_farther_among_movers(jackal):
    told = scenario(jackal, map="none", perception=Perception(), unseen=())
    tracks_movers = replace(told, perception=LIDAR)
    assert [compose(s)[1].survey.map.horizon for s in (told, tracks_movers)] == [10.0, 16.0]


def test_movers_are_tracked_in_an_empty_world(turtlebot):
    empty = Task(World("empty", (0.0, 0.0, 4.0, 3.0)), (0.8, 1.5, 0.0), (3.2, 1.5), cell=0.1)
    done = run(scenario(turtlebot, empty, unseen=()))
    assert done.succeeded
    assert not len(done.rollout.tracks)
    assert done.rollout.record.perception is not None
    assert done.rollout.record.replans == ()


def test_movers_are_predicted_at_the_velocity_that_was_estimated(jackal):
    tracking, hall = MoverTracking(jackal.lidar, 60), World("hall", (-5.0, -5.0, 5.0, 5.0))
    scanner = Scanner(jackal.lidar, np.empty((0, 3)), bounds=hall.bounds)
    ground = KnownGround(jackal.lidar, hall)
    for tick in range(31):
        places = np.array([[3.0 - tick / 60, 1.0], [2.0, -2.0]])
        tracking.read(ground, (0.0, 0.0, 0.0), scanner.scan((0.0, 0.0, 0.0), places, np.array([0.3, 0.2])), tick)
    movers = Tracked(tracking, LIDAR)
    movers.read(observed(36))
    places, radii, numbers = movers.predict(np.array([0.0, 1.0])), movers.near.radii, movers.near.numbers
    first = int(np.argmin(places[0, :, 1] < 0))
    assert np.allclose(places[:, first], [[2.4, 1.0], [1.4, 1.0]], atol=0.05)
    assert np.array_equal(places[0, 1 - first], places[1, 1 - first])  # it stands
    assert radii[first] == pytest.approx(0.3, abs=0.03)
    assert np.array_equal(movers.places[numbers], places[0])
    near = Tracked(tracking, Perception(kind="lidar", range=2.3))
    near.read(observed(36))
    assert near.near.numbers.tolist() == [numbers[first]]
    assert math.hypot(2.0, 2.0) - 0.2 > 2.3


def test_a_robot_without_a_map_gets_ground_truth_only_on_request(jackal):
    nobody = changed(TASK, "world", movers=())
    given, alone, still = (
        scenario(jackal, task, map=map, perception=None, unseen=())
        for task, map in ((TASK, "given"), (TASK, "none"), (nobody, "none"))
    )
    assert [s.known_perception.kind for s in (given, alone, still)] == ["velocities", "lidar", "velocities"]
    assert alone.as_dict() == replace(alone, perception=LIDAR).as_dict()
    assert replace(alone, perception=Perception()).known_perception == Perception()
    for drifting in ("odometry", "matching"):
        assert replace(alone, localisation=drifting).known_perception.kind == "lidar"
        with pytest.raises(FieldError, match=f"velocities: the pose drifts with localisation {drifting}") as caught:
            replace(alone, localisation=drifting, perception=Perception())
        assert caught.value.key == "sees"
        replace(still, localisation=drifting, perception=Perception())


def test_without_a_map_a_mover_that_no_beam_meets_changes_nothing(jackal):
    """The mover approaches from behind posts; with ground truth the robot evades."""
    closet = tuple(Disc(0.1 + 0.14 * k, 1.4, 0.075) for k in range(22)) + tuple(
        Disc(3.1, 1.4 - 0.14 * k, 0.075) for k in range(11)
    )
    mover = Keyframed(radius=0.2, keyframes=((0.0, 1.8, 0.25), (0.8, 1.8, 1.1)), loop="pingpong")
    other = replace(mover, keyframes=((0.0, 2.6, 0.4), (1.0, 2.6, 0.5)))
    logs = []
    for hidden in (mover, other):
        task = changed(TASK, "world", obstacles=closet, movers=(hidden,))
        logs.append(run(scenario(jackal, task, map="none", perception=None, unseen=(), time_limit=1.0)).rollout)
    one, two = logs
    assert not np.array_equal(one.movers, two.movers)
    for name in ("pose", "twist", "command", "limiter", "scans", "tracks"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name


def test_the_scans_of_a_robot_with_a_map_are_in_its_log(log, jackal):
    assert log.scans.shape[1] == jackal.lidar.beams
    assert (len(log.scans) - 1) / log.t[log.scan_rows[-1]] == pytest.approx(jackal.lidar.rate, rel=0.01)
    k, rows = 30, log.scan_rows
    exact = replace(jackal.lidar, resolution=0.0)
    radii = np.array([mover.radius for mover in log.record.world.movers])
    expected = Scanner.of(exact, log.record.world).scan(tuple(log.pose[rows[k]].tolist()), log.movers[rows[k]], radii)
    assert np.abs(ranges_of(log.scans[k]) - expected).max() < 0.0056  # half the resolution, and rounding
    assert np.isnan(measure(log)["explored_m2"])  # it had a map
    assert {sight.obstacle for sight in passed(log) if sight.mover} == {0}


def test_only_a_robot_with_a_lidar_in_use_logs_scans(log):
    told = replace(log.record, perception=PerceptionRecord(kind="velocities", range_m=None))
    forged = replace(log, record=told, tracks=log.tracks[:0])
    assert "scans: must be empty, since the robot did not use its lidar" in certify(forged).problems


#: A corridor along a room; a person in the room cannot be seen from it before the door.
WALL = tuple(Disc(0.1 * k, 1.4, 0.05) for k in range(121) if not 60 <= k < 72)
PERSON = Keyframed(radius=0.25, keyframes=((0.0, 1.0, 0.5), (60.0, 2.0, 0.5)), loop="pingpong")
OFFICE = Task(World("office", (0.0, 0.0, 12.0, 3.6), WALL, movers=(PERSON,)), (0.8, 2.0, 0.0), (11.2, 2.0), cell=0.1)


def test_a_robot_slows_down_for_ground_that_its_lidar_does_not_see(jackal):
    """Not with ground-truth positions, which it knows behind walls."""
    seen, known = (
        run(Scenario.of(OFFICE, "astar", jackal, **given, **COARSE)) for given in ({"perception": LIDAR}, {})
    )
    assert seen.succeeded
    assert known.succeeded
    speeds = [done.rollout.twist[np.abs(done.rollout.pose[:, 0] - 5.7) < 0.1, 0].max() for done in (seen, known)]
    assert speeds[0] < jackal.near_speed + 0.3 < speeds[1]


def test_corners_are_where_ground_is_hidden_but_not_behind_movers(jackal):
    near = Keyframed(radius=0.25, keyframes=((0.0, 4.0, 2.6), (6.0, 10.0, 2.6)), loop="pingpong")
    world = replace(OFFICE.world, movers=(near,))
    lidar = jackal.lidar.at(60)
    scanner, tracking, ground = Scanner.of(lidar, world), MoverTracking(lidar, 60), KnownGround(lidar, world)
    for tick in range(0, 60, 2):
        place = np.array([[4.0 + tick / 60, 2.6]])
        tracking.read(ground, (2.0, 2.0, 0.0), scanner.scan((2.0, 2.0, 0.0), place, np.array([0.25])), tick)
    assert len(tracking.tracker.movers().numbers) == 1
    assert np.hypot(*(tracking.corners - (5.9, 1.4)).T).min() < 0.2  # the door's nearer side
    assert np.hypot(*(tracking.corners - place).T).min() > 0.5


@given(st.lists(st.tuples(st.floats(0, 12), st.floats(0, 3.6)), max_size=6), st.floats(0, 2), st.floats(0, 10))
def test_the_limit_at_corners_is_the_least_of_all_places_ahead(corners, speed, arc):
    """The robot can brake to each place, and no limit is below the speed near people."""
    jackal = load_robot("jackal")
    path = PurePursuit().prepare(Route(np.array([(0.8, 2.0), (11.2, 2.0)])), OFFICE.world, jackal, 0.03, 1 / 60)
    tracking, reaction = SimpleNamespace(corners=np.array(corners).reshape(-1, 2)), 0.1
    limit = SlowAtCorners(tracking, jackal, 60, reaction).limit(path, arc, speed)
    if speed <= jackal.near_speed or not corners:
        assert limit == math.inf
        return
    assert limit >= jackal.near_speed
    for ahead in np.arange(arc, min(arc + speed**2 / (2 * jackal.max_acceleration), path.length), 0.1):
        place = 0.8 + min(ahead, path.length)
        room = min(math.dist(corner, (place, 2.0)) for corner in corners) - jackal.radius
        there = max(jackal.near_speed, jackal.max_acceleration * (room / 1.2 - reaction))
        assert limit**2 <= there**2 + 2 * jackal.max_acceleration * (ahead - arc) + 1e-9


def test_a_thin_pole_hides_nobody(jackal):
    world = World("hall", (0.0, 0.0, 12.0, 12.0), (Disc(5.0, 6.0, 0.1),))
    lidar = jackal.lidar.at(60)
    tracking = MoverTracking(lidar, 60)
    tracking.read(KnownGround(lidar, world), (2.0, 6.0, 0.0), Scanner.of(lidar, world).scan((2.0, 6.0, 0.0)), 0)
    assert len(tracking.corners) == 0
