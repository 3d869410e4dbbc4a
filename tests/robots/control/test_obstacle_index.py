"""Queries among the discs near a point have the bits of queries among all discs."""

import math

import numpy as np
import pytest

from antdrive.robots import Footprint, PurePursuit, load_robot
from antdrive.robots._kernels_footprint import footprint_clearances
from antdrive.robots.clearance import kernel_shape
from antdrive.robots.control._kernels_avoidance import Required, passes_within
from antdrive.robots.control._kernels_lines import outline_clearance
from antdrive.robots.control._kernels_obstacles import (
    ObstacleIndex,
    arc_clearance,
    clearance_at,
    index_discs,
    is_beside_arc,
    nearby,
    on_arc,
    points_within,
)
from antdrive.robots.control.pursuit import obstacles_around
from antdrive.worlds import Route, World
from antdrive.worlds._kernels import segment_clearance

BOUNDS = np.array([-3.0, 2.0, 5.0, 8.0])
SHAPES = {
    "disc": Footprint.disc(0.3),
    "rectangle": Footprint.rectangle(0.9, 0.6),
    "polygon": Footprint.polygon([(0.5, 0.3), (-0.2, 0.3), (-0.4, 0.0), (-0.2, -0.3), (0.5, -0.3)]),
}


def indices(rng):
    """Yield indices of random discs: by squares of different sizes, and around a point; overlapping discs of all sizes."""
    for count in (0, 1, 30, 300):
        discs = rng.uniform((-3, 2, 0.01), (5, 8, 0.4), (count, 3))
        for side, distance in ((0.5, 3.0), (1.3, 4.0)):
            found, starts = index_discs(discs, BOUNDS, side, distance)
            yield discs, ObstacleIndex(found, starts, BOUNDS, BOUNDS[:2], side)
        yield discs, obstacles_around(rng.uniform((-3, 2), (5, 8)), discs, BOUNDS)


def test_discs_within_reach_are_listed_and_the_list_is_short():
    rng, listed, everything = np.random.default_rng(7), 0, 0
    for discs, obstacles in indices(rng):
        for x, y in rng.uniform((-3.5, 1.5), (5.5, 8.5), (40, 2)):
            reach = rng.uniform(-0.2, 1.5)
            here = {tuple(row) for row in nearby(x, y, reach, obstacles).tolist()}
            away = np.hypot(discs[:, 0] - x, discs[:, 1] - y) - discs[:, 2]
            inside = np.clip((x, y), BOUNDS[:2], BOUNDS[2:])
            if math.dist((x, y), inside) + reach < 2.9:
                assert {tuple(row) for row in discs[away <= reach].tolist()} <= here
            listed, everything = listed + len(here), everything + len(nearby(x, y, math.inf, obstacles))
    assert listed < 0.5 * everything


def test_the_clearance_of_a_point_is_that_among_all_discs():
    rng = np.random.default_rng(8)
    for _, obstacles in indices(rng):
        for x, y in rng.uniform((-3.5, 1.5), (5.5, 8.5), (40, 2)):
            listed = nearby(x, y, math.inf, obstacles)
            assert clearance_at(x, y, obstacles) == segment_clearance(x, y, x, y, listed, BOUNDS)


def tuning_of(footprint):
    robot, route = load_robot("turtlebot"), Route(np.array([(0.0, 4.0), (1.0, 4.0)]))
    tracked = PurePursuit().prepare(route, World("empty", tuple(BOUNDS)), robot, 0.05, 1 / 60)
    shape, corners = kernel_shape(footprint)
    return tracked.tuning._replace(
        robot_radius=footprint.radius, half_length=shape[0], half_width=shape[1], rounding=shape[2], corners=corners
    )


def among_all(footprint, poses, discs):
    """Return the footprint's least distance to a disc or wall at poses."""
    out = np.empty(len(poses))
    footprint_clearances(np.ascontiguousarray(poses), *kernel_shape(footprint), discs, BOUNDS, out)
    return out.min()


