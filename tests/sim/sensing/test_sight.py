"""The clear way ends where the swept footprint first meets what was not seen or was hit: sampled poses are the oracle."""

import math

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

from antdrive.base import Floats, Pose
from antdrive.robots import Footprint, Lidar
from antdrive.sim.sensing import OccupancyMap, clear_distance, clear_turn

EYE = Lidar(beams=240, field_of_view=4.7, min_range=0.1, max_range=6.0, rate=20.0)
BOX, ROUND = Footprint.rectangle(0.5, 0.4), Footprint.disc(0.2)


def seen(unknown: list[tuple[float, float]], hits: list[tuple[float, float]] = (), side: float = 3.0) -> OccupancyMap:  # type: ignore[assignment]
    """A map of free ground with unknown cells and hits at some places."""
    grid = OccupancyMap(EYE, 0.1, bounds=(-side, -side, side, side))
    grid.arrays.free[:] = True
    for x, y in unknown:
        grid.arrays.free[math.floor((y + side) / 0.1), math.floor((x + side) / 0.1)] = False
    for x, y in hits:  # a scan of a single beam
        ranges = np.full(EYE.beams, -np.inf)
        ranges[0] = 0.5
        angle = EYE.angles[0]
        grid.insert((x - 0.5 * math.cos(angle), y - 0.5 * math.sin(angle), 0.0), ranges)
    return grid


def blockers(grid: OccupancyMap) -> Floats:
    unknown = np.argwhere(~grid.seen_free & ~grid.occupied)
    centres = (unknown[:, ::-1] + 0.5) * grid.cell + grid.origin
    return np.vstack((np.column_stack((centres, np.full(len(centres), grid.cell / math.sqrt(2)))), grid.discs()))


def gaps(discs: Floats, foot: Footprint, pose: Pose) -> Floats:
    """Distance from a footprint to discs, from the outline's own frame."""
    x, y, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    local = (discs[:, :2] - (x, y)) @ np.array([[cos, -sin], [sin, cos]])
    over = np.abs(local) - (foot.half_length, foot.half_width)
    return np.hypot(*np.maximum(over, 0).T) + np.minimum(over.max(axis=1), 0) - foot.rounding - discs[:, 2]


def along(pose: Pose, speed: float, yaw_rate: float, way: float) -> Pose:
    """The pose after a way, by 2000 small steps."""
    x, y, yaw = pose
    turn = yaw_rate * way / abs(speed)
    headings = yaw + turn * (np.arange(2000) + 0.5) / 2000
    step = math.copysign(way, speed) / 2000
    return x + step * np.cos(headings).sum(), y + step * np.sin(headings).sum(), yaw + turn


places = st.lists(st.tuples(st.floats(-2.5, 2.5), st.floats(-2.5, 2.5)), max_size=12)


@hypothesis.settings(max_examples=60)
@hypothesis.given(
    places, places, st.sampled_from([BOX, ROUND]), st.sampled_from([1.0, -0.5]), st.floats(-2, 2), st.floats(-3, 3)
)
def test_the_way_is_clear_up_to_the_first_contact(
    unknown: list[tuple[float, float]],
    hits: list[tuple[float, float]],
    foot: Footprint,
    speed: float,
    rate: float,
    yaw: float,
) -> None:
    grid, pose = seen(unknown, hits), (0.1, -0.05, yaw)
    discs = blockers(grid)
    if len(discs):  # what overlaps the robot at first has a rule of its own
        discs = discs[gaps(discs, foot, pose) > 3e-3]
        for x, y, _ in blockers(grid)[gaps(blockers(grid), foot, pose) <= 3e-3]:
            grid.forget((x, y), 0.1)
            grid.take_as_free((x, y), 0.01)
        discs = blockers(grid)
        hypothesis.assume(not len(discs) or gaps(discs, foot, pose).min() > 3e-3)
    way = clear_distance(grid, pose, speed, rate, foot, 1.5)
    assert 0 <= way <= 1.5
    if len(discs):
        nearest = [gaps(discs, foot, along(pose, speed, rate, s)).min() for s in np.linspace(0, way, 60)]
        assert min(nearest) > -5e-4
        if way < 1.5:
            assert gaps(discs, foot, along(pose, speed, rate, way)).min() < 3e-3


