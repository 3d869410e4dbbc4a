"""`antdrive planners`."""

import json

from antdrive.planners import PLANNERS
from tests.cli.calling import Call


def test_every_planner_is_listed_with_its_options(antdrive: Call) -> None:
    code, out, err = antdrive("planners", "--json")
    found = json.loads(out)
    assert (code, err) == (0, "")
    assert list(found)[: len(PLANNERS)] == list(PLANNERS)
    assert found["aco-han-elite"]["options"]["elitism"] == 100
    code, out, _ = antdrive("planners")
    assert code == 0
    assert "aco-han" in out
    assert "elitism=100" in out
