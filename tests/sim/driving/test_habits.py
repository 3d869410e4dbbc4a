"""Movers may take ways again that one took before, in both directions."""

import numpy as np
import pytest

from antdrive.sim import Perception
from antdrive.sim.driving.habits import Habits
from antdrive.worlds import Keyframed, Trajectories, World
from tests.sim.driving.ground_truth import GroundTruth

HZ, AHEAD = 20, np.arange(26) * 0.1
CORNER = ((0.0, 1.0, 1.0), (4.0, 5.0, 1.0), (8.0, 5.0, 5.0))  # east at 1 m/s, then north


def predicted(t, *movers, hz=HZ, perception=None):
    """The other predictions at a time, by a robot in the corner that has seen the movers since the start."""
    world = World("corner", (0.0, 0.0, 10.0, 10.0), movers=movers)
    truth = GroundTruth(Trajectories.of(world, (9.0, 9.0), 0), perception or Perception(), hz)
    habits = Habits(truth, hz)
    for tick in range(round(t * hz) + 1):
        others, radii = habits.predict(AHEAD, truth.at(tick, (5.0, 2.0)).predict(AHEAD))
    return others, radii


def walker(loop="pingpong", phase=0.0, frames=CORNER):
    return Keyframed(radius=0.25, keyframes=frames, loop=loop, phase=phase)


@pytest.mark.parametrize(
    ("t", "end"), [(11.0, (3.5, 1.0)), (19.0, (5.0, 2.5))], ids=["on the way back", "on the same way again"]
)
def test_a_mover_is_expected_to_turn_where_it_turned_before(t, end):
    others, radii = predicted(t, walker())
    assert radii.tolist() == [0.25]
    np.testing.assert_allclose(others[-1, 0], end, atol=0.1)


@pytest.mark.parametrize("hz", [5, 15, 60])
def test_the_control_rate_leaves_predictions_as_they_are(hz):
    others, _ = predicted(11.0, walker(), hz=hz)
    np.testing.assert_allclose(others[-1, 0], (3.5, 1.0), atol=0.25)


def test_positions_before_and_after_a_gap_are_no_way():
    """The mover leaves the range of perception on its way, and comes back elsewhere."""
    frames = ((0.0, 5.0, 3.0), (2.0, 7.0, 3.0), (12.0, 7.0, 9.5), (22.0, 5.0, 3.0))
    for t in np.arange(22.0, 26.0, 0.1):
        others, _ = predicted(t, walker("teleport", frames=frames), perception=Perception(range=3.0))
        steps = np.hypot(*np.diff(others, axis=0).transpose(2, 0, 1))
        assert steps.max(initial=0.0) < 0.3


def test_a_mover_at_a_new_place_has_no_other_prediction():
    assert predicted(3.5, walker())[0].shape == (26, 0, 2)


def test_a_mover_is_expected_to_do_what_another_did():
    later = [(t + 9.0, x, y) for t, x, y in CORNER]
    first = (0.0, 1.0, 1.0)
    others, _ = predicted(12.0, walker("once"), walker("once", frames=[first, *later]))
    np.testing.assert_allclose(others[-1], [(5.0, 2.5)], atol=0.1)
