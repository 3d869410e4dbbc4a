"""A scenario that is rebuilt from a log's record is the one that was driven."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from antdrive.base import InputError
from antdrive.planners import PLANNERS, GridPlanner, PlanResult, Query
from antdrive.robots import Avoidance, PurePursuit
from antdrive.runs.failures.rebuild import rebuilt
from antdrive.sim import DriveRecord, Perception, ReplanPolicy, Scenario, run
from antdrive.sim.log.record import ComponentRecord, settings_of
from antdrive.worlds import Disc
from tests.records import made_up_record


def record_of(scenario: Scenario) -> DriveRecord:
    rollout = run(scenario).rollout
    assert rollout is not None
    return DriveRecord.from_json(replace(rollout.record, digest="0").to_json())


@pytest.mark.parametrize("name", PLANNERS)
def test_every_planner_is_rebuilt_with_its_options(name: str) -> None:
    planner = replace(PLANNERS[name], **({"ants": 7} if hasattr(PLANNERS[name], "ants") else {}))
    options = {key: getattr(planner, key) for key in vars(planner)}
    record = made_up_record(planner=ComponentRecord(name=name, settings=settings_of(options)))
    scenario = rebuilt(replace(record, controller=ComponentRecord(name="PurePursuit", settings=vars(PurePursuit()))))
    assert scenario.planner == planner
    assert scenario.planner_name == name


@pytest.mark.parametrize(
    "changes",
    [
        {"noise": 1.0, "seed": 4, "unseen": (Disc(2.0, 2.6, 0.1, 0.5),), "margin": 0.01},
        {"smoothing": "none", "cell": 0.2, "controller": PurePursuit(lookahead_time=0.5), "physics_hz": 120},
    ],
    ids=["noise", "settings"],
)
def test_the_rebuilt_scenario_drives_the_same_bits(small_scenario: Scenario, changes: dict[str, Any]) -> None:
    original = replace(small_scenario, **changes)
    done, again = run(original).rollout, run(rebuilt(record_of(original))).rollout
    assert done is not None
    assert again is not None
    assert again.digest == done.digest


def test_what_the_robot_knows_of_movers_and_does_about_them_is_rebuilt() -> None:
    original = Scenario.of(
        "plaza-moving",
        "astar",
        time_limit=3.0,
        perception=Perception(kind="positions", range=3.0),
        avoidance=Avoidance(horizon=2.0),
        replanning=ReplanPolicy(patience=5.0),
    )
    found = rebuilt(record_of(original))
    keys = ("task", "perception", "avoidance", "replanning", "time_limit")
    assert {key: getattr(found, key) for key in keys} == {key: getattr(original, key) for key in keys}
    blind = replace(original, avoidance=None, replanning=None, perception=Perception())
    assert (rebuilt(record_of(blind)).avoidance, rebuilt(record_of(blind)).perception) == (None, Perception())


class Homemade(GridPlanner):
    """A planner that is not registered."""

    def _plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        return PLANNERS["astar"].plan(query, rng)


def test_an_unregistered_planner_is_one_line_that_names_it() -> None:
    record = made_up_record(planner=ComponentRecord(name="Homemade", settings={}))
    with pytest.raises(InputError, match=r"record\.planner\.name: 'Homemade' is not registered.*entry point"):
        rebuilt(record)
    controller = ComponentRecord(name="PurePursuit", settings=vars(PurePursuit()))
    assert rebuilt(replace(record, controller=controller), Homemade()).planner_name == "Homemade"


def test_the_name_of_a_class_is_found_too() -> None:
    controller = ComponentRecord(name="PurePursuit", settings=vars(PurePursuit()))
    record = made_up_record(planner=ComponentRecord(name="AStar", settings={}), controller=controller)
    assert rebuilt(record).planner_name == "astar"


@pytest.mark.parametrize(
    ("controller", "says"),
    [
        (ComponentRecord(name="Mine", settings={}), "record.controller.name: 'Mine' cannot be rebuilt"),
        (ComponentRecord(name="PurePursuit", settings={"speed": 1.0}), "record.controller.settings.speed: unknown"),
    ],
    ids=lambda value: value.name if isinstance(value, ComponentRecord) else "",
)
def test_another_controller_is_refused(controller: ComponentRecord, says: str) -> None:
    with pytest.raises(InputError, match=says):
        rebuilt(made_up_record(controller=controller))
