"""Registry entries are complete: every step of CONTRIBUTING's checklists that could be missed has a test."""

import re
from pathlib import Path

import pytest

from antdrive import Outcome, Scenario, list_robots, load_robot, run
from antdrive.cli.commands.worlds import import_world
from antdrive.robots import LIMITERS
from antdrive.robots.control import _kernels_pursuit as rules
from antdrive.sim.log.metrics import METRICS
from antdrive.views.colours import LIMITER_COLOURS, OUTCOME_LABELS
from antdrive.worlds import IMPORTS

ROOT = Path(__file__).parent.parent
GUIDES = {page.stem: page.read_text() for page in (ROOT / "docs" / "how-to").glob("*.md")}
CHECKLISTS = (ROOT / "docs" / "explanation" / "extending.md").read_text()


@pytest.mark.parametrize("name", list_robots())
def test_a_robot_of_the_catalogue_has_a_source_and_noise_and_drives(name):
    robot = load_robot(name)
    assert robot.source, "the file says after which specification it is made"
    assert robot.noise.nonzero, "the file documents the robot's noise"
    assert f"| `{name}` |" in (ROOT / "docs" / "reference" / "robots.md").read_text()
    assert run(Scenario.of("empty", "astar", robot)).succeeded


@pytest.mark.parametrize("name", METRICS)
def test_a_metric_has_a_unit_and_a_definition(name):
    metric = METRICS[name]
    assert metric.unit
    assert metric.definition.endswith(".")


@pytest.mark.parametrize("name", IMPORTS)
def test_a_world_format_has_a_module_tests_and_a_place_in_the_help(name):
    assert (ROOT / "worlds" / "formats" / f"{name}.py").exists()
    assert (ROOT / "tests" / "worlds" / "formats" / f"test_{name}.py").exists()
    text = f"{import_world.__doc__} {GUIDES['worlds']}".lower().replace("_", "")
    assert name.replace("_", "") in text


def test_a_limiter_has_a_colour_and_an_index_in_the_kernels():
    assert len(set(LIMITERS)) == len(LIMITERS)
    assert len(LIMITER_COLOURS) >= len(LIMITERS)
    constants = {name: value for name, value in vars(rules).items() if name.isupper() and isinstance(value, int)}
    for index, name in enumerate(LIMITERS[:-1]):  # the last, "avoid", is set by the avoidance and not by a kernel
        assert constants.get(name.upper().replace(" ", "_")) == index


@pytest.mark.parametrize("outcome", Outcome)
def test_an_outcome_has_a_verdict(outcome):
    assert outcome in OUTCOME_LABELS
    assert not outcome.value.endswith("."), "the sentence continues in messages"


def test_the_checklists_name_files_that_exist():
    named = re.findall(r"`((?:worlds|planners|robots|sim|runs|views|cli|tests|docs)/[\w/.-]*\w)/?`", CHECKLISTS)
    assert len(named) > 10
    assert [path for path in named if not (ROOT / path).exists()] == []
