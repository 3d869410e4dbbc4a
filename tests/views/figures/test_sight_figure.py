"""The figure of what a robot without a map knew."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.sights import sightings
from antdrive.views.figures.canvas import panels
from antdrive.views.figures.run_figures import overview
from antdrive.views.figures.sight_figure import LISTED, sight_figure
from antdrive.views.recollection import Recollection
from antdrive.worlds import Disc
from tests.views.scanned import scanned


@pytest.fixture(scope="module")
def log(made_up_drive: Any) -> Rollout:
    return scanned(made_up_drive(size=(6.0, 4.0), obstacles=40), max_range=2.5)


def test_the_figure_shows_the_map_and_the_first_sights(log: Rollout, tmp_path: Path) -> None:
    figure = sight_figure(log, tmp_path / "sight.png", dpi=60)
    named = panels(figure)
    assert set(named) == {"map", "known ground", "first sights"}
    seen = Recollection(log)
    seen.advance(log.t[-1])
    _, explored = named["known ground"].lines[0].get_data()
    assert float(np.asarray(explored)[-1]) == pytest.approx(seen.explored)
    assert len(named["first sights"].get_yticklabels()) == LISTED
    listed = {label.get_text() for label in named["first sights"].get_yticklabels()}
    assert listed <= {text.get_text() for text in named["map"].texts}
    assert (tmp_path / "sight.png").stat().st_size < 400_000


def test_an_overview_calls_the_first_route_one_and_shows_all_of_it(log: Rollout) -> None:
    away = dataclasses.replace(log, route=np.array([[1.0, 2.0], [2.0, -1.5], [5.0, 2.0]]))
    for figure in (overview(away), sight_figure(away)):
        assert panels(figure)["map"].get_ylim()[0] < -1.5
    words = {text.get_text() for text in panels(overview(away))["map"].get_legend().get_texts()}
    assert {"first route, before the world was seen", "obstacle, on no map"} <= words


def test_nothing_is_passed_that_the_robot_only_came_nearest_to(log: Rollout) -> None:
    said = " ".join(text.get_text() for text in panels(sight_figure(log))["first sights"].texts)
    assert "first seen" in said
    assert "nearest" in said
    assert "passed" not in said


def test_the_words_beside_the_curves_lie_in_the_picture_and_on_nothing_else(log: Rollout) -> None:
    """Every rule limited the speed in turn."""
    count = len(log.record.limiters)
    busy = dataclasses.replace(log, limiter=(np.arange(len(log.t)) % count).astype(np.uint8))
    figure = overview(busy)
    figure.draw_without_rendering()
    named = panels(figure)
    for name in ("speed", "limiters"):
        box = named[name].get_legend().get_window_extent()
        assert box.x1 <= figure.bbox.x1
    title = named["speed"].title.get_window_extent()
    assert not title.overlaps(named["speed"].get_legend().get_window_extent())


def test_the_same_log_gives_the_same_file(log: Rollout, tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        sight_figure(log, tmp_path / name, dpi=40)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_log_without_scans_has_no_such_figure(made_up_drive: Any) -> None:
    with pytest.raises(ValueError, match="no scans"):
        sight_figure(made_up_drive())


def test_sightings_have_the_footprint_s_distances(log: Rollout) -> None:
    """One cylinder 2 m ahead of a robot that drives straight at it and stops 0.3 m before, by hand."""
    rows = len(log.t)
    x = np.linspace(1.0, 2.0, rows)
    pose = np.column_stack([x, np.full(rows, 2.0), np.zeros(rows)])
    robot = log.record.robot
    reach = robot.footprint.half_length + robot.footprint.rounding
    world = dataclasses.replace(log.record.world, obstacles=(Disc(2.0 + 0.3 + reach + 0.2, 2.0, 0.2),))
    task = dataclasses.replace(log.record.task, world=world)
    record = dataclasses.replace(log.record, task=task)
    straight = dataclasses.replace(log, pose=pose, record=record)
    (late,) = sightings(straight, np.array([log.t[rows // 2]]))
    assert (late.obstacle, late.touched, late.nearest_at) == (0, False, log.t[-1])
    assert late.nearest == pytest.approx(0.3)
    assert late.seen_from == pytest.approx(0.3 + 2.0 - x[rows // 2])
    (never,) = sightings(straight, np.array([math.inf]))
    assert math.isnan(never.seen_from)
    hit = dataclasses.replace(straight, contacts=np.array([[rows - 1, 0, -0.001, 1.0]]))
    assert sightings(hit, np.array([0.0]))[0].touched
