"""Figures of plans, papers, drives, occupancy maps and comparisons with a baseline."""

import math
import re
import sys
import threading
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import matplotlib
import numpy as np
import pytest
from PIL import Image

from antdrive.base import InputError
from antdrive.planners import History, PlanResult, PlanStatus, Query, load_planner
from antdrive.robots import load_robot, outline_of
from antdrive.sim.log.certificate import Certificate, certify
from antdrive.sim.log.outcome import Outcome
from antdrive.views.colours import BAD, GOOD, MOVER, hexed, label_styles
from antdrive.views.figures import plan_figures as module
from antdrive.views.figures.canvas import panels, save_figure
from antdrive.views.figures.paper_figures import (
    ConvergenceCurve,
    convergence_figure,
    maps_figure,
)
from antdrive.views.figures.plan_figures import plan_figure
from antdrive.views.figures.robot_figure import robot_figure
from antdrive.views.figures.run_figures import certificate_figure, comparison_figure, overview
from antdrive.worlds import Disc, Grid, Keyframed, Task, Wandering, World, rasterise
from antdrive.worlds.coverage import coverage
from tests.made_up_drive import scanned, undriven
from tests.records import changed

ROBOT = load_robot("turtlebot")
DRAWN_MOVER = tuple(round(0.85 * channel + 0.15 * 255) for channel in MOVER)


@pytest.fixture(scope="module")
def planned():
    world = World("three", (0.0, 0.0, 5.0, 4.0), (Disc(1.5, 2.0, 0.4), Disc(3.0, 1.2, 0.3), Disc(3.6, 3.0, 0.3)))
    task = Task(world, (0.5, 0.5, 0.0), (4.4, 3.5), cell=0.25)
    grid = rasterise(world, 0.25, 0.23)
    plan = load_planner("as", ants=10, iterations=8).plan(Query.between(grid, task), np.random.default_rng(0))
    return task, grid, plan


@pytest.fixture(scope="module")
def plain(planned, searched, tmp_path_factory):
    """The pixels of the figure of a plan without history, field and movers."""
    task, grid, _ = planned
    return pixels(plan_figure(task, grid, searched, ROBOT, tmp_path_factory.mktemp("plan") / "plain.png", dpi=80))


@pytest.fixture(scope="module")
def searched(planned):
    """A plan without history and field."""
    task, grid, _ = planned
    return load_planner("astar").plan(Query.between(grid, task), np.random.default_rng(0))


def pixels(figure):
    """Return the words of a figure, from its file or its canvas."""
    if isinstance(figure, Path):
        with Image.open(figure) as picture:
            return np.asarray(picture.convert("RGB")).astype(int)
    return np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(int)


def named_on_the_map(figure):
    return [text.get_text() for text in panels(figure)["map"].get_legend().get_texts()]


def near(picture, colour, within=12):
    return int((np.abs(picture - np.array(colour)).max(axis=-1) < within).sum())


def test_an_iterative_planner_gets_its_history_and_field(planned, searched, plain, tmp_path):
    task, grid, _ = planned
    best = searched.cost * (1 + np.exp(-np.arange(30) / 6))
    mean = best + 1
    mean[:4] = math.inf
    history = History(best=best, iteration_best=best + 0.2, iteration_mean=mean, arrived=np.full(30, 9))
    learnt = replace(searched, history=history, field=np.random.default_rng(0).random(grid.shape))
    picture = pixels(plan_figure(task, grid, learnt, ROBOT, tmp_path / "learnt.png", dpi=80))
    assert near(picture, (18, 63, 122), 40) > 500, "the field's dark end"
    assert picture.shape[1] > 1.3 * plain.shape[1]


