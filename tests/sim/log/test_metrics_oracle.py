"""Every metric against an oracle that reads the file alone and follows docs/reference/metrics.md, on drives of every kind."""

import math
from dataclasses import replace

import numpy as np
import pytest

from antdrive.robots import Footprint, load_robot
from antdrive.robots.lidar import Lidar
from antdrive.sim import METRICS, Outcome, Perception, Rollout, Scenario, measure, run
from antdrive.sim.log.record import PlanRecord, ReplanRecord
from antdrive.worlds import Cruising, Disc, Keyframed, Task, Wandering, World
from tests.made_up_drive import scanned
from tests.records import COARSE, changed
from tests.sim.log.metrics_oracle import ORACLES, metrics_of

pytestmark = pytest.mark.xdist_group("oracles of metrics")

WITHIN = 1e-9  # relative
NOSE = [[0.62, 0.0], [0.45, 0.25], [-0.25, 0.25], [-0.25, -0.25], [0.45, -0.25]]
POSTS = (Disc(2.0, 1.5, 0.3), Disc(3.4, 2.6, 0.25), Disc(3.6, 0.8, 0.35))
TASK = Task(World("posts", (0.0, 0.0, 6.0, 3.5), POSTS), (0.6, 1.4, 0.0), (5.3, 1.9), cell=0.2)
MOVERS = (
    Cruising(radius=0.2, position=(3.0, 3.0), velocity=(0.1, -0.3)),
    Keyframed(radius=0.2, keyframes=((0.0, 4.5, 0.5), (6.0, 4.5, 3.0))),
    Wandering(radius=0.15, cell=0.5, period=2.0, start=(5.2, 0.6)),
)
ROOM = changed(TASK, "world", obstacles=())
AMONG = changed(TASK, "world", movers=MOVERS)
MAPLESS = {"map": "none", "localisation": "matching", "noise": 1.0}
BLIND = {"avoidance": None, "replanning": None}
BY_WALL = Task(World("room", (0.0, 0.0, 6.0, 4.0)), (0.5, 0.19, 0.0), (2.5, 1.5), goal_tolerance=0.2, cell=0.05)


def mover(*frames, **more):
    return changed(TASK, "world", movers=(Keyframed(radius=0.3, keyframes=frames, **more),))


def drives():
    """Drives of every kind by name: scenarios, and what becomes of them."""
    turtlebot, jackal = load_robot("turtlebot"), load_robot("jackal")
    nose = replace(load_robot("warehouse"), footprint=Footprint.polygon(NOSE), name="nose")
    weak = replace(turtlebot, wheel_torque=1e-6)
    done = Outcome.SUCCEEDED
    yield "map", done, Scenario.of(TASK, "astar", turtlebot)
    yield "map, noise", done, Scenario.of(TASK, "astar", jackal, noise=1.0, seed=5, **COARSE)
    yield "any angle", done, Scenario.of(TASK, "tangent", jackal, **COARSE)
    yield "25 Hz", done, Scenario.of(TASK, "astar", turtlebot, physics_hz=250, control_hz=50)
    yield "movers", done, Scenario.of(AMONG, "dstar-lite", turtlebot, seed=1, **COARSE)
    yield "movers, noise", done, Scenario.of(AMONG, "dstar-lite", jackal, noise=1.0, seed=2, **COARSE)
    yield "lidar", done, Scenario.of(AMONG, "dstar-lite", jackal, seed=1, perception=Perception(kind="lidar"), **COARSE)
    yield "mapless", done, Scenario.of(TASK, "astar", jackal, **MAPLESS, **COARSE)
    yield "mapless, movers", done, Scenario.of(AMONG, "dstar-lite", turtlebot, **MAPLESS, **COARSE)
    yield "narrow", done, Scenario.of(BY_WALL, "astar", turtlebot, margin=0.2, **COARSE)
    yield "polygon", Outcome.COLLIDED, Scenario.of(ROOM, "astar", nose, unseen=(Disc(3.0, 2.0, 0.2),), **COARSE)
    yield "collided", Outcome.COLLIDED, Scenario.of(TASK, "astar", turtlebot, unseen=(Disc(3.0, 1.8, 0.4),))
    comes = mover((0.0, 3.0, 1.4), (4.0, 0.0, 1.4))
    yield "standing", Outcome.HIT_WHILE_STANDING, Scenario.of(comes, "astar", weak, **BLIND, **COARSE)
    appears = mover((0.0, 0.7, 1.4), (2.0, 3.0, 1.4), loop="teleport", phase=1.0)
    yield "teleport", Outcome.HIT_BY_TELEPORT, Scenario.of(appears, "astar", weak, **BLIND, **COARSE)
    yield "stuck", Outcome.STUCK, Scenario.of(TASK, "astar", weak, **COARSE)
    yield "timed out", Outcome.TIMED_OUT, Scenario.of(TASK, "astar", turtlebot, time_limit=3.0)


@pytest.fixture(scope="module")
def logs():
    found = {}
    for name, outcome, scenario in drives():
        log = run(scenario).rollout
        assert log is not None
        assert log.outcome is outcome, (name, log.outcome, log.record.reason)
        found[name] = log
    return found


@pytest.fixture(scope="module")
def expected(logs, tmp_path_factory):
    """What the oracles read in the file of each drive."""
    folder = tmp_path_factory.mktemp("logs")
    return {name: metrics_of(log.save(folder / f"{k}.npz")) for k, (name, log) in enumerate(logs.items())}


