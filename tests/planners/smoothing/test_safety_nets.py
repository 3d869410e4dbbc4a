"""The checks of smoothed lines, called directly: on real lines one may mask another."""

import math

import numpy as np
import pytest

from antdrive.planners.smoothing import _kernels_smooth as kernels
from antdrive.planners.smoothing.smooth import NOTES, _pulled, _runs, _smoothed, pull_taut
from antdrive.worlds import Disc, World, segment_clearance

INFLATE = 0.2
WORLD = World("w", (0.0, 0.0, 8.0, 6.0), (Disc(4.0, 3.0, 0.5),))
ABOVE = np.array([(1.0, 3.0), (4.0, 4.2), (7.0, 3.0)])
BELOW = ABOVE * (1, -1) + (0, 6)


def rejection(xy, line=ABOVE, longest=math.inf, string=None):
    string = string or _pulled(line, WORLD.discs, INFLATE)
    limits = INFLATE - kernels.SLACK, longest + kernels.SLACK
    return NOTES[kernels.fault(string, xy, line, WORLD.discs, np.array(WORLD.bounds), *limits)]


def length(xy):
    return float(np.hypot(*np.diff(xy, axis=0).T).sum())


def over(top):
    """Return a line across the disc at some height, with steep ends."""
    return np.array([(1.0, 3.0), (1.5, top), (6.5, top), (7.0, 3.0)])


def test_a_line_on_the_other_side_is_refused():
    assert rejection(ABOVE) == ""
    assert "on its other side" in rejection(BELOW)
    assert "on its other side" in rejection(ABOVE, line=BELOW)
    assert rejection(BELOW, line=BELOW) == ""


@pytest.mark.parametrize(("closer", "refused"), [(0.0, False), (5e-10, False), (1e-7, True), (0.005, True)])
def test_a_line_that_comes_closer_than_the_clearance_is_refused(closer, refused):
    xy = over(3.7 - closer)
    assert ("closer than the clearance" in rejection(xy)) is refused
    assert (pull_taut(xy, WORLD.discs, WORLD.bounds, INFLATE) is None) is (closer > 1e-9)
    assert len(list(_runs(segment_clearance(WORLD, xy[:-1], xy[1:]), INFLATE))) == (3 if closer > 2e-9 else 1)


@pytest.mark.parametrize(
    ("spare", "refused"), [(1e-8, False), (0.0, False), (-5e-10, False), (-1e-8, True), (-0.01, True)]
)
def test_a_line_that_is_longer_than_allowed_is_refused(spare, refused):
    assert ("longer than the plan's" in rejection(ABOVE, longest=length(ABOVE) + spare)) is refused


def test_a_string_that_comes_too_close_is_refused_though_its_drawing_does_not():
    narrow = _pulled(ABOVE, WORLD.discs, INFLATE - 0.005)
    assert "closer than the clearance" in rejection(over(3.8), string=narrow)


def test_a_line_with_finer_arcs_than_ours_is_pulled_taut_with_finer_corners():
    """The shortest line around the disc, with corners closer to the arc than usual."""
    radius = 0.7 + kernels.SHRINK
    side = math.acos(radius / 3.0)
    angles = np.linspace(math.pi - side, side, 32)
    stand_off = radius / math.cos((angles[0] - angles[1]) / 2)
    arc = (4.0, 3.0) + stand_off * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    line = np.vstack([(1.0, 3.0), arc, (7.0, 3.0)])
    bulge = 5e-4
    string = _pulled(line, WORLD.discs, INFLATE)
    drawn, _ = kernels.string_points(string, WORLD.discs, np.array(WORLD.bounds), INFLATE, bulge)
    assert length(drawn) > length(line) + 1e-6, "the usual drawing is longer"
    piece = _smoothed(line, length(line), WORLD.discs, np.array(WORLD.bounds), INFLATE, 0.0, 0.03, 0.0, bulge)
    assert (piece.kind, piece.note) == ("taut", "")
    assert length(piece.xy) <= length(line) + 1e-9
