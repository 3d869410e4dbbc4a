"""Facts of a run: the same from its log alone, and noticed by `verify` where a result claims others."""

import json

import pytest

from antdrive.base.files import as_json
from antdrive.sim import Scenario
from antdrive.sim.facts import FACTS, IN_RESULT, facts_of
from antdrive.sim.verifying import COMPARED, false_claims


def test_what_a_log_proves_is_the_same_without_the_run(small_run):
    proved = [name for name, fact in FACTS.items() if fact.proof != "written"]
    assert as_json(facts_of(small_run, proved)) == as_json(facts_of(small_run.logged, proved))


def test_every_fact_of_a_result_is_compared_but_long_ones():
    assert set(IN_RESULT) - set(COMPARED) == {"digest", "sights"}, "another digest is another log"


def test_settings_without_a_key_of_their_own_are_among_the_settings_of_a_result():
    exact = Scenario.of("forest", "astar", "jackal", footprint="exact")
    assert exact.as_dict()["settings"] == {"footprint": "exact"}


@pytest.mark.parametrize("name", [name for name in COMPARED if name not in ("time_limit_s", "frame")])
def test_a_claim_that_the_log_contradicts_is_named(name, small_run):
    result = json.loads(as_json(small_run.as_dict()))
    assert list(false_claims(result, small_run.logged)) == []
    within, key = ("settings", "map") if name == "settings" else (FACTS[name].within, name)
    (result[within] if within else result)[key] = "another"
    said = f"result.json: {f'{within}.' if within else ''}{key}: differs from the log, which says "
    assert [one.startswith(said) for one in false_claims(result, small_run.logged)] == [True]
