"""Python tests of the courier."""

from pathlib import Path

from courier import WideBerth
from hypothesis import given, settings

from antdrive import Task, load_robot, run
from antdrive.sim import Scenario
from antdrive.testing import DriveFixture, assert_collision_free, tasks

COURIER = load_robot(Path(__file__).parent / "robots" / "courier.yaml")


def test_a_higher_price_keeps_the_courier_farther_from_the_desks(drive: DriveFixture) -> None:
    wide = drive("worlds/office.yaml", WideBerth(price=4.0), COURIER, smoothing="none")
    near = drive.run("worlds/office.yaml", WideBerth(price=0.0), COURIER, smoothing="none")
    assert wide.metric("mean_clearance_m") > near.metric("mean_clearance_m")


@given(tasks(COURIER, clearance=0.1, size=(3.0, 5.0)))
@settings(max_examples=3, deadline=None, derandomize=True)
def test_the_courier_touches_nothing_anywhere(task: Task) -> None:
    assert_collision_free(run(Scenario.of(task, WideBerth(), COURIER, margin=0.05)), clearance=0.01)
