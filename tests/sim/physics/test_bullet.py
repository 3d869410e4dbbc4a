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
