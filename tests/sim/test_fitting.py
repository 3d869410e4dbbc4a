"""`fit`: whether a robot crosses a world, and with which margin."""

from dataclasses import replace

from antdrive import Disc, Scenario, fit, load_task
from antdrive.planners import PlanStatus


def test_a_robot_that_fits_has_a_plan_and_reaches_floor():
    found = fit("gate")
    assert found.passable
    assert found.plan.solved
    assert 0.5 < found.covered["disc"].share <= 1


def test_the_margin_is_that_of_drives_with_this_noise():
    assert 0.03 < fit("gate", noise=5.0).margin == Scenario.of("gate", "astar", noise=5.0).planned_margin
    assert fit("gate", margin=0.1).margin == 0.1


def test_a_start_that_is_not_free_is_the_reason():
    task = load_task("gate")
    x, y, _ = task.start
    world = replace(task.world, obstacles=(*task.world.obstacles, Disc(x + 0.15, y, 0.1)))
    found = fit(replace(task, world=world))
    assert (found.passable, found.plan.status) == (False, PlanStatus.NO_PATH)
    assert found.reason == found.overlaps["turtlebot"] != ""
