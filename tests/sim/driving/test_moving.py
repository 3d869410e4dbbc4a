"""Worlds with movers: in physics, in logs and in certificates."""

import math
from dataclasses import replace

import numpy as np
import pytest

from antdrive.base.errors import FieldError
from antdrive.robots import PurePursuit
from antdrive.sim import Engine, Outcome, Scenario, certify, measure, run
from antdrive.sim.driving.drive import follow
from antdrive.sim.log.certificate import closed_form_clearance
from antdrive.sim.physics import movers as bodies_of_movers
from antdrive.worlds import Cruising, Disc, Keyframed, Route, Task, Trajectories, Wandering, World
from tests.records import changed

OPEN = (-10.0, -10.0, 10.0, 10.0)
ZIGZAG = ((0.0, -3.0, 3.0), (2.0, 0.0, 4.0), (2.5, 1.0, 4.0), (4.0, 1.0, 6.0))


def placed(engine, steps):
    """The steps with contacts, and the movers' positions at each step: those of the bodies and those of the trajectories."""
    engine.place((0.0, 0.0, 0.0))
    bodies, touched = [engine.mover_positions()], []
    for k in range(steps):
        if engine.step():
            touched.append(k)
        bodies.append(engine.mover_positions())
    return touched, np.array(bodies), engine.trajectories.positions(np.arange(steps + 1) / engine.physics_hz)


def built(*movers, obstacles=()):
    world = World("w", OPEN, obstacles, movers=movers)
    return world, Trajectories.of(world, (0.0, 0.0))


# Physics


@pytest.fixture
def bodies_everywhere(monkeypatch):
    """Every mover has a body, however far away it is."""
    monkeypatch.setattr(bodies_of_movers, "MARGIN", math.inf)


@pytest.mark.usefixtures("bodies_everywhere")
def test_bodies_follow_the_trajectories_at_every_step(turtlebot):
    world, trajectories = built(
        *(Keyframed(radius=0.3, keyframes=ZIGZAG, loop=loop, phase=0.3) for loop in ("pingpong", "teleport", "once")),
        Keyframed(radius=0.3, keyframes=ZIGZAG, loop="teleport", interpolation="catmull-rom"),
        Cruising(radius=0.3, position=(-5.0, 5.0), velocity=(9.7, 6.3)),
        Wandering(radius=0.2, cell=0.5, period=0.21),
        obstacles=(Disc(5.0, 5.0, 1.0),),
    )
    with Engine(world, turtlebot, trajectories=trajectories) as engine:
        for _ in range(2):  # placing the robot restarts the movers
            _, bodies, expected = placed(engine, 1000)
            assert np.abs(bodies - expected).max() < 1e-9


@pytest.mark.parametrize("speed", [0.25, 1.0, 4.0, 17.0])
def test_a_mover_that_crosses_a_standing_robot_touches_it_and_one_that_passes_does_not(spec, speed):
    """At 4 m/s a mover covers 17 mm per step, and a graze of 1 mm lasts less than 40 mm: no step may be missed."""
    radius, reach = 0.2, spec.footprint.half_width + spec.footprint.rounding
    graze = 0.001 if speed <= 4 else 0.03
    for phase in np.linspace(0.0, 1.0, 3 if speed > 1.0 else 1) / 240:
        for aside, expected in ((0.0, True), (reach + radius - graze, True), (reach + radius + 0.002, False)):
            lead = 0.75 + speed * float(phase)
            world, trajectories = built(Cruising(radius=radius, position=(-lead, aside), velocity=(speed, 0.0)))
            with Engine(world, spec, trajectories=trajectories) as engine:
                touched, bodies, way = placed(engine, math.ceil(1.3 * lead / speed * 240))
            assert bool(touched) == expected, (phase, aside)
            assert np.abs(bodies - way).max() < 1e-9, "nothing slows a mover"


def test_a_mover_pushes_the_robot_ahead(turtlebot):
    world, trajectories = built(Cruising(radius=0.3, position=(-1.0, 0.0), velocity=(1.0, 0.0)))
    with Engine(world, turtlebot, trajectories=trajectories) as engine:
        engine.place((0.0, 0.0, 0.0))
        contacts = [contact for _ in range(480) for contact in engine.step()]
        x, y = engine.state()[:2]
        (place,) = engine.mover_positions()
    assert {contact.obstacle for contact in contacts} == {0}
    assert place[0] == pytest.approx(1.0)
    assert math.dist((x, y), place) > 0.3 + 0.18 - 0.01
    assert min(contact.distance for contact in contacts) > -0.01


