"""Scans computed all at once are those of the scanner that drives use."""

import math

import numpy as np
import pytest

from antdrive.robots.lidar import Lidar
from antdrive.sim.sensing import Scanner
from antdrive.views.export import scanning
from antdrive.worlds import Cruising, Disc, World


def some_world(rng: np.random.Generator, discs: int, movers: int) -> World:
    places = rng.uniform((-4.2, -2.2), (4.2, 2.2), (discs + movers, 2)).tolist()
    radii, heights = rng.uniform(0.02, 0.8, discs + movers).tolist(), rng.uniform(0.05, 0.6, discs + movers).tolist()
    everything = [(*place, radius, height) for place, radius, height in zip(places, radii, heights, strict=True)]
    return World(
        "some",
        (-5.0, -3.0, 5.0, 3.0),
        tuple(Disc(*row) for row in everything[:discs]),
        movers=tuple(
            Cruising(radius=r, position=(x, y), velocity=(0.1, 0.0), height=h) for x, y, r, h in everything[discs:]
        ),
    )


@pytest.mark.parametrize("view", [0.5, 4.7, 2 * math.pi])
@pytest.mark.parametrize(("discs", "movers"), [(0, 0), (40, 3), (3, 0)])
def test_they_are_those_of_the_scanner(view: float, discs: int, movers: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scanning, "AT_ONCE", 2000)  # a few scans at a time
    rng = np.random.default_rng(discs)
    lidar = Lidar(
        beams=181, field_of_view=view, min_range=0.3, max_range=6.0, rate=10.0, x=0.1, y=-0.05, yaw=0.7, height=0.2
    )
    world = some_world(rng, discs, movers)
    poses = np.column_stack([rng.uniform((-5.2, -3.2), (5.2, 3.2), (60, 2)), rng.uniform(-7, 7, 60)])
    places = np.array([mover.position for mover in world.movers]).reshape(-1, 2) + rng.normal(size=(60, movers, 2))
    found = scanning.exact_scans(lidar, world, poses, places)
    scanner, radii = Scanner.of(lidar, world), np.array([mover.radius for mover in world.movers])
    expected = np.array([scanner.scan(tuple(p), m, radii) for p, m in zip(poses.tolist(), places, strict=True)])
    assert np.isneginf(expected).any(), "a lidar in a cylinder or behind a wall"
    assert discs == 0 or np.isposinf(expected).any() or view < 1
    assert np.array_equal(np.isinf(found), np.isinf(expected))
    assert np.allclose(found, expected, rtol=1e-6, atol=1e-6)


def test_ranges_are_multiples_of_the_resolution() -> None:
    lidar = Lidar(beams=90, field_of_view=6.0, min_range=0.1, max_range=30.0, rate=10.0, resolution=0.25)
    world = some_world(np.random.default_rng(1), 4, 0)
    poses = np.array([[0.0, 0.0, 0.3]])
    found = scanning.exact_scans(lidar, world, poses, np.empty((1, 0, 2)))[0]
    assert np.isfinite(found).all()
    assert np.abs(found - Scanner.of(lidar, world).scan((0.0, 0.0, 0.3))).max() < 1e-5
    assert np.array_equal(found, np.round(found / 0.25) * 0.25)
