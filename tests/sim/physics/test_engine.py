"""Physics compared with closed forms, and Bullet's own output apart from ours."""

import ctypes
import math
import os
from dataclasses import replace

import numpy as np
import pytest

from antdrive.robots import footprint_clearance
from antdrive.sim import Engine
from antdrive.sim.log.certificate import SKID, SPINNING
from antdrive.sim.physics.bullet import bullet, client
from antdrive.worlds import Disc, World

OPEN = World("open", (-10, -10, 10, 10))


@pytest.mark.parametrize(("share_v", "share_w"), [(1.0, 0.0), (0.5, 0.3), (0.3, -0.5), (0.0, 0.5)])
def test_the_robot_moves_as_commanded(spec, share_v, share_w):
    v, w = share_v * min(spec.max_speed, 1.0), share_w * spec.max_yaw_rate
    with Engine(OPEN, spec) as engine:
        engine.place((0, 0, 0.3))
        for i in range(240):  # accelerate gently
            engine.command(v * i / 240, w * i / 240)
            engine.step()
        engine.command(v, w)
        before = engine.state()
        for _ in range(240):
            assert engine.step() == []
        after = engine.state()
    assert after.speed == pytest.approx(v, abs=0.003)
    assert after.yaw_rate == pytest.approx(w, abs=0.01)
    turned = (after.yaw - before.yaw + math.pi) % (2 * math.pi) - math.pi
    assert turned == pytest.approx((w + math.pi) % (2 * math.pi) - math.pi, abs=0.01)
    chord = abs(v) if w == 0 else abs(2 * v / w * math.sin(w / 2))
    assert math.dist(before[:2], after[:2]) == pytest.approx(chord, abs=0.003)


@pytest.mark.parametrize("bearing", [0.0, 0.4, 0.7025, 1.2, math.pi / 2, 2.6])
@pytest.mark.parametrize("gap", [-0.004, 0.002])
def test_contacts_agree_with_the_closed_form(spec, bearing, gap):
    """A cylinder that overlaps the footprint by 4 mm is touched; one that is 2 mm away is not."""
    pose = (1.0, -2.0, 0.5)
    low, high = 0.0, 2.0
    for _ in range(60):  # the distance along the bearing at which the surfaces are `gap` apart
        middle = (low + high) / 2
        low, high = (middle, high) if _gap(spec, pose, bearing, middle) < gap else (low, middle)
    x, y = 1 + low * math.cos(0.5 + bearing), -2 + low * math.sin(0.5 + bearing)
    with Engine(World("w", OPEN.bounds, (Disc(5, 5, 0.1), Disc(x, y, 0.1))), spec) as engine:
        engine.place(pose)
        touched = engine.contacts() + engine.step()
    assert bool(touched) == (gap < 0)
    assert {contact.obstacle for contact in touched} <= {1}


def _gap(spec, pose, bearing, distance):
    x, y, yaw = pose
    disc = Disc(x + distance * math.cos(yaw + bearing), y + distance * math.sin(yaw + bearing), 0.1)
    return float(footprint_clearance(World("w", OPEN.bounds, (disc,)), spec.footprint, [pose])[0])


@pytest.mark.parametrize(("yaw", "wall"), [(0, 1), (math.pi, 0), (math.pi / 2, 3), (-math.pi / 2, 2)])
def test_walls_are_solid(turtlebot, yaw, wall):
    world = World("box", (-1, -1, 1, 1), (Disc(0.8, 0.8, 0.1),))
    with Engine(world, turtlebot) as engine:
        engine.place((0, 0, yaw))
        engine.command(0.5, 0)
        touched = []
        for _ in range(600):
            touched += engine.step()
        state = engine.state()
    assert {contact.obstacle for contact in touched} == {len(world.obstacles) + wall}
    assert max(contact.force for contact in touched) > 1
    assert max(abs(state.x), abs(state.y)) == pytest.approx(1 - turtlebot.radius, abs=0.01)


def test_torque_limits_acceleration(turtlebot):
    reached = []
    for torque in (1.5, 0.02):
        with Engine(OPEN, replace(turtlebot, wheel_torque=torque)) as engine:
            engine.place((0, 0, 0))
            engine.command(0.7, 0)
            for _ in range(60):
                engine.step()
            reached.append(engine.state().speed)
    assert reached[0] == pytest.approx(0.7, abs=0.01)
    assert reached[1] < 0.3


def test_the_pose_is_that_of_the_axle(jackal):
    """The centre of mass hangs below the axle: a tilt must not shift the pose."""
    with Engine(OPEN, jackal) as engine:
        engine.place((1.25, -2.5, 2.0))
        np.testing.assert_allclose(engine.state(), (1.25, -2.5, 2.0, 0, 0), atol=2e-4)