@pytest.mark.parametrize(("yaw", "index"), [(0.0, 0), (math.pi, 1), (math.pi / 2, 2), (-math.pi / 2, 5)])
def test_movers_are_numbered_after_the_discs_and_before_the_walls(turtlebot, yaw, index):
    movers = (
        Cruising(radius=0.1, position=(-0.5, 0.0), velocity=(0.0, 0.01)),
        Keyframed(radius=0.1, keyframes=((0.0, 0.0, 0.5), (9.0, 0.0, 0.6))),
    )
    world = World("w", (-2.0, -0.5, 2.0, 2.0), (Disc(0.5, 0.0, 0.1),), movers=movers)
    with Engine(world, turtlebot, trajectories=Trajectories.of(world, (0.0, 0.0))) as engine:
        engine.place((0.0, 0.0, yaw))
        engine.command(0.5, 0.0)
        touched = [contact.obstacle for _ in range(240) for contact in engine.step()]
    assert set(touched) == {index}


@pytest.mark.usefixtures("bodies_everywhere")
def test_movers_pass_through_each_other_and_through_obstacles(turtlebot):
    world, trajectories = built(
        Cruising(radius=0.5, position=(-5.0, 5.0), velocity=(2.0, 0.0)),
        Cruising(radius=0.5, position=(5.0, 5.0), velocity=(-2.0, 0.0)),
        obstacles=(Disc(2.0, 5.0, 0.5),),
    )
    with Engine(world, turtlebot, trajectories=trajectories) as engine:
        _, bodies, way = placed(engine, 1200)
    assert np.abs(bodies - way).max() < 1e-9


# Runs

ROOM = World("room", (0.0, 0.0, 6.0, 4.0), (Disc(3.0, 3.0, 0.3),))
TASK = Task(ROOM, (0.6, 1.4, 0.0), (5.4, 1.4), cell=0.2)
BESIDE = (
    Keyframed(radius=0.3, keyframes=((0.0, 3.0, 0.4), (4.0, 5.0, 0.4)), loop="teleport"),
    Cruising(radius=0.2, position=(1.0, 3.5), velocity=(0.5, 0.0)),
    Wandering(radius=0.15, cell=0.4, period=0.8, start=(5.5, 3.5), seed=1),
)


def among(*movers, robot, **settings):
    """A drive among movers, by a robot that does not avoid them."""
    settings = {"avoidance": None, "replanning": None, **settings}
    return run(Scenario.of(changed(TASK, "world", movers=movers), "astar", robot, **settings))


@pytest.fixture(scope="module")
def passed(turtlebot):
    """A drive past three movers."""
    result = among(*BESIDE, robot=turtlebot, seed=3)
    assert result.succeeded, (result.outcome, result.certificate)
    return result.rollout


@pytest.fixture(scope="module")
def standing(turtlebot):
    """A robot whose motors are too weak to move it, and its goal."""
    return Scenario.of(TASK, "astar", replace(turtlebot, wheel_torque=1e-4))


def test_the_log_holds_every_mover_at_every_row(passed):
    assert passed.movers.shape == (len(passed.t), 3, 2)
    assert [mover.radius for mover in passed.record.task.world.movers] == [0.3, 0.2, 0.15]
    assert (passed.movers == passed.trajectories().positions(passed.t)).all()


def test_clearance_includes_movers(passed):
    np.testing.assert_allclose(closed_form_clearance(passed), passed.clearance, atol=1e-12)
    centre = np.hypot(*np.moveaxis(passed.movers - passed.pose[:, None, :2], -1, 0)) - [0.3, 0.2, 0.15] - 0.18
    assert (passed.clearance <= centre.min(axis=1) + 1e-12).all()
    assert (np.abs(passed.clearance - centre.min(axis=1)) < 1e-9).sum() > 100