@pytest.mark.parametrize("tall", [False, True])
def test_a_map_shows_what_a_robot_reaches_by_each_shape_and_the_doors_that_it_passes(searched, tall):
    """Three rooms in a row; the disc of 0.7 m passes no door, the rectangle of 0.6 m passes the first."""
    gaps = {4.0: (2.0, 2.9), 8.0: (2.0, 2.4)}
    posts = [(x, y / 10) for x, (low, high) in gaps.items() for y in range(51) if not low < y / 10 < high]
    size = (12.0, 5.0)
    posts, size = ([(y, x) for x, y in posts], size[::-1]) if tall else (posts, size)
    world = World("rooms", (0.0, 0.0, *size), tuple(Disc(x, y, 0.04) for x, y in posts))
    start = (2.45, 2.0, math.pi / 2) if tall else (2.0, 2.45, 0.0)
    robot = load_robot("warehouse")
    outline = outline_of(robot.footprint, 0.03)
    grids = [rasterise(world, 0.1, robot.radius + 0.03), rasterise(world, 0.05, robot.radius + 0.03, outline)]
    covered = coverage(world, grids, start[:2])
    assert [[door.passed for door in each.doors] for each in covered] == [[False, False], [False, True]]
    figure = plan_figure(Task(world, start, (1.0, 1.0)), grids[0], searched, robot, covered=covered)
    figure.draw_without_rendering()
    chart = panels(figure)["map"]
    words = [text.get_text() for text in chart.get_legend().get_texts()]
    shares = [re.search(rf"^{kind}: (\d+)% of the floor", "\n".join(words), re.MULTILINE) for kind in SHARES]
    assert sum(int(share[1]) for share in shares) == pytest.approx(100, abs=1), "all of the floor"
    assert {"door passed only by its footprint", "door not passed"} <= set(words)
    assert "door passed by its disc" not in words
    assert not any("no-go" in word for word in words)
    assert {text.get_text() for text in chart.texts} == {"0.82 m", "0.32 m"}
    assert chart.get_legend().get_window_extent().x1 < figure.bbox.x1
    alone = plan_figure(Task(world, start, (1.0, 1.0)), grids[0], searched, robot, covered=covered[:1])
    assert "not reached" in [text.get_text() for text in panels(alone)["map"].get_legend().get_texts()][1]


SHARES = "reached by its disc", "reached only by its footprint", "not reached"


def test_a_long_reason_covers_nothing_of_the_map(planned):
    task, grid, _ = planned
    reason = "the widest disc that passes has a radius of 0.4 m, " * 8
    figure = plan_figure(task, grid, PlanResult(status=PlanStatus.NO_PATH, reason=reason), ROBOT)
    figure.draw_without_rendering()
    map_, words = panels(figure)["map"], figure._supxlabel
    assert words.get_text().replace("\n", " ") == reason.strip()
    assert words.get_window_extent().y1 < map_.get_tightbbox().y0
    assert words.get_window_extent().x1 < figure.bbox.x1


def test_the_first_plan_of_a_robot_without_a_map_is_said_to_be_one_and_lies_in_the_picture(planned):
    """It leads through an undetected cylinder and out of the world."""
    task, _, _ = planned
    wider = rasterise(World("seen", (-4.0, -4.0, 9.0, 8.0)), 0.25, 0.23)
    cells = np.array([wider.cell_at(*task.start[:2]), wider.cell_at(1.5, -3.0), wider.cell_at(*task.goal)])
    plan = PlanResult(status=PlanStatus.SOLVED, cells=cells)
    blind, known = (plan_figure(task, wider, plan, ROBOT, mapped=mapped) for mapped in (False, True))
    (x, y), axes = wider.xy(cells).T, panels(blind)["map"]
    assert axes.get_xlim()[0] < x.min() < x.max() < axes.get_xlim()[1]
    assert axes.get_ylim()[0] < y.min() < y.max() < axes.get_ylim()[1]
    assert blind._supxlabel.get_text().replace("\n", " ") == module.FIRST
    assert known._supxlabel is None
    words = [{text.get_text() for text in panels(one)["map"].get_legend().get_texts()} for one in (blind, known)]
    assert "obstacle, not on a map" in words[0]
    assert "obstacle" in words[1]


#: Three runs on the maps 0, 1 and 0; the last finds its first path in the third of four iterations.
RUNS = [np.array([9.0, 8.0, 7.0, 6.0]), np.array([12.0, 9.0, 5.0, 5.0]), np.array([np.inf, np.inf, 8.0, 7.0])]


STYLES = dict(zip(("as", "as, again"), label_styles(["as", "as, again"], ["as", "as"]), strict=True))


def curve(name, spent=None, printed=None, x="iteration"):
    return ConvergenceCurve(
        name=name,
        style=STYLES[name],
        best=RUNS,
        maps=np.array([0, 1, 0]),
        spent=spent,
        optimum=4.0,
        printed=printed,
        x=x,
    )


def line(figure, name):
    (found,) = (drawn for drawn in figure.axes[0].lines if drawn.get_label() == name)
    return found.get_xdata(), found.get_ydata()


def test_the_median_of_all_runs_is_drawn_within_its_interval():
    figure = convergence_figure({"a map": [curve("as", printed=4.5), curve("as, again")]})
    x, y = line(figure, "as")
    assert x.tolist() == [1, 2, 3, 4]
    assert y.tolist() == [12, 9, 7, 6]  # no path counts as longer than any
    (first, second) = figure.axes[0].collections
    assert {color for band in (first, second) for color in map(tuple, band.get_facecolor()[:, :3])}.__len__() == 2
    corners = first.get_paths()[0].vertices
    assert corners[:, 1].min() <= 5
    assert line(figure, "paper")[1] == [4.5]
    low, high = figure.axes[0].get_ylim()
    assert low < 4.0
    assert high > 12.0


