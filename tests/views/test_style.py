"""The colours of planners."""

import itertools

import numpy as np
import pytest

from antdrive.planners import PLANNERS
from antdrive.sim.log.outcome import Outcome
from antdrive.views.style import PLANNER_COLOURS, PLANNER_STYLES, VERDICTS, planner_style


@pytest.mark.parametrize("name", PLANNERS)
def test_every_planner_has_a_style(name):
    assert name in PLANNER_STYLES


def test_no_two_planners_have_similar_colours():
    colours = np.array([colour for colour, _ in PLANNER_STYLES.values()], dtype=float)
    gaps = [np.linalg.norm(one - other) for one, other in itertools.combinations(colours, 2)]
    assert min(gaps) > 40
    assert len(PLANNER_COLOURS) == len(PLANNER_STYLES)


def test_a_plugins_planner_has_a_style_of_its_name():
    assert planner_style("somebody-elses") == planner_style("somebody-elses")
    assert planner_style("somebody-elses")[1] == "dashdot"


def test_every_outcome_has_a_label():
    assert set(VERDICTS) == set(Outcome)