def disagreements(found, expected):
    """Return the metrics that their oracles contradict, with both values."""
    wrong = {}
    for name, value in found.items():
        close = math.isclose(value, expected[name], rel_tol=WITHIN, abs_tol=1e-12)
        if not (close or (math.isnan(value) and math.isnan(expected[name]))):
            wrong[name] = value, expected[name]
    return wrong


def disagreements_in(log, folder):
    """Save a log, measure what is loaded, and return what its oracles contradict."""
    path = log.save(folder / "rollout.npz")
    return disagreements(measure(Rollout.load(path)), metrics_of(path))


def test_every_metric_has_an_oracle():
    assert list(ORACLES) == list(METRICS)


@pytest.mark.parametrize("name", [name for name, *_ in drives()])
def test_the_metrics_of_a_drive_are_as_defined(name, logs, expected):
    assert disagreements(measure(logs[name]), expected[name]) == {}


def test_the_drives_show_every_metric_at_work(logs):
    """A metric that is 0 or NaN in every drive is not tested by them."""
    measured = [measure(log) for log in logs.values()]
    for name in METRICS:
        assert any(math.isfinite(values[name]) and values[name] for values in measured), name
    assert {values["arrival_s"] for values in measured} >= {math.inf}
    assert all(values["path_length_m"] > 1 for values in measured)


def altered(log, rng):
    """A log with random contents where metrics read, at another rate; no robot drove it."""
    rows, record = len(log.t), log.record
    things = len(record.world.obstacles) + log.movers.shape[1] + 4
    at = np.sort(rng.integers(0, rows, 12))
    contacts = np.column_stack([at, rng.integers(0, things, 12), np.zeros((12, 2))])
    ends = rng.uniform((0, 0), (6, 3), (2, 4, 2))
    times, routes = np.sort(rng.uniform(0, log.t[-1], 3)).tolist(), [tuple(map(tuple, way)) for way in ends.tolist()]
    again = [
        ReplanRecord(t=t, trigger="time", solved=bool(way), cost_m=1.0 if way else None, work=1, route=way)
        for t, way in zip(times, (routes[0], (), routes[1]), strict=True)
    ]
    lengths = rng.choice([0.5, 3.0, 40.0], 3).tolist()
    plan = PlanRecord(
        cost_m=lengths[0], length_m=lengths[int(rng.integers(2))], grid_optimum_m=rng.choice([None, 2.0]),
        euclidean_optimum_m=rng.choice([None, lengths[2]]), work=1, work_unit="cells",
    )  # fmt: skip
    task = replace(record.task, goal_tolerance=float(rng.uniform(0.1, 5.0)))
    record = replace(
        record, plan=plan, task=task, replans=tuple(again), physics_hz=int(rng.choice([7, 15, 25, 240])),
        outcome=rng.choice([Outcome.SUCCEEDED, Outcome.STUCK], p=[0.8, 0.2]),
    )  # fmt: skip
    twist = log.twist * rng.choice([0.0, 0.001, 1.0], (rows, 1)) + rng.normal(0, 0.05, (rows, 2)) * rng.integers(2)
    limiter = rng.integers(0, len(record.limiters), rows).astype(np.uint8)
    return replace(log, twist=twist, limiter=limiter, contacts=contacts, record=record)


@pytest.mark.parametrize("seed", range(2))
def test_the_metrics_of_logs_that_nothing_drove_are_as_defined(seed, logs, tmp_path):
    for k, log in enumerate(logs.values()):
        assert disagreements_in(altered(log, np.random.default_rng((seed, k))), tmp_path) == {}


@pytest.mark.parametrize(
    "lidar",
    [
        {"field_of_view": 4.7, "beams": 721, "rate": 10.0}, {"field_of_view": 1.0, "beams": 31, "rate": 5.0, "yaw": 2.0},
        {"field_of_view": 2 * math.pi, "beams": 90, "rate": 30.0, "x": 0.2, "y": -0.1}, {"rate": 24.0, "max_range": 1.5},
        {"min_range": 0.9, "rate": 40.0},
    ],
)  # fmt: skip
def test_explored_ground_is_as_defined_for_every_lidar(lidar, made_up_drive, tmp_path):
    """At 24 scans a second every second one counts, and the last."""
    log = scanned(made_up_drive(size=(6.03, 4.0), obstacles=25, seconds=1.1), **lidar)
    assert isinstance(log.record.robot.lidar, Lidar)
    assert measure(log)["explored_m2"] > 0
    assert disagreements_in(log, tmp_path) == {}


def test_in_a_large_world_the_cells_of_explored_ground_are_larger(made_up_drive, tmp_path):
    log = scanned(made_up_drive(size=(6.0, 4.0), obstacles=5, seconds=0.2))
    log = changed(log, "record.task.world", bounds=(0.0, 0.0, 260.0, 240.5))
    assert disagreements_in(log, tmp_path) == {}


@pytest.mark.parametrize("name", METRICS)
def test_the_oracles_notice_a_metric_that_is_off_by_a_millionth(name, logs, expected):
    off = {drive: METRICS[name](log) * (1 + 1e-6) for drive, log in logs.items()}
    assert any(disagreements({name: value}, expected[drive]) for drive, value in off.items())
