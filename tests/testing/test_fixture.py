"""The fixture `drive`, the assertions, and the strategies."""

import pickle
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

import antdrive.testing
from antdrive import Scenario, load_robot, rasterise, run
from antdrive.base.errors import FieldError, InputError
from antdrive.planners import AStar, load_planner
from antdrive.runs.suites import Baseline
from antdrive.testing.fixture import DriveFailure, DriveFixture, assert_collision_free, assert_reached_goal
from antdrive.testing.strategies import tasks, worlds
from antdrive.worlds import point_clearance
from tests.worlds.oracles import passable


@pytest.fixture
def drive(tmp_path):
    return DriveFixture(file=tmp_path / "test_mine.py", test="test_it[a/b]", address="test_mine.py::test_it[a/b]")


def fresh(drive, update=""):
    return DriveFixture(file=drive._file, test=drive._test, address=drive._address, update=update)


def test_a_drive_is_compared_with_a_baseline_beside_the_tests_file(drive, small_task, tmp_path):
    with pytest.raises(DriveFailure, match=r"is missing; accept this drive with antdrive accept ") as caught:
        drive(small_task, "astar")
    assert caught.value.result.outcome == "succeeded"
    fresh(drive, "all")(small_task, "astar")
    (written,) = (tmp_path / "baselines" / "test_mine").iterdir()
    assert re.fullmatch(r"test_it-a-b-[0-9a-f]{8}\.json", written.name)
    assert fresh(drive)(small_task, "astar").succeeded
    slower = replace(load_robot("turtlebot"), max_speed=0.4)
    with pytest.raises(DriveFailure, match=r"duration_s: .* longer, tolerance"):
        fresh(drive)(small_task, "astar", slower)


class Raises(AStar):
    """A planner that raises an error."""

    def plan(self, query, rng):
        raise IndexError("pop from empty list")


def test_a_planner_that_raises_fails_its_test_with_the_command_that_repeats_it(drive, small_run):
    Baseline.of(small_run, "test_it[a/b]").save(drive.baseline_path("test_it[a/b]"))
    with pytest.raises(DriveFailure) as caught:
        drive("empty", Raises())
    fault, changed, repeat = str(caught.value).splitlines()
    assert fault.startswith("planner Raises raised IndexError: pop from empty list")
    assert (changed, repeat) == ("changed since the baseline: world", "repeat: pytest 'test_mine.py::test_it[a/b]'")


def test_each_drive_of_a_test_has_a_name(drive, small_task):
    drive(small_task, "astar", baseline=False)
    drive(small_task, "astar", name="second", baseline=False, expect={"duration_s": "< 60"})
    with pytest.raises(FieldError, match="give each drive its own name"):
        drive(small_task, "astar", name="second", baseline=False)


@pytest.mark.parametrize("beside", [{"planner": "aco-han"}, {"robot": "jackal"}, {"seed": 1}, {"nonsense": 3}])
def test_a_scenario_takes_no_settings_beside_it(drive, small_task, beside):
    (key,) = beside
    with pytest.raises(FieldError, match=f"{key}: is part of the scenario; change it with"):
        drive(Scenario.of(small_task, "astar"), baseline=False, **beside)


@pytest.mark.parametrize("demand", [{"tolerance": {"duration_s": 1}}, {"trajectory": "exact"}])
def test_what_needs_a_baseline_is_refused_without_one(drive, small_task, demand):
    with pytest.raises(FieldError, match=f"{next(iter(demand))}: needs a baseline"):
        drive(small_task, "astar", baseline=False, **demand)


def test_a_failed_drive_reaches_other_processes(drive, small_task):
    with pytest.raises(DriveFailure) as caught:
        drive(small_task, "astar", baseline=False, expect={"duration_s": "< 1"})
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.result) == (str(caught.value), caught.value.result)


