"""Bullet's own output never mixes with ours."""

import ctypes
import os

import pytest

from antdrive.robots import RobotSpec
from antdrive.sim import Engine
from antdrive.sim.physics.bullet import bullet, client
from antdrive.worlds import World

OPEN = World("open", (-5, -5, 5, 5))


def written(capfd: pytest.CaptureFixture[str]) -> str:
    """What the process has written to file descriptor 1, with what C still had in its buffer."""
    ctypes.CDLL(None).fflush(None)
    return capfd.readouterr().out


def test_bullet_prints_warnings_outside_a_client(capfd: pytest.CaptureFixture[str]) -> None:
    """The other tests are worth something: Bullet does print on C's stdout."""
    p = bullet()
    number = p.connect(p.DIRECT)
    with pytest.raises(p.error):
        p.loadURDF("/no/such/file.urdf", physicsClientId=number)
    p.disconnect(number)
    assert "not found" in written(capfd)


def test_bullet_prints_nothing_on_stdout(
    turtlebot: RobotSpec, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """A robot whose inertia is impossible makes Bullet print while it is loaded."""
    import antdrive.sim.physics.engine as engine

    text = engine.robot_urdf
    monkeypatch.setattr(engine, "robot_urdf", lambda *args: text(*args).replace('ixx="', 'ixx="-'))
    with Engine(OPEN, turtlebot) as made:
        made.place((0, 0, 0))
        os.write(1, b"ours")
        made.step()
    assert written(capfd) == "ours"


def test_stdout_is_back_when_the_last_client_is_closed(capfd: pytest.CaptureFixture[str]) -> None:
    libc = ctypes.CDLL(None)
    first, second = client(), client()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    libc.puts(b"within")
    second.__exit__(None, None, None)
    libc.puts(b"after")
    assert written(capfd) == "after\n"


def test_an_engine_takes_the_client_that_another_has_left(turtlebot: RobotSpec) -> None:
    p = bullet()
    with Engine(OPEN, turtlebot) as first:
        number = first._client
        assert number > 0
    assert p.isConnected(number)
    assert p.getNumBodies(number) == 0
    with Engine(OPEN, turtlebot) as second:
        assert second._client == number


def test_a_client_of_ones_own_is_never_the_one_that_is_kept(turtlebot: RobotSpec) -> None:
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


def test_a_kept_client_that_was_closed_is_replaced(turtlebot: RobotSpec) -> None:
    p = bullet()
    with Engine(OPEN, turtlebot) as first:
        number = first._client
    p.disconnect(number)
    with Engine(OPEN, turtlebot) as second:
        second.place((0, 0, 0))
        assert second.step() == []


def test_a_client_whose_world_failed_is_not_kept(turtlebot: RobotSpec) -> None:
    with Engine(OPEN, turtlebot) as first:
        number = first._client
    with pytest.raises(KeyError), client() as taken:
        raise KeyError
    assert taken == number
    assert not bullet().isConnected(number)
