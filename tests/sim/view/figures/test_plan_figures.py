import dataclasses

import numpy as np
import pytest
from PIL import Image

from antdrive.planners import History, Query, load_planner
from antdrive.robots import load_robot
from antdrive.sim.log.certificate import Certificate
from antdrive.sim.view.figures import plan_figures as module
from antdrive.sim.view.figures.paper_figures import ants_figure, history_figure, sweep_figure
from antdrive.sim.view.figures.plan_figures import bars_figure, plan_figures
from antdrive.sim.view.figures.run_figures import certificate_figure, comparison_figure
from antdrive.sim.view.style import BAD, GOOD, planner_style
from antdrive.worlds import Disc, InputError, Task, World, rasterise


@pytest.fixture(scope="module")
def planned():
    world = World("three", (0.0, 0.0, 5.0, 4.0), (Disc(1.5, 2.0, 0.4), Disc(3.0, 1.2, 0.3), Disc(3.6, 3.0, 0.3)))
    task = Task(world, (0.5, 0.5, 0.0), (4.4, 3.5), cell=0.25)
    grid = rasterise(world, 0.25, 0.23)
    plan = load_planner("as", ants=10, iterations=8).plan(Query.between(grid, task), np.random.default_rng(0))
    return task, grid, plan


def pixels(path):
    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB")).astype(int)


def near(picture, colour, within=12):
    return int((np.abs(picture - np.array(colour)).max(axis=-1) < within).sum())


def history(start, n=20):
    best = start + np.exp(-np.arange(n) / 4)
    return History(best=best, iteration_best=best, iteration_mean=best + 1, arrived=np.full(n, 5))


def test_a_plan_has_the_papers_kinds_of_figures_in_pixels_and_vectors(planned, tmp_path):
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


def test_bars_rise_with_the_field_and_spare_blocked_cells(planned, tmp_path):
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


def test_each_planner_keeps_its_colour(tmp_path):
    for name in ("ants", "mmas"):
        picture = pixels(
            history_figure({name: [history(4), history(5)]}, tmp_path / f"{name}.png", dpi=80, optimum=3.9)
        )
        other = "mmas" if name == "ants" else "ants"
        assert near(picture, planner_style(name)[0]) > 100
        assert near(picture, planner_style(other)[0]) == 0


def test_ants_and_sweeps_are_drawn(tmp_path):
    lengths = {10: [41.0, 44.0], 100: [38.0, 39.0], 500: [36.0, 36.5]}
    picture = pixels(
        ants_figure(lengths, tmp_path / "a.png", planner="aco-han", optimum=30.0, printed={10: 45.0}, dpi=80)
    )
    assert near(picture, planner_style("aco-han")[0]) > 100
    table = {True: np.array([[30.0, 31.0], [32.0, np.nan]]), False: np.array([[33.0, 34.0], [35.0, 36.0]])}
    assert sweep_figure([0.2, 0.4], [0.1, 0.3], table, tmp_path / "s.pdf").stat().st_size > 3000


@pytest.mark.parametrize("certified", [True, False])
def test_a_certificate_is_drawn_with_its_verdict(made_up_drive, tmp_path, certified):
    found = Certificate(certified, 0 if certified else 3, 0.05, 0.04, () if certified else ("it touched",))
    picture = pixels(certificate_figure(made_up_drive(), found, tmp_path / "c.png", dpi=80))
    assert (near(picture, GOOD) > near(picture, BAD)) == certified


def test_several_planners_on_one_map(made_up_drive, tmp_path):
    one = made_up_drive()
    other = dataclasses.replace(one, pose=one.pose + [0, 0.2, 0])
    picture = pixels(comparison_figure({"astar": one, "mmas": other}, tmp_path / "c.png", dpi=80))
    assert near(picture, planner_style("astar")[0]) > 50
    assert near(picture, planner_style("mmas")[0]) > 100


def test_an_unknown_suffix_is_refused(tmp_path):
    with pytest.raises(InputError, match="choose one of"):
        history_figure({"as": [history(3)]}, tmp_path / "a.bmp")