def test_distant_movers_do_not_change_the_drive(passed, turtlebot):
    """Movers are not on the grid, and none was near."""
    alone = among(robot=turtlebot, seed=3).rollout
    assert (alone.cells == passed.cells).all()
    np.testing.assert_allclose(alone.pose, passed.pose, atol=1e-6)


def test_driving_into_a_mover_is_a_collision(turtlebot):
    mover = Keyframed(radius=0.3, keyframes=((0.0, 3.0, 0.4), (4.0, 3.0, 1.4), (9.0, 3.0, 1.5)))
    result = among(mover, robot=turtlebot)
    assert result.outcome is Outcome.COLLIDED
    assert "movers[0] at 0." in result.reason
    log, certificate = result.rollout, result.certificate
    assert not result.succeeded
    assert not certificate.certified
    assert not any("disagree" in problem for problem in certificate.problems)
    assert set(log.contacts[:, 1]) == {1}  # after the one disc
    assert _contacts(log) == (1, 0, 0)


def test_a_robot_brakes_after_a_contact(collided_run):
    log = collided_run.rollout
    first, target = int(log.contacts[0, 0]), log.command[-1]
    assert log.command[first, 0] > 0.1
    assert target.tolist() == [0.0, 0.0]
    assert np.abs(log.twist[-1]).max() < 0.02


@pytest.fixture(scope="module")
def hit(standing):
    """A run in which a mover hits the robot that stands."""
    mover = Keyframed(radius=0.3, keyframes=((0.0, 3.0, 1.4), (4.0, 0.0, 1.4)))
    return run(changed(standing, "task.world", movers=(mover,)))


def test_being_hit_while_standing_is_an_outcome_of_its_own(hit):
    assert hit.outcome is Outcome.HIT_WHILE_STANDING
    assert not hit.succeeded
    assert "movers[0] at 0.75 m/s, the robot at 0.00 m/s" in hit.reason
    assert _contacts(hit.rollout) == (0, 1, 0)
    assert not hit.certificate.certified
    assert not any("outcome" in problem or "disagree" in problem for problem in hit.certificate.problems)


@pytest.mark.parametrize("place", [(0.7, 1.4), (0.6, 1.0)])
def test_being_hit_by_a_teleporting_mover_is_an_outcome_of_its_own(standing, place):
    mover = Keyframed(radius=0.3, keyframes=((0.0, *place), (2.0, 3.0, 1.4)), loop="teleport", phase=1.0)
    result = run(changed(standing, "task.world", movers=(mover,)))
    assert result.outcome is Outcome.HIT_BY_TELEPORT
    assert result.rollout.t[int(result.rollout.contacts[0, 0])] == pytest.approx(1.0, abs=0.02)
    assert _contacts(result.rollout) == (0, 0, 1)


def test_a_mover_that_appears_within_the_braking_distance_counts_as_a_teleport_hit(turtlebot):
    """At 0.7 m/s the turtlebot needs 0.245 m to brake; the mover appears 0.1 m or 0.4 m ahead of it."""
    clean = among(robot=turtlebot).rollout
    x = float(clean.pose[600, 0])  # at 2.5 s
    for gap, outcome in ((0.1, Outcome.HIT_BY_TELEPORT), (0.4, Outcome.COLLIDED)):
        ahead = x + 0.18 + 0.3 + gap
        frames = ((0.0, ahead, 1.4), (4.0, ahead + 0.001, 1.4), (4.5, ahead + 1.0, 3.5))
        mover = Keyframed(radius=0.3, keyframes=frames, loop="teleport", phase=2.0)
        assert among(mover, robot=turtlebot).outcome is outcome


def test_a_robot_does_not_start_in_a_mover(turtlebot):
    mover = Keyframed(radius=0.3, keyframes=((0.0, 0.6, 1.0), (9.0, 3.0, 1.4)))
    with pytest.raises(FieldError, match=r"overlaps movers\[0\]"):
        among(mover, robot=turtlebot)