def test_ant_steps_take_the_place_of_iterations():
    figure = convergence_figure({"a map": [curve("as", np.array([4.0, 8.0, 4.0]), x="million ant steps")]})
    assert figure.axes[0].get_xlabel() == "million ant steps"
    x, y = line(figure, "as")
    assert x[-1] == pytest.approx(4.0)
    assert y[-1] == 7.0  # at four million steps the second run is half done, at 9


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_the_same_run_gives_the_same_file(made_up_drive, tmp_path, suffix):
    drive = {"mmas": made_up_drive()}
    files = [tmp_path / f"{name}{suffix}" for name in ("drawn", "saved")]
    comparison_figure(drive, files[0], dpi=60)
    save_figure(comparison_figure(drive, dpi=60), files[1])
    one, other = (path.read_bytes() for path in files)
    assert one == other
    assert one[:5] in (b"\x89PNG\r", b"%PDF-", b"<?xml")


def test_an_overview_shows_all_obstacles_movers_and_the_contact(made_up_drive, tmp_path):
    grey, red, unseen = (121, 136, 160), (204, 32, 42), (196, 74, 138)
    drive = made_up_drive(collide=True, movers=2)
    obstacles = drive.record.task.world.obstacles
    record = replace(changed(drive.record, "task.world", obstacles=obstacles[2:]), unseen=obstacles[:2])
    drawn = overview(replace(drive, record=record), tmp_path / "full.png", dpi=80)
    assert "contact" in named_on_the_map(drawn)
    full = pixels(drawn)
    record = changed(drive.record, "task.world", obstacles=obstacles[-1:], movers=())
    record = replace(record, outcome=Outcome.STUCK)
    bare = replace(drive, contacts=np.empty((0, 4)), movers=drive.movers[:, :0], record=record)
    few = pixels(overview(bare, tmp_path / "few.png", dpi=80))
    assert near(full, grey) > 3 * near(few, grey)
    assert near(full, red) > near(few, red) + 50
    assert near(full, DRAWN_MOVER) > near(few, DRAWN_MOVER) + 100
    assert near(full, unseen) > near(few, unseen) + 100


def test_a_plan_shows_movers_and_their_tracks(planned, searched, plain, tmp_path):
    task, grid, _ = planned
    mover = Keyframed(radius=0.2, keyframes=((0.0, 0.5, 3.0), (5.0, 2.5, 3.5)))
    moving = changed(task, "world", movers=(mover, Wandering(radius=0.1, cell=0.5, period=1.0)))
    picture = pixels(plan_figure(moving, grid, searched, ROBOT, tmp_path / "moving.png", dpi=80))
    assert near(picture, DRAWN_MOVER) > near(plain, DRAWN_MOVER) + 100


def test_the_legend_says_when_movers_are_where_they_are_drawn(made_up_drive, planned, searched):
    drive = made_up_drive(movers=1)
    (task, grid, _), plan = planned, searched
    mover = Keyframed(radius=0.2, keyframes=((0.0, 0.5, 3.0), (5.0, 2.5, 3.5)))
    moving = changed(task, "world", movers=(mover,))
    closest = drive.t[drive.clearance.argmin()]
    assert closest < drive.t[-1]
    for figure, at in ((overview(drive), closest), (plan_figure(moving, grid, plan, ROBOT), 0.0)):
        named = [text.get_text() for text in panels(figure)["map"].get_legend().get_texts()]
        assert f"mover at {at:.1f} s" in named


def test_an_undriven_run_s_overview_works_in_a_thread_without_pyplot_and_leaves_settings_alone(
    made_up_drive, tmp_path, monkeypatch
):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)  # importing it fails
    before = matplotlib.rcParams.copy()
    path = tmp_path / "a.png"
    thread = threading.Thread(target=overview, args=(undriven(made_up_drive()), path), kwargs={"dpi": 60})
    thread.start()
    thread.join()
    assert path.stat().st_size > 5000
    assert matplotlib.rcParams.copy() == before


@pytest.mark.parametrize("certified", [True, False])
def test_a_certificate_s_figure_has_clearance_bound_and_problems(made_up_drive, certified):
    drive = made_up_drive()
    bound, problems = (0.04, ()) if certified else (math.nan, ("it touched",))
    figure = certificate_figure(drive, Certificate(certified, 0 if certified else 3, 0.05, bound, problems))
    axes, (legend,) = panels(figure)["clearance"], figure.legends
    curve = max((line.get_ydata() for line in axes.lines), key=len)
    assert np.array_equal(curve, drive.clearance)
    assert figure._suptitle.get_color() == hexed(GOOD if certified else BAD)
    words = [text.get_text() for text in legend.get_texts()]
    assert words == (["proved: at least 0.0400 m"] if certified else ["it touched"])


