"""Settings of the arms of each row, read from the planners."""

import dataclasses
import json

import numpy as np
import pytest

from antdrive.planners import Query, load_planner
from antdrive.runs.papers import arms, maps
from antdrive.runs.papers.arms import HEADS, arm_facts, merged, moves_in_words
from antdrive.runs.papers.experiment import Experiment, for_every_seed
from antdrive.runs.papers.experiments import PAPERS
from antdrive.worlds import Grid

SMALL = Query(Grid.from_free(np.eye(4, dtype=bool) | np.eye(4, k=1, dtype=bool)), (0, 0), (3, 3))


def facts(planner, query=SMALL, **settings):
    options = settings.pop("options", {})
    return arm_facts(
        Experiment(
            paper="p", map="m", planner=planner, query=for_every_seed(query), printed=None, options=options, **settings
        )
    )


@pytest.mark.parametrize("planner", ["as", "maco", "iaco", "pfaco", "aco-han", "ga-han", "mmas-dstar", "dstar"])
def test_every_option_that_an_experiment_may_set_is_shown(planner):
    plain = facts(planner)
    assert tuple(plain) == HEADS
    for option in dataclasses.fields(load_planner(planner)):
        if (planner, option.name) == ("maco", "deposit"):  # its bounds replace it
            continue
        if isinstance(option.default, bool):
            changed = facts(planner, options={option.name: not option.default})
        elif isinstance(option.default, float) and option.name != "q_min":
            changed = facts(planner, options={option.name: 0.5 * option.default + 0.25})
        else:
            continue
        assert changed != plain, option.name


def test_walks_deposits_and_budgets_are_those_of_the_planner():
    found = facts("as", options={"backtrack": True, "deposit": 1000.0, "initial": 2.0, "ants": 7}, work=3e6)
    assert "backtrack yes" in found["walk"]
    assert "deposit 1000" in found["deposit"]
    assert found["first pheromone"] == "mix 0, 2 on arcs"
    assert found["ants"] == "ants 7"
    assert found["iterations"] == "until the budget is spent"
    assert found["budget"] == "3,000,000 ant steps"
    assert found["step limit of an ant"] == "32"
    assert facts("as")["step limit of an ant"] == "100"
    assert facts("dstar")["counted as work"] == "cells expanded"


def test_moves_say_whether_corners_are_cut():
    assert moves_in_words([SMALL]) == "eight, none cuts a corner"
    assert moves_in_words([maps.cutting_corners(SMALL)]) == "eight, corners may be cut"
    shut = SMALL.grid.moves.copy()
    shut[0, 0] = 0
    shut[0, 1] &= ~np.uint8(1 << 4)
    closed = dataclasses.replace(SMALL, grid=dataclasses.replace(SMALL.grid, moves=shut))
    assert moves_in_words([closed]) == "eight, none cuts a corner; 1 closed"
    assert moves_in_words([closed, SMALL]) == "eight, none cuts a corner; 0 to 1 closed"


def test_corners_are_cut_between_all_free_neighbours_and_no_others():
    free = np.random.default_rng(3).random((9, 7)) < 0.6
    free[0, 0] = free[8, 6] = True
    moves = maps.cutting_corners(Query(Grid.from_free(free), (0, 0), (8, 6))).grid.moves
    for (row, col), bits in np.ndenumerate(moves):
        for bit, (down, right) in enumerate([(0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1)]):
            to = (row + down, col + right)
            inside = 0 <= to[0] < 9 and 0 <= to[1] < 7
            assert bool(bits >> bit & 1) == bool(free[row, col] and inside and free[to])


def test_an_arm_on_several_maps_shows_each_value_with_its_maps():
    one, other = facts("as", work=1e6), facts("as", work=2e6)
    found = merged({"a": one, "b": other, "c": one})
    assert found["budget"] == "1,000,000 ant steps (a, c); 2,000,000 ant steps (b)"
    assert found["walk"] == one["walk"]


@pytest.mark.parametrize("paper", PAPERS)
def test_arms_of_one_map_with_other_settings_have_other_facts(paper, monkeypatch):
    monkeypatch.setattr(arms, "MAPS", 1)
    every = [e for e in PAPERS[paper]() if e.map == PAPERS[paper]()[0].map]
    shown: dict[str, list[Experiment]] = {}
    for one in every:
        shown.setdefault(json.dumps(arm_facts(one)), []).append(one)
    for same in shown.values():
        settings = {(repr(e.made), json.dumps(dict(e.options)), e.movers, e.on_path, e.enter, e.work) for e in same}
        assert len(settings) == 1, [e.name for e in same]


def test_a_default_that_depends_on_the_map_is_shown_as_used():
    assert "beta 0.88" in facts("as")["further options"]
    assert facts("as")["planner"] == "AntSystem"
    assert facts("mmas-dstar", movers=2, on_path=True)["movers"] == "2, on the path"