def test_a_contact_in_the_control_period_that_would_end_as_stuck_counts(standing):
    rigid = replace(standing.robot, wheel_torque=1e-6)
    alone = run(replace(standing, robot=rigid)).rollout
    assert alone.outcome is Outcome.STUCK
    touching = float(alone.t[-1]) - 1.5 / 240  # after the first physics step of the last control period
    mover = Cruising(radius=0.3, position=(5.0, 1.4), velocity=(-(4.4 - 0.48) / touching, 0.0))
    task = changed(TASK, "world", movers=(mover,))
    result = run(replace(standing, task=task, robot=rigid, avoidance=None, replanning=None))
    assert result.outcome is Outcome.HIT_WHILE_STANDING
    assert alone.t[-1] - 1 / 60 < result.rollout.t[int(result.rollout.contacts[0, 0])] <= alone.t[-1]


def test_the_time_limit_of_a_task_counts_unless_another_is_given(small_scenario):
    task = replace(small_scenario.task, time_limit=1.0)
    short = run(replace(small_scenario, task=task))
    assert short.outcome is Outcome.TIMED_OUT
    assert short.rollout.record.time_limit == 1.0
    assert run(replace(small_scenario, task=task, time_limit=60.0)).succeeded


def test_wanderers_avoid_unseen_obstacles(turtlebot):
    task = changed(TASK, "world", movers=BESIDE[2:])
    scenario = Scenario.of(task, "astar", turtlebot, unseen=(Disc(5.0, 3.4, 0.2), Disc(5.5, 2.6, 0.2)))
    places = scenario.trajectories.positions(np.arange(0, 60, 0.05))[:, 0]
    for disc in scenario.unseen:
        assert np.hypot(*(places - (disc.x, disc.y)).T).min() > disc.radius + 0.15
    log = run(scenario).rollout
    assert (log.movers == log.trajectories().positions(log.t)).all()


def test_a_robot_drives_among_movers_without_a_scenario(turtlebot):
    """An engine with trajectories is all that `follow` needs to drive among movers."""
    world = replace(ROOM, movers=BESIDE)
    controller = PurePursuit()
    tracked = controller.prepare(Route(np.array([(0.6, 1.4), (5.4, 1.4)])), world, turtlebot, 0.05, 1 / 60)
    with Engine(world, turtlebot, trajectories=Trajectories.of(world, TASK.start[:2])) as engine:
        log = follow(engine, controller, tracked, TASK, limit=60)
        assert engine.time == pytest.approx(log.t[-1])
    assert log.outcome is Outcome.SUCCEEDED
    assert log.movers.shape == (len(log.t), 3, 2)


def _contacts(log):
    m = measure(log)
    return m["contacts_driving"], m["contacts_standing"], m["contacts_teleported"]


# Certificates


def with_movers(log, *movers):
    """The log with other movers in its task."""
    return changed(log, "record.task.world", movers=movers)


def grazed(passed, mover, gap):
    """The log with only one mover, of the radius that leaves `gap` at the nearest row."""
    log = replace(with_movers(passed, mover), movers=passed.movers[:, :1])
    centres = log.trajectories().positions(log.t)
    nearest = float(np.hypot(*np.moveaxis(centres - log.pose[:, None, :2], -1, 0)).min())
    log = with_movers(log, replace(mover, radius=nearest - 0.18 - gap))
    log = replace(log, movers=centres)
    return replace(log, clearance=closed_form_clearance(log))


def test_the_bound_holds_on_a_finer_walk_with_jumps(passed):
    fine = np.linspace(0, len(passed.t) - 1, 10 * len(passed.t) - 9)
    rows = np.arange(len(passed.t))
    pose = np.stack([np.interp(fine, rows, np.unwrap(column)) for column in passed.pose.T], axis=1)
    for frames, phase in (
        (((0.0, 1.5, 0.8), (0.6301, 5.0, 0.8)), 0.0),
        (((0.0, 5.0, 2.0), (1.2303, 0.6, 2.0)), 0.0),
        # Approaches the robot and teleports away 4.95 steps after the start: closest between two rows.
        (((0.0, 0.6, 3.4), (0.4, 0.6, 1.9)), 0.4 - 4.95 / 240),
    ):
        log = grazed(passed, Keyframed(radius=0.1, loop="teleport", phase=phase, keyframes=frames), 0.05)
        moving = log.trajectories().positions(fine / 240)
        finer = replace(log, pose=pose, movers=moving)
        assert log.trajectories().jumps(log.t).any()
        assert closed_form_clearance(finer).min() >= certify(log).bound
