"""What is shared: the elite's additional pheromone among the best ants, and the first field between chance and potential."""

import numpy as np
import pytest

from antdrive.base import Floats
from antdrive.planners import PotentialFieldAnts, Query
from antdrive.planners.colonies.ant_system import ExploringAnts
from antdrive.planners.colonies.pfaco import AntPool
from antdrive.worlds import Grid
from tests.planners.colonies.test_colony import BEND, DIRECT, state, walks


@pytest.mark.parametrize("best", [1, 2, 3])
def test_best_ants_share_the_additional_deposit_of_the_elite(best: int) -> None:
    tours = walks(BEND, *[DIRECT] * best, [])
    amounts = ExploringAnts(elite=2.0, deposit=5.0).amounts(state(tours))
    each = (1 + 2 / best) * 5 / tours.lengths[1]  # eq. 7-8 of suganthi2019
    np.testing.assert_allclose(amounts, [5 / tours.lengths[0], *[each] * best, 0])


@pytest.mark.parametrize("mix", [0.0, 0.3, 1.0])
def test_the_first_pheromone_is_chance_by_the_given_share(mix: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Eq. 14 of lee2008: mix x chance + (1 - mix) x potential / its largest value."""
    first: list[Floats] = []

    def look(self: AntPool, trail: Floats, heuristic: Floats, alpha: float) -> tuple[Floats, int]:
        first.append(trail.copy())
        return np.empty(0), 0

    monkeypatch.setattr(AntPool, "run", look)
    query = Query(Grid.from_free(np.ones((20, 30))), (0, 0), (19, 29))
    planner = PotentialFieldAnts(mix=mix, min_pheromone=1e-9)
    next(planner.iterate(query, np.random.default_rng(3)))
    field = planner.potential(query)
    chance = first[0] - (1 - mix) * field / field.max()
    assert chance.min() >= -1e-12
    assert chance.max() <= mix
    assert chance.mean() == pytest.approx(mix / 2, abs=0.03 * mix + 1e-9)
    assert chance.std() == pytest.approx(mix / np.sqrt(12), abs=0.03 * mix + 1e-9)
