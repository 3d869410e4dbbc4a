"""Physics compared with closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from antdrive.robots import RobotSpec, footprint_clearance
from antdrive.sim import Engine
from antdrive.sim.log.certificate import SKID, SPINNING
from antdrive.sim.physics.bullet import bullet, client
from antdrive.worlds import Disc, World

OPEN = World("open", (-10, -10, 10, 10))


@pytest.mark.parametrize("robot", ["turtlebot", "jackal"])
@pytest.mark.parametrize(("share_v", "share_w"), [(1.0, 0.0), (0.5, 0.3), (0.3, -0.5), (0.0, 0.5)])
def test_the_robot_moves_as_commanded(
    robot: str, share_v: float, share_w: float, request: pytest.FixtureRequest
) -> None:
    spec: RobotSpec = request.getfixturevalue(robot)
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


@pytest.mark.parametrize("robot", ["turtlebot", "jackal"])
@pytest.mark.parametrize("bearing", [0.0, 0.4, 0.7025, 1.2, math.pi / 2, 2.6])
@pytest.mark.parametrize("gap", [-0.004, 0.002])
def test_contacts_agree_with_the_closed_form(
    robot: str, bearing: float, gap: float, request: pytest.FixtureRequest
) -> None:
    """A cylinder that overlaps the footprint by 4 mm is touched; one that is 2 mm away is not."""
    spec: RobotSpec = request.getfixturevalue(robot)
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


def _gap(spec: RobotSpec, pose: tuple[float, float, float], bearing: float, distance: float) -> float:
    x, y, yaw = pose
    disc = Disc(x + distance * math.cos(yaw + bearing), y + distance * math.sin(yaw + bearing), 0.1)
    return float(footprint_clearance(World("w", OPEN.bounds, (disc,)), spec.footprint, [pose])[0])


@pytest.mark.parametrize(("yaw", "wall"), [(0, 1), (math.pi, 0), (math.pi / 2, 3), (-math.pi / 2, 2)])
def test_walls_are_solid(turtlebot: RobotSpec, yaw: float, wall: int) -> None:
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


def test_a_low_obstacle_is_touched(turtlebot: RobotSpec) -> None:
    with Engine(World("w", OPEN.bounds, (Disc(1, 0, 0.2, height=0.02),)), turtlebot) as engine:
        engine.place((0, 0, 0))
        engine.command(0.5, 0)
        assert any(engine.step() for _ in range(480))


def test_torque_limits_acceleration(turtlebot: RobotSpec) -> None:
    from dataclasses import replace

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


def test_clients_are_closed_even_after_an_error(turtlebot: RobotSpec) -> None:
    engine = Engine(OPEN, turtlebot)
    with pytest.raises(ZeroDivisionError), engine:
        raise ZeroDivisionError
    number = engine._client
    assert bullet().getConnectionInfo(number)["isConnected"] == 0
    with client() as fresh:
        assert bullet().getNumBodies(fresh) == 0
        assert bullet().getConnectionInfo(fresh)["isConnected"] == 1


def test_the_pose_is_that_of_the_axle(jackal: RobotSpec) -> None:
    """The centre of mass hangs below the axle: a tilt must not shift the pose."""
    with Engine(OPEN, jackal) as engine:
        engine.place((1.25, -2.5, 2.0))
        np.testing.assert_allclose(engine.state(), (1.25, -2.5, 2.0, 0, 0), atol=2e-4)


def slide(spec: RobotSpec, acceleration: float, physics_hz: int, control_hz: int, degrees: float) -> float:
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
def test_a_robot_that_speeds_up_slides_by_a_third_of_what_it_gains_in_a_step(
    robot: str, acceleration: float, physics_hz: int, request: pytest.FixtureRequest
) -> None:
    """The certificate allows for it, see SKID."""
    spec: RobotSpec = replace(request.getfixturevalue(robot), wheel_torque=1e3)
    slides = [slide(spec, acceleration, physics_hz, physics_hz, degrees) for degrees in range(0, 180, 10)]
    share = max(slides) / (acceleration / physics_hz)
    assert 0.3 < share < 0.33
    assert share < SKID
    assert slides[0] < 0.02 * max(slides)  # none along the world's axes


@pytest.mark.parametrize("friction", [0.9, 1.5])
@pytest.mark.parametrize(("physics_hz", "control_hz"), [(60, 10), (60, 20), (240, 10)])
def test_a_robot_whose_wheels_spin_slides_by_a_share_of_what_it_gains_in_a_period(
    jackal: RobotSpec, friction: float, physics_hz: int, control_hz: int
) -> None:
    """The certificate allows for it, see SPINNING."""
    spec, acceleration = replace(jackal, wheel_friction=friction, wheel_torque=1e3), 7.0
    most = max(slide(spec, acceleration, physics_hz, control_hz, degrees) for degrees in range(0, 180, 10))
    spinning = min(1.0, acceleration / (friction * 9.81)) * acceleration / control_hz
    assert 0.5 * spinning * SPINNING < most < SKID * acceleration / physics_hz + SPINNING * spinning
