import dataclasses
import importlib
import inspect
import re
import subprocess
import sys
import threading
from pathlib import Path

import matplotlib
import numpy as np
import pytest

from antdrive.base import InputError
from antdrive.planners import History, Query
from antdrive.planners.graph.search import AStar
from antdrive.robots import Footprint, RobotSpec
from antdrive.sim.log.certificate import Certificate, certify
from antdrive.sim.log.outcome import Outcome
from antdrive.views import figures as figures_package
from antdrive.views.figures.canvas import panels, save_figure
from antdrive.views.figures.paper_figures import ants_figure, history_figure, sweep_figure
from antdrive.views.figures.plan_figures import bars_figure, contours_figure, plan_figure
from antdrive.views.figures.robot_figure import robot_figure
from antdrive.views.figures.run_figures import certificate_figure, comparison_figure, overview
from antdrive.views.figures.then_and_now import then_and_now
from antdrive.views.style import BAD, GOOD, planner_style
from antdrive.worlds import Disc, Keyframed, Task, Wandering, World, rasterise

ROBOT = RobotSpec(
    name="disc", footprint=Footprint.disc(0.18), height=0.2, mass=3.0, wheel_radius=0.04, track=0.25, max_speed=1.0,
    max_yaw_rate=3.0, max_acceleration=1.0, max_yaw_acceleration=8.0, max_lateral_acceleration=1.0,
    max_wheel_speed=25.0, wheel_torque=1.5,
)  # fmt: skip


@pytest.fixture(scope="module")
def planned():
    world = World("three", (0.0, 0.0, 5.0, 4.0), (Disc(1.5, 2.0, 0.4), Disc(3.0, 1.2, 0.3), Disc(3.6, 3.0, 0.3)))
    task = Task(world, (0.5, 0.5, 0.0), (4.4, 3.5), cell=0.25)
    grid = rasterise(world, 0.25, 0.23)
    return task, grid, AStar().plan(Query.between(grid, task), np.random.default_rng(0))


def pixels(figure):
    """What was written, as the figure's canvas still holds it."""
    return np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(int)


def near(picture, colour, within=24):
    return int((np.abs(picture - np.array(colour)).max(axis=-1) < within).sum())


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_the_same_run_gives_the_same_file(made_up_drive, tmp_path, suffix):
    drive = made_up_drive()
    files = [tmp_path / f"{name}{suffix}" for name in ("one", "other", "saved")]
    for path in files[:2]:
        overview(drive, path, dpi=60)
    save_figure(overview(drive, dpi=60), files[2])
    one, other, saved = (path.read_bytes() for path in files)
    assert one == other == saved
    assert one[:5] in (b"\x89PNG\r", b"%PDF-", b"<?xml")


def test_an_overview_shows_obstacles_trail_and_contact(made_up_drive, tmp_path):
    drive = made_up_drive(collide=True)
    full = pixels(overview(drive, tmp_path / "full.png", dpi=80))
    world = drive.record.task.world
    world = dataclasses.replace(world, obstacles=world.obstacles[-1:])
    record = dataclasses.replace(drive.record, task=dataclasses.replace(drive.record.task, world=world))
    bare = dataclasses.replace(drive, contacts=drive.contacts * [1, 0, 1, 1], record=record)
    few = pixels(overview(bare, tmp_path / "few.png", dpi=80))
    assert near(full, (121, 136, 160)) > 3 * near(few, (121, 136, 160))
    stuck = dataclasses.replace(drive.record, outcome=Outcome.STUCK)
    clean = dataclasses.replace(drive, contacts=np.empty((0, 4)), record=stuck)
    untouched = pixels(overview(clean, tmp_path / "clean.png", dpi=80))
    assert near(full, (204, 32, 42)) > near(untouched, (204, 32, 42)) + 50


def test_unseen_obstacles_have_their_own_colour(made_up_drive, tmp_path):
    drive = made_up_drive()
    task = drive.record.task
    known = dataclasses.replace(task, world=dataclasses.replace(task.world, obstacles=task.world.obstacles[2:]))
    record = dataclasses.replace(drive.record, task=known, unseen=task.world.obstacles[:2])
    marked = dataclasses.replace(drive, record=record)
    assert near(pixels(overview(marked, tmp_path / "marked.png", dpi=80)), (196, 74, 138)) > 100


def test_movers_and_their_tracks_are_drawn(made_up_drive, planned, tmp_path):
    amber = (228, 177, 65)
    pictures = [pixels(overview(made_up_drive(movers=n), tmp_path / f"{n}.png", dpi=80)) for n in (0, 2)]
    assert near(pictures[1], amber) > near(pictures[0], amber) + 100
    task, grid, plan = planned
    mover = Keyframed(radius=0.2, keyframes=((0.0, 0.5, 3.0), (5.0, 2.5, 3.5)))
    moving = dataclasses.replace(
        task,
        world=dataclasses.replace(task.world, movers=(mover, Wandering(radius=0.1, cell=0.5, period=1.0))),
    )
    picture = pixels(plan_figure(moving, grid, plan, ROBOT, tmp_path / "moving.png", dpi=80))
    plain = pixels(plan_figure(task, grid, plan, ROBOT, tmp_path / "plain.png", dpi=80))
    assert near(picture, amber) > near(plain, amber) + 100


