"""Drives past people in the catalogue's worlds: certified, without long detours, slowly near people, hardly backwards."""

import numpy as np
import pytest

from antdrive.base.plane import polyline_length
from antdrive.sim import Perception, Scenario, run
from antdrive.worlds import load_task
from tests.records import changed

LIDAR = Perception(kind="lidar")
SEES = {
    "truth": {},
    "lidar": {"perception": LIDAR},
    "mapless": {"perception": LIDAR, "map": "none", "localisation": "matching"},
}


def driven(log):
    """The driven length, and the longest way backwards that was not driven forwards again [m]."""
    behind, longest = 0.0, 0.0
    for speed in log.twist[:, 0]:
        behind = max(0.0, behind - speed / log.record.physics_hz)
        longest = max(longest, behind)
    return polyline_length(log.pose[:, :2]), longest


@pytest.mark.slow
@pytest.mark.parametrize("sees", SEES)
@pytest.mark.parametrize("world", ["people-aisle", "people-corridor", "people-crossing", "people-doorway"])
def test_a_robot_passes_people_slowly_and_without_a_long_detour(world, sees, jackal):
    task = load_task(world)
    scenario = Scenario.of(task, "dstar-lite", jackal, **SEES[sees])
    settings = {key: value for key, value in SEES[sees].items() if key != "perception"}
    alone = run(Scenario.of(changed(task, "world", movers=()), "dstar-lite", jackal, **settings))
    done = run(scenario)
    assert done.succeeded, (done.outcome, done.reason)
    log = done.rollout
    way, backwards = driven(log)
    assert way <= 1.5 * driven(alone.rollout)[0]
    assert backwards <= 0.52
    radii = np.array([mover.radius for mover in task.world.movers])
    gaps = (np.hypot(*(log.movers - log.pose[:, None, :2]).transpose(2, 0, 1)) - radii - jackal.radius).min(axis=1)
    if world != "people-aisle" or sees != "mapless":  # there the person stands, and is part of the map
        assert log.twist[gaps < 1.0, 0].max() <= 0.82
