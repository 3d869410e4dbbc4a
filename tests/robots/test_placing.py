"""Whether a robot fits where it stands."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.robots import Footprint, RobotSpec, footprint_clearance, load_robot, overlap_at
from antdrive.robots.placing import gaps
from antdrive.worlds import Disc, World

WORLD = World("w", (0.0, 0.0, 6.0, 4.0), (Disc(5.0, 3.0, 0.2), Disc(2.5, 1.8, 0.4)))
JACKAL = load_robot("jackal")


@given(st.floats(0, 6), st.floats(0, 4), st.floats(-7, 7), st.floats(0, 0.2))
def test_the_least_gap_is_the_footprints_clearance(x: float, y: float, yaw: float, rounding: float) -> None:
    robot = dataclasses.replace(JACKAL, footprint=dataclasses.replace(JACKAL.footprint, rounding=rounding))
    clearance = footprint_clearance(WORLD, robot.footprint, [(x, y, yaw)])
    np.testing.assert_allclose(gaps(WORLD, robot, [(x, y, yaw)]).min(axis=1), clearance, atol=1e-12)


@pytest.mark.parametrize(
    ("pose", "says"),
    [
        ((3.0, 2.0, 0.0), "overlaps obstacles[1] at (2.5, 1.8) with radius 0.4 by 0.0315 m"),
        ((0.1, 2.0, 0.0), "overlaps the left wall by 0.07 m"),
        ((5.9, 1.0, 0.0), "overlaps the right wall by 0.07 m"),
        ((3.0, 0.16, 0.0), "overlaps the lower wall by 0.01 m"),
        ((3.0, 3.9, 0.0), "overlaps the upper wall by 0.07 m"),
        ((3.0, 3.0, 0.0), ""),
    ],
)
def test_an_overlap_names_the_obstacle_and_its_depth(
    turtlebot: RobotSpec, pose: tuple[float, float, float], says: str
) -> None:
    robot = dataclasses.replace(turtlebot, footprint=Footprint.disc(0.17))
    assert overlap_at(WORLD, robot, pose) == says


def test_the_yaw_decides_for_a_rectangle() -> None:
    beside = JACKAL.footprint.half_width + 0.01
    assert overlap_at(WORLD, JACKAL, (3.0, beside, 0.0)) == ""
    assert "the lower wall" in overlap_at(WORLD, JACKAL, (3.0, beside, math.pi / 4))


def test_touching_is_refused_and_unseen_obstacles_count(turtlebot: RobotSpec) -> None:
    robot = dataclasses.replace(turtlebot, footprint=Footprint.disc(0.25))
    assert overlap_at(WORLD, robot, (0.25, 2.0, 0.0)) == "touches the left wall"
    assert overlap_at(WORLD, robot, (1.0, 1.0, 0.0)) == ""
    assert overlap_at(WORLD, robot, (1.0, 1.0, 0.0), (Disc(1.0, 1.5, 0.35),)).startswith(
        "overlaps unseen[0] at (1, 1.5)"
    )
