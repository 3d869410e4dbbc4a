"""HTML of worlds, plans and rollouts in notebooks, and planners' colours."""

import base64
import io
import pydoc
import re
import subprocess
import sys
import types
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from antdrive.base.progress import progress_bar
from antdrive.planners import PLANNERS, PlanResult, PlanStatus, Query, load_planner
from antdrive.sim import Scenario, certify, run
from antdrive.sim.log.outcome import Outcome
from antdrive.views.colours import OUTCOME_LABELS, PLANNER_STYLES
from antdrive.views.figures.run_figures import overview
from antdrive.views.film.film_options import FilmInfo
from antdrive.worlds import Cruising, Disc, Keyframed, Task, Trajectories, Wandering, World, load_task, rasterise
from tests.records import changed

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


def test_representations_fit_one_line(small_run, collided_run):
    for done in (small_run, collided_run):
        for shown in (done, done.scenario, done.plan, done.rollout):
            assert len(repr(shown)) < 200
            assert "\n" not in repr(shown)
    assert "certified collision-free" in repr(small_run)
    assert "touched an obstacle, " in repr(collided_run)
    assert "a < b" in repr(PlanResult(status=PlanStatus.NO_PATH, reason="a < b"))


def test_figures_show_as_png_without_pyplot(small_run):
    picture = Image.open(io.BytesIO(overview(small_run.rollout)._repr_png_()))
    assert picture.format == "PNG"
    assert 600 < picture.width < 1400


def film_info(path):
    return FilmInfo(path, frames=30, size=(320, 180), fps=30.0, camera="oblique", wall_s=0.1)


@pytest.mark.parametrize(("name", "tag"), [("a & b.mp4", "video"), ("film.gif", "img"), ("film.webp", "img")])
def test_small_films_are_embedded_and_large_ones_linked(tmp_path, monkeypatch, name, tag):
    info = film_info(tmp_path / name)
    assert "the file is gone" in info._repr_html_()
    info.path.write_bytes(b"film")
    html = info._repr_html_()
    assert f"<{tag}" in html
    assert base64.b64encode(b"film").decode() in html
    monkeypatch.setattr(sys.modules[FilmInfo.__module__], "MOST_EMBEDDED", 3)
    html = info._repr_html_()
    assert "base64" not in html
    assert ElementTree.fromstring(html).find("a").text == str(info.path)


def test_a_bar_shows_in_notebooks_and_on_request(small_scenario, small_run, capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "100")
    run(small_scenario, planned=(small_run.grid, small_run.plan), progress=True)
    assert "astar in small" in capsys.readouterr().err
    for wanted, shown in ((None, False), (True, True), (False, False)):
        with progress_bar(wanted, "campaign") as update:
            update(3, 3)
        assert ("3 of 3 runs" in capsys.readouterr().err) == shown
    shown, space = [], types.SimpleNamespace
    monkeypatch.setitem(sys.modules, "IPython", space(get_ipython=lambda: space(kernel=None)))
    cell = space(HTML=str, display=lambda text, display_id: space(update=shown.append))
    monkeypatch.setitem(sys.modules, "IPython.display", cell)
    with progress_bar(None, "campaign"):
        assert shown[0].startswith("<pre>campaign [")
    assert (shown[-1], capsys.readouterr().err) == ("", "")


def moving():
    to_and_fro = Keyframed(radius=0.25, keyframes=((0.0, 1.0, 1.0), (4.0, 3.0, 1.0)), loop="teleport")
    straight = Cruising(radius=0.2, position=(2.0, 2.0), velocity=(0.3, 0.1))
    walker = Wandering(radius=0.15, cell=0.5, period=0.8)
    world = World("moving", (0.0, 0.0, 6.0, 4.0), movers=(to_and_fro, straight, walker))
    return Task(world, (5.0, 3.5, 0.0), (5.0, 0.5))


def drawn(html):
    """Return the discs of movers (M, 3) and the points of their dotted paths."""
    root = ElementTree.fromstring(html)
    discs = [[float(e.get(k)) for k in ("cx", "cy", "r")] for e in root.iter() if e.get("class") == "mover"]
    lines = [
        [[float(v) for v in point.split(",")] for point in e.get("points").split()]
        for e in root.iter() if e.tag.endswith("polyline") and e.get("stroke") == "#a8329e"
    ]  # fmt: skip
    return np.array(discs), [np.array(line) for line in lines]


def test_movers_are_drawn_where_they_begin_with_their_ways():
    task = moving()
    scenario = Scenario.of(task, "astar", seed=5)
    discs, ways = drawn(scenario._repr_html_())
    begin = Trajectories.of(task.world, task.start[:2], 5).positions(0.0)[0]
    np.testing.assert_allclose(discs, np.column_stack([begin, [0.25, 0.2, 0.15]]), rtol=1e-3)
    assert np.ptp(ways[0][:, 0]) == pytest.approx(2.0, abs=0.05), "up to the jump, and not back"
    assert len(ways) == 3
    for shown in (task, task.world):
        discs, ways = drawn(shown._repr_html_())
        assert len(discs) == len(ways) == 2, "where the walker goes depends on the seed"


def test_a_run_and_its_log_show_movers(small_run):
    assert len(drawn(small_run._repr_html_())[0]) == 0
    record = small_run.rollout.record
    world = replace(record.task.world, movers=moving().world.movers[:2])
    log = replace(small_run.rollout, record=changed(record, "task", world=world))
    assert len(drawn(log._repr_html_())[0]) == 2


def test_a_certificate_shows_its_verdict_and_its_problems(small_run):
    assert "certified collision-free" in small_run.certificate._repr_html_()
    other = certify(replace(small_run.rollout, pose=small_run.rollout.pose + 0.01))
    html = other._repr_html_()
    assert "NOT certified" in html
    assert "problem 1" in html
    ElementTree.fromstring(html)


def test_the_help_of_a_scenario_begins_with_what_it_is():
    text = pydoc.render_doc(Scenario, renderer=pydoc.plaintext)
    assert text.index("Complete input of a run") < 1200  # Python 3.13 puts each parameter on its own line


@pytest.mark.parametrize("name", PLANNERS)
def test_every_planner_has_a_style(name):
    assert name in PLANNER_STYLES


def test_every_outcome_has_a_label():
    assert set(OUTCOME_LABELS) == set(Outcome)
