"""`antdrive find-margin`."""

import json
import math
import re
from pathlib import Path

import pytest

from antdrive.cli.commands.find_margin import _print
from antdrive.sim import Scenario
from antdrive.sim.log.margin import MarginTrial
from tests.cli.calling import Call, Refused


def test_the_smallest_safe_margin_is_found(antdrive: Call, small: Path) -> None:
    code, out, err = antdrive("find-margin", small, "--seeds", "1", "--json", "-p", "astar", "--smoothing", "taut")
    facts = json.loads(out)
    assert (code, err) == (0, "")
    assert 0 <= facts["margin_m"] <= 0.03
    assert facts["trials"][0]["margin"] == pytest.approx(0.2)
    assert code == antdrive("find-margin", small, "--seeds", "1", "--start", "0.7,0.7,0.5", "-p", "astar")[0]
    words = antdrive("find-margin", small, "--seeds", "1", "-p", "astar", "--max-speed", "0.3")[1]
    assert re.search(r"smallest safe margin for turtlebot at up to 0.3 m/s: 0\.\d+ m, from 1 drive\n", words)


def test_the_answer_says_how_many_worlds_it_rests_on(capsys: pytest.CaptureFixture[str]) -> None:
    """A margin that closes nine worlds of ten is safe in one."""
    closing = MarginTrial(margin=0.2, drives=0, impassable=10, failed=None, left=math.inf)
    trials = [closing, MarginTrial(margin=0.1, drives=1, impassable=9, failed=None, left=0.02)]
    _print(Scenario.of("empty", "astar"), trials, 0.1)
    assert ": 0.100 m, from 1 drive; the margin closes 9 more worlds, which are left out\n" in capsys.readouterr().out
    _print(Scenario.of("empty", "astar"), trials[:1], None)
    assert capsys.readouterr().out.endswith(": none up to 0.2 m\n")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["find-margin"], "name a world, or a kind of random worlds"),
        (["find-margin", "empty", "--generate", "barn"], "name a world, or a kind of random worlds"),
        (["find-margin", "--generate", "desert"], "choose from forest, barn"),
        (["find-margin", "--generate", "barn", "--goal", "1,1"], "random worlds have their own starts and goals"),
        (["find-margin", "empty", "--task", "dock"], "no task 'dock'"),
        (["find-margin", "empty", "--goal", "99,1"], "--goal: "),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_input_is_one_line_and_exit_code_2(refused: Refused, words: list[str], says: str) -> None:
    assert says in refused(*words)
