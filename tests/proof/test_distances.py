"""Distances of outlines against shapely, which shares no code with them."""

import math

import numpy as np
import pytest
import shapely
from shapely import affinity

from antdrive.proof.distances import to_outline
from antdrive.robots.spec import Footprint

PAIRS = 10_000  # in each test about as many, touching, overlapping and apart


def footprints(rng):
    """One of each kind: discs on and off the axle, rectangles on and off it, rounded, a capsule, polygons."""
    a, b, r, x, y = rng.uniform(0.05, 0.6, 5).tolist()
    angles = np.sort(rng.choice(24, rng.integers(3, 9), replace=False)) * math.tau / 24
    return [
        Footprint.disc(r),
        Footprint.disc(r, (x, y - 0.3)),
        Footprint.rectangle(2 * a, 2 * b),
        Footprint.rectangle(2 * a, 2 * b, (x, y - 0.3)),
        Footprint(half_length=a, half_width=b, rounding=r / 3),
        Footprint(half_length=a, rounding=r),
        Footprint.polygon(np.stack([a * np.cos(angles) + x - 0.3, b * np.sin(angles)], axis=1).tolist()),
    ]


def core(foot, pose):
    """The outline without its rounding, at a pose."""
    a, b = foot.half_length, foot.half_width
    corners = foot.corners or ((a, b), (-a, b), (-a, -b), (a, -b))
    body = shapely.convex_hull(shapely.MultiPoint(corners))
    return affinity.translate(affinity.rotate(body, pose[2], origin=(0, 0), use_radians=True), *pose[:2])


def test_distances_of_moving_outlines_are_those_of_shapely():
    rng = np.random.default_rng(5)
    wrong, overlaps, count = [], 0, 0
    while count < PAIRS:
        shapes = footprints(rng)
        for foot in shapes:
            other = shapes[rng.integers(len(shapes))]
            pose, at = (rng.uniform((-1, -1, -4), (1, 1, 4), (8, 3)) for _ in range(2))
            found = to_outline(foot, pose, other, at)
            np.testing.assert_allclose(to_outline(other, at, foot, pose), found, atol=1e-12)
            for row in range(len(pose)):
                a, b = core(foot, pose[row]), core(other, at[row])
                apart = a.distance(b) - foot.rounding - other.rounding
                sunk = a.intersects(b)
                overlaps += sunk
                count += 1
                # Where the cores overlap, the distance is that of shapely's boundary of their Minkowski difference.
                if sunk:
                    expected = -depth(a, b) - foot.rounding - other.rounding
                else:
                    expected = apart
                if abs(found[row] - expected) > 1e-9:
                    wrong.append((foot, other, pose[row], at[row], found[row], expected))
    assert not wrong, (len(wrong), wrong[0])
    assert overlaps > PAIRS // 10


def depth(a, b):
    """How far one convex shape must move to leave another: from the origin to the edge of their Minkowski difference."""
    corners = [np.array(shape.exterior.coords if shape.geom_type == "Polygon" else shape.coords) for shape in (a, b)]
    difference = (corners[0][:, None] - corners[1][None]).reshape(-1, 2)
    hull = shapely.convex_hull(shapely.MultiPoint(difference))
    return hull.boundary.distance(shapely.Point(0, 0)) if hull.geom_type == "Polygon" else 0.0


@pytest.mark.parametrize("rows", [0, 1])
def test_no_rows_and_one_row(rows):
    box, pose = Footprint.rectangle(0.5, 0.3), np.zeros((rows, 3))
    assert to_outline(box, pose, box, pose + 1.0).shape == (rows,)


def test_an_outline_without_a_pose_has_no_distance():
    boxes = Footprint.rectangle(0.5, 0.3), Footprint.polygon([(0.3, 0.0), (-0.2, 0.2), (-0.2, -0.2)])
    there, nowhere = np.zeros((1, 3)), np.full((1, 3), np.nan)
    for one in boxes:
        for two in (*boxes, Footprint.disc(0.2)):
            assert np.isnan(to_outline(one, there, two, nowhere)).all()
            assert np.isnan(to_outline(one, nowhere, two, there)).all()
