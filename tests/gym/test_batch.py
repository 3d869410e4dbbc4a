"""The kinematic plant beside the drives' own noise, lidar, distances and rules."""

import dataclasses
import math

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra `gym`")

from antdrive.cli import warming
from antdrive.gym import _kernels_batch as kernels
from antdrive.gym.batch import CONTROL_HZ, ENDINGS, PHYSICS_HZ, Episode, KinematicPlant, thinned
from antdrive.robots import Footprint, footprint_clearance, load_robot
from antdrive.robots.noise import SLIP_TIME
from antdrive.runs.pool import Pool
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.sensing.scanner import Scanner
from antdrive.worlds import Cruising, Disc, Keyframed, Task, Trajectories, World, generate

ROBOT = thinned(load_robot("jackal"), 64, 10.0)
EXACT = dataclasses.replace(ROBOT, lidar=dataclasses.replace(ROBOT.lidar, resolution=0.0, sigma=0.0))
OUTLINES = {
    "disc": Footprint.disc(0.3),
    "box": ROBOT.footprint,
    "polygon": Footprint.polygon([(0.4, 0.0), (0.0, 0.28), (-0.3, 0.25), (-0.3, -0.25), (0.0, -0.28)]),
}
MOVERS = (
    Cruising(radius=0.3, position=(3.0, 7.0), velocity=(0.8, -0.5)),
    Keyframed(radius=0.2, height=0.1, keyframes=((0.0, 6.0, 1.0), (5.0, 9.0, 1.0))),  # below the beams
)


def plant_at(task, robot=EXACT, noise=0.0, steps=500, seed=3):
    plant = KinematicPlant(robot, 1, steps)
    plant.place(0, Episode(task, 0, seed, noise))
    return plant


def driven(plant, actions):
    """The plant's states after each action, until its episode ends."""
    for action in actions:
        plant.drive(np.ones(1, dtype=np.bool_), np.array([action], dtype=np.float64))
        yield plant.robots.state[0].copy()
        if plant.robots.ending[0]:
            return


def wandering(count, seed=0):
    return np.random.default_rng(seed).uniform((0.1, -0.6), (0.6, 0.6), (count, 2))


def forest(movers=()):
    task = generate("forest", 5, {"count": 20, "radius": "0.1,0.5", "clearance": 1.5})
    return dataclasses.replace(task, world=dataclasses.replace(task.world, movers=movers))


@pytest.mark.parametrize("name", OUTLINES)
def test_rays_and_clearance_are_those_of_the_scanner_and_the_footprint(name):
    robot, task = dataclasses.replace(EXACT, footprint=OUTLINES[name]), forest(MOVERS)
    plant, movers = plant_at(task, robot), Trajectories.of(task.world, task.start[:2])
    for step, state in enumerate(driven(plant, wandering(60)), 1):
        if plant.robots.ending[0]:
            break
        places = movers.positions(step / 10)[0]
        ranges = Scanner.of(robot.lidar, task.world).scan(state[:3], places, movers.radii)
        seen = np.clip(np.nan_to_num(ranges, posinf=10.0, neginf=0.0) / 10.0, 0.0, 1.0)
        assert plant.robots.seen[0, :64] == pytest.approx(seen, abs=1e-12)
        among = World("all", task.world.bounds, (*task.world.obstacles, *map(Disc, *places.T, movers.radii)))
        clear = footprint_clearance(among, robot.footprint, [state[:3]])[0]
        assert plant.robots.facts[0, kernels.CLEARANCE] == pytest.approx(clear, abs=1e-12)
    assert step > 20


def moved(pose, speed, turn, time):
    middle = pose[2] + turn * time / 2
    return np.add(pose, (speed * math.cos(middle) * time, speed * math.sin(middle) * time, turn * time))