@pytest.mark.parametrize("speed", [0.7, -0.7])
def test_unknown_ground_ahead_or_behind_ends_the_way(speed: float) -> None:
    ahead = [(math.copysign(1.55, speed), y) for y in np.arange(-2.95, 3.0, 0.1)]
    way = clear_distance(seen(ahead), (0.0, 0.0, 0.0), speed, 0.0, BOX, 2.0)
    assert way == pytest.approx(1.55 - 0.1 / math.sqrt(2) - 0.25, abs=3e-3)


def test_ground_beyond_the_map_was_not_seen() -> None:
    assert clear_distance(seen([], side=1.0), (0.0, 0.0, 0.0), 1.0, 0.0, ROUND, 5.0) == pytest.approx(0.8, abs=2e-3)


def test_a_limit_is_enough() -> None:
    assert clear_distance(seen([]), (0.0, 0.0, 0.0), 1.0, 0.5, BOX, 0.6) == 0.6


def test_a_turn_ends_where_a_corner_meets_something() -> None:
    grid = seen([], [(0.0, 0.3)])
    turn = clear_turn(grid, (0.0, 0.0, 0.0), 1.0, BOX, math.pi)
    corner, (_, y, size) = math.hypot(0.25, 0.2), grid.discs()[0]
    # The front of the box, 0.25 m ahead, has turned so far that the disc touches its corner or side.
    assert 0 < turn < math.pi / 2
    assert min(gaps(grid.discs(), BOX, (0.0, 0.0, turn))) == pytest.approx(1e-3, abs=2e-3)
    assert y - size < corner
    assert clear_turn(grid, (0.0, 0.0, 0.0), -1.0, BOX, math.pi) == pytest.approx(turn, abs=2e-2)
    assert clear_turn(seen([]), (0.0, 0.0, 0.0), 1.0, BOX, math.pi) == math.pi


def test_a_robot_may_leave_what_it_overlaps_but_not_come_nearer() -> None:
    grid = seen([(0.35, 0.05)])  # its disc reaches 0.03 m into the round robot's 0.2 m
    close = (0.1, 0.05, 0.0)
    assert clear_distance(grid, close, 1.0, 0.0, ROUND, 1.0) < 0.01
    assert clear_distance(grid, close, -1.0, 0.0, ROUND, 1.0) == 1.0
    beside = (0.3, -0.15, 0.0)  # drives along the cell
    assert clear_distance(grid, (0.35, -0.15, 0.0), 1.0, 0.0, ROUND, 1.0) == 1.0
    assert clear_distance(grid, beside, 1.0, 0.0, ROUND, 1.0) < 0.02


def test_nothing_is_gained_by_standing() -> None:
    assert clear_distance(seen([]), (0.0, 0.0, 0.0), 0.0, 1.0, BOX, 1.0) == 0.0
    assert clear_distance(seen([]), (0.0, 0.0, 0.0), 0.0, 0.0, BOX, 1.0) == 1.0


def test_footprints_off_the_axle_are_swept_as_they_are() -> None:
    """The same rectangle reaches 5 cm farther ahead where it is shifted, and no farther than that behind."""
    grid = seen([], [(1.0, 0.1), (-1.0, 0.1)])
    shifted, triangle = (
        Footprint.rectangle(0.5, 0.4, (0.05, 0.0)),
        Footprint.polygon([(0.3, 0.0), (-0.2, 0.3), (-0.2, -0.3)]),
    )
    centred = [clear_distance(grid, (0.0, 0.0, 0.0), way, 0.0, BOX, 2.0) for way in (1.0, -1.0)]
    off = [clear_distance(grid, (0.0, 0.0, 0.0), way, 0.0, shifted, 2.0) for way in (1.0, -1.0)]
    assert np.subtract(off, centred) == pytest.approx([-0.05, 0.05], abs=2e-3)
    # The triangle's slanted side is at x = 0.3 - 0.1 * 5 / 3 where y = 0.1; a disc meets it nearer to its tip.
    x, _, size = grid.discs()[0]
    way = clear_distance(grid, (0.0, 0.0, 0.0), 1.0, 0.0, triangle, 2.0)
    assert way == pytest.approx(x - 0.3 + (0.1 * 0.5 - size * math.hypot(0.5, 0.3)) / 0.3, abs=5e-3)
    assert clear_turn(seen([], [(0.0, 0.25)]), (0.0, 0.0, 0.0), 1.0, triangle, math.pi) < math.pi / 2
    assert clear_turn(seen([], [(0.0, 0.5)]), (0.0, 0.0, 0.0), 1.0, triangle, math.pi) == math.pi