def slide(spec, acceleration, physics_hz, control_hz, degrees):
    """How fast a robot slides aside that speeds up for half a second, on average [m/s]."""
    yaw, period = math.radians(degrees), physics_hz // control_hz
    with Engine(OPEN, spec, physics_hz=physics_hz) as engine:
        engine.place((0, 0, yaw))
        for k in range(physics_hz // 2):
            if k % period == 0:
                engine.command(acceleration * (k // period + 1) / control_hz, 0.0)
            engine.step()
        x, y = engine.state()[:2]
    return abs(math.cos(yaw) * y - math.sin(yaw) * x) / 0.5


@pytest.mark.parametrize("robot", ["turtlebot", "jackal"])
@pytest.mark.parametrize(("acceleration", "physics_hz"), [(2.0, 60), (7.0, 60), (7.0, 240)])
def test_a_robot_that_speeds_up_slides_by_a_third_of_what_it_gains_in_a_step(robot, acceleration, physics_hz, request):
    """The certificate allows for it, see SKID."""
    spec = replace(request.getfixturevalue(robot), wheel_torque=1e3)
    slides = [slide(spec, acceleration, physics_hz, physics_hz, degrees) for degrees in range(0, 180, 10)]
    share = max(slides) / (acceleration / physics_hz)
    assert 0.3 < share < 0.33
    assert share < SKID
    assert slides[0] < 0.02 * max(slides)  # none along the world's axes


@pytest.mark.parametrize("friction", [0.9, 1.5])
@pytest.mark.parametrize(("physics_hz", "control_hz"), [(60, 10), (60, 20), (240, 10)])
def test_a_robot_whose_wheels_spin_slides_by_a_share_of_what_it_gains_in_a_period(
    jackal, friction, physics_hz, control_hz
):
    """The certificate allows for it, see SPINNING."""
    spec, acceleration = replace(jackal, wheel_friction=friction, wheel_torque=1e3), 7.0
    most = max(slide(spec, acceleration, physics_hz, control_hz, degrees) for degrees in range(0, 180, 10))
    spinning = min(1.0, acceleration / (friction * 9.81)) * acceleration / control_hz
    assert 0.5 * spinning * SPINNING < most < SKID * acceleration / physics_hz + SPINNING * spinning


def written(capfd):
    """What the process has written to file descriptor 1, with what C still had in its buffer."""
    ctypes.CDLL(None).fflush(None)
    return capfd.readouterr().out


def test_bullet_prints_nothing_on_stdout(turtlebot, monkeypatch, capfd):
    """A robot whose inertia is impossible makes Bullet print while it is loaded."""
    import antdrive.sim.physics.engine as engine

    text = engine.robot_urdf
    monkeypatch.setattr(engine, "robot_urdf", lambda *args: text(*args).replace('ixx="', 'ixx="-'))
    with Engine(OPEN, turtlebot) as made:
        made.place((0, 0, 0))
        os.write(1, b"ours")
        made.step()
    assert written(capfd) == "ours"


def test_stdout_is_back_when_the_last_client_is_closed(capfd):
    libc = ctypes.CDLL(None)
    first, second = client(), client()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    libc.puts(b"within")
    second.__exit__(None, None, None)
    libc.puts(b"after")
    assert written(capfd) == "after\n"


def test_an_engine_takes_the_client_that_another_has_left(turtlebot):
    p = bullet()
    with Engine(OPEN, turtlebot) as first:
        number = first._client
        assert number > 0
    assert p.isConnected(number)
    assert p.getNumBodies(number) == 0
    with Engine(OPEN, turtlebot) as second:
        assert second._client == number


def test_an_engine_touches_no_other_engine_after_its_block(turtlebot):
    with Engine(OPEN, turtlebot) as first:
        first.place((0, 0, 0))
    with Engine(OPEN, turtlebot) as second:
        second.place((1, 1, 0))
        before = second.state()
        with pytest.raises(bullet().error):
            first.place((0, 0, 0))
        assert second.state() == before


def test_a_client_of_ones_own_is_never_the_one_that_is_kept(turtlebot):
    """Calls of PyBullet without a client's number mean client 0."""
    p = bullet()
    with Engine(OPEN, turtlebot):
        pass
    mine = p.connect(p.DIRECT)
    try:
        assert mine == 0
        box = p.createMultiBody(0, p.createCollisionShape(p.GEOM_BOX, halfExtents=[1, 1, 1]))
        with Engine(OPEN, turtlebot) as engine:
            engine.place((0, 0, 0))
        assert p.getNumBodies() == 1
        assert p.getBodyUniqueId(0) == box
    finally:
        p.disconnect(mine)


def test_a_kept_client_that_was_closed_is_replaced(turtlebot):
    p = bullet()
    with Engine(OPEN, turtlebot) as first:
        number = first._client
    p.disconnect(number)
    with Engine(OPEN, turtlebot) as second:
        second.place((0, 0, 0))
        assert second.step() == []


def test_a_client_whose_world_failed_is_not_kept(turtlebot):
    with Engine(OPEN, turtlebot) as first:
        number = first._client
    with pytest.raises(KeyError), client() as taken:
        raise KeyError
    assert taken == number
    assert not bullet().isConnected(number)


def test_a_control_period_has_the_bits_of_single_steps(spec):
    """The compiled states equal those of `Engine.state`, which share no code; contacts carry their step."""
    world = World("wall", (0, -2, 6, 2), (Disc(spec.radius + 1.2, 0.05, 0.1),))
    commands = [(min(spec.max_speed, 0.8), 0.3 * (-1) ** k) for k in range(60)]
    with Engine(world, spec) as engine:
        engine.place((0.8, 0.0, 0.1))
        single, contacts = [], []
        for k, command in enumerate(commands):
            engine.command(*command)
            for j in range(4):
                contacts += [(4 * k + j, contact) for contact in engine.step()]
                single.append(engine.state())
    with Engine(world, spec) as engine:
        engine.place((0.8, 0.0, 0.1))
        motion, together, last = [], [], []
        for k, command in enumerate(commands):
            engine.command(*command)
            state, touched = engine.advance(4, motion)
            last.append(state)
            together += [(4 * k + step, contact) for step, contact in touched]
        states = engine.states(motion)
    assert contacts
    assert together == contacts
    assert states.tobytes() == np.array(single).tobytes()
    assert last == single[3::4]