def test_the_legend_says_when_movers_are_where_they_are_drawn(made_up_drive, planned):
    drive = made_up_drive(movers=1)
    task, grid, plan = planned
    mover = Keyframed(radius=0.2, keyframes=((0.0, 0.5, 3.0), (5.0, 2.5, 3.5)))
    moving = dataclasses.replace(task, world=dataclasses.replace(task.world, movers=(mover,)))
    for figure, at in ((overview(drive), drive.t[-1]), (plan_figure(moving, grid, plan, ROBOT), 0.0)):
        named = [text.get_text() for text in panels(figure)["map"].get_legend().get_texts()]
        assert f"moving obstacle, at {at:.1f} s" in named


def test_a_rectangular_robot_and_planned_cells_are_drawn(made_up_drive, tmp_path):
    drive = made_up_drive(square=True)
    overview(drive, tmp_path / "square.png", cells=np.array([(0.5, 1.5), (0.75, 1.5)]), dpi=60)
    assert (tmp_path / "square.png").exists()


def test_a_run_that_never_drove_has_an_overview(made_up_drive, tmp_path):
    drive = made_up_drive(outcome="no_path")
    empty = dataclasses.replace(
        drive, t=drive.t[:0], pose=drive.pose[:0], twist=drive.twist[:0], command=drive.command[:0],
        clearance=drive.clearance[:0], limiter=drive.limiter[:0], route=np.empty((0, 2)),
    )  # fmt: skip
    overview(empty, tmp_path / "empty.png", dpi=60)
    assert (tmp_path / "empty.png").stat().st_size > 5000


def test_an_unknown_suffix_is_refused(made_up_drive, planned, tmp_path):
    with pytest.raises(InputError, match=r"choose one of .png, .pdf, .svg"):
        overview(made_up_drive(), tmp_path / "a.bmp")
    with pytest.raises(InputError, match="choose one of"):
        plan_figure(*planned, ROBOT, tmp_path / "a")
    assert not list(tmp_path.iterdir())


def test_figures_work_in_a_thread_without_pyplot_and_leave_settings_alone(made_up_drive, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)  # importing it fails
    before = matplotlib.rcParams.copy()
    thread = threading.Thread(target=overview, args=(made_up_drive(), tmp_path / "a.png"), kwargs={"dpi": 50})
    thread.start()
    thread.join()
    assert (tmp_path / "a.png").exists()
    assert matplotlib.rcParams.copy() == before


@pytest.mark.parametrize("certified", [True, False])
def test_a_certificate_is_drawn_with_its_verdict(made_up_drive, tmp_path, certified):
    found = Certificate(certified, 0 if certified else 3, 0.05, 0.04, () if certified else ("it touched",))
    picture = pixels(certificate_figure(made_up_drive(), found, tmp_path / "c.png", dpi=80))
    assert (near(picture, GOOD, 12) > near(picture, BAD, 12)) == certified


def test_several_planners_on_one_map(made_up_drive, tmp_path):
    one = made_up_drive()
    other = dataclasses.replace(one, pose=one.pose + [0, 0.2, 0])
    picture = pixels(comparison_figure({"astar": one, "mmas": other}, tmp_path / "c.png", dpi=80))
    assert near(picture, planner_style("astar")[0], 12) > 50
    assert near(picture, planner_style("mmas")[0], 12) > 100


def test_every_figure_gives_its_axes_back_to_be_labelled_and_saved(made_up_drive, planned, tmp_path):
    drive, (task, grid, plan) = made_up_drive(), planned
    history = History(*(np.full(5, 3.0) for _ in range(3)), arrived=np.full(5, 2))
    learnt = dataclasses.replace(plan, field=grid.free * np.arange(grid.shape[1], dtype=float), history=history)
    table = {True: np.ones((1, 2)), False: np.full((1, 2), 2.0)}
    figures = [
        (overview(drive), ["map", "clearance", "speed", "limiters"]),
        (certificate_figure(drive, certify(drive)), ["map", "distance", "readings"]),
        (comparison_figure({"astar": drive, "ants": drive}), ["map"]),
        (then_and_now(drive, drive), ["map", "clearance", "distance"]),
        (plan_figure(task, grid, learnt, ROBOT), ["map", "history"]),
        (bars_figure(grid, learnt.field), ["field"]),
        (contours_figure(task, grid, learnt, ROBOT), ["map"]),
        (history_figure({"as": [history]}), ["history"]),
        (robot_figure(ROBOT), ["map"]),
        (ants_figure({10: [3.0]}, planner="aco-han", optimum=2.0), ["lengths"]),
        (sweep_figure([0.1], [0.2, 0.3], table), ["with elitism", "without elitism"]),
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


def test_no_figure_function_is_left_out(made_up_drive):
    """Every public function of the figures that takes a path returns a figure, and writes none without a path."""
    folder = Path(figures_package.__path__[0])
    found = {}
    for path in sorted(folder.glob("[a-z]*.py")):
        module = importlib.import_module(f"antdrive.views.figures.{path.stem}")
        for name, function in inspect.getmembers(module, inspect.isfunction):
            if function.__module__ == module.__name__ and not name.startswith("_") and path.stem != "canvas":
                found[name] = inspect.signature(function)
    with_path = {name: of for name, of in found.items() if "path" in of.parameters}
    assert len(with_path) == 14
    assert all(of.parameters["path"].default is None and of.return_annotation == "Figure" for of in with_path.values())
    assert all(name.startswith("draw_") for name in found.keys() - with_path.keys() - {"plan_figures"})


def test_the_example_of_the_page_runs(tmp_path):
    page = Path(__file__).parents[4] / "docs" / "how-to" / "figures.md"
    (code,) = re.findall(r"```python\n(.*?)```", page.read_text(), flags=re.DOTALL)
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "slalom.pdf").stat().st_size > 10_000