def test_files_lie_beside_the_tests_file(drive, tmp_path):
    (tmp_path / "w.yaml").write_text(
        "{schema: 1, bounds: [0, 0, 4, 2], start: [0.6, 1, 0], goal: [3.4, 1], cell: 0.2}\n"
    )
    assert drive.run("w.yaml", "astar").succeeded
    with pytest.raises(InputError, match="no such file"):
        drive.run("v.yaml", "astar")


def test_a_collision_free_drive_is_one_that_is_certified_with_that_clearance(small_run, collided_run):
    bound = small_run.certificate.bound
    assert_collision_free(small_run, clearance=bound)
    assert_reached_goal(small_run)
    with pytest.raises(AssertionError, match=r"is proved, expected .* m; nearest to obstacles\[0\] at \(2, 1.5\)"):
        assert_collision_free(small_run, clearance=bound + 1e-6)
    with pytest.raises(
        AssertionError, match=r"collided: touched unseen\[0\] at \(.*\) with radius 0.1; the robot was at"
    ):
        assert_collision_free(collided_run)
    with pytest.raises(AssertionError, match="collided: touched unseen"):
        assert_collision_free(collided_run.rollout)
    forged = replace(small_run.rollout, pose=small_run.rollout.pose + [0.5, 0, 0])
    with pytest.raises(AssertionError, match="not certified collision-free: "):
        assert_collision_free(forged)


def test_a_robot_that_did_not_drive_proved_nothing(small_task):
    nowhere = run(Scenario.of(small_task, "astar", margin=1.2))
    for assertion in (assert_collision_free, assert_reached_goal):
        with pytest.raises(AssertionError, match="no_path"):
            assertion(nowhere)


@given(worlds(obstacles=5, size=(2.0, 3.0), radius=(0.1, 0.2)))
@settings(max_examples=25)
def test_worlds_keep_to_their_sizes(world):
    assert all(2 <= side <= 3 for side in world.bounds[2:])
    assert len(world.obstacles) <= 5
    assert all(0.1 <= disc.radius <= 0.2 and 0 <= disc.x <= world.bounds[2] for disc in world.obstacles)


@given(tasks("jackal", clearance=0.15, obstacles=12))
@settings(max_examples=25)
def test_tasks_have_free_ends_and_a_path(task):
    reach = load_robot("jackal").radius + 0.15
    assert (point_clearance(task.world, [task.start[:2], task.goal]) > reach).all()
    assert passable(task, rasterise(task.world, task.cell, reach))


@pytest.mark.slow
def test_tasks_shrink_to_the_obstacle_that_matters():
    import hypothesis

    def blocked(task):
        """Whether a cylinder stands on the straight line between start and goal."""
        return any(_on_the_way(task, disc) for disc in task.world.obstacles)

    found = hypothesis.find(
        tasks(obstacles=2, solvable=False), blocked, settings=settings(max_examples=50, database=None)
    )
    assert len(found.world.obstacles) == 1


def _on_the_way(task, disc):
    start, goal = np.array(task.start[:2]), np.array(task.goal)
    along = (goal - start) / np.hypot(*(goal - start))
    offset = np.array([disc.x, disc.y]) - start
    aside = abs(float(along[0] * offset[1] - along[1] * offset[0]))
    return 0 < float(offset @ along) < float(np.hypot(*(goal - start))) and aside < disc.radius


def test_without_hypothesis_the_message_names_what_to_install(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "hypothesis", None)
    with pytest.raises(InputError, match="hypothesis is not installed; pip install hypothesis"):
        worlds()


def test_the_door_lists_what_it_offers():
    for name in antdrive.testing.__all__:
        assert getattr(antdrive.testing, name).__doc__
    assert antdrive.worlds.__name__ == "antdrive.worlds", "the strategy of that name hides no package"


def test_a_robot_may_be_given_as_an_object(turtlebot, drive):
    assert drive.run("empty", load_planner("astar"), turtlebot).succeeded


@given(worlds(obstacles=2, radius=(0.004, 0.1)))
@settings(max_examples=30)
def test_radii_keep_to_their_range_in_whole_centimetres(world):
    assert all(0.01 <= disc.radius <= 0.1 for disc in world.obstacles)
