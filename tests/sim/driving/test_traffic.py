"""Going round the ground that movers roam."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base import Floats
from antdrive.planners import load_planner
from antdrive.robots import RobotSpec
from antdrive.sim import Outcome, Perception, ReplanPolicy, Run, Scenario, run
from antdrive.sim.driving.perception import Predictor
from antdrive.sim.driving.traffic import MIXING, Traffic, Zone
from antdrive.worlds import Cruising, Disc, Keyframed, Mover, Task, Trajectories, World, import_dynabarn, rasterise
from tools.shared_data import DYNABARN

HALL = World("hall", (0.0, 0.0, 16.0, 12.0))
TASK = Task(HALL, (1.0, 6.0, 0.0), (15.0, 6.0), cell=0.25)
GRID = rasterise(HALL, 0.25, 0.25)
coordinate = st.floats(-1, 17)


def shuttle(x: float, speed: float = 1.0, phase: float = 0.0) -> Keyframed:
    """A mover that goes to and fro across the middle of the hall."""
    frames = ((0.0, x, 2.5), (7.0 / speed, x, 9.5))
    return Keyframed(radius=0.4, keyframes=frames, loop="pingpong", phase=phase)


SHUTTLES = tuple(shuttle(3.0 + 0.9 * k, 1.2, phase=4.7 * k) for k in range(11))


def traffic_of(*movers: Mover, kind: str = "velocities", reach: float = math.inf) -> Traffic:
    motions = Trajectories.of(dataclasses.replace(HALL, movers=movers), (1.0, 6.0))
    predictor = Predictor(motions, Perception(kind=kind, range=reach), 60)  # type: ignore[arg-type]
    return Traffic(predictor, 0.2, HALL.bounds, 60)


def among(*movers: Mover, robot: RobotSpec, **settings: object) -> Run:
    task = dataclasses.replace(TASK, world=dataclasses.replace(HALL, movers=movers))
    scenario = Scenario(
        task=task, planner=load_planner("dstar-lite"), planner_name="dstar-lite", robot=robot, **settings
    )  # type: ignore[arg-type]
    return run(scenario)


def test_the_box_holds_every_place_that_was_seen_and_no_more() -> None:
    traffic = traffic_of(*SHUTTLES, reach=5.0)
    seen = []
    motions = Trajectories.of(dataclasses.replace(HALL, movers=SHUTTLES), (1.0, 6.0))
    for tick in range(0, 300, 7):
        robot = (1.0 + 0.02 * tick, 6.0)
        traffic.look(tick, robot)
        places = motions.positions(tick / 60)[0]
        seen += [p for p, r in zip(places, motions.radii, strict=True) if math.dist(p, robot) - r <= 5.0]
    expected = np.concatenate((np.min(seen, axis=0), np.max(seen, axis=0)))
    np.testing.assert_allclose(traffic.box, expected)


def test_a_box_has_grown_only_when_a_mover_was_seen_farther_out() -> None:
    traffic = traffic_of(shuttle(5.0), shuttle(8.0))
    assert not traffic.grown(0.1), "nothing was seen yet"
    traffic.look(0, (1.0, 6.0))
    assert traffic.grown(0.1)
    traffic.zones(0, (1.0, 6.0), (15.0, 6.0), GRID)
    assert not traffic.grown(0.1)
    traffic.look(30, (1.0, 6.0))
    assert traffic.grown(0.4)
    assert not traffic.grown(0.6)


def test_the_rate_is_that_of_movers_meeting_robots_put_down_at_random() -> None:
    """Brute force: on a fine lattice, how many standing robots each mover meets in a second."""
    movers = (shuttle(4.0, 1.3), Cruising(radius=0.25, position=(9.0, 5.0), velocity=(0.6, -0.7)))
    side = 0.02
    x, y = np.meshgrid(np.arange(0, 16, side), np.arange(0, 12, side))
    motions = Trajectories.of(dataclasses.replace(HALL, movers=movers), (1.0, 6.0))
    begin, end = motions.positions(1.0)[0], motions.positions(2.0)[0]
    met = 0
    for a, b, r in zip(begin, end, motions.radii, strict=True):
        share = np.clip(((x - a[0]) * (b - a)[0] + (y - a[1]) * (b - a)[1]) / ((b - a) @ (b - a)), 0, 1)
        swept = np.hypot(x - a[0] - share * (b - a)[0], y - a[1] - share * (b - a)[1]) < r + 0.2
        met += int((swept & (np.hypot(x - a[0], y - a[1]) >= r + 0.2)).sum())
    assert traffic_of(*movers).rate(60, (1.0, 6.0)) == pytest.approx(met * side**2 / (16 * 12), rel=0.02)
    assert traffic_of(*movers, kind="positions").rate(60, (1.0, 6.0)) == 0.0


def test_few_places_make_a_box_that_is_grown_and_many_one_as_seen() -> None:
    """For n places drawn evenly from an interval, the highest lies 1 / (n + 1) of it below its end on average."""
    rng = np.random.default_rng(0)
    draws = rng.uniform(0.0, 1.0, (20_000, 11))
    spread = np.ptp(draws, axis=1)
    grown = draws.max(axis=1) + spread / 12
    assert grown.mean() == pytest.approx(1.0, abs=0.02)
    traffic = traffic_of(*SHUTTLES)
    boxes = []
    for tick in range(1200):
        traffic.look(tick, (1.0, 6.0))
        if tick in (0, 1199):
            boxes.append([zone._box for zone in traffic.zones(tick, (1.0, 6.0), (15.0, 6.0), GRID)])
    assert traffic.samples == pytest.approx(11 + 11 * 1199 / (60 * MIXING))
    for (larger, seen), n in zip(boxes, (11, traffic.samples), strict=True):
        np.testing.assert_allclose(larger[2:] - seen[2:], (seen[2:] - seen[:2]) / (n + 1))
        np.testing.assert_allclose(seen[:2] - larger[:2], (seen[2:] - seen[:2]) / (n + 1))


@given(robot=st.tuples(coordinate, coordinate), goal=st.tuples(coordinate, coordinate), radius=st.floats(0.1, 0.6))
def test_a_zone_blocks_what_lies_in_its_box_off_the_ways_of_the_ends(
    robot: tuple[float, float], goal: tuple[float, float], radius: float
) -> None:
    box, half = np.array([4.0, 3.0, 12.0, 9.0]), 2 * GRID.cell
    zone = Zone(box, radius, robot, goal, GRID)
    reach = radius + GRID.inflate

    def inside(p: Floats) -> float:
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


def test_a_prediction_beyond_the_box_is_not_believed() -> None:
    zone = Zone(np.array([4.0, 3.0, 12.0, 9.0]), 0.4, (1.0, 6.0), (15.0, 6.0), GRID)
    assert zone.holds(Disc(11.9, 5.0, 0.4))
    assert not zone.holds(Disc(12.3, 5.0, 0.4))


def test_the_robot_goes_round_busy_ground_and_through_quiet_ground(turtlebot: RobotSpec) -> None:
    """The shuttles stay 2 m off the long walls."""
    slow = tuple(shuttle(3.0 + 0.9 * k, speed=0.2, phase=4.7 * k) for k in range(3))
    for movers, goes_round in ((SHUTTLES, True), (slow, False)):
        done = among(*movers, robot=turtlebot)
        assert done.succeeded, (done.outcome, done.reason)
        assert done.rollout is not None
        middle = np.abs(done.rollout.pose[:, 0] - 8) < 2
        off = np.abs(done.rollout.pose[middle, 1] - 6)
        assert (off.min() > 3.5) == goes_round
        triggers = {replan.trigger for replan in done.rollout.record.replans}
        assert ("traffic" in triggers) == goes_round


def test_without_traffic_above_the_limit_nothing_changes(turtlebot: RobotSpec) -> None:
    slow = tuple(shuttle(3.0 + 0.9 * k, speed=0.2, phase=4.7 * k) for k in range(3))
    one, other = (
        among(*slow, robot=turtlebot, replanning=ReplanPolicy(max_traffic=limit)).rollout for limit in (0.07, 1e9)
    )
    assert one is not None
    assert other is not None
    assert (one.pose.tobytes(), one.command.tobytes()) == (other.pose.tobytes(), other.command.tobytes())


@pytest.mark.parametrize(
    "settings", [{"perception": Perception(kind="motions")}, {"replanning": ReplanPolicy(max_detour=1.0)}]
)
def test_a_robot_that_knows_the_motions_or_may_not_go_far_round_goes_through(
    turtlebot: RobotSpec, settings: dict[str, object]
) -> None:
    done = among(*SHUTTLES, robot=turtlebot, **settings)
    assert done.rollout is not None
    middle = np.abs(done.rollout.pose[:, 0] - 8) < 2
    assert np.abs(done.rollout.pose[middle, 1] - 6).min(initial=0.0) < 3.5


@pytest.mark.slow
@pytest.mark.skipif(not DYNABARN.exists(), reason="needs DynaBARN's worlds (docs/how-to/data.md)")
def test_nearly_all_drives_in_the_hard_worlds_of_dynabarn_arrive(jackal: RobotSpec) -> None:
    """Moments that benchmarks.dynamic does not use. A mover that jumps onto the robot ends one of the six drives."""
    hard = [task for task in import_dynabarn(DYNABARN) if int(task.world.name.split("-")[1]) >= 40]
    moments = [dataclasses.replace(task, world=task.world.later(t)) for task in hard for t in (3.1, 7.4)]
    planner = load_planner("dstar-lite")
    done = [run(Scenario(task=task, planner=planner, planner_name="dstar-lite", robot=jackal)) for task in moments]
    outcomes = [each.outcome for each in done]
    assert len(done) == 6
    assert sum(each.succeeded for each in done) >= 5, outcomes
    assert Outcome.COLLIDED not in outcomes