def test_a_field_that_is_constant_but_for_rounding_is_not_drawn(planned, searched):
    task, grid, _ = planned
    noise = 0.0731 + 1e-12 * np.random.default_rng(0).random(grid.shape)
    for field, bars in ((noise, []), (grid.free * np.arange(grid.shape[1], dtype=float), ["pheromone"])):
        figure = plan_figure(task, grid, replace(searched, field=field, work_unit="ant steps"), ROBOT)
        assert [axes.get_ylabel() for axes in figure.axes if axes.get_label() == "<colorbar>"] == bars


def test_several_planners_on_one_map(made_up_drive, tmp_path):
    one = made_up_drive()
    other = replace(one, pose=one.pose + [0, 0.2, 0])
    figure = comparison_figure({"astar": one, "mmas": other}, tmp_path / "c.png", dpi=80)
    assert panels(figure)["map"].get_legend().get_title().get_text() == "planner: planned → driven, time"
    picture = pixels(figure)
    for style in label_styles(["astar", "mmas"], [one.record.planner.name] * 2):
        assert near(picture, style.colour, 12) > 100


def test_every_figure_gives_its_axes_back_to_be_labelled_and_saved(made_up_drive, planned, searched, tmp_path):
    drive, (task, grid, _), plan = made_up_drive(), planned, searched
    history = History(*(np.full(5, 3.0) for _ in range(3)), arrived=np.full(5, 2))
    learnt = replace(plan, field=grid.free * np.arange(grid.shape[1], dtype=float), history=history)
    figures = [
        (overview(drive), ["map", "clearance", "speed", "limiters"]),
        (certificate_figure(drive, certify(drive)), ["clearance"]),
        (comparison_figure({"astar": drive, "ants": drive}), ["map"]),
        (plan_figure(task, grid, learnt, ROBOT), ["map", "history"]),
        (robot_figure(ROBOT), ["map"]),
    ]
    for figure, names in figures:
        assert list(panels(figure)) == names
    assert not list(tmp_path.iterdir()), "without a path nothing is written"
    drawn, path = figures[0][0], tmp_path / "mine.svg"
    panels(drawn)["map"].set_title("a title of my own")
    assert save_figure(drawn, path) == path
    assert "a title of my own" in path.read_text()
    with pytest.raises(InputError, match="choose one of"):
        save_figure(drawn, tmp_path / "a.bmp")


@pytest.fixture(scope="module")
def log(made_up_drive):
    return scanned(made_up_drive(size=(6.0, 4.0), obstacles=40), max_range=2.5)


def test_an_overview_calls_the_first_route_one_and_shows_all_of_it(log):
    away = replace(log, route=np.array([[1.0, 2.0], [2.0, -1.5], [5.0, 2.0]]))
    chart = panels(overview(away))["map"]
    assert chart.get_ylim()[0] < -1.5
    words = {text.get_text() for text in chart.get_legend().get_texts()}
    assert {"initial route", "obstacle, not on a map"} <= words


def test_the_words_beside_the_curves_lie_in_the_picture_and_on_nothing_else(log):
    """Every rule limits the speed in turn."""
    count = len(log.record.limiters)
    busy = replace(log, limiter=(np.arange(len(log.t)) % count).astype(np.uint8))
    figure = overview(busy)
    figure.draw_without_rendering()
    named = panels(figure)
    for name in ("speed", "limiters"):
        box = named[name].get_legend().get_window_extent()
        assert box.x1 <= figure.bbox.x1
    title = named["speed"].title.get_window_extent()
    assert not title.overlaps(named["speed"].get_legend().get_window_extent())


def test_a_planner_has_one_colour_in_all_figures_of_papers():
    plan = SimpleNamespace(solved=True, line_length=3.0, cells=np.array([[0, 0], [1, 1]]), waypoints=None)
    query = Query(Grid.from_free(np.ones((3, 3), dtype=bool)), (0, 0), (1, 1))
    two_maps = {"one": (query, {"as": plan, "as, again": plan}), "two": (query, {"as, again": plan})}
    painted = maps_figure(two_maps, styles=STYLES)
    drawn = [line for axes in painted.axes for line in axes.lines]
    drawn += convergence_figure({"a map": [curve("as, again"), curve("as")]}).axes[0].lines
    for name in STYLES:
        colours = {line.get_color() for line in drawn if line.get_label().partition(":")[0] == name}
        assert colours == {STYLES[name].light}