def test_slip_delay_odometry_and_fixes_follow_their_equations():
    """The model of antdrive.robots.noise, written down once more, with the plant's own random numbers."""
    levels, half, period = EXACT.noise, EXACT.track / 2, 1 / CONTROL_HZ
    task = Task(World("open", (0.0, 0.0, 40.0, 40.0)), (20.0, 20.0, 0.5), (39.0, 39.0))
    numbers, plant = plant_at(task).robots.random.copy(), plant_at(task, noise=1.0)  # without noise nothing is drawn

    def normals(count):
        return np.array([kernels.normal(0, numbers) for _ in range(count)])

    def fixed(estimate):
        return pose + normals(3) * (levels.pose_xy, levels.pose_xy, levels.pose_yaw) - estimate

    pose, rims, slip, command = np.array(task.start), np.zeros(2), np.zeros(2), (0.0, 0.0)
    delayed, keep = [(0.0, 0.0)] * round(levels.delay / period), math.exp(-period / SLIP_TIME)
    gain_xy, gain_yaw = plant.robots.noise[0, 4:6]
    normals(2)
    estimate = pose + (gain_xy, gain_xy, gain_yaw) * fixed(pose)
    tick, limits = 0, plant._shared.limits
    for action, state in zip(wandering(40), driven(plant, wandering(40)), strict=True):
        for _ in range(CONTROL_HZ // 10):
            command = kernels.limited(*command, *action, period, limits)
            delayed.append(command)
            speed, turn = delayed.pop(0)
            slip = keep * slip + levels.slip * math.sqrt(1 - keep**2) * normals(2)
            rims = np.array((speed - turn * half, speed + turn * half)) * (1 + slip)
            for _ in range(PHYSICS_HZ // CONTROL_HZ):
                pose = moved(pose, rims.mean(), (rims[1] - rims[0]) / (2 * half), 1 / PHYSICS_HZ)
            tick += 1
            rolled = rims / (1 + slip) * (1 + levels.encoder * normals(2))
            estimate = moved(estimate, rolled.mean(), (rolled[1] - rolled[0]) / (2 * half), period)
            error = fixed(estimate)
            estimate = estimate + (gain_xy, gain_xy, gain_yaw) * error * (
                tick % round(CONTROL_HZ / levels.pose_rate) == 0
            )
        assert state[:3] == pytest.approx(pose, abs=1e-9)
        assert state[kernels.BELIEVED : kernels.BELIEVED + 3] == pytest.approx(estimate, abs=1e-9)
        ahead = estimate
        for speed, turn in delayed:
            ahead = moved(ahead, speed, turn, period)
        away = math.dist(ahead[:2], task.goal)
        assert plant.robots.seen[0, 64] == pytest.approx(min(away / kernels.FARTHEST, 1.0), abs=1e-9)


@pytest.mark.parametrize("binding", [{}, {"max_wheel_speed": 21.0, "max_lateral_acceleration": 50.0}])
def test_commands_keep_every_limit_of_the_robot(binding):
    robot = dataclasses.replace(ROBOT, **binding)
    limits, period, command = KinematicPlant(robot, 1, 1)._shared.limits, 1 / CONTROL_HZ, (0.0, 0.0)
    rng = np.random.default_rng(1)
    for action in np.repeat(rng.choice((-1.0, 1.0, 0.3), (200, 2)), 20, axis=0):
        speed, turn = kernels.limited(*command, *action, period, limits)
        assert abs(speed) <= robot.max_speed
        assert abs(speed - command[0]) <= robot.max_acceleration * period + 1e-12
        assert abs(turn) <= robot.max_yaw_rate
        assert abs(turn) - abs(command[1]) <= robot.max_yaw_acceleration * period + 1e-12
        assert abs(speed * turn) <= robot.max_lateral_acceleration + 1e-9
        assert abs(speed) + abs(turn) * robot.track / 2 <= robot.max_wheel_speed * robot.wheel_radius + 1e-9
        command = speed, turn


@pytest.mark.parametrize("name", OUTLINES)
def test_the_first_contact_ends_the_episode_within_a_physics_step(name):
    robot = dataclasses.replace(EXACT, footprint=OUTLINES[name])
    world = World("wall", (0.0, 0.0, 8.0, 4.0), (Disc(4.0, 2.1, 0.2),))
    plant = plant_at(Task(world, (1.0, 2.0, 0.0), (7.0, 2.0)), robot)
    *_, state = driven(plant, [(1.0, 0.0)] * 50)
    assert ENDINGS[plant.robots.ending[0]] is Outcome.COLLIDED
    gap = footprint_clearance(world, robot.footprint, [state[:3]])[0]
    assert -state[kernels.SPEED] / PHYSICS_HZ <= gap <= 1e-4


def hit_by(mover, action=(0.0, 0.0), bounds=(0.0, 0.0, 9.0, 4.0)):
    task = Task(World("hit", bounds, movers=(mover,)), (3.0, 2.0, 0.0), (8.0, 2.0))
    plant = plant_at(task)
    list(driven(plant, [action] * 100))
    return ENDINGS[plant.robots.ending[0]]


COMING = Cruising(radius=0.3, position=(6.0, 2.0), velocity=(-1.0, 0.0))


def test_a_mover_that_hits_a_standing_robot_is_told_apart_from_the_robot_s_own_contact():
    assert hit_by(COMING) is Outcome.HIT_WHILE_STANDING
    assert hit_by(COMING, (0.2, 0.0)) is Outcome.COLLIDED


def test_a_mover_that_appears_on_the_robot_is_a_teleport():
    jumps = Keyframed(
        radius=0.3, keyframes=((0.0, 3.2, 2.0), (0.5, 5.0, 2.0), (1.0, 6.0, 3.0)), loop="teleport", phase=0.5
    )
    assert hit_by(jumps) is Outcome.HIT_BY_TELEPORT


def test_a_robot_that_drives_to_the_goal_brakes_and_stands_there():
    task = Task(World("open", (0.0, 0.0, 9.0, 4.0)), (1.0, 2.0, 0.0), (3.0, 2.0))
    plant = plant_at(task)
    *_, state = driven(plant, [(0.4, 0.0)] * 60)
    assert ENDINGS[plant.robots.ending[0]] is Outcome.SUCCEEDED
    assert math.dist(state[:2], task.goal) <= task.goal_tolerance
    assert abs(state[kernels.SPEED]) < 0.01


def test_a_robot_that_stands_at_the_goal_by_its_estimate_alone_is_stuck():
    plant = plant_at(Task(World("open", (0.0, 0.0, 9.0, 4.0)), (1.0, 2.0, 0.0), (3.0, 2.0)))
    plant.robots.state[0, kernels.BELIEVED] = 2.9
    assert kernels.arrived(0, plant.robots) == kernels.STUCK
    plant.robots.state[0, kernels.X] = 2.9
    assert kernels.arrived(0, plant.robots) == kernels.SUCCEEDED
    plant.robots.state[0, kernels.TO_TURN] = 0.02
    assert kernels.arrived(0, plant.robots) == kernels.DRIVING


def test_worlds_that_come_later_change_no_other():
    first, second = forest(MOVERS), generate("forest", 6)
    alone, both = KinematicPlant(EXACT, 2, 50), KinematicPlant(EXACT, 2, 50)
    for plant in (alone, both):
        plant.place(0, Episode(first, "first", 1, 1.0))
    for number in range(20):
        both.place(1, Episode(generate("forest", number), number, 2, 1.0))
    both.place(1, Episode(second, "second", 2, 1.0))
    chosen = np.array([True, False])
    for action in wandering(20):
        for plant in (alone, both):
            plant.drive(chosen, np.array([action, action]))
    assert alone.results(0) == both.results(0)
    assert both.robots.tick.tolist()[1] == 0


def test_warm_compiles_the_batch(monkeypatch, tmp_path):
    works = []
    monkeypatch.setattr(Pool, "results", lambda _, __, items, **___: works.extend(items) or ())
    monkeypatch.setattr(warming, "_marker", lambda: tmp_path / "warm")
    warming.warm(1)
    assert warming.drive_batch in works
    warming.drive_batch()


def test_constants_are_those_of_the_rules_that_they_repeat():
    from antdrive.robots.clearance import TOUCHING
    from antdrive.sim.log import contacts, ending
    from antdrive.worlds import limits

    assert kernels.STOPPED_SPEED == ending.STOPPED_SPEED
    assert kernels.STANDING_SPEED == contacts.STANDING_SPEED
    assert kernels.TOUCHING == TOUCHING
    assert kernels.LEAP == limits.MAX_SPEED
    assert kernels.SLIP_TIME == SLIP_TIME
