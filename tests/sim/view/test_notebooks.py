"""The HTML that notebooks show for worlds, plans and rollouts."""

import re
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest

from antdrive.planners import PlanResult, PlanStatus, Query, load_planner
from antdrive.sim import Run, Scenario, run
from antdrive.worlds import Disc, Grid, Task, World, load_task, rasterise

TASK = load_task("slalom")


def plan(name="as", **options):
    grid = rasterise(TASK.world, TASK.cell, 0.21)
    return load_planner(name, **options).plan(Query.between(grid, TASK), np.random.default_rng(0))


@pytest.mark.parametrize(
    "shown",
    [
        TASK,
        TASK.world,
        plan(ants=5, iterations=5),
        plan("tangent"),
        PlanResult(status=PlanStatus.NO_PATH, reason="a < b"),
    ],
    ids=["task", "world", "ants", "tangent", "no path"],
)
def test_html_is_well_formed_and_starts_with_a_picture(shown):
    html = shown._repr_html_()
    root = ElementTree.fromstring(html.replace("&nbsp;", " "))
    if not isinstance(shown, PlanResult) or shown.solved:
        assert root[0].tag.endswith("svg")


def test_every_obstacle_is_drawn_at_its_place():
    world = World("two", (0, 0, 4, 2), (Disc(1, 0.5, 0.25), Disc(3, 1.5, 0.125)))
    html = Task(world, (0.5, 1.5, 0), (3.5, 0.5))._repr_html_()
    assert '<circle cx="1" cy="0.5" r="0.25"' in html
    assert '<circle cx="3" cy="1.5" r="0.125"' in html
    assert "scale(1 -1)" in html, "y runs up"


def test_names_are_escaped():
    assert "<script>" not in World("<script>", (0, 0, 1, 1))._repr_html_()


def test_a_rollout_shows_its_route_and_its_driven_path(small_run):
    html = small_run.rollout._repr_html_()
    assert html.count("<polyline") == 2
    assert re.search(r"stopped at the goal", html)


def test_looking_at_a_world_imports_nothing_heavy():
    code = (
        "import sys; from antdrive.worlds import load_task; load_task('slalom')._repr_html_(); "
        "print([m for m in ('matplotlib', 'numba', 'antdrive.sim', 'pybullet') if m in sys.modules])"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"


def test_a_scenario_shows_its_world_and_its_settings():
    html = Scenario.of("slalom", "as", unseen=(Disc(1.0, 1.0, 0.125),), seed=7)._repr_html_()
    assert ElementTree.fromstring(html)[0].tag.endswith("svg")
    assert 'r="0.125"' in html, "what is unseen is drawn too"
    assert ">as<" in html
    assert ">7<" in html


def test_a_run_shows_its_drive_and_how_it_ended(small_run: Run):
    html = small_run._repr_html_()
    assert ElementTree.fromstring(html)[0].tag.endswith("svg")
    assert html.count("<polyline") == 2
    assert "stopped at the goal" in html


def test_a_run_without_a_drive_shows_why():
    html = run(Scenario.of("no-path", "astar"))._repr_html_()
    assert "<polyline" not in html
    assert "reason" in html


def test_a_grid_shows_its_blocked_cells():
    grid = Grid.from_free([[True, False, False], [True, True, True]])
    html = grid._repr_html_()
    assert ElementTree.fromstring(html)[0].tag.endswith("svg")
    assert 'd="M1 0h2v1h-2z"' in html, "one run of two cells in the lower row"
    assert "66.7 %" in html


def test_a_large_grid_is_drawn_coarser():
    free = np.ones((1000, 500), dtype=bool)
    free[0, 499] = False
    html = Grid.from_free(free)._repr_html_()
    assert 'd="M99 0h1v1h-1z"' in html
    assert "1000 × 500" in html
