"""`antdrive find-margin`."""

import json
import math
import re

import pytest

from antdrive.runs.margins.choice import MarginResult, MarginSearch
from antdrive.sim import Scenario


@pytest.mark.slow
def test_the_smallest_safe_margin_is_found(antdrive, small):
    code, out, err = antdrive("find-margin", small, "--seeds", "1", "--json", "-p", "astar", "--smoothing", "taut")
    facts = json.loads(out)
    assert (code, err) == (0, "")
    assert 0 <= facts["margin_m"] <= 0.03
    assert facts["trials"][0]["margin"] == pytest.approx(0.2)
    assert code == antdrive("find-margin", small, "--seeds", "1", "--start", "0.7,0.7,0.5", "-p", "astar")[0]
    words = antdrive("find-margin", small, "--seeds", "1", "-p", "astar", "--max-speed", "0.3")[1]
    assert re.search(r"smallest safe margin for turtlebot at up to 0.3 m/s: 0\.\d+ m, from 1 drive\n", words)


def test_the_answer_says_how_many_worlds_it_rests_on():
    """A margin that closes nine worlds of ten is safe in one."""
    closing = MarginResult(margin=0.2, drives=0, impassable=10, failed=None, left=math.inf)
    trials = [closing, MarginResult(margin=0.1, drives=1, impassable=9, failed=None, left=0.02)]
    *_, said = MarginSearch(Scenario.of("empty", "astar"), trials).lines()
    assert said.endswith(": 0.100 m, from 1 drive; 9 more worlds have no path with this margin")
    *_, said = MarginSearch(Scenario.of("empty", "astar"), trials[:1]).lines()
    assert said.endswith(": none up to 0.2 m")
