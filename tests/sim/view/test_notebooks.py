"""The HTML that notebooks show for worlds, plans and rollouts."""

import re
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest

from antdrive.planners import PlanResult, PlanStatus, Query, load_planner
from antdrive.worlds import Disc, Task, World, load_task, rasterise

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
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
