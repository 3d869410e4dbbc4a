"""Tests of drives in Python. pytest collects them and the suites."""

from antdrive.testing import DriveFixture, assert_collision_free


def test_a_mapless_robot_keeps_clear(drive: DriveFixture) -> None:
    """Lidar alone finds the pillars."""
    run = drive.run("world.yaml", "dstar-lite", "robot.yaml", map="none", noise=1)
    assert_collision_free(run, clearance=0.01)
