import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from antdrive.planners import History, PlanResult, PlanStatus, Query, load_planner
from antdrive.robots import load_robot
from antdrive.views.figures import plan_figures as module
from antdrive.views.figures.canvas import panels
from antdrive.views.figures.plan_figures import bars_figure, plan_figure, plan_figures
from antdrive.worlds import Disc, Task, World, rasterise


@pytest.fixture(scope="module")
def planned():
    world = World("three", (0.0, 0.0, 5.0, 4.0), (Disc(1.5, 2.0, 0.4), Disc(3.0, 1.2, 0.3), Disc(3.6, 3.0, 0.3)))
    task = Task(world, (0.5, 0.5, 0.0), (4.4, 3.5), cell=0.25)
    grid = rasterise(world, 0.25, 0.23)
    plan = load_planner("as", ants=10, iterations=8).plan(Query.between(grid, task), np.random.default_rng(0))
    return task, grid, plan


@pytest.fixture(scope="module")
def searched(planned):
    """A plan without history and field."""
    task, grid, _ = planned
    return load_planner("astar").plan(Query.between(grid, task), np.random.default_rng(0))


def pixels(figure):
    """What was written, from the file, or as the figure's canvas still holds it."""
    if isinstance(figure, Path):
        with Image.open(figure) as picture:
            return np.asarray(picture.convert("RGB")).astype(int)
    return np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(int)


def near(picture, colour, within=12):
    return int((np.abs(picture - np.array(colour)).max(axis=-1) < within).sum())


def test_a_plan_has_all_kinds_of_figures_in_pixels_and_vectors(planned, tmp_path):
    made = plan_figures(*planned, load_robot("turtlebot"), tmp_path, name="as", suffixes=(".png", ".pdf"))
    kinds = {"plan", "tour", "history", "bars", "contours"}
    assert set(made) == kinds | {f"{kind} pdf" for kind in kinds}
    assert all(path.stat().st_size > 3000 for path in made.values())
    assert near(pixels(made["tour"]), (255, 122, 14)) > 300, "the tour"
    assert near(pixels(made["tour"]), (121, 136, 160)) > 1000, "obstacles"


def test_a_search_has_neither_history_nor_field(planned, tmp_path):
    task, grid, _ = planned
    plan = load_planner("astar").plan(Query.between(grid, task), np.random.default_rng(0))
    made = plan_figures(task, grid, plan, load_robot("turtlebot"), tmp_path, name="astar", suffixes=(".png",))
    assert set(made) == {"plan"}


def test_bars_rise_with_the_field(planned, tmp_path):
    _, grid, _ = planned
    field = np.zeros(grid.shape)
    flat = pixels(bars_figure(grid, field, tmp_path / "flat.png", dpi=60))
    field[2, 2] = 1
    peak = pixels(bars_figure(grid, field, tmp_path / "peak.png", dpi=60))
    assert (np.abs(flat - peak).max(axis=-1) > 40).sum() > 50


def test_a_large_field_is_drawn_with_fewer_bars_that_keep_its_peaks(tmp_path, monkeypatch):
    grid = rasterise(World("wide", (0, 0, 20, 20)), 0.1, 0.1)
    heights = []
    from mpl_toolkits.mplot3d import Axes3D

    monkeypatch.setattr(Axes3D, "bar3d", lambda self, x, y, z, dx, dy, dz, **_: heights.append(dz))
    field = np.zeros(grid.shape)
    field[:, 100] = 3.0
    bars_figure(grid, field, tmp_path / "a.png", dpi=50)
    assert len(heights[0]) <= module.MAX_BARS**2
    assert heights[0].max() == pytest.approx(3.0)


def test_a_plan_is_drawn_on_the_map(planned, searched, tmp_path):
    task, grid, _ = planned
    picture = pixels(plan_figure(task, grid, searched, load_robot("turtlebot"), tmp_path / "plan.png", dpi=80))
    assert near(picture, (255, 122, 14), 24) > 300


def test_an_iterative_planner_gets_its_history_and_field(planned, searched, tmp_path):
    task, grid, _ = planned
    best = searched.cost * (1 + np.exp(-np.arange(30) / 6))
    mean = best + 1
    mean[:4] = math.inf
    history = History(best=best, iteration_best=best + 0.2, iteration_mean=mean, arrived=np.full(30, 9))
    learnt = dataclasses.replace(searched, history=history, field=np.random.default_rng(0).random(grid.shape))
    robot = load_robot("turtlebot")
    picture = pixels(plan_figure(task, grid, learnt, robot, tmp_path / "learnt.png", dpi=80))
    assert near(picture, (18, 63, 122), 40) > 500, "the field's dark end"
    plain = pixels(plan_figure(task, grid, searched, robot, tmp_path / "plain.png", dpi=80))
    assert picture.shape[1] > 1.3 * plain.shape[1]


def test_a_failed_plan_gives_the_reason(planned, tmp_path):
    task, grid, _ = planned
    failed = PlanResult(status=PlanStatus.NO_PATH, reason="walled in")
    figure = plan_figure(task, grid, failed, load_robot("turtlebot"), tmp_path / "failed.png", dpi=80)
    assert near(pixels(figure), (204, 32, 42), 24) > 40


def test_a_long_reason_covers_nothing_of_the_map(planned):
    task, grid, _ = planned
    reason = "the widest disc that passes has a radius of 0.4 m, " * 8
    figure = plan_figure(task, grid, PlanResult(status=PlanStatus.NO_PATH, reason=reason), load_robot("turtlebot"))
    figure.draw_without_rendering()
    map_, words = panels(figure)["map"], figure._supxlabel
    assert words.get_text().replace("\n", " ") == reason.strip()
    assert words.get_window_extent().y1 < map_.get_tightbbox().y0
    assert words.get_window_extent().x1 < figure.bbox.x1


def test_the_first_plan_of_a_robot_without_a_map_is_said_to_be_one_and_lies_in_the_picture(planned):
    """It leads through a cylinder that was not seen, and out of the world."""
    task, _, _ = planned
    wider = rasterise(World("seen", (-4.0, -4.0, 9.0, 8.0)), 0.25, 0.23)
    cells = np.array([wider.cell_at(*task.start[:2]), wider.cell_at(1.5, -3.0), wider.cell_at(*task.goal)])
    plan = PlanResult(status=PlanStatus.SOLVED, cells=cells)
    blind, known = (plan_figure(task, wider, plan, load_robot("turtlebot"), mapped=mapped) for mapped in (False, True))
    (x, y), axes = wider.xy(cells).T, panels(blind)["map"]
    assert axes.get_xlim()[0] < x.min() < x.max() < axes.get_xlim()[1]
    assert axes.get_ylim()[0] < y.min() < y.max() < axes.get_ylim()[1]
    assert blind._supxlabel.get_text().replace("\n", " ") == module.FIRST
    assert known._supxlabel is None
    words = [{text.get_text() for text in panels(one)["map"].get_legend().get_texts()} for one in (blind, known)]
    assert "obstacle, on no map" in words[0]
    assert "obstacle" in words[1]
