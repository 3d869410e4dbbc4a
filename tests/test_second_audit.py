"""The second audit of `benchmarks.held_out` finds the least clearance of drives for which it is known otherwise."""

import math

import numpy as np
import pytest

from antdrive.sim import Run, Scenario, certify, run
from antdrive.worlds import Cruising, Keyframed, Task, Trajectories, World
from antdrive.worlds.files.world_file import task_to_dict
from benchmarks.second_audit import Least, least_clearance, track

DISC, BOX = {"radius": 0.18}, {"length": 0.508, "width": 0.43}
HZ = 240


def audit(world: dict[str, object], footprint: dict[str, float], pose: np.ndarray, twist: np.ndarray) -> Least:
    base: dict[str, object] = {"bounds": [0.0, 0.0, 10.0, 10.0], "obstacles": []}
    return least_clearance({**base, **world}, footprint, pose, twist, HZ)


def straight(y: float, rows: int = 480, speed: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    x = 4.0 + speed * np.arange(rows) / HZ
    return np.column_stack([x, np.full(rows, y), np.zeros(rows)]), np.tile([speed, 0.0], (rows, 1))


def post(x: float, y: float, radius: float) -> dict[str, object]:
    return {"obstacles": [{"x": x, "y": y, "radius": radius, "height": 1.0}]}


@pytest.mark.parametrize(("footprint", "side"), [(DISC, 0.18), (BOX, 0.215)])
def test_a_post_that_is_passed(footprint: dict[str, float], side: float) -> None:
    found = audit(post(5.0, 5.5, 0.1), footprint, *straight(5.0))
    assert found.rows == pytest.approx(0.5 - 0.1 - side, abs=1e-4)
    assert found.near == "obstacles[0]"


def test_a_corner_that_sweeps_past_a_post() -> None:
    """The box turns on the spot; its corner, 0.3328 m from the centre, is nearest."""
    yaw = np.linspace(0.0, 2 * math.pi, 2000)
    pose = np.column_stack([np.full_like(yaw, 5.0), np.full_like(yaw, 5.0), yaw])
    twist = np.column_stack([np.zeros_like(yaw), np.full_like(yaw, (yaw[1] - yaw[0]) * HZ)])
    found = audit(post(5.5, 5.0, 0.1), BOX, pose, twist)
    assert found.between == pytest.approx(0.4 - math.hypot(0.254, 0.215), abs=1e-4)


def test_a_thin_post_inside_the_footprint_is_an_overlap() -> None:
    for footprint in (DISC, BOX):
        assert audit(post(5.0, 5.0, 0.01), footprint, *straight(5.0)).rows < 0


def test_a_post_between_two_rows_is_seen_on_the_arc() -> None:
    """Rows 0.5 m apart, with the post in the middle."""
    pose = np.array([[4.75, 5.0, 0.0], [5.25, 5.0, 0.0]])
    found = audit(post(5.0, 5.2, 0.01), DISC, pose, np.array([[0.5 * HZ, 0.0]] * 2))
    assert found.rows > 0.1
    assert found.between == pytest.approx(0.2 - 0.01 - 0.18, abs=1e-4)
    assert found.t == pytest.approx(0.5 / HZ)


def test_a_mover_that_comes_after_the_last_row_does_not_count() -> None:
    mover = {"radius": 0.1, "position": [6.0, 5.0], "velocity": [-0.6, 0.0]}
    found = audit({"movers": [mover]}, DISC, *straight(5.0, rows=100))
    assert found.between == found.rows


def test_walls_and_movers_count() -> None:
    wall = audit({}, BOX, *straight(0.3))
    assert (wall.near, wall.rows) == ("bottom wall", pytest.approx(0.085, abs=1e-4))
    mover = {"radius": 0.1, "position": [5.0, 6.0], "velocity": [0.0, -0.6]}
    found = audit({"movers": [mover]}, DISC, *straight(5.0))
    assert found.near == "movers[0]"
    x, y, t = *straight(5.0)[0].T[:2], np.arange(480) / HZ
    assert found.rows == pytest.approx(np.hypot(x - 5.0, y - 6.0 + 0.6 * t).min() - 0.28, abs=1e-4)


def test_movers_are_where_the_drive_says() -> None:
    bounds, t = (0.0, 0.0, 4.0, 3.0), np.arange(20_000) / HZ
    movers = (
        Cruising(radius=0.2, position=(1.0, 1.0), velocity=(-0.9, 0.7), phase=3.7),
        Keyframed(radius=0.2, keyframes=((0.0, 1.0, 1.0), (2.0, 2.0, 1.5), (2.5, 1.0, 2.0)), phase=1.1),
    )
    task = Task(World("m", bounds, movers=movers), (0.5, 2.5, 0.0), (3.5, 2.5))
    places = Trajectories.of(task.world, task.start[:2]).positions(t)
    for m, mover in enumerate(task_to_dict(task)["movers"]):
        np.testing.assert_allclose(track(mover, np.array(bounds), t), places[:, m], atol=1e-9)


def test_a_real_drive_agrees_with_its_certificate(small_run: Run, small_scenario: Scenario, jackal: object) -> None:
    for robot, footprint in ((small_run.scenario.robot, DISC), (jackal, BOX)):
        log = run(Scenario(task=small_run.scenario.task, planner=small_scenario.planner, robot=robot)).rollout  # type: ignore[arg-type]
        assert log is not None
        found = least_clearance(task_to_dict(log.record.task), footprint, log.pose, log.twist, HZ)
        certificate = certify(log)
        assert found.rows == pytest.approx(certificate.min_clearance, abs=1e-4)
        assert found.between > certificate.bound