@pytest.mark.parametrize("shape", SHAPES)
def test_the_clearance_of_a_footprint_is_that_among_all_discs(shape):
    rng, footprint = np.random.default_rng(9), SHAPES[shape]
    tuning, below = tuning_of(footprint), 0
    for _, obstacles in indices(rng):
        for x, y, yaw in rng.uniform((-3, 2, -4), (5, 8, 4), (40, 3)):
            expected = among_all(footprint, np.array([(x, y, yaw)]), nearby(x, y, math.inf, obstacles))
            assert outline_clearance(x, y, yaw, obstacles, tuning, math.inf) == expected
            most = rng.uniform(0, 0.4)
            found = outline_clearance(x, y, yaw, obstacles, tuning, most)
            assert found == expected if expected < most else found >= most
            below += expected < most
    assert below > 100


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("outlined", [False, True])
def test_a_step_comes_within_the_required_clearance_where_it_does_among_all_discs(shape, outlined):
    rng, footprint, step = np.random.default_rng(10), SHAPES[shape], 0.1
    tuning, answers = tuning_of(footprint), []
    for _, obstacles in indices(rng):
        for _ in range(80):
            x, y, yaw, v, w = rng.uniform((-3, 2, -4, -1.5, -2), (5, 8, 4, 1.5, 2))
            end = x + v * step * math.cos(yaw), y + v * step * math.sin(yaw), yaw + w * step
            trail, listed = np.array([(x, y, yaw, v, w), (*end, v, w)]), nearby(x, y, math.inf, obstacles)
            centre = segment_clearance(x, y, *end[:2], listed, BOUNDS)
            required = rng.uniform(-0.1, 0.3) + (0.0 if outlined else footprint.radius)
            expected = centre < required
            if outlined:
                count = int((abs(v) * step + abs(end[2] - yaw) * footprint.radius) / 0.05) + 1
                shares = (np.arange(1, count + 1) / count)[:, None]
                poses = trail[0, :3] + shares * (trail[1, :3] - trail[0, :3])
                expected = centre < required + footprint.radius and among_all(footprint, poses, listed) < required
            keeps = Required(-math.inf, required) if outlined else Required(required, -math.inf)
            assert passes_within(trail, 0, keeps, obstacles, tuning, step) == expected
            answers.append(expected)
    assert 0.1 < np.mean(answers) < 0.9


def test_the_clearance_of_an_arc_is_that_of_the_nearest_disc():
    """Every disc alone, without a bound; arcs of up to more than a full turn."""
    rng = np.random.default_rng(11)
    for _ in range(200):
        x, y, yaw, sweep = rng.uniform((-1, 4, -4, -7), (3, 6, 4, 7))
        radius = rng.uniform(0.01, 5)
        curvature = math.copysign(1 / radius, sweep)
        chord = 2 * radius * math.sin(abs(sweep) / 2)
        ends = x + chord * math.cos(yaw + sweep / 2), y + chord * math.sin(yaw + sweep / 2)
        discs, most = rng.uniform((-3, 2, 0.01), (5, 8, 0.4), (30, 3)), rng.uniform(0, 2)
        arc = x, y, yaw, curvature, sweep, *ends
        alone = [distance_to_arc(*arc, disc) for disc in discs]
        walls = arc_clearance(*arc, discs[:0], BOUNDS, math.inf)
        assert arc_clearance(*arc, discs, BOUNDS, most) == min(most, walls, *alone)


def distance_to_arc(x, y, yaw, curvature, sweep, ex, ey, disc):
    """Return the distance of a disc from an arc: from its ends, or from the circle beside the arc."""
    px, py, size = disc.tolist()
    radius, (cx, cy) = 1 / abs(curvature), (x - math.sin(yaw) / curvature, y + math.cos(yaw) / curvature)
    away = min(math.hypot(px - x, py - y), math.hypot(px - ex, py - ey))
    beside = is_beside_arc(px - cx, py - cy, x + ex - 2 * cx, y + ey - 2 * cy, radius, sweep)
    if not beside and on_arc(math.atan2(py - cy, px - cx), math.atan2(y - cy, x - cx), sweep):
        away = min(away, abs(math.hypot(px - cx, py - cy) - radius))
    return away - size


def test_points_are_within_reach_of_obstacles_where_their_clearance_is_no_more():
    rng, answers = np.random.default_rng(12), []
    for _, obstacles in indices(rng):
        points, reach = rng.uniform((-3.5, 1.5), (5.5, 8.5), (60, 2)), rng.uniform(0.0, 0.6, 60)
        expected = [
            segment_clearance(x, y, x, y, nearby(x, y, math.inf, obstacles), BOUNDS) <= most
            for (x, y), most in zip(points.tolist(), reach, strict=True)
        ]
        found = np.empty(60, dtype=np.bool_)
        points_within(points, reach, obstacles, found)
        assert found.tolist() == expected
        answers += expected
    assert 0.1 < np.mean(answers) < 0.9
